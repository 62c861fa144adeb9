"""A first design whose rods bear more than their strength on every way up gets thinner ones.

On the way up rods bend more in places than in the shape that they come to, whichever cables are left in the
end: what those of the initial design bear is, to a few hundredths, what those of the design to build will.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from shellform.records.raising import easiest
from shellform.records.words import raising_words
from shellform.run.first_edges import edge_choices
from shellform.run.first_finish import Say, WithParts
from shellform.run.first_net import Allowance
from shellform.run.first_steadier import with_strays
from shellform.run.first_trial import FirstDesign, first_shell
from shellform.run.raised import raised
from shellform.run.sizes import RodChoice
from shellform.surface.shape.target import Surface

_AS_LONG = 8  # trials of a design that take as long as its ways up
_TRIED = 3  # thinner rods, one after the other
Thinner = Callable[[FirstDesign, float], RodChoice]
"""The stiffest rods that bending stresses no more than a share of what it does those of a design; its own
where there are none."""


def raisable(
    design: FirstDesign,
    surface: Surface,
    thinner: Thinner,
    with_parts: WithParts,
    allowance: Allowance,
    say: Say,
) -> FirstDesign:
    """The design with its ways up; that of the thickest among thinner rods that keep their strength on one
    and with which it stands, where its own break on each."""
    design = _with_ways_up(design, surface, allowance)
    best = design
    for _ in range(_TRIED):
        if not breaks(best) or allowance.over:
            break
        say(raising_words(best.ways_up))
        choice = thinner(best, 1.0 / (easiest(best.ways_up).utilisation or 1.0))
        if choice == best.parts.choice:
            break
        stage = edge_choices(best.parts.choice).index(best.parts.edge)
        found = with_parts(best, replace(best.parts, choice=choice, edge=edge_choices(choice)[stage]))
        if not isinstance(found, FirstDesign):
            break
        best = _with_ways_up(found, surface, allowance)
    if best is design or breaks(best):
        return design
    return with_strays(best, surface)


def breaks(design: FirstDesign) -> bool:
    """Whether its rods bear more than their strength on the best of the ways up that were found."""
    share = easiest(design.ways_up).utilisation if design.ways_up else None
    return share is not None and share > 1.0


def _with_ways_up(design: FirstDesign, surface: Surface, allowance: Allowance) -> FirstDesign:
    allowance.spend(len(design.placed.net.grid.lattice), times=_AS_LONG)
    shell, _ = first_shell(design.placed.net, surface, design.parts, design.thickness)
    return replace(design, ways_up=raised(shell, shell.design(rest_ratio=design.parts.rest_ratio)))
