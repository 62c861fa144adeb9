"""What relaxation and load steps must refuse: rises of the potential, unstable states, ends of a branch."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve import loading
from shellform.structure.solve.equilibrium import (
    TOLERANCE,
    Equilibrium,
    _minimum,
    _Relaxation,
    find_equilibrium,
    newton,
    stability,
)
from shellform.structure.solve.loading import SMALLEST, apply_load
from shellform.verification.models import chain


@pytest.fixture
def toggle():
    """A shallow toggle of two elements a side, and the load at its crown."""
    points = np.vstack([np.linspace([-1, 0, 0], [0, 0, 0.1], 3), np.linspace([0, 0, 0.1], [1, 0, 0], 3)[1:]])
    pin = [True, True, True, True, False, True]
    load = np.zeros((5, 6))
    load[2, 2] = -1.0
    return assemble(chain(points, (1e4, 1.0, 0.2, 0.2), {0: pin, 4: pin})), at_rest(points), load


def relaxing(toggle, times):
    assembly, start, load = toggle
    return _Relaxation(assembly, start, times * load, 1.0, TOLERANCE)


def potential(walk, load):
    """Strain energy less the work of the dead forces, J; no moments act."""
    return walk.now.energy - float((load[:, :3] * walk.state.positions).sum())


def newton_step(walk):
    unbalanced = (walk.load - walk.now.force).ravel()[walk.assembly.free]
    factor = walk.assembly.factor(walk.state)
    direction = factor.solve(unbalanced)
    return direction, float(unbalanced @ direction)


def test_a_step_uphill_is_refused_whatever_it_promises(toggle):
    walk = relaxing(toggle, 0.05)
    direction, downhill = newton_step(walk)
    before = walk.state
    assert downhill > 0.0
    assert not walk._advance(-direction, downhill)
    assert walk.state is before
    assert walk._advance(direction, downhill)


def test_a_step_that_is_no_number_is_refused(toggle):
    walk = relaxing(toggle, 0.05)
    direction, downhill = newton_step(walk)
    before = walk.state
    for none in (np.nan, np.inf):
        assert not walk._advance(np.where(np.arange(len(direction)) == 1, none, direction), downhill)
        assert walk.state is before
    assert walk._advance(direction, downhill)


def test_a_step_too_far_is_cut_until_the_potential_falls_by_enough(toggle):
    walk = relaxing(toggle, 0.05)
    direction, downhill = newton_step(walk)
    begun = potential(walk, walk.load)
    assert walk._advance(6.0 * direction, 6.0 * downhill)
    fallen = begun - potential(walk, walk.load)
    assert fallen >= 1e-4 * 6.0 * downhill * 0.1**4
    moved = np.abs(walk.state.positions - toggle[1].positions).max()
    assert moved < 2.5 * np.abs(direction).max(), "the whole step would have led uphill"


def test_the_parabola_s_minimum_lies_where_two_potentials_and_the_slope_put_it():
    # p(s) = s² - 2 a s along a step whose slope there is -2 a
    for least in (0.1, 0.3, 0.7):
        assert _minimum(1.0 - 2.0 * least, 2.0 * least, 1.0) == pytest.approx(least)
    assert _minimum(-2.0, 1.0, 1.0) == 0.5, "no minimum: the curve bends down"


def test_the_potential_falls_at_every_step_through_a_snap(toggle):
    walk, load = relaxing(toggle, 3.0), 3.0 * toggle[2]
    seen = [potential(walk, load)]
    while not walk.balanced() and walk.factorisations < 200:
        close = walk.residual < 1e-2
        walk.step(on_branch=False)
        seen.append(potential(walk, load))
        assert close or seen[-1] < seen[-2]
    assert walk.balanced()
    assert walk.state.positions[2, 2] < -0.05, "it has snapped through"


def test_the_equilibrium_of_a_flattened_toggle_without_load_is_unstable(toggle):
    assembly, start, load = toggle
    flat = replace(start, positions=start.positions * [1.0, 1.0, 0.0])
    found = newton(assembly, flat, 0.0 * load)
    assert abs(found.state.positions[2, 2]) < 0.01
    assert not found.stable
    assert found.negative >= 1
    assert stability(assembly, assembly.evaluate(found.state)) == (False, found.negative)
    assert stability(assembly, assembly.evaluate(start)) == (True, 0)


def told(state, *, stable=True):
    return Equilibrium(state, 0.0, 0.0, 1, stable, 0 if stable else 1)


def stood_in(monkeypatch, ends, *, by="unstable"):
    """Load steps whose equilibria are stable up to a factor, beyond it unstable or not found; the factors
    tried."""
    tried = []

    def find(assembly, start, load, *, tolerance, limit=0, on_branch=False, **_):
        factor = load
        tried.append((factor, on_branch))
        if factor > ends and on_branch and by == "lost":
            raise NotConverged("lost", state=start, iterations=2)
        return told(f"at {factor}", stable=not on_branch or factor <= ends)

    monkeypatch.setattr(loading, "find_equilibrium", find)
    drive = SimpleNamespace(at=lambda factor: factor, moves_supports=False)
    return drive, tried


@pytest.mark.parametrize("by", ["unstable", "lost"])
@pytest.mark.parametrize("ends", [0.2, 0.5, 0.77])
def test_a_branch_ends_before_the_first_state_that_is_lost_or_unstable(monkeypatch, by, ends):
    drive, tried = stood_in(monkeypatch, ends, by=by)
    seen = []
    found = loading.advance(
        None, "start", drive, stay=True, report=lambda share, equilibrium: seen.append((share, equilibrium))
    )
    assert not found.on_branch
    assert ends - SMALLEST <= found.share <= ends
    assert [share for share, _ in seen] == sorted(share for share, _ in seen)
    assert all(each.stable for _, each in seen)
    assert found.equilibrium.state == (seen[-1][1].state if seen else "at 0.0")
    assert tried[-1] == (found.share, False), "its last stable state is found to the tolerance"
    assert found.equilibrium.factorisations == found.factorisations > len(seen)


def test_a_branch_that_goes_on_is_followed_to_the_end_in_even_steps(monkeypatch):
    drive, tried = stood_in(monkeypatch, 2.0)
    found = loading.advance(None, "start", drive, step=0.25, stay=True)
    assert (found.on_branch, found.share) == (True, 1.0)
    assert [factor for factor, _ in tried] == [0.25, 0.5, 0.75, 1.0]
    assert all(on_branch for _, on_branch in tried)


def test_beyond_the_end_of_a_branch_the_whole_load_is_relaxed_and_said_to_be_off_it(monkeypatch):
    drive, tried = stood_in(monkeypatch, 0.5)
    found = loading.advance(None, "start", drive)
    assert not found.on_branch
    assert 0.5 - SMALLEST <= found.share <= 0.5
    assert tried[-1] == (1.0, False)
    assert found.equilibrium.state == "at 1.0"


def test_steps_are_halved_where_one_fails_and_doubled_after_two_that_succeed(monkeypatch):
    drive, tried = stood_in(monkeypatch, 0.3)
    loading.advance(None, "start", drive, stay=True)
    factors = [factor for factor, on_branch in tried if on_branch]
    # 0.25 holds, 0.5 and 0.375 don't, 0.3125 doesn't, 0.28125 does, 0.3125 …
    assert factors[:5] == [0.25, 0.5, 0.375, 0.3125, 0.28125]


def test_the_toggle_s_branch_ends_at_its_limit_load(toggle):
    """Stable on the way up to it, and not on the branch beyond: within the smallest step of each other."""
    assembly, start, load = toggle
    ends = apply_load(assembly, start, 0.0 * load, 4.0 * load, step=1 / 16, smallest=1 / 256, stay=True)
    assert ends.equilibrium.stable
    assert 0.0 < ends.share < 1.0
    below = apply_load(assembly, start, 0.0 * load, 4.0 * (ends.share - 0.01) * load)
    above = apply_load(assembly, start, 0.0 * load, 4.0 * (ends.share + 0.01) * load)
    assert below.on_branch
    assert not above.on_branch


def test_only_a_way_that_may_be_symmetric_is_looked_at_for_it(toggle, monkeypatch):
    """Pushed through, its tangent is indefinite on the way."""
    assembly, start, load = toggle
    found = []
    for symmetric in (True, False):
        asked = []
        monkeypatch.setattr(
            _Relaxation, "_saddle", lambda self, *_, asked=asked: asked.append(self.symmetric)
        )
        found.append(find_equilibrium(assembly, start, 3.0 * load, symmetric=symmetric))
        assert set(asked) == {symmetric}
    assert (found[0].state.positions == found[1].state.positions).all()
