"""Published and exact cases that `shellform verify` and the tests run on the installed package.

Each case is a function that yields rows; its docstring states citation, units, mesh and the reason for the
tolerance. References are closed forms evaluated here (`exact.py`) or numbers that
tests/literature/test_references.py recomputes by other means.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from shellform.verification import (
    beams,
    bent,
    buckling,
    cables,
    invariances,
    limit_points,
    suites,
    twisted,
)
from shellform.verification.cables import slack_pair
from shellform.verification.compared import Comparison
from shellform.verification.invariances import turned_forces
from shellform.verification.models import chain

__all__ = ["CASES", "Comparison", "chain", "slack_pair", "turned_forces", "verify"]

CASES: tuple[Callable[[], Iterator[Comparison]], ...] = (
    beams.cantilevers,
    beams.cantilever_order,
    beams.diamonds,
    beams.roll_ups,
    beams.bends,
    beams.bend_order,
    beams.helices,
    beams.quarter_ring,
    beams.helical_spring,
    beams.twisted_rod,
    beams.beam_columns,
    beams.lee_frames,
    limit_points.lee_limits,
    limit_points.toggles,
    limit_points.mises_truss,
    limit_points.arches,
    limit_points.domes,
    buckling.columns,
    buckling.braced,
    buckling.lateral,
    buckling.right_angle,
    buckling.ring_pressure,
    buckling.greenhill,
    buckling.michell,
    bent.strips,
    bent.bows,
    bent.bow_in_space,
    bent.rings,
    bent.laths,
    bent.torsion_constants,
    cables.slack,
    cables.tripod,
    cables.two_links,
    cables.catenaries,
    cables.opensees,
    cables.force_densities,
    cables.nets,
    suites.truss_domes,
    suites.jayaraman,
    suites.inclined_catenaries,
    suites.crossing_cables,
    suites.spokes,
    suites.self_stressed_simplex,
    twisted.dead_moment,
    twisted.spirals,
    twisted.semi_tangential,
    twisted.hockling,
    twisted.elastica_at_nine_thrusts,
    invariances.turns,
    invariances.invariances,
    invariances.statics,
    invariances.work,
    invariances.betti,
    invariances.gradients,
    invariances.assembled,
    invariances.sensitivities,
)


LARGE = (suites.large_net,)
"""Cases of 100,000 elements, which take a minute."""


def verify(*, large: bool = False) -> Iterator[Comparison]:
    """All cases, one row a compared number; with `large` those of 100,000 elements too."""
    for case in (*CASES, *(LARGE if large else ())):
        yield from case()
