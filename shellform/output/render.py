"""Deviation maps (figures 12 to 14) and geometry files, drawn off-screen; the door to PyVista.

Rods are tubes coloured by each node's distance from its target, cables grey tubes as thick as their force (slack ones
faint), supports cones, loads arrows. One parallel camera fits everything that is to be shown, on all panels of a sheet
alike: in the view's axes right and up, the box of all points is laid into the part of the panel below the title. Each
panel is drawn at twice its size and averaged down, so that edges and letters are smooth on any driver, and the colour
bar is painted by the function that colours the rods.

VTK draws without display or graphics card where EGL (or OSMesa) and Mesa's software driver are installed. Where they are
not, it hands out a window without a context and crashes at the first frame; `_window_works` asks for the context first.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shellform.arrays import Indices, Reals, indices, reals
from shellform.errors import InputError
from shellform.output.colours import VIRIDIS

_LIBRARIES = "On Debian and Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri libxrender1"
try:
    import pyvista as pv
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - registers the windows that vtkRenderWindow chooses from
    from vtkmodules.vtkRenderingCore import vtkRenderWindow
except ImportError as error:  # an incomplete installation, or a system library that VTK loads at import
    raise InputError(f"PyVista can't be loaded: {error}", remedy=f"{_LIBRARIES}.") from error

Image = NDArray[np.uint8]
Triangles = tuple[ArrayLike, ArrayLike]  # vertices (v, 3), m; corners (t, 3)

LIMIT = 0.010  # m, end of the colour scale in figures 12 to 14
# Directions from the shell to the eye, and which way is up.
_VIEWS = {
    "iso": ((1.0, -1.6, 1.1), (0.0, 0.0, 1.0)),
    "top": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
    "front": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "side": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
}
_VIRIDIS = np.array(VIRIDIS, dtype=np.float64)
_CABLE, _SLACK, _SUPPORT, _LOAD, _SURFACE, _INK, _QUIET = (
    "#8a8a8a", "#dcdcdc", "#3a3a3a", "#c8382e", "#b9c4cf", "#1a1a1a", "#5a5a5a",
)  # fmt: skip
_FINER = 2  # each pixel is the mean of 2 × 2; VTK's own multisampling took three times as long and looked no better
_SMALLEST = (160, 120)  # pixels; below it the title leaves no room for the shell
_THIN = 0.0024  # half the width at which a rod is drawn at least, over the width of the picture


@dataclass(frozen=True)
class Panel:
    """One picture: a gridshell in one state.

    `positions` (n, 3), m; rod elements `beams` (m, 2); `deviation` (n,), m, of each node from its target; `cables` (c, 2)
    with their `cable_forces` (c,), N, slack at or below zero; nodes of `supports` (s,) and of loads, `load_points` (k,);
    `rod_radius`, m, drawn thicker where it would be too thin to be seen. `quantity`
    says what `deviation` measures where it is something else, in a `unit` of a name and so much in SI. Raises InputError for wrong shapes and indices.
    """

    title: str
    positions: Reals
    beams: Indices
    deviation: Reals
    cables: Indices
    cable_forces: Reals
    supports: Indices
    load_points: Indices
    rod_radius: float
    quantity: str = "deviation from the target"
    unit: tuple[str, float] = ("mm", 1e-3)

    def __post_init__(self) -> None:
        put = functools.partial(object.__setattr__, self)
        put("positions", reals("positions", self.positions, (None, 3)))
        count = len(self.positions)
        if count == 0:
            raise InputError("positions has no nodes", where=f"panel {self.title!r}")
        put("deviation", reals("deviation", self.deviation, (count,)))
        if self.deviation.min() < 0.0:
            raise InputError("deviation is a distance and can't be negative", value=float(self.deviation.min()))
        for name, width in [("beams", 2), ("cables", 2), ("supports", 0), ("load_points", 0)]:
            shape = (None, width) if width else (None,)
            put(name, indices(name, getattr(self, name), shape, below=count))
        put("cable_forces", reals("cable_forces", self.cable_forces, (len(self.cables),)))
        put("rod_radius", float(reals("rod_radius", self.rod_radius, (), positive=True)))


def image(
    panel: Panel,
    *,
    limit: float = LIMIT,
    size: tuple[int, int] = (1600, 1000),
    view: str = "iso",
    surface: Triangles | None = None,
    frame: ArrayLike | None = None,
) -> Image:
    """The picture as an array (height, width, 3) of `size` (width, height) pixels; the same input gives the same picture.

    `limit`, m, ends the colour scale. `view` is iso, top, front or side. `surface`, as vertices (v, 3) in m and triangles
    (t, 3), is drawn translucent. `frame` (p, 3), m, are further points that must be in view: give the nodes of all states
    where single pictures are to be compared. Raises InputError for a bad argument and where VTK can't draw.
    """
    bar = _bar_height(size)
    return _draw([[panel]], limit, (size[0], size[1] - bar), bar, view, surface, frame)


def picture(
    path: str | Path,
    panel: Panel,
    *,
    limit: float = LIMIT,
    size: tuple[int, int] = (1600, 1000),
    view: str = "iso",
    surface: Triangles | None = None,
    frame: ArrayLike | None = None,
) -> None:
    """Writes `image` of one panel as PNG: all of the file or nothing."""
    target = _door(path, ".png")
    _write(target, image(panel, limit=limit, size=size, view=view, surface=surface, frame=frame))


def sheet(
    path: str | Path,
    rows: Sequence[Sequence[Panel]],
    *,
    limit: float = LIMIT,
    size: tuple[int, int] = (800, 560),
    view: str = "iso",
    surface: Triangles | None = None,
    frame: ArrayLike | None = None,
) -> None:
    """Writes all panels on one PNG, with one scale and one camera; `size` is one panel's, the colour bar stands below.

    Rows may differ in length. The other arguments are those of `image`.
    """
    target = _door(path, ".png")
    _write(target, _draw(rows, limit, size, _bar_height(size), view, surface, frame))


def write_vtp(path: str | Path, panel: Panel, cells: Mapping[str, ArrayLike] | None = None) -> None:
    """Writes a state: its rods and cables with `deviation` [m], `cable_force` [N] and further `cells` (see `write_lines`)."""
    force = np.concatenate([np.full(len(panel.beams), np.nan), panel.cable_forces])
    data = {"cable_force": force, **(cells or {})}
    write_lines(path, panel.positions, panel.beams, panel.cables, {"deviation": panel.deviation}, data)


def write_lines(
    path: str | Path,
    positions: ArrayLike,
    beams: ArrayLike,
    cables: ArrayLike,
    point_data: Mapping[str, ArrayLike],
    cell_data: Mapping[str, ArrayLike],
) -> None:
    """Writes `beams` (m, 2), then `cables` (c, 2), as lines between `positions` (n, 3), m, for ParaView (VTP).

    `point_data` arrays have n rows. `cell_data` arrays have m + c rows, beams first, NaN where a value has no meaning, or
    m rows, for beams only. The cell array `cable` is added: 0 for beams, 1 for cables. Raises InputError for wrong lengths.
    """
    target = _door(path, ".vtp")
    nodes = reals("positions", positions, (None, 3))
    rods = indices("beams", beams, (None, 2), below=len(nodes))
    ties = indices("cables", cables, (None, 2), below=len(nodes))
    mesh = _lines(nodes, np.vstack([rods, ties]))
    for name, given in point_data.items():
        mesh.point_data[name] = _rows(f"point_data[{name!r}]", given, [len(nodes)])
    for name, given in cell_data.items():
        values = _rows(f"cell_data[{name!r}]", given, [len(rods) + len(ties), len(rods)])
        blank = np.full((len(rods) + len(ties) - len(values), *values.shape[1:]), np.nan)
        mesh.cell_data[name] = np.concatenate([values, blank])
    mesh.cell_data["cable"] = np.repeat(np.array([0, 1], dtype=np.uint8), [len(rods), len(ties)])
    _replace(target, mesh.save)


def _rows(name: str, given: ArrayLike, lengths: Sequence[int]) -> Reals:
    values = np.asarray(given, dtype=np.float64)  # NaN is a value here
    if values.ndim not in (1, 2) or len(values) not in lengths:
        wanted = " or ".join(str(length) for length in dict.fromkeys(lengths))
        raise InputError(f"{name} has the wrong shape", value=values.shape, remedy=f"Give {wanted} rows.")
    return values


@dataclass(frozen=True)
class _Camera:
    focus: Reals
    away: Reals
    up: Reals
    height: float  # of the panel, m
    width: float
    depth: float  # from the focus to the farthest point, m


@dataclass(frozen=True)
class _Scale:
    """What all panels of a picture share: metres, newtons and letters."""

    limit: float  # m
    force: float  # N, the largest
    reach: float  # m, the largest extent, which loads are drawn by
    letters: int  # pixels
    quantity: str  # what the colours measure
    unit: tuple[str, float]


def _draw(
    rows: Sequence[Sequence[Panel]],
    limit: float,
    size: tuple[int, int],
    bar: int,
    view: str,
    surface: Triangles | None,
    frame: ArrayLike | None,
) -> Image:
    """All panels of `size` pixels on one white page, and a strip of `bar` pixels with the colour scale below them."""
    panels = [panel for row in rows for panel in row]
    if not panels:
        raise InputError("has no panels", where="sheet", remedy="Give at least one row with one panel.")
    if view not in _VIEWS:
        raise InputError("is no view", where="view", value=view, remedy=f"Known: {', '.join(_VIEWS)}.")
    if not 0.0 < limit < np.inf:
        raise InputError("must be positive", where="figures.limit", value=limit)
    width, height = size
    if width < _SMALLEST[0] or height < _SMALLEST[1]:
        raise InputError("is too small", where="size", value=size, remedy=f"Give {_SMALLEST} pixels or more.")
    skin = None if surface is None else _skin(*surface)
    further = [] if frame is None else [reals("frame", frame, (None, 3))]
    further += [] if skin is None else [np.asarray(skin.points, dtype=np.float64)]
    reach = max(max(float(np.ptp(panel.positions, axis=0).max()) for panel in panels), 1e-9)
    force = max(float(panel.cable_forces.max(initial=0.0)) for panel in panels)
    scale = _Scale(limit, force, reach, max(11, round(0.034 * min(height, 0.7 * width))), panels[0].quantity, panels[0].unit)
    camera = _camera(panels, further, view, size, scale)

    if not _window_works():
        raise InputError("VTK lacks a library to draw pictures with (X11, EGL or Mesa)", remedy=f"{_LIBRARIES}.")
    columns = max(len(row) for row in rows)
    page = np.full((height * len(rows) + bar, width * columns, 3), 255, dtype=np.uint8)
    with _quiet():
        plotter = pv.Plotter(off_screen=True, window_size=[_FINER * width, _FINER * height], lighting="none")
        try:
            plotter.render_window.SetMultiSamples(0)
            plotter.set_background("white")
            for i, row in enumerate(rows):
                for j, panel in enumerate(row):
                    _add(plotter, panel, scale, camera, skin, size)
                    page[i * height : (i + 1) * height, j * width : (j + 1) * width] = _shot(plotter)
            left = (page.shape[1] - width) // 2
            page[-bar:, left : left + width] = _bar(plotter, scale, size, bar)
        finally:
            plotter.close()
    return page


def _add(
    plotter: pv.Plotter, panel: Panel, scale: _Scale, camera: _Camera, skin: pv.PolyData | None, size: tuple[int, int]
) -> None:
    """Replaces what the plotter shows by one panel."""
    plotter.clear_actors()
    radius = max(panel.rod_radius, _THIN * camera.width)
    matt = {"ambient": 0.5, "diffuse": 0.5, "smooth_shading": True, "render": False}  # colours stay those of the bar
    if skin is not None:
        plotter.add_mesh(skin, color=_SURFACE, opacity=0.35, ambient=0.6, diffuse=0.4, smooth_shading=True, render=False)
    rods = _lines(panel.positions, _long(panel.positions, panel.beams))
    if rods.n_lines:
        rods.point_data["colour"] = _colours(panel.deviation / scale.limit)
        tubes = rods.strip(join=True, max_length=len(panel.positions)).tube(radius=radius, n_sides=12)
        plotter.add_mesh(tubes, scalars="colour", rgb=True, **matt)
    taut = panel.cable_forces > 0.0
    share = np.where(taut, panel.cable_forces / (scale.force or 1.0), 0.0)
    for chosen, colour, thickness in [(~taut, _SLACK, 0.2 + share), (taut, _CABLE, 0.2 + 0.5 * np.sqrt(share))]:
        ends = panel.cables[chosen]
        keep = np.isin(np.arange(len(ends)), _which(panel.positions, ends))
        if keep.any():  # each cable has its own two points, so that its thickness is its own
            own = np.arange(2 * int(keep.sum())).reshape(-1, 2)
            lines = _lines(panel.positions[ends[keep]].reshape(-1, 3), own)
            lines.point_data["thickness"] = np.repeat(radius * thickness[chosen][keep], 2)
            plotter.add_mesh(lines.tube(scalars="thickness", absolute=True, n_sides=8), color=colour, **matt)
    if len(panel.supports):
        cone = pv.Cone(center=(0.0, 0.0, -2.5 * radius), direction=(0.0, 0.0, 1.0), height=5.0 * radius, radius=2.5 * radius)
        plotter.add_mesh(_copies(panel.positions[panel.supports], cone), color=_SUPPORT, ambient=0.5, diffuse=0.5, render=False)
    if len(panel.load_points):
        long = _arrow(scale)
        arrow = pv.Arrow(
            start=(0.0, 0.0, long + radius), direction=(0.0, 0.0, -1.0), scale=long,
            tip_length=0.35, tip_radius=0.11, shaft_radius=0.03,
        )  # fmt: skip
        plotter.add_mesh(_copies(panel.positions[panel.load_points], arrow), color=_LOAD, ambient=0.6, diffuse=0.4, render=False)
    name, unit = panel.unit
    largest, mean = panel.deviation.max() / unit, panel.deviation.mean() / unit
    told = f"{panel.quantity.split()[0]}: maximum {largest:.1f} {name}, mean {mean:.1f} {name}"
    if largest < 1.0:
        told = f"{panel.quantity.split()[0]}: maximum {largest:.2g} {name}, mean {mean:.2g} {name}"
    line = scale.letters
    _text(plotter, panel.title, line, (0.8 * line, size[1] - 1.7 * line), bold=True)
    _text(plotter, told, round(0.9 * line), (0.8 * line, size[1] - 3.1 * line), colour=_QUIET)
    _aim(plotter, camera)


def _bar(plotter: pv.Plotter, scale: _Scale, size: tuple[int, int], height: int) -> Image:
    """The colour scale in millimetres, (height, width, 3): lettering by VTK, the colours painted in."""
    plotter.clear_actors()
    width, line = size[0], round(0.9 * scale.letters)
    left, right = round(0.22 * width), round(0.78 * width)
    low, high = round(1.9 * line), round(2.8 * line)
    steps = 4
    # letters need a decimal only where the steps do
    name, unit = scale.unit
    decimals = max(1, int(np.ceil(-np.log10(scale.limit / unit / steps) + 0.5)))
    for k in range(steps + 1):
        value = f"{scale.limit / unit * k / steps:.{decimals}f}"
        label = f"0 {name}" if k == 0 else f"≥ {value} {name}" if k == steps else value
        _text(plotter, label, line, (left + (right - left) * k / steps, 0.55 * line), justify="center")
    _text(plotter, scale.quantity, line, (0.5 * (left + right), 3.2 * line), justify="center", colour=_QUIET)
    strip = _shot(plotter)[-height:]
    painted = _colours((np.arange(right - left) + 0.5) / (right - left))
    strip[height - high : height - low, left:right] = painted
    return strip


def _bar_height(size: tuple[int, int]) -> int:
    return round(0.17 * min(size[1], 0.7 * size[0]))


def _colours(share: Reals) -> Image:
    """Colours (n, 3) of values (n,) between 0 and 1; beyond 1 as at 1."""
    at = np.linspace(0.0, 1.0, len(_VIRIDIS))
    return np.column_stack([np.interp(share, at, _VIRIDIS[:, k]) for k in range(3)]).round().astype(np.uint8)


def _camera(
    panels: Sequence[Panel], further: Sequence[Reals], view: str, size: tuple[int, int], scale: _Scale
) -> _Camera:
    """The parallel camera under which all points, arrows included, lie below the titles."""
    away = np.array(_VIEWS[view][0]) / np.linalg.norm(_VIEWS[view][0])
    up = np.array(_VIEWS[view][1]) - away * (away @ _VIEWS[view][1])
    up /= np.linalg.norm(up)
    right = np.cross(up, away)
    tips = [panel.positions[panel.load_points] + [0.0, 0.0, _arrow(scale)] for panel in panels]
    points = np.vstack([*(panel.positions for panel in panels), *tips, *further])
    seen = points @ np.column_stack([right, up, away])
    low, high = seen.min(axis=0), seen.max(axis=0)
    title = 3.6 * scale.letters / size[1]
    margin = 0.04
    across = max(high[0] - low[0], 1e-6 * scale.reach) / (1.0 - 2.0 * margin)
    upward = max(high[1] - low[1], 1e-6 * scale.reach) / (1.0 - title - 2.0 * margin)
    height = max(upward, across * size[1] / size[0])
    middle = 0.5 * (low + high) + np.array([0.0, 0.5 * title * height, 0.0])
    depth = float(high[2] - low[2]) + scale.reach
    focus = middle[0] * right + middle[1] * up + middle[2] * away
    return _Camera(focus, away, up, height, height * size[0] / size[1], depth)


def _aim(plotter: pv.Plotter, camera: _Camera) -> None:
    eye = plotter.camera
    eye.parallel_projection = True
    eye.focal_point = tuple(camera.focus)
    eye.position = tuple(camera.focus + 2.0 * camera.depth * camera.away)
    eye.up = tuple(camera.up)
    eye.parallel_scale = 0.5 * camera.height
    eye.clipping_range = (0.5 * camera.depth, 3.5 * camera.depth)
    if not plotter.renderer.lights:
        plotter.add_light(pv.Light(position=(-0.4, 0.6, 1.0), light_type="camera light"))


def _arrow(scale: _Scale) -> float:
    return 0.04 * scale.reach


def _shot(plotter: pv.Plotter) -> Image:
    """The plotter's picture, averaged down to the size of a panel."""
    plotter.render()  # screenshot() renders the first time only
    fine = np.asarray(plotter.screenshot(return_img=True))[..., :3].astype(np.uint16)
    height, width = fine.shape[0] // _FINER, fine.shape[1] // _FINER
    blocks = fine.reshape(height, _FINER, width, _FINER, 3).sum(axis=(1, 3))
    return ((blocks + _FINER**2 // 2) // _FINER**2).astype(np.uint8)


def _text(
    plotter: pv.Plotter,
    text: str,
    pixels: int,
    at: tuple[float, float],
    *,
    colour: str = _INK,
    bold: bool = False,
    justify: str = "left",
) -> None:
    """Letters `pixels` high with their foot at `at`, pixels of the panel from its lower left corner."""
    look = pv.TextProperty(
        color=colour, font_size=_FINER * pixels, bold=bold, justification_horizontal=justify, font_family="arial"
    )
    actor = pv.Text(text, position=(round(_FINER * at[0]), round(_FINER * at[1])))
    actor.prop = look  # PyVista 0.49 ignores the one given to Text
    plotter.add_actor(actor, render=False)


def _which(positions: Reals, pairs: Indices) -> Indices:
    """Those of the pairs that have a length: VTK refuses a whole line for one element without."""
    length = np.linalg.norm(positions[pairs[:, 1]] - positions[pairs[:, 0]], axis=1)
    return np.flatnonzero(length > 1e-9 * max(float(np.ptp(positions, axis=0).max()), 1e-9))


def _long(positions: Reals, pairs: Indices) -> Indices:
    return pairs[_which(positions, pairs)]


def _lines(positions: Reals, pairs: Indices) -> pv.PolyData:
    cells = np.column_stack([np.full(len(pairs), 2), pairs]).ravel()
    mesh = pv.PolyData()
    mesh.points = np.array(positions, dtype=np.float64)
    mesh.lines = cells
    return mesh


def _copies(points: Reals, shape: pv.PolyData) -> pv.PolyData:
    return pv.PolyData(np.array(points)).glyph(geom=shape, scale=False, orient=False)


def _skin(vertices: ArrayLike, triangles: ArrayLike) -> pv.PolyData:
    points = reals("surface vertices", vertices, (None, 3))
    corners = indices("surface triangles", triangles, (None, 3), below=len(points))
    return pv.PolyData(np.array(points), faces=np.column_stack([np.full(len(corners), 3), corners]).ravel())


@functools.cache
def _window_works() -> bool:
    """Whether VTK gets a drawing context: without one, drawing ends the process by a segmentation fault."""
    if sys.platform == "linux" and "VTK_DEFAULT_OPENGL_WINDOW" not in os.environ:
        try:
            ctypes.CDLL("libX11.so.6")  # VTK tries X first, and crashes where there is no X library to try it with
        except OSError:
            return False
    with _quiet():
        window = vtkRenderWindow()
        window.SetOffScreenRendering(True)
        window.SetSize(16, 16)
        window.Initialize()
        works = bool(window.IsCurrent())
        window.Finalize()
    return works


def _quiet() -> contextlib.AbstractContextManager[None]:
    """VTK tries X first and warns on standard error where there is no display, which is how we always draw."""
    return pv.vtk_verbosity("off")  # type: ignore[no-any-return]


def _door(path: str | Path, ending: str) -> Path:
    target = Path(path)
    if target.suffix.lower() != ending:
        raise InputError("has another ending", where=str(target), value=target.suffix, remedy=f"Use {ending}.")
    if not target.parent.is_dir():
        raise InputError("the folder doesn't exist", where=str(target.parent), remedy="Make it first.")
    return target


def _write(target: Path, picture: Image) -> None:
    height, width = picture.shape[:2]
    grid = pv.ImageData(dimensions=(width, height, 1))
    grid.point_data["colour"] = np.flipud(picture).reshape(-1, 3)
    _replace(target, grid.save)


def _replace(target: Path, save: Callable[[Path], None]) -> None:
    """Saves beside the target first: VTK reports a full disc or a closed folder only by leaving no file."""
    partial = target.with_name(f"{target.stem}.part{target.suffix}")
    try:
        with _quiet():
            save(partial)
        os.replace(partial, target)
    except OSError as error:
        raise InputError(f"can't be written: {error.strerror}", where=str(target)) from error
    finally:
        partial.unlink(missing_ok=True)
