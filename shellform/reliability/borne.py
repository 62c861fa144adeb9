"""How much of a load one structure as built bears, and how that depends on the design, exactly.

Letters: x the state, d the design, p the load at factor 1, f the internal forces, K their tangent, v the
softest mode with v'Mv = 1, s = v'Kv its stiffness.

The structure is loaded from nothing. Its branch counts as borne up to the factor F at which its softest mode
has only the stiffness s0 > 0 left:

    f(x, d) = F p,   s(x, d) = s0.

At a limit point the stiffness falls like the root of the distance, and its slope by the load is infinite. A
little stiffness left keeps the equations regular, and F depends on the design as smoothly as the load at the
limit point does. With the adjoint K y = ds/dx, along the path ds/dF = y'p, and by the design

    dF/dd = -(ds/dd - y' df/dd) / (y'p),

ds/dd and ds/dx the third derivatives of the energy (third_derivatives.py).

A cable that goes slack takes its stiffness away at once, and s may jump over s0. Then F is where that cable's
stretch l - l0 comes to 0, and stands in the place of s in the same equations, K being the tangent before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import NotConverged
from shellform.reliability.path_of_one import Loading
from shellform.structure.answers.sensitivity import by_rest_length, by_stiffness
from shellform.structure.answers.stability import modes
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof, bilinear_by_rest_length
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Part
from shellform.structure.elements.state import State
from shellform.structure.solve.whole_steps import ON_THE_WAY, Here

_RESOLUTION = 1 / 64  # of the load, to which the end of the branch is known before it is sought exactly
_NARROW = 1e-3  # of the load, between whose ends one cable at most is taken to go slack
_SHORT = 0.99  # of the way to where a cable goes slack: the tangent beyond is another one
_AT_ONCE = 1e-9  # of the load, before a cable goes slack
EXACT = 1e-8  # relative, of the stiffness left
_STEPS = 40  # of the search for the end, at the most
CAREFUL = 1 / 8  # of the load, the steps from nothing: larger ones may leap over a short unstable stretch …
_NEAR = 1 / 16  # … as may those from a state of a design nearby
_SETTLING = 8  # factorisations of that state in this design


@dataclass(frozen=True, eq=False)
class BorneFactor(Record):
    """How much of a load a structure bears: the `factor`; by all rest lengths of the present cables
    `factor_by_rest_length` (p,), 1/m, and `factor_by_rate` (k,) by variables on which the beams' stiffness
    depends. Both are 0 where the branch goes on beyond what was asked for."""

    factor: float
    factor_by_rest_length: Reals
    factor_by_rate: Reals


@dataclass(frozen=True, eq=False)
class _Point(Record):
    """A state on the branch at the load `factor`, its softest mode's `stiffness`, N/m, and `shape` (6 n, 1)
    with unit mass, and which cables (p,) are `taut`."""

    here: Here
    factor: float
    stiffness: float
    shape: Reals
    taut: Flags


@dataclass(frozen=True, eq=False)
class _End(Record):
    """What ends the branch: derivatives of the softest stiffness or of a cable's stretch `by_dof` (6 n,),
    `by_rest_length` (p,) and `by_rate` (k,) at a fixed state."""

    by_dof: Reals
    by_rest_length: Reals
    by_rate: Reals


def borne(
    loading: Loading,
    *,
    left: float,
    most: float,
    rates: Sequence[Part] = (),
    exact: float = EXACT,
    near: tuple[float, State] | None = None,
) -> BorneFactor:
    """The factor up to which the structure keeps the stiffness `left`, N/m, to a relative error `exact` of
    it, `most` where it does so beyond; `rates` are the beams as built with the derivatives of their stiffness
    by further variables. From nothing, or from a factor and a state `near` it, of the same structure in a
    design nearby, if Newton's steps from there keep every tangent definite. Raises NotConverged where there
    is no unloaded equilibrium."""
    here, factor = _followed(loading, most, near)
    if here is None:
        raise NotConverged(
            f"Structure {loading.number} as built has no unloaded equilibrium",
            state=loading.nominal.unloaded,
            remedy="Ask for smaller tolerances or for stiffer rods.",
        )
    low = _point(loading, here, factor)
    if factor >= most and low.stiffness >= left:
        return BorneFactor(most, np.zeros(len(low.taut)), np.zeros(len(rates)))
    if low.stiffness >= left:
        above, high = factor + _RESOLUTION, None
    else:
        above, high = factor, low
        low = _stiff(loading, low, left)
    for _ in range(_STEPS):
        for each in (low, high):
            if each is not None and abs(each.stiffness - left) <= exact * left:
                return _derived(loading, each, _softest(loading, each, rates), rates)
        if above - low.factor <= _NARROW and (high is None or (low.taut & ~high.taut).any()):
            end = _slackening(loading, low, above, left)
            if end is not None:
                return _derived(loading, end[0], _stretch(loading, *end, rates), rates)
        goal = _between(low, above, high, left)
        middle = _moved(loading, low, goal)
        if middle is None:
            above, high = goal, None
        elif middle.stiffness >= left:
            low = middle
        else:
            above, high = goal, middle
    raise _not_found(loading, low)


def _followed(loading: Loading, most: float, near: tuple[float, State] | None) -> tuple[Here | None, float]:
    if near is not None and near[0] < most:
        factor, state = near
        begin = loading.newton(state, factor * loading.load, limit=_SETTLING, tolerance=ON_THE_WAY)
        if begin is not None:
            return loading.along(begin, factor, most, _NEAR, _RESOLUTION)
    return loading.followed(most, CAREFUL, _RESOLUTION)


def _between(low: _Point, above: float, high: _Point | None, left: float) -> float:
    """The next factor: where the square of the stiffness, nearly linear in the load, comes to that of what is
    left, or halfway where that isn't known or a cable goes slack between."""
    share = 0.5
    if high is not None and not (low.taut & ~high.taut).any():
        over = low.stiffness**2 - left**2
        share = over / (over + left**2 - high.stiffness * abs(high.stiffness))
    return low.factor + share * (above - low.factor)


def _stiff(loading: Loading, point: _Point, left: float) -> _Point:
    """A point before the given one with at least the stiffness `left`. Raises NotConverged where none is
    reached from there, however near it is."""
    back = _RESOLUTION
    while point.factor > 0.0 and back > _AT_ONCE:
        before = _moved(loading, point, max(0.0, point.factor - back))
        if before is not None and before.stiffness >= left:
            return before
        point, back = before or point, (2.0 if before is not None else 0.5) * back
    raise _not_found(loading, point)


def _slackening(loading: Loading, low: _Point, above: float, left: float) -> tuple[_Point, int] | None:
    """The point just before the first cable after `low` goes slack, and the cable, if the structure still has
    the stiffness `left` there; None where none does before the factor `above`."""
    ceiling = above
    if not low.taut.any():
        return None
    for _ in range(_STEPS):
        own = loading.assembly
        onward = own.by_node(own.factor(low.here.state).solve(loading.load.ravel()[own.free])).ravel()
        unit, dofs = _units(loading, low)
        rate = (unit * onward[dofs]).sum(axis=1)
        falling = low.taut & (rate < 0.0)
        stretch = _cables(loading).lengths(low.here.state) - _cables(loading).rest_length
        after = np.where(falling, -stretch / np.where(falling, rate, -1.0), np.inf)
        cable = int(np.argmin(after))
        if after[cable] <= _AT_ONCE:
            return (low, cable) if low.stiffness >= left else None
        if not low.factor + after[cable] <= above + _NARROW:
            return None
        goal = low.factor + _SHORT * float(after[cable])
        goal = goal if goal < ceiling else 0.5 * (low.factor + ceiling)
        there = _moved(loading, low, goal)
        if there is None or (low.taut & ~there.taut).any():
            ceiling = goal
        else:
            low = there
    return None


def _point(loading: Loading, here: Here, factor: float) -> _Point:
    found = modes(loading.assembly, here.state, 1)
    flat = found.shapes[0].ravel()
    size = np.sqrt(float(loading.measure.mass_shape @ flat[loading.assembly.free] ** 2))
    cables = _cables(loading)
    taut = cables.lengths(here.state) > cables.rest_length
    return _Point(here, factor, float(found.stiffness[0]), (flat / size)[:, None], taut)


def _moved(loading: Loading, point: _Point, goal: float) -> _Point | None:
    """The point of the same branch at the factor `goal`; None where it doesn't reach so far."""
    here = loading.at(point.here.state)  # its factor was replaced
    there = None if here is None else loading.step(here, goal, last=True)
    return None if there is None else _point(loading, there, goal)


def _softest(loading: Loading, point: _Point, rates: Sequence[Part]) -> _End:
    state, shape = point.here.state, point.shape
    return _End(
        bilinear_by_dof(loading.assembly, state, shape, shape),
        bilinear_by_rest_length(_cables(loading), state, shape, shape),
        np.array([bilinear(rate, state, shape, shape) for rate in rates]),
    )


def _stretch(loading: Loading, point: _Point, cable: int, rates: Sequence[Part]) -> _End:
    unit, dofs = _units(loading, point)
    by_dof, by_rest = np.zeros(6 * loading.assembly.count), np.zeros(len(unit))
    by_dof[dofs[cable]] = unit[cable]
    by_rest[cable] = -1.0
    return _End(by_dof, by_rest, np.zeros(len(rates)))


def _derived(loading: Loading, point: _Point, end: _End, rates: Sequence[Part]) -> BorneFactor:
    own, state = loading.assembly, point.here.state
    adjoint = own.factor(state).solve(end.by_dof[own.free])
    along = float(adjoint @ loading.load.ravel()[own.free])
    by_rest = end.by_rest_length - by_rest_length(own, state, _cables(loading)).T @ adjoint
    by_rate = end.by_rate - by_stiffness(own, state, *rates).T @ adjoint
    return BorneFactor(point.factor, -by_rest / along, -by_rate / along)


def _cables(loading: Loading) -> Cables:
    cables = loading.assembly.parts[1]
    assert isinstance(cables, Cables)
    return cables


def _units(loading: Loading, point: _Point) -> tuple[Reals, Indices]:
    """Derivatives (p, 6) of the cables' lengths by their ends' places, and the degrees of freedom (p, 6)."""
    cables = _cables(loading)
    unit, _ = cables.directions(point.here.state)
    return np.hstack([-unit, unit]), cables.dofs()


def _not_found(loading: Loading, point: _Point) -> NotConverged:
    return NotConverged(
        f"The load that structure {loading.number} as built bears was not found",
        state=point.here.state,
        iterations=_STEPS,
        remedy="Leave it out of the scenarios.",
    )
