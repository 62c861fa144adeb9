"""COMPAS meshes in JSON, as RHINOVault's successors and other COMPAS programs write them.

A file is one mesh, or a session with a scene of several; each is found by its `vertex` and `face` tables, in
the layouts of COMPAS 0 and 1 (`dva`, faces as lists) and 2 (`default_vertex_attributes`, `facedata`). Of a
RHINOVault session the `ThrustDiagram` is the shell, and a `ForceDiagram`, whose coordinates are forces, is
none; faces marked as without load are openings. A file without a mesh may hold a network (`node` and `edge`
tables, as force density programs write): the faces between its lines are the shell.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, how_many
from shellform.surface.readers.draft import Choice, Draft, MeshObject, first_names, joined, told_apart
from shellform.surface.readers.network_faces import faces_in_plan

_SHELL, _FORCES = "ThrustDiagram", "ForceDiagram"
_UNSOLVED = "the thrust diagram is flat as yet: solve its vertical equilibrium and save the session anew"
_LOADED = ("_is_loaded", "is_loaded")  # of a face, as later and earlier versions call it


def holds_meshes(file: Path) -> bool:
    """Whether a file of COMPAS holds a mesh, or a network."""
    data = json.loads(file.read_bytes())
    return any(True for joins in (("vertex", "face"), ("node", "edge")) for _ in _tables(data, "", *joins))


def read_compas(file: Path, choice: Choice) -> Draft:
    """The mesh in a COMPAS file, or the one of its meshes that `choice` names. Raises InputError for what
    can't be used.
    """
    try:
        data = json.loads(file.read_text(encoding="utf-8-sig"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"isn't whole JSON: {error}", where=str(file), remedy="Save it anew.") from error
    found = list(_tables(data, "", "vertex", "face"))
    networks = [] if found else list(_tables(data, "", "node", "edge"))
    if not found and not networks:
        raise InputError(
            "holds no COMPAS mesh",
            where=str(file),
            remedy="Save a compas.datastructures.Mesh, a NURBS surface, or a RHINOVault session; a Brep as STEP.",
        )
    kind, read = ("network", partial(_between_lines, str(file))) if networks else ("mesh", _part)
    found = found or networks
    named = [(name, table) for name, table in found if name == _SHELL]
    if not choice.name and not choice.layer and named:
        found = named[-1:]
    else:
        found = _told_apart(found, but=None if choice.name else _FORCES)
    if not choice.name and len(found) > 1:
        raise InputError(
            f"holds {len(found)} {'networks' if networks else 'meshes'}",
            where=str(file),
            remedy=f"Choose by surface.object (--object) among {first_names([n for n, _ in found])}.",
        )
    parts, openings = [], 0
    for name, table in found:
        try:
            part, left_out = read(name, table)
        except InputError:
            raise
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise InputError(
                f"its {kind} {name} is damaged: {error!r}", where=str(file), remedy="Save it anew."
            ) from error
        parts.append(part)
        openings += left_out
    draft = joined(parts, choice, str(file))
    notes = [f"the mesh {found[0][0]} was taken"] if len(found) == 1 and found[0][0] else []
    if networks:
        notes = [f"the faces between the lines of {choice.name or found[0][0] or 'a network'} were taken"]
    if openings:
        notes.append(
            how_many(
                openings,
                "face without load was left out as an opening",
                "faces without load were left out as openings",
            )
        )
    if [name for name, _ in found] == [_SHELL] and not np.ptp(draft.points[:, 2]):
        notes.append(_UNSOLVED)
    return replace(draft, notes=tuple(notes))


def _tables(data: Any, name: str, points: str, joins: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables that hold one of `points` and one of what `joins` them, with the name or the kind of the
    object around each."""
    if isinstance(data, list):
        for each in data:
            yield from _tables(each, name, points, joins)
    elif isinstance(data, dict):
        kind = str(data.get("dtype") or data.get("datatype") or "").replace("/", ".").rsplit(".", 1)[-1]
        stated = data.get("attributes")
        called = str(data.get("name") or (isinstance(stated, dict) and stated.get("name")) or kind or name)
        if isinstance(data.get(points), dict) and isinstance(data.get(joins), dict):
            yield called, data
        else:
            for key, each in data.items():
                yield from _tables(each, called or key, points, joins)


def _told_apart(
    found: list[tuple[str, dict[str, Any]]], *, but: str | None
) -> list[tuple[str, dict[str, Any]]]:
    """The objects by names of which none is empty and none there twice, where there are several; without
    those called `but`, unless all are. Each keeps its number whether these are left out or not."""
    apart = told_apart([name for name, _ in found], "mesh")
    kept = [k for k, (name, _) in enumerate(found) if name != but] or list(range(len(found)))
    return [found[k] for k in kept] if len(kept) == 1 else [(apart[k], found[k][1]) for k in kept]


def _part(name: str, table: dict[str, Any]) -> tuple[MeshObject, int]:
    """The mesh, and how many of its faces are openings."""
    number, points = _places(
        table["vertex"], table.get("default_vertex_attributes") or table.get("dva") or {}
    )
    shared = table.get("facedata") or {}
    whole = dict(table.get("default_face_attributes") or table.get("dfa") or {})
    faces, openings = [], 0
    for key, face in table["face"].items():
        if face is None:
            continue
        told = {**whole, **(shared.get(key) or {})}
        if not all(told.get(each, True) for each in _LOADED):
            openings += 1
            continue
        corners = [number[str(each)] for each in face]
        if len(corners) > 1 and corners[0] == corners[-1]:
            corners.pop()
        faces.append(corners)
    return MeshObject(name, "", points, _by_corners(faces)), openings


def _between_lines(where: str, name: str, table: dict[str, Any]) -> tuple[MeshObject, int]:
    """The mesh of the faces between a network's lines, none of them known as an opening."""
    number, points = _places(table["node"], table.get("default_node_attributes") or table.get("dna") or {})
    lines = [(number[str(a)], number[str(b)]) for a, others in table["edge"].items() for b in others]
    faces = faces_in_plan(points, np.array(lines, dtype=np.int64).reshape(-1, 2), where)
    return MeshObject(name, "", points, _by_corners(faces)), 0


def _places(table: dict[str, Any], others: Mapping[str, Any]) -> tuple[dict[str, int], Reals]:
    """The row of each key, and the points (v, 3); `others` are what holds where a point has no coordinate."""
    default = {"x": 0.0, "y": 0.0, "z": 0.0, **others}
    points = [[float(each.get(axis, default[axis])) for axis in "xyz"] for each in table.values()]
    return {str(key): row for row, key in enumerate(table)}, np.array(points).reshape(-1, 3)


def _by_corners(faces: Iterable[list[int]]) -> tuple[Indices, ...]:
    """The faces of each number of corners from three on (f, k)."""
    blocks: dict[int, list[list[int]]] = {}
    for corners in faces:
        blocks.setdefault(len(corners), []).append(corners)
    return tuple(np.array(each, dtype=np.int64) for size, each in blocks.items() if size > 2)
