"""The misfit of structures as built to first order: against structures that are built, and its
derivatives."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.problem.terms import LoadedDesign
from shellform.reliability.built_misfit import PAIRS, PAIRS_OF_DEVIATIONS, BuiltMisfit, built_misfit
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop
from shellform.structure.elements.state import State
from tests.problems import assert_gradient_as_re_solved, solved

CAUSES = {
    "cable_length": 3e-4,
    "cable_stiffness": 0.1,
    "supports": 3e-4,
    "marks": 3e-4,
    "rod_stiffness": 0.05,
    "rod_bow": 1e-3,
    "connectors": 0.2,
    "load_each": 0.1,
    "load_all": 0.05,
    "load_uneven": 0.05,
    "shape": 2e-4,
}
ALL = sf.Tolerances(**CAUSES)


def term_of(shell, design, load, tolerances, **more):
    return built_misfit(shell, design, sf.LoadCase("wet", load), tolerances, seed=7, **more)


@pytest.mark.parametrize("cause", [*CAUSES, "all"])
def test_its_gradient_agrees_with_re_solved_equilibria(dome, loaded, cause):
    design, state, load = loaded
    term = term_of(dome, design, load, ALL if cause == "all" else ALL.only(cause), pairs=2)
    assert_gradient_as_re_solved(dome, design, state, load, term)


@pytest.mark.parametrize("cause", [*CAUSES, "all"])
def test_with_deviations_added_its_gradient_agrees_with_re_solved_equilibria(dome, loaded, cause):
    design, state, load = loaded
    off = ALL if cause == "all" else ALL.only(cause)
    term = term_of(dome, design, load, off, pairs=2, deviations=2.0)
    assert_gradient_as_re_solved(dome, design, state, load, term)


def test_deviations_are_those_of_its_structures_misfits(dome, loaded):
    """Each structure's own misfit is the value of the term of it alone."""
    design, state, load = loaded
    at = LoadedDesign(dome, design, solved(dome, design, state, load), load)
    term = term_of(dome, design, load, ALL, pairs=3, deviations=1.5)
    each = [replace(term, errors=(one,), deviations=0.0).measure(at).value[0] for one in term.errors]
    assert np.std(each) > 0.1 * np.mean(each)
    assert term.measure(at).value[0] == pytest.approx(np.mean(each) + 1.5 * np.std(each), rel=1e-9)
    alone = replace(term, errors=term.errors[:1])
    assert alone.measure(at).value[0] == pytest.approx(each[0], rel=1e-9), "one has no deviation"
    assert alone.measure(at).whole().value[0] == pytest.approx(each[0], rel=1e-9)


@pytest.mark.parametrize(("deviations", "pairs"), [(0.0, PAIRS), (0.5, PAIRS_OF_DEVIATIONS)])
def test_a_deviation_takes_more_structures_than_a_mean(dome, loaded, deviations, pairs):
    design, _, load = loaded
    term = term_of(dome, design, load, sf.Tolerances(load_all=0.1), deviations=deviations)
    assert (len(term.errors), term.deviations) == (2 * pairs, deviations)


def test_its_value_is_the_mean_misfit_of_structures_that_are_built(dome, loaded):
    """With a tenth of the errors: what is left is of third order, and the order of the first step is tested
    with first_order.py."""
    design, state, load = loaded
    small = sf.Tolerances(**{name: 0.1 * size for name, size in CAUSES.items()})
    term = term_of(dome, design, load, small, pairs=4)
    workshop = Workshop(replace(perfect(dome, design, load), imperfections=term.imperfections))
    at = LoadedDesign(dome, design, solved(dome, design, state, load), load)
    target, none = dome.target.positions, sf.Misfit("wet").measure(at).value[0]
    built = [((workshop.load(each).state.positions - target) ** 2).sum() for each in term.errors]
    assert np.mean(built) > 1.01 * none
    assert term.measure(at).value[0] - none == pytest.approx(np.mean(built) - none, rel=0.05)


def test_opposite_errors_leave_its_distances_from_the_target_without_a_mean(dome, loaded):
    design, _, load = loaded
    term = term_of(dome, design, load, sf.Tolerances(supports=1e-4, load_each=0.1), pairs=3)
    assert len(term.errors) == 6
    mean = sum(each.supports for each in term.errors)
    assert np.abs(mean).max() < 1e-18
    assert np.abs(sum(each.load - 1.0 for each in term.errors)).max() < 1e-14


def test_without_errors_it_is_the_misfit(dome, loaded):
    design, state, load = loaded
    term = term_of(dome, design, load, sf.Tolerances(), pairs=1)
    at = LoadedDesign(dome, design, solved(dome, design, state, load), load)
    assert term.measure(at).value[0] == pytest.approx(sf.Misfit("wet").measure(at).value[0], rel=1e-9)


def test_what_it_cannot_do_is_refused(dome, loaded):
    design, state, load = loaded
    with pytest.raises(InputError, match=r"built_misfit\.pairs"):
        term_of(dome, design, load, ALL, pairs=0)
    term = term_of(dome, design, load, ALL, pairs=1)
    with pytest.raises(InputError, match=r"built_misfit\.errors"):
        BuiltMisfit("wet", (), term.imperfections)
    off = State(0.9 * state.positions, state.quaternions)
    with pytest.raises(NotConverged, match="isn't a stable equilibrium"):
        term.measure(LoadedDesign(dome, design, off, load))
