"""What the first design that stands gets at last, where it helps the search for the design to build.

Edge beams. No cable lifts an edge, and what it sags by pulls the shell beside it along: heavier ones, until
edges sag less.

Shape. Of what the initial design lies off under 1.2 × the load a search leaves about a quarter, so that from
much farther off it doesn't come to what is wished for. Such a design gets heavier edge beams, and stiffer
rods where these don't do.

Strands. Rods are chosen with strands as they are usual, but a search that begins near what these bear can
lengthen and leave out few: its steps end at their limit. With about twice the section a half round barrel
keeps 167 of 442 cables instead of 400, and is 8 instead of 15 mm off.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace

from shellform.run.first_edges import EdgeChoice, edge_choices
from shellform.run.first_net import Allowance
from shellform.run.first_trial import (
    ADDITIONAL,
    DRAWN,
    NEEDED,
    FirstDesign,
    FirstParts,
    Followed,
    drawn_standing,
    followed,
)
from shellform.run.next_trial import fails_by
from shellform.run.sizes import Placed, RodChoice, may_come_off, may_sag, thicker
from shellform.run.unbuildable import Obstacle
from shellform.surface.shape.target import Surface

_STRAIGHTER = 0.8  # of the sag before, at the most, for which edge beams are made heavier
_FAR = 4.0  # times what the shape may be off, of the shell under the additional load: farther off, it is made stiffer
_NEARER = 0.85  # of the deviation before, at the most, for which it is
_ROOM = 1.9  # times the section of the strands with which a design stands
WithEdges = Callable[[Placed, RodChoice, EdgeChoice, float, float], FirstDesign | Obstacle]
"""The design on a net with rods, edge beams, a spacing, m, and a thickness of the concrete, m, or what it
fails by."""
WithParts = Callable[[FirstDesign, FirstParts], FirstDesign | Obstacle]
"""A design of other parts on its net, or what it fails by then."""
Stiffer = Callable[[FirstDesign, float], RodChoice | None]
"""Rods so many times as stiff as those of a design, or the stiffest that may bear its load; None where there
are none stiffer."""
Say = Callable[[str], None]


def straighter(
    design: FirstDesign, surface: Surface, with_edges: WithEdges, allowance: Allowance
) -> FirstDesign:
    """The design on the first heavier edge beams that don't sag too far; where all do, on the last that help
    and with which it stands."""
    choice, thickness = design.parts.choice, design.thickness
    edges, far = edge_choices(choice), may_sag(surface, thickness)
    for edge in edges[edges.index(design.parts.edge) + 1 :]:
        if design.tried.sag <= far or allowance.over:
            break
        result = with_edges(design.placed, choice, edge, design.spacing, thickness)
        if not isinstance(result, FirstDesign) or result.tried.sag > _STRAIGHTER * design.tried.sag:
            break
        design = result
    return design


def too_far(design: FirstDesign, surface: Surface) -> bool:
    """Whether the initial design lies farther off its shape than a search usually brings to what that may be
    off."""
    return design.tried.off > _FAR * may_come_off(surface, design.thickness)


def far_told(design: FirstDesign, surface: Surface) -> str:
    """How far off it lies where that is `too_far`: what to expect of a search; else empty."""
    if not too_far(design, surface):
        return ""
    return f"{_off(design, surface)}, of which a search usually leaves a quarter"


def _off(design: FirstDesign, surface: Surface) -> str:
    times = design.tried.off / may_come_off(surface, design.thickness)
    return (
        f"the initial design lies {design.tried.off_told} off under {ADDITIONAL:g} × the load, {times:.2g} times what its shape may be "
        "in the end"
    )


def nearer(
    design: FirstDesign,
    surface: Surface,
    stiffer: Stiffer,
    with_parts: WithParts,
    allowance: Allowance,
    say: Say,
) -> FirstDesign:
    """The design on heavier edge beams, and on stiffer rods where these don't do, with which it is no longer
    `too_far` off; where none bring it so near, on what comes nearest. Only what a look at the perfect
    structure promises is drawn too."""

    def off(parts: FirstParts) -> float:
        """How far the design of these parts lies off on the same net, m; infinite where it fails."""
        allowance.spend(len(design.placed.net.grid.lattice))
        tried = followed(design.placed.net, surface, parts, design.thickness)
        return math.inf if fails_by(tried) is not None else tried.off

    wished = may_come_off(surface, design.thickness)
    while too_far(design, surface) and not allowance.over:
        say(_off(design, surface))
        better = None
        for parts in _stiffened(design, stiffer, _FAR * wished, off):
            found = None if allowance.over else with_parts(design, parts)
            if isinstance(found, FirstDesign) and found.tried.off <= _NEARER * design.tried.off:
                better = found
                break
        if better is None:
            break
        design = better
    return design


def _stiffened(
    design: FirstDesign, stiffer: Stiffer, far: float, off: Callable[[FirstParts], float]
) -> Iterator[FirstParts]:
    """What promises a shape that lies no more than `far`, m, off, or nearer: heavier edge beams, with which
    the net stays as it is; then stiffer rods, on edge beams as much stiffer than these as before; then rods
    half the way there. `off` tells how far a design of other parts lies off."""
    parts, least = design.parts, design.tried.off
    edges = edge_choices(parts.choice)
    stage = edges.index(parts.edge)
    heavier = None
    for edge in edges[stage + 1 :] if design.placed.net.edges else ():
        came = off(replace(parts, edge=edge))
        if came > _NEARER * least:
            break
        heavier, least = replace(parts, edge=edge), came
        if came <= far:
            break
    if heavier is not None:
        yield heavier
    for stiffened in with_stiffer_rods(design, stiffer, design.tried.off / far):
        if off(stiffened) <= _NEARER * design.tried.off:
            yield stiffened


def with_stiffer_rods(design: FirstDesign, stiffer: Stiffer, times: float) -> Iterator[FirstParts]:
    """The parts with rods so many `times` as stiff, on edge beams as much stiffer than these as before; then
    with rods half the way there."""
    parts, seen = design.parts, [design.parts.choice]
    stage = edge_choices(parts.choice).index(parts.edge)
    for aimed in (times, math.sqrt(times)):
        choice = stiffer(design, aimed)
        if choice is not None and choice not in seen:
            seen.append(choice)
            yield replace(parts, choice=choice, edge=edge_choices(choice)[stage])


def with_room(design: FirstDesign, surface: Surface, say: Say) -> FirstDesign:
    """The design with thicker strands, as it is where it doesn't stand with them or there are none; what came
    of it is told to `say`."""
    rope = thicker(design.parts.rope, _ROOM)
    if rope is None:
        return design
    net, parts, thickness = design.placed.net, replace(design.parts, rope=rope), design.thickness
    tried = followed(net, surface, parts, thickness)
    drawn = None if fails_by(tried) is not None else drawn_standing(net, surface, parts, thickness)
    what = f"strands of {1e3 * rope.diameter:g} mm instead of {1e3 * design.parts.rope.diameter:g}, for the search"
    if drawn is None or drawn.falls:
        say(f"{what}: {came_to(design.placed, tried)}; not all drawn structures stand, and they are left")
        return design
    say(f"{what}: {came_to(design.placed, tried)}; {drawn.standing} of {DRAWN} drawn structures stand")
    return replace(design, parts=parts, tried=tried)


def made_of(placed: Placed, parts: FirstParts, thickness: float) -> str:
    """What a design is made of, in words, with so much concrete, m."""
    choice = parts.choice
    edges = f", edge beams of {parts.edge.label}" if placed.net.edges else ""
    return f"{choice.label} ({choice.catalogue}), {1e3 * thickness:.3g} mm of concrete{edges}"


def came_to(placed: Placed, tried: Followed) -> str:
    """What a design came to, in words."""
    off = f", edges {tried.sag_told} off" if placed.net.edges else ""
    told = f"stands up to {tried.factor:.2f} × its load, rods at {tried.stress:.0%} of their strength"
    if tried.factor >= NEEDED and tried.pull > 1.0:
        told += f", cables at {tried.pull:.0%} of theirs"
    return told + off
