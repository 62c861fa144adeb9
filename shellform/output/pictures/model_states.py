"""Pictures of an analysed model: its state, coloured by displacement, and its softest modes."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from shellform.arrays import Reals
from shellform.output.pictures import render
from shellform.output.pictures.maps import AMPLITUDE
from shellform.output.pictures.panel import Look, Panel
from shellform.quantities import number
from shellform.structure.answers.analysis import Analysis
from shellform.written import make_folder


def draw_analysis(analysis: Analysis, folder: str | Path) -> list[Path]:
    """Writes state.png, coloured by how far each node has moved, and mode-1.png and so on, coloured by
    amplitude; returns the files.
    """
    place = analysis.equilibrium.state.positions
    moved = np.linalg.norm(place - analysis.model.network.nodes, axis=1)
    target = make_folder(folder)
    name = "loaded" if analysis.converged else "last state, not in equilibrium"
    files = [
        _draw(
            analysis,
            f"{name}: {number(float(1e3 * moved.max()), 4)} mm at most",
            "displacement",
            place,
            moved,
            target / "state.png",
        )
    ]
    critical = analysis.critical
    if critical is not None:
        title = f"critical at {critical.factor:.4g} × the load ({critical.kind})"
        files.append(
            _mode(
                analysis, title, critical.equilibrium.state.positions, critical.mode, target / "critical.png"
            )
        )
    if analysis.modes is not None:
        for k, (stiffness, shape) in enumerate(
            zip(analysis.modes.stiffness, analysis.modes.shapes, strict=True), 1
        ):
            title = f"mode {k}, stiffness {number(float(stiffness), 4)} N/m"
            files.append(_mode(analysis, title, place, shape, target / f"mode-{k}.png"))
    return files


def _mode(analysis: Analysis, title: str, place: Reals, shape: Reals, target: Path) -> Path:
    size = float(np.ptp(place, axis=0).max())
    shift = AMPLITUDE * size * shape[:, :3]
    return _draw(
        analysis, title, "amplitude (arbitrary)", place + shift, np.linalg.norm(shift, axis=1), target
    )


def _draw(analysis: Analysis, title: str, quantity: str, place: Reals, colour: Reals, target: Path) -> Path:
    network = analysis.model.network
    size = float(np.ptp(place, axis=0).max())
    panel = Panel(
        title=title,
        positions=place,
        beams=network.beams.ends,
        deviation=colour,
        cables=network.cables.ends,
        cable_forces=network.cables.tension(analysis.equilibrium.state),
        supports=np.flatnonzero(network.fixed[:, :3].any(axis=1)),
        load_points=np.flatnonzero(analysis.load[:, :3].any(axis=1)),
        rod_radius=1e-3 * size,
        quantity=quantity,
    )
    render.picture(target, panel, Look(limit=max(float(colour.max()), 1e-9 * size)))
    return target
