"""The analysis of a model: how it comes to its load, and what there is to tell of it then
(documentation/reference/model.md).

Four ways lead to the equilibrium under a load. Relaxation, the default, goes in adaptive increments on the
stable branch (loading.py), where these get no further along the path (settled.py), and past the branch's end
follows the snap-through to a stable state. Newton takes whole increments without help, dynamic relaxation
lets the network move until it comes to rest (dynamic.py). A path goes through limit points, loads falling and
rising, to where the factor first comes to its goal or a led displacement to its own (path.py). Where
relaxation doesn't come to rest under moments that have no potential, the path is followed, and a warning says
so.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import NotConverged
from shellform.structure.answers.halved import Refined, critical_error, too_coarse
from shellform.structure.answers.increments import LoadIncrement, PathIncrement, Reached, Waypoint
from shellform.structure.answers.request import (
    check_imposed_turns,
    check_request,
    chosen_load,
    with_supports_moved,
)
from shellform.structure.answers.stability import Critical, Modes, critical_load, modes
from shellform.structure.elements.state import State, at_rest, moved
from shellform.structure.model import Model
from shellform.structure.network import assemble, doubts, free_to_swing, held_spins, lost_moments, swinging
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive, turns_half
from shellform.structure.solve.dynamic import dynamic
from shellform.structure.solve.equilibrium import (
    LIMIT,
    TOLERANCE,
    Equilibrium,
    find_equilibrium,
    newton,
    stability,
)
from shellform.structure.solve.extended import fit_for
from shellform.structure.solve.loading import advance
from shellform.structure.solve.path import follow
from shellform.structure.solve.residual import Drowned, Turning
from shellform.structure.solve.settled import prestressed, settle
from shellform.structure.solve.walk import Lead

_TIMED = ("assembly", "factorisation", "solve")
_TURNING = 200  # the same under moments without potential, before their path is followed instead

PathWatch = Callable[[float, int], None]
"""Called with the load factor and the factorisations so far."""


@dataclass(frozen=True, eq=False)
class Analysis(Record):
    """The last state reached and why it ended there.

    `load` (n, 6) at that state; `reactions` (n, 6), what held degrees of freedom bear there, N and N·m;
    `converged`; the `increments` by which it was come to, or the points of a path; `modes` and `critical`
    where they were asked for; a `message` of what wasn't found; `warnings`, a sentence each. `on_branch`:
    whether the state lies on the stable branch from the start; None where Newton's method doesn't tell.
    `critical_sought`: the factor up to which no other is critical, 0 where that wasn't found out;
    `critical_mesh`: on this mesh and with beams halved.
    """

    model: Model
    load: Reals
    reactions: Reals
    equilibrium: Equilibrium
    converged: bool
    increments: tuple[LoadIncrement | PathIncrement, ...]
    seconds: Mapping[str, float]
    message: str
    warnings: tuple[str, ...]
    modes: Modes | None
    critical: Critical | None
    critical_sought: float
    on_branch: bool | None
    critical_mesh: Refined | None


def analyse(
    model: Model,
    *,
    load: str | None = None,
    factor: float = 1.0,
    increments: int = 1,
    tolerance: float = TOLERANCE,
    method: str = "relaxation",
    lead: tuple[int, int, float] | None = None,
    limit: int = LIMIT,
    mode_count: int = 0,
    critical_to: float | None = None,
    progress: PathWatch | None = None,
) -> Analysis:
    """The equilibrium of the model under `factor` times the case `load`, reached in equal `increments` by one
    of METHODS.

    Loads and imposed displacements grow together; from a given start, imposed displacements hold in full and
    only the loads grow. `lead` (node, axis 0 to 2, displacement in m) leads a path by a free displacement
    instead of by its length. `limit` bounds the factorisations of a relaxation. `mode_count` softest modes
    are found at the end; with `critical_to` the critical load factor up to that multiple of the load. Where
    no equilibrium is found the last one is kept and `converged` is false; where one is, but no modes or end
    of the search for a critical factor, it stays as it is. Raises InputError for bad requests.
    """
    began = time.perf_counter()
    chosen = chosen_load(model, load)
    check_request(
        factor=factor, increments=increments, tolerance=tolerance, method=method, lead=lead, limit=limit,
        mode_count=mode_count, critical_to=critical_to, node_count=len(chosen),
    )  # fmt: skip
    assembly = assemble(model.network)
    walk = _Analysis(model, assembly, chosen, factor, tolerance, limit, progress)
    message, converged = "", True
    critical, softest, mesh, sought = None, None, None, 0.0
    try:
        walk.begin(method)
        if method == "path":
            walk.path(None if lead is None else Lead(*lead), increments)
        else:
            walk.increments(increments, method)
    except NotConverged as error:
        converged, message = False, str(error)
        walk.keep(error)
    if converged and critical_to is not None:
        critical, mesh, message = walk.critical(critical_to)
        sought = 0.0 if message else critical_to
    if converged and mode_count:
        try:
            softest = modes(fit_for(assembly, walk.state), walk.state, mode_count)
        except NotConverged as error:
            message = f"{message} {error}".lstrip()
    found = walk.found
    if found is None:  # not even the start: what there is of it
        found = walk.measured(walk.state, np.inf)
    loaded, clock = walk.drive.at(walk.reached), assembly.clock
    return Analysis(
        model=model,
        load=loaded,
        reactions=assembly.unbalanced(found.state, loaded),
        equilibrium=replace(found, factorisations=walk.spent),
        converged=converged,
        increments=tuple(walk.behind),
        seconds={each: clock.get(each, 0.0) for each in _TIMED} | {"total": time.perf_counter() - began},
        message=message,
        warnings=(
            *doubts(model.network),
            *lost_moments(model.network, chosen),
            *held_spins(model.network, found.state.rotations),
            *free_to_swing(walk.swinging),
            *walk.warnings(),
            *too_coarse(mesh),
        ),
        modes=softest,
        critical=critical,
        critical_sought=sought,
        on_branch=walk.on_branch,
        critical_mesh=mesh,
    )


@dataclass(eq=False)
class _Analysis:
    """An analysis under way."""

    model: Model
    assembly: Assembly
    load: Reals
    factor: float
    tolerance: float
    limit: int
    progress: PathWatch | None
    spent: int = 0
    reached: float = 0.0
    behind: list[LoadIncrement | PathIncrement] = field(default_factory=list)
    found: Equilibrium | None = None
    on_branch: bool | None = True
    left_at: float | None = None  # the factor at which the stable branch ended
    followed_from: float | None = None  # the factor from which a path stands in for the relaxation

    def __post_init__(self) -> None:
        network, start = self.model.network, self.model.start
        none = np.zeros_like(self.load)
        # Rotations that are imposed turn the node as a whole.
        check_imposed_turns(network)
        imposed = none if start is not None else np.where(network.fixed, network.imposed, 0.0)
        self.drive = Drive(self.load, imposed, none)
        self.loaded = np.flatnonzero(self.load.any(axis=1))
        self.swinging = swinging(network)
        self.turns = len(Turning(self.assembly, self.load).nodes) > 0
        self.state = at_rest(network.nodes) if start is None else with_supports_moved(network, start)
        self.origin = self.state

    def begin(self, method: str = "relaxation") -> None:
        """The unloaded equilibrium from which the loading begins, of a given start or a prestressed model; of
        the latter where it is stable, and not by methods that take whole increments."""
        load, watch = self.drive.at(0.0), self._watch(0.0)
        if self.model.start is not None:
            found = find_equilibrium(
                self.assembly, self.state, load, tolerance=self.tolerance, limit=self.limit, progress=watch
            )
            self.accept(found, 0.0, found.factorisations)
        elif method not in ("newton", "dynamic"):
            rest, spent = prestressed(
                self.assembly, self.state, load, tolerance=self.tolerance, limit=self.limit, progress=watch
            )
            self.spent += spent
            if rest is not None:
                self.accept(rest, 0.0, 0)
        self.origin = self.state

    def increments(self, count: int, method: str) -> None:
        """Equal increments up to the factor."""
        for k in range(1, count + 1):
            before, after = (k - 1) / count * self.factor, k / count * self.factor
            waypoints: list[Waypoint] = []
            if method in ("newton", "dynamic"):
                motion = (after - before) * self.drive.imposed
                if turns_half(motion):
                    raise NotConverged(
                        f"Supports turn by half a turn or more from load factor {before:.6g} to {after:.6g}",
                        state=self.state,
                        remedy="Take more increments, so that each turns them by less.",
                    )
                start = moved(self.state, motion)
                solve = newton if method == "newton" else dynamic
                found = solve(
                    self.assembly,
                    start,
                    self.drive.at(after),
                    tolerance=self.tolerance,
                    progress=self._watch(after),
                )
                spent = found.factorisations
                self.on_branch = None
            else:
                found, spent = self._relaxed(before, after, waypoints)
            self.accept(found, after, spent)
            self.behind.append(LoadIncrement(self._reached(found, after, spent), tuple(waypoints)))

    def _relaxed(self, before: float, after: float, waypoints: list[Waypoint]) -> tuple[Equilibrium, int]:
        """The equilibrium at the factor `after` from the one at `before`, and factorisations spent; along the
        path where moments without potential don't let the relaxation come to rest. Adds its `waypoints`.
        """
        try:
            to_load = advance if len(self.swinging) else settle
            arrived = to_load(
                self.assembly,
                self.state,
                self.drive,
                begin=before,
                end=after,
                tolerance=self.tolerance,
                limit=min(self.limit, _TURNING) if self.turns else self.limit,
                report=self._reporter(waypoints, before, after),
            )
        except NotConverged as error:
            if not self.turns or isinstance(error, Drowned):
                raise
            waypoints.clear()
            found = self._followed(before, after, waypoints, error.iterations)
            return found, error.iterations + found.factorisations
        if not arrived.on_branch:
            self._left(before + arrived.share * (after - before))
        return arrived.equilibrium, arrived.factorisations

    def _followed(self, before: float, after: float, waypoints: list[Waypoint], wasted: int) -> Equilibrium:
        """The equilibrium at the factor `after` along the path from the one at `before`, after `wasted`
        factorisations. Adds its `waypoints`."""
        change = after - before
        rest = Drive(change * self.drive.load, change * self.drive.imposed, self.drive.at(before))
        if self.followed_from is None:
            self.followed_from = before
        points = follow(self.assembly, self.state, rest, tolerance=self.tolerance, heeding=True)
        last, spent = next(points), 0
        for last in points:
            factor, found = before + last.factor * change, last.equilibrium
            if last.event or not found.stable:
                self._left(factor)
            waypoints.append(Waypoint(factor, found.factorisations - spent, found.stable))
            spent = found.factorisations
            if self.progress is not None:
                self.progress(factor, self.spent + wasted + spent)
        return last.equilibrium

    def path(self, lead: Lead | None, parts: int) -> None:
        """Along the path to the factor or to the led displacement, the first step a `parts`-th of it, or a
        tenth.
        """
        first = 1.0 / parts if parts > 1 else 0.1
        before = 0
        points = follow(
            self.assembly,
            self.state,
            self.drive,
            goal=self.factor,
            lead=lead,
            first=first,
            tolerance=self.tolerance,
            heeding=True,
        )
        for point in points:
            spent = point.equilibrium.factorisations
            if point.factor == 0.0 and not self.behind:
                continue
            if point.event or not point.equilibrium.stable:
                self._left(point.factor)
            self.accept(point.equilibrium, point.factor, spent - before)
            reached = self._reached(point.equilibrium, point.factor, spent - before)
            self.behind.append(PathIncrement(reached, point.rate, point.event))
            before = spent

    def critical(self, goal: float) -> tuple[Critical | None, Refined | None, str]:
        """The critical load up to the factor `goal`, if there is one, that of the finer mesh beside it, and
        what to say where that isn't found out."""
        drive, tolerance = self.drive, self.tolerance
        try:
            found = critical_load(self.assembly, self.origin, drive, goal=goal, tolerance=tolerance)
        except NotConverged as error:
            said = f"The critical factor was not found: {error.what}."
            return None, None, f"{said} Seek it up to a smaller one, or give a stable start that is at rest."
        if found is None:
            return None, None, ""
        return found, critical_error(self.model, drive, found.factor, goal=goal, tolerance=tolerance), ""

    def _left(self, factor: float) -> None:
        """Takes down where the stable branch first ended."""
        self.on_branch = False
        self.left_at = factor if self.left_at is None else self.left_at

    def warnings(self) -> list[str]:
        """What has to be said of how the state was reached, a sentence each."""
        said = []
        if self.left_at is not None:
            said.append(
                f"The stable branch from the start ends near load factor {self.left_at:.6g}: the state lies "
                "beyond, past a snap-through or a bifurcation."
            )
        if self.turns:
            said.append(
                "Moments about fixed axes turn nodes in space and have no potential: equilibrium is that under "
                "these dead moments, stability and critical factors are those of the tangent's symmetric part, as "
                "under semi-tangential moments."
            )
        if self.followed_from is not None:
            said.append(
                "The relaxation does not come to rest under these moments: the path was followed from load factor "
                f"{self.followed_from:.6g} on."
            )
        return said

    def accept(self, found: Equilibrium, factor: float, spent: int) -> None:
        """Takes an equilibrium over as the last one."""
        self.found, self.state, self.reached = found, found.state, factor
        self.spent += spent
        if self.progress is not None:
            self.progress(factor, self.spent)

    def keep(self, error: NotConverged) -> None:
        """Takes the last state of a failure over."""
        self.spent += error.iterations
        if isinstance(error.state, State):
            self.state = error.state
            self.found = self.measured(error.state, error.residual)

    def measured(self, state: State, residual: float) -> Equilibrium:
        """A state that isn't an equilibrium, with its energy and stability."""
        assembly = fit_for(self.assembly, state)
        balance = assembly.evaluate(state)
        stable, negative = stability(assembly, balance)
        return Equilibrium(state, balance.energy, residual, self.spent, stable, negative)

    def _reached(self, found: Equilibrium, factor: float, spent: int) -> Reached:
        moves = (found.state.positions - self.model.network.nodes)[self.loaded]
        moved_by = dict(zip(self.loaded.tolist(), moves, strict=True))
        return Reached(factor, spent, moved_by, found.stable, found.negative)

    def _reporter(
        self, waypoints: list[Waypoint], before: float, after: float
    ) -> Callable[[float, Equilibrium], None]:
        def report(share: float, found: Equilibrium) -> None:
            factor = before + share * (after - before)
            waypoints.append(Waypoint(factor, found.factorisations, found.stable))
            if self.progress is not None:
                self.progress(factor, self.spent + found.factorisations)

        return report

    def _watch(self, factor: float) -> Callable[[int, float], None] | None:
        if self.progress is None:
            return None
        tell = self.progress
        return lambda factorisations, residual: tell(factor, self.spent + factorisations)
