"""Where errors take a perfect structure, to first order.

At an equilibrium x of the perfect structure under the loads p, a structure with errors has the unbalanced
forces r = p' - f'(x) - K u, u the places of its supports that are off. It moves by dx = K⁻¹ r, and its
supports by u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Reals, Record
from shellform.errors import NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import (
    Errors,
    Imperfections,
    built_beams,
    built_cables,
    built_load,
    errors_by_cause,
)
from shellform.reliability.perfect import Perfect
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import side_by_side
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import held

DRAWN = 8  # structures of each cause: what moves nodes farthest does so by far


@dataclass(frozen=True, eq=False)
class Moved(Record):
    """Assemblies of `structures` as built, k of them, and how far each goes from a perfect structure's
    equilibrium, `motions` (6 n, k), m and rad, supports included."""

    structures: tuple[Assembly, ...]
    motions: Reals

    @property
    def translations(self) -> Reals:
        """Of the nodes in each (k, n, 3), m."""
        return np.asarray(self.motions.T.reshape(len(self.structures), -1, 6)[:, :, :3])


def moved_from(
    assembly: Assembly,
    state: State,
    load: Reals,
    present: Flags,
    some: Sequence[Errors],
    imperfections: Imperfections | None,
) -> Moved:
    """The structures that are a perfect one, with this `assembly` and those of the candidate cables that are
    `present`, but for `some` errors, moved from its equilibrium `state` under the dead `load` (n, 6). Raises
    NotConverged where that isn't stable."""
    (beams,), (cables,) = assembly.beams, assembly.cables

    def one(errors: Errors) -> tuple[Assembly, Reals]:
        """A structure as built, and the forces that its load has more than it."""
        own = (
            built_beams(beams, errors, imperfections),
            built_cables(cables, present, errors, imperfections),
        )
        built = assembly.with_parts(own)
        more = built_load(load, errors) - built.evaluate(state, tangent=False).force
        if errors.supports.any():
            more -= assembly.force_along(state, errors.supports)
        return built, more.ravel()

    found = side_by_side(one, list(some))
    try:
        motions = solved(assembly, state, np.column_stack([more for _, more in found]))
    except NotPositiveDefinite as error:
        what, remedy = "The state isn't a stable equilibrium of the design", "Solve for it first."
        raise NotConverged(what, state=state, remedy=remedy) from error
    motions += np.column_stack([errors.supports.ravel() for errors in some])
    return Moved(tuple(built for built, _ in found), motions)


def solved(assembly: Assembly, state: State, right: Reals) -> Reals:
    """K⁻¹ of the columns (6 n, k) at the free degrees of freedom, 0 at the held ones. Raises
    NotPositiveDefinite."""
    factor = assembly.matrix.factor(held(assembly, assembly.evaluate(state)))
    result = np.zeros_like(right)
    result[assembly.free] = factor.solve(np.asfortranarray(right[assembly.free]))
    return result


def moved_by_cause(
    nominal: Perfect, tolerances: Tolerances, *, seed: int = 0, drawn: int = DRAWN
) -> dict[str, float]:
    """By cause of error, the root mean square motion of a node, m, from its place in the perfect structure at
    the end of its path, where no other cause is off; nothing where that structure isn't stable."""
    assembly, state, load = assemble(nominal.network), nominal.states[-1], nominal.factors[-1] * nominal.load
    own = errors_by_cause(nominal.members, tolerances, seed, range(drawn))
    some = [errors for each in own.values() for errors in each]
    if not some:
        return {}
    try:
        found = moved_from(assembly, state, load, nominal.present, some, nominal.imperfections)
    except NotConverged:
        return {}
    squares = (found.translations**2).sum(axis=2).mean(axis=1).reshape(len(own), drawn)
    return dict(zip(own, np.sqrt(squares.mean(axis=1)).tolist(), strict=True))
