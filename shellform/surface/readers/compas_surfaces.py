"""NURBS surfaces in COMPAS' JSON, which gmsh meshes.

Each is a table with its control points, weights, the different knots and how often each of them occurs
(`mults`). COMPAS writes a row of control points for each along u from Rhino, and for each along v from Open
CASCADE; the number of knots tells which. Where both fit, rows are taken to be along u, and where that makes
a difference, it is told.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.surface.readers.draft import Choice, Draft, Meshing, among, called, check_points, told_apart
from shellform.surface.readers.nurbs import Patch, with_end_knots
from shellform.surface.units import unit_factor

_ALL = {"points", "weights", "knots_u", "knots_v", "mults_u", "mults_v", "degree_u", "degree_v"}
_ROWS = "rows of control points are taken to run along u: where the surface is another, export it as STEP"


def surface_tables(data: Any, name: str = "") -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables of NURBS surfaces, with the name of the object around each; "" where it has none. Those of
    a Brep's faces, which are trimmed, are none."""
    if isinstance(data, list):
        for each in data:
            yield from surface_tables(each, name)
    elif isinstance(data, dict) and not str(data.get("dtype")).endswith("/Brep"):
        called = str(data.get("name") or name)
        if data.keys() >= _ALL:
            yield called, data
        else:
            for each in data.values():
                yield from surface_tables(each, called)


def holds_surfaces(file: Path) -> bool:
    """Whether a file of COMPAS holds NURBS surfaces."""
    content = file.read_bytes()
    if b'"mults_u"' not in content:
        return False
    try:
        return any(True for _ in surface_tables(json.loads(content)))
    except (ValueError, RecursionError):  # which the reader of meshes tells
        return False


def read_compas_surfaces(
    file: Path,
    choice: Choice,
    meshing: Meshing,
    *,
    unit: str | None,
) -> Draft:
    """The NURBS surfaces of a COMPAS file that `choice` means, in m; the `unit` is m where it is left out.
    Raises InputError for what can't be used.
    """
    from shellform.surface import cad

    found = list(surface_tables(json.loads(file.read_text(encoding="utf-8-sig"))))
    names = told_apart([name for name, _ in found], "surface")
    kept = among([("", name) for name in names], choice, str(file))
    read = []
    for name, (_, table), meant in zip(names, found, kept, strict=True):
        if meant:
            try:
                read.append(_patch(table, unit_factor(unit or "m"), f"{file}, {name}"))
            except InputError:
                raise
            except (KeyError, TypeError, ValueError, OverflowError) as error:
                raise InputError(
                    f"its NURBS surface {name} is damaged: {error}", where=str(file), remedy="Save it anew."
                ) from error
    draft = cad.mesh_patches([patch for patch, _ in read], file, meshing)
    objects = tuple(called("", name) for name, meant in zip(names, kept, strict=True) if meant)
    notes = (*draft.notes, _ROWS) if any(either for _, either in read) else draft.notes
    return replace(draft, notes=notes, objects=objects)


def _patch(table: dict[str, Any], factor: float, where: str) -> tuple[Patch, bool]:
    """The surface, and whether rows of control points along v would make another."""
    points = np.array(table["points"], dtype=float)
    weights = np.array(table["weights"], dtype=float)
    if points.ndim != 3 or points.shape[2] != 3 or weights.shape != points.shape[:2]:
        raise ValueError(f"control points {points.shape} and weights {weights.shape}")
    check_points(points.reshape(-1, 3), where)
    degree = int(table["degree_u"]), int(table["degree_v"])
    vectors = tuple(
        np.repeat(np.array(table[f"knots_{way}"], dtype=float), np.array(table[f"mults_{way}"], dtype=int))
        for way in "uv"
    )
    if not all(np.isfinite(each).all() for each in (weights, *vectors)):
        raise ValueError("a weight or a knot is no number")
    rows, columns = points.shape[:2]
    along_u, along_v = (_fits(vectors, degree, counts) for counts in ((rows, columns), (columns, rows)))
    if not along_u and not along_v:
        raise InputError(
            f"{rows} × {columns} control points don't go with {len(vectors[0])} and {len(vectors[1])} knots of "
            f"degree {degree[0]} and {degree[1]}",
            where=where,
            remedy="Export it as STEP, and a closed surface cut open.",
        )
    if not along_u:
        points, weights = points.transpose(1, 0, 2), weights.T
    knots = tuple(
        vector if len(vector) == count + each + 1 else with_end_knots(vector, each)
        for vector, each, count in zip(vectors, degree, points.shape[:2], strict=True)
    )
    same = (
        degree[0] == degree[1]
        and len(knots[0]) == len(knots[1])
        and np.allclose(_scaled(knots[0]), _scaled(knots[1]))
    )
    return Patch(factor * points, weights, (knots[0], knots[1]), degree), along_u and along_v and not same


def _fits(vectors: tuple[Reals, ...], degree: tuple[int, int], counts: tuple[int, int]) -> bool:
    """Whether so many control points go with these knots, with or without the two that no surface depends
    on."""
    return all(
        each > 0 and len(vector) - count - each in (1, -1)
        for vector, each, count in zip(vectors, degree, counts, strict=True)
    )


def _scaled(knots: Reals) -> Reals:
    """The knots from 0 to 1."""
    return (knots - knots[0]) / (knots[-1] - knots[0])
