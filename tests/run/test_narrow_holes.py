"""`new` closes holes narrower than rods are apart, says so, and keeps them where that is asked for."""

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from shellform.case.build_net import surface_of
from shellform.case.entries import SurfaceEntry
from shellform.run import propose
from shellform.run.narrow_holes import NarrowHoles, narrow_holes
from shellform.run.sizes import DesignWish, first_spacing
from shellform.surface.shape.target import make_surface
from tests.run.test_propose import as_obj
from tests.surface.test_fill import holed_sheet


class Reached(Exception):
    """The design is about to begin, on the surface that was read."""


def holed(*cells):
    return make_surface(*holed_sheet(*cells))


def read(tmp_path, monkeypatch, surface, *, spacing=None, **options):
    """The surface that `new` designs for, and what is told before it does."""
    seen, heard = [], []

    def stop(surface, *_):
        seen.append(surface)
        raise Reached

    monkeypatch.setattr(propose, "first_design", stop)
    file = as_obj(tmp_path / "sheet.obj", surface)
    with pytest.raises(Reached):
        propose.propose_case(
            file,
            tmp_path / "sheet.toml",
            options,
            allow_scripts=False,
            wish=DesignWish(spacing=spacing),
            report=lambda event: heard.append(event.text),
        )
    return seen[0], [text for text in heard if "narrower than" in text and "an edge beam" in text]


def test_new_closes_a_hole_narrower_than_its_spacing_and_says_how_to_keep_it(tmp_path, monkeypatch):
    sheet = holed(2, 5)
    assert 0.4 < first_spacing(sheet)[0] < 1.0
    closed, told = read(tmp_path, monkeypatch, sheet)
    assert closed.holes == 1
    assert any("1 hole narrower than" in text and "--fill-narrower 0 keeps" in text for text in told)
    kept, told = read(tmp_path, monkeypatch, sheet, fill_narrower=0.0)
    assert kept.holes == 2
    assert not any("is closed" in text for text in told)


@pytest.mark.parametrize(("spacing", "holes"), [(0.35, 2), (0.5, 1), (1.2, 0)])
def test_the_spacing_that_is_asked_for_decides(tmp_path, monkeypatch, spacing, holes):
    assert read(tmp_path, monkeypatch, holed(2, 5), spacing=spacing)[0].holes == holes


@pytest.mark.parametrize(("ground", "count"), [(0.0, 1), (1.4, None)])
def test_no_hole_counts_that_closing_takes_for_a_door_on_the_ground(tmp_path, ground, count):
    sheet, file = holed(2, 5), tmp_path / "sheet.obj"
    options = {"ground": ground}
    found = narrow_holes(sheet, file, options, 0.5)
    assert (found and found.count) == count
    closed = surface_of(SurfaceEntry(file=str(as_obj(file, sheet)), fill_narrower=0.5, **options))
    assert closed.holes == 2 - (count or 0)


def test_a_hole_that_cannot_be_closed_stays_and_why_is_told(tmp_path, monkeypatch):
    points, faces = holed_sheet(2, 2)
    sheet = make_surface(points, faces)
    loop = sheet.boundary[1]
    # a pipe stands on one hole: its rim is upright
    rim = [sheet.vertices[loop] + [0.0, 0.0, 0.1 * k] for k in (1, 2, 3)]
    rows = [loop, *(len(sheet.vertices) + k * len(loop) + np.arange(len(loop)) for k in range(3))]
    quads = [(a, np.roll(a, -1), np.roll(b, -1), b) for a, b in pairwise(rows)]
    pipe = [np.column_stack(each) for a, b, c, d in quads for each in ((a, d, b), (b, d, c))]
    piped = make_surface(np.vstack([sheet.vertices, *rim]), np.vstack([sheet.triangles, *pipe]))
    kept, told = read(tmp_path, monkeypatch, piped, spacing=0.5)
    assert kept.holes == 2
    assert any("2 holes narrower than 0.5 m" in text and "can't be closed" in text for text in told)


@pytest.mark.parametrize(
    ("file", "options"),
    [
        ("shell.obj", {"fill": "holes"}),
        ("shell.obj", {"fill": "all"}),
        ("shell.obj", {"fill_narrower": 0.0}),
        ("shell.py", {}),
    ],
)
def test_nothing_is_closed_where_openings_are_asked_for_or_built(file, options):
    sheet = holed(2, 2)
    assert narrow_holes(sheet, Path("shell.obj"), {"fill": "edges"}, 0.5) == NarrowHoles(2, 0.5)
    assert narrow_holes(sheet, Path(file), options, 0.5) is None


def test_a_door_on_the_ground_is_no_hole():
    points, faces = holed_sheet(2, 2)
    sheet = make_surface(points, faces)
    sunk = points.copy()
    sunk[sheet.boundary[2], 2] = points[:, 2].min()
    assert narrow_holes(make_surface(sunk, faces), Path("shell.obj"), {}, 0.5) == NarrowHoles(1, 0.5)


def test_a_case_says_which_holes_are_closed(tmp_path):
    file = as_obj(tmp_path / "sheet.obj", holed(2, 5))
    for width, holes in ((0.5, 1), (0.0, 2)):
        assert surface_of(SurfaceEntry(file=str(file), fill_narrower=width)).holes == holes
