"""The stage "optimise" of a run: the optimised design, rounded to sections that can be bought, and
polished.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields, replace

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.case.build_gridshell import rounding_catalogue
from shellform.case.build_problem import cable_force_planned, case_problem
from shellform.case.build_safety import case_safety, case_tolerances
from shellform.case.case import Case
from shellform.compiled import clock_without_compiling
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.grouping import symmetric_groups
from shellform.gridshell.joints import doubts
from shellform.optimiser.moving_asymptotes import MovingAsymptotes
from shellform.optimiser.optimum import Optimum, Step
from shellform.optimiser.rounding import CandidateSection
from shellform.optimiser.solver import POLISHING, SequentialConvex
from shellform.problem.constraints import AtMost
from shellform.problem.problem import FEASIBLE, LoadCase, Problem
from shellform.problem.terms import CableForces, Misfit, Share
from shellform.problem.variables import RestLengths
from shellform.records.history import write_history
from shellform.records.optimisation import CableCountRecord, OptimisationRecord, SectionRecord, SymmetryRecord
from shellform.records.progress import Event, Kind
from shellform.records.summary import Summary
from shellform.reliability.trial_structures import Judging
from shellform.run.checkpoint import drop_checkpoint, load_checkpoint, save_checkpoint
from shellform.run.designs import followed, forget, keep
from shellform.run.pace import POLISHING_TAKES, WITHOUT_LOADS, Pace, time_words
from shellform.run.robustness import robustness
from shellform.run.workspace import Workspace
from shellform.structure.solve.loading import Loaded
from shellform.tables import Table, table_text
from shellform.written import write_text

_UNLED = ("climb", "descend")  # phases in which no structure as built was drawn yet
_QUIET = 10.0  # s between two notes on the judgement of a design
_UNLOADED = 15  # evaluations at most, of the design without regard to the loads


def optimise(
    workspace: Workspace,
    shell: Gridshell,
    loads: Mapping[str, Reals],
    summary: Summary,
    initial: Mapping[str, Loaded] | None = None,
) -> Summary:
    """Makes the designs "optimised", "rounded", "polished" and "unloaded", as the case asks for them, and
    returns the summary with what came of it; `initial`: what the initial design comes to under the loads,
    where it was followed just before.

    Raises InputError and NotConverged as the optimiser.
    """
    entry = workspace.case.optimise
    start = shell.design(rest_ratio=workspace.case.cable.rest_ratio)
    groups = symmetric_groups(shell) if entry.symmetric else None  # at once: it may be refused
    best = _best(workspace, shell, start, loads, initial)
    summary = forget(workspace.folder, ("unloaded", "optimised", "rounded", "polished"), summary)
    reached = {each: best.loaded[each] for each in loads}
    summary = keep(workspace, shell, "optimised", best.design, reached, loads, summary)
    write_history(workspace.folder, best.history)  # whatever comes after
    built = {"optimised": best}
    if entry.rod_radius > 0.0 and entry.rounded:
        rounded, summary = _rounded(workspace, best, start, loads, summary)
        built |= {} if rounded is None else {"rounded": rounded}
    not_polished = None
    if entry.polish and entry.method != "paper":
        last = list(built.values())[-1]
        polished, not_polished = _polished(workspace, last, groups, loads)
        if polished is not None:
            built["polished"] = polished
            reached = {each: polished.loaded[each] for each in loads}
            shell_of_it = last.problem.shell
            summary = keep(workspace, shell_of_it, "polished", polished.design, reached, loads, summary)
            section = summary.designs["rounded"].section if "rounded" in summary.designs else None
            summary = summary.with_design("polished", replace(summary.designs["polished"], section=section))
    name, final = list(built.items())[-1]
    if entry.rod_radius > 0.0:
        for doubt in doubts(shell.joint, final.problem.shell.rod.resized(final.design.radius)):
            workspace.say("optimise", f"the rods that were found: {doubt.told()}", Kind.NOTE)
    cable_count, symmetry = _wishes(workspace, final.design, groups)
    if workspace.case.robust is not None:
        workspace.say("optimise", "what tolerances do to the shape")
        built_shell = final.problem.shell
        scattered = robustness(
            workspace.case.robust,
            built_shell,
            final.design,
            final.states["design"],
            loads["design"],
            case_tolerances(workspace.case, built_shell),
        )
        summary = replace(summary, robust=scattered.record(name))
        write_text(workspace.path("schedules/robust.csv"), table_text(scattered.table()))
    if entry.unloaded:
        unloaded = _without_loads(workspace, shell, start, loads["none"])
        reached = followed(shell, unloaded, loads)
        summary = keep(workspace, shell, "unloaded", unloaded, reached, loads, summary)
    record = replace(
        _record(best),
        not_polished=not_polished,
        cables_max=cable_count,
        symmetric=symmetry,
        deviation_wished=_wished(workspace.case),
        cable_force_limit=cable_force_planned(workspace.case),
    )
    drop_checkpoint(workspace.folder)
    return replace(summary, optimisation=record)


def _best(
    workspace: Workspace,
    shell: Gridshell,
    start: Design,
    loads: Mapping[str, Reals],
    initial: Mapping[str, Loaded] | None,
) -> Optimum:
    """The optimised design, begun anew or gone on with from a checkpoint."""
    from shellform.optimiser import optimise as optimiser

    entry = workspace.case.optimise
    polishes = entry.polish > 0 and entry.method != "paper"
    pace = Pace(entry.evaluations, POLISHING_TAKES * polishes + WITHOUT_LOADS * entry.unloaded)

    def watch(step: Step) -> None:
        rejected = "" if step.accepted else ", rejected"
        left = pace.left(step.evaluation, step.phase)
        more = ", more if structures as built lead it" if safety is not None and step.phase in _UNLED else ""
        still = "" if left is None else f", about {time_words(left)} left of this stage{more}"
        workspace.report(
            Event(
                "optimise",
                f"evaluation {step.evaluation}/{max(entry.evaluations, step.evaluation)}: objective {step.objective:.4f}, "
                f"{step.cables} cables, {100 * step.stage:.0f} % of the additional load{rejected}{still}",
                fraction=min(step.evaluation / entry.evaluations, 1.0),
                seconds_left=left,
            )
        )

    problem, safety = case_problem(workspace.case, shell, loads, start), case_safety(workspace.case, shell)
    key = workspace.keys["optimise"]
    checkpoint = load_checkpoint(workspace.folder, key)
    if checkpoint is not None:
        reached = checkpoint.numbers["evaluations"]
        workspace.say("optimise", f"going on after evaluation {reached}", Kind.BEGAN)
    return optimiser.optimise(
        problem,
        start,
        solver=_solver(workspace.case),
        evaluations=entry.evaluations,
        safety=safety,
        progress=watch,
        keep=lambda checkpoint: save_checkpoint(workspace.folder, key, checkpoint),
        judging=_judging(workspace),
        resume=checkpoint,
        followed=initial,
    )


def _solver(case: Case) -> SequentialConvex | MovingAsymptotes:
    """That of the case's method, with its settings."""
    entry = case.optimise
    if entry.method == "paper":
        return MovingAsymptotes()
    return SequentialConvex(
        stiffness=entry.stiffness_min,
        most_cables=entry.cables_max,
        deviation=_deviation(case),
        allowance=entry.allowance,
    )


def _deviation(case: Case) -> float | None:
    """How far, m, a node may be off by what is saved: the wish, and the limit."""
    off = [each for each in (case.optimise.deviation, case.limits.deviation) if each is not None]
    return min(off, default=None)


def _wished(case: Case) -> float | None:
    """How far, m, a node may be off by what is saved, where that is a wish alone."""
    required = case.limits.deviation is not None or case.optimise.method == "paper"
    return None if required else case.optimise.deviation


def _record(best: Optimum) -> OptimisationRecord:
    """What came of the optimisation."""

    return OptimisationRecord(
        objective_start=best.objective_start,
        objective_end=best.objective,
        iterations=sum(step.accepted for step in best.history) - 1,
        evaluations=best.evaluations,
        equilibria=best.equilibria,
        factorisations=best.factorisations,
        status=best.status,
        constraints=dict(best.constraints),
        rejected=best.rejected,
        factorisations_rejected=best.wasted,
        stiffness_min=best.stiffness,
        feasible=max(best.constraints.values(), default=-1.0) <= FEASIBLE,
    )


def _polished(
    workspace: Workspace, last: Optimum, groups: Indices | None, loads: Mapping[str, Reals]
) -> tuple[Optimum | None, str | None]:
    """The last design polished, followed under the loads; or None, and why."""
    from shellform.optimiser import optimise as optimiser

    if not last.design.present.any():
        return None, "no cable is left"
    workspace.say("optimise", "polishing the cables that are left")
    try:
        most = workspace.case.optimise.polish
        polished = optimiser.polish(
            last,
            solver=replace(POLISHING, deviation=_deviation(workspace.case)),
            evaluations=most,
            groups=groups,
            progress=_telling(workspace, "polishing", most),
            judging=_judging(workspace),
        )
    except NotConverged as error:  # averaged lengths may not bear the loads; the design before them stands
        workspace.say("optimise", f"not polished: {error.what}", Kind.NOTE)
        return None, error.what
    # its own states are of unequal lengths where none was better
    reached = followed(last.problem.shell, polished.design, loads)
    return replace(polished, loaded={**polished.loaded, **reached}), None


def _wishes(
    workspace: Workspace, design: Design, groups: Indices | None
) -> tuple[CableCountRecord | None, SymmetryRecord | None]:
    """Whether the design to build keeps `cables_max`, and how many lengths it has for how many groups where
    symmetry was asked for."""
    most = workspace.case.optimise.cables_max
    cables = symmetry = None
    if most is not None:
        count = int(design.present.sum())
        cables = CableCountRecord(most, count, count <= most)
        if count > most:
            text = (
                f"{count} cables are left, not {most}: no design with fewer was found that keeps every limit"
            )
            workspace.say("optimise", text, Kind.NOTE)
    if groups is not None:
        numbers, lengths = groups[design.present], design.rest_length[design.present]
        alike = all(bool(np.ptp(lengths[numbers == each]) <= 1e-9) for each in np.unique(numbers))
        symmetry = SymmetryRecord(len(np.unique(numbers)), alike)
    return cables, symmetry


def _without_loads(workspace: Workspace, shell: Gridshell, start: Design, none: Reals) -> Design:
    """The design of the best fit of the unloaded shape, with forces within the cables' limit."""
    from shellform.optimiser import optimise as optimiser

    workspace.say("optimise", "the design without regard to the loads")
    entry = workspace.case.optimise
    problem = Problem(
        shell,
        LoadCase("none", none),
        [Share(1.0, Misfit("none"))],
        [AtMost(cable_force_planned(workspace.case), CableForces("none"))],
        variables=[RestLengths(entry.rest_length_min, entry.rest_length_max)],
    )
    return optimiser.optimise(
        problem,
        start,
        solver=SequentialConvex(thin=False),
        evaluations=_UNLOADED,
        progress=_telling(workspace, "without the loads", _UNLOADED),
    ).design


def _judging(workspace: Workspace) -> Judging:
    """Tells now and then how far the judgement of a design is: of a large shell one takes minutes."""
    told = clock_without_compiling()

    def tell(done: int, most: int) -> None:
        nonlocal told
        if clock_without_compiling() - told >= _QUIET:
            told = clock_without_compiling()
            text = f"a design as it would be built: {done} structures loaded, {most} at the most"
            workspace.report(Event("optimise", text))

    return tell


def _telling(workspace: Workspace, what: str, most: int) -> Callable[[Step], None]:
    """Tells each trial of a search that isn't the main one. Where a fresh sample disagrees with its design it
    goes on beyond the `most` that were asked for, by a fifth of them (agreeing.py)."""

    def tell(step: Step) -> None:
        workspace.say(
            "optimise", f"{what}: evaluation {step.evaluation}/{max(most, step.evaluation)} at most"
        )

    return tell


def _rounded(
    workspace: Workspace, best: Optimum, start: Design, loads: Mapping[str, Reals], summary: Summary
) -> tuple[Optimum | None, Summary]:
    """Operation 4: keeps the design "rounded" and the table of sections; None without a catalogue or a
    design.
    """
    from shellform.optimiser import rounding

    entry = workspace.case.optimise
    catalogue = rounding_catalogue(workspace.case)
    if catalogue is None:
        return None, summary
    trials = rounding.tried(
        best,
        start,
        catalogue,
        lambda shell: case_problem(workspace.case, shell, loads, start, frees_radius=False),
        evaluations=entry.rounded,
        beside=entry.neighbours,
        solver=_solver(workspace.case),
        safety=case_safety(workspace.case, best.problem.shell),
        progress=lambda text: workspace.say("optimise", text),
    )
    sections = tuple(_section(each) for each in trials)
    summary = replace(summary, sections=sections)
    heads = tuple(field.name for field in fields(SectionRecord))
    rows = tuple(tuple(getattr(each, head) for head in heads) for each in sections)
    text = table_text(Table("sections", heads, rows), exact=True)
    write_text(workspace.path("schedules/sections.csv"), text)
    taken = rounding.chosen(trials)
    if taken is None or taken.optimum is None:
        return None, summary
    design = taken.optimum.design
    reached = followed(taken.shell, design, loads)
    summary = keep(workspace, taken.shell, "rounded", design, reached, loads, summary)
    record = replace(
        summary.designs["rounded"],
        section=taken.section,
        feasible=not taken.why,
        why_not=taken.why,
        objective=taken.objective,
    )
    return taken.optimum, summary.with_design("rounded", record)


def _section(trial: CandidateSection) -> SectionRecord:
    """A section that was tried, whose numbers are known where it has a design."""
    known = trial.optimum is not None
    return SectionRecord(
        section=trial.section,
        rod_radius=trial.shell.rod.radius,
        rod_mass=trial.mass,
        rounded_up=trial.rounded_up,
        objective=trial.objective if known else None,
        deviation_max=trial.deviation_max if known else None,
        deviation_mean=trial.deviation_mean if known else None,
        cables=trial.cables if known else None,
        stress_utilisation_max=trial.utilisation if known else None,
        feasible=not trial.why,
        why_not=trial.why,
    )
