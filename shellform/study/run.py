"""The whole job of one case, stage by stage, in a run folder (contracts/run-folder.md).

surface -> net -> initial -> optimise -> figures -> documents -> report. Each stage leaves its result in the folder and a key in
`stages.json`: a hash of the entries it depends on, the surface file's bytes, the package's version and the stage before. Run again, a stage whose key is
unchanged is loaded instead of computed.
"""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

import shellform
from shellform.arrays import Reals
from shellform.design.gridshell import Design, Gridshell
from shellform.design.grouping import symmetric_groups
from shellform.design.optimum import Optimum
from shellform.design.problem import Problem, follow
from shellform.design.terms import AtMost, CableForces, Misfit, Share
from shellform.errors import InputError, NotConverged
from shellform.net.files import load_net, net_document, save_net
from shellform.net.net import Net
from shellform.net.orient import oriented_net
from shellform.structure.equilibrium import Equilibrium
from shellform.structure.loading import Loaded
from shellform.structure.state import State
from shellform.study.case import Case, NetEntry, SurfaceEntry, check_script, dump_case
from shellform.study.folder import (
    FORMAT,
    VERSION,
    Report,
    history_text,
    keep_design,
    load_surface,
    read_json,
    read_run,
    refuse_overwriting,
    save_surface,
)
from shellform.study.limits import below_factor, case_problem, critical_factors
from shellform.study.pictures import draw_everything, write_states
from shellform.study.robustness import robustness
from shellform.study.shell import catalogue_bytes, gridshell, rod_limits, rounding_catalogue
from shellform.surface.target import Surface
from shellform.written import folder as made
from shellform.written import write_text

STAGES = ("surface", "net", "initial", "optimise", "figures", "documents", "report")


def surface_of(entry: SurfaceEntry, *, allow_scripts: bool = False) -> Surface:
    """The surface of a builder script, or of a file in any format, as its entry says."""
    file = Path(entry.file)
    check_script(file, allow_scripts=allow_scripts)
    if file.suffix.lower() == ".py":
        from shellform.surface import cad

        return cad.build_surface(file, size=_builder_size(file, entry.size, entry.dimensions), **entry.dimensions)
    if entry.dimensions:
        raise InputError("only builder scripts have dimensions", where="surface.dimensions", value=entry.dimensions)
    from shellform.surface.reading import read_surface

    return read_surface(
        file,
        unit=entry.unit,
        up=entry.up,
        size=entry.size,
        layer=entry.layer,
        name=entry.object,
        face=entry.face,
        piece=entry.piece,
        fill=entry.fill,
        ground=entry.ground,
    )


def surface_summary(surface: Surface, source: str) -> dict[str, Any]:
    """The `surface` part of summary.json."""
    return {
        "source": source,
        "area": surface.area,
        "size": surface.size.tolist(),
        "triangles": len(surface.triangles),
        "holes": surface.holes,
        "mended": list(surface.mended),
    }


def told_size(surface: Surface) -> str:
    """The extents in words, so that a wrong unit is seen."""
    x, y, z = surface.size
    return f"{x:.4g} × {y:.4g} × {z:.4g} m (is the unit right?)"


def _builder_size(file: Path, size: float | None, dimensions: Mapping[str, float] | None) -> float:
    if size is not None:
        return size
    from shellform.surface import cad

    return max({**cad.dimensions_of(file), **(dimensions or {})}.values()) / 90.0


@dataclass(frozen=True)
class _Job:
    case: Case
    folder: Path
    report: Report

    def path(self, name: str) -> Path:
        return self.folder / name

    def tell(self, summary: Mapping[str, Any]) -> None:
        """Writes summary.json."""
        write_text(self.path("summary.json"), json.dumps(summary, indent=1))


def run_case(
    case: Case,
    folder: Path,
    *,
    until: str = STAGES[-1],
    fresh: bool = False,
    allow_scripts: bool = False,
    report: Report = lambda stage, text: None,
) -> dict[str, Any]:
    """Runs the case's stages up to `until` in `folder` and returns the summary.

    Raises InputError for bad input and NotConverged where a stage finds no result; what was computed stays in the folder.
    """
    if until not in STAGES:
        raise InputError("is no stage", where="--until", value=until, remedy=f"Stages: {', '.join(STAGES)}.")
    file = Path(case.surface.file)
    if not file.is_file():
        raise InputError("there is no such file", where=f"surface.file: {file}")
    check_script(file, allow_scripts=allow_scripts)
    keys = stage_keys(case)
    if not fresh:
        refuse_overwriting(folder)
    done = {} if fresh else read_json(folder / "stages.json")
    results: dict[str, Any] = {}
    began = time.perf_counter()
    if done.get("surface") != keys["surface"]:  # before anything is written: most bad input is a bad surface
        report("surface", f"reading {file}")
        results["surface"] = surface_of(case.surface, allow_scripts=allow_scripts)
        report("surface", f"size {told_size(results['surface'])}")
    summary = read_json(folder / "summary.json") if done else {}
    summary = {**summary, "format": FORMAT, "version": VERSION, "shellform": shellform.__version__}
    summary.setdefault("seconds", {})
    for part in ("designs", "states", "figures", "schedules"):
        made(folder / part)
    job = _Job(case, folder, report)
    steps = {"surface": _surface, "net": _net, "initial": _initial, "optimise": _optimise, "figures": _figures}
    steps |= {"documents": _documents, "report": _report}
    first = next((stage for stage in STAGES if done.get(stage) != keys[stage]), None)
    if first is not None:  # whoever reads the folder from now on finds what belongs to the case as it is
        _outdate(summary, first)
        done = {stage: done[stage] for stage in STAGES[: STAGES.index(first)]}
        write_text(folder / "stages.json", json.dumps(done))
        job.tell(summary)
    write_text(folder / "case.toml", dump_case(case))
    reusable = True
    for stage in STAGES[: STAGES.index(until) + 1]:
        reusable = reusable and done.get(stage) == keys[stage]
        results[stage] = steps[stage](job, results, summary, reusable)
        if not reusable:
            summary["seconds"][stage] = round(time.perf_counter() - began, 3)
            if results[stage] is not False:  # pictures without OpenGL aren't done: once it is there, the next run makes them
                done = {**done, stage: keys[stage]}
        summary["seconds"]["total"] = round(sum(v for k, v in summary["seconds"].items() if k != "total"), 3)
        job.tell(summary)
        write_text(folder / "stages.json", json.dumps(done))
        report(stage, f"{'kept' if reusable else 'done'} in {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
    return summary


def _outdate(summary: dict[str, Any], stage: str) -> None:
    """Takes out of the summary what a stage and those after it will find anew."""
    if STAGES.index(stage) <= STAGES.index("initial"):
        summary.pop("designs", None)
    if STAGES.index(stage) <= STAGES.index("optimise"):
        for key in ("optimisation", "sections", "robust"):
            summary.pop(key, None)
        for name in ("unloaded", "optimised", "rounded", "polished"):
            summary.get("designs", {}).pop(name, None)


def stage_keys(case: Case) -> dict[str, str]:
    """A hash for each stage of all that it depends on; of the surface file that is its name and content, wherever it lies."""
    entries = case.model_dump(mode="json")
    file = Path(case.surface.file)
    entries["surface"]["file"] = file.name
    stock = catalogue_bytes(case)
    entries["stock"] = {name: entries["rod"].pop(name) for name in ("stock_length", "kerf")}  # which no design depends on
    needs = {
        "surface": ["surface"],
        "net": ["net", "joint"],
        "initial": ["rod", "cable", "load", "part"],
        "optimise": ["optimise", "limits", "robust"],
        "figures": ["figures", "title"],
        "documents": ["stock"],
        "report": [],
    }
    told = file.stat()
    digest = hashlib.sha256(shellform.__version__.encode() + _content(str(file), told.st_size, told.st_mtime_ns))
    keys = {}
    for stage in STAGES:
        digest.update(stock if stage == "initial" else b"")
        digest.update(json.dumps({name: entries[name] for name in needs[stage]}, sort_keys=True).encode())
        keys[stage] = digest.hexdigest()
    return keys


@cache
def _content(file: str, size: int, written: int) -> bytes:
    """A hash of a file as it was when it had this size and time: studies ask for the same ones many times."""
    return hashlib.sha256(Path(file).read_bytes()).digest()


def _surface(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Surface:
    store, entry = job.path("surface.npz"), job.case.surface
    if keep:
        return load_surface(store, entry.file)
    surface: Surface = results["surface"]
    save_surface(store, surface)
    summary["surface"] = surface_summary(surface, entry.file)
    return surface


def _net(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Net:
    if keep:
        return load_net(job.path("net.npz"))
    net, angle, offset = net_of(job.case, results["surface"], progress=lambda text: job.report("net", text))
    save_net(job.path("net.npz"), net)
    write_text(job.path("net.json"), json.dumps(net_document(net)))
    summary["net"] = {
        **net_summary(net),
        **rod_limits(job.case.rod, net),
        "angle": angle,
        "offset": list(offset),
    }
    return net


def net_of(
    case: Case, surface: Surface, *, progress: Callable[[str], None] = lambda text: None
) -> tuple[Net, float, tuple[float, float]]:
    """The case's net with its angle, rad, and offset."""
    entry = case.net
    return oriented_net(
        surface,
        net_settings(entry, case.joint.gap),
        angle=entry.angle if entry.angle == "auto" else float(np.deg2rad(entry.angle)),
        offset=entry.offset,
        progress=progress,
    )


def net_settings(entry: NetEntry, gap: float) -> dict[str, Any]:
    """The settings of pull_net in a case but for angle and offset."""
    names = ("spacing", "spacing_v", "guides", "elements", "method", "start", "spring_density", "shear_stiffness", "merge", "ground")
    return {name: getattr(entry, name) for name in names} | {"outline": entry.outline, "gap": gap}


def net_summary(net: Net) -> dict[str, Any]:
    """The `net` part of summary.json but for the rod's radius."""
    return {
        "spacing": net.spacing,
        "crossings": len(net.grid.lattice),
        "rods": len(net.grid.rods),
        "supports": len(net.supports),
        "spacing_v": net.grid.spacing_v,
        **net.quality.summary(),
        "notes": list(net.notes),
    }


def _initial(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> dict[str, Any]:
    case = job.case
    shell, loads = gridshell(case, results["net"], results["surface"])
    summary["net"] |= rod_limits(case.rod, shell.net)
    found: dict[str, Any] = {"shell": shell, "loads": loads}
    if keep:
        return found
    network = shell.network(shell.design(rest_ratio=case.cable.rest_ratio))
    summary["model"] = {
        "nodes": len(network.nodes),
        "beams": len(network.beams.ends),
        "cables": len(network.cables.ends),
        "freedoms": int(6 * len(network.nodes)),
    }
    summary["designs"] = {}
    for name, design in [("unbraced", shell.unbraced()), ("initial", shell.design(rest_ratio=case.cable.rest_ratio))]:
        job.report("initial", f"loading the {name} design")
        _keep(job, shell, name, design, _follow(shell, design, loads), loads, summary)
    first = summary["designs"]["initial"]["loads"]["design"]
    span = float(max(summary["surface"]["size"][:2]))
    if not first["on_branch"] or first["deviation_max"] > 0.1 * span:
        raise NotConverged(
            f"The initial design deforms excessively under the design load ({1e3 * first['deviation_max']:.0f} mm); its states "
            f"are kept in {job.path('states')}",
            remedy="Choose a denser grid (net.spacing), thicker rods (rod.radius) or stiffer cables (cable.stiffness).",
        )
    return found


def _optimise(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if keep:
        return
    from shellform.design import mma

    entry, cable = job.case.optimise, job.case.cable
    shell, loads = results["initial"]["shell"], results["initial"]["loads"]
    start = shell.design(rest_ratio=cable.rest_ratio)

    def watch(step: mma.Step) -> None:
        said = "" if step.accepted else ", rejected"
        job.report(
            "optimise",
            f"evaluation {step.evaluation}/{entry.evaluations}: objective {step.objective:.4f}, {step.cables} cables, "
            f"{100 * step.stage:.0f} % of the additional load{said}",
        )

    problem = case_problem(job.case, shell, loads, start)
    groups = symmetric_groups(shell) if entry.symmetric else None  # at once: it may be refused
    best = mma.optimize(
        problem,
        start,
        evaluations=entry.evaluations,
        stiffness=entry.stiffness_min,
        most_cables=entry.cables_max,
        progress=watch,
    )
    _forget(job, ("unloaded", "optimised", "rounded", "polished"), summary)
    built = {"optimised": best}
    _keep(job, shell, "optimised", best.design, _follow(shell, best.design, loads), loads, summary)
    rounded = _rounded(job, best, start, loads, summary) if problem.frees_radius and entry.rounded else None
    if rounded is not None:
        built["rounded"] = rounded
    if entry.polish:
        job.report("optimise", "polishing the cables that are left")
        last = list(built.values())[-1]
        built["polished"] = mma.polish(last, evaluations=entry.polish, groups=groups)
        here = last.problem.shell
        _keep(job, here, "polished", built["polished"].design, _follow(here, built["polished"].design, loads), loads, summary)
        if "section" in summary["designs"].get("rounded", {}):
            summary["designs"]["polished"]["section"] = summary["designs"]["rounded"]["section"]
    for name, found in built.items():
        _examine(job, name, found, loads, summary)
    if job.case.robust is not None:
        job.report("optimise", "what scatter does to the shape")
        name, found = list(built.items())[-1]
        told = robustness(job.case.robust, found.problem.shell, found.design, found.states["design"], loads["design"])
        summary["robust"] = {"design": name, **told.summary()}
        write_text(job.path("schedules/robust.csv"), told.table())
    job.report("optimise", "the design without regard to the loads")
    unloaded = mma.optimize(
        Problem(
            shell,
            {"none": loads["none"]},
            [Share(1.0, Misfit("none"))],
            [AtMost(cable.force_max, CableForces("none"))],
            entry.rest_length_min,
            entry.rest_length_max,
        ),
        start,
        evaluations=15,
        thin=False,
    )
    _keep(job, shell, "unloaded", unloaded.design, _follow(shell, unloaded.design, loads), loads, summary)
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
        "feasible": max(best.constraints.values(), default=-1.0) <= mma.FEASIBLE
        and summary["designs"]["optimised"].get("critical_factor_kept", True),
    }
    write_text(job.path("history.csv"), history_text(best.history))


def _rounded(job: _Job, best: Optimum, start: Design, loads: Mapping[str, Reals], summary: dict[str, Any]) -> Optimum | None:
    """Operation 4: keeps the design "rounded" and the table of sections. None without a catalogue or a design."""
    from shellform.study import rounding

    entry = job.case.optimise
    catalogue = rounding_catalogue(job.case)
    if catalogue is None:
        return None
    trials = rounding.tried(
        best,
        start,
        catalogue,
        lambda shell: case_problem(job.case, shell, loads, start, frees_radius=False),
        evaluations=entry.rounded,
        beside=entry.neighbours,
        progress=lambda text: job.report("optimise", text),
    )
    summary["sections"] = [each.row() for each in trials]
    write_text(job.path("schedules/sections.csv"), rounding.table(trials))
    taken = rounding.chosen(trials)
    if taken is None or taken.optimum is None:
        return None
    design = taken.optimum.design
    _keep(job, taken.shell, "rounded", design, _follow(taken.shell, design, loads), loads, summary)
    summary["designs"]["rounded"] |= {"section": taken.section, "feasible": not taken.why, "why_not": taken.why, "objective": taken.objective}
    return taken.optimum


def _forget(job: _Job, names: Sequence[str], summary: dict[str, Any]) -> None:
    """Takes designs of an earlier run away, some of which this one may not make."""
    for name in names:
        summary["designs"].pop(name, None)
        for part in (f"designs/{name}.npz", f"designs/{name}.json"):
            job.path(part).unlink(missing_ok=True)
        for file in [*job.folder.glob(f"states/{name}-*.vtp"), *job.folder.glob(f"figures/{name}-*.png")]:
            file.unlink()
    for key in ("sections", "robust"):
        summary.pop(key, None)
        job.path(f"schedules/{key}.csv").unlink(missing_ok=True)


def _examine(job: _Job, name: str, found: Optimum, loads: Mapping[str, Reals], summary: dict[str, Any]) -> None:
    """Adds to a design's part of the summary how far each load could grow."""
    job.report("optimise", f"critical load factors of the {name} design")
    wanted = job.case.limits.critical_factor
    factors = critical_factors(found.problem.shell, found.design, found.states["none"], loads, wanted=wanted)
    for each, told in factors.items():
        summary["designs"][name]["loads"][each] |= told
    if wanted is not None:
        short = below_factor(factors, wanted, job.case.limits.critical_loads)
        summary["designs"][name]["critical_factor_kept"] = not short


def _keep(
    job: _Job,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
    summary: dict[str, Any],
) -> None:
    """Writes a design's model file, states and summary."""
    summary["designs"][name] = keep_design(job.folder, shell, name, design, loaded, loads)
    write_states(job.folder, shell, name, design, {each: loaded[each].equilibrium.state for each in loads})
    job.tell(summary)


def _figures(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> bool:
    """Whether all pictures are there."""
    return keep or draw_everything(read_run(job.folder), report=job.report)


def _documents(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if not keep:
        from shellform.study.documents import write_documents

        summary["documents"] = write_documents(read_run(job.folder), report=job.report)


def _report(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if not keep:
        from shellform.study.page import FILE, write_page

        write_page([read_run(job.folder)], job.path(FILE))


def _follow(shell: Gridshell, design: Design, loads: Mapping[str, Reals]) -> dict[str, Loaded]:
    """As `follow`; where a snap-through doesn't settle, the last state stands for it, and is marked by its residual."""
    try:
        return follow(shell, design, loads)
    except NotConverged as error:
        if not isinstance(error.state, State):
            raise
        lost = Loaded(Equilibrium(error.state, float("nan"), error.residual, error.iterations, False, 1), 0.0, 0)
        return {name: lost for name in loads}
