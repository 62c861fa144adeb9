"""Pictures of gridshells (figures 12 to 14): as pixels (PNG), as lines (SVG, PDF), as films (GIF, MP4), or as
arrays.

    from shellform import render
    image = render.deviation("wet.png", shell, best.states["wet"], best.design, limit=0.010)

Panels (`panel.py`, `maps.py`) are laid out on pages (`sheets.py`) and drawn (`painter.py`) in one window,
off-screen (`scene.py`), or as lines (`vectors.py`). The same input gives the same picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Reals
from shellform.errors import require_count
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.output.pictures import maps, painter
from shellform.output.pictures.images import FILMS, write_film, write_png
from shellform.output.pictures.panel import FORMATS, LIMIT, Look, Panel
from shellform.output.pictures.sheets import Canvas, single, table
from shellform.structure.elements.state import State
from shellform.written import path_to_write

Image = NDArray[np.uint8]


def deviation(
    path: str | Path | None,
    shell: Gridshell,
    state: State,
    design: Design | None = None,
    *,
    load: Reals | None = None,
    title: str = "",
    limit: float = LIMIT,
    size: tuple[int, int] = (1600, 1000),
    view: str = "best",
    transparent: bool = False,
) -> Image:
    """The state's deviation from the target as an array (height, width, 3), or 4 if `transparent`; written to
    `path` unless it is None.

    With the `design` its cables are drawn, with the `load` (n, 6) its arrows. `limit`, m, ends the colour
    scale; `view` is best, top, front or side. The ending of `path` chooses .png, .svg or .pdf. Raises
    InputError for a bad argument and where VTK can't draw.
    """
    panel = maps.panel_of(shell, design, state, load=load, title=title or "deviation from the target")
    return picture(path, panel, Look(limit=limit, size=size, view=view, transparent=transparent))


def image(panel: Panel, look: Look | None = None) -> Image:
    """The picture of one panel as an array (height, width, 3), or 4 without a background, of the look's
    size.
    """
    return picture(None, panel, look)


def picture(path: str | Path | None, panel: Panel, look: Look | None = None) -> Image:
    """As `image`, and written to `path`: all of the file or nothing."""
    return _written(path, single([panel], look or Look())[0])


def sheet(
    path: str | Path | None, rows: Sequence[Sequence[Panel]], look: Look | None = None, *, heading: str = ""
) -> Image:
    """All panels on one page, with one scale and one camera; the look's `size` is one panel's. Rows may
    differ in length.
    """
    return _written(path, table(rows, look or Look(size=(800, 560)), heading))


def pictures(paths: Sequence[str | Path], panels: Sequence[Panel], look: Look | None = None) -> None:
    """Several pictures, each as `picture` writes it; pixels are drawn in one window, which is faster than one
    by one.
    """
    pages = [single([panel], look or Look())[0] for panel in panels]
    endings = {path_to_write(path, *FORMATS).suffix.lower() for path in paths}
    if endings == {".png"}:
        for path, drawn in zip(paths, painter.paint(pages), strict=True):
            write_png(path, drawn, dots=pages[0].look.dots)
        return
    for path, page in zip(paths, pages, strict=True):
        _written(path, page)


def film(
    paths: Sequence[str | Path], panels: Sequence[Panel], look: Look | None = None, *, rate: int = 12
) -> None:
    """A film of the panels, `rate` a second, with one scale and camera, as .gif or .mp4, one file for each
    path.
    """
    require_count(rate, where="rate", give="pictures a second, such as 12")
    for path in paths:
        path_to_write(path, *FILMS)
    frames = list(painter.paint(single(panels, look or Look(size=(960, 600)))))
    for path in paths:
        write_film(path, frames, rate=rate)


def _written(path: str | Path | None, page: Canvas) -> Image:
    """The page as an array, and in its file; a page of lines is never drawn by VTK."""
    target = None if path is None else path_to_write(path, *FORMATS)
    if target is not None and target.suffix.lower() != ".png":
        from shellform.output.pictures import vectors

        vectors.write(target, page)
        return vectors.rasterised(page)
    (picture,) = painter.paint([page])
    if target is not None:
        write_png(target, picture, dots=page.look.dots)
    return picture
