"""The faces of a CAD file brought into gmsh's current model, and sewn.

Of a file with solids and surfaces the surfaces are taken: gmsh's own choice, what has the most dimensions,
would drop them silently.
"""

from __future__ import annotations

from pathlib import Path

from shellform.errors import InputError, how_many
from shellform.surface.occ import extent, gmsh, silence, to_sew
from shellform.surface.readers.draft import MOST_SOLIDS

# of the size: edges of neighbouring faces nearer than that are one, as CAD programs leave them apart
_SEWN = 1e-6


def import_faces(file: Path, kind: str, face: str | None) -> tuple[str, ...]:
    """Brings the faces of a "step", "iges" or "brep" file into the current model, STEP in mm, IGES in m,
    those that touch sewn together, and returns a sentence where solids were left out.

    Raises InputError where there are no faces, for solids alone without a `face`, or more than hang together,
    and for solids beside surfaces with one.
    """
    _read_shapes(file, kind)
    left_out = _surfaces_beside_solids(file, kind, face) if gmsh.model.getEntities(3) else ()
    solids = len(gmsh.model.getEntities(3))
    if solids > MOST_SOLIDS:
        raise InputError(
            f"holds {solids} solids, which make no one skin",
            where=str(file),
            remedy="Export the surface that they make, such as their upper faces joined, without the solids.",
        )
    if solids and face is None:
        remedy = (
            "Choose its upper or lower face (surface.face, --face), or export that face alone, as a surface."
        )
        raise InputError("holds a solid", where=str(file), remedy=remedy)
    if not gmsh.model.getEntities():
        raise InputError(
            f"holds nothing that can be read as {kind.upper()}",
            where=str(file),
            remedy="Open it in a CAD program and export it anew.",
        )
    if not gmsh.model.getEntities(2):
        raise InputError(
            "holds no surface, only points or curves", where=str(file), remedy="Export the surface."
        )
    return left_out


def sew() -> None:
    """Sews the model's faces together where they touch and share no curves."""
    tolerance = _SEWN * float(extent().max())
    if to_sew(tolerance):
        # Of all shapes at once, which an empty list means: named ones are sewn each by itself, to nothing.
        gmsh.model.occ.healShapes([], tolerance, False, False, False, True, False)
        gmsh.model.occ.synchronize()


def _read_shapes(file: Path, kind: str) -> None:
    """What has the most dimensions of the file's shapes, faces that touch sewn together.

    With metres for its unit OpenCASCADE loses the seam of what turns about a pole and is less than some 2 m
    wide in STEP files of millimetres."""
    if kind == "step":
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    if kind == "iges":
        # OpenCASCADE takes a target unit for IGES only once it has read one: this reading is thrown away.
        gmsh.option.setString("Geometry.OCCTargetUnit", "")
        _import(file, kind)
        gmsh.option.setString("Geometry.OCCTargetUnit", "M")
    _import(file, kind)
    tolerance = _SEWN * float(extent().max())
    if not gmsh.model.getEntities(3) and to_sew(tolerance):
        # The sewing tolerance is a share of the size, which is known only now: read again.
        gmsh.option.setNumber("Geometry.Tolerance", tolerance)
        gmsh.option.setNumber("Geometry.OCCSewFaces", 1)
        _import(file, kind)


def _surfaces_beside_solids(file: Path, kind: str, face: str | None) -> tuple[str, ...]:
    """Leaves the faces that bound no solid alone in the model, and says so; where there are none, the solids
    are read as they were.
    """
    _import(file, kind, everything=True)
    solids, faces = gmsh.model.getEntities(3), _free(2)
    if not faces:
        _import(file, kind)
        return ()
    told = f"{how_many(len(solids), 'solid', 'solids')} and {how_many(len(faces), 'surface', 'surfaces')}"
    if face is not None:
        raise InputError(
            f"holds {told}: which of them has the {face} face isn't clear",
            where=str(file),
            remedy="Leave the face out (surface.face, --face) for the surfaces, or export the solid alone.",
        )
    gmsh.model.occ.remove(solids, recursive=True)
    gmsh.model.occ.synchronize()
    for dimension in (1, 0):  # curves and points beside them, which would count for the size
        gmsh.model.occ.remove(_free(dimension), recursive=True)
        gmsh.model.occ.synchronize()
    sew()
    return (f"it holds {told}: solids were left out",)


def _free(dimension: int) -> list[tuple[int, int]]:
    """The model's entities of that dimension that bound no other."""
    found = gmsh.model.getEntities(dimension)
    return [each for each in found if not len(gmsh.model.getAdjacencies(*each)[0])]


def _import(file: Path, kind: str, *, everything: bool = False) -> None:
    gmsh.model.remove()
    gmsh.model.add("surface")
    with silence():
        gmsh.model.occ.importShapes(str(file), highestDimOnly=not everything, format=kind)
    gmsh.model.occ.synchronize()
