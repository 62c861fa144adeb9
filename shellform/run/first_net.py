"""The net that a first design begins with: of several angles and offsets the one that bends its rods least.
On a saddle these lie along its straight lines, where they bear nothing as arches; there the net across is
told too.

Angles are tried side by side, on as many cores as there are; what comes of them is judged in order, so that
it is the same on any number. Pulls that fail end earlier here than in a design: nets that are found take up
to a hundred factorisations. Where no angle gives a net, the ladder (net/ladder.py) is climbed from the one
whose failure costs least to mend, with fewer factorisations for larger nets; not on surfaces that are tried
as a way out, of which the next rounder one is more likely to take a net than another attempt on this one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace

import numpy as np

from shellform.net.chebyshev import NetSettings, NetTuning, net_at
from shellform.net.cover import NOTABLE
from shellform.net.edges import Edges, stand
from shellform.net.ladder import climbed_net
from shellform.net.net import Net
from shellform.net.orientation import cost
from shellform.net.quality import refuse_nearness
from shellform.net.refusal import Attempt, NoNet, Stalled
from shellform.quantities import number
from shellform.run.first_trial import ELEMENTS
from shellform.run.sizes import MOST_CROSSINGS, Placed
from shellform.structure.elements.threads import in_turn
from shellform.surface.shape.target import Surface

ANGLES = (45.0, 0.0, 22.5, 67.5)  # degrees
_ALIKE = 0.05  # of curvature: nets that bend rods alike are told apart by their cost
_ACROSS = 45.0  # degrees: from the straight lines of a saddle to its arches
# Times the curvature of rods along these; across a barrel's diagonals 1.4, on saddles 2.6 to 5.4.
_ARCHED = 2.0
_PULL, _BRIEF = 110, 70  # factorisations of one pull
_PULLS, _USUAL_CROSSINGS = 450, 300  # factorisations of failed pulls, for so many crossings
_LARGEST = 20.0  # times the usual crossings: hours of a processor before a design must have been found
# crossings pulled and solved, ways out included: two to three minutes of a processor, two at the most on two
WORK = 45_000
_A_PULL, _AT_ONCE = 40, 5  # factorisations that count as one pull; at the least, where it ends before any
_A_TRIAL = 100  # factorisations of designs on the trimmed net that do
Say = Callable[[str], None]


@dataclass
class Allowance:
    """How much `work` a search may do, in crossings of the nets that are pulled and of the designs that are
    solved; and how much is `left` of it. Seconds aren't asked, so that a surface ends at the same place on
    any machine, however busy. What a part spends the `whole` spends too, and where that is over so is the
    part. Whether it is `thorough`: climbs the ladder where no angle gives a net, and tries finer spacings
    where no section stands; whether it `thins` concrete then, and to `thin_layers`, less than is poured at
    once, too. Of what was found last, the `angle`, degrees, of the net, and what share of its load the shell
    `bore` at the most."""

    work: int = WORK
    thorough: bool = True
    thins: bool = True
    thin_layers: bool = False
    angle: float | None = None
    bore: float = 0.0
    whole: Allowance | None = None
    left: int = field(init=False)
    _was_over: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self.left = self.work

    @property
    def over(self) -> bool:
        """Whether nothing new may begin."""
        return self.left <= 0 or (self.whole is not None and self.whole.over)

    @property
    def ran_out(self) -> bool:
        """Whether it is over, or was before some was left to it: what came of it then was not looked for to
        its end."""
        return self._was_over or self.over

    @classmethod
    def for_size(cls, surface: Surface, spacing: float | None) -> Allowance:
        """The usual one; so many times more work as the `spacing`, m, that was asked for makes more crossings
        than a first design has by itself, which each trial then takes."""
        return cls(round(larger(surface, spacing) * WORK))

    def part(self, share: float) -> Allowance:
        """Another one, that may spend a `share` of this one's work."""
        return Allowance(round(share * self.work), whole=self)

    def rest(
        self, share: float, *, thorough: bool = True, thins: bool = True, thin_layers: bool = False
    ) -> Allowance:
        """Another one, that may spend a `share` of what is left of this one's work."""
        return Allowance(round(share * self.left), thorough, thins, thin_layers, whole=self)

    def leave(self, share: float) -> None:
        """Sees to it that a `share` of its work is left, at the cost of what else the whole is for."""
        self._was_over = self.ran_out
        self.left = max(self.left, round(share * self.work))

    def spend(self, crossings: float, times: int = 1) -> None:
        """Takes what a pull or a trial on a net of so many `crossings` costs."""
        self.left -= times * round(crossings)
        if self.whole is not None:
            self.whole.spend(crossings, times)

    def spend_on(self, net: Net, factorisations: int) -> None:
        """Takes what so many factorisations of designs on a net cost."""
        self.spend(len(net.grid.lattice) * factorisations / _A_TRIAL)


def larger(surface: Surface, spacing: float | None) -> float:
    """How many times more crossings than a first design has by itself the `spacing`, m, asked for makes: at
    least 1, and no more than is worth waiting for."""
    if spacing is None:
        return 1.0
    across = math.sqrt(surface.area / MOST_CROSSINGS) / spacing
    return min(max(across, 1.0), math.sqrt(_LARGEST)) ** 2


@dataclass(frozen=True, eq=False)
class FirstNets:
    """The `best` net, which bends its rods least; up to two `angles`, degrees, that bend them nearly as
    little, none where only the ladder gave a net; and the net `across` (None: it isn't needed, or wasn't
    found), where the best one's rods lie along the straight lines of a saddle."""

    best: Placed
    angles: tuple[float, ...]
    across: Placed | None = None


def least_bent_net(
    surface: Surface,
    spacing: float,
    gap: float,
    angles: Sequence[float],
    say: Say,
    allowance: Allowance,
    *,
    shifted: bool,
    tell: Say,
) -> FirstNets:
    """The net that bends its rods least among those at the `angles`, degrees, and, if it is to be `shifted`,
    the best of these half a spacing off. `say` hears what fails, `tell` what doesn't; the `allowance` is
    spent. Raises NoNet or Stalled."""
    limit = _PULL if allowance.thorough else _BRIEF
    settings = NetSettings(spacing=spacing, gap=gap, elements=ELEMENTS, tuning=NetTuning(limit=limit))
    crossings = surface.area / spacing**2

    def attempt(place: tuple[float, tuple[float, float]]) -> Placed | NoNet | Stalled:
        angle, offset = place
        try:
            net = net_at(surface, settings, angle=math.radians(angle), offset=offset)
            refuse_nearness(net.quality, net.grid, net.target)
        except (NoNet, Stalled) as error:
            return error
        return Placed(net, angle, offset)

    def counted(found: Placed | NoNet | Stalled, angle: float) -> Placed | NoNet | Stalled:
        where = f"net at {angle:g}°, {spacing:g} m"
        if isinstance(found, Placed):
            allowance.spend(crossings)
            tell(f"{where}: rods bend to a radius of {bends_to(found.net):.3g} m")
        else:
            allowance.spend(crossings * _share_of_pull(_taken(found)))
            say(f"{where}: {found.reason.value}")
        return found

    pulled: list[Placed | NoNet | Stalled] = []
    with closing(in_turn(attempt, [(angle, (0.0, 0.0)) for angle in angles])) as attempts:
        for found, angle in zip(attempts, angles, strict=True):
            pulled.append(counted(found, angle))
            if allowance.over:
                break
    nets = [each for each in pulled if isinstance(each, Placed)]
    if nets:
        best = _least_bent(nets)
        most = (1.0 + 2.0 * _ALIKE) * best.net.quality.curvature_max
        near = [each.angle for each in nets if each.net.quality.curvature_max <= most][:2]
        across = _across(best, nets)
        moved = counted(attempt((best.angle, (0.5, 0.5))), best.angle) if shifted else None
        best = _least_bent([best, moved]) if isinstance(moved, Placed) else best
        further = dict.fromkeys([*near, *([across.angle] if across else [])])
        return FirstNets(best, tuple(further), across)
    first, failed = min(
        ((k, each) for k, each in enumerate(pulled) if not isinstance(each, Placed)),
        key=lambda each: (isinstance(each[1], Stalled), each[0]),  # whose next attempts take longest
    )
    left = _worth(surface, spacing) - sum(_taken(each) for each in pulled if not isinstance(each, Placed))
    if allowance.over or not allowance.thorough or left <= 0:
        raise failed
    try:
        net, given = climbed_net(
            surface,
            replace(settings, tuning=NetTuning()),  # as a design climbs it
            angle=math.radians(angles[first]),
            most=left + _taken(failed),
            failed=failed,
            near=False,
            progress=tell,
        )
    except (NoNet, Stalled) as error:
        allowance.spend(crossings * _share_of_pull(_taken(error) - _taken(failed)))
        raise
    allowance.spend(crossings * _climbed(net.attempts[1:-1]))
    return FirstNets(Placed(net, math.degrees(given.angle), given.offset), ())


def with_gap(
    surface: Surface,
    placed: Placed,
    spacing: float,
    gap: float,
    edges: Edges,
    tell: Say,
    allowance: Allowance,
    *,
    climbs: bool,
) -> Placed:
    """The net pulled anew with another gap, its edges standing on what `edges` say; where that fails it
    `climbs` the ladder, or doesn't. The `allowance` is spent. Raises NoNet or Stalled."""
    crossings = surface.area / spacing**2
    try:
        net, given = climbed_net(
            surface,
            NetSettings(spacing=spacing, gap=gap, elements=ELEMENTS),
            angle=math.radians(placed.angle),
            offset=placed.offset,
            most=_worth(surface, spacing) if climbs else 0,
            near=False,
            progress=tell,
        )
    except (NoNet, Stalled) as error:
        allowance.spend(crossings * _share_of_pull(_taken(error)))
        raise
    allowance.spend(crossings * _climbed(net.attempts[:-1]))
    return Placed(stand(net, surface, edges), math.degrees(given.angle), given.offset)


def net_told(placed: Placed, spacing: float) -> str:
    """What the net of a `spacing`, m, is."""
    return (
        f"net at {placed.angle:g}° and {spacing:g} m: {len(placed.net.grid.lattice)} crossings, "
        f"rods bend to a radius of {bends_to(placed.net):.3g} m{bare_told(placed.net)}"
    )


def bare_told(net: Net) -> str:
    """How much of the surface lies beyond its rods, to follow what else is said of it; nothing where that is
    little."""
    if net.bare_cells < NOTABLE:
        return ""
    return f", {number(net.quality.uncovered_area, 2)} m² of the surface lie beyond them"


def bends_to(net: Net) -> float:
    """The least radius, m, to which its rods are bent."""
    return 1.0 / max(net.quality.curvature_max, 1e-12)


def _across(best: Placed, nets: Sequence[Placed]) -> Placed | None:
    """Of the nets the one across the straight lines along which the `best` one's rods lie, if they do."""
    for each in nets:
        turned = (each.angle - best.angle) % 90.0
        if math.isclose(turned, _ACROSS) and arching(each.net) > _ARCHED * arching(best.net):
            return each
    return None


def arching(net: Net) -> float:
    """How much its rods are bent out of the surface, 1/m, in the root of the mean square."""
    return float(np.sqrt(np.mean(net.curvature[:, 0] ** 2)))


def _worth(surface: Surface, spacing: float) -> int:
    """How many factorisations of pulls that fail a net is worth."""
    return round(_PULLS * min(1.0, _USUAL_CROSSINGS * spacing**2 / surface.area))


def _share_of_pull(factorisations: int) -> float:
    """What pulls that failed cost, by the factorisations that they took, in pulls that end with a net."""
    return max(factorisations, _AT_ONCE) / _A_PULL


def _climbed(failed: Sequence[Attempt]) -> float:
    """What attempts at a net that `failed` cost, and then the one that gave it, in pulls that end with a
    net."""
    return 1.0 + sum(_share_of_pull(each.factorisations) for each in failed)


def _taken(error: NoNet | Stalled) -> int:
    """Factorisations of pulls that failed."""
    return error.iterations if isinstance(error, Stalled) else error.factorisations


def _least_bent(nets: Sequence[Placed]) -> Placed:
    """The net whose rods bend least; among those alike that of the least cost, of those that leave less than
    a cell bare if there are any."""
    least = min(each.net.quality.curvature_max for each in nets)
    alike = [each for each in nets if each.net.quality.curvature_max <= (1.0 + _ALIKE) * least]
    return min(alike, key=lambda each: (each.net.bare_cells >= 1.0, cost(each.net)))
