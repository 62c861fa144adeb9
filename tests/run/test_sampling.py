"""Structures that are drawn a few at a time: which, what is kept of them, and how long the rest takes."""

from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.records.drawn import DrawnPath, DrawnShape, DrawnSnap, read_drawn
from shellform.reliability.perfect import TO_ITS_END
from shellform.run import sampling
from shellform.run.sampling import Clock, Examined, drawn_of

DESIGN = np.array([[0.0, 0.0, -10.0]])
LOADS = {"design": DESIGN, "additional": 1.25 * DESIGN}


class Bench:
    """Draws structures whose numbers tell all of them: every fifth falls and snaps, every third doesn't
    rest."""

    asked: ClassVar[list] = []

    def __init__(self, nominal):
        assert nominal == (-12.5, {"step": TO_ITS_END})

    def load_numbers(self, tolerances, *, seed, numbers, marks, resting):
        assert (tolerances, seed) == ("tolerances", 7)
        self.asked.append((list(numbers), marks, resting))
        return [
            SimpleNamespace(
                number=number,
                factor=1.0 - 0.001 * number,
                stands=number % 5 != 4,
                snaps=[SimpleNamespace(factor=0.5, far=0.01 * number)] if number % 5 == 4 else [],
                resting=None if resting is None or number % 3 == 2 else number,
                beams=SimpleNamespace(share=0.05),
                cables=SimpleNamespace(tension=lambda state: np.array([0.0, 2.0 * state])),
            )
            for number in numbers
        ]


@pytest.fixture
def draw(monkeypatch, tmp_path):
    Bench.asked, now = [], [0.0]

    def ticking():
        now[0] += 5.0
        return now[0]

    monkeypatch.setattr(sampling, "Workshop", Bench)
    monkeypatch.setattr(sampling, "perfect", lambda shell, own, force, **how: (force[0, 2], how))
    monkeypatch.setattr(sampling, "clock_without_compiling", ticking)
    monkeypatch.setattr(Examined, "key", lambda *_: "key")
    monkeypatch.setattr(sampling, "deviations", lambda shell, state: np.array([0.0, 0.002, 0.001 * state]))
    monkeypatch.setattr(
        sampling, "rod_utilisation", lambda rod, beams, state: np.array([0.25, beams.share * state + rod])
    )
    rods = {0.02: SimpleNamespace(section=0.5)}
    shell = SimpleNamespace(rod=SimpleNamespace(resized=rods.get))
    design = SimpleNamespace(radius=0.02)
    (tmp_path / "designs").mkdir()

    def drawn(count, clock, heard):
        return drawn_of(
            tmp_path, Examined("one", shell, design, LOADS, "tolerances"), "additional", count=count, seed=7,
            clock=clock, tell=heard.append,
        )  # fmt: skip

    return drawn


def test_structures_are_drawn_by_tens_and_those_that_were_kept_are_not_drawn_again(draw, tmp_path):
    clock, heard = Clock(30), []
    path = draw(13, clock, heard)
    marks = (1.0, 0.8)
    assert Bench.asked == [(list(range(10)), marks, 0.8), ([10, 11, 12], marks, 0.8)]
    assert heard == [10, 13]
    assert (clock.planned, clock.done, clock.spent) == (30, 13, 10.0)
    assert path.factors == pytest.approx([1.0 - 0.001 * number for number in range(13)])
    assert path.stand == tuple(number not in (4, 9) for number in range(13))
    assert path.snaps == (DrawnSnap(4, 0.5, 0.04), DrawnSnap(9, 0.5, 0.09))
    assert [each.number for each in path.shapes] == [0, 1, 3, 4, 6, 7, 9, 10, 12]
    assert path.shapes[-1] == DrawnShape(
        12, pytest.approx(0.012), pytest.approx(0.014 / 3), pytest.approx(1.1), 24.0
    ), "of its own beams, over the strength, and of its own cables"
    assert read_drawn(tmp_path, "one", "key").paths["additional"] == path
    again = draw(25, clock, heard)
    assert [numbers for numbers, _, _ in Bench.asked[2:]] == [list(range(13, 23)), [23, 24]]
    assert [resting for _, _, resting in Bench.asked[2:]] == [0.8, None], "of the first twenty the shape"
    assert (clock.planned, clock.done) == (25, 25), "30 less the 13 that were there, but more in all"
    assert max(each.number for each in again.shapes) == 19
    assert again.factors[:13] == path.factors


def test_of_more_structures_than_are_asked_for_the_first_ones_are_taken(draw):
    draw(13, Clock(30), [])
    clock, heard = Clock(30), []
    path = draw(4, clock, heard)
    assert len(Bench.asked) == 2
    assert (len(path.factors), len(path.stand), path.snaps, heard) == (4, 4, (), [])
    assert [each.number for each in path.shapes] == [0, 1, 3]
    assert draw(5, clock, heard).snaps == (DrawnSnap(4, 0.5, 0.04),)
    assert clock.planned == 30 - 4 - 5
    assert draw(12, clock, heard) == DrawnPath(
        tuple(1.0 - 0.001 * number for number in range(12)),
        tuple(number not in (4, 9) for number in range(12)),
        (DrawnSnap(4, 0.5, 0.04), DrawnSnap(9, 0.5, 0.09)),
        draw(13, clock, heard).shapes[:8],
    )


def test_what_is_left_is_told_by_what_the_structures_took_that_were_drawn():
    clock = Clock(40)
    assert (clock.left(), clock.fraction()) == (0.0, 0.0)
    clock.took(10, 25.0)
    assert (clock.left(), clock.fraction()) == (75.0, 0.25)
    clock.kept(5)
    assert (clock.left(), clock.fraction()) == (62.5, pytest.approx(10 / 35))
    clock.kept(100)
    assert clock.planned == 0
    clock.took(5, 5.0)
    assert (clock.planned, clock.left(), clock.fraction()) == (15, 0.0, 1.0)


def test_what_is_left_counts_what_comes_after_the_structures_too():
    clock = Clock(40, afterwards=10)
    clock.took(10, 25.0)
    assert (clock.left(), clock.fraction()) == (100.0, 0.2)
    clock.took(30, 75.0)
    assert (clock.left(), clock.fraction()) == (25.0, 0.8), "no noughts while it goes on"


def test_structures_are_kept_under_another_key_where_two_loads_have_changed_names():
    """Paths are kept by the names of their loads: one would be taken for the other's."""
    none = np.zeros(0)
    beams = SimpleNamespace(axial=none, bending_y=none, bending_z=none, torsion=none, rest_length=none)
    cables = SimpleNamespace(ends=none, rest_length=none, stiffness=none)
    shell = SimpleNamespace(
        target=SimpleNamespace(positions=none),
        network=lambda design: SimpleNamespace(beams=beams, cables=cables),
    )

    def key(**loads):
        return Examined("one", shell, None, loads, Tolerances()).key(7)

    assert key(wind=DESIGN, snow=2.0 * DESIGN) == key(wind=DESIGN, snow=2.0 * DESIGN)
    assert key(wind=DESIGN, snow=2.0 * DESIGN) != key(snow=DESIGN, wind=2.0 * DESIGN)
