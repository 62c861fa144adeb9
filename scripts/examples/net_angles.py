"""One surface, four directions of the grid: which bends its rods least?"""

from dataclasses import replace
from pathlib import Path

import numpy as np

import shellform as sf
from shellform import cad, render
from shellform.output.pictures import net_maps
from shellform.output.pictures.panel import Look

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "vault.py", size=0.03, length=0.90, width=0.55)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
nets = [
    sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(angle), elements=2)
    for angle in (0, 15, 30, 45)
]
panels = [net_maps.panel_of(each, "curvature") for each in nets]
titled = [replace(panel, title=f"{angle}°") for panel, angle in zip(panels, (0, 15, 30, 45), strict=True)]
limit = max(net_maps.limit_of(panel) for panel in panels)
render.sheet("net_angles.png", [titled[:2], titled[2:]], Look(limit=limit, size=(800, 560)))
