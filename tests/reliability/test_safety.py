"""Whether a design holds what is asked of it as built."""

import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import PERFECT, drawn
from shellform.reliability.perfect import perfect
from shellform.reliability.refinement import critical_factor, mesh_error
from shellform.reliability.safety import Safety, allowed, judge, paths
from shellform.reliability.standing import Workshop, sample

HARD = Tolerances(load_each=0.2, load_all=0.2)


@pytest.fixture(scope="module")
def loads(dome):
    design = dome.point_load(4.5, every=2)
    return {"none": 0.0 * design, "design": design, "additional": 1.2 * design}


def test_one_path_tells_of_all_loads_on_it_what_a_path_of_each_own_tells(dome, loads):
    safety = Safety(HARD, critical_factor=None, drawn=12, seed=3)
    found = judge(dome, dome.design(), loads, safety)
    assert list(found.loads) == ["design", "additional"]
    for name, own in found.loads.items():
        alone = sample(dome, dome.design(), loads[name], HARD, count=12, seed=3)
        assert own.standing.standing == alone.standing.standing
        assert own.fallen == tuple(each.number for each in alone.outcomes if not each.stands)
    assert found.loads["additional"].fallen


def test_loads_that_are_shares_of_another_lie_on_its_path(loads):
    across = loads["design"].copy()
    across[0, 0] += 1.0
    found = paths({**loads, "across": across})
    assert found["additional"] == {"additional": 1.0, "design": pytest.approx(1.0 / 1.2)}
    assert found["across"] == {"across": 1.0}
    assert "none" not in found


def test_a_load_against_another_has_a_path_of_its_own(loads):
    design = loads["design"]
    found = paths({"design": design, "uplift": -0.3 * design, "more": -0.6 * design})
    assert found == {
        "design": {"design": 1.0},
        "more": {"more": 1.0, "uplift": pytest.approx(0.5)},
    }


def test_the_initial_designs_share_is_required_under_the_additional_load_where_none_is_named(dome, loads):
    safety = Safety(HARD, critical_factor=None, drawn=12, seed=3)
    initial = judge(dome, dome.design(), loads, safety)
    again = judge(dome, dome.design(), loads, safety, initial=initial)
    own = again.loads["additional"]
    assert own.required == pytest.approx(own.standing.standing / 12)
    assert own.holds
    assert not initial.loads["additional"].holds  # against 99 %
    assert any("'additional'" in each and "12 are required" in each for each in initial.failed)


def test_a_critical_factor_is_required_on_the_halved_mesh(dome, loads):
    design = dome.design()
    fine = mesh_error(dome, design, loads["design"]).critical.fine
    assert fine < critical_factor(dome, design, loads["design"]).factor
    for factor, kept in ((0.97 * fine, True), (1.03 * fine, False)):
        found = judge(dome, design, loads, Safety(Tolerances(), critical_factor=factor, drawn=1))
        assert found.holds == kept
        assert kept or found.critical.factor == pytest.approx(fine, rel=0.01)


def test_as_many_may_fall_as_the_required_probability_allows():
    assert [allowed(0.99, count) for count in (60, 100, 200)] == [0, 1, 2]
    assert allowed(13 / 20, 20) == 7


@pytest.mark.parametrize(
    ("entries", "where"),
    [
        ({"probability_design": 1.0}, "safety.probability_design"),
        ({"probability_additional": -0.1}, "safety.probability_additional"),
        ({"critical_factor": 0.9}, "safety.critical_factor"),
        ({"drawn": 0}, "safety.drawn"),
        ({"stiffness": 0.0}, "safety.stiffness"),
        ({"enlarged": 0.5}, "safety.enlarged"),
    ],
)
def test_what_cannot_be_asked_for_is_refused(entries, where):
    with pytest.raises(InputError) as error:
        Safety(Tolerances(), **entries)
    assert error.value.where == where


def test_judging_asks_for_a_design_load(dome, loads):
    with pytest.raises(InputError, match="design load"):
        judge(dome, dome.design(), {"none": loads["none"]}, Safety(Tolerances()))


@pytest.mark.parametrize("step", [0.5, 0.125])
def test_a_path_gone_on_with_ends_where_one_from_nothing_does(dome, loads, step):
    nominal = perfect(dome, dome.design(), loads["additional"], step=step)
    none = drawn(nominal.members, Tolerances(), 0, PERFECT)
    workshop = Workshop(nominal)
    begin = float(nominal.factors[-1]), nominal.states[-1]
    going_on = workshop.limit(none, most=3.0, resolution=1e-4, begin=begin)
    anew = workshop.limit(none, most=3.0, step=1 / 16, resolution=1e-4)
    assert 1.0 < anew.factor < 3.0
    assert going_on.factor == pytest.approx(anew.factor, abs=2e-4)
    assert going_on.kind == anew.kind


def test_a_path_followed_to_its_end_alone_ends_in_the_same_state(dome, loads):
    short, whole = (perfect(dome, dome.design(), loads["design"], step=step) for step in (0.5, 0.125))
    assert (short.bears, len(short.states), len(whole.states)) == (True, 3, 9)
    assert short.states[-1].positions == pytest.approx(whole.states[-1].positions, abs=1e-8)
