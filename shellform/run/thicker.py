"""Where the rods of the given size don't stand as built: which would.

The initial design, which has all cables, is drawn with rods that become thicker step by step, or with the
next stiffer sections of the catalogue that they are from, as far as the net's curvature allows (equation 1).
It is the design that a search begins with, so that a search with such rods has where to begin; how few cables
it comes to isn't known before.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.gridshell.catalogue import Catalogue, label, neighbours
from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.gridshell.layers import single
from shellform.gridshell.tolerances import Tolerances
from shellform.records.as_built import AsBuilt
from shellform.records.remedies import rounded_up
from shellform.records.thicker_rods import ThickerRodsRecord
from shellform.reliability.safety import allowed, paths
from shellform.reliability.standing import sample

DRAWN = 40  # structures of each size of rods
_THICKER = 1.1  # times as thick as the ones before
_SIZES = 8  # of rods tried at the most
_EQUAL = 1e-9  # relative: stiffnesses that count as equal


def rods_that_stand(
    shell: Gridshell,
    initial: Design,
    loads: Mapping[str, Reals],
    tolerances: Tolerances,
    asked: AsBuilt,
    *,
    seed: int,
    catalogue: Catalogue | None = None,
) -> ThickerRodsRecord | None:
    """The thinnest of the thicker rods, or the least stiff section of the `catalogue`, with which the
    `initial` design stands as often as is `asked` under every load; None where none does that the net
    allows."""
    for name, other, design in _thicker(shell, initial, catalogue):
        standing = _standing(other, design, loads, tolerances, seed)
        if DRAWN - standing <= allowed(asked.design, DRAWN):
            return ThickerRodsRecord(design.radius, standing, DRAWN, name)
    return None


def _thicker(
    shell: Gridshell, initial: Design, catalogue: Catalogue | None
) -> Iterator[tuple[str | None, Gridshell, Design]]:
    """The gridshell and the design with thicker rods, and the name of the section where it has one."""
    if catalogue is not None:
        found = [
            own for own in neighbours(shell, initial, catalogue, count=_SIZES) if _stiffer(own[0], shell)
        ]
        for other, design in found[:_SIZES]:
            yield label(single(other.rod.section)), other, design
        return
    largest, radius = max_radius(shell.net, shell.rod), initial.radius
    for _ in range(_SIZES):
        radius = rounded_up(_THICKER * radius)
        if radius > largest:
            return
        yield None, shell, replace(initial, radius=radius)


def _stiffer(one: Gridshell, other: Gridshell) -> bool:
    return min(one.rod.stiffness.bending) > (1.0 + _EQUAL) * min(other.rod.stiffness.bending)


def _standing(
    shell: Gridshell, design: Design, loads: Mapping[str, Reals], tolerances: Tolerances, seed: int
) -> int:
    """How many structures stand under every load, the least of them; the largest of those on one path is the
    hardest."""
    try:
        found = [
            sample(shell, design, loads[largest], tolerances, count=DRAWN, seed=seed).standing.standing
            for largest in paths(loads)
        ]
    except NotConverged:
        return 0  # without an unloaded state none stands
    return min(found, default=DRAWN)
