"""`shellform new`: a commented case file for a surface, proposed from its size and curvature.

The paper's scale model (section 4.1) has 55 mm spacing on 0.56 m². With s the spacing, lengths grow by k = s / 55 mm; stresses stay
as they are, so that forces grow with k² and bending and torsion stiffness (force × length²) with k⁴, as in table 1. Rods may be no
thicker than equation (1) r <= f_f / (E κ) allows; where they are thinner than the paper's times k, joints follow the rods.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shellform.case.build_net import size_text, surface_of
from shellform.errors import InputError
from shellform.run.first_look import STRENGTH, YOUNG, largest_radius, surface_entry
from shellform.surface.shape.target import largest_curvature
from shellform.written import write_text

_SPACING, _RADIUS = 0.055, 0.001  # m, of the paper's scale model
_AREA = 0.56  # m², of its surface
_THICKER = 1.4  # than the paper's, whose openings carry nothing: loaded all over, a dome of its size collapses with 1.05 mm and bears with 1.5
_MARGIN = (
    0.9  # of the radius by (1): rods curve a little more than the surface between its triangles' corners
)


def propose_case(
    file: Path, output: Path, options: Mapping[str, Any], *, allow_scripts: bool
) -> dict[str, str]:
    """Writes a case for a surface file to `output`; returns what was proposed as labelled lines.

    `options` are the entries of [surface] in a case. Raises InputError where `output` exists or isn't named .toml.
    """
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
    entry = surface_entry(file, options)
    surface = surface_of(entry, allow_scripts=allow_scripts)
    bent = largest_curvature(surface)
    spacing = _short(_SPACING * np.sqrt(surface.area / _AREA))
    k = spacing / _SPACING
    allowed = largest_radius(YOUNG, STRENGTH, bent) or np.inf
    radius = _short(min(_THICKER * _RADIUS * k, _MARGIN * allowed))
    rods = radius / _RADIUS
    entries = {"file": os.path.relpath(file.resolve(), output.resolve().parent), **options}
    lines = "\n".join(f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in entries.items())
    thin = (
        ""
        if radius >= _short(_RADIUS * k)
        else f"; thinner than the paper's × {k:.3g}, so look whether they bear the load"
    )
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
radius = {radius!r}      # m: equation (1) allows {allowed:.3g} at the surface's largest curvature {bent:.3g} 1/m{thin}

[joint]              # table 1 of the paper, scaled with the rods: EA with r², GJ and EI with r⁴
axial = {_short(7.15e4 * rods**2)!r}
torsion = {_short(7.38e-4 * rods**4)!r}
bending = {_short(7.85e-4 * rods**4)!r}
gap = {2 * radius!r}          # m, rods lie on each other

[cable]
stiffness = {_short(187.0 * k**2)!r}    # EA, N: the paper's × {k:.3g}²
rest_ratio = 0.99
force_max = {_short(20.0 * k**2)!r}     # N, constraint (5): the paper's × {k:.3g}²

[load]
force = {_short(6.9 * k**2)!r}         # N on every second crossing: 1.1 kN/m², about 5 cm of concrete at any size
every = 2
additional = 1.2     # the case under which the shell must still stand, constraint (6)

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
        "rod radius": f"{radius:g} m (equation 1 allows {allowed:.3g}){thin}",
        "case": str(output),
    }


def _short(value: float) -> float:
    """Two digits more than the first."""
    return float(f"{value:.3g}")
