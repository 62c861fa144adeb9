"""One design on the way to what `shellform new` proposes, solved under its growing load and drawn as built.

Two elements a segment are enough for that: they change critical factors by half a percent. Structures are
drawn with errors of building a quarter larger than they are to be expected: few of them then refuse what else
more would be needed for (requirements.py). How far a shell is off as built is that of the structures, with
usual errors, which `design` draws of its initial design.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Reals, Record
from shellform.case.build_problem import edge_utilisation
from shellform.case.safety_entries import SafetyEntry
from shellform.errors import NotConverged
from shellform.gridshell.edge_beams import EdgeBeam, weight
from shellform.gridshell.gridshell import Cable, Gridshell, Joint, Rod, brace
from shellform.gridshell.joints import following, swivelling
from shellform.gridshell.loads import concrete, rods
from shellform.gridshell.tolerances import default_tolerances, enlarged
from shellform.net.net import Net
from shellform.problem.paths import deviations
from shellform.records.raising import WayUpRecord
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop
from shellform.run.first_edges import EdgeChoice
from shellform.run.sampling import LOOKED_AT
from shellform.run.sizes import LEAST_PRESTRAIN, STRAINED, Placed, RodChoice, Rope, thicker
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import apply_load
from shellform.surface.shape.target import Surface

ELEMENTS = 2  # a segment
NEEDED = 1.5  # times the design load, which the perfect structure bears: drawn ones fall earlier
ADDITIONAL = 1.2  # times the load: the case "additional", a share of whose path the design load then is
DRAWN, SEED, ENLARGED = 40, 1, 1.5  # structures, their seed, and how much larger their errors are
_SEED = SafetyEntry.model_validate({}).seed  # under which a case that says nothing else is judged
STRESSED = 0.95  # of the strength, at the most, under the additional load
PULLED = 0.85  # of the cables' limit, at the most: a search that begins beyond it takes no cables away
_RELIEVED = 1.5  # with which power of the force in excess a section has to grow: stiffer strands bear more of the load
_SMALLEST = 1.0 / 16.0  # of the load, by which a path is followed here
_TOGETHER = 2  # structures drawn, until one falls: what falls takes ten times as long as what stands
_SETTLED = 1e-3  # residual: rods too thin for the load are not solved with twice the digits to be told so
_UNLOADED = 120  # factorisations of the unloaded shell; one that stands without load takes five to thirty


@dataclass(frozen=True)
class FirstParts:
    """What a first design is made of: the `choice` of rods, what edge beams are (`edge`), the
    cables' `rest_ratio` and what `rope` they are, and whether rods turn on their joints (`swivels`)."""

    choice: RodChoice
    edge: EdgeChoice
    rest_ratio: float
    rope: Rope
    swivels: bool

    @property
    def joint(self) -> Joint:
        """With the gap that follows the rods."""
        fitting = following(Rod(self.choice.section))
        return swivelling(fitting) if self.swivels else fitting

    def easier(self, tried: Followed, most: float) -> FirstParts | None:
        """What to try after a design that bears its load, `tried`, with rods that are stressed too much or
        cables that are pulled to more than `most` of their limit: the same with slacker cables and joints
        that turn, or thicker cables; else None.

        Where the last cells end short of the edge, prestressed cables bend the rods' ends in the surface,
        load or none.
        """
        if tried.factor < NEEDED:
            return None
        if tried.stress > STRESSED:
            slacker = round(1.0 - max(0.5 * (1.0 - self.rest_ratio), LEAST_PRESTRAIN), 4)
            eased = replace(self, rest_ratio=max(slacker, self.rest_ratio), swivels=True)
            return None if eased == self else eased
        return self.eased(tried.pull) if tried.edge <= STRESSED and tried.pull > most else None

    def stronger(self, tried: Followed) -> FirstParts | None:
        """What to try after a design that bears its load, `tried`, with rods that are stressed too much and
        cables beyond their limit: the same with strands that bear what pulls these. Where soft ones let the
        shell move, that is what breaks both. Else None."""
        if tried.factor < NEEDED or tried.stress <= STRESSED or tried.pull <= 1.0:
            return None
        rope = thicker(self.rope, (tried.pull / PULLED) ** _RELIEVED)
        return None if rope is None else replace(self, rope=rope)

    def eased(self, pull: float) -> FirstParts | None:
        """The same with so much less prestrain that cables whose largest force is `pull` times their limit
        come down to `PULLED`; with the next thicker strand where they have the least already; None where
        there is none."""
        prestrain = 1.0 - self.rest_ratio - (pull - PULLED) * STRAINED
        least = round(1.0 - max(prestrain, LEAST_PRESTRAIN), 4)
        if least > self.rest_ratio:
            return replace(self, rest_ratio=least)
        rope = thicker(self.rope)
        return None if rope is None else replace(self, rope=rope)


@dataclass(frozen=True, eq=False)
class Followed(Record):
    """What a design came to: the `factor` of its load up to which it stands; under the additional load the
    stress over the strength of its rods (`stress`), where that is (`most_stressed` (3,), m), and of its edge
    beams (`edge`), how far these are off at most (`sag`, m), how far the whole shell is (`off`, m), and the
    cables' largest force over its limit (`pull`); `where` (3,), m, the last state is farthest off; the rods'
    stress before any load (`unloaded`)."""

    factor: float
    stress: float
    edge: float
    sag: float
    off: float
    pull: float
    where: Reals
    most_stressed: Reals
    unloaded: float = 0.0

    @property
    def sag_told(self) -> str:
        """In two digits: "87 mm"."""
        return millimetres(self.sag)

    @property
    def off_told(self) -> str:
        """In two digits."""
        return millimetres(self.off)


def millimetres(length: float) -> str:
    """A `length`, m, in two digits: "87 mm"."""
    return f"{float(f'{1e3 * length:.2g}'):g} mm"


@dataclass(frozen=True, eq=False)
class FirstDesign:
    """What is proposed: `spacing`, m, and its `reason`; `placed`, the net; the `parts`; `thickness`, m, of
    the concrete; what the perfect structure came to (`tried`); of `drawn` structures `standing`; the largest
    fibre distance, m, that equation (1) allows rods of that material (`allowed`); what was `told` on the
    way; how far, m, structures as built stray (`strays`; None: not looked at); and the `ways_up` (none: not
    looked at)."""

    spacing: float
    reason: str
    placed: Placed
    parts: FirstParts
    thickness: float
    tried: Followed
    standing: int
    drawn: int
    allowed: float
    told: tuple[str, ...]
    strays: float | None = None
    ways_up: tuple[WayUpRecord, ...] = ()


def followed(net: Net, surface: Surface, parts: FirstParts, thickness: float) -> Followed:
    """The design followed up to `NEEDED` times its load."""
    shell, load = first_shell(net, surface, parts, thickness)
    design = shell.design(rest_ratio=parts.rest_ratio)
    assembly = assemble(shell.network(design))
    none = np.zeros((shell.node_count, 6))
    factor, borne, unloaded = 0.0, none, 0.0
    state, stressed = shell.target, shell.target
    try:
        state = find_equilibrium(assembly, shell.target, none, tolerance=_SETTLED, limit=_UNLOADED).state
        unloaded = float(shell.utilisation(design, state).max())
        for goal in (ADDITIONAL, NEEDED):  # the stress counts under the first
            more = goal * load
            found = apply_load(
                assembly, state, borne, more, stay=True, smallest=_SMALLEST, tolerance=_SETTLED
            )
            factor += (goal - factor) * found.share
            state, borne = found.equilibrium.state, more
            stressed = state if goal == ADDITIONAL else stressed
            if not found.on_branch:
                break
    except NotConverged as error:
        state = error.state if isinstance(error.state, State) else state
    away, beams = deviations(shell, state), shell.beams(design.radius)
    off = deviations(shell, stressed)
    stress = shell.utilisation(design, stressed)
    breaks = net.grid.rod_ends[int(np.argmax(stress))]
    return Followed(
        factor=factor,
        stress=float(stress.max()),
        edge=edge_utilisation(shell, beams, beams.local_forces(stressed)),
        sag=float(off[net.edge_lines].max(initial=0.0)),
        off=float(off.max()),
        pull=float(shell.cables(design).tension(stressed).max(initial=0.0)) / parts.rope.force_max,
        where=shell.target.positions[int(np.argmax(away))],
        most_stressed=shell.target.positions[breaks].mean(axis=0),
        unloaded=unloaded,
    )


@dataclass(frozen=True)
class FirstSample:
    """Of structures drawn until one of them fell so many were `standing`, `DRAWN` where none did; and the
    `factorisations` that they took: ten each where they bear their load with ease, hundreds where they
    hardly do."""

    standing: int
    factorisations: int

    @property
    def falls(self) -> bool:
        """Whether one of them did."""
        return self.standing < DRAWN

    @property
    def told(self) -> str:
        """In words."""
        fall = ", the next falls" if self.falls else ""
        return f"{self.standing} of {DRAWN} drawn structures stand under the additional load{fall}"


def drawn_standing(net: Net, surface: Surface, parts: FirstParts, thickness: float) -> FirstSample:
    """How many of up to `DRAWN` structures stand under the additional load, drawn few at a time."""
    shell, load = first_shell(net, surface, parts, thickness)
    nominal = perfect(shell, shell.design(rest_ratio=parts.rest_ratio), ADDITIONAL * load)
    workshop, tolerances = Workshop(nominal), enlarged(default_tolerances(shell), ENLARGED)
    standing, factorisations = 0, 0
    for first in range(0, DRAWN, _TOGETHER):
        made = workshop.load_numbers(
            tolerances, seed=SEED, numbers=range(first, min(first + _TOGETHER, DRAWN))
        )
        standing += sum(each.stands for each in made)
        factorisations += sum(each.factorisations for each in made)
        if not all(each.stands for each in made):
            break
    return FirstSample(standing, factorisations)


def straying(net: Net, surface: Surface, parts: FirstParts, thickness: float) -> float:
    """How far any node of structures as built that stand lies from where that of the perfect one does, under
    the design load, m."""
    shell, load = first_shell(net, surface, parts, thickness)
    nominal = perfect(shell, shell.design(rest_ratio=parts.rest_ratio), load)
    made = Workshop(nominal).load_numbers(default_tolerances(shell), seed=_SEED, numbers=range(LOOKED_AT))
    return max((each.far for each in made if each.stands), default=0.0)


def first_shell(net: Net, surface: Surface, parts: FirstParts, thickness: float) -> tuple[Gridshell, Reals]:
    """The gridshell and its load (n, 6), N; the joint's gap is the net's."""
    rope, section = parts.rope, parts.choice.section
    rod = Rod(section)
    joint = replace(parts.joint, gap=net.grid.gap)
    edge = EdgeBeam(parts.edge.section) if net.edges else None
    shell = brace(net, rod, joint, Cable(rope.stiffness), below=surface, edge=edge)
    own = rods(net, section)
    if edge is not None:
        own = own + weight(net, edge)
    poured = concrete(net, surface, thickness=thickness)
    return shell, poured + own
