"""Saving a net: net.json for others (documentation/reference/run.md), net.npz for shellform itself."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import read_arrays
from shellform.errors import ANEW, InputError
from shellform.net.cover import BarePatch, Cover
from shellform.net.grid import Grid, GridRod
from shellform.net.limits import NetLimits
from shellform.net.net import EdgeLine, Net, Stretch
from shellform.net.notes import NetNote, NoteKind
from shellform.net.quality import MAPS, Quality
from shellform.net.refusal import Attempt, Change, Reason
from shellform.structure.elements.state import State
from shellform.written import write_arrays


def net_document(net: Net) -> dict[str, Any]:
    """The content of net.json."""
    grid, place = net.grid, net.target.positions
    flat = grid.flat[grid.crossing_nodes].mean(axis=1)
    return {
        "spacing": net.spacing,
        "spacing_v": net.grid.spacing_v,
        "crossings": [
            {"lattice": lattice, "flat": flat_place, "target": target}
            for lattice, flat_place, target in zip(
                grid.lattice.tolist(), flat[:, :2].tolist(), net.crossings.tolist(), strict=True
            )
        ],
        "rods": [
            {
                "direction": rod.direction,
                "index": rod.index,
                "length": rod.length,
                "marks": rod.marks.tolist(),
                "crossings": rod.crossings.tolist(),
                "ends": place[rod.nodes[[0, -1]]].tolist(),
            }
            for rod in grid.rods
        ],
        "supports": place[net.supports].tolist(),
        "edges": [
            {"kind": each.kind, "name": each.name, "opening": each.opening, "points": each.points.tolist()}
            for each in net.stretches
        ],
        "edge_beams": [
            {"name": line.name, "closed": line.closed, "points": place[line.nodes].tolist()}
            for line in net.edges
        ],
    }


def save_net(path: Path, net: Net) -> None:
    """Writes the net so that `load_net` gives the same."""
    grid = net.grid
    arrays: dict[str, Any] = {
        "flat": grid.flat,
        "lattice": grid.lattice,
        "crossing_nodes": grid.crossing_nodes,
        "positions": net.target.positions,
        "quaternions": net.target.quaternions,
        "supports": net.supports,
        **{f"map_{name}": getattr(net.quality, name) for name in MAPS},
        "directions": np.array([rod.direction for rod in grid.rods]),
        "meta": np.array(
            json.dumps(
                {
                    "spacing": grid.spacing,
                    "spacing_v": grid.spacing_v,
                    "gap": grid.gap,
                    "quality": net.quality.summary(),
                    **({} if net.cover is None else {"cover": asdict(net.cover)}),
                    **({} if net.limits.ground is None else {"ground": net.limits.ground}),
                    "notes": [[note.kind.value, note.text] for note in net.notes],
                    "indices": [rod.index for rod in grid.rods],
                    **({"attempts": [_row(each) for each in net.attempts]} if net.attempts else {}),
                    "edges": [{"closed": line.closed, "name": line.name} for line in net.edges],
                    "stretches": [
                        {"kind": each.kind, "name": each.name, "opening": each.opening, "whole": each.whole}
                        for each in net.stretches
                    ],
                }
            )
        ),
    }
    if net.limits.plan is not None:
        arrays["outline"] = net.limits.plan
    for k, line in enumerate(net.edges):
        arrays[f"edge_{k}_nodes"], arrays[f"edge_{k}_clamps"] = line.nodes, line.clamps
    for k, stretch in enumerate(net.stretches):
        arrays[f"stretch_{k}_points"] = stretch.points
    for name in ("nodes", "arc", "crossings", "at"):
        pieces = [getattr(rod, name) for rod in grid.rods]
        arrays[f"rod_{name}"] = np.concatenate(pieces)
        arrays[f"rod_{name}_ends"] = np.cumsum([len(piece) for piece in pieces])
    write_arrays(path, **arrays)


def _cover(saved: dict[str, Any]) -> Cover:
    patches = (BarePatch(each["area"], tuple(each["place"]), each["away"]) for each in saved["patches"])
    return Cover(saved["area"], tuple(patches))


def _note(saved: str | list[str]) -> NetNote:
    """A saved note: its kind and text, or as before version 0.3 the text alone."""
    if isinstance(saved, str):
        return NetNote(NoteKind.OTHER, saved)
    kind, text = saved
    return NetNote(NoteKind(kind), text)


def load_net(path: Path) -> Net:
    """The net written by `save_net`. Raises InputError where the file is missing or damaged."""
    data = read_arrays(path)
    try:
        meta = json.loads(str(data["meta"]))
        pieces = {
            name: np.split(data[f"rod_{name}"], data[f"rod_{name}_ends"][:-1])
            for name in ("nodes", "arc", "crossings", "at")
        }
        rods = tuple(
            GridRod(str(direction), index, *(pieces[name][k] for name in ("nodes", "arc", "crossings", "at")))
            for k, (direction, index) in enumerate(zip(data["directions"], meta["indices"], strict=True))
        )
        grid = Grid(
            data["flat"],
            rods,
            data["lattice"],
            data["crossing_nodes"],
            meta["spacing"],
            meta["gap"],
            meta["spacing_v"],
        )
        quality = Quality(**meta["quality"], **{name: data[f"map_{name}"] for name in MAPS})
        target = State(data["positions"], data["quaternions"])
        attempts = tuple(_attempt(row) for row in meta.get("attempts", ()))
        notes = tuple(map(_note, meta["notes"]))
        edges = tuple(
            EdgeLine(data[f"edge_{k}_nodes"], data[f"edge_{k}_clamps"], **each)
            for k, each in enumerate(meta["edges"])
        )
        stretches = tuple(
            Stretch(points=data[f"stretch_{k}_points"], **each) for k, each in enumerate(meta["stretches"])
        )
        return Net(
            grid=grid,
            target=target,
            supports=data["supports"],
            quality=quality,
            cover=_cover(meta["cover"]) if "cover" in meta else None,
            limits=NetLimits(meta.get("ground"), data.get("outline")),
            notes=notes,
            attempts=attempts,
            edges=edges,
            stretches=stretches,
        )
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, IndexError, AttributeError, OverflowError) as error:
        raise InputError(f"is damaged: {error}", where=str(path), remedy=ANEW) from error


def _row(attempt: Attempt) -> list[Any]:
    reason = attempt.reason.name if attempt.reason else None
    return [attempt.change.name, attempt.angle, list(attempt.offset), reason, attempt.factorisations]


def _attempt(row: list[Any]) -> Attempt:
    change, angle, offset, reason, *taken = row  # what pulls took isn't there in nets of before version 0.5
    place = (float(offset[0]), float(offset[1]))
    return Attempt(Change[change], float(angle), place, Reason[reason] if reason else None, *map(int, taken))
