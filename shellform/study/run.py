"""The whole job of one case, stage by stage, in a run folder (contracts/run-folder.md).

surface -> net -> initial -> optimise -> figures. Each stage leaves its result in the folder and a key in `stages.json`: a hash of
the entries it depends on, the surface file's bytes, the package's version and the stage before. Run again, a stage whose key is
unchanged is loaded instead of computed.
"""

from __future__ import annotations

import csv
import hashlib
import io
import json
import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import shellform
from shellform.arrays import Reals
from shellform.design.gridshell import Design, Gridshell
from shellform.design.problem import Problem, deviations, follow
from shellform.design.terms import AtMost, CableForce, CableForces, Misfit, RmsMisfit, RodRadius, Share
from shellform.errors import InputError, NotConverged
from shellform.net.files import load_net, net_document, save_net
from shellform.net.net import Net
from shellform.net.orient import oriented_net
from shellform.structure.equilibrium import Equilibrium
from shellform.structure.loading import Loaded
from shellform.structure.model import Model, write_model
from shellform.structure.state import State
from shellform.study.case import Case, NetEntry, SurfaceEntry, check_script, dump_case, write_text
from shellform.study.shell import catalogue_bytes, gridshell, rod_bounds, rod_limits
from shellform.surface.target import Surface

STAGES = ("surface", "net", "initial", "optimise", "figures")
DESIGNS = ("unbraced", "initial", "unloaded", "optimised", "polished")

_MARKED = 0.2  # of the largest load on a node: smaller ones, such as of the rods' own weight, would hide the shell behind arrows

Report = Callable[[str, str], None]
"""Called with the stage and a line of progress."""


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


def run_case(
    case: Case,
    folder: Path,
    *,
    until: str = "figures",
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
    keys = _keys(case, file)
    done = {} if fresh else _read_json(folder / "stages.json")
    results: dict[str, Any] = {}
    began = time.perf_counter()
    if done.get("surface") != keys["surface"]:  # before anything is written: most bad input is a bad surface
        report("surface", f"reading {file}")
        results["surface"] = surface_of(case.surface, allow_scripts=allow_scripts)
        report("surface", f"size {told_size(results['surface'])}")
    try:
        for part in ("designs", "states", "figures"):
            (folder / part).mkdir(parents=True, exist_ok=True)
        write_text(folder / "case.toml", dump_case(case))
    except OSError as error:
        raise InputError(f"can't be written: {error}", where=str(folder), remedy="Choose another --output.") from error
    job = _Job(case, folder, report)
    summary = _read_json(folder / "summary.json") if done else {}
    summary = {"format": "shellform-summary", "version": 1, **{k: v for k, v in summary.items() if k != "format"}}
    summary.setdefault("seconds", {})
    steps = {"surface": _surface, "net": _net, "initial": _initial, "optimise": _optimise, "figures": _figures}
    reusable = True
    for stage in STAGES[: STAGES.index(until) + 1]:
        reusable = reusable and done.get(stage) == keys[stage]
        results[stage] = steps[stage](job, results, summary, reusable)
        if not reusable:
            summary["seconds"][stage] = round(time.perf_counter() - began, 3)
            done = {**{s: done[s] for s in STAGES[: STAGES.index(stage)] if s in done}, stage: keys[stage]}
        summary["seconds"]["total"] = round(sum(v for k, v in summary["seconds"].items() if k != "total"), 3)
        write_text(folder / "summary.json", json.dumps(summary, indent=1))
        write_text(folder / "stages.json", json.dumps(done))
        report(stage, f"{'kept' if reusable else 'done'} in {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
    return summary


def _keys(case: Case, file: Path) -> dict[str, str]:
    """A hash for each stage of all that it depends on."""
    entries = case.model_dump(mode="json")
    needs = {
        "surface": ["surface"],
        "net": ["net", "joint"],
        "initial": ["rod", "cable", "load", "part"],
        "optimise": ["optimise"],
        "figures": ["figures", "title"],
    }
    digest = hashlib.sha256(shellform.__version__.encode() + file.read_bytes())
    keys = {}
    for stage in STAGES:
        digest.update(catalogue_bytes(case) if stage == "initial" else b"")
        digest.update(json.dumps({name: entries[name] for name in needs[stage]}, sort_keys=True).encode())
        keys[stage] = digest.hexdigest()
    return keys


def _surface(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Surface:
    store, entry = job.path("surface.npz"), job.case.surface
    if keep:
        with np.load(store, allow_pickle=False) as data:
            return Surface(data["vertices"], data["triangles"], data["normals"], entry.file)
    surface: Surface = results["surface"]
    _save_arrays(store, vertices=surface.vertices, triangles=surface.triangles, normals=surface.normals)
    summary["surface"] = surface_summary(surface, entry.file)
    return surface


def _net(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Net:
    if keep:
        return load_net(job.path("net.npz"))
    entry = job.case.net
    net, angle, offset = oriented_net(
        results["surface"],
        net_settings(entry, job.case.joint.gap),
        angle=entry.angle if entry.angle == "auto" else float(np.deg2rad(entry.angle)),
        offset=entry.offset,
        progress=lambda text: job.report("net", text),
    )
    save_net(job.path("net.npz"), net)
    write_text(job.path("net.json"), json.dumps(net_document(net)))
    summary["net"] = {
        **net_summary(net),
        **rod_limits(job.case.rod, net),
        "angle": angle,
        "offset": list(offset),
    }
    return net


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
        _keep_design(job, shell, name, design, _follow(shell, design, loads), loads, summary)
    first = summary["designs"]["initial"]["loads"]["design"]
    span = float(max(summary["surface"]["size"][:2]))
    if not first["on_branch"] or first["deviation_max"] > 0.1 * span:
        write_text(job.path("summary.json"), json.dumps(summary, indent=1))
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
    shares: list[tuple[float, Any]] = [
        (entry.misfit, Misfit("design")),
        (entry.cable_force, CableForce("design")),
        (entry.rod_radius, RodRadius()),
    ]
    others = [name for name in loads if name not in ("none", "design")]

    def watch(step: mma.Step) -> None:
        said = "" if step.accepted else ", rejected"
        job.report(
            "optimise",
            f"evaluation {step.evaluation}/{entry.evaluations}: objective {step.objective:.4f}, {step.cables} cables, "
            f"{100 * step.stage:.0f} % of the additional load{said}",
        )

    problem = Problem(
        shell,
        {name: loads[name] for name in ("design", *others)},
        [Share(share, term) for share, term in shares if share > 0.0],
        [
            AtMost(cable.force_max, CableForces("design")),
            *(AtMost(entry.misfit_rms_additional, RmsMisfit(name)) for name in others),
        ],
        entry.rest_length_min,
        entry.rest_length_max,
        rod_bounds(job.case, shell),
    )
    best = mma.optimize(problem, start, evaluations=entry.evaluations, stiffness=entry.stiffness_min, progress=watch)
    _keep_design(job, shell, "optimised", best.design, _follow(shell, best.design, loads), loads, summary)
    if entry.polish:
        job.report("optimise", "polishing the cables that are left")
        polished = mma.polish(best, evaluations=entry.polish)
        _keep_design(job, shell, "polished", polished.design, _follow(shell, polished.design, loads), loads, summary)
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
    _keep_design(job, shell, "unloaded", unloaded.design, _follow(shell, unloaded.design, loads), loads, summary)
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
    }
    write_text(job.path("history.csv"), _history(best.history))


def _history(history: Any) -> str:
    text = io.StringIO()
    terms, constraints = list(history[0].terms), list(history[0].constraints)
    writer = csv.writer(text)
    head = [f"term.{name}" for name in terms] + [f"constraint.{name}" for name in constraints]
    writer.writerow(["evaluation", "accepted", "objective", *head, "cables", "stage", "seconds"])
    for step in history:
        values = [step.terms[name] for name in terms] + [step.constraints[name] for name in constraints]
        writer.writerow(
            [step.evaluation, int(step.accepted), step.objective, *values, step.cables, step.stage, round(step.seconds, 3)]
        )
    return text.getvalue()


def _figures(job: _Job, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if keep:
        return
    from shellform.output import plots
    from shellform.output.nets import draw_net

    try:
        draw_run(job.folder, limit=job.case.figures.limit, report=job.report)
        draw_net(results["net"], job.path("figures"))
    except InputError as error:  # no OpenGL: everything but the pictures is still made
        job.report("figures", f"no pictures: {error}")
    with job.path("history.csv").open(encoding="utf-8", newline="") as file:
        rows = [row for row in csv.DictReader(file) if row["accepted"] == "1"]
    at = [int(row["evaluation"]) for row in rows]

    def columns(prefix: str) -> dict[str, list[float]]:
        return {
            name.removeprefix(prefix): [float(row[name]) for row in rows] for name in rows[0] if name.startswith(prefix)
        }

    plots.objective_history(job.path("figures/objective.png"), at, columns("term."))
    plots.constraint_history(job.path("figures/constraints.png"), at, columns("constraint."))


def draw_run(
    folder: Path,
    *,
    design: str | None = None,
    load: str | None = None,
    limit: float | None = None,
    report: Report = lambda stage, text: None,
) -> list[Path]:
    """Draws the deviation maps of a run's designs and loads (all, or those named) and returns their files."""
    from shellform.output import render
    from shellform.study.case import load_case

    if not (folder / "case.toml").is_file():
        raise InputError("is no run folder", where=str(folder), remedy="Make one with shellform design.")
    case = load_case(folder / "case.toml")
    ready = [name for name in DESIGNS if (folder / f"designs/{name}.npz").is_file()]
    if not ready:
        raise InputError("the run has no designs yet", where=str(folder), remedy="Run shellform design on it first.")
    net = load_net(folder / "net.npz")
    with np.load(folder / "surface.npz", allow_pickle=False) as data:
        surface = Surface(data["vertices"], data["triangles"], data["normals"])
    shell, cases = gridshell(case, net, surface)
    for what, name, known in [("--design", design, ready), ("--load", load, list(cases))]:
        if name is not None and name not in known:
            raise InputError("isn't there", where=what, value=name, remedy=f"Known: {', '.join(known)}.")
    scale = limit or case.figures.limit
    designs = [design] if design else ready
    loads = [load] if load else list(cases)
    rows, files = [], []
    for name in designs:
        with np.load(folder / f"designs/{name}.npz", allow_pickle=False) as data:
            made = Design(data["rest_length"], data["present"], float(data["radius"]))
            states = {each: State(data[f"{each}_positions"], data[f"{each}_quaternions"]) for each in loads}
        row = []
        for each in loads:
            report("figures", f"{name}, {each}")
            panel = _panel(render, shell, f"{name} design, load: {each}", made, states[each], cases[each])
            file = folder / f"figures/{name}-{each}.png"
            render.picture(file, panel, limit=scale)
            files.append(file)
            row.append(panel)
        rows.append(row)
    if len(rows) * len(rows[0]) > 1:
        file = folder / "figures/deviations.png"
        render.sheet(file, rows, limit=scale)
        files.append(file)
    return files


def _panel(render: Any, shell: Gridshell, title: str, design: Design, state: State, load: Reals) -> Any:
    cables = shell.cables(design)
    weight = np.linalg.norm(load[:, :3], axis=1)
    return render.Panel(
        title,
        state.positions,
        shell.net.grid.rod_ends,
        deviations(shell, state),
        cables.ends,
        cables.tension(state),
        shell.net.supports,
        np.flatnonzero(weight > _MARKED * weight.max()),
        design.radius,
    )


def _follow(shell: Gridshell, design: Design, loads: Mapping[str, Reals]) -> dict[str, Loaded]:
    """As `follow`; where a snap-through doesn't settle, the last state stands for it, and is marked by its residual."""
    try:
        return follow(shell, design, loads)
    except NotConverged as error:
        if not isinstance(error.state, State):
            raise
        lost = Loaded(Equilibrium(error.state, float("nan"), error.residual, error.iterations, False, 1), 0.0, 0)
        return {name: lost for name in loads}


def _keep_design(
    job: _Job,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
    summary: dict[str, Any],
) -> None:
    """Writes a design's model file, states and summary."""
    supports = tuple(int(node) for node in shell.net.supports)
    network = shell.network(design)
    model = Model(network, {each: loads[each] for each in loads if loads[each].any()}, shell.target, supports)
    write_model(job.path(f"designs/{name}.json"), model)
    states = {each: loaded[each].equilibrium.state for each in loads}
    _save_arrays(
        job.path(f"designs/{name}.npz"),
        rest_length=design.rest_length,
        present=design.present,
        radius=np.array(design.radius),
        **{f"{each}_positions": state.positions for each, state in states.items()},
        **{f"{each}_quaternions": state.quaternions for each, state in states.items()},
    )
    cables = shell.cables(design)
    pull = cables.tension(states["design"])
    summary["designs"][name] = {
        "cables": int(design.present.sum()),
        "rod_radius": design.radius,
        "cable_force_sum": float(pull.sum()),
        "cable_force_max": float(pull.max(initial=0.0)),
        "loads": {
            each: {
                "factor": round(float(loads[each][:, 2].sum() / loads["design"][:, 2].sum()), 12) + 0.0,  # no -0
                **_deviation(shell, states[each]),
                "stable": loaded[each].equilibrium.stable,
                "on_branch": loaded[each].on_branch,
                "residual": loaded[each].equilibrium.residual,
                "rod_utilisation_max": utilisation(shell, design, states[each]),
            }
            for each in loads
        },
    }
    _write_states(job, shell, name, design, states, loads)


def _write_states(
    job: _Job,
    shell: Gridshell,
    name: str,
    design: Design,
    states: Mapping[str, State],
    loads: Mapping[str, Reals],
) -> None:
    try:
        from shellform.output import render
    except InputError as error:  # pictures need libraries that may be missing; everything else goes on
        job.report("initial", f"no pictures: {error}")
        return
    labels = ("N", "Mx_a", "My_a", "Mz_a", "Mx_b", "My_b", "Mz_b")
    for each, state in states.items():
        forces = shell.beams(design.radius).local_forces(state)[: len(shell.net.grid.rod_ends)]
        panel = _panel(render, shell, name, design, state, loads[each])
        columns = {label: forces[:, k] for k, label in enumerate(labels)}
        render.write_vtp(job.path(f"states/{name}-{each}.vtp"), panel, columns)


def _deviation(shell: Gridshell, state: State) -> dict[str, float]:
    away = deviations(shell, state)
    return {
        "deviation_max": float(away.max()),
        "deviation_mean": float(away.mean()),
        "deviation_rms": float(np.sqrt((away**2).mean())),
    }


def utilisation(shell: Gridshell, design: Design, state: State) -> float:
    """The largest bending stress of the rods over their flexural strength: M r / I over f_f for round ones (1)."""
    section = shell.rod.resized(design.radius).section
    forces = shell.beams(design.radius).local_forces(state)[: len(shell.net.grid.rod_ends)]
    return float(section.bending(forces[:, [2, 5]], forces[:, [3, 6]]).max()) / section.material.strength


def _save_arrays(path: Path, **arrays: Any) -> None:
    partial = path.with_name(f"{path.name}.part.npz")
    np.savez_compressed(partial, **arrays)
    os.replace(partial, path)


def _read_json(path: Path) -> dict[str, Any]:
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"is damaged: {error}", where=str(path), remedy="Run again with --fresh.") from error
    if not isinstance(data, dict):
        raise InputError("is damaged", where=str(path), remedy="Run again with --fresh.")
    return data
