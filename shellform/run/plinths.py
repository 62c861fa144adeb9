"""Plinths under a shell's feet: where a surface runs out flat on the ground, rods can't follow it down to
there.

Shells that stand on few points often end in flat pads or flare into the ground, in a crease that is bent more
sharply than anywhere else. What lies within two hundredths of the extent above the lowest point stands on the
ground anyway (net/edges.py); cut off at that level the rest may be bent far less. Where it is, `new` leaves
the feet to plinths.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from shellform.errors import InputError
from shellform.net.ground import LOW, ground_under
from shellform.run.sizes import first_spacing
from shellform.surface.shape.cut import cut_off
from shellform.surface.shape.target import Surface, sharpest_bend

_SHARP = 2.0  # spacings: a radius to which hardly a net is bent
_BETTER = 1.4  # times the radius, for which the feet are cut off


@dataclass(frozen=True, eq=False)
class Plinths:
    """The `surface` higher than plinths that reach up to the level `above`, m, their `height`, m, and to what
    `radius`, m, the surface was bent lower down."""

    surface: Surface
    above: float
    height: float
    radius: float

    @property
    def told(self) -> str:
        """In words."""
        return (
            f"rods end on plinths of up to {self.height:.3g} m: lower down the surface is bent to a radius of "
            f"{self.radius:.2g} m"
        )


def plinths_for(surface: Surface) -> Plinths | None:
    """The plinths with which a surface that is bent too sharply at its feet goes on; None where none help,
    and on ground that slopes, which no level cuts alike."""
    _, radius = sharpest_bend(surface)
    if radius > _SHARP * first_spacing(surface)[0] or ground_under(surface).slopes:
        return None
    lowest = float(surface.vertices[:, 2].min())
    step = 10.0 ** math.floor(math.log10(LOW * surface.longer_side) - 1)  # two digits
    above = step * math.floor((lowest + LOW * surface.longer_side) / step)
    try:
        rest = cut_off(surface, round(above, 6))
    except InputError:
        return None
    if sharpest_bend(rest)[1] < _BETTER * radius:
        return None
    return Plinths(rest, round(above, 6), above - lowest, radius)
