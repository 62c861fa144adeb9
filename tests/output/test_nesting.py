"""Rods cut from stock, on rods whose lengths and crossings are made up so that every bar is known
beforehand."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.output.workshop import nesting
from shellform.output.workshop.splice_schedule import cutting_notes, lath_names


def grid_of(*lengths, spacing=1.0):
    """Rods of these lengths, crossed every so many metres from their first ends on."""
    rods = [
        SimpleNamespace(length=length, marks=np.arange(0.0, length + 1e-9, spacing)) for length in lengths
    ]
    return SimpleNamespace(rods=tuple(rods))


def pieces_of(cutting, rod):
    """Its pieces as (start, length), from the first end on."""
    return sorted(
        (piece.start, piece.length) for bar in cutting.bars for piece in bar.pieces if piece.rod == rod
    )


def test_where_nothing_is_said_bars_are_of_6_m_and_saw_cuts_of_3_mm():
    cutting = nesting.cut(grid_of(2.0, 3.0))
    assert (cutting.stock, cutting.kerf) == (nesting.STOCK, nesting.KERF) == (6.0, 0.003)
    (bar,) = cutting.bars
    assert [(piece.rod, piece.length) for piece in bar.pieces] == [(1, 3.0), (0, 2.0)], "the longest first"
    assert bar.offcut == pytest.approx(0.994)


def test_the_better_of_two_packings_is_bought():
    cutting = nesting.cut(grid_of(4.0, 3.0, 4.0, 3.0, 3.0, 3.0), stock=10.0, kerf=0.0)
    assert (len(cutting.bars), cutting.least) == (2, 2), "longest first alone would buy three"
    assert cutting.waste == 0.0


def test_a_bar_is_begun_with_the_longest_piece_that_is_left():
    assert [sorted(bar) for bar in nesting._fullest({0: 2.0, 1: 5.0, 2: 3.0}, 8.0)] == [[1, 2], [0]]


def test_pieces_are_taken_to_the_tenth_of_a_millimetre():
    assert len(nesting._fullest(dict.fromkeys(range(3), 3.3333), 10.0)) == 1
    assert len(nesting._fullest(dict.fromkeys(range(3), 3.3334), 10.0)) == 2


def test_fewer_bars_than_stand_alone_for_want_of_the_smallest_piece_can_not_do():
    """Beside 6 of 8 nothing as long as 3 fits, though all three together are shorter than two bars."""
    assert nesting._least([6.0, 6.0, 3.0], 8.0) == 3
    assert nesting._least([6.0, 6.0, 2.0, 2.0], 8.0) == 2
    assert nesting._least([5.0, 4.0, 4.0, 3.0], 8.0) == 2


@pytest.mark.parametrize("beyond", [0.0, 5e-10])
def test_a_rod_as_long_as_the_stock_is_not_spliced(beyond):
    cutting = nesting.cut(grid_of(3.0 + beyond), stock=3.0, kerf=0.002)
    assert cutting.spliced == ()
    assert [len(bar.pieces) for bar in cutting.bars] == [1]
    assert nesting.cut(grid_of(3.0 + 1e-5), stock=3.0, kerf=0.002).spliced == (0,)


@pytest.mark.parametrize("short", [0.0, 5e-10])
def test_a_spliced_rod_s_pieces_may_be_as_long_as_the_stock(short):
    cutting = nesting.cut(grid_of(7.0), stock=2.5 - short, kerf=0.0)
    assert pieces_of(cutting, 0) == [(0.0, 2.5), (2.5, 2.0), (4.5, 2.5)]
    assert len(cutting.bars) == 3


def test_every_second_spliced_rod_is_divided_from_its_other_end_and_whole_ones_do_not_count():
    cutting = nesting.cut(grid_of(6.0, 2.0, 6.0, 6.0), stock=4.0, kerf=0.001)
    assert cutting.spliced == (0, 2, 3)
    assert pieces_of(cutting, 0) == [(0.0, 3.5), (3.5, 2.5)]
    assert pieces_of(cutting, 2) == [(0.0, 2.5), (2.5, 3.5)]
    assert pieces_of(cutting, 3) == [(0.0, 3.5), (3.5, 2.5)]


@pytest.mark.parametrize("stock", [0.4, 0.9])
def test_stock_that_reaches_no_further_place_between_crossings_is_refused(stock):
    """Of 0.4 m not to the first, of 0.9 m not from the first to the second."""
    with pytest.raises(InputError, match=r"a rod of 3 m can't be spliced") as told:
        nesting.cut(grid_of(3.0), stock=stock)
    assert (told.value.where, told.value.value) == ("rod.stock_length", stock)
    assert "Choose a longer stock length" in told.value.remedy


def test_two_laths_are_cut_for_each_rod():
    cutting = nesting.cut(grid_of(2.0, 1.5), stock=3.6, kerf=0.1, laths=2)
    found = sorted(sorted((piece.rod, piece.length) for piece in bar.pieces) for bar in cutting.bars)
    assert found == [[(0, 2.0), (1, 1.5)], [(0, 2.0), (1, 1.5)]]
    assert [bar.offcut for bar in cutting.bars] == [0.0, 0.0], "the saw's last cut ends the bar"
    assert cutting.waste == pytest.approx(0.2 / 7.2)


def splices_of(cutting):
    return sorted(piece.start for bar in cutting.bars for piece in bar.pieces if piece.part > 1)


def test_two_laths_of_a_rod_are_never_spliced_in_one_place_where_that_can_be_helped():
    """From either end a piece of 3.5 m would be the longest that 4 m of stock allow of 7 m."""
    assert splices_of(nesting.cut(grid_of(7.0), stock=4.0, kerf=0.0)) == [3.5]
    cutting = nesting.cut(grid_of(7.0), stock=4.0, kerf=0.0, laths=2)
    assert splices_of(cutting) == [0.5, 3.5, 4.5]
    assert cutting.spliced_through == ()


def test_the_pieces_of_each_lath_reach_from_its_first_end_to_its_second():
    """One is of two pieces, the other one of three, so that a part's number alone tells nothing."""
    cutting = nesting.cut(grid_of(7.0), stock=4.0, kerf=0.0, laths=2)
    pieces = [piece for bar in cutting.bars for piece in bar.pieces]
    assert lath_names(cutting) == {1: "lath 1, ", 2: "lath 2, "}
    for lath, count in ((1, 2), (2, 3)):
        own = sorted((each for each in pieces if each.lath == lath), key=lambda each: each.part)
        assert [each.part for each in own] == list(range(1, count + 1))
        ends = [0.0, *np.cumsum([each.length for each in own])]
        assert [each.start for each in own] == pytest.approx(ends[:-1])
        assert ends[-1] == pytest.approx(7.0)
    assert set(lath_names(nesting.cut(grid_of(7.0), stock=4.0, kerf=0.0)).values()) == {""}


def test_rods_of_which_both_laths_must_be_spliced_in_one_place_are_told():
    cutting = nesting.cut(grid_of(3.0, 0.9), stock=1.0, kerf=0.0, laths=2)
    assert splices_of(cutting) == [0.5, 0.5, 1.5, 1.5, 2.5, 2.5]
    assert cutting.spliced_through == (0,)
    assert nesting.cut(grid_of(3.0, 3.0), stock=1.0, kerf=0.0).spliced_through == (), "of one lath each"
    told = cutting_notes(cutting, ["U0", "V1"])
    assert told[-1].startswith("Both laths are spliced in one place, where only splices hold the rod: U0. ")
