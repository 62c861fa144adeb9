"""The thickest concrete that a first design bears where none stands with what was asked for.

It is thinned for the rods that are likely to bear most of it. What falls tells what it bears by the share of
its load up to which it stands, and nothing of how it is stressed beyond: it may need less than a layer to
spare its rods. So where too little is left, concrete is thinned once more for the rods that stand with all of
it and are stressed least.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from shellform.gridshell.layers import layers_of
from shellform.run.first_net import Allowance
from shellform.run.first_trial import NEEDED, FirstDesign
from shellform.run.next_trial import bears_most, thinned
from shellform.run.sizes import DesignWish, Placed, RodChoice, choices
from shellform.run.unbuildable import Obstacle, Why, refused
from shellform.surface.shape.target import Surface

LEAST_THICKNESS = 0.015  # m: a first layer of sprayed concrete
_THINNING = 0.3  # of a search's work, at the least: thinner concrete comes before ways out


def with_thinner_concrete(
    surface: Surface,
    wish: DesignWish,
    failures: Sequence[Obstacle],
    nearest: Obstacle,
    stands: Callable[[Placed, RodChoice, float, float], FirstDesign | Obstacle],
    allowance: Allowance,
) -> FirstDesign:
    """The design that `stands` with the thickest concrete, after the `failures` of which one came `nearest`.
    Raises what says why there is none where less than a layer is left, unless that will do, or another was
    asked for."""
    failure = bears_most(failures, nearest)
    if failure.choice is None or failure.placed is None or failure.why in (Why.CURVATURE, Why.SPACING):
        raise refused(surface, failure, wish)
    if not allowance.thins:
        raise refused(surface, nearest, wish)
    thickness = failure.thickness
    least = least_layer(thickness)
    outcomes: list[tuple[Obstacle, FirstDesign | None]] = []
    tried = [own.choice for own in failures if _alike(own, failure) and own.choice is not None]
    for each in dict.fromkeys((failure, least_stressed(failures, failure))):
        allowance.leave(_THINNING)
        assert each.choice is not None
        assert each.placed is not None
        possible = choices(each.placed.net, each.spacing, wish.rod, layers_of(each.choice.section))
        outcomes.append(thinned(each, nearest, possible, least, stands, lambda: allowance.over, tried))
        if _thickness(outcomes[-1]) >= least:
            break
    told, design = max(outcomes, key=_thickness)
    if design is None:
        raise refused(surface, told, wish)
    too_thin = design.thickness < least and not allowance.thin_layers
    if wish.thickness is not None or too_thin:
        raise refused(surface, replace(told, thickness=thickness), wish, design=design)
    return design


def least_layer(thickness: float) -> float:
    """What is poured at once at the least, m, where a `thickness` is to be reached."""
    return min(LEAST_THICKNESS, 0.5 * thickness)


def least_stressed(failures: Sequence[Obstacle], failure: Obstacle) -> Obstacle:
    """Of the failures with the spacing and the thickness of the `failure` the one that stands with the least
    stress of its rods; the `failure` itself where none does."""
    standing = [
        each
        for each in failures
        if each.why is Why.STRENGTH and each.factor >= NEEDED and _alike(each, failure)
    ]
    return min(standing, key=lambda each: each.stress, default=failure)


def _alike(one: Obstacle, other: Obstacle) -> bool:
    """Whether both are of one spacing and thickness."""
    return (one.spacing, one.thickness) == (other.spacing, other.thickness)


def _thickness(outcome: tuple[Obstacle, FirstDesign | None]) -> float:
    """m; 0 where nothing stands."""
    return 0.0 if outcome[1] is None else outcome[1].thickness
