"""Makes shells as strangers bring them, and prints what `shellform` makes of each: the corpus of unattended
work.

The forms are classic ones, computed with NumPy alone and written by hand or through trimesh, meshio, rhino3dm
and (two STEP files) Open CASCADE, in m, mm, cm, in and ft, z up and y up; every file is the same at each run.
Files of others can be added by `--files`.

Run: PYTHONPATH=. python scripts/strangers.py FOLDER [--files OTHER ...] [--only NAME ...] [--limit 120]
     [--processor 150] [--rows FILE]
     [--do make check net new design] [--until safety] [--quick] [--way-out]
 or: PYTHONPATH=. python scripts/strangers.py --report FILE ...
prints the documentation's table of the rows in files that `--rows` wrote, the last one of each shell and
step. Each row says of which build it is: a digest of the package's modules.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import math
import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gmsh
import meshio
import numpy as np
import rhino3dm
import scipy.sparse as sp
import scipy.sparse.linalg as spl
import trimesh

ROOT = Path(__file__).parent.parent
CROSSINGS = 185
METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "ft": 0.3048}
READABLE = (".obj", ".off", ".ply", ".stl", ".glb", ".gltf", ".3dm", ".step", ".json")


@dataclass(frozen=True)
class Mesh:
    """`points` (v, 3), m, z up, and `quads` (q, 4); a triangle repeats its last corner."""

    points: np.ndarray
    quads: np.ndarray

    @property
    def triangles(self) -> np.ndarray:
        """(t, 3)."""
        both = np.vstack([self.quads[:, [0, 1, 2]], self.quads[:, [0, 2, 3]]])
        return both[(both[:, 0] != both[:, 1]) & (both[:, 1] != both[:, 2]) & (both[:, 2] != both[:, 0])]


@dataclass(frozen=True)
class Stranger:
    """A form, how it is written and in what unit and axis; the options that a person would give with it."""

    name: str
    form: Callable[[], Mesh]
    ending: str
    write: Callable[[Path, Mesh], None]
    unit: str = "m"
    up: str = "z"

    def make(self, folder: Path) -> Path:
        """Writes the file."""
        mesh = self.form()
        points = mesh.points / METRES[self.unit]
        if self.up == "y":
            points = np.column_stack([points[:, 0], points[:, 2], -points[:, 1]])
        file = folder / f"{self.name}{self.ending}"
        self.write(file, Mesh(points, mesh.quads))
        return file

    @property
    def options(self) -> list[str]:
        """Of the command line: which axis is vertical is to be found."""
        stated = self.ending in (".3dm", ".step", ".glb")
        return [] if self.unit == "m" or stated else ["--unit", self.unit]


# ---------------------------------------------------------------------------------------------- meshes


def lattice(u: np.ndarray, v: np.ndarray, place: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Mesh:
    """The quads of a parameter grid, `place` giving (n, 3) for (n,) and (n,)."""
    a, b = (each.ravel() for each in np.meshgrid(u, v, indexing="ij"))
    return Mesh(place(a, b), _quads(len(u), len(v)))


def _quads(rows: int, columns: int) -> np.ndarray:
    i = np.arange(rows * columns).reshape(rows, columns)
    return np.column_stack([i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()])


def height(
    wide: float, deep: float, z: Callable[[np.ndarray, np.ndarray], np.ndarray], count: int = 28
) -> Mesh:
    """A height over the rectangle `wide` × `deep` about the origin."""
    u, v = np.linspace(-wide / 2, wide / 2, count + 1), np.linspace(-deep / 2, deep / 2, count + 1)
    return lattice(u, v, lambda x, y: np.column_stack([x, y, z(x, y)]))


def disc(
    radius: float, z: Callable[[np.ndarray, np.ndarray], np.ndarray], inner: float = 0.0, rings: int = 14
) -> Mesh:
    """A height over a circle, mapped from a square (no pole), or over a ring."""
    if inner:
        u, v = np.linspace(inner, radius, rings + 1), np.linspace(0.0, 2 * math.pi, 6 * rings + 1)
        mesh = lattice(
            u,
            v,
            lambda r, t: np.column_stack([r * np.cos(t), r * np.sin(t), z(r * np.cos(t), r * np.sin(t))]),
        )
        return closed_round(mesh, len(u), len(v))

    def mapped(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        x, y = radius * a * np.sqrt(1 - b * b / 2), radius * b * np.sqrt(1 - a * a / 2)
        return np.column_stack([x, y, z(x, y)])

    side = np.linspace(-1.0, 1.0, 2 * rings + 1)
    return lattice(side, side, mapped)


def closed_round(mesh: Mesh, rows: int, columns: int) -> Mesh:
    """The last column of a lattice made the first."""
    number = np.arange(rows * columns).reshape(rows, columns)
    number[:, -1] = number[:, 0]
    return without(Mesh(mesh.points, number.ravel()[mesh.quads]), np.ones(len(mesh.quads), dtype=bool))


def without(mesh: Mesh, kept: np.ndarray) -> Mesh:
    """The quads that are `kept` (q,), and their points."""
    quads = mesh.quads[kept]
    used = np.unique(quads)
    return Mesh(mesh.points[used], np.searchsorted(used, quads))


def where(mesh: Mesh, inside: Callable[[np.ndarray, np.ndarray], np.ndarray]) -> Mesh:
    """The quads whose middle lies `inside` in plan."""
    middle = mesh.points[mesh.quads].mean(axis=1)
    return without(mesh, inside(middle[:, 0], middle[:, 1]))


def hung(mesh: Mesh, held: np.ndarray, rise: float) -> Mesh:
    """The mesh raised as a soap film under constant pressure, `held` (v,) vertices at 0: Isler's bubbles."""
    n = len(mesh.points)
    edges = np.vstack([mesh.quads[:, [k, (k + 1) % 4]] for k in range(4)])
    links = sp.coo_array((np.ones(len(edges)), edges.T), shape=(n, n)).tocsr()
    links = ((links + links.T) > 0).astype(float)
    free = np.flatnonzero(~held)
    laplace = sp.diags_array(np.asarray(links.sum(axis=0)).ravel()) - links
    z = np.zeros(n)
    z[free] = spl.spsolve(laplace.tocsc()[free][:, free], np.ones(len(free)))
    return Mesh(np.column_stack([mesh.points[:, :2], rise * z / z.max()]), mesh.quads)


def corners_of(mesh: Mesh, places: Sequence[tuple[float, float]], reach: float) -> np.ndarray:
    """Which vertices (v,) lie within `reach` of one of the `places`."""
    away = [np.hypot(mesh.points[:, 0] - x, mesh.points[:, 1] - y) for x, y in places]
    return np.asarray(np.min(away, axis=0) <= reach)


# ---------------------------------------------------------------------------------------------- forms


def sphere(radius: float) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
    return lambda x, y: np.sqrt(np.maximum(radius**2 - x**2 - y**2, 0.0))


def bumps(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    hills = ((-6, -2, 4.0, 5.0), (5, 3, 3.0, 4.5), (1, -5, 2.0, 4.0))
    return np.sum([h * np.exp(-((x - a) ** 2 + (y - b) ** 2) / (2 * w * w)) for a, b, h, w in hills], axis=0)


def groined(count: int, radius: float) -> Mesh:
    """Candela's groined hypars: `count` lobes, groins between them that rise to the middle."""

    def place(r: np.ndarray, t: np.ndarray) -> np.ndarray:
        lobe = 2 * math.pi / count
        at = np.abs((t + lobe / 2) % lobe - lobe / 2)  # from the lobe's axis
        z = 0.30 * radius + 0.10 * r * (r / radius) - 0.55 * r * (at / (lobe / 2)) ** 2 * (r / radius)
        return np.column_stack([r * np.cos(t), r * np.sin(t), z])

    u, v = np.linspace(0.0, radius, 15), np.linspace(0.0, 2 * math.pi, 12 * count + 1)
    mesh = closed_round(lattice(u, v, place), len(u), len(v))
    at_pole = np.hypot(*mesh.points[:, :2].T) < 1e-9
    number = np.where(at_pole, np.argmax(at_pole), np.arange(len(mesh.points)))
    quads = number[mesh.quads]
    quads = np.where((quads[:, [0]] == quads[:, [3]]), np.column_stack([quads[:, :3], quads[:, 2]]), quads)
    return without(Mesh(mesh.points, quads), np.ones(len(quads), dtype=bool))


def arched(width: float, length: float, rise: float) -> Mesh:
    """A barrel whose section is a circle's arc."""
    radius = (rise**2 + (width / 2) ** 2) / (2 * rise)
    most = (
        math.asin(min(width / 2 / radius, 1.0)) if rise <= radius else math.pi - math.asin(width / 2 / radius)
    )
    u, v = np.linspace(-most, most, 25), np.linspace(-length / 2, length / 2, 33)
    return lattice(
        u,
        v,
        lambda t, y: np.column_stack([radius * np.sin(t), y, radius * np.cos(t) - radius + rise]),
    )


def four_points(side: float, rise: float) -> Mesh:
    flat = height(side, side, lambda x, y: 0 * x)
    places = [(sx * side / 2, sy * side / 2) for sx in (-1, 1) for sy in (-1, 1)]
    return hung(flat, corners_of(flat, places, 0.09 * side), rise)


def three_points(side: float, rise: float) -> Mesh:
    a = side / math.sqrt(3.0)
    corners = [(a * math.cos(t), a * math.sin(t)) for t in (math.pi / 2, 7 * math.pi / 6, 11 * math.pi / 6)]
    count = 24
    index: dict[tuple[int, int], int] = {}
    points = []
    for i in range(count + 1):
        for j in range(count + 1 - i):
            share = np.array([i, j, count - i - j]) / count
            index[i, j] = len(points)
            points.append([*(share @ np.array(corners)), 0.0])
    quads = []
    for i, j in index:
        if (i + 1, j + 1) in index:
            quads.append([index[i, j], index[i + 1, j], index[i + 1, j + 1], index[i, j + 1]])
        elif i + j < count:
            quads.append([index[i, j], index[i + 1, j], index[i, j + 1], index[i, j + 1]])
    flat = Mesh(np.array(points), np.array(quads))
    return hung(flat, corners_of(flat, corners, 0.12 * side), rise)


def on_plan(
    wide: float, deep: float, inside: Callable[..., np.ndarray], rise: float, count: int = 32
) -> Mesh:
    """A bubble over any plan, held all round."""
    mesh = where(height(wide, deep, lambda x, y: 0 * x, count), inside)
    edges = np.sort(np.vstack([mesh.quads[:, [k, (k + 1) % 4]] for k in range(4)]), axis=1)
    pairs, times = np.unique(edges, axis=0, return_counts=True)
    held = np.zeros(len(mesh.points), dtype=bool)
    held[pairs[times == 1].ravel()] = True
    return hung(mesh, held, rise)


def torus(major: float, minor: float, about: float, across: float) -> Mesh:
    u, v = np.linspace(-about / 2, about / 2, 33), np.linspace(-across / 2, across / 2, 25)
    return lattice(
        u,
        v,
        lambda t, s: np.column_stack(
            [
                (major + minor * np.sin(s)) * np.cos(t) - major,
                (major + minor * np.sin(s)) * np.sin(t),
                minor * np.cos(s) - minor * math.cos(across / 2),
            ]
        ),
    )


def noisy(mesh: Mesh, size: float) -> Mesh:
    noise = np.random.default_rng(7).normal(scale=size, size=len(mesh.points))
    return Mesh(mesh.points + noise[:, None] * [0.0, 0.0, 1.0], mesh.quads)


def turned(mesh: Mesh, angle: float, shift: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    c, s = math.cos(angle), math.sin(angle)
    return Mesh(mesh.points @ np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) + shift, mesh.quads)


# ---------------------------------------------------------------------------------------------- writers


def _polygon(quad: Sequence[int]) -> list[int]:
    return list(dict.fromkeys(int(each) for each in quad))


def to_obj(file: Path, mesh: Mesh) -> None:
    lines = ["# by hand", "o shell", *(f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.points)]
    lines += ["f " + " ".join(f"{k + 1}" for k in _polygon(quad)) for quad in mesh.quads]
    file.write_text("\n".join(lines) + "\n")


def to_off(file: Path, mesh: Mesh) -> None:
    lines = ["OFF", f"{len(mesh.points)} {len(mesh.quads)} 0"]
    lines += [f"{x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.points]
    lines += [f"{len(_polygon(q))} " + " ".join(map(str, _polygon(q))) for q in mesh.quads]
    file.write_text("\n".join(lines) + "\n")


def to_meshlab_ply(file: Path, mesh: Mesh) -> None:
    """Text as MeshLab writes it with texture coordinates and quality: a list of floats a face."""
    head = f"""ply
format ascii 1.0
comment VCGLIB generated
comment TextureFile none.png
element vertex {len(mesh.points)}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property uchar alpha
property float quality
element face {len(mesh.quads)}
property list uchar int vertex_indices
property list uchar float texcoord
property float quality
end_header
"""
    lines = [f"{x:.9g} {y:.9g} {z:.9g} 200 200 200 255 0.5" for x, y, z in mesh.points]
    for quad in mesh.quads:
        face = _polygon(quad)
        lines.append(f"{len(face)} {' '.join(map(str, face))} {2 * len(face)} {'0.25 ' * (2 * len(face))}1")
    file.write_text(head + "\n".join(lines) + "\n")


def to_rhino_ply(file: Path, mesh: Mesh) -> None:
    """Binary, big endian, with normals and a table of materials, as Rhino and 3ds Max write."""
    head = f"""ply
format binary_big_endian 1.0
obj_info made by hand
element vertex {len(mesh.points)}
property double x
property double y
property double z
property float nx
property float ny
property float nz
element material 1
property uchar ambient_red
property list uchar float gloss
property double ambient_coeff
element face {len(mesh.quads)}
property list uint16 uint32 vertex_index
property int material_index
end_header
"""
    data = np.zeros(len(mesh.points), [("p", ">f8", 3), ("n", ">f4", 3)])
    data["p"], data["n"] = mesh.points, [0.0, 0.0, 1.0]
    material = np.array([7, 2], "u1").tobytes() + np.array([1.0, 2.0], ">f4").tobytes()
    rest = material + np.array([0.5], ">f8").tobytes()
    for quad in mesh.quads:
        face = _polygon(quad)
        rest += np.array([len(face)], ">u2").tobytes() + np.array(face, ">u4").tobytes() + b"\0\0\0\0"
    file.write_bytes(head.encode() + data.tobytes() + rest)


def to_trimesh(file: Path, mesh: Mesh) -> None:
    trimesh.Trimesh(mesh.points, mesh.triangles, process=False).export(file)


def to_meshio(file: Path, mesh: Mesh) -> None:
    meshio.Mesh(mesh.points, [("triangle", mesh.triangles)]).write(file)


def to_compas(file: Path, mesh: Mesh) -> None:
    tables = {
        "dtype": "compas.datastructures/Mesh",
        "data": {
            "attributes": {"name": "shell"},
            "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "default_edge_attributes": {},
            "default_face_attributes": {},
            "vertex": {str(k): dict(zip("xyz", p, strict=True)) for k, p in enumerate(mesh.points.tolist())},
            "face": {str(k): _polygon(quad) for k, quad in enumerate(mesh.quads)},
            "facedata": {},
            "edgedata": {},
        },
    }
    file.write_text(json.dumps(tables))


def to_rhino(unit: str) -> Callable[[Path, Mesh], None]:
    def write(file: Path, mesh: Mesh) -> None:
        model = rhino3dm.File3dm()
        model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
        shape = rhino3dm.Mesh()
        for x, y, z in mesh.points.tolist():
            shape.Vertices.Add(x, y, z)
        for quad in mesh.quads.tolist():
            shape.Faces.AddFace(*quad)
        model.Objects.Add(shape)
        model.Write(str(file), 7)

    return write


def to_step(file: Path, mesh: Mesh) -> None:
    """A B-spline through the points of a square lattice, in Open CASCADE's millimetres."""
    count = math.isqrt(len(mesh.points))
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        tags = [gmsh.model.occ.addPoint(*p) for p in mesh.points.tolist()]
        gmsh.model.occ.addBSplineSurface(tags, count)
        gmsh.model.occ.remove([(0, tag) for tag in tags])
        gmsh.model.occ.synchronize()
        gmsh.write(str(file))
    finally:
        gmsh.finalize()


# ---------------------------------------------------------------------------------------------- the corpus

QUARTER = [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)]
STRANGERS = (
    Stranger("umbrella_hypar", lambda: height(12, 12, lambda x, y: 2.4 * (1 - np.abs(x / 6)) * (1 - np.abs(y / 6))), ".obj", to_obj),
    Stranger("inverted_umbrella", lambda: height(10, 10, lambda x, y: 2 * np.abs(x / 5) + 2 * np.abs(y / 5) - 2 * np.abs(x * y / 25)), ".ply", to_meshlab_ply, "ft"),
    Stranger("groined_hypar_8", lambda: groined(8, 15.0), ".ply", to_rhino_ply),
    Stranger("groined_hypar_4", lambda: groined(4, 8.0), ".obj", to_obj, "cm"),
    Stranger("cross_vault", lambda: height(8, 8, lambda x, y: np.maximum(3 - 3 * (x / 4) ** 2, 3 - 3 * (y / 4) ** 2)), ".off", to_off),
    Stranger("cross_vault_soft", lambda: height(16, 16, lambda x, y: 0.5 * np.log(np.exp(2 * (5 - 5 * (x / 8) ** 2)) + np.exp(2 * (5 - 5 * (y / 8) ** 2)))), ".json", to_compas),
    Stranger("barrel_low", lambda: arched(10, 16, 2.5), ".stl", to_trimesh, "mm"),
    Stranger("barrel_half_round", lambda: arched(6, 9, 2.9), ".obj", to_obj, "ft"),
    Stranger("tunnel_60", lambda: arched(12, 60, 4.5), ".ply", to_trimesh),
    Stranger("tunnel_y_up", lambda: arched(4, 7, 1.6), ".obj", to_obj, "cm", "y"),
    Stranger("sail_vault", lambda: height(15, 15, lambda x, y: sphere(13)(x, y) - 7.3), ".off", to_off),
    Stranger("cap_small_cm", lambda: disc(0.25, lambda x, y: sphere(0.35)(x, y) - 0.24), ".stl", to_trimesh, "cm"),
    Stranger("cap_oculus", lambda: disc(10, lambda x, y: sphere(13)(x, y) - 8.3, inner=2.5), ".obj", to_obj),
    Stranger("cap_flat_60", lambda: disc(30, lambda x, y: sphere(110)(x, y) - 105.8), ".ply", to_meshio),
    Stranger("dome_ellipsoid", lambda: disc(1, lambda x, y: 3 * sphere(1.25)(x, y) - 2.25).__class__(disc(1, lambda x, y: 3 * sphere(1.25)(x, y) - 2.25).points * [9, 6, 1], disc(1, lambda x, y: 0 * x).quads), ".glb", to_trimesh, "m", "y"),
    Stranger("hemisphere", lambda: disc(5, sphere(5.02)), ".obj", to_obj),
    Stranger("dome_on_four_points", lambda: four_points(15, 4.0), ".ply", to_meshlab_ply, "mm"),
    Stranger("dome_on_four_points_low", lambda: four_points(24, 4.0), ".3dm", to_rhino("Meters")),
    Stranger("shell_on_three_points", lambda: three_points(26, 4.5), ".obj", to_obj),
    Stranger("saddle_straight_edges", lambda: height(6, 6, lambda x, y: 0.1 * x * y + 1), ".step", to_step, "mm"),
    Stranger("saddle_round", lambda: disc(12, lambda x, y: (x**2 - y**2) / 60 + 3), ".3dm", to_rhino("Feet"), "ft"),
    Stranger("saddle_monkey", lambda: disc(6, lambda x, y: (x**3 - 3 * x * y**2) / 160 + 2), ".off", to_off),
    Stranger("ridge_roof", lambda: height(14, 10, lambda x, y: 3 - 0.45 * np.abs(x)), ".obj", to_obj),
    Stranger("folded_plates", lambda: height(20, 12, lambda x, y: 1.2 * np.abs(((x / 5) % 1) - 0.5)), ".stl", to_trimesh),
    Stranger("creased_dome", lambda: height(9, 9, lambda x, y: 3 - 0.04 * (x**2 + y**2) - 0.15 * np.abs(x)), ".ply", to_meshlab_ply),
    Stranger("elliptic_paraboloid", lambda: height(9, 6, lambda x, y: 2.2 - 1.2 * (x / 4.5) ** 2 - (y / 3) ** 2), ".ply", to_rhino_ply, "in"),
    Stranger("elliptic_paraboloid_60", lambda: height(60, 40, lambda x, y: 11 - 6 * (x / 30) ** 2 - 5 * (y / 20) ** 2), ".glb", to_trimesh, "m", "y"),
    Stranger("translational_waves", lambda: height(40, 25, lambda x, y: 5 + 1.8 * np.cos(x / 6) + 1.4 * np.cos(y / 5)), ".off", to_off),
    Stranger("translational_mixed", lambda: height(30, 18, lambda x, y: 4 - 3 * (x / 15) ** 2 + 1.5 * (y / 9) ** 2), ".json", to_compas, "mm"),
    Stranger("cone", lambda: disc(5, lambda x, y: 2.5 - 0.5 * np.hypot(x, y)), ".obj", to_obj),
    Stranger("cone_cut", lambda: disc(5, lambda x, y: 2.5 - 0.5 * np.hypot(x, y), inner=1.2), ".stl", to_trimesh, "ft"),
    Stranger("conoid", lambda: height(12, 8, lambda x, y: (0.3 + 0.7 * (x + 6) / 12) * 2.5 * (1 - (y / 4) ** 2)), ".obj", to_obj, "in"),
    Stranger("blob", lambda: disc(12, bumps), ".glb", to_trimesh, "m", "y"),
    Stranger("blob_with_opening", lambda: where(height(24, 20, bumps, 36), lambda x, y: np.hypot(x - 1.5, y - 2.0) > 2.4), ".obj", to_obj, "m", "y"),
    Stranger("half_dome_canopy", lambda: where(disc(8, lambda x, y: sphere(9)(x, y) - 4.1), lambda x, y: y > 0), ".ply", to_trimesh),
    Stranger("shell_two_free_edges", lambda: height(12, 8, lambda x, y: (2.5 + 0.02 * x**2) * (1 - (y / 4) ** 2)), ".off", to_off, "mm"),
    Stranger("torus_arch", lambda: torus(18, 6, 1.2, 1.7), ".3dm", to_rhino("Millimeters"), "mm"),
    Stranger("hyperboloid_funnel", lambda: disc(7, lambda x, y: 1.6 * np.arccosh(np.maximum(np.hypot(x, y), 1.6) / 1.6), inner=2.2), ".ply", to_meshio, "cm"),
    Stranger("corrugated", lambda: height(30, 15, lambda x, y: 3 + 0.7 * np.cos(x * 1.0) - 2.5 * (y / 7.5) ** 2, 60), ".obj", to_obj),
    Stranger("bubble_l_plan", lambda: on_plan(14, 14, lambda x, y: (x < 0) | (y < 0), 3.0), ".obj", to_obj),
    Stranger("bubble_star_plan", lambda: on_plan(20, 20, lambda x, y: np.hypot(x, y) < 7 + 2.5 * np.cos(5 * np.arctan2(y, x)), 3.5, 40), ".json", to_compas),
    Stranger("bubble_square", lambda: on_plan(1.0, 0.8, lambda x, y: x < 9, 0.22), ".step", to_step, "mm"),
    Stranger("paraboloid_turned", lambda: turned(height(18, 9, lambda x, y: 3 - 2 * (x / 9) ** 2 - (y / 4.5) ** 2), 0.5, (430000.0, 81000.0, 400.0)), ".obj", to_obj),
    Stranger("model_half_metre", lambda: height(0.5, 0.4, lambda x, y: 0.12 - 1.1 * x**2 - 0.9 * y**2), ".stl", to_trimesh, "in"),
    Stranger("scan_noisy", lambda: noisy(disc(4, lambda x, y: sphere(5)(x, y) - 3), 0.004), ".ply", to_meshlab_ply),
    Stranger("coarse_dome", lambda: height(10, 10, lambda x, y: 3 - 0.05 * (x**2 + y**2), 5), ".off", to_off),
)  # fmt: skip


# ---------------------------------------------------------------------------------------------- measuring


@dataclass(frozen=True)
class Ended:
    """How a command ended: `status` (None: broken off), what it `printed`, its last `words`, the `seconds`
    that it took, and those of processors."""

    status: int | None
    printed: str
    words: str
    seconds: float
    processor: float


def ran(arguments: Sequence[str], limit: float, log: Path, processor: float | None = None) -> Ended:
    """`shellform` with these arguments, given `limit` s, and `processor` s of a processor for each of its
    processes; what it started is ended with it, and what it said stays in the `log`."""
    began, before = time.perf_counter(), _processor()
    with log.open("w", encoding="utf-8") as said:
        child = subprocess.Popen(
            [sys.executable, "-m", "shellform", *arguments],
            stdout=subprocess.PIPE,
            stderr=said,
            text=True,
            start_new_session=True,
            preexec_fn=None if processor is None else lambda: _allowed(processor),
        )
        try:
            printed, _ = child.communicate(timeout=limit)
            status = None if child.returncode in (-signal.SIGKILL, -signal.SIGXCPU) else child.returncode
        except subprocess.TimeoutExpired:
            os.killpg(child.pid, signal.SIGKILL)
            printed, _ = child.communicate()
            status = None
    lines = log.read_text(encoding="utf-8").strip().splitlines()
    took = time.perf_counter() - began
    return Ended(status, printed, lines[-1] if lines else "", took, _processor() - before)


def _allowed(processor: float) -> None:
    resource.setrlimit(resource.RLIMIT_CPU, (math.ceil(processor), math.ceil(processor)))


def _processor() -> float:
    """s, of all that were started and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def measured(
    file: Path,
    options: Sequence[str],
    folder: Path,
    do: Sequence[str],
    limit: float,
    quick: Sequence[str] = (),
    until: str = "safety",
    processor: float | None = None,
    way_out: Sequence[str] = (),
) -> dict[str, Any]:
    """One row: what each of the steps in `do` came to; `design` with the further options `quick`, `new` with
    those that let it take a `way_out`."""
    row: dict[str, Any] = {"name": file.name, "build": build()}
    logs = folder / "logs"
    logs.mkdir(exist_ok=True)

    def log(step: str) -> Path:
        return logs / f"{file.name}.{step}.txt"

    if "check" in do or "net" in do:
        check = ran(["check", str(file), *options, "--json"], limit, log("check"))
        row |= {"check": check.status, "reason": check.words if check.status else ""}
        if check.status != 0:
            return row
        found = json.loads(check.printed)
        row |= {"area": found["area"], "size": " × ".join(f"{x:.3g}" for x in found["size"])}
    if "net" in do:
        spacing = float(f"{math.sqrt(row['area'] / CROSSINGS):.2g}")
        out = folder / "runs" / file.name
        command = ["net", str(file), *options, "--spacing", str(spacing), "--angle", "auto"]
        net = ran([*command, "--output", str(out), "--json"], limit, log("net"))
        row |= {"net": net.status, "reason": net.words, "spacing": spacing, "seconds": net.seconds}
        if net.status == 0:
            told = json.loads(net.printed)["net"]
            row |= {
                "reason": f"attempts: {sum('attempt' in note for note in told['notes'])}",
                "crossings": told["crossings"],
                "distance": told["distance_max"] / spacing,
                "error": told["spacing_error_max"],
            }
    for step in ("new", "design"):
        if step not in do:
            continue
        case = folder / "cases" / f"{file.stem}.toml"
        case.parent.mkdir(exist_ok=True)
        if step == "new":
            case.unlink(missing_ok=True)
        arguments = (
            ["new", str(file), *options, *way_out, "--output", str(case)]
            if step == "new"
            else [
                "design",
                str(case),
                "--output",
                str(folder / "designs" / file.stem),
                "--quiet",
                "--json",
                "--until",
                until,
                *quick,
            ]
        )
        ended = ran(arguments, limit, log(step), processor)
        row |= {step: ended.status, "reason": ended.words if ended.status else row.get("reason", "")}
        row[f"{step}_seconds"], row[f"{step}_processor"] = ended.seconds, ended.processor
        row |= proposed(ended.printed) if step == "new" else designed(ended.printed)
        if ended.status != 0:
            break
    return row


def proposed(printed: str) -> dict[str, Any]:
    """Columns of what `new` told: lines of a label of up to 22 letters, two spaces, and its value."""
    lines = (line[:22].strip() and (line[:22].strip(), line[24:].strip()) for line in printed.splitlines())
    told = dict(each for each in lines if each)
    shown = {"rods": "section", "concrete": "concrete", "spacing": "proposed"}
    found = {
        name: re.split(r" \(equation|, |: ", told[label])[0] for label, name in shown.items() if label in told
    }
    crossings = re.search(r"(\d+) crossings$", told.get("spacing", ""))
    found |= {"crossings": crossings[1]} if crossings else {}
    return found | ({"way_out": told["way out"]} if "way out" in told else {})


def designed(printed: str) -> dict[str, Any]:
    """Columns of what `design` came to."""
    if not printed.strip():
        return {}
    summary = json.loads(printed)
    verdict = summary.get("verdict") or {}
    built = summary["designs"][verdict.get("design", list(summary["designs"])[-1])]
    loads = {name: built["loads"][name] for name in ("design", "additional")}
    stands = {name: row.get("stands") or {} for name, row in loads.items()}
    return {
        "holds": verdict.get("holds"),
        "fails": ", ".join(verdict.get("failed", [])),
        "cables": f"{built['cables']} of {summary['model']['cables']}",
        "deviation": loads["design"]["deviation_max"],
        "stands": " and ".join(f"{each['standing']} of {each['drawn']}" for each in stands.values() if each),
        "factor": loads["design"].get("critical_factor_halved"),
    }


def build() -> str:
    """Eight letters that tell the package's modules from others."""
    digest = hashlib.sha256()
    for file in sorted((ROOT / "shellform").rglob("*.py")):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:8]


def report(files: Sequence[Path]) -> str:
    """The documentation's table of the rows in the files: the last one of each shell and step; none of
    designs of another case than the last that `new` wrote."""
    proposals: dict[str, dict[str, Any]] = {}
    designs: dict[str, dict[str, Any]] = {}
    latest = ""
    for line in (line for file in files for line in file.read_text(encoding="utf-8").splitlines()):
        row = json.loads(line)
        name, latest = row["name"], row.get("build", latest)
        if "new" in row:
            before = proposals.get(name, {})
            if any(
                before.get(key) != row.get(key)
                for key in ("new", "section", "proposed", "crossings", "way_out")
            ):
                designs.pop(name, None)
            proposals[name] = row
        if "design" in row:
            designs[name] = row
    rows = [reported(row, designs.get(name, {}), latest) for name, row in proposals.items()]
    lines = [f"| {' | '.join(rows[0])} |", "| --- " * len(rows[0]) + "|"]
    lines += [f"| {' | '.join(each.values())} |" for each in rows]
    ends = [each["ends with"].strip("*") for each in rows]
    told = ", ".join(f"{ends.count(end)} {end}" for end in sorted(set(ends)))
    return "\n".join(
        [
            *lines,
            "",
            f"{len(rows)} shells: {told}. ¹: of an earlier build than {latest}; ²: of one that wasn't recorded.",
        ]
    )


def reported(new: dict[str, Any], design: dict[str, Any], latest: str) -> dict[str, str]:
    """The cells of a shell in the documentation's table."""
    section = str(new.get("section", ""))
    double = section.startswith("2 layers of ")

    def used(row: dict[str, Any], step: str) -> str:
        mark = "" if row.get("build") == latest else " ¹" if "build" in row else " ²"
        return f"{row[f'{step}_processor']:.0f}{mark}" if f"{step}_processor" in row else ""

    if new["new"] != 0:
        ends = "broken off" if new["new"] is None else "refused"
    elif not design:
        ends = "case, not designed"
    else:
        ends = {True: "**holds**", False: "does not hold"}.get(design.get("holds"), "design broken off")  # type: ignore[call-overload]
        ends += ", by its way out" if new.get("way_out") else ""
    factor = design.get("factor")
    fails = f"fails: {design['fails']}" if design.get("fails") else ""
    refused = shortened(str(new.get("reason", ""))) if ends in ("broken off", "refused") else ""
    return {
        "file": new["name"],
        "net": f"{new['crossings']} at {new['proposed']}" if "proposed" in new else "",
        "section": section.removeprefix("2 layers of "),
        "layers": ("2" if double else "1") if section else "",
        "concrete": str(new.get("concrete", "")),
        "cables": str(design.get("cables", "")),
        "deviation, mm": f"{1e3 * design['deviation']:.1f}" if "deviation" in design else "",
        "factor": ("3 or more" if factor >= 3.0 else f"{factor:.2f}") if factor else "",
        "stand at 1 and 1.2": str(design.get("stands", "")),
        "`new`, s": used(new, "new"),
        "`design`, s": used(design, "design"),
        "ends with": ends,
        "said": " ".join(
            filter(None, [fails or refused, taken(new["way_out"]) if new.get("way_out") else ""])
        ),
    }


def shortened(reason: str) -> str:
    """What was said in a line: the reason's first sentence, and the way out."""
    text = re.sub(r"^shellform: (refused: |stopped: )?", "", reason)
    parts = re.split(r"(?<=[a-z0-9%)])[.;] (?=[A-Z]|it is|no surface|\d+ attempts)", text)
    first = re.sub(r"^[^ ]*: (reason: )?", "", parts[0])
    way = taken(text)
    if not way and "no surface near it" in text:
        way = "none found"
    elif not way and "left untried" in text:
        way = "none tried"
    elif not way and len(parts) > 1:
        way = parts[-1].rstrip(".")
    return first[:230] + (f" → {way}" if way else "")


def taken(text: str) -> str:
    """The way out that is offered in a text, if any is."""
    rounded = re.search(r"creases rounded to ([\d.]+ m), ([\d.]+ m) off at most", text)
    if rounded:
        walls = ", on walls" if "with --edges wall)" in text else ""
        return f"rounded to {rounded[1]} ({rounded[2]} off at most){walls}"
    option = re.search(r"With (--[a-z]+ [a-z0-9.]+) this goes on", text)
    return f"`{option[1]}`" if option else ""


def table(rows: Sequence[dict[str, Any]]) -> str:
    """The rows in Markdown, without columns in which nothing stands."""
    steps = [step for step in ("check", "net", "new", "design") if any(step in row for row in rows)]
    named = [cells(row, steps) for row in rows]
    names = [name for name in named[0] if any(each[name] for each in named)] if named else []
    lines = [f"| {' | '.join(names)} |", "| --- " * len(names) + "|"]
    lines += [f"| {' | '.join(each[name] for name in names)} |" for each in named]
    for step in steps:
        lines.append("")
        lines.append(f"{step}: {sum(row.get(step, 1) == 0 for row in rows)} of {len(rows)}")
    return "\n".join(lines)


def cells(row: dict[str, Any], steps: Sequence[str]) -> dict[str, str]:
    """A row's cells by the names of their columns."""
    ends = {
        step: "-" if step not in row else {0: "yes", None: "time"}.get(row[step], f"no ({row[step]})")
        for step in steps
    }
    took = [f"{row[name]:.0f}" for name in ("seconds", "new_seconds", "design_seconds") if name in row]
    used = [f"{row[name]:.0f}" for name in ("new_processor", "design_processor") if name in row]
    return {
        "file": row["name"],
        "size, m": row.get("size", ""),
        **ends,
        "spacing": f"{row['spacing']:.3g}" if "spacing" in row else str(row.get("proposed", "")),
        "crossings": str(row.get("crossings", "")),
        "distance / spacing": f"{100 * row['distance']:.2f} %" if "distance" in row else "",
        "spacing error": f"{100 * row['error']:.2f} %" if "error" in row else "",
        "section": row.get("section", ""),
        "concrete": row.get("concrete", ""),
        "holds": {True: "yes", False: f"no: {row.get('fails')}"}.get(row.get("holds"), ""),  # type: ignore[call-overload]
        "cables": row.get("cables", ""),
        "deviation, mm": f"{1e3 * row['deviation']:.0f}" if "deviation" in row else "",
        "stand at 1.0 and 1.2": row.get("stands", ""),
        "factor": f"{row['factor']:.2f}" if row.get("factor") else "",
        "s": " + ".join(took),
        "processor s": " + ".join(used),
        "said": row.get("reason", "")[:250],
    }


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="?")
    parser.add_argument("--report", type=Path, nargs="+", default=[], help="print the table of such rows")
    parser.add_argument("--files", type=Path, nargs="*", default=[], help="files or folders of others")
    parser.add_argument("--only", nargs="*", default=[], help="names (their beginnings)")
    parser.add_argument("--limit", type=float, default=120.0, help="s for one command")
    parser.add_argument("--processor", type=float, help="s of a processor for one new or design")
    parser.add_argument("--rows", type=Path, help="a file that each row is appended to, as a line of JSON")
    parser.add_argument("--do", nargs="*", default=["check", "net"], help="of check, net, new, design")
    parser.add_argument("--until", default="safety", help="last stage of design")
    parser.add_argument(
        "--quick", action="store_true", help="design: in ten evaluations, eighty structures drawn"
    )
    parser.add_argument(
        "--way-out", action="store_true", help="new: take it where the shell is refused as it is"
    )
    given = parser.parse_args()
    if given.report:
        print(report(given.report))
        return
    if given.folder is None:
        parser.error("a folder is needed")
    quick = QUICK if given.quick else []
    way_out = ["--way-out"] if given.way_out else []
    made = given.folder / "files"
    made.mkdir(parents=True, exist_ok=True)
    corpus = [(each.make(made), each.options) for each in STRANGERS]
    others = [
        file
        for path in (given.files or [ROOT / "surfaces", ROOT / "tests/data"])
        for file in (sorted(path.iterdir()) if path.is_dir() else [path])
        if file.suffix in READABLE
    ]
    corpus += [(file, []) for file in others]
    if given.do == ["make"]:
        return
    rows = []
    for file, options in corpus:
        if given.only and not any(file.stem.startswith(name) for name in given.only):
            continue
        rows.append(
            measured(
                file,
                options,
                given.folder,
                given.do,
                given.limit,
                quick,
                given.until,
                given.processor,
                way_out,
            )
        )
        line = json.dumps(rows[-1], ensure_ascii=False)
        print(line, file=sys.stderr, flush=True)
        if given.rows:
            with given.rows.open("a", encoding="utf-8") as kept:
                print(line, file=kept)
    print(table(rows))


QUICK = [
    f"--set={each}"
    for each in (
        "optimise.evaluations=10",
        "optimise.polish=3",
        "safety.drawn=80",
        "safety.compared=5",
    )
]

if __name__ == "__main__":
    main()
