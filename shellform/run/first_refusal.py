"""What `shellform new` says of a shell that it can't design: the reason, and a way out that it went itself.

Three are tried, each where the reason says that it may help, and offered only where a design then stood:
walls all round, where the shell tips, gives way or is stressed too much and edge beams carry its edge; a
rounded surface, where its rods are bent too much (way_out.py), on walls where it falls on edge beams; and as
much concrete as these bear, where no rounded surface helps, or it falls of its load alone. None is begun once
the work is done that a surface is worth, of which a fifth is left for walls and two for rounded surfaces,
whatever came before. Each ends with the first design that stands; who goes that way has it finished.

Of a shell that stands and strays too far as built walls are tried too, where edge beams carry its edge.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from shellform.errors import InputError, NotConverged
from shellform.net.edges import stretches_of
from shellform.run.first_design import standing_design
from shellform.run.first_net import Allowance
from shellform.run.first_steadier import strays, with_strays
from shellform.run.first_thinner import least_layer
from shellform.run.first_trial import FirstDesign
from shellform.run.folder import BUILDABLE
from shellform.run.plinths import plinths_for
from shellform.run.sizes import DesignWish, usual_thickness
from shellform.run.unbuildable import Falls, Tips, Unbuildable, Why, flat_between_creases
from shellform.run.way_out import COVERED, Nearest, nearest_buildable, renewed
from shellform.surface.shape.target import Surface

_SHARES = (0.2, 0.5, 1.0)  # of the radius at which rods bear the load by a cautious estimate
_FLAT_SHARES = (1.0, 1.8)  # of a radius that makes a vault of flat pieces
_WELL_COVERED = 1.4 * COVERED  # spacings: of COVERED itself half the nets are bent a little too much
_APART = 1.3  # from one to the next, at the least
_FURTHER = 1.7  # times the largest radius, where it helps nothing
_TRIED = 0.8  # of the work that is left: on rounded surfaces, on these again on walls, and with less concrete
_ROUNDED = 0.4  # of all the work, that is left for rounded surfaces, whatever came before
_FOR_WALLS = 0.2  # the same for walls
_WALLED = 0.4  # on walls at the most, with which large nets are tried once
_SPARE = 0.5  # of the work on rounded surfaces, that has to be left where a nearer one is tried than one that stands
_NEARLY = 0.2  # of the load needed, that a shell has to bear which is tried thoroughly
_WALLS = "--edges wall"
_THICKNESS = "--thickness"
_TAKEN = "--way-out"
_FIRST_LAYER = ": pour that first, and the rest when it has hardened"
Refusal = InputError | NotConverged
Say = Callable[[str], None]


@dataclass(frozen=True, eq=False)
class WayOut:
    """With what `new` goes on where it refuses a surface: the `design` that stands, not finished yet, and the
    `wish` of which it is, on the surface in a `file` in metres (None: as given); `told` is the sentence that
    offers it."""

    design: FirstDesign
    wish: DesignWish
    told: str
    file: Path | None = None


@dataclass(frozen=True, eq=False)
class Refused:
    """Why a shell has no design (`error`), and the first way out that leads to one, if any does."""

    error: Refusal
    way_out: WayOut | None = None

    @property
    def offered(self) -> Refusal:
        """The error with the way out as its remedy: instead of a radius to round to that nobody has tried, or
        with which no design stood."""
        if self.way_out is None:
            return self.error
        instead = isinstance(self.error, Unbuildable) and not self.way_out.wish.rod
        if isinstance(self.error, Falls):  # its own remedy is the layer
            instead = self.error.bears is not None and self.error.bears == self.way_out.wish.thickness
        return renewed(self.error, f"{self.way_out.told}. {_TAKEN} goes on so at once", instead=instead)


def with_ways_out(
    refusal: Refusal,
    surface: Surface,
    wish: DesignWish,
    output: Path,
    say: Say,
    allowance: Allowance | None = None,
    *,
    uncut: Surface | None = None,
) -> Refused:
    """The refusal with the first way out that leads to a design; without one, saying that none was found.
    What is offered as a surface is written into a folder beside `output`. `say` hears what is tried; each
    kind of way out has its share of the `allowance`, of which the search has taken its own. `uncut`: the
    surface that reaches down into plinths, which is rounded where the one above them can't be."""
    whole = allowance or Allowance()
    way_out: WayOut | None = None
    if _walls_may_help(refusal, surface, wish):
        whole.leave(_FOR_WALLS)
        way_out = _on_walls(surface, wish, say, whole.part(_WALLED))
    if way_out is None and isinstance(refusal, Unbuildable) and not wish.rod:
        whole.leave(_ROUNDED)
        again = _Rounded(wish, whole, say)
        way_out = _to_nearest(refusal, surface, uncut or surface, wish, output, again, say)
        if way_out is None:
            refusal = refusal.in_vain()
            way_out = _poured_first(refusal, surface, wish, say, whole.rest(_TRIED))
    if way_out is None and isinstance(refusal, Falls) and _may_be_less(refusal, wish):
        way_out = _poured_first(refusal, surface, wish, say, whole.rest(_TRIED))
        refusal = refusal if way_out is not None else refusal.in_vain()
    return Refused(refusal, way_out)


def steadier_on_walls(surface: Surface, wish: DesignWish, say: Say, allowance: Allowance) -> WayOut | None:
    """Walls all round, for a shell whose structures stray too far as built; None where its outer edge stands
    on the ground, or they do on walls too. `allowance`: of all that the surface is worth."""
    if not _on_edge_beams(surface, wish) or allowance.over:
        return None
    found = _on_walls(surface, wish, say, allowance.part(_WALLED))
    if found is None:
        return None
    steady = replace(found, design=with_strays(found.design, surface))
    return None if strays(steady.design, surface) else steady


def _to_nearest(
    refusal: Unbuildable,
    surface: Surface,
    uncut: Surface,
    wish: DesignWish,
    output: Path,
    again: _Rounded,
    say: Say,
) -> WayOut | None:
    """The nearest surface that can be built, on walls where it falls otherwise; None where none was found."""
    folder = _unused(output.with_name(f"{output.stem}-{BUILDABLE}"))
    tried = _FLAT_SHARES if flat_between_creases(surface) else shares(refusal)

    def nearest_of(
        surface: Surface, shares: Sequence[float], then: Callable[[Surface, float], None] = again
    ) -> Nearest | None:
        return nearest_buildable(surface, refusal.radius, folder, then, say, shares, lambda: again.options)

    nearest = nearest_of(surface, tried)
    if nearest is None and uncut is not surface and not again.begun:
        surface = uncut  # cut off, feet end in what may not be rounded
        nearest = nearest_of(surface, tried)
    if nearest is None and again.may_stand:
        again.go_on()
        nearest = nearest_of(surface, [again.best.share])
    if nearest is None and again.thin is not None:
        nearest = nearest_of(surface, [again.thin.share], again.take_thin)
    if nearest is None:
        return None
    assert again.design is not None
    layer = "" if wish.thickness == again.wish.thickness else _FIRST_LAYER
    return WayOut(again.design, again.wish, f"{nearest.told}{layer}", nearest.file)


def shares(refusal: Unbuildable) -> list[float]:
    """What of its radius to round to, one after the other: the least first that nets cover."""
    least = _WELL_COVERED * refusal.spacing / refusal.radius
    found = [max(least, _SHARES[0])]
    for share in _SHARES[1:]:
        if share > _APART * found[-1]:
            found.append(share)
    return [*found, _FURTHER * found[-1], _FURTHER**2 * found[-1]]


def _unused(folder: Path) -> Path:
    """The folder, or the first numbered one where it is there already: a case may name the surface in it."""
    number, found = 1, folder
    while found.exists():
        number += 1
        found = folder.with_name(f"{folder.name}-{number}")
    return found


@dataclass(frozen=True)
class _Brief:
    """What a brief trial came to: the `share` of the radius asked for to which the surface was rounded, the
    `wish` it was tried with, and what share of its load the shell `bore`."""

    share: float
    wish: DesignWish
    bore: float


@dataclass(frozen=True, eq=False)
class _Thin:
    """The `design` that stands, with less concrete than is poured at once, on a surface rounded to a `share`
    of the radius asked for, and the `wish` it was found with."""

    share: float
    wish: DesignWish
    design: FirstDesign


class _Rounded:
    """The search on a rounded surface for what stands, within the work of all such trials; on walls too where
    a net covers it that falls on edge beams.

    Trials are brief, so that rounder surfaces have their turn. Where none stands, what brief trials have no
    time for is tried on the `best` one, with all the work that is left: finer spacings, and concrete as thin
    as it has to be. The best is the one that bore most, or the roundest, where no net covered any. Where
    nothing comes of that either, `thin` is what stood with less concrete than brief trials are after."""

    def __init__(self, wish: DesignWish, whole: Allowance, say: Say) -> None:
        self.design: FirstDesign | None = None  # of the last surface, where one stands
        self.wish = wish  # of which it is
        self.options = ""  # of the command, that stand for it
        self.best = _Brief(0.0, wish, 0.0)
        self.thin: _Thin | None = None
        self._thorough = False
        self.begun = False  # whether any surface was tried
        self._covered = False
        self._say = say
        self._whole = whole
        self._brief = whole.rest(_TRIED, thorough=False, thins=False)
        self._walled = whole.rest(_TRIED, thorough=False)

    @property
    def may_stand(self) -> bool:
        """Whether finer spacings are worth trying: something bore nearly enough, or nothing was covered."""
        worth = self.best.bore >= _NEARLY or (self.begun and not self._covered)
        return worth and self.wish.spacing is None and not self._whole.over

    def go_on(self) -> None:
        """With finer spacings and thinner concrete."""
        self._thorough = True
        self._brief = self._walled = self._whole.rest(1.0, thin_layers=True)

    def take_thin(self, surface: Surface, share: float) -> None:
        """What is known to stand on the surface, rounded to such a share, which isn't looked for again."""
        assert self.thin is not None
        self._take(self.thin.design, self.thin.wish, _above_plinths(surface))

    def __call__(self, surface: Surface, share: float) -> None:
        """Raises InputError or NotConverged where no design stands on the surface, rounded to such a share of
        the radius."""
        self.begun, stands = True, self.design is not None
        if stands and self._brief.left < _SPARE * self._brief.work:
            raise _untried("a rounder one stands and most of the work is done")
        surface = _above_plinths(surface)
        wish = self.best.wish if self._thorough else self.wish
        how = "rounded, thoroughly" if self._thorough else "rounded"
        try:
            self._tried(how, surface, share, wish, self._brief)
        except (InputError, NotConverged) as error:
            covered = not (isinstance(error, Unbuildable) and error.why is Why.NET)
            self._covered = self._covered or covered
            if stands or not (covered and _on_edge_beams(surface, wish)):
                raise  # a rounder one that stands on its own edges is worth more than one on walls
            self._say(f"rounded: {error}")
            walls = replace(wish, edges="wall", angle=self._brief.angle)
            self._tried(f"{how}, on walls", surface, share, walls, self._walled)

    def _tried(
        self, how: str, surface: Surface, share: float, wish: DesignWish, allowance: Allowance
    ) -> None:
        """Takes the design that stands with a wish; where none does, the trial may be the best."""
        allowance.bore, allowance.angle = 0.0, wish.angle
        try:
            design = _trial(how, surface, wish, allowance, self._say, finer=self._thorough)
        except (InputError, NotConverged) as error:
            stood = error.design if isinstance(error, (Unbuildable, Falls)) else None
            if self.thin is None and stood is not None and wish.thickness is None:
                self.thin = _Thin(share, wish, stood)
            if allowance.bore > self.best.bore or self.best.bore == 0.0:
                self.best = _Brief(share, replace(wish, angle=allowance.angle), allowance.bore)
            raise
        self._take(design, wish, surface)

    def _take(self, design: FirstDesign, wish: DesignWish, surface: Surface) -> None:
        """The design, with what of the wish whoever follows has to give."""
        if wish.edges != self.wish.edges:
            self.wish, self.options = replace(self.wish, edges=wish.edges), _WALLS
        self.wish, layer = _with_layer(self.wish, surface, design)
        self.options = f"{self.options} {layer}".strip()
        self.design = design


def _above_plinths(surface: Surface) -> Surface:
    """The surface above the plinths that whoever follows gets too."""
    plinths = plinths_for(surface)
    return surface if plinths is None else plinths.surface


def _trial(
    how: str, surface: Surface, wish: DesignWish, allowance: Allowance, say: Say, *, finer: bool = False
) -> FirstDesign:
    """What stands on another surface or with another wish, within the allowance of all such trials."""
    if allowance.over:
        raise _untried("what was tried before took all the work that is allowed")
    return standing_design(surface, wish, lambda text: say(f"{how}, {text}"), allowance, finer=finer)


def _untried(why: str) -> InputError:
    """Of a trial that isn't made, which no user asked for."""
    return InputError(f"left untried, since {why}")


def _walls_may_help(refusal: Refusal, surface: Surface, wish: DesignWish) -> bool:
    """Whether walls all round may: where something but its curvature is the reason, and its outer edge
    doesn't stand on the ground."""
    if isinstance(refusal, Unbuildable) and refusal.why is not Why.STRENGTH:
        return False
    return isinstance(refusal, (Unbuildable, Tips, NotConverged)) and _on_edge_beams(surface, wish)


def _on_edge_beams(surface: Surface, wish: DesignWish) -> bool:
    """Whether edge beams carry a part of the outer edge that walls might."""
    if wish.edges != "auto":
        return False
    return any(each.kind == "beam" and not each.opening for each in stretches_of(surface))


def _on_walls(surface: Surface, wish: DesignWish, say: Say, allowance: Allowance) -> WayOut | None:
    """Walls all round; None where no design stands on them either."""
    walls = replace(wish, edges="wall")
    try:
        design = _trial("on walls", surface, walls, allowance, say)
    except (InputError, NotConverged) as error:
        say(f"on walls: {error}")
        return None
    outer = surface.vertices[surface.boundary[0], 2]
    return WayOut(
        design,
        walls,
        f"With {_WALLS} this goes on: walls all round, up to {outer.max() - outer.min():.3g} m above the lowest of its "
        "edge",
    )


def _with_layer(wish: DesignWish, surface: Surface, design: FirstDesign) -> tuple[DesignWish, str]:
    """The wish for what stands with less concrete than is poured at once, and the option of the command that
    says so; as it was, and "", for others."""
    if wish.thickness is not None or design.thickness >= least_layer(usual_thickness(surface)):
        return wish, ""
    return replace(wish, thickness=design.thickness), f"{_THICKNESS} {design.thickness:g}"


def _may_be_less(refusal: Unbuildable | Falls, wish: DesignWish) -> bool:
    """Whether less concrete is known to be borne, and no other was asked for."""
    return refusal.bears is not None and wish.thickness is None


def _poured_first(
    refusal: Unbuildable | Falls, surface: Surface, wish: DesignWish, say: Say, allowance: Allowance
) -> WayOut | None:
    """A first layer of concrete, looked for from the start, or as it was found where the work ends before;
    None where none is known to be borne."""
    if not _may_be_less(refusal, wish):
        return None
    assert refusal.bears is not None
    how, layer = f"with {1e3 * refusal.bears:g} mm", replace(wish, thickness=refusal.bears)
    try:
        design = _trial(how, surface, layer, allowance, say)
    except (InputError, NotConverged) as error:
        say(f"{how}: {error}")
        if refusal.design is None or not allowance.ran_out:
            return None
        design = refusal.design
    return WayOut(
        design,
        layer,
        f"With {_THICKNESS} {refusal.bears:g} this goes on{_FIRST_LAYER}",
    )
