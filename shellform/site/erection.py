"""Erection: from the grid laid flat to the braced shell, step by step, with what the rods bear on the way.

The flat grid is laid out where it fits its supports best (turned and shifted in plan, which doesn't stress
it). Then a scaffold raises it (scaffold.py), or the supports move to their places on the target, straight or
by way points; the cables, slack so far, are tightened, all at once or group after group, from the length at
which they just hang straight to their rest lengths; then a load may follow.

A flat grid whose supports close in can buckle up, down and in waves: its stable paths all begin in one point.
The path that leads to the erected shell is found from its other end: the structure is elastic, so that its
stable equilibria are the same both ways, and the erected grid is a known one. It is therefore taken down, the
supports moving back (loading.py), and the steps are put in reverse. A `lift` (a crane, a tower) acts from
before the supports move until they have arrived. Stresses are those of equation σ = |N|/A + |M| r/I at both
ends of every rod element.

Rods in two layers slide until they are locked as they lie: on the scaffold, next to the target, before it
goes and before cables are tight, which is how designs take them to be locked; where supports move in, once
the cables are tight, since nothing else holds the grid near its shape: that is another shell than was
designed. The load follows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Indices, Reals, indices, reals
from shellform.errors import InputError, NotConverged, require_known, require_number
from shellform.gridshell.gridshell import Design, Gridshell, Rod
from shellform.gridshell.layers import TwoLayers
from shellform.site.erection_steps import SMALLEST, Erection, ErectionStep, Site, laid_out
from shellform.site.scaffold import Scaffold
from shellform.structure.elements.state import State
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.loading import advance

SUPPORTS, SCAFFOLD = WAYS_UP = ("supports", "scaffold")
STEP = 0.1  # of a stage
_SLACK = 1.5  # times its length in the target: a cable that isn't tightened yet
_LEAST = 1e-4  # of a stage, which then has ten thousand steps
_TRIAL = 25  # factorisations of one step of tightening


def erect(
    shell: Gridshell,
    design: Design,
    *,
    by: str | None = None,
    props: ArrayLike | None = None,
    tighten_first: bool = False,
    way: Sequence[ArrayLike] = (),
    groups: Sequence[ArrayLike] | None = None,
    lift: Reals | None = None,
    weight: Reals | None = None,
    load: Reals | None = None,
    step: float = STEP,
) -> Erection:
    """The erection of the shell with the design's cables.

    - `by`: what brings the grid up, "supports" that move in or a "scaffold" (scaffold.py); None: the
      usual one (`usual_way_up`).
    - Of a scaffold, `props`: nodes of the crossings that it bears (None: every second one);
      `tighten_first`: the cables are tightened before it goes.
    - Of supports, `way`: their positions (s, 3), m, between the flat grid and the target, in the order of
      building; `lift`, a dead load (n, 6), N, while they move.
    - `groups`: candidate cables tightened together, group after group (all at once); dead loads (n, 6), N:
      `weight` all the time, `load` in the end.

    Raises InputError, and NotConverged where no stable path leads from the flat grid to the erected one, or
    tightening or the load ends it.
    """
    require_number(step, least=_LEAST, most=1.0, where="erect.step", give="a share of the way, such as 0.1")
    moving = [name for name, given in (("way", len(way) > 0), ("lift", lift is not None)) if given]
    propped = [
        name for name, given in (("props", props is not None), ("tighten_first", tighten_first)) if given
    ]
    by = _way_up(shell, by, moving=moving, propped=propped)
    nodes = shell.node_count
    none = np.zeros((nodes, 6))
    own, carried, last = (
        none if each is None else reals(name, each, (nodes, 6))
        for name, each in (("weight", weight), ("lift", lift), ("load", load))
    )
    teams = _teams(design, groups)
    locked, shell = shell, _sliding(shell)
    unbraced = design.unbraced()
    now = replace(design, rest_length=np.maximum(_SLACK * shell.cable_lengths, design.rest_length))
    scaffold = Scaffold(shell, unbraced, own, props, step) if by == SCAFFOLD else None
    if scaffold is None:
        site, braced = Site(shell, unbraced), Site(shell, now)
        state = _erected(site, own)
        steps = _taken_down(site, state, way, carried, own, step)
    else:
        steps = scaffold.up()
        scaffold = scaffold.under(locked.locked_in(steps[-1].state))
        braced = scaffold.site(now) if tighten_first else scaffold.standing(now)
        if not tighten_first:
            steps += scaffold.taken_away(unbraced, steps[-1].state, braced_later=len(teams) > 0)
        state = steps[-1].state
    for number, team in enumerate(teams, 1):
        stage = "tightening" if len(teams) == 1 else f"tightening group {number}"
        now, state, more = _tightened(braced, now, design, state, team, own, stage, step)
        steps += more
    if scaffold is not None and tighten_first:
        steps += scaffold.taken_away(now, state, braced_later=False)
        state = steps[-1].state
    if last.any():
        whole = Site(locked.locked_in(state), now) if scaffold is None else scaffold.standing(now)
        steps += _loaded(whole, state, own, last, step)
    return Erection(tuple(steps), shell.rod.strength)


def usual_way_up(shell: Gridshell) -> str:
    """What brings such a shell up: a scaffold where there are edge beams or rods in two layers, else
    supports that move in."""
    two = isinstance(shell.rod.section, TwoLayers)
    return SCAFFOLD if len(shell.net.edges) or two else SUPPORTS


def _loaded(site: Site, state: State, weight: Reals, load: Reals, step: float) -> list[ErectionStep]:
    """The load coming on."""
    steps = list[ErectionStep]()

    def note(share: float, found: Equilibrium) -> None:
        steps.append(site.step("loading", share, found.state, weight + share * load))

    drive = Drive(load, np.zeros_like(load), weight)
    reached = advance(site.assembly, state, drive, step=step, stay=True, heeding=True, report=note)
    if not reached.on_branch:
        raise NotConverged(
            f"The shell bears {reached.share:.2f} of the load only",
            state=reached.equilibrium.state,
            remedy="Brace it better or load it less.",
        )
    return steps


def _way_up(shell: Gridshell, by: str | None, *, moving: Sequence[str], propped: Sequence[str]) -> str:
    """The way that the grid goes up, where what is given goes with supports that move (`moving`) or with a
    scaffold (`propped`). Raises InputError for what doesn't go with it."""
    edges = len(shell.net.edges)
    usual = SUPPORTS if moving and not edges else usual_way_up(shell)
    way = (SCAFFOLD if propped else usual) if by is None else by
    require_known(way, WAYS_UP, where="erect.by", what="is no way up")
    if way == SUPPORTS and edges:
        raise InputError(
            "doesn't bring up a shell with edge beams, whose rods' ends would break on straight ways there",
            where="erect.by",
            value=way,
            remedy="Erect it by a scaffold.",
        )
    if way == SCAFFOLD and moving:
        raise InputError(
            "goes with supports that move in",
            where="erect",
            value=", ".join(moving),
            remedy="Leave it out." if edges or propped else "Leave it out, or erect by supports.",
        )
    if way == SUPPORTS and propped:
        raise InputError(
            "goes with a scaffold",
            where="erect",
            value=", ".join(propped),
            remedy="Leave it out." if moving else "Leave it out, or erect by a scaffold.",
        )
    return way


def _erected(site: Site, weight: Reals) -> State:
    """The grid that stands by itself without cables."""
    try:
        return find_equilibrium(site.assembly, site.shell.target, weight).state
    except NotConverged as error:
        raise NotConverged(
            "The erected grid doesn't stand under the weight before it is braced",
            state=error.state,
            remedy="Give a smaller weight, N, downwards negative.",
        ) from error


def _sliding(shell: Gridshell) -> Gridshell:
    """The shell before blocks lock its rods, if they have two layers."""
    section = shell.rod.section
    if not isinstance(section, TwoLayers):
        return shell
    return replace(shell, rod=Rod(replace(section, composite=0.0)))


def _taken_down(
    site: Site, erected: State, way: Sequence[ArrayLike], lift: Reals, weight: Reals, step: float
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
        # It isn't heeded what steps may pass over: at the flat grid all stable paths meet.
        reached = advance(site.assembly, state, drive, step=step, smallest=SMALLEST, stay=True, report=note)
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
    site: Site,
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
            if width < SMALLEST:
                first = " or before a scaffold goes (--by scaffold --tighten-first)"
                held = site.holding is not None and site.holding.props is not None
                raise NotConverged(
                    f"At {share:.2f} of the stage {stage!r} the grid loses stability",
                    state=state,
                    remedy=f"Tighten the cables in other groups{'' if held else first}.",
                )
            continue
        share, state, now = then, found.state, trial
        steps.append(site.beside(trial, assembly).step(stage, share, state, load))
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
    count = np.bincount(together, minlength=len(design.present))
    off = np.flatnonzero(count != design.present)
    if len(off):
        times = int(count[off[0]])
        raise InputError(
            "must hold every cable of the design once"
            if design.present[off[0]]
            else "holds a candidate that is no cable of the design",
            where="groups",
            value=f"{_called(off[0], present)} {'in none' if times == 0 else f'{times} times'}",
            remedy=f"Give each of the {len(present)} cables one row, with the group in which it is tightened.",
        )
    return teams


def _called(candidate: int, present: Indices) -> str:
    """A cable's name in the drawings, where it is one of the `present` ones."""
    at = np.flatnonzero(present == candidate)
    return f"C{at[0]}" if len(at) else f"candidate {candidate}"
