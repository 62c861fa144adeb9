"""NURBS curves and trimmed surfaces as a reader hands them to gmsh."""

from __future__ import annotations

from dataclasses import dataclass

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
