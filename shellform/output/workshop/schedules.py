"""What is cut, tensioned and set out: the tables that go to the workshop and to the site; here in SI units,
in their files in mm and degrees.

Names are those of the drawings: rod U5 or V16 has the number 5 or 16 in net.json, crossing 37 and support S3
too; cable C12 is number 12 in the model file of the design. All places are those of the rods' axes; a
crossing lies in the middle between its two rods.

**Rods.** Marks are distances of the crossings from the rod's first end along the straight rod.

**Cables.** A cable is made with its rest length, between the pins' axes with nothing pulling on it. Where it
is measured on site it is taut: the clear length between its pins at a load is that of the loaded state, and
its force N = EA (l - l⁰) / l⁰. Load "none" is the erected grid before the pour. The turnbuckle has to reach
from the length at which the cable is hung in without force, that between its pins in the grid before bracing,
to the rest length, and `RESERVE` beyond both for what a survey asks for.

Where the turnbuckles' range of adjustment is given, cables are cut to the fewest lengths that it allows
(grouping.py): with the turnbuckle closed a cable has its cut length, and it is let out to its rest length.

**Order of tensioning.** Round after round from the supports to the crown: a cable's round is the number of
segments from its ends to the nearest rod end along the rods, the smaller of both. The grid is held at its
feet and the curvature is set there first, so that each round pulls against a part that is braced already, and
the crown, the softest part, stays free to settle until the end. Within a round the cables stand in the order
in which they go round the plan, and are best tightened on opposite sides at a time. On the optimised vault no
round loses stability (erection.py), and no cable pulls more than 5.0 N on the way to 4.6 N.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError, how_many, require_number
from shellform.gridshell.catalogue import label
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.grouping import cut_lengths
from shellform.gridshell.layers import layers_of
from shellform.net.grid import Grid, rod_names
from shellform.output.workshop.block_schedule import block_table
from shellform.output.workshop.cable_forces import force_notes, tightening_notes
from shellform.output.workshop.directions import away, fixing_note, turning_note
from shellform.output.workshop.edge_schedule import bundled_note, edge_table
from shellform.output.workshop.nesting import Cutting
from shellform.output.workshop.splice_schedule import cutting_notes, lath_names, splice_table
from shellform.output.workshop.turnbuckles import cutting_note, turnbuckle_notes
from shellform.quantities import newtons
from shellform.reliability.adjusting import RESERVE
from shellform.structure.elements.sections import mass_per_length
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.tables import Table, for_the_workshop, write_tables


@dataclass(frozen=True)
class TitleBlock:
    """Who stands for a drawing: its `date` (2026-05-31), `revision` and `author`; "" leaves one out."""

    date: str = ""
    revision: str = ""
    author: str = ""


@dataclass(frozen=True, eq=False)
class Built(Record):
    """A `design` to build of a `shell`, with its `states` by load case, "none" among them; for the heads its
    `name` and the job's `title`; `block`: what the title block says of who drew it and when. `hung`: the
    state in which cables are hung in, the erected grid before bracing (None: the target). `adjustment`, m:
    the turnbuckles' range, by which cables are let out from the lengths that they are cut to (None: each is
    cut for itself). `origin` (3,), m: where coordinates count from in those of a survey (None: the file's).
    `loads` (n, 6), N, of the states: what stands on a support goes straight into it (left out: nothing).
    `force_limit`, N: what cables may pull (None: not known)."""

    shell: Gridshell
    design: Design
    states: Mapping[str, State]
    hung: State | None = None
    name: str = ""
    title: str = ""
    adjustment: float | None = None
    block: TitleBlock = TitleBlock()
    origin: tuple[float, float, float] | None = None
    loads: Mapping[str, Reals] = field(default_factory=dict)
    force_limit: float | None = None

    def __post_init__(self) -> None:
        if "none" not in self.states:
            raise InputError("no state without load", value=list(self.states), remedy="Add it as 'none'.")
        if self.adjustment is not None:
            give = "metres of the turnbuckles' range, such as 0.02, or leave it out"
            require_number(self.adjustment, least=0.0, where="adjustment", give=give)
        if self.force_limit is not None:
            give = "newtons that a cable may pull, such as 20, or leave it out"
            require_number(self.force_limit, above=0.0, where="force_limit", give=give)

    @property
    def grid(self) -> Grid:
        """The net's grid."""
        return self.shell.net.grid

    @property
    def origin_notes(self) -> tuple[str, ...]:
        """What is to be added to coordinates, in words; nothing where they are the file's."""
        if self.origin is None:
            return ()
        x, y, z = self.origin
        return (f"Coordinates count from ({x:.9g}, {y:.9g}, {z:.9g}) m: add it for those of the survey.",)


def rods(built: Built, cutting: Cutting) -> Table:
    """The rods: lengths, marks, section, mass, and from which bars they are cut."""
    section = built.shell.rod.resized(built.design.radius).section
    weight = mass_per_length(section)
    places: dict[int, list[tuple[int, int, str]]] = {}
    of_lath = lath_names(cutting)
    for number, bar in enumerate(cutting.bars, 1):
        for piece in bar.pieces:
            said = f"B{number}" if piece.parts == 1 else f"{of_lath[piece.lath]}part {piece.part}: B{number}"
            places.setdefault(piece.rod, []).append((piece.lath, piece.part, said))
    rows = tuple(
        (
            name, rod.direction, rod.length, label(section, 2), weight * rod.length if weight else None,
            len(rod.marks), " ".join(f"{1e3 * mark:.1f}" for mark in rod.marks),
            " ".join(map(str, rod.crossings.tolist())), ", ".join(said for _, _, said in sorted(places[k])),
            "spliced" if k in cutting.spliced else "",
        )
        for k, (name, rod) in enumerate(zip(rod_names(built.grid), built.grid.rods, strict=True))
    )  # fmt: skip
    heads = (
        "rod", "direction", "length [m]", "section", "mass [kg]", "crossings",
        "marks from the first end [mm]", "crossing numbers", "bars", "note",
    )  # fmt: skip
    notes = (
        *cutting_notes(cutting, rod_names(built.grid)),
        *bundled_note(built.shell),
    )
    if layers_of(section) == 2:
        notes += ("Each rod is two laths of that length; masses are of both, without shear blocks.",)
    if not weight:
        notes += ("No masses: the rods' density isn't known (rod.density).",)
    return Table("rods", heads, rows, notes)


def splices(built: Built, cutting: Cutting) -> Table:
    """Where rods longer than the stock are spliced, and what the splices bear at each load."""
    return splice_table(built.shell, built.design, _told_states(built), rod_names(built.grid), cutting)


def marks(built: Built) -> Table:
    """One row a mark: rod, crossing, its distance from the first end, and the rod that crosses there."""
    grid, names = built.grid, rod_names(built.grid)
    across: dict[tuple[str, int], str] = {
        (rod.direction, crossing): name
        for name, rod in zip(names, grid.rods, strict=True)
        for crossing in rod.crossings.tolist()
    }
    rows = tuple(
        (name, number, crossing, mark, across["v" if rod.direction == "u" else "u", crossing])
        for name, rod in zip(names, grid.rods, strict=True)
        for number, (crossing, mark) in enumerate(
            zip(rod.crossings.tolist(), rod.marks.tolist(), strict=True), 1
        )
    )
    return Table("marks", ("rod", "mark", "crossing", "from the first end [m]", "crosses rod"), rows)


def bars(built: Built, cutting: Cutting) -> Table:
    """One row a piece: which bar it is cut from, in which order, and the bar's offcut after the last one."""
    names, of_lath = rod_names(built.grid), lath_names(cutting)
    rows = []
    for number, bar in enumerate(cutting.bars, 1):
        at = 0.0
        for place, piece in enumerate(bar.pieces, 1):
            part = "" if piece.parts == 1 else f"{of_lath[piece.lath]}{piece.part} of {piece.parts}"
            last = bar.offcut if place == len(bar.pieces) else None
            rows.append((f"B{number}", place, names[piece.rod], part, piece.length, at, piece.start, last))
            at += piece.length + cutting.kerf
    heads = (
        "bar", "piece", "rod", "part", "length [m]", "begins on the bar at [m]",
        "begins on the rod at [m]", "offcut [m]",
    )  # fmt: skip
    return Table("bars", heads, tuple(rows), (*cutting_notes(cutting, names), *bundled_note(built.shell)))


def rounds(shell: Gridshell, design: Design) -> Indices:
    """The round (c,), from 1, in which each cable of the design is tightened (see the module's head)."""
    grid = shell.net.grid
    steps = np.full(len(grid.lattice), len(grid.lattice))
    for rod in grid.rods:
        count = len(rod.crossings)
        near = np.minimum(np.arange(count), np.arange(count)[::-1])
        steps[rod.crossings] = np.minimum(steps[rod.crossings], near)
    own = steps[cable_crossings(shell, design)].min(axis=1)
    used = np.unique(own)
    return np.asarray(np.searchsorted(used, own) + 1, dtype=np.int64)


def tension_order(shell: Gridshell, design: Design) -> Indices:
    """The design's cables (c,) in the order of tensioning: by rounds, in each about the plan's middle."""
    ends = shell.cable_ends[design.present]
    middle = shell.target.positions[ends].mean(axis=1)[:, :2]
    away = middle - shell.net.crossings[:, :2].mean(axis=0)
    turned = np.arctan2(away[:, 1], away[:, 0])
    return np.lexsort((turned, rounds(shell, design)))


def cable_crossings(shell: Gridshell, design: Design) -> Indices:
    """The crossings (c, 2) that the design's cables join."""
    number = np.full(shell.node_count, -1)
    for side in range(2):
        nodes = shell.net.grid.crossing_nodes[:, side]
        number[nodes] = np.arange(len(nodes))
    return np.asarray(number[shell.cable_ends[design.present]], dtype=np.int64)


def cables(built: Built) -> Table:
    """The cables: crossings, rest length, turnbuckle, order of tensioning, clear length and force by load."""
    shell, design = built.shell, built.design
    ties = shell.cables(design)
    pairs = cable_crossings(shell, design)
    hung = ties.lengths(built.hung or shell.target)
    shortest = (1.0 - RESERVE) * np.minimum(ties.rest_length, hung)
    longest = (1.0 + RESERVE) * np.maximum(ties.rest_length, hung)
    order = np.empty(len(pairs), dtype=np.int64)
    order[tension_order(shell, design)] = np.arange(1, len(pairs) + 1)
    columns: dict[str, Reals | Indices] = {
        "from crossing": pairs[:, 0],
        "to crossing": pairs[:, 1],
        "tensioning round": rounds(shell, design),
        "tensioning order": order,
        "rest length [m]": ties.rest_length,
        **(
            {}
            if built.adjustment is None
            else {"cut length [m]": cut_lengths(ties.rest_length, built.adjustment)}
        ),
        "hung in at [m]": hung,
        "turnbuckle shortest [m]": shortest,
        "turnbuckle longest [m]": longest,
    }
    pulls = {_stage(name): ties.tension(built.states[name]) for name in _in_order(built)}
    for name, state in _told_states(built).items():
        columns[f"{name}: clear length [m]"] = ties.lengths(state)
        columns[f"{name}: force [N]"] = pulls[name]
    rows = tuple((f"C{k}", *(values[k].item() for values in columns.values())) for k in range(len(pairs)))
    notes = (
        f"Lengths between the pins' axes. {how_many(len(pairs), 'cable', 'cables')}, EA = {newtons(shell.cable.stiffness, 6)}. A force of "
        "0: slack at that stage.",
        *force_notes(pulls, _stage("none"), built.force_limit),
        *tightening_notes(pulls[_stage("none")]),
        *cutting_of_cables(built),
        *turnbuckles_of_cables(built),
    )
    return Table("cables", ("cable", *columns), rows, notes)


def cutting_of_cables(built: Built) -> tuple[str, ...]:
    """To how many lengths cables are cut; nothing where each is cut for itself."""
    if built.adjustment is None or not built.design.present.any():
        return ()
    return (cutting_note(built.shell.cables(built.design).rest_length, built.adjustment),)


def turnbuckles_of_cables(built: Built) -> tuple[str, ...]:
    """What their turnbuckles can't do, a sentence each; nothing where each is cut for itself."""
    if built.adjustment is None or not built.design.present.any():
        return ()
    ties = built.shell.cables(built.design)
    hung = ties.lengths(built.hung or built.shell.target)
    return turnbuckle_notes(ties.rest_length, hung, built.adjustment)


def shoe_width(built: Built) -> float:
    """What a support needs across, m: three rod diameters, the rod between two walls of its own thickness."""
    return 6.0 * max(built.shell.rod.resized(built.design.radius).section.fibres)


def clashing_supports(built: Built) -> list[tuple[int, int, float]]:
    """Pairs of supports that stand nearer to each other than a shoe is wide, by number, with the distance of
    their axes, m."""
    feet = built.shell.target.positions[built.shell.net.supports]
    pairs = sorted(cKDTree(feet).query_pairs(shoe_width(built))) if len(feet) else []
    return [(a, b, float(np.linalg.norm(feet[a] - feet[b]))) for a, b in pairs]


def support_forces(built: Built) -> dict[str, Reals]:
    """With which force (n, 3), N, the shell and what stands on its supports act on the ground at each node
    and load, in order: the reactions' opposite, nothing away from supports."""
    assembly = assemble(built.shell.network(built.design))
    none = np.zeros((built.shell.node_count, 6))
    return {
        name: -assembly.unbalanced(built.states[name], built.loads.get(name, none))[:, :3]
        for name in _in_order(built)
    }


def supports(built: Built) -> Table:
    """The supports: which end of which rod, where its axis stands, how it leaves the ground there: bearing
    from x and rise of its tangent, rad; and which force acts on it at each load."""
    net, place = built.shell.net, built.shell.target.positions
    ends = away(net, net.target)
    pushes = support_forces(built)
    rows, clashes = [], clashing_supports(built)
    for support, node in enumerate(net.supports.tolist()):
        rod, side, along = ends[node]
        x, y, z = place[node].tolist()
        bearing = float(np.arctan2(along[1], along[0]))
        rise = float(np.arctan2(along[2], np.hypot(along[0], along[1])))
        forces = [value for push in pushes.values() for value in push[node].tolist()]
        near = ", ".join(f"S{b if a == support else a}" for a, b, _ in clashes if support in (a, b))
        rows.append((f"S{support}", rod, side, x, y, z, bearing, rise, near, *forces))
    heads = [
        "support", "rod", "end", "x [m]", "y [m]", "z [m]",
        "bearing of the rod [rad]", "rise of the rod [rad]", "clashes with",
    ]  # fmt: skip
    heads += [f"{_stage(name)}: on the support along {axis} [N]" for name in pushes for axis in "xyz"]
    notes = (
        "x, y and z are those of the axis that ends there, a rod's or an edge beam's, not of the ground under it.",
        "Supports stand where they are: before, during and after the pour. Forces are those of the rods' ends on them, "
        "at the feet of edge beams (E0, E1, …) those of the beams, with the load that stands on the support itself.",
        "Bearing, from x towards y, and rise are those of the axis' tangent at the support in the wanted shape; of beams that meet "
        "in one, the first one's.",
        *fixing_note(net),
        *turning_note(net, _told_states(built)),
        f"Supports whose axes are nearer than {1e3 * shoe_width(built):.3g} mm, the width of a shoe (three rod "
        "diameters), clash: "
        + (", ".join(f"S{a} and S{b}, {1e3 * apart:.1f} mm" for a, b, apart in clashes) or "none")
        + ".",
        *built.origin_notes,
    )
    return Table("supports", tuple(heads), tuple(rows), notes)


def survey(built: Built) -> Table:
    """Where the axis of each crossing's upper rod is wanted, and expected at each load, "none" before the
    pour."""
    grid, shell, upper = built.grid, built.shell, built.grid.crossing_nodes[:, 1]
    places = {"target": shell.target.positions[upper]}
    places |= {_stage(name): built.states[name].positions[upper] for name in _in_order(built)}
    across = {
        (rod.direction, c): name
        for name, rod in zip(rod_names(grid), grid.rods, strict=True)
        for c in rod.crossings.tolist()
    }
    heads = ["crossing", "rod u", "rod v"]
    for name in places:
        heads += [f"{name}: {axis} [m]" for axis in "xyz"]
    heads += [f"{name}: off the target [m]" for name in places if name != "target"]
    rows = []
    for k in range(len(grid.lattice)):
        here = [value for place in places.values() for value in place[k].tolist()]
        off = [
            float(np.linalg.norm(p[k] - places["target"][k]))
            for name, p in places.items()
            if name != "target"
        ]
        rows.append((k, across["u", k], across["v", k], *here, *off))
    notes = ("Axis of the upper rod, as `shellform survey` reads a crossing.", *built.origin_notes)
    return Table("survey", tuple(heads), tuple(rows), notes)


def all_tables(built: Built, cutting: Cutting) -> list[Table]:
    """Every schedule, that of the splices also where there are none: none is left from another stock."""
    told = built.shell, built.design, _told_states(built), rod_names(built.grid)
    tables = [make(built, cutting) for make in (rods, bars, splices)]
    tables += [make(built) for make in (marks, cables, supports, survey)]
    if layers_of(built.shell.rod.section) == 2:
        tables.append(block_table(*told))
    return [*tables, edge_table(*told)] if built.shell.net.edges else tables


def write_schedules(folder: str | Path, built: Built, cutting: Cutting) -> list[Path]:
    """Writes every schedule as NAME.csv, their notes as notes.txt and all of it as schedules.xlsx, in mm and
    degrees as workshops read them; returns the files. Raises InputError where they can't be written.
    """
    return write_tables(folder, [for_the_workshop(table) for table in all_tables(built, cutting)])


def _told_states(built: Built) -> dict[str, State]:
    """The states by what they are called on site, in order."""
    return {_stage(name): built.states[name] for name in _in_order(built)}


def _in_order(built: Built) -> list[str]:
    """The load cases as they come on site: before the pour, its stages, all of it, what is only checked."""
    last = [name for name in ("design", "additional") if name in built.states]
    return ["none", *(name for name in built.states if name not in ("none", *last)), *last]


def _stage(load: str) -> str:
    """What a load case is called on site."""
    return "erected" if load == "none" else load
