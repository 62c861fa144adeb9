"""What a reader hands over: triangles in the file's own unit and axes, not yet mended, and the choice among a
file's objects.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.errors import InputError, how_many, require_number
from shellform.quantities import LENGTHS, if_other_unit
from shellform.surface.shape.triangles import area_vectors, used_points

_MOST_CORNERS = 1000  # of a face: cutting its ears takes seconds
MOST_TRIANGLES = 2_000_000  # of one surface: they take 4 GB (allowance.py)
MOST_BYTES = 512 * 1024**2  # of one file
MOST_SOLIDS = 50  # of one file, whose faces are looked at: no shell hangs together of more
_NAMES_TOLD = 12  # of layers and objects, in one message
_COARSE = 2.0  # times a surface's larger side: no triangle of it is so large
_TRIANGLES = 2.5  # in a square of the mesh size, with what a surface's rise adds to its plan
_ENTRIES = ("surface.layer", "surface.object")


@dataclass(frozen=True, eq=False)
class Draft(Record):
    """`points` (v, 3) in units of `metres` m (None: the file doesn't say) with the vertical axis `up`;
    `triangles` (t, 3); unit `normals` (v, 3) where the source knows them, zero where it knows others;
    `notes`, a sentence for each thing left out or chosen; `objects`, what the file's objects that it is made
    of are called, "" where one of them has no name; `of_solid`, whether it is that face of a solid which was
    asked for."""

    points: Reals
    triangles: Indices
    normals: Reals | None = None
    metres: float | None = None
    up: str = "z"
    notes: tuple[str, ...] = ()
    objects: tuple[str, ...] = ()
    of_solid: bool = False


def without_unused(draft: Draft) -> Draft:
    """The draft without points that no triangle has."""
    used, faces = used_points(draft.triangles, len(draft.points))
    normals = None if draft.normals is None else draft.normals[used]
    return replace(draft, points=draft.points[used], triangles=faces, normals=normals)


@dataclass(frozen=True, eq=False)
class MeshObject(Record):
    """One object of a file: `points` (v, 3) and its `faces`, arrays (f, k) of polygons with k corners
    each. Objects that share their points, as an OBJ's do, have one array of them.
    """

    name: str
    layer: str
    points: Reals
    faces: tuple[Indices, ...]


@dataclass(frozen=True)
class Choice:
    """Which objects of a file are the surface: those on a `layer`, or of a `name`; "" stands for any."""

    layer: str = ""
    name: str = ""


@dataclass(frozen=True)
class Meshing:
    """How a CAD file's surfaces are meshed: at about `size`, m (None: a sixtieth of the plan), of a solid its
    "upper" or "lower" `face`, where `up` is the file's vertical axis; `begins` is told about how many
    triangles there will be."""

    size: float | None = None
    up: str = "z"
    face: str | None = None
    begins: Callable[[float], None] = lambda triangles: None


def noted(draft: Draft, note: str) -> Draft:
    """The draft with one more note."""
    return replace(draft, notes=(*draft.notes, note))


def among(labels: Sequence[tuple[str, str]], choice: Choice, where: str) -> Flags:
    """Which of the objects with these (layer, name) `labels` are meant (n,). Raises InputError that lists
    what there is.
    """
    kept = np.ones(len(labels), dtype=bool)
    for column, (wanted, entry) in enumerate(zip((choice.layer, choice.name), _ENTRIES, strict=True)):
        if not wanted:
            continue
        kept &= [_is_called(label[column], wanted) for label in labels]
        if not kept.any():
            known = Counter(label[column] for label in labels if label[column])
            listed = ", ".join(
                f"{name!r}" + (f" ({n})" if n > 1 else "") for name, n in known.most_common(_NAMES_TOLD)
            )
            more = f" and {len(known) - _NAMES_TOLD} more" if len(known) > _NAMES_TOLD else ""
            remedy = f"There are {listed}{more}." if listed else "None has a name."
            if any(_is_called(label[1 - column], wanted) for label in labels):
                remedy = f"A{' layer' if column else 'n object'} is called so: {_ENTRIES[1 - column]}."
            raise InputError(
                f"{where} has no such surface",
                where=entry,
                value=wanted,
                remedy=remedy,
            )
    return kept


def _is_called(name: str, wanted: str) -> bool:
    """Whether a full name, or the last part of a layer's path "A::B", is the one wanted, in whatever case."""
    return wanted.casefold() in (name.casefold(), name.rsplit("::", 1)[-1].casefold())


def called(layer: str, name: str) -> str:
    """What an object is told by: its name, and its layer; "" where it has neither."""
    return " on ".join([*([repr(name)] if name else []), *([f"layer {layer!r}"] if layer else [])])


def told_apart(names: Sequence[str], kind: str) -> list[str]:
    """The names of a file's objects, of which none is empty then and none there twice: with its number, from
    1, after one that was, or after the `kind`."""
    times = Counter(names)
    return [
        name if name and times[name] < 2 else f"{name or kind} {number}"
        for number, name in enumerate(names, 1)
    ]


def choosable(draft: Draft) -> str:
    """How one of the file's objects is chosen, and what they are called; "" where there is one, or where
    names and layers don't tell them apart."""
    known = list(dict.fromkeys(each for each in draft.objects if each))
    if len(known) < 2:
        return ""
    return f"by surface.object or surface.layer (--object, --layer), among {first_names(known)}"


def first_names(names: Sequence[str]) -> str:
    """As many names as one message has room for, and how many more there are."""
    more = f" and {len(names) - _NAMES_TOLD} more" if len(names) > _NAMES_TOLD else ""
    return f"{', '.join(names[:_NAMES_TOLD])}{more}"


def joined(parts: Sequence[MeshObject], choice: Choice, where: str) -> Draft:
    """All chosen parts as one mesh of triangles, points that they share once. Raises InputError where there
    is no face."""
    if not any(len(block) for part in parts for block in part.faces):
        raise InputError(
            "holds no faces, only points or lines", where=where, remedy="Export the surface, or a mesh of it."
        )
    chosen = among([(p.layer, p.name) for p in parts], choice, where)
    kept = [part for part, meant in zip(parts, chosen, strict=True) if meant]
    points, triangles, count = list[Reals](), list[Indices](), 0
    begins: dict[int, int] = {}  # where the parts' points stand in the whole, by which array they are
    for part in kept:
        if id(part.points) not in begins:
            check_points(part.points, where)
            begins[id(part.points)] = count
            points.append(part.points)
            count += len(part.points)
        for block in part.faces:
            if len(block) and not (block.min() >= 0 and block.max() < len(part.points)):
                raise InputError(
                    f"a face names vertex {1 + int(block.max() if block.min() >= 0 else block.min())}, of "
                    f"{len(part.points)}",
                    where=where,
                    remedy="Export the mesh anew.",
                )
            if block.shape[1] > _MOST_CORNERS:
                raise InputError(
                    f"has a face of {block.shape[1]:,} corners; up to {_MOST_CORNERS:,} are read",
                    where=where,
                    remedy="Export triangles.",
                )
            triangles.append(triangulated(part.points, block) + begins[id(part.points)])
    faces = np.vstack([np.zeros((0, 3), dtype=np.int64), *triangles])
    if len(faces) > MOST_TRIANGLES:
        raise InputError(
            f"has {len(faces):,} triangles; up to {MOST_TRIANGLES:,} are read",
            where=where,
            remedy="Export a coarser mesh.",
        )
    whole = np.vstack(points)
    # What is left out alone has points that are no loose ones, of which notes would tell.
    others = np.zeros(len(whole), dtype=bool)
    for part, meant in zip(parts, chosen, strict=True):
        if not meant and id(part.points) in begins:
            for block in part.faces:
                inside = block[(block >= 0) & (block < len(part.points))]
                others[inside + begins[id(part.points)]] = True
    others[faces.ravel()] = False
    return Draft(
        whole[~others],
        (np.cumsum(~others) - 1)[faces],
        objects=tuple(called(p.layer, p.name) for p in kept if any(map(len, p.faces))),
    )


def require_mesh_size(size: float, length: float, width: float, *, where: str, give: str) -> float:
    """About how many triangles of that size, m, a surface of `length` × `width`, m, gets. Raises InputError
    where these are too many, with the size that is possible, and for what is no size; `give` is what to give
    instead."""
    require_number(size, above=0.0, where=where, give=give)
    length, width = float(length), float(width)  # NumPy's warn where they overflow
    side = max(length, width)
    if size > _COARSE * side:
        raise InputError(
            f"is {size / side:.3g} times as large as a surface of {length:.3g} × {width:.3g} m",
            where=where,
            value=size,
            remedy=f"Give {give}.{if_other_unit(size, LENGTHS, side / 500.0, side / 10.0)}",
        )
    expected = _TRIANGLES * (length / size) * (width / size)
    if expected > MOST_TRIANGLES:
        possible = math.sqrt(_TRIANGLES * length * width / MOST_TRIANGLES)
        rounded = 10.0 ** (math.floor(math.log10(possible)) - 1)  # up to two digits
        raise InputError(
            f"would give more than {MOST_TRIANGLES:,} triangles on a surface of {length:.3g} × {width:.3g} m",
            where=where,
            value=size,
            remedy=f"Give {math.ceil(possible / rounded) * rounded:.2g} m or more, or check the surface's unit."
            + if_other_unit(size, LENGTHS, side / 500.0, side / 10.0),
        )
    return expected


def check_points(points: Reals, where: str) -> None:
    """Raises InputError that names the first vertex whose coordinates are no numbers."""
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        vertex, others = int(np.argmax(bad)), int(bad.sum()) - 1
        also = f", as {how_many(others, 'other has', 'others have')}" if others else ""
        raise InputError(
            f"vertex {vertex + 1} has a coordinate that is no number{also}",
            where=where,
            remedy="Export the mesh anew.",
        )


def triangulated(points: Reals, faces: Indices) -> Indices:
    """Triangles (t, 3) of polygons (f, k), no vertex moved: quadrilaterals along the diagonal that folds
    less, others by cutting ears.
    """
    if faces.shape[1] < 3:
        return np.zeros((0, 3), dtype=np.int64)
    if faces.shape[1] == 3:
        return faces.astype(np.int64)
    if faces.shape[1] > 4:
        return np.vstack([_ears(points, face) for face in faces]).astype(np.int64)
    first = np.stack([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]], axis=1)
    second = np.stack([faces[:, [0, 1, 3]], faces[:, [1, 2, 3]]], axis=1)
    flatter = (_fold(points, first) >= _fold(points, second))[:, None, None]
    return np.where(flatter, first, second).reshape(-1, 3).astype(np.int64)


def _fold(points: Reals, pairs: Indices) -> Reals:
    """Cosine (f,) of the angle between the normals of two triangles each (f, 2, 3)."""
    normal = area_vectors(points, pairs)
    normal /= np.maximum(np.linalg.norm(normal, axis=2, keepdims=True), 1e-300)
    return np.asarray(np.sum(normal[:, 0] * normal[:, 1], axis=1))


def _ears(points: Reals, face: Indices) -> Indices:
    """Triangles (k - 2, 3) of one polygon, which may be concave: always the ear with the widest smallest
    angle is cut off.
    """
    corner = points[face]
    normal = 0.5 * np.cross(corner, np.roll(corner, -1, axis=0)).sum(axis=0)
    left, cut = list(range(len(face))), []
    while len(left) > 3:
        best, worth = 0, -np.inf
        for k in range(len(left)):
            a, b, c = left[k - 1], left[k], left[(k + 1) % len(left)]
            ear = corner[[a, b, c]]
            quality = _smallest_angle(ear)
            if np.dot(np.cross(ear[1] - ear[0], ear[2] - ear[0]), normal) <= 0.0:
                quality -= 10.0  # turned over: only where nothing else is left
            elif _any_inside(corner[[i for i in left if i not in (a, b, c)]], ear, normal):
                quality -= 5.0
            if quality > worth:
                best, worth = k, quality
        cut.append([left[best - 1], left[best], left[(best + 1) % len(left)]])
        del left[best]
    return face[np.array([*cut, left])]


def _smallest_angle(ear: Reals) -> float:
    sides = np.roll(ear, -1, axis=0) - ear
    unit = sides / np.maximum(np.linalg.norm(sides, axis=1, keepdims=True), 1e-300)
    return float(np.arccos(np.clip(-np.sum(unit * np.roll(unit, 1, axis=0), axis=1), -1.0, 1.0)).min())


def _any_inside(others: Reals, ear: Reals, normal: Reals) -> bool:
    side = [np.cross(ear[(k + 1) % 3] - ear[k], others - ear[k]) @ normal for k in range(3)]
    return bool((np.min(side, axis=0) > 0.0).any())
