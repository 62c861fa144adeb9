"""Rod elements halved, Richardson's estimate, critical factors that are factors; and how structures fail."""

from itertools import pairwise

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.failure import explained, most_likely
from shellform.reliability.path_of_one import BORNE, LIMIT_POINT
from shellform.reliability.perfect import perfect, perfect_of
from shellform.reliability.refinement import Refined, critical_factor, halved, mesh_error
from shellform.reliability.standing import Workshop
from shellform.structure.model import Model

LARGE = Tolerances(cable_length=3e-4, supports=3e-4, marks=3e-4, load_each=0.1, load_all=0.05, connectors=0.1)


def test_richardsons_estimate_of_a_parabola_in_h_is_exact():
    found = Refined(coarse=2.0 + 0.5 * 0.1**2, fine=2.0 + 0.5 * 0.05**2)
    assert found.extrapolated == pytest.approx(2.0, abs=1e-15)
    assert found.error == pytest.approx(0.5 * 0.1**2, abs=1e-15)


def test_a_halved_model_has_twice_the_rod_elements_on_the_same_joints(dome, nominal):
    model = Model(nominal.network, {"load": nominal.load}, dome.target, ())
    finer = halved(model)
    rods = (model.network.beams.kind == 0).sum()
    assert (finer.network.beams.kind == 0).sum() == 2 * rods
    assert finer.network.nodes[: len(nominal.load)] == pytest.approx(model.network.nodes, abs=0.0)
    assert finer.network.beams.rest_length.sum() == pytest.approx(model.network.beams.rest_length.sum())
    assert finer.network.cables == model.network.cables
    assert finer.loads["load"].sum() == nominal.load.sum()


def test_the_deviation_moves_by_a_quarter_as_much_when_rods_are_halved_again(dome, nominal):
    model = Model(nominal.network, {"load": nominal.load}, dome.target, ())
    states = []
    for _ in range(4):
        states.append(perfect_of(model, "load", shapes=0).states[-1].positions[: len(nominal.load)])
        model = halved(model)
    steps = [np.linalg.norm(b - a) for a, b in pairwise(states)]
    assert steps[1] / steps[2] == pytest.approx(4.0, rel=0.15)


def test_the_critical_factor_is_where_the_loaded_shell_loses_stability(dome, nominal):
    end = critical_factor(dome, dome.design(), nominal.load)
    assert 1.0 < end.factor < 3.0
    assert end.kind == LIMIT_POINT
    below, beyond = (perfect(dome, dome.design(), f * end.factor * nominal.load) for f in (0.999, 1.001))
    assert below.bears
    assert not beyond.bears


def test_a_load_that_is_borne_as_far_as_was_looked_has_no_critical_kind(dome, nominal):
    end = critical_factor(dome, dome.design(), 0.1 * nominal.load, sought=2.0)
    assert (end.factor, end.kind) == (2.0, BORNE)


def test_the_critical_factor_scales_with_the_load(dome, nominal):
    one, half = (critical_factor(dome, dome.design(), s * nominal.load).factor for s in (1.0, 0.5))
    assert half == pytest.approx(2.0 * one, rel=1e-3)


def test_mesh_errors_are_told_of_all_four_numbers(dome, nominal):
    found = mesh_error(dome, dome.design(), nominal.load)
    for each in (found.deviation_max, found.deviation_mean, found.stress, found.critical):
        assert each.coarse > 0.0
        assert each.fine != each.coarse
        assert abs(each.error) < 0.2 * each.coarse


def test_a_fallen_structure_is_explained_by_what_it_would_bear_without_each_cause(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.2 * nominal.load))
    outcomes = tuple(workshop.drawn(LARGE, seed=7, numbers=range(12)))
    fallen = most_likely(outcomes)
    found = explained(workshop, LARGE, seed=7, number=fallen.number)
    assert set(found.without) == {name for name, value in vars(LARGE).items() if value}
    assert found.without[found.driver] == max(found.without.values()) > found.factor
    assert np.abs(found.mode[:, :3]).max() == pytest.approx(1.0)


def test_a_structure_that_stands_has_no_failure_to_explain(nominal):
    with pytest.raises(InputError, match="hasn't fallen"):
        explained(Workshop(nominal), Tolerances(), seed=0, number=0)
