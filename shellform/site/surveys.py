"""A survey of the erected grid: read from its file, and held against what it is believed to be.

Nodes come by name, in the model's axes or in those of a survey from which the model's count, or as points in
any axes and order, which are laid onto the crossings (scans.py). What cables' lengths can't explain of a
survey is told, for the turns that follow from it are no better than the survey: a benchmark that is off looks
like a grid that is, a point that is confused like a slack cable.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError, how_many
from shellform.gridshell.gridshell import Gridshell
from shellform.gridshell.tolerances import span_of
from shellform.site import measurements
from shellform.site.retensioning import Belief
from shellform.site.scan_points import read_points
from shellform.site.scans import match, rigid_fit
from shellform.structure.elements.state import State
from shellform.surface.units import unit_factor

_ABOVE = 3.0  # times its noise: what is left of a survey by chance alone stays below
_FAR = 5.0  # times the others' median: a point that is off by itself
_FAR_OFF = 0.02  # of the shell's extent, by which structures as built may be off
_MOST = 3  # of such points are named
_UNLIKELY = 4.0  # times its usual error: by chance one cable in 16,000 is that far off
_TOGETHER = 0.5  # of what is left: where a rigid motion leaves less, the axes are off, not the grid


@dataclass(frozen=True, eq=False)
class Surveyed(Record):
    """The `nodes` (k,) that were seen, their `places` (k, 3), m, in the model's axes, what each is called,
    and what is doubtful, a sentence each. `laid`: the points were laid onto the model by a rigid motion;
    `counted`: how their coordinates were made to count as the model's, in words."""

    nodes: Indices
    places: Reals
    names: tuple[str, ...]
    doubts: tuple[str, ...] = ()
    laid: bool = False
    counted: tuple[str, ...] = ()


def read_survey(
    path: Path, shell: Gridshell, expected: State, *, unit: str, origin: Sequence[float] | None = None
) -> Surveyed:
    """The survey in a CSV file, near the `expected` state; the model counts from `origin` (3,), m, in the
    survey's coordinates, which named nodes may have. Raises InputError where a named node lies more than half
    a spacing and a fiftieth of the shell's extent from there, or points can't be laid onto the crossings."""
    crossings, reach = shell.net.grid.crossing_nodes[:, 1], 0.5 * shell.net.spacing
    if not any(measurements.has_column(path, name) for name in ("node", "crossing")):
        points = read_points(path, unit=unit)
        found = match(points, expected.positions[crossings], reach=reach)
        places = found.places(points)
        seen = np.isfinite(places).all(axis=1)
        doubts = found.doubts
        if len(found.outliers):
            doubts += (
                f"{how_many(len(found.outliers), 'point belongs', 'points belong')} to no crossing and "
                f"{how_many(int((~seen).sum()), 'crossing has', 'crossings have')} no point",
            )
        names = tuple(f"crossing {k}" for k in np.flatnonzero(seen))
        return Surveyed(crossings[seen], places[seen], names, doubts, laid=True)
    metres = unit_factor(unit, where="--unit")
    nodes, places = measurements.read_places(path, shell)
    places = metres * places
    seen = np.isfinite(places).all(axis=1)
    if not seen.any():
        remedy = "Give at least one node a measured place."
        raise InputError("no node was seen", where=str(path), remedy=remedy)
    nodes, places = nodes[seen], places[seen]
    names = _called(nodes, crossings, measurements.named_by(path))
    there = expected.positions[nodes]
    places, counted = measurements.counted_alike(places, there, origin, reach=shell.net.spacing)
    away = np.linalg.norm(places - there, axis=1)
    worst = int(np.argmax(away))
    far = (
        f"{names[worst]} lies {1e3 * away[worst]:.1f} mm from where it is expected, more than half a spacing"
    )
    if away[worst] > max(reach, _FAR_OFF * span_of(shell)):
        raise InputError(
            far,
            where=str(path),
            remedy="Check the unit, the axes and the numbering; leave the columns node and crossing out to have points laid "
            "onto the model.",
        )
    doubts = (f"{far}: check that it has its own number",) if away[worst] > reach else ()
    return Surveyed(nodes, places, names, doubts, counted=counted)


def doubtful(survey: Surveyed, before: Belief, after: Belief, *, noise: float) -> list[str]:
    """What makes the survey doubtful, in words: what even the likeliest lengths, believed in `after` it,
    leave of it unexplained beyond its `noise`, m a coordinate, and lengths unlikely by what was believed
    `before`."""
    present = before.design.present
    change = (after.design.rest_length - before.design.rest_length)[present]
    times = np.abs(change) / np.sqrt(np.diag(before.covariance))
    worst = int(np.argmax(times))
    told = _unexplained(survey, before.state, after.state, noise)
    if times[worst] > _UNLIKELY:
        told.append(
            f"doubtful: C{worst} would have to be {1e3 * abs(change[worst]):.1f} mm {'longer' if change[worst] > 0.0 else 'shorter'} "
            f"than it is taken to be, {times[worst]:.0f} times what is usual: check that the grid bears what --load says, "
            "or give a larger --length-error"
        )
    return told


def _unexplained(survey: Surveyed, expected: State, learnt: State, noise: float) -> list[str]:
    """What of the survey the `learnt` state leaves unexplained, in words; `expected`: the state before."""
    off = survey.places - learnt.positions[survey.nodes]
    away = np.linalg.norm(off, axis=1)
    left = float(np.sqrt((off**2).mean()))
    alone = np.flatnonzero(away > max(_FAR * float(np.median(away)), 2.0 * _ABOVE * noise))
    if left <= _ABOVE * noise and not len(alone):
        return []
    there = expected.positions[survey.nodes]
    if len(there) > _MOST and not survey.laid:
        motion = rigid_fit(survey.places, there)
        rest = float(np.sqrt(((motion(survey.places) - there) ** 2).mean()))
        if rest < _TOGETHER * left:
            shift = float(np.linalg.norm(motion(survey.places) - survey.places, axis=1).mean())
            return [
                f"doubtful: moved as a whole by {1e3 * shift:.1f} mm the survey would fit the grid as it was expected, to "
                f"{1e3 * rest:.2f} mm a coordinate: check its axes and levels, or leave the columns node and crossing out to "
                "have its points laid onto the model"
            ]
    told = [
        f"doubtful: {survey.names[k]} lies {1e3 * away[k]:.1f} mm from where any lengths of cables bring it: measure it "
        "again, or leave it out"
        for k in alone[np.argsort(-away[alone])][:_MOST]
    ]
    return told or [
        f"doubtful: lengths of cables explain the survey to {1e3 * left:.2f} mm a coordinate, {left / noise:.0f} times its "
        f"noise: supports, marks or the load are off too; with --noise {left:.1g} "
        "fewer turns are made for it"
    ]


def _called(nodes: Indices, crossings: Indices, by: str) -> tuple[str, ...]:
    """What a file calls its nodes: by their numbers, or by their crossings'."""
    number = {int(node): k for k, node in enumerate(crossings)}
    return tuple(f"{by} {number[node] if by == 'crossing' else node}" for node in nodes.tolist())
