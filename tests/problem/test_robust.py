"""Mean and deviation of the misfit under scatter, against re-solved equilibria."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.scatter import groups_of
from shellform.problem import robust
from shellform.problem.robust import RobustMisfit, _Line, sample, spread
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from tests.problems import assert_gradient_as_re_solved, solved

CAUSES = {
    "cable_stiffness": 0.1,
    "cable_stiffness_all": 0.05,
    "cable_length": 3e-4,
    "supports": 3e-4,
    "connectors": 0.2,
    "connectors_all": 0.1,
    "load_each": 0.1,
    "load_all": 0.05,
    "load_uneven": 0.05,
}
ALL = sf.Tolerances(**CAUSES)


@pytest.fixture(scope="module")
def shell(dome):
    """A small one: each test solves it many times."""
    return dome


@pytest.fixture(scope="module")
def loaded(shell):
    """The initial design under a fraction of the paper's load."""
    load, design = shell.point_load(3.0, every=2), shell.design()
    assembly = assemble(shell.network(design))
    unloaded = find_equilibrium(assembly, shell.target, np.zeros_like(load)).state
    return design, find_equilibrium(assembly, unloaded, load, on_branch=True).state, load


def small(tolerances, factor):
    return sf.Tolerances(**{name: factor * value for name, value in vars(tolerances).items()})


@pytest.mark.parametrize("cause", [*CAUSES, "all"])
def test_the_derivative_of_the_robust_misfit_is_that_of_re_solved_equilibria(shell, loaded, cause):
    term = RobustMisfit("wet", ALL if cause == "all" else ALL.only(cause), 2.0)
    assert_gradient_as_re_solved(shell, *loaded, term)


def misfit(shell, line, z):
    return float(((line.drawn(z, (1.0,)).positions - shell.target.positions) ** 2).sum())


@pytest.mark.parametrize("cause", [*CAUSES, "all"])
def test_the_first_derivative_of_the_misfit_by_each_cause_is_that_of_re_solved_equilibria(
    shell, loaded, cause
):
    design, state, load = loaded
    tolerances = small(ALL if cause == "all" else ALL.only(cause), 0.02)
    line = _Line(shell, design, solved(shell, design, state, load), load, tolerances)
    z = np.random.default_rng(0).normal(size=line.motion.shape[1])
    slope = 2.0 * float((line.away * (line.motion @ z).reshape(-1, 6)[:, :3]).sum())
    assert 0.5 * (misfit(shell, line, z) - misfit(shell, line, -z)) == pytest.approx(slope, rel=5e-3)


@pytest.mark.parametrize(
    "cause", ["cable_stiffness_all", "connectors_all", "load_all", "load_uneven", "cable_length", "supports"]
)
def test_the_mean_s_second_order_terms_are_the_misfit_s_second_derivatives(shell, loaded, cause, monkeypatch):
    design, state, load = loaded
    if cause == "cable_length":  # a few cables only
        design, load = replace(design, present=np.arange(len(design.present)) % 97 == 0), 0.3 * load
        state = sf.follow(shell, design, {"part": load})["part"].equilibrium.state
    if cause == "supports":  # two coordinates only
        monkeypatch.setattr(
            robust,
            "groups_of",
            lambda *given: [replace(each, dofs=each.dofs[30:32]) for each in groups_of(*given)],
        )
    tolerances = small(ALL.only(cause), 0.1)
    state = solved(shell, design, state, load)
    line, told = _Line(shell, design, state, load, tolerances), spread(shell, design, state, load, tolerances)
    total = 0.0
    for each in np.eye(line.motion.shape[1]):
        total += 0.5 * (misfit(shell, line, each) + misfit(shell, line, -each) - 2.0 * told.nominal)
    assert told.mean - told.nominal == pytest.approx(total, rel=5e-3)
    assert abs(told.curvature) > 0.01 * told.linear


def test_the_predicted_scatter_is_that_of_a_quick_sample(shell, loaded):
    design, state, load = loaded
    tolerances = small(ALL, 0.25)
    told = spread(shell, design, state, load, tolerances)
    drawn = sample(shell, design, state, load, tolerances, count=40, seed=1)
    assert drawn.lost == 0
    error = drawn.misfits.std() / np.sqrt(40)
    assert abs(drawn.misfits.mean() - told.mean) < 4.0 * error
    assert drawn.misfits.std() == pytest.approx(
        told.deviation, rel=2.0 / np.sqrt(2 * 40)
    )  # two standard errors
    assert sum(each[0] for each in told.causes.values()) == pytest.approx(1.0)
    assert sum(each[1] for each in told.causes.values()) == pytest.approx(1.0)
    assert (told.node_deviation**2).sum() == pytest.approx(told.linear)
    assert "comes from" in told.sentences()[1]
    again = sample(shell, design, state, load, tolerances, count=2, seed=1)
    np.testing.assert_array_equal(again.misfits, drawn.misfits[:2])


@pytest.mark.slow
def test_the_predicted_scatter_is_that_of_four_hundred_samples(shell, loaded):
    design, state, load = loaded
    told = spread(shell, design, state, load, small(ALL, 0.25))
    drawn = sample(shell, design, state, load, small(ALL, 0.25), count=400, seed=2)
    assert drawn.lost == 0
    assert abs(drawn.misfits.mean() - told.mean) < 0.01 * told.mean
    assert drawn.misfits.std() == pytest.approx(told.deviation, rel=0.12)


def test_what_can_t_scatter_is_refused(shell, loaded):
    design, state, load = loaded
    for tolerances, under in (
        (sf.Tolerances(marks=1e-3), load),
        (sf.Tolerances(load_each=0.1), np.zeros_like(load)),
    ):
        with pytest.raises(InputError, match="nothing is off"):
            spread(shell, design, state, under, tolerances)
    with pytest.raises(InputError, match=r"robust\.deviations: .*0 or more"):
        RobustMisfit("wet", ALL, -1.0)
    with pytest.raises(InputError, match="at least 1"):
        sample(shell, design, state, load, ALL, count=0, seed=0)
    with pytest.raises(NotConverged, match="isn't a stable equilibrium"):
        spread(shell, design, State(0.9 * state.positions, state.quaternions), load, ALL)


def test_drawings_off_the_stable_branch_are_counted_and_have_no_misfit(shell, loaded):
    design, state, load = loaded
    drawn = sample(shell, design, state, load, sf.Tolerances(supports=5e-3), count=6, seed=0)
    assert drawn.lost > 0
    assert len(drawn.misfits) + drawn.lost == 6
