"""Structures as built, adjusted on site before they are loaded: what errors of making and setting out bend
rods and pull cables with is taken back where that costs nothing.

Supports last. A support is fixed to the ground after the rod that ends in it is clamped at its crossings,
where the rod's end lies on the scaffold; so are ends on an edge beam to that. What supports are off, and
what a rod's last mark is, strains nothing then. Set out beforehand instead, a support that is 5 mm off along
a straight slender rod makes it bow out by 45 mm over a metre, and one 5 mm off across a stiff rod bends it.

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
from shellform.reliability.drawing import Errors, built_cables
from shellform.reliability.members import Members
from shellform.reliability.path_of_one import UNLOADED
from shellform.reliability.standing import Workshop

_ROUNDS = 3  # of tightening: a fourth changes the largest force and stress by one per cent
_FELT = 0.02  # of the largest force before any load: what pulls less than that hangs slack on site
RESERVE = 0.02  # of its rest length, by which a cable is tightened or let out at the most


def adjusted(workshop: Workshop, errors: Errors) -> Errors:
    """What a structure with the `errors` is off by when it has been adjusted, its supports first; where it
    has no unloaded equilibrium, as far as it came to one."""
    return tightened(workshop, supports_last(workshop.nominal.members, errors))


def supports_last(members: Members, errors: Errors) -> Errors:
    """The errors with supports fixed where rods' ends lie."""
    longer = errors.beam_length.copy()
    for rod in members.rods:
        longer[rod.elements[: rod.marks[1]]] = longer[rod.elements[rod.marks[-2] :]] = 0.0
    return replace(errors, beam_length=longer, supports=np.zeros_like(errors.supports))


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
