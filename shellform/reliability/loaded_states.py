"""A design's states under its loads, each on the stable branch from the unloaded one, for a search that asks
whether it has come to another equilibrium.

They are those of the documented path (problem/paths.py), to the tolerance of an equilibrium, found in a
quarter of its factorisations: in wider steps, in a mixed form (structure/solve/whole_steps.py), and on one
path where loads are in proportion.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import span_of
from shellform.reliability.branch import Branch
from shellform.reliability.perfect import TO_ITS_END
from shellform.reliability.safety import paths
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly, on_their_own
from shellform.structure.solve.equilibrium import TOLERANCE, find_equilibrium
from shellform.structure.solve.loading import SMALLEST


def loaded_states(
    shell: Gridshell, design: Design, loads: Mapping[str, Reals]
) -> tuple[dict[str, State] | None, int]:
    """The states of a design under dead `loads`, forces (n, 6), N and N·m, on the stable branch from its
    unloaded one, heeding what steps may pass over (outlook.py), and the factorisations spent. Loads in
    proportion lie on one path; paths are followed side by side.

    None where a branch ends before its largest load, which is no proof that it does (settled.py). Raises
    NotConverged where there is no unloaded state."""
    first = assemble(shell.network(design))
    unloaded = find_equilibrium(first, shell.target, np.zeros((shell.node_count, 6)))

    def along(own: Assembly, path: tuple[str, Mapping[str, float]]) -> tuple[dict[str, State] | None, int]:
        largest, shares = path
        branch, load, found = Branch(own, loads[largest], span_of(shell)), loads[largest], dict[str, State]()

        def reached(factor: float, state: State) -> None:
            for name, share in shares.items():
                if share == factor:
                    balance = own.evaluate(state)
                    if branch.counts(unloaded.state, state, balance, share * load, TOLERANCE):
                        found[name] = state

        here = branch.at(unloaded.state)
        if here is not None:
            stops = tuple(shares.values())
            branch.along(here, 0.0, 1.0, TO_ITS_END, SMALLEST, reached, stops=stops, heeding=True)
        return found if len(found) == len(shares) else None, branch.spent

    states = {name: unloaded.state for name, load in loads.items() if not load.any()}
    spent = unloaded.factorisations
    for found, own in on_their_own(first, along, list(paths(loads).items())):
        spent += own
        if found is None:
            return None, spent
        states |= found
    return states, spent
