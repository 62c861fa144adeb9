"""What the peers read of a model file (documentation/reference/model.md): plain NumPy, for Pythons that don't
have shellform.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Model:
    """`nodes` (n, 3); beams: `ends` (m, 2), `stiffness` (m, 4) EA, GJ, EIy, EIz, `z_axis` (m, 3); cables:
    `cable_ends` (c, 2), `cable_stiffness` (c,), `cable_rest` (c,); `fixed` (n, 6); `load` (n, 6). Newtons and
    a length of the caller's choice. Imposed displacements are left out."""

    nodes: np.ndarray
    ends: np.ndarray
    stiffness: np.ndarray
    z_axis: np.ndarray
    cable_ends: np.ndarray
    cable_stiffness: np.ndarray
    cable_rest: np.ndarray
    fixed: np.ndarray
    load: np.ndarray


def read(path: str, unit: float) -> Model:
    """The model with its only load case, lengths in `unit` metres. Raises ValueError for what the peers'
    elements can't say.
    """
    with open(path, encoding="utf-8") as file:
        told = json.load(file)
    nodes = np.array(told["nodes"], dtype=float) / unit
    beams, cables, (case,) = told["beams"], told["cables"], told["loads"].values()
    ends = np.array([beam["nodes"] for beam in beams])
    length = np.linalg.norm(nodes[ends[:, 1]] - nodes[ends[:, 0]], axis=1)
    rest = np.array(
        [
            beam["rest_length"] / unit if "rest_length" in beam else own
            for beam, own in zip(beams, length, strict=True)
        ]
    )
    if told.get("start") or np.abs(rest / length - 1.0).max() > 1e-9:
        raise ValueError(
            "the peers' beams are free of stress where their nodes are given, and start from there"
        )
    fixed, load = np.zeros((len(nodes), 6), dtype=bool), np.zeros((len(nodes), 6))
    for support in told["supports"]:
        fixed[support["node"]] = support["fixed"]
    for each in case:
        load[each["node"]] += [*each.get("force", [0, 0, 0]), *each.get("moment", [0, 0, 0])]
    return Model(
        nodes,
        ends,
        np.array([[beam[name] for name in ("EA", "GJ", "EIy", "EIz")] for beam in beams])
        / [1.0, unit**2, unit**2, unit**2],
        np.array([beam["z_axis"] for beam in beams]),
        np.array([cable["nodes"] for cable in cables]).reshape(-1, 2),
        np.array([cable["EA"] for cable in cables]),
        np.array([cable["rest_length"] for cable in cables]) / unit,
        fixed,
        load / ([1.0] * 3 + [unit] * 3),
    )


def arguments(solvers: list[str]) -> argparse.Namespace:
    """The command line that the peers share."""
    parser = argparse.ArgumentParser()
    parser.add_argument("model", help="model file")
    parser.add_argument("displacements", help="where the displacements (n, 3), m, are written (.npy)")
    parser.add_argument(
        "--tolerance", type=float, required=True, help="unbalanced force at which an iteration is done, N"
    )
    parser.add_argument(
        "--unit",
        type=float,
        default=1.0,
        help="length, m, in which the peer computes: moments weigh as forces at that arm",
    )
    parser.add_argument("--solver", default=solvers[0], choices=solvers)
    return parser.parse_args()
