"""A design's states under its loads, against the documented path's."""

import numpy as np
import pytest

import shellform as sf
from shellform.reliability import loaded_states as module
from shellform.reliability.loaded_states import loaded_states


@pytest.fixture(scope="module")
def loads(dome):
    wet = dome.point_load(3.0, every=2)
    half = wet * (dome.target.positions[:, :1] > 0.5 * dome.target.positions[:, :1].max())
    return {"none": 0.0 * wet, "wet": wet, "wetter": 1.2 * wet, "half": half}


def test_they_are_those_of_the_documented_path_in_fewer_factorisations(dome, loads):
    states, spent = loaded_states(dome, dome.design(), loads)
    path = sf.follow(dome, dome.design(), loads)
    assert set(states) == set(loads)
    for name, state in states.items():
        np.testing.assert_allclose(state.positions, path[name].equilibrium.state.positions, atol=1e-8)
    assert spent < sum(each.factorisations for each in path.values())


def test_loads_in_proportion_lie_on_one_path(dome, loads, monkeypatch):
    followed = []

    class Branch(module.Branch):
        def along(self, here, factor, most, *given, stops, heeding):
            followed.append((factor, most, sorted(stops), heeding))
            return super().along(here, factor, most, *given, stops=stops, heeding=heeding)

    monkeypatch.setattr(module, "Branch", Branch)
    loaded_states(dome, dome.design(), {name: loads[name] for name in ("none", "wet", "wetter")})
    assert followed == [(0.0, 1.0, [pytest.approx(1.0 / 1.2), 1.0], True)]


def test_where_a_branch_ends_before_its_load_there_are_none(dome, loads):
    states, spent = loaded_states(dome, dome.design(), {**loads, "far too much": 40.0 * loads["wet"]})
    assert states is None
    assert spent > 0


def test_what_rounding_leaves_does_not_count_as_rest(dome, loads, monkeypatch):
    monkeypatch.setattr(module.Branch, "counts", lambda *_: False)
    assert loaded_states(dome, dome.design(), {"wet": loads["wet"]})[0] is None
