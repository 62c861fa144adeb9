"""Entries of case files written before 0.4, run folders' among them, under the names that they have now: what
a structure is off by stands in [tolerances] alone, critical factors in [safety], and what errors do to the
shape has a share `built_misfit` of the objective.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shellform.case.safety_entries import SafetyEntry

_TOLERANCES = {  # by their names in [robust], where 0 left a cause out
    "cable_stiffness": "cable_stiffness",
    "cable_stiffness_all": "cable_stiffness_all",
    "rest_length": "cable_length",
    "supports": "supports",
    "joints": "connectors",
    "joints_all": "connectors_all",
    "loads": "load_each",
    "loads_all": "load_all",
}
_CRITICAL = SafetyEntry.model_fields["critical_factor"].default


def with_present_names(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The tables of a case; what is given under both names stays as it is under the present one."""
    return _with_built_misfit(_with_critical_factors(_with_tolerances(data)))


def _with_built_misfit(data: Mapping[str, Any]) -> Mapping[str, Any]:
    optimise = data.get("optimise")
    if not isinstance(optimise, Mapping) or "robust" not in optimise:
        return data
    kept = {name: value for name, value in optimise.items() if name != "robust"}
    return {**data, "optimise": {"built_misfit": optimise["robust"]} | kept}


def _with_tolerances(data: Mapping[str, Any]) -> Mapping[str, Any]:
    robust, tolerances = data.get("robust"), data.get("tolerances", {})
    if not isinstance(robust, Mapping) or not isinstance(tolerances, Mapping):
        return data
    moved = {_TOLERANCES[name]: value for name, value in robust.items() if name in _TOLERANCES and value}
    kept = {name: value for name, value in robust.items() if name not in _TOLERANCES}
    return {**data, "robust": kept, "tolerances": moved | dict(tolerances)}


def _with_critical_factors(data: Mapping[str, Any]) -> Mapping[str, Any]:
    """The larger of two factors for the design load: both were asked for."""
    limits, safety = data.get("limits"), data.get("safety", {})
    if not isinstance(limits, Mapping) or not isinstance(safety, Mapping):
        return data
    factor, loads = limits.get("critical_factor"), limits.get("critical_loads", ["design"])
    further = safety.get("critical_further", {})
    if not isinstance(loads, list) or not isinstance(further, Mapping):
        return data
    asked = dict(safety)
    if factor is not None and "design" in loads:
        before = asked.get("critical_factor", _CRITICAL)
        known = isinstance(factor, int | float) and isinstance(before, int | float)
        asked["critical_factor"] = max(factor, before) if known else factor
    others = {str(name): factor for name in loads if name != "design"} if factor is not None else {}
    if others:
        asked["critical_further"] = others | dict(further)
    kept = {name: limits[name] for name in limits if name not in ("critical_factor", "critical_loads")}
    return {**data, "limits": kept, "safety": asked}
