"""Rods in two layers, as timber gridshells have them (Mannheim 1975, Weald and Downland 2002, Savill 2006):
bent as single laths that slide on one another, then locked by shear blocks.

Two laths, each of area A, torsion constant J and second moments I_y, I_z, have together while they slide

    EA = 2 E A,   GJ = 2 G J,   EI_y = 2 E I_y,   EI_z = 2 E I_z,

and each bears half of every force and moment. Laths of u and v rods lie in turn, so that the axes of a rod's
two are a = 2 d apart across the surface, d a lath's depth. Once they are locked, bending by Δκ more about y
also pulls one and pushes the other with F = γ E A a/2 Δκ, which bears the moment

    M = F a = B Δκ,   B = γ E A a²/2.

γ says how far they act together (EN 1995-1-1, annex B): 1 as if glued, 0 as if loose. In the surface and in
torsion they bend and turn beside each other as before. B is added by beams of its own along the rods' (kind
"lock"), built into the target without stress: what the laths bear of bending into the shape stays in them.
The largest fibre stress is in a corner of one of both, and the sum of what they bore when they were locked
and since:

    σ = |N| / 2A + σ_lath(M_y / 2, M_z / 2) + |M| / (a A).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals
from shellform.errors import require_number
from shellform.net.grid import ROD
from shellform.net.net import Net
from shellform.structure.answers.results import end_stress
from shellform.structure.elements.beam import Beams, built_in
from shellform.structure.elements.rotation import matrices
from shellform.structure.elements.sections import Material, Section, section_area, stiffness
from shellform.structure.elements.state import State

LOCK = "lock"  # kind of beams
TOGETHER = 0.5  # γ where nothing is known of the blocks, as for bundles


@dataclass(frozen=True)
class TwoLayers:
    """Two laths of one `single` section above one another, sliding; `composite` (0 to 1) says how far they
    act together once they are locked."""

    single: Section
    composite: float = TOGETHER

    def __post_init__(self) -> None:
        require_number(
            self.composite,
            least=0.0,
            most=1.0,
            where="rod.composite",
            give="0 for loose laths to 1 for glued ones, such as 0.5",
            share=True,
        )

    @property
    def material(self) -> Material:
        """The laths'."""
        return self.single.material

    @property
    def sizes(self) -> tuple[float, ...]:
        """The single lath's."""
        return self.single.sizes

    def with_sizes(self, sizes: Sequence[float]) -> TwoLayers:
        """Of laths of these sizes, m."""
        return TwoLayers(self.single.with_sizes(sizes), self.composite)

    @property
    def constants(self) -> tuple[float, float, float, float]:
        """Twice the single lath's."""
        area, torsion, about_y, about_z = self.single.constants
        return 2.0 * area, 2.0 * torsion, 2.0 * about_y, 2.0 * about_z

    @property
    def constants_by_size(self) -> Reals:
        """Twice the single lath's."""
        return 2.0 * self.single.constants_by_size

    @property
    def fibres(self) -> tuple[float, float]:
        """The single lath's, from its own axis: it is bent alone."""
        return self.single.fibres

    def bending(self, about_y: Reals, about_z: Reals) -> Reals:
        """Of a lath, which bears half of the moments."""
        return self.single.bending(0.5 * about_y, 0.5 * about_z)

    def bending_by_moment(self, about_y: Reals, about_z: Reals) -> tuple[Reals, Reals]:
        """Half of the lath's."""
        by_y, by_z = self.single.bending_by_moment(0.5 * about_y, 0.5 * about_z)
        return 0.5 * by_y, 0.5 * by_z

    def bending_by_size(self, about_y: Reals, about_z: Reals) -> list[Reals]:
        """The lath's."""
        return self.single.bending_by_size(0.5 * about_y, 0.5 * about_z)

    @property
    def apart(self) -> float:
        """Distance a, m, of the laths' axes."""
        return 4.0 * self.single.fibres[1]

    @property
    def locking(self) -> float:
        """B, N·m²: bending stiffness about y that shear blocks add. It goes with the sizes' fourth power."""
        return 0.5 * self.composite * stiffness(self.single).axial * self.apart**2

    def couple_stress(self, moment: Reals) -> Reals:
        """|M| / (a A), Pa, of the laths under moments M, N·m, of what locks them."""
        return np.asarray(np.abs(moment) / (self.apart * section_area(self.single)))

    def couple_stress_by_moment(self, moment: Reals) -> Reals:
        """Its derivative, 1/m³; 0 at the kink."""
        return np.asarray(np.sign(moment) / (self.apart * section_area(self.single)))


def locked_bending(section: Section) -> tuple[float, float]:
    """EI_y and EI_z, N·m², of rods as they bear loads: of laths in two layers once they are locked."""
    about_y, about_z = stiffness(section).bending
    return (about_y + section.locking, about_z) if isinstance(section, TwoLayers) else (about_y, about_z)


def single(section: Section) -> Section:
    """The section of a lath: of rods in one layer their own."""
    return section.single if isinstance(section, TwoLayers) else section


def layers_of(section: Section) -> int:
    """How many laths a rod has."""
    return 2 if isinstance(section, TwoLayers) else 1


def locks(net: Net, section: Section, state: State) -> Beams | None:
    """What locks laths in two layers, an element along each of the rods', without stress in the `state`, with
    the rods' local axes there; None where rods have one layer, or nothing locks them."""
    if not isinstance(section, TwoLayers) or not section.locking:
        return None
    ends = net.grid.rod_ends
    # Flat, a rod's local y axis is z × its own direction (beam.py).
    flat = net.grid.flat[ends[:, 1]] - net.grid.flat[ends[:, 0]]
    return locks_along(state, ends, np.cross([0.0, 0.0, 1.0], flat), section.locking)


def locks_along(state: State, ends: Indices, y_axes: Reals, bending: ArrayLike) -> Beams:
    """Locks of the `bending` stiffness B, N·m², along rod elements with `ends` (k, 2) whose local y axes,
    before they are bent, are `y_axes` (k, 3) of any length; without stress in the `state`."""
    chord = state.positions[ends[:, 1]] - state.positions[ends[:, 0]]
    rotations = matrices(state.quaternions[ends.ravel()]).reshape(-1, 2, 3, 3)
    turned = np.einsum("eaij,ej->ei", rotations, y_axes)
    return built_in(
        state, ends, axial=0.0, torsion=0.0, bending_y=bending, bending_z=0.0,
        z_axis=np.cross(chord, turned), kind=LOCK
    )  # fmt: skip


def rod_stress(section: Section, beams: Beams, forces: Reals) -> Reals:
    """Largest fibre stress (r, 2), Pa, at both ends of the rods' elements from the section forces (16) (m, 7)
    of all beams; erection stress is in it."""
    result = end_stress(beams, forces, {ROD: section})[beams.of_kind(ROD)]
    return result + _couples(section, beams, forces)


def rod_utilisation(section: Section, beams: Beams, state: State) -> Reals:
    """Largest fibre stress (r,) of the rods' elements over their strength; 0 where that isn't known."""
    stress = rod_stress(section, beams, beams.local_forces(state))
    return np.asarray(stress.max(axis=1) / section.material.strength)


def rod_bending_stress(section: Section, beams: Beams, forces: Reals) -> Reals:
    """The same without the axial force of the rod."""
    own = forces[beams.of_kind(ROD)]
    return section.bending(own[:, [2, 5]], own[:, [3, 6]]) + _couples(section, beams, forces)


def rod_forces(beams: Beams, forces: Reals) -> Reals:
    """Section forces (r, 7), N and N·m, of the rods' elements, with what their locks bear."""
    own, locked = forces[beams.of_kind(ROD)], beams.of_kind(LOCK)
    return own + forces[locked] if locked.any() else own


def _couples(section: Section, beams: Beams, forces: Reals) -> Reals | float:
    locked = beams.of_kind(LOCK)
    if not isinstance(section, TwoLayers) or not locked.any():
        return 0.0
    return section.couple_stress(forces[locked][:, [2, 5]])
