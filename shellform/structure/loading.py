"""Loading step by step along one documented path.

Slender structures have many equilibria; which one is meant is a matter of how the load came on. The path here: from an
equilibrium, the load changes in equal increments (`STEP` of the whole unless said otherwise); each increment is solved from the
one before by steps that may not lose definiteness on the way (`on_branch`), and halved where they do, down to `SMALLEST` of
the whole. Where even that fails the stable branch has ended; the rest of the load is then applied at once and implicit dynamic
relaxation follows the snap-through to wherever it ends. So the same start and load always lead to the same state.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.structure.assembly import Assembly
from shellform.structure.equilibrium import TOLERANCE, Equilibrium, find_equilibrium
from shellform.structure.state import State

STEP = 0.25
SMALLEST = 1.0 / 64.0
_PATIENCE = 25  # factorisations of one increment; on the branch five or six are enough

Report = Callable[[float, Equilibrium], None]


@dataclass(frozen=True)
class Loaded:
    """The equilibrium under the whole load; `share` of the load change up to which the stable branch was followed (1: to
    the end); `factorisations` of all increments."""

    equilibrium: Equilibrium
    share: float
    factorisations: int

    @property
    def on_branch(self) -> bool:
        """Whether the state lies on the stable branch from the start."""
        return self.share == 1.0


def apply_load(
    assembly: Assembly,
    start: State,
    before: Reals,
    after: Reals,
    *,
    step: float = STEP,
    smallest: float = SMALLEST,
    tolerance: float = TOLERANCE,
    stay: bool = False,
    report: Report | None = None,
) -> Loaded:
    """The equilibrium under the load `after` (n, 6), reached from the equilibrium `start` under the load `before`.

    Increments begin at `step` and are halved down to `smallest`, shares of the whole. With `stay` the end of the stable branch is returned instead of what lies beyond the snap-through: the last stable
    equilibrium and the share of the load change that it bears. `report(share, equilibrium)` is called at each accepted increment.
    Raises NotConverged.
    """
    share, spent = 0.0, 0
    # Exact shares: 1.0 is reached as such, whatever the step.
    parts = max(1, round(1.0 / step))
    state, found = start, None
    width = 1.0 / parts
    while share < 1.0:
        goal = 1.0 if share + width > 1.0 - 1e-12 else share + width
        try:
            found = find_equilibrium(
                assembly, state, before + goal * (after - before), tolerance=tolerance, limit=_PATIENCE, on_branch=True
            )
        except NotConverged as error:
            spent += error.iterations
            width *= 0.5
            if width < smallest:
                break
            continue
        spent += found.factorisations
        if not found.stable:  # converged onto an unstable equilibrium: no branch goes on from there
            width *= 0.5
            if width < smallest:
                break
            continue
        share, state = goal, found.state
        if report is not None:
            report(share, found)
    if share < 1.0 and not stay:
        found = find_equilibrium(assembly, state, after, tolerance=tolerance)
        spent += found.factorisations
        if report is not None:
            report(1.0, found)
    if found is None:
        found = find_equilibrium(assembly, start, before, tolerance=tolerance)
        spent += found.factorisations
    return Loaded(replace(found, factorisations=spent), share, spent)


def limit_factor(assembly: Assembly, start: State, load: Reals, *, most: float = 2.0) -> float:
    """The share of `load`, up to `most`, that is borne on the stable branch from the unloaded equilibrium `start`."""
    none = np.zeros_like(load)
    return most * apply_load(assembly, start, none, most * load, step=0.0625, stay=True).share
