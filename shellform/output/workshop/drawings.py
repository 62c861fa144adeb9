"""Drawings for the workshop and the site, as DXF and as PDF sheets; the door to ezdxf.

The DXF file has the drawing in mm at real scale, on one layer a kind of thing (RODS_U, RODS_V,
CROSSING_NUMBERS, …), with real dimensions. The PDF sheet has it at the largest usual scale that fits the
smallest paper on which its smallest letters are `SMALLEST` mm high, with notes, a list and a title block.
Date, revision and author are those of the case ([title_block]), never the day of writing, so that the same
case gives the same bytes. What is on the sheets: layout.py and setting_out.py.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import cos, pi, sin
from pathlib import Path

import ezdxf
from ezdxf import units
from ezdxf.enums import TextEntityAlignment
from ezdxf.layouts import Modelspace

import shellform
from shellform.net.grid import Grid
from shellform.output.pictures.letters import columns, without_font
from shellform.output.pictures.plots import Label, PaperLine, PaperPage, write_pages
from shellform.output.workshop import layout, setting_out
from shellform.output.workshop.marks import PENS, WIDE, Mark, Ring, Sheet, Span, Stroke, Words
from shellform.output.workshop.nesting import Cutting
from shellform.output.workshop.schedules import Built
from shellform.written import whole

# 1 : each of them, as scales are usual on drawings
SCALES = (1.0, 2.0, 2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 50.0, 75.0, 100.0, 200.0, 500.0, 1000.0)
PAPERS = {"A3": (420.0, 297.0), "A2": (594.0, 420.0), "A1": (841.0, 594.0), "A0": (1189.0, 841.0)}
SMALLEST = 1.6  # mm, of letters on paper
STRIPS = 26  # rods on a sheet, or as many as have room where the longest fills its width
_HIGH = 0.75  # over its width: what a sheet has room for
_EDGE, _BOUND = 10.0, 20.0  # mm, of the frame from the paper's edge, and on the side where it is bound
_COLUMN = 110.0  # mm, of the column with title block, notes and list
_BLOCK = 72.0  # mm, height of the title block
_PROSE, _BOLD = 0.8, 0.93  # width of a letter of prose over its height, plain and bold
_SIDES = {"left": "LEFT", "middle": "CENTER", "right": "RIGHT"}


def write_drawings(folder: str | Path, built: Built, cutting: Cutting) -> list[Path]:
    """Writes grid, cables, supports, elevations and rods, each as .dxf and .pdf; returns the files. Raises
    InputError where they can't be written.
    """
    place = Path(folder)
    sheets = {
        "grid": layout.flat_grid(built),
        "cables": layout.cable_plan(built),
        "supports": setting_out.support_plan(built),
        "elevations": setting_out.elevations(built),
        "rods": layout.rod_strips(built, cutting),
    }
    files = []
    for name, sheet in sheets.items():
        files += [place / f"{name}.dxf", place / f"{name}.pdf"]
        write_dxf(files[-2], sheet, built)
        pages = [sheet]
        if name == "rods":
            most = rods_a_sheet(built.grid)
            pages = [
                layout.rod_strips(built, cutting, k, k + most) for k in range(0, len(built.grid.rods), most)
            ]
        write_pdf(files[-1], pages, built)
    return files


def rods_a_sheet(grid: Grid) -> int:
    """How many rods lie on each sheet of their own, one under the other."""
    high = layout.STRIP * min(grid.spacing, grid.spacing_v)
    most = max(STRIPS, int(_HIGH * max(rod.length for rod in grid.rods) / high))
    return -(-len(grid.rods) // -(-len(grid.rods) // most))


def letters_note(built: Built) -> tuple[str, ...]:
    """What the PDF sheets show as boxes, since no font here has it, a sentence; nothing where all is set."""
    block = built.block
    boxes = without_font("".join((built.title, built.name, block.date, block.revision, block.author)))
    if not boxes:
        return ()
    return (
        f"No font of this machine has the letters {boxes}, which are boxes on the PDF drawings: install one (Noto Sans CJK has "
        "Chinese, Japanese and Korean ones), delete drawings/ and give the same command again.",
    )


def write_dxf(path: str | Path, sheet: Sheet, built: Built | None = None) -> Path:
    """Writes the sheet's drawing in mm at real scale, with date, revision and author of what is `built` among
    the drawing's properties, with no time of day and no number of chance: the same
    sheet gives the same bytes. Raises InputError where the file can't be written.
    """
    with _timeless():
        return _saved(Path(path), sheet, built)


@contextmanager
def _timeless() -> Iterator[None]:
    """ezdxf's drawings without dates and identifiers of chance."""
    usual = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = usual


def _saved(target: Path, sheet: Sheet, built: Built | None) -> Path:
    document = ezdxf.new("R2010", setup=["linetypes"], units=units.MM)
    document.header["$LTSCALE"] = sheet.lettering
    if built is not None:
        told = {"Job": built.title, "Drawing": sheet.title, "Design": built.name}
        told |= {"Date": built.block.date, "Revision": built.block.revision, "Author": built.block.author}
        for name, said in told.items():
            if said:  # a line of the file each
                document.header.custom_vars.append(name, " ".join(said.split()))
    document.styles.new("LETTERS", dxfattribs={"font": "arial.ttf"})
    used = {mark.layer for mark in sheet.marks}
    for name, pen in PENS.items():
        if name in used:
            layer = document.layers.add(
                name, linetype="DASHED" if pen.dashed else "CONTINUOUS", lineweight=round(100 * pen.width)
            )
            red, green, blue = bytes.fromhex(pen.colour[1:])
            layer.rgb = (red, green, blue)
    height = max([mark.height for mark in sheet.marks if isinstance(mark, Span)], default=sheet.lettering)
    style = document.dimstyles.new("SHELLFORM")
    for name, value in {
        "dimtxt": height, "dimasz": 0.0, "dimtsz": 0.5 * height, "dimexo": 0.3 * height,
        "dimexe": 0.6 * height, "dimgap": 0.4 * height,
        "dimtad": 1, "dimdec": 1, "dimtxsty": "LETTERS", "dimscale": 1.0,
    }.items():  # fmt: skip
        style.set_dxf_attrib(name, value)
    space = document.modelspace()
    for mark in sheet.marks:
        _draw(space, mark)
    for kind in sorted(
        document.entitydb.dxf_types_in_use()
    ):  # a set, which ezdxf would go through as it comes
        document.classes.add_class(kind)
    with whole(target, ".dxf") as partial:
        document.saveas(partial)
    return target


def _draw(space: Modelspace, mark: Mark) -> None:
    on = {"layer": mark.layer}
    if isinstance(mark, Stroke):
        if len(mark.points) == 2:
            space.add_line(*mark.points, dxfattribs=on)
        else:
            space.add_lwpolyline(mark.points, dxfattribs=on)
    elif isinstance(mark, Ring):
        space.add_circle(mark.centre, mark.radius, dxfattribs=on)
    elif isinstance(mark, Words):
        align = TextEntityAlignment[f"{mark.foot.upper()}_{_SIDES[mark.side]}"]
        text = space.add_text(
            mark.text, height=mark.height, rotation=mark.angle, dxfattribs={**on, "style": "LETTERS"}
        )
        text.set_placement(mark.place, align=align)
    else:
        angle = 90.0 if mark.upright else 0.0
        space.add_linear_dim(
            base=mark.base,
            p1=mark.a,
            p2=mark.b,
            angle=angle,
            text=mark.text,
            dimstyle="SHELLFORM",
            dxfattribs=on,
        ).render()


def write_pdf(path: str | Path, sheets: Sequence[Sheet], built: Built) -> Path:
    """Writes the sheets as pages to scale, each with a title block. Raises InputError where the file can't be
    written.
    """
    target = Path(path)
    with whole(target, ".pdf") as partial:
        pages = [
            paper_page(sheet, built, f"{k} / {len(sheets)}" if len(sheets) > 1 else "1 / 1")
            for k, sheet in enumerate(sheets, 1)
        ]
        write_pages(partial, pages, f"{built.title or 'Gridshell'}: {sheets[0].title}")
    return target


def fitted(sheet: Sheet) -> tuple[str, float]:
    """The paper and the scale (how many mm a mm on paper stands for)."""
    x0, y0, x1, y1 = sheet.extent
    found = ("A0", SCALES[-1])
    for name, (width, height) in PAPERS.items():
        room = width - _EDGE - _BOUND - _COLUMN - 16.0, height - 2 * _EDGE - 12.0
        fits = [scale for scale in SCALES if x1 - x0 <= room[0] * scale and y1 - y0 <= room[1] * scale]
        if fits:
            found = (name, fits[0])
            if sheet.lettering / fits[0] >= SMALLEST:
                break
    return found


def paper_page(sheet: Sheet, built: Built, number: str) -> PaperPage:
    """The page: the drawing to scale, notes and list in a column on the right, the title block below them."""
    paper, scale = fitted(sheet)
    width, height = PAPERS[paper]
    x0, y0, x1, y1 = sheet.extent
    left, right = _BOUND, width - _EDGE - _COLUMN
    shift = (0.5 * (left + right) - 0.5 * (x0 + x1) / scale, 0.5 * height - 0.5 * (y0 + y1) / scale)
    lines, labels = _to_scale(sheet, scale, shift)
    lines += [
        _frame(left, _EDGE, width - _EDGE, height - _EDGE, 0.5),
        _frame(right, _EDGE, width - _EDGE, height - _EDGE, 0.35),
    ]
    column = _Column(right + 4.0, height - _EDGE - 8.0, _COLUMN - 8.0)
    column.words(sheet.title, 5.0, bold=True)
    for note in sheet.notes:
        column.words(note, 2.5)
    if sheet.rows:
        column.table(sheet.heads, sheet.rows, down_to=_EDGE + _BLOCK + 6.0)
    block = _title_block(right, width - _EDGE, built, sheet, paper, scale, number)
    return PaperPage(width, height, (*lines, *block[0]), (*labels, *column.labels, *block[1]))


def _to_scale(sheet: Sheet, scale: float, shift: tuple[float, float]) -> tuple[list[PaperLine], list[Label]]:
    lines: list[PaperLine] = []
    labels: list[Label] = []

    def at(point: tuple[float, float]) -> tuple[float, float]:
        return point[0] / scale + shift[0], point[1] / scale + shift[1]

    for mark in sheet.marks:
        pen = PENS[mark.layer]
        line = PaperLine((), pen.colour, pen.width, pen.dashed)
        if isinstance(mark, Stroke):
            lines.append(replace(line, points=[at(p) for p in mark.points]))
        elif isinstance(mark, Ring):
            lines.append(replace(line, points=[at(p) for p in _circle(mark)]))
        elif isinstance(mark, Words):
            labels.append(
                Label(
                    at(mark.place),
                    mark.height / scale,
                    mark.text,
                    pen.colour,
                    mark.angle,
                    mark.side,
                    mark.foot,
                )
            )
        else:
            more, label = _dimension(mark)
            lines += [replace(line, points=[at(p) for p in points]) for points in more]
            labels.append(
                Label(
                    at(label.place),
                    label.height / scale,
                    label.text,
                    pen.colour,
                    label.angle,
                    label.side,
                    label.foot,
                )
            )
    return lines, labels


def _circle(ring: Ring) -> list[tuple[float, float]]:
    (x, y), r = ring.centre, ring.radius
    return [(x + r * cos(pi * k / 12), y + r * sin(pi * k / 12)) for k in range(25)]


def _dimension(span: Span) -> tuple[list[list[tuple[float, float]]], Words]:
    """A dimension's line, its ends' ticks and extension lines, and its text."""
    t = 0.5 * span.height
    if span.upright:
        x = span.base[0]
        (_, a), (_, b) = span.a, span.b
        lines = (
            [[(x, a), (x, b)]]
            + [[(x - t, y - t), (x + t, y + t)] for y in (a, b)]
            + [[(x - t, y), (x + 2 * t, y)] for y in (a, b)]
        )
        return lines, Words(
            span.layer, (x - 0.8 * t, 0.5 * (a + b)), span.height, span.text, 90.0, "middle", "bottom"
        )
    y = span.base[1]
    (a, _), (b, _) = span.a, span.b
    lines = (
        [[(a, y), (b, y)]]
        + [[(x - t, y - t), (x + t, y + t)] for x in (a, b)]
        + [[(x, y - t), (x, y + 2 * t)] for x in (a, b)]
    )
    return lines, Words(
        span.layer, (0.5 * (a + b), y + 0.8 * t), span.height, span.text, 0.0, "middle", "bottom"
    )


class _Column:
    """Words under each other, from the top of a column downwards, broken into lines where they are too
    long.
    """

    def __init__(self, left: float, top: float, width: float) -> None:
        self.left, self.top, self.width = left, top, width
        self.labels: list[Label] = []

    def words(self, text: str, height: float, *, bold: bool = False) -> None:
        """A paragraph."""
        line = ""
        for word in [*text.split(), ""]:
            longer = f"{line} {word}".strip()
            if line and (not word or columns(longer) * (_BOLD if bold else _PROSE) * height > self.width):
                self.labels.append(Label((self.left, self.top - height), height, line, bold=bold))
                self.top -= 1.6 * height
                longer = word
            line = longer
        self.top -= 1.2 * height

    def table(self, heads: Sequence[str], rows: Sequence[Sequence[str]], *, down_to: float) -> None:
        """A list in as many columns as it takes to end above `down_to`; where there is no room, a word that
        says where it is.
        """
        cells = [max(len(row[k]) for row in [heads, *rows]) for k in range(len(heads))]
        for height in (2.4, 2.1, 1.8):
            fit = int((self.top - down_to) / (1.6 * height)) - 1
            needed = -(-len(rows) // max(fit, 1))
            letters = (sum(cells) + 2 * len(cells)) * WIDE * height
            if fit > 0 and needed * letters <= self.width:
                break
        else:
            self.words("The list is too long for this sheet: see the schedules.", 2.5)
            return
        for block in range(needed):
            x = self.left + block * self.width / needed
            ends = []
            for cell in cells:
                x += (cell + 2) * WIDE * height
                ends.append(x - WIDE * height)
            for line, row in enumerate([heads, *rows[block * fit : (block + 1) * fit]]):
                y = self.top - (line + 1) * 1.6 * height
                self.labels += [
                    Label((end, y), height, text, side="right", bold=line == 0)
                    for end, text in zip(ends, row, strict=True)
                ]


def _title_block(
    left: float, right: float, built: Built, sheet: Sheet, paper: str, scale: float, number: str
) -> tuple[list[PaperLine], list[Label]]:
    bottom, top, block = _EDGE, _EDGE + _BLOCK, built.block
    middle = 0.5 * (left + right)
    rows = [top - 16.0, top - 26.0, top - 36.0, top - 46.0, bottom + 14.0]
    lines = [PaperLine([(left, top), (right, top)], width=0.35)]
    lines += [PaperLine([(left, y), (right, y)], width=0.18) for y in rows]
    lines.append(PaperLine([(middle, rows[-1]), (middle, rows[0])], width=0.18))
    fields = [
        ("job", built.title or "gridshell", left, top, 3.5),
        ("drawing", sheet.title, left, rows[0], 3.0),
        ("design", built.name or "–", middle, rows[0], 3.0),
        ("scale", f"1 : {scale:g}", left, rows[1], 3.0),
        ("paper", f"{paper}, print at 100 %", middle, rows[1], 3.0),
        ("unit", "mm", left, rows[2], 3.0),
        ("sheet", f"{number}   shellform {shellform.__version__}", middle, rows[2], 3.0),
        ("date, revision", " / ".join(filter(None, (block.date, block.revision))) or "–", left, rows[3], 3.0),
        ("drawn by", block.author or "–", middle, rows[3], 3.0),
    ]
    labels = []
    for head, text, x, y, height in fields:
        room = (right if x == middle or head == "job" else middle) - x - 4.0
        size = min(height, room / (_PROSE * max(columns(text), 1.0)))
        labels += [
            Label((x + 2.0, y - 3.2), 1.6, head, colour="#5a5a5a"),
            Label((x + 2.0, y - 8.2), size, text),
        ]
    # A bar to check the print by.
    bar = 50.0
    x0, y0 = left + 6.0, bottom + 6.0
    lines += [PaperLine([(x0, y0), (x0 + bar, y0)], width=0.5)]
    lines += [PaperLine([(x, y0 - 1.5), (x, y0 + 1.5)], width=0.35) for x in (x0, x0 + 0.5 * bar, x0 + bar)]
    labels.append(
        Label((x0 + bar + 3.0, y0), 2.0, f"{bar:g} mm on paper = {bar * scale:g} mm", foot="middle")
    )
    return lines, labels


def _frame(x0: float, y0: float, x1: float, y1: float, width: float) -> PaperLine:
    return PaperLine([(x0, y0), (x1, y0), (x1, y1), (x0, y1), (x0, y0)], width=width)
