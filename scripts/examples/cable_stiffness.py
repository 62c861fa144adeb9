"""How much is a stiffer wire worth? Tightened by the same share, too stiff ones pull the shell out of
shape."""

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
stiffness = [50.0, 100.0, 200.0, 400.0, 800.0]
off = []
for value in stiffness:
    braced = sf.brace(net, rod, joint, sf.Cable(stiffness=value), below=surface)
    loaded = sf.follow(braced, braced.design(rest_ratio=0.99), {"none": 0.0 * wet, "wet": wet})
    off.append(1e3 * sf.deviations(braced, loaded["wet"].equilibrium.state).max())
figure, axes = plt.subplots(figsize=(7, 4))
axes.plot(stiffness, off, "o-")
axes.set(xlabel="stiffness EA of the cables, N", ylabel="largest distance from the target, mm")
figure.savefig("cable_stiffness.png", dpi=150)
