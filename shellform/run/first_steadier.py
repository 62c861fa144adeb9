"""A first design whose structures stray too far as built gets heavier edge beams, and stiffer rods where
these don't help.

What structures as built are off by comes of their errors, and little of what a search does: it leaves the
worst of them 0.77 to 1.5 times as far from the shape as that of the initial design lies from the perfect one
(ten shells of 6 to 17 m). So a shell that strays is told from others before its search, by the very
structures by which `design` judges the shape.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from shellform.run.first_edges import edge_choices
from shellform.run.first_finish import Say, Stiffer, WithParts, with_stiffer_rods
from shellform.run.first_net import Allowance
from shellform.run.first_trial import FirstDesign, FirstParts, millimetres, straying
from shellform.run.sizes import may_stray
from shellform.surface.shape.target import Surface

_STEADIER = 0.85  # of how far structures stray before, at the most, for which it is made stiffer


def with_strays(design: FirstDesign, surface: Surface) -> FirstDesign:
    """The design with how far its structures stray."""
    return replace(design, strays=straying(design.placed.net, surface, design.parts, design.thickness))


def strays(design: FirstDesign, surface: Surface) -> bool:
    """Whether structures of the initial design lie farther from the perfect one than any as built may from
    its shape in the end; that of a design of which it isn't known isn't told."""
    return design.strays is not None and design.strays > may_stray(surface, design.thickness)


def strays_told(design: FirstDesign, surface: Surface) -> str:
    """How far they lie, where that is too far; else empty."""
    if design.strays is None or not strays(design, surface):
        return ""
    most = may_stray(surface, design.thickness)
    return f"structures drawn as built stray by up to {millimetres(design.strays)}, where {millimetres(most)} may be"


def steadier(
    design: FirstDesign,
    surface: Surface,
    stiffer: Stiffer,
    with_parts: WithParts,
    allowance: Allowance,
    say: Say,
) -> FirstDesign:
    """The design on heavier edge beams, or of stiffer rods where these don't help, whose structures no longer
    stray too far; where all do, what strays least."""

    def steady(parts: FirstParts, least: float) -> FirstDesign | None:
        """The design of other parts, where it stands and its structures stray no more than `least`, m."""
        found = None if allowance.over else with_parts(design, parts)
        if not isinstance(found, FirstDesign):
            return None
        allowance.spend(len(found.placed.net.grid.lattice))
        measured = with_strays(found, surface)
        return measured if measured.strays is not None and measured.strays <= least else None

    while design.strays is not None and strays(design, surface) and not allowance.over:
        say(strays_told(design, surface))
        times, least = design.strays / may_stray(surface, design.thickness), _STEADIER * design.strays
        tried = (steady(parts, least) for parts in _stiffened(design, stiffer, times))
        better = next((each for each in tried if each is not None), None)
        if better is None:
            break
        design = better
    return design


def _stiffened(design: FirstDesign, stiffer: Stiffer, times: float) -> Iterator[FirstParts]:
    """The next heavier edge beams; then rods so many `times` as stiff, on edge beams as much stiffer than
    these as before; then rods half the way there."""
    parts, edges = design.parts, edge_choices(design.parts.choice)
    stage = edges.index(parts.edge)
    if design.placed.net.edges and stage + 1 < len(edges):
        yield replace(parts, edge=edges[stage + 1])
    yield from with_stiffer_rods(design, stiffer, times)
