"""What the first design that stands gets at last, where it helps the search for the design to build.

Edge beams. No cable lifts an edge, and what it sags by pulls the shell beside it along: heavier ones, until edges sag less.

Strands. Rods are chosen with strands as they are usual, but a search that begins near what these bear can lengthen and leave
out few: its steps end at their limit. With about twice the section a half round barrel keeps 167 of 442 cables instead of
400, and is 8 instead of 15 mm off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from shellform.run.first_edges import EdgeChoice, edge_choices
from shellform.run.first_net import Allowance
from shellform.run.first_trial import DRAWN, NEEDED, FirstDesign, Followed, drawn_standing, followed
from shellform.run.next_trial import fails_by
from shellform.run.sizes import Placed, RodChoice, may_come_off, thicker
from shellform.run.unbuildable import Obstacle
from shellform.surface.shape.target import Surface

_SAGS = 2.0  # times what the shape may be off, of edges under the additional load: beyond it heavier beams are tried
_STRAIGHTER = 0.8  # of the sag before, at the most, for which edge beams are made heavier
_ROOM = 1.9  # times the section of the strands with which a design stands
WithEdges = Callable[[Placed, RodChoice, EdgeChoice, float, float], FirstDesign | Obstacle]
"""The design on a net with rods, edge beams, a spacing, m, and a thickness of the concrete, m, or what it fails by."""


def straighter(
    design: FirstDesign, surface: Surface, with_edges: WithEdges, allowance: Allowance
) -> FirstDesign:
    """The design on the first heavier edge beams that don't sag too far; where all do, on the last that help and with which
    it stands."""
    choice, thickness = design.parts.choice, design.thickness
    edges, far = edge_choices(choice), _SAGS * may_come_off(surface, thickness)
    for edge in edges[edges.index(design.parts.edge) + 1 :]:
        if design.tried.sag <= far or allowance.over:
            break
        result = with_edges(design.placed, choice, edge, design.spacing, thickness)
        if not isinstance(result, FirstDesign) or result.tried.sag > _STRAIGHTER * design.tried.sag:
            break
        design = result
    return design


def with_room(design: FirstDesign, surface: Surface, say: Callable[[str], None]) -> FirstDesign:
    """The design with thicker strands, as it is where it doesn't stand with them or there are none; what came of it is
    told to `say`, and with the design."""
    rope = thicker(design.parts.rope, _ROOM)
    if rope is None:
        return design
    net, parts, thickness = design.placed.net, replace(design.parts, rope=rope), design.thickness
    tried = followed(net, surface, parts, thickness)
    standing = 0 if fails_by(tried) is not None else drawn_standing(net, surface, parts, thickness)
    what = f"strands of {1e3 * rope.diameter:g} mm instead of {1e3 * design.parts.rope.diameter:g}, for the search"
    if standing < DRAWN:
        told = f"{what}: {came_to(design.placed, tried)}; not all drawn structures stand, and they are left"
        say(told)
        return replace(design, told=(*design.told, told))
    told = f"{what}: {came_to(design.placed, tried)}; {standing} of {DRAWN} drawn structures stand"
    say(told)
    return replace(design, parts=parts, tried=tried, told=(*design.told, told))


def came_to(placed: Placed, tried: Followed) -> str:
    """What a design came to, in words."""
    off = f", edges {tried.sag_told} off" if placed.net.edges else ""
    told = f"stands up to {tried.factor:.2f} × its load, rods at {tried.stress:.0%} of their strength"
    if tried.factor >= NEEDED and tried.pull > 1.0:
        told += f", cables at {tried.pull:.0%} of theirs"
    return told + off
