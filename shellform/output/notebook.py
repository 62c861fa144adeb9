"""Pictures of net_maps, gridshells and optima where they are displayed in Jupyter or IPython.

`import shellform` in a running IPython, or `%load_ext shellform`, tells its formatter the names of the types;
nothing is loaded until one of them is displayed. Without OpenGL the picture is made of lines.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shellform.errors import InputError
from shellform.gridshell.gridshell import Gridshell
from shellform.net.net import Net
from shellform.optimiser.optimum import Optimum
from shellform.output.pictures import maps, net_maps, painter, sheets
from shellform.output.pictures.images import png_bytes
from shellform.output.pictures.panel import Look, Panel

_SIZE = (900, 560)
_SMALL = (560, 400)  # one of several side by side


def net_png(net: Net) -> bytes:
    """The net on its target, coloured by the curvature of its rods."""
    panel = net_maps.panel_of(net, "curvature")
    return _png([[panel]], Look(limit=net_maps.limit_of(panel), size=_SIZE))


def gridshell_png(shell: Gridshell) -> bytes:
    """The gridshell in its target shape with all candidate cables, coloured by the curvature that its rods
    are bent to.
    """
    net = net_maps.panel_of(shell.net, "curvature")
    none = np.zeros(len(shell.cable_ends))
    title = f"gridshell of {len(shell.net.grid.rods)} rods, {len(shell.cable_ends)} candidate cables"
    panel = Panel(
        title, net.positions, net.beams, net.deviation, shell.cable_ends, none, net.supports, net.load_points,
        net.rod_radius,
        net.quantity, net.unit, net.edges,
    )  # fmt: skip
    return _png([[panel]], Look(limit=net_maps.limit_of(panel), size=_SIZE))


def optimum_png(optimum: Optimum) -> bytes:
    """The design under each of its loads, coloured by the deviation from the target up to the largest one."""
    shell, states = optimum.problem.shell, optimum.states
    loads = {name: optimum.problem.loads.get(name) for name in states}
    panels = [
        maps.panel_of(shell, optimum.design, state, load=loads[name], title=f"load: {name}")
        for name, state in states.items()
    ]
    largest = max(net_maps.limit_of(panel) for panel in panels)
    return _png([panels], Look(limit=largest, size=_SMALL if len(panels) > 1 else _SIZE), optimum.status)


def _png(rows: Sequence[Sequence[Panel]], look: Look, heading: str = "") -> bytes:
    many = len(rows[0]) > 1
    laid = sheets.table(rows, look, heading) if many else sheets.single(rows[0], look)[0]
    try:
        (picture,) = painter.drawn([laid])
    except InputError:  # no OpenGL
        from shellform.output.pictures import vectors

        picture = vectors.rasterised(laid)
    return png_bytes(picture)
