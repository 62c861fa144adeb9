"""Deviation maps (figures 12 to 14), drawn off-screen; the door to PyVista.

Rods are tubes coloured by each node's distance from its target, on one scale for all panels of a sheet; cables are thin lines,
slack ones faint; supports and loads are marked. VTK draws without a display where EGL or OSMesa libraries are installed.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Indices, Reals, indices, reals
from shellform.errors import InputError

try:
    import pyvista as pv
except ImportError as error:  # VTK's libraries need libGL even to import
    raise InputError(
        f"PyVista can't be loaded: {error}",
        remedy="On Debian and Ubuntu: apt-get install libgl1 libegl1 libxrender1",
    ) from error

pv.vtk_verbosity("off")  # "bad X server connection" is said on every machine without a display, where VTK then goes on

Image = NDArray[np.uint8]

LIMIT = 0.010  # m, end of the colour scale in figures 12 to 14
COLOURS = "viridis"  # perceptually uniform and safe for the colour-blind
_VIEWS = {"iso": (1.0, -1.6, 0.9), "top": (0.0, -1e-3, 1.0), "front": (0.0, -1.0, 0.0), "side": (1.0, 0.0, 0.0)}
_CABLE, _SLACK, _SUPPORT, _LOAD = "#b8860b", "#d8d8d8", "#303030", "#c03028"


@dataclass(frozen=True)
class Panel:
    """One picture: `positions` (n, 3), m; rod elements `beams` (m, 2); `deviation` (n,), m; `cables` (c, 2) with their
    `cable_forces` (c,), N; nodes of `supports` (s,) and loads `load_points` (k,); `rod_radius`, m; `title`."""

    title: str
    positions: Reals
    beams: Indices
    deviation: Reals
    cables: Indices
    cable_forces: Reals
    supports: Indices
    load_points: Indices
    rod_radius: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "positions", reals("positions", self.positions, (None, 3)))
        count = len(self.positions)
        put(self, "deviation", reals("deviation", self.deviation, (count,)))
        for name, shape in [("beams", (None, 2)), ("cables", (None, 2)), ("supports", (None,)), ("load_points", (None,))]:
            put(self, name, indices(name, getattr(self, name), shape, below=count))
        put(self, "cable_forces", reals("cable_forces", self.cable_forces, (len(self.cables),)))


def image(panel: Panel, *, limit: float = LIMIT, size: tuple[int, int] = (1600, 1000), view: str = "iso") -> Image:
    """The picture as an array (height, width, 3); `limit`, m, ends the colour scale."""
    return _draw([[panel]], limit, size, view)


def picture(path: str | Path, panel: Panel, *, limit: float = LIMIT, view: str = "iso") -> None:
    """Writes the picture of one panel as PNG."""
    _write(path, image(panel, limit=limit, view=view))


def sheet(
    path: str | Path,
    rows: Sequence[Sequence[Panel]],
    *,
    limit: float = LIMIT,
    size: tuple[int, int] = (800, 560),
    view: str = "iso",
) -> None:
    """Writes all panels on one PNG, with one scale and one camera; `size` is one panel's."""
    _write(path, _draw(rows, limit, (size[0] * max(len(row) for row in rows), size[1] * len(rows)), view))


def write_vtp(path: str | Path, panel: Panel, cells: Mapping[str, Reals] | None = None) -> None:
    """Writes rods, then cables, as lines with the node array `deviation` and cell arrays, one value an element (VTP)."""
    mesh = _lines(panel.positions, np.vstack([panel.beams, panel.cables]))
    mesh.point_data["deviation"] = panel.deviation
    force = np.concatenate([np.full(len(panel.beams), np.nan), panel.cable_forces])
    mesh.cell_data["cable_force"] = force
    for name, values in (cells or {}).items():
        mesh.cell_data[name] = np.concatenate([values, np.full(len(panel.cables), np.nan)])
    partial = Path(path).with_suffix(".part.vtp")
    mesh.save(partial)
    os.replace(partial, path)


def _draw(rows: Sequence[Sequence[Panel]], limit: float, size: tuple[int, int], view: str) -> Image:
    if view not in _VIEWS:
        raise InputError("is no view", where="view", value=view, remedy=f"Known: {', '.join(_VIEWS)}.")
    if not limit > 0.0:
        raise InputError("must be positive", where="figures.limit", value=limit)
    columns = max(len(row) for row in rows)
    plotter = pv.Plotter(off_screen=True, window_size=list(size), shape=(len(rows), columns), border=False)
    try:
        camera = _camera([panel for row in rows for panel in row], view)
        last = (len(rows) - 1, columns - 1)
        for i, row in enumerate(rows):
            for j, panel in enumerate(row):
                plotter.subplot(i, j)
                small = size[0] / columns < 1200
                _add(plotter, panel, limit, bar=(i, j) == last or len(rows) * columns == 1, small=small)
                plotter.camera_position = camera
        plotter.enable_anti_aliasing("ssaa")
        picture = plotter.screenshot(return_img=True)
    except (RuntimeError, AttributeError) as error:
        raise InputError(
            f"VTK can't draw off-screen: {error}",
            remedy="On Debian and Ubuntu: apt-get install libgl1 libegl1 libosmesa6 libxrender1",
        ) from error
    finally:
        plotter.close()
    return np.asarray(picture, dtype=np.uint8)


def _add(plotter: pv.Plotter, panel: Panel, limit: float, *, bar: bool, small: bool) -> None:
    plotter.set_background("white")
    extent = float(np.ptp(panel.positions, axis=0).max())
    radius = max(panel.rod_radius, 0.0022 * extent)
    rods = _lines(panel.positions, panel.beams)
    rods.point_data["mm"] = 1e3 * panel.deviation
    tubes = rods.tube(radius=radius, n_sides=10)
    font = 11 if small else 17
    plotter.add_mesh(
        tubes,
        scalars="mm",
        cmap=COLOURS,
        clim=(0.0, 1e3 * limit),
        show_scalar_bar=False,
        smooth_shading=True,
        specular=0.15,
    )
    if bar:
        plotter.add_scalar_bar(
            title=f"deviation from the target [mm], ≥ {1e3 * limit:g} at the end\n",
            n_labels=5,
            fmt="%.1f",
            color="black",
            title_font_size=font + 2,
            label_font_size=font,
            position_x=0.25,
            position_y=0.03,
            width=0.5,
            height=0.07,
        )
    taut = panel.cable_forces > 0.0
    for chosen, colour, width, opacity in [(taut, _CABLE, 0.45, 1.0), (~taut, _SLACK, 0.25, 0.35)]:
        if chosen.any():
            mesh = _lines(panel.positions, panel.cables[chosen]).tube(radius=width * radius, n_sides=6)
            plotter.add_mesh(mesh, color=colour, opacity=opacity)
    if len(panel.supports):
        points = pv.PolyData(panel.positions[panel.supports])
        plotter.add_mesh(points.glyph(geom=pv.Sphere(radius=2.2 * radius), scale=False, orient=False), color=_SUPPORT)
    if len(panel.load_points):
        tips = pv.PolyData(panel.positions[panel.load_points] + np.array([0.0, 0.0, 0.045 * extent]))
        tips.point_data["down"] = np.tile([0.0, 0.0, -1.0], (len(panel.load_points), 1))
        arrow = pv.Arrow(tip_length=0.35, tip_radius=0.12, shaft_radius=0.035)
        plotter.add_mesh(tips.glyph(orient="down", scale=False, factor=0.04 * extent, geom=arrow), color=_LOAD)
    told = f"max {1e3 * panel.deviation.max():.1f} mm, mean {1e3 * panel.deviation.mean():.1f} mm"
    plotter.add_text(f"{panel.title}\n{told}", font_size=font - 1, color="black", position="upper_left")


def _camera(panels: Sequence[Panel], view: str) -> list[tuple[float, float, float]]:
    """One camera for all panels, far enough for the largest of them, also where it has snapped through."""
    low = np.min([panel.positions.min(axis=0) for panel in panels], axis=0)
    high = np.max([panel.positions.max(axis=0) for panel in panels], axis=0)
    middle = 0.5 * (low + high)
    away = np.array(_VIEWS[view]) / np.linalg.norm(_VIEWS[view])
    reach = 1.4 * float(np.linalg.norm(high - low))
    up = (0.0, 1.0, 0.0) if view == "top" else (0.0, 0.0, 1.0)
    return [tuple(middle + reach * away), tuple(middle), up]


def _lines(positions: Reals, pairs: Indices) -> pv.PolyData:
    cells = np.column_stack([np.full(len(pairs), 2), pairs]).ravel()
    return pv.PolyData(np.array(positions), lines=cells)


def _write(path: str | Path, picture: Image) -> None:
    partial = Path(path).with_suffix(".part.png")
    height, width = picture.shape[:2]
    grid = pv.ImageData(dimensions=(width, height, 1))
    grid.point_data["colour"] = np.flipud(picture).reshape(-1, 3)
    grid.save(partial)
    os.replace(partial, path)
