"""The schedule of edge beams."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from shellform.arrays import Reals
from shellform.gridshell.catalogue import label
from shellform.gridshell.edge_beams import EDGE, Bundle, lengths, rods_of_bundles
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.net import EdgeLine, Net
from shellform.quantities import number
from shellform.structure.elements.sections import mass_per_length
from shellform.structure.elements.state import State
from shellform.tables import Table, Value


def edge_names(net: Net) -> list[str]:
    """E and the edge beam's number."""
    return [f"E{k}" for k in range(len(net.edges))]


def edge_table(shell: Gridshell, design: Design, states: Mapping[str, State], rods: Sequence[str]) -> Table:
    """The edge beams, a line a node of their axes in the target: where it is, how far along the beam, and
    which rods' ends are clamped to it, with how far before or behind it where there are more of them; the
    section forces there in each of the `states`. `rods` are the rods' names."""
    net, beams = shell.net, shell.beams(design.radius)
    place = shell.target.positions
    ends = {
        int(rod.nodes[side]): f"{name} {word}"
        for name, rod in zip(rods, net.grid.rods, strict=True)
        for side, word in ((0, "first"), (-1, "second"))
    }
    forces = {name: beams.local_forces(state)[beams.of_kind(EDGE)] for name, state in states.items()}
    rows: list[tuple[Value, ...]] = []
    before = 0
    for name, line in zip(edge_names(net), net.edges, strict=True):
        count = len(line.ends)
        step = np.linalg.norm(place[line.ends[:, 1]] - place[line.ends[:, 0]], axis=1)
        at = np.append(0.0, np.cumsum(step))
        held = _clamped(line, place, ends)
        for k, node in enumerate(line.nodes.tolist()):
            own = [each[before + min(k, count - 1)] for each in forces.values()]
            first = 1 if k < count else 4
            pushed = [
                value
                for each in own
                for value in (float(each[0]), float(np.hypot(each[first + 1], each[first + 2])))
            ]
            rows.append((name, float(at[k]), *place[node].tolist(), held.get(node, ""), *pushed))
        before += count
    heads = ["edge beam", "along it [m]", "x [m]", "y [m]", "z [m]", "rods' ends clamped there"]
    for name in forces:
        heads += [f"{name}: axial force [N]", f"{name}: bending moment [N m]"]
    edge = shell.edge
    notes = tuple(
        f"{name}: {label(edge.section)}, E {edge.section.material.young / 1e9:.4g} GPa, {length:.3f} m{', closed' if line.closed else ''}"
        + (f", {number(mass_per_length(edge.section) * length)} kg" if edge.section.material.density else "")
        + (f", {number(edge.section.count * length)} m of rods" if isinstance(edge.section, Bundle) else "")
        + ". It is made in its final curve, and rods are clamped to it once they are bent."
        for name, line, length in zip(edge_names(net), net.edges, lengths(net), strict=True)
        if edge is not None
    )
    return Table("edge_beams", tuple(heads), tuple(rows), notes)


def bundled_note(shell: Gridshell) -> tuple[str, ...]:
    """That the rods of edge beams are bought besides, a sentence; nothing where edge beams are no bundles."""
    bundled = rods_of_bundles(shell.net, shell.edge)
    if not bundled:
        return ()
    return (
        f"The edge beams' own rods are not among these: {number(bundled)} m of them are bought besides (edge_beams.csv).",
    )


def _clamped(line: EdgeLine, place: Reals, ends: Mapping[int, str]) -> dict[int, str]:
    """For nodes of the line what is clamped to them: the names of `ends`, of several each with its place, mm,
    along the beam from the node."""
    onward = np.gradient(place[line.nodes], axis=0)
    onward /= np.linalg.norm(onward, axis=1, keepdims=True)
    way = dict(zip(line.nodes.tolist(), onward, strict=True))
    there: dict[int, list[tuple[float, str]]] = {}
    for node, end in line.clamps.tolist():
        there.setdefault(node, []).append((float((place[end] - place[node]) @ way[node]), ends[end]))
    return {
        node: own[0][1]
        if len(own) == 1
        else ", ".join(f"{name} ({1e3 * at:+.0f} mm)" for at, name in sorted(own))
        for node, own in there.items()
    }
