"""NURBS curves and trimmed surfaces as a reader hands them to gmsh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record


@dataclass(frozen=True, eq=False)
class Curve(Record):
    """A NURBS curve: `control` (n, 3), m, `weights` (n,), `knots` (n + degree + 1,)."""

    control: Reals
    weights: Reals
    knots: Reals
    degree: int


@dataclass(frozen=True, eq=False)
class Patch(Record):
    """A NURBS surface: `control` (m, n, 3), m, `weights` (m, n), `knots` along u and v, `degree` along u and
    v; it is trimmed by `loops` of curves, the outer one first, or whole where there are none.
    """

    control: Reals
    weights: Reals
    knots: tuple[Reals, Reals]
    degree: tuple[int, int]
    loops: tuple[tuple[Curve, ...], ...] = ()


def with_end_knots(knots: Sequence[float] | Reals, degree: int) -> Reals:
    """The knot vector (n + degree - 1,) with its first and last knot, which no curve depends on and Rhino
    leaves out."""
    inner = np.array(knots, dtype=float)
    first = inner[0] if np.all(inner[:degree] == inner[0]) else inner[0] - (inner[degree] - inner[degree - 1])
    last = (
        inner[-1]
        if np.all(inner[-degree:] == inner[-1])
        else inner[-1] + (inner[-degree] - inner[-degree - 1])
    )
    return np.concatenate([[first], inner, [last]])
