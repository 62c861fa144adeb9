"""Whether a step along a branch may pass over an unstable stretch, told from both its ends.

A step counts where every tangent that is made on it is positive definite. Those are few, and a structure may
lose its stability and have it again between two of them. With K the tangent at either end, u the motion there
with what measures the step (the load factor, or the length of the path), and h the step, it may have passed
over something if

- it turns: the cubic of the factor over the way between both states, with its rates at both, turns round
  twice (loading.py), as where the step has led beyond a snap;
- it bends: the way isn't the mean of both h u to within a fifth of it, as where much happens in between;
- it sinks: K, going on as it changes at one end, isn't positive definite any more before the other. So steps
  never go beyond where the tangent foretells a limit point or a bifurcation, which the shape of the path
  doesn't tell.

The last is looked at through the softest modes V, V'MV = 1: V'KV + h V'K'V has to be positive definite. They
come by inverse iteration from one state to the next, with the factor at hand; K' is a difference over a short
way along u to the inside of the step. What comes at once, as a cable that goes slack, isn't foretold: it
bends. So a step that changes the load by less than a 64th of it may bend, and by less than a 512th sink.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import Factor

_MODES = 6  # the softest ones, through which the tangent is looked at
_ROUNDS, _AGAIN = 8, 2  # of inverse iteration, at the beginning and from one state to the next
_BENT = 0.2  # of the way of a step, by which the mean of the motions at its ends may miss it
_SHORT, _TURNED = 1e-5, 1e-3  # of the span, and rad: the way over which differences are taken
KINK = 1 / 64  # of the load, a step so short may turn or bend by a cable's kink
WINDOW = 1 / 512  # of the load, a step so short may pass over bifurcations that lie within it


@dataclass(frozen=True, eq=False)
class View(Record):
    """A stable `state`: its tangent's lower `values`, as the assembly has them; `onward` (n, 6), m and rad,
    the motion with what measures the step; the `soft` shapes (f, k) with unit mass and their `stiffness`
    (k,), N/m."""

    state: State
    values: Reals
    onward: Reals
    soft: Reals
    stiffness: Reals


class Outlook:
    """What is to be seen from the states of one structure's path; `mass` (f,) is what modes are measured by,
    `span`, m, the structure's size."""

    def __init__(self, assembly: Assembly, span: float, mass: Reals) -> None:
        self.assembly, self.span, self.mass = assembly, span, mass[:, None]

    def view(self, state: State, values: Reals, factor: Factor, onward: Reals, before: View | None) -> View:
        """From a state with its tangent's lower values, their factor and the motion `onward` (n, 6), after
        the view `before`."""
        size = len(self.assembly.free)
        shapes, rounds = (_first(size), _ROUNDS) if before is None else (before.soft, _AGAIN)
        stiffness = np.zeros(0)
        for _ in range(rounds):
            inert = self.mass * shapes
            solved = np.asarray(factor.solve(inert))
            stiffness, mixed = _ritz(solved.T @ inert, solved.T @ (self.mass * solved))
            shapes = solved @ mixed
        return View(state, values, onward, shapes, stiffness)

    def turns(self, before: View, after: View, width: float) -> bool:
        """Whether a step that changes the load factor by `width`, and views' motions are by it, may have led
        to another branch."""
        way = after.state.positions - before.state.positions
        length = float(np.linalg.norm(way))
        rates = [float(np.einsum("ij,ij", way, each.onward[:, :3])) for each in (before, after)]
        if length == 0.0 or 0.0 in rates:
            return False
        return turns_between(length / rates[0], length / rates[1], width / length)

    def passes_over(
        self, before: View, after: View, width: float, share: float, *, critical: bool = False
    ) -> bool:
        """Whether a step of a `width` that changes the load by a `share` of it may pass over something;
        where the step ends beside a `critical` point it may sink within a window of that."""
        if share > KINK and self.bends(before, after, width):
            return True
        if share <= WINDOW:
            return False
        return self.sinks(before, after, (1.0 - WINDOW / share) * width if critical else width)

    def bends(self, before: View, after: View, width: float) -> bool:
        """Whether the nodes go otherwise than by the mean of their motions at both ends of the step."""
        way = after.state.positions - before.state.positions
        mean = 0.5 * width * (before.onward + after.onward)[:, :3]
        return bool(np.linalg.norm(way - mean) > _BENT * np.linalg.norm(way))

    def sinks(self, before: View, after: View, width: float) -> bool:
        """Whether the tangent, going on as it changes at one end of the step, loses definiteness before the
        other."""
        return any(self._lost(view, change) for view, change in ((before, width), (after, -width)))

    def _lost(self, view: View, change: float) -> bool:
        """Whether the tangent does by a `change` of what measures the step."""
        rate = self.assembly.matrix.full(self._rate(view, float(np.sign(change))))
        rises = change * (view.soft.T @ (rate @ view.soft))
        return bool(np.linalg.eigvalsh(np.diag(view.stiffness) + rises)[0] <= 0.0)

    def _rate(self, view: View, side: float) -> Reals:
        """How the tangent's lower values change with what measures the step, to the `side` 1 or -1."""
        far = float(np.abs(view.onward[:, :3]).max()) / (_SHORT * self.span)
        change = side / max(far, float(np.abs(view.onward[:, 3:]).max()) / _TURNED, 1.0)
        motion = self.assembly.chords.corrected(view.state, change * view.onward)
        then = self.assembly.evaluate(moved(view.state, motion)).tangent
        assert then is not None
        return (then - view.values) / change


def turns_between(before: float, after: float, mean: float) -> bool:
    """Whether a cubic with the slopes `before` and `after`, of one sign, at its ends, and the `mean` slope
    from one to the other, has slopes of the other sign on its way."""
    # At the share t of the way its slope is before - 2 half t + square t².
    half, square = 2.0 * before + after - 3.0 * mean, 3.0 * (before + after - 2.0 * mean)
    if not (before * after > 0.0 and before * square > 0.0):
        return False
    return 0.0 < half / square < 1.0 and half * half > before * square


def _first(size: int) -> Reals:
    """Shapes (f, k) with a share of all modes: fixed, so that results are repeatable."""
    return np.cos(1.7 * np.arange(size)[:, None] * np.arange(1.0, 1.0 + min(_MODES, size)))


def _ritz(stiffness: Reals, mass: Reals) -> tuple[Reals, Reals]:
    """Eigenvalues (k,) of both (k, k), the smallest first, and the vectors (k, k) with unit mass."""
    size = 1.0 / np.sqrt(np.diag(mass))
    heavy, turned = np.linalg.eigh(size[:, None] * mass * size)
    unit = size[:, None] * turned / np.sqrt(np.maximum(heavy, 1e-14 * heavy[-1]))
    found, mixed = np.linalg.eigh(unit.T @ stiffness @ unit)
    return found, unit @ mixed
