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
from shellform.reliability.safety import Safety, judge

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
    `initial` design stands as often as is `asked` under every load (as under the design load, where nothing
    else is); None where none does that the net allows."""
    safety = Safety(tolerances, asked.design, asked.other, critical_factor=None, drawn=DRAWN, seed=seed)
    for name, other, design in _thicker(shell, initial, catalogue):
        try:
            found = judge(other, design, loads, safety)
        except NotConverged:
            continue  # without an unloaded state none stands
        if not found.failed:
            fewest = min(each.standing.standing for each in found.loads.values())
            return ThickerRodsRecord(design.radius, fewest, DRAWN, name)
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
