"""What the three-dimensional view draws, as JSON: positions in m from the middle of the target, lengths in
mm, forces in N; arrays of floats as base64 of little-endian float32.

Beside the computed states the view shows the way to them: from the flat grid, laid out where the shell lies
nearest to it, to the erected, the braced and the poured shell. Between two computed states it draws straight
lines, and says so.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import rod_names
from shellform.net.net import Net
from shellform.output.pictures.maps import worst_at_nodes
from shellform.output.pictures.panel import marked_nodes, scale_end
from shellform.problem.paths import deviations
from shellform.records import words
from shellform.site.erection_steps import turn_in_plan
from shellform.structure.elements.state import State
from shellform.surface.shape.target import Surface

_MOST_TRIANGLES = 30_000  # of the surface in the view; more are merged


@dataclass(frozen=True, eq=False)
class ViewedShell(Record):
    """What is seen: `designs`, each with its `shells` (rods may differ) and its `states` by load case, of
    which `best` is to be built; `loads` (n, 6), N, with their `load_titles`; the `surface`, if it is known;
    `limit`, m, which ends the case's colour scale; the load that is `shown_first`."""

    title: str
    shells: Mapping[str, Gridshell]
    designs: Mapping[str, Design]
    states: Mapping[str, Mapping[str, State]]
    best: str
    loads: Mapping[str, Reals]
    load_titles: Mapping[str, str]
    surface: Surface | None
    limit: float
    shown_first: str = "design"

    @property
    def shell(self) -> Gridshell:
        """The shell of the design to build."""
        return self.shells[self.best]

    @property
    def first_load(self) -> str:
        """The load that is shown first."""
        return self.shown_first if self.shown_first in self.loads else next(iter(self.loads))


def fitting(viewed: ViewedShell) -> float:
    """The end of a scale, mm, that the design to build fills under the load that is shown first."""
    state = viewed.states[viewed.best].get(viewed.first_load)
    return scale_end(1e3 * (viewed.limit if state is None else float(deviations(viewed.shell, state).max())))


def controls(viewed: ViewedShell, gradient: str) -> dict[str, Any]:
    """What the template writes of the view's controls; `gradient` is the scale's colours as CSS."""
    return {
        "design_titles": [(name, words.design_title(name)) for name in viewed.designs],
        "loads": list(viewed.load_titles.items()),
        "first_load": viewed.first_load,
        "best": viewed.best,
        "fitting": fitting(viewed),
        "limit": 1e3 * viewed.limit,
        "gradient": gradient,
        "has_surface": viewed.surface is not None,
    }


def view_data(viewed: ViewedShell) -> dict[str, Any]:
    """What the script draws."""
    shell, grid = viewed.shell, viewed.shell.net.grid
    place = shell.target.positions
    middle = _middle(place)
    joint_of = {int(node): k for k, pair in enumerate(grid.crossing_nodes) for node in pair}
    vertices, triangles = (
        (np.zeros((0, 3)), np.zeros((0, 3))) if viewed.surface is None else _light(viewed.surface)
    )
    pulls = [
        viewed.shells[name].cables(design).tension(state)
        for name, design in viewed.designs.items()
        for state in viewed.states[name].values()
    ]
    return {
        "title": viewed.title,
        "limit": 1e3 * viewed.limit,
        "fitting": fitting(viewed),
        "strength": bool(np.isfinite(shell.rod.strength)),
        "force": max(float(pull.max(initial=0.0)) for pull in pulls),
        **_geometry(shell.net, middle, place),
        "cables": {
            "ends": shell.cable_ends.tolist(),
            "joints": [[joint_of[int(n)] for n in pair] for pair in shell.cable_ends],
        },
        "surface": {"vertices": _floats(vertices - middle), "triangles": _bytes(triangles.astype("<u4"))},
        "loads": [
            {
                "name": name,
                "title": viewed.load_titles[name],
                "points": marked_nodes(load, place).tolist(),
            }
            for name, load in viewed.loads.items()
        ],
        "designs": [_design(viewed, name) for name in viewed.designs],
        "best": list(viewed.designs).index(viewed.best),
    }


def _design(viewed: ViewedShell, name: str) -> dict[str, Any]:
    shell, design = viewed.shells[name], viewed.designs[name]
    cables = shell.cables(design)
    states = {}
    for load, state in viewed.states[name].items():
        use = worst_at_nodes(shell.net, shell.bending_utilisation(design, state))
        away = deviations(shell, state)
        states[load] = {
            "positions": _floats(state.positions - _middle(shell.target.positions)),
            "utilisation": _floats(use),
            "length": np.round(1e3 * cables.lengths(state), 4).tolist(),
            "force": [_short(value) for value in cables.tension(state)],
            "rods": [
                [round(1e3 * float(away[rod.nodes].max()), 4), _short(use[rod.nodes].max())]
                for rod in shell.net.grid.rods
            ],
        }
    return {
        "name": name,
        "title": words.design_title(name),
        "radius": design.radius,
        "cables": np.flatnonzero(design.present).tolist(),
        "rest": np.round(1e3 * cables.rest_length, 4).tolist(),
        "states": states,
    }


def net_data(net: Net, title: str, told: str, cable_ends: Indices) -> dict[str, Any]:
    """The same of a net that bears nothing yet, or of a gridshell's target: coloured by its rods' curvature,
    1/m, with all candidate cables slack; `told` is said of it."""
    grid, place = net.grid, net.target.positions
    middle = _middle(place)
    bent = worst_at_nodes(net, net.curvature)
    joint_of = {int(node): k for k, pair in enumerate(grid.crossing_nodes) for node in pair}
    count = len(cable_ends)
    lengths = np.linalg.norm(place[cable_ends[:, 1]] - place[cable_ends[:, 0]], axis=1)
    state = {
        "positions": _floats(place - middle),
        "utilisation": _floats(np.zeros(net.node_count)),
        "length": np.round(1e3 * lengths, 4).tolist(),
        "force": [0.0] * count,
        "rods": [[0.0, 0.0] for _ in grid.rods],
    }
    design = {
        "name": "target", "title": "Target", "radius": 0.02 * net.spacing, "cables": list(range(count)),
        "rest": state["length"], "states": {"none": state},
    }  # fmt: skip
    return {
        "title": title,
        "told": told,
        "limit": 1.0,
        "fitting": 1.0,
        "strength": False,
        "force": 0.0,
        "curved": _floats(bent),
        "curvature": _short(bent.max()),
        **_geometry(net, middle, place),
        "cables": {
            "ends": cable_ends.tolist(),
            "joints": [[joint_of[int(n)] for n in pair] for pair in cable_ends],
        },
        "surface": {"vertices": "", "triangles": ""},
        "loads": [{"name": "none", "title": "no load", "points": []}],
        "designs": [design],
        "best": 0,
    }


def _geometry(net: Net, middle: Reals, place: Reals) -> dict[str, Any]:
    """What doesn't depend on the design."""
    grid = net.grid
    return {
        "spacing": net.spacing,
        "middle": [_short(value) for value in middle],
        "box": [[_short(v) for v in end] for end in (place.min(axis=0) - middle, place.max(axis=0) - middle)],
        "target": _floats(place - middle),
        "flat": _floats(_before(net, place) - middle),
        "crossings": grid.crossing_nodes.tolist(),
        "supports": net.supports.tolist(),
        "edges": net.edge_lines.tolist(),
        "rods": [
            {
                "name": name,
                "nodes": rod.nodes.tolist(),
                "length": round(1e3 * rod.length, 3),
                "crossings": len(rod.crossings),
            }
            for name, rod in zip(rod_names(grid), grid.rods, strict=True)
        ],
    }


def _before(net: Net, place: Reals) -> Reals:
    """All nodes (n, 3), m, before the grid is bent: that flat, edge beams where they will be."""
    rods = np.unique(net.grid.rod_ends)
    flat = place.copy()
    flat[rods] = laid_out(net.grid.flat[rods], place[rods])
    flat[rods, 2] += place[:, 2].min() - flat[rods, 2].min()
    return flat


def laid_out(flat: Reals, place: Reals) -> Reals:
    """The flat grid (n, 3), m, turned and moved in plan to where it lies nearest to `place` (n, 3), on the
    level of its lowest point."""
    first, second = (each[:, :2] - each[:, :2].mean(axis=0) for each in (flat, place))
    angle = turn_in_plan(first, second)
    turn = [[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]
    level = place[:, 2].min() + flat[:, 2] - flat[:, 2].min()
    return np.column_stack([first @ turn + place[:, :2].mean(axis=0), level])


def _middle(place: Reals) -> Reals:
    return 0.5 * (place.min(axis=0) + place.max(axis=0))


def _light(surface: Surface) -> tuple[Reals, Any]:
    """Vertices (v, 3), m, and triangles (t, 3) of the surface; of a fine one vertices in one cell of a cubic
    grid are merged to their mean."""
    vertices, triangles = np.asarray(surface.vertices), np.asarray(surface.triangles)
    if len(triangles) <= _MOST_TRIANGLES:
        return vertices, triangles
    size = np.sqrt(2.0 * surface.area / _MOST_TRIANGLES)
    _, cell = np.unique(
        np.floor((vertices - vertices.min(axis=0)) / size).astype(np.int64), axis=0, return_inverse=True
    )
    cell = cell.ravel()
    count = np.bincount(cell).astype(float)
    merged = np.column_stack([np.bincount(cell, vertices[:, k]) / count for k in range(3)])
    corners = cell[triangles]
    whole = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    return merged, corners[whole]


def _floats(values: Reals) -> str:
    return _bytes(np.asarray(values).astype("<f4"))


def _bytes(values: Any) -> str:
    return base64.b64encode(np.ascontiguousarray(values).tobytes()).decode()


def _short(value: float) -> float:
    return float(f"{value:.6g}")
