"""The braced gridshell (operation 2 of the framework): rods, joints and candidate cables on a net.

Candidates run between the lower rods along both diagonals of every cell whose corners are all joints, but
those that would rise above the surface below which they have to stay. A design says which of them are there,
how long each is without force, and the rods' radius; all else is the net's, so that the beams follow from the
radius alone. How thick rods may be, the net's curvature says: κ E c at the outermost fibre, a distance c from
the axis, is at most the flexural strength (equation 1).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Flags, Indices, Reals, Record, flags, indices, reals
from shellform.errors import InputError
from shellform.gridshell.candidates import candidate_cables
from shellform.gridshell.edge_beams import EdgeBeam, edge_beams
from shellform.gridshell.layers import LOCK, locks, rod_bending_stress, rod_forces, rod_utilisation
from shellform.gridshell.loads import points
from shellform.gridshell.possible_rods import refuse_thick, require_section
from shellform.net.grid import ROD, grid_beams
from shellform.net.net import Net
from shellform.quantities import AXIAL, FLEXURAL, GAP, ROD_SIZE, require_rest_ratio
from shellform.structure.elements.beam import Beams, joined
from shellform.structure.elements.cable import Cables, make_cables
from shellform.structure.elements.sections import (
    BeamStiffness,
    Round,
    Section,
    isotropic,
    stiffness,
    stiffness_by_size,
)
from shellform.structure.elements.state import State
from shellform.structure.network import Network
from shellform.surface.shape.target import Surface

_RADII = 8  # whose beams are kept


@dataclass(frozen=True)
class Rod:
    """Rods of one `section` and its material.

    Where their thickness is a variable they vary among the sections similar to it, all sizes in proportion;
    `radius` tells these apart.
    """

    section: Section

    def __post_init__(self) -> None:
        require_section(self.section, ROD_SIZE, where="rod.section")

    @classmethod
    def round(
        cls,
        *,
        young: float,
        radius: float,
        poisson: float = 0.3,
        strength: float = math.inf,
        density: float = 0.0,
    ) -> Rod:
        """A solid round rod of an isotropic material: `radius`, m; moduli and flexural strength, Pa (inf: not
        known); kg/m³.
        """
        return cls(Round(radius, isotropic(young=young, poisson=poisson, density=density, strength=strength)))

    @property
    def radius(self) -> float:
        """Distance of the outermost fibre, m: the outer radius of round rods and tubes, half a lath's longer
        side.
        """
        return max(self.section.fibres)

    @property
    def young(self) -> float:
        """Young's modulus, Pa."""
        return self.section.material.young

    @property
    def shear(self) -> float:
        """Shear modulus, Pa."""
        return self.section.material.shear

    @property
    def strength(self) -> float:
        """Flexural strength, Pa."""
        return self.section.material.strength

    @property
    def stiffness(self) -> BeamStiffness:
        """EA, N; GJ, EI_y, EI_z, N·m²."""
        return stiffness(self.section)

    @property
    def stiffness_by_radius(self) -> BeamStiffness:
        """Derivatives of EA, GJ, EI_y, EI_z by the radius, all sizes in proportion to it."""
        rates = (np.array(self.section.sizes) / self.radius) @ stiffness_by_size(self.section)
        return BeamStiffness(*rates.tolist())

    def resized(self, radius: float) -> Rod:
        """The rod with a similar section of that radius, m."""
        return Rod(self.section.with_sizes([size / self.radius * radius for size in self.section.sizes]))


_OF_JOINTS = {"axial": AXIAL, "torsion": FLEXURAL, "bending": FLEXURAL, "gap": GAP}


@dataclass(frozen=True)
class Joint:
    """The connection of two crossing rods, a short beam between their axes: EA, N; GJ and EI, N·m²; length
    `gap`, m."""

    axial: float
    torsion: float
    bending: float
    gap: float

    def __post_init__(self) -> None:
        for name, quantity in _OF_JOINTS.items():
            quantity.require(getattr(self, name), where=f"joint.{name}")

    @property
    def stiffness(self) -> BeamStiffness:
        """EA, N; GJ, EI_y, EI_z, N·m²."""
        return BeamStiffness(self.axial, self.torsion, self.bending, self.bending)


@dataclass(frozen=True)
class Cable:
    """Axial stiffness EA, N, of every cable."""

    stiffness: float

    def __post_init__(self) -> None:
        AXIAL.require(self.stiffness, where="cable.stiffness")


@dataclass(frozen=True, eq=False)
class Design(Record):
    """What is designed: `rest_length` (c,), m, of every candidate cable, which of them exist, and the rods'
    `radius`, m.
    """

    rest_length: Reals
    present: Flags
    radius: float

    def __post_init__(self) -> None:
        put = object.__setattr__
        put(self, "present", flags("present", self.present, (None,)))
        put(self, "rest_length", reals("rest_length", self.rest_length, (len(self.present),), positive=True))

    def unbraced(self) -> Design:
        """The same without cables: its rods as they stand before they are braced."""
        return replace(self, present=np.zeros(len(self.present), dtype=bool))

    def among_candidates(self, values: Reals) -> Reals:
        """Values (..., p) of the present cables among those of all candidates (..., c); 0 for absent ones."""
        result = np.zeros((*values.shape[:-1], len(self.present)))
        result[..., self.present] = values
        return result

    def __repr__(self) -> str:
        cables = f"{int(self.present.sum())} of {len(self.present)} cables"
        return f"Design({cables}, rods of {1e3 * self.radius:.4g} mm radius)"


@dataclass(frozen=True, eq=False)
class Gridshell(Record):
    """A net with its rod, joint and candidate cables: `cable_ends` (c, 2) nodes, `cable_lengths` (c,), m, in
    the target; `edge`, what its edge beams are (None where the net has none, whatever was given).
    """

    net: Net
    rod: Rod
    joint: Joint
    cable: Cable
    cable_ends: Indices
    edge: EdgeBeam | None = None
    cable_lengths: Reals = field(init=False)
    _edges: Beams | None = field(init=False, repr=False, compare=False)
    _locks: Beams | None = field(init=False, repr=False, compare=False)
    _made: dict[float, Beams] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        count = len(self.cable_ends)
        ends = indices("cable_ends", self.cable_ends, (count, 2), below=self.net.node_count)
        object.__setattr__(self, "cable_ends", ends)
        place = self.net.target.positions[ends]
        lengths = np.linalg.norm(place[:, 1] - place[:, 0], axis=1)
        object.__setattr__(self, "cable_lengths", reals("cable_lengths", lengths, (count,), positive=True))
        object.__setattr__(self, "_edges", edge_beams(self.net, self.edge, self.rod.stiffness))
        object.__setattr__(self, "edge", self.edge if self.net.edges else None)
        object.__setattr__(self, "_locks", locks(self.net, self.rod.section, self.target))
        object.__setattr__(self, "_made", {})

    def __repr__(self) -> str:
        return (
            f"Gridshell({len(self.net.grid.rods)} rods of {1e3 * self.rod.radius:.4g} mm radius, "
            f"{len(self.net.grid.lattice)} connectors, {len(self.cable_ends)} candidate cables)"
        )

    @property
    def target(self) -> State:
        """The bent state on the target surface, (n,) nodes."""
        return self.net.target

    @property
    def node_count(self) -> int:
        """How many nodes there are, those of both layers of rods."""
        return self.net.node_count

    def locked_in(self, state: State) -> Gridshell:
        """The same, its rods, if in two layers, locked without stress in a `state` instead of the target."""
        other = copy.copy(self)
        object.__setattr__(other, "_locks", locks(self.net, self.rod.section, state))
        object.__setattr__(other, "_made", {})
        return other

    def design(self, *, rest_ratio: float = 0.99) -> Design:
        """The initial design: every candidate cable at `rest_ratio` of its length in the target."""
        require_rest_ratio(rest_ratio, where="cable.rest_ratio")
        every = np.ones(len(self.cable_ends), dtype=bool)
        return Design(rest_ratio * self.cable_lengths, every, self.rod.radius)

    def unbraced(self) -> Design:
        """The design without cables."""
        return self.design().unbraced()

    def point_load(self, force: float, *, every: int = 1, openings: Sequence[ArrayLike] = ()) -> Reals:
        """Dead load (n, 6): `force` N downwards on every `every`-th crossing outside the plan polygons
        `openings`.

        With 2 it is every second crossing of the checkerboard, as in section 4.1. It acts on the upper rod.
        """
        return points(self.net, force, every=every, openings=openings)

    def sections(self, radius: float) -> dict[str, Section]:
        """The sections by kind of beam, rods of the radius, m; connectors have none."""
        return {ROD: self.rod.resized(radius).section}

    def beams(self, radius: float) -> Beams:
        """Rods of the radius, m, and connectors; what locks rods in two layers; then edge beams and their
        clamps, whatever the radius. The same for the same radius, made once: one evaluation asks a dozen
        times.
        """
        made = self._made.get(radius)
        if made is None:
            made = self._beams(radius)
            if len(self._made) >= _RADII:
                self._made.clear()
            self._made[radius] = made
        return made

    def _beams(self, radius: float) -> Beams:
        own = grid_beams(self.net.grid, self.rod.resized(radius).stiffness, self.joint.stiffness)
        if self._locks is not None:
            larger = (radius / self.rod.radius) ** 4
            own = joined(own, replace(self._locks, bending_y=larger * self._locks.bending_y))
        return own if self._edges is None else joined(own, self._edges)

    def beams_by_radius(self, radius: float) -> Beams:
        """Beams whose end forces are the derivative of `beams`' end forces by the radius: they are linear in
        the stiffness.
        """
        beams = self.beams(radius)
        rate = self.rod.resized(radius).stiffness_by_radius
        rods = beams.of_kind(ROD)
        axial, torsion, bending_y, bending_z = (np.where(rods, value, 0.0) for value in rate)
        bending_y = np.where(beams.of_kind(LOCK), 4.0 / radius * beams.bending_y, bending_y)
        return replace(beams, axial=axial, torsion=torsion, bending_y=bending_y, bending_z=bending_z)

    def cables(self, design: Design) -> Cables:
        """The cables that exist in the design. Raises InputError for a design of another gridshell."""
        here = design.present
        if len(here) != len(self.cable_ends):
            raise InputError(
                f"is of another gridshell: this one has {len(self.cable_ends)} candidate cables",
                where="design.present",
                value=len(here),
                remedy="Take a design of this gridshell, as its design() makes one.",
            )
        return make_cables(
            self.cable_ends[here], rest_length=design.rest_length[here], stiffness=self.cable.stiffness
        )

    def network(self, design: Design) -> Network:
        """The structural model: flat and stress-free, pinned supports moved to where the rods end on the
        target.
        """
        flat = self.net.grid.flat
        fixed = np.zeros((len(flat), 6), dtype=bool)
        fixed[self.net.supports, :3] = True
        imposed = np.zeros((len(flat), 6))
        imposed[self.net.supports, :3] = (self.target.positions - flat)[self.net.supports]
        return Network(flat, self.beams(design.radius), self.cables(design), fixed, imposed)

    def rod_forces(self, design: Design, state: State) -> Reals:
        """Section forces (16) (r, 7), N and N·m, of the rods' elements, rod after rod; those in two layers
        with what locks them."""
        beams = self.beams(design.radius)
        return rod_forces(beams, beams.local_forces(state))

    def utilisation(self, design: Design, state: State) -> Reals:
        """Largest fibre stress (r,) of the rods' elements over their strength; 0 where it isn't known."""
        return rod_utilisation(self.rod.resized(design.radius).section, self.beams(design.radius), state)

    def bending_utilisation(self, design: Design, state: State) -> Reals:
        """Bending stress (r, 2) at both ends of the rods' elements over their flexural strength, M r / (I
        f_f) for round ones (1); 0 where it isn't known.
        """
        section, beams = self.rod.resized(design.radius).section, self.beams(design.radius)
        return rod_bending_stress(section, beams, beams.local_forces(state)) / section.material.strength


class TooCurved(InputError):
    """A net whose curvature its rods don't bear: `radius`, m, is the smallest to which they can be bent."""

    def __init__(self, what: str, *, where: str, value: object = None, remedy: str, radius: float) -> None:
        self.radius = radius
        super().__init__(what, where=where, value=value, remedy=remedy)


def erection_stress(net: Net, section: Section) -> float:
    """The largest bending stress, Pa, of rods bent into the net: σ = E κ c at the outermost fibre (equation
    1).

    A section's local z axis stands across the surface: curvature out of the surface bends it about y,
    curvature in it about z.
    """
    bent = net.quality.curvature
    own = stiffness(section)
    return float(section.bending(own.bending_y * bent[..., 0], own.bending_z * bent[..., 1]).max())


def max_radius(net: Net, rod: Rod) -> float:
    """Equation (1), m, for any section: the radius of the largest one similar to the rod's that bears the
    net's curvature.
    """
    stress = erection_stress(net, rod.section)
    return rod.radius * rod.strength / stress if stress > 0.0 else math.inf


def brace(
    net: Net,
    rod: Rod,
    joint: Joint,
    cable: Cable,
    *,
    below: Surface,
    edge: EdgeBeam | None = None,
    edge_cells: bool = False,
) -> Gridshell:
    """The gridshell with a candidate cable on both diagonals of every cell whose corners are all joints, and
    with `edge_cells` behind them on the one of every cell at the edge that has three.

    None ends at a support, since supports are no joints, and none rises above the surface `below` which they
    have to stay. They join the lower rods. `edge` is what the net's edge beams are. Raises InputError where
    the joint doesn't fit the net or the rod doesn't bear its curvature.
    """
    if not math.isclose(joint.gap, net.grid.gap, rel_tol=1e-9):
        raise InputError(
            f"differs from the net's gap of {net.grid.gap:g} m",
            where="joint.gap",
            value=joint.gap,
            remedy="Pull the net with the joint's gap.",
        )
    size, wide = rod.section.sizes[0], 2.0 * rod.section.fibres[0]  # its radius or its width
    refuse_thick(size, wide / size, min(net.grid.spacing, net.grid.spacing_v), where="rod.section")
    bearable = max_radius(net, rod)
    if rod.radius > bearable * (1.0 + 1e-9):
        raise TooCurved(
            f"the net bends rods to {net.quality.curvature_max:.3g} 1/m; with the outermost fibre more than "
            f"{1e3 * bearable:.4g} mm from the "
            "axis they break (equation 1)",
            where="rod.radius",
            value=rod.radius,
            remedy="Choose a thinner rod, a stronger material, another angle of the net, or a flatter "
            "surface.",
            radius=rod.radius / bearable / net.quality.curvature_max,
        )
    candidates = candidate_cables(net, below, edge_cells=edge_cells)
    return Gridshell(net, rod, joint, cable, candidates, edge)
