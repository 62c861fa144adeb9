"""Pictures of nets, gridshells and optima where they are displayed in Jupyter or IPython, and the page's own
view of them, to be turned, picked in, measured and cut; it stands in a frame of its own and asks for nothing.

`import shellform` in a running IPython, or `%load_ext shellform`, tells its formatter the names of the types;
nothing is loaded until one of them is displayed. Without OpenGL the picture is made of lines.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.net import Net
from shellform.optimiser.optimum import Optimum
from shellform.output.page.report import VIEW
from shellform.output.page.template import filled, part
from shellform.output.page.view_data import ViewedShell, controls, net_data, view_data
from shellform.output.pictures import maps, net_maps, painter, sheets
from shellform.output.pictures.colours import VIRIDIS
from shellform.output.pictures.images import png_bytes
from shellform.output.pictures.panel import Look, Panel
from shellform.problem.paths import deviations
from shellform.quantities import number
from shellform.records.words import load_title
from shellform.structure.elements.state import State

_SIZE = (900, 560)  # pixels, of a picture
_TALL = 760  # pixels, of the view's frame
_SMALL = (560, 400)  # one of several side by side


def net_png(net: Net) -> bytes:
    """The net on its target, coloured by the curvature of its rods."""
    panel = net_maps.panel_of(net, "curvature")
    return _png([[panel]], Look(limit=net_maps.limit_of(panel), size=_SIZE))


def gridshell_png(shell: Gridshell) -> bytes:
    """The gridshell in its target shape with all candidate cables, coloured by the curvature that its rods
    are bent to.
    """
    title = f"gridshell of {len(shell.net.grid.rods)} rods, {len(shell.cable_ends)} candidate cables"
    panel = replace(
        net_maps.panel_of(shell.net, "curvature"),
        title=title,
        cables=shell.cable_ends,
        cable_forces=np.zeros(len(shell.cable_ends)),
    )
    return _png([[panel]], Look(limit=net_maps.limit_of(panel), size=_SIZE))


def optimum_png(optimum: Optimum) -> bytes:
    """The design under each of its loads, as `design_png` draws it."""
    problem = optimum.problem
    return design_png(problem.shell, optimum.design, optimum.states, problem.loads, optimum.status)


def design_png(
    shell: Gridshell, design: Design, states: Mapping[str, State], loads: Mapping[str, Reals], heading: str
) -> bytes:
    """A design in its states by load case, coloured by the deviation from the target up to the largest one;
    `loads` (n, 6), N, of those that have some."""
    panels = [
        maps.panel_of(shell, design, state, load=loads.get(name), title=f"load: {name}")
        for name, state in states.items()
    ]
    largest = max(net_maps.limit_of(panel) for panel in panels)
    return _png([panels], Look(limit=largest, size=_SMALL if len(panels) > 1 else _SIZE), heading)


def _png(rows: Sequence[Sequence[Panel]], look: Look, heading: str = "") -> bytes:
    many = len(rows[0]) > 1
    laid = sheets.table(rows, look, heading) if many else sheets.single(rows[0], look)[0]
    try:
        (picture,) = painter.paint([laid])
    except InputError:  # no OpenGL
        from shellform.output.pictures import vectors

        picture = vectors.rasterised(laid)
    return png_bytes(picture)


def net_html(net: Net) -> str:
    """The net's view, its rods coloured by their curvature."""
    return _framed(net_data(net, "net", repr(net), np.zeros((0, 2), dtype=np.int64)))


def gridshell_html(shell: Gridshell) -> str:
    """The gridshell's view in its target shape with all candidate cables."""
    return _framed(net_data(shell.net, "gridshell", repr(shell), shell.cable_ends))


def optimum_html(optimum: Optimum) -> str:
    """The optimum's view under each of its loads."""
    shell, states = optimum.problem.shell, optimum.states
    none = np.zeros((shell.node_count, 6))
    first = optimum.problem.design_load.name
    largest = float(deviations(shell, states[first]).max())
    viewed = ViewedShell(
        title="optimum",
        shells={"optimum": shell},
        designs={"optimum": optimum.design},
        states={"optimum": states},
        best="optimum",
        loads={name: optimum.problem.loads.get(name, none) for name in states},
        load_titles={name: load_title(name) for name in states},
        surface=None,
        limit=max(largest, 1e-6),
        shown_first=first,
    )
    return view_html(viewed)


def view_html(viewed: ViewedShell) -> str:
    """The page's view of designs."""
    return _framed(view_data(viewed), viewed)


def _framed(data: Mapping[str, Any], viewed: ViewedShell | None = None) -> str:
    gradient = ", ".join(f"rgb{colour}" for colour in VIRIDIS)
    told: dict[str, Any] = {
        "design_titles": [(each["name"], each["title"]) for each in data["designs"]],
        "loads": [(each["name"], each["title"]) for each in data["loads"]],
        "first_load": "none",
        "best": data["designs"][data["best"]]["name"],
        "fitting": data["fitting"],
        "limit": data["limit"],
        "gradient": gradient,
        "has_surface": False,
    }
    if viewed is not None:
        told = controls(viewed, gradient)
    page = filled(
        "view.html",
        {"r": {"id": "run0", "title": data["title"], **told}},
        generator="shellform view",
        style=part("look.css") + part("style.css"),
        script="(() => {\n" + "\n".join(part(name) for name in (*VIEW, "view_alone.js")) + "\n})();",
        data={"viridis": VIRIDIS, "runs": [data]},
        number=number,
    )
    return (
        f'<iframe srcdoc="{escape(page, quote=True)}" title="{data["title"]}" '
        f'style="width: 100%; height: {_TALL}px; border: 0" sandbox="allow-scripts allow-downloads"></iframe>'
    )
