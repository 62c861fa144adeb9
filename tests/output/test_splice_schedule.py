"""What splices bear, on two rods whose elements' forces are made up."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.layers import LOCK, TwoLayers
from shellform.output.workshop.nesting import Bar, Cutting, Piece
from shellform.output.workshop.splice_schedule import cutting_notes, splice_table
from shellform.structure.elements.sections import Material, Rectangle

LATH = Rectangle(0.050, 0.035, Material(12e9, 0.75e9, 460.0, 24e6))
FORCES = np.zeros((7, 7))  # of three elements of rod A and four of rod B
FORCES[1] = [100.0, 0.0, 6.0, -8.0, 0.0, -2.0, 4.0]  # axial force; the ends' moments as they turn them
FORCES[5] = [-40.0, 0.0, 3.0, 1.0, 0.0, -3.0, -1.0]
COUPLE = np.zeros((7, 7))
COUPLE[1, [2, 5]] = 21.0, -7.0
COUPLE[5, [2, 5]] = -14.0, 7.0
CUTTING = Cutting(
    6.0,
    0.003,
    (
        Bar((Piece(1, 1, 2, 0.0, 5.5),), 0.497),
        Bar((Piece(1, 2, 2, 5.5, 2.5), Piece(0, 2, 2, 1.5, 2.5)), 0.994),
        Bar((Piece(0, 1, 2, 0.0, 1.5),), 4.497),
    ),
    3,
)


class Beams:
    """Those of the rods, and behind them those that lock their laths."""

    def __init__(self, lock=()):
        self.lock = lock

    def of_kind(self, kind):
        return np.repeat([kind != LOCK, kind == LOCK], [7, len(self.lock)])

    def local_forces(self, state):
        return state * np.concatenate([FORCES, self.lock]) if len(self.lock) else state * FORCES


def told(section, lock=()):
    rods = (
        SimpleNamespace(
            nodes=np.arange(4),
            arc=np.array([0.0, 1.0, 2.0, 4.0]),
            marks=np.array([1.0, 2.0, 4.0]),
            crossings=np.array([7, 3, 9]),
        ),
        SimpleNamespace(
            nodes=np.arange(5),
            arc=np.array([0.0, 2.0, 4.0, 6.0, 8.0]),
            marks=np.array([2.0, 5.0, 6.0]),
            crossings=np.array([8, 9, 2]),
        ),
    )
    asked = []
    shell = SimpleNamespace(
        net=SimpleNamespace(grid=SimpleNamespace(rods=rods)),
        beams=lambda radius: asked.append(radius) or Beams(lock),
        rod=SimpleNamespace(resized=lambda radius: asked.append(radius) or SimpleNamespace(section=section)),
    )
    design = SimpleNamespace(radius=0.0125)
    table = splice_table(shell, design, {"erected": 1.0, "design": 2.0}, ["A", "B"], CUTTING)
    assert asked == [0.0125, 0.0125], "both of the design's rods"
    return table


def test_a_splice_bears_what_its_element_does_between_its_ends():
    """Rod A's halfway along its second element, rod B's three quarters along its third."""
    table = told(LATH)
    assert table.columns == (
        "rod", "from the first end [m]", "after crossing", "before crossing",
        "erected: tension [N]", "erected: bending moment [N m]",
        "design: tension [N]", "design: bending moment [N m]",
    )  # fmt: skip
    a, b = table.rows
    assert a[:4] == ("A", 1.5, 7, 3)
    # half of 6 and 2, and of -8 and -4: 4 and -6
    assert a[4:] == pytest.approx((100.0, 52.0**0.5, 200.0, 2.0 * 52.0**0.5))
    assert b[:4] == ("B", 5.5, 9, 2)
    assert b[4:] == pytest.approx((-40.0, 10.0**0.5, -80.0, 2.0 * 10.0**0.5)), "the moment is constant there"
    assert "2 rods are longer than the stock and must be SPLICED" in table.notes[0]


def test_of_two_laths_each_bears_half_and_one_more_by_what_locks_them():
    """The laths' axes lie 70 mm apart: a couple of 14 N m is 200 N in each."""
    section = TwoLayers(LATH, 0.5)
    loose, locked = told(section), told(section, COUPLE)
    assert section.apart == pytest.approx(0.07)
    for table, pulled in ((loose, (50.0, -20.0)), (locked, (50.0 + 200.0, -20.0 + 125.0))):
        # rod B's: a quarter of -14 and three quarters of -7
        for row, own, whole in zip(table.rows, pulled, (52.0**0.5, 10.0**0.5), strict=True):
            assert row[4:] == pytest.approx((own, whole / 2.0, 2.0 * own, whole))


def test_the_buyer_is_told_of_bars_saw_cuts_and_waste_and_whether_fewer_could_do():
    (said, warned) = cutting_notes(CUTTING, ["A", "B"])
    assert said == "3 bars of 6 m, saw cuts of 3 mm, 33 % waste; fewer can't do."
    assert warned.endswith("strong as the rod: A, B.")
    many = Cutting(
        6.0, 0.0, tuple(Bar((Piece(k, 2, 2, 3.0, 5.0),), 1.0) for k in (0, 1, 3, 4, 5, 6, 7, 9)), 8
    )
    names = [*(f"U{k}" for k in range(5)), *(f"V{k}" for k in range(5, 10))]
    assert cutting_notes(many, names)[1].endswith("strong as the rod: U0, U1, U3, U4, V5 to V7, V9.")
    whole = Cutting(6.0, 0.0025, (Bar((Piece(0, 1, 1, 0.0, 4.5),), 1.5),) * 3, 2)
    assert cutting_notes(whole, ["A"]) == (
        "3 bars of 6 m, saw cuts of 2.5 mm, 25 % waste; fewer than 2 can't do.",
    )
