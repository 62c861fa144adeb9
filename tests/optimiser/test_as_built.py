"""A search that is asked for designs that stand as built."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.gridshell.tolerances import enlarged
from shellform.optimiser import optimise as optimiser
from shellform.optimiser import trials
from shellform.optimiser.solver import POLISHING
from shellform.problem.paths import deviations
from shellform.problem.terms import LoadedDesign
from shellform.reliability import demands
from shellform.reliability.demands import demand, required
from shellform.reliability.requirements import FRESH, MOST, SEED, Demand, Required
from shellform.reliability.scenarios import scenarios
from shellform.reliability.standing import sample
from shellform.reliability.trial_structures import JudgedTrial, confirm, judge_trial, try_structures
from tests.problems import misfit_and_force

ROUGH = sf.Tolerances(cable_length=2e-4, supports=1e-4, marks=2e-4, load_each=0.1, load_all=0.05)
ASKED = sf.Safety(ROUGH, critical_factor=None, drawn=10, tried=6, seed=5)


@pytest.fixture(scope="module")
def problem(stout):
    return misfit_and_force(stout, 4.5)


@pytest.fixture(scope="module")
def found(stout, problem):
    kept = []
    return sf.optimise(problem, stout.design(), evaluations=50, safety=ASKED, keep=kept.append), kept


def test_the_design_found_has_fewer_cables_and_stands_as_a_fresh_sample_says(stout, problem, found):
    best, _ = found
    assert best.design.present.sum() < 0.8 * stout.design().present.sum()
    judged = sf.judge(stout, best.design, problem.loads, replace(ASKED, seed=999), design_load="wet")
    assert judged.holds, judged.failed


def test_a_search_with_safety_resumed_in_thinning_ends_with_the_same_design_to_the_bit(stout, problem, found):
    whole, kept = found
    for phase in ("descend", "thin"):
        place = [each.numbers["phase"] for each in kept].index(phase)
        again = sf.optimise(problem, stout.design(), evaluations=50, safety=ASKED, resume=kept[place])
        np.testing.assert_array_equal(again.design.rest_length, whole.design.rest_length)
        np.testing.assert_array_equal(again.design.present, whole.design.present)
        assert (again.evaluations, again.status) == (whole.evaluations, whole.status)


def test_where_no_accepted_design_stands_the_search_says_so(stout, problem, monkeypatch):
    def falls(shell, design, asked, **how):
        return replace(judge_trial(shell, design, asked, **how), stands=False)

    monkeypatch.setattr(trials, "judge_trial", falls)
    best = sf.optimise(
        problem, stout.design(), evaluations=4, safety=ASKED, solver=sf.SequentialConvex(thin=False)
    )
    assert "no design was found that stands as built" in best.status


def test_polishing_that_spends_what_stands_comes_back_with_the_design_before_it(found, monkeypatch):
    best, _ = found
    before = best.design

    def only_before(shell, design, asked, **how):
        own = judge_trial(shell, design, asked, **how)
        return replace(own, stands=bool(np.array_equal(design.rest_length, before.rest_length)))

    monkeypatch.setattr(trials, "judge_trial", only_before)
    monkeypatch.setattr(trials, "confirm", only_before)
    polished = sf.polish(best, evaluations=4)
    np.testing.assert_array_equal(polished.design.rest_length, before.rest_length)
    assert polished.status == "no design with less misfit was found"


def test_structures_of_polished_designs_are_sought_where_they_rested_in_the_search(found, monkeypatch):
    best, _ = found
    assert best.rested["wetter"].drawn, "the design that was found stood, and where is known"
    known = []

    def judged(shell, design, asked, **how):
        known.append(how["before"])
        return judge_trial(shell, design, asked, **how)

    monkeypatch.setattr(trials, "judge_trial", judged)
    sf.polish(best, evaluations=4)
    assert known[0] is best.rested


def test_where_no_polished_design_stands_the_design_before_it_comes_back(found, monkeypatch):
    best, _ = found

    def falls(shell, design, asked, **how):
        return replace(judge_trial(shell, design, asked, **how), stands=False)

    monkeypatch.setattr(trials, "judge_trial", falls)
    monkeypatch.setattr(trials, "confirm", falls)
    for one in (best, replace(best, mind={0: 1.0})):
        polished = sf.polish(one, evaluations=3)
        np.testing.assert_array_equal(polished.design.rest_length, best.design.rest_length)


def test_a_design_that_structures_led_to_is_polished_with_these_in_mind_and_judged_afresh(
    stout, found, monkeypatch
):
    best, _ = found
    trial = best.asked.trial
    one = replace(trial, loads={"wet": trial.loads["wet"]}, fallen={"wet": 0})
    asked = Demand(
        one, replace(one, safety=replace(one.safety, enlarged=1.0, drawn=20, tried=20), first=FRESH)
    )
    judged = []

    def fresh(shell, design, asked, **how):
        judged.append(asked)
        return confirm(shell, design, asked, **how)

    monkeypatch.setattr(trials, "confirm", fresh)
    free = sf.polish(replace(best, asked=replace(asked, confirmed=None)), evaluations=4)
    aims = {0: 20.0, 1: 20.0}  # more than they bear: what they bear is kept
    held = sf.polish(replace(best, asked=asked, mind=aims), evaluations=4)
    assert held.objective < held.objective_start
    assert 1.0 > held.history[1].objective > free.history[1].objective, "in smaller steps"
    assert held.mind.keys() == aims.keys()
    assert [each.first for each in judged] == [FRESH]
    case, seed = sf.LoadCase("wet", one.loads["wet"]), one.safety.seed + SEED
    mind = scenarios(stout, best.design, case, one.tolerances, seed=seed, least=held.mind, most=20.0)
    bear = [
        mind.measure(LoadedDesign(stout, each.design, each.states["wet"], None)).value
        for each in (best, held)
    ]
    assert bear[0] == pytest.approx(1.0 / 0.99, abs=1e-3), "of what they bear a hundredth may be lost"
    assert (bear[1] > 0.99).all(), "an aim may be missed by a little"


def test_with_structures_in_mind_polishing_goes_on_from_where_it_ended(found, monkeypatch):
    best = replace(found[0], mind={0: 1.0})
    asked, told = [], []

    def once(before, solver, least, evaluations, groups, progress, judging):
        asked.append((before, evaluations))
        if progress is not None:
            progress(replace(before.history[0], evaluation=2))
        after = made.pop(0)
        return replace(before, status="none better") if after is None else after

    def better(objective, evaluations=5, **changes):
        design = replace(best.design, rest_length=best.design.rest_length * (1.0 - 1e-9 * len(made)))
        history = (replace(best.history[0], evaluation=1),)
        return replace(
            best, design=design, objective=objective, objective_start=1.0, evaluations=evaluations,
            history=history, **changes,
        )  # fmt: skip

    monkeypatch.setattr(optimiser, "_polished", once)
    made = []
    first, second = better(0.9), better(0.995, 4)
    made[:] = [first, second]
    polished = sf.polish(best, evaluations=12, progress=told.append)
    assert asked == [(best, 12), (first, 7)], "until a round gains less than a hundredth"
    assert polished.design is second.design
    assert polished.evaluations == 9
    assert [step.evaluation for step in polished.history] == [1, 6]
    assert [step.evaluation for step in told] == [2, 7]
    for made_now, rounds, kept in [
        ([better(0.9), None], 2, 0),
        ([better(0.9, 12)], 1, 0),
        ([better(0.9, mind={})], 1, 0),
        ([None], 1, None),
    ]:
        asked.clear()
        made[:], before = made_now, list(made_now)
        polished = sf.polish(best, evaluations=12)
        assert len(asked) == rounds
        assert polished.design is (best.design if kept is None else before[kept].design)
    asked.clear()
    made[:] = [better(0.9), better(0.5)]
    limit = 0.5 * float(deviations(best.problem.shell, best.states["wet"]).max())
    far = made[1]
    off = far.states["wet"]
    moved = replace(off, positions=1.01 * off.positions)
    reached = far.loaded["wet"]
    away = replace(reached, equilibrium=replace(reached.equilibrium, state=moved))
    made[1] = replace(far, loaded={**far.loaded, "wet": away})
    polished = sf.polish(best, solver=replace(POLISHING, deviation=limit), evaluations=12)
    assert len(asked) == 2
    assert polished.objective == 0.9, "a round that brings a node farther off than it was isn't kept"


def test_a_design_with_a_node_too_far_off_is_polished_for_its_farthest_nodes_too(stout, found):
    best, _ = found
    best = replace(best, asked=None)

    def farthest(polished):
        return float(deviations(stout, polished.states["wet"]).max())

    usual, kept = (
        sf.polish(best, solver=replace(POLISHING, deviation=each), evaluations=12)
        for each in (None, 1.001 * farthest(best))
    )
    np.testing.assert_array_equal(kept.design.rest_length, usual.design.rest_length)
    led = sf.polish(best, solver=replace(POLISHING, deviation=0.999 * farthest(best)), evaluations=12)
    assert [part.term for part in led.problem.minimise] == [sf.Misfit("wet"), sf.Bulges("wet")]
    assert farthest(led) < min(farthest(usual), farthest(best))


def test_polishing_serves_what_the_objective_holds_of_the_shape_as_built_in_every_round(stout, found):
    best, _ = found
    case = best.problem.design_load
    built = sf.built_misfit(stout, best.design, case, ROUGH, seed=3, pairs=2)
    shares = [sf.Share(0.2, sf.Misfit("wet")), sf.Share(0.6, built), sf.Share(0.2, sf.CableForce("wet"))]
    told = replace(best, asked=None, problem=replace(best.problem, minimise=shares))

    def served(polished):
        return [(round(part.share, 9), part.term.name) for part in polished.problem.minimise]

    one = sf.polish(told, evaluations=6)
    assert served(one) == [(0.25, "misfit"), (0.75, "built_misfit")]
    near = replace(POLISHING, deviation=1e-9)
    led = sf.polish(told, solver=near, evaluations=2)
    assert served(led) == [(0.125, "misfit"), (0.375, "built_misfit"), (0.5, "bulges")]
    assert served(sf.polish(led, solver=near, evaluations=2)) == served(led)

    def as_built(design, state):
        return built.measure(LoadedDesign(stout, design, state, case.force)).value[0]

    assert as_built(one.design, one.states["wet"]) < as_built(best.design, best.states["wet"])


def test_cables_keep_a_tension_that_errors_of_their_lengths_leave_them(stout, problem, found):
    best, _ = found
    asked, start = best.asked, stout.design()
    least = optimiser._least_tension(problem, start, asked)
    stiff = stout.cables(start)
    assert least >= 0.5 * np.median(stiff.stiffness / stiff.rest_length) * ROUGH.cable_length
    trial = replace(asked.trial, safety=replace(asked.trial.safety, margin=1.0))
    assert optimiser._least_tension(problem, start, replace(asked, trial=trial)) == pytest.approx(2.0 * least)
    none = replace(asked, trial=replace(asked.trial, safety=replace(asked.trial.safety, margin=0.0)))
    bare = replace(start, present=np.zeros_like(start.present))
    for given, design in ((none, start), (None, start), (asked, bare)):
        assert optimiser._least_tension(problem, design, given) == 0.0


def test_structures_that_fell_before_come_first_and_refuse_early(stout, problem):
    heavy = {"wet": 2.2 * problem.loads["wet"]}
    asked = Required(ASKED, heavy, "wet", {"wet": 6})
    every = try_structures(stout, stout.design(), asked)
    assert every.fallen["wet"]
    strict = Required(ASKED, heavy, "wet", {"wet": 0})
    early = try_structures(stout, stout.design(), strict, first=every.fallen["wet"][-1:])
    assert not early.stands
    assert early.factorisations < every.factorisations


def test_a_search_tries_more_structures_where_its_start_bears_none_with_enlarged_errors(stout, problem):
    asked = replace(ASKED, enlarged=1.5, drawn=60)
    for factor, larger, searched in ((1.0, 1.5, 6), (2.2, 1.0, MOST)):
        loads = {"wet": factor * problem.loads["wet"]}
        found = demand(stout, stout.design(), loads, asked, design_load="wet")
        trial, fresh = found.trial.safety, found.confirmed.safety
        assert (trial.enlarged, trial.tried, fresh.enlarged, fresh.tried) == (larger, searched, 1.0, 60)


def test_numbers_make_up_for_errors_that_the_start_doesnt_bear_as_large_as_asked_for(
    stout, problem, monkeypatch
):
    def bears_half(shell, start, asked, **_):
        return JudgedTrial(dict.fromkeys(asked.loads, ()), True, asked.safety.enlarged <= 1.25, 0)

    monkeypatch.setattr(demands, "try_structures", bears_half)
    asked = replace(ASKED, enlarged=1.5)
    found = demand(stout, stout.design(), {"wet": problem.loads["wet"]}, asked, design_load="wet")
    assert (found.trial.safety.enlarged, found.trial.safety.tried) == (1.25, MOST)
    assert not found.trusted


def test_a_fresh_sample_as_large_as_the_final_one_confirms_and_lets_one_fall_less(stout, problem):
    asked = replace(ASKED, enlarged=1.5, drawn=200, probability_design=0.99)
    found = demand(stout, stout.design(), {"wet": problem.loads["wet"]}, asked, design_load="wet")
    assert found.confirmed.safety.tried == 200
    assert found.sample(0).fallen == {"wet": 1}
    assert found.unspared().sample(0).fallen == {"wet": 2}, "as many as where a finished design is judged"
    every = [set(found.trial.numbers), *({*found.sample(number).numbers} for number in range(3))]
    assert len(set.union(*every)) == sum(len(own) for own in every), "no sample has seen another's structures"
    assert vars(found.after(2).sample(1)) == vars(found.sample(3))
    assert replace(found, confirmed=None).after(2).confirmed is None
    assert found.trusted


def test_structures_of_fresh_samples_are_drawn_with_errors_as_they_are_and_count_under_the_design_load_alone(
    stout, problem
):
    loads = {"wet": 2.2 * problem.loads["wet"], "wetter": 2.4 * problem.loads["wet"]}
    asked = Required(ASKED, loads, "wet", {"wet": 0, "wetter": 0})
    assert asked.tolerances(0) == enlarged(ROUGH, ASKED.enlarged)
    assert asked.tolerances(FRESH) == ROUGH
    numbers = range(FRESH, FRESH + 8)
    of_one = replace(asked, safety=replace(ASKED, tried=8), first=FRESH)
    fell = try_structures(stout, stout.design(), of_one, whole=True).fallen
    assert fell["wet"]
    assert fell["wetter"]
    few = replace(asked, safety=replace(ASKED, tried=1))
    own = try_structures(stout, stout.design(), few, whole=True).fallen
    found = try_structures(stout, stout.design(), few, first=numbers, whole=True).fallen
    assert found == {"wet": (*fell["wet"], *own["wet"]), "wetter": own["wetter"]}


def test_no_more_is_asked_of_designs_than_the_start_shows(stout, problem):
    heavy = {"wet": 1.4 * problem.loads["wet"], "wetter": 2.2 * problem.loads["wet"]}
    asked = required(stout, stout.design(), heavy, ASKED, design_load="wet")
    assert asked.fallen["wetter"] > 0
    assert judge_trial(stout, stout.design(), asked).stands
    named = required(
        stout, stout.design(), heavy, replace(ASKED, probability_additional=0.99), design_load="wet"
    )
    assert named.fallen["wetter"] == 0


def test_as_many_may_fall_in_fresh_samples_as_of_those_structures_of_the_start_that_judge_the_end(
    stout, problem
):
    heavy = {"wet": 1.4 * problem.loads["wet"], "wetter": 2.2 * problem.loads["wet"]}
    found = demand(stout, stout.design(), heavy, replace(ASKED, drawn=30), design_load="wet")
    last = sample(stout, stout.design(), heavy["wetter"], ROUGH, count=30, seed=ASKED.seed).standing
    assert 0 < found.confirmed.fallen["wetter"] == last.drawn - last.standing < 30
    assert found.confirmed.numbers == range(FRESH, FRESH + 30)
    assert found.confirmed.safety.seed == ASKED.seed, "but drawn they are apart"


def test_a_design_is_confirmed_only_with_its_critical_factor_on_the_halved_mesh(stout, problem):
    loads = {"wet": problem.loads["wet"]}
    for factor, holds in ((1.05, True), (5.0, False)):
        safety = replace(ASKED, critical_factor=factor, tried=1)
        assert confirm(stout, stout.design(), Required(safety, loads, "wet", {"wet": 1})).stands == holds
