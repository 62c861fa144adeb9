"""Whether a design holds what is asked of it as built."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import safety as safety_module
from shellform.reliability.drawing import PERFECT, draw_errors
from shellform.reliability.perfect import TO_ITS_END, perfect
from shellform.reliability.refinement import critical_factor, mesh_error
from shellform.reliability.safety import Safety, allowed, critical_on_halved, judge, paths
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
        ({"margin": -0.1}, "safety.margin"),
        ({"margin": float("nan")}, "safety.margin"),
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
    none = draw_errors(nominal.members, Tolerances(), 0, PERFECT)
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


class Drawn:
    """Structures of which each bears a factor of the largest load on a path, told by their numbers."""

    def __init__(self, factors, stands=None):
        self.factors, self.asked = factors, []
        self.stand = stands or [factor >= 1.0 for factor in factors]

    def __call__(self, _nominal):
        return self

    def load_numbers(self, tolerances, **how):
        self.asked.append((tolerances, how))
        every = zip(how["numbers"], self.factors, self.stand, strict=True)
        return [SimpleNamespace(number=k, factor=factor, stands=stands) for k, factor, stands in every]


def judged(monkeypatch, made, safety, *, loads, critical=1.25, **how):
    followed = []
    monkeypatch.setattr(
        safety_module, "perfect", lambda *given, step: followed.append((given[2].sum(), step))
    )
    monkeypatch.setattr(safety_module, "Workshop", made)
    monkeypatch.setattr(
        safety_module,
        "critical_on_halved",
        lambda _shell, _design, load, sought: SimpleNamespace(
            factor=critical, load=load.sum(), sought=sought
        ),
    )
    return judge(None, None, loads, safety, **how), followed


DOWN = np.array([[0.0, 0.0, -6.0, 0.0, 0.0, 0.0]] * 2)
ASIDE = np.array([[-1.0, 0.0, 0.0, 0.0, 0.0, 0.0]] * 2)
BOTH = {"none": 0.0 * DOWN, "wet": DOWN, "wetter": 1.25 * DOWN}


def test_each_structure_is_loaded_once_and_told_of_under_every_share_of_its_load(monkeypatch):
    """One bears all, one comes to the larger load too far from its place, one to just the smaller one, and
    one not so far; under the smaller load it counts how far a path goes alone."""
    made = Drawn([1.0, 1.0, 0.8, 0.7999, 0.3], [True, False, False, False, False])
    asked = Safety(HARD, probability_design=0.6, critical_factor=None, drawn=5, seed=7)
    found, followed = judged(monkeypatch, made, asked, loads=BOTH, design_load="wet")
    assert followed == [(-15.0, TO_ITS_END)]
    assert made.asked == [(HARD, {"seed": 7, "numbers": range(5), "marks": (1.0, pytest.approx(0.8))})]
    assert list(found.loads) == ["wet", "wetter"]
    assert found.loads["wet"].fallen == (3, 4)
    assert found.loads["wetter"].fallen == (1, 2, 3, 4)
    assert (found.loads["wet"].standing.standing, found.loads["wetter"].standing.standing) == (3, 1)
    assert {(own.standing.drawn, own.standing.seed) for own in found.loads.values()} == {(5, 7)}
    assert found.loads["wet"].holds
    assert not found.loads["wetter"].holds
    assert found.failed == ("under the load 'wetter' 1 of 5 drawn structures stand, and 3 are required",)
    assert found.critical is None
    assert not found.holds


@pytest.mark.parametrize(
    ("critical", "said"),
    [
        (1.25, ()),
        (1.249, ("the critical factor is 1.249 with rod elements halved, and 1.25 is required",)),
    ],
)
def test_a_judgement_says_which_critical_factor_is_missing(monkeypatch, critical, said):
    made = Drawn([1.0, 1.0])
    asked = Safety(HARD, critical_factor=1.25, drawn=2)
    found, _ = judged(monkeypatch, made, asked, loads=BOTH, critical=critical, design_load="wet")
    assert (found.critical.load, found.critical.sought) == (-12.0, 1.25), "under the design load"
    assert found.failed == said
    assert found.holds == (not said)


def test_the_initial_design_s_share_is_asked_for_under_other_loads_alone(monkeypatch):
    asked = Safety(HARD, probability_design=0.75, critical_factor=None, drawn=4)
    before, _ = judged(monkeypatch, Drawn([1.0, 0.5, 0.5, 0.5]), asked, loads=BOTH, design_load="wet")
    found, _ = judged(
        monkeypatch, Drawn([1.0, 0.9, 0.5, 0.5]), asked, loads=BOTH, design_load="wet", initial=before
    )
    assert (found.loads["wet"].required, found.loads["wetter"].required) == (0.75, 0.25)
    assert found.failed == ("under the load 'wet' 2 of 4 drawn structures stand, and 3 are required",)
    lone = {"wet": DOWN, "wind": ASIDE}
    found, followed = judged(
        monkeypatch, Drawn([1.0] * 4), asked, loads=lone, design_load="wet", initial=before
    )
    assert found.loads["wind"].required == 0.75, "of which the initial design's judgement doesn't tell"
    assert [size for size, _ in followed] == [-12.0, -2.0]


def test_a_load_by_itself_or_of_nothing_is_no_design_load():
    for loads in ({"wet": DOWN}, {"design": 0.0 * DOWN, "wet": DOWN}):
        with pytest.raises(InputError, match="design load") as told:
            judge(None, None, loads, Safety(Tolerances()))
        assert told.value.value == "design"


def test_what_is_required_under_a_load():
    asked = Safety(HARD, probability_design=0.9)
    shares = [asked.required(name, "wet", initial) for name, initial in FOUR]
    assert shares == [0.9, 0.9, 0.6, 0.9]
    given = Safety(HARD, probability_design=0.9, probability_additional=0.8)
    assert [given.required(name, "wet", initial) for name, initial in FOUR] == [0.9, 0.8, 0.8, 0.8]


FOUR = (("wet", 0.5), ("wetter", None), ("wetter", 0.6), ("wetter", 0.95))


def test_without_a_word_on_safety_these_numbers_are_asked_for():
    asked = Safety(HARD)
    assert (asked.probability_design, asked.probability_additional, asked.critical_factor) == (
        0.99,
        None,
        1.25,
    )
    assert (asked.stiffness, asked.margin, asked.enlarged) == (0.5, 0.5, 1.5)


@pytest.mark.parametrize(
    "entries",
    [
        {"probability_design": 0.0, "probability_additional": 0.0},
        {"probability_additional": 0.999},
        {"critical_factor": 1.0},
        {"critical_factor": None},
        {"drawn": 1, "tried": 1},
        {"stiffness": 1e-6},
        {"enlarged": 1.0},
        {"enlarged": 3.0},
    ],
)
def test_what_lies_at_the_edge_of_what_can_be_asked_for_is_taken(entries):
    asked = Safety(Tolerances(), **entries)
    assert {name: getattr(asked, name) for name in entries} == entries


@pytest.mark.parametrize(
    "entries", [{"enlarged": 3.1}, {"enlarged": 0.99}, {"tried": 0}, {"critical_factor": 0.999}]
)
def test_what_lies_beyond_it_is_refused(entries):
    with pytest.raises(InputError):
        Safety(Tolerances(), **entries)


def test_a_load_that_is_off_another_s_line_by_a_millionth_has_a_path_of_its_own():
    across = np.zeros((2, 6))
    across[1, 0] = 1.0
    heavy = {"wet": 1e4 * DOWN, "beside": 5e3 * DOWN + 1e-6 * across}  # a share of 1e-11 across
    assert list(paths(heavy)) == ["wet"]
    beside = 0.5 * DOWN + 1e-6 * across
    assert paths({"wet": DOWN, "beside": beside}) == {"wet": {"wet": 1.0}, "beside": {"beside": 1.0}}
    assert paths({"wet": DOWN, "beside": 0.5 * DOWN + 1e-12 * across}) == {
        "wet": {"wet": 1.0, "beside": pytest.approx(0.5)}
    }


def test_the_critical_factor_is_sought_of_the_perfect_structure_up_to_what_is_asked_for(monkeypatch):
    monkeypatch.setattr(safety_module, "model_under", lambda *parts: parts)
    monkeypatch.setattr(safety_module, "rods_halved", lambda model: ("halved", *model))
    monkeypatch.setattr(safety_module, "critical_of", lambda model, **how: (model, how))
    model, how = critical_on_halved("shell", "design", "load", 1.4)
    assert model == ("halved", "shell", "design", "load")
    assert how == {"sought": 1.4, "resolution": 1 / 256}


def test_the_same_load_twice_is_one_path_to_the_end_of_which_both_are_judged():
    """Of every fourth load the product with itself over its squared length is more than 1 by a bit."""
    rng = np.random.default_rng(3)
    for _ in range(50):
        load = rng.normal(size=(20, 6))
        (shares,) = paths({"wet": load, "same": load.copy()}).values()
        assert shares == {"wet": 1.0, "same": 1.0}
