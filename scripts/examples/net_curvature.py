"""How strongly a net bends its rods: the map that says which rods fit."""

from pathlib import Path

import numpy as np

import shellform as sf
from shellform import cad
from shellform.output.pictures import net_maps

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "vault.py", size=0.03, length=0.90, width=0.55)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
net_maps.draw_map(net, "curvature", Path("net_curvature.png"))
