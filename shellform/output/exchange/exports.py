"""The design as files for other programs, in metres: lines with results (VTU), Rhino's 3DM with layers, a
solid picture (GLB), curves (STEP), and a script that computes it anew (OpenSeesPy). The model file of the
design, which other programs can be fed from too, lies in designs/.

Geometry is that of one load case: with the design load it is the shell as it is built. Names are those of the
drawings: U5, V16, C12, S3.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.gridshell.catalogue import label
from shellform.gridshell.layers import TwoLayers
from shellform.net.grid import crossing_points, rod_names
from shellform.net.net import EdgeLine
from shellform.output.exchange.opensees import opensees_script
from shellform.output.exchange.run_readers import write_readers
from shellform.output.workshop.edge_schedule import edge_names
from shellform.output.workshop.marks import PENS
from shellform.output.workshop.schedules import Built, cable_crossings, rounds, support_forces
from shellform.problem.paths import deviations
from shellform.structure.elements import rotation
from shellform.structure.elements.state import State
from shellform.surface.shape.target import Surface
from shellform.written import whole, write_text

SIDES = 8  # of a rod drawn as a tube
THIN = 0.35  # of the rods' radius: a cable's
_LAYERS = {
    "rods u": PENS["RODS_U"].colour,
    "rods v": PENS["RODS_V"].colour,
    "edge beams": PENS["EDGE_BEAMS"].colour,
    "cables": PENS["CABLES"].colour,
    "supports": PENS["SUPPORT_NUMBERS"].colour,
    "crossings": "#404040",
    "target": "#9a9a9a",
}


def write_exports(
    folder: str | Path, built: Built, target: Surface, loads: Mapping[str, Reals], *, load: str = "design"
) -> list[Path]:
    """Writes gridshell.vtu, .3dm, .glb, .step and, but for designs with edge beams or rods in two layers,
    gridshell-opensees.py for the geometry under `load`, and the scripts that open a run in Blender and
    Grasshopper; returns the files.

    `loads` (n, 6) by name. The .step is left out where gmsh can't be loaded (`no_step` says why). Raises
    InputError for an unknown load and where files can't be written.
    """
    if load not in built.states or load not in loads:
        raise InputError(
            "is no load case", where="load", value=load, remedy=f"Known: {', '.join(built.states)}."
        )
    place = Path(folder)
    files = [place / f"gridshell{ending}" for ending in (".vtu", ".3dm", ".glb")]
    write_vtu(files[0], built)
    write_3dm(files[1], built, target, load=load)
    write_glb(files[2], built, target, load=load)
    if not built.shell.beams(built.design.radius).built_in.any():  # which OpenSees' frames can't say
        files.append(place / "gridshell-opensees.py")
        write_script(files[-1], built, loads[load], load=load)
    files += write_readers(place)
    if not no_step():
        files.append(place / "gridshell.step")
        write_step(files[-1], built, load=load)
    return files


def no_step() -> str:
    """Why no STEP file can be written here: system libraries that gmsh needs are missing. Empty where it
    can.
    """
    try:
        from shellform.surface import occ  # noqa: F401
    except InputError as error:
        return str(error)
    return ""


def write_vtu(path: str | Path, built: Built) -> None:
    """Rods, connectors and cables as lines on the target, with displacements, m, from there and cable forces,
    N, at each load.
    """
    from shellform.surface.readers.meshes import write_lines

    shell = built.shell
    beams, ties = shell.beams(built.design.radius), shell.cables(built.design)
    lines = np.vstack([beams.ends, ties.ends])
    kind = np.concatenate([beams.kind, np.full(len(ties.ends), len(beams.kinds))])
    points, cells = {}, {"kind": kind}
    for name, state in built.states.items():
        points[f"displacement {name} [m]"] = state.positions - shell.target.positions
        cells[f"cable force {name} [N]"] = np.concatenate([np.zeros(len(beams.ends)), ties.tension(state)])
    with whole(path, ".vtu") as partial:
        write_lines(partial, shell.target.positions, lines, points, cells)


def write_3dm(path: str | Path, built: Built, target: Surface, *, load: str = "design") -> None:
    """Rhino: rods u, rods v, cables, supports, crossings and the target's mesh on layers of their own; rods
    as NURBS curves. Section, lengths, marks, and forces and places at each load are user strings.
    """
    from shellform.surface.readers.rhino import Item, write_rhino

    shell, state = built.shell, built.states[load]
    items = _rod_items(built, state)
    items += [
        Item("edge beams", name, state.positions[_path(line)])
        for name, line in zip(edge_names(shell.net), shell.net.edges, strict=True)
    ]
    items += _cable_items(built, state)
    pushes = support_forces(built)
    for k, node in enumerate(shell.net.supports.tolist()):
        strings = {f"on the support under {name} [N]": _row(push[node]) for name, push in pushes.items()}
        items.append(Item("supports", f"S{k}", state.positions[[node]], strings=strings))
    places = {name: crossing_points(built.grid, each) for name, each in built.states.items()}
    wanted = shell.net.crossings
    for k, point in enumerate(places[load]):
        strings = {"target [m]": _row(wanted[k])}
        strings |= {f"under {name} [m]": _row(each[k]) for name, each in places.items()}
        items.append(Item("crossings", str(k), point[None], strings=strings))
    about = {"job": built.title, "design": built.name, "load": load, "date": built.block.date}
    about |= {"revision": built.block.revision, "author": built.block.author}
    about |= {"coordinates": " ".join(built.origin_notes)}
    told = {name: value for name, value in about.items() if value}
    items.append(Item("target", "target", target.vertices, target.triangles, told))
    with whole(path, ".3dm") as partial:
        write_rhino(partial, items, _LAYERS)


def _rod_items(built: Built, state: State) -> list[Any]:
    from shellform.surface.readers.rhino import Item

    section = label(built.shell.rod.resized(built.design.radius).section, 2)
    off = {name: deviations(built.shell, each) for name, each in built.states.items()}
    return [
        Item(
            f"rods {rod.direction}",
            name,
            state.positions[rod.nodes],
            strings={
                "section": section,
                "length [m]": f"{rod.length:.6f}",
                "crossings": " ".join(map(str, rod.crossings.tolist())),
                "marks from the first end [m]": _row(rod.marks),
                **{
                    f"off the target at most under {load} [m]": f"{each[rod.nodes].max():.6f}"
                    for load, each in off.items()
                },
            },
        )
        for name, rod in zip(rod_names(built.grid), built.grid.rods, strict=True)
    ]


def _cable_items(built: Built, state: State) -> list[Any]:
    from shellform.surface.readers.rhino import Item

    ties = built.shell.cables(built.design)
    pairs = cable_crossings(built.shell, built.design)
    turns = rounds(built.shell, built.design)
    lengths = {name: ties.lengths(each) for name, each in built.states.items()}
    pulls = {name: ties.tension(each) for name, each in built.states.items()}
    items = []
    for k, ends in enumerate(ties.ends):
        strings = {
            "crossings": f"{pairs[k][0]} {pairs[k][1]}",
            "tensioning round": str(int(turns[k])),
            "stiffness EA [N]": f"{built.shell.cable.stiffness:g}",
            "rest length [m]": f"{ties.rest_length[k]:.6f}",
            **{f"length under {name} [m]": f"{each[k]:.6f}" for name, each in lengths.items()},
            **{f"force under {name} [N]": f"{each[k]:.6f}" for name, each in pulls.items()},
        }
        items.append(Item("cables", f"C{k}", state.positions[ends], strings=strings))
    return items


def _row(values: Reals) -> str:
    return " ".join(f"{value:.6f}" for value in values.tolist())


def write_glb(path: str | Path, built: Built, target: Surface, *, load: str = "design") -> None:
    """A picture in space: rods as tubes of their true radius, each lath of two layers as one; cables thinner,
    supports as blocks, the target translucent.
    """
    from shellform.surface.readers.gltf import Solid, write_glb

    grid, state, radius = built.grid, built.states[load], built.design.radius
    solids = []
    up = rotation.matrices(state.quaternions)[:, :, 2]
    for direction in "uv":
        rods = [rod.nodes for rod in grid.rods if rod.direction == direction]
        ways = [state.positions[nodes] + level * up[nodes] for nodes in rods for level in _levels(built)]
        solids.append(Solid(f"rods {direction}", *_tubes(ways, radius), _shade(f"rods {direction}")))
    shell = built.shell
    if shell.edge is not None:
        ways = [state.positions[_path(line)] for line in shell.net.edges]
        thick = max(shell.edge.section.fibres)
        solids.append(Solid("edge beams", *_tubes(ways, thick), _shade("edge beams")))
    ties = built.shell.cables(built.design)
    if len(ties.ends):
        solids.append(
            Solid(
                "cables",
                *_tubes([state.positions[ends] for ends in ties.ends], THIN * radius),
                _shade("cables"),
            )
        )
    feet = state.positions[built.shell.net.supports]
    if len(feet):
        low, high = feet - np.array([0.0, 0.0, 3.0 * radius]), feet + np.array([0.0, 0.0, radius])
        blocks = _tubes([np.array(pair) for pair in zip(low, high, strict=True)], 2.5 * radius)
        solids.append(Solid("supports", *blocks, _shade("supports")))
    solids.append(Solid("target", target.vertices, target.normals, target.triangles, _shade("target", 0.35)))
    with whole(path, ".glb") as partial:
        write_glb(partial, solids)


def _levels(built: Built) -> tuple[float, ...]:
    """Heights, m, of a rod's laths over its axis."""
    section = built.shell.rod.resized(built.design.radius).section
    return (-0.5 * section.apart, 0.5 * section.apart) if isinstance(section, TwoLayers) else (0.0,)


def write_step(path: str | Path, built: Built, *, load: str = "design") -> None:
    """Curves: a B-spline through the nodes of each rod, in the order of the rods' numbers, then of each
    edge beam, then a line for each cable, each a part under its name.
    """
    from shellform.surface.occ import write_curves

    state = built.states[load]
    curves = [state.positions[rod.nodes] for rod in built.grid.rods]
    curves += [state.positions[_path(line)] for line in built.shell.net.edges]
    ties = built.shell.cables(built.design).ends
    curves += [state.positions[ends] for ends in ties]
    names = [*rod_names(built.grid), *edge_names(built.shell.net), *(f"C{k}" for k in range(len(ties)))]
    with whole(path, ".step") as partial:
        write_curves(partial, curves, names)


def write_script(path: str | Path, built: Built, load_forces: Reals, *, load: str = "design") -> None:
    """The script for OpenSeesPy (opensees.py) that computes the design under `load_forces` (n, 6), N,
    anew.
    """
    target = Path(path)
    text = opensees_script(
        built.shell.network(built.design),
        [built.states["none"], built.states[load]],
        load_forces,
        title=f"{built.title or 'Gridshell'}, {built.name or 'design'}",
        name=target.name,
        case=load,
    )
    write_text(target, text, ".py")


def _path(line: EdgeLine) -> Indices:
    """The edge beam's nodes in order, the first again at the end of a ring."""
    return np.append(line.nodes, line.nodes[:1]) if line.closed else line.nodes


def _shade(layer: str, opacity: float = 1.0) -> tuple[float, float, float, float]:
    """A layer's colour as glTF has it, which counts light, not what the eye sees (sRGB's exponent is near
    2.2).
    """
    red, green, blue = ((value / 255.0) ** 2.2 for value in bytes.fromhex(_LAYERS[layer][1:]))
    return red, green, blue, opacity


def _tubes(ways: list[Reals], radius: float) -> tuple[Reals, Reals, Indices]:
    """Points, normals and triangles of closed tubes of `radius`, m, round polylines; their ends have rims of
    their own with other normals.

    The ring at each point stands across the line there and is carried along without twist: the last one's
    axis less its part along the line.
    """
    turn = 2.0 * np.pi * np.arange(SIDES) / SIDES
    points: list[Reals] = []
    normals: list[Reals] = []
    triangles: list[Indices] = []
    count = 0
    around = np.arange(SIDES)
    ahead = (around + 1) % SIDES
    for way in ways:
        along = np.gradient(way, axis=0) if len(way) > 2 else np.repeat(np.diff(way, axis=0), 2, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        axis = np.eye(3)[np.argmin(np.abs(along[0]))]
        rings = []
        for place, direction in zip(way, along, strict=True):
            axis = axis - (axis @ direction) * direction
            axis /= np.linalg.norm(axis)
            out = np.cos(turn)[:, None] * axis + np.sin(turn)[:, None] * np.cross(direction, axis)
            rings.append((place + radius * out, out))
        points += [ring for ring, _ in rings] + [rings[0][0], rings[-1][0]]
        normals += [out for _, out in rings] + [
            np.tile(-along[0], (SIDES, 1)),
            np.tile(along[-1], (SIDES, 1)),
        ]
        for k in range(len(way) - 1):
            a, b = count + k * SIDES, count + (k + 1) * SIDES
            triangles += [
                np.column_stack([a + around, a + ahead, b + ahead]),
                np.column_stack([a + around, b + ahead, b + around]),
            ]
        first = count + len(way) * SIDES
        fan = np.column_stack([np.zeros(SIDES - 2, dtype=np.int64), around[1:-1], around[2:]])
        triangles += [first + fan[:, ::-1], first + SIDES + fan]
        count += (len(way) + 2) * SIDES
    return np.vstack(points), np.vstack(normals), np.vstack(triangles)
