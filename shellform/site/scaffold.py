"""A grid raised by a scaffold, as Mannheim's was by towers that were pushed up (Happold and Liddell 1975):
how shells with edge beams go up, and another way for those that stand on the ground.

    raising         the flat grid lies on props under every second crossing, which rise, and its rods' ends
                    with them. At the share s of the way the net between the layers is at s of its height on
                    the target; in plan all move as they like, but for soft ropes that lead the ends to where
                    bent rods bring them: s² of the way from their places in the flat grid to their seats
    drawing in      firmer ropes draw the ends to their seats
    pinning         the ends are pinned there, to the ground or to edge beams on props of their own
    clamping        the ends are turned to where they lie on the target, and clamped to the edge beams
    lowering        the scaffold goes
    striking props  the edge beams' props go

The net of which all heights are a share of the target's is nearly the target's own, less bent, and the grid
finds it by itself where nothing holds it in plan; along given lines its ends don't let it. Rods lie beside
the net along its normal: were they at a share of their own heights, one layer would bend the other, and the
more the narrower the grid. Where the target is steep, rods of less height are bent more at its foot: props
stand where it is less steep than 60°.

Where firmer supports take over, the forces of those that go are put on as dead loads and taken away bit by
bit; so too where the scaffold and the beams' props go. Where that isn't stable, these are let down to where
the shell stands without them. As in erection.py the way up to the pinned grid, which is found next to the
target, is gone backwards: stable equilibria are the same both ways.
"""

from __future__ import annotations

import copy
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Flags, Indices, Reals, indices
from shellform.errors import InputError, NotConverged
from shellform.gridshell.edge_beams import CLAMP, EDGE
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import span_of
from shellform.site.erection_steps import SMALLEST, ErectionStep, Holding, Site, laid_out
from shellform.structure.elements import rotation
from shellform.structure.elements.ropes import Ropes
from shellform.structure.elements.state import State, motion
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import Equilibrium, find_equilibrium
from shellform.structure.solve.loading import advance

# Ropes that draw ends: of 12 EI/l³, with which a rod's segment resists its end's moving aside. Ropes that
# lead them: of 12 EI/(l L²), L the shell's extent, so that off their lines by a share of L they bend the
# segment by a share of what bends rods to the shell, however narrow the grid.
_FIRM, _SOFT = 1.0, 10.0
_PIECES = 10  # of raising, at least: on each the ropes' anchors move straight
_SLIGHT = 1e-6  # of the force that bends a segment by its own length
_ALIKE = 1e-6  # of the shell's extent, by which two paths to one state differ
_ONTO = "No stable path leads from the flat grid onto the scaffold and to its ends' places"
_STEEPEST = 0.5  # cosine of the slope of the surface over a prop


def _propped(shell: Gridshell, props: ArrayLike | None) -> Indices:
    """Nodes that the scaffold bears: of every second crossing, as on a chessboard, where the target isn't
    steep, or of crossings and other nodes of rods that `props` names; of crossings the lower rod's. Raises
    InputError for other nodes.
    """
    grid = shell.net.grid
    lower, upper = grid.crossing_nodes.T
    if props is None:
        second = grid.lattice.sum(axis=1) % 2 == 0
        return np.asarray(lower[second & (_upright(shell, lower) >= _STEEPEST)])
    given = indices("props", props, (None,), below=grid.node_count)
    under = np.arange(grid.node_count)
    under[upper] = lower
    nodes: Indices = np.unique(under[given])
    aside = nodes[~np.isin(nodes, grid.rod_ends)]
    if len(aside):
        raise InputError(
            "is no node of a rod",
            where="props",
            value=int(aside[0]),
            remedy="Name crossings, or nodes of rods: edge beams have props of their own.",
        )
    return nodes


def _upright(shell: Gridshell, nodes: Indices) -> Reals:
    """The cosine (k,) of the target's slope at rods' nodes."""
    return np.asarray(rotation.matrices(shell.target.quaternions[nodes])[:, 2, 2])


class Scaffold:
    """A scaffold that bears nodes of a shell under the dead load `weight` (n, 6), N: those of `props`.

    Without its cables the shell is the design `unbraced`; steps are at most `step`, a share of a stage.
    """

    def __init__(
        self, shell: Gridshell, unbraced: Design, weight: Reals, props: ArrayLike | None, step: float
    ) -> None:
        self.shell, self.unbraced, self.weight, self.step = shell, unbraced, weight, step
        self.props = _propped(shell, props)
        net = shell.net
        on_rods = np.zeros(shell.node_count, dtype=bool)
        on_rods[net.grid.rod_ends] = True
        self.on_rods: Indices = np.flatnonzero(on_rods)
        self.on_beams: Indices = np.flatnonzero(~on_rods)
        self.clamped: Indices = np.array(
            [end for line in net.edges for end in line.clamps[:, 1]], dtype=np.int64
        )
        self.seats: Indices = np.union1d(net.supports[on_rods[net.supports]], self.clamped)
        self.places = shell.target.positions[self.seats]
        self.ground = float(shell.target.positions[:, 2].min())
        own = shell.beams(unbraced.radius)
        self.rods = own.chosen(np.flatnonzero(~(own.of_kind(EDGE) | own.of_kind(CLAMP))))
        bending = min(shell.rod.resized(unbraced.radius).stiffness.bending)
        resistance = 12.0 * bending / net.grid.scale**3
        self.firm, self.soft = _FIRM * resistance, _SOFT * resistance * (net.grid.scale / span_of(shell)) ** 2
        self.slight = _SLIGHT * resistance * net.grid.scale

    def under(self, shell: Gridshell) -> Scaffold:
        """The same scaffold under the shell as it is once something has been built into it."""
        other = copy.copy(self)
        other.shell = shell
        return other

    def up(self) -> list[ErectionStep]:
        """Steps from the flat grid to the one that lies on the scaffold with its ends in place. Raises
        NotConverged where no stable path leads there.
        """
        pinned = self._pinned()
        below, above = list[ErectionStep](), list[ErectionStep]()
        firm, soft = self._roped(self.firm, drawn=False), self._roped(self.soft, drawn=True)
        state = self._passed(firm, "pinning", pinned, self._handed(firm, pinned), (1.0, 0.0), below)
        state = self._passed(soft, "drawing in", state, self._handed(soft, state), (1.0, 0.0), below)
        self._flattened(soft, state, below)
        if len(self.on_beams):
            turned = np.zeros_like(self._pins())
            turned[self.clamped, 3:] = True
            turning, there = self._held(self._pins() | turned), self.site(self.unbraced)
            drive = self._eased(pinned, self.shell.target, turned)
            state = self._passed(turning, "clamping", pinned, drive, (0.0, 0.5), above)
            self._passed(there, "clamping", state, self._handed(there, state), (0.5, 1.0), above)
        return below[::-1] + above

    def site(self, design: Design) -> Site:
        """The shell with the design's cables on the scaffold, its ends in place."""
        return self._with_cables(design, self._fixed(props=True, beams=True), self.props)

    def standing(self, design: Design) -> Site:
        """The same without scaffold and props."""
        return self._with_cables(design, self._fixed(props=False, beams=False), None)

    def taken_away(self, design: Design, state: State, *, braced_later: bool) -> list[ErectionStep]:
        """Steps from a state of `site` to the one in which the design's shell stands by itself; cables may be
        `braced_later`. Raises NotConverged where it doesn't stand.
        """
        held, on_beams = self.site(design), self._fixed(props=False, beams=True)
        lowered = self._with_cables(design, on_beams, self.props)
        lost = ("The grid loses stability as what holds it goes", self._standing_better(braced_later))
        steps = self._let_down("lowering", state, held, lowered, lost)
        if len(self.on_beams):
            held = self._with_cables(design, on_beams, None)
            steps += self._let_down("striking props", steps[-1].state, held, self.standing(design), lost)
        return steps

    def _standing_better(self, braced_later: bool) -> str:
        """What to do where the shell doesn't stand by itself."""
        ways = ["Tighten the cables first (--tighten-first)"] if braced_later else []
        return self._or_lighter(*ways) or "Choose stiffer rods."

    def _or_lighter(self, *ways: str) -> str:
        """These ways to go on, and a smaller weight where there is one."""
        every = [*ways, *(["give a smaller weight"] if self.weight.any() else [])]
        return f"{', or '.join(every)}.".capitalize() if every else ""

    def _let_down(
        self, stage: str, state: State, held: Site, freed: Site, lost: tuple[str, str]
    ) -> list[ErectionStep]:
        """Steps from the state that is `held` to the one that is `freed`: the forces that go fall in
        proportion, which bends rods little, or where that isn't stable the places do, to where nothing is
        borne there. Raises NotConverged with what is `lost` and what to do."""
        steps = list[ErectionStep]()
        try:
            self._passed(freed, stage, state, self._handed(freed, state), (0.0, 1.0), steps, lost)
        except NotConverged:
            steps = []
            goal = self._standing(freed.assembly, lost)
            moved = np.zeros(self.weight.size, dtype=bool)
            moved[np.setdiff1d(freed.assembly.free, held.assembly.free)] = True
            drive = self._eased(state, goal, moved.reshape(self.weight.shape))
            reached = self._passed(held, stage, state, drive, (0.0, 1.0), steps, lost).positions
            if np.abs(reached - goal.positions).max() > _ALIKE * np.ptp(reached, axis=0).max():
                raise NotConverged(f"{lost[0]}, in {stage!r}", state=state, remedy=lost[1]) from None
        return steps

    def _standing(self, freed: Assembly, lost: tuple[str, str]) -> State:
        """The shell when what held it has gone: next to the target, then under the weight."""
        none = np.zeros_like(self.weight)
        found = find_equilibrium(freed, self.shell.target, none)
        if not found.stable:
            raise NotConverged(f"{lost[0]}: it doesn't stand by itself", state=found.state, remedy=lost[1])
        loaded = advance(freed, found.state, Drive(self.weight, none, none), stay=True, heeding=True)
        if not loaded.on_branch:
            raise NotConverged(
                f"{lost[0]}: it bears {loaded.share:.2f} of the weight by itself",
                state=found.state,
                remedy=lost[1],
            )
        return loaded.equilibrium.state

    def _fixed(self, *, props: bool, beams: bool) -> Flags:
        """Degrees of freedom (n, 6) that the ground holds, that the scaffold and props of edge beams hold."""
        fixed = np.zeros((self.shell.node_count, 6), dtype=bool)
        fixed[self.shell.net.supports, :3] = True
        if props:
            fixed[self.props, 2] = True
        if beams:
            fixed[self.on_beams] = True
        return fixed

    def _pins(self) -> Flags:
        """The same (n, 6) with all ends pinned."""
        fixed = self._fixed(props=True, beams=True)
        fixed[self.seats, :3] = True
        return fixed

    def _held(self, fixed: Flags) -> Site:
        """The grid before it has cables, its ends pinned."""
        network = replace(self.shell.network(self.unbraced), beams=self.rods, fixed=fixed)
        borne = np.union1d(self.seats, self.shell.net.supports)
        holding = Holding(self.ground, borne, self.props, self.slight)
        return Site(self.shell, self.unbraced, assemble(network), holding)

    def _with_cables(self, design: Design, fixed: Flags, props: Indices | None) -> Site:
        """The shell with all that is built into it."""
        network = replace(self.shell.network(design), fixed=fixed)
        borne = np.union1d(self.on_beams, self.shell.net.supports)
        holding = Holding(self.ground, borne, props, self.slight)
        return Site(self.shell, design, assemble(network), holding)

    def _roped(self, stiffness: float, *, drawn: bool) -> Site:
        """The grid on the scaffold, its ends drawn by ropes of that stiffness, N/m."""
        fixed = self._pins()
        fixed[self.seats, :2] = False
        ropes = Ropes(self.seats, self.places[:, :2], stiffness)
        holding = Holding(self.ground, self.seats, self.props, self.slight, ropes, drawn)
        return Site(self.shell, self.unbraced, Assembly(len(fixed), (self.rods, ropes), fixed), holding)

    def _pinned(self) -> State:
        """The grid on the scaffold with its ends pinned to their seats, next to the target."""
        there = self._held(self._pins()).assembly
        try:
            return find_equilibrium(there, self.shell.target, self.weight).state
        except NotConverged as error:
            raise NotConverged(
                "The grid doesn't lie still on its scaffold",
                state=error.state,
                remedy=self._or_lighter("Prop more crossings"),
            ) from error

    def _flattened(self, soft: Site, state: State, steps: list[ErectionStep]) -> None:
        """The way from the grid at its full height, led by `soft` ropes, to the flat one."""
        flat = laid_out(self.shell, self.seats).positions
        lifted = np.union1d(self.props, self.seats)
        back = (flat[self.seats] - self.places)[:, :2]
        assert soft.holding is not None
        assert soft.holding.ropes is not None
        stiffness = soft.holding.ropes.stiffness

        def led(share: float) -> Reals:
            """Dead loads (n, 6) that bring the ropes' anchors to where they are at that share of raising."""
            load = np.zeros_like(self.weight)
            load[self.seats, :2] = stiffness * (1.0 - share**2) * back
            return load

        pieces = max(_PIECES, round(1.0 / self.step))
        for k in range(pieces, 0, -1):
            shares = k / pieces, (k - 1) / pieces
            here, there = led(shares[0]), led(shares[1])
            down = np.zeros_like(self.weight)
            down[lifted, 2] = self._heights(lifted, shares[1]) - state.positions[lifted, 2]
            drive = Drive(there - here, down, self.weight + here)
            state = self._passed(soft, "raising", state, drive, shares, steps, widest=1.0)

    def _heights(self, nodes: Indices, share: float) -> Reals:
        """Heights (k,), m, of rods' nodes at that share of raising: of the net between the layers that share,
        and of the rods' distances from it what is upright where the sine of its slope is that share of the
        target's, or where it overhangs the slope itself. At 0 the grid lies on the ground.
        """
        grid, upright = self.shell.net.grid, _upright(self.shell, nodes)
        aside, middle = grid.layer[nodes], self.ground + 0.5 * grid.gap
        net = self.shell.target.positions[nodes, 2] - aside * upright
        now = np.where(
            upright >= 0.0,
            np.sqrt(1.0 - share**2 * (1.0 - upright**2)),
            np.cos(share * np.arccos(np.clip(upright, -1.0, 1.0))),
        )
        return np.asarray(middle + share * (net - middle) + aside * now)

    def _eased(self, state: State, goal: State, moved: Flags) -> Drive:
        """Degrees of freedom (n, 6) that are held moved to where they are in another state."""
        way = motion(state, goal)
        return Drive(np.zeros_like(way), np.where(moved, way, 0.0), self.weight)

    def _handed(self, site: Site, state: State) -> Drive:
        """What held the state where nothing holds it any more, as a dead load that goes."""
        held = site.assembly.unbalanced(state, self.weight)
        gone = site.assembly.by_node(held.ravel()[site.assembly.free])
        return Drive(-gone, np.zeros_like(gone), self.weight + gone)

    def _passed(
        self,
        site: Site,
        stage: str,
        state: State,
        drive: Drive,
        shares: tuple[float, float],
        steps: list[ErectionStep],
        lost: tuple[str, str] | None = None,
        widest: float | None = None,
    ) -> State:
        """The state at the end of the drive, from one share of the stage to another; its steps are added.
        Raises NotConverged where its branch ends, with what is `lost` and what to do (None: the way up).
        """
        first, last = shares

        def note(share: float, found: Equilibrium) -> None:
            steps.append(site.step(stage, first + share * (last - first), found.state, self.weight))

        if not steps or steps[-1].stage != stage:
            steps.append(site.step(stage, first, state, self.weight))
        width = self.step if widest is None else widest
        reached = advance(
            site.assembly, state, drive, step=width, smallest=SMALLEST, stay=True, heeding=True, report=note
        )
        if not reached.on_branch:
            what, remedy = lost or (_ONTO, self._or_lighter("Prop other crossings"))
            raise NotConverged(
                f"{what}, at {first + reached.share * (last - first):.2f} of the stage {stage!r}",
                state=reached.equilibrium.state,
                remedy=remedy,
            )
        return reached.equilibrium.state
