"""How a search judges trials and goes back: which it accepts, refuses, calls sound, and takes away. The
equilibria are stood in for, so that each case is the one that is meant."""

from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser import descent, going_back, phases, search_state, thinning, trials
from shellform.optimiser.search_state import Accepted, Iterate, merit, missed, stiffness_of, violation
from shellform.optimiser.thinning import kept_stiffness, removable
from shellform.problem.engineering import ModalStiffness
from shellform.problem.evaluation import OffBranch
from shellform.problem.problem import FEASIBLE
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.verification.invariances import basket

NONE = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Point:
    """What judgements see of a linearisation."""

    objective: float
    name: str = ""
    constraints: np.ndarray = field(default_factory=lambda: NONE)
    design: object = None
    states: object = None


def searching(left=10, **changes):
    """A search with so many evaluations left, each try of which costs one."""
    evaluator = SimpleNamespace(
        evaluations=0,
        factorisations=0,
        base="wet",
        problem=SimpleNamespace(used=lambda: ["wet", "wetter"], constraints=[]),
        blocks=SimpleNamespace(each_cable=None),
    )
    given = {
        "solver": sf.SequentialConvex(),
        "evaluator": evaluator,
        "left": lambda: left - evaluator.evaluations,
        "tension": 1.0,
        "first_window": 0.2,
        "softest": 1.0,
        "always_guarded": False,
        "asked": None,
        "groups": None,
        "bounded": (),
        "base": "wet",
        "inner": SimpleNamespace(constraints=[]),
        "models": SimpleNamespace(at=lambda point: SimpleNamespace(point=point)),
    }
    return SimpleNamespace(**{**given, **changes})


def standing_at(point, **changes):
    return replace(
        Iterate(point, (), (), 0.0, 1.0, 0.2, 0.15, False, np.zeros(0, dtype=bool), NONE), **changes
    )


@pytest.fixture
def bare(monkeypatch):
    """Phases whose steps are told: `predicted`, and the next of `trials`; those accepted are kept in
    `taken`."""
    told = SimpleNamespace(predicted=-1.0, trials=[], taken=[], merits={}, noted=[])

    def attempted(search, it, model, y):
        search.evaluator.evaluations += 1
        return told.trials.pop(0), it

    def took(search, it, trial):
        told.taken.append((trial, it.window))
        return replace(it, point=trial)

    def noted(search, it, point, kept):
        told.noted.append((point, kept))
        return it

    for module in (descent, phases):
        monkeypatch.setattr(module, "tell", lambda *_: None)
        monkeypatch.setattr(module, "task", lambda *_, **__: None)
        monkeypatch.setattr(module, "propose", lambda *_: (None, told.predicted))
        monkeypatch.setattr(module, "attempt", attempted)
        monkeypatch.setattr(module, "accepted", took)
        monkeypatch.setattr(
            module, "merit", lambda search, point: told.merits.get(point.name, point.objective)
        )
        monkeypatch.setattr(module, "violation", lambda search, point: point.constraints.max(initial=0.0))
        monkeypatch.setattr(module, "noted", noted)
    return told


def test_a_trial_counts_only_where_the_merit_falls(bare):
    start = Point(1.0)
    for other in (Point(1.0), Point(1.1), None):
        bare.trials, bare.taken = [other], []
        found = descent.descend(searching(1), standing_at(start))
        assert bare.taken == []
        assert found.point is start
        assert found.window == pytest.approx(0.4 * 0.2)
        assert found.refused
        assert bare.noted[-1] == (other or start, False)
    better = Point(0.999)
    bare.trials = [better]
    assert descent.descend(searching(1), standing_at(start)).point is better


def test_a_lower_objective_that_breaks_a_limit_is_refused_by_its_merit(bare):
    broken = Point(0.5, "broken")
    bare.trials, bare.merits = [broken], {"broken": 1.5}
    assert descent.descend(searching(1), standing_at(Point(1.0))).point.objective == 1.0


@pytest.mark.parametrize(
    ("objective", "refused", "factor"),
    [
        (0.29, False, 1.6),  # of 1 predicted 0.71 came true
        (0.31, False, 1.0),
        (0.69, False, 1.0),
        (0.71, False, 0.4),
        (0.29, True, 1.0),
        (0.71, True, 0.4),
    ],
)
def test_the_window_grows_where_the_model_was_right_and_shrinks_where_it_was_wrong(
    bare, objective, refused, factor
):
    bare.trials = [Point(objective)]
    found = descent.descend(searching(1), standing_at(Point(1.0), refused=refused))
    assert found.window == pytest.approx(factor * 0.2)
    assert not found.refused


def test_a_descent_leaves_evaluations_to_what_comes_next_once_it_keeps_every_limit(bare):
    bare.trials = [Point(0.9 - 0.01 * k) for k in range(10)]
    found = descent.descend(searching(10), standing_at(Point(1.0)), least=4)
    assert len(bare.taken) == 6
    assert found.point.objective == pytest.approx(0.85)
    broken = np.array([0.2])
    bare.taken, bare.trials = [], [Point(0.9, constraints=broken), *(Point(0.8 - 0.01 * k) for k in range(9))]
    descent.descend(searching(5), standing_at(Point(1.0, constraints=broken)), least=5)
    assert len(bare.taken) == 2  # as long as a limit is broken it goes on


@pytest.mark.parametrize(
    ("earlier", "ready"), [(0.09, "as it is"), (0.17, "as it is"), (0.19, "stiffened"), (None, "stiffened")]
)
def test_the_way_back_to_a_design_that_stands_is_taken_where_it_costs_less_than_more_stiffness(
    bare, monkeypatch, earlier, ready
):
    there, last = Point(0.1, "stiffer"), Point(0.05, "last")
    it = standing_at(last, accepted=(SimpleNamespace(built=None),))
    back = replace(it, point=Point(earlier or 0.0), accepted=it.accepted if earlier else ())
    monkeypatch.setattr(phases, "_ready_to_thin", lambda search, it: (it.point, "stiffened"))
    monkeypatch.setattr(phases, "_ready_as_it_is", lambda search, it: (it.point, "as it is"))
    monkeypatch.setattr(phases, "_tensioned", lambda *_: it.tensioned)
    monkeypatch.setattr(phases, "_made_to_stand", lambda *_, **__: (there, it))
    monkeypatch.setattr(phases, "last_standing", lambda *_: back)
    monkeypatch.setattr(
        phases, "replace", lambda of, **changes: of if isinstance(of, tuple) else replace(of, **changes)
    )
    found = phases._stiffened(searching(asked=object()), it)
    assert found == ((back if ready == "as it is" else replace(it, point=there)).point, ready)


@pytest.mark.parametrize("reached", [0.9, 0.05])
def test_what_cables_may_cost_is_a_share_of_the_start_not_of_what_is_left_of_it(monkeypatch, reached):
    monkeypatch.setattr(phases, "taut_count", lambda *_: 80)
    solver = sf.SequentialConvex(allowance=0.07)
    ready = phases._ready_to_thin(searching(solver=solver), standing_at(Point(reached)))
    assert ready.thrifty == pytest.approx(reached + 0.07)


def test_a_search_has_settled_where_little_is_predicted_or_the_window_is_smallest():
    search = searching(solver=sf.SequentialConvex())

    def settled(predicted, **changes):
        point = Point(1.0, constraints=np.array([changes.pop("broken", -1.0)]), states={"wet": None})
        return descent._settled(search, standing_at(point, **changes), predicted)

    monkey = pytest.MonkeyPatch()
    monkey.setattr(descent, "violation", lambda _, point: max(point.constraints[0], 0.0))
    with monkey.context():
        assert "less than 0.1% improvement" in settled(-0.9e-3, window=1.0)
        assert settled(-1.1e-3, window=1.0) == ""
        assert settled(-0.9e-3, window=0.9) == "", "a smaller window promises less"
        assert settled(-0.9e-3, window=1.0, broken=0.1) == "", "limits are broken still"
        assert settled(-0.9e-3, window=1.0, stage=0.9) == "", "the load isn't whole yet"
        assert "no better design within the smallest" in settled(-1.0, window=0.029)
        assert settled(-1.0, window=0.031) == ""
        assert "no design within the smallest window breaks" in settled(-1.0, window=0.029, broken=0.1)
    monkey.undo()


def climbing(bare, monkeypatch, reached, **changes):
    """A search that climbs, each trial of which reaches so far."""
    search = searching(len(reached))
    search.evaluator.problem.constraints = [SimpleNamespace(term=SimpleNamespace(stabilises=True))]
    search.evaluator.seed = lambda design, states, stage: Point(0.5, f"seeded at {stage}")
    far = iter(reached)
    monkeypatch.setattr(descent, "reach", lambda *_: next(far))
    monkeypatch.setattr(descent, "staged", lambda *_: {})
    monkeypatch.setattr(descent, "accepted_design", lambda search, point: point.name)
    bare.trials = [Point(2.0, states={"wet": None}) for _ in reached]
    return descent.climb(search, standing_at(Point(1.0, "start"), **{"stage": 0.5, **changes}))


def test_a_climb_counts_only_trials_whose_stable_branch_reaches_farther(bare, monkeypatch):
    found = climbing(bare, monkeypatch, [0.5, 0.4])
    assert (found.stage, found.point.name, found.accepted) == (0.5, "start", ())
    found = climbing(bare, monkeypatch, [0.6, 0.55, 1.0])
    assert (found.stage, found.point.name) == (1.0, "seeded at 1.0")
    assert found.accepted == ("seeded at 0.6", "seeded at 1.0")
    assert not found.climbing


def test_nothing_climbs_that_bears_the_load_or_has_nothing_that_stabilises(bare, monkeypatch):
    search = searching()
    whole = standing_at(Point(1.0))
    assert descent.climb(search, whole) is whole
    staged = standing_at(Point(1.0), stage=0.5)
    assert descent.climb(search, staged) is staged


@pytest.mark.parametrize(
    ("begun", "trial", "sound", "stands", "taken"),
    [
        (-1.0, -1.0, True, True, True),
        (-1.0, 0.01, True, True, False),  # it breaks a limit
        (0.02, 0.01, True, True, True),  # less than the design before
        (0.02, 0.03, True, True, False),
        (-1.0, -1.0, False, True, False),  # its own path doesn't lead there
        (-1.0, -1.0, True, False, False),
    ],
)
def test_a_thinner_design_is_kept_only_where_it_breaks_no_limit_more_is_sound_and_stands(
    bare, monkeypatch, begun, trial, sound, stands, taken
):
    search, asked = searching(), []
    end = Point(0.9, "end", np.array([trial]))
    monkeypatch.setattr(phases, "stiffness_of", lambda *_: 0.0)
    monkeypatch.setattr(
        phases, "accepted_design", lambda search, point: Accepted(SimpleNamespace(), NONE, 0.0)
    )
    monkeypatch.setattr(Accepted, "built", property(lambda self: None))
    monkeypatch.setattr(phases, "sound", lambda *_: end if sound else None)
    monkeypatch.setattr(phases, "aimed", lambda problem, *_: problem)

    def judged(search, it, built):
        asked.append(built)
        return stands, it

    monkeypatch.setattr(phases, "standing", judged)
    start = standing_at(Point(1.0, "start", np.array([begun])))
    found, after = phases._made_to_stand(search, start, end, phases.Budget(1.0))
    assert (found is end) is taken
    assert len(asked) == (sound and trial <= max(begun, 0.0)), "what is refused is judged no further"
    assert after.point is start.point or taken


def test_a_repair_takes_steps_that_lower_the_merit_whatever_the_first_one_costs(bare):
    start = standing_at(Point(1.0, "before"), thrifty=1.2)
    trial = Point(1.1, "trial", np.array([0.5]))
    bare.merits = {"trial": 6.1, "dear": 1.3, "better": 1.15, "worse": 6.2}
    for names, end in (
        ([Point(1.3, "dear"), Point(1.2, "worse")], "dear"),
        ([Point(1.3, "dear"), Point(1.15, "better")], "better"),
        ([Point(1.2, "worse"), None], "trial"),
        ([Point(1.15, "better"), None], "better"),
        ([None, Point(1.15, "better")], "better"),
    ):
        bare.trials = list(names)
        found, after = phases._repaired(searching(), start, trial)
        assert found.name == end
        assert after.point.name == "before", "whoever judges takes the step"
    bare.trials = [Point(1.15, "better"), Point(1.15, "better")]
    bare.merits = {"trial": 6.1, "better": 1.15}
    found, after = phases._repaired(searching(1), start, trial)
    assert len(bare.trials) == 1, "no more than the evaluations that are left"
    assert after.window == pytest.approx(1.6 * 0.2)


def test_while_cables_are_taken_away_only_those_that_pull_and_stay_are_kept_taut(bare, monkeypatch):
    model = SimpleNamespace(origin=np.array([1.0, 2.0, 3.0, 4.0, 0.0]))
    leaving, kept_taut = [np.array([1, 3]), np.array([2]), np.array([], dtype=int)], []
    without = [Point(0.9, "without two"), None]

    def repaired(search, it, trial, *, reviving):
        assert not reviving
        kept_taut.append(it.tensioned.tolist())
        return trial, it

    monkeypatch.setattr(phases, "_without_slack", lambda search, it: it)
    monkeypatch.setattr(phases, "_leaving", lambda *_: leaving.pop(0))
    monkeypatch.setattr(phases, "attempt_without", lambda *_: without.pop(0))
    monkeypatch.setattr(phases, "_repaired", repaired)
    monkeypatch.setattr(phases, "_made_to_stand", lambda search, it, trial, budget: (trial, it))
    monkeypatch.setattr(phases, "stiffness_of", lambda *_: 0.0)
    monkeypatch.setattr(phases, "taut_count", lambda *_: 2)
    none = np.zeros(5, dtype=bool)
    start = standing_at(Point(1.0, "start"), tensioned=none, needed=none, thrifty=2.0, batch=2)
    search = searching(models=SimpleNamespace(at=lambda point: model))
    end = phases._thin(search, start)
    assert kept_taut == [[True, False, True, False, False]]
    assert [point.name for point, _ in bare.taken] == ["without two"]
    assert end.needed.tolist() == [False, False, True, False, False], "which could not go alone"
    assert end.failures == 1


def accepted_ones(count):
    return tuple(
        Accepted(SimpleNamespace(number=k, present=np.ones(1, dtype=bool)), np.ones(1, dtype=bool), 0.0)
        for k in range(count)
    )


@pytest.fixture
def returning(monkeypatch):
    """Searches that go back among designs 0, 1, …; a point's name is its design's number."""
    monkeypatch.setattr(Accepted, "built", property(lambda self: self.design))
    monkeypatch.setattr(
        going_back, "accepted_design", lambda search, found: Accepted(found.design, np.ones(1), -1.0)
    )

    def begin(count):
        own = accepted_ones(count)
        return standing_at(Point(1.0, design=own[-1].design), accepted=own, status="ended")

    return begin


def sound_are(monkeypatch, numbers):
    def sound(search, before):
        return Point(0.5, design=before.design) if before.design.number in numbers else None

    monkeypatch.setattr(going_back, "sound", sound)


def test_a_search_goes_back_to_the_last_sound_design_and_to_none_where_none_is(returning, monkeypatch):
    sound_are(monkeypatch, {0, 2})
    found = going_back.last_sound(None, returning(5))
    assert found.point.design.number == 2
    assert found.point.objective == 0.5, "in the states of its documented path"
    assert len(found.accepted) == 3
    sound_are(monkeypatch, set())
    assert going_back.last_sound(None, returning(5)).accepted == ()


@pytest.mark.parametrize(
    ("broken", "changes", "end"),
    [
        ((0.0, 0.0, 0.2, 0.1), {}, 1),
        ((0.0, 0.1, 0.0, 0.0), {}, 3),
        ((0.0, 0.0, 0.2, 0.1), {"begun": 2}, 1),
        ((0.0, 0.0, 0.2, 0.1), {"begun": 3}, 3),
        ((0.0, 0.0, 0.2, 0.1), {"stood": 3}, 3),
        ((0.3, 0.2, 0.2, 0.1), {}, 3),
    ],
)
def test_a_descent_ends_with_its_last_design_that_keeps_every_limit_where_it_had_one(
    returning, monkeypatch, broken, changes, end
):
    def search_at(sound):
        sound_are(monkeypatch, sound)
        it = returning(4)
        own = tuple(replace(each, violation=most) for each, most in zip(it.accepted, broken, strict=True))
        return going_back.within_limits(None, replace(it, accepted=own, **changes))

    found = search_at({0, 1, 2, 3})
    assert (found.point.design.number, len(found.accepted)) == (end, end + 1)
    assert search_at({0, 2, 3}).point.design.number == 3, "one that its path doesn't lead to is no end"


@pytest.mark.parametrize("stand", range(-1, 7))
def test_a_search_goes_back_to_the_last_design_that_stands(returning, monkeypatch, stand):
    asked = []

    def standing(search, it, built):
        asked.append(built.number)
        return built.number <= stand, it

    monkeypatch.setattr(going_back, "standing", standing)
    sound_are(monkeypatch, set(range(7)))
    found = going_back.last_standing(searching(asked=1), returning(7))
    assert len(asked) <= 4, "by bisection"
    assert len(asked) == len(set(asked)), "none twice"
    if stand < 0:
        assert "no design was found that stands as built" in found.status
        assert len(found.accepted) == 7, "it goes on with what it has"
    else:
        assert found.accepted[-1].design.number == stand
        assert found.status == "ended"
    begun = returning(7)
    assert going_back.last_standing(searching(), begun) is begun, "nothing is asked"


@pytest.mark.parametrize(
    ("confirmed", "sound", "end", "words"),
    [
        ({6}, {6}, 6, "ended"),
        ({5}, {5}, 5, "ended; the last design that a fresh sample confirms"),
        ({4, 3, 0}, {4}, 4, "ended; the last design that a fresh sample confirms"),  # 6, 5, 3, then 4
        ({4, 3, 0}, set(range(7)), 4, "ended; the last design that a fresh sample confirms"),
        ({0}, {0}, 0, "ended; the last design that a fresh sample confirms"),
        (
            {4, 3, 1},
            {3},
            3,
            "ended; the last design that a fresh sample confirms",
        ),  # 4 isn't where its path leads
        (set(), set(range(7)), 6, "ended; a fresh sample doesn't confirm that it stands as built"),
        ({5}, set(), 6, "ended; a fresh sample doesn't confirm that it stands as built"),
    ],
)
def test_a_search_ends_with_the_last_design_that_a_fresh_sample_confirms(
    returning, monkeypatch, confirmed, sound, end, words
):
    known, told_first = [], []

    def judged(search, asked, built, first):
        told_first.append(list(first))
        if not first:  # begun anew, from a design that the documented path led to or with none spared
            known.clear()
        assert list(first) == known
        stands = built.number in confirmed and asked == ("some spared", 3)
        fallen = () if stands else (10 + built.number, 7)
        known[:] = dict.fromkeys([*fallen, *known])
        return SimpleNamespace(stands=stands, fallen={"wet": fallen, "wetter": fallen})

    monkeypatch.setattr(going_back, "confirmed", judged)
    sound_are(monkeypatch, sound)
    found = going_back.last_confirmed(searching(asked=asking()), replace(returning(7), samples=3))
    assert (found.accepted[-1].design.number, found.status) == (end, words)
    assert found.fell == ("doesn't" in words)
    if 6 not in confirmed:
        assert told_first[1] == [16, 7], "those that fell come first"
    told_first.clear()
    begun = returning(7)
    assert going_back.last_confirmed(searching(asked=SimpleNamespace(confirmed=None)), begun) is begun
    assert not told_first, "it is left to whoever judges"


def asking():
    """What is asked of fresh samples, with some that may fall spared or none."""
    unspared = SimpleNamespace(sample=lambda number: ("none spared", number))
    return SimpleNamespace(
        confirmed="a fresh sample", sample=lambda number: ("some spared", number), unspared=lambda: unspared
    )


def test_a_search_none_of_whose_designs_is_confirmed_ends_with_the_last_one_that_is_with_none_spared(
    returning, monkeypatch
):
    def judged(search, asked, built, first):
        stands = asked[0] == "none spared" and built.number <= 4
        return SimpleNamespace(stands=stands, fallen={"wet": () if stands else (1,)})

    monkeypatch.setattr(going_back, "confirmed", judged)
    sound_are(monkeypatch, set(range(7)))
    found = going_back.last_confirmed(searching(asked=asking()), returning(7))
    assert (found.accepted[-1].design.number, found.fell) == (4, False)


@pytest.mark.parametrize(
    ("on_branch", "before", "after", "is_sound"),
    [
        ((True, True), 0.0, 0.0, True),
        ((True, False), 0.0, 0.0, False),
        ((False, True), 0.0, 0.0, False),
        ((True, True), 0.0, 0.01, False),
        ((True, True), 0.02, 0.01, True),
        ((True, True), 0.01, 0.02, False),
        ((True, True), 10.0, 10.0 + 1e-6, True),
        ((True, True), -0.5, 0.0, True),
    ],
)
def test_a_design_is_sound_only_where_its_documented_path_bears_every_load_and_breaks_no_limit_more(
    monkeypatch, on_branch, before, after, is_sound
):
    def loaded(on):
        return SimpleNamespace(
            on_branch=on, factorisations=3, equilibrium=SimpleNamespace(state=f"state {on}")
        )

    def follow(shell, design, loads, *, stay):
        assert stay, "what lies beyond a snap-through isn't looked at"
        return {"wet": loaded(on_branch[0]), "wetter": loaded(on_branch[1])}

    monkeypatch.setattr(trials, "loaded_states", lambda *_: (None, 5))
    monkeypatch.setattr(trials, "follow", follow)
    monkeypatch.setattr(trials, "violation", lambda search, point: after)
    end = Point(1.0)
    search = searching(problem=SimpleNamespace(shell=None, loads=None))
    search.evaluator.seed = lambda design, states, stage: end
    own = Accepted(sf_design(), np.ones(2, dtype=bool), before)
    assert (trials.sound(search, own) is end) is is_sound
    assert search.evaluator.factorisations == 11
    better = Accepted(sf_design(), np.ones(2, dtype=bool), before, 0.9)
    assert trials.sound(search, better) is None, "its path leads to another equilibrium, which is worse"
    as_good = Accepted(sf_design(), np.ones(2, dtype=bool), before, 0.92)
    assert (trials.sound(search, as_good) is end) is is_sound

    def off(*_):
        raise OffBranch

    search.evaluator.seed = off
    assert trials.sound(search, own) is None


def test_the_documented_path_is_followed_only_where_a_shorter_way_to_its_states_ends(monkeypatch):
    states = {"wet": "state", "wetter": "another", "told": "left out"}
    monkeypatch.setattr(trials, "loaded_states", lambda shell, design, loads: (dict(states), 5))
    monkeypatch.setattr(trials, "follow", None)
    monkeypatch.setattr(trials, "violation", lambda search, point: 0.0)
    search = searching(problem=SimpleNamespace(shell=None, loads=None))
    search.evaluator.seed = lambda design, found, stage: replace(Point(1.0), states=found)
    found = trials.sound(search, Accepted(sf_design(), np.ones(2, dtype=bool), 0.0))
    assert found.states == {"wet": "state", "wetter": "another"}
    assert search.evaluator.factorisations == 5


def sf_design():
    from shellform.gridshell.gridshell import Design

    return Design(np.ones(2), np.ones(2, dtype=bool), 0.001)


def test_a_branch_is_followed_to_the_margin_before_its_end_and_not_below_what_is_known(monkeypatch):
    shares = {"wetter": 0.7, "wettest": 0.5}
    used = ["wet", *shares]
    given = []

    def apply_load(assembly, state, before, after, *, step, smallest, stay):
        given.append(smallest)
        assert stay
        return SimpleNamespace(on_branch=shares[after] == 1.0, share=shares[after], factorisations=1)

    monkeypatch.setattr(trials, "apply_load", apply_load)
    evaluator = SimpleNamespace(
        base="wet",
        factorisations=0,
        problem=SimpleNamespace(used=lambda: used, loads={name: name for name in used}),
        load=lambda name, stage: name,
        assembly=lambda design: None,
    )
    assert trials.reach(evaluator, None, None, 0.0, 0.15, 1 / 64) == pytest.approx(0.35)
    assert given == [1 / 64] * 2
    assert trials.reach(evaluator, None, None, 0.4, 0.15) == 0.4
    assert trials.reach(evaluator, None, None, 0.0, 0.001, 1 / 64) == pytest.approx(0.499)
    assert given[-1] == 0.001, "as finely as the margin asks for"
    shares |= {"wetter": 1.0, "wettest": 1.0}
    assert trials.reach(evaluator, None, None, 0.0, 0.15) == 1.0
    assert evaluator.factorisations == 8


@pytest.mark.parametrize(
    ("stage", "reached", "margin", "end"),
    [(1.0, None, 0.15, (1.0, 0.15)), (0.5, 0.6, 0.15, (0.6, 0.15)), (0.5, 0.5, 0.15, (0.5, 0.075))],
)
def test_a_stage_rises_as_far_as_the_branch_reaches_or_goes_nearer_to_its_end(
    monkeypatch, stage, reached, margin, end
):
    monkeypatch.setattr(trials, "reach", lambda *_: reached)
    monkeypatch.setattr(trials, "staged", lambda *_: {})
    search = searching()
    search.evaluator.seed = lambda design, states, stage: Point(0.5, f"at {stage}")
    begun = standing_at(Point(1.0, "before", states={"wet": None}), stage=stage, margin=margin)
    found = trials._raised(search, begun)
    assert (found.stage, found.margin) == end
    assert found.point.name == (f"at {reached}" if reached == 0.6 else "before")
    least = trials._raised(search, replace(begun, margin=0.012)) if reached == 0.5 else None
    assert least is None or least.margin == search.solver.least_margin


def test_the_violation_is_that_of_the_limit_broken_most_and_none_within_what_counts_as_kept(monkeypatch):
    search = searching(bounded=(sf.AtMost(20.0, sf.CableForces("wet")),))
    pull = np.array([5.0, 0.0])
    monkeypatch.setattr(search_state, "tensions", lambda *_: pull)

    def broken(*values):
        return violation(search, Point(1.0, constraints=np.array(values)))

    assert FEASIBLE == 1e-3
    assert broken() == broken(-0.5, 0.9e-3) == 0.0
    assert broken(-0.5, 1.1e-3) == 1.1e-3
    pull[0] = 22.0
    assert broken(-0.5, 0.05) == pytest.approx(0.1)
    assert broken(-0.5, 0.5) == 0.5


def test_the_merit_is_the_objective_and_ten_times_what_is_broken_or_three_times_what_is_missed(monkeypatch):
    search = searching()
    monkeypatch.setattr(search_state, "tensions", lambda *_: np.zeros(0))
    monkeypatch.setattr(search_state, "in_mind", lambda _: 1)

    def of(limit, aim):
        return Point(0.5, constraints=np.array([limit, aim]))

    assert merit(search, of(-0.1, -0.1)) == 0.5
    assert merit(search, of(0.1, -0.1)) == pytest.approx(1.5)
    assert violation(search, of(-0.1, 0.5)) == 0.0, "an aim is no limit"
    assert missed(search, of(-0.1, 0.019)) == 0.0
    assert missed(search, of(-0.1, 0.12)) == pytest.approx(0.1)
    assert merit(search, of(-0.1, 0.12)) == pytest.approx(0.5 + 10.0 * 0.3 * 0.1)
    assert merit(search, of(0.2, 0.12)) == pytest.approx(2.5)


def test_the_stiffness_that_is_left_is_the_softest_mode_s_of_all_loads():
    parts = [sf.AtLeast(3.0, ModalStiffness(name, 3.0)) for name in ("wetter", "windy")]
    problem = SimpleNamespace(constraints=parts, places=lambda: [slice(0, 2), slice(2, 4)])
    search = searching()
    search.evaluator.problem = problem

    def at(*stiffnesses):
        return Point(1.0, constraints=np.array([1.0 - (each / 3.0) ** 2 for each in stiffnesses]))

    assert stiffness_of(search, at(4.0, 5.0, 6.0, 7.0)) == pytest.approx(4.0)
    assert stiffness_of(search, at(4.0, 5.0, 6.0, 2.0)) == pytest.approx(2.0)
    unstable = Point(1.0, constraints=np.array([-1.0, -1.0, 1.5, -1.0]))
    assert stiffness_of(search, unstable) == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_cables_that_go_leave_every_direction_its_share_of_stiffness_and_no_further_one_of_them_could_go(
    seed,
):
    chance = np.random.default_rng(seed)
    root = chance.normal(size=(12, 12)) / 5.0
    kept = np.eye(12) - root @ root.T / 1.5
    order, least = chance.permutation(12), 0.4

    def softest(cables):
        return np.linalg.eigvalsh(kept[np.ix_(cables, cables)]).min()

    whole = removable(kept, order, 12, least)
    assert softest(whole) >= least
    gone = []
    for cable in order:  # greedily by eigenvalues, one set after the other
        if softest([*gone, cable]) > least:
            gone.append(int(cable))
    assert whole.tolist() == gone
    assert 0 < len(whole) < 12
    assert removable(kept, order, 2, least).tolist() == gone[:2]
    assert removable(kept, order, 0, least).tolist() == []


def test_what_is_kept_of_the_stiffness_is_that_of_the_tangent_without_the_cables(monkeypatch):
    network, load = basket()
    longer = network.cables.rest_length * [1.0, 1.0, 1.2]
    network = replace(network, cables=replace(network.cables, rest_length=longer))
    assembly = assemble(network)
    state = find_equilibrium(assembly, at_rest(network.nodes), load).state
    kept = kept_stiffness(assembly, state, network.cables)
    np.testing.assert_array_equal(network.cables.tension(state) > 0.0, [True, True, False])
    np.testing.assert_array_equal(kept[2], [0.0, 0.0, 1.0])
    monkeypatch.setattr(thinning, "column_blocks", lambda count, size: [slice(0, 2), slice(2, count)])
    np.testing.assert_allclose(kept_stiffness(assembly, state, network.cables), kept)
    one = np.asfortranarray(np.eye(len(assembly.free)))
    tangent = np.linalg.inv(assembly.factor(state).solve(one))
    elastic = []
    for (one, other), rest in zip(network.cables.ends, network.cables.rest_length, strict=True):
        pull = state.positions[other] - state.positions[one]
        column = np.zeros(6 * len(network.nodes))
        column[6 * one : 6 * one + 3], column[6 * other : 6 * other + 3] = -pull, pull
        column = column[assembly.free] / np.linalg.norm(pull)
        elastic.append(3.0 / rest * np.outer(column, column))
    for gone in ([0], [1], [0, 1]):
        without = tangent - sum(elastic[k] for k in gone)
        share = np.exp(np.linalg.slogdet(without)[1] - np.linalg.slogdet(tangent)[1])
        assert np.linalg.det(kept[np.ix_(gone, gone)]) == pytest.approx(share, rel=1e-6)
        assert share < 0.9
