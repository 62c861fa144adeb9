"""`shellform new`: a commented case file for a surface, proposed from its size and curvature.

The paper's scale model (section 4.1) has 55 mm spacing on 0.56 m². With s the spacing, lengths grow by k = s / 55 mm; stresses stay
as they are, so that forces grow with k² and bending and torsion stiffness (force × length²) with k⁴, as in table 1. Rods may be no
thicker than equation (1) r <= f_f / (E κ) allows. Joints follow the rods (joints.py), loads the area.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shellform.case.build_net import size_text, surface_of
from shellform.errors import InputError
from shellform.net.edges import stretches_of
from shellform.net.net import Stretch
from shellform.run.first_look import STRENGTH, YOUNG, largest_radius, surface_entry
from shellform.surface.shape.target import largest_curvature
from shellform.written import write_text

_SPACING, _RADIUS = 0.055, 0.001  # m, of the paper's scale model
_AREA = 0.56  # m², of its surface
_THICKER = 1.4  # than the paper's, whose openings carry nothing: loaded all over, a dome of its size collapses with 1.05 mm and bears with 1.5
_CONCRETE = 0.05  # m, 1.2 kN/m²: the paper's 6.9 N on every second crossing are 1.1
_MARGIN = (
    0.9  # of the radius by (1): rods curve a little more than the surface between its triangles' corners
)


def propose_case(
    file: Path, output: Path, options: Mapping[str, Any], *, allow_scripts: bool
) -> dict[str, str]:
    """Writes a case for a surface file to `output`; returns what was proposed as labelled lines.

    `options` are the entries of [surface] in a case. Raises InputError where `output` exists or isn't named .toml.
    """
    _check(output)
    entry = surface_entry(file, options)
    surface = surface_of(entry, allow_scripts=allow_scripts)
    bent = largest_curvature(surface)
    spacing = _short(_SPACING * np.sqrt(surface.area / _AREA))
    k = spacing / _SPACING
    allowed = largest_radius(YOUNG, STRENGTH, bent) or np.inf
    radius = _short(min(_THICKER * _RADIUS * k, _MARGIN * allowed))
    edges = _edges_told(stretches_of(surface))
    entries = {"file": os.path.relpath(file.resolve(), output.resolve().parent), **options}
    lines = "\n".join(f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in entries.items())
    text = f"""\
# Proposed by `shellform new` for {json.dumps(file.name, ensure_ascii=False)}: {size_text(surface.size)}, {surface.area:.4g} m².
# If that size is wrong, the unit is: run `shellform new` again with --unit. Lengths are {k:.3g} × the paper's scale model's.
title = {json.dumps(file.stem, ensure_ascii=False)}

[surface]            # relative to this file
{lines}

[net]
spacing = {spacing!r}        # m: about {surface.area / spacing**2:.0f} crossings, as many as the paper's; smaller: nearer, more rods
angle = 45.0         # degrees of the u rods against x; "auto" seeks the least bending

[rod]
young = 40e9         # Pa, glass-fibre reinforced polymer; or catalogue = "gfrp_rods" in place of young, strength and radius
strength = 255e6     # Pa, of the paper's rods
density = 2000.0     # kg/m³
radius = {radius!r}      # m: equation (1) allows {allowed:.3g} at the surface's largest curvature {bent:.3g} 1/m{_thin_told(radius, k)}

[cable]
stiffness = {_short(187.0 * k**2)!r}    # EA, N: the paper's × {k:.3g}²
rest_ratio = 0.99
force_max = {_short(20.0 * k**2)!r}     # N, constraint (5): the paper's × {k:.3g}²

[edges]              # found: {edges}
outer = "auto"       # ground where the edge is low, elsewhere an edge beam; "fill" brings it down to the ground, "free" lets rods end
openings = "auto"    # [[edges.stretch]] names walls and abutments by height, box or curve

[edges.beam]
rods = 19            # in a bundle, as the rods are; or width and height, radius and wall, catalogue and section
composite = 0.5      # how far they act together: 1 as if glued, 0 loose

[part.concrete]      # on its true area, so that the load stays where the spacing changes
kind = "concrete"
thickness = {_CONCRETE!r}     # m

[part.rods]
kind = "rods"

[[load]]
name = "design"
factors = {{ concrete = 1.0, rods = 1.0 }}

[[load]]
name = "additional"  # the case under which the shell must still stand, constraint (6)
factors = {{ concrete = 1.2, rods = 1.0 }}

[optimise]
misfit = 0.7         # w1
cable_force = 0.3    # w2
misfit_rms_additional = {_short(0.005 * k)!r}     # m, constraint (6): the paper's 5 mm × {k:.3g}

[figures]
limit = {_short(0.010 * k)!r}      # m, end of the colour scale
"""
    write_text(output, text)
    return {
        "size": size_text(surface.size),
        "spacing": f"{spacing:g} m",
        "rod radius": f"{radius:g} m (equation 1 allows {allowed:.3g}){_thin_told(radius, k)}",
        "edges": edges,
        "case": str(output),
    }


def _check(output: Path) -> None:
    """Raises InputError where the case can't be written there."""
    if output.suffix.lower() != ".toml":
        raise InputError("must end in .toml", where="--output", value=str(output))
    if output.exists():
        raise InputError(
            "is there already and is not overwritten", where=str(output), remedy="Choose another --output."
        )
    if not output.parent.is_dir():
        raise InputError(
            "there is no such folder", where=str(output.parent), remedy="Make it, or choose another --output."
        )


def _thin_told(radius: float, k: float) -> str:
    """What is to be said where rods are thinner than the paper's times k."""
    if radius >= _short(_RADIUS * k):
        return ""
    return f"; thinner than the paper's × {k:.3g}, so look whether they bear the load"


def _edges_told(stretches: Sequence[Stretch]) -> str:
    """What was found, in a line: "2 stretches on the ground, 2 edge beams, 1 of them round an opening"."""
    beams = [each for each in stretches if each.kind == "beam"]
    standing = len(stretches) - len(beams)
    rings = sum(each.opening for each in beams)
    told = f"{standing} {'stretch' if standing == 1 else 'stretches'} on the ground"
    if not beams:
        return told
    highest = max(float(each.points[:, 2].max()) for each in beams)
    return (
        f"{told}, {len(beams)} edge {'beam' if len(beams) == 1 else 'beams'} up to {highest:.3g} m high"
        + (f", {rings} of them round openings" if rings else "")
    )


def _short(value: float) -> float:
    """Two digits more than the first."""
    return float(f"{value:.3g}")
