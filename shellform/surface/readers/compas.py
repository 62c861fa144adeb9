"""COMPAS meshes in JSON, as RHINOVault's successors and other COMPAS programs write them.

A file is one mesh, or a session with a scene of several; each is found by its `vertex` and `face` tables, in
the layouts of COMPAS 1 (`dva`, faces as lists) and 2 (`default_vertex_attributes`, `facedata`). Of a
RHINOVault session the `ThrustDiagram` is the shell; its faces marked as without load are openings.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shellform.errors import InputError
from shellform.surface.readers.draft import Choice, Draft, MeshObject, joined

_SHELL = "ThrustDiagram"


def read_compas(file: Path, choice: Choice) -> Draft:
    """The mesh in a COMPAS file, or the one of its meshes that `choice` names. Raises InputError for what
    can't be used.
    """
    try:
        data = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"isn't whole JSON: {error}", where=str(file), remedy="Save it anew.") from error
    found = list(_meshes(data, ""))
    if not found:
        raise InputError(
            "holds no COMPAS mesh",
            where=str(file),
            remedy="Save a compas.datastructures.Mesh, or a RHINOVault session.",
        )
    named = [(name, table) for name, table in found if name == _SHELL]
    if not choice.name and not choice.layer and named:
        found = named[-1:]
    elif not choice.name and len(found) > 1:
        raise InputError(
            f"holds {len(found)} meshes",
            where=str(file),
            remedy=f"Choose by surface.object (--object) among {', '.join(n for n, _ in found)}.",
        )
    parts, openings = [], 0
    for name, table in found:
        try:
            part, left_out = _part(name, table)
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise InputError(
                f"its mesh {name} is damaged: {error!r}", where=str(file), remedy="Save it anew."
            ) from error
        parts.append(part)
        openings += left_out
    draft = joined(parts, choice, str(file))
    notes = [f"the mesh {found[0][0]} was taken"] if len(found) == 1 and found[0][0] else []
    if openings:
        notes.append(f"{openings} faces without load were left out as openings")
    return Draft(draft.points, draft.triangles, notes=tuple(notes))


def _meshes(data: Any, name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables that look like a mesh, with the name or the kind of the object around each."""
    if isinstance(data, list):
        for each in data:
            yield from _meshes(each, name)
    elif isinstance(data, dict):
        kind = str(data.get("dtype") or data.get("datatype") or "").replace("/", ".").rsplit(".", 1)[-1]
        called = str(data.get("name") or kind or name)
        if isinstance(data.get("vertex"), dict) and isinstance(data.get("face"), dict):
            yield called, data
        else:
            for each in data.values():
                yield from _meshes(each, called)


def _part(name: str, table: dict[str, Any]) -> tuple[MeshObject, int]:
    """The mesh, and how many of its faces are openings."""
    default = {"x": 0.0, "y": 0.0, "z": 0.0} | dict(
        table.get("default_vertex_attributes") or table.get("dva") or {}
    )
    number = {str(key): row for row, key in enumerate(table["vertex"])}
    points = np.array(
        [[float(each.get(axis, default[axis])) for axis in "xyz"] for each in table["vertex"].values()]
    )
    shared = table.get("facedata") or {}
    whole = dict(table.get("default_face_attributes") or table.get("dfa") or {})
    blocks: dict[int, list[list[int]]] = {}
    openings = 0
    for key, face in table["face"].items():
        if face is None:
            continue
        if not ({**whole, **(shared.get(key) or {})}).get("_is_loaded", True):
            openings += 1
            continue
        corners = [number[str(each)] for each in face]
        if len(corners) > 1 and corners[0] == corners[-1]:
            corners.pop()
        blocks.setdefault(len(corners), []).append(corners)
    faces = tuple(np.array(each, dtype=np.int64) for size, each in blocks.items() if size > 2)
    return MeshObject(name, "", points.reshape(-1, 3), faces), openings
