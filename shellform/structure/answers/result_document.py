"""What an analysis found, as the document that is written (documentation/reference/model.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.structure.answers.analysis import Analysis
from shellform.structure.answers.results import (
    elongation,
    end_stress,
    energy_by_kind,
    stiffness_doubts,
    twist,
    utilisation,
)
from shellform.structure.elements.sections import Section


def result(analysis: Analysis, *, sections: Mapping[str, Section] | None = None) -> dict[str, Any]:
    """The content of result.json, and besides it `on_branch`, `warnings`, `beam_twists`, `cable_elongations`,
    `energy_by_kind`, with `sections` by kind of beam `stresses` (Pa, at both ends) and `utilisation`, and
    where asked for `modes` and `critical`."""
    network, found = analysis.model.network, analysis.equilibrium
    reaction = analysis.reactions
    names = ("N", "Mx_a", "My_a", "Mz_a", "Mx_b", "My_b", "Mz_b")
    forces = network.beams.local_forces(found.state)
    document = {
        "converged": analysis.converged,
        "stable": found.stable,
        "on_branch": analysis.on_branch,
        "negative_pivots": found.negative,
        "iterations": found.factorisations,
        "residual": found.residual if np.isfinite(found.residual) else None,
        "displacements": (found.state.positions - network.nodes).tolist(),
        "rotations": found.state.rotations.tolist(),
        "beam_forces": [dict(zip(names, row, strict=True)) for row in forces.tolist()],
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
        "increments": [each.document() for each in analysis.increments],
        "seconds": dict(analysis.seconds),
        "warnings": list(analysis.warnings),
        "beam_twists": twist(network.beams.local_deformations(found.state)).tolist(),
        "cable_elongations": elongation(network.cables, found.state).tolist(),
        "energy_by_kind": energy_by_kind(network, found.state),
    }
    if sections is not None:
        unknown = sorted(set(sections) - set(network.beams.kinds))
        if unknown:
            raise InputError(
                f"the model has no beams of kind {unknown[0]!r}",
                where="--sections",
                remedy=f"It has: {', '.join(network.beams.kinds)}.",
            )
        document["warnings"] = [*analysis.warnings, *stiffness_doubts(network.beams, sections)]
        document["stresses"] = _numbers(end_stress(network.beams, forces, sections))
        document["utilisation"] = _numbers(utilisation(network.beams, forces, sections))
    if analysis.modes is not None:
        document["modes"] = [
            {
                "stiffness": stiffness,
                "displacements": shape[:, :3].tolist(),
                "rotations": shape[:, 3:].tolist(),
            }
            for stiffness, shape in zip(analysis.modes.stiffness.tolist(), analysis.modes.shapes, strict=True)
        ]
    if analysis.critical_sought:
        document["critical"] = _critical(analysis)
    if analysis.message:
        document["message"] = analysis.message
    return document


def _critical(analysis: Analysis) -> dict[str, Any]:
    critical, sought, mesh = analysis.critical, analysis.critical_sought, analysis.critical_mesh
    if critical is None:
        return {"factor": None, "sought_to": sought}
    estimate = critical.linearised if np.isfinite(critical.linearised) else None
    return {
        "factor": critical.factor,
        "factor_error": None if mesh is None else mesh.error,
        "kind": critical.kind,
        "linearised": estimate,
        "sought_to": sought,
        "mode": critical.mode[:, :3].tolist(),
    }


def _numbers(values: Reals) -> list[Any]:
    """Nested lists with null for what is undefined."""
    listed: Sequence[Any] = values.tolist()
    return [[_or_none(x) for x in row] if isinstance(row, list) else _or_none(row) for row in listed]


def _or_none(value: float) -> float | None:
    return value if np.isfinite(value) else None
