"""Critical factors of low dishes against their paths by arc length, and what a step may pass over, on
stand-ins whose numbers are worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.reliability import branch
from shellform.reliability.branch import Branch, Here
from shellform.reliability.outlook import Outlook, View
from shellform.reliability.perfect import perfect
from shellform.reliability.refinement import critical_factor
from shellform.structure.answers.stability import modes
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve import path
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import Symmetric
from shellform.structure.solve.loading import forces


def dish(rise, spacing, radius, angle, rest_ratio):
    """A gridshell on a dish of 2 m, and its initial design."""
    side = np.linspace(-1.0, 1.0, 13)
    x, y = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(169).reshape(13, 13)
    a, b, c, d = (
        each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    surface = sf.make_surface(
        np.column_stack([x, y, rise * (1.0 - x**2) * (1.0 - y**2)]),
        np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
    )
    net = sf.pull_net(surface, spacing=spacing, gap=0.01, angle=angle, elements=2)
    joint = sf.Joint(axial=1e6, torsion=1.0, bending=1.0, gap=0.01)
    rod, cable = sf.Rod.round(young=40e9, radius=radius), sf.Cable(stiffness=1e5)
    shell = sf.brace(net, rod, joint, cable, below=surface)
    return shell, shell.design(rest_ratio=rest_ratio)


def first_critical(shell, design, load, borne):
    """The load factor of the first point of the path by arc length that isn't stable."""
    assembly = assemble(shell.network(design))
    start = find_equilibrium(assembly, shell.target, np.zeros_like(load)).state
    for found in path.follow(assembly, start, forces(load), goal=1.1 * borne, first=0.01, most=2500):
        if found.event or not found.equilibrium.stable:
            return found.factor
    raise AssertionError("stable as far as was looked")


@pytest.mark.parametrize(
    ("made", "borne", "share", "told_before"),
    [
        ((0.08, 0.4, 0.0015, 0.25 * np.pi, 0.995), 0.2106, 0.6, "3, with nothing critical up to there"),
        ((0.06, 0.4, 0.002, 0.0, 0.999), 0.2383, 0.3, "1.37"),
        ((0.05, 0.55, 0.002, 0.25 * np.pi, 0.995), 7.825, 0.3, "2.03"),
        ((0.1, 0.4, 0.0015, 0.25 * np.pi, 0.999), 0.2689, 0.77, "1.54: stable again after a fiftieth"),
        ((0.06, 0.4, 0.003, 0.0, 0.999), 3.191, 0.77, "1.01: stable again after a 27th"),
        ((0.04, 0.55, 0.003, 0.25 * np.pi, 0.999), 2.0908, 0.76, "0.76, though nearly unstable at 0.70"),
    ],
)
def test_a_critical_factor_is_that_of_the_first_critical_point_by_arc_length(
    monkeypatch, made, borne, share, told_before
):
    """Dishes that bear so many N a crossing, under loads of which they bear a share."""
    monkeypatch.setattr(path, "_LONGEST", 1.0)  # all steps are as short as the first
    shell, design = dish(*made)
    load = shell.point_load(borne / share)
    found = critical_factor(shell, design, load)
    assert found.factor == pytest.approx(share, rel=2e-3), told_before
    assert found.factor == pytest.approx(first_critical(shell, design, load, share), rel=2e-3)
    assert perfect(shell, design, load, shapes=0).bears is False


STILL = np.zeros((2, 6))


def view(x, factor, *, onward=0.0, values=(), soft=None, stiffness=()):
    """Of two nodes, of which one stands still and the other is at x and moves `onward` with the factor."""
    motion = STILL.copy()
    motion[1, 0] = onward
    state = at_rest(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]]))
    return View(state, factor, np.array(values), motion, soft, np.array(stiffness))


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
    assert outlook.turns(view(1.0, 0.5, onward=1.0), view(3.0, 0.5 + 2.0 * mean, onward=1.0)) is turns


def test_a_step_on_which_nothing_moves_does_not_turn(outlook):
    assert not outlook.turns(view(1.0, 0.5, onward=1.0), view(1.0, 1.0, onward=1.0))
    assert not outlook.turns(view(1.0, 0.5, onward=0.0), view(3.0, 0.6, onward=1.0))


@pytest.mark.parametrize(
    ("after", "bends"), [(1.0, False), (0.84, False), (0.82, True), (1.24, False), (1.26, True), (-1.0, True)]
)
def test_a_step_bends_that_misses_the_mean_of_both_motions_by_a_fifth(outlook, after, bends):
    """From 1.0 on at 2 a factor of 1, by a half to there."""
    end = view(1.0 + after, 1.5, onward=2.0)
    assert outlook.bends(view(1.0, 1.0, onward=2.0), end) is bends


@pytest.mark.parametrize(("width", "sinks"), [(0.12, False), (0.13, True), (-0.12, False), (0.5, True)])
def test_a_step_sinks_beyond_where_the_tangent_at_its_beginning_loses_definiteness(outlook, width, sinks):
    """The entry 1 at x = 1 loses 8 a metre and there is 1 m a factor: nothing is left at 0.125; the other
    end, where all is stiff and stays so, tells nothing. Backwards the first entry grows."""
    begin = view(1.0, 0.0, onward=1.0, values=[1.0, 1.0, 4.0], soft=np.array([[1.0], [0.0]]), stiffness=[1.0])
    end = view(1.0, width, onward=0.0, values=[1.0, 1.0, 4.0], soft=np.array([[1.0], [0.0]]), stiffness=[1.0])
    assert outlook.sinks(begin, end) is (sinks and width > 0.0)


def test_differences_are_taken_over_a_short_way_to_the_inside_of_the_step(outlook):
    begin = view(1.0, 0.0, onward=1.0, values=[1.0, 1.0, 4.0], soft=np.eye(2), stiffness=[90.0, 90.0])
    end = view(1.5, 0.5, onward=1.0, values=[-3.0, 1.5, 4.0], soft=np.eye(2), stiffness=[90.0, 90.0])
    assert not outlook.sinks(begin, end)
    assert outlook.seen.moves == pytest.approx([1.0 + 2e-5, 1.5 - 2e-5], abs=1e-12)


def test_shapes_come_to_be_the_softest_modes_of_what_is_at_hand(nominal):

    assembly = assemble(nominal.network)
    path = Branch(assembly, nominal.load, nominal.members.span)
    here = path.at(nominal.states[-1])
    outlook, seen = Outlook(assembly, nominal.load, nominal.members.span, path.measure.mass_shape), None
    for _ in range(12):
        seen = outlook.view(here.state, here.balance, here.factor, 1.0, seen)
    mass = outlook.mass * seen.soft
    np.testing.assert_allclose(seen.soft.T @ mass, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(seen.stiffness[:3], modes(assembly, here.state, 3).stiffness, rtol=1e-3)


class Seen:
    """Steps of a quarter that all come to rest, and what there is to be seen of them."""

    def __init__(self, monkeypatch, **seen):
        self.seen = {"turns": False, "bends": False, "sinks": False} | seen
        self.widths, self.returns, self.backs = [], False, 0
        outlook = SimpleNamespace(
            view=lambda state, balance, factor, share, before: SimpleNamespace(factor=share)
        )
        for name in self.seen:
            setattr(outlook, name, lambda before, after, name=name: self.tells(name, before, after))
        monkeypatch.setattr(branch, "Outlook", lambda *_: outlook)
        self.path = Branch.__new__(Branch)
        self.path.assembly = self.path.load = self.path.span = None
        self.path.measure = SimpleNamespace(mass_shape=None)
        self.path.step = lambda here, goal, last: Here(f"at {goal}", None, None)
        self.path.at = lambda state: Here(state, None, None)
        self.path._returns = self.back

    def tells(self, name, before, after):
        told = self.seen[name]
        self.widths.append(after.factor - before.factor)
        return told(before.factor, after.factor) if callable(told) else told

    def back(self, before, after):
        self.backs += 1
        return self.returns

    def along(self, smallest):
        return self.path.along(Here("begin", None, None), 0.0, 1.0, 0.25, smallest, heeding=True)[1]


def over(*, low, high):
    """Whether a step passes over what lies between both factors."""
    return lambda before, after: before <= low and after >= high


def test_steps_over_nothing_are_taken_as_they_are(monkeypatch):
    steps = Seen(monkeypatch)
    assert steps.along(1e-4) == 1.0
    assert set(steps.widths) == {0.25}


def test_a_step_that_sinks_is_halved_to_a_512th_of_the_load_however_coarse_its_end_may_be(monkeypatch):
    steps = Seen(monkeypatch, sinks=over(low=0.6, high=0.6))
    assert steps.along(1 / 64) == 1.0
    assert min(steps.widths) == 1 / 512


def test_a_step_that_bends_is_halved_to_a_64th_of_the_load(monkeypatch):
    steps = Seen(monkeypatch, bends=over(low=0.6, high=0.6))
    assert steps.along(1e-4) == 1.0
    assert min(steps.widths) == 1 / 64


@pytest.mark.parametrize(("returns", "reached", "least"), [(True, 1.0, 1 / 64), (False, 0.6, 1 / 512)])
def test_a_step_that_turns_counts_where_it_is_short_and_leads_back(monkeypatch, returns, reached, least):
    steps = Seen(monkeypatch, turns=over(low=0.6, high=0.6))
    steps.returns = returns
    assert steps.along(1e-3) == pytest.approx(reached, abs=2e-3)
    assert min(steps.widths) == least
    assert steps.backs == (1 if returns else 4)


@pytest.mark.parametrize(("off", "comes_back"), [(0.0, True), (0.039, True), (0.041, False), (None, False)])
def test_a_step_leads_back_to_within_a_tenth_of_its_way_from_where_it_began(monkeypatch, off, comes_back):
    """From 1.0 at rest, 1.1 on the way, to 1.4; nothing is found behind it where `off` is None."""
    path, given = Branch.__new__(Branch), []
    path.assembly, path.load, path.spent = None, 8.0, 0

    def find(assembly, state, load, *, limit):
        x = state.positions[1, 0]
        given.append((x, load))
        if x == 1.4 and off is None:
            raise NotConverged("lost", iterations=5)
        return SimpleNamespace(state=view(1.0 if x == 1.1 else 1.0 + off, 0.5).state, factorisations=5)

    monkeypatch.setattr(branch, "find_equilibrium", find)
    assert path._returns(view(1.1, 0.5), view(1.4, 0.75)) is comes_back
    assert given == [(1.1, 4.0), (1.4, 4.0)]
    assert path.spent == 10
