"""The quantities of a summary and of a case as a designer reads them: in words, in a unit of handy size.

A path is known by its last word (`deviation_rms`, `rod_radius`), and an entry of a case by its whole name
(`case.net.spacing`). What isn't known stays as it is, a number in SI units.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

from shellform.records.words import design_title, load_title


@dataclass(frozen=True)
class Measure:
    """A quantity in `words`, and its `unit`, of which an SI unit is `factor`."""

    words: str
    unit: str = ""
    factor: float = 1.0


_MM, _DEGREES, _PERCENT = ("mm", 1e3), ("°", 180.0 / math.pi), ("%", 100.0)
_FOUND = {
    "deviation_max": Measure("largest distance from the target", *_MM),
    "deviation_mean": Measure("mean distance from the target", *_MM),
    "deviation_rms": Measure("root mean square of the distances from the target", *_MM),
    "rod_utilisation_max": Measure("rods' bending stress over their strength", *_PERCENT),
    "stress_utilisation_max": Measure("rods' stress with axial force over their strength", *_PERCENT),
    "edge_utilisation_max": Measure("edge beams' stress over their strength", *_PERCENT),
    "connector_turn_max": Measure("largest turning of a connector", *_DEGREES),
    "uplift_max": Measure("largest uplift of a support", "N"),
    "thrust_max": Measure("largest thrust of a support", "N"),
    "cable_force_max": Measure("largest cable force", "N"),
    "cable_force_min": Measure("least cable force", "N"),
    "cable_force_sum": Measure("all cable forces together", "N"),
    "cables": Measure("number of cables"),
    "cables_slack": Measure("number of slack cables"),
    "rod_radius": Measure("radius of the rods", *_MM),
    "critical_factor": Measure("factor of the load at which stability ends"),
    "critical_factor_halved": Measure("factor at which stability ends with rod elements halved"),
    "critical_snap_halved": Measure("local snap that ends the path with rod elements halved alone", *_MM),
    "critical_factor_error": Measure("what the mesh costs of the factor at which stability ends"),
    "expected_stiffness": Measure("stiffness of the softest mode as built", "N/m"),
    "drawn": Measure("structures drawn as built"),
    "standing": Measure("of these, structures that stand"),
    "lowest": Measure("factor of the load that the weakest of these bears"),
    "snapped": Measure("of these, structures that stand after a snap"),
    "snap": Measure("farthest snap of those that stand", *_MM),
    "deviation_max_worst": Measure("largest distance from the target in the worst structure", *_MM),
    "objective": Measure("objective"),
    "objective_end": Measure("objective at the end"),
    "rods": Measure("number of rods"),
    "crossings": Measure("number of crossings"),
    "supports": Measure("number of supports"),
    "spacing": Measure("spacing of the rods", *_MM),
    "distance_max": Measure("largest distance of the net from the surface", *_MM),
    "distance_mean": Measure("mean distance of the net from the surface", *_MM),
    "shear_angle_min": Measure("smallest angle between rods", *_DEGREES),
    "angle": Measure("angle of the net", *_DEGREES),
    "curvature_max": Measure("largest curvature of a rod", "1/m"),
    "curvature_utilisation": Measure("curvature over what rods bear", *_PERCENT),
    "area": Measure("area of the surface", "m²"),
    "uncovered_area": Measure("area without rods", "m²"),
    "waste": Measure("waste in cutting", *_PERCENT),
    "at_least": Measure("share that stands at least", *_PERCENT),
    "total": Measure("time of computing", "s"),
}
_ENTRIES = {
    "surface.size": Measure("mesh size of the surface", *_MM),
    "net.spacing": Measure("spacing of the rods", *_MM),
    "net.spacing_v": Measure("spacing along the v rods", *_MM),
    "net.angle": Measure("angle of the net", "°"),
    "rod.radius": Measure("radius of the rods", *_MM),
    "rod.wall": Measure("wall of the tubes", *_MM),
    "rod.width": Measure("width of the laths", *_MM),
    "rod.height": Measure("height of the laths", *_MM),
    "rod.young": Measure("Young's modulus of the rods", "GPa", 1e-9),
    "rod.strength": Measure("strength of the rods", "MPa", 1e-6),
    "joint.gap": Measure("distance of the rods' axes", *_MM),
    "cable.stiffness": Measure("stiffness EA of the cables", "N"),
    "cable.force_max": Measure("largest allowed cable force", "N"),
    "cable.rest_ratio": Measure("rest length of the cables over their first length"),
    "load.force": Measure("load on a crossing", "N"),
    "load.thickness": Measure("thickness of the concrete", *_MM),
    "load.additional": Measure("factor of the additional load"),
    "optimise.misfit": Measure("weight of the misfit"),
    "optimise.cable_force": Measure("weight of the cable forces"),
    "optimise.built_misfit": Measure("weight of the misfit as built"),
    "optimise.rod_radius": Measure("weight of the rod radius"),
    "optimise.misfit_rms_additional": Measure("allowed misfit under the additional load", *_MM),
}


def summary_measure(path: str) -> Measure:
    """What stands at a path of the summary, with the design and the load that it is of."""
    *way, last = path.split(".")
    known = _FOUND.get(last)
    if known is None:
        return Measure(path)
    parts = dict(itertools.pairwise(way))
    design, load = parts.get("designs"), parts.get("loads")
    of = (
        ""
        if design is None
        else f" of the {'design to build' if design == 'best' else design_title(design).lower() + ' design'}"
    )
    under = "" if load is None else f" under {load_title(load)}"
    built = {"built_shape": " as built", "adjusted_shape": " adjusted on site"}.get(
        way[-1] if way else "", ""
    )
    return Measure(f"{known.words}{built}{under}{of}", known.unit, known.factor)


def entry_measure(entry: str) -> Measure:
    """An entry of the case, by its dotted name."""
    return _ENTRIES.get(entry, Measure(entry))
