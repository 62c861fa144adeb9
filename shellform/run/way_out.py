"""A way out for surfaces that can't be built: the nearest one that can, tried before it is offered.

Creases are rounded and curvature is capped by the least change (surface/shape/fairing.py), to the radius that
is asked for and, where that isn't enough, more; what is offered went through the very step that refused the
surface as given. Beside it stands a map of the change.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from shellform.errors import InputError, NotConverged
from shellform.net.refusal import NoNet, Stalled
from shellform.quantities import coordinates, number
from shellform.surface.readers.reading import read_surface
from shellform.surface.shape.fairing import Faired, faired
from shellform.surface.shape.target import Surface
from shellform.written import make_folder, whole

SURFACE = "surface.obj"
COVERED = 3.0  # spacings: a radius of curvature that nets cover
MORE = (1.0, 1.5, 2.2)  # times the radius asked for
_CLOSE = 1.1  # from one radius to the next, at the least
_NEARER = 1.25  # the same, for a nearer surface than one that was taken
_SLENDER = 1e-9  # m: less is no change
_FAR_OFF, _FARTHEST = 0.2, 0.5  # of a surface's height, in the mean and at most


@dataclass(frozen=True)
class Nearest:
    """The nearest buildable surface, in a `file` in metres, and the sentence in which it is offered
    (`told`)."""

    file: Path
    told: str


def with_way_out(
    refusal: InputError | NotConverged,
    surface: Surface,
    radius: float,
    folder: Path,
    again: Callable[[Surface], object],
    say: Callable[[str], None],
) -> InputError | NotConverged:
    """The refusal of a surface with the nearest buildable one, as `nearest_buildable` finds it, for its
    remedy; as it was, where none is found."""
    nearest = nearest_buildable(surface, radius, folder, lambda rounded, _: again(rounded), say)
    return refusal if nearest is None else renewed(refusal, nearest.told)


def nearest_buildable(
    surface: Surface,
    radius: float,
    folder: Path,
    again: Callable[[Surface, float], object],
    say: Callable[[str], None],
    shares: Sequence[float] = MORE,
    options: Callable[[], str] = lambda: "",
) -> Nearest | None:
    """The nearest buildable surface, written into `folder` as surface.obj, surface.step, change.vtu and
    change.png; None where none is found.

    `radius`, m, to which the surface must be rounded at least; `shares` of it are tried, one after the other,
    where the surface can't be rounded to one those between it and the one before, and after the first that is
    taken the one between that and the one that was refused before; `again` does with a surface rounded to a
    share what was refused and raises InputError or NotConverged where it is refused again; `say` hears what
    is tried; `options` are those of the command with which `again` went on.
    """
    left, before = list(shares), 0.0
    nearest: tuple[Faired, float] | None = None
    while left:
        share, *left = left
        wanted, between = share * radius, math.sqrt(before * share)
        try:
            found = faired(surface, wanted)
        except (InputError, NotConverged) as error:
            say(f"rounded to {wanted:.3g} m: {error.what}")  # nobody asked for this radius: no remedy
            # still rounder is still harder
            left = [between] if nearest is None and between > _CLOSE * before > 0.0 else []
            continue
        if _goes_on(found, share, wanted, again, say):
            left = [between] if nearest is None and between > _NEARER * before > 0.0 else []
            nearest = found, wanted
        else:
            before = share
    return None if nearest is None else Nearest(folder / SURFACE, _offer(*nearest, folder, options()))


def _goes_on(
    found: Faired,
    share: float,
    radius: float,
    again: Callable[[Surface, float], object],
    say: Callable[[str], None],
) -> bool:
    """Whether a surface that was rounded to a `share`, to a `radius`, m, isn't refused again; `say` hears why
    it is."""
    from shellform.surface.readers.meshes import write_mesh

    if float(found.change.max()) <= _SLENDER:
        say(f"it is rounded to {radius:.3g} m already")
        return False
    try:
        with TemporaryDirectory() as place:
            trial = Path(place) / SURFACE
            write_mesh(trial, found.surface)
            again(read_surface(trial), share)  # the very file that is offered
    except (InputError, NotConverged) as error:
        say(f"rounded to {radius:.3g} m: {error}")
        return False
    return True


def _offer(found: Faired, radius: float, folder: Path, options: str) -> str:
    """Writes the surface and the map of its change; what to say of them."""
    from shellform.output.pictures.plots import plan_map
    from shellform.surface.readers.meshes import write_mesh, write_values

    make_folder(folder)
    write_mesh(folder / SURFACE, found.surface)
    cad = _step(folder / "surface.step", found.surface)
    write_values(folder / "change.vtu", found.surface, {"change [m]": found.change})
    most = int(np.argmax(found.change))
    place = f"{coordinates(found.before.vertices[most])} m"
    mean = float(found.change.mean())
    off = f"{number(float(found.change[most]))} m off at most, at {place}, {number(mean, 2)} m in the mean"
    plan_map(
        folder / "change.png",
        found.surface.vertices[:, :2],
        found.surface.triangles,
        found.change,
        title=f"Nearest buildable surface: {off}",
        label="change, m",
    )
    return (
        f"The nearest surface with which this goes on is {folder / SURFACE}{cad} ({'the first ' if cad else ''}in metres"
        f"{f', with {options}' if options else ''}): creases rounded to "
        f"{radius:.3g} m, {off}{_another(found)} (change.png)"
    )


def _another(found: Faired) -> str:
    """What else is said of a surface that lies so far off the one that was drawn that it is hardly its
    shape."""
    off = found.change / found.before.size[2]
    if off.mean() <= _FAR_OFF and off.max() <= _FARTHEST:
        return ""
    return f", {100.0 * off.mean():.0f} % of its height: hardly the shape that was drawn"


def _step(path: Path, surface: Surface) -> str:
    """Writes the surface as STEP too, where one B-spline can be fitted; what to say of it."""
    from shellform.surface.cad import write_fitted

    try:
        with whole(path) as partial:
            write_fitted(partial, surface)
    except (InputError, NotConverged):  # openings, or no gmsh: the mesh is there all the same
        path.unlink(missing_ok=True)
        return ""
    return f", {path.name}"


def renewed(
    refusal: InputError | NotConverged, offer: str, *, instead: bool = False
) -> InputError | NotConverged:
    """The same refusal with the offer before its remedy, or `instead` of it."""
    remedy = f"{offer}. {f'Or: {refusal.remedy}' if refusal.remedy and not instead else ''}".strip()
    if isinstance(refusal, NoNet):
        return NoNet(refusal.reason, refusal.what, where=refusal.where, value=refusal.value, remedy=remedy)
    if isinstance(refusal, InputError):
        return InputError(refusal.what, where=refusal.where, value=refusal.value, remedy=remedy)
    kind = Stalled if isinstance(refusal, Stalled) else NotConverged
    return kind(
        refusal.what,
        state=refusal.state,
        residual=refusal.residual,
        iterations=refusal.iterations,
        remedy=remedy,
    )
