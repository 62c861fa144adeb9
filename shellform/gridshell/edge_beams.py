"""Edge beams: what carries the rods' ends along an edge that doesn't stand on the ground.

They follow the lines that the net has for them (net/edges.py) in straight elements, and are made in their
final curve, so that they are without stress in the target. Each rod's end is clamped to the beam's axis by a
short beam, half the gap long or longer where ends share a node, without stress in the target too: the rods
are bent first, then clamped. It is as stiff as the edge beam, but never stiffer between its ends than a rod
half the gap long: nothing gives way there that counts, and stiffer ones would leave more to rounding than the
load. Where an edge beam has a foot it is pinned.

A bundle of n rods of radius r, packed as close as circles pack round a middle one, has with the distances d
of their axes from the bundle's

    A = n π r²,   I = n π r⁴/4 + γ Σ π r² d²/2,   J = 2 n π r⁴/4

where γ is how far they act together: 1 as if glued, 0 loose (the efficiency of EN 1995-1-1, annex B; torsion
is counted loose). A bundle's outermost fibre lies γ d + r from where its stress is 0.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, require_count, require_number
from shellform.gridshell.loads import GRAVITY
from shellform.gridshell.possible_rods import require_section
from shellform.net.net import Net
from shellform.quantities import EDGE_SIZE
from shellform.structure.elements.beam import Beams, built_in, joined
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.sections import (
    BeamStiffness,
    Circular,
    Material,
    Section,
    mass_per_length,
    stiffness,
)

EDGE, CLAMP = "edge", "clamp"  # kinds of beams
_RINGS = 12  # of a bundle, whose rods are counted from the middle: 469 rods


@dataclass(frozen=True)
class Bundle(Circular):
    """A bundle of `count` solid round rods of `radius`, m, of which `composite` (0 to 1) says how far they
    act together."""

    radius: float
    count: int
    composite: float
    material: Material

    def __post_init__(self) -> None:
        require_number(self.radius, above=0.0, where="edges.beam.radius", give="metres, such as 0.004")
        most = 1 + 3 * _RINGS * (_RINGS + 1)
        require_count(
            self.count, most=most, where="edges.beam.rods", give=f"a number of rods up to {most}, such as 7"
        )
        require_number(
            self.composite,
            least=0.0,
            most=1.0,
            where="edges.beam.composite",
            give="0 for loose rods to 1 for glued ones, such as 0.5",
            share=True,
        )

    @property
    def _places(self) -> Reals:
        """Axes (n, 2) of the rods from the bundle's, m."""
        steps = range(-_RINGS, _RINGS + 1)
        lattice = [(2.0 * i + j, math.sqrt(3.0) * j) for i in steps for j in steps if abs(i + j) <= _RINGS]
        lattice.sort(key=lambda place: (round(math.hypot(*place), 9), math.atan2(place[1], place[0])))
        chosen = self.radius * np.array(lattice[: self.count])
        return np.asarray(chosen - chosen.mean(axis=0))

    @property
    def sizes(self) -> tuple[float, ...]:
        """The rods' radius."""
        return (self.radius,)

    def with_sizes(self, sizes: Sequence[float]) -> Bundle:
        """As many rods of that radius, m."""
        return Bundle(sizes[0], self.count, self.composite, self.material)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """A, J, I_y, I_z by the formulas above, I the mean of both axes: a bundle turns between them."""
        own, area = 0.25 * math.pi * self.radius**4, math.pi * self.radius**2
        apart = 0.5 * float((self._places**2).sum())
        inertia = self.count * own + self.composite * area * apart
        return self.count * area, 2.0 * self.count * own, inertia, inertia

    @property
    def constants_by_size(self) -> Reals:
        """By the rods' radius: A goes with its square, the others with its fourth power."""
        area, torsion, inertia, _ = self.constants
        return np.array([[2.0 * area, 4.0 * torsion, 4.0 * inertia, 4.0 * inertia]]) / self.radius

    @property
    def fibres(self) -> tuple[float, float]:
        """γ d + r, twice."""
        outermost = self.composite * float(np.linalg.norm(self._places, axis=1).max()) + self.radius
        return outermost, outermost

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """The stress falls with the radius' cube."""
        return [np.asarray(-3.0 / self.radius * self.bending(about_y, about_z))]


@dataclass(frozen=True)
class EdgeBeam:
    """What edge beams are made of: their `section` with its material. Its local z axis stands across the
    surface."""

    section: Section

    def __post_init__(self) -> None:
        require_section(self.section, EDGE_SIZE, where="edges.beam")

    @property
    def stiffness(self) -> BeamStiffness:
        """EA, N; GJ, EI_y, EI_z, N·m²."""
        return stiffness(self.section)


def edge_beams(net: Net, edge: EdgeBeam | None, rod: BeamStiffness) -> Beams | None:
    """The elements of the net's edge beams, then their clamps, no stiffer than a `rod` half the gap long;
    None where it has none. Raises InputError where the net has edge beams, but nothing is said of what they
    are."""
    if not net.edges:
        return None
    if edge is None:
        raise InputError(
            "is needed: the net has edges that hang on edge beams",
            where="edge",
            remedy="Give an EdgeBeam, or let the net stand otherwise (net.edges).",
        )
    turned = matrices(net.target.quaternions)
    along = np.vstack([line.ends for line in net.edges])
    upwards = turned[along][..., 2].sum(axis=1)
    clamps = np.vstack([line.clamps for line in net.edges])
    reach = net.target.positions[clamps[:, 1]] - net.target.positions[clamps[:, 0]]
    across = np.eye(3)[np.argmin(np.abs(reach), axis=1)]
    return joined(
        _built(net, along, edge.stiffness, upwards, EDGE),
        _built(net, clamps, _no_stiffer(edge.stiffness, rod, reach, 0.5 * net.grid.gap), across, CLAMP),
    )


def _built(
    net: Net, ends: Indices, stiffness: Sequence[float] | Sequence[Reals], z_axis: Reals, kind: str
) -> Beams:
    """Beams between the nodes, without stress in the target."""
    axial, torsion, bending_y, bending_z = stiffness
    return built_in(
        net.target, ends, axial=axial, torsion=torsion, bending_y=bending_y, bending_z=bending_z, z_axis=z_axis, kind=kind
    )  # fmt: skip


def _no_stiffer(
    edge: Sequence[float], rod: Sequence[float], reach: Reals, shortest: float
) -> tuple[Reals, Reals, Reals, Reals]:
    """EA, GJ, EI_y, EI_z (c,) of clamps that reach (c, 3), m: the edge beam's, but between their ends, EA/L,
    GJ/L and 12 EI/L³, at most those of a rod so short, m."""
    times = np.linalg.norm(reach, axis=1) / shortest
    axial, torsion, about_y, about_z = (
        np.minimum(most, own * times**power)
        for most, own, power in zip(edge, rod, (1.0, 1.0, 3.0, 3.0), strict=True)
    )
    return axial, torsion, about_y, about_z


def lengths(net: Net) -> Reals:
    """Lengths (k,), m, of the net's edge beams along their axes."""
    place = net.target.positions
    return np.array(
        [float(np.linalg.norm(np.diff(place[line.ends], axis=1), axis=2).sum()) for line in net.edges]
    )


def mass(net: Net, edge: EdgeBeam) -> float:
    """Mass, kg, of all edge beams; 0 where their density isn't known."""
    return mass_per_length(edge.section) * float(lengths(net).sum())


def rods_of_bundles(net: Net, edge: EdgeBeam | None) -> float:
    """Length, m, of all single rods that edge beams are bundles of; 0 where they are none."""
    if edge is None or not isinstance(edge.section, Bundle):
        return 0.0
    return edge.section.count * float(lengths(net).sum())


def weight(net: Net, edge: EdgeBeam) -> Reals:
    """Load (n, 6), N, of the edge beams' own weight, half an element on each of its nodes."""
    down = np.zeros((len(net.grid.flat), 6))
    for line in net.edges:
        ends: Indices = line.ends
        size = np.linalg.norm(np.diff(net.target.positions[ends], axis=1)[:, 0], axis=1)
        half = 0.5 * GRAVITY * mass_per_length(edge.section) * size
        np.add.at(down[:, 2], ends, -half[:, None])
    return down
