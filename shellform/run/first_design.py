"""The design that `shellform new` proposes: a net, rods, cables and a load under which it stands.

Nets are pulled at several angles, and the one that bends its rods least is taken. Then the initial design
is solved under its growing load, for the rods with which the estimate says to begin (sizes.py), stiffer
ones where it falls, two layers where the stiffest that equation (1) allows falls, finer spacings, and
thinner concrete last (first_thinner.py). What stands up to `NEEDED` times its load is pulled anew with the
gap that follows its rods, solved again, and forty structures are drawn and loaded (first_trial.py). Edge
beams are bundles of rods, or stiffer steel tubes where these are stressed too much or the shell nearly
stands (first_edges.py). What stands gets heavier edge beams, stiffer rods and thicker strands where they
help (first_finish, first_steadier), and thinner rods where its own break on every way up (first_raised).

Nothing is random but what is drawn under a fixed seed: the same surface gives the same case.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import replace

from shellform.errors import InputError
from shellform.gridshell.joints import turning_stress, usual_gap
from shellform.gridshell.layers import layers_of
from shellform.gridshell.loads import CONCRETE, pressure, refuse_bulk
from shellform.net.edges import Edges, stand
from shellform.net.refusal import NoNet, Stalled
from shellform.run.first_edges import HEAVY, EdgeChoice, edge_choices
from shellform.run.first_finish import came_to, made_of, nearer, straighter, too_far, with_room
from shellform.run.first_net import ANGLES, Allowance, least_bent_net, net_told, with_gap
from shellform.run.first_raised import raisable
from shellform.run.first_steadier import steadier, strays, with_strays
from shellform.run.first_thinner import with_thinner_concrete
from shellform.run.first_trial import (
    DRAWN,
    NEEDED,
    FirstDesign,
    FirstParts,
    Followed,
    drawn_standing,
    followed,
)
from shellform.run.next_trial import (
    EASES,
    after,
    edges_may_help,
    fails_by,
    finer_is_vain,
    more_come,
    narrowed,
    relieved,
    stiffer_rods,
    thinner_rods,
)
from shellform.run.sizes import (
    BENT,
    MOST_CROSSINGS,
    DesignWish,
    Placed,
    RodChoice,
    choices,
    first_choice,
    first_spacing,
    hopeless,
    least_spacing,
    may_sag,
    practical,
    rest_ratio_for,
    rope_for,
    usual_thickness,
    wished,
)
from shellform.run.unbuildable import (
    Obstacle,
    Why,
    refuse_flat,
    refuse_size,
    refuse_tipping,
    sharpest,
    too_curved,
)
from shellform.surface.shape.target import Surface

_FINER = 0.75  # from one spacing to the next
_SPACINGS = 3  # tried, one after the other
_STEPS = 4  # sections tried on one net
# where less stiff ones fell, deeper ones broke, and some lie between; two layers of thinner ones come before
_NARROWED = 6
_BENT_HARD = 0.9  # of the rods' strength, that bending takes where thin layers of concrete are tried too
_TURNED = 0.5  # of the rods' strength lost to joints that resist turning: beyond it no others are tried
Say = Callable[[str], None]


def first_design(
    surface: Surface, wish: DesignWish, say: Say = lambda _: None, allowance: Allowance | None = None
) -> FirstDesign:
    """The design to propose, found within an `allowance` of work. Raises what `standing_design` does."""
    allowance = allowance or Allowance()
    found = standing_design(surface, wish, say, allowance)
    return finished_design(found, surface, wish, say, allowance)


def standing_design(
    surface: Surface, wish: DesignWish, say: Say, allowance: Allowance, *, finer: bool = False
) -> FirstDesign:
    """The first that stands; spacings begin with the usual one, or where that was tried with the next
    `finer`, unless that takes more crossings than a first design has. Raises InputError for a surface of
    absurd size, a flat one, or one that no net covers or no rod follows, NotConverged where nothing stands;
    both with the reason and a way out."""
    refuse_size(surface)
    refuse_flat(surface)
    if wish.thickness is not None:
        refuse_bulk(surface, wish.thickness, where="--thickness")
    return _Search(surface, wish, say, allowance).that_holds(finer=finer)


def finished_design(
    design: FirstDesign, surface: Surface, wish: DesignWish, say: Say, allowance: Allowance
) -> FirstDesign:
    """What stands for the surface and wish, on edge beams that don't sag too far, near enough to its shape,
    with strands that leave a search room and rods that bear being raised."""
    search = _Search(surface, wish, say, allowance)
    search.told, search.reasons = list(design.told), {design.spacing: design.reason}
    found = straighter(design, surface, search.with_edges, allowance)
    if too_far(found, surface):
        found = nearer(found, surface, search.stiffer, search.other, allowance, search.say)
    found = with_strays(with_room(found, surface, search.say), surface)
    if strays(found, surface):
        found = steadier(found, surface, search.stiffer, search.other, allowance, search.say)
    found = raisable(found, surface, search.thinner, search.other, allowance, search.say)
    return replace(found, told=tuple(search.told))


class _Search:
    """The search under way: what was tried is `told`."""

    def __init__(self, surface: Surface, wish: DesignWish, say: Say, allowance: Allowance) -> None:
        self.surface, self.wish, self._say, self.allowance = surface, wish, say, allowance
        self.told: list[str] = []
        self.best: Obstacle | None = None
        self.failures: list[Obstacle] = []
        self.reasons: dict[float, str] = {}
        self.edges = Edges(outer=wish.edges)
        self.layers: Sequence[int] = (wish.layers,) if wish.layers else (1,) if wish.rod else (1, 2)
        self.lightest = 0  # of the choices of edge beams, with which they begin
        self.angles: Sequence[float] = ANGLES  # worth trying; with a finer spacing only those that were best

    def say(self, text: str) -> None:
        self.told.append(text)
        self._say(text)

    def stiffer(self, design: FirstDesign, times: float) -> RodChoice | None:
        """Rods so many `times` as stiff as those of a design, or the stiffest, in as many layers or more."""
        own = layers_of(design.parts.choice.section)
        possible = [
            each
            for layers in self.layers
            if layers >= own
            for each in choices(design.placed.net, design.spacing, self.wish.rod, layers)
        ]
        return stiffer_rods(design.placed.net, possible, design.parts.choice, design.tried.stress, times)

    def thinner(self, design: FirstDesign, share: float) -> RodChoice:
        """Rods in as many layers that bending stresses to a `share` of what it does a design's, if any."""
        own = design.parts.choice
        possible = choices(design.placed.net, design.spacing, self.wish.rod, layers_of(own.section))
        return thinner_rods(possible, own, share)

    def that_holds(self, *, finer: bool) -> FirstDesign:
        """The first that stands."""
        spacing, thickness = self._first_spacing(), self._thickness
        if finer and self.surface.area <= MOST_CROSSINGS * practical(_FINER * spacing) ** 2:
            spacing = self._finer(spacing)
        for number in range(_SPACINGS):
            if number:
                if self.wish.spacing is not None or self._vain(spacing, practical(_FINER * spacing)):
                    break
                spacing = self._finer(spacing)
            design = self._on_net(spacing, thickness)
            if design is not None:
                return design
        assert self.best is not None
        return with_thinner_concrete(
            self.surface, self.wish, self.failures, self.best, self._stands, self.allowance
        )

    @property
    def _thickness(self) -> float:
        """m, of concrete that is looked for."""
        return self.wish.thickness or usual_thickness(self.surface)

    def _first_spacing(self) -> float:
        if self.wish.spacing is not None:
            spacing, reason = self.wish.spacing, "as asked"
        else:
            spacing, reason = first_spacing(self.surface)
            least = min(least_spacing(each) for each in wished(self.wish.rod, self.layers[0]))
            if spacing < least:
                spacing, reason = least, "as near as rods of that depth may lie"
        self.reasons[spacing] = reason
        return spacing

    def _finer(self, spacing: float) -> float:
        """The next finer spacing."""
        finer = practical(_FINER * spacing)
        self.reasons[finer] = f"finer than {spacing:g} m, with which none stands"
        return finer

    def _vain(self, spacing: float, finer: float) -> bool:
        """Whether a finer spacing is too fine to solve, or far too little help."""
        assert self.best is not None
        ended = self.allowance.over or not self.allowance.thorough
        return ended or finer_is_vain(self.best, self.surface.area, spacing, finer)

    def _on_net(self, spacing: float, thickness: float) -> FirstDesign | None:
        """The first section that stands on a net of that spacing; None where none does."""
        try:
            nets = self._nets(spacing, usual_gap(spacing))
        except (NoNet, Stalled) as error:
            self._keep(Obstacle(Why.NET, spacing, thickness, error=error))
            self.say(f"no net at {spacing:g} m: {error.what if isinstance(error, InputError) else error}")
            return None
        for layers, placed in itertools.product(self.layers, nets):
            possible = choices(placed.net, spacing, self.wish.rod, layers)
            if possible and (result := self._first_that_stands(placed, possible, spacing, thickness)):
                return result
        if self.best is None:
            self._keep(too_curved(nets[-1], wished(self.wish.rod, self.layers[0]), spacing, thickness))
        return self._on_heavier_edges(nets[-1], spacing, thickness) if nets[-1].net.edges else None

    def _on_heavier_edges(self, placed: Placed, spacing: float, thickness: float) -> FirstDesign | None:
        """The design on far heavier edge beams, without which no rods help where edges give way; None where
        these let the shell bear hardly more."""
        nearest = self.best
        assert nearest is not None
        falls = nearest.factor > 0.0 and nearest.spacing == spacing and nearest.why is not Why.SCATTER
        if nearest.choice is None or not falls or self.lightest or self.allowance.over:
            return None
        before = list(self.failures)
        self.lightest = HEAVY
        result = self._stands(placed, nearest.choice, spacing, thickness)
        if isinstance(result, FirstDesign):
            return result
        if result.eases(nearest, NEEDED) < EASES:
            self.lightest, self.failures, self.best = 0, before, nearest
            return None
        possible = choices(placed.net, spacing, self.wish.rod, layers_of(nearest.choice.section))
        tried = {possible.index(nearest.choice): result}
        return self._first_that_stands(placed, possible, spacing, thickness, tried)

    def _first_that_stands(
        self,
        placed: Placed,
        possible: Sequence[RodChoice],
        spacing: float,
        thickness: float,
        tried: dict[int, Obstacle] | None = None,
    ) -> FirstDesign | None:
        """The design with the first of the `possible` sections, by rising stiffness, that stands, none of
        those that were `tried`; None where none does that is likely to."""
        needed = NEEDED * pressure(thickness, CONCRETE)
        if hopeless(self.surface, spacing, possible[-1], needed):
            most, place = possible[-1], sharpest(placed.net)
            self._keep(Obstacle(Why.STABILITY, spacing, thickness, 0.0, most, placed, place))
            self.say(f"{most.label} ({most.catalogue}) and thinner: far too thin for the load")
            return None
        if tried:
            at = after(placed.net, possible, tried)
        else:
            tried, at = {}, first_choice(placed.net, self.surface, spacing, possible, needed)
        narrows = not more_come(possible[-1], self.layers)
        bent = (_BENT_HARD if self.allowance.thin_layers else BENT) if narrows else 0.0
        while at not in tried:
            ended = len(tried) >= (_NARROWED if narrows and narrowed(possible, tried) else _STEPS)
            if tried and (ended or self.allowance.over):
                break
            result = self._stands(placed, possible[at], spacing, thickness)
            if isinstance(result, FirstDesign):
                return result
            tried[at] = result
            at = after(placed.net, possible, tried, bent=bent)
        return None

    def _nets(self, spacing: float, gap: float) -> list[Placed]:
        """The net that bends its rods least, among several angles and offsets; before it, on a saddle, the
        one across it, unless edge beams give way to its arches. Raises NoNet or Stalled."""
        angles: Sequence[float] = self.angles if self.wish.angle is None else (self.wish.angle,)
        found = least_bent_net(
            self.surface, spacing, gap, angles, self.say, self.allowance, shifted=angles is ANGLES, tell=self._say
        )  # fmt: skip
        self.angles, self.allowance.angle = found.angles or self.angles, found.best.angle
        best = self._stood(found.best, spacing)
        if found.across is None or best.net.edges:
            return [best]
        return [self._stood(found.across, spacing), best]

    def _stood(self, placed: Placed, spacing: float) -> Placed:
        """The net with its edges standing on what they are, told."""
        stood = replace(placed, net=stand(placed.net, self.surface, self.edges))
        self.say(net_told(stood, spacing))
        refuse_tipping(stood.net)
        return stood

    def _stands(
        self, placed: Placed, choice: RodChoice, spacing: float, thickness: float
    ) -> FirstDesign | Obstacle:
        """The design with these rods and this load, and the lightest edge beams with which it stands. Single
        rods of which drawn structures fall, or that break, or whose cables are pulled too much, give way to
        two layers, which cost no more and spare more than heavier edge beams. Only where concrete is thinned
        do edges that sag give way to heavier ones, but not of structures that fall: before that, other rods
        do better, and for these still less concrete."""
        spare, thinned = more_come(choice, self.layers), thickness < self._thickness
        far = may_sag(self.surface, thickness) if thinned else math.inf
        leaves = (Why.SCATTER, Why.STRENGTH, Why.CABLES) if spare else (Why.SCATTER,) if thinned else ()
        for edge in edge_choices(choice)[self.lightest : self.lightest + HEAVY]:
            result = self.with_edges(placed, choice, edge, spacing, thickness)
            if isinstance(result, FirstDesign) or not placed.net.edges:
                break
            if result.why in leaves or not edges_may_help(result, far):
                break
        return result

    def with_edges(
        self, placed: Placed, choice: RodChoice, edge: EdgeChoice, spacing: float, thickness: float
    ) -> FirstDesign | Obstacle:
        """The design with the strands and the prestrain that are usual."""
        swivels = turning_stress(placed.net, choice.section.material) > _TURNED
        parts = FirstParts(choice, edge, rest_ratio_for(self.surface, spacing), rope_for(spacing), swivels)
        return self._with_parts(placed, parts, spacing, thickness)

    def other(self, design: FirstDesign, parts: FirstParts) -> FirstDesign | Obstacle:
        """The design of other parts; where its net can't be pulled with the gap that follows their rods, no
        other is looked for."""
        return self._with_parts(design.placed, parts, design.spacing, design.thickness, climbs=False)

    def _with_parts(
        self, placed: Placed, parts: FirstParts, spacing: float, thickness: float, *, climbs: bool = True
    ) -> FirstDesign | Obstacle:
        """The design, where it stands with the gap that follows its rods too, and the net pulled with that
        bends them no more than they bear; one that can't be pulled `climbs` the ladder, or doesn't."""
        parts, tried, failure = self._solved(placed, parts, spacing, thickness)
        choice, gap, what = parts.choice, parts.joint.gap, made_of(placed, parts, thickness)
        if failure is None and not math.isclose(placed.net.grid.gap, gap, rel_tol=1e-9):
            try:
                placed = with_gap(
                    self.surface, placed, spacing, gap, self.edges, self._say, self.allowance, climbs=climbs
                )
            except (NoNet, Stalled) as error:
                return self._keep(Obstacle(Why.NET, spacing, thickness, error=error))
            if (bent := too_curved(placed, [choice], spacing, thickness)).why is Why.CURVATURE:
                return self._keep(bent)
            parts, tried, failure = self._solved(placed, parts, spacing, thickness)
        self.say(f"{what}: {came_to(placed, tried)}")
        if failure is not None:
            return self._keep(failure)
        drawn = drawn_standing(placed.net, self.surface, parts, thickness)
        self.allowance.spend_on(placed.net, drawn.factorisations)
        self.say(f"{what}: {drawn.told}")
        if drawn.falls:
            return self._keep(Obstacle(
                Why.SCATTER, spacing, thickness, tried.factor, choice, placed, tried.where, tried.stress,
                stood=drawn.standing / DRAWN,
            ))  # fmt: skip
        material = choice.section.material
        allowed = placed.net.max_radius(young=material.young, strength=material.strength)
        return FirstDesign(
            spacing=spacing, reason=self.reasons[spacing], placed=placed, parts=parts, thickness=thickness,
            tried=tried, standing=drawn.standing, drawn=DRAWN, allowed=allowed, told=tuple(self.told),
        )  # fmt: skip

    def _solved(
        self, placed: Placed, parts: FirstParts, spacing: float, thickness: float
    ) -> tuple[FirstParts, Followed, Obstacle | None]:
        """The parts with cables below their limit, what the design came to, and what it fails by, if any."""
        parts, tried = relieved(parts, lambda each: self._followed(placed, each, thickness))
        why = fails_by(tried)
        if why is None:
            return parts, tried, None
        stress = {Why.EDGES: tried.edge, Why.CABLES: tried.pull}.get(why, tried.stress)
        place = tried.most_stressed if why is Why.STRENGTH else tried.where
        return parts, tried, Obstacle(
            why, spacing, thickness, tried.factor, parts.choice, placed, place, stress, tried.sag
        )  # fmt: skip

    def _followed(self, placed: Placed, parts: FirstParts, thickness: float) -> Followed:
        self.allowance.spend(len(placed.net.grid.lattice))
        return followed(placed.net, self.surface, parts, thickness)

    def _keep(self, failure: Obstacle) -> Obstacle:
        """The failure, kept if it came nearer than those before."""
        self.failures.append(failure)
        self.allowance.bore = max(self.allowance.bore, failure.bore(NEEDED))
        if self.best is None or failure.near(NEEDED) >= self.best.near(NEEDED):
            self.best = failure
        return failure
