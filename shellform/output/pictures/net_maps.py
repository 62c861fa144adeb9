"""Maps of a net's quality: distance from the surface, curvature of the rods, skewness of the cells, forces of
the springs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shellform.arrays import Reals
from shellform.net.net import Net
from shellform.output.pictures import render
from shellform.output.pictures.maps import DEGREE, along_rods, worst_at_nodes
from shellform.output.pictures.panel import Look, Panel, Skin
from shellform.surface.shape.target import Surface
from shellform.written import make_folder


def draw_net(net: Net, folder: str | Path, surface: Surface | None = None) -> list[Path]:
    """Writes net-distance, net-curvature, net-skew and net-springs, each as .png; returns the files. With the
    `surface` what lies beyond the rods is seen."""
    target = make_folder(folder)
    return [draw_map(net, name, target / f"net-{name}.png", surface) for name in _MAPS]


def draw_map(net: Net, name: str, path: Path, surface: Surface | None = None) -> Path:
    """Writes one of the maps "distance", "curvature", "skew" and "springs", on the `surface` if it is given;
    its colours end at the largest value.
    """
    panel = panel_of(net, name)
    skin = None if surface is None else Skin(surface.vertices, surface.triangles)
    render.picture(path, panel, Look(limit=limit_of(panel), surface=skin))
    return path


def panel_of(net: Net, name: str) -> Panel:
    """The net on its target, its rods coloured by one of the maps."""
    quantity, unit = _MAPS[name]
    return Panel(
        title=f"net of {len(net.grid.rods)} rods, {len(net.grid.lattice)} crossings, spacing {net.spacing:g} m",
        positions=net.target.positions,
        beams=net.lines,
        deviation=_values(net, name),
        cables=np.zeros((0, 2), dtype=np.int64),
        cable_forces=np.zeros(0),
        supports=net.supports,
        load_points=np.zeros(0, dtype=np.int64),
        rod_radius=0.02 * net.spacing,
        quantity=quantity,
        unit=unit,
        edges=net.edge_lines,
    )


def limit_of(panel: Panel) -> float:
    """The largest value, as the end of a colour scale."""
    return max(float(panel.deviation.max()), 1e-9 * panel.unit[1])


_MAPS = {
    "distance": ("distance from the surface", ("mm", 1e-3)),
    "curvature": ("curvature of the rods", ("1/m", 1.0)),
    "skew": ("skewness of the cells", ("°", DEGREE)),
    "springs": ("force left in the springs", ("EI/s²", 1.0)),
}


def _values(net: Net, name: str) -> Reals:
    quality = net.quality
    if name == "distance":
        return along_rods(net, np.abs(quality.distance))
    if name == "curvature":
        return worst_at_nodes(net, net.curvature)
    if name == "skew":
        return along_rods(net, np.abs(0.5 * np.pi - quality.shear_angle))
    return np.abs(quality.pull)
