"""Surfaces built or imported in gmsh, through occ.py.

A builder script is a Python file with one function `build(gmsh, *, name=default, ...)`, whose keyword
arguments are the shell's named dimensions, m, and which makes the geometry in the current model. Where it has
a second function `form(points, triangles, edge, *, ...)` with the same dimensions, the mesh of what was built
is a plan, and `form` returns where its `points` (v, 3) go; `edge` (v,) tells which lie on its boundary. So a
form-found shell is meshed before it is found.

CAD files (STEP, IGES, BREP) come through gmsh's OpenCASCADE, which converts the unit that STEP and IGES files
state to metres; a BREP file has none. OpenCASCADE remembers the last unit asked for beyond gmsh's session, so
that every session asks for metres anew.

Vertex normals are the CAD surface's own, summed over the faces that meet at a vertex; across a fold they are
its bisector.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.errors import InputError, NotConverged, require_file, require_number
from shellform.surface.imports import import_faces, sew
from shellform.surface.occ import errors, extent, gmsh, mesh_faces, session, silence, surface_from
from shellform.surface.readers.draft import Draft, Meshing, require_mesh_size
from shellform.surface.readers.nurbs import Patch
from shellform.surface.readers.script import builder, load_script, named_dimensions
from shellform.surface.readers.stated import line_without_number
from shellform.surface.shape.triangles import open_edges
from shellform.surface.units import level_axes, turned_up, unit_factor

if TYPE_CHECKING:  # target.py loads numba, which a reader's process does without
    from shellform.surface.shape.target import Surface

FORMATS = {".step": "step", ".stp": "step", ".iges": "iges", ".igs": "iges", ".brep": "brep", ".brp": "brep"}
_DEFAULT_EDGES = 60.0  # along the longer plan extent
_BUILT_EDGES = 90.0  # along the largest dimension of a builder script
_SAMPLES = 33  # points on each edge curve that a fitted surface passes through
_FITTED = 1000  # about as many vertices a fitted surface passes through
_AT_FIRST = 250  # the same of a quick one, which tells whether that is worth its time: …
_HOPELESS = 10.0  # … not where it is so many times as far off as it may be
_SEGMENTS = 100  # of a fitted B-spline along u and v
_TOGETHER = 200  # patches that are made in one model
_CORNER = np.cos(np.deg2rad(30.0))  # an edge that turns more has a corner there
_IGES_UNITS = 1000.0  # gmsh states millimetres in IGES files and leaves the numbers as they are


def build_surface(script: str | Path, *, size: float, **dimensions: float) -> Surface:
    """The surface that a builder script makes with the named `dimensions`, m, meshed at about `size`, m.

    Raises InputError for a script that can't be read or fails, and for dimensions it doesn't have.
    """
    path = Path(script)
    draft = read_script(path, size=size, dimensions=dimensions)
    return surface_from(draft.points, draft.triangles, draft.normals, str(path))


def read_script(path: Path, *, size: float | None, dimensions: Mapping[str, float]) -> Draft:
    """What `build_surface` makes a surface of; `size` left out: a part of the largest dimension."""
    module = load_script(path)
    build = builder(module, path)
    named = named_dimensions(build, dict(dimensions), path)
    mesh = max(named.values(), default=0.0) / _BUILT_EDGES if size is None else size
    form = getattr(module, "form", None)
    with session(), errors(path, "the script fails", "Check the script and its dimensions."):
        build(gmsh, **named)
        gmsh.model.occ.synchronize()
        points, triangles, normals = mesh_faces(mesh, path, Meshing())
        if form is not None:
            points, normals = form(points, triangles, _on_edge(triangles, len(points)), **named), None
    return Draft(np.asarray(points, dtype=float), triangles, normals, 1.0)


def dimensions_of(script: str | Path) -> dict[str, float]:
    """The named dimensions, m, of a builder script and their defaults."""
    path = Path(script)
    return named_dimensions(builder(load_script(path), path), {}, path)


def import_surface(
    path: str | Path, *, unit: str | None = None, size: float | None = None, up: str = "z"
) -> Surface:
    """The surface of a STEP, IGES or BREP file as `read_cad` reads it, in this process, and z up."""
    file = Path(path)
    require_file(file)
    kind = FORMATS.get(file.suffix.lower())
    if kind is None:
        raise InputError("isn't a CAD file", where=str(file), remedy=f"Known endings: {', '.join(FORMATS)}.")
    turned_up(np.zeros((0, 3)), up)  # refuses an unknown axis before the work
    draft = read_cad(file, kind, Meshing(size, up), unit=unit)
    normals = None if draft.normals is None else turned_up(draft.normals, up)
    return surface_from(turned_up(draft.points, up), draft.triangles, normals, str(file))


def read_cad(
    file: Path,
    kind: str,
    meshing: Meshing,
    *,
    unit: str | None = None,
) -> Draft:
    """The faces of a "step", "iges" or "brep" file, in m.

    The unit is the file's own; a BREP file's is `unit` ("m" if left out). z isn't turned up yet. Raises
    InputError for unreadable files, for solids of which no face is asked for, and where one is for solids
    beside surfaces.
    """
    if kind != "brep" and unit is not None:
        raise InputError(
            f"{kind.upper()} files carry their own unit",
            where="surface.unit",
            value=unit,
            remedy="Leave the unit out.",
        )
    line = line_without_number(file, kind)
    if line is not None:
        raise InputError(
            f"line {line} has nan for a number",
            where=str(file),
            remedy="Open it in the program that wrote it, check it, and export it anew.",
        )
    factor = {"step": unit_factor("mm"), "iges": 1.0, "brep": unit_factor(unit or "m")}[kind]
    with session(), errors(file, "gmsh can't read it", "Open it in a CAD program and export it anew."):
        left_out = import_faces(file, kind, meshing.face)
        if factor != 1.0:
            gmsh.model.occ.dilate(gmsh.model.occ.getEntities(), 0.0, 0.0, 0.0, factor, factor, factor)
        gmsh.model.occ.synchronize()
        draft = _draft(file, meshing)
    return replace(draft, notes=(*left_out, *draft.notes))


def mesh_patches(patches: Sequence[Patch], where: Path, meshing: Meshing) -> Draft:
    """NURBS patches, m, trimmed and sewn where they touch, meshed as CAD files are."""
    with session(), errors(where, "gmsh can't build its surfaces", "Export it as STEP, or as a mesh."):
        _add_patches(patches)
        sew()
        return _draft(where, meshing)


def mesh_plan(outlines: Sequence[Reals], *, size: float | None = None) -> tuple[Reals, Indices]:
    """Points (k, 2) inside the first of the closed `outlines` (n, 2), m, and outside the others, and
    triangles (t, 3), counterclockwise.

    The triangles number the outlines' points first, one outline after the other, then these. Edges are about
    `size`, m, long (left out: as those of the outline nearby). Raises InputError where outlines cross, and
    for a size with which the triangles would be too many.
    """
    if size is not None:
        sides = np.ptp(np.vstack(outlines), axis=0)
        require_mesh_size(size, *sides, where="size", give="metres, such as a fortieth of the span")
    with (
        session(),
        errors(Path("plan"), "its outline can't be meshed", "Check that it doesn't cross itself."),
    ):
        geo = gmsh.model.geo
        loops, tags = [], []
        for outline in outlines:
            mine = [geo.addPoint(x, y, 0.0) for x, y in outline]
            lines = [geo.addLine(a, b) for a, b in zip(mine, mine[1:] + mine[:1], strict=True)]
            loops.append(geo.addCurveLoop(lines))
            tags += mine
            for line in lines:
                geo.mesh.setTransfiniteCurve(line, 2)
        geo.addPlaneSurface(loops)
        geo.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeExtendFromBoundary", 1)
        if size is not None:
            gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(2)
        nodes, coordinates, _ = gmsh.model.mesh.getNodes()
        kinds, _, corners = gmsh.model.mesh.getElements(2)
    places = coordinates.reshape(-1, 3)[:, :2]
    # A mesh's vertex on a point has the point's number.
    own = [int(np.flatnonzero(nodes == tag)[0]) for tag in tags]
    if not len(kinds) or not np.array_equal(places[own], np.vstack(outlines)):
        raise InputError("its outline can't be meshed", remedy="Check that it doesn't cross itself.")
    inside = np.setdiff1d(np.arange(len(nodes)), own)
    number = np.zeros(int(nodes.max()) + 1, dtype=np.int64)
    number[nodes[np.concatenate([own, inside]).astype(int)]] = np.arange(len(nodes))
    triangles = number[corners[0].reshape(-1, 3)]
    first, second = (np.concatenate([places[own], places[inside]])[triangles[:, k]] for k in (1, 2))
    begin = np.concatenate([places[own], places[inside]])[triangles[:, 0]]
    across = (first - begin)[:, 0] * (second - begin)[:, 1] - (first - begin)[:, 1] * (second - begin)[:, 0]
    triangles[across < 0.0] = triangles[across < 0.0][:, ::-1]
    return places[inside], triangles


def _add_patches(patches: Sequence[Patch]) -> None:
    """The patches as faces of the current model. Many are made in models of their own and brought together by
    files: how long gmsh looks for what a face was made with, to take it away, grows with what is there."""
    groups = [patches[k : k + _TOGETHER] for k in range(0, len(patches), _TOGETHER)]
    with tempfile.TemporaryDirectory() as folder:
        files = [str(Path(folder) / f"{number}.brep") for number in range(len(groups))]
        for file, group in zip(files, groups, strict=True):
            for patch in group:
                _add_patch(patch)
            gmsh.model.occ.synchronize()
            if len(groups) > 1:
                with silence():
                    gmsh.write(file)
                gmsh.model.remove()
                gmsh.model.add("surface")
        for file in files if len(groups) > 1 else ():
            with silence():
                gmsh.model.occ.importShapes(file, format="brep")
        gmsh.model.occ.synchronize()


def _add_patch(patch: Patch) -> None:
    """One trimmed NURBS surface into the model, without the curves and points that it was made with."""
    occ = gmsh.model.occ
    before = set(occ.getEntities())
    rows, columns, _ = patch.control.shape
    tags = [occ.addPoint(*patch.control[i, j]) for j in range(columns) for i in range(rows)]
    wires = []
    for loop in patch.loops:
        curves = []
        for curve in loop:
            ends = [occ.addPoint(*point) for point in curve.control]
            knots, times = _knots(curve.knots)
            curves.append(occ.addBSpline(ends, -1, curve.degree, curve.weights, knots, times))
        wires.append(occ.addWire(curves))
    (u, times_u), (v, times_v) = _knots(patch.knots[0]), _knots(patch.knots[1])
    made = occ.addBSplineSurface(
        tags, rows, -1, *patch.degree, patch.weights.T.ravel(), u, v, times_u, times_v, wires, wire3D=True
    )
    kept = {(2, made)}
    waste = [each for each in occ.getEntities() if each not in before and each not in kept]
    occ.remove([each for each in waste if each[0] < 2])


def _knots(knots: Reals) -> tuple[Reals, Indices]:
    """The different knots and how often each occurs."""
    values, times = np.unique(knots, return_counts=True)
    return values, times


def _draft(where: Path, meshing: Meshing) -> Draft:
    sides = extent()
    if not sides.max() > 0.0:
        raise InputError("has no extent", where=str(where), remedy="Export the surface anew.")
    plan = sides[list(level_axes(meshing.up))]
    size = float(plan.max()) / _DEFAULT_EDGES if meshing.size is None else meshing.size
    points, triangles, normals = mesh_faces(size, where, meshing)
    of_solid = meshing.face is not None and bool(gmsh.model.getEntities(3))
    notes = (f"the {meshing.face} face of a solid was taken",) if of_solid else ()
    return Draft(points, triangles, normals, 1.0, meshing.up, notes, of_solid=of_solid)


def write_cad(path: str | Path, script: str | Path, **dimensions: float) -> None:
    """Writes a builder script's geometry as STEP or IGES, in millimetres, or BREP, in metres, whichever the
    path's ending says.

    Raises InputError for other endings, and for a script with a `form`, whose shell has no CAD geometry.
    """
    file, source = Path(path), Path(script)
    if file.suffix.lower() not in FORMATS:
        raise InputError("isn't a CAD file", where=str(file), remedy=f"Known endings: {', '.join(FORMATS)}.")
    module = load_script(source)
    if hasattr(module, "form"):
        raise InputError(
            "is form-found on a mesh, of which there is no CAD file",
            where=str(source),
            remedy="Build its mesh instead (cad.build_surface).",
        )
    build = builder(module, source)
    named = named_dimensions(build, dimensions, source)
    with session(), errors(source, "the script fails", "Check the script and its dimensions."):
        build(gmsh, **named)
        if file.suffix.lower() in (".iges", ".igs"):
            gmsh.model.occ.dilate(gmsh.model.occ.getEntities(), 0.0, 0.0, 0.0, *3 * (_IGES_UNITS,))
        gmsh.model.occ.synchronize()
        with silence():
            gmsh.write(str(file))


def write_fitted(path: str | Path, surface: Surface, *, within: float = 1e-3) -> float:
    """Writes a B-spline surface through a surface's edge and vertices, by the path's ending as `write_cad`,
    and returns how far it is off, m.

    Raises InputError for other endings and for surfaces with openings, which one B-spline can't have, and
    NotConverged where the vertices are further off than `within` of the size, a share of it.
    """
    file = Path(path)
    kind = FORMATS.get(file.suffix.lower())
    if kind is None:
        raise InputError("isn't a CAD file", where=str(file), remedy=f"Known endings: {', '.join(FORMATS)}.")
    give = "a share of the surface's size, such as 0.001"
    require_number(within, above=0.0, below=1.0, where="within", give=give, share=True)
    most = within * float(surface.size.max())
    loops = surface.boundary
    if len(loops) > 1:
        raise InputError(
            "has openings, which can't be fitted",
            where=surface.source,
            remedy="Close them (surface.fill), or write a mesh.",
        )
    with session(), errors(file, "gmsh can't fit a surface", "Write a mesh."):
        _refuse_off(_fit(surface, _AT_FIRST), _HOPELESS * most)
    with session(), errors(file, "gmsh can't fit a surface", "Write a mesh."):
        off = _fit(surface, _FITTED)
        _refuse_off(off, most)
        if kind == "iges":
            gmsh.model.occ.dilate(gmsh.model.occ.getEntities(), 0.0, 0.0, 0.0, *3 * (_IGES_UNITS,))
            gmsh.model.occ.synchronize()
        with silence():
            gmsh.write(str(file))
    return off


def _refuse_off(off: float, most: float) -> None:
    if off > most:
        raise NotConverged(
            f"The fitted surface is {off:.2g} m off", residual=off, remedy="Write a mesh instead."
        )


def _fit(surface: Surface, count: int) -> float:
    """Makes a B-spline surface through the edge of a surface without openings and about so many of its
    vertices, and tells how far the others are off it, m."""
    occ, edge = gmsh.model.occ, surface.boundary[0]
    inner = np.setdiff1d(np.arange(len(surface.vertices)), edge)
    # One vertex a cell of a grid in space: evenly spread, whatever the mesh.
    cell = max(math.sqrt(surface.area / count), 1e-12 * float(surface.size.max()))
    chosen = inner[np.unique(np.floor(surface.vertices[inner] / cell), axis=0, return_index=True)[1]]
    curves = []
    rim = [occ.addPoint(*point) for point in surface.vertices[edge]]
    for stretch in _stretches(surface.vertices[edge]):
        ends = [rim[k % len(rim)] for k in stretch]
        curves.append(occ.addSpline(ends) if len(ends) > 2 else occ.addLine(*ends))
    wire = occ.addWire(curves)
    points = [occ.addPoint(*surface.vertices[k]) for k in chosen]
    face = occ.addSurfaceFilling(
        wire, pointTags=points, degree=3, numPointsOnCurves=_SAMPLES, maxSegments=_SEGMENTS
    )
    occ.remove([(0, point) for point in points])
    occ.synchronize()
    closest = np.reshape(gmsh.model.getClosestPoint(2, face, surface.vertices[inner].ravel())[0], (-1, 3))
    return float(np.linalg.norm(closest - surface.vertices[inner], axis=1).max(initial=0.0))


def _stretches(edge: Reals) -> list[range]:
    """A closed edge (k, 3) parted at its corners, and where it has fewer than two, into four."""
    along = np.roll(edge, -1, axis=0) - edge
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    corners = np.flatnonzero(np.sum(along * np.roll(along, 1, axis=0), axis=1) < _CORNER)
    if len(corners) < 2:
        corners = np.arange(4) * len(edge) // 4
    return [
        range(a, b + 1) for a, b in zip(corners, np.append(corners[1:], corners[0] + len(edge)), strict=True)
    ]


def _on_edge(triangles: Indices, count: int) -> Flags:
    result = np.zeros(count, dtype=bool)
    result[open_edges(triangles).ravel()] = True
    return result
