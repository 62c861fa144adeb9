"""How far a design's numbers are off because its rods are cut into straight elements: the same model with
each rod element halved, solved anew along the documented path; what the two meshes say of the error is
Richardson's estimate (structure/answers/halved.py).

New nodes lie on the cubic through both ends of an element with their directions
(structure/answers/halved.py). A path that the finer mesh leaves much earlier has no error of order h²; the
estimate then tells the size of it and nothing more.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import LOCK, locks_along, rod_bending_stress
from shellform.gridshell.tolerances import Tolerances
from shellform.net.grid import ROD
from shellform.reliability.drawing import PERFECT, Errors, draw_errors
from shellform.reliability.path_of_one import BORNE, SOUGHT, UNLOADED, Limit, Snap
from shellform.reliability.perfect import perfect_of
from shellform.reliability.standing import Workshop
from shellform.structure.answers.halved import Refined, cut_in_two, with_middles, with_nodes
from shellform.structure.elements.beam import Beams, joined
from shellform.structure.elements.sections import Section
from shellform.structure.elements.state import State
from shellform.structure.model import Model

_LOAD = "load"  # the name of the load case under which models are loaded here
_STEP = 0.25  # of the load, towards the critical factor
_RESOLUTION = 1e-4  # of the load factor


@dataclass(frozen=True)
class MeshError:
    """`deviation_max` and `deviation_mean`, m, of the design's nodes from the target, `stress`, Pa, the
    largest bending stress of rods, `critical` the critical load factor; how the path ended on both meshes,
    `kinds`. `snap`: where it ends with rod elements halved alone, the farthest of the local snaps there after
    which the structure bears what was sought; None where it falls."""

    deviation_max: Refined
    deviation_mean: Refined
    stress: Refined
    critical: Refined
    kinds: tuple[str, str]
    snap: Snap | None = None


def mesh_error(shell: Gridshell, design: Design, load: Reals, *, sought: float = SOUGHT) -> MeshError:
    """Of a design under the dead `load` (n, 6); critical factors are sought up to `sought`. Raises
    NotConverged where there is no unloaded equilibrium."""
    section = shell.rod.resized(design.radius).section
    model = model_under(shell, design, load)
    coarse = _on_mesh(model, shell.target.positions, section, sought)
    alone = coarse.limit.kind == BORNE
    fine = _on_mesh(rods_halved(model), shell.target.positions, section, sought, going_on=alone)
    return MeshError(
        deviation_max=Refined(coarse.deviation_max, fine.deviation_max),
        deviation_mean=Refined(coarse.deviation_mean, fine.deviation_mean),
        stress=Refined(coarse.stress, fine.stress),
        critical=Refined(coarse.limit.factor, fine.limit.factor),
        kinds=(coarse.limit.kind, fine.limit.kind),
        snap=fine.snap,
    )


def critical_factor(shell: Gridshell, design: Design, load: Reals, *, sought: float = SOUGHT) -> Limit:
    """The load factor at which a design, loaded from nothing, loses stability, and what ends its path. Raises
    NotConverged where there is no unloaded equilibrium."""
    return critical_of(model_under(shell, design, load), sought=sought)


def critical_of(model: Model, *, sought: float = SOUGHT, resolution: float = _RESOLUTION) -> Limit:
    """The same of a model with a start, under its load case "load", the factor to a `resolution`. Raises
    InputError where it has no such load case or no start, NotConverged."""
    return _limit(model, sought, resolution)[1]


def model_under(shell: Gridshell, design: Design, load: Reals) -> Model:
    """The model of a design with one load case, "load": the dead `load` (n, 6)."""
    supports = tuple(int(node) for node in shell.net.supports)
    return Model(shell.network(design), {_LOAD: load}, shell.target, supports)


def rods_halved(model: Model) -> Model:
    """The model with each beam of the kind "rod" cut in two, and what locks its layers with it, built into
    the start anew; its nodes come first, in their order."""
    network, beams = model.network, model.network.beams
    rods = np.flatnonzero(beams.of_kind(ROD))
    middles = len(network.nodes) + np.arange(len(rods))
    nodes = np.vstack([network.nodes, network.nodes[beams.ends[rods]].mean(axis=1)])
    finer = cut_in_two(beams, rods, middles)
    start = None if model.start is None else with_middles(model.start, beams, rods)
    if start is not None and beams.of_kind(LOCK).any():
        finer = _with_locks_cut(finer, start, beams, rods, middles)
    return with_nodes(model, nodes, finer, start)


def _with_locks_cut(finer: Beams, start: State, beams: Beams, rods: Indices, middle: Indices) -> Beams:
    """The beams with each lock that lies along one of the `rods` cut at its `middle` node."""
    place = {(a, b): k for k, (a, b) in enumerate(beams.ends[rods].tolist())}
    whole = beams.of_kind(LOCK) & np.array([(a, b) in place for a, b in beams.ends.tolist()])
    cut = np.flatnonzero(whole)
    along = np.array([place[a, b] for a, b in beams.ends[cut].tolist()], dtype=np.int64)
    ends, bending = beams.ends[cut], np.tile(beams.bending_y[cut], 2)
    halves = np.vstack(
        [np.column_stack([ends[:, 0], middle[along]]), np.column_stack([middle[along], ends[:, 1]])]
    )
    y_axes = np.tile(beams.frames[rods[along], 0, :, 1], (2, 1))
    kept = np.setdiff1d(np.arange(len(finer.ends)), cut)
    return joined(finer.chosen(kept), locks_along(start, halves, y_axes, bending))


def _limit(model: Model, sought: float, resolution: float) -> tuple[Workshop, Limit]:
    """Where the perfect structure's path ends, and the workshop that has it."""
    nominal = perfect_of(model, _LOAD, shapes=0, step=_STEP)
    workshop = Workshop(nominal)
    return workshop, workshop.limit(
        _no_errors(workshop),
        most=sought,
        step=_STEP,
        resolution=resolution,
        begin=nominal.known_to(sought),
    )


def _no_errors(workshop: Workshop) -> Errors:
    return draw_errors(workshop.nominal.members, Tolerances(), 0, PERFECT)


@dataclass(frozen=True, eq=False)
class _OnMesh:
    """What one mesh says: as in `MeshError`, and where the path ends."""

    deviation_max: float
    deviation_mean: float
    stress: float
    limit: Limit
    snap: Snap | None


def _on_mesh(
    model: Model, target: Reals, section: Section, sought: float, *, going_on: bool = False
) -> _OnMesh:
    """What the model says; `going_on`: beyond the end of its path too."""
    workshop, limit = _limit(model, sought, _RESOLUTION)
    state, beams = workshop.nominal.states[-1], model.network.beams
    away = np.linalg.norm(state.positions[: len(target)] - target, axis=1)
    stress = float(rod_bending_stress(section, beams, beams.local_forces(state)).max())
    snap = _snap(workshop, limit, sought) if going_on else None
    return _OnMesh(float(away.max()), float(away.mean()), stress, limit, snap)


def _snap(workshop: Workshop, end: Limit, sought: float) -> Snap | None:
    """The farthest of the local snaps from the `end` of a path on, after which the structure bears what is
    `sought`; None where it doesn't, or the path doesn't end."""
    if end.kind in (BORNE, UNLOADED):
        return None
    factor, snaps = workshop.beyond(_no_errors(workshop), end, most=sought, step=_STEP)
    return max(snaps, key=lambda each: each.far) if snaps and factor >= sought else None
