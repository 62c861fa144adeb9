"""Maps of a net's quality: distance from the surface, curvature of the rods, skewness of the cells, forces of the springs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shellform.arrays import Reals
from shellform.net.net import Net
from shellform.output import render

_DEGREE = float(np.pi / 180.0)


def draw_net(net: Net, folder: str | Path) -> list[Path]:
    """Writes net-distance.png, net-curvature.png, net-skew.png and net-springs.png; returns the files."""
    target = Path(folder)
    target.mkdir(parents=True, exist_ok=True)
    quality = net.quality
    maps = {
        "distance": ("distance from the surface", ("mm", 1e-3), _along_rods(net, np.abs(quality.distance))),
        "curvature": ("curvature of the rods", ("1/m", 1.0), _at_nodes(net, np.linalg.norm(quality.curvature, axis=2))),
        "skew": ("skewness of the cells", ("°", _DEGREE), _along_rods(net, np.abs(0.5 * np.pi - quality.shear_angle))),
        "springs": ("force left in the springs", ("EI/s²", 1.0), np.abs(quality.pull)),
    }
    files = []
    none = np.zeros((0, 2), dtype=np.int64)
    for name, (quantity, unit, values) in maps.items():
        title = f"net of {len(net.grid.rods)} rods, {len(net.grid.lattice)} crossings, spacing {net.spacing:g} m"
        panel = render.Panel(
            title,
            net.target.positions,
            net.grid.rod_ends,
            values,
            none,
            np.zeros(0),
            net.supports,
            np.zeros(0, dtype=np.int64),
            0.02 * net.spacing,
            quantity,
            unit,
        )
        file = target / f"net-{name}.png"
        render.picture(file, panel, limit=max(float(values.max()), 1e-9 * unit[1]))
        files.append(file)
    return files


def _along_rods(net: Net, at_crossings: Reals) -> Reals:
    """Values (n,) at all nodes from those at crossings (c,), linear along each rod."""
    result = np.zeros(len(net.grid.flat))
    known = np.full(len(net.grid.flat), np.nan)
    for side in range(2):
        known[net.grid.crossing_nodes[:, side]] = at_crossings
    for rod in net.grid.rods:
        nodes = np.asarray(rod.nodes)
        place = np.flatnonzero(~np.isnan(known[nodes]))
        result[nodes] = np.interp(np.arange(len(nodes)), place, known[nodes][place])
    return result


def _at_nodes(net: Net, at_ends: Reals) -> Reals:
    """The largest of the rod elements' values at their two ends (m, 2) at each node (n,)."""
    result = np.zeros(len(net.grid.flat))
    np.maximum.at(result, net.grid.rod_ends, at_ends)
    return result
