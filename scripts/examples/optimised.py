"""A design before and after the search, in the same colours."""

from pathlib import Path

import numpy as np

import shellform as sf
from shellform import cad, render
from shellform.output.pictures import maps
from shellform.output.pictures.panel import Look

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "vault.py", size=0.03, length=0.90, width=0.55)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
shell = sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)
wet = shell.point_load(2.0)
problem = sf.Problem(
    shell,
    design_load=sf.LoadCase("wet", wet),
    minimise=[sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))],
    constraints=[sf.AtMost(20.0, sf.CableForces("wet"))],
)
best = sf.optimise(problem, shell.design(rest_ratio=0.99), evaluations=8)
first = sf.follow(shell, shell.design(rest_ratio=0.99), {"none": 0.0 * wet, "wet": wet})[
    "wet"
].equilibrium.state
panels = [
    maps.panel_of(shell, shell.design(rest_ratio=0.99), first, load=wet, title="first design"),
    maps.panel_of(shell, best.design, best.states["wet"], load=wet, title="after eight evaluations"),
]
limit = max(float(panel.deviation.max()) for panel in panels)
render.sheet("optimised.png", [panels], Look(limit=limit, size=(800, 560)))
