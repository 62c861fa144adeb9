"""Rhino's 3DM files, read and written; the door to rhino3dm.

The unit is the file's. Meshes are taken as they are; NURBS surfaces, extrusions and the trimmed faces of
breps are rebuilt in gmsh's OpenCASCADE from their control points and edges, and meshed there with exact
normals; SubDs are subdivided. Blocks are placed by their instances. Hidden objects and layers count, since
what is hidden on one screen is the surface on another: choose by layer or name.

rhino3dm leaves out each knot vector's first and last knot, which no curve depends on, and its control points
are homogeneous.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from uuid import UUID, uuid5

import numpy as np
import rhino3dm

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError, how_many
from shellform.surface.readers.draft import (
    MOST_SOLIDS,
    Choice,
    Draft,
    Meshing,
    MeshObject,
    among,
    called,
    first_names,
    joined,
)
from shellform.surface.readers.nurbs import Curve, Patch, with_end_knots
from shellform.surface.readers.rhino_bytes import without_date_and_path

_METRES = {
    "Microns": 1e-6, "Millimeters": 1e-3, "Centimeters": 1e-2, "Decimeters": 0.1, "Meters": 1.0,
    "Kilometers": 1e3,
    "Inches": 0.0254, "Feet": 0.3048, "Yards": 0.9144,
}  # fmt: skip
_OURS = UUID("5c6f4b1e-6b0e-5a53-9f0d-6a1f8b7d2c11")  # under which what is written has its identifiers
_DEEPEST = 16  # blocks within blocks
_SUBDIVISIONS = 3  # of a SubD, each of which quarters its faces
_ON_EDGE = 1e-4  # of the size: a trim nearer to the patch's own edge than that doesn't cut it
_SAMPLES = 161  # along each curved side, whose chords are then nearer to it than that


@dataclass(frozen=True, eq=False)
class Item(Record):
    """What is written: on `layer`, under a `name`, a NURBS curve through `points` (n, 3), m, a straight line
    where there are two, a point where there is one, or where `triangles` are given their mesh; `strings` are
    its user strings."""

    layer: str
    name: str
    points: Reals
    triangles: Indices | None = None
    strings: Mapping[str, str] = field(default_factory=dict)


def write_rhino(path: Path, items: Sequence[Item], colours: Mapping[str, str]) -> None:
    """Writes the items in metres, each layer in its colour (#rrggbb), the same bytes each time, dated 1970.
    Raises OSError where the file can't be written.
    """
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    model.Settings.ModelAbsoluteTolerance = 1e-6
    layers = {}
    for name, colour in colours.items():
        layer = rhino3dm.Layer()
        layer.Name, layer.Color = name, (*bytes.fromhex(colour[1:]), 255)
        layer.Id = uuid5(_OURS, f"layer {name}")
        layers[name] = model.Layers.Add(layer)
    for number, item in enumerate(items):
        own = rhino3dm.ObjectAttributes()
        own.Id = uuid5(_OURS, f"object {number}")
        own.Name, own.LayerIndex = item.name, layers[item.layer]
        for key, value in item.strings.items():
            own.SetUserString(key, value)
        if item.triangles is not None:
            mesh = rhino3dm.Mesh()
            for point in item.points.tolist():
                mesh.Vertices.Add(*point)
            for corners in item.triangles.tolist():
                mesh.Faces.AddFace(*corners)
            mesh.Normals.ComputeNormals()
            model.Objects.AddMesh(mesh, own)
        elif len(item.points) == 1:
            model.Objects.AddPoint(rhino3dm.Point3d(*item.points[0].tolist()), own)
        else:
            model.Objects.AddCurve(_through(item.points), own)
    if not model.Write(str(path), 7):
        raise OSError(f"rhino3dm can't write {path}")
    path.write_bytes(without_date_and_path(path.read_bytes()))


def _through(points: Reals) -> Any:
    """The cubic spline through the points over the chords' length, without a kink at its second and its last
    but one point (de Boor 1978), as a NURBS curve; of less degree where there are fewer than four."""
    from scipy.interpolate import make_interp_spline  # whose loading takes longer than reading most files

    if len(points) == 2:
        return rhino3dm.LineCurve(*(rhino3dm.Point3d(*point) for point in points.tolist()))
    degree = min(3, len(points) - 1)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1)))
    spline = make_interp_spline(along, points, k=degree)
    curve = rhino3dm.NurbsCurve(3, False, degree + 1, len(points))
    for k, point in enumerate(spline.c.tolist()):
        curve.Points[k] = rhino3dm.Point4d(*point, 1.0)
    for k, knot in enumerate(spline.t[1:-1].tolist()):  # Rhino leaves the first and the last one out
        curve.Knots[k] = knot
    return curve


def read_rhino(
    file: Path,
    choice: Choice,
    meshing: Meshing,
    *,
    unit: str | None,
) -> Draft:
    """The surfaces and meshes of a 3DM file that `choice` means, in m.

    Raises InputError for what can't be read, for a stated `unit` where the file has its own, and where no
    object is a surface.
    """
    model = rhino3dm.File3dm.Read(str(file))
    if model is None:
        raise InputError(
            "can't be read as a Rhino file",
            where=str(file),
            remedy="Save it anew in Rhino, as version 5 or later.",
        )
    factor = _factor(model, unit, file)
    found = _numbered([each for each in _objects(model) if _is_surface(each[2])])
    if not found:
        said = ", ".join(sorted({str(each.Geometry.ObjectType).rpartition(".")[2] for each in model.Objects}))
        raise InputError(
            f"holds no surface, only {said}" if said else "is empty",
            where=str(file),
            remedy="Save the surface, or a mesh of it, with it.",
        )
    kept = among([(layer, name) for layer, name, _ in found], choice, str(file))
    chosen = [each for each, meant in zip(found, kept, strict=True) if meant]
    _refuse_many_solids(chosen, file)
    parts, patches = [], []
    for layer, name, shape in chosen:
        if isinstance(shape, rhino3dm.Mesh | rhino3dm.SubD):
            parts.append(_mesh(shape, layer, name, factor))
        else:
            patches += list(_patches(shape, factor, file))
    if parts and patches:
        listed = ", ".join(f"{name!r} on layer {layer!r}" for layer, name, _ in chosen[:6])
        raise InputError(
            f"holds both meshes and surfaces: {listed}",
            where=str(file),
            remedy="Choose by surface.object or surface.layer (--object, --layer).",
        )
    if parts:
        return replace(joined(parts, Choice(), str(file)), metres=1.0, up=meshing.up)
    from shellform.surface import cad

    draft = cad.mesh_patches(patches, file, meshing)
    return replace(draft, objects=tuple(called(layer, name) for layer, name, _ in chosen))


def _refuse_many_solids(chosen: Sequence[tuple[str, str, Any]], file: Path) -> None:
    """Raises InputError for a stack of blocks, before minutes go into skins that never become one."""
    solid = [
        isinstance(shape, rhino3dm.Brep | rhino3dm.Extrusion) and shape.IsSolid for _, _, shape in chosen
    ]
    if sum(solid) <= MOST_SOLIDS:
        return
    open_ones = [each for each, closed in zip(chosen, solid, strict=True) if not closed]
    names = list(dict.fromkeys(called(layer, name) for layer, name, _ in open_ones or chosen))
    choose = "choose a surface" if open_ones else "choose one of them"
    raise InputError(
        f"holds {sum(solid)} closed solids, which make no one skin"
        + (f", beside {how_many(len(open_ones), 'surface', 'surfaces')}" if open_ones else ""),
        where=str(file),
        remedy="Export the surface that they make, such as their upper faces joined, without the solids"
        + (
            f"; or {choose} by surface.object or surface.layer (--object, --layer): {first_names(names)}."
            if open_ones or len(names) == len(chosen)
            else "."
        ),
    )


def _numbered(found: list[tuple[str, str, Any]]) -> list[tuple[str, str, Any]]:
    """The objects with those without a name called by kind and number: "brep 1"."""
    counts: Counter[str] = Counter()
    result = []
    for layer, name, shape in found:
        kind = type(shape).__name__.lower()
        counts[kind] += not name
        result.append((layer, name or f"{kind} {counts[kind]}", shape))
    return result


def _factor(model: Any, unit: str | None, file: Path) -> float:
    from shellform.surface.units import unit_factor

    said = str(model.Settings.ModelUnitSystem).rpartition(".")[2]
    if said in _METRES:
        if unit is not None and unit_factor(unit) != _METRES[said]:
            raise InputError(
                f"is in {said.lower()}", where=str(file), value=unit, remedy="Leave the unit out."
            )
        return _METRES[said]
    if unit is None:
        raise InputError(
            f"has no usable unit ({said})", where=str(file), remedy="State it: surface.unit, --unit."
        )
    return unit_factor(unit)


def _objects(model: Any) -> Iterator[tuple[str, str, Any]]:
    """Layer, name and geometry of the file's objects, those in blocks where their instances are."""
    layers = {layer.Index: str(layer.FullPath or layer.Name) for layer in model.Layers}
    members = {str(each.Attributes.Id): each for each in model.Objects}
    blocks = {str(block.Id): [str(i) for i in block.GetObjectIds()] for block in model.InstanceDefinitions}
    for each in model.Objects:
        if not each.Attributes.IsInstanceDefinitionObject:
            yield from _placed(each, [], members, blocks, layers)


def _placed(
    each: Any,
    places: list[Any],
    members: dict[str, Any],
    blocks: dict[str, list[str]],
    layers: dict[int, str],
) -> Iterator[Any]:
    shape = each.Geometry
    if isinstance(shape, rhino3dm.InstanceReference) and len(places) < _DEEPEST:
        for member in blocks.get(str(shape.ParentIdefId), []):
            if member in members:
                yield from _placed(members[member], [shape.Xform, *places], members, blocks, layers)
        return
    if places:
        # Stretched along one axis or sheared it is of revolution no more, and Rhino's would become another.
        turns = isinstance(shape, rhino3dm.RevSurface)
        shape = shape.ToNurbsSurface() if turns else shape.Duplicate()
        for place in places:
            shape.Transform(place)
    yield layers.get(each.Attributes.LayerIndex, ""), str(each.Attributes.Name or ""), shape


def _is_surface(shape: Any) -> bool:
    return isinstance(shape, rhino3dm.Mesh | rhino3dm.SubD | rhino3dm.Brep | rhino3dm.Surface)


def _mesh(shape: Any, layer: str, name: str, factor: float) -> MeshObject:
    if isinstance(shape, rhino3dm.SubD):
        shape = shape.Duplicate()
        shape.Subdivide(_SUBDIVISIONS)
        shape = rhino3dm.Mesh.CreateFromSubDControlNet(shape, False)
    points = np.array(
        [(p.X, p.Y, p.Z) for p in (shape.Vertices.Point3dAt(k) for k in range(len(shape.Vertices)))],
        dtype=float,
    )
    faces = np.array([shape.Faces[k] for k in range(shape.Faces.Count)], dtype=np.int64).reshape(-1, 4)
    triangle = faces[:, 2] == faces[:, 3]
    return MeshObject(name, layer, factor * points.reshape(-1, 3), (faces[triangle, :3], faces[~triangle]))


def _patches(shape: Any, factor: float, file: Path) -> Iterator[Patch]:
    if isinstance(shape, rhino3dm.Extrusion):
        shape = shape.ToBrep(False)
    if not isinstance(shape, rhino3dm.Brep):
        yield _patch(shape, (), factor)
        return
    for number in range(len(shape.Faces)):
        face = shape.Faces[number]
        surface = face.UnderlyingSurface()
        if surface is None:
            raise InputError(
                f"its face {number + 1} has no surface",
                where=str(file),
                remedy="Check it in Rhino (SelBadObjects).",
            )
        loops = [
            (loop.LoopType, _edges(shape, loop)) for loop in (face.Loops[k] for k in range(len(face.Loops)))
        ]
        if len(loops) == 1 and _along_edge(surface, loops[0][1]):
            yield _patch(surface, (), factor)
        else:
            loops.sort(key=lambda loop: loop[0] != rhino3dm.BrepLoopType.Outer)
            yield _patch(
                surface,
                [tuple(_curve(edge, factor) for edge in edges) for _, edges in loops if edges],
                factor,
            )


def _edges(brep: Any, loop: Any) -> list[Any]:
    """The edges of a trimming loop; a pole's trim has none."""
    numbers = [loop.Trims[k].EdgeIndex for k in range(loop.TrimCount)]
    return [brep.Edges[number] for number in numbers if number >= 0]


def _curve(edge: Any, factor: float) -> Curve:
    nurbs = edge.ToNurbsCurve()
    points = np.array([(p.X, p.Y, p.Z, p.W) for p in (nurbs.Points[k] for k in range(len(nurbs.Points)))])
    return Curve(
        factor * points[:, :3] / points[:, 3:],
        points[:, 3],
        with_end_knots([k for k in nurbs.Knots], nurbs.Degree),
        nurbs.Degree,
    )


def _patch(surface: Any, loops: Sequence[tuple[Curve, ...]], factor: float) -> Patch:
    nurbs = surface.ToNurbsSurface()
    rows, columns = nurbs.Points.CountU, nurbs.Points.CountV
    points = np.array(
        [[(p.X, p.Y, p.Z, p.W) for p in (nurbs.Points[i, j] for j in range(columns))] for i in range(rows)]
    )
    degree = (nurbs.OrderU - 1, nurbs.OrderV - 1)
    knots = (
        with_end_knots([k for k in nurbs.KnotsU], degree[0]),
        with_end_knots([k for k in nurbs.KnotsV], degree[1]),
    )
    return Patch(factor * points[..., :3] / points[..., 3:], points[..., 3], knots, degree, tuple(loops))


def _along_edge(surface: Any, edges: Sequence[Any]) -> bool:
    """Whether a trimming loop runs along the untrimmed surface's own edge."""
    (u0, u1), (v0, v1) = ((d.T0, d.T1) for d in (surface.Domain(0), surface.Domain(1)))
    across, along_u = (np.linspace(0.0, 1.0, _side_samples(surface, way)) for way in (1, 0))
    sides = [[(u0 + (u1 - u0) * s, v) for s in along_u] for v in (v0, v1)] + [
        [(u, v0 + (v1 - v0) * s) for s in across] for u in (u0, u1)
    ]
    lines = [np.array([(p.X, p.Y, p.Z) for p in (surface.PointAt(u, v) for u, v in side)]) for side in sides]
    rim = np.vstack(lines)
    begin, along = (
        np.vstack([line[:-1] for line in lines]),
        np.vstack([np.diff(line, axis=0) for line in lines]),
    )
    for edge in edges:
        for s in np.linspace(edge.Domain.T0, edge.Domain.T1, 9):
            point = edge.PointAt(s)
            away = np.array([point.X, point.Y, point.Z]) - begin
            share = np.sum(away * along, axis=1) / np.maximum(np.sum(along * along, axis=1), 1e-300)
            gap = np.linalg.norm(away - np.clip(share, 0.0, 1.0)[:, None] * along, axis=1).min()
            if gap > _ON_EDGE * float(np.ptp(rim, axis=0).max()):
                return False
    return True


def _side_samples(surface: Any, way: int) -> int:
    """How many points tell where a side along u (`way` 0) or v (1) runs: its ends where that is straight, as
    all those of flat panels are."""
    return 2 if surface.Degree(way) == 1 and surface.SpanCount(way) == 1 else _SAMPLES
