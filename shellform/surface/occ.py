"""Gmsh's one global session, and the mesh of the faces in it with their CAD normals; the door to gmsh."""

from __future__ import annotations

import contextlib
import itertools
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, ShellformError
from shellform.surface.readers.draft import Meshing, require_mesh_size
from shellform.surface.shape.triangles import area_vectors, used_points
from shellform.surface.units import turned_up

if TYPE_CHECKING:  # target.py loads numba, which a reader's process does without
    from shellform.surface.shape.target import Surface

try:
    import gmsh
except (ImportError, OSError) as error:  # a shared library that gmsh's wheel needs isn't there
    raise InputError(
        f"gmsh can't be loaded: {error}",
        remedy="Allow more memory (ulimit -v): its library takes 1 GB of addresses."
        if "map segment" in str(error) or "allocate memory" in str(error)
        else "On Debian and Ubuntu: apt-get install libgl1 libglu1-mesa libxrender1 libxcursor1 libxft2 "
        "libxinerama1",
    ) from error

# cosine between a CAD normal and the triangles around it, below which it is taken for a pole's
_AGREES = 0.95
_STEP_TIME = re.compile(r"(?<=')\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d(?=')")
_STEP_FILE = re.compile(r"(Open CASCADE STEP translator [\d.]+) \d+")
_STEP_PRODUCT = re.compile(r"PRODUCT\('Open CASCADE STEP translator [^']*',\s*'[^']*'")
_STEP_PLACE = re.compile(r"(NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+',)''")
_STEP_PART = re.compile(r"NEXT_ASSEMBLY_USAGE_OCCURRENCE\('\d+'")
_SAMPLES = 33  # points on a curve that tell its extent
_SAME = 1e-9  # of the extent of a curve: ends so near close it


@contextlib.contextmanager
def session() -> Iterator[None]:
    """Gmsh's one global session, quiet, without its signal handlers, and repeatable."""
    if gmsh.isInitialized():
        raise InputError("gmsh is already in use in this process", remedy="Call gmsh.finalize() first.")
    gmsh.initialize(argv=[], readConfigFiles=False, interruptible=False)
    _ignore_broken_pipes()
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


def _ignore_broken_pipes() -> None:
    """As Python does from its start, until gmsh undoes it: else the first write to a socket whose other end
    is gone kills the process.
    """
    if hasattr(signal, "SIGPIPE") and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGPIPE, signal.SIG_IGN)


@contextlib.contextmanager
def errors(path: Path, what: str, remedy: str) -> Iterator[None]:
    """Gmsh raises plain exceptions with its last message; scripts raise anything. The user gets a
    sentence.
    """
    try:
        yield
    except ShellformError:
        raise
    except Exception as error:
        said = str(error) if type(error) is Exception else f"{type(error).__name__}: {error}"
        raise InputError(f"{what}: {said.rstrip('.')}", where=str(path), remedy=remedy) from error


def write_curves(path: Path, curves: Sequence[Reals], names: Sequence[str]) -> None:
    """Writes a STEP file, in m, of a B-spline curve through each of the rows of points (k, 3), closed where
    the last is the first, a straight line where there are two, each under its name. The same curves give the
    same bytes: of the time, and of how many files OpenCASCADE has written before, nothing is told.
    """
    with session(), errors(path, "gmsh can't write the curves", "Choose another folder."):
        occ = gmsh.model.occ
        for points in curves:
            closed = len(points) > 2 and np.allclose(
                points[0], points[-1], rtol=0.0, atol=_SAME * np.ptp(points)
            )
            tags = [occ.addPoint(*point) for point in points[: len(points) - closed].tolist()]
            tags += tags[:1] * closed
            if len(tags) > 2:
                occ.addSpline(tags)
            else:
                occ.addLine(*tags)
        occ.synchronize()
        with silence():
            gmsh.write(str(path))
    text = path.read_text(encoding="utf-8", errors="surrogateescape") if path.is_file() else ""
    if not text.rstrip().endswith("END-ISO-10303-21;"):  # which gmsh doesn't say
        raise InputError("can't be written", where=str(path), remedy="Choose another folder.")
    path.write_text(_timeless(_named(text, names)), encoding="utf-8", errors="surrogateescape", newline="")


def _named(text: str, names: Sequence[str]) -> str:
    """A STEP file's text with the curves' names in place of OpenCASCADE's numbers: of the parts, and of their
    places in the whole, which come in the order of the curves. A last part has the splines' inner points."""
    alone = len(_STEP_PRODUCT.findall(text)) == 1
    own = itertools.chain(names if alone else ["gridshell", *names], itertools.repeat("points"))
    placed = itertools.chain(names, itertools.repeat("points"))
    text = _STEP_PRODUCT.sub(lambda _: "PRODUCT('{0}','{0}'".format(next(own)), text)
    return _STEP_PLACE.sub(lambda found: f"{found[1]}'{next(placed)}'", text)


def _timeless(text: str) -> str:
    """A STEP file's text without the time, and numbered as the process's first: OpenCASCADE goes on counting
    files and parts.
    """
    numbers = itertools.count(1)
    text = _STEP_TIME.sub("1970-01-01T00:00:00", text, count=1)
    text = _STEP_FILE.sub(r"\1 1", text)
    return _STEP_PART.sub(lambda _: f"NEXT_ASSEMBLY_USAGE_OCCURRENCE('{next(numbers)}'", text)


@contextlib.contextmanager
def silence() -> Iterator[None]:
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


def extent() -> Reals:
    """The extents (3,), in the model's unit, of its curves along x, y and z: gmsh's own boxes are those of
    the control points.
    """
    ends = [np.reshape(gmsh.model.getValue(0, point, []), (-1, 3)) for _, point in gmsh.model.getEntities(0)]
    for _, curve in gmsh.model.getEntities(1):
        low, high = (float(bound[0]) for bound in gmsh.model.getParametrizationBounds(1, curve))
        ends.append(np.reshape(gmsh.model.getValue(1, curve, np.linspace(low, high, _SAMPLES)), (-1, 3)))
    if not ends:  # a discrete surface of nothing but triangles
        return np.asarray(np.ptp(np.reshape(gmsh.model.getBoundingBox(-1, -1), (2, 3)), axis=0))
    return np.asarray(np.ptp(np.vstack(ends), axis=0))


def to_sew(tolerance: float) -> bool:
    """Whether faces lie within the `tolerance`, in the model's unit, of others without hanging together with
    them by curves that they share; sewing faces with a pole breaks them, so only such are sewn.
    """
    groups: list[tuple[set[int], Reals, Reals]] = []
    for _, face in gmsh.model.getEntities(2):
        curves = set(gmsh.model.getAdjacencies(2, face)[1].tolist())
        box = np.reshape(gmsh.model.getBoundingBox(2, face), (2, 3))
        touching = [group for group in groups if group[0] & curves]
        whole = (
            curves.union(*(group[0] for group in touching)),
            np.min([box[0], *(group[1] for group in touching)], axis=0),
            np.max([box[1], *(group[2] for group in touching)], axis=0),
        )
        groups = [*(group for group in groups if not group[0] & curves), whole]
    return any(
        (low <= other + tolerance).all() and (lower <= high + tolerance).all()
        for (_, low, high), (_, lower, other) in itertools.combinations(groups, 2)
    )


def mesh_faces(size: float, where: Path, meshing: Meshing) -> tuple[Reals, Indices, Reals | None]:
    """Points (v, 3), triangles (t, 3) and, where the faces have them, CAD normals (v, 3) of the model's
    faces, zero at poles, where they mean nothing, in a mesh of this `size`, m, and else as `meshing` says.
    """
    if not gmsh.model.getEntities(2):
        raise InputError(
            "makes no surface",
            where=str(where),
            remedy="Give a file with at least one face, or let build make one, as surfaces/dome.py does.",
        )
    spans = np.sort(extent())
    give = "the triangles' size in metres, such as 0.01, or leave it out"
    expected = require_mesh_size(size, spans[2], spans[1], where="surface.size", give=give)
    meshing.begins(expected)
    gmsh.option.setNumber("Mesh.MeshSizeMin", size)
    gmsh.option.setNumber("Mesh.MeshSizeMax", size)
    gmsh.model.mesh.generate(2)
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    number = np.full(int(tags.max()) + 1, -1)
    number[tags] = np.arange(len(tags))
    points = coordinates.reshape(-1, 3)
    triangles, normals = {}, np.zeros_like(points)
    for _, face in gmsh.model.getEntities(2):
        _, nodes = gmsh.model.mesh.getElementsByType(2, face)
        triangles[face] = number[nodes.reshape(-1, 3)]
        if not len(triangles[face]):
            raise InputError(
                f"gmsh made no triangles of its face {face}", where=str(where), remedy="Check the surface."
            )
    if meshing.face is not None and gmsh.model.getEntities(3):
        triangles = _on_side(points, triangles, meshing.face, meshing.up, where)
    for face, mine in triangles.items():
        _add_normals(normals, points, mine, face, number)
    faces = np.vstack(list(triangles.values()))
    length = np.linalg.norm(normals, axis=1)  # zero where no face knows it
    used, faces = used_points(faces, len(points))
    points, normals, known = points[used], normals[used], length[used] > 0.5
    normals[~known] = 0.0
    return points, faces, normals if known.any() else None


def _on_side(
    points: Reals, triangles: dict[int, Indices], side: str, up: str, where: Path
) -> dict[int, Indices]:
    """The triangles of a solid's skin on one side, by their CAD faces."""
    from shellform.surface.readers.mend import turned_alike
    from shellform.surface.readers.sides import side_of

    whole = np.vstack(list(triangles.values()))
    kept = side_of(turned_up(points, up), turned_alike(whole, str(where)), side, str(where))
    ends = np.cumsum([len(each) for each in triangles.values()])[:-1]
    chosen = zip(triangles, np.split(whole, ends), np.split(kept, ends), strict=True)
    return {face: mine[mask] for face, mine, mask in chosen if mask.any()}


def _add_normals(normals: Reals, points: Reals, triangles: Indices, face: int, number: Indices) -> None:
    """Adds the CAD normals at the face's nodes, turned to the side of its triangles or, where another face
    came first, to its.
    """
    tags, _, parameters = gmsh.model.mesh.getNodes(2, face, includeBoundary=True, returnParametricCoord=True)
    if not len(triangles) or len(parameters) != 2 * len(tags):
        return
    exact = np.reshape(gmsh.model.getNormal(face, parameters), (-1, 3))
    rough, across = np.zeros_like(points), area_vectors(points, triangles)
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
    # Two faces of a script need not turn the same way; make_surface turns all upwards, so only the sum has to
    # agree.
    normals[rest] += np.where(np.sum(normals[rest] * mine, axis=1, keepdims=True) < 0.0, -mine, mine)


def surface_from(points: Reals, triangles: Indices, normals: Reals | None, source: str) -> Surface:
    """The surface (target.py: make_surface), which loads Numba: only once there is one to make."""
    from shellform.surface.shape.target import make_surface

    return make_surface(points, triangles, normals=normals, source=source)
