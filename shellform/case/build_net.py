"""From a case's entries to its surface and its net, and their records in the summary."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from shellform.arrays import Reals
from shellform.case.build_gridshell import RodLimits
from shellform.case.case import Case, check_script, shipped_surfaces
from shellform.case.entries import NetEntry, SurfaceEntry
from shellform.errors import InputError
from shellform.net.chebyshev import NetSettings
from shellform.net.edges import Edges, Place, stand
from shellform.net.net import Net
from shellform.net.orientation import oriented_net
from shellform.quantities import extents, number
from shellform.records.summary import EdgeRecord, NetRecord, SurfaceRecord
from shellform.surface.shape.cut import cut_off
from shellform.surface.shape.target import Surface

FAR = 100.0  # of a surface's larger side, from its origin: there `new` takes one near it
_DISTANT = 5000.0  # no net is sure to be pulled: at 21 500 none is
_OF_FILES = ("unit", "up", "layer", "object", "face", "piece", "fill", "fill_narrower", "ground")


def surface_of(entry: SurfaceEntry, *, allow_scripts: bool = False) -> Surface:
    """The surface of a builder script, or of a file in any format, as its entry says."""
    found = _read(entry, allow_scripts=allow_scripts)
    found = found if entry.origin is None else counted_from(found, entry.origin)
    return found if entry.above is None else cut_off(found, entry.above)


def counted_from(surface: Surface, origin: Sequence[float]) -> Surface:
    """The surface in coordinates that count from `origin` (3,), m, which it tells with what was mended."""
    place = ", ".join(f"{each:.9g}" for each in origin)
    told = f"coordinates, here and in all that is written, count from ({place}) m of the file's"
    return replace(surface, vertices=surface.vertices - np.array(origin), mended=(*surface.mended, told))


def distant_origin(surface: Surface, sides: float) -> tuple[float, float, float] | None:
    """A round origin near a surface that lies more than so many of its larger `sides` away from its own, m;
    None for others."""
    lowest, side = surface.vertices.min(axis=0), float(surface.size.max())
    if float(np.abs(surface.vertices).max()) <= sides * side:
        return None
    step = 10.0 ** math.floor(math.log10(side))
    x, y, z = (step * np.floor(lowest / step)).tolist()
    return x, y, z


def refuse_distant(surface: Surface) -> None:
    """Raises InputError for a surface so far from its origin that rounding hides what loads do."""
    origin = distant_origin(surface, _DISTANT)
    if origin is None:
        return
    told = ", ".join(f"{each:.9g}" for each in origin)
    raise InputError(
        f"lies {number(float(np.abs(surface.vertices).max()), 4)} m from the origin, {_DISTANT:g} times its size or more: beside "
        "such coordinates rounding hides the load",
        where="surface",
        remedy=f"Count from a point near it: origin = [{told}] in [surface], or --origin {told.replace(',', '')}.",
    )


def _read(entry: SurfaceEntry, *, allow_scripts: bool) -> Surface:
    file = Path(entry.file)
    check_script(file, allow_scripts=allow_scripts)
    if file.suffix.lower() == ".py":
        return _built(file, entry)
    if entry.dimensions:
        raise InputError(
            "only builder scripts have dimensions",
            where="surface.dimensions",
            value=entry.dimensions,
            remedy="Leave out surface.dimensions, or name a builder script (.py).",
        )
    from shellform.surface.readers.fills import OffGround
    from shellform.surface.readers.reading import read_surface

    level = 0.0 if entry.origin is None else entry.origin[2]  # of the file's, from which the case's count
    try:
        return read_surface(
            file,
            unit=entry.unit,
            up=entry.up,
            size=entry.size,
            layer=entry.layer,
            name=entry.object,
            face=entry.face,
            piece=entry.piece,
            fill=entry.fill,
            fill_narrower=entry.fill_narrower,
            ground=None if entry.ground is None else entry.ground + level,
        )
    except OffGround as error:
        assert entry.ground is not None
        raise OffGround(entry.ground, error.lowest - level, error.highest - level) from error


def _built(file: Path, entry: SurfaceEntry) -> Surface:
    """What a builder script makes; a stranger's, which may hang or crash, in a process of its own. Raises
    InputError for entries that only files take."""
    for name in _OF_FILES:
        value = getattr(entry, name)
        if value != SurfaceEntry.model_fields[name].default:
            raise InputError(
                f"a builder script takes no {name}: it says in metres and z up what is built and what is open",
                where=f"surface.{name}",
                value=value,
                remedy=f"Leave out surface.{name}.",
            )
    from shellform.surface import cad, occ
    from shellform.surface.readers.foreign import read_foreign

    if shipped_surfaces() in file.resolve().parents:
        draft = cad.read_script(file, size=entry.size, dimensions=entry.dimensions)
    else:
        draft = read_foreign(file, "script", {"size": entry.size, "dimensions": entry.dimensions})
    return occ.surface_from(draft.points, draft.triangles, draft.normals, str(file))


def surface_record(surface: Surface, source: str) -> SurfaceRecord:
    """The `surface` part of summary.json."""
    x, y, z = surface.size.tolist()
    return SurfaceRecord(
        source=source,
        area=surface.area,
        size=(x, y, z),
        triangles=len(surface.triangles),
        holes=surface.holes,
        mended=tuple(surface.mended),
    )


def size_text(size: Sequence[float] | Reals) -> str:
    """The extents (3,), m, in words, so that a wrong unit is seen."""
    x, y, z = extents(size)
    return f"{number(x, 4)} × {number(y, 4)} × {number(z, 4)} m (is the unit right?)"


def net_of(
    case: Case, surface: Surface, *, progress: Callable[[str], None] = lambda text: None
) -> tuple[Net, float, tuple[float, float]]:
    """The case's net with its angle, rad, and offset."""
    refuse_distant(surface)
    entry = case.net
    net, angle, offset = oriented_net(
        surface,
        net_settings(entry, case.joint.gap),
        angle=entry.angle if entry.angle == "auto" else float(np.deg2rad(entry.angle)),
        offset=entry.offset,
        progress=progress,
    )
    return stand(net, surface, edges_of(case)), angle, offset


def edges_of(case: Case) -> Edges:
    """What the case's edges stand on; filled ones stand on the ground, or are as high as they are."""
    entry = case.edges
    places = tuple(
        Place(
            each.kind,
            each.name,
            each.height,
            None if each.box is None else np.array(each.box),
            None if each.curve is None else np.array(each.curve),
            0.5 * case.net.spacing if each.within is None else each.within,
            each.opening,
        )
        for each in entry.stretch
    )
    outer, openings = ("auto" if each == "fill" else each for each in (entry.outer, entry.openings))
    ground = case.net.ground if entry.ground is None else entry.ground
    return Edges(places, outer, openings, ground)


def net_settings(entry: NetEntry, gap: float) -> NetSettings:
    """What a case's net is to be, but for where it lies."""
    return NetSettings(
        spacing=entry.spacing,
        gap=gap,
        spacing_v=entry.spacing_v,
        guides=None if entry.guides is None else (entry.guides[0], entry.guides[1]),
        elements=entry.elements,
        method=entry.method,
        start=entry.start,
        spring_density=entry.spring_density,
        shear_stiffness=entry.shear_stiffness,
        merge=entry.merge,
        ground=entry.ground,
        outline=entry.outline,
        uncovered_max=entry.uncovered_max,
    )


def edge_records(net: Net) -> tuple[EdgeRecord, ...]:
    """What the net's edge is, stretch after stretch."""
    return tuple(
        EdgeRecord(
            each.kind,
            each.name,
            each.opening,
            each.length,
            (float(each.points[:, 2].min()), float(each.points[:, 2].max())),
        )
        for each in net.stretches
    )


def net_record(
    net: Net, *, angle: float, offset: tuple[float, float], rods: RodLimits | None = None
) -> NetRecord:
    """The `net` part of summary.json; `rods` as `build_gridshell.rod_limits` finds them."""
    record = NetRecord(
        spacing=net.spacing,
        crossings=len(net.grid.lattice),
        rods=len(net.grid.rods),
        supports=len(net.supports),
        edges=edge_records(net),
        spacing_v=net.grid.spacing_v,
        **net.quality.summary(),
        uncovered_share=None if net.cover is None else net.cover.share,
        uncovered=() if net.cover is None else net.cover.patches,
        notes=tuple(note.text for note in net.notes),
        angle=angle,
        offset=offset,
    )
    return record if rods is None else with_rods(record, rods)


def with_rods(record: NetRecord, rods: RodLimits) -> NetRecord:
    """The record with what the net allows of rods."""
    return replace(
        record,
        rod_radius_max=rods.radius_max,
        curvature_limit=rods.curvature_limit,
        curvature_utilisation=rods.curvature_utilisation,
    )
