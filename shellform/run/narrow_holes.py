"""Holes narrower than rods are apart, which `new` closes: skylights, and what a scan or a mesh lacks.

Rods can't end at such a hole, so that an edge beam goes round it, as wide as the hole itself: fourteen
skylights of 0.46 m in a cap of 14 m got fourteen rings of 19 rods of 50 mm. The net goes over it instead, and
the concrete's weight too.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shellform.errors import how_many
from shellform.run.sizes import first_spacing
from shellform.surface.readers.fills import openings_of
from shellform.surface.shape.target import Surface


@dataclass(frozen=True)
class NarrowHoles:
    """So many holes (`count`) narrower than the `width`, m, that rods are apart."""

    count: int
    width: float

    @property
    def closed(self) -> str:
        """What is said once they are."""
        return (
            f"{self._named} {'is' if self.count == 1 else 'are'} closed: rods pass over, and concrete counts there too "
            "(surface.fill_narrower; --fill-narrower 0 keeps an edge beam round each)"
        )

    @property
    def kept(self) -> str:
        """What is said where that can't be done, before the reason."""
        return f"{self._named} can't be closed, so that an edge beam goes round each"

    @property
    def _named(self) -> str:
        return f"{how_many(self.count, 'hole', 'holes')} narrower than {self.width:g} m, about as far as rods are apart,"


def narrow_holes(
    surface: Surface, file: Path, options: Mapping[str, Any], spacing: float | None
) -> NarrowHoles | None:
    """The holes of the surface in a `file` that are narrower than the `spacing`, m (None: the one to begin
    with); None where there are none, where `options`, the entries of [surface], say what is closed, and for
    builder scripts, whose openings are meant."""
    if file.suffix.lower() == ".py" or "fill_narrower" in options or options.get("fill") in ("holes", "all"):
        return None
    if len(surface.boundary) < 2:  # the outer edge alone
        return None
    width = first_spacing(surface)[0] if spacing is None else spacing
    found = openings_of(surface.vertices, surface.boundary, options.get("ground"))
    count = len(found.narrower(width))
    return NarrowHoles(count, width) if count else None
