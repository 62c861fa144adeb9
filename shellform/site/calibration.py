"""Calibration of the connectors from scans of the built grid under known loads (section 4.1).

Their stiffnesses EA, GJ and EI are unknown; the positions of marked nodes in several load states are
measured. What is sought are the logarithms q of the stiffnesses over their start values that minimise the sum
of squares of

    r(q) = P (y - x(q)),

with the measured y (3 a marker and scan), the model's positions x in the equilibria under the loads, and P
the projection that takes away what isn't the grid's doing: the scanner's place (a small rigid motion for each
frame) and, if asked, how far each marker sits from its node (an offset for each marker, the same in all
scans). The Jacobian -P dx/dq is analytic (sensitivity.py; end forces are linear in the stiffness), the steps
are Gauss-Newton's within a trust region (SciPy's `least_squares`). All equilibria stay on the stable branch:
a trial that leaves it counts as worse, and load states that the start doesn't bear come in when the others
have been fitted. After a fit the points are laid and named anew, until nothing changes.

Parameters that the data don't tell (identifiability.py) are held, at their start values or where fits have
brought them, and it is said so; connectors of the scale model are so short that EA always is.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from shellform.arrays import Indices, Reals, Record, reals
from shellform.errors import InputError, NotConverged, require_known, require_number
from shellform.gridshell.gridshell import Design, Gridshell, Joint
from shellform.net.grid import CONNECTOR
from shellform.problem.paths import follow
from shellform.site.identifiability import Identifiability, identifiability, nuisance
from shellform.site.markers import Markers, marked, markers_of
from shellform.site.measurements import check_noise
from shellform.site.scans import Match, Scan, apart, distances, laid, refuse_unlike
from shellform.structure.answers.sensitivity import by_stiffness, respond, state_by_design, stiffness_rate
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import Loaded
from shellform.tables import Table, Value, table_text

PARAMETERS = ("axial", "torsion", "bending")
NOISE = 0.15e-3  # m, the average error that section 4.2 reports for its motion capture
_RANGE = np.log(1e3)  # a stiffness is sought between a thousandth and a thousand times its start
_TRIAL = 15  # factorisations of a trial's equilibrium; next to a known one five are enough
_ROUNDS = 6  # of fitting and naming points anew
_WORSE = 1e3  # times the start's residuals: what a trial off the branch counts
_SETTLED = 1e-5  # relative change of the residual norm or of the logarithms at which a fit ends


@dataclass(frozen=True, eq=False)
class Calibration(Record):
    """The calibrated `joint`; which parameters were `fitted` and are told by the data, and which are `held`.
    `identifiability`: what the data tell, with the noise or the residuals, whichever are larger. `markers`
    (m,) with their names; `matches` of the scans (s). `before`, `after` (m, s), m: distances of markers from
    the model with the start's and the calibrated joint, NaN where missing; `residual`, m: a coordinate's
    standard deviation. `states`: the calibrated model's. `evaluations` of all load states that it took;
    `rejected`: trials off the branch."""

    joint: Joint
    fitted: tuple[str, ...]
    held: tuple[str, ...]
    identifiability: Identifiability
    markers: Markers
    matches: tuple[Match, ...]
    before: Reals
    after: Reals
    residual: float
    states: tuple[State, ...]
    evaluations: int
    rejected: int

    def sentences(self) -> list[str]:
        """What was found, held and doubted."""
        result = [f"{name} = {getattr(self.joint, name):.4g}" for name in self.fitted]
        result += [
            f"{name} was held at {getattr(self.joint, name):.4g}, which the data don't tell."
            for name in self.held
        ]
        result += self.identifiability.sentences()
        for number, each in enumerate(self.matches, 1):
            if len(each.missing):
                result.append(f"Scan {number}: no point for {self.markers.called(each.missing)}.")
            if len(each.outliers):
                result.append(
                    f"Scan {number}: points {', '.join(map(str, each.outliers))} belong to no marker."
                )
        for doubt in dict.fromkeys(doubt for each in self.matches for doubt in each.doubts):
            own = [str(k) for k, each in enumerate(self.matches, 1) if doubt in each.doubts]
            result.append(f"Scan{'s' * (len(own) > 1)} {', '.join(own)}: {doubt}")
        return result

    def table(self) -> str:
        """Distances, mm, between numerical and physical model at the markers, as in table 2, with means and
        maxima, as CSV.
        """
        scans = self.after.shape[1]
        heads = [name for k in range(1, scans + 1) for name in (f"{k} start", str(k))]
        both = 1e3 * np.stack([self.before, self.after], axis=2).reshape(len(self.before), -1)
        rows: list[tuple[Value, ...]] = [
            (number, *place, *("" if np.isnan(each) else f"{each:.3f}" for each in row))
            for number, (place, row) in enumerate(zip(self.markers.places(), both, strict=True), 1)
        ]
        for name, measure in (("mean", np.mean), ("max", np.max)):
            seen = [column[np.isfinite(column)] for column in both.T]
            rows.append((name, "", "", "", *(f"{measure(each):.3f}" if len(each) else "" for each in seen)))
        return table_text(Table("calibration", ("pos.", "node", "crossing", "rod", *heads), tuple(rows)))


def foresee(
    shell: Gridshell,
    design: Design,
    loads: Sequence[Reals],
    nodes: Indices,
    *,
    noise: float = NOISE,
    frame: int | None = 0,
    offsets: bool = False,
) -> Identifiability:
    """What scans of the `nodes` (m,) under the `loads`, (n, 6) each, would tell about all three stiffnesses,
    at their present values: choose load states with it before anything is measured. Raises NotConverged where
    a load isn't borne on the stable branch."""
    markers = marked(shell.node_count, nodes)
    check_noise(noise)
    model = _Model(shell, design, loads)
    begun = model.begin(shell.joint)
    if not all(each.on_branch for each in begun):
        _refuse(begun)
    states = [each.equilibrium.state for each in begun]
    jacobian = model.jacobian(shell.joint, states, PARAMETERS)[:, markers, :3].reshape(-1, len(PARAMETERS))
    basis = nuisance(
        states, markers, [frame] * len(loads), np.ones((len(loads), len(markers)), dtype=bool), offsets
    )
    return identifiability(PARAMETERS, jacobian - basis @ (basis.T @ jacobian), jacobian, noise)


def calibrate(
    shell: Gridshell,
    design: Design,
    scans: Sequence[Scan],
    nodes: Indices,
    *,
    free: Sequence[str] = PARAMETERS,
    noise: float = NOISE,
    offsets: bool = False,
    reach: float | None = None,
) -> Calibration:
    """Connector stiffnesses, of those in `free`, from scans of the marked `nodes` (m,) of the `shell` as
    built with `design`; its joint is the start. `offsets` lets each marker sit away from its node; `reach`, m
    (half the net's spacing), bounds how far a point lies from its marker.

    Raises InputError where points can't be named, NotConverged where a load isn't borne on the stable branch
    or where nothing can be told.
    """
    markers = marked(shell.node_count, nodes)
    check_noise(noise)
    if reach is not None:
        require_number(reach, above=0.0, where="calibrate.reach", give="metres, such as half the spacing")
    for name in free:
        require_known(name, PARAMETERS, where="calibrate.free", what="isn't a connector's stiffness")
    if not scans:
        remedy = "Give a scan with the load it was taken under."
        raise InputError("needs at least one scan", where="calibrate", remedy=remedy)
    beside = 0.5 * shell.net.spacing if reach is None else reach
    first = tuple(name for name in PARAMETERS if name in free)
    task = _Task(markers, first, noise, offsets, beside)
    model = _Model(shell, design, [scan.load for scan in scans])
    joint, begun = shell.joint, model.begin(shell.joint)
    before = np.full((len(markers), len(scans)), np.nan)
    carried = [k for k, each in enumerate(begun) if each.on_branch]
    own = [scans[k] for k in carried]
    near = [begun[k].equilibrium.state for k in carried]
    before[:, carried] = distances(own, laid(own, near, markers, beside), near, markers)
    while len(carried) < len(scans):
        # The start is too soft for some load states: what the others tell comes first.
        if carried:
            part = _Model(shell, design, [scans[k].load for k in carried])
            joint = _rounds(part, joint, near, [scans[k] for k in carried], task)[0]
            model.evaluations += part.evaluations
            model.rejected += part.rejected
            begun = model.begin(joint)
        more = [k for k, each in enumerate(begun) if each.on_branch]
        if len(more) <= len(carried):
            _refuse(begun)
        carried, near = more, [begun[k].equilibrium.state for k in more]
    joint, states, matches, fitted = _rounds(model, joint, near, scans, task)
    after = distances(scans, matches, states, markers)
    refuse_unlike(after, beside)
    fit = _Fit(model, joint, states, scans, matches, markers, offsets)
    deviation = fit.deviation(len(fitted))
    known = fit.identifiability(first, max(noise, deviation))
    told = tuple(name for name in fitted if name in known.tellable)
    return Calibration(
        joint=joint,
        fitted=told,
        held=tuple(name for name in first if name not in told),
        identifiability=known,
        markers=markers_of(shell.net.grid, markers),
        matches=tuple(matches),
        before=before,
        after=after,
        residual=deviation,
        states=tuple(states),
        evaluations=model.evaluations,
        rejected=model.rejected,
    )


@dataclass(frozen=True, eq=False)
class _Task(Record):
    """What is the same in all fits: the nodes that are `markers` (m,), which parameters are `free`, the
    `noise` and the `reach`, m, and whether markers may sit away from their nodes (`offsets`)."""

    markers: Indices
    free: tuple[str, ...]
    noise: float
    offsets: bool
    reach: float


def _rounds(
    model: _Model, joint: Joint, states: list[State], scans: Sequence[Scan], task: _Task
) -> tuple[Joint, list[State], list[Match], tuple[str, ...]]:
    """Fits, lays and names the points anew until nothing changes; the names of what was fitted come last."""
    matches = laid(scans, states, task.markers, task.reach)
    for _ in range(_ROUNDS):
        fit = _Fit(model, joint, states, scans, matches, task.markers, task.offsets)
        known = fit.identifiability(task.free, task.noise)
        if not known.tellable:
            raise NotConverged(
                f"The data tell none of the stiffnesses: {' '.join(known.sentences()).removesuffix('.')}",
                state=states,
                remedy="Choose load states that move the markers more (see `foresee`).",
            )
        joint, states = fit.solve(known.tellable)
        before, matches = matches, laid(scans, states, task.markers, task.reach)
        pairs = list(zip(before, matches, strict=True))
        moved = max(apart(a.motion, b.motion, model.shell.target.positions) for a, b in pairs)
        if moved < 0.1 * task.noise and all(np.array_equal(a.point, b.point) for a, b in pairs):
            break
    return joint, states, matches, known.tellable


def _refuse(begun: Sequence[Loaded]) -> None:
    number = next(k for k, each in enumerate(begun) if not each.on_branch)
    raise NotConverged(
        f"With the start's joint the grid bears {begun[number].share:.2f} of load {number + 1} only",
        state=begun[number].equilibrium.state,
        remedy="Check that its forces are in N; start from stiffer connectors, or leave this load state out.",
    )


class _Model:
    """Equilibria of the shell under several loads with any joint; counts its work."""

    def __init__(self, shell: Gridshell, design: Design, loads: Sequence[Reals]) -> None:
        self.shell, self.design, self.loads = shell, design, list(loads)
        nodes = shell.node_count
        for number, load in enumerate(self.loads):
            reals(f"loads[{number}]", load, (nodes, 6))
        self.base = assemble(shell.network(design))
        self.evaluations = self.rejected = 0

    def assembly(self, joint: Joint) -> Assembly:
        """The assembly with the joint's stiffness."""
        other = replace(self.shell, joint=joint)
        return self.base.with_parts((other.beams(self.design.radius), other.cables(self.design)))

    def begin(self, joint: Joint) -> list[Loaded]:
        """The documented path towards every load, as far as the stable branch goes."""
        self.evaluations += 1
        loads = {str(k): load for k, load in enumerate(self.loads)}
        return list(follow(replace(self.shell, joint=joint), self.design, loads, stay=True).values())

    def near(self, joint: Joint, states: Sequence[State]) -> list[State] | None:
        """The equilibria next to those known for a similar joint; None where one has left the stable
        branch.
        """
        self.evaluations += 1
        assembly = self.assembly(joint)
        result = []
        for state, load in zip(states, self.loads, strict=True):
            try:
                found = find_equilibrium(assembly, state, load, limit=_TRIAL, on_branch=True)
            except NotConverged:
                found = None
            if found is None or not found.stable:
                self.rejected += 1
                return None
            result.append(found.state)
        return result

    def jacobian(self, joint: Joint, states: Sequence[State], names: Sequence[str]) -> Reals:
        """Derivatives (s, n, 6, p) of all degrees of freedom, m and rad, by the logarithms of the joint's
        stiffnesses.
        """
        assembly = self.assembly(joint)
        beams = assembly.beams[0]
        stiffness = {"axial": (joint.axial, 0.0, 0.0, 0.0), "torsion": (0.0, joint.torsion, 0.0, 0.0)}
        stiffness["bending"] = (0.0, 0.0, joint.bending, joint.bending)
        rates = [stiffness_rate(beams, CONNECTOR, stiffness[name]) for name in names]
        result = np.zeros((len(states), 6 * assembly.count, len(names)))
        for each, state in zip(result, states, strict=True):
            each[assembly.free] = state_by_design(
                respond(assembly, state, by_stiffness(assembly, state, *rates))
            )
        return result.reshape(len(states), assembly.count, 6, len(names))


class _Fit:
    """One least-squares problem with the points' names and places fixed."""

    def __init__(
        self,
        model: _Model,
        joint: Joint,
        states: list[State],
        scans: Sequence[Scan],
        matches: Sequence[Match],
        markers: Indices,
        offsets: bool,
    ) -> None:
        self.model, self.joint, self.states, self.markers = model, joint, states, markers
        self.goal = np.stack([each.places(scan.points) for each, scan in zip(matches, scans, strict=True)])
        self.seen = np.isfinite(self.goal[:, :, 0])
        self.basis = nuisance(states, markers, [scan.frame for scan in scans], self.seen, offsets)
        self.dof = 3 * int(self.seen.sum()) - self.basis.shape[1]

    def residuals(self, states: Sequence[State]) -> Reals:
        """Projected distances (r,), m."""
        away = np.stack([state.positions[self.markers] for state in states])[self.seen] - self.goal[self.seen]
        return self._projected(away.reshape(-1, 1))[:, 0]

    def jacobian(self, joint: Joint, states: Sequence[State], names: Sequence[str]) -> tuple[Reals, Reals]:
        """Derivatives (r, p), m, by the logarithms, projected and as they are."""
        raw = self.model.jacobian(joint, states, names)[:, self.markers, :3][self.seen].reshape(
            -1, len(names)
        )
        return self._projected(raw), raw

    def identifiability(self, names: Sequence[str], noise: float) -> Identifiability:
        """What the data tell about the names."""
        return identifiability(names, *self.jacobian(self.joint, self.states, names), noise)

    def solve(self, names: Sequence[str]) -> tuple[Joint, list[State]]:
        """The best joint and its equilibria."""
        known: dict[bytes, list[State] | None] = {np.zeros(len(names)).tobytes(): self.states}
        accepted = self.states
        far = _WORSE * self.residuals(self.states)

        def states_at(q: Reals) -> list[State] | None:
            key = q.tobytes()
            if key not in known:
                known[key] = self.model.near(self._joint(q, names), accepted)
            return known[key]

        def value(q: Reals) -> Reals:
            states = states_at(q)
            return far if states is None else self.residuals(states)

        def slope(q: Reals) -> Reals:
            nonlocal accepted
            states = states_at(q)
            assert states is not None  # asked for at accepted points only
            accepted = states
            return self.jacobian(self._joint(q, names), states, names)[0]

        start = np.array([getattr(self.model.shell.joint, name) for name in names])
        begun = np.log(start / [getattr(self.joint, name) for name in names])
        found = least_squares(
            value,
            np.clip(0.0, begun - _RANGE, begun + _RANGE),
            slope,
            bounds=(begun - _RANGE, begun + _RANGE),
            xtol=_SETTLED,
            ftol=_SETTLED**2,
            gtol=None,
        )
        best = states_at(found.x)
        assert best is not None
        return self._joint(found.x, names), best

    def deviation(self, fitted: int) -> float:
        """Standard deviation, m, of a coordinate that the residuals show."""
        left = self.dof - fitted
        return float(np.sqrt((self.residuals(self.states) ** 2).sum() / left)) if left > 0 else np.inf

    def _joint(self, q: Reals, names: Sequence[str]) -> Joint:
        values = {
            name: getattr(self.joint, name) * float(np.exp(each)) for name, each in zip(names, q, strict=True)
        }
        return replace(self.joint, **values)

    def _projected(self, columns: Reals) -> Reals:
        return np.asarray(columns - self.basis @ (self.basis.T @ columns))
