"""What can't be built: the reason, how far off it is, where, and a way out that works.

Sizes no shell has are refused with the unit as the first suspicion, and flat surfaces since a flat plate has
none of a shell's stiffness. Where the search for a first design ends without one, the failure that came
nearest says why.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import InputError, NotConverged
from shellform.gridshell.gridshell import erection_stress
from shellform.gridshell.layers import layers_of
from shellform.gridshell.loads import CONCRETE, pressure
from shellform.net.net import Net
from shellform.net.refusal import NoNet, Stalled
from shellform.quantities import coordinates, extents, number
from shellform.run.first_net import bends_to
from shellform.run.first_trial import NEEDED, STRESSED, FirstDesign
from shellform.run.sizes import DesignWish, Placed, RodChoice, least_spacing, radius_for
from shellform.run.way_out import COVERED
from shellform.surface.readers.reading import states_unit
from shellform.surface.shape.bends import curvature_usual
from shellform.surface.shape.target import Surface, sharpest_bend
from shellform.surface.units import METRES

SMALLEST, LARGEST = 0.2, 150.0  # m, of a shell's larger side in plan
_RATHER = 1.5  # times the least radius, where that alone isn't the reason
_SPARE = 1.05  # times the radius that rods just bear
_OPEN = 0.9  # of the radius that three quarters of a surface keep: rounded further it would be another one
_ARCHED = 0.5  # of its larger side: a radius that makes a vault of a roof of flat pieces
_WORTH = 1.3  # times the radius to which rods bend now, at the least, for rounding to be worth while
_FLAT = 0.01  # of the larger side: a surface that keeps to a plane so closely is a plate
_IN_A_LINE = 0.02  # of the net's extent: supports that keep so near to a line don't keep it from tipping
_SUSPECTED = ("mm", "cm", "in", "ft")  # units of files that were taken for metres, or metres for them
_MORE_RISE = "Give the surface more rise: buckling grows with the square of its curvature."


class Unbuildable(InputError):
    """A surface that no net of the `spacing`, m, covers, or that no rod follows there, for the reason `why`;
    rounded to the `radius`, m, it may be built, or with the thickness of concrete, m, that it `bears`: that
    of the `design`, if one was found."""

    def __init__(
        self,
        what: str,
        *,
        why: Why,
        where: str,
        remedy: str,
        spacing: float,
        radius: float,
        design: FirstDesign | None = None,
    ) -> None:
        self.why, self.spacing, self.radius = why, spacing, radius
        self.design, self.bears = design, None if design is None else design.thickness
        super().__init__(what, where=where, remedy=remedy)

    def in_vain(self) -> Unbuildable:
        """The same, where none of the ways out that were tried led to a design."""
        found = f"no surface near it that is rounded there to {self.radius:.2g} m or more was found on which a design stands"
        return Unbuildable(
            f"{self.what}; {found}",
            why=self.why,
            where=self.where,
            remedy="It takes a rounder form there.",
            spacing=self.spacing,
            radius=self.radius,
            design=self.design,
        )


class Falls(NotConverged):
    """A shell that its load brings down, or stresses too much, for the reason `what`; `bears`: the thickness
    of concrete, m, with which the `design` was found to stand, if one was."""

    def __init__(self, what: str, *, remedy: str, design: FirstDesign | None = None) -> None:
        self.design, self.bears = design, None if design is None else design.thickness
        super().__init__(what, residual=math.nan, iterations=0, remedy=remedy)

    def in_vain(self) -> Falls:
        """The same, where that concrete, asked for from the start, led to no design."""
        return Falls(self.what, remedy=_MORE_RISE)


class Tips(InputError):
    """A shell on supports in one line, about which it tips."""


class Why(Enum):
    """Which of a shell's needs isn't met, in words."""

    NET = "no net covers it"
    SPACING = "its rods are too thick for their spacing"
    CURVATURE = "its rods are bent too much"
    STRENGTH = "its rods aren't strong enough"
    EDGES = "its edge beams aren't strong enough"
    CABLES = "its cables aren't strong enough"
    STABILITY = "it isn't stable enough"
    SCATTER = "it isn't stable enough as built"


@dataclass(frozen=True, eq=False)
class Obstacle(Record):
    """How an attempt failed: `why`, at which `spacing` and `thickness`, m, up to which `factor` of its load
    it stood, with which `choice` of rods on which net (`placed`), `where` (3,), m, the rods' `stress` over
    their strength and how far edge beams `sag`, m, under the additional load, which share of drawn structures
    `stood` until one fell, or the net's own `error`."""

    why: Why
    spacing: float
    thickness: float
    factor: float = 0.0
    choice: RodChoice | None = None
    placed: Placed | None = None
    where: Reals | None = None
    stress: float = 0.0
    sag: float = 0.0
    stood: float = 0.0
    error: NoNet | Stalled | None = None

    def near(self, needed: float) -> tuple[float, float]:
        """By which failures are ranked: the factor up to the one that is `needed`, and of those that reach it
        how little they are stressed."""
        if self.factor < needed:
            return self.factor, 0.0
        return needed, 0.0 if self.why is Why.SCATTER else -self.stress

    def nearness(self, needed: float) -> float:
        """The factor from which to step on: structures as built fall a little below the one that is
        `needed`.
        """
        return min(self.factor, 0.9 * needed) if self.why is Why.SCATTER else self.factor

    def bore(self, needed: float) -> float:
        """About what share of the load that is `needed` the shell bore. What rods are stressed to that fell
        says nothing of it."""
        share = self.nearness(needed) / needed
        if self.why is Why.STRENGTH:
            return share / max(self.stress, 1.0)
        return share / self.stress if self.why in (Why.EDGES, Why.CABLES) else share

    def eases(self, before: Obstacle, needed: float) -> float:
        """How many times as much of its load as with the failure `before` the shell bears; once it bears what
        is `needed`, times how many times less it is stressed."""
        more = min(self.factor, needed) / max(min(before.factor, needed), 1e-12)
        if self.factor < needed or (self.stress > before.stress and before.factor < needed):
            return more
        return more * before.stress / self.stress

    def breaks_unloaded(self, before: Obstacle, most: float) -> bool:
        """Whether this failure and the one `before`, of the same rods under more concrete, say that these
        would be stressed to more than `most` of their strength without any."""
        less = before.thickness - self.thickness
        if less <= 0.0 or before.choice != self.choice or not before.why == self.why == Why.STRENGTH:
            return False
        return self.stress - (before.stress - self.stress) * self.thickness / less > most


def refuse_size(surface: Surface) -> None:
    """Raises InputError for a surface smaller or larger than any shell."""
    side = surface.longer_side
    if SMALLEST <= side <= LARGEST:
        return
    x, y, z = extents(surface.size)
    likely = (2.0, 0.5 * LARGEST)
    taken = [unit for unit in _SUSPECTED if likely[0] <= side * METRES[unit] <= likely[1]]
    stated = [unit for unit in _SUSPECTED if likely[0] <= side / METRES[unit] <= likely[1]]
    own = states_unit(Path(surface.source))  # which --unit doesn't change
    remedy = "Scale the file to the size that is meant."
    if taken and not own:
        possible = [each for each in _SUSPECTED if SMALLEST <= side * METRES[each] <= LARGEST]
        units = dict.fromkeys([taken[0], *possible])
        made = [f"{number(side * METRES[each])} m with --unit {each}" for each in units]
        remedy = f"Give the file's unit, which makes it {', '.join(made)}."
    elif taken or stated:
        said, meant = ("m", taken[0]) if taken else (stated[0], "m")
        how = "in the program that wrote the file, and export it anew" if own else f"by --unit {meant}"
        remedy = (
            f"If {said} was stated and {meant} was meant, state {meant} {how}: that makes it "
            f"{number(side * METRES[meant] / METRES[said])} m. Else scale it to the size that is meant."
        )
    raise InputError(
        f"is {number(x, 4)} × {number(y, 4)} × {number(z, 4)} m, which no gridshell is ({SMALLEST:g} to {LARGEST:g} m)",
        where="surface.unit",
        remedy=remedy,
    )


def refuse_flat(surface: Surface) -> None:
    """Raises InputError for a surface that lies in a plane."""
    centred = surface.vertices - surface.vertices.mean(axis=0)
    _, _, axes = np.linalg.svd(centred, full_matrices=False)
    depth, side = float(np.ptp(centred @ axes[2])), float(np.ptp(centred @ axes[0]))
    if depth < _FLAT * side:
        raise InputError(
            f"keeps to a plane within {depth:.3g} m over {side:.3g} m: a flat plate has no shell's stiffness",
            where="surface",
            remedy=f"Give it a rise: a tenth of its span, {0.1 * side:.3g} m, is usual for shells.",
        )


def refuse_tipping(net: Net) -> None:
    """Raises InputError for a net whose supports lie in a line in plan, about which it tips."""
    feet = net.target.positions[net.supports][:, :2]
    away = np.linalg.svd(feet - feet.mean(axis=0), full_matrices=False)[1]
    apart = float(np.ptp(net.target.positions[:, :2], axis=0).max())
    if len(feet) > 2 and away[1] > _IN_A_LINE * apart:
        return
    raise Tips(
        f"the surface's edge comes to the ground at {_at(net.target.positions[net.supports[0]])} and "
        f"{_at(net.target.positions[net.supports[-1]])} only, in one line, about which it tips",
        where="edges",
        remedy="Bring its edge down to the ground elsewhere too, or write a case that says in [[edges.stretch]] what else "
        "holds it.",
    )


def refused(
    surface: Surface, failure: Obstacle, wish: DesignWish, *, design: FirstDesign | None = None
) -> InputError | NotConverged:
    """What to say of a shell that can't be built: as an error, to be raised. `design`: one with less concrete
    that was found to stand."""
    if failure.why is Why.NET:
        return _uncovered(surface, failure, wish)
    choice = failure.choice
    assert choice is not None
    much = design is not None and design.thickness >= 0.5 * failure.thickness
    crease = None if much else _crease(surface, failure, wish, design)
    if crease is not None:
        return crease
    if failure.why is Why.SPACING:
        return InputError(
            f"rods of {choice.label} are too thick for a spacing of {failure.spacing:g} m",
            where="--spacing",
            remedy=f"Give --spacing {least_spacing(choice):g} or more, or thinner rods with --rod.",
        )
    if failure.why is Why.CURVATURE or (failure.why is Why.STRENGTH and design is None):
        return _broken(surface, failure, choice, wish)
    return _fallen(failure, choice, design)


def _uncovered(surface: Surface, failure: Obstacle, wish: DesignWish) -> Unbuildable:
    """The refusal of a surface that no net covers."""
    error, spacing = failure.error, failure.spacing
    most, radius = sharpest_bend(surface)
    needed = max(COVERED * spacing, _RATHER * radius, _rounding(surface, failure, wish))
    return Unbuildable(
        f"no net of {spacing:g} m covers the surface, which is curved most at {_at(surface.vertices[most])}, to a radius of "
        f"{radius:.3g} m{'' if error is None else f': {_said(error)}'}",
        why=Why.NET,
        where="net.spacing",
        remedy=f"Round the surface there to {needed:.2g} m or more.",
        spacing=spacing,
        radius=needed,
    )


def _broken(surface: Surface, failure: Obstacle, choice: RodChoice, wish: DesignWish) -> Unbuildable:
    """The refusal of a surface into which rods can't be bent, or in which the load breaks them."""
    placed, stress = failure.placed, failure.stress
    bends = 0.0 if placed is None else bends_to(placed.net)
    loaded = failure.why is Why.STRENGTH and failure.factor > 0.0
    done = "bent" if failure.why is Why.CURVATURE else "stressed"
    allowed = (
        f" and with {1e3 * failure.thickness:.3g} mm of concrete, where {STRESSED:.0%} is allowed"
        if loaded
        else ""
    )
    return Unbuildable(
        f"{choice.label} of {choice.catalogue} would be {done} to {stress:.0%} of its "
        f"strength{_place(failure)}, at a spacing of {failure.spacing:g} m{allowed}",
        why=failure.why,
        where="rod",
        remedy=_thinner_rods(wish)
        if wish.rod
        else f"Round the surface there: {max(stress, 1.0):.2g} times its radius is needed.",
        spacing=failure.spacing,
        radius=max(_SPARE * max(stress, 1.0) * bends, 0.0 if wish.rod else _rounding(surface, failure, wish)),
    )


def _fallen(failure: Obstacle, choice: RodChoice, design: FirstDesign | None) -> Falls:
    """The refusal of a shell that falls under its load, or is stressed too much by it."""
    bearing = {Why.EDGES: "edge beams", Why.CABLES: "cables"}.get(failure.why, "rods")
    falls = failure.factor < NEEDED or failure.why is Why.SCATTER
    what = (
        f"The shell doesn't stand: {failure.why.value}. The stiffest that stands out is {choice.label} of {choice.catalogue} at "
        f"{failure.spacing:g} m; with {1e3 * failure.thickness:.3g} mm of concrete it stands up to {failure.factor:.2f} × its load, "
        f"where {NEEDED:g} is needed, its {bearing} at {failure.stress:.0%} of {'what they may bear' if failure.why is Why.CABLES else 'their strength'}"
        f"{f', and gives way first{_place(failure)}' if falls else ''}"
    )
    if design is not None:
        layer = (
            "A single layer of rods bears" if layers_of(choice.section) == 1 else "Rods in two layers bear"
        )
        remedy = (
            f"{layer} --thickness {design.thickness:g}: pour that first, and the rest when it has hardened."
        )
    else:
        remedy = _MORE_RISE
    return Falls(what, remedy=remedy, design=design)


def _place(failure: Obstacle) -> str:
    return "" if failure.where is None else f" at {_at(failure.where)}"


def _rounding(surface: Surface, failure: Obstacle, wish: DesignWish) -> float:
    """The radius, m, to which creases are to be rounded so that rods follow them that bear the load, but no
    more than nearly what three quarters of the surface keep; of flat pieces so far that they become a
    vault."""
    needed = NEEDED * pressure(failure.thickness, CONCRETE)
    if flat_between_creases(surface):
        return _ARCHED * surface.longer_side
    wanted = radius_for(surface, failure.spacing, needed, wish)
    return min(wanted, _OPEN / max(curvature_usual(surface), 1e-12))


def flat_between_creases(surface: Surface) -> bool:
    """Whether three quarters of the surface are hardly curved, as roofs of flat pieces are: rounded creases
    alone leave it flat, and a flat grid bears nothing."""
    return surface.longer_side * curvature_usual(surface) < 1.0


def _crease(
    surface: Surface, failure: Obstacle, wish: DesignWish, design: FirstDesign | None
) -> Unbuildable | None:
    """The refusal of a surface on which the rods that can follow it at one spot are too thin to bear the
    load, while nearly all of it takes thicker ones; None where that isn't so."""
    placed, choice = failure.placed, failure.choice
    if placed is None or choice is None or failure.why not in (Why.STABILITY, Why.STRENGTH):
        return None
    net = placed.net
    radius = bends_to(net)
    wanted = _rounding(surface, failure, wish)
    if wanted < _WORTH * radius:
        return None
    return Unbuildable(
        f"at {_at(sharpest(net))} rods bend to a radius of {radius:.3g} m: those that can, {choice.label} of "
        f"{choice.catalogue} for one, stand up to {failure.factor:.2f} × the load of {1e3 * failure.thickness:.3g} mm of concrete "
        f"at {failure.spacing:g} m, where {NEEDED:g} is needed",
        why=Why.CURVATURE,
        where="rod",
        remedy="Round it there, so that thicker rods follow it.",
        spacing=failure.spacing,
        radius=wanted,
        design=design,
    )


def _thinner_rods(wish: DesignWish) -> str:
    return f"Leave --rod {wish.rod} out, so that rods are chosen that the net allows."


def _said(error: NoNet | Stalled) -> str:
    return error.what if isinstance(error, InputError) else str(error)


def too_curved(placed: Placed, possible: Sequence[RodChoice], spacing: float, thickness: float) -> Obstacle:
    """The failure of a net on which every one of the `possible` sections breaks, or is too deep for the
    spacing."""
    net = placed.net
    least = min(possible, key=lambda each: erection_stress(net, each.section))
    stress = erection_stress(net, least.section) / least.section.material.strength
    why = Why.CURVATURE if stress > 1.0 else Why.SPACING
    return Obstacle(
        why=why,
        spacing=spacing,
        thickness=thickness,
        factor=0.0,
        choice=least,
        placed=placed,
        where=sharpest(net),
        stress=stress,
    )


def sharpest(net: Net) -> Reals:
    """Where its rods are bent most (3,), m."""
    most = int(np.argmax(net.curvature.max(axis=1)))
    return np.asarray(net.target.positions[net.grid.rod_ends[most]].mean(axis=0))


def _at(point: Reals) -> str:
    return f"{coordinates(point)} m"
