"""Steps of an erection: what is read off each state on the way, and where the flat grid is laid out."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Indices, Reals, Record
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import rod_stress
from shellform.structure.elements import rotation
from shellform.structure.elements.ropes import Ropes
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.tables import Table, Value, table_text

SMALLEST = 1.0 / 256.0  # of a stage: where no longer step leads on, nothing stands
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
_PROPS = (
    "largest push of the scaffold [N]",
    "largest pull of the scaffold [N]",
    "crossings held down",
    "largest force of a rope [N]",
)


@dataclass(frozen=True, eq=False)
class ErectionStep:
    """One state on the way: the `stage` it belongs to and the `share` of it that is done; `height`, m, of the
    highest node over the lowest support (of a grid that a scaffold raises, of its rods over the ground); the
    largest rod `stress`, Pa, and the `element` that bears it; the largest cable `tension`, N; the largest
    `reaction`, N, of a support; `state`; what the scaffold bears (`props`; None: there is none)."""

    stage: str
    share: float
    height: float
    stress: float
    element: int
    tension: float
    reaction: float
    state: State
    props: Props | None = None


@dataclass(frozen=True)
class Props:
    """What a scaffold bears of a grid, N: the largest `push` upwards on a crossing, and the largest `pull`
    with which it holds one down, which it does with `pulled` of them; the largest force of a `rope` that
    draws a rod's end in."""

    push: float
    pull: float
    pulled: int
    rope: float


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
        """The largest stress on the way over the strength; 0 where that isn't known."""
        return self.worst.stress / self.strength

    @property
    def props(self) -> Props | None:
        """The largest of each that a scaffold bears on the way; None where there is none."""
        borne = [each.props for each in self.steps if each.props is not None]
        if not borne:
            return None
        return Props(
            max(each.push for each in borne),
            max(each.pull for each in borne),
            max(each.pulled for each in borne),
            max(each.rope for each in borne),
        )

    def table(self) -> str:
        """Step after step as CSV."""
        scaffold = self.props is not None
        rows = tuple(
            (
                each.stage,
                f"{each.share:.3f}",
                f"{1e3 * each.height:.2f}",
                f"{1e-6 * each.stress:.2f}",
                None if math.isinf(self.strength) else f"{each.stress / self.strength:.3f}",
                each.element,
                f"{each.tension:.3f}",
                f"{each.reaction:.3f}",
                *(_borne(each.props) if scaffold else ()),
            )
            for each in self.steps
        )
        return table_text(Table("erection", (*_COLUMNS, *(_PROPS if scaffold else ())), rows))


def _borne(props: Props | None) -> tuple[Value, ...]:
    """The cells of what a scaffold bears, empty where there is none."""
    if props is None:
        return (None,) * len(_PROPS)
    return f"{props.push:.3f}", f"{props.pull:.3f}", props.pulled, f"{props.rope:.3f}"


def laid_out(shell: Gridshell, held: Indices | None = None) -> State:
    """The flat, stress-free grid, turned and shifted so that its supports, or the nodes `held` (k,), come
    nearest to their places in plan, at their mean height.
    """
    flat, supports = shell.net.grid.flat, shell.net.supports if held is None else held
    here, goal = flat[supports], shell.target.positions[supports]
    middle, there = here.mean(axis=0), goal.mean(axis=0)
    angle = turn_in_plan((here - middle)[:, :2], (goal - there)[:, :2])
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    quaternions = rotation.from_vectors(np.tile([0.0, 0.0, angle], (len(flat), 1)))
    return State((flat - middle) @ turn.T + there, quaternions)


def turn_in_plan(plan: Reals, wanted: Reals) -> float:
    """The angle, rad, anticlockwise, by which plan points (k, 2) about their middle come nearest to those
    `wanted`, by the sum of squares: that of the sum of conj(plan) * wanted as complex numbers."""
    cosine = float((plan * wanted).sum())
    sine = float((plan[:, 0] * wanted[:, 1] - plan[:, 1] * wanted[:, 0]).sum())
    return float(np.arctan2(sine, cosine))


@dataclass(frozen=True, eq=False)
class Holding(Record):
    """What holds a grid that a scaffold raises: the level of the `ground`, m; nodes that are `borne` by
    supports, or by props of edge beams; nodes on the scaffold's `props` (None: it is gone), where less than
    `slight`, N, is nothing; `ropes` on rods' ends, which are `drawn` by these alone, or pinned by now."""

    ground: float
    borne: Indices
    props: Indices | None
    slight: float
    ropes: Ropes | None = None
    drawn: bool = False

    def told(self, forces: Reals, state: State) -> tuple[float, Props | None]:
        """The largest reaction, N, and what the scaffold bears, where `forces` (n, 3), N, hold the grid."""
        rope = 0.0
        if self.ropes is not None:
            ends = self.ropes.nodes
            forces[ends, :2] -= self.ropes.force(state)  # of what the anchors bear
            if self.drawn:
                rope = float(np.linalg.norm(forces[ends, :2], axis=1).max())
                forces[ends, :2] = 0.0
        reaction = float(np.linalg.norm(forces[self.borne], axis=1).max())
        if self.props is None:
            return reaction, None
        upwards = forces[self.props, 2]
        push, pull = (max(float(each.max(initial=0.0)), 0.0) for each in (upwards, -upwards))
        return reaction, Props(push, pull, int(np.count_nonzero(upwards < -self.slight)), rope)


class Site:
    """The shell with a design's cables and what holds it on its way up (None: its supports), and what is read
    off its states."""

    def __init__(
        self,
        shell: Gridshell,
        design: Design,
        assembly: Assembly | None = None,
        holding: Holding | None = None,
    ) -> None:
        self.shell, self.design, self.holding = shell, design, holding
        self.assembly = assemble(shell.network(design)) if assembly is None else assembly
        self.section = shell.rod.resized(design.radius).section

    def beside(self, design: Design, assembly: Assembly) -> Site:
        """Another design's, held alike."""
        return Site(self.shell, design, assembly, self.holding)

    def step(self, stage: str, share: float, state: State, load: Reals) -> ErectionStep:
        """The state as a step."""
        beams, cables = self.assembly.beams[0], self.shell.cables(self.design)
        stress = rod_stress(self.section, beams, beams.local_forces(state)).max(axis=1)
        worst = int(np.argmax(stress))
        tension = float(cables.tension(state).max(initial=0.0))
        supports, props = self.shell.net.supports, None
        forces = self.assembly.unbalanced(state, load)[:, :3]
        if self.holding is None:
            top, ground = state.positions[:, 2].max(), state.positions[supports, 2].min()
            reaction = float(np.linalg.norm(forces[supports], axis=1).max())
        else:
            rods = self.shell.net.grid.rod_ends
            top, ground = state.positions[rods, 2].max(), self.holding.ground
            reaction, props = self.holding.told(forces, state)
        return ErectionStep(
            stage=stage,
            share=float(share),
            height=float(top - ground),
            stress=float(stress[worst]),
            element=worst,
            tension=tension,
            reaction=reaction,
            state=state,
            props=props,
        )
