"""The layout of a page: panels in rows, all with one scale and one camera, a heading above and the keys below
them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shellform.errors import InputError
from shellform.output.pictures import legend
from shellform.output.pictures.legend import Ramp, Word
from shellform.output.pictures.panel import Look, Panel, Scale, scale_of
from shellform.output.pictures.view import Camera, fitted


@dataclass(frozen=True, eq=False)
class Drawing:
    """A rectangle of a page: `size` in pixels, `corner` its upper left one's place from the page's; what it
    shows.
    """

    size: tuple[int, int]
    corner: tuple[int, int]
    words: tuple[Word, ...]
    ramps: tuple[Ramp, ...] = ()
    panel: Panel | None = None


@dataclass(frozen=True, eq=False)
class Canvas:
    """`drawings` on a canvas of a `size` in pixels, all with one `scale`, `camera` and `look`."""

    size: tuple[int, int]
    drawings: Sequence[Drawing]
    scale: Scale
    camera: Camera
    look: Look


def single(panels: Sequence[Panel], look: Look) -> list[Canvas]:
    """A page of the look's size for each panel, all with one scale and camera: one picture, or the frames of
    a film.
    """
    if not panels:
        raise InputError("has no panels", where="picture", remedy="Give at least one.")
    width, height = look.size
    strip = legend.key_height(look)
    room = (width, height - strip)
    scale = scale_of(panels, look, room)
    camera = fitted(panels, look, scale, room)
    words, ramps = legend.key(scale, width, strip)
    foot = Drawing((width, strip), (0, height - strip), words, ramps)
    return [
        Canvas(
            look.size,
            [Drawing(room, (0, 0), legend.title(panel, scale, room), (), panel), foot],
            scale,
            camera,
            look,
        )
        for panel in panels
    ]


def table(rows: Sequence[Sequence[Panel]], look: Look, heading: str = "") -> Canvas:
    """All panels on one page, each of the look's size, and higher by what titles of more than two lines take;
    rows may differ in length."""
    panels = [panel for row in rows for panel in row]
    if not panels:
        raise InputError("has no panels", where="sheet", remedy="Give at least one row with one panel.")
    scale = scale_of(panels, look, look.size)
    more = legend.title_height(panels, scale, look.size[0]) - legend.TWO_LINES * scale.letters
    size = width, height = look.size[0], look.size[1] + max(round(more), 0)
    camera = fitted(panels, look, scale, size)
    columns, strip = max(len(row) for row in rows), legend.key_height(look)
    across = width * columns
    above, top = legend.heading(heading, across, scale) if heading else ((), 0)
    drawings = [
        Drawing(size, (j * width, top + i * height), legend.title(panel, scale, size), (), panel)
        for i, row in enumerate(rows)
        for j, panel in enumerate(row)
    ]
    if heading:
        drawings.append(Drawing((across, top), (0, 0), above))
    wide = min(across, 2 * width)
    words, ramps = legend.key(scale, wide, strip)
    drawings.append(Drawing((wide, strip), ((across - wide) // 2, top + height * len(rows)), words, ramps))
    return Canvas((across, top + height * len(rows) + strip), drawings, scale, camera, look)
