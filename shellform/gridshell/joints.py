"""Joints that fit their rods: table 1 of the paper, scaled.

The paper's rods are round, 1 mm in radius and of E = 40 GPa; its joints have EA = 71.5 kN, GJ = 7.38e-4 and
EI = 7.85e-4 N·m² over a gap of 2 mm, so that the rods lie on each other. With lengths times s and stresses as
they are, forces grow with s², bending and torsion stiffness with s⁴, as those of the rods do. A joint that
follows its rods therefore has their EA and EI (the mean of both axes) in the paper's proportions, and a gap
of their depth across the surface.

Where rods are pulled out of their right angle, such a joint bends both in the surface. With a couple GJ Δ /
gap at an angle Δ between them and half of it on each side, GJ in the proportion k to a round rod's EI, that
stresses them to k E Δ / 4 whatever their depth: nearly half of the strength of GFRP at Δ = 0.5, all of
steel's at 0.3. Rods that turn on their joints, in swivel couplers or on bolts that are tightened afterwards,
are spared that (`swivelling`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from shellform.gridshell.gridshell import Joint, Rod
from shellform.net.net import Net
from shellform.structure.elements.sections import Material

_PAPER = Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
_RODS = Rod.round(young=40e9, radius=0.001)
_TURNING = 0.1  # of table 1's resistance to turning: what friction leaves
_OFF = 4.0  # times what fits: as much as a rod's EI changes where its radius is √2 times as large
_WIDE = 1.5  # the same of the gap
_NARROW = 0.95  # of what fits, below which rods would be pressed into each other
PAPER_SPACING = 0.055  # m, of the paper's rods


def usual_gap(spacing: float) -> float:
    """The gap, m, of rods that aren't chosen yet: the depth of the paper's at that spacing. Once they are, it
    is theirs (`following`)."""
    return _PAPER.gap * spacing / PAPER_SPACING


def following(rod: Rod) -> Joint:
    """The joint of table 1 that fits the rods."""
    own = rod.stiffness
    by_axial = own.axial / _RODS.stiffness.axial
    by_bending = 0.5 * (own.bending_y + own.bending_z) / _RODS.stiffness.bending_y
    return Joint(
        _PAPER.axial * by_axial,
        _PAPER.torsion * by_bending,
        _PAPER.bending * by_bending,
        2.0 * rod.section.fibres[1],
    )


def swivelling(joint: Joint) -> Joint:
    """The same with a tenth of its torsion stiffness: a swivel coupler, or a bolt that is tightened after
    bending."""
    return replace(joint, torsion=_TURNING * joint.torsion)


def turning_stress(net: Net, material: Material) -> float:
    """To what share of their strength rods of a `material` are bent in the surface by joints that follow
    them, where the net's right angles are sheared most."""
    sheared = 0.5 * math.pi - net.quality.shear_angle_min
    return 0.25 * (_PAPER.torsion / _RODS.stiffness.bending_y) * sheared * material.young / material.strength


@dataclass(frozen=True)
class JointDoubt:
    """An entry of the joint, by `name`, that is far from what fits the rods: its `value` and what would be
    `fitting`, in SI units."""

    name: str
    value: float
    fitting: float

    def told(self) -> str:
        """In a sentence."""
        return (
            f"joint.{self.name} is {self.value:.3g}, where {self.fitting:.3g} would fit the rods (table 1 of the paper, scaled): "
            "it may have been made for other rods; left out, the joint follows them"
        )


def doubts(joint: Joint, rod: Rod) -> tuple[JointDoubt, ...]:
    """What of the joint doesn't fit its rods: stiffness more than four times off, a gap half as wide again,
    or less than the rods are deep. Joints that turn more easily fit any rods."""
    fitting, stiffness = following(rod), (1.0 / _OFF, _OFF)
    usual = {"axial": stiffness, "torsion": (0.0, _OFF), "bending": stiffness, "gap": (_NARROW, _WIDE)}
    return tuple(
        JointDoubt(name, getattr(joint, name), getattr(fitting, name))
        for name, (least, most) in usual.items()
        if not least <= getattr(joint, name) / getattr(fitting, name) <= most
    )
