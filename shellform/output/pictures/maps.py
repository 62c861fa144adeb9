"""What the rods of a gridshell can be coloured by: from a design and a state to a panel.

Deviation from the target (7); utilisation, the bending stress over the flexural strength; the rods' curvature
κ = M / EI; the shear angle between the two rods of a crossing, from the right angle; and the softest mode
(stability.py), in which the shell would buckle.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import InputError, require_known
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import ROD
from shellform.net.net import Net
from shellform.net.quality import shear_angles
from shellform.output.pictures.panel import Panel, marked_nodes
from shellform.problem.paths import deviations
from shellform.quantities import number
from shellform.structure.answers.stability import modes
from shellform.structure.elements.state import State
from shellform.structure.network import assemble

DEGREE = float(np.pi / 180.0)  # rad
AMPLITUDE = 0.05  # of the size of a shell or model, at which a mode is drawn


@dataclass(frozen=True, eq=False)
class Map(Record):
    """Values (n,) at the nodes of what `quantity` says, in a `unit` of a name and so much in SI, drawn at
    `positions` (n, 3), m.
    """

    values: Reals
    quantity: str
    unit: tuple[str, float]
    positions: Reals
    note: str = ""


def panel_of(
    shell: Gridshell,
    design: Design | None,
    state: State,
    *,
    load: Reals | None = None,
    quantity: str = "deviation",
    title: str = "",
) -> Panel:
    """The shell in a state, its rods coloured by one of QUANTITIES; with the `design` its cables, with the
    `load` (n, 6), N, its arrows.

    Raises InputError for another quantity and where the shell and the state don't belong together,
    NotConverged where no mode is found.
    """
    require_known(quantity, QUANTITIES, where="quantity", what="is nothing to draw")
    if len(state.positions) != shell.node_count:
        raise InputError(
            "belongs to another shell",
            where="state",
            value=len(state.positions),
            remedy="Draw a state with the shell that it was solved for.",
        )
    chosen = shell.unbraced() if design is None else design
    seen = QUANTITIES[quantity](shell, chosen, state)
    cables = shell.cables(chosen)
    return Panel(
        title=f"{title}{seen.note}",
        positions=seen.positions,
        beams=shell.net.lines,
        deviation=seen.values,
        cables=cables.ends,
        cable_forces=cables.tension(state),
        supports=shell.net.supports,
        load_points=np.empty(0, dtype=np.int64)
        if load is None
        else marked_nodes(load, shell.target.positions),
        rod_radius=chosen.radius,
        quantity=seen.quantity,
        unit=seen.unit,
        edges=shell.net.edge_lines,
    )


def _deviation(shell: Gridshell, design: Design, state: State) -> Map:
    return Map(deviations(shell, state), "deviation from the target", ("mm", 1e-3), state.positions)


def _utilisation(shell: Gridshell, design: Design, state: State) -> Map:
    values = worst_at_nodes(shell.net, shell.bending_utilisation(design, state))
    return Map(values, "utilisation of the rods in bending", ("", 1.0), state.positions)


def _curvature(shell: Gridshell, design: Design, state: State) -> Map:
    bending = shell.rod.resized(design.radius).stiffness.bending
    beams = shell.beams(design.radius)
    own = beams.local_forces(state)[beams.of_kind(ROD)]  # those of the laths: what locks them is bent by less
    bent = np.linalg.norm(own[:, [[2, 3], [5, 6]]] / bending, axis=2)
    return Map(worst_at_nodes(shell.net, bent), "curvature of the rods", ("1/m", 1.0), state.positions)


def _shear(shell: Gridshell, design: Design, state: State) -> Map:
    skew = np.abs(0.5 * np.pi - shear_angles(shell.net.grid, state))
    return Map(
        along_rods(shell.net, skew), "shear of the grid, from the right angle", ("°", DEGREE), state.positions
    )


def _mode(shell: Gridshell, design: Design, state: State) -> Map:
    found = modes(assemble(shell.network(design)), state, 1)
    shift = found.shapes[0, :, :3] / np.linalg.norm(found.shapes[0, :, :3], axis=1).max()
    note = f": softest mode, {number(float(found.stiffness[0]))} N/m"
    place = sunk(state.positions, shift)
    return Map(np.linalg.norm(shift, axis=1), "amplitude over the largest", ("", 1.0), place, note)


def sunk(positions: Reals, shift: Reals) -> Reals:
    """The nodes' `positions` (n, 3), m, moved along the translations `shift` (n, 3) of a mode, the largest of
    which is 1, so far that it is seen. A mode has no sign: where it moves most up or down it sinks."""
    size = float(np.ptp(positions, axis=0).max())
    upright = 1.0 if shift[np.argmax(np.abs(shift[:, 2])), 2] <= 0.0 else -1.0
    return positions + AMPLITUDE * size * upright * shift


def drawn_out(panel: Panel, shift: Reals) -> Panel:
    """A panel whose nodes alone are moved along a mode, as by `sunk`, so far that it is seen: its numbers and
    colours stay those of its state, and its title says so."""
    return replace(panel, positions=sunk(panel.positions, shift), title=f"{panel.title}, the mode drawn out")


QUANTITIES: dict[str, Callable[[Gridshell, Design, State], Map]] = {
    "deviation": _deviation,
    "utilisation": _utilisation,
    "curvature": _curvature,
    "shear": _shear,
    "mode": _mode,
}


def along_rods(net: Net, at_crossings: Reals) -> Reals:
    """Values (n,) at all nodes from those at crossings (c,), linear along each rod."""
    result = np.zeros(net.node_count)
    known = np.full(net.node_count, np.nan)
    for side in range(2):
        known[net.grid.crossing_nodes[:, side]] = at_crossings
    for rod in net.grid.rods:
        nodes = np.asarray(rod.nodes)
        place = np.flatnonzero(~np.isnan(known[nodes]))
        result[nodes] = np.interp(np.arange(len(nodes)), place, known[nodes][place])
    return result


def worst_at_nodes(net: Net, at_ends: Reals) -> Reals:
    """The largest of the rod elements' values at their two ends (m, 2) at each node (n,)."""
    result = np.zeros(net.node_count)
    np.maximum.at(result, net.grid.rod_ends, at_ends)
    return result
