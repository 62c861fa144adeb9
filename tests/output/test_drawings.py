"""Drawings, read back with ezdxf and pypdf and compared with the net; what is written on them doesn't lie on
top of each other.
"""

from dataclasses import replace
from itertools import combinations, pairwise
from types import SimpleNamespace

import ezdxf
import numpy as np
import pytest
from pypdf import PdfReader

from shellform.errors import InputError
from shellform.net.grid import lattice_grid
from shellform.output.workshop import drawings, layout, nesting, schedules, setting_out
from shellform.output.workshop.cable_forces import tightening_notes
from shellform.output.workshop.directions import fixing_note
from shellform.output.workshop.marks import PENS, Span, Stroke, Words, overlap
from shellform.output.workshop.schedules import TitleBlock
from tests.conftest import built_as


@pytest.fixture(scope="module")
def folder(built, tmp_path_factory):
    place = tmp_path_factory.mktemp("drawings")
    drawings.write_drawings(place, built, nesting.cut(built.grid, stock=0.6))
    return place


def on(space, layer, kind):
    return [entity for entity in space if entity.dxf.layer == layer and entity.dxftype() == kind]


@pytest.mark.parametrize("name", ["grid", "cables", "supports", "elevations", "rods"])
def test_each_dxf_file_is_sound_and_in_millimetres(folder, name):
    document = ezdxf.readfile(folder / f"{name}.dxf")
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    assert document.units == ezdxf.units.MM
    assert {entity.dxf.layer for entity in document.modelspace()} <= {
        layer.dxf.name for layer in document.layers
    }


def test_the_flat_grid_has_every_rod_and_crossing_at_real_scale(folder, net):
    space = ezdxf.readfile(folder / "grid.dxf").modelspace()
    for direction in "uv":
        lines = on(space, f"RODS_{direction.upper()}", "LINE")
        rods = [rod for rod in net.grid.rods if rod.direction == direction]
        lengths = [line.dxf.start.distance(line.dxf.end) for line in lines]
        assert sorted(lengths) == pytest.approx(sorted(1e3 * rod.length for rod in rods), abs=1e-6)
    rings = np.array([tuple(ring.dxf.center)[:2] for ring in on(space, "CROSSINGS", "CIRCLE")])
    assert rings == pytest.approx(1e3 * net.grid.flat[net.grid.crossing_nodes[:, 0], :2], abs=1e-6)
    numbers = [text.dxf.text for text in on(space, "CROSSING_NUMBERS", "TEXT")]
    assert numbers == [str(k) for k in range(len(net.grid.lattice))]
    told = [text.dxf.text for text in on(space, "CUT_LENGTHS", "TEXT")]
    for k, rod in enumerate(net.grid.rods):
        assert f"{rod.direction.upper()}{k}   {1e3 * rod.length:.1f}" in told
    spans = on(space, "DIMENSIONS", "DIMENSION")
    columns = np.ptp(net.grid.lattice[:, 0])
    texts = {span.dxf.text: span.get_measurement() for span in spans}
    assert texts[f"{columns} × 55 = {55 * columns}"] == pytest.approx(55.0 * columns)


def test_the_cable_plan_names_every_cable_between_its_crossings(folder, built):
    space = ezdxf.readfile(folder / "cables.dxf").modelspace()
    names = [text.dxf.text.partition("·")[0] for text in on(space, "CABLE_NAMES", "TEXT")]
    assert names == [f"C{k}" for k in range(built.design.present.sum())]
    lengths = [line.dxf.start.distance(line.dxf.end) for line in on(space, "CABLES", "LINE")]
    assert lengths == pytest.approx([55.0 * 2.0**0.5 - 2 * 0.13 * 55.0] * len(names), abs=1e-6)
    joints = 1e3 * built.grid.flat[built.grid.crossing_nodes[:, 0], :2]
    ends = joints[schedules.cable_crossings(built.shell, built.design)]
    lines = [(tuple(line.dxf.start)[:2], tuple(line.dxf.end)[:2]) for line in on(space, "CABLES", "LINE")]
    assert np.mean(lines, axis=1) == pytest.approx(ends.mean(axis=1), abs=1e-6)
    rising = np.prod(np.subtract(*np.swapaxes(lines, 0, 1)), axis=1) > 0.0
    place = np.array([tuple(text.get_placement()[1].vec2) for text in on(space, "CABLE_NAMES", "TEXT")])
    beside = np.column_stack([np.zeros(len(names)), np.where(rising, 0.27, -0.27) * 55.0])
    assert place == pytest.approx(ends.mean(axis=1) + beside, abs=1e-6)
    turns = [text.dxf.text.partition("·")[2] for text in on(space, "CABLE_NAMES", "TEXT")]
    assert turns == [str(turn) for turn in schedules.rounds(built.shell, built.design)]
    for text in on(space, "CROSSING_NUMBERS", "TEXT"):
        assert tuple(text.get_placement()[1].vec2) == pytest.approx(joints[int(text.dxf.text)], abs=1e-6)


def test_the_sheets_say_to_what_cables_are_tightened_and_when_supports_are_fixed(built):
    before = built.shell.cables(built.design).tension(built.states["none"])
    assert set(tightening_notes(before)) < set(layout.cable_plan(built).notes)
    assert set(fixing_note(built.shell.net)) < set(setting_out.support_plan(built).notes)
    assert len(tightening_notes(before)) == len(fixing_note(built.shell.net)) == 1


def test_the_cable_plan_s_rods_run_from_ring_to_ring(built):
    sheet, grid = layout.cable_plan(built), built.grid
    joints = 1e3 * grid.flat[grid.crossing_nodes[:, 0], :2]
    lines = [mark.points for mark in sheet.marks if isinstance(mark, Stroke) and mark.layer == "BACKGROUND"]
    between = sum(len(rod.crossings) - 1 for rod in grid.rods)
    lengths = np.linalg.norm(np.subtract(*np.swapaxes(lines, 0, 1)), axis=1)
    assert np.isclose(lengths, 55.0 - 2 * 0.13 * 55.0).sum() >= between
    apart = np.linalg.norm(np.array(lines).reshape(-1, 1, 2) - joints[None], axis=2)
    assert apart.min() >= 0.13 * 55.0 - 1e-6


def test_supports_stand_on_the_plan_where_the_net_has_them(folder, built):
    space = ezdxf.readfile(folder / "supports.dxf").modelspace()
    middles = [np.mean(square.get_points("xy")[:4], axis=0) for square in on(space, "SUPPORTS", "LWPOLYLINE")]
    net = built.shell.net
    assert np.array(middles) == pytest.approx(1e3 * net.target.positions[net.supports, :2], abs=1e-6)


@pytest.mark.parametrize("name", ["grid", "cables", "supports"])
def test_each_sheet_is_one_page_of_a_usual_size_with_title_and_numbers_as_text(folder, built, name):
    pages = PdfReader(folder / f"{name}.pdf").pages
    assert len(pages) == 1
    size = sorted(
        (float(pages[0].mediabox.width) / 72 * 25.4, float(pages[0].mediabox.height) / 72 * 25.4),
        reverse=True,
    )
    assert any(size == pytest.approx(paper, abs=0.1) for paper in drawings.PAPERS.values())
    text = pages[0].extract_text()
    for word in ("The vault", "scale", "1 : 2", "mm", "test"):
        assert word in text
    words = text.split()
    wanted = range(len(built.shell.net.supports) if name == "supports" else len(built.grid.lattice))
    assert all(f"S{k}" in words if name == "supports" else str(k) in words for k in wanted)


def test_the_rod_sheets_have_every_mark_and_splice(folder, built):
    pages = PdfReader(folder / "rods.pdf").pages
    assert len(pages) == -(-len(built.grid.rods) // drawings.STRIPS)
    text = " ".join(page.extract_text() for page in pages)
    for k, rod in enumerate(built.grid.rods):
        assert f"{rod.direction.upper()}{k}" in text
        assert f"L = {1e3 * rod.length:.1f}" in text
        assert all(f"{1e3 * mark:.1f}" in text for mark in rod.marks)
    assert text.count("splice ") == sum(rod.length > 0.6 for rod in built.grid.rods)


def test_long_rods_close_together_share_a_sheet_as_far_as_it_has_room():
    def grid(count, length, spacing):
        return SimpleNamespace(
            rods=[SimpleNamespace(length=length)] * count, spacing=spacing, spacing_v=spacing
        )

    assert drawings.rods_a_sheet(grid(26, 1.0, 0.055)) == 26
    assert drawings.rods_a_sheet(grid(44, 1.0, 0.055)) == 22, "as many on each of both"
    assert drawings.rods_a_sheet(grid(236, 58.8, 0.5)) == 79
    assert drawings.rods_a_sheet(grid(100, 58.8, 0.5)) == 100


def test_the_same_design_gives_the_same_files(folder, built, tmp_path):
    drawings.write_pdf(tmp_path / "grid.pdf", [layout.flat_grid(built)], built)
    assert (tmp_path / "grid.pdf").read_bytes() == (folder / "grid.pdf").read_bytes()


@pytest.fixture(scope="module")
def sheets(built):
    cutting = nesting.cut(built.grid, stock=0.6)
    return [
        layout.flat_grid(built),
        layout.cable_plan(built),
        setting_out.support_plan(built),
        setting_out.elevations(built),
        layout.rod_strips(built, cutting),
    ]


@pytest.mark.parametrize("which", range(4))
def test_no_words_lie_on_each_other(sheets, which):
    words = [mark for mark in sheets[which].marks if isinstance(mark, Words)]
    lying = [(a.text, b.text) for a, b in combinations(words, 2) if overlap(a.box, b.box)]
    assert lying == []


@pytest.mark.parametrize("which", range(4))
def test_letters_are_legible_on_paper_and_the_drawing_stays_beside_the_column(built, sheets, which):
    sheet = sheets[which]
    paper, scale = drawings.fitted(sheet)
    assert sheet.lettering / scale >= drawings.SMALLEST
    page = drawings.paper_page(sheet, built, "1 / 1")
    frame = page.width - 10.0 - 110.0
    for mark in sheet.marks:
        assert not isinstance(mark, Words) or mark.height >= 0.99 * sheet.lettering
    assert (page.width, page.height) == drawings.PAPERS[paper]
    pens = {PENS[layer].colour for layer in ("RODS_U", "CABLES")}
    drawn = [x for line in page.lines if line.colour in pens for x, _ in line.points]
    assert drawn
    assert max(drawn) < frame
    assert min(drawn) > 20.0
    up = [y for line in page.lines if line.colour in pens for _, y in line.points]
    assert 10.0 < min(up) < max(up) < page.height - 10.0
    assert min(label.place[1] for label in page.labels) > 10.0
    assert max(label.place[1] for label in page.labels) < page.height - 10.0


def test_notes_are_broken_into_lines_as_long_as_the_column_is_wide_and_no_word_is_lost():
    column = drawings._Column(5.0, 100.0, 50.0)
    text = (
        "Rods are drawn by their axes. Their first end is the left one of U rods and the lower one of V rods."
    )
    column.words(text, 2.5)
    assert " ".join(label.text for label in column.labels) == text
    widths = [0.8 * 2.5 * len(label.text) for label in column.labels]
    assert max(widths) <= 50.0
    for label, following in pairwise(column.labels):  # none could have taken the next one's first word
        assert 0.8 * 2.5 * len(f"{label.text} {following.text.split()[0]}") > 50.0
    assert [label.place for label in column.labels] == [
        (5.0, pytest.approx(97.5 - 4.0 * k)) for k in range(len(widths))
    ]


def test_words_of_the_title_block_stay_in_their_fields_however_long(built, sheets):
    block = TitleBlock("2026-05-31", "R" * 20, "A" * 60)
    long = replace(built, title="T" * 70, name="N" * 40, block=block)
    page = drawings.paper_page(sheets[0], long, "1 / 1")
    found = {label.text: label for label in page.labels}
    left, right = page.width - 10.0 - 110.0, page.width - 10.0
    for text, x, end in (
        (long.title, left, right),
        (long.name, left + 55.0, right),
        (f"2026-05-31 / {block.revision}", left, left + 55.0),
        (block.author, left + 55.0, right),
    ):
        label = found[text]
        width = 0.8 * label.height * len(text)
        assert label.place[0] == pytest.approx(x + 2.0)
        assert x + 2.0 + width == pytest.approx(end - 2.0), "as large as the field allows"
    short = {label.text: label.height for label in drawings.paper_page(sheets[0], built, "1 / 1").labels}
    assert (short["The vault"], short["test"]) == (3.5, 3.0)


def test_letters_are_as_large_as_the_largest_usual_scale_on_the_smallest_paper_lets_them(built, sheets):
    assert drawings.SMALLEST == 1.6
    assert drawings.SCALES[:5] == (1.0, 2.0, 2.5, 5.0, 10.0)
    for sheet in sheets:
        paper, scale = drawings.fitted(sheet)
        x0, y0, x1, y1 = sheet.extent
        # What the frame, the bound edge and the column of notes leave of the paper, with a little air.
        names = list(drawings.PAPERS)
        for name in names[: names.index(paper) + 1]:
            width, height = drawings.PAPERS[name]
            room = max((x1 - x0) / (width - 156.0), (y1 - y0) / (height - 32.0))
            best = next(each for each in drawings.SCALES if each >= room)
            assert (best == scale) if name == paper else (sheet.lettering / best < 1.6)
        assert sheet.lettering / scale >= 1.6


def test_a_list_beside_the_drawing_stands_in_lines_and_columns_that_leave_each_other_room():
    column = drawings._Column(10.0, 200.0, 80.0)
    rows = [(f"U{k}", f"{1000 + k}") for k in range(80)]
    column.table(("rod", "mm"), rows, down_to=110.0)
    assert {label.text for label in column.labels} == {"rod", "mm", *(cell for row in rows for cell in row)}
    (height,) = {label.height for label in column.labels}
    levels = sorted({round(label.place[1], 6) for label in column.labels}, reverse=True)
    assert levels[0] == pytest.approx(200.0 - 1.6 * height)
    np.testing.assert_allclose(np.diff(levels), -1.6 * height)
    assert levels[-1] >= 110.0
    for level in levels:
        ends = [label for label in column.labels if label.place[1] == pytest.approx(level)]
        for left, right in pairwise(sorted(ends, key=lambda label: label.place[0])):
            assert right.place[0] - drawings.WIDE * height * len(right.text) > left.place[0]
    assert max(label.place[0] for label in column.labels) <= 90.0
    full = drawings._Column(10.0, 200.0, 80.0)
    full.table(("rod", "mm"), 4 * rows, down_to=150.0)
    assert " ".join(label.text for label in full.labels).startswith("The list is too long for this sheet")


def test_each_paper_is_two_of_the_next_smaller_one_side_by_side():
    """ISO 216, in whole millimetres."""
    sizes = list(drawings.PAPERS.values())
    assert sizes[0] == (420.0, 297.0)
    for (smaller_long, smaller_short), (long, short) in pairwise(sizes):
        assert short == smaller_long
        assert 0.0 <= long - 2.0 * smaller_short <= 1.0


@pytest.mark.parametrize("direction", ["u", "v"])
def test_words_run_along_the_rods_and_stand_to_their_left(built, direction):
    rod = next(each for each in built.grid.rods if each.direction == direction)
    angle, along, left = layout._directions(rod)
    turn = np.radians(angle)
    np.testing.assert_allclose(along, [np.cos(turn), np.sin(turn)], atol=1e-12)
    np.testing.assert_allclose(left, [-np.sin(turn), np.cos(turn)], atol=1e-12)
    way = np.ptp(built.grid.flat[rod.nodes, :2], axis=0)
    assert np.abs(along) @ way == pytest.approx(np.linalg.norm(way))


@pytest.mark.parametrize("upright", [False, True])
def test_a_dimension_on_paper_has_its_ticks_at_its_ends_and_its_text_in_the_middle(upright):
    ends, base = [(2.0, 0.0), (12.0, 0.0)], (2.0, -5.0)
    line = [(2.0, -5.0), (12.0, -5.0)]
    turned = (lambda point: point[::-1]) if upright else (lambda point: point)
    span = Span("DIMENSIONS", *map(turned, ends), turned(base), 2.0, "10.0")
    (found, *marks), words = drawings._dimension(span)
    assert found == [turned(point) for point in line]
    for mark, end in zip(marks, line * 2, strict=True):
        middle = np.mean(mark, axis=0)
        if mark in marks[:2]:
            assert tuple(middle) == turned(end)
            assert np.subtract(mark[1], mark[0]).tolist() == [2.0, 2.0]
        else:  # from a little beyond the line towards what is measured
            along, across = (1, 0) if upright else (0, 1)
            assert {point[along] for point in mark} == {end[0]}
            assert [point[across] for point in mark] == [-6.0, -3.0]
    at, beside = (words.place[::-1]) if upright else words.place
    assert (at, words.text, words.height, words.angle) == (7.0, "10.0", 2.0, 90.0 if upright else 0.0)
    assert beside == pytest.approx(-5.8 if upright else -4.2)


def test_the_gaps_between_lines_on_paper_are_to_scale(built):
    sheet = layout.flat_grid(built)
    _, scale = drawings.fitted(sheet)
    page = drawings.paper_page(sheet, built, "1 / 1")
    lengths = sorted(
        abs(line.points[1][0] - line.points[0][0]) for line in page.lines if line.colour == "#0072b2"
    )
    assert lengths == pytest.approx(
        sorted(1e3 * rod.length / scale for rod in built.grid.rods if rod.direction == "u")
    )


def test_several_rods_in_one_row_are_told_apart(built):
    # Two arms joined by a bar below: rows 2 and 3 have two u rods each.
    places = [(i, j) for i in range(7) for j in range(4) if j < 2 or i in (0, 1, 5, 6)]
    grid = lattice_grid(np.array(places), spacing=(1.0, 1.0), gap=0.01, elements=1)
    net = replace(built.shell.net, grid=grid, supports=np.zeros(0, dtype=np.int64))
    forked = replace(built, shell=replace(built.shell, net=net, cable_ends=np.zeros((0, 2), dtype=np.int64)))
    sheet = layout.flat_grid(forked)
    told = {mark.text for mark in sheet.marks if isinstance(mark, Words) and mark.layer == "CUT_LENGTHS"}
    assert {"U0   6000.0", "U2   1000.0", "1000.0   U3", "U4   1000.0", "1000.0   U5"} <= told


def test_drawings_that_can_not_be_written_leave_nothing_behind(built, tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="can't be written"):
        drawings.write_drawings(tmp_path / "file", built, nesting.cut(built.grid))
    with pytest.raises(InputError, match="another ending"):
        drawings.write_dxf(tmp_path / "grid.dwg", layout.flat_grid(built))
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_the_title_block_says_who_drew_it_and_when_as_the_case_does(dome, tmp_path):
    block = TitleBlock("2026-05-31", "B", "A. Author")
    told = replace(built_as(dome), block=block)
    for name in ("first", "second"):
        drawings.write_drawings(tmp_path / name, told, nesting.cut(told.grid, stock=0.6))
    for file in sorted((tmp_path / "first").iterdir()):
        assert file.read_bytes() == (tmp_path / "second" / file.name).read_bytes()
    text = PdfReader(tmp_path / "first/elevations.pdf").pages[0].extract_text()
    for word in ("2026-05-31 / B", "A. Author"):
        assert word in text
    properties = dict(ezdxf.readfile(tmp_path / "first/grid.dxf").header.custom_vars.properties)
    assert (properties["Date"], properties["Revision"]) == ("2026-05-31", "B")


def test_a_job_s_title_of_two_lines_leaves_the_file_sound(built, tmp_path):
    told = replace(built, title="Shell\nof two\r\nlines")
    file = drawings.write_dxf(tmp_path / "grid.dxf", layout.flat_grid(told), told)
    assert dict(ezdxf.readfile(file).header.custom_vars.properties)["Job"] == "Shell of two lines"


def words_on(sheet, layer):
    return [mark for mark in sheet.marks if isinstance(mark, Words) and mark.layer == layer]


def test_what_is_written_on_the_flat_grid_stands_at_what_it_speaks_of(built):
    sheet, grid, s = layout.flat_grid(built), built.grid, 55.0
    flat, supports = 1e3 * grid.flat[:, :2], built.shell.net.supports.tolist()
    joints = flat[grid.crossing_nodes[:, 0]]
    numbers = words_on(sheet, "CROSSING_NUMBERS")
    beside = np.array([0.05 * s, 0.04 * s])
    assert np.array([mark.place for mark in numbers]) == pytest.approx(joints + beside)
    names, lengths = words_on(sheet, "ROD_NAMES"), iter(words_on(sheet, "CUT_LENGTHS"))
    firsts, feet = iter(words_on(sheet, "FIRST_MARKS")), iter(words_on(sheet, "SUPPORT_NUMBERS"))
    for k, (rod, name) in enumerate(zip(grid.rods, names, strict=True)):
        axis = "uv".index(rod.direction)
        tips, marks = flat[rod.nodes[[0, -1]]], 1e3 * rod.marks
        middles = 0.5 * (marks[:-1] + marks[1:])
        near = tips[0, axis] + middles[np.argmin(np.abs(middles - 500.0 * rod.length))]
        assert name.text == f"{rod.direction.upper()}{k}"
        assert name.place[axis] == pytest.approx(near)
        assert abs(name.place[1 - axis] - tips[0, 1 - axis]) < 0.1 * s
        for tip, sign, first in ((tips[0], -1.0, marks[0]), (tips[1], 1.0, 1e3 * rod.length - marks[-1])):
            mark, length = next(firsts), next(lengths)
            assert mark.text == f"{first:.1f}"
            assert abs(mark.place[1 - axis] - tip[1 - axis]) < 0.1 * s
            # between the rod's end and its first crossing, further out in steps where something lies there
            steps = (sign * (mark.place[axis] - tip[axis]) + first - 0.07 * s) / (0.08 * s)
            assert steps == pytest.approx(np.rint(steps), abs=1e-6)
            assert -1e-6 < steps < 11.5
            assert name.text in length.text
            assert length.place[1 - axis] == pytest.approx(tip[1 - axis])
            assert sign * (length.place[axis] - tip[axis]) >= 0.75 * s
            node = int(rod.nodes[0 if sign < 0.0 else -1])
            if node in supports:
                foot = next(feet)
                assert foot.text == f"S{supports.index(node)}"
                assert abs(foot.place[1 - axis] - tip[1 - axis]) < 0.1 * s
                assert 0.0 < sign * (foot.place[axis] - tip[axis]) < s
    assert next(feet, None) is next(firsts, None) is next(lengths, None) is None


def test_marks_and_splices_stand_on_the_rod_strips_where_they_are_on_the_rods(built):
    cutting = nesting.cut(built.grid, stock=0.6)
    starts = {}
    for piece in (piece for bar in cutting.bars for piece in bar.pieces):
        starts.setdefault(piece.rod, set()).add(round(1e3 * piece.start, 6))
    sheet = layout.rod_strips(built, cutting, 3, 9)
    strokes = [mark for mark in sheet.marks if isinstance(mark, Stroke)]
    for row, number in enumerate(range(3, 9)):
        rod, y = built.grid.rods[number], -0.75 * 55.0 * row
        at = {
            layer: [
                mark.points[0][0]
                for mark in strokes
                if mark.layer == layer and abs(np.mean(mark.points, axis=0)[1] - y) < 1e-9
            ]
            for layer in ("CROSSINGS", "SPLICES")
        }
        assert at["CROSSINGS"] == pytest.approx((1e3 * rod.marks).tolist())
        cuts = sorted(starts[number] - {0.0})
        assert sorted(at["SPLICES"]) == pytest.approx([cut - 0.08 * 55.0 for cut in cuts])
        for layer, told in (
            ("FIRST_MARKS", [f"{mark:.1f}" for mark in 1e3 * rod.marks]),
            ("CROSSING_NUMBERS", [str(k) for k in rod.crossings]),
        ):
            own = [mark for mark in words_on(sheet, layer) if abs(mark.place[1] - y) < 0.3 * 55.0]
            assert [mark.text for mark in own] == told
            assert [mark.place[0] for mark in own] == pytest.approx((1e3 * rod.marks).tolist())
            assert all((mark.place[1] > y) == (layer == "FIRST_MARKS") for mark in own)
        own = [mark for mark in words_on(sheet, "SPLICES") if y - 0.5 * 55.0 < mark.place[1] < y]
        assert sorted(mark.text for mark in own) == sorted(f"splice {cut:.1f}" for cut in cuts)
    assert len(words_on(sheet, "ROD_NAMES")) == 6


def test_elevations_tell_the_levels_of_crown_and_supports(built):
    sheet = setting_out.elevations(built)
    place = 1e3 * built.shell.target.positions
    words = [mark.text for mark in sheet.marks if isinstance(mark, Words)]
    assert words.count(f"crown {place[:, 2].max():+.1f}") == 2
    feet = place[built.shell.net.supports, 2]
    assert f"lowest support {feet.min():+.1f}" in words
    spans = [mark.text for mark in sheet.marks if isinstance(mark, Span)]
    assert spans[::2] == [f"{np.ptp(place[:, axis]):.1f}" for axis in (0, 1)]
    strokes = {
        layer: [mark for mark in sheet.marks if isinstance(mark, Stroke) and mark.layer == layer]
        for layer in ("GROUND", "LEVELS")
    }
    told = words_on(sheet, "LEVELS")
    assert len(told) == len(strokes["LEVELS"]) == 6
    for k, (stroke, mark) in enumerate(zip(strokes["LEVELS"], told, strict=True)):
        ground, level = strokes["GROUND"][k // 3].points[0][1], float(mark.text.split()[-1])
        for point in stroke.points[:2]:
            assert point[1] - ground == pytest.approx(level - place[:, 2].min(), abs=0.051)
        assert stroke.points[2][1] == mark.place[1] >= stroke.points[1][1]
        aside = [x for x, _ in (*stroke.points, mark.place)]
        assert aside == sorted(aside)


def test_a_support_s_number_stands_outside_of_it_seen_from_the_middle(built):
    sheet, net = setting_out.support_plan(built), built.shell.net
    feet = 1e3 * net.target.positions[net.supports, :2]
    numbers = words_on(sheet, "SUPPORT_NUMBERS")
    assert [mark.text for mark in numbers] == [f"S{k}" for k in range(len(feet))]
    for mark, foot in zip(numbers, feet, strict=True):
        away, out = np.array(mark.place) - foot, foot - feet.mean(axis=0)
        steps = 2.0 * (np.linalg.norm(away) / mark.height - 1.0)  # outwards until it lies on no other
        assert steps == pytest.approx(np.rint(steps), abs=1e-6)
        assert -0.5 < steps < 39.5
        out /= np.linalg.norm(out)
        assert away / np.linalg.norm(away) == pytest.approx(out)
        # Letters go on from there, away from the support.
        assert mark.side == ("left" if out[0] > 0.3 else "right" if out[0] < -0.3 else "middle")
        assert mark.foot == ("bottom" if out[1] > 0.3 else "top" if out[1] < -0.3 else "middle")


def test_the_plan_of_supports_tells_how_long_and_wide_the_shell_is(built):
    sheet, place = setting_out.support_plan(built), 1e3 * built.shell.target.positions[:, :2]
    low, high = place.min(axis=0), place.max(axis=0)
    along, across = (mark for mark in sheet.marks if isinstance(mark, Span))
    assert (along.text, across.text) == tuple(f"{each:.1f}" for each in high - low)
    for axis, span in enumerate((along, across)):
        ends = np.array([span.a, span.b])
        assert ends[:, axis] == pytest.approx([low[axis], high[axis]])
        assert (ends[:, 1 - axis] == span.base[1 - axis]).all()
        assert span.base[1 - axis] < low[1 - axis]


def test_levels_of_supports_are_said_to_be_those_of_axes_where_they_are_given(built):
    """Of a cap of 15 m they lie 14 mm below the surface's ground to 18 mm above it, in two layers of rods."""
    level = 1e3 * built.shell.target.positions[built.shell.net.supports, 2]
    sheet, table = setting_out.support_plan(built), schedules.supports(built)
    assert [row[4] for row in sheet.rows] == [f"{z:.1f}" for z in level.tolist()]
    assert "z is the axis' level, not the ground's" in sheet.notes[0]
    assert "x, y and z are those of the axis that ends there" in table.notes[0]


def test_supports_that_stand_too_near_for_their_shoes_are_named(built):
    found = schedules.clashing_supports(built)
    feet = built.shell.target.positions[built.shell.net.supports]
    apart = np.linalg.norm(feet[:, None] - feet[None], axis=2)
    wanted = [(a, b) for a in range(len(feet)) for b in range(a) if apart[a, b] < 0.006]
    assert sorted((b, a) for a, b, _ in found) == sorted(wanted), "three diameters of 2 mm"
    assert found
    note = setting_out.support_plan(built).notes[-1]
    table = schedules.supports(built)
    for a, b, _ in found:
        assert f"S{a} and S{b}" in note
        assert f"S{b}" in table.column("clashes with")[a].split(", ")
        assert f"S{a} and S{b}, {1e3 * apart[a, b]:.1f} mm" in " ".join(table.notes)
    thin = replace(built, design=replace(built.design, radius=1e-5))
    assert not schedules.clashing_supports(thin)
    assert "Nearer" not in " ".join(setting_out.support_plan(thin).notes)
    assert "clash: none." in " ".join(schedules.supports(thin).notes)
