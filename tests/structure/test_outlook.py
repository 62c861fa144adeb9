"""What the ends of a step tell of what it may pass over, on a stand-in whose numbers are worked out by hand;
and critical factors of low dishes, whose paths pass over a good deal."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.structure.answers.stability import critical_load
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve import path
from shellform.structure.solve.drive import forces
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import Symmetric
from shellform.structure.solve.outlook import KINK, WINDOW, Outlook, View
from tests.gridshell.dishes import dish, first_critical

STILL = np.zeros((2, 6))


def view(x, *, onward=0.0, values=(), soft=None, stiffness=()):
    """Of two nodes, of which one stands still and the other is at x and moves `onward` with the factor."""
    motion = STILL.copy()
    motion[1, 0] = onward
    state = at_rest(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]]))
    return View(state, np.array(values), motion, soft, np.array(stiffness))


@pytest.fixture
def outlook():
    """Of a structure with two degrees of freedom whose tangent, lower values (3,), is (9 - 8 x, x, 4) at x,
    with a node's motions of a hundred-thousandth of the span, 2 m, at the most."""
    seen = SimpleNamespace(moves=[])

    def evaluate(state):
        x = state.positions[1, 0]
        seen.moves.append(x)
        return SimpleNamespace(tangent=np.array([9.0 - 8.0 * x, x, 4.0]))

    found = Outlook.__new__(Outlook)
    found.assembly = SimpleNamespace(
        matrix=Symmetric(np.array([0, 2, 3]), np.array([0, 1, 1])),
        chords=SimpleNamespace(corrected=lambda state, step: step),
        evaluate=evaluate,
    )
    found.span, found.seen = 2.0, seen
    return found


@pytest.mark.parametrize(
    ("mean", "turns"), [(0.1, True), (0.3, True), (0.34, False), (1.0, False), (3.0, False)]
)
def test_a_step_turns_whose_mean_slope_is_below_a_third_of_those_at_both_ends(outlook, mean, turns):
    """With slopes of 1 at both ends: a cubic turns round below (1 + 1 - 1) / 3."""
    assert outlook.turns(view(1.0, onward=1.0), view(3.0, onward=1.0), 2.0 * mean) is turns


def test_a_step_on_which_nothing_moves_does_not_turn(outlook):
    assert not outlook.turns(view(1.0, onward=1.0), view(1.0, onward=1.0), 0.5)
    assert not outlook.turns(view(1.0, onward=0.0), view(3.0, onward=1.0), 0.1)


@pytest.mark.parametrize(
    ("after", "bends"), [(1.0, False), (0.84, False), (0.82, True), (1.24, False), (1.26, True), (-1.0, True)]
)
def test_a_step_bends_that_misses_the_mean_of_both_motions_by_a_fifth(outlook, after, bends):
    """From 1.0 on at 2 a factor of 1, by a half to there."""
    end = view(1.0 + after, onward=2.0)
    assert outlook.bends(view(1.0, onward=2.0), end, 0.5) is bends


@pytest.mark.parametrize(("width", "sinks"), [(0.12, False), (0.13, True), (-0.12, False), (0.5, True)])
def test_a_step_sinks_beyond_where_the_tangent_at_its_beginning_loses_definiteness(outlook, width, sinks):
    """The entry 1 at x = 1 loses 8 a metre and there is 1 m a factor: nothing is left at 0.125; the other
    end, where all is stiff and stays so, tells nothing. Backwards the first entry grows."""
    begin = view(1.0, onward=1.0, values=[1.0, 1.0, 4.0], soft=np.array([[1.0], [0.0]]), stiffness=[1.0])
    end = view(1.0, onward=0.0, values=[1.0, 1.0, 4.0], soft=np.array([[1.0], [0.0]]), stiffness=[1.0])
    assert outlook.sinks(begin, end, width) is (sinks and width > 0.0)


def test_differences_are_taken_over_a_short_way_to_the_inside_of_the_step(outlook):
    begin = view(1.0, onward=1.0, values=[1.0, 1.0, 4.0], soft=np.eye(2), stiffness=[90.0, 90.0])
    end = view(1.5, onward=1.0, values=[-3.0, 1.5, 4.0], soft=np.eye(2), stiffness=[90.0, 90.0])
    assert not outlook.sinks(begin, end, 0.5)
    assert outlook.seen.moves == pytest.approx([1.0 + 2e-5, 1.5 - 2e-5], abs=1e-12)


@pytest.mark.parametrize(
    ("share", "bends", "sinks", "passes"),
    [
        (1.01 * KINK, True, False, True),
        (0.99 * KINK, True, False, False),
        (1.01 * WINDOW, False, True, True),
        (0.99 * WINDOW, True, True, False),
        (0.5, False, False, False),
    ],
)
def test_a_step_may_bend_by_a_64th_of_the_load_and_sink_by_a_512th(outlook, share, bends, sinks, passes):
    outlook.bends = lambda before, after, width: bends
    outlook.sinks = lambda before, after, width: sinks
    assert outlook.passes_over("begin", "end", 3.0, share) is passes


def test_a_step_to_a_critical_point_may_sink_within_a_512th_of_the_load_before_it(outlook):
    asked = []
    outlook.bends = lambda before, after, width: False
    outlook.sinks = lambda before, after, width: asked.append(width) or False
    for critical in (False, True):
        assert not outlook.passes_over("begin", "end", 3.0, 4.0 * WINDOW, critical=critical)
    assert asked == pytest.approx([3.0, 2.25])


@pytest.mark.parametrize(
    ("made", "borne", "told_before"),
    [
        ((0.05, 0.55, 0.003, 0.0, 0.999), 2.2022, 2.2488),
        ((0.06, 0.55, 0.003, 0.0, 0.999), 3.2124, 3.3187),
        ((0.04, 0.55, 0.003, 0.25 * np.pi, 0.999), 2.0909, 2.9866),
        ((0.05, 0.55, 0.0015, 0.25 * np.pi, 0.995), 5.0939, 31.579),
        ((0.06, 0.55, 0.002, 0.25 * np.pi, 0.995), 7.8959, 66.406),
        ((0.04, 0.4, 0.002, 0.0, 0.995), 0.72398, 0.63305),
    ],
)
def test_the_critical_load_of_a_low_dish_is_that_of_the_first_critical_point(
    monkeypatch, made, borne, told_before
):
    """Sought up to ten times what it bears, N a crossing, where steps are as long as that."""
    shell, design = dish(*made)
    assembly, load = assemble(shell.network(design)), shell.point_load(1.0)
    start = find_equilibrium(assembly, shell.target, np.zeros_like(load)).state
    found = critical_load(assembly, start, forces(load), goal=10.0 * borne)
    assert found.factor == pytest.approx(borne, rel=1e-4), f"{told_before} before"
    assert found.equilibrium.negative == 1
    monkeypatch.setattr(path, "_LONGEST", 1.0)  # all steps are as short as the first
    assert found.factor == pytest.approx(first_critical(shell, design, load, borne), rel=2e-3)
