"""Which cables a braced shell can do without.

The L1 term empties the cables with the least tension; but tension says little about what a cable does against
buckling. Without the cables of a set R the tangent K at a loaded state loses their stiffness, K - B k B', and
stays positive definite as long as

    S = I - k^½ B' K⁻¹ B k^½,   rows and columns of R,

does, B being the cables' directions and k = EA/l0. One block solve gives S for all cables; its diagonal is
what the structure keeps of its stiffness along each cable when that one goes, small numbers belonging to
cables that hold the softest mode. Sets are chosen greedily by a Cholesky factor of S that grows row by row
and may not lose more than a set share. What they may cost is a budget: of the objective, and of the shape.

Of thousands of cables a batch takes hundreds at once, and what these pull has to be in balance without them:
with the least used ones of the whole shell those along one diagonal of one region went together, which
sheared it. So of each patch of cells either diagonal gives as much pull as the others do, where those are
used as much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular

from shellform.arrays import Indices, Reals
from shellform.optimiser.search_state import Iterate, Search
from shellform.problem.evaluation import Evaluated
from shellform.problem.paths import deviations
from shellform.structure.answers.sensitivity import element_columns
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.state import State
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import column_blocks


@dataclass(frozen=True)
class Budget:
    """What cables may cost that are taken away: the `objective` that is left, and the `deviation`, m, of any
    node from its place under the design load."""

    objective: float = np.inf
    deviation: float = np.inf

    def covers(self, search: Search, trial: Evaluated) -> bool:
        """Whether the trial costs no more."""
        near = self.deviation == np.inf or farthest(search, trial) <= self.deviation
        return trial.objective <= self.objective and near


def allowed(search: Search, it: Iterate) -> float:
    """The deviation, m, to which cables may be taken away: the solver's, or the present one where that is
    beyond it."""
    most = search.solver.deviation
    return np.inf if most is None else max(most, farthest(search, it.point))


def farthest(search: Search, trial: Evaluated) -> float:
    """The largest distance, m, of a node from its place under the design load."""
    return float(deviations(search.problem.shell, trial.states[search.base]).max())


def kept_stiffness(
    assembly: Assembly, state: State, cables: Cables, some: Indices | slice = slice(None)
) -> Reals:
    """The matrix S (c, c) of the cables at the stable `state`, or of `some`; slack cables have rows of the
    identity.

    Raises NotPositiveDefinite.
    """
    chord, length = cables.chords(state)
    stiffness = np.where(length > cables.rest_length, cables.stiffness / cables.rest_length, 0.0)
    unit = np.sqrt(stiffness)[:, None] * chord / length[:, None]
    pull = element_columns(assembly, cables.dofs(), np.hstack([-unit, unit]))[:, some]
    factor, kept = assembly.factor(state), np.eye(pull.shape[1])
    for own in column_blocks(len(kept), len(assembly.free)):
        kept[:, own] -= pull.T @ factor.solve(np.asfortranarray(pull[:, own].toarray()))
    return kept


def evenly(use: Reals, pull: Reals, patch: Indices) -> Indices:
    """The order (c,) in which cables go that `pull` so much, of which so much `use` is made, both as shares
    of all, numbered by the `patch` that each belongs to: as if what those of its patch pull that go before it
    were made of it too."""
    order = np.lexsort((use, patch))
    own, pulled = patch[order], np.cumsum(pull[order]) - pull[order]
    begins = np.flatnonzero(np.diff(own, prepend=own[:1] - 1))
    counts = np.diff(np.append(begins, len(own)))
    before = np.empty(len(order))
    before[order] = pulled - np.repeat(pulled[begins], counts)
    return np.argsort(use + before, kind="stable")


def removable(kept: Reals, order: Indices, most: int, least: float) -> Indices:
    """The first cables of `order`, at most `most`, without all of which every direction keeps a share of at
    least `least` of its stiffness.

    A cable that would bring it below is passed over. `kept` (c, c) is the matrix S above.
    """
    chosen: list[int] = []
    factor = np.zeros((most, most))
    for cable in order:
        count = len(chosen)
        if count == most:
            break
        row = kept[cable, chosen]
        solved = solve_triangular(factor[:count, :count], row, lower=True) if count else row
        pivot = kept[cable, cable] - least - float(solved @ solved)
        if pivot <= 0.0:
            continue
        factor[count, :count], factor[count, count] = solved, np.sqrt(pivot)
        chosen.append(int(cable))
    return np.array(chosen, dtype=np.int64)
