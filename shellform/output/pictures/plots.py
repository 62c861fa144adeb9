"""Convergence plots (figures 10, 11, 15 and 16 of the paper), and pages of lines and words; the door to
matplotlib.

Figures are made as objects with their own canvas, so that nothing global is touched and any thread may draw.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import cycle
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.ticker import FixedLocator, FuncFormatter, MaxNLocator, NullLocator
from matplotlib.tri import Triangulation
from numpy.typing import ArrayLike, NDArray

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.output.pictures.curves import read_history as read_history
from shellform.output.pictures.legend import Ramp, Word
from shellform.output.pictures.letters import families
from shellform.output.pictures.panel import FORMATS, Look
from shellform.quantities import number
from shellform.records.words import constraint_titles
from shellform.written import path_to_write, whole

_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00")  # Okabe and Ito's
_DASHES = ("-", "--", ":")  # taken one by one when the colours are used up
_FAR = -1.5  # values further below their limit than this run out of the picture: what is near is what counts
HISTORY = Look(size=(1280, 704), dots=160.0, letters=10.0)
_INCH, _POINTS = 25.4, 72.0  # mm and points in an inch
_CAPITAL = 0.73  # height of a capital over the font's size
_WIDE = 3.0  # value / limit - 1 above which the axis turns logarithmic beyond 1


def objective_history(
    path: str | Path,
    evaluation: Sequence[float],
    terms: Mapping[str, Sequence[float]],
    *,
    cables: Sequence[float] | None = None,
    look: Look | None = None,
) -> None:
    """Figure 10: the objective and its weighted terms at each accepted design, and `cables` in tension if
    given. Of a `look` the size, the letters and the background count.

    The ending of `path` chooses the format: png, svg or pdf. Raises InputError for other endings and uneven
    columns.
    """
    at, lines = _columns(evaluation, terms)
    figure, axes = _figure(look or HISTORY)
    axes.plot(at, np.sum(list(lines.values()), axis=0), color="black", linewidth=2.0, label="objective")
    _curves(axes, at, lines)
    axes.set(xlabel="design evaluations", ylabel="objective and its terms")
    if np.nanmin(list(lines.values()), initial=0.0) >= 0.0:
        axes.set_ylim(bottom=0.0)
    if cables is not None:
        beside = axes.twinx()
        (count,) = _columns(evaluation, {"cables": cables})[1].values()
        beside.step(
            at, count, where="post", color="#9a9a9a", linewidth=1.2, linestyle="--", label="cables (right)"
        )
        beside.set_ylabel("cables", color="#6a6a6a")
        beside.set_ylim(bottom=0.0, top=1.1 * float(np.nanmax(count, initial=1.0)))
        beside.yaxis.set_major_locator(MaxNLocator(integer=True))
        beside.tick_params(axis="y", colors="#6a6a6a")
        _lettered(beside, (look or HISTORY).letters)
        beside.spines[["top", "left"]].set_visible(False)
        beside.spines["right"].set_color("#b0b0b0")
    _save(figure, path)


def constraint_history(
    path: str | Path,
    evaluation: Sequence[float],
    constraints: Mapping[str, Sequence[float]],
    *,
    look: Look | None = None,
) -> None:
    """Figure 11: value over limit, minus 1, of each constraint at each accepted design; feasible at and below
    zero.

    Linear, or, where a value exceeds 3, linear between -1 and 1 and logarithmic beyond; what is below -1.5 is
    out of the picture. `path` and `look` as in `objective_history`.
    """
    at, lines = _columns(evaluation, constraints)
    figure, axes = _figure(look or HISTORY)
    titles = constraint_titles(lines)
    _curves(axes, at, {titles[name]: line for name, line in lines.items()})
    values = np.concatenate(list(lines.values()))
    highest, lowest = float(np.nanmax(values, initial=0.0)), float(np.nanmin(values, initial=0.0))
    if highest > _WIDE:
        axes.set_yscale("symlog", linthresh=1.0, linscale=1.0)
        decades = [k * 10.0**n for n in range(int(np.log10(highest)) + 1) for k in (1, 2, 5)]
        axes.yaxis.set_major_locator(FixedLocator([-5.0, -2.0, -1.0, -0.5, 0.0, 0.5, *decades]))
        axes.yaxis.set_minor_locator(NullLocator())
        axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
        top = 1.5 * highest
    else:
        top = max(1.15 * highest, 0.15)
    bottom = max(min(1.1 * lowest, -0.15), _FAR)
    axes.set_ylim(bottom, top)
    axes.axhspan(0.0, top, color="#f8ddd3", linewidth=0.0, zorder=0)
    axes.axhspan(bottom, 0.0, color="#e4eff6", linewidth=0.0, zorder=0)
    axes.axhline(0.0, color="black", linewidth=0.9, zorder=1.5)
    for word, offset, foot in [("infeasible", 4, "bottom"), ("feasible", -4, "top")]:
        axes.annotate(
            word, (1.0, 0.0), (-6, offset), xycoords=("axes fraction", "data"), textcoords="offset points",
            ha="right", va=foot, color="#5a5a5a", style="italic", fontsize=axes.xaxis.label.get_fontsize(),
        )  # fmt: skip
    axes.set(xlabel="design evaluations", ylabel="value / limit − 1")
    _save(figure, path)


@dataclass(frozen=True)
class PaperLine:
    """A line through `points` (x, y), mm from the page's lower left corner, `width` mm wide."""

    points: Sequence[tuple[float, float]]
    colour: str = "#000000"
    width: float = 0.18
    dashed: bool = False


@dataclass(frozen=True)
class Label:
    """A line of `text` with capitals `height` mm high, turned by `angle` degrees; `side` and `foot` of it are
    at `place`, mm.
    """

    place: tuple[float, float]
    height: float
    text: str
    colour: str = "#000000"
    angle: float = 0.0
    side: str = "left"
    foot: str = "bottom"
    bold: bool = False


@dataclass(frozen=True)
class PaperPage:
    """A page of `width` and `height`, mm, with its lines and labels."""

    width: float
    height: float
    lines: tuple[PaperLine, ...]
    labels: tuple[Label, ...]


def write_pages(path: str | Path, pages: Sequence[PaperPage], title: str = "") -> None:
    """Writes the pages, to scale and with their words as text, to a PDF; a single page may also go to a PNG
    or SVG.

    The same pages give the same bytes. The caller sees to it that `path` can be written.
    """
    target = Path(path)
    with rc_context(
        {
            "pdf.fonttype": 42,
            "svg.fonttype": "none",
            "svg.hashsalt": "shellform",
        }
    ):
        if target.suffix.lower() != ".pdf":
            _page(pages[0]).savefig(target, dpi=160)
            return
        with PdfPages(target, metadata={"Title": title, "CreationDate": None}) as book:
            for page in pages:
                book.savefig(_page(page))


def _page(page: PaperPage) -> Figure:
    figure = Figure(figsize=(page.width / _INCH, page.height / _INCH))
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, page.width), ylim=(0.0, page.height))
    axes.axis("off")
    kinds: dict[tuple[str, float, bool], list[Sequence[tuple[float, float]]]] = {}
    for line in page.lines:
        kinds.setdefault((line.colour, line.width, line.dashed), []).append(line.points)
    for (colour, width, dashed), several in kinds.items():
        style: Any = (0, (8.0, 6.0)) if dashed else "solid"
        axes.add_collection(
            LineCollection(
                several,
                colors=colour,
                linewidths=width / _INCH * _POINTS,
                linestyles=[style],
                capstyle="round",
            )
        )
    vertical = {"bottom": "baseline", "middle": "center_baseline", "top": "top"}
    fonts: dict[tuple[float, bool, tuple[str, ...]], FontProperties] = {}
    for label in page.labels:
        kind = label.height, label.bold, tuple(families(label.text))
        if kind not in fonts:
            fonts[kind] = FontProperties(
                family=list(kind[2]),
                size=label.height / _CAPITAL / _INCH * _POINTS,
                weight="bold" if label.bold else "normal",
            )
        figure.text(
            *label.place, label.text, color=label.colour, fontproperties=fonts[kind],
            rotation=label.angle, rotation_mode="anchor", transform=axes.transData,
            ha="center" if label.side == "middle" else label.side, va=vertical[label.foot],
        )  # fmt: skip
    return figure


def _columns(
    evaluation: Sequence[float], named: Mapping[str, Sequence[float]]
) -> tuple[Reals, dict[str, Reals]]:
    """Arrays of one length; what is not finite (a design without an equilibrium) leaves a gap."""
    at = np.asarray(evaluation, dtype=np.float64)
    if at.ndim != 1 or not len(at) or not named:
        raise InputError(
            "has nothing to draw", where="history", remedy="Give at least one row and one column."
        )
    lines = {}
    for name, values in named.items():
        line = np.asarray(values, dtype=np.float64)
        if line.shape != at.shape:
            raise InputError(
                f"column {name} and evaluation differ in length",
                where="history",
                value=line.shape,
                remedy=f"Give {len(at)} values, nan where one is missing.",
            )
        lines[name] = np.where(np.isfinite(line), line, np.nan)
    return at, lines


def plan_map(
    path: str | Path, plan: Reals, triangles: Indices, values: Reals, *, title: str, label: str
) -> None:
    """Values (v,) at the vertices (v, 2), m, of triangles seen from above; a ring where they are largest."""
    figure = Figure(figsize=(8.0, 6.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(aspect="equal", xlabel="x, m", ylabel="y, m")
    axes.set_title(title, fontsize=9)
    seen = Triangulation(plan[:, 0], plan[:, 1], triangles)
    drawn = axes.tripcolor(seen, values, shading="gouraud", cmap="viridis")
    worst = plan[int(np.argmax(values))]
    axes.plot(*worst, marker="o", markersize=14, markerfacecolor="none", color="#b00020")
    figure.colorbar(drawn, label=label)
    _write(figure, path_to_write(path, *FORMATS), 120)


def _figure(look: Look) -> tuple[Figure, Axes]:
    ground = "none" if look.transparent else "white"
    figure = Figure(
        figsize=(look.size[0] / look.dots, look.size[1] / look.dots),
        dpi=look.dots,
        layout="constrained",
        facecolor=ground,
    )
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(facecolor=ground)
    axes.grid(color="#e0e0e0", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    axes.margins(x=0.02)
    _lettered(axes, look.letters)
    return figure, axes


def _lettered(axes: Axes, letters: float) -> None:
    axes.tick_params(labelsize=letters)
    for label in (axes.xaxis.label, axes.yaxis.label):
        label.set_fontsize(letters)


def _curves(axes: Axes, at: Reals, lines: Mapping[str, Reals]) -> None:
    styles = cycle([(colour, dash) for dash in _DASHES for colour in _COLOURS])
    for (name, values), (colour, dash) in zip(lines.items(), styles, strict=False):
        label = name.replace(".", ", ").replace("_", " ")
        axes.plot(
            at, values, color=colour, linestyle=dash, linewidth=1.4, marker=".", markersize=5, label=label
        )


def _save(figure: Figure, path: str | Path) -> None:
    """Writes all of the file or nothing; the same history gives the same bytes."""
    target = path_to_write(path, *FORMATS)
    figure.legend(
        loc="outside right upper", frameon=False, fontsize=figure.axes[0].xaxis.label.get_fontsize()
    )
    _write(figure, target, figure.dpi)


def _write(figure: Figure, target: Path, resolution: float) -> None:
    undated: dict[str, None] = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(
        target.suffix.lower(), {}
    )
    with whole(target) as partial, _lasting():
        figure.savefig(partial, dpi=resolution, metadata=undated)


def _lasting() -> Any:
    """Words stay words, text in SVG and embedded TrueType in PDF, and the same page gives the same bytes."""
    return rc_context(
        {"svg.hashsalt": "shellform", "path.simplify": False, "svg.fonttype": "none", "pdf.fonttype": 42}
    )


def blank(size: tuple[int, int], *, transparent: bool, dots: float) -> Axes:
    """An empty page measured in pixels, `dots` an inch, from its lower left corner."""
    figure = Figure(
        figsize=(size[0] / dots, size[1] / dots), dpi=dots, facecolor="none" if transparent else "white"
    )
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0), xlim=(0, size[0]), ylim=(0, size[1]))
    axes.set_axis_off()
    return axes


def strokes(axes: Axes, ends: Reals, widths: Reals, colours: ArrayLike) -> None:
    """Straight lines (s, 2, 2) of `widths` (s,), all in pixels, and `colours` (s, 3) from 0 to 1, later ones
    above earlier ones.
    """
    lines = LineCollection(
        list(np.round(ends, 1)),
        linewidths=widths * _point(axes),
        colors=colours,
        capstyle="round",
        clip_on=False,
    )
    axes.add_collection(lines, autolim=False)


def _point(axes: Axes) -> float:
    """Points a pixel of a page."""
    return float(_POINTS / axes.figure.dpi)


def areas(axes: Axes, corners: Reals, colour: str) -> None:
    """Filled polygons (p, k, 2), pixels, of one colour."""
    axes.add_collection(
        PolyCollection(list(np.round(corners, 1)), facecolors=colour, linewidths=0.0, clip_on=False),
        autolim=False,
    )


def letter(axes: Axes, word: Word, corner: tuple[float, float]) -> None:
    """A word of a drawing whose lower left corner stands at `corner`."""
    axes.text(
        corner[0] + word.at[0], corner[1] + word.at[1], word.text, fontsize=word.pixels * _point(axes),
        color=word.colour,
        weight="bold" if word.bold else "normal", ha=word.justify, va="baseline",
    )  # fmt: skip


def strip(axes: Axes, ramp: Ramp, corner: tuple[float, float]) -> None:
    """A strip of colours of a drawing whose lower left corner stands at `corner`."""
    x, y = corner
    place = (x + ramp.left, x + ramp.right, y + ramp.low, y + ramp.high)
    axes.imshow(ramp.colours[None], extent=place, aspect="auto", interpolation="nearest")
    axes.set(xlim=(0, axes.figure.bbox.width), ylim=(0, axes.figure.bbox.height))


def save(axes: Axes, path: str | Path) -> None:
    """Writes a page as .svg, .pdf or .png: the same page gives the same bytes."""
    figure = axes.figure
    assert isinstance(figure, Figure)
    _write(figure, path_to_write(path, *FORMATS), figure.dpi)


def pixels(axes: Axes) -> NDArray[np.uint8]:
    """A page as an array (height, width, 4)."""
    canvas = axes.figure.canvas
    assert isinstance(canvas, FigureCanvasAgg)
    canvas.draw()
    return np.array(canvas.buffer_rgba())
