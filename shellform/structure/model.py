"""The model file: one structural model as a JSON document (documentation/reference/model.md).

What the types of its document (model_document.py) can't say, ranges, signs and references, is checked on
whole arrays. Every refusal names the field and the element.
"""

from __future__ import annotations

from codecs import BOM_UTF8
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from shellform.arrays import Flags, Reals, Record, reals
from shellform.errors import InputError, unreadable
from shellform.structure.elements.beam import Beams, make_beams
from shellform.structure.elements.cable import Cables, make_cables
from shellform.structure.elements.state import State, from_vectors
from shellform.structure.model_document import (
    GivenBeam,
    GivenCable,
    GivenLoad,
    GivenSupport,
    ModelDocument,
    converted,
    decoded,
)
from shellform.structure.network import Network
from shellform.structure.refusals import check_node, components, node_pairs, positive
from shellform.written import whole

_SKEW, _EXACT = 1e-6, 1e-14  # of axes that are refused, and that are made square


@dataclass(frozen=True, eq=False)
class Model(Record):
    """`network`; `loads` by name, (n, 6) N and N·m; `start` state or None; `supported` (s,) nodes in the
    file's order.
    """

    network: Network
    loads: Mapping[str, Reals]
    start: State | None
    supported: tuple[int, ...]

    def __post_init__(self) -> None:
        shape = len(self.network.nodes), 6
        loads = {name: reals(f"loads.{name}", load, shape) for name, load in self.loads.items()}
        object.__setattr__(self, "loads", loads)


def read_model(path: str | Path) -> Model:
    """The model in a file. Raises InputError naming the field and the element."""
    file = Path(path)
    try:
        content = file.read_bytes().removeprefix(BOM_UTF8)
    except OSError as error:
        raise InputError(
            unreadable(error),
            where=str(file),
            remedy="Name a model file, such as RUN/designs/optimised.json.",
        ) from error
    try:
        document = decoded(content)
        del content
        return _model(document)
    except InputError as error:
        raise error.within(str(file)) from error


def parse_model(data: object) -> Model:
    """The model in a parsed JSON document, in which NumPy's numbers and arrays may stand. Raises InputError
    naming the field and the element."""
    return _model(converted(msgspec.to_builtins(data, enc_hook=_plain)))


def _plain(value: object) -> object:
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    raise InputError(
        f"holds a {type(value).__name__}",
        where="model",
        remedy="Give numbers, texts, lists and dictionaries.",
    )


def write_model(path: str | Path, model: Model) -> None:
    """Writes the model; numbers are written so that they are read back exactly. The file appears whole or not
    at all.
    """
    with whole(path) as partial:
        partial.write_bytes(msgspec.json.encode(_document(model)))


def _document(model: Model) -> dict[str, Any]:
    network, beams, cables = model.network, model.network.beams, model.network.cables
    document: dict[str, Any] = {
        "format": "shellform-model",
        "version": 1,
        "nodes": network.nodes.tolist(),
        "beams": [
            {
                "nodes": ends,
                "EA": ea,
                "GJ": gj,
                "EIy": ey,
                "EIz": ez,
                "z_axis": z,
                "rest_length": rest,
                "kind": beams.kinds[kind],
            }
            for ends, ea, gj, ey, ez, z, rest, kind in zip(
                beams.ends.tolist(),
                beams.axial.tolist(),
                beams.torsion.tolist(),
                beams.bending_y.tolist(),
                beams.bending_z.tolist(),
                beams.frames[:, 0, :, 2].tolist(),
                beams.rest_length.tolist(),
                beams.kind.tolist(),
                strict=True,
            )
        ],
        "cables": [
            {"nodes": ends, "EA": ea, "rest_length": rest}
            for ends, ea, rest in zip(
                cables.ends.tolist(), cables.stiffness.tolist(), cables.rest_length.tolist(), strict=True
            )
        ],
        "supports": [
            {
                "node": node,
                "fixed": network.fixed[node].tolist(),
                "displacement": network.imposed[node].tolist(),
            }
            for node in model.supported
        ],
        "loads": {
            name: [
                {"node": int(node), "force": load[node, :3].tolist(), "moment": load[node, 3:].tolist()}
                for node in np.flatnonzero(load.any(axis=1))
            ]
            for name, load in model.loads.items()
        },
    }
    for beam in np.flatnonzero(beams.built_in).tolist():
        del document["beams"][beam]["z_axis"]
        document["beams"][beam]["axes"] = beams.frames[beam].swapaxes(1, 2).tolist()
    if model.start is not None:
        document["start"] = {
            "positions": model.start.positions.tolist(),
            "rotations": model.start.rotations.tolist(),
        }
    return document


def _model(document: ModelDocument) -> Model:
    if document.format != "shellform-model":
        raise InputError(
            "must be 'shellform-model'",
            where="format",
            value=document.format,
            remedy='Write "format": "shellform-model" if it is a model, or give another file.',
        )
    if document.version != 1:
        raise InputError(
            "is not known here", where="version", value=document.version, remedy="This reads version 1."
        )
    nodes = components(document.nodes, "nodes", 3)
    count = len(nodes)
    if count == 0:
        raise InputError("there are none", where="nodes", remedy="Give at least one node: [x, y, z] in m.")
    beams, cables = _beams(document.beams, nodes), _cables(document.cables, nodes)
    fixed, imposed, supported = _supports(document.supports, count)
    loads = {name: _load(entries, f"loads.{name}", count) for name, entries in document.loads.items()}
    start = None
    if document.start is not None:
        parts = []
        for name, rows in [("positions", document.start.positions), ("rotations", document.start.rotations)]:
            if len(rows) != count:
                raise InputError(
                    "has the wrong shape",
                    where=f"start.{name}",
                    value=len(rows),
                    remedy=f"One row a node: {count}.",
                )
            parts.append(components(rows, f"start.{name}", 3))
        start = from_vectors(*parts)
    return Model(Network(nodes, beams, cables, fixed, imposed), loads, start, tuple(supported))


def _beams(entries: list[GivenBeam], nodes: Reals) -> Beams:
    names = ("EA", "GJ", "EIy", "EIz")
    ends = node_pairs([each.nodes for each in entries], "beams", len(nodes))
    own = np.array([each.axes is not None for each in entries], dtype=bool)
    given = [np.array([getattr(each, name) for each in entries], dtype=float) for name in names]
    # A beam built into a bent state may add to another one in part only.
    none = own & (np.array(given).reshape(4, -1) == 0.0)
    stiffness = [
        positive(np.where(without & ~none.all(axis=0), 1.0, values), "beams", name)
        for name, values, without in zip(names, given, none, strict=True)
    ]
    left_out = np.array([each.z_axis is None for each in entries], dtype=bool)
    z_axis = components([each.z_axis or (0.0, 0.0, 1.0) for each in entries], "beams", 3, ".z_axis")
    z_axis = np.where(left_out[:, None], np.nan, z_axis)
    rest = _rest_lengths(entries, "beams")
    words: dict[str, int] = {"rod": 0}
    kind = np.array([words.setdefault(each.kind, len(words)) for each in entries], dtype=np.int64)
    made = make_beams(
        nodes,
        ends,
        axial=stiffness[0],
        torsion=stiffness[1],
        bending_y=stiffness[2],
        bending_z=stiffness[3],
        z_axis=z_axis,
        rest_length=rest,
        kind=kind,
        kinds=tuple(words),
    )
    if not own.any():
        return made
    frames = np.array(made.frames)
    frames[own] = _axes(entries, own)
    ea, gj, eiy, eiz = (
        np.where(without, 0.0, values)
        for without, values in zip(
            none, (made.axial, made.torsion, made.bending_y, made.bending_z), strict=True
        )
    )
    return replace(made, frames=frames, axial=ea, torsion=gj, bending_y=eiy, bending_z=eiz)


def _rest_lengths(entries: list[GivenBeam] | list[GivenCable], part: str) -> Reals:
    """Those that are given (k,), m; NaN for those left out."""
    given = [each.rest_length for each in entries]
    positive(np.array([1.0 if each is None else each for each in given], dtype=float), part, "rest_length")
    return np.array(given, dtype=float)


def _axes(entries: list[GivenBeam], own: Flags) -> Reals:
    """The axes (k, 2, 3, 3) at both ends of the beams that give their own, as columns."""
    for beam in np.flatnonzero(own).tolist():
        if entries[beam].z_axis is not None:
            raise InputError(
                "a beam with axes has no z_axis",
                where=f"beams[{beam}].z_axis",
                remedy="Leave z_axis out: axes say where z is.",
            )
        if entries[beam].rest_length is None:
            raise InputError(
                "is needed beside axes",
                where=f"beams[{beam}].rest_length",
                remedy="Give its length without stress, m.",
            )
    axes = np.array([each.axes for each in entries if each.axes is not None], dtype=float)
    off = np.abs(axes @ axes.swapaxes(2, 3) - np.eye(3)).max(axis=(2, 3))
    wrong = ~((off < _SKEW) & (np.linalg.det(axes) > 0.0)).all(axis=1)
    if wrong.any():
        k = int(np.argmax(wrong))
        raise InputError(
            "must be three unit vectors at each end, square to one another and right-handed",
            where=f"beams[{int(np.flatnonzero(own)[k])}].axes",
            value=axes[k].tolist(),
            remedy="Give rows x, y and z = x × y at each end, or leave axes out.",
        )
    rough = (off > _EXACT).any(axis=1)
    left, _, right = np.linalg.svd(axes[rough])
    axes[rough] = left @ right
    return np.asarray(axes.swapaxes(2, 3))


def _cables(entries: list[GivenCable], nodes: Reals) -> Cables:
    ends = node_pairs([each.nodes for each in entries], "cables", len(nodes))
    stiffness = positive(np.array([each.EA for each in entries], dtype=float), "cables", "EA")
    rest = _rest_lengths(entries, "cables")
    length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    meeting = np.isnan(rest) & (length == 0.0) & (ends[:, 0] != ends[:, 1])
    if meeting.any():
        cable = int(np.argmax(meeting))
        raise InputError(
            "the cable's nodes must not coincide",
            where=f"cables[{cable}]",
            value=ends[cable].tolist(),
            remedy="Move one of them, or give the cable's rest_length, m.",
        )
    return make_cables(ends, rest_length=np.where(np.isnan(rest), length, rest), stiffness=stiffness)


def _supports(entries: list[GivenSupport], count: int) -> tuple[Flags, Reals, list[int]]:
    fixed, imposed = np.zeros((count, 6), dtype=bool), np.zeros((count, 6))
    nodes: dict[int, int] = {}
    for k, entry in enumerate(entries):
        where = f"supports[{k}]"
        check_node(entry.node, f"{where}.node", count)
        if entry.node in nodes:
            raise InputError(
                "the node has a support already", where=where, value=entry.node, remedy="Join the two."
            )
        nodes[entry.node] = k
        fixed[entry.node] = entry.fixed
        if entry.displacement is not None:
            imposed[entry.node] = components([entry.displacement], f"{where}.displacement", 6)[0]
    return fixed, imposed, list(nodes)


def _load(entries: list[GivenLoad], where: str, count: int) -> Reals:
    none = (0.0, 0.0, 0.0)
    nodes = np.array([each.node for each in entries], dtype=float)
    outside = (nodes < 0) | (nodes >= count)
    if outside.any():
        entry = int(np.argmax(outside))
        check_node(entries[entry].node, f"{where}[{entry}].node", count)
    values = np.hstack(
        [
            components([each.force or none for each in entries], where, 3, ".force"),
            components([each.moment or none for each in entries], where, 3, ".moment"),
        ]
    )
    load = np.zeros((count, 6))
    np.add.at(load, nodes.astype(np.int64), values)
    return load
