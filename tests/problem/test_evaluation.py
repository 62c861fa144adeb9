"""How trial designs are evaluated: which equilibria count, in which order loads are tried, what is counted
and weighted."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.problem import evaluation, weights
from shellform.problem.evaluation import Evaluated, Evaluator, OffBranch
from shellform.structure.solve.factorisation import NotPositiveDefinite

TARGET = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.5], [0.0, 1.0, 0.5]])  # of 2 m
WET, WETTER, WIND = 1.0, 5.0, -3.0
LOADS = {"wet": WET, "wetter": WETTER, "wind": WIND}


@pytest.fixture
def evaluator(monkeypatch):
    monkeypatch.setattr(evaluation, "Blocks", lambda *_: None)
    problem = SimpleNamespace(
        shell=SimpleNamespace(target=SimpleNamespace(positions=TARGET)),
        design_load=SimpleNamespace(name="wet", force=WET),
        loads=LOADS,
        minimise=[],
        constraints=[],
        terms=[],
        variables=[],
        used=lambda: list(LOADS),
    )
    return Evaluator(problem, "start")


def off_by(away, **changes):
    """An equilibrium of which one node is so far off, m."""
    positions = TARGET.copy()
    positions[2, 1] += away
    given = {"state": SimpleNamespace(positions=positions), "stable": True, "factorisations": 3}
    return SimpleNamespace(**{**given, **changes})


def reached(away, *, on_branch=True, share=1.0):
    return SimpleNamespace(equilibrium=off_by(away), on_branch=on_branch, factorisations=4, share=share)


def test_a_stage_stands_for_so_much_of_the_way_from_the_design_load_to_a_further_one(evaluator):
    assert evaluator.load("wetter", 0.25) == 2.0
    assert evaluator.load("wind", 0.5) == -1.0
    assert evaluator.load("wet", 0.25) == 1.0


@pytest.mark.parametrize(
    ("first", "further", "farthest"),
    [
        # twenty times the larger misfit of those that are borne
        (0.05, 0.1, np.sqrt(20.0) * 0.1),
        (0.2, 0.1, np.sqrt(20.0) * 0.2),
        # a root mean square distance of a fiftieth of 2 m at the least, of four nodes
        (0.001, 0.002, 2.0 * 0.04),
    ],
)
def test_an_equilibrium_many_times_as_far_off_as_the_start_s_is_another_one(
    evaluator, monkeypatch, first, further, farthest
):
    paths = {"wet": reached(first), "wetter": reached(further), "wind": reached(1.0, on_branch=False)}
    monkeypatch.setattr(evaluation, "follow", lambda shell, start, loads: paths)
    monkeypatch.setattr(evaluation, "start_weights", lambda *given: given[1:])
    assert evaluator.begin() == paths
    assert (evaluator.factorisations, evaluator.equilibria) == (12, 3)
    assert evaluator.weights == ("start", paths)
    for away, kept in ((0.999 * farthest, True), (1.001 * farthest, False)):
        found = off_by(away)
        monkeypatch.setattr(evaluation, "next_equilibrium", lambda *_, found=found, **__: found)
        tried = evaluator._settled(None, None, None)
        assert (tried.state is found.state) == kept
        assert (tried.why == "") == kept
        assert tried.factorisations == 3


def test_a_start_that_was_followed_before_is_not_again_and_counts_the_same(evaluator, monkeypatch):
    paths = {"none": reached(9.0), "wet": reached(0.1), "wetter": reached(0.2), "wind": reached(0.3)}
    monkeypatch.setattr(evaluation, "start_weights", lambda *given: given[1:])
    monkeypatch.setattr(evaluation, "follow", None)
    own = {name: paths[name] for name in ("wet", "wetter", "wind")}
    assert evaluator.begin(paths) == own, "the problem's loads alone"
    assert (evaluator.factorisations, evaluator.equilibria) == (12, 3)
    assert evaluator.weights == ("start", own)


def test_a_start_is_followed_under_the_loads_alone_that_nobody_followed_it_under(evaluator, monkeypatch):
    """A limit may ask for a load that no load case has, such as that of a critical factor."""
    paths = {"wet": reached(0.1), "wetter": reached(0.2), "wind": reached(0.3)}
    asked = []

    def follow(shell, start, loads):
        asked.append(dict(loads))
        return {name: paths[name] for name in loads}

    monkeypatch.setattr(evaluation, "start_weights", lambda *given: given[1:])
    monkeypatch.setattr(evaluation, "follow", follow)
    assert list(evaluator.begin({"wet": paths["wet"]}).items()) == list(paths.items())
    assert asked == [{name: evaluator.problem.loads[name] for name in ("wetter", "wind")}]


def test_terms_of_a_changed_problem_that_were_measured_in_the_same_states_are_not_again(
    evaluator, monkeypatch
):
    measured = []

    def measure(term, at):
        measured.append(term.name)
        return SimpleNamespace(value=np.array([0.5]))

    kept, other, new = (SimpleNamespace(name=name, load="wet") for name in ("kept", "other", "new"))
    monkeypatch.setattr(evaluation, "measured", measure)
    monkeypatch.setattr(evaluation, "residuals", lambda part, value: value)
    monkeypatch.setattr(evaluator, "assembly", lambda design: None)
    monkeypatch.setattr(evaluator, "_at", lambda *_: None)
    evaluator.blocks, evaluator.weights = SimpleNamespace(of=lambda _: np.zeros(2)), np.ones(1)

    def posed(*limits):
        parts = [SimpleNamespace(term=each) for each in limits]
        evaluator.problem = SimpleNamespace(
            minimise=[SimpleNamespace(term=kept)], constraints=parts, terms=[kept, *limits]
        )

    posed(other)
    point = evaluator.seed("design", {}, 0.5)
    posed(new)
    again = evaluator.seed("design", {}, 0.5, before=point)
    assert again.measurements[0] is point.measurements[0]
    assert measured == ["kept", "other", "new"]
    evaluator.seed("design", {}, 1.0, before=point)  # under another load
    assert measured == ["kept", "other", "new", "kept", "new"]


def test_a_start_that_does_not_bear_the_design_load_is_told_how_far_it_came(evaluator, monkeypatch):
    paths = {"wet": reached(0.1, on_branch=False, share=0.734), "wetter": reached(0.1), "wind": reached(0.1)}
    monkeypatch.setattr(evaluation, "follow", lambda shell, start, loads: paths)
    with pytest.raises(NotConverged, match=r"'wet': it loses stability at 0\.73 of it") as told:
        evaluator.begin()
    assert "denser grid, thicker rods or stiffer cables" in told.value.remedy
    assert told.value.state is paths["wet"].equilibrium.state


def test_an_equilibrium_that_is_not_stable_or_not_found_is_none(evaluator, monkeypatch):
    asked = []

    def find(assembly, start, load, **how):
        asked.append(how)
        return off_by(0.01, stable=False)

    monkeypatch.setattr(evaluation, "next_equilibrium", find)
    found = evaluator._settled(None, None, None)
    assert (found.state, found.factorisations) == (None, 3)
    assert asked == [{"limit": 12}]

    def none(*_, **__):
        raise NotConverged("no equilibrium", iterations=7)

    monkeypatch.setattr(evaluation, "next_equilibrium", none)
    found = evaluator._settled(None, None, None)
    assert (found.state, found.factorisations) == (None, 7)
    assert "no equilibrium" in found.why


@pytest.fixture
def trying(evaluator, monkeypatch):
    """Which loads have equilibria next to the start, those that can be led to, and what was tried in which
    order."""
    told = SimpleNamespace(borne=set(LOADS), led=set(), tried=[], seeded=[])

    def settled(assembly, near, load):
        name = next(name for name, stage in LOADS.items() if load == WET + 0.5 * (stage - WET))
        told.tried.append(name)
        assert near == f"near {name}"
        return evaluation._Tried(name if name in told.borne else None, 5, f"{name} isn't borne")

    def led(design, known, load):
        name = next(name for name, stage in LOADS.items() if load == WET + 0.5 * (stage - WET))
        assert (design, known) == ("design", "wet")
        evaluator._count(8)
        if name not in told.led:
            raise OffBranch(f"{name} can't be led to")
        return f"{name} led"

    def seed(design, states, stage):
        told.seeded.append((design, states, stage))
        return "seeded"

    monkeypatch.setattr(evaluation, "side_by_side", lambda work, items: [work(each) for each in items])
    monkeypatch.setattr(evaluator, "assembly", lambda design, number: number)
    monkeypatch.setattr(evaluator, "_settled", settled)
    monkeypatch.setattr(evaluator, "_led", led)
    monkeypatch.setattr(evaluator, "seed", seed)
    told.evaluate = lambda lead: evaluator.evaluate(
        "design", {name: f"near {name}" for name in LOADS}, 0.5, lead=lead
    )
    return told


def test_a_trial_that_is_borne_under_every_load_is_measured_there(evaluator, trying):
    for lead, order in ((False, ["wind", "wetter", "wet"]), (True, ["wet", "wetter", "wind"])):
        trying.tried.clear()
        assert trying.evaluate(lead) == "seeded"
        assert trying.tried == order
        design, states, stage = trying.seeded[-1]
        assert (design, list(states.items()), stage) == ("design", [(name, name) for name in LOADS], 0.5)
    assert (evaluator.evaluations, evaluator.rejected, evaluator.wasted) == (2, 0, 0)
    assert (evaluator.factorisations, evaluator.equilibria) == (30, 6)


def test_a_trial_is_given_up_with_the_first_load_that_it_does_not_bear(evaluator, trying):
    trying.borne = {"wet", "wind"}
    evaluator.factorisations = 100
    with pytest.raises(OffBranch, match="wetter isn't borne"):
        trying.evaluate(False)
    assert trying.tried == ["wind", "wetter"], "the design load last, which it bears as a rule"
    assert (evaluator.evaluations, evaluator.rejected, evaluator.wasted) == (1, 1, 10)
    assert trying.seeded == []


def test_the_first_load_of_the_order_that_is_not_borne_gives_a_trial_up_whichever_is_found_first(
    evaluator, trying, monkeypatch
):
    """So that what a trial has spent, and why it is given up, hangs on no thread."""
    monkeypatch.setattr(
        evaluation, "side_by_side", lambda work, items: [work(each) for each in reversed(items)][::-1]
    )
    trying.borne = {"wind"}
    with pytest.raises(OffBranch, match="wetter isn't borne"):
        trying.evaluate(False)
    assert trying.tried == ["wet", "wetter", "wind"]
    assert evaluator.factorisations == 10


def test_a_load_that_is_too_far_off_is_led_to_from_the_design_load_where_that_is_asked_for(evaluator, trying):
    trying.borne, trying.led = {"wet"}, {"wetter", "wind"}
    assert trying.evaluate(True) == "seeded"
    assert trying.seeded[-1][1] == {"wet": "wet", "wetter": "wetter led", "wind": "wind led"}
    assert evaluator.factorisations == 3 * 5 + 2 * 8
    trying.led = {"wetter"}
    with pytest.raises(OffBranch, match="wind can't be led to"):
        trying.evaluate(True)
    assert (evaluator.rejected, evaluator.wasted) == (1, 31)


def test_nothing_leads_to_further_loads_from_a_design_load_that_is_not_borne(evaluator, trying):
    trying.borne, trying.led = {"wetter", "wind"}, set(LOADS)
    with pytest.raises(OffBranch, match="wet isn't borne"):
        trying.evaluate(True)
    assert trying.tried == ["wet"]


@pytest.mark.parametrize("on_branch", [True, False])
def test_a_load_is_led_to_by_halves_and_no_smaller_steps(evaluator, monkeypatch, on_branch):
    def apply_load(assembly, known, first, load, **how):
        assert (assembly, known, first, load) == ("assembly", "known", WET, WETTER)
        assert how == {"step": 0.5, "smallest": 0.5, "stay": True}
        return reached(0.1, on_branch=on_branch)

    monkeypatch.setattr(evaluation, "apply_load", apply_load)
    monkeypatch.setattr(evaluator, "assembly", lambda design: "assembly")
    if on_branch:
        evaluator._led("design", "known", WETTER)
    else:
        with pytest.raises(OffBranch):
            evaluator._led("design", "known", WETTER)
    assert (evaluator.factorisations, evaluator.equilibria) == (4, 1)


@pytest.mark.parametrize("error", [NotPositiveDefinite(), NotConverged("lost")])
def test_a_design_of_which_a_term_cannot_be_measured_is_off_the_branch(evaluator, monkeypatch, error):
    def measured(*_):
        raise error

    evaluator.problem.terms = ["term"]
    monkeypatch.setattr(evaluator, "assembly", lambda design: None)
    monkeypatch.setattr(evaluator, "_at", lambda *_: None)
    monkeypatch.setattr(evaluator, "_measured", measured)
    with pytest.raises(OffBranch):
        evaluator.seed("design", {}, 1.0)


def test_an_assembly_is_made_anew_where_other_cables_are_present_and_kept_while_they_are_the_same(
    evaluator, monkeypatch
):
    made = []

    class Made:
        def __init__(self, network):
            self.name = f"{network} of its own"
            made.append(network)

        def beside(self):
            other = Made.__new__(Made)
            other.name = f"{made[-1]} beside"
            return other

        def with_parts(self, parts):
            return self.name, parts

    monkeypatch.setattr(evaluation, "assemble", Made)
    evaluator.shell = SimpleNamespace(
        network=lambda design: design.name, beams=lambda radius: radius, cables=lambda design: design.name
    )

    def design(name, *present):
        return SimpleNamespace(name=name, present=np.array(present, dtype=bool), radius=0.1)

    assert evaluator.assembly(design("a", 1, 1)) == ("a of its own", (0.1, "a"))
    assert evaluator.assembly(design("b", 1, 1)) == ("a of its own", (0.1, "b"))
    assert evaluator.assembly(design("b", 1, 1), 1) == ("a beside", (0.1, "b"))
    assert evaluator.assembly(design("c", 1, 0)) == ("c of its own", (0.1, "c"))
    assert evaluator.assembly(design("d", 1, 1), 1) == ("d beside", (0.1, "d"))
    assert made == ["a", "c", "d"]


def point(objective, *constraints):
    return Evaluated(None, None, None, {}, objective, np.zeros(0), np.array(constraints), (), 1.0)


def test_feasible_designs_come_first_by_their_objective_and_others_by_what_they_break():
    order = [
        point(0.3, -0.5, 1e-3),  # within what counts as kept
        point(0.4, -0.1),
        point(0.5),
        point(0.1, 0.02, -1.0),
        point(0.2, 0.02),
        point(0.0, -1.0, 0.3),
    ]
    assert sorted(reversed(order), key=lambda each: each.rank) == order
    assert [each.violation for each in order] == [1e-3, 0.0, 0.0, 0.02, 0.02, 0.3]


def test_terms_are_weighted_to_their_shares_of_1_at_the_start_whatever_their_sign(monkeypatch):
    """What the start doesn't bear is taken under the design load; a term of several values is their sum."""
    values = {"wet": [3.0, 1.0], "wetter": [-0.5], "": [2.0], "wind": [9.0]}
    parts = [
        SimpleNamespace(share=share, term=SimpleNamespace(load=load))
        for share, load in ((0.4, "wet"), (0.3, "wetter"), (0.2, ""), (0.1, "wind"))
    ]
    problem = SimpleNamespace(
        design_load=SimpleNamespace(name="wet"), loads=LOADS, minimise=parts, shell=SimpleNamespace()
    )
    paths = {"wet": reached(0.1), "wetter": reached(0.2), "wind": reached(0.3, on_branch=False)}
    taken = []

    def measured(term, at):
        name = next(name for name, load in LOADS.items() if load == at.load)
        assert at.state is paths[name].equilibrium.state
        taken.append(name)
        return SimpleNamespace(value=np.array(values[term.load]))

    monkeypatch.setattr(weights, "measured", measured)
    found = weights.start_weights(problem, "start", paths)
    assert found == pytest.approx([0.4 / 4.0, 0.3 / 0.5, 0.2 / 2.0, 0.1 / 9.0])
    assert taken == ["wet", "wetter", "wet", "wet"]


def test_what_needs_no_equilibrium_is_kept_of_the_last_sixteen_designs(evaluator, monkeypatch):
    measured = []

    def measure(term, at):
        measured.append(at.design)
        return f"{term.load} of {at.design}"

    monkeypatch.setattr(evaluation, "measured", measure)
    own, soft = SimpleNamespace(load=""), SimpleNamespace(load="wet")
    designs = [f"design {k}" for k in range(17)]
    for design in designs[:16]:
        evaluator._measured(own, SimpleNamespace(design=design))
    for design in designs[:16]:
        assert evaluator._measured(own, SimpleNamespace(design=design)) == f" of {design}"
    assert measured == designs[:16]
    for design in (designs[16], designs[1], designs[0]):
        evaluator._measured(own, SimpleNamespace(design=design))
    assert measured[16:] == [designs[16], designs[0]], "the first of them is forgotten"
    for _ in range(2):
        evaluator._measured(soft, SimpleNamespace(design=designs[0]))
    assert measured[18:] == [designs[0]] * 2


def test_the_objective_s_slope_is_the_sum_of_its_terms_slopes_by_their_weights(dome):
    """Of the radius alone, whose unit is the start's."""
    problem = sf.Problem(
        dome,
        sf.LoadCase("wet", dome.point_load(2.0, every=2)),
        [sf.Share(0.25, sf.RodRadius()), sf.Share(0.75, sf.RodRadius())],
        [sf.AtMost(0.002, sf.RodRadius())],
        variables=[sf.FreeRadius()],
    )
    design = dome.design()
    evaluator = Evaluator(problem, design)
    evaluator.weights = np.array([3.0, 5.0])
    point = evaluator.linearised(evaluator.seed(design, {"wet": dome.target}, 1.0))
    assert point.objective == pytest.approx(8.0 * design.radius)
    assert point.objective_by_variables == pytest.approx([8.0 * design.radius])
    assert point.constraints_by_variables == pytest.approx(np.array([[design.radius / 0.002]]))
    assert point.constraints == pytest.approx([design.radius / 0.002 - 1.0])
