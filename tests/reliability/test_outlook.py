"""Critical factors of low dishes against their paths by arc length, and what a step may pass over, on
stand-ins whose numbers are worked out by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.reliability import branch
from shellform.reliability.branch import Branch
from shellform.reliability.perfect import perfect
from shellform.reliability.refinement import critical_factor
from shellform.structure.answers.stability import modes
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve import path
from shellform.structure.solve.outlook import Outlook
from shellform.structure.solve.whole_steps import Here
from tests.gridshell.dishes import dish, first_critical


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


def test_shapes_come_to_be_the_softest_modes_of_what_is_at_hand(nominal):
    assembly = assemble(nominal.network)
    path = Branch(assembly, nominal.load, nominal.members.span)
    here = path.at(nominal.states[-1])
    outlook, seen = Outlook(assembly, nominal.members.span, path.measure.mass_shape), None
    for _ in range(12):
        seen = path._view(outlook, here, seen)
    mass = outlook.mass * seen.soft
    np.testing.assert_allclose(seen.soft.T @ mass, np.eye(6), atol=1e-9)
    np.testing.assert_allclose(seen.stiffness[:3], modes(assembly, here.state, 3).stiffness, rtol=1e-3)


class Seen:
    """Steps of a quarter that all come to rest, and what there is to be seen of them."""

    def __init__(self, monkeypatch, **seen):
        self.seen = {"turns": False, "bends": False, "sinks": False} | seen
        self.widths, self.returns, self.backs = [], False, 0
        outlook = Outlook.__new__(Outlook)
        for name in self.seen:
            setattr(outlook, name, lambda before, after, width, name=name: self.tells(name, before, after))
        monkeypatch.setattr(branch, "Outlook", lambda *_: outlook)
        self.path = Branch.__new__(Branch)
        self.path.assembly = self.path.load = self.path.span = None
        self.path.measure = SimpleNamespace(mass_shape=None)
        self.path.step = lambda here, goal, last: Here(f"at {goal}", None, None)
        self.path._view = lambda outlook, here, before: SimpleNamespace(
            factor=0.0 if here.state == "begin" else float(here.state[3:])
        )
        self.path.at = lambda state: Here(state, None, None)
        self.path._returns = self.back

    def tells(self, name, before, after):
        told = self.seen[name]
        self.widths.append(after.factor - before.factor)
        return told(before.factor, after.factor) if callable(told) else told

    def back(self, before, after, factor):
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


def placed(x):
    """Of two nodes, of which one stands still, the other is at x."""
    return at_rest(np.array([[0.0, 0.0, 0.0], [x, 0.0, 0.0]]))


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
        return SimpleNamespace(state=placed(1.0 if x == 1.1 else 1.0 + off), factorisations=5)

    monkeypatch.setattr(branch, "find_equilibrium", find)
    before, after = (SimpleNamespace(state=placed(x)) for x in (1.1, 1.4))
    assert path._returns(before, after, 0.5) is comes_back
    assert given == [(1.1, 4.0), (1.4, 4.0)]
    assert path.spent == 10
