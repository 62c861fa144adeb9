"""The model file: one structural model as a JSON document, and its analysis (contracts/model-file.md)."""

from __future__ import annotations

import difflib
import json
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Flags, Reals
from shellform.errors import InputError, NotConverged
from shellform.structure import rotation
from shellform.structure.assembly import Assembly
from shellform.structure.beam import Beams, make_beams
from shellform.structure.cable import Cables, make_cables
from shellform.structure.equilibrium import TOLERANCE, Equilibrium, find_equilibrium, stability
from shellform.structure.loading import apply_load
from shellform.structure.network import Network, assemble
from shellform.structure.state import State, at_rest, from_vectors

_TOP = ("format", "version", "nodes", "beams", "cables", "supports", "loads", "start")
_BEAM = ("nodes", "EA", "GJ", "EIy", "EIz", "z_axis", "rest_length", "kind")
_CABLE = ("nodes", "EA", "rest_length")
_SUPPORT = ("node", "fixed", "displacement")
_LOAD = ("node", "force", "moment")


@dataclass(frozen=True)
class Model:
    """`network`; `loads` by name, (n, 6) N and N·m; `start` state or None; `supported` (s,) nodes in the file's order."""

    network: Network
    loads: Mapping[str, Reals]
    start: State | None
    supported: tuple[int, ...]


@dataclass(frozen=True)
class Analysis:
    """The last state reached; `increments` with factor, iterations and the loaded nodes' displacements; why it ended."""

    model: Model
    load: Reals
    equilibrium: Equilibrium
    converged: bool
    increments: tuple[dict[str, Any], ...]
    seconds: Mapping[str, float]
    message: str = ""


def read_model(path: str | Path) -> Model:
    """The model in a file. Raises InputError naming the field and the element."""
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"can't be read: {error}", where=str(file)) from error
    try:
        data = json.loads(text, parse_constant=_no_constant)
    except (json.JSONDecodeError, RecursionError) as error:
        raise InputError(f"isn't JSON: {error}", where=str(file)) from error
    try:
        return parse_model(data)
    except InputError as error:
        where = f"{file}: {error.where}" if error.where else str(file)
        raise InputError(error.what, where=where, value=error.value, remedy=error.remedy) from error


def parse_model(data: object) -> Model:
    """The model in a parsed JSON document."""
    top = _object(data, "model", _TOP, ("format", "version", "nodes"))
    if top["format"] != "shellform-model":
        raise InputError("must be 'shellform-model'", where="format", value=top["format"])
    if top["version"] != 1:
        raise InputError("is not known here", where="version", value=top["version"], remedy="This reads version 1.")
    nodes = _numbers(top["nodes"], "nodes", (None, 3))
    count = len(nodes)
    beams = _beams(_list(top.get("beams", []), "beams"), nodes)
    cables = _cables(_list(top.get("cables", []), "cables"), nodes)
    fixed, imposed, supported = _supports(_list(top.get("supports", []), "supports"), count)
    loads = {}
    cases = top.get("loads", {})
    if not isinstance(cases, dict):
        raise InputError("must be an object of named cases", where="loads")
    for name, entries in cases.items():
        loads[name] = _load(_list(entries, f"loads.{name}"), f"loads.{name}", count)
    start = None
    if top.get("start") is not None:
        given = _object(top["start"], "start", ("positions", "rotations"), ("positions", "rotations"))
        start = from_vectors(
            _numbers(given["positions"], "start.positions", (count, 3)),
            _numbers(given["rotations"], "start.rotations", (count, 3)),
        )
    return Model(Network(nodes, beams, cables, fixed, imposed), loads, start, tuple(supported))


def write_model(path: str | Path, model: Model) -> None:
    """Writes the model; numbers are written so that they are read back exactly. The file appears whole or not at all."""
    network, beams, cables = model.network, model.network.beams, model.network.cables
    document = {
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
                beams.frames[:, :, 2].tolist(),
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
            {"node": node, "fixed": network.fixed[node].tolist(), "displacement": network.imposed[node].tolist()}
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
    if model.start is not None:
        document["start"] = {
            "positions": model.start.positions.tolist(),
            "rotations": model.start.rotations.tolist(),
        }
    partial = Path(f"{path}.part")
    partial.write_text(json.dumps(document), encoding="utf-8")
    os.replace(partial, path)


def analyse(
    model: Model,
    *,
    load: str | None = None,
    factor: float = 1.0,
    increments: int = 1,
    tolerance: float = TOLERANCE,
) -> Analysis:
    """The equilibrium of the model under `factor` times the case `load`, reached in equal increments.

    Loads and imposed displacements grow together; from a given start, imposed displacements hold in full and only the loads
    grow. Where no equilibrium is found the last one is kept and `converged` is false. Raises InputError for bad requests.
    """
    began = time.perf_counter()
    full = factor * _chosen(model, load)
    if increments < 1:
        raise InputError("must be at least 1", where="--increments", value=increments)
    if not (np.isfinite(factor) and 0.0 < tolerance < 1.0):
        raise InputError("--factor must be finite and --tolerance between 0 and 1", value=(factor, tolerance))
    network = model.network
    assembly = assemble(network)
    none = np.zeros_like(full)
    state = model.start or at_rest(network.nodes)
    spent = 0
    steps: list[dict[str, Any]] = []
    loaded_nodes = np.flatnonzero(full.any(axis=1))
    message, converged = "", True
    try:
        if model.start is not None:
            state = _imposed(network, state, 1.0)
            begin = find_equilibrium(assembly, state, none, tolerance=tolerance)
            state, spent = begin.state, begin.factorisations
        found: Equilibrium | None = None
        for k in range(1, increments + 1):
            before, after = (k - 1) / increments * full, k / increments * full
            iterations = 0
            if model.start is None and network.imposed.any():
                found = find_equilibrium(
                    assembly, _imposed(network, state, factor * k / increments), after, tolerance=tolerance
                )
                iterations = found.factorisations
            else:
                arrived = apply_load(assembly, state, before, after, tolerance=tolerance)
                found, iterations = arrived.equilibrium, arrived.factorisations
            state = found.state
            spent += iterations
            moved = (state.positions - network.nodes)[loaded_nodes]
            steps.append(
                {
                    "factor": factor * k / increments,
                    "iterations": iterations,
                    "displacements": {str(n): d for n, d in zip(loaded_nodes.tolist(), moved.tolist(), strict=True)},
                }
            )
        assert found is not None
    except NotConverged as error:
        converged, message = False, str(error)
        last = error.state if isinstance(error.state, State) else state
        balance = assembly.evaluate(last)
        stable, negative = stability(assembly, balance)
        found = Equilibrium(last, balance.energy, error.residual, spent + error.iterations, stable, negative)
        spent += error.iterations
    result = Equilibrium(found.state, found.energy, found.residual, spent, found.stable, found.negative)
    return Analysis(
        model, full, result, converged, tuple(steps), _seconds(assembly, time.perf_counter() - began), message
    )


def result(analysis: Analysis) -> dict[str, Any]:
    """The result document of the contract."""
    network, found = analysis.model.network, analysis.equilibrium
    assembly = assemble(network)
    reaction = assembly.evaluate(found.state, tangent=False).force - analysis.load
    names = ("N", "Mx_a", "My_a", "Mz_a", "Mx_b", "My_b", "Mz_b")
    return {
        "converged": analysis.converged,
        "stable": found.stable,
        "negative_pivots": found.negative,
        "iterations": found.factorisations,
        "residual": found.residual,
        "displacements": (found.state.positions - network.nodes).tolist(),
        "rotations": found.state.rotations.tolist(),
        "beam_forces": [dict(zip(names, row, strict=True)) for row in network.beams.local_forces(found.state).tolist()],
        "cable_forces": network.cables.tension(found.state).tolist(),
        "reactions": [
            {
                "node": node,
                "force": np.where(network.fixed[node, :3], reaction[node, :3], 0.0).tolist(),
                "moment": np.where(network.fixed[node, 3:], reaction[node, 3:], 0.0).tolist(),
            }
            for node in analysis.model.supported
        ],
        "energy": found.energy,
        "increments": list(analysis.increments),
        "seconds": dict(analysis.seconds),
    } | ({"message": analysis.message} if analysis.message else {})


def _imposed(network: Network, state: State, factor: float) -> State:
    """The state with held freedoms where the supports want them at the load factor."""
    positions, quaternions = state.positions.copy(), state.quaternions.copy()
    held = network.fixed[:, :3]
    positions[held] = (network.nodes + factor * network.imposed[:, :3])[held]
    turned = network.fixed[:, 3:].all(axis=1)
    quaternions[turned] = rotation.from_vectors(factor * network.imposed[turned, 3:])
    partly = network.fixed[:, 3:].any(axis=1) & ~turned & network.imposed[:, 3:].any(axis=1)
    if partly.any():
        raise InputError(
            "a rotation can be imposed only where all three rotations are fixed",
            where=f"supports at node {int(np.argmax(partly))}",
        )
    return State(positions, quaternions)


def _chosen(model: Model, name: str | None) -> Reals:
    if name is None:
        if len(model.loads) > 1:
            raise InputError("the model has several load cases", remedy=f"Choose one with --load: {', '.join(model.loads)}.")
        return next(iter(model.loads.values()), np.zeros((len(model.network.nodes), 6)))
    if name not in model.loads:
        known = ", ".join(model.loads) or "none"
        raise InputError("there is no such load case", where="--load", value=name, remedy=f"Known: {known}.")
    return model.loads[name]


def _seconds(assembly: Assembly, total: float) -> dict[str, float]:
    clock = assembly.clock
    return {**{name: clock.get(name, 0.0) for name in ("assembly", "factorisation", "solve")}, "total": total}


def _no_constant(word: str) -> float:
    raise InputError("isn't a number in JSON", value=word, remedy="Give finite numbers.")


def _object(value: object, where: str, known: tuple[str, ...], required: tuple[str, ...]) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError("must be an object", where=where)
    for name in value:
        if name not in known:
            near = difflib.get_close_matches(str(name), known, n=1)
            hint = f"Did you mean {near[0]!r}?" if near else f"Known: {', '.join(known)}."
            raise InputError(f"unknown field {name!r}", where=where, remedy=hint)
    for name in required:
        if name not in value:
            raise InputError(f"the field {name!r} is missing", where=where)
    return value


def _list(value: object, where: str) -> list[Any]:
    if not isinstance(value, list):
        raise InputError("must be a list", where=where)
    return value


def _numbers(value: object, where: str, shape: tuple[int | None, ...]) -> Reals:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError("must be a list of numbers", where=where, remedy=f"Its shape is {shape}.") from error
    wrong = array.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=False))
    if wrong or isinstance(value, str | bool):
        raise InputError("has the wrong shape", where=where, value=array.shape, remedy=f"It has to be {shape}.")
    if not np.isfinite(array).all():
        raise InputError("holds a number that is not finite", where=where)
    return array


def _pair(value: object, where: str, count: int) -> list[int]:
    if not (isinstance(value, list) and len(value) == 2):
        raise InputError("must be two node numbers", where=where, value=value)
    return [_node(each, where, count) for each in value]


def _node(value: object, where: str, count: int) -> int:
    if not isinstance(value, int) or isinstance(value, bool):
        raise InputError("must be a node number", where=where, value=value)
    if not 0 <= value < count:
        raise InputError("is out of range", where=where, value=value, remedy=f"Nodes run from 0 to {count - 1}.")
    return value


def _positive(value: object, where: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value) or value <= 0:
        raise InputError("must be a positive number", where=where, value=value)
    return float(value)


def _beams(entries: list[Any], nodes: Reals) -> Beams:
    count = len(entries)
    ends = np.zeros((count, 2), dtype=np.int64)
    stiffness, rest = np.ones((count, 4)), np.full(count, np.nan)
    z_axis = np.full((count, 3), np.nan)
    words: dict[str, int] = {"rod": 0}
    kind = np.zeros(count, dtype=np.int64)
    for k, entry in enumerate(entries):
        where = f"beams[{k}]"
        given = _object(entry, where, _BEAM, _BEAM[:5])
        ends[k] = _pair(given["nodes"], f"{where}.nodes", len(nodes))
        stiffness[k] = [_positive(given[name], f"{where}.{name}") for name in _BEAM[1:5]]
        if given.get("z_axis") is not None:
            z_axis[k] = _numbers(given["z_axis"], f"{where}.z_axis", (3,))
        if given.get("rest_length") is not None:
            rest[k] = _positive(given["rest_length"], f"{where}.rest_length")
        word = given.get("kind", "rod")
        if not isinstance(word, str):
            raise InputError("must be a word", where=f"{where}.kind", value=word)
        kind[k] = words.setdefault(word, len(words))
    return make_beams(
        nodes,
        ends,
        axial=stiffness[:, 0],
        torsion=stiffness[:, 1],
        bending_y=stiffness[:, 2],
        bending_z=stiffness[:, 3],
        z_axis=z_axis,
        rest_length=rest,
        kind=kind,
        kinds=tuple(words),
    )


def _cables(entries: list[Any], nodes: Reals) -> Cables:
    ends, rest, stiffness = [], [], []
    for k, entry in enumerate(entries):
        where = f"cables[{k}]"
        given = _object(entry, where, _CABLE, _CABLE[:2])
        pair = _pair(given["nodes"], f"{where}.nodes", len(nodes))
        length = float(np.linalg.norm(nodes[pair[1]] - nodes[pair[0]]))
        if pair[0] == pair[1]:
            raise InputError("the cable joins a node to itself", where=where, value=pair[0])
        own = given.get("rest_length")
        if own is None and length == 0.0:
            raise InputError("the two nodes of the cable coincide", where=where, value=pair)
        ends.append(pair)
        stiffness.append(_positive(given["EA"], f"{where}.EA"))
        rest.append(length if own is None else _positive(own, f"{where}.rest_length"))
    return make_cables(np.array(ends).reshape(-1, 2), rest_length=np.array(rest), stiffness=np.array(stiffness))


def _supports(entries: list[Any], count: int) -> tuple[Flags, Reals, list[int]]:
    fixed, imposed = np.zeros((count, 6), dtype=bool), np.zeros((count, 6))
    nodes: list[int] = []
    seen: set[int] = set()
    for k, entry in enumerate(entries):
        where = f"supports[{k}]"
        given = _object(entry, where, _SUPPORT, _SUPPORT[:2])
        node = _node(given["node"], f"{where}.node", count)
        if node in seen:
            raise InputError("the node has a support already", where=where, value=node, remedy="Join the two.")
        held = given["fixed"]
        if not (isinstance(held, list) and len(held) == 6 and all(isinstance(each, bool) for each in held)):
            raise InputError("must be six times true or false", where=f"{where}.fixed", value=held)
        fixed[node] = held
        nodes.append(node)
        seen.add(node)
        if given.get("displacement") is not None:
            imposed[node] = _numbers(given["displacement"], f"{where}.displacement", (6,))
    return fixed, imposed, nodes


def _load(entries: list[Any], where: str, count: int) -> Reals:
    load = np.zeros((count, 6))
    for k, entry in enumerate(entries):
        here = f"{where}[{k}]"
        given = _object(entry, here, _LOAD, _LOAD[:1])
        node = _node(given["node"], f"{here}.node", count)
        for name, part in (("force", slice(0, 3)), ("moment", slice(3, 6))):
            if given.get(name) is not None:
                load[node, part] += _numbers(given[name], f"{here}.{name}", (3,))
    return load
