"""Where the rods of the given size don't stand as built: which would.

The initial design, which has all cables, is drawn with rods that become thicker step by step, as far as the
net's curvature allows (equation 1). It is the design that a search begins with, so that a search with such
rods has where to begin; how few cables it comes to isn't known before.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell, max_radius
from shellform.gridshell.tolerances import Tolerances
from shellform.records.as_built import AsBuilt
from shellform.records.remedies import rounded_up
from shellform.records.thicker_rods import ThickerRodsRecord
from shellform.reliability.safety import allowed, paths
from shellform.reliability.standing import sample

DRAWN = 40  # structures of each size of rods
_THICKER = 1.1  # times as thick as the ones before
_SIZES = 8


def rods_that_stand(
    shell: Gridshell,
    initial: Design,
    loads: Mapping[str, Reals],
    tolerances: Tolerances,
    asked: AsBuilt,
    *,
    seed: int,
) -> ThickerRodsRecord | None:
    """The thinnest of the thicker rods with which the `initial` design stands as often as is `asked` under
    every load; None where none does that the net allows."""
    largest, radius = max_radius(shell.net, shell.rod), initial.radius
    for _ in range(_SIZES):
        radius = rounded_up(_THICKER * radius)
        if radius > largest:
            return None
        standing = _standing(shell, replace(initial, radius=radius), loads, tolerances, seed)
        if DRAWN - standing <= allowed(asked.design, DRAWN):
            return ThickerRodsRecord(radius, standing, DRAWN)
    return None


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
