"""The design that `shellform new` proposes: a net, rods, cables and a load under which it stands.

Nets are pulled at several angles, and the one that bends its rods least is taken. Then the initial design is
solved under its growing load, for the rods with which the estimate says to begin (sizes.py), stiffer ones
where it falls, finer spacings where the stiffest that equation (1) allows falls, and thinner concrete last.
What stands up to `NEEDED` times its load is pulled anew with the gap that follows its rods, solved again, and
ten structures with the errors of building are drawn and loaded. Two elements a segment are enough for that:
they change critical factors by half a percent.

Nothing is random but what is drawn under a fixed seed: the same surface gives the same case.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, NotConverged
from shellform.gridshell.edge_beams import Bundle, EdgeBeam, weight
from shellform.gridshell.gridshell import Cable, Gridshell, Joint, Rod, brace, erection_stress
from shellform.gridshell.joints import following, usual_gap
from shellform.gridshell.layers import single
from shellform.gridshell.loads import concrete, pressure, rods
from shellform.gridshell.tolerances import default_tolerances
from shellform.net.chebyshev import pull_net
from shellform.net.edges import stand
from shellform.net.ladder import climbed_net
from shellform.net.net import Net
from shellform.net.orientation import cost
from shellform.net.refusal import NoNet, Stalled
from shellform.problem.paths import deviations
from shellform.reliability.standing import sample
from shellform.run.sizes import (
    MOST_CROSSINGS,
    DesignWish,
    Placed,
    RodChoice,
    Rope,
    buckling_load,
    choices,
    first_spacing,
    least_spacing,
    practical,
    rope_for,
    wished,
)
from shellform.run.unbuildable import Obstacle, Why, refuse_flat, refuse_size, refused
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import apply_load
from shellform.surface.shape.target import Surface

NEEDED = 1.5  # times the design load, which the perfect structure bears: drawn ones fall earlier
ADDITIONAL = 1.2  # times the concrete: the case "additional"
REST_RATIO = 0.998  # of the cables: their prestrain is about what they may be off in length
DRAWN, SEED = 10, 1
ELEMENTS = 2
THICKNESS, LEAST_THICKNESS = 0.05, 0.015  # m: usual; a first layer of sprayed concrete
_ANGLES = (45.0, 0.0, 22.5, 67.5)  # degrees
_FINER = 0.75  # from one spacing to the next
_SPACINGS = 3
_SMALLEST = 1.0 / 16.0  # of the load, by which a path is followed here
_STRESSED = 0.95  # of the strength, at the most, under the additional load
_AMPLE = 2.0  # times what is needed, by the estimate: there the sections begin
_STEPS = 4  # sections tried on one net
_THINNER = 8  # thicknesses tried
_ALIKE = 0.05  # of curvature: nets that bend rods alike are told apart by their cost
Say = Callable[[str], None]


@dataclass(frozen=True)
class Followed:
    """What a design came to: the `factor` of its load up to which it stands, the rods' `stress` over their strength and the
    largest `deviation`, m, at the last state, and `where` that is (3,), m."""

    factor: float
    stress: float
    deviation: float
    where: Reals


@dataclass(frozen=True)
class FirstDesign:
    """What is proposed: `spacing`, m, and its `reason`; `placed`, the net; `choice` of rods; `rope`;
    `thickness`, m, of the concrete; what the perfect structure came to (`tried`); of `drawn` structures
    `standing`; the largest fibre distance, m, that equation (1) allows rods of that material (`allowed`);
    what was `told` on the way."""

    spacing: float
    reason: str
    placed: Placed
    choice: RodChoice
    rope: Rope
    thickness: float
    tried: Followed
    standing: int
    drawn: int
    allowed: float
    told: tuple[str, ...]


def first_design(surface: Surface, wish: DesignWish, say: Say = lambda text: None) -> FirstDesign:
    """The design to propose. Raises InputError for a surface of absurd size, a flat one, or one that no net
    covers or no rod follows, NotConverged where nothing stands; both with the reason and a way out."""
    refuse_size(surface)
    refuse_flat(surface)
    return _Search(surface, wish, say).found()


class _Search:
    """The search under way: what was tried is `told`."""

    def __init__(self, surface: Surface, wish: DesignWish, say: Say) -> None:
        self.surface, self.wish, self._say = surface, wish, say
        self.told: list[str] = []
        self.best: Obstacle | None = None
        self.reason = "as asked"
        self.angles: Sequence[float] = _ANGLES  # worth trying; with a finer spacing only those that were best

    def say(self, text: str) -> None:
        self.told.append(text)
        self._say(text)

    def found(self) -> FirstDesign:
        spacing, self.reason = self._first_spacing()
        thickness = self.wish.thickness or THICKNESS
        for number in range(_SPACINGS):
            if number:
                finer = practical(_FINER * spacing)
                if self.wish.spacing is not None or self._vain(spacing, finer):
                    break
                spacing, self.reason = finer, f"finer than {spacing:g} m, with which the shell falls"
            design = self._on_net(spacing, thickness)
            if design is not None:
                return design
        return self._thinner(spacing, thickness)

    def _first_spacing(self) -> tuple[float, str]:
        if self.wish.spacing is not None:
            return self.wish.spacing, "as asked"
        spacing, reason = first_spacing(self.surface)
        least = min(least_spacing(each) for each in wished(self.wish.rod, self.wish.layers))
        return (spacing, reason) if spacing >= least else (least, "as near as rods of that depth may lie")

    def _vain(self, spacing: float, finer: float) -> bool:
        """Whether a finer spacing is too fine to solve, or far too little help."""
        if self.best is None:
            raise refused(self.surface, None, self.wish)
        if self.surface.area / finer**2 > MOST_CROSSINGS:
            return True
        return self.best.why is Why.STABILITY and self.best.factor * (spacing / finer) ** 2 < 0.5 * NEEDED

    def _on_net(self, spacing: float, thickness: float) -> FirstDesign | None:
        """The first section that stands on a net of that spacing; None where none does."""
        try:
            placed = self._net(spacing, usual_gap(spacing))
        except (NoNet, Stalled) as error:
            self._keep(Obstacle(Why.NET, spacing, thickness, error=error))
            self.say(f"no net at {spacing:g} m: {error.what if isinstance(error, InputError) else error}")
            return None
        possible = choices(placed.net, spacing, self.wish.rod, self.wish.layers)
        if not possible:
            self._keep(self._too_curved(placed, spacing, thickness))
            return None
        rope, load = rope_for(spacing), pressure(thickness, 2500.0)
        enough = [
            buckling_load(self.surface, spacing, each.bending, rope) >= _AMPLE * NEEDED * load
            for each in possible
        ]
        at = enough.index(True) if any(enough) else len(possible) - 1
        tried_before: set[int] = set()
        for _ in range(_STEPS):
            if at in tried_before:
                break
            tried_before.add(at)
            result = self._stands(placed, possible[at], rope, spacing, thickness)
            if isinstance(result, FirstDesign):
                return result
            if result.why is Why.STRENGTH:
                at = _less_stressed(placed.net, possible, at, result.stress - _STRESSED)
            else:
                wanted = possible[at].bending * max(
                    1.3, (1.1 * NEEDED / max(result.nearness(NEEDED), 0.1)) ** 1.3
                )
                at = next((k for k, each in enumerate(possible) if each.bending >= wanted), len(possible) - 1)
        return None

    def _thinner(self, spacing: float, thickness: float) -> FirstDesign:
        """The thickest concrete that stands where the design falls. Raises where less than a layer is left,
        or another was asked for."""
        failure = self.best
        assert failure is not None
        if failure.choice is None or failure.placed is None or failure.why in (Why.CURVATURE, Why.SPACING):
            raise refused(self.surface, failure, self.wish)
        asked, thinner = thickness, failure.thickness
        placed, choice, nearest = failure.placed, failure.choice, failure
        possible = choices(placed.net, failure.spacing, self.wish.rod, self.wish.layers)
        for _ in range(_THINNER):
            other = choice
            if failure.why is Why.STRENGTH and choice in possible:
                at = possible.index(choice)
                other = possible[_less_stressed(placed.net, possible, at, failure.stress - _STRESSED)]
            if (
                other is choice
            ):  # else the load is kept, and bent rods that leave more of their strength are tried
                thinner = _whole_mm(min(0.8 * thinner, 0.95 * thinner * failure.nearness(NEEDED) / NEEDED))
            choice = other
            if thinner < 0.002:
                break
            result = self._stands(placed, choice, rope_for(failure.spacing), failure.spacing, thinner)
            if isinstance(result, FirstDesign):
                if self.wish.thickness is not None or thinner < LEAST_THICKNESS:
                    nearest = replace(nearest, thickness=asked)
                    raise refused(self.surface, nearest, self.wish, bears=thinner)
                return result
            failure = result
            if failure.why is Why.NET:
                break
        raise refused(self.surface, nearest, self.wish)

    def _net(self, spacing: float, gap: float) -> Placed:
        """The net that bends its rods least, among several angles and offsets. Raises NoNet or Stalled."""
        settings: dict[str, Any] = {"spacing": spacing, "gap": gap, "elements": ELEMENTS}
        angles: Sequence[float] = self.angles if self.wish.angle is None else (self.wish.angle,)
        nets = [each for angle in angles if (each := self._pulled(settings, angle, (0.0, 0.0))) is not None]
        if nets:
            best = _least_bent(nets)
            near = (1.0 + 2.0 * _ALIKE) * best.net.quality.curvature_max
            self.angles = [each.angle for each in nets if each.net.quality.curvature_max <= near][:2]
            moved = self._pulled(settings, best.angle, (0.5, 0.5)) if angles is _ANGLES else None
            best = best if moved is None else _least_bent([best, moved])
        else:
            net, given = climbed_net(
                self.surface, settings, angle=math.radians(angles[0]), progress=self._say
            )
            best = Placed(net, math.degrees(given.angle), given.offset)
        self.say(
            f"net at {best.angle:g}° and {spacing:g} m: {len(best.net.grid.lattice)} crossings, "
            f"rods bend to a radius of {_radius(best.net):.3g} m"
        )
        return replace(best, net=stand(best.net, self.surface))

    def _pulled(self, settings: dict[str, Any], angle: float, offset: tuple[float, float]) -> Placed | None:
        """The net at that angle, degrees, and offset; None where there is none."""
        where = f"net at {angle:g}°, {settings['spacing']:g} m"
        try:
            net = pull_net(self.surface, **settings, angle=math.radians(angle), offset=offset)
        except (NoNet, Stalled) as error:
            self.say(f"{where}: {error.reason.value}")
            return None
        self._say(f"{where}: rods bend to a radius of {_radius(net):.3g} m")
        return Placed(net, angle, offset)

    def _stands(
        self, placed: Placed, choice: RodChoice, rope: Rope, spacing: float, thickness: float
    ) -> FirstDesign | Obstacle:
        """The design with these rods and this load, where it stands with the gap that follows its rods
        too.
        """
        tried = self._tried(placed.net, choice, rope, thickness)
        failure = Obstacle(
            Why.STABILITY, spacing, thickness, tried.factor, choice, placed, tried.where, tried.stress
        )
        what = f"{choice.label} ({choice.catalogue}), {1e3 * thickness:.3g} mm of concrete"
        self.say(
            f"{what}: stands up to {tried.factor:.2f} × its load, rods at {tried.stress:.0%} of their strength"
        )
        if tried.factor < NEEDED:
            return self._keep(failure)
        if tried.stress > _STRESSED:
            return self._keep(replace(failure, why=Why.STRENGTH))
        gap = following(Rod(choice.section)).gap
        settings: dict[str, Any] = {"spacing": spacing, "gap": gap, "elements": ELEMENTS}
        if not math.isclose(placed.net.grid.gap, gap, rel_tol=1e-9):
            try:
                net, given = climbed_net(
                    self.surface,
                    settings,
                    angle=math.radians(placed.angle),
                    offset=placed.offset,
                    progress=self._say,
                )
            except (NoNet, Stalled) as error:
                return self._keep(Obstacle(Why.NET, spacing, thickness, error=error))
            placed = Placed(stand(net, self.surface), math.degrees(given.angle), given.offset)
            if erection_stress(placed.net, choice.section) > choice.section.material.strength:
                return self._keep(replace(failure, why=Why.STRENGTH, placed=placed, stress=1.0))
            tried = self._tried(placed.net, choice, rope, thickness)
            if tried.factor < NEEDED:
                return self._keep(replace(failure, factor=tried.factor, placed=placed))
        shell, loads = _shell(placed.net, self.surface, choice, rope, thickness)
        drawn = sample(
            shell,
            shell.design(rest_ratio=REST_RATIO),
            loads["design"],
            default_tolerances(shell),
            count=DRAWN,
            seed=SEED,
        )
        standing = sum(each.stands for each in drawn.outcomes)
        self.say(f"{what}: {standing} of {DRAWN} drawn structures stand under the design load")
        if standing < DRAWN:
            return self._keep(replace(failure, why=Why.SCATTER, factor=tried.factor, placed=placed))
        material = choice.section.material
        allowed = placed.net.max_radius(young=material.young, strength=material.strength)
        return FirstDesign(
            spacing, self.reason, placed, choice, rope, thickness, tried, standing, DRAWN, allowed, tuple(self.told)
        )  # fmt: skip

    def _tried(self, net: Net, choice: RodChoice, rope: Rope, thickness: float) -> Followed:
        shell, loads = _shell(net, self.surface, choice, rope, thickness)
        design = shell.design(rest_ratio=REST_RATIO)
        assembly = assemble(shell.network(design))
        none = np.zeros((shell.node_count, 6))
        factor, load = 0.0, none
        state, stressed = shell.target, shell.target
        try:
            state = find_equilibrium(assembly, shell.target, none).state
            for goal in (ADDITIONAL, NEEDED):  # the stress counts under the first
                more = goal * loads["design"]
                found = apply_load(assembly, state, load, more, stay=True, smallest=_SMALLEST)
                factor += (goal - factor) * found.share
                state, load = found.equilibrium.state, more
                stressed = state if goal == ADDITIONAL else stressed
                if not found.on_branch:
                    break
        except NotConverged as error:
            state = error.state if isinstance(error.state, State) else state
        away = deviations(shell, state)
        return Followed(
            factor,
            float(shell.utilisation(design, stressed).max()),
            float(away.max()),
            shell.target.positions[int(np.argmax(away))],
        )

    def _too_curved(self, placed: Placed, spacing: float, thickness: float) -> Obstacle:
        """The failure of a net on which every section breaks, or is too deep for the spacing."""
        net = placed.net
        bent = net.curvature.max(axis=1)
        place = net.target.positions[net.grid.rod_ends[int(np.argmax(bent))]].mean(axis=0)
        least = min(
            wished(self.wish.rod, self.wish.layers), key=lambda each: erection_stress(net, each.section)
        )
        stress = erection_stress(net, least.section) / least.section.material.strength
        why = Why.CURVATURE if stress > 1.0 else Why.SPACING
        return Obstacle(why, spacing, thickness, 0.0, least, placed, place, stress)

    def _keep(self, failure: Obstacle) -> Obstacle:
        """The failure, kept if it came nearer than those before."""
        if self.best is None or failure.factor >= self.best.factor:
            self.best = failure
        return failure


def _shell(
    net: Net, surface: Surface, choice: RodChoice, rope: Rope, thickness: float
) -> tuple[Gridshell, dict[str, Reals]]:
    """The gridshell and its loads; the joint's gap is the net's."""
    rod = Rod(choice.section)
    fitting = following(rod)
    joint = Joint(fitting.axial, fitting.torsion, fitting.bending, net.grid.gap)
    radius = math.sqrt(single(choice.section).constants[0] / math.pi)
    edge = EdgeBeam(Bundle(radius, 19, 0.5, choice.section.material)) if net.edges else None
    shell = brace(net, rod, joint, Cable(rope.stiffness), below=surface, edge=edge)
    own = rods(net, choice.section)
    if edge is not None:
        own = own + weight(net, edge)
    poured = concrete(net, surface, thickness=thickness)
    return shell, {"design": poured + own, "additional": ADDITIONAL * poured + own}


def _less_stressed(net: Net, possible: Sequence[RodChoice], at: int, excess: float) -> int:
    """The stiffest section below `at` that bending into the net stresses less, by a share `excess` of its
    strength.
    """
    share = [erection_stress(net, each.section) / each.section.material.strength for each in possible]
    return next((k for k in range(at - 1, -1, -1) if share[k] <= share[at] - excess), at)


def _least_bent(nets: Sequence[Placed]) -> Placed:
    """The net whose rods bend least; among those alike that of the least cost."""
    least = min(each.net.quality.curvature_max for each in nets)
    alike = [each for each in nets if each.net.quality.curvature_max <= (1.0 + _ALIKE) * least]
    return min(alike, key=lambda each: cost(each.net))


def _radius(net: Net) -> float:
    return 1.0 / max(net.quality.curvature_max, 1e-12)


def _whole_mm(thickness: float) -> float:
    return math.floor(1e3 * thickness) / 1e3
