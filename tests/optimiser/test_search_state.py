"""What a search adds to its problem, tells of its trials and hands out at its end, without an equilibrium
solved."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import search_state
from shellform.optimiser.search_state import Iterate, Models, Search, aimed, in_mind, restiffened, stiff
from shellform.problem.engineering import ModalStiffness
from shellform.reliability.scenarios import FactorsAsBuilt, Scenario

LOAD = np.zeros((3, 6))
LOAD[1, 2] = -2.0
SHELL = SimpleNamespace(node_count=3)


def problem_of(**changes):
    """One with limits under every further load but `idle`; `still` is without force."""
    cases = [("wetter", LOAD), ("wind", LOAD), ("idle", LOAD), ("still", 0.0 * LOAD)]
    limits = [
        sf.AtMost(0.005, sf.RmsMisfit("wetter")),
        sf.AtLeast(2.0, ModalStiffness("wind", 2.0)),
        sf.AtMost(0.01, sf.RmsMisfit("still")),
    ]
    given = {
        "minimise": [sf.Share(1.0, sf.Misfit("wet"))],
        "constraints": limits,
        "further": [sf.LoadCase(*case) for case in cases],
    }
    return sf.Problem(SHELL, sf.LoadCase("wet", LOAD), **{**given, **changes})


def mind_of(*numbers):
    case = sf.LoadCase("wetter", LOAD)
    return FactorsAsBuilt(case, tuple(Scenario(number, None, 1.03) for number in numbers), None, 1.0)


def test_the_softest_mode_is_to_keep_its_stiffness_under_each_further_load_that_has_no_limit_on_it():
    problem = problem_of()
    found = stiff(problem, 3.0)
    assert list(found.constraints[:3]) == list(problem.constraints)
    assert found.constraints[3:] == [sf.AtLeast(3.0, ModalStiffness("wetter", 3.0))]
    assert stiff(problem, 0.0) is problem


def test_structures_in_mind_are_to_bear_what_they_have_to():
    problem, mind = problem_of(), mind_of(4, 7)
    assert aimed(problem, 0.0, None) is problem
    *_, soft, aim = aimed(problem, 3.0, mind).constraints
    assert soft.term == ModalStiffness("wetter", 3.0)
    assert (aim.term, aim.lower, aim.upper) == (mind, 1.0, np.inf)
    search = SimpleNamespace(inner=problem, evaluator=SimpleNamespace(problem=aimed(problem, 3.0, mind)))
    assert in_mind(search) == 2
    search.evaluator.problem = stiff(problem, 3.0)
    assert in_mind(search) == 0


def search_of(**changes):
    evaluator = SimpleNamespace(evaluations=3, base="wet", factorisations=50)
    given = {
        "problem": problem_of(),
        "solver": sf.SequentialConvex(window=0.3),
        "evaluator": evaluator,
        "bounded": (),
        "evaluations": 10,
        "tension": 2.5,
        "objective_start": 1.0,
        "inner": problem_of(),
        "softest": 4.0,
        "asked": None,
        "least": 0.0,
        "groups": None,
        "always_guarded": False,
        "progress": None,
        "keep": None,
        "judging": None,
        "began": 0.0,
        "models": None,
    }
    return Search(**{**given, **changes})


def iterate(point=None, **changes):
    given = Iterate(point, (), (), 5.0, 0.5, 0.01, 0.15, False, np.zeros(3, dtype=bool), np.ones(2))
    return replace(given, **changes)


def test_windows_begin_in_mean_tensions_and_evaluations_are_counted_down():
    search = search_of()
    assert (search.first_window, search.left(), search.base) == (pytest.approx(0.75), 7, "wet")


def test_with_another_stiffness_to_keep_a_search_forgets_what_trials_have_shown():
    search, seeded = search_of(), []

    def seed(design, states, stage, *, before):
        seeded.append((design, states, stage, before, list(search.evaluator.problem.constraints)))
        return SimpleNamespace(constraints=np.ones(4))

    search.evaluator.seed = seed
    begun = iterate(SimpleNamespace(design="design", states="states"), window=7.0)
    found = restiffened(search, begun, 3.0)
    assert (found.stiffness, found.window, found.excess.tolist()) == (3.0, pytest.approx(0.75), [0.0] * 4)
    ((*where, constraints),) = seeded
    assert where == ["design", "states", 0.5, begun.point]
    assert constraints[-1] == sf.AtLeast(3.0, ModalStiffness("wetter", 3.0))


def test_structures_are_kept_in_mind_a_quarter_beyond_what_they_are_to_bear(monkeypatch):
    heard = []

    def scenarios(shell, design, case, tolerances, **how):
        heard.append((shell, design, case.name, case.force.sum(), tolerances, how))
        return "scenarios"

    monkeypatch.setattr(search_state, "scenarios", scenarios)
    monkeypatch.setattr(search_state, "remembered_in", lambda shell, design, drawn: (design, drawn))
    monkeypatch.setattr(search_state, "largest_on_path", lambda asked: ("wetter", {}))
    trial = SimpleNamespace(safety=SimpleNamespace(seed=5), tolerances="errors", loads={"wetter": 1.5 * LOAD})
    search = search_of(asked=SimpleNamespace(trial=trial))
    assert search_state.kept_in_mind(search, "design", {3: 0.8, 4: 1.2}) == ("design", "scenarios")
    ((*what, how),) = heard
    assert what == [SHELL, "design", "wetter", -3.0, "errors"]
    assert how == {"seed": 5 + 2, "least": {3: 0.8, 4: 1.2}, "most": 1.5, "exact": 0.01}


def test_a_trial_is_recorded_with_its_pulling_cables_and_each_limit_s_worst_value(monkeypatch):
    """Limits on single cables as well as those of the problem, but no aims of structures in mind."""
    told = []
    mind = mind_of(1, 2)
    inner = problem_of(
        minimise=[sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wetter"))],
        constraints=[
            sf.AtMost(0.005, sf.RmsMisfit("wetter")),
            sf.AtMost(9.0, sf.CableForces("wind", (0, 1))),
        ],
    )
    evaluator = SimpleNamespace(evaluations=6, problem=aimed(inner, 0.0, mind))
    search = search_of(
        inner=inner,
        evaluator=evaluator,
        bounded=(sf.AtMost(4.0, sf.CableForces("wet")),),
        progress=told.append,
        began=1.0,
    )
    monkeypatch.setattr(search_state, "tensions", lambda *_: np.array([3.0, 0.0, 5.0, 1.0, 0.0]))
    monkeypatch.setattr(search_state.time, "perf_counter", lambda: 3.5)
    point = SimpleNamespace(
        objective=0.9, terms=np.array([0.6, 0.3]), constraints=np.array([0.25, -0.5, -0.125, 7.0, 8.0])
    )
    step = search_state.record(search, point, 0.5, True, "thin")
    assert told == [step]
    assert (step.evaluation, step.objective, step.cables, step.stage) == (6, 0.9, 3, 0.5)
    assert (step.accepted, step.seconds, step.phase) == (True, 2.5, "thin")
    assert step.terms == {"misfit": 0.6, "cable_force.wetter": 0.3}
    assert step.constraints == {"cable_force": 0.25, "misfit.wetter": 0.25, "cable_force.wind": -0.125}
    it = search_state.noted(search, iterate(history=("before",)), point, False)
    assert it.history[0] == "before"
    assert (it.history[1].accepted, it.history[1].phase) == (False, "climb")


def test_a_search_ends_with_its_design_on_its_own_path_and_what_is_asked_of_later_ones(monkeypatch):
    followed = []

    def follow(shell, design, loads):
        followed.append((design, {name: load.sum() for name, load in loads.items()}))
        return {name: SimpleNamespace(equilibrium=SimpleNamespace(state=name)) for name in loads}

    monkeypatch.setattr(search_state, "without_slack", lambda shell, design, state: (design, state))
    monkeypatch.setattr(search_state, "follow", follow)
    monkeypatch.setattr(
        search_state,
        "record",
        lambda search, point, stage, kept, phase: SimpleNamespace(
            objective=point, constraints=(stage, kept, phase)
        ),
    )
    work = {"evaluations": 9, "rejected": 2, "equilibria": 40, "factorisations": 99, "wasted": 11}
    evaluator = SimpleNamespace(**work, seed=lambda design, states, stage: (design, states["wind"], stage))
    search = search_of(
        evaluator=evaluator,
        asked=SimpleNamespace(after=lambda samples: f"after {samples}"),
    )
    point = SimpleNamespace(design="design", states={"wet": "rest"})
    it = iterate(
        point, accepted=("last",), samples=2, fallen=(8,), mind=mind_of(4), phase="agree", status="ended"
    )
    found = search_state.finish(search, it)
    assert found.design == ("design", "rest")
    ((_, loads),) = followed
    assert list(loads) == ["none", "wet", "wetter", "wind", "idle", "still"]
    assert (loads["none"], loads["wet"]) == (0.0, -2.0)
    assert (found.objective, found.constraints) == ((found.design, "wind", 1.0), (1.0, True, "agree"))
    assert (found.asked, found.fallen, found.mind, found.status) == ("after 3", (8,), {4: 1.03}, "ended")
    assert {name: getattr(found, name) for name in work} == work
    assert (found.stiffness, found.objective_start) == (5.0, 1.0)
    alone = search_state.finish(replace(search, asked=None), replace(it, mind=None))
    assert (alone.asked, alone.mind) == (None, {})
    with pytest.raises(NotConverged, match="carries all loads") as told:
        search_state.finish(search, replace(it, accepted=()))
    assert told.value.iterations == 99
    assert "denser grid" in told.value.remedy


class Modelled:
    """An evaluator of designs, its radius free or not, of all cables one by one or not."""

    base = "wet"

    def __init__(self, *, radius=True, each=slice(0, 5)):
        self.blocks = SimpleNamespace(moves_radius=radius, each_cable=each)
        self.shell = SimpleNamespace(
            beams_by_radius=lambda radius: ("rate", radius), cables=lambda design: "cables"
        )
        self.problem = problem_of()

    def assembly(self, design):
        return "assembly"


def point_of(count):
    present = np.arange(5) < count
    states = {name: f"state {name}" for name in ("wet", "wetter", "wind", "still")}
    return SimpleNamespace(design=Design(np.ones(5), present, 0.1), states=states)


@pytest.mark.parametrize(
    ("count", "whole", "each", "dense"),
    [(3, False, True, True), (4, False, True, False), (4, True, True, True), (4, False, False, True)],
)
def test_models_and_guards_are_dense_up_to_many_cables_or_where_they_have_to_be(
    monkeypatch, count, whole, each, dense
):
    made = []
    monkeypatch.setattr(search_state, "step_model", lambda *_, whole: ("model", *[whole]))
    for name, own in (("whole_guard", True), ("solved_guard", False)):
        monkeypatch.setattr(search_state, name, lambda *given, own=own: made.append((own, given)) or own)
    evaluator = Modelled(each=slice(0, 5) if each else None)
    models = Models(evaluator, sf.SequentialConvex(many=3), 0.7, whole=whole)
    point, other = point_of(count), point_of(count)
    assert models.at(point) == ("model", dense)
    first = models.at(point)
    assert models.at(point) is first
    assert models.at(other) is not first, "of another point"
    assert models.at(point) is not first, "of which the last one's alone is kept"
    assert models.guards(point) == [dense, dense]
    assert models.guards(point) is models.guards(point)
    assert [given for _, given in made] == [
        ("assembly", f"state {name}", "cables", 0.7, ("rate", 0.1)) for name in ("wetter", "wind")
    ], "where a further load pulls"
    models.guards(other)
    assert len(made) == 4, "anew for another point"
    made.clear()
    Models(Modelled(radius=False), sf.SequentialConvex(), 0.7).guards(point)
    assert [given[4:] for _, given in made] == [(), ()]
