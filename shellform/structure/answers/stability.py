"""How far an equilibrium is from losing its stability, and in which shapes it would.

Three looks at the same question, from the tangent K of the equilibrium and its factor:

Modes. The softest shapes solve K v = w M v with the mass of the implicit dynamic relaxation (1 for a
translation, the square of an element length for a rotation), by Lanczos iteration with shift-invert about 0:
each step is one solve with the factor of K. That gives the eigenvalues nearest to 0, which are the lowest
where K is positive definite. Elsewhere its factor tells how many are negative; where some of them lie farther
off, the iteration is made again about a shift below all, from where K - shift M is positive definite.

Linearised critical factor. Between two equilibria at factors f0 < f1 of one load the tangent changes from K0
to K1; carried on at the same rate it becomes singular where

    (K1 + (f - f1) (K1 - K0) / (f1 - f0)) v = 0,

the eigenvalue of which nearest above f1 is the estimate. It assumes that the tangent goes on changing as it
begins to: where cables go slack or tighten on the way it may be far off, to either side.

True critical factor. The path is followed (path.py) until the number of negative eigenvalues changes, which
is located by bisection.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import ArpackError, ArpackNoConvergence, LinearOperator, eigsh

from shellform.arrays import Reals, Record
from shellform.errors import InputError, NotConverged, require_count
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import TOLERANCE, Equilibrium
from shellform.structure.solve.extended import fit_for
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.path import follow
from shellform.structure.solve.residual import ResidualNorm, held
from shellform.work_clock import Work, counts_as

_LANCZOS = 200  # restarts; an eigenvalue that stands out takes a few
_SHARP = 1e-9  # relative, of a mode's stiffness; its shape is as good
_LOWER = 4.0  # times the shift that isn't below all eigenvalues yet; …
_SHIFTS = 60  # … as often, that is by 36 digits
_DENSE = 12  # degrees of freedom up to which Lanczos vectors don't fit


@dataclass(frozen=True, eq=False)
class Modes(Record):
    """The softest modes of an equilibrium: `stiffness` (k,), N/m, the smallest first, negative where
    unstable; `shapes` (k, n, 6), the largest translation of each is 1."""

    stiffness: Reals
    shapes: Reals


@dataclass(frozen=True, eq=False)
class Critical(Record):
    """Where stability ends: load `factor`, the `kind` of point ("limit point" or "bifurcation"), its
    `equilibrium` and `mode` (n, 6).

    `linearised`: the estimate from the start of the path, infinite where the load stiffens the structure.
    """

    factor: float
    kind: str
    equilibrium: Equilibrium
    mode: Reals
    linearised: float


def modes(assembly: Assembly, state: State, count: int) -> Modes:
    """The `count` modes of the tangent at the state with the lowest stiffness, unstable ones first. Raises
    InputError for a bad count, NotConverged.
    """
    size = len(assembly.free)
    if not size:
        raise InputError(
            "a structure of which no node is free has none",
            where="modes",
            remedy="Ask for none, or leave out some supports.",
        )
    require_count(count, where="modes", give=f"{min(3, size)}, say", most=size)
    balance = assembly.evaluate(state)
    values = held(assembly, balance)
    solve: Callable[[Reals], Reals]
    negative = 0
    try:
        solve = assembly.matrix.factor(values).solve
    except NotPositiveDefinite:
        indefinite = assembly.matrix.factor_indefinite(values)
        solve, negative = indefinite.solve, indefinite.negative
    shape = ResidualNorm(assembly).mass_shape
    tangent, mass = assembly.matrix.full(values), sp.diags_array(shape).tocsc()
    stiffness, vectors = _nearest(tangent, solve, mass, count)
    if (stiffness < 0.0).sum() < negative:
        solve, shift = _from_below(assembly, values, shape, float(np.abs(stiffness).max()))
        stiffness, vectors = _nearest(tangent, solve, mass, count, shift)
    order = np.argsort(stiffness)
    flat = np.zeros((count, 6 * assembly.count))
    flat[:, assembly.free] = vectors[:, order].T
    shapes = flat.reshape(count, -1, 6)
    shapes = shapes.reshape(count, -1, 6)
    largest = np.abs(shapes[:, :, :3]).max(axis=(1, 2))
    largest = np.where(largest > 0.0, largest, 1.0)
    return Modes(stiffness[order], shapes / largest[:, None, None])


@counts_as(Work.EIGENVECTORS)
def linearised_factor(assembly: Assembly, before: State, after: State, factors: tuple[float, float]) -> float:
    """The critical factor estimated from the equilibria `before` and `after` at two load `factors`, beyond
    the second as seen from the first; infinite where there is none.

    Raises NotPositiveDefinite where `after` isn't stable.
    """
    then = held(assembly, assembly.evaluate(after))
    onward = factors[1] - factors[0]
    change = (then - held(assembly, assembly.evaluate(before))) / abs(onward)
    solve = assembly.matrix.factor(then).solve
    rate, tangent = assembly.matrix.full(change), assembly.matrix.full(then)
    # With m along the way, (K + m R) v = 0: R v = -1/m K v, so the largest -R over K is 1/m.
    size = tangent.shape[0]
    if size <= _DENSE:
        largest = float(np.linalg.eigvals(solve(-rate.toarray())).real.max())
    else:
        inverse = LinearOperator((size, size), matvec=solve, dtype=float)
        try:
            found = eigsh(
                -rate,
                1,
                M=tangent,
                Minv=inverse,
                which="LA",
                v0=_start(size),
                maxiter=_LANCZOS,
                return_eigenvectors=False,
            )
        except ArpackNoConvergence:  # nothing stands out from the many zeros: the structure stiffens
            return np.inf
        largest = float(found[0])
    return float(factors[1] + np.copysign(1.0, onward) / largest) if largest > 0.0 else np.inf


def critical_load(
    assembly: Assembly,
    start: State,
    drive: Drive,
    *,
    goal: float,
    first: float = 0.1,
    tolerance: float = TOLERANCE,
) -> Critical | None:
    """Where the path from the stable equilibrium `start` at factor 0 first loses stability, or None up to the
    factor `goal`.

    `first`: the first step as a share of the goal. Raises NotConverged where the path can't be followed,
    InputError where the start is unstable.
    """
    linearised, before = np.inf, None
    for point in follow(assembly, start, drive, goal=goal, first=first, tolerance=tolerance, heeding=True):
        found = point.equilibrium
        if before is None and not found.stable:
            raise InputError(
                "the start isn't stable", where="critical_load", remedy="Start from a stable equilibrium."
            )
        if point.event or not found.stable:
            shape = modes(fit_for(assembly, found.state), found.state, 1).shapes[0]
            return Critical(point.factor, point.event or "bifurcation", found, shape, linearised)
        if before is not None and not np.isfinite(linearised):
            linearised = linearised_factor(
                fit_for(assembly, found.state), before[1], found.state, (before[0], point.factor)
            )
        before = (point.factor, found.state)
    return None


def _from_below(
    assembly: Assembly, values: Reals, mass: Reals, size: float
) -> tuple[Callable[[Reals], Reals], float]:
    """The solve with K - shift M and a shift below all eigenvalues, by the factor that is positive definite
    first; `size` is that of the known ones. Raises NotConverged."""
    matrix, shift = assembly.matrix, -2.0 * (size or 1.0)
    for _ in range(_SHIFTS):
        try:
            return matrix.factor(matrix.raised(values, matrix.diagonal, -shift * mass)).solve, shift
        except NotPositiveDefinite:
            shift *= _LOWER
    raise NotConverged(
        "The modes were not found: no shift makes the tangent positive definite",
        remedy="Ask for those of a state nearer to its stable branch.",
    )


def _start(size: int) -> Reals:
    """A fixed start that is orthogonal to no mode in practice keeps results repeatable."""
    return np.cos(1.7 * np.arange(size))


@counts_as(Work.EIGENVECTORS)
def _nearest(  # type: ignore[no-untyped-def]
    tangent: sp.csc_array, solve, mass: sp.csc_array, count: int, shift: float = 0.0
) -> tuple[Reals, Reals]:
    """The `count` eigenvalues of (K, M) nearest to the `shift`, and their vectors (f, count); `solve` is with
    K - shift M."""
    size = tangent.shape[0]
    if size <= max(_DENSE, 2 * count + 2):
        root = 1.0 / np.sqrt(mass.diagonal())
        values, vectors = np.linalg.eigh(root[:, None] * tangent.toarray() * root)
        nearest = np.argsort(np.abs(values - shift))[:count]
        return values[nearest], root[:, None] * vectors[:, nearest]
    inverse = LinearOperator((size, size), matvec=solve, dtype=float)
    try:
        values, vectors = eigsh(
            tangent,
            count,
            M=mass,
            sigma=shift,
            OPinv=inverse,
            v0=_start(size),
            ncv=min(size, max(_DENSE, 2 * count + 8)),
            tol=_SHARP,
        )
    except ArpackError as error:
        raise NotConverged(
            f"The modes were not found: {error}",
            remedy="Ask for fewer modes, or for those of a state farther from its limit.",
        ) from error
    return values, vectors
