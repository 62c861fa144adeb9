"""The pictures of a run: maps of its designs under its loads, maps of its net, histories, and states as .vtp
files.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import read_arrays
from shellform.errors import InputError, NotConverged, require_known, require_number
from shellform.gridshell.edge_beams import EDGE
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import rod_forces
from shellform.optimiser.optimum import by_constraint
from shellform.output.pictures import maps
from shellform.output.pictures.panel import Look, Paper
from shellform.records import history
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.records.words import fallen_at
from shellform.run.folder import Run, figures_folder, read_run
from shellform.run.scales import colour_limit, force_limit
from shellform.structure.elements.state import State
from shellform.written import make_folder

FAILURE = "states/failure.npz"  # of the stage "safety"
_LOADS = {"none": "no load", "design": "design load", "additional": "additional load"}
QUANTITIES = (*maps.QUANTITIES, "spring", "history")
FILMS = ("pour", "erection")
_STILL = ("spring", "mode", "history")  # of one state, or of none
# of what is looked at how
_OPTIONS = {"view": "--view", "size": "--size", "thickness": "--rods", "width": "--width-mm"}
_FILMED = "Give --film erection, or leave it out."
_USUAL = (1600, 1000)  # pixels


@dataclass(frozen=True)
class Wish:
    """What of a run is to be drawn, and how.

    - `design`, `load`: None: all of them.
    - `quantity`, one of QUANTITIES; `limit` of its colours, SI units; None: the case's for the deviation, 1
      for the utilisation, what the rods bear for their curvature, else the largest.
    - `force_limit`, N, of the cables' colours; 0: the largest.
    - `paper` that it is for; None: a screen. `by`, `tighten_first`: as `erect` takes them, of a film.
    - `endings` of the files, in `folder` (None: the run's figures/); the rest as in panel.py.
    """

    design: str | None = None
    load: str | None = None
    quantity: str = "deviation"
    limit: float | None = None
    view: str = "best"
    size: tuple[int, int] | None = None
    thickness: float = 0.0
    transparent: bool = False
    endings: tuple[str, ...] = (".png",)
    force_limit: float = 0.0
    paper: Paper | None = None
    by: str | None = None
    tighten_first: bool = False
    folder: Path | None = None


def wish(
    *,
    design: str | None,
    load: str | None,
    quantity: str | None,
    limit: float | None,
    view: str,
    size: str | None,
    thickness: float,
    transparent: bool,
    kind: str | None,
    film: str | None,
    force_limit: float | None = None,
    width_mm: float | None = None,
    dpi: float | None = None,
    font_size: float | None = None,
    by: str | None = None,
    tighten_first: bool = False,
    folder: Path | None = None,
) -> Wish:
    """A wish as the command line says it: `size` as WIDTHxHEIGHT, the file's `kind` without a dot. Raises
    InputError for bad options.
    """
    paper = _paper(width_mm, dpi, font_size, film)
    if limit is not None:
        require_number(limit, above=0.0, where="--limit", give="SI units, such as 0.010 for 10 mm")
    if force_limit is not None:
        require_number(force_limit, above=0.0, where="--force-limit", give="newtons, such as 20")
    if film is not None:
        require_known(film, FILMS, where="--film", what="is no film")
    if film is not None and (transparent or quantity in _STILL):
        filmed = ", ".join(each for each in QUANTITIES if each not in _STILL)
        raise InputError(
            "can't be filmed",
            where="--film",
            value="--transparent" if transparent else quantity,
            remedy="Leave --transparent out." if transparent else f"Films show {filmed}.",
        )
    if (by is not None or tighten_first) and film != "erection":
        given = "--tighten-first" if by is None else "--by"
        raise InputError("says how a grid is erected", where=given, value=by, remedy=_FILMED)
    if quantity is not None:
        require_known(quantity, QUANTITIES, where="--quantity", what="is nothing to draw")
    kinds = ("gif", "mp4") if film else ("png", "svg", "pdf")
    if kind is not None:
        require_known(kind, kinds, where="--format", what="is no format of it")
    chosen_kinds = (kind,) if kind else kinds if film else kinds[:1]
    usual = "utilisation" if film == "erection" else "deviation"
    pixels = None if size is None else _pixels(size)
    try:
        look = Look(view=view, thickness=thickness, size=pixels or Look.size)
        if paper is not None:
            paper.look(look)
    except InputError as error:
        option = _OPTIONS[error.where]
        raise InputError(error.what, where=option, value=error.value, remedy=error.remedy) from error
    return Wish(
        design=design,
        load=load,
        quantity=quantity or usual,
        limit=limit,
        view=view,
        size=pixels,
        thickness=thickness,
        transparent=transparent,
        endings=tuple(f".{each}" for each in chosen_kinds),
        force_limit=force_limit or 0.0,
        paper=paper,
        by=by,
        tighten_first=tighten_first,
        folder=folder,
    )


def _paper(
    width_mm: float | None, dpi: float | None, font_size: float | None, film: str | None
) -> Paper | None:
    """The paper that the options name. Raises InputError for what can't be printed."""
    given = {"--width-mm": width_mm, "--dpi": dpi, "--font-size": font_size}
    for (name, value), give in zip(
        given.items(),
        ("millimetres, such as 180", "dots an inch, such as 300", "points, such as 8"),
        strict=True,
    ):
        if value is not None:
            require_number(value, above=0.0, where=name, give=give)
    if width_mm is None:
        for name in ("--dpi", "--font-size"):
            if given[name] is not None:
                raise InputError(
                    "says nothing without a width", where=name, remedy="Give --width-mm 180, say."
                )
        return None
    if film is not None:
        raise InputError("is for pictures in print", where="--width-mm", remedy="Films take --size.")
    usual = Paper(width_mm / 1000.0)
    return Paper(usual.width, dpi or usual.dots, font_size or usual.letters)


def _pixels(text: str) -> tuple[int, int]:
    try:
        width, height = (int(each) for each in text.lower().split("x"))
    except ValueError as error:
        raise InputError(
            "must read WIDTHxHEIGHT in pixels", where="--size", value=text, remedy="For example 1600x1000."
        ) from error
    return width, height


def draw_everything(run: Run, *, mapped: bool | None = None, report: Report) -> bool:
    """All pictures of a run. Without OpenGL the histories alone, a line that says why, and False. Where its
    maps are there already, `mapped` says whether all of them are."""
    drawn = draw_maps(run, report=report) if mapped is None else mapped
    if drawn:
        draw_failure(run)
    if (run.folder / history.FILE).is_file():
        draw_histories(run)
    return drawn


def draw_maps(run: Run, *, report: Report = unheard) -> bool:
    """The maps of a run's designs and of its net, none of which tells what the stage `safety` finds. Without
    OpenGL none, a line that says why, and False."""
    from shellform.output.pictures.net_maps import draw_net  # loads no OpenGL

    if not pictures_possible(report):
        return False
    draw_designs(run, report=report)
    for quantity in ("utilisation", "curvature", "shear", "mode"):
        try:
            draw_designs(run, Wish(run.best, "design", quantity), report=report)
        except NotConverged as error:  # of a shell at its limit no mode may be found; the other maps stand
            report(Event("figures", f"no pictures of the {quantity}: {error}", Kind.NOTE))
    for view in ("top", "front", "side"):
        draw_designs(run, Wish(run.best, "design", view=view), report=report)
    draw_net(run.net, run.folder / "figures", run.surface)
    return True


def draw_failure(run: Run) -> list[Path]:
    """The shape in which the design to build most likely fails, its last stable state moved along the mode in
    which it gives way; nothing where none of its structures falls."""
    from shellform.output.pictures import render

    file, told = run.folder / "figures/failure.png", run.summary.failure
    if told is None or not (run.folder / FAILURE).is_file():
        file.unlink(missing_ok=True)
        return []
    data = read_arrays(run.folder / FAILURE)
    panel = maps.panel_of(
        run.shell_of(told.design),
        run.designs[told.design],
        State(data["positions"], data["quaternions"]),
        load=run.loads[told.load],
        title=f"{told.design} design, structure {told.number} as it fails at {fallen_at(told.factor)} of {_LOADS.get(told.load, told.load)}",
    )
    make_folder(file.parent)
    panel = maps.drawn_out(panel, data["mode"][:, :3])
    render.pictures([file], [titled(run, panel)], look_of(run, Wish(), [panel]))
    return [file]


def draw_histories(
    run: Run, *, ending: str = ".png", folder: Path | None = None, look: Look | None = None
) -> list[Path]:
    """The objective with its terms and cables, and the constraints, at each accepted design; .png, .svg or
    .pdf."""
    from shellform.output.pictures import plots

    steps = [step for step in history.read_history(run.folder) if step.accepted]
    if not steps:
        raise InputError(
            "isn't there: nothing was optimised yet",
            where=str(run.folder / history.FILE),
            remedy="Run shellform design on it again.",
        )
    at = [float(step.evaluation) for step in steps]
    terms = {name: [step.terms[name] for step in steps] for name in steps[0].terms}
    constraints = by_constraint(steps)
    figures = figures_folder(run, folder)
    files = [figures / f"{name}{ending}" for name in ("objective", "constraints")]
    plots.objective_history(files[0], at, terms, cables=[float(step.cables) for step in steps], look=look)
    plots.constraint_history(files[1], at, constraints, look=look)
    return files


def pictures_possible(report: Report) -> bool:
    """Whether pictures can be drawn; if not, one line says why: everything else is still made."""
    from shellform.output.pictures import painter

    try:
        painter.require()
    except InputError as error:
        report(Event("figures", f"no pictures: {error}", Kind.NOTE))
        return False
    if not painter.shades():
        report(Event("figures", painter.AS_LINES, Kind.NOTE))
    return True


def draw_run(folder: str | Path, wish: Wish | None = None) -> list[Path]:
    """Draws maps of a run's designs and loads (all, or those named) and returns their files."""
    return draw_designs(read_run(folder), wish)


def draw_designs(run: Run, wish: Wish | None = None, *, report: Report = unheard) -> list[Path]:
    """As `draw_run`, of a run that is read already."""
    from shellform.output.pictures import net_maps, plots, render

    asked = wish or Wish()
    figures = figures_folder(run, asked.folder)
    if asked.quantity == "history":
        look = replace(plots.HISTORY, size=asked.size or plots.HISTORY.size, transparent=asked.transparent)
        look = asked.paper.look(look) if asked.paper else look
        return draw_histories(run, ending=asked.endings[0], folder=asked.folder, look=look)
    if asked.quantity == "spring":  # what the springs still pull is the net's, whatever the design
        panel = net_maps.panel_of(run.net, "springs")
        look = Look(
            limit=asked.limit or net_maps.limit_of(panel),
            size=asked.size or _USUAL,
            view=asked.view,
            thickness=asked.thickness,
            transparent=asked.transparent,
        )
        file = figures / f"net-springs{asked.endings[0]}"
        render.picture(file, panel, asked.paper.look(look) if asked.paper else look)
        return [file]
    names, loads = chosen(run, asked.design, asked.load)
    report(Event("figures", f"{asked.quantity} of {', '.join(names)}"))
    rows = [[panel_of(run, name, each, asked.quantity) for each in loads] for name in names]
    look = look_of(run, asked, [panel for row in rows for panel in row])
    files = [figures / f"{_stem(asked, name, each)}{asked.endings[0]}" for name in names for each in loads]
    render.pictures(files, [titled(run, panel) for row in rows for panel in row], look)
    if len(files) > 1:
        shown = [row for name, row in zip(names, rows, strict=True) if name in _compared(run) or asked.design]
        stem = "deviations" if asked.quantity == "deviation" else "all"
        page = figures / f"{_stem(asked, stem)}{asked.endings[0]}"
        across, upward = look.size
        part = (across // len(loads), upward // len(loads)) if asked.paper else _half(asked.size)
        render.sheet(page, shown, replace(look, size=part), heading=run.case.title)
        files.append(page)
    return files


def chosen(run: Run, design: str | None, load: str | None) -> tuple[list[str], list[str]]:
    """The designs and loads that are meant. Raises InputError for unknown ones."""
    if design is not None:
        require_known(design, run.designs, where="--design", what="isn't there")
    if load is not None:
        require_known(load, run.loads, where="--load", what="isn't there")
    return [design] if design else list(run.designs), [load] if load else list(run.loads)


def panel_of(run: Run, design: str, load: str, quantity: str = "deviation") -> Any:
    """A design under a load."""

    title = f"{design} design, {_LOADS.get(load, f'load: {load}')}"
    state = run.states[design][load]
    try:
        return maps.panel_of(
            run.shell_of(design),
            run.designs[design],
            state,
            load=run.loads[load],
            quantity=quantity,
            title=title,
        )
    except NotConverged as error:
        raise NotConverged(f"{title}: {error.what}", remedy="Choose another design or load.") from error


def titled(run: Run, panel: Any) -> Any:
    """The panel with the case's title before its own, for a picture that stands alone."""
    return replace(panel, title=f"{run.case.title}: {panel.title}") if run.case.title else panel


def look_of(run: Run, wish: Wish, panels: Sequence[Any]) -> Any:
    """How the run's panels are drawn: one scale of colours and of forces for all."""
    from shellform.output.pictures.panel import Skin

    largest = max(max(float(panel.deviation.max()) for panel in panels), 1e-9 * panels[0].unit[1])
    rod = run.shell.rod
    borne = rod.strength / (rod.young * max(design.radius for design in run.designs.values()))
    usual = {"deviation": colour_limit(run), "utilisation": 1.0, "mode": 1.0}
    if math.isfinite(borne):
        usual["curvature"] = borne
    look = Look(
        limit=wish.limit or usual.get(wish.quantity, largest),
        size=wish.size or _USUAL,
        view=wish.view,
        thickness=wish.thickness,
        force=wish.force_limit or force_limit(run),
        surface=Skin(run.surface.vertices, run.surface.triangles),
        transparent=wish.transparent,
    )
    return wish.paper.look(look) if wish.paper else look


def write_states(
    folder: Path, shell: Gridshell, name: str, design: Design, states: Mapping[str, State]
) -> None:
    """states/NAME-LOAD.vtp: the loaded geometry with deviations, m, and the end forces of rods and edge
    beams.
    """
    from shellform.output.exchange import vtp

    labels = ("N", "Mx_a", "My_a", "Mz_a", "Mx_b", "My_b", "Mz_b")
    for each, state in states.items():
        beams = shell.beams(design.radius)
        forces = beams.local_forces(state)
        forces = np.vstack([rod_forces(beams, forces), forces[beams.of_kind(EDGE)]])  # as net.lines
        columns = {label: forces[:, k] for k, label in enumerate(labels)}
        vtp.write_vtp(folder / f"states/{name}-{each}.vtp", maps.panel_of(shell, design, state), columns)


def _compared(run: Run) -> list[str]:
    """The rows of the sheet: the four designs of the paper's figures 12 to 14, and the one to build."""
    return ["unbraced", "initial", "unloaded", "optimised", run.best]


def _half(size: tuple[int, int] | None) -> tuple[int, int]:
    return (800, 560) if size is None else (max(size[0] // 2, 160), max(size[1] // 2, 120))


def _stem(wish: Wish, *parts: str) -> str:
    """A file's name: what is usual isn't in it."""
    front = [] if wish.quantity == "deviation" else [wish.quantity]
    back = [] if wish.view == "best" else [wish.view]
    return "-".join([*front, *parts, *back])
