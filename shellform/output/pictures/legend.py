"""Colours, titles and keys: everything on a page that is no gridshell, laid out in pixels for whoever draws
it.

Two scales run side by side, both perceptually uniform and safe for the colour-blind, since their lightness
alone tells the value: the quantity on the rods in viridis, dark to light, the cables' force from light to
dark on a line through CIELAB.
"""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Reals, Record
from shellform.errors import how_many
from shellform.output.pictures.colours import VIRIDIS
from shellform.output.pictures.panel import Look, Panel, Scale
from shellform.quantities import force_unit, number

Colours = NDArray[np.uint8]
"""Red, green, blue (n, 3)."""

SLACK, SUPPORT, LOAD, SURFACE, INK, QUIET = "#dcdcdc", "#3a3a3a", "#5b6573", "#b9c4cf", "#1a1a1a", "#5a5a5a"
_VIRIDIS = np.array(VIRIDIS, dtype=np.float64)
# Equal steps of CIELAB from (84, 8, 36) to (32, 44, 36), sand to brick red, as sRGB.
_SAND = np.array(
    [
        (247, 202, 142), (237, 186, 129), (228, 169, 115), (218, 153, 102), (208, 136, 90), (197, 120, 77),
        (187, 104, 65),
        (176, 88, 53), (165, 72, 42), (154, 54, 31), (143, 35, 20),
    ],
    dtype=np.float64,
)  # fmt: skip
_NOTHING = 1e-6  # of the scale: what is smaller is rounding
_TRUE = 0.01  # of the scale: how far a tick may lie from its number
_STEPS = 4  # of a bar
_CAPTION = 3.2  # of a line: where the words over a bar stand
_SMALLER = 0.9  # of a title's letters, those of what stands below it, and of the key
_LINE = 1.4  # letters' heights from one line of a title to the next
_ABOVE, _BELOW = 1.7, 0.5  # the same, from the panel's edge to the first one's foot, and below the last one's
TWO_LINES = _ABOVE + _LINE + _BELOW
_WIDE = 0.6  # mean width of a letter over its height, generous


@dataclass(frozen=True)
class Word:
    """Letters `pixels` high with their foot at `at`, pixels from the drawing's lower left corner; `justify`
    left, center or right.
    """

    text: str
    at: tuple[float, float]
    pixels: int
    colour: str = INK
    bold: bool = False
    justify: str = "left"


@dataclass(frozen=True, eq=False)
class Ramp(Record):
    """A strip of `colours` (k, 3) between the pixels `left` and `right`, `low` and `high` from the lower left
    corner.
    """

    left: int
    right: int
    low: int
    high: int
    colours: Colours


def rod_colours(share: Reals) -> Colours:
    """Colours (n, 3) of values (n,) between 0 and 1; beyond 1 as at 1."""
    return _between(_VIRIDIS, share)


def cable_colours(share: Reals) -> Colours:
    """Colours (n, 3) of the cables' forces (n,) over the scale's."""
    return _between(_SAND, share)


def title(panel: Panel, scale: Scale, size: tuple[int, int]) -> tuple[Word, ...]:
    """A panel's two lines: its title; the largest and the mean value, and its cables."""
    name, unit = panel.unit
    largest, mean = panel.deviation.max() / unit, panel.deviation.mean() / unit
    if largest < _NOTHING * scale.limit / unit:
        largest = mean = 0.0
    digits = ".1f" if largest >= 1.0 and name else ".2g"
    caption = (
        f"{panel.quantity.split()[0]}: maximum {largest:{digits}} {name}".rstrip()
        + f", mean {mean:{digits}} {name}".rstrip()
    )
    taut, count = int((panel.cable_forces > 0.0).sum()), len(panel.cables)
    if count:
        cables = how_many(count, "cable", "cables")
        caption += f"; {cables}" if taut == count else f"; {taut} of {cables} taut"
    if taut:
        label, size_of = force_unit(scale.force)
        caption += f", {number(float(panel.cable_forces.max()) / size_of)} {label} at most"
    line = scale.letters
    words: list[Word] = []
    for text, letters, colour in ((panel.title, line, INK), (caption, round(_SMALLER * line), QUIET)):
        for part, pixels in _lines(text, letters, size[0] - 1.6 * line, scale.given):
            foot = size[1] - (_ABOVE + _LINE * len(words)) * line
            words.append(Word(part, (0.8 * line, foot), pixels, colour, bold=colour == INK))
    return tuple(words)


def title_height(panels: Sequence[Panel], scale: Scale, width: int) -> float:
    """Pixels that the titles of panels so wide take at most."""
    most = max(len(title(panel, scale, (width, 0))) for panel in panels)
    return (_ABOVE + _LINE * (most - 1) + _BELOW) * scale.letters


def heading(text: str, width: int, scale: Scale) -> tuple[tuple[Word, ...], int]:
    """What stands above a sheet, and the pixels that it takes."""
    letters = round(1.25 * scale.letters)
    lines = _lines(text, letters, width - 1.6 * letters, scale.given)
    height = round(2.6 * scale.letters + _LINE * (len(lines) - 1) * letters)
    foot = 1.04 * scale.letters  # of the last line
    return tuple(
        Word(part, (0.8 * letters, foot + _LINE * (len(lines) - 1 - k) * letters), pixels, bold=True)
        for k, (part, pixels) in enumerate(lines)
    ), height


def key(scale: Scale, width: int, height: int) -> tuple[tuple[Word, ...], tuple[Ramp, ...]]:
    """The colour scales below the panels: the quantity's, and beside it the cables' where one is taut; in
    letters that fit into so many pixels.
    """
    ends = [(0.1, 0.52), (0.66, 0.92)] if scale.force > 0.0 else [(0.22, 0.78)]
    line = min(round(_SMALLER * scale.letters), round(width / 38), int(height / (_CAPTION + 1.0)))
    name, unit = scale.unit
    words, ramp = _bar(
        scale.quantity,
        name,
        scale.limit / unit,
        "≥ " if scale.beyond else "",
        rod_colours,
        ends[0],
        width,
        line,
    )
    ramps = [ramp]
    if scale.force > 0.0:
        caption = "cable force (pale: slack)" if scale.slack else "cable force"
        label, size_of = force_unit(scale.force)
        more, ramp = _bar(caption, label, scale.force / size_of, "", cable_colours, ends[1], width, line)
        words, ramps = words + more, [*ramps, ramp]
    return tuple(words), tuple(ramps)


def key_height(look: Look) -> int:
    """Pixels that the key takes below panels of the look's size."""
    usual = round(0.17 * min(look.size[1], 0.7 * look.size[0]))
    return max(usual, math.ceil((_CAPTION + 1.0) * round(_SMALLER * look.pixels)))


def _bar(
    quantity: str, name: str, limit: float, last: str, colours: Any, ends: Any, width: int, line: int
) -> tuple[list[Word], Ramp]:
    left, right = round(ends[0] * width), round(ends[1] * width)
    steps = _STEPS if right - left > 20 * line else 2
    ticks = limit * np.arange(steps + 1) / steps
    near = (places for places in range(12) if (np.abs(ticks.round(places) - ticks) <= _TRUE * limit).all())
    decimals = next(near, 12)  # a number has to stand where it says
    words = []
    for k in range(steps + 1):
        value = f"{ticks[k]:.{decimals}f}"
        label = f"0 {name}".rstrip() if k == 0 else f"{last}{value} {name}".rstrip() if k == steps else value
        words.append(Word(label, (left + (right - left) * k / steps, 0.55 * line), line, justify="center"))
    words.append(Word(quantity, (0.5 * (left + right), _CAPTION * line), line, QUIET, justify="center"))
    painted = colours((np.arange(right - left) + 0.5) / (right - left))
    return words, Ramp(left, right, round(1.9 * line), round(2.8 * line), painted)


def _between(table: Reals, share: Reals) -> Colours:
    at = np.linspace(0.0, 1.0, len(table))
    return np.column_stack([np.interp(share, at, table[:, k]) for k in range(3)]).round().astype(np.uint8)


def _lines(text: str, pixels: int, room: float, given: bool) -> list[tuple[str, int]]:
    """A text in as many lines as it takes with letters that are given, else in one; each with its letters."""
    if not given:
        return [(text, _fitting(text, pixels, room))]
    columns = max(int(room / (_WIDE * pixels)), 1)
    return [(part, pixels) for part in textwrap.wrap(text, columns)]


def _fitting(text: str, pixels: int, room: float) -> int:
    """Letters as high as they may be for the text to fit."""
    return max(8, min(pixels, int(room / (_WIDE * max(len(text), 1)))))
