"""Pages as pixels, drawn off-screen; the door to PyVista.

Rods are tubes, cables tubes as thick as their force, supports cones, loads arrows. Each drawing is made at
twice its size and averaged down, so that edges and letters are smooth on any driver, and the keys are painted
by the function that colours the rods. Without a background, everything is drawn on white and on black: what
differs shines through, exactly and whatever VTK does about transparency.

VTK draws without display or graphics card where EGL (or OSMesa) and Mesa's software driver are installed.
Where they are not, it hands out a window without a context and crashes at the first frame; `_window_works`
asks for the context first.
"""

from __future__ import annotations

import contextlib
import ctypes
import functools
import os
import sys
from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.output.pictures.legend import LOAD, SLACK, SUPPORT, SURFACE, Word, cable_colours, rod_colours
from shellform.output.pictures.panel import (
    EDGE_BEAM,
    Panel,
    Skin,
    arrow_length,
    cable_thickness,
    drawn_radius,
    long_enough,
)
from shellform.output.pictures.sheets import Canvas, Drawing
from shellform.output.pictures.view import Camera

_LIBRARIES = (
    "On Debian and Ubuntu: apt-get install libegl1 libgl1 libgl1-mesa-dri libxrender1; "
    "pictures as .svg and .pdf need none of them"
)
try:
    import pyvista as pv
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401 - registers the windows that vtkRenderWindow chooses from
    from vtkmodules.vtkRenderingCore import vtkRenderWindow
except ImportError as error:  # an incomplete installation, or a system library that VTK loads at import
    raise InputError(f"PyVista can't be loaded: {error}", remedy=f"{_LIBRARIES}.") from error

Image = NDArray[np.uint8]

# each pixel is the mean of 2 × 2; VTK's own multisampling took three times as long and looked no better
_FINER = 2
# colours stay those of the bar
_MATT = {"ambient": 0.5, "diffuse": 0.5, "smooth_shading": True, "render": False}


def paint(pages: Iterable[Canvas]) -> Iterator[Image]:
    """The pages as arrays (height, width, 3), or 4 without a background; all are drawn in one window.

    Keys and headings that don't change from page to page are drawn once. Raises InputError where VTK can't
    draw.
    """
    require()
    windows: dict[tuple[int, int], pv.Plotter] = {}
    kept: dict[tuple[object, ...], Image] = {}
    try:
        for page in pages:
            depth = 4 if page.look.transparent else 3
            sheet = np.full(
                (page.size[1], page.size[0], depth), 0 if page.look.transparent else 255, dtype=np.uint8
            )
            for each in page.drawings:
                if each.size not in windows:
                    windows[each.size] = _window(each.size)
                # The words of a key tell its colours too.
                known = each.size, each.words, page.look.transparent
                picture = kept.get(known)
                if picture is None:
                    picture = _one(windows[each.size], each, page)
                    if each.panel is None:
                        kept[known] = picture
                (x, y), (width, height) = each.corner, each.size
                sheet[y : y + height, x : x + width] = picture
            yield sheet
    finally:
        for plotter in windows.values():
            plotter.close()


def require() -> None:
    """Raises InputError, naming the packages to install, where VTK can't draw."""
    if not _window_works():
        raise InputError(
            "VTK lacks a library to draw pictures with (X11, EGL or Mesa)", remedy=f"{_LIBRARIES}."
        )


def _window(size: tuple[int, int]) -> pv.Plotter:
    with _quiet():
        plotter = pv.Plotter(off_screen=True, window_size=[_FINER * each for each in size], lighting="none")
        plotter.render_window.SetMultiSamples(0)
        # One surface of one colour needs no order, and a third of the time is saved.
        plotter.renderer.SetUseOIT(False)
        plotter.add_light(pv.Light(position=(-0.4, 0.6, 1.0), light_type="camera light"))
    return plotter


def _one(plotter: pv.Plotter, drawing: Drawing, page: Canvas) -> Image:
    """One drawing, (height, width, 3 or 4)."""
    with _quiet():
        plotter.clear_actors()
        if drawing.panel is not None:
            _add(plotter, drawing.panel, page)
            _aim(plotter, page.camera)
        for word in drawing.words:
            _write(plotter, word)
        shots = []
        for ground in ("white", "black") if page.look.transparent else ("white",):
            plotter.set_background(ground)
            shots.append(_shot(plotter))
    height = drawing.size[1]
    for shot in shots:
        for ramp in drawing.ramps:
            shot[height - ramp.high : height - ramp.low, ramp.left : ramp.right] = ramp.colours
    return _without_ground(*shots) if page.look.transparent else shots[0]


def _add(plotter: pv.Plotter, panel: Panel, page: Canvas) -> None:
    """A panel's actors."""
    scale, camera, look = page.scale, page.camera, page.look
    radius = drawn_radius(panel, look, camera.width)
    if look.surface is not None:
        plotter.add_mesh(
            _skin(look.surface),
            color=SURFACE,
            opacity=0.3,
            ambient=0.6,
            diffuse=0.4,
            smooth_shading=True,
            render=False,
        )
    kept = long_enough(panel.positions, panel.beams)
    if len(kept):
        rods = _lines(panel.positions, panel.beams[kept])
        rods.point_data["colour"] = rod_colours(panel.deviation / scale.limit)
        tubes = rods.strip(join=True, max_length=len(panel.positions)).tube(radius=radius, n_sides=12)
        plotter.add_mesh(tubes, scalars="colour", rgb=True, **_MATT)
    kept = long_enough(panel.positions, panel.edges)
    if len(kept):
        beams = _lines(panel.positions, panel.edges[kept]).strip(join=True, max_length=len(panel.positions))
        tube = beams.tube(radius=EDGE_BEAM * radius, n_sides=12)
        plotter.add_mesh(tube, color=SUPPORT, ambient=0.5, diffuse=0.5, render=False)
    kept = long_enough(panel.positions, panel.cables)
    if len(kept):  # each cable has its own two points, so that its thickness and colour are its own
        share = np.clip(panel.cable_forces[kept] / (scale.force or 1.0), 0.0, 1.0)
        lines = _lines(
            panel.positions[panel.cables[kept]].reshape(-1, 3), np.arange(2 * len(kept)).reshape(-1, 2)
        )
        lines.point_data["thickness"] = np.repeat(radius * cable_thickness(share), 2)
        faint = np.array([int(SLACK[k : k + 2], 16) for k in (1, 3, 5)], dtype=np.uint8)
        lines.point_data["colour"] = np.repeat(
            np.where((share > 0.0)[:, None], cable_colours(share), faint), 2, axis=0
        )
        plotter.add_mesh(
            lines.tube(scalars="thickness", absolute=True, n_sides=8), scalars="colour", rgb=True, **_MATT
        )
    wide = max(radius, 0.0024 * camera.width)  # marks stay marks where rods are drawn as thin as they are
    if len(panel.supports):
        cone = pv.Cone(
            center=(0.0, 0.0, -2.5 * wide), direction=(0.0, 0.0, 1.0), height=5.0 * wide, radius=2.5 * wide
        )
        plotter.add_mesh(
            _copies(panel.positions[panel.supports], cone),
            color=SUPPORT,
            ambient=0.5,
            diffuse=0.5,
            render=False,
        )
    if len(panel.load_points):
        long = arrow_length(scale)
        arrow = pv.Arrow(
            start=(0.0, 0.0, long + wide), direction=(0.0, 0.0, -1.0), scale=long,
            tip_length=0.35, tip_radius=0.11, shaft_radius=0.03,
        )  # fmt: skip
        plotter.add_mesh(
            _copies(panel.positions[panel.load_points], arrow),
            color=LOAD,
            ambient=0.6,
            diffuse=0.4,
            render=False,
        )


def _aim(plotter: pv.Plotter, camera: Camera) -> None:
    eye = plotter.camera
    eye.parallel_projection = True
    eye.focal_point = tuple(camera.focus)
    eye.position = tuple(camera.focus + 2.0 * camera.depth * camera.away)
    eye.up = tuple(camera.up)
    eye.parallel_scale = 0.5 * camera.height
    eye.clipping_range = (0.5 * camera.depth, 3.5 * camera.depth)


def _shot(plotter: pv.Plotter) -> Image:
    """The window's picture, averaged down."""
    plotter.render()  # screenshot() renders the first time only
    fine = np.asarray(plotter.screenshot(return_img=True))[..., :3]
    rows = fine[0::_FINER].astype(np.uint16) + fine[1::_FINER]
    return ((rows[:, 0::_FINER] + rows[:, 1::_FINER] + 2) >> 2).astype(np.uint8)


def _without_ground(on_white: Image, on_black: Image) -> Image:
    """(h, w, 4): where c shines through with opacity a, white shows a c + (1 - a) 255 and black a c."""
    opacity = 255 - (on_white.astype(np.int16) - on_black).clip(0, 255).min(axis=2)
    share = np.maximum(opacity, 1)[..., None]
    colour = np.minimum((on_black.astype(np.int32) * 255 + share // 2) // share, 255)
    return np.dstack([colour, opacity]).astype(np.uint8)


def _write(plotter: pv.Plotter, word: Word) -> None:
    look = pv.TextProperty(
        color=word.colour,
        font_size=_FINER * word.pixels,
        bold=word.bold,
        justification_horizontal=word.justify,
        font_family="arial",
    )
    actor = pv.Text(word.text, position=(round(_FINER * word.at[0]), round(_FINER * word.at[1])))
    actor.prop = look  # PyVista 0.49 ignores the one given to Text
    plotter.add_actor(actor, render=False)


def _lines(positions: Reals, pairs: NDArray[np.int64]) -> pv.PolyData:
    mesh = pv.PolyData()
    mesh.points = np.array(positions, dtype=np.float64)
    mesh.lines = np.column_stack([np.full(len(pairs), 2), pairs]).ravel()
    return mesh


def _copies(points: Reals, shape: pv.PolyData) -> pv.PolyData:
    return pv.PolyData(np.array(points)).glyph(geom=shape, scale=False, orient=False)


def _skin(surface: Skin) -> pv.PolyData:
    corners = surface.triangles
    return pv.PolyData(
        np.array(surface.vertices), faces=np.column_stack([np.full(len(corners), 3), corners]).ravel()
    )


@functools.cache
def _window_works() -> bool:
    """Whether VTK gets a drawing context: without one, drawing ends the process by a segmentation fault."""
    if sys.platform == "linux" and "VTK_DEFAULT_OPENGL_WINDOW" not in os.environ:
        try:  # VTK tries X first, and crashes where there is no X library to try it with
            ctypes.CDLL("libX11.so.6")
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
    """VTK tries X first and warns on standard error where there is no display, which is how we always
    draw.
    """
    return pv.vtk_verbosity("off")  # type: ignore[no-any-return]
