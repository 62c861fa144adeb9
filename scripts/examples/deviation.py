"""How far the shell moves under wet concrete, with cables between all crossings."""

from pathlib import Path

import numpy as np

import shellform as sf
from shellform import cad, render

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "vault.py", size=0.03, length=0.90, width=0.55)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
shell = sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)
wet = shell.point_load(2.0)
loaded = sf.follow(shell, shell.design(rest_ratio=0.99), {"none": 0.0 * wet, "wet": wet})
state = loaded["wet"].equilibrium.state
render.deviation("deviation.png", shell, state, shell.design(rest_ratio=0.99), load=wet, limit=0.010)
