"""Erection: from the grid laid flat to the braced shell, step by step, with what the rods bear on the way.

The flat grid is laid out where it fits its supports best (turned and shifted in plan, which doesn't stress
it). Then the supports move to their places on the target, straight or by way points; the cables, slack so
far, are tightened, all at once or group after group, from the length at which they just hang straight to
their rest lengths; then a load may follow.

A flat grid whose supports close in can buckle up, down and in waves: its stable paths all begin in one point.
The path that leads to the erected shell is found from its other end: the structure is elastic, so that its
stable equilibria are the same both ways, and the erected grid is a known one. It is therefore taken down, the
supports moving back (loading.py), and the steps are put in reverse. A `lift` (a crane, a tower) acts from
before the supports move until they have arrived. Stresses are those of equation σ = |N|/A + |M| r/I at both
ends of every rod element.

Rods in two layers slide until the cables are tight; then they are locked as they lie, and the load follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals, indices, reals
from shellform.errors import InputError, NotConverged, require_number
from shellform.gridshell.gridshell import Design, Gridshell, Rod
from shellform.gridshell.layers import TwoLayers, locks, rod_stress
from shellform.structure.elements import rotation
from shellform.structure.elements.beam import joined
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.loading import advance
from shellform.tables import Table, table_text

STEP = 0.1  # of a stage
_SMALLEST = 1.0 / 256.0  # of a stage: shorter steps lead on where nothing stands
_SLACK = 1.5  # times its length in the target: a cable that isn't tightened yet
_LEAST = 1e-4  # of a stage, which then has ten thousand steps
_TRIAL = 25  # factorisations of one step of tightening

_COLUMNS = (
    "stage",
    "share",
    "height [mm]",
    "largest stress [MPa]",
    "stress/strength",
    "rod element",
    "largest tension [N]",
    "largest reaction [N]",
)


@dataclass(frozen=True, eq=False)
class ErectionStep:
    """One state on the way: the `stage` it belongs to and the `share` of it that is done; `height`, m, of the
    highest node over the lowest support; the largest rod `stress`, Pa, and the `element` that bears it; the
    largest cable `tension`, N; the largest `reaction`, N, of a support; `state`."""

    stage: str
    share: float
    height: float
    stress: float
    element: int
    tension: float
    reaction: float
    state: State


@dataclass(frozen=True, eq=False)
class Erection:
    """All `steps` in the order of building; `strength`, Pa, of the rods (inf: not known)."""

    steps: tuple[ErectionStep, ...]
    strength: float

    @property
    def worst(self) -> ErectionStep:
        """The step in which a rod bears the largest stress."""
        return max(self.steps, key=lambda step: step.stress)

    @property
    def utilisation(self) -> float:
        """The largest stress on the way over the strength."""
        return self.worst.stress / self.strength

    def table(self) -> str:
        """Step after step as CSV."""
        rows = tuple(
            (
                each.stage,
                f"{each.share:.3f}",
                f"{1e3 * each.height:.2f}",
                f"{1e-6 * each.stress:.2f}",
                f"{each.stress / self.strength:.3f}",
                each.element,
                f"{each.tension:.3f}",
                f"{each.reaction:.3f}",
            )
            for each in self.steps
        )
        return table_text(Table("erection", _COLUMNS, rows))


def erect(
    shell: Gridshell,
    design: Design,
    *,
    way: Sequence[ArrayLike] = (),
    groups: Sequence[ArrayLike] | None = None,
    lift: Reals | None = None,
    weight: Reals | None = None,
    load: Reals | None = None,
    step: float = STEP,
) -> Erection:
    """The erection of the shell with the design's cables.

    `way`: positions (s, 3), m, of the supports between the flat grid and the target, in the order of
    building; `groups`: candidate cables tightened together, group after group (all at once); dead loads (n,
    6), N: `lift` while the supports move, `weight` all the time, `load` in the end. Raises NotConverged where
    no stable path leads from the flat grid to the erected one, or tightening or the load ends it.
    """
    require_number(step, least=_LEAST, most=1.0, where="erect.step", give="a share of the way, such as 0.1")
    if shell.net.edges:
        raise InputError(
            "is worked out for shells that stand on the ground all round: edge beams are clamped to the grid "
            "once it is bent",
            where="erect",
            value=f"{len(shell.net.edges)} edge beams",
            remedy="Fill the edges (edges.outer, edges.openings), or work the lifting out by hand.",
        )
    nodes = shell.node_count
    none = np.zeros((nodes, 6))
    own, carried, last = (
        none if each is None else reals(name, each, (nodes, 6))
        for name, each in (("weight", weight), ("lift", lift), ("load", load))
    )
    teams = _teams(design, groups)
    locked, shell = shell, _sliding(shell)
    unbraced = replace(design, present=np.zeros(len(design.present), dtype=bool))
    site = _Site(shell, unbraced)
    try:
        erected = find_equilibrium(site.assembly, shell.target, own).state
    except NotConverged as error:
        raise NotConverged(
            "The erected grid doesn't stand under the weight before it is braced",
            state=error.state,
            remedy="Give a smaller weight, N, downwards negative.",
        ) from error
    steps = _taken_down(site, erected, way, carried, own, step)
    state, now = (
        erected,
        replace(design, rest_length=np.maximum(_SLACK * shell.cable_lengths, design.rest_length)),
    )
    braced = _Site(shell, now)
    for number, team in enumerate(teams, 1):
        stage = "tightening" if len(teams) == 1 else f"tightening group {number}"
        now, state, more = _tightened(braced, now, design, state, team, own, stage, step)
        steps += more
    if last.any():
        there = braced.assembly.with_parts((shell.beams(now.radius), shell.cables(now)))
        blocks = locks(shell.net, locked.rod.resized(now.radius).section, state)
        if blocks is not None:
            network = shell.network(now)
            there = assemble(replace(network, beams=joined(network.beams, blocks)))
        site = _Site(locked, now, there)

        def note(share: float, found: Equilibrium) -> None:
            steps.append(site.step("loading", share, found.state, own + share * last))

        reached = advance(there, state, Drive(last, none, own), step=step, stay=True, report=note)
        if not reached.on_branch:
            raise NotConverged(
                f"The shell bears {reached.share:.2f} of the load only",
                state=reached.equilibrium.state,
                remedy="Brace it better or load it less.",
            )
    return Erection(tuple(steps), shell.rod.strength)


def _sliding(shell: Gridshell) -> Gridshell:
    """The shell before blocks lock its rods, if they have two layers."""
    section = shell.rod.section
    if not isinstance(section, TwoLayers):
        return shell
    return replace(shell, rod=Rod(replace(section, composite=0.0)))


def laid_out(shell: Gridshell) -> State:
    """The flat, stress-free grid, turned and shifted so that its supports come nearest to their places in
    plan, at their mean height.
    """
    flat, supports = shell.net.grid.flat, shell.net.supports
    here, goal = flat[supports], shell.target.positions[supports]
    middle, there = here.mean(axis=0), goal.mean(axis=0)
    plan, wanted = (here - middle)[:, :2], (goal - there)[:, :2]
    # The turn in plan that minimises the sum of squares has the angle of sum of conj(plan) * wanted as
    # complex numbers.
    cosine = float((plan * wanted).sum())
    sine = float((plan[:, 0] * wanted[:, 1] - plan[:, 1] * wanted[:, 0]).sum())
    angle = np.arctan2(sine, cosine)
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    quaternions = rotation.from_vectors(np.tile([0.0, 0.0, angle], (len(flat), 1)))
    return State((flat - middle) @ turn.T + there, quaternions)


class _Site:
    """The shell with a design's cables, and what is read off its states."""

    def __init__(self, shell: Gridshell, design: Design, assembly: Assembly | None = None) -> None:
        self.shell, self.design = shell, design
        self.assembly = assemble(shell.network(design)) if assembly is None else assembly
        self.section = shell.rod.resized(design.radius).section

    def step(self, stage: str, share: float, state: State, load: Reals) -> ErectionStep:
        """The state as a step."""
        beams, cables = self.assembly.beams[0], self.shell.cables(self.design)
        stress = rod_stress(self.section, beams, beams.local_forces(state)).max(axis=1)
        worst = int(np.argmax(stress))
        tension = float(cables.tension(state).max(initial=0.0))
        supports = self.shell.net.supports
        forces = self.assembly.unbalanced(state, load)[supports, :3]
        height = float(state.positions[:, 2].max() - state.positions[supports, 2].min())
        return ErectionStep(
            stage=stage,
            share=float(share),
            height=height,
            stress=float(stress[worst]),
            element=worst,
            tension=tension,
            reaction=float(np.linalg.norm(forces, axis=1).max()),
            state=state,
        )


def _taken_down(
    site: _Site, erected: State, way: Sequence[ArrayLike], lift: Reals, weight: Reals, step: float
) -> list[ErectionStep]:
    """Steps from the flat grid to the erected one, found the other way round."""
    shell = site.shell
    supports, none = shell.net.supports, np.zeros_like(weight)
    flat = laid_out(shell)
    stops = [reals(f"way[{k}]", each, (len(supports), 3)) for k, each in enumerate(way)]
    places = [flat.positions[supports], *stops, shell.target.positions[supports]]
    steps: list[ErectionStep] = []
    state, total = erected, len(places) - 1

    def passed(stage: str, drive: Drive, share_of: tuple[float, float]) -> State:
        first, last = share_of

        def note(share: float, found: Equilibrium) -> None:
            steps.append(site.step(stage, first + share * (last - first), found.state, drive.at(share)))

        if not steps or steps[-1].stage != stage:
            steps.append(site.step(stage, first, state, drive.at(0.0)))
        reached = advance(site.assembly, state, drive, step=step, smallest=_SMALLEST, stay=True, report=note)
        if not reached.on_branch:
            raise NotConverged(
                "No stable path leads from the flat grid to the erected one: taken down, it snaps at "
                f"{first + reached.share * (last - first):.2f} "
                f"of the stage {stage!r}",
                state=reached.equilibrium.state,
                remedy="Give the supports other way points, or lift the grid.",
            )
        return reached.equilibrium.state

    if lift.any():
        state = passed("lowering", Drive(lift, none, weight), (1.0, 0.0))
    carried = Drive(lift, none, weight).at(1.0)
    for k in range(total, 0, -1):
        imposed = none.copy()
        imposed[supports, :3] = places[k - 1] - places[k]
        state = passed("moving supports", Drive(none, imposed, carried), (k / total, (k - 1) / total))
    if lift.any():
        state = passed("lifting", Drive(-lift, none, carried), (1.0, 0.0))
    return steps[::-1]


def _tightened(
    site: _Site,
    now: Design,
    design: Design,
    start: State,
    team: Indices,
    load: Reals,
    stage: str,
    widest: float,
) -> tuple[Design, State, list[ErectionStep]]:
    """The team's cables brought to their rest lengths from where they just hang straight, in steps that are
    halved where they leave the branch.
    """
    shell = site.shell
    ends = shell.cable_ends[team]
    straight = np.linalg.norm(start.positions[ends[:, 1]] - start.positions[ends[:, 0]], axis=1)
    goal = design.rest_length[team]
    straight = np.maximum(straight, goal)  # some stay slack at their rest length
    state, share, width, steps = start, 0.0, widest, []
    while share < 1.0:
        then = 1.0 if share + width > 1.0 - 1e-12 else share + width
        lengths = now.rest_length.copy()
        lengths[team] = straight + then * (goal - straight)
        trial = replace(now, rest_length=lengths)
        assembly = site.assembly.with_parts((shell.beams(trial.radius), shell.cables(trial)))
        try:
            found = find_equilibrium(assembly, state, load, limit=_TRIAL, on_branch=True)
            reached = found.stable
        except NotConverged:
            reached = False
        if not reached:
            width *= 0.5
            if width < _SMALLEST:
                raise NotConverged(
                    f"At {share:.2f} of the stage {stage!r} the grid loses stability",
                    state=state,
                    remedy="Tighten the cables in other groups, or prop the grid.",
                )
            continue
        share, state, now = then, found.state, trial
        steps.append(_Site(shell, trial, assembly).step(stage, share, state, load))
    return now, state, steps


def _teams(design: Design, groups: Sequence[ArrayLike] | None) -> list[Indices]:
    """Present cables group by group, checked to be all of them once."""
    present = np.flatnonzero(design.present)
    if groups is None:
        return [present] if len(present) else []
    teams = [
        indices(f"groups[{k}]", each, (None,), below=len(design.present)) for k, each in enumerate(groups)
    ]
    together = np.concatenate([np.zeros(0, dtype=np.int64), *teams])
    if not np.array_equal(np.sort(together), present):
        raise InputError(
            "must hold every cable of the design once",
            where="groups",
            value=len(together),
            remedy=f"There are {len(present)} cables.",
        )
    return teams
