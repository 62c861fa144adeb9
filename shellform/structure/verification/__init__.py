"""Published and exact cases that `shellform verify` and the tests run on the installed package.

Each case is a function that yields rows; its docstring states citation, units, mesh and the reason for the tolerance. References
are closed forms evaluated here (`exact.py`) or numbers that tests/literature/test_references.py recomputes by other means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from shellform.structure.verification.beams import (
    bend_order,
    bends,
    cantilever_order,
    cantilevers,
    diamonds,
    helices,
    lee_frames,
    quarter_ring,
    roll_ups,
    twisted_rod,
)
from shellform.structure.verification.bent import bows, rings, strips
from shellform.structure.verification.buckling import (
    columns,
    greenhill,
    lateral,
    michell,
    right_angle,
    ring_pressure,
)
from shellform.structure.verification.cables import (
    catenaries,
    force_densities,
    nets,
    slack,
    slack_pair,
    tripod,
    two_links,
)
from shellform.structure.verification.case import Row
from shellform.structure.verification.checks import (
    betti,
    gradients,
    invariances,
    statics,
    turned_forces,
    turns,
    work,
)
from shellform.structure.verification.limits import arches, domes, lee_limits, mises_truss, toggles
from shellform.structure.verification.models import chain

__all__ = ["CASES", "Row", "chain", "slack_pair", "turned_forces", "verify"]

CASES: tuple[Callable[[], Iterator[Row]], ...] = (
    cantilevers,
    cantilever_order,
    diamonds,
    roll_ups,
    bends,
    bend_order,
    helices,
    quarter_ring,
    twisted_rod,
    lee_frames,
    lee_limits,
    toggles,
    mises_truss,
    arches,
    domes,
    columns,
    lateral,
    right_angle,
    ring_pressure,
    greenhill,
    michell,
    strips,
    bows,
    rings,
    slack,
    tripod,
    two_links,
    catenaries,
    force_densities,
    nets,
    turns,
    invariances,
    statics,
    work,
    betti,
    gradients,
)


def verify() -> Iterator[Row]:
    """All cases, one row a compared number."""
    for case in CASES:
        yield from case()
