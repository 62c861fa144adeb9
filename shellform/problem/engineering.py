"""What an engineer limits besides the paper's constraints: stress, distances from the target, the turning of
connectors, cable forces, slack cables, uplift.

Each is the largest of many values, v_k at rod ends, nodes, connectors, cables or supports, which has no
derivative where two change places. The Kreisselmeier-Steinhauser function

    KS(v) = max v + ln(sum exp(q (v_k - max v))) / q

is smooth, never below the largest and at most ln(number)/q above it, so that a limit on it keeps the limit on
each; q is `SHARPNESS` over the quantity's unit. One value, so one adjoint solve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals
from shellform.errors import InputError, require_number
from shellform.gridshell.gridshell import Gridshell
from shellform.gridshell.layers import LOCK, TwoLayers, rod_stress
from shellform.net.grid import CONNECTOR, ROD
from shellform.problem.terms import LoadedDesign, Measurement, Term
from shellform.structure.answers.results import end_stress_by_force, twist
from shellform.structure.answers.sensitivity import force_by_stiffness, reaction_rows
from shellform.structure.answers.stability import modes
from shellform.structure.answers.third_derivatives import bilinear, bilinear_by_dof, bilinear_by_rest_length
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.sections import Section, stress_by_size
from shellform.structure.solve import residual

# per unit: 3000 rod ends that are all used to the full are told 4 % too high, and a single one not at all
SHARPNESS = 200.0
# the same for slack cables: tensions change by many times their least in a step, so that a sharp maximum
# would hop from cable to cable
_EASED = 10.0
_MODES = 4  # the softest ones, which may change places
BROKEN = 2.0  # times the rods' strength: what is beyond can only be per cents
_TURN = 0.1  # rad, the unit of turns


@dataclass(frozen=True)
class RodUtilisation(Term):
    """The largest fibre stress of the rods, for round ones |N|/A + |M| r/I, at any end, over their strength;
    erection stress is in it, and with two layers what their locks add (layers.py).
    """

    name = "utilisation"
    load: str

    def at_limit(self, limit: float) -> float:
        """The same. Raises InputError for one that can only be in per cent."""
        require_number(limit, most=BROKEN, where="utilisation", give="a share of the strength", share=True)
        return limit

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value. Raises InputError where the rods' strength isn't known."""
        shell, design, state = at.shell, at.design, at.state
        rod = shell.rod
        if not np.isfinite(rod.strength):
            raise InputError(
                "isn't known, so that their utilisation can't be limited",
                where="rod.strength",
                remedy="Give rod.strength, in Pa, or leave out limits.utilisation.",
            )
        section = rod.resized(design.radius).section
        beams = shell.beams(design.radius)
        forces = beams.local_forces(state)
        values = rod_stress(section, beams, forces).ravel() / rod.strength
        alone = Measurement(np.array([_smooth(values, SHARPNESS)[1]]))
        return replace(alone, late=lambda: self._with_slopes(at, section, forces, values))

    def _with_slopes(self, at: LoadedDesign, section: Section, forces: Reals, values: Reals) -> Measurement:
        shell, design, state, rod = at.shell, at.design, at.state, at.shell.rod
        beams, rate = shell.beams(design.radius), shell.beams_by_radius(design.radius)
        by_dof, own = beams.local_forces_by_dof(state), beams.of_kind(ROD)
        by_force = end_stress_by_force(beams, forces, shell.sections(design.radius))[own] / rod.strength
        rows = (by_force @ by_dof[own]).reshape(len(values), 12)
        rates = rate.local_forces(state)
        by_radius = (by_force @ rates[own][:, :, None])[:, :, 0]
        for end in range(2):
            three = forces[own][:, [0, 2 + 3 * end, 3 + 3 * end]].T
            by_radius[:, end] += (
                np.array(section.sizes) / design.radius @ stress_by_size(section, *three) / rod.strength
            )
        locked, ends = beams.of_kind(LOCK), [2, 5]
        if isinstance(section, TwoLayers) and locked.any():
            by_moment = section.couple_stress_by_moment(forces[locked][:, ends]) / rod.strength
            rows += (by_moment[:, :, None] * by_dof[locked][:, ends]).reshape(len(values), 12)
            own_stress = section.couple_stress(forces[locked][:, ends]) / rod.strength
            by_radius += by_moment * rates[locked][:, ends] - 3.0 / design.radius * own_stress
        return _largest(shell, 1.0, values, np.repeat(beams.dofs()[own], 2, axis=0), rows, by_radius.ravel())


@dataclass(frozen=True)
class LargestDeviation(Term):
    """The largest distance, m, of a node from its place in the target; `scale`, m, is the size of distances
    that matter, such as their limit."""

    name = "deviation"
    load: str
    scale: float

    def __post_init__(self) -> None:
        require_number(
            self.scale, above=0.0, where="largest_deviation.scale", give="metres, such as their limit"
        )

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m."""
        away = at.state.positions - at.shell.target.positions
        size = np.linalg.norm(away, axis=1)
        along = away / np.maximum(size, np.finfo(float).tiny)[:, None]
        places = 6 * np.arange(len(size))[:, None] + np.arange(3)
        return _largest(at.shell, self.scale, size, places, along, np.zeros(len(size)))


@dataclass(frozen=True)
class ConnectorTurn(Term):
    """The largest turning, rad, of two crossing rods against each other about their connector's axis, from
    the stress-free grid.
    """

    name = "connector_turn"
    load: str

    def at_limit(self, limit: float) -> float:
        """The same, rad. Raises InputError for one that can only be in degrees."""
        if limit >= 0.5 * np.pi:
            raise InputError(
                f"{limit:g} rad limit nothing, since crossing rods lie on each other at 1.57",
                remedy=f"If degrees are meant, write {np.radians(limit):.3g}.",
            )
        return limit

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, rad."""
        shell, state = at.shell, at.state
        beams = shell.beams(at.design.radius)
        own = beams.of_kind(CONNECTOR)
        turn = twist(beams.local_deformations(state))[own]
        # Mx_a = GJ (theta_a - theta_b) / l0, so that its derivative is that of the twist but for a factor.
        scale = -beams.rest_length[own] / beams.torsion[own]
        rows = scale[:, None] * beams.local_forces_by_dof(state)[own, 1]
        sign = np.where(turn < 0.0, -1.0, 1.0)
        return _largest(
            shell, _TURN, np.abs(turn), beams.dofs()[own], sign[:, None] * rows, np.zeros(len(turn))
        )


@dataclass(frozen=True)
class LargestCableForce(Term):
    """The largest cable tension, N: constraint (5) before any load and for loads beside the design load, in
    one value; `scale`, N, is the size of tensions that matter, such as their limit. A cable at less than nine
    tenths of the largest has no weight."""

    name = "cable_force"
    load: str
    scale: float

    def __post_init__(self) -> None:
        require_number(
            self.scale, above=0.0, where="largest_cable_force.scale", give="newtons, such as their limit"
        )

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, N; slack cables count with the push that they would give."""
        return _of_tensions(at, np.flatnonzero(at.design.present), self.scale, 1.0)

    def of(self, tensions: Reals) -> float:
        """The value, N, of `tensions` (c,), N, negative where slack cables would push."""
        return _smooth(tensions, SHARPNESS / self.scale)[1]


@dataclass(frozen=True)
class LeastTension(Term):
    """The least cable tension, N, of the present cables; `scale`, N, is the size of tensions that matter,
    such as the limit that it is to keep.

    It is told up to ln(number) / 10 of `scale` too low. Cables longer than `let_out` times their length
    in the target don't count: those which the optimiser has done without (step_model.py).
    """

    name = "slackness"
    load: str
    scale: float
    let_out: float = np.inf

    def __post_init__(self) -> None:
        require_number(
            self.scale, above=0.0, where="least_tension.scale", give="newtons, such as the least asked for"
        )
        if self.let_out != np.inf:
            give = "a factor of the lengths in the target, such as 1.05, or leave it out"
            where = "least_tension.let_out"
            require_number(self.let_out, above=0.0, below=100.0, where=where, give=give, share=True)

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, N, twice `scale` where there are no cables. A slack cable counts with the tension that
        it would have if it could push, which tells how slack it is.
        """
        design, lengths = at.design, at.shell.cable_lengths
        chosen = np.flatnonzero(design.present & (design.rest_length <= self.let_out * lengths))
        if not len(chosen):
            return Measurement(np.array([2.0 * self.scale]))
        return _of_tensions(at, chosen, SHARPNESS / _EASED * self.scale, -1.0)


@dataclass(frozen=True)
class ModalStiffness(Term):
    """The square of the softest mode's stiffness under the load, (N/m)², negative where that is; limits on it
    are given in N/m, and `scale`, N/m, is the size of stiffness that matters, such as the limit that it is to
    keep.

    The square, because that stiffness goes with the root of the distance to a limit point: its square is
    nearly linear in the design. Stability ends where that stiffness comes to 0, long before deviations tell
    of it; a load case at F times the design load that keeps this limit has a critical load factor above F.
    The softest four modes count, so that they may change places.
    """

    name = "softness"
    stabilises = True
    load: str
    scale: float

    def __post_init__(self) -> None:
        require_number(
            self.scale, above=0.0, where="modal_stiffness.scale", give="N/m, such as the least asked for"
        )

    def at_limit(self, limit: float) -> float:
        """Its square."""
        return limit * abs(limit)

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, (N/m)²."""
        shell, design, state = at.shell, at.design, at.state
        assembly = at.assembled()
        found = modes(assembly, state, _MODES)
        mass = residual.ResidualNorm(assembly).mass_shape
        flat = found.shapes.reshape(_MODES, -1)
        size = np.sqrt((flat[:, assembly.free] ** 2) @ mass)
        motions = (flat / size[:, None]).T
        stiffness = found.stiffness
        weight, largest = _smooth(-stiffness * np.abs(stiffness), SHARPNESS / self.scale**2)
        alone = Measurement(np.array([-largest]))

        def with_slopes() -> Measurement:
            weighted = 2.0 * np.abs(stiffness) * weight * motions
            rate, cables = shell.beams_by_radius(design.radius), shell.cables(design)
            by_rest_length = bilinear_by_rest_length(cables, state, weighted, motions)
            return replace(
                alone,
                by_dof=sp.csr_array(bilinear_by_dof(assembly, state, weighted, motions)[None]),
                by_rest_length=sp.csr_array(design.among_candidates(by_rest_length)[None]),
                by_radius=np.array([bilinear(rate, state, weighted, motions)]),
            )

        return replace(alone, late=with_slopes)


@dataclass(frozen=True)
class Uplift(Term):
    """The largest force, N, with which a support has to hold a rod's end down, negative where all press;
    `scale`, N, is the size of reactions that matter.
    """

    name = "uplift"
    load: str
    scale: float = 1.0

    def __post_init__(self) -> None:
        require_number(self.scale, above=0.0, where="uplift.scale", give="newtons, such as their limit")

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, N; supports may bear a part of the load at once."""
        push, free, rows, by_radius = _pushes(at, (2,), self.name)
        return _largest(at.shell, self.scale, -push[:, 0], free, -rows, -by_radius[:, 0])


@dataclass(frozen=True)
class Thrust(Term):
    """The largest horizontal force, N, on a support; `scale`, N, is the size of forces that matter, such as
    their limit.
    """

    name = "thrust"
    load: str
    scale: float = 1.0

    def __post_init__(self) -> None:
        require_number(self.scale, above=0.0, where="thrust.scale", give="newtons, such as their limit")

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, N; supports may bear a part of the load at once."""
        push, free, rows, by_radius = _pushes(at, (0, 1), self.name)
        size = np.hypot(push[:, 0], push[:, 1])
        along = push / np.maximum(size, np.finfo(float).tiny)[:, None]
        outward = sp.csr_array(sum(sp.diags_array(along[:, k]) @ rows[k::2] for k in range(2)))
        return _largest(at.shell, self.scale, size, free, outward, (along * by_radius).sum(axis=1))


def _pushes(at: LoadedDesign, axes: tuple[int, ...], name: str) -> tuple[Reals, Indices, sp.csr_array, Reals]:
    """With what each support pushes the shell along k `axes` (s, k), N; the free degrees of freedom (f,) by
    which `rows` (s k, f) are its derivatives, N/m; and those by the radius (s, k). Raises InputError where
    cables end at supports."""
    shell, state, assembly = at.shell, at.state, at.assembled()
    if np.isin(shell.cables(at.design).ends, shell.net.supports).any():
        raise InputError(
            "isn't known where cables end at supports",
            where=name,
            remedy="Leave out the limit, or the cables at supports.",
        )
    held = 6 * np.asarray(shell.net.supports)[:, None] + np.array(axes)
    push = assembly.unbalanced(state, at.load).ravel()[held]
    rows = reaction_rows(assembly, state, held.ravel())
    change = force_by_stiffness(shell.beams_by_radius(at.design.radius), state)
    return push, assembly.free, rows, change[held]


def _of_tensions(at: LoadedDesign, chosen: Indices, unit: float, sign: float) -> Measurement:
    """The largest (`sign` 1) or least (-1) of EA (l / l0 - 1), N, of the `chosen` candidate cables, smooth in
    the `unit`, N; 0 where there are none."""
    shell, design, state = at.shell, at.design, at.state
    if not len(chosen):
        return Measurement(np.zeros(1))
    cables = make_cables(
        shell.cable_ends[chosen], rest_length=design.rest_length[chosen], stiffness=shell.cable.stiffness
    )
    chord, length = cables.chords(state)
    slope = sign * cables.stiffness / cables.rest_length
    toward = (slope / length)[:, None] * chord
    largest = _largest(
        shell,
        unit,
        slope * (length - cables.rest_length),
        cables.dofs(),
        np.hstack([-toward, toward]),
        np.zeros(len(length)),
        chosen,
        -slope * length / cables.rest_length,
    )
    return largest if sign > 0.0 else _negative(largest)


def _negative(measurement: Measurement) -> Measurement:
    assert measurement.by_dof is not None
    assert measurement.by_rest_length is not None
    return Measurement(-measurement.value, -measurement.by_dof, -measurement.by_rest_length)


def _largest(
    shell: Gridshell,
    unit: float,
    values: Reals,
    dofs: np.ndarray,
    rows: Reals | sp.csr_array,
    by_radius: Reals,
    cables: np.ndarray | None = None,
    by_rest_length: Reals | None = None,
) -> Measurement:
    """KS of `values` (k,) from their derivatives `rows` (k, q) at `dofs` (k, q), or sparse ones at `dofs`
    (q,), `by_radius` (k,), and each by its own cable's rest length.
    """
    weight, value = _smooth(values, SHARPNESS / unit)
    slope = np.zeros(6 * shell.node_count)
    if sp.issparse(rows):
        slope[dofs] = rows.T @ weight
    else:
        np.add.at(slope, dofs, weight[:, None] * rows)
    by_rest = np.zeros(len(shell.cable_ends))
    if cables is not None and by_rest_length is not None:
        by_rest[cables] = weight * by_rest_length
    return Measurement(
        np.array([value]),
        sp.csr_array(slope[None]),
        sp.csr_array(by_rest[None]),
        np.array([float(weight @ by_radius)]),
    )


def _smooth(values: Reals, sharpness: float) -> tuple[Reals, float]:
    """Weights (k,), the derivatives of KS by the values, and KS."""
    top = float(values.max())
    weight = np.exp(sharpness * (values - top))
    total = float(weight.sum())
    return weight / total, top + float(np.log(total)) / sharpness
