"""Structures as built, adjusted on site before they are loaded: what errors of making and setting out bend
rods and pull cables with is taken back where that costs nothing.

Ends last. A rod is fastened at its support, or at the edge beam on which it ends, after it is clamped at its
crossings, and where it lies along its own axis. With the support off by u, m, and t the rod's direction out
of the shell there, its last segment is longer by t'u, and its last mark is off by nothing. Held where it was
marked instead, a straight slender rod that is pushed by so little as 5 mm over a metre bows out by 45 mm.

Force, not length. A cable that pulls before any load in the perfect structure is tightened until it pulls as
much, N0, at the length l between its ends,

    l0 = l / (1 + N0 / EA),

all of them round after round, since each slackens its neighbours. One that hangs slack there keeps its
length, and none goes farther than a turnbuckle's reserve, whatever range the case gives to turnbuckles.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shellform.arrays import Reals
from shellform.reliability.drawing import LEAST, Errors, built_cables
from shellform.reliability.path_of_one import UNLOADED
from shellform.reliability.perfect import Perfect
from shellform.reliability.standing import Workshop

_ROUNDS = 3  # of tightening: a fourth changes forces by per cents
_FELT = 0.02  # of the largest force before any load: what pulls less than that hangs slack on site
RESERVE = 0.02  # of its rest length, by which a cable is tightened or let out at the most


def adjusted(workshop: Workshop, errors: Errors) -> Errors:
    """What a structure with the `errors` is off by when it has been adjusted, its ends first; where it has no
    unloaded equilibrium, as far as it came to one."""
    return tightened(workshop, ends_last(workshop.nominal, errors))


def ends_last(nominal: Perfect, errors: Errors) -> Errors:
    """The errors with the rods' ends fastened where they lie along their axes."""
    members, ends, places = nominal.members, nominal.network.beams.ends, nominal.unloaded.positions
    made = members.beam_length
    longer = errors.beam_length.copy()
    for rod in members.rods:
        segments = rod.elements[: rod.marks[1]], rod.elements[rod.marks[-2] :]
        for segment in segments:
            longer[segment] = 0.0
        for segment, last, inward in zip(segments, (0, -1), rod.sense[[0, -1]] * (1.0, -1.0), strict=True):
            end, beside = ends[rod.elements[last]] if inward > 0.0 else ends[rod.elements[last]][::-1]
            out = places[end] - places[beside]
            farther = float(out @ errors.supports[end, :3]) / float(np.linalg.norm(out))
            longer[segment] += farther * made[segment] / made[segment].sum()
    return replace(errors, beam_length=np.maximum(longer, (LEAST - 1.0) * made))


def tightened(workshop: Workshop, errors: Errors) -> Errors:
    """The errors with cables that pull as much before any load as those of the perfect structure."""
    nominal = workshop.nominal
    planned = nominal.network.cables
    force = planned.tension(nominal.unloaded)
    felt = force > _FELT * force.max(initial=0.0)
    reach = RESERVE * planned.rest_length
    for _ in range(_ROUNDS if felt.any() else 0):
        found = workshop.limit(errors, most=0.0, tell=False, heeding=False)
        if found.kind == UNLOADED:
            break
        own = built_cables(planned, nominal.present, errors, nominal.imperfections)
        wanted: Reals = own.lengths(found.state) / (1.0 + force / own.stiffness)
        off = errors.cable_length.copy()
        off[nominal.present] = np.where(
            felt,
            np.clip(off[nominal.present] + wanted - own.rest_length, -reach, reach),
            off[nominal.present],
        )
        errors = replace(errors, cable_length=off)
    return errors
