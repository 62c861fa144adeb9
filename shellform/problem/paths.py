"""A design's documented path: its states under each load case, and what is read off them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from shellform.arrays import Flags, Reals, reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly, on_their_own
from shellform.structure.solve.drive import forces
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import Loaded
from shellform.structure.solve.settled import settle

_SLACK_MARGIN = 1e-6  # relative tension below which a cable counts as slack


def follow(
    shell: Gridshell, design: Design, loads: Mapping[str, Reals], *, stay: bool = False
) -> dict[str, Loaded]:
    """The documented path of a design: unloaded from the target shape by relaxation, then each load case on
    its own from there, step by step, heeding what a step may pass over, and along the path where no step gets
    on (settled.py). `shellform analyse` goes the same way. `on_branch` of what is found is true where no
    unstable state is met, or foretold by both ends of a step, on the way: of a stretch shorter than a 512th
    of the load, and of what comes at once as a cable that goes slack, nothing may be seen. It is false, too,
    where neither steps nor the path come to the load.

    The cases, forces (n, 6), N and Nm, are solved side by side on the cores. With `stay` snap-through isn't
    followed. Raises InputError for forces of another shape, NotConverged where no equilibrium is found.
    """
    given = {name: reals(f"loads[{name!r}]", load, (shell.node_count, 6)) for name, load in loads.items()}
    none = np.zeros((shell.node_count, 6))
    first = assemble(shell.network(design))
    unloaded = find_equilibrium(first, shell.target, none)

    def loaded(own: Assembly, load: Reals) -> Loaded:
        return settle(own, unloaded.state, forces(load), stay=stay)

    followed = {name: load for name, load in given.items() if load.any()}
    found = dict(zip(followed, on_their_own(first, loaded, list(followed.values())), strict=True))
    return {name: found.get(name, Loaded(unloaded, 1.0, unloaded.factorisations)) for name in given}


def in_tension(shell: Gridshell, design: Design, state: State) -> Flags:
    """Which candidate cables (c,) are present and under tension in the state."""
    cables = shell.cables(design)
    pulled = cables.lengths(state) > cables.rest_length * (1.0 + _SLACK_MARGIN)
    result = np.zeros(len(shell.cable_ends), dtype=bool)
    result[np.flatnonzero(design.present)[pulled]] = True
    return result


def without_slack(shell: Gridshell, design: Design, state: State) -> Design:
    """The design without the cables that are slack in the state: the shell doesn't notice."""
    return replace(design, present=in_tension(shell, design, state))


def deviations(shell: Gridshell, state: State) -> Reals:
    """Distance (n,), m, of every node from its place in the target (7)."""
    return np.linalg.norm(state.positions - shell.target.positions, axis=1)
