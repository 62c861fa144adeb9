"""Any surface file to a Surface: the reader chosen by the file's ending and its content, then mended, one
piece, one side, closed.

A file's first bytes say what it is in all formats but BREP's and OBJ's, whose lines do. Where ending and
content disagree the file is refused; where the ending is unknown, the content decides.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, how_many, require_file, unreadable
from shellform.surface.readers import compas, compas_surfaces, foreign, plain
from shellform.surface.readers.draft import MOST_BYTES, Choice, Draft, noted
from shellform.surface.readers.fills import filled, width_of
from shellform.surface.readers.mend import mended
from shellform.surface.readers.teeth import is_ragged
from shellform.surface.shape.target import Surface, make_surface
from shellform.surface.shape.triangles import area_vectors
from shellform.surface.units import downwards, turned_back, turned_up, unit_factor

ENDINGS = {
    ".step": "step", ".stp": "step", ".iges": "iges", ".igs": "iges", ".brep": "brep", ".brp": "brep",
    ".3dm": "3dm",
    ".stl": "stl", ".obj": "obj", ".ply": "ply", ".off": "off", ".gltf": "gltf", ".glb": "gltf",
    ".vtk": "vtk", ".vtu": "vtu", ".vts": "vts",
    ".vtp": "vtp", ".msh": "msh", ".json": "compas",
}  # fmt: skip
FORMATS = {
    "step": "STEP", "iges": "IGES", "brep": "OpenCASCADE BREP", "3dm": "Rhino 3DM", "stl": "STL",
    "obj": "OBJ", "ply": "PLY",
    "off": "OFF", "gltf": "glTF", "vtk": "VTK", "vtu": "VTU", "vtp": "VTP", "vts": "VTS", "msh": "MSH",
    "compas": "COMPAS JSON",
}  # fmt: skip
_HEAD = 65536  # bytes, by which a file's format is told
_UPRIGHT = 0.25  # plan over area, below which a shell is likely to lie on its side
_STATED_UNIT = ("step", "iges", "3dm")
_STATED_UP = ("gltf",)  # formats that say which axis is vertical
_TURNED = "its {} axis is taken for the vertical: with z up it would lie on its side (surface.up, --up)"
# that are taken for the vertical, in this order, where a shell would lie on its side; z is looked at first
_OTHER_AXES = ("y", "x")
_RAGGED = "its edge is toothed and was left so: rods end along a smooth line, so trim it to one if teeth aren't meant"
_LEVEL = 0.01  # of the rise: points as high as others
_COARSE = 1e-4  # of the extent, that coordinates lie apart: rounding bends what is flat
_STEPS = (
    "its coordinates are numbers of 32 bits, {:.2g} m apart so far from the origin, which creases it: export it nearer to "
    "its origin, or in a format of 64 bits (OBJ, STEP, 3DM)"
)
_NARROW = 0.05  # of the larger extent: openings that aren't as wide lie between two rods, as far apart as these usually are
_NARROW_TOLD = (
    "{} narrower than a twentieth of its extent: what is narrower than rods are apart `new` closes, and an edge beam goes "
    "round each other one; --fill holes (surface.fill) closes all"
)
_HANGS = "its highest point lies on its edge and its lowest does not: where it is drawn as it hangs, turn it over (surface.up, --up {})"
_UPRIGHT_AS_READ = "it stands upright, with a plan of {:.0f} % of its area"
_OWN = {
    "obj": plain.read_obj,
    "off": plain.read_off,
    "stl": plain.read_stl,
    "compas": compas.read_compas,
}
_OTHERS = {  # the first bytes of what people also send
    b"PK\x03\x04": "a zip archive (3MF, IFCZIP and others)",
    b"\x1f\x8b": "compressed with gzip",
    b"AC10": "an AutoCAD drawing",
    b"Kaydara FBX": "an FBX scene",
    b"BLENDER": "a Blender file",
    b"%PDF": "a PDF",
}


def read_surface(
    path: str | Path,
    *,
    unit: str | None = None,
    up: str | None = None,
    size: float | None = None,
    layer: str = "",
    name: str = "",
    face: str | None = None,
    piece: int | None = None,
    fill: str | None = None,
    fill_narrower: float = 0.0,
    ground: float | None = None,
) -> Surface:
    """The surface in a file, in metres, z up.

    - `unit`: of files that state none; left out: "m".
    - `up`: the file's vertical axis, "x", "y" or "z", "-z" where it points down; left out: the format's, and
      where that has none z, but y, or else x, for a shell that lies on its side with z up and not with that.
    - `size`, m: of the mesh on CAD surfaces.
    - `layer`, `name`: the objects that are meant.
    - `face`: of a closed solid, "upper" or "lower".
    - `piece`: of several separate ones, 1 being the largest.
    - `fill`: "holes", "edges" or "all" closes openings (fills.py), edges down to the `ground`, m; left out:
      the edge's lowest point.
    - `fill_narrower`, m: closes holes narrower than that, whatever else is closed.

    `mended` of the result tells what was done. Raises InputError.
    """
    file = Path(path)
    kind = kind_of(file)
    if kind == "compas" and compas_surfaces.holds_surfaces(file) and not compas.holds_meshes(file):
        kind = "compas surface"
    if unit is not None:
        unit_factor(unit)
    turned_up(np.zeros((0, 3)), up or "z")  # refuses an unknown axis before the work
    if face not in (None, "upper", "lower"):
        raise InputError(
            "must be upper or lower",
            where="surface.face",
            value=face,
            remedy="Leave it out for a file that holds a surface and no solid.",
        )

    def whole(axis: str | None) -> tuple[Draft, str]:
        """What is in the file, mended, and which of its axes is vertical."""
        if kind in _OWN:
            draft = _OWN[kind](file, Choice(layer, name))
        else:
            settings = {
                "unit": unit,
                "size": size,
                "up": axis or "z",
                "layer": layer,
                "name": name,
                "face": face,
            }
            draft = foreign.read_foreign(file, kind, settings)
        step = _step_of_32_bits(draft)
        if step > 0.0:
            metres = unit_factor(unit or "m") if draft.metres is None else draft.metres
            draft = noted(draft, _STEPS.format(metres * step))
        vertical = axis or draft.up
        return mended(_upright(draft, unit, vertical), str(file), face=face, piece=piece), vertical

    as_given, vertical = whole(up)
    # told from the skin as it is: what fills its openings depends on the axis
    if up is None and kind not in _STATED_UP and _plan_share(as_given.points, as_given.triangles) < _UPRIGHT:
        for axis in _OTHER_AXES:
            turned, _ = whole(axis)
            if _plan_share(turned.points, turned.triangles) >= _UPRIGHT:
                return _closed(
                    noted(turned, _TURNED.format(axis)), axis, str(file), fill, fill_narrower, ground
                )
    return _closed(as_given, vertical, str(file), fill, fill_narrower, ground)


def surface_of(
    draft: Draft,
    source: str,
    *,
    face: str | None = None,
    piece: int | None = None,
    fill: str | None = None,
    ground: float | None = None,
) -> Surface:
    """A draft in metres, z up, mended and closed as `read_surface` says."""
    return _closed(mended(draft, source, face=face, piece=piece), "z", source, fill, 0.0, ground)


def _closed(
    whole: Draft, vertical: str, source: str, fill: str | None, narrower: float, ground: float | None
) -> Surface:
    """Of a mended draft whose `vertical` is that axis of its file, its openings closed where that is asked
    for."""
    if fill is not None or narrower > 0.0:
        whole = filled(whole, source, what=fill, narrower=narrower, ground=ground)
    surface = make_surface(whole.points, whole.triangles, normals=whole.normals, source=source)
    notes = (*whole.notes, *surface.mended, *_doubts(surface, vertical))
    return Surface(surface.vertices, surface.triangles, surface.normals, source, notes)


def _doubts(surface: Surface, vertical: str) -> tuple[str, ...]:
    """What tells that a surface's edge is no line that rods can end along, that openings are hardly meant, or
    that another axis of its file is the vertical one, with that axis."""
    doubts = list[str]()
    if any(is_ragged(surface.vertices, loop) for loop in surface.boundary):
        doubts.append(_RAGGED)
    widths = [width_of(surface.vertices, loop) for loop in surface.boundary[1:]]
    narrow = sum(width < _NARROW * float(surface.size.max()) for width in widths)
    if narrow:
        doubts.append(_NARROW_TOLD.format(how_many(narrow, "opening is", "openings are")))
    plan = _plan_share(surface.vertices, surface.triangles)
    if plan >= _UPRIGHT:
        return (*doubts, *([_HANGS.format(downwards(vertical))] if _hangs(surface.vertices, surface) else []))
    told = _UPRIGHT_AS_READ.format(100.0 * plan)
    as_in_file = turned_back(surface.vertices, vertical)
    for axis in ("z", *_OTHER_AXES):
        points = turned_up(as_in_file, axis)
        if _plan_share(points, surface.triangles) >= _UPRIGHT:
            found = downwards(axis) if _hangs(points, surface) else axis
            return (*doubts, f"{told}: give its {found} axis for the vertical (surface.up, --up {found})")
    return (*doubts, f"{told}, and so it does with any other of its axes for the vertical")


def _step_of_32_bits(draft: Draft) -> float:
    """How far apart coordinates lie that are numbers of 32 bits, in the file's unit, where that is too far
    for a shell; else 0."""
    points = draft.points
    with np.errstate(over="ignore"):
        rounded = points.astype(np.float32)
    if not len(points) or not np.array_equal(rounded, points):
        return 0.0
    step = float(np.spacing(np.abs(rounded).max()))
    return step if step > _COARSE * float(np.ptp(points, axis=0).max()) else 0.0


def _hangs(points: Reals, surface: Surface) -> bool:
    """Whether a surface whose vertices are turned to these `points` (v, 3) looks like a form that hangs from
    its edge: its highest point lies on that, and its lowest doesn't."""
    level = points[:, 2]
    edge = level[np.concatenate(surface.boundary)] if surface.boundary else level
    slack = _LEVEL * float(np.ptp(level))
    return bool(edge.max() >= level.max() - slack and edge.min() > level.min() + slack)


def kind_of(file: Path) -> str:
    """The format of a file, one of ENDINGS' values. Raises InputError for what can't be read here."""
    require_file(file)
    size = file.stat().st_size
    if size == 0:
        raise InputError("is empty", where=str(file), remedy="Copy or export it anew.")
    if size > MOST_BYTES:
        raise InputError(
            f"is {size / 1024**2:,.0f} MB large; up to {MOST_BYTES / 1024**2:.0f} MB are read",
            where=str(file),
            remedy="Export a coarser mesh, or the surface alone.",
        )
    stated = ENDINGS.get(file.suffix.lower())
    try:
        with file.open("rb") as opened:
            head = opened.read(_HEAD)
    except OSError as error:
        raise InputError(unreadable(error), where=str(file), remedy="Check its permissions.") from error
    for first, what in _OTHERS.items():
        if head.startswith(first):
            raise InputError(
                f"is {what}, which isn't read here", where=str(file), remedy=f"Known: {', '.join(ENDINGS)}."
            )
    found = _content(head, file)
    if stated is None and found is None:
        raise InputError(
            "is in no format that is read here",
            where=str(file),
            value=file.suffix,
            remedy=f"Known: {', '.join(ENDINGS)}.",
        )
    if stated is not None and found is not None and stated != found:
        ending = next(each for each, kind in ENDINGS.items() if kind == found)
        raise InputError(
            f"is {FORMATS[found]} by its content, though its ending is {file.suffix}",
            where=str(file),
            remedy=f"Rename it to {file.stem}{ending}, or export it anew.",
        )
    return stated or found or ""


def states_unit(file: Path) -> bool:
    """Whether a file is of a format that states its own unit, so that none may be given."""
    return file.is_file() and kind_of(file) in _STATED_UNIT


def _content(head: bytes, file: Path) -> str | None:
    """What the first bytes say; None where they say nothing."""
    text = head.lstrip(b"\xef\xbb\xbf \t\r\n")
    marks = {
        b"ISO-10303-21": "step",
        b"3D Geometry File Format": "3dm",
        b"glTF": "gltf",
        b"# vtk DataFile": "vtk",
        b"ply\n": "ply",
        b"ply\r": "ply",
        b"$MeshFormat": "msh",
        b"$NOD": "msh",
        b"DBRep_DrawableShape": "brep",
        b"CASCADE Topology": "brep",
    }
    for mark, kind in marks.items():
        if text.startswith(mark):
            return kind
    if re.match(rb"(ST|C|N|4|n)*OFF\s", text):
        return "off"
    if b"<VTKFile" in text[:1024]:
        xml = {
            b'type="PolyData"': "vtp",
            b'type="UnstructuredGrid"': "vtu",
            b'type="StructuredGrid"': "vts",
        }
        return next((kind for mark, kind in xml.items() if mark in text[:2048]), None)
    if text.startswith(b"{"):
        data = file.read_bytes()
        return "gltf" if b'"asset"' in data and b'"bufferViews"' in data else "compas"
    if re.match(rb"[^\r\n]{72}S[ 0]*1\s", head):
        return "iges"
    facets = int.from_bytes(head[80:84], "little")
    if len(head) >= 84 and file.stat().st_size == 84 + 50 * facets:
        return "stl"
    if text[:5].lower() == b"solid" and b"facet" in text:
        return "stl"
    if b"\0" not in head and re.search(rb"(?m)^v[ \t]+[-+\d.]", head):
        return "obj"
    return None


def _plan_share(points: Reals, triangles: Indices) -> float:
    """Of its area, the plan's: little where a shell lies on its side."""
    area = area_vectors(points, triangles)
    return abs(float(area[:, 2].sum())) / float(np.linalg.norm(area, axis=1).sum())


def _upright(draft: Draft, unit: str | None, vertical: str) -> Draft:
    """The draft in metres and z up."""
    factor = unit_factor(unit or "m") if draft.metres is None else draft.metres
    normals = None if draft.normals is None else turned_up(draft.normals, vertical)
    points = factor * turned_up(draft.points, vertical)
    return replace(draft, points=points, normals=normals, metres=1.0, up="z")
