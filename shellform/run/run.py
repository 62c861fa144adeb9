"""The whole job of one case, stage by stage, in a run folder (documentation/reference/run.md).

surface -> net -> initial -> optimise -> safety -> figures -> documents -> report. Each stage leaves its
result in the folder and a key in `stages.json`: a hash of the entries it depends on, the surface file's
bytes, the package's version and the stage before. Run again, a stage whose key is unchanged and whose files
are there is loaded instead of computed. Stages hand on what they made, and the summary with their part.
"""

from __future__ import annotations

import json
import platform
import time
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import shellform
from shellform.arrays import Reals, Record
from shellform.case.beside_surface import doubts, refuse_beside
from shellform.case.build_gridshell import gridshell, rod_limits
from shellform.case.build_net import net_of, net_record, size_text, surface_of, surface_record, with_rods
from shellform.case.build_rod import rod_sizes
from shellform.case.case import Case, check_script
from shellform.errors import InputError, NotConverged, ShellformError, require_file, require_known
from shellform.gridshell.gridshell import Gridshell, TooCurved
from shellform.gridshell.joints import doubts as joint_doubts
from shellform.gridshell.tolerances import default_tolerances
from shellform.net.net import Net
from shellform.net.refusal import NoNet, Stalled
from shellform.net.saved import load_net, net_document, save_net
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.records.stages import SHOWING, STAGES, StagesDone, read_stages, write_stages
from shellform.records.summary import ModelRecord, Summary, outdated, read_summary, write_summary
from shellform.run import designs
from shellform.run.broken_off import break_off
from shellform.run.checkpoint import drop_checkpoint
from shellform.run.folder import (
    BUILDABLE,
    DESIGNS,
    alone,
    load_surface,
    read_run,
    refuse_links,
    refuse_overwriting,
    save_surface,
)
from shellform.run.judged import judged
from shellform.run.kept_case import write_case
from shellform.run.keys import stage_keys
from shellform.run.lasting import lasting, take_away
from shellform.run.log import logged
from shellform.run.pages import FILE, write_page
from shellform.run.pictures_beside import DrawnMaps, draw_all_but, maps_beside
from shellform.run.profiling import Profiler
from shellform.run.sketch import STAGES_OF_SKETCH, draw_sketch, drop_other, refuse_over_full, sketched
from shellform.run.way_out import COVERED, with_way_out
from shellform.run.workspace import Workspace
from shellform.structure.elements.threads import dense_on_one
from shellform.structure.solve.loading import Loaded
from shellform.surface.shape.target import Surface
from shellform.work_clock import listening
from shellform.written import make_folder, write_text

_EXCESS = 0.1  # of the larger side, that a node of the initial design may be off
_T = TypeVar("_T")


@dataclass(frozen=True, eq=False)
class Parts(Record):
    """What the stages hand on; None until its stage is done, `initial` where that was done before."""

    surface: Surface | None = None
    net: Net | None = None
    shell: Gridshell | None = None
    loads: Mapping[str, Reals] | None = None
    initial: Mapping[str, Loaded] | None = None
    maps: DrawnMaps | None = None


@dataclass(frozen=True, eq=False)
class _Ended:
    """What a stage gives back: the parts, the summary, and whether its result is `complete`: pictures without
    OpenGL aren't, so that the next run makes them."""

    parts: Parts
    summary: Summary
    complete: bool = True


@dense_on_one()
def run_case(
    case: Case,
    folder: str | Path,
    *,
    until: str = STAGES[-1],
    fresh: bool = False,
    allow_scripts: bool = False,
    wait: bool = False,
    profile: bool = False,
    sketch: bool = False,
    report: Report = unheard,
) -> Summary:
    """Runs the case's stages up to `until` in `folder` and returns the summary.

    Raises InputError for bad input, and where another process is at work in the folder unless it is to `wait`
    for it; NotConverged where a stage finds no result; what was computed stays in the folder. Where pictures,
    documents or the page fail, the others are still made, `failed` in the summary says what was wrong, and
    then the first error is raised. With `profile`, profile.json tells what the stages took that were
    computed. A `sketch` is a first look (sketch.py).
    """
    folder = Path(folder)
    with listening() if profile else nullcontext() as clock:
        profiler = None if clock is None else Profiler(clock)
        case = sketched(case) if sketch else case
        require_known(until, STAGES, where="--until", what="is no stage")
        file = Path(case.surface.file)
        require_file(file, where=f"surface.file: {file}")
        check_script(file, allow_scripts=allow_scripts)
        keys = stage_keys(case, sketch=sketch)
        began = time.perf_counter()
        parts = Parts()
        if not _done(folder, fresh).has("surface", keys["surface"]):
            # before anything is written: most bad input is a bad surface
            report(Event("surface", f"reading {file}"))
            surface = surface_of(case.surface, allow_scripts=allow_scripts)
            report(Event("surface", f"size {size_text(surface.size)}", Kind.NOTE))
            refuse_beside(case, surface)
            parts = Parts(surface=surface)
        with alone(folder, wait=wait):
            workspace = Workspace(case, folder, logged(folder, report), keys, until, profiler, sketch)
            return _run_alone(workspace, fresh, parts, began)


def _done(folder: Path, fresh: bool) -> StagesDone:
    """What is done in a folder, and may be kept: what of it is still there."""
    if fresh:
        refuse_links(folder)
        return StagesDone()
    refuse_overwriting(folder)
    done = read_stages(folder)
    return lasting(folder, done, read_summary(folder)) if done.keys else done


def _run_alone(workspace: Workspace, fresh: bool, parts: Parts, began: float) -> Summary:
    """As `run_case`, in a folder where nobody else is at work."""
    folder, keys = workspace.folder, workspace.keys
    done = _done(folder, fresh)
    if parts.surface is None and not done.has("surface", keys["surface"]):
        raise InputError(
            "was changed by another shellform meanwhile",
            where=str(folder),
            remedy="Run the same command again.",
        )
    if parts.surface is None:  # of an earlier run, whose results stay where the case can't be meant
        parts = Parts(surface=load_surface(workspace.path("surface.npz"), workspace.case.surface.file))
        refuse_beside(workspace.case, _there(parts.surface))
    if workspace.sketch:
        refuse_over_full(folder, fresh=fresh)
    summary = read_summary(folder) if done.keys else Summary()
    summary = replace(summary, shellform=shellform.__version__, failed={}, sketch=workspace.sketch)
    for part in ("designs", "states", "figures", "schedules"):
        make_folder(folder / part)
    workspace.say(
        "run",
        f"shellform {shellform.__version__}, Python {platform.python_version()}, up to {workspace.until}",
    )
    if fresh:
        drop_checkpoint(folder)
    first = next((stage for stage in _wanted(workspace) if not done.has(stage, keys[stage])), None)
    if first is not None:  # whoever reads the folder from now on finds what belongs to the case as it is
        summary, done = outdated(summary, first), done.before(first)
        write_stages(folder, done)
        write_summary(folder, summary)
        take_away(folder, first)
    drop_other(folder, sketch=workspace.sketch)
    write_case(folder, workspace.case)
    return _stages(workspace, parts, summary, done, began)


def _stages(workspace: Workspace, parts: Parts, summary: Summary, done: StagesDone, began: float) -> Summary:
    """Stage after stage. Raises the first error of those that only show what was found, once all were tried;
    any other at once."""
    reusable, failures = True, list[Exception]()
    for stage in _wanted(workspace, workspace.until):
        reusable = reusable and done.has(stage, workspace.keys[stage])
        kind = Kind.KEPT if reusable else Kind.DONE
        try:
            ended = _steps()[stage](workspace, parts, summary, reusable)
        except Exception as error:
            workspace.say(stage, f"ended: {error}", Kind.FAILED)
            if stage not in SHOWING:
                if isinstance(error, ShellformError):
                    _tell(workspace, stage, error)
                raise
            failures.append(error)
            kind = Kind.FAILED
            ended = _Ended(parts, replace(summary, failed={**summary.failed, stage: str(error)}), False)
        parts, summary = ended.parts, ended.summary
        spent = time.perf_counter() - began
        if not reusable:
            summary = summary.with_seconds(stage, spent)
            if ended.complete:
                done = done.also(stage, workspace.keys[stage])
        summary = summary.totalled()
        write_summary(workspace.folder, summary)
        write_stages(workspace.folder, done)
        if workspace.profiler is not None:
            workspace.profiler.over(workspace.folder, stage, workspace.keys[stage], kept=reusable)
        workspace.say(stage, f"{kind.value} in {spent:.1f} s", kind)
        began = time.perf_counter()
    if failures:
        raise failures[0]
    return summary


def _wanted(workspace: Workspace, until: str = STAGES[-1]) -> list[str]:
    """The stages up to one of them."""
    some = STAGES_OF_SKETCH if workspace.sketch else STAGES
    return [stage for stage in STAGES[: STAGES.index(until) + 1] if stage in some]


def _tell(workspace: Workspace, stage: str, error: ShellformError) -> None:
    """The page of a run that ends early; where it can't be written, the error says so too."""
    try:
        break_off(workspace, stage, error)
    except (ShellformError, OSError) as other:
        error.add_note(f"Nor could its page be written: {other}")


def _steps() -> dict[str, Callable[[Workspace, Parts, Summary, bool], _Ended]]:
    """What each stage does, by its name."""
    return {
        "surface": _surface,
        "net": _net,
        "initial": _initial,
        "optimise": _optimise,
        "safety": _safety,
        "figures": _figures,
        "documents": _documents,
        "report": _report,
    }


def _surface(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    surface = _there(parts.surface)
    for doubt in doubts(workspace.case, surface):
        workspace.say("surface", doubt, Kind.NOTE)
    if keep:
        return _Ended(parts, summary)
    for mended in surface.mended:
        workspace.say("surface", mended, Kind.NOTE)
    save_surface(workspace.path("surface.npz"), surface)
    return _Ended(parts, replace(summary, surface=surface_record(surface, workspace.case.surface.file)))


def _net(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    case = workspace.case
    if keep:  # which is the same with other rods; what it allows of them isn't
        net = load_net(workspace.path("net.npz"))
        record = with_rods(_there(summary.net), rod_limits(case.rod, net))
        return _Ended(replace(parts, net=net), replace(summary, net=record))
    surface = _there(parts.surface)

    def pulled(target: Surface) -> tuple[Net, float, tuple[float, float]]:
        return net_of(case, target, progress=partial(workspace.say, "net"))

    try:
        net, angle, offset = pulled(surface)
    except (NoNet, Stalled) as error:
        radius = COVERED * case.net.spacing
        folder, say = workspace.path(BUILDABLE), partial(workspace.say, "net")
        raise with_way_out(error, surface, radius, folder, pulled, say) from error
    save_net(workspace.path("net.npz"), net)
    write_text(workspace.path("net.json"), json.dumps(net_document(net)))
    record = net_record(net, angle=angle, offset=offset, rods=rod_limits(case.rod, net))
    return _Ended(replace(parts, net=net), replace(summary, net=record))


def _initial(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    case, surface = workspace.case, _there(parts.surface)

    def made(target: Surface) -> None:
        gridshell(case, net_of(case, target)[0], target)

    try:
        shell, loads = gridshell(case, _there(parts.net), surface)
    except TooCurved as error:
        folder, say = workspace.path(BUILDABLE), partial(workspace.say, "initial")
        raise with_way_out(error, surface, error.radius, folder, made, say) from error
    parts = replace(parts, shell=shell, loads=loads)
    write_case(workspace.folder, case, default_tolerances(shell))
    net = with_rods(_there(summary.net), rod_limits(case.rod, shell.net))
    summary = replace(summary, net=net)
    for doubt in joint_doubts(shell.joint, shell.rod):
        workspace.say("initial", doubt.told(), Kind.NOTE)
    if keep:
        return _Ended(parts, summary)
    start = shell.design(rest_ratio=case.cable.rest_ratio)
    network = shell.network(start)
    nodes = len(network.nodes)
    model = ModelRecord(nodes, len(network.beams.ends), len(network.cables.ends), 6 * nodes)
    summary = replace(summary, model=model, designs={})
    # whose load cases may have had other names, and with those that an earlier run made of it
    summary = designs.forget(workspace.folder, DESIGNS, summary)
    unbraced = {"unbraced": shell.unbraced()} if case.cable.without else {}
    for name, design in {**unbraced, "initial": start}.items():
        workspace.say("initial", f"loading the {name} design", Kind.BEGAN)
        reached = designs.followed(shell, design, loads)
        summary = designs.keep(workspace, shell, name, design, reached, loads, summary)
    parts = replace(parts, initial=reached)  # the last one's
    _refuse_excess(workspace, shell, summary)
    return _Ended(parts, summary)


def _refuse_excess(workspace: Workspace, shell: Gridshell, summary: Summary) -> None:
    """Raises NotConverged where the initial design deforms so much that no search would mend it."""
    case, loads = workspace.case, summary.designs["initial"].loads
    first, most = loads["design"], _EXCESS * max(_there(summary.surface).size[:2])
    if first.on_branch and first.deviation_max <= most:
        return
    remedy = (
        "Choose a denser grid (net.spacing), thicker rods "
        f"({rod_sizes(case.rod, shell.rod).named}) or stiffer cables (cable.stiffness)."
    )
    if "none" in loads and loads["none"].deviation_max > most:  # cables pull it out of shape
        remedy = f"It does so without any load: give a cable.rest_ratio nearer to 1 than {case.cable.rest_ratio:g}."
    raise NotConverged(
        "The initial design deforms excessively under the design load "
        f"({1e3 * first.deviation_max:.0f} mm); its states are kept in {workspace.path('states')}",
        remedy=remedy,
    )


def _optimise(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    if keep and summary.verdict is not None:
        return _Ended(parts, summary)
    if keep:  # and what examined the design is to be done anew, or wasn't asked for
        return _Ended(parts, replace(summary, verdict=judged(read_run(workspace.folder))))
    from shellform.run.optimising import optimise

    summary = optimise(workspace, _there(parts.shell), _there(parts.loads), summary, parts.initial)
    write_summary(workspace.folder, summary)
    return _Ended(parts, replace(summary, verdict=judged(read_run(workspace.folder))))


def _safety(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    if keep:
        return _Ended(parts, summary)
    from shellform.run.examination import examine

    write_summary(workspace.folder, summary)
    if "figures" not in _wanted(workspace, workspace.until):
        return _Ended(parts, examine(workspace))
    with maps_beside(workspace.folder) as drawn:
        summary = examine(workspace)
        return _Ended(replace(parts, maps=drawn()), summary)


def _figures(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    draw = draw_sketch if workspace.sketch else partial(draw_all_but, parts.maps)
    complete = keep or draw(read_run(workspace.folder), report=workspace.report)
    return _Ended(parts, summary, complete)


def _documents(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    if keep:
        return _Ended(parts, summary)
    from shellform.run.documents import write_documents

    record = write_documents(read_run(workspace.folder), report=workspace.report)
    return _Ended(parts, replace(summary, documents=record))


def _report(workspace: Workspace, parts: Parts, summary: Summary, keep: bool) -> _Ended:
    if not keep:
        write_page([read_run(workspace.folder)], workspace.path(FILE))
    return _Ended(parts, summary)


def _there(part: _T | None) -> _T:
    """A part that an earlier stage has made."""
    assert part is not None
    return part
