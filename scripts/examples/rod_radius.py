"""Thicker rods carry more and bend less easily: the deviation over the radius, up to where rods break."""

from pathlib import Path

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt

import shellform as sf
from shellform import cad

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "vault.py", size=0.03, length=0.90, width=0.55)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
shell = sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)
wet = shell.point_load(2.0)
largest = net.max_radius(young=40e9, strength=255e6)
radius = np.linspace(0.5, 0.95, 5) * largest
off = []
for value in radius:
    own = sf.brace(
        net,
        sf.Rod.round(young=40e9, radius=value, strength=255e6),
        joint,
        sf.Cable(stiffness=187.0),
        below=surface,
    )
    loaded = sf.follow(own, own.design(rest_ratio=0.99), {"none": 0.0 * wet, "wet": wet})
    off.append(1e3 * sf.deviations(own, loaded["wet"].equilibrium.state).max())
figure, axes = plt.subplots(figsize=(7, 4))
axes.plot(1e3 * radius, off, "o-")
axes.set(
    xlabel=f"radius of the rods, mm (the largest that bears the net: {1e3 * largest:.2f} mm)",
    ylabel="largest distance from the target, mm",
)
figure.savefig("rod_radius.png", dpi=150)
