"""Robust design: mean and standard deviation of the misfit of structures with tolerances (the paper's future
work): what their errors do to the shape, to second order. Whether they stand, drawn structures tell.

With independent normal variables z (scatter.py), d the distances from the target at z = 0, and X = dx/dz from
K X = -F, the misfit q = |d + X z + ...|² has, to second order,

    E q = d'd + tr(X'X) + sum of d'x_kk,                             var q = 4 |X'd|² + 2 |X'X|² (Frobenius).

The third term of the mean is the curvature of the equilibria; with y = K⁻¹ d it is -(sum of T(y, x_k, x_k) +
2 y' dF_k/dx x_k + y'F_kk), T being the third derivative of the energy (third_derivatives.py). The variance is
the one of linear equilibria: that is a Gauss-Newton approximation. `Spread.mean` has all three terms. On the
vault at 3 N a crossing, supports 0.075 mm off and all else in proportion, 150 samples gave a deviation of
8.4e-5 m² where 8.4e-5 were predicted; with twice that scatter 2.7e-4 instead of 1.9e-4: a stiff grid on
supports that give way is far from linear, and the predicted deviation is then too small (the mean 1.71e-3
instead of 1.69e-3).

What an optimiser needs is the term `RobustMisfit`: the Gauss-Newton value d'd + tr(X'X) + k sqrt(var q),
without the curvature, and its derivative by the rest lengths and the radius. That derivative is exact: for G
= d(value)/dX, K L = G, the terms -L_k'(dK X_k + dF_k) hold the third derivative of the energy contracted with
sum of L_k X_k', and one more adjoint solve carries their dependence on the state to the design.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals
from shellform.errors import NotConverged, require_count, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.scatter import Group, Realisation, groups_of, unpacked
from shellform.gridshell.tolerances import Tolerances
from shellform.problem.terms import LoadedDesign, Measurement, Term, distance_squares
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof, bilinear_by_rest_length
from shellform.structure.elements.parts import Part
from shellform.structure.elements.state import State, moved
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite

_TRIAL = 25  # factorisations of a sample's equilibrium
# tighter than usual: the linear answer is a start so good that it would pass for a solution
_TOLERANCE = 1e-11
_SHARES = ((1.0,), (0.5, 1.0), (0.25, 0.5, 0.75, 1.0))  # of a sample's variation, tried one after the other


@dataclass(frozen=True)
class Spread:
    """How the misfit scatters: `nominal`, m², without scatter; the `mean` to second order, of which `linear`
    is tr(X'X) and `curvature` that of the equilibria; the standard `deviation` with linear equilibria;
    `causes`: each one's share of tr(X'X) and of the variance's 4 |X'd|²; `node_deviation` (n,), m,
    the root mean square motion of each node."""

    nominal: float
    mean: float
    linear: float
    curvature: float
    deviation: float
    causes: Mapping[str, tuple[float, float]]
    node_deviation: Reals

    def sentences(self) -> list[str]:
        """Mean and deviation, and the causes by their share of the scatter."""
        result = [
            f"The misfit is {self.mean:.3g} ± {self.deviation:.2g} m² on average, against {self.nominal:.3g} "
            f"m² without scatter "
            f"(Gauss-Newton deviation; {self.curvature:+.2g} m² of the mean from the curvature of the "
            f"equilibria)."
        ]
        for name, (spread, _) in sorted(self.causes.items(), key=lambda each: -each[1][0]):
            result.append(f"{100.0 * spread:.1f} % of the scatter of the shape comes from {name}.")
        return result


@dataclass(frozen=True)
class MisfitSample:
    """Misfits, m², of re-solved equilibria of drawn structures, and how many drawings were `lost` off the
    stable branch (they have no misfit).
    """

    misfits: Reals
    lost: int


def spread(shell: Gridshell, design: Design, state: State, load: Reals, tolerances: Tolerances) -> Spread:
    """The scatter of the misfit at the stable equilibrium `state` of the design under the dead `load` (n, 6).
    Raises NotConverged where it isn't stable.
    """
    line = _Line(shell, design, state, load, tolerances)
    motion, away = line.motion, line.away
    places = _places(motion)
    along = places.T @ away.ravel()
    gram = places.T @ places
    linear = float(np.trace(gram))
    variance = 4.0 * float(along @ along) + 2.0 * float((gram**2).sum())
    pull = np.zeros(6 * len(away))
    pull.reshape(-1, 6)[:, :3] = away
    adjoint = line.solved(pull)
    own = np.concatenate([np.full(each.count, number) for number, each in enumerate(line.groups)])
    names = [each.name for each in line.groups]
    share = np.bincount(own, (places**2).sum(axis=0), len(names)) / max(linear, 1e-300)
    straight = np.bincount(own, along**2, len(names)) / max(float(along @ along), 1e-300)
    causes: dict[str, tuple[float, float]] = {}
    for name, one, other in zip(names, share, straight, strict=True):
        before = causes.get(name, (0.0, 0.0))
        causes[name] = (before[0] + float(one), before[1] + float(other))
    curvature = line.curvature(adjoint, along)
    nominal = float((away**2).sum())
    node_deviation = np.sqrt((places**2).sum(axis=1).reshape(-1, 3).sum(axis=1))
    return Spread(
        nominal,
        nominal + linear + curvature,
        linear,
        curvature,
        float(np.sqrt(variance)),
        causes,
        node_deviation,
    )


@dataclass(frozen=True)
class RobustMisfit(Term):
    """The misfit d'd, m², that is kept in spite of scatter under the load case `load`: the Gauss-Newton mean
    and `deviations` standard deviations. It costs a solve for each uncertain variable. The step model takes
    the misfit's curvature for its own."""

    name = "robust_misfit"
    of_shape = True
    load: str
    tolerances: Tolerances
    deviations: float = 1.0

    def __post_init__(self) -> None:
        give = "how many standard deviations are added, such as 1"
        require_number(self.deviations, least=0.0, where="robust.deviations", give=give)

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m². Raises NotConverged where the state isn't stable."""
        line = _Line(at.shell, at.design, at.state, at.load, self.tolerances)
        part = line.partial(self.deviations)
        return Measurement(
            np.array([part.value]),
            sp.csr_array(part.by_state[None]),
            sp.csr_array(at.design.among_candidates(part.by_rest_length)[None]),
            np.array([part.by_radius]),
            squares=distance_squares(at),
        )


def sample(
    shell: Gridshell,
    design: Design,
    state: State,
    load: Reals,
    tolerances: Tolerances,
    *,
    count: int,
    seed: int,
) -> MisfitSample:
    """Misfits of `count` drawn structures, every equilibrium solved anew on the stable branch from where the
    linear one lies.
    """
    require_count(count, where="sample.count", give="a number of structures to draw, such as 100")
    require_count(seed, least=0, where="sample.seed", give="a whole number, such as 1")
    line = _Line(shell, design, state, load, tolerances)
    rng = np.random.default_rng(seed)
    found: list[float] = []
    lost = 0
    for z in rng.normal(size=(count, line.motion.shape[1])):
        reached = next((each for shares in _SHARES if (each := line.drawn(z, shares)) is not None), None)
        if reached is None:
            lost += 1
        else:
            found.append(float(((reached.positions - shell.target.positions) ** 2).sum()))
    return MisfitSample(np.array(found), lost)


@dataclass(frozen=True)
class _Partial:
    """The robust value and its derivatives `by_state` (6 n,) at a fixed design, `by_rest_length` (p,) and
    `by_radius` at a fixed state.
    """

    value: float
    by_state: Reals
    by_rest_length: Reals
    by_radius: float


class _Line:
    """The equilibrium and its linear answer `motion` (6 n, k) to all variables."""

    def __init__(
        self, shell: Gridshell, design: Design, state: State, load: Reals, tolerances: Tolerances
    ) -> None:
        self.shell, self.state, self.radius = shell, state, design.radius
        self.built = Realisation(
            shell.beams(design.radius), shell.cables(design), np.asarray(load), np.zeros_like(load)
        )
        self.groups: list[Group] = groups_of(shell, design, load, tolerances)
        self.assembly: Assembly = assemble(shell.network(design))
        self.away = state.positions - shell.target.positions
        nodes = len(state.positions)
        forces = np.hstack([each.forces(state).toarray() for each in self.groups])
        self.motion: Reals = np.hstack([each.motion(nodes).toarray() for each in self.groups])
        held = np.flatnonzero(self.motion.any(axis=0))
        if len(held):
            for part in (self.built.beams, self.built.cables):
                _add_products(part, state, self.motion[:, held], forces, held)
        try:
            self.factor: Factor = self.assembly.factor(state)
        except NotPositiveDefinite as error:
            raise NotConverged(
                "The state isn't a stable equilibrium of the design",
                state=state,
                remedy="Solve for it first.",
            ) from error
        free = self.assembly.free
        self.motion[free] = -self.factor.solve(np.asfortranarray(forces[free]))

    def partial(self, deviations: float) -> _Partial:
        """d'd + tr(X'X) + `deviations` times the deviation, and its partial derivatives."""
        away, places = self.away.ravel(), _places(self.motion)
        along, gram = places.T @ away, places.T @ places
        root = float(np.sqrt(4.0 * along @ along + 2.0 * (gram**2).sum()))
        value = float(away @ away + np.trace(gram)) + deviations * root
        # Derivatives of the value by d and by X.
        factor = 0.5 * deviations / root if root > 0.0 else 0.0
        by_away = 2.0 * away + factor * 8.0 * (places @ along)
        by_places = 2.0 * places + factor * 8.0 * (np.outer(away, along) + places @ gram)
        right = np.zeros_like(self.motion)
        right.reshape(-1, 6, right.shape[1])[:, :3] = by_places.reshape(-1, 3, right.shape[1])
        multipliers = self.solved(right)
        row = np.zeros((len(self.away), 6))
        row[:, :3] = by_away.reshape(-1, 3)
        return _Partial(
            value,
            row.ravel() - self.by_state(multipliers),
            -self.by_rest_length(multipliers),
            -self.by_radius(multipliers),
        )

    def solved(self, right: Reals) -> Reals:
        """K⁻¹ on the free degrees of freedom, 0 on the held ones, for (6 n,) or (6 n, k)."""
        result = np.zeros_like(right)
        result[self.assembly.free] = self.factor.solve(np.asfortranarray(right[self.assembly.free]))
        return result

    def curvature(self, adjoint: Reals, along: Reals) -> float:
        """Sum of d'x_kk by the adjoint (6 n,) of the distances."""
        total = float(bilinear_by_dof(self.assembly, self.state, self.motion, self.motion) @ adjoint)
        for each, columns in self._columns():
            # Twice y'(dF/dx)x for what is symmetric. Spins don't commute: with w = x × y the third derivative
            # taken along y instead of x differs by 3/2 w'K x = -3/2 w'F, which with the skew part of dF/dx,
            # -1/2 w'F, makes it twice x'(dF/dx)y.
            own = self.motion[:, columns]
            total += 2.0 * float((each.by_state(self.state, own).T @ adjoint).sum())
            total += float((each.curvature(self.state).T @ adjoint).sum())
        return -total

    def by_state(self, multipliers: Reals) -> Reals:
        """Derivative (6 n,) by the state of the sum of L_k'(K X_k + F_k) at fixed L, X."""
        result = bilinear_by_dof(self.assembly, self.state, multipliers, self.motion)
        for each, columns in self._columns():
            result += each.by_state(self.state, multipliers[:, columns]).sum(axis=1)
        return result

    def by_rest_length(self, multipliers: Reals) -> Reals:
        """The same by the rest lengths (p,)."""
        result = bilinear_by_rest_length(self.built.cables, self.state, multipliers, self.motion)
        for each, columns in self._columns():
            result = result + each.by_rest_length(self.state, multipliers[:, columns])
        return result

    def by_radius(self, multipliers: Reals) -> float:
        """The same by the rods' radius, on which beams' stiffness depends; no cause of scatter does."""
        rate = self.shell.beams_by_radius(self.radius)
        return bilinear(rate, self.state, multipliers, self.motion)

    def drawn(self, z: Reals, shares: Sequence[float]) -> State | None:
        """The equilibrium of the structure at z, on the stable branch; None where it can't be followed in
        these shares.
        """
        state, before = self.state, 0.0
        for share in shares:
            built = self.built
            for each, columns in self._columns():
                built = each.varied(built, share * z[columns])
            if not (built.cables.rest_length > 0.0).all():
                return None
            step = ((share - before) * self.motion @ z).reshape(-1, 6)
            start = moved(state, self.assembly.chords.corrected(state, step))
            there = self.assembly.with_parts((built.beams, built.cables))
            try:
                found = find_equilibrium(
                    there, start, built.load, tolerance=_TOLERANCE, limit=_TRIAL, on_branch=True
                )
            except NotConverged:
                return None
            if not found.stable:
                return None
            state, before = found.state, share
        return state

    def _columns(self) -> list[tuple[Group, slice]]:
        ends = np.cumsum([each.count for each in self.groups])
        return [
            (each, slice(int(end) - each.count, int(end)))
            for each, end in zip(self.groups, ends, strict=True)
        ]


def _places(motion: Reals) -> Reals:
    """The nodes' translations (3 n, k) among all degrees of freedom (6 n, k)."""
    return np.ascontiguousarray(motion.reshape(-1, 6, motion.shape[1])[:, :3]).reshape(-1, motion.shape[1])


def _add_products(part: Part, state: State, motion: Reals, forces: Reals, columns: Indices) -> None:
    """Adds what the part's elements answer to the motions (6 n, h) to the `columns` of the forces (6 n,
    k).
    """
    dofs = part.dofs()
    if not len(dofs):
        return
    packed = part.evaluate(state, tangent=True).tangent
    assert packed is not None
    moving = np.asarray(motion[dofs].any(axis=(1, 2)))
    own = dofs[moving]
    change = unpacked(packed[moving], dofs.shape[1]) @ motion[own]
    for k, column in enumerate(columns):
        np.add.at(forces[:, column], own, change[:, :, k])
