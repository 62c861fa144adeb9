"""Meshes that other programs wrote; the door to meshio."""

from __future__ import annotations

from pathlib import Path

import meshio
import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError
from shellform.surface.target import Surface, make_surface
from shellform.surface.units import turned_up, unit_factor

FORMATS = (".stl", ".obj", ".ply", ".off", ".vtk", ".vtu", ".msh")


def read_mesh(path: str | Path, *, unit: str = "m", up: str = "z") -> Surface:
    """The surface of a mesh file whose coordinates are in `unit` and whose vertical axis is `up`, "z" or "y".

    Quadrilaterals and polygons are cut into triangles without moving a vertex. Raises InputError for what can't be used.
    """
    file = Path(path)
    factor = unit_factor(unit)
    if not file.is_file():
        raise InputError("there is no such file", where=str(file))
    if file.suffix.lower() not in FORMATS:
        raise InputError(
            "isn't a mesh format that is read here",
            where=str(file),
            value=file.suffix,
            remedy=f"Known: {', '.join(FORMATS)}.",
        )
    try:
        mesh = meshio.read(file)
    except (Exception, SystemExit) as error:  # meshio raises whatever its readers stumble over, and even exits
        raise InputError(
            f"can't be read as {file.suffix}: {error or type(error).__name__}",
            where=str(file),
            remedy="Check that the file is whole and that its ending fits its content.",
        ) from error
    points = np.asarray(mesh.points, dtype=float)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
        raise InputError("holds no points", where=str(file))
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    if not np.isfinite(points).all():
        vertex = int(np.argmin(np.isfinite(points).all(axis=1)))
        raise InputError(
            f"vertex {vertex} has a coordinate that is no number", where=str(file), remedy="Export the mesh anew."
        )
    triangles = [
        _triangles(points, np.asarray(block.data))
        for block in mesh.cells
        if block.type in ("triangle", "quad", "polygon") or block.type.startswith("polygon")
    ]
    if not sum(len(each) for each in triangles):
        raise InputError("holds no faces, only points or lines", where=str(file), remedy="Export the surface as a mesh.")
    return make_surface(factor * turned_up(points, up), np.vstack(triangles), source=str(file))


def write_mesh(path: str | Path, surface: Surface) -> None:
    """Writes the triangles in metres, in the format of the path's ending."""
    meshio.Mesh(surface.vertices, [("triangle", surface.triangles)]).write(path)


def _triangles(points: Reals, faces: Indices) -> Indices:
    """Triangles (t, 3) of polygons (f, k): quadrilaterals along the diagonal that folds less, others as fans."""
    if faces.shape[1] == 3:
        return faces.astype(np.int64)
    if faces.shape[1] > 4:
        fan = [faces[:, [0, k, k + 1]] for k in range(1, faces.shape[1] - 1)]
        return np.vstack(fan).astype(np.int64)
    first = np.stack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]], axis=1)
    second = np.stack([faces[:, [0, 1, 3]], faces[:, [1, 2, 3]]], axis=1)
    flatter = (_fold(points, first) >= _fold(points, second))[:, None, None]
    return np.where(flatter, first, second).reshape(-1, 3).astype(np.int64)


def _fold(points: Reals, pairs: Indices) -> Reals:
    """Cosine (f,) of the angle between the normals of two triangles each (f, 2, 3)."""
    corner = points[pairs]
    normal = np.cross(corner[:, :, 1] - corner[:, :, 0], corner[:, :, 2] - corner[:, :, 0])
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    return np.asarray(np.sum(normal[:, 0] * normal[:, 1], axis=1))
