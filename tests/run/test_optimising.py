"""What a search is told to keep, and what is recorded of it, without any search."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import optimise as optimiser
from shellform.problem.problem import FEASIBLE
from shellform.records.optimisation import CableCountRecord, SymmetryRecord
from shellform.records.progress import Kind
from shellform.run import optimising

DESIGN = Design(np.array([1.0, 1.0 + 0.9e-9, 2.0, 5.0, 3.0]), np.array([True, True, True, False, True]), 0.01)


class Desk:
    """A workspace that keeps what is said."""

    def __init__(self, **entries):
        self.said = []
        optimise = {
            "cables_max": None,
            "deviation": None,
            "method": "convex",
            "polish": 9,
            "stiffness_min": 0.1,
            "allowance": 0.3,
        }
        limits = SimpleNamespace(deviation=entries.pop("limit", None))
        self.case = SimpleNamespace(optimise=SimpleNamespace(**{**optimise, **entries}), limits=limits)

    def say(self, stage, text, kind=Kind.PROGRESS):
        self.said.append((text, kind))

    def report(self, event):
        self.said.append(event.text)


@pytest.mark.parametrize(
    ("wish", "limit", "method", "kept", "wished"),
    [
        (None, None, "convex", None, None),
        (0.03, None, "convex", 0.03, 0.03),
        (0.03, 0.02, "convex", 0.02, None),
        (0.03, 0.04, "convex", 0.03, None),
        (None, 0.04, "convex", 0.04, None),
        (0.03, None, "paper", 0.03, None),
    ],
)
def test_cables_are_saved_within_the_wish_and_the_limit_and_only_a_wish_is_told_of(
    wish, limit, method, kept, wished
):
    case = Desk(deviation=wish, limit=limit, method=method).case
    assert optimising._deviation(case) == kept
    assert optimising._wished(case) == wished


def test_the_solver_has_what_the_case_says_of_cables_that_go():
    solver = optimising._solver(Desk(cables_max=7, deviation=0.03).case)
    assert (solver.most_cables, solver.deviation, solver.stiffness, solver.allowance) == (7, 0.03, 0.1, 0.3)


@pytest.mark.parametrize(("most", "kept"), [(3, False), (4, True), (5, True)])
def test_cables_are_counted_that_are_left_and_more_than_were_wished_for_are_told_of(most, kept):
    desk = Desk(cables_max=most)
    assert optimising._wishes(desk, DESIGN, None) == (CableCountRecord(most, 4, kept), None)
    assert desk.said == (
        []
        if kept
        else [("4 cables are left, not 3: no design with fewer was found that keeps every limit", Kind.NOTE)]
    )


@pytest.mark.parametrize(
    ("groups", "told"),
    [
        ([7, 7, 2, 7, 3], SymmetryRecord(3, True)),  # to a millionth of a millimetre; the fourth is left out
        ([7, 7, 2, 2, 2], SymmetryRecord(2, False)),
        ([1, 1, 1, 1, 1], SymmetryRecord(1, False)),
    ],
)
def test_cables_of_a_group_are_alike_to_rounding(groups, told):
    assert optimising._wishes(Desk(), DESIGN, np.array(groups)) == (None, told)


@pytest.mark.parametrize(
    ("constraints", "feasible"),
    [({"a": -0.5, "b": 0.9 * FEASIBLE}, True), ({"a": -0.5, "b": 1.1 * FEASIBLE}, False), ({}, True)],
)
def test_an_optimum_is_feasible_where_every_constraint_is_kept_to_rounding(constraints, feasible):
    steps = [SimpleNamespace(accepted=each) for each in (True, False, True, True)]
    best = SimpleNamespace(
        objective_start=1.0, objective=0.4, history=steps, evaluations=11, equilibria=23, factorisations=77,
        status="done", constraints=constraints, rejected=1, wasted=5, stiffness=0.3,
    )  # fmt: skip
    found = optimising._record(best)
    assert (found.iterations, found.evaluations, found.rejected) == (2, 11, 1), "the start is none"
    assert (found.equilibria, found.factorisations, found.factorisations_rejected) == (23, 77, 5)
    assert (found.objective_start, found.objective_end, found.stiffness_min) == (1.0, 0.4, 0.3)
    assert found.feasible is feasible


def test_the_judgement_of_a_design_is_told_of_every_ten_seconds(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(optimising, "clock_without_compiling", lambda: now[0])
    desk = Desk()
    tell = optimising._judging(desk)
    for seconds, done in ((109.9, 1), (110.0, 2), (119.0, 3), (120.1, 4)):
        now[0] = seconds
        tell(done, 12)
    assert desk.said == [
        f"a design as it would be built: {done} structures loaded, 12 at the most" for done in (2, 4)
    ]


def test_a_design_without_cables_is_not_polished_and_one_that_can_not_be_stands_as_it_was(monkeypatch):
    def last(*present):
        design = SimpleNamespace(present=np.array(present))
        return SimpleNamespace(design=design, problem=SimpleNamespace(shell="shell"))

    def polish(best, *, solver, evaluations, groups, progress, judging):
        assert (solver.deviation, evaluations, groups) == (0.02, 9, "groups")
        raise NotConverged("they don't bear it")

    monkeypatch.setattr(optimiser, "polish", polish)
    desk = Desk(deviation=0.02)
    assert optimising._polished(desk, last(False, False), None, {}) == (None, "no cable is left")
    assert optimising._polished(desk, last(False, True), "groups", {}) == (None, "they don't bear it")
    assert desk.said[-1] == ("not polished: they don't bear it", Kind.NOTE)


@pytest.mark.parametrize(
    ("known", "why", "told"), [(True, "", (0.4, 0.02, 0.01, 30, 0.8)), (False, "it falls", (None,) * 5)]
)
def test_of_a_section_without_a_design_no_numbers_are_told(known, why, told):
    trial = SimpleNamespace(
        optimum="one" if known else None, section="⌀ 8 mm", shell=SimpleNamespace(rod=SimpleNamespace(radius=0.004)),
        mass=12.0, rounded_up=True, objective=0.4, deviation_max=0.02, deviation_mean=0.01, cables=30,
        utilisation=0.8, why=why,
    )  # fmt: skip
    found = optimising._section(trial)
    assert (
        found.objective, found.deviation_max, found.deviation_mean, found.cables, found.stress_utilisation_max,
    ) == told  # fmt: skip
    assert (found.rod_radius, found.rod_mass, found.rounded_up) == (0.004, 12.0, True)
    assert (found.feasible, found.why_not) == (known, why)


def test_evaluations_beyond_those_asked_for_are_counted_as_asked_for():
    desk = Desk()
    tell = optimising._telling(desk, "polishing", 80)
    for evaluation in (79, 86):
        tell(SimpleNamespace(evaluation=evaluation))
    assert [text for text, _ in desk.said] == [
        "polishing: evaluation 79/80 at most",
        "polishing: evaluation 86/86 at most",
    ]
