"""The whole job of one case, stage by stage, in a run folder (contracts/run-folder.md).

surface -> net -> initial -> optimise -> figures -> documents -> report. Each stage leaves its result in the
folder and a key in `stages.json`: a hash of the entries it depends on, the surface file's bytes, the
package's version and the stage before. Run again, a stage whose key is unchanged is loaded instead of
computed.
"""

from __future__ import annotations

import hashlib
import json
import platform
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import shellform
from shellform.case.build_gridshell import catalogue_bytes, gridshell, rod_limits
from shellform.case.build_net import net_of, net_summary, surface_of, surface_summary, told_size
from shellform.case.case import Case, check_script, dump_case
from shellform.errors import InputError, NotConverged
from shellform.net.files import load_net, net_document, save_net
from shellform.net.net import Net
from shellform.run import designs
from shellform.run.checkpoint import drop_checkpoint
from shellform.run.designs import Making
from shellform.run.figures import draw_everything
from shellform.run.folder import (
    FORMAT,
    VERSION,
    Report,
    load_surface,
    read_json,
    read_run,
    refuse_overwriting,
    save_surface,
)
from shellform.run.log import logged
from shellform.surface.shape.target import Surface
from shellform.written import folder as made
from shellform.written import write_text

STAGES = ("surface", "net", "initial", "optimise", "figures", "documents", "report")
_SHOWING = STAGES[4:]  # which show what was found: none of them needs another


def run_case(
    case: Case,
    folder: str | Path,
    *,
    until: str = STAGES[-1],
    fresh: bool = False,
    allow_scripts: bool = False,
    report: Report = lambda stage, text: None,
) -> dict[str, Any]:
    """Runs the case's stages up to `until` in `folder` and returns the summary.

    Raises InputError for bad input and NotConverged where a stage finds no result; what was computed stays in
    the folder. Where pictures, documents or the page fail, the others are still made, `failed` in the summary
    says what was wrong, and then the first error is raised.
    """
    folder = Path(folder)
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
        report("surface", f"size {told_size(results['surface'].size)}")
    summary = read_json(folder / "summary.json") if done else {}
    summary = {**summary, "format": FORMAT, "version": VERSION, "shellform": shellform.__version__}
    summary.setdefault("seconds", {})
    for part in ("designs", "states", "figures", "schedules"):
        made(folder / part)
    report = logged(folder, report)
    report("run", f"shellform {shellform.__version__}, Python {platform.python_version()}, up to {until}")
    making = Making(case, folder, report, keys)
    if fresh:
        drop_checkpoint(folder)
    steps = {
        "surface": _surface,
        "net": _net,
        "initial": _initial,
        "optimise": _optimise,
        "figures": _figures,
    }
    steps |= {"documents": _documents, "report": _report}
    first = next((stage for stage in STAGES if done.get(stage) != keys[stage]), None)
    if first is not None:  # whoever reads the folder from now on finds what belongs to the case as it is
        _outdate(summary, first)
        done = {stage: done[stage] for stage in STAGES[: STAGES.index(first)]}
        write_text(folder / "stages.json", json.dumps(done))
        making.tell(summary)
    write_text(folder / "case.toml", dump_case(case))
    summary.pop("failed", None)
    reusable, failures = True, dict[str, Exception]()
    for stage in STAGES[: STAGES.index(until) + 1]:
        reusable = reusable and done.get(stage) == keys[stage]
        try:
            results[stage] = steps[stage](making, results, summary, reusable)
        except Exception as error:
            report(stage, f"ended: {error}")
            if stage not in _SHOWING:
                raise
            failures[stage], results[stage] = error, False
            summary.setdefault("failed", {})[stage] = str(error)
        if not reusable:
            summary["seconds"][stage] = round(time.perf_counter() - began, 3)
            if (
                results[stage] is not False
            ):  # pictures without OpenGL aren't done: once it is there, the next run makes them
                done = {**done, stage: keys[stage]}
        summary["seconds"]["total"] = round(sum(v for k, v in summary["seconds"].items() if k != "total"), 3)
        making.tell(summary)
        write_text(folder / "stages.json", json.dumps(done))
        ended = "failed" if stage in failures else "kept" if reusable else "done"
        report(stage, f"{ended} in {time.perf_counter() - began:.1f} s")
        began = time.perf_counter()
    for first_failure in failures.values():
        raise first_failure
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
    """A hash for each stage of all that it depends on; of the surface file that is its name and content,
    wherever it lies.
    """
    entries = case.model_dump(mode="json")
    file = Path(case.surface.file)
    entries["surface"]["file"] = file.name
    stock = catalogue_bytes(case)
    entries["stock"] = {
        name: entries["rod"].pop(name) for name in ("stock_length", "kerf")
    }  # which no design depends on
    entries["stock"] |= {"adjustment": entries["cable"].pop("adjustment")}
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
    digest = hashlib.sha256(
        shellform.__version__.encode() + _content(str(file), told.st_size, told.st_mtime_ns)
    )
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


def _surface(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Surface:
    store, entry = making.path("surface.npz"), making.case.surface
    if keep:
        return load_surface(store, entry.file)
    surface: Surface = results["surface"]
    save_surface(store, surface)
    summary["surface"] = surface_summary(surface, entry.file)
    return surface


def _net(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> Net:
    if keep:
        return load_net(making.path("net.npz"))
    net, angle, offset = net_of(
        making.case, results["surface"], progress=lambda text: making.report("net", text)
    )
    save_net(making.path("net.npz"), net)
    write_text(making.path("net.json"), json.dumps(net_document(net)))
    summary["net"] = {
        **net_summary(net),
        **rod_limits(making.case.rod, net),
        "angle": angle,
        "offset": list(offset),
    }
    return net


def _initial(
    making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool
) -> dict[str, Any]:
    case = making.case
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
    designs.forget(making, ("unbraced", "initial"), summary)  # whose load cases may have had other names
    unbraced = {"unbraced": shell.unbraced()} if case.cable.without else {}
    for name, design in {**unbraced, "initial": shell.design(rest_ratio=case.cable.rest_ratio)}.items():
        making.report("initial", f"loading the {name} design")
        designs.keep(making, shell, name, design, designs.followed(shell, design, loads), loads, summary)
    first = summary["designs"]["initial"]["loads"]["design"]
    span = float(max(summary["surface"]["size"][:2]))
    if not first["on_branch"] or first["deviation_max"] > 0.1 * span:
        raise NotConverged(
            f"The initial design deforms excessively under the design load ({1e3 * first['deviation_max']:.0f} mm); its states "
            f"are kept in {making.path('states')}",
            remedy="Choose a denser grid (net.spacing), thicker rods (rod.radius) or stiffer cables (cable.stiffness).",
        )
    return found


def _optimise(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if not keep:
        from shellform.run.optimising import optimise

        optimise(making, results["initial"]["shell"], results["initial"]["loads"], summary)


def _figures(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> bool:
    """Whether all pictures are there."""
    return keep or draw_everything(read_run(making.folder), report=making.report)


def _documents(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if not keep:
        from shellform.run.documents import write_documents

        summary["documents"] = write_documents(read_run(making.folder), report=making.report)


def _report(making: Making, results: Mapping[str, Any], summary: dict[str, Any], keep: bool) -> None:
    if not keep:
        from shellform.run.pages import FILE, write_page

        write_page([read_run(making.folder)], making.path(FILE))
