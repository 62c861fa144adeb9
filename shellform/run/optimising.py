"""The stage "optimise" of a run: the optimised design, rounded to sections that can be bought, polished, and
its limits examined.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.case.build_gridshell import rounding_catalogue
from shellform.case.build_problem import below_factor, case_problem, critical_factors
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.grouping import symmetric_groups
from shellform.optimiser.optimum import Optimum, Step
from shellform.optimiser.solver import SequentialConvex
from shellform.problem.constraints import AtMost
from shellform.problem.problem import FEASIBLE, LoadCase, Problem
from shellform.problem.terms import CableForces, Misfit, Share
from shellform.problem.variables import RestLengths
from shellform.run.checkpoint import drop_checkpoint, load_checkpoint, save_checkpoint
from shellform.run.designs import Making, followed, forget, keep
from shellform.run.folder import history_text
from shellform.run.robustness import robustness
from shellform.written import write_text


def optimise(making: Making, shell: Gridshell, loads: Mapping[str, Reals], summary: dict[str, Any]) -> None:
    """Makes the designs "optimised", "rounded", "polished" and "unloaded", as the case asks for them, and
    adds to the summary what came of it.

    Raises InputError and NotConverged as the optimiser.
    """
    from shellform.optimiser import optimise as optimiser

    entry, cable = making.case.optimise, making.case.cable
    start = shell.design(rest_ratio=cable.rest_ratio)

    def watch(step: Step) -> None:
        said = "" if step.accepted else ", rejected"
        left = step.seconds / max(step.evaluation, 1) * (entry.evaluations - step.evaluation)
        making.report(
            "optimise",
            f"evaluation {step.evaluation}/{entry.evaluations}: objective {step.objective:.4f}, {step.cables} cables, "
            f"{100 * step.stage:.0f} % of the additional load{said}, {left:.0f} s left at most",
        )

    problem = case_problem(making.case, shell, loads, start)
    groups = symmetric_groups(shell) if entry.symmetric else None  # at once: it may be refused
    key = making.keys["optimise"]
    stood = load_checkpoint(making.folder, key)
    if stood is not None:
        making.report("optimise", f"going on after evaluation {stood.numbers['evaluations']}")
    best = optimiser.optimise(
        problem,
        start,
        solver=SequentialConvex(stiffness=entry.stiffness_min, most_cables=entry.cables_max),
        evaluations=entry.evaluations,
        progress=watch,
        keep=lambda checkpoint: save_checkpoint(making.folder, key, checkpoint),
        resume=stood,
    )
    forget(making, ("unloaded", "optimised", "rounded", "polished"), summary)
    built = {"optimised": best}
    keep(making, shell, "optimised", best.design, {each: best.loaded[each] for each in loads}, loads, summary)
    write_text(making.path("history.csv"), history_text(best.history))  # whatever comes after
    rounded = (
        _rounded(making, best, start, loads, summary) if entry.rod_radius > 0.0 and entry.rounded else None
    )
    if rounded is not None:
        built["rounded"] = rounded
    asked: dict[str, Any] = {}
    if entry.polish:
        making.report("optimise", "polishing the cables that are left")
        last = list(built.values())[-1]
        try:
            polished = optimiser.polish(last, evaluations=entry.polish, groups=groups)
        except (
            NotConverged
        ) as error:  # averaged lengths may not bear the loads; the design before them stands
            making.report("optimise", f"not polished: {error.what}")
            asked["not_polished"] = error.what
        else:
            here = last.problem.shell
            reached = followed(here, polished.design, loads)
            built["polished"] = replace(
                polished, loaded={**polished.loaded, **reached}
            )  # its own are of unequal lengths where none was better
            keep(making, here, "polished", polished.design, reached, loads, summary)
        if "polished" in built and "section" in summary["designs"].get("rounded", {}):
            summary["designs"]["polished"]["section"] = summary["designs"]["rounded"]["section"]
    asked |= _came_of(making, list(built.values())[-1].design, groups)
    for name, found in built.items():
        _examine(making, name, found, loads, summary)
    if making.case.robust is not None:
        making.report("optimise", "what scatter does to the shape")
        name, found = list(built.items())[-1]
        told = robustness(
            making.case.robust, found.problem.shell, found.design, found.states["design"], loads["design"]
        )
        summary["robust"] = {"design": name, **told.summary()}
        write_text(making.path("schedules/robust.csv"), told.table())
    if entry.unloaded:
        unloaded = _without_loads(making, shell, start, loads["none"])
        keep(making, shell, "unloaded", unloaded, followed(shell, unloaded, loads), loads, summary)
    summary["optimisation"] = {
        "objective_start": best.objective_start,
        "objective_end": best.objective,
        "iterations": sum(step.accepted for step in best.history) - 1,
        "evaluations": best.evaluations,
        "rejected": best.rejected,
        "equilibria": best.equilibria,
        "factorisations": best.factorisations,
        "factorisations_rejected": best.wasted,
        "stiffness_min": best.stiffness,
        "status": best.status,
        "constraints": dict(best.constraints),
        "feasible": max(best.constraints.values(), default=-1.0) <= FEASIBLE
        and summary["designs"]["optimised"].get("critical_factor_kept", True),
        **asked,
    }
    drop_checkpoint(making.folder)


def _came_of(making: Making, design: Design, groups: Indices | None) -> dict[str, Any]:
    """For the summary: whether the design to build keeps `cables_max`, and how many lengths it has for how
    many groups where symmetry was asked for."""
    entry, found = making.case.optimise, dict[str, Any]()
    if entry.cables_max is not None:
        count = int(design.present.sum())
        found["cables_max"] = {"asked": entry.cables_max, "cables": count, "kept": count <= entry.cables_max}
        if count > entry.cables_max:
            making.report(
                "optimise",
                f"note: {count} cables are left, not {entry.cables_max}: with fewer a limit is broken",
            )
    if groups is not None:
        numbers, lengths = groups[design.present], design.rest_length[design.present]
        alike = all(np.ptp(lengths[numbers == each]) <= 1e-9 for each in np.unique(numbers))
        found["symmetric"] = {"groups": len(np.unique(numbers)), "kept": alike}
    return found


def _without_loads(making: Making, shell: Gridshell, start: Design, none: Reals) -> Design:
    """The design of the best fit of the unloaded shape, with forces within the cables' limit."""
    from shellform.optimiser import optimise as optimiser

    making.report("optimise", "the design without regard to the loads")
    entry, cable = making.case.optimise, making.case.cable
    problem = Problem(
        shell,
        LoadCase("none", none),
        [Share(1.0, Misfit("none"))],
        [AtMost(cable.force_max, CableForces("none"))],
        variables=[RestLengths(entry.rest_length_min, entry.rest_length_max)],
    )
    return optimiser.optimise(problem, start, solver=SequentialConvex(thin=False), evaluations=15).design


def _rounded(
    making: Making, best: Optimum, start: Design, loads: Mapping[str, Reals], summary: dict[str, Any]
) -> Optimum | None:
    """Operation 4: keeps the design "rounded" and the table of sections. None without a catalogue or a
    design.
    """
    from shellform.optimiser import rounding

    entry = making.case.optimise
    catalogue = rounding_catalogue(making.case)
    if catalogue is None:
        return None
    trials = rounding.tried(
        best,
        start,
        catalogue,
        lambda shell: case_problem(making.case, shell, loads, start, frees_radius=False),
        evaluations=entry.rounded,
        beside=entry.neighbours,
        most_cables=entry.cables_max,
        progress=lambda text: making.report("optimise", text),
    )
    summary["sections"] = [each.row() for each in trials]
    write_text(making.path("schedules/sections.csv"), rounding.table(trials))
    taken = rounding.chosen(trials)
    if taken is None or taken.optimum is None:
        return None
    design = taken.optimum.design
    keep(making, taken.shell, "rounded", design, followed(taken.shell, design, loads), loads, summary)
    summary["designs"]["rounded"] |= {
        "section": taken.section,
        "feasible": not taken.why,
        "why_not": taken.why,
        "objective": taken.objective,
    }
    return taken.optimum


def _examine(
    making: Making, name: str, found: Optimum, loads: Mapping[str, Reals], summary: dict[str, Any]
) -> None:
    """Adds to a design's part of the summary how far each load could grow."""
    making.report("optimise", f"critical load factors of the {name} design")
    wanted = making.case.limits.critical_factor
    factors = critical_factors(found.problem.shell, found.design, found.states["none"], loads, wanted=wanted)
    for each, told in factors.items():
        summary["designs"][name]["loads"][each] |= told
    if wanted is not None:
        short = below_factor(factors, wanted, making.case.limits.critical_loads)
        summary["designs"][name]["critical_factor_kept"] = not short
