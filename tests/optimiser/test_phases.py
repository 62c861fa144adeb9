"""In which order a search goes through its phases, how far it stiffens and thins, and what it says at the
end: with trials and judgements that are told.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.gridshell import Design
from shellform.optimiser import phases
from shellform.optimiser.search_state import Iterate
from shellform.optimiser.thinning import Budget


def iterate(point=None, **changes):
    given = Iterate(point, ("first",), (), 0.0, 1.0, 0.2, 0.15, False, np.zeros(5, dtype=bool), np.zeros(2))
    return replace(given, **changes)


def searching(left=100, **changes):
    evaluator = SimpleNamespace(
        blocks=SimpleNamespace(each_cable=slice(0, 5)),
        problem=SimpleNamespace(decisive_load=lambda: "wetter"),
        evaluations=0,
    )
    given = {
        "solver": sf.SequentialConvex(),
        "evaluator": evaluator,
        "evaluations": 41,
        "left": lambda: left - evaluator.evaluations,
        "tension": 4.0,
        "softest": 2.0,
        "asked": None,
        "inner": "inner",
        "models": SimpleNamespace(at=lambda point: f"model at {point}"),
        "problem": SimpleNamespace(shell=SimpleNamespace(cables=lambda design: "cables")),
    }
    return SimpleNamespace(**{**given, **changes})


@pytest.fixture
def ways(monkeypatch):
    """The phases that were gone through, each of which leaves the next one to be as told."""
    gone, after = [], {}

    def way(name, *, kept=("phase",)):
        def phase(search, it, *rest, **how):
            gone.append((name, *(getattr(it, each) for each in kept), *how.values()))
            return replace(it, **after.get(name, {}))

        return phase

    for name in ("climb", "descend", "last_sound", "_stiffened", "last_standing", "last_confirmed"):
        monkeypatch.setattr(phases, name, way(name.strip("_")))
    monkeypatch.setattr(phases, "_led", lambda search, it: way(f"led by {search}")(search, it))
    monkeypatch.setattr(phases, "_thin", lambda search, it: way(f"thin {search}")(search, it))
    monkeypatch.setattr(phases, "looking_closer", lambda search: "closely")
    monkeypatch.setattr(
        phases, "leaving_some", lambda search: f"leaving some {search if search == 'closely' else 'as it is'}"
    )
    agree = way("agreed", kept=("phase", "until", "stood", "led_to"))
    monkeypatch.setattr(phases, "agreed", lambda search, it: (after.get("agrees", True), agree(search, it)))
    return gone, after


def test_a_search_climbs_descends_thins_and_asks_a_fresh_sample(ways):
    gone, after = ways
    after["stiffened"] = {"phase": "thin"}
    phases.run(searching(), iterate(phase="climb", until=7, stood=3, led_to=0.5))
    assert gone == [
        ("climb", "climb"),
        ("descend", "descend", 20),
        ("last_sound", "descend"),
        ("stiffened", "descend"),
        ("thin leaving some as it is", "thin"),
        ("agreed", "agree", 0, 0, np.inf),
    ], "half of the evaluations are left to thinning"
    gone.clear()
    after["agrees"] = False
    phases.run(searching(), iterate(phase="thin"))
    assert [name for name, *_ in gone] == ["thin leaving some as it is", "agreed", "last_confirmed"]


def test_a_search_led_by_structures_thins_judged_by_more_of_them(ways):
    gone, after = ways
    after["stiffened"] = {"phase": "lead"}
    after["led by closely"] = {"phase": "thin", "mind": "structures"}
    phases.run(searching(), iterate(phase="descend"))
    assert [name for name, *_ in gone][2:] == [
        "stiffened",
        "led by closely",
        "thin leaving some closely",
        "agreed",
    ]


def test_where_nothing_was_accepted_there_is_nothing_to_thin(ways):
    gone, after = ways
    after["last_sound"] = {"accepted": ()}
    phases.run(searching(), iterate(phase="descend"))
    assert [name for name, *_ in gone] == ["descend", "last_sound", "last_standing", "last_confirmed"]


@pytest.mark.parametrize("each", [None, slice(0, 5)])
def test_without_thinning_the_last_design_that_stands_is_taken_or_a_sample_asked_where_structures_led(
    ways, each
):
    gone, _ = ways
    search = searching(solver=sf.SequentialConvex(thin=each is None))
    search.evaluator.blocks.each_cable = each
    phases.run(search, iterate(phase="descend"))
    assert gone == [
        ("descend", "descend", 0),
        ("last_sound", "descend"),
        ("last_standing", "descend"),
        ("last_confirmed", "descend"),
    ]
    gone.clear()
    phases.run(search, iterate(phase="descend", mind="structures"))
    assert [name for name, *_ in gone] == ["descend", "last_sound", "agreed"]


def point(objective, name=""):
    return SimpleNamespace(objective=objective, name=name)


@pytest.mark.parametrize(
    ("found", "led", "end"),
    [
        (point(0.5, "stiffer"), None, ("stiffer", "ready")),  # it costs nothing
        (None, "led", "led"),
        (None, None, ("before", "as it is")),
    ],
)
def test_a_design_that_falls_is_stiffened_or_led_or_thinned_as_it_is(monkeypatch, found, led, end):
    monkeypatch.setattr(phases, "_ready_to_thin", lambda search, it: (it.point.name, "ready"))
    monkeypatch.setattr(phases, "_ready_as_it_is", lambda search, it: (it.point.name, "as it is"))
    monkeypatch.setattr(phases, "_tensioned", lambda search, it: "tensioned")
    monkeypatch.setattr(phases, "accepted", lambda search, it, trial: replace(it, point=trial))
    monkeypatch.setattr(phases, "last_standing", lambda search, it: replace(it, point=point(0.7, "before")))
    monkeypatch.setattr(phases, "ready_to_lead", lambda search, it, fell: led)
    monkeypatch.setattr(
        phases, "replace", lambda of, **changes: of if isinstance(of, tuple) else replace(of, **changes)
    )
    it = iterate(point(0.5, "last"), accepted=(SimpleNamespace(built="last built"),))
    monkeypatch.setattr(phases, "_made_to_stand", lambda *_: (found, it))
    assert phases._stiffened(searching(asked="asked"), it) == end
    assert phases._stiffened(searching(), it) == ("last", "ready"), "where nothing is asked as built"


def test_a_search_is_ready_to_thin_with_an_eighth_of_its_cables_and_a_tenth_of_a_mean_tension_at_least(
    monkeypatch,
):
    monkeypatch.setattr(phases, "taut_count", lambda *_: 43)
    ready = phases._ready_to_thin(
        searching(), iterate(point(0.5), window=0.2, paused=True, needed=np.ones(5))
    )
    assert (ready.batch, ready.counted, ready.window, ready.thrifty) == (5, 43, 0.4, pytest.approx(0.58))
    assert (ready.guarded, ready.phase, ready.paused, ready.needed.any()) == (True, "thin", False, False)
    assert phases._ready_to_thin(searching(), iterate(point(0.5), window=0.7)).window == 0.7
    monkeypatch.setattr(phases, "taut_count", lambda *_: 3)
    assert phases._ready_to_thin(searching(), iterate(point(0.5))).batch == 1


def restiffening(monkeypatch):
    asked = []

    def restiffened(search, it, least):
        asked.append(least)
        return replace(it, stiffness=least, window=9.0)

    monkeypatch.setattr(phases, "restiffened", restiffened)
    return asked


def test_another_stiffness_is_asked_for_where_designs_are_judged_as_built_and_it_is_another_one(monkeypatch):
    asked = restiffening(monkeypatch)
    search = searching(asked="asked", solver=sf.SequentialConvex(stiffness=0.25))  # of 2 N/m
    it = iterate(stiffness=10.0)
    for wanted, kept in ((13.0, 13.0), (7.0, 7.0), (0.3, 0.5), (10.000008, 10.0), (10.000015, 10.000015)):
        found = phases._aiming_for(search, it, wanted)
        assert (found.stiffness, found.window) == (kept, 0.2)
    assert len(asked) == 4
    alone = searching(solver=search.solver)
    assert phases._aiming_for(alone, it, 1.3) is it
    none = iterate(stiffness=0.0)  # nothing is asked of it
    assert phases._aiming_for(search, none, 1.3) is none


@pytest.mark.parametrize(("has", "kept"), [(0.8, 0.8), (1.2, 1.0)])
def test_a_trial_lowers_what_is_asked_for_and_never_raises_it(monkeypatch, has, kept):
    restiffening(monkeypatch)
    monkeypatch.setattr(phases, "stiffness_of", lambda *_: has)
    search = searching(asked="asked", solver=sf.SequentialConvex(stiffness=0.0))
    trial, it = phases._aiming_lower(search, iterate("before", stiffness=1.0), "trial")
    assert (trial, it.stiffness) == ("trial", kept)


@pytest.mark.parametrize(("has", "asked_for"), [(0.8, 1.0), (1.2, 1.2)])
def test_as_it_is_a_design_is_to_keep_the_stiffness_that_it_has(monkeypatch, has, asked_for):
    monkeypatch.setattr(phases, "stiffness_of", lambda *_: has)
    monkeypatch.setattr(phases, "_aiming_for", lambda search, it, stiffness: stiffness)
    monkeypatch.setattr(phases, "_ready_to_thin", lambda search, it: ("ready", it))
    assert phases._ready_as_it_is(searching(), iterate(stiffness=1.0)) == ("ready", asked_for)


@pytest.fixture
def falling(monkeypatch):
    """Trials of told stiffness that fall until they stand."""
    told = SimpleNamespace(stiffness=[], stands=99, judged=[], repaired=[], asked=restiffening(monkeypatch))

    def standing(search, it, built):
        told.judged.append(built)
        return len(told.judged) > told.stands, replace(it, fallen=(*it.fallen, len(told.judged)), fell=True)

    def repaired(search, it, trial):
        told.repaired.append(trial)
        return f"trial {len(told.repaired)}", it

    def stiffness_of(search, trial):
        return told.stiffness[int(str(trial).split()[-1])]

    monkeypatch.setattr(phases, "_aiming_lower", lambda search, it, trial: (trial, it))
    monkeypatch.setattr(phases, "violation", lambda *_: 0.0)
    monkeypatch.setattr(
        phases, "accepted_design", lambda search, trial: SimpleNamespace(built=f"built {trial}")
    )
    monkeypatch.setattr(phases, "sound", lambda search, before: before.built.removeprefix("built "))
    monkeypatch.setattr(phases, "standing", standing)
    monkeypatch.setattr(phases, "_repaired", repaired)
    monkeypatch.setattr(phases, "stiffness_of", stiffness_of)
    monkeypatch.setattr(phases, "aimed", lambda problem, least, mind: (problem, least, mind))
    monkeypatch.setattr(phases, "add_fallen", lambda search, it, built: replace(it, mind=(it.mind, built)))
    return told


def stiffened(search=None, **changes):
    search = search or searching()
    it = iterate("start", stiffness=1.0, fallen=(), **changes)
    budget = SimpleNamespace(covers=lambda search, trial: True)
    return search, phases._made_to_stand(search, it, "trial 0", budget)


def test_a_design_that_falls_is_asked_for_a_tenth_more_stiffness_three_times_in_a_row(falling):
    falling.stiffness, falling.stands = [1.0, 1.2, 1.5, 1.9], 3
    _, (found, it) = stiffened()
    assert found == "trial 3"
    assert falling.asked == pytest.approx([1.1, 1.1 * 1.2, 1.1 * 1.5])
    assert falling.judged == [f"built trial {k}" for k in range(4)]
    falling.judged.clear()
    falling.repaired.clear()
    falling.stands = 4
    search, (found, it) = stiffened()
    assert found is None
    assert len(falling.judged) == 4, "and no further"
    assert (it.point, it.stiffness, it.fallen, it.fell) == ("start", 1.0, (1, 2, 3, 4), True)
    assert search.evaluator.problem == ("inner", 1.0, None), "as before"


@pytest.mark.parametrize(
    ("stiffness", "left", "judged"),
    [
        ([1.0, 1.005, 9.0], 100, 1),  # less than a hundredth more is no gain
        ([1.0, 1.015, 1.016], 100, 2),
        ([0.0, 9.0], 100, 1),  # nothing to stiffen
        ([1.0, 1.2], 0, 1),  # no evaluation left
    ],
)
def test_a_design_is_given_up_where_it_gets_no_stiffer(falling, stiffness, left, judged):
    falling.stiffness = stiffness
    _, (found, _) = stiffened(searching(left))
    assert found is None
    assert len(falling.judged) == judged


def test_with_structures_in_mind_those_that_fall_join_them_and_no_stiffness_is_asked_for(falling):
    falling.stiffness, falling.stands = [1.0, 0.9, 0.8], 2
    _, (found, it) = stiffened(mind="some")
    assert found == "trial 2"
    assert falling.asked == []
    assert it.mind == (("some", "built trial 0"), "built trial 1")


@pytest.fixture
def thinning(monkeypatch):
    """Batches of told cables, each of which may go or not; budgets, batches and aims are kept."""
    told = SimpleNamespace(batches=[], go=[], seen=[], noted=[], aims=[], count=40, repaired=[])

    def leaving(search, it, model):
        told.seen.append((it.batch, it.failures))
        return np.array(told.batches.pop(0), dtype=int) if told.batches else np.zeros(0, dtype=int)

    def made(search, it, trial, budget):
        told.seen[-1] = (*told.seen[-1], budget)
        return (trial if told.go.pop(0) else None), replace(it, fell=told.fell)

    def repaired(search, it, trial, *, reviving):
        assert reviving is (it.mind is not None), "else those that went would come back for the shape"
        told.repaired.append(trial)
        return trial, it

    told.fell, told.trial = False, SimpleNamespace(objective=0.5)
    monkeypatch.setattr(phases, "pausing", lambda *_: False)
    monkeypatch.setattr(phases, "_without_slack", lambda search, it: it)
    monkeypatch.setattr(phases, "tell", lambda *_: None)
    monkeypatch.setattr(phases, "taut_count", lambda *_: told.count)
    monkeypatch.setattr(phases, "allowed", lambda *_: 0.01)
    monkeypatch.setattr(phases, "_leaving", leaving)
    monkeypatch.setattr(phases, "_tensioned", lambda search, it: np.ones(5, dtype=bool))
    monkeypatch.setattr(phases, "attempt_without", lambda *_: told.trial)
    monkeypatch.setattr(phases, "_made_to_stand", made)
    monkeypatch.setattr(phases, "_repaired", repaired)
    monkeypatch.setattr(
        phases, "noted", lambda search, it, trial, kept: told.noted.append((trial, kept)) or it
    )
    monkeypatch.setattr(
        phases, "accepted", lambda search, it, found: replace(it, accepted=(*it.accepted, found))
    )
    monkeypatch.setattr(phases, "stiffness_of", lambda *_: 2.0)
    monkeypatch.setattr(phases, "_aiming_for", lambda search, it, aim: told.aims.append(aim) or it)
    monkeypatch.setattr(phases, "remembering", lambda search, it: replace(it, mind=f"{it.mind} remembered"))
    return told


def thinned(search=None, **changes):
    given = {"thrifty": 0.6, "batch": 6, "needed": np.zeros(5, dtype=bool), "status": "settled", **changes}
    return phases._thin(
        search or searching(solver=sf.SequentialConvex(failures=2)), iterate(point(0.4), **given)
    )


def test_batches_grow_while_cables_go_and_are_cut_where_they_do_not_until_single_ones_fail_in_a_row(thinning):
    thinning.batches = [[0, 1, 2, 3], [0, 1], [4], [4], [2], [3]]
    thinning.go = [True, False, False, True, False, False]
    end = thinned()
    assert [each[:2] for each in thinning.seen] == [(6, 0), (8, 0), (1, 0), (1, 1), (2, 0), (1, 1)]
    assert {(budget.objective, budget.deviation) for *_, budget in thinning.seen} == {(0.6, 0.01)}
    assert (end.failures, end.needed.tolist()) == (2, [False, False, True, True, True])
    assert end.status == "settled, and no further cable can be taken away"
    assert thinning.noted == [(thinning.trial, False)] * 4
    assert len(end.accepted) == 3
    assert thinning.aims == pytest.approx([0.95 * 2.0] * 2)


def test_a_larger_batch_that_fails_is_cut_to_a_third(thinning):
    thinning.batches, thinning.go = [[0, 1, 2, 3, 4], [0]], [False, False]
    end = thinned(searching(2, solver=sf.SequentialConvex(failures=1)), needed=np.ones(5, dtype=bool))
    assert [each[:2] for each in thinning.seen] == [(6, 0), (1, 0)]
    assert end.needed.tolist() == [True, False, False, False, False], (
        "what goes with others isn't needed for itself"
    )


def test_down_to_so_many_cables_they_go_whatever_they_cost(thinning):
    solver = sf.SequentialConvex(failures=1, most_cables=39)
    thinning.batches, thinning.go = [[1]], [False]
    end = thinned(searching(solver=solver))
    assert thinning.seen[0][-1] == Budget(np.inf, 0.01)
    assert end.status.endswith("taken away; no design with 39 cables was found that keeps every limit")
    thinning.count, thinning.seen, thinning.batches, thinning.go = 39, [], [[1]], [False]
    end = thinned(searching(solver=solver))
    assert thinning.seen[0][-1] == Budget(0.6, 0.01)
    assert end.status.endswith("and no further cable can be taken away")


def test_thinning_says_what_it_ended_with(thinning):
    assert thinned().status == "settled, and every cable that is left is needed for stability"
    thinning.count = 0
    assert thinned().status == "settled, and no cable is left"
    assert thinned(searching(0)).status == "settled, and thinning ended with its last evaluation"


@pytest.mark.parametrize(("objective", "repaired"), [(1.19, 1), (1.21, 0)])
def test_what_costs_twice_the_budget_is_not_repaired(thinning, objective, repaired):
    thinning.trial = SimpleNamespace(objective=objective)
    thinning.batches, thinning.go = [[1]], [False]
    thinned(searching(solver=sf.SequentialConvex(failures=1)))
    assert len(thinning.repaired) == repaired


@pytest.mark.parametrize(("fell", "repaired", "aims"), [(True, 0, [2.0]), (False, 1, [])])
def test_a_trial_that_falls_as_built_is_not_repaired_and_one_that_breaks_a_limit_is(
    thinning, fell, repaired, aims
):
    thinning.fell, thinning.batches, thinning.go = fell, [[1]], [False, False]
    thinned(searching(asked="asked", solver=sf.SequentialConvex(failures=1)))
    assert len(thinning.repaired) == repaired
    assert thinning.aims == aims
    assert len(thinning.go) == 1 - repaired


def test_with_structures_in_mind_they_are_remembered_in_each_design_and_no_stiffness_is_aimed_for(thinning):
    thinning.batches, thinning.go = [[1], [2]], [True, True]
    end = thinned(mind="some")
    assert end.mind == "some remembered remembered"
    assert thinning.aims == []


def test_a_trial_off_the_branch_is_no_trial_to_judge(thinning):
    thinning.trial, thinning.batches, thinning.go = None, [[1]], [False]
    end = thinned(searching(asked="asked", solver=sf.SequentialConvex(failures=1)))
    assert (len(thinning.repaired), end.failures) == (0, 1)
    assert thinning.noted == [(end.point, False)], "in the place of one"


@pytest.mark.parametrize(("idle", "left"), [(0.2, False), (0.3, True)])
def test_cables_leave_the_search_that_pull_under_no_load_once_they_are_a_fifth(monkeypatch, idle, left):
    """Of six candidates five are present; the fourth of these pulls nowhere, others under one of two
    loads."""
    pulls = {"wet": [1.0, 0.0, 2.0, 0.0, 0.0], "wetter": [1.0, 3.0, 0.0, -1.0, 0.5]}
    cables = SimpleNamespace(tension=lambda state: np.array(pulls[state]))
    search = searching(solver=sf.SequentialConvex(idle=idle))
    search.problem.shell.cables = lambda design: cables
    search.evaluator.seed = lambda design, states, stage: SimpleNamespace(design=design, states=states)
    monkeypatch.setattr(phases, "accepted_design", lambda search, point: "without")
    design = Design(np.ones(6), np.array([True, False, True, True, True, True]), 0.1)
    begun = iterate(
        SimpleNamespace(design=design, states={name: name for name in pulls}),
        accepted=("first", "second", "last"),
        tensioned=np.array([True, False, False, True, False]),
        needed=np.array([False, True, False, False, True]),
    )
    found = phases._without_slack(search, begun)
    if left:
        assert found is begun
        return
    assert found.point.design.present.tolist() == [True, False, True, True, False, True]
    assert found.tensioned.tolist() == [True, False, False, False]
    assert found.needed.tolist() == [False, True, False, True]
    assert found.accepted == ("first", "second", "without")


@pytest.mark.parametrize(("window", "after"), [(0.3, 0.2), (1.0, 0.4), (9.0, 3.6), (40.0, 4.0)])
def test_after_a_repair_the_window_is_at_least_a_twentieth_of_a_mean_tension_and_at_most_one(
    monkeypatch, window, after
):
    monkeypatch.setattr(phases, "propose", lambda *_: (None, 0.0))
    monkeypatch.setattr(phases, "task", lambda *_, reviving: None)
    monkeypatch.setattr(phases, "attempt", lambda search, it, model, y: (None, it))
    search = searching(solver=sf.SequentialConvex(repairs=1))
    found, it = phases._repaired(search, iterate("before", window=window), "trial")
    assert (found, it.point) == ("trial", "before")
    assert it.window == pytest.approx(after)


KEPT = np.array([0.9, 1.0, 0.4, 0.8, 0.8])  # of the stiffness without each cable
PULLS = np.array([3.0, 0.0, 1.0, 2.5, 2.0, 77.0])  # the last one is no tension


@pytest.fixture
def leaving(monkeypatch):
    """The order in which cables leave that pull so, the fifth of which is needed, and what was asked for it.
    The third of six candidates isn't present."""
    asked = []

    def kept_stiffness(assembly, state, cables, looked):
        asked.append((assembly, state, looked.tolist()))
        return np.diag(KEPT[looked])

    monkeypatch.setattr(phases, "kept_stiffness", kept_stiffness)
    monkeypatch.setattr(
        phases, "removable", lambda kept, order, most, least: asked.append((most, least)) or order
    )
    monkeypatch.setattr(phases, "missed_without", lambda *_: np.array([0.0, 0.0, 0.0, 0.9, 0.0]))
    design = Design(np.ones(6), np.array([True, True, False, True, True, True]), 0.1)

    def order(batch, mind, patch=None, **settings):
        monkeypatch.setattr(phases, "patches", lambda shell: np.array(patch))
        model = SimpleNamespace(origin=PULLS, tensions=5, assembly="assembly")
        search = searching(solver=sf.SequentialConvex(candidates=1, kept=0.15, **settings))
        at = SimpleNamespace(states={"wet": "rest", "wetter": "under more"}, design=design)
        it = iterate(at, needed=np.arange(5) == 4, batch=batch, mind=mind)
        return phases._leaving(search, it, model).tolist(), asked

    return order


@pytest.mark.parametrize(
    ("mind", "order"),
    [
        # by what is lost of the stiffness without each and what it pulls, as shares of all
        (None, [0, 3, 2]),
        # the fourth is missed most by a structure in mind
        ("mind", [0, 2, 3]),
    ],
)
def test_cables_go_by_what_they_hold_and_pull_and_what_structures_in_mind_would_miss(leaving, mind, order):
    asked = [("assembly", "under more", [0, 1, 2, 3, 4]), (3, 0.15)]
    assert leaving(3, mind) == (order, asked)


@pytest.mark.parametrize(
    ("batch", "mind", "patch", "some", "order"),
    [
        (3, None, [0, 1, 1, 2, 3, 3], [0, 2, 3], [0, 3, 2]),
        # the fourth as if what the first pulls, of the same patch, were made of it too
        (3, None, [0, 1, 1, 7, 0, 3], [0, 2, 3], [0, 2, 3]),
        (3, "mind", [0, 1, 7, 0, 2, 3], [0, 2, 3], [0, 2, 3]),
        (2, None, [0, 1, 1, 5, 5, 3], [0, 2], [0, 2]),  # so many are looked at as the batch takes
    ],
)
def test_of_many_cables_patches_give_as_much_pull_as_others_do(leaving, batch, mind, patch, some, order):
    asked = [("assembly", "under more", some), (batch, 0.15)]
    assert leaving(batch, mind, patch, many=4) == (order, asked)


def test_a_batch_of_many_cables_is_no_larger_than_the_largest(leaving):
    _, asked = leaving(3, None, [0, 1, 2, 3, 4, 5], many=4, largest=2)
    assert asked == [("assembly", "under more", [2, 3]), (2, 0.15)]
