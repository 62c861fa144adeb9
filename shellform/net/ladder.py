"""A net that doesn't give up: where the first attempt fails, a fixed ladder of small changes is climbed.

Each rung changes one thing of what was asked for and names the reasons that it may help against; those that
can't help are passed over. So the same surface and settings always end with the same net, and where the
first attempt succeeds nothing is changed. What is left of a surface that no rung covers is refused with the
reason of the first attempt and with what was tried.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass

from shellform.net.chebyshev import NetSettings, NetTuning, net_at
from shellform.net.net import Net
from shellform.net.notes import NetNote, NoteKind
from shellform.net.pull import FROM_COMPASS, FROM_FLAT, Pulling
from shellform.net.quality import refuse_nearness
from shellform.net.refusal import Attempt, Beside, Change, NoNet, Reason, Stalled
from shellform.surface.shape.target import Surface, largest_curvature

TOLERANCE = math.radians(10.0)  # of the angle asked for
_SETTLED = 1e-5  # residual that will do: distances and lengths are measured, whatever is left of it
_MOST = 800  # factorisations of pulls that failed, all rungs together
_SMALL = 1e-3  # residual of a stall that a looser tolerance may end
_ANY = frozenset(Reason)
_PULL = frozenset({Reason.STALLED, Reason.FOLDED, Reason.OVERLAPPING, Reason.OFF})
_REACHED = frozenset({Reason.SHORT, Reason.BROKEN})


@dataclass(frozen=True)
class Rung:
    """A change and the reasons it may help `against`: the net turned by `turn`, rad, shifted by `shift`
    spacings, its shear stiffness times `shear`, its springs of the `density` given, EI/s³, begun `flat`; and
    what its tuning has in place of the settings' (None: the same)."""

    change: Change
    against: frozenset[Reason] = _ANY
    turn: float = 0.0
    shift: tuple[float, float] = (0.0, 0.0)
    shear: float = 1.0
    density: tuple[float, ...] = ()
    flat: bool = False
    tail: int | None = None
    reach: float | None = None
    tolerance: float | None = None

    def tuned(self, tuning: NetTuning) -> NetTuning:
        """The tuning with what this rung has in its place."""
        return NetTuning(
            limit=tuning.limit,
            reach=tuning.reach if self.reach is None else self.reach,
            tolerance=tuning.tolerance if self.tolerance is None else self.tolerance,
            tail=tuning.tail if self.tail is None else self.tail,
        )


def _turned(degrees: float, tail: int | None = None) -> Rung:
    return Rung(Change.TURNED, turn=math.radians(degrees), tail=tail)


LADDER = (
    Rung(Change.NOTHING),
    Rung(Change.LOOSER, frozenset({Reason.STALLED}), tolerance=_SETTLED),
    Rung(Change.LONGER, _REACHED, tail=2),
    Rung(Change.TIGHTER, frozenset({Reason.OFF}), density=(*FROM_COMPASS, 50.0, 500.0), tolerance=_SETTLED),
    Rung(Change.GENTLER, _PULL, density=FROM_FLAT, reach=0.5, tolerance=_SETTLED),
    Rung(Change.SHEAR, _PULL, shear=5.0),
    _turned(5.0),
    _turned(-5.0),
    _turned(10.0, 2),
    _turned(-10.0, 2),
    Rung(Change.SHIFTED, shift=(0.5, 0.5)),
    Rung(Change.SHIFTED, shift=(0.5, 0.0), tail=2, tolerance=_SETTLED),
    Rung(Change.FLAT, _PULL, density=FROM_FLAT, flat=True, reach=0.5, tolerance=_SETTLED),
)


def climbed_net(
    surface: Surface,
    settings: NetSettings,
    *,
    angle: float,
    offset: tuple[float, float] = (0.0, 0.0),
    tolerance: float = TOLERANCE,
    most: int = _MOST,
    failed: NoNet | Stalled | None = None,
    near: bool = True,
    progress: Callable[[str], None] = lambda text: None,
    watch: Pulling | None = None,
) -> tuple[Net, Attempt]:
    """The net with the `settings` at the `angle`, rad, and `offset`, or the first on the ladder, turned by at
    most `tolerance`, rad; and the attempt that gave it.

    `most`: factorisations of pulls that fail, all rungs together; `failed`: what the first rung is known to
    end with; `near`: whether rods may be bent so much that crossings come nearer than their spacing. Raises
    InputError for settings that can't work, NoNet or Stalled where no rung helps.
    """
    attempts: list[Attempt] = []
    first: NoNet | Stalled | None = None
    reasons: set[Reason] = set()
    spent = 0
    for rung in LADDER:
        if attempts and (
            abs(rung.turn) > tolerance or not reasons & rung.against or _vain(rung, settings, first)
        ):
            continue
        turned = angle + rung.turn
        shifted = (offset[0] + rung.shift[0], offset[1] + rung.shift[1])
        try:
            if failed is not None and not attempts:
                raise failed
            net = _at(surface, settings, rung, turned, shifted, watch)
            if not near:
                refuse_nearness(net.quality, net.grid, net.target)
        except (NoNet, Stalled) as error:
            taken = error.iterations if isinstance(error, Stalled) else error.factorisations
            attempts.append(Attempt(rung.change, turned, shifted, error.reason, taken))
            progress(attempts[-1].sentence())
            reasons.add(error.reason)
            first = first or error
            spent += taken
            if spent > most:
                break
            continue
        given = Attempt(rung.change, turned, shifted, None, net.quality.factorisations)
        if not attempts:
            return net, given
        notes = (*net.notes, *(NetNote(NoteKind.ATTEMPT, each.sentence()) for each in (*attempts, given)))
        return dataclasses.replace(net, notes=notes, attempts=(*attempts, given)), given
    assert first is not None
    raise _refused(first, attempts, surface, spent) from first


def _at(
    surface: Surface,
    settings: NetSettings,
    rung: Rung,
    angle: float,
    offset: tuple[float, float],
    watch: Pulling | None,
) -> Net:
    """The net of a rung. Raises as `net_at`, but NoNet where it is the rung's change that puts the origin off
    the surface."""
    try:
        return net_at(surface, _changed(settings, rung), angle=angle, offset=offset, progress=watch)
    except Beside as error:
        if rung.change is Change.NOTHING:
            raise
        raise NoNet(Reason.BESIDE, error.what, remedy=error.remedy) from error


def _vain(rung: Rung, settings: NetSettings, first: NoNet | Stalled | None) -> bool:
    """Whether a rung changes nothing: guides fix the angle and the origin, the compass method has no springs,
    a density given is kept to, and a tolerance ends no stall far from rest."""
    if rung.change is Change.LOOSER:
        return not (isinstance(first, Stalled) and first.residual < _SMALL)
    placed = settings.guides is not None and rung.change in (Change.TURNED, Change.SHIFTED)
    alone = settings.method == "compass" and rung.against <= _PULL
    return placed or alone or (settings.spring_density is not None and bool(rung.density))


def _changed(settings: NetSettings, rung: Rung) -> NetSettings:
    """The settings as the rung has them."""
    return dataclasses.replace(
        settings,
        shear_stiffness=rung.shear * settings.shear_stiffness,
        spring_density=rung.density or settings.spring_density,
        start="flat" if rung.flat else settings.start,
        tuning=rung.tuned(settings.tuning),
    )


def _refused(
    first: NoNet | Stalled, attempts: list[Attempt], surface: Surface, spent: int
) -> NoNet | Stalled:
    """The first refusal, with what was tried besides, the surface's own radius, and the factorisations
    `spent` by all attempts."""
    bent = largest_curvature(surface)
    radius = f" (it bends to a radius of {1.0 / bent:.3g} m)" if bent > 0.0 else ""
    others = ", ".join(sorted({each.reason.value for each in attempts if each.reason}))
    tried = f"{len(attempts)} attempts, with other angles, offsets, springs and starts, ended: {others}"
    what = f"{first.what}{radius}; {tried}"
    if isinstance(first, Stalled):
        return Stalled(
            what, state=first.state, residual=first.residual, iterations=spent, remedy=first.remedy
        )
    found = NoNet(first.reason, what, where=first.where, value=first.value, remedy=first.remedy)
    found.factorisations = spent
    return found
