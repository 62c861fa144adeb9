"""A load that is the concrete itself: 5 mm of it over the whole surface, in arrows and deviations."""

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
poured = sf.loads.concrete(net, surface, thickness=0.005)
print(f"{-poured[:, 2].sum():.0f} N of concrete")
design = shell.design(rest_ratio=0.99)
loaded = sf.follow(shell, design, {"none": 0.0 * poured, "wet": poured})
state = loaded["wet"].equilibrium.state
render.deviation("concrete.png", shell, state, design, load=poured, limit=0.005, title="5 mm of concrete")
