"""Another surface by a builder script, and its net."""

from pathlib import Path

import shellform as sf
from shellform import cad
from shellform.output.pictures import net_maps

SURFACES = Path(__file__).resolve().parents[2] / "surfaces"

surface = cad.build_surface(SURFACES / "dome.py", size=0.03)
net = sf.pull_net(surface, spacing=0.12, gap=0.002, elements=2)
net_maps.draw_map(net, "skew", Path("dome.png"))
