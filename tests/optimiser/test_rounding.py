"""Sections that can be bought instead of a free radius: which are tried, from where, by what they are
compared and which one is chosen.
"""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.optimiser import rounding
from shellform.optimiser.moving_asymptotes import MovingAsymptotes
from shellform.optimiser.rounding import CandidateSection, broken, chosen, rods_mass
from shellform.problem.terms import Measurement


def candidate(name, objective, *, why="", up=False, found=True):
    optimum = f"optimum {name}" if found else None
    return CandidateSection(name, None, optimum, objective, 0.0, 0.0, 5, 0.5, 1.0, why, up)


def test_the_section_that_was_rounded_up_to_is_taken_where_it_is_feasible_and_else_the_best_that_is():
    thin = candidate("thin", 0.1, why="the rods are used to 110% of their strength under the wet load")
    up, thick, thicker = candidate("up", 0.5, up=True), candidate("thick", 0.6), candidate("thicker", 0.4)
    assert chosen([thin, up, thick, thicker]) is up, "though another one is better"
    lost = candidate("up", 0.5, why="not stable under wet", up=True)
    assert chosen([thin, lost, thick, thicker]) is thicker
    assert chosen([thin, lost]) is lost, "with what it lacks"
    assert chosen([thin, candidate("up", 0.5, why="no equilibrium", up=True, found=False)]) is None


def loaded(on_branch):
    return SimpleNamespace(on_branch=on_branch)


def test_what_an_optimum_breaks_is_told_by_name_and_by_how_much():
    def of(**constraints):
        return SimpleNamespace(
            problem=SimpleNamespace(loads=["wet", "wetter"]),
            loaded={"wet": loaded(True), "wetter": loaded(stable)},
            constraints=constraints,
        )

    stable = True
    assert broken(of(misfit=0.0009, cable_force=-0.5)) == ""
    over = {"misfit": 0.21, "cable_force": 0.0011, "uplift": 0.3}
    assert (
        broken(of(**over)) == "beyond its limit: misfit at 110.0% of it, cable_force at 100.1% of it, uplift"
    )
    stable = False
    assert broken(of(misfit=-0.1)) == "not stable under wetter"
    assert broken(of(misfit=0.5)) == "not stable under wetter; beyond its limit: misfit at 122.5% of it"


class Beams:
    rest_length = np.array([2.0, 3.0, 100.0])

    def of_kind(self, kind):
        assert kind == "rod"
        return np.array([True, True, False])


def shell_of(used=0.8):
    """Of two rods, 5 m together, of 0.3 kg/m."""
    return SimpleNamespace(
        beams=lambda radius: Beams() if radius == 0.002 else None,
        rod=SimpleNamespace(radius=0.002, section="tube"),
        utilisation=lambda design, state: np.array([0.1, used if state == "rest" else 9.0]),
    )


@pytest.fixture
def masses(monkeypatch):
    monkeypatch.setattr(rounding, "mass_per_length", lambda section: 0.3 if section == "tube" else 0.0)


def test_rods_weigh_what_their_lengths_do(masses):
    assert rods_mass(shell_of()) == pytest.approx(1.5)


def compared(monkeypatch, used=0.8, why=""):
    terms = [SimpleNamespace(load=""), SimpleNamespace(load="wetter")]
    problem = SimpleNamespace(
        design_load=SimpleNamespace(name="wet"),
        minimise=[SimpleNamespace(term=term) for term in terms],
        loads={"wet": 1.0, "wetter": 1.2},
    )
    optimum = SimpleNamespace(
        problem=problem,
        states={"wet": "rest", "wetter": "under more"},
        design=SimpleNamespace(present=np.array([True, False, True, True])),
    )

    def measured(term, at):
        assert (at.state, at.load) == (("under more", 1.2) if term.load else ("rest", 1.0))
        return Measurement(np.array([0.1, 0.2]) if term is terms[0] else np.array([5.0]))

    monkeypatch.setattr(rounding, "measured", measured)
    monkeypatch.setattr(
        rounding, "deviations", lambda shell, state: np.array([0.001, 0.005]) if state == "rest" else None
    )
    return rounding._candidate("20 x 2", shell_of(used), optimum, why, np.array([2.0, 0.1]), problem, True)


def test_a_section_is_told_by_the_objective_of_the_free_problem_and_what_is_off_under_the_design_load(
    monkeypatch, masses
):
    found = compared(monkeypatch)
    assert found.objective == pytest.approx(2.0 * 0.3 + 0.1 * 5.0)
    assert (found.deviation_max, found.deviation_mean) == (0.005, pytest.approx(0.003))
    assert (found.cables, found.utilisation, found.mass) == (3, 0.8, pytest.approx(1.5))
    assert (found.section, found.why, found.rounded_up) == ("20 x 2", "", True)


def test_a_section_whose_rods_are_used_beyond_their_strength_is_not_feasible(monkeypatch, masses):
    assert compared(monkeypatch, used=1.0).why == ""
    over = "the rods are used to 112% of their strength under the wet load"
    assert compared(monkeypatch, used=1.12).why == over
    assert compared(monkeypatch, used=1.12, why="too far off").why == f"too far off; {over}"


def test_a_section_without_an_optimum_has_a_weight_and_no_numbers(masses):
    problem = SimpleNamespace(design_load=SimpleNamespace(name="wet"))
    found = rounding._candidate("20 x 2", shell_of(), None, "no equilibrium", np.ones(1), problem, False)
    assert np.isnan([found.objective, found.deviation_max, found.deviation_mean, found.utilisation]).all()
    assert (found.mass, found.cables, found.why, found.rounded_up) == (
        pytest.approx(1.5),
        0,
        "no equilibrium",
        False,
    )


@pytest.fixture
def optimising(monkeypatch):
    """`optimise` that ends as told for each start; what it was asked is kept."""
    asked, ends = [], {}

    def optimise(problem, start, **how):
        asked.append((start, how))
        end = ends[start]
        if isinstance(end, Exception):
            raise end
        return end

    monkeypatch.setattr(rounding, "optimise", optimise)
    monkeypatch.setattr(rounding, "broken", lambda optimum: optimum.why)
    monkeypatch.setattr(
        rounding, "_share", lambda problem, start, least: {"few": 0.25, "all": 0.5}[start] * least
    )
    return asked, ends


def optimised(solver=None):
    solver = solver or sf.SequentialConvex(window=0.3)
    return rounding._optimised("problem", ["few", "all"], 0.8, 30, solver, "safety")


def test_cables_are_optimised_from_those_that_are_left_and_where_that_leads_to_nothing_from_all(optimising):
    asked, ends = optimising
    good, bad = SimpleNamespace(why=""), SimpleNamespace(why="misfit +2%")
    ends |= {"few": good}
    assert optimised() == (good, "")
    ((start, how),) = asked
    assert (start, how["initial"], how["evaluations"], how["safety"]) == ("few", "all", 30, "safety")
    assert how["solver"] == sf.SequentialConvex(window=0.3, stiffness=0.25 * 0.8)
    ends |= {"few": bad, "all": good}
    assert optimised() == (good, "")
    assert asked[-1][1]["solver"].stiffness == 0.5 * 0.8
    ends |= {"few": bad, "all": NotConverged("no equilibrium")}
    assert optimised() == (bad, "misfit +2%")
    ends |= {"few": NotConverged("snaps through"), "all": NotConverged("no equilibrium")}
    assert optimised() == (None, "snaps through"), "the first reason counts"
    ends |= {"all": bad}
    assert optimised() == (bad, "misfit +2%")


def test_the_paper_s_method_is_used_as_it_is(optimising):
    asked, ends = optimising
    ends |= {"few": SimpleNamespace(why="")}
    solver = MovingAsymptotes()
    optimised(solver)
    assert asked[0][1]["solver"] is solver


@pytest.mark.parametrize(
    ("softest", "on_branch", "share"),
    [(8.0, True, 0.25), (-8.0, True, 0.0), (8.0, False, 0.0), (1.5, True, 1.0)],
)
def test_stiffness_is_asked_for_as_a_share_of_the_start_s_at_most_all_of_it(
    monkeypatch, softest, on_branch, share
):
    problem = SimpleNamespace(
        design_load=SimpleNamespace(name="wet", force="load"),
        shell=SimpleNamespace(network=lambda start: start),
    )

    def follow(shell, start, loads, *, stay):
        assert (loads, stay) == ({"wet": "load"}, True)
        return {"wet": SimpleNamespace(on_branch=on_branch, equilibrium=SimpleNamespace(state="rest"))}

    monkeypatch.setattr(rounding, "follow", follow)
    monkeypatch.setattr(rounding, "assemble", lambda network: network)
    monkeypatch.setattr(rounding, "modes", lambda *_: SimpleNamespace(stiffness=np.array([softest, 99.0])))
    assert rounding._share(problem, "start", 2.0) == share
    assert sf.SequentialConvex(stiffness=share).stiffness == share


def test_sections_beside_the_free_radius_are_tried_each_from_its_own_design_and_from_all_cables(monkeypatch):
    """Loads that no term is taken at aren't followed for the weights; of each the safety is asked."""
    sections = {name: SimpleNamespace(rod=SimpleNamespace(section=name)) for name in ("thin", "up", "thick")}
    own = {
        name: Design(np.full(2, k + 1.0), np.array([True, False]), 0.01 * (k + 1))
        for k, name in enumerate(sections)
    }
    best = SimpleNamespace(
        problem=SimpleNamespace(
            shell="shell",
            design_load=SimpleNamespace(name="wet"),
            minimise=[SimpleNamespace(term=SimpleNamespace(load=name)) for name in ("", "wetter")],
            loads={"wet": 1, "wetter": 2, "idle": 3},
        ),
        design="free",
        stiffness=0.7,
    )
    start, seen, heard = Design(np.full(2, 9.0), np.array([True, True]), 0.5), [], []

    def follow(shell, start, loads, *, stay):
        seen.append((loads, stay))
        return "paths"

    def optimised(problem, starts, least, evaluations, solver, safety):
        seen.append((problem, starts, least, evaluations, solver, safety))
        return "optimum", "why"

    def neighbours(shell, design, catalogue, *, count):
        assert (design, count) == ("free", 1)
        return [(sections[name], own[name]) for name in sections]

    monkeypatch.setattr(rounding, "follow", follow)
    monkeypatch.setattr(rounding, "start_weights", lambda problem, start, paths: ("weights", paths))
    monkeypatch.setattr(rounding, "rounded_up", lambda *_: (sections["up"], own["up"]))
    monkeypatch.setattr(rounding, "neighbours", neighbours)
    monkeypatch.setattr(rounding, "label", lambda section: section)
    monkeypatch.setattr(rounding, "_optimised", optimised)
    monkeypatch.setattr(rounding, "_candidate", lambda *given: given)
    found = rounding.tried(
        best,
        start,
        "catalogue",
        lambda shell: ("problem", shell),
        evaluations=30,
        beside=1,
        safety="safety",
        progress=heard.append,
    )
    assert seen[0] == ({"wet": 1, "wetter": 2}, True)
    assert [(each[0], each[4], each[6]) for each in found] == [
        (name, ("weights", "paths"), name == "up") for name in sections
    ]
    assert heard == ["cables for rods thin", "cables for rods up", "cables for rods thick"]
    problem, (few, every), *rest = seen[2]
    assert problem == ("problem", sections["up"])
    assert few is own["up"]
    assert (every.rest_length.tolist(), every.present.tolist(), every.radius) == (
        [9.0, 9.0],
        [True, True],
        0.02,
    )
    assert rest == [0.7, 30, sf.SequentialConvex(), "safety"]
    best.problem.minimise = best.problem.minimise[:1]
    rounding.tried(best, start, "catalogue", lambda shell: shell, evaluations=30, beside=1, solver="mine")
    assert seen[4] == ({"wet": 1}, False)
    assert seen[5][-2:] == ("mine", None)
