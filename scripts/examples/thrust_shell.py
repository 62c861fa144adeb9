"""A surface that bears its own weight by thrust, found from a plan, and the net on it."""

from pathlib import Path

import numpy as np

import shellform as sf
from shellform.output.pictures import net_maps

outline = [(0.0, 0.0), (0.9, 0.0), (0.9, 0.6), (0.0, 0.6)]
surface = sf.funicular.thrust_shell(outline, rise=0.2, size=0.03)
net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45), elements=2)
net_maps.draw_map(net, "curvature", Path("thrust_shell.png"))
