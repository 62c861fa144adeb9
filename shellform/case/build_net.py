"""From a case's entries to its surface and its net, and what the summary tells of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import Reals
from shellform.case.case import Case, check_script
from shellform.case.entries import NetEntry, SurfaceEntry
from shellform.errors import InputError
from shellform.net.net import Net
from shellform.net.orientation import oriented_net
from shellform.surface.shape.target import Surface


def surface_of(entry: SurfaceEntry, *, allow_scripts: bool = False) -> Surface:
    """The surface of a builder script, or of a file in any format, as its entry says."""
    file = Path(entry.file)
    check_script(file, allow_scripts=allow_scripts)
    if file.suffix.lower() == ".py":
        from shellform.surface import cad

        return cad.build_surface(
            file, size=_builder_size(file, entry.size, entry.dimensions), **entry.dimensions
        )
    if entry.dimensions:
        raise InputError(
            "only builder scripts have dimensions", where="surface.dimensions", value=entry.dimensions
        )
    from shellform.surface.readers.reading import read_surface

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
        ground=entry.ground,
    )


def surface_summary(surface: Surface, source: str) -> dict[str, Any]:
    """The `surface` part of summary.json."""
    return {
        "source": source,
        "area": surface.area,
        "size": surface.size.tolist(),
        "triangles": len(surface.triangles),
        "holes": surface.holes,
        "mended": list(surface.mended),
    }


def told_size(size: Sequence[float] | Reals) -> str:
    """The extents (3,), m, in words, so that a wrong unit is seen."""
    x, y, z = size
    return f"{x:.4g} × {y:.4g} × {z:.4g} m (is the unit right?)"


def _builder_size(file: Path, size: float | None, dimensions: Mapping[str, float] | None) -> float:
    if size is not None:
        return size
    from shellform.surface import cad

    return max({**cad.dimensions_of(file), **(dimensions or {})}.values()) / 90.0


def net_of(
    case: Case, surface: Surface, *, progress: Callable[[str], None] = lambda text: None
) -> tuple[Net, float, tuple[float, float]]:
    """The case's net with its angle, rad, and offset."""
    entry = case.net
    return oriented_net(
        surface,
        net_settings(entry, case.joint.gap),
        angle=entry.angle if entry.angle == "auto" else float(np.deg2rad(entry.angle)),
        offset=entry.offset,
        progress=progress,
    )


def net_settings(entry: NetEntry, gap: float) -> dict[str, Any]:
    """The settings of pull_net in a case but for angle and offset."""
    names = (
        "spacing",
        "spacing_v",
        "guides",
        "elements",
        "method",
        "start",
        "spring_density",
        "shear_stiffness",
        "merge",
        "ground",
    )
    return {name: getattr(entry, name) for name in names} | {"outline": entry.outline, "gap": gap}


def net_summary(net: Net) -> dict[str, Any]:
    """The `net` part of summary.json but for the rod's radius."""
    return {
        "spacing": net.spacing,
        "crossings": len(net.grid.lattice),
        "rods": len(net.grid.rods),
        "supports": len(net.supports),
        "spacing_v": net.grid.spacing_v,
        **net.quality.summary(),
        "notes": list(net.notes),
    }
