"""Marks on a sheet: where they lie, at which scale they are printed, and how words are broken into lines."""

import itertools

import numpy as np
import pytest

from shellform.output.workshop import drawings
from shellform.output.workshop.marks import WIDE, Ring, Sheet, Span, Stroke, Words, box_of


def test_a_mark_s_box_holds_all_of_it():
    assert box_of(Ring("SUPPORTS", (3.0, -2.0), 0.5)) == (2.5, -2.5, 3.5, -1.5)
    assert box_of(Stroke("RODS_U", ((4.0, 1.0), (-1.0, 2.0), (0.0, -3.0)))) == (-1.0, -3.0, 4.0, 2.0)
    span = Span("DIMENSIONS", (0.0, 5.0), (8.0, 5.0), (0.0, 1.0), 2.0, "8.0")
    assert box_of(span) == (-3.0, -2.0, 11.0, 8.0)
    wide = 3 * WIDE * 2.0
    for side, x in (("left", 1.0), ("middle", 1.0 - wide / 2.0), ("right", 1.0 - wide)):
        for foot, y in (("bottom", 5.0), ("middle", 4.0), ("top", 3.0)):
            box = box_of(Words("ROD_NAMES", (1.0, 5.0), 2.0, "U12", 0.0, side, foot))
            assert box == pytest.approx((x, y, x + wide, y + 2.0))
    upright = box_of(Words("ROD_NAMES", (1.0, 5.0), 2.0, "U12", 90.0, "left", "bottom"))
    assert upright == pytest.approx((-1.0, 5.0, 1.0, 5.0 + wide))


def test_a_sheet_reaches_as_far_as_its_marks():
    marks = (Ring("SUPPORTS", (3.0, -2.0), 0.5), Stroke("RODS_U", ((-4.0, 1.0), (1.0, 7.0))))
    assert Sheet("one", marks, 1.6).extent == (-4.0, -2.5, 3.5, 7.0)


def test_what_is_printed_is_the_sheet_over_its_scale_moved_by_the_shift():
    marks = (
        Stroke("RODS_U", ((0.0, 0.0), (100.0, 50.0))),
        Words("ROD_NAMES", (200.0, -100.0), 20.0, "U1"),
    )
    lines, labels = drawings._to_scale(Sheet("one", marks, 1.6), 10.0, (30.0, 40.0))
    np.testing.assert_allclose(lines[0].points, [(30.0, 40.0), (40.0, 45.0)])
    np.testing.assert_allclose(labels[0].place, (50.0, 30.0))
    assert labels[0].height == pytest.approx(2.0)


@pytest.mark.parametrize("bold", [False, True])
def test_no_word_of_a_paragraph_is_lost_and_no_line_is_wider_than_its_column(bold):
    text = "Cables are tightened round after round, from the supports to the crown, each to its length."
    column = drawings._Column(5.0, 200.0, 60.0)
    column.words(text, 2.5, bold=bold)
    lines = [label.text for label in column.labels]
    assert " ".join(lines) == text
    letter = 0.93 if bold else 0.8
    most = int(60.0 / (letter * 2.5))
    assert len(lines) > 2
    assert max(len(line) for line in lines) <= most
    for line, following in itertools.pairwise(lines):
        assert len(line) + 1 + len(following.split()[0]) > most, "the next word would have fitted"
    tops = [label.place[1] for label in column.labels]
    np.testing.assert_allclose(tops, 200.0 - 2.5 - 1.6 * 2.5 * np.arange(len(lines)))
    assert column.top < tops[-1]
    assert {label.place[0] for label in column.labels} == {5.0}


def test_drawings_have_the_scales_that_rulers_have():
    by_ruler = {1.0, 2.0, 2.5, 5.0, 10.0, 15.0, 20.0, 25.0, 50.0, 75.0, 100.0, 200.0, 500.0, 1000.0}
    assert set(drawings.SCALES) == by_ruler
    assert list(drawings.SCALES) == sorted(drawings.SCALES)
