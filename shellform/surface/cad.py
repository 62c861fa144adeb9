"""Surfaces built or imported in gmsh; the door to gmsh.

A builder script is a Python file with one function `build(gmsh, *, name=default, ...)`, whose keyword arguments are the shell's
named dimensions, m, and which makes the geometry in the current model. Where it has a second function
`form(points, triangles, edge, *, ...)` with the same dimensions, the mesh of what was built is a plan, and `form` returns where
its `points` (v, 3) go; `edge` (v,) tells which lie on its boundary. So a form-found shell is meshed before it is found.

CAD files (STEP, IGES, BREP) come through gmsh's OpenCASCADE, which converts the unit that STEP and IGES files state to metres; a BREP
file has none. OpenCASCADE remembers the last unit asked for beyond gmsh's session, so that every session asks for metres anew.

Vertex normals are the CAD surface's own, summed over the faces that meet at a vertex; across a fold they are its bisector.
"""

from __future__ import annotations

import contextlib
import difflib
import importlib.util
import inspect
import math
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError, ShellformError
from shellform.surface.target import Surface, make_surface
from shellform.surface.units import turned_up, unit_factor

try:
    import gmsh
except (ImportError, OSError) as error:  # a shared library that gmsh's wheel needs isn't there
    raise InputError(
        f"gmsh can't be loaded: {error}",
        remedy="On Debian and Ubuntu: apt-get install libgl1 libglu1-mesa libxrender1 libxcursor1 libxft2 libxinerama1",
    ) from error

FORMATS = (".step", ".stp", ".iges", ".igs", ".brep", ".brp")
_DEFAULT_EDGES = 60.0  # along the longer plan extent
_MOST_TRIANGLES = 2_000_000
_AGREES = 0.95  # cosine between a CAD normal and the triangles around it, below which it is taken for a pole's
_SAMPLES = 33  # points on a curve that tell its extent
_SEWN = 1e-6  # of the size: edges of neighbouring faces nearer than that are one, as CAD programs leave them apart
_IGES_UNITS = 1000.0  # gmsh states millimetres in IGES files and leaves the numbers as they are


def build_surface(script: str | Path, *, size: float, **dimensions: float) -> Surface:
    """The surface that a builder script makes with the named `dimensions`, m, meshed at about `size`, m.

    Raises InputError for a script that can't be read or fails, and for dimensions it doesn't have.
    """
    path = Path(script)
    module = _load(path)
    build = _function(module, "build", path)
    named = _dimensions(build, dimensions, path)
    form = getattr(module, "form", None)
    with _session(), _errors(path, "the script fails", "Check the script and its dimensions."):
        build(gmsh, **named)
        gmsh.model.occ.synchronize()
        points, triangles, normals = _mesh(size, path)
        if form is not None:
            points, normals = form(points, triangles, _on_edge(triangles, len(points)), **named), None
    return make_surface(points, triangles, normals=normals, source=str(path))


def dimensions_of(script: str | Path) -> dict[str, float]:
    """The named dimensions, m, of a builder script and their defaults."""
    path = Path(script)
    return _dimensions(_function(_load(path), "build", path), {}, path)


def import_surface(path: str | Path, *, unit: str | None = None, size: float | None = None, up: str = "z") -> Surface:
    """The surface of a STEP, IGES or BREP file, meshed at about `size`, m (a sixtieth of its plan if left out).

    The unit is the file's own; a BREP file's is `unit` ("m" if left out). `up` is the file's vertical axis, "z" or "y".
    Raises InputError for unreadable files and solids.
    """
    file = Path(path)
    if not file.is_file():
        raise InputError("there is no such file", where=str(file))
    if file.suffix.lower() not in FORMATS:
        raise InputError("isn't a CAD file", where=str(file), remedy=f"Known endings: {', '.join(FORMATS)}.")
    has_unit = file.suffix.lower() not in (".brep", ".brp")
    if has_unit and unit is not None:
        raise InputError(
            f"{file.suffix} files carry their own unit", where="surface.unit", value=unit, remedy="Leave the unit out."
        )
    factor = 1.0 if has_unit else unit_factor(unit or "m")
    turned_up(np.zeros((0, 3)), up)  # refuses an unknown axis before the work
    with _session(), _errors(file, "gmsh can't read it", "Open it in a CAD program and export it anew."):
        _read_shapes(file)
        _refuse_all_but_faces(file)
        if factor != 1.0:
            gmsh.model.occ.dilate(gmsh.model.occ.getEntities(), 0.0, 0.0, 0.0, factor, factor, factor)
        gmsh.model.occ.synchronize()
        plan = np.delete(_extent(), 1 if up == "y" else 2)
        points, triangles, normals = _mesh(float(plan.max()) / _DEFAULT_EDGES if size is None else size, file)
    return make_surface(
        turned_up(points, up), triangles, normals=None if normals is None else turned_up(normals, up), source=str(file)
    )


def write_cad(path: str | Path, script: str | Path, **dimensions: float) -> None:
    """Writes a builder script's geometry as STEP or IGES, in millimetres, or BREP, in metres, whichever the path's ending says.

    Raises InputError for other endings, and for a script with a `form`, whose shell has no CAD geometry.
    """
    file, source = Path(path), Path(script)
    if file.suffix.lower() not in FORMATS:
        raise InputError("isn't a CAD file", where=str(file), remedy=f"Known endings: {', '.join(FORMATS)}.")
    module = _load(source)
    if hasattr(module, "form"):
        raise InputError("is form-found on a mesh, of which there is no CAD file", where=str(source))
    build = _function(module, "build", source)
    named = _dimensions(build, dimensions, source)
    with _session(), _errors(source, "the script fails", "Check the script and its dimensions."):
        build(gmsh, **named)
        if file.suffix.lower() in (".iges", ".igs"):
            gmsh.model.occ.dilate(gmsh.model.occ.getEntities(), 0.0, 0.0, 0.0, *3 * (_IGES_UNITS,))
        gmsh.model.occ.synchronize()
        with _silence():
            gmsh.write(str(file))


def _read_shapes(file: Path) -> None:
    """The file's shapes into the current model, STEP and IGES in m, faces that touch sewn together."""
    if file.suffix.lower() in (".iges", ".igs"):
        # OpenCASCADE takes a target unit for IGES only once it has read one: this reading is thrown away.
        gmsh.option.setString("Geometry.OCCTargetUnit", "")
        _import(file)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    _import(file)
    if not gmsh.model.getEntities(3) and not _faces_connected():
        # The sewing tolerance is a share of the size, which is known only now: read again.
        gmsh.option.setNumber("Geometry.Tolerance", _SEWN * float(_extent().max()))
        gmsh.option.setNumber("Geometry.OCCSewFaces", 1)
        _import(file)


def _faces_connected() -> bool:
    """Whether all faces hang together by curves that they share; sewing faces with a pole breaks them, so only the others are sewn."""
    groups: list[set[int]] = []
    for _, face in gmsh.model.getEntities(2):
        curves = set(gmsh.model.getAdjacencies(2, face)[1].tolist())
        touching = [group for group in groups if group & curves]
        groups = [group for group in groups if not group & curves] + [curves.union(*touching)]
    return len(groups) < 2


def _import(file: Path) -> None:
    gmsh.model.remove()
    gmsh.model.add("surface")
    with _silence():
        gmsh.model.occ.importShapes(str(file), highestDimOnly=True)
    gmsh.model.occ.synchronize()


def _refuse_all_but_faces(file: Path) -> None:
    if gmsh.model.getEntities(3):
        raise InputError("holds a solid", where=str(file), remedy="Export the upper face alone, as a surface.")
    if not gmsh.model.getEntities():
        raise InputError(
            f"holds nothing that can be read as {file.suffix.lstrip('.').upper()}",
            where=str(file),
            remedy="Open it in a CAD program and export it anew.",
        )
    if not gmsh.model.getEntities(2):
        raise InputError("holds no surface, only points or curves", where=str(file), remedy="Export the surface.")


@contextlib.contextmanager
def _session() -> Iterator[None]:
    """Gmsh's one global session, quiet, without its signal handlers, and repeatable."""
    if gmsh.isInitialized():
        raise InputError("gmsh is already in use in this process", remedy="Call gmsh.finalize() first.")
    gmsh.initialize(argv=[], readConfigFiles=False, interruptible=False)
    try:
        for name, value in [
            ("General.Terminal", 0),
            ("General.NumThreads", 1),
            ("Mesh.RandomSeed", 1),
            ("Mesh.Algorithm", 6),
            ("Mesh.MeshSizeExtendFromBoundary", 0),
            ("Mesh.MeshSizeFromPoints", 0),
        ]:
            gmsh.option.setNumber(name, value)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
        gmsh.model.add("surface")
        yield
    finally:
        gmsh.finalize()


@contextlib.contextmanager
def _errors(path: Path, what: str, remedy: str) -> Iterator[None]:
    """Gmsh raises plain exceptions with its last message; scripts raise anything. The user gets a sentence."""
    try:
        yield
    except ShellformError:
        raise
    except Exception as error:
        said = str(error) if type(error) is Exception else f"{type(error).__name__}: {error}"
        raise InputError(f"{what}: {said.rstrip('.')}", where=str(path), remedy=remedy) from error


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Nothing on standard output: OpenCASCADE writes there past Python and past gmsh's own setting."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 1)
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)


def _extent() -> Reals:
    """The extents (3,), m, of the model's curves along x, y and z: gmsh's own boxes are those of the control points."""
    ends = [np.reshape(gmsh.model.getValue(0, point, []), (-1, 3)) for _, point in gmsh.model.getEntities(0)]
    for _, curve in gmsh.model.getEntities(1):
        low, high = (float(bound[0]) for bound in gmsh.model.getParametrizationBounds(1, curve))
        ends.append(np.reshape(gmsh.model.getValue(1, curve, np.linspace(low, high, _SAMPLES)), (-1, 3)))
    if not ends:  # a discrete surface of nothing but triangles
        return np.asarray(np.ptp(np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)), axis=0))
    return np.asarray(np.ptp(np.vstack(ends), axis=0))


def _mesh(size: float, where: Path) -> tuple[Reals, Indices, Reals | None]:
    """Points (v, 3), triangles (t, 3) and, where the faces have them, CAD normals (v, 3) of the model's faces."""
    if not (size > 0.0 and math.isfinite(size)):
        raise InputError("must be a positive length", where="surface.size", value=size)
    if not gmsh.model.getEntities(2):
        raise InputError("makes no surface", where=str(where), remedy="See surfaces/dome.py.")
    spans = np.sort(_extent())
    if 2.5 * spans[2] * spans[1] / size**2 > _MOST_TRIANGLES:
        raise InputError(
            f"would give more than {_MOST_TRIANGLES:,} triangles on a surface of {spans[2]:.3g} × {spans[1]:.3g} m",
            where="surface.size",
            value=size,
            remedy="Choose a larger mesh size, or check the surface's unit.",
        )
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    triangles, normals = [], np.zeros_like(points)
    for _, face in gmsh.model.getEntities(2):
        _, nodes = gmsh.model.mesh.getElementsByType(2, face)
        mine = number[nodes.reshape(-1, 3)]
        if not len(mine):
            raise InputError(f"gmsh made no triangles of its face {face}", where=str(where), remedy="Check the surface.")
        triangles.append(mine)
        _add_normals(normals, points, mine, face, number)
    faces = np.vstack(triangles)
    length = np.linalg.norm(normals, axis=1)  # zero where no face knows it
    used = np.zeros(len(points), dtype=bool)
    used[faces.ravel()] = True
    points, faces = points[used], (np.cumsum(used) - 1)[faces]
    normals, known = normals[used], length[used] > 0.5
    if not known.any():
        return points, faces, None
    if not known.all():
        estimated = make_surface(points, faces, source=str(where))
        normals[~known] = estimated.normals[cKDTree(estimated.vertices).query(points[~known])[1]]
    return points, faces, normals


def _add_normals(normals: Reals, points: Reals, triangles: Indices, face: int, number: Indices) -> None:
    """Adds the CAD normals at the face's nodes, turned to the side of its triangles or, where another face came first, to its."""
    tags, _, parameters = gmsh.model.mesh.getNodes(2, face, includeBoundary=True, returnParametricCoord=True)
    if not len(triangles) or len(parameters) != 2 * len(tags):
        return
    exact = np.reshape(gmsh.model.getNormal(face, parameters), (-1, 3))
    corner = points[triangles]
    rough = np.zeros_like(points)
    across = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    for k in range(3):
        np.add.at(rough, triangles[:, k], across)
    rows = number[tags]
    seen = rough[rows]
    seen /= np.maximum(np.linalg.norm(seen, axis=1, keepdims=True), 1e-300)
    agreement = np.sum(exact * seen, axis=1)
    # At a pole the CAD normal means nothing: it stays zero here, unless another face knows it.
    good = np.isfinite(exact).all(axis=1) & (np.abs(agreement) > _AGREES)
    signed = np.where(good[:, None], exact * np.sign(agreement)[:, None], 0.0)
    rest, first = np.unique(rows, return_index=True)
    mine = signed[first]
    # Two faces of a script need not turn the same way; make_surface turns all upwards, so only the sum has to agree.
    normals[rest] += np.where(np.sum(normals[rest] * mine, axis=1, keepdims=True) < 0.0, -mine, mine)


def _on_edge(triangles: Indices, count: int) -> Flags:
    edges = np.sort(np.vstack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]), axis=1)
    pairs, uses = np.unique(edges, axis=0, return_counts=True)
    result = np.zeros(count, dtype=bool)
    result[pairs[uses == 1].ravel()] = True
    return result


def _load(path: Path) -> ModuleType:
    if not path.is_file():
        raise InputError("there is no such file", where=str(path))
    spec = importlib.util.spec_from_file_location(f"surface_{path.stem}", path)
    if spec is None or spec.loader is None:
        raise InputError("isn't a Python script", where=str(path), remedy="Builder scripts end in .py.")
    module = importlib.util.module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # whatever somebody's script raises
        raise InputError(f"the script fails: {type(error).__name__}: {error}", where=str(path)) from error
    return module


def _function(module: ModuleType, name: str, path: Path) -> Callable[..., Any]:
    found = getattr(module, name, None)
    if not callable(found):
        raise InputError(f"has no function {name}(gmsh, *, ...)", where=str(path), remedy="See surfaces/dome.py.")
    return found  # type: ignore[no-any-return]


def _dimensions(build: Callable[..., Any], given: dict[str, float], path: Path) -> dict[str, float]:
    parameters = inspect.signature(build).parameters.values()
    known = {p.name: p.default for p in parameters if p.kind is inspect.Parameter.KEYWORD_ONLY}
    for name, value in known.items():
        if not _is_length(value):
            raise InputError(
                f"its dimension {name!r} has no positive default", where=str(path), remedy=f"Write {name}=0.90, say, m."
            )
    for name, value in given.items():
        if name not in known:
            near = difflib.get_close_matches(name, known, n=1)
            hint = f"Did you mean {near[0]!r}? " if near else ""
            raise InputError(
                f"{path.name} has no dimension {name!r}",
                where="surface.dimensions",
                remedy=f"{hint}Known: {', '.join(known)}.",
            )
        if not _is_length(value):
            raise InputError("must be a positive number", where=f"surface.dimensions.{name}", value=value)
    return {name: float(value) for name, value in {**known, **given}.items()}


def _is_length(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value) and value > 0.0
