"""Where errors take a perfect structure, to first order.

At an equilibrium x of the perfect structure under the loads p, a structure with errors has the unbalanced forces
r = p' - f'(x) - K u, u the places of its supports that are off. It moves by dx = K⁻¹ r, and its supports by u.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import (
    CAUSES,
    Errors,
    built_beams,
    built_cables,
    built_load,
    errors_of,
    variables,
)
from shellform.reliability.perfect import Perfect
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.structure.solve.residual import held

DRAWN = 8  # structures of each cause: what moves nodes farthest does so by far


def motions(
    nominal: Perfect,
    assembly: Assembly,
    state: State,
    load: Reals,
    some: Sequence[Errors],
    *,
    shape: bool = True,
) -> Reals:
    """How each node moves (k, n, 3), m, from the perfect structure's equilibrium `state` under the `load` (n, 6) in
    structures with `some` errors, k of them; with the imperfections of `shape`, or without. Raises
    NotPositiveDefinite where the state isn't stable."""
    network, imperfections = nominal.network, nominal.imperfections if shape else None
    factor = assembly.matrix.factor(held(assembly, assembly.evaluate(state)))
    right = []
    for errors in some:
        beams = built_beams(network.beams, errors, imperfections)
        cables = built_cables(network.cables, nominal.present, errors, imperfections)
        balance = assembly.with_parts((beams, cables)).evaluate(state, tangent=False)
        force = built_load(load, errors) - balance.force - assembly.force_along(state, errors.supports)
        right.append(force.ravel()[assembly.free])
    steps = factor.solve(np.asfortranarray(np.column_stack(right)))
    found = np.array([errors.supports.ravel() for errors in some])
    found[:, assembly.free] = steps.T
    return np.asarray(found.reshape(len(some), -1, 6)[:, :, :3])


def moved_by_cause(
    nominal: Perfect, tolerances: Tolerances, *, seed: int = 0, drawn: int = DRAWN
) -> dict[str, float]:
    """By cause of error, the root mean square motion of a node, m, from its place in the perfect structure at the
    end of its path, where no other cause is off; nothing where that structure isn't stable."""
    assembly, state, load = assemble(nominal.network), nominal.states[-1], nominal.factors[-1] * nominal.load
    causes = [name for name in CAUSES if getattr(tolerances, name) > 0.0]
    some = [
        errors_of(
            nominal.members,
            replace(Tolerances(), **{name: getattr(tolerances, name)}),
            variables(nominal.members, seed, number),
        )
        for name in causes
        for number in range(drawn)
    ]
    if not some:
        return {}
    try:
        found = motions(nominal, assembly, state, load, some)
    except NotPositiveDefinite:
        return {}
    squares = (found**2).sum(axis=2).mean(axis=1).reshape(len(causes), drawn)
    return dict(zip(causes, np.sqrt(squares.mean(axis=1)).tolist(), strict=True))
