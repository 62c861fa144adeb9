"""`shellform new`: a commented case file for a surface, with a design that stands (first_design.py).

Every number comes with its reason. Forces and lengths that only limit the search are the paper's scale
model's (section 4.1: 55 mm spacing), times k = spacing / 55 mm and its square.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from shellform.case.build_net import FAR, counted_from, distant_origin, size_text, surface_of
from shellform.errors import InputError, NotConverged, printable
from shellform.gridshell.catalogue import label
from shellform.gridshell.layers import layers_of, single
from shellform.net.edges import Edges, stretches_of
from shellform.net.ground import ground_under
from shellform.quantities import number
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.records.words import raising_words
from shellform.run.first_design import finished_design, first_design
from shellform.run.first_finish import far_told
from shellform.run.first_look import surface_entry
from shellform.run.first_net import Allowance, bare_told, bends_to, larger
from shellform.run.first_refusal import WayOut, steadier_on_walls, with_ways_out
from shellform.run.first_steadier import strays, strays_told
from shellform.run.first_trial import (
    ADDITIONAL,
    ELEMENTS,
    ENLARGED,
    NEEDED,
    FirstDesign,
    FirstParts,
)
from shellform.run.narrow_holes import narrow_holes
from shellform.run.plinths import plinths_for
from shellform.run.proposed_edges import edge_beams_table, edge_beams_told, edges_told, named
from shellform.run.proposed_shape import (
    built_deviation,
    cables_pull,
    optimise_table,
    rods_strength,
    stray_told,
)
from shellform.run.sizes import THICKNESS, DesignWish, RodChoice, usual_thickness
from shellform.structure.elements.threads import dense_on_one
from shellform.surface.shape.target import Surface
from shellform.written import refuse_unwritable, write_named

_SEARCH = 2 / 3  # of the work that a surface is worth: the search for a design of it as it is
_LEVEL_PLACES = 9  # of a level's metres: 1300.3 less 1300 is 0.3, and not 0.2999999999999545
_BUILT = f"errors of building {ENLARGED:g} times as large as is usual"


@dataclass(frozen=True)
class _Asked:
    """What was asked for: a case for the surface of a `file`, written to `output`; whether its scripts may
    run, and who hears what is tried."""

    file: Path
    output: Path
    allow_scripts: bool
    report: Report

    def say(self, text: str) -> None:
        self.report(Event("new", text, Kind.NOTE))


@dense_on_one()
def propose_case(
    file: Path,
    output: Path,
    options: Mapping[str, Any],
    *,
    allow_scripts: bool,
    wish: DesignWish | None = None,
    way_out: bool = False,
    report: Report = unheard,
) -> dict[str, str]:
    """Writes a case for a surface file to `output`; returns what was proposed as labelled lines.

    `options` are the entries of [surface] in a case; `wish` is what the user wants of the design; with
    `way_out` the case of a shell that gets no design as it is becomes that of the first way out
    (first_refusal.py), and says so. Raises InputError where `output` exists or isn't named .toml, and
    InputError or NotConverged where no design stands (unbuildable.py).
    """
    _check(output)
    asked, wish = _Asked(file, output, allow_scripts, report), wish or DesignWish()
    ready = _read(asked, file, options, wish.spacing)
    times = larger(ready.surface, wish.spacing)
    if times > 1.0:
        asked.say(f"{times:.2g} times the usual work is allowed, for so many crossings")
    worth = Allowance.for_size(ready.surface, wish.spacing)
    try:
        design = first_design(ready.surface, wish, asked.say, worth.part(_SEARCH))
    except (InputError, NotConverged) as error:
        refused = with_ways_out(error, ready.surface, wish, output, asked.say, worth, uncut=ready.uncut)
        taken = refused.way_out
        if taken is None or not way_out:
            raise refused.offered from error
        return {"way out": taken.told, **_gone_on(asked, ready, refused.error.what, taken)}
    steady = None
    if strays(design, ready.surface):
        steady = steadier_on_walls(ready.surface, wish, asked.say, worth)
    if steady is not None and way_out:
        why = strays_told(design, ready.surface)
        return {"way out": steady.told, **_gone_on(asked, ready, why, steady)}
    return _written(asked, file, ready, design, wish, ready.told, steady)


@dataclass(frozen=True, eq=False)
class _Ready:
    """A `surface` to design for, the `options` of [surface] that lead to it, and what was `told` of it, with
    what was of its `plinths`, if it has any; and the surface that reaches down into these, `uncut`."""

    surface: Surface
    uncut: Surface
    options: Mapping[str, Any]
    told: tuple[str, ...]
    plinths: str


def _read(asked: _Asked, file: Path, options: Mapping[str, Any], spacing: float | None) -> _Ready:
    """The surface in a file, without holes narrower than the `spacing` (None: the usual one), counted from
    near where it is far away, on plinths where it flares into the ground."""
    told: tuple[str, ...] = ()
    asked.report(Event("surface", f"reading {file.name}"))
    surface = surface_of(surface_entry(file, options), allow_scripts=asked.allow_scripts)
    narrow = narrow_holes(surface, file, options, spacing)
    if narrow is not None:
        closed = {**options, "fill_narrower": narrow.width}
        try:
            surface = surface_of(surface_entry(file, closed), allow_scripts=asked.allow_scripts)
        except InputError as error:  # too steep there, or of an outline that crosses itself
            told = (f"{narrow.kept}: {error.what}",)
        else:
            options, told = closed, (narrow.closed,)
    for mended in surface.mended:
        asked.report(Event("surface", mended, Kind.NOTE))
    for sentence in told:
        asked.say(sentence)
    origin = distant_origin(surface, FAR)
    if origin is not None:
        surface, earlier = counted_from(surface, origin), options.get("origin") or (0.0, 0.0, 0.0)
        levels = {
            name: round(options[name] - origin[2], _LEVEL_PLACES)
            for name in ("above", "ground")
            if name in options
        }
        options = {**options, **levels, "origin": [a + b for a, b in zip(earlier, origin, strict=True)]}
        told = (
            *told,
            f"coordinates count from {options['origin']} m",
        )
        asked.report(Event("surface", told[-1], Kind.NOTE))
    asked.report(Event("surface", f"size {size_text(surface.size)}", Kind.NOTE))

    uncut = surface
    plinths = plinths_for(surface) if "above" not in options else None
    if plinths is not None:
        surface, options = plinths.surface, {**options, "above": plinths.above}
        asked.say(plinths.told)
        told = (*told, plinths.told)
    return _Ready(surface, uncut, options, told, "" if plinths is None else plinths.told)


def _gone_on(asked: _Asked, ready: _Ready, why: str, taken: WayOut) -> dict[str, str]:
    """The case of the way out, whose design is finished. The head says so, `why`, and what was told of the
    surface as it is: coordinates in a file that is offered are those of that one, whose feet may have been
    cut off."""
    asked.say(f"not as it is: {why}. {taken.told}")
    told: tuple[str, ...] = (
        f"NOT the surface as it is: {why}",
        f"but the way out. {taken.told}",
        *ready.told,
    )
    file = asked.file
    if taken.file is not None:
        file, ready = taken.file, _read(asked, taken.file, {}, 0.0)  # the very surface that stands
        told = (*told, *ready.told)
    worth = Allowance.for_size(ready.surface, taken.wish.spacing)
    design = finished_design(taken.design, ready.surface, taken.wish, asked.say, worth.part(_SEARCH))
    return _written(asked, file, ready, design, taken.wish, told)


def _written(
    asked: _Asked,
    file: Path,
    ready: _Ready,
    design: FirstDesign,
    wish: DesignWish,
    told: tuple[str, ...],
    steady: WayOut | None = None,
) -> dict[str, str]:
    """The case for the surface in `file`, written, with what was `told` before at its head, and what it
    proposes; `steady`: on which its structures wouldn't stray too far as built, where they do."""
    surface = ready.surface
    edges = edges_told(stretches_of(surface, Edges(outer=wish.edges)), ground_under(surface))
    entries = {"file": os.path.relpath(file.resolve(), asked.output.resolve().parent), **ready.options}
    design = replace(design, told=(*told, *design.told))
    title = asked.file.stem + ("" if file == asked.file else ", nearest buildable surface")
    stray = stray_told(design, surface, steady)
    far = "; ".join(each for each in (far_told(design, surface), stray) if each)
    write_named(asked.output, _text(asked.file, title, entries, surface, design, wish, edges, stray))
    return {
        "size": size_text(surface.size),
        **({"plinths": ready.plinths} if ready.plinths else {}),
        "spacing": f"{design.spacing:g} m, {design.reason}: {len(design.placed.net.grid.lattice)} crossings"
        + bare_told(design.placed.net),
        "angle": f"{design.placed.angle:g}°",
        "rods": f"{design.parts.choice.label} of {design.parts.choice.catalogue} (equation 1 allows {2e3 * design.allowed:.3g} mm)",
        **({"joints": "turn, as swivel couplers do"} if design.parts.swivels else {}),
        "cables": f"⌀ {1e3 * design.parts.rope.diameter:g} mm",
        "concrete": f"{1e3 * design.thickness:g} mm",
        "stands": f"up to {design.tried.factor:.2f} × its load or more; {design.standing} of {design.drawn} structures under 1.2 × its load with {_BUILT}",
        **({"shape": far} if far else {}),
        **({"raising": raising_words(design.ways_up)} if design.ways_up else {}),
        "edges": edges,
        **({"edge beams": edge_beams_told(design)} if design.placed.net.edges else {}),
        "case": str(asked.output),
    }


def _text(
    file: Path,
    title: str,
    entries: Mapping[str, Any],
    surface: Surface,
    design: FirstDesign,
    wish: DesignWish,
    edges: str,
    stray: str,
) -> str:
    """The case file."""
    lines = "\n".join(f"{name} = {json.dumps(value, ensure_ascii=False)}" for name, value in entries.items())
    placed, parts, choice, rope = design.placed, design.parts, design.parts.choice, design.parts.rope
    told = "\n".join(f"#   {printable(each)}" for each in design.told)
    offset = "" if placed.offset == (0.0, 0.0) else f"\noffset = {list(placed.offset)!r}"
    angle = "as asked" if wish.angle is not None else "of those tried its rods bend least"
    bent = bends_to(placed.net)
    return f"""\
# Proposed by `shellform new` for {json.dumps(file.name, ensure_ascii=False)}: {size_text(surface.size)}, {number(surface.area, 4)} m².
# If that size is wrong, the unit is: run `shellform new` again with --unit. What was tried:
{told}
title = {json.dumps(title, ensure_ascii=False)}

[surface]            # relative to this file
{lines}

[net]
spacing = {design.spacing!r}        # m: {design.reason}; {len(placed.net.grid.lattice)} crossings
angle = {placed.angle!r}         # degrees of the u rods against x: {angle}{offset}
elements = {ELEMENTS}         # beams a segment; what is asked of the design has to hold with twice as many

[rod]
catalogue = "{choice.catalogue}"
section = "{named(label(single(choice.section)))}"    # equation (1) allows {2e3 * design.allowed:.3g} mm where the net is curved most, to a radius of {bent:.3g} m; \
rods at {design.tried.stress:.0%} of their strength under the load followed
{_layers(choice)}{_joint(parts)}
[cable]
stiffness = {_short(rope.stiffness)!r}    # EA, N: stainless strand 1 × 19, ⌀ {1e3 * rope.diameter:g} mm; much softer cables let the shell buckle
rest_ratio = {parts.rest_ratio!r}    # a prestrain that takes up what cables are off in length
force_max = {_short(rope.force_max)!r}     # N, constraint (5): half of what breaks it
without = false      # true: show too what the grid does without cables

[edges]              # found: {edges}
outer = "{wish.edges}"       # {_outer(wish)}auto: ground where the edge is low, elsewhere an edge beam; "fill" brings it down to the ground, "free" lets rods end
openings = "auto"    # [[edges.stretch]] names walls and abutments by height, box or curve

[edges.beam]
{edge_beams_table(design)}

[part.concrete]      # on its true area, so that the load stays where the spacing changes
kind = "concrete"
thickness = {design.thickness!r}     # m: {_thickness_told(surface, design, wish)}

[part.rods]
kind = "rods"

[[load]]
name = "design"      # the initial design stands up to {design.tried.factor:.2f} × this or more ({NEEDED:g} is asked), and under 1.2 × it \
{design.standing} of {design.drawn} structures with {_BUILT} do
factors = {{ concrete = 1.0, rods = 1.0 }}

[[load]]
name = "additional"  # the case under which the shell must still stand, constraint (6)
factors = {{ concrete = {ADDITIONAL!r}, rods = {ADDITIONAL!r} }}   # the design load lies on its path, so that structures are loaded once for both

[limits]
{rods_strength(design)}
{cables_pull(design)}
{built_deviation(surface, design, stray)}

{optimise_table(surface, design)}
# [title_block]      # on the drawings, where it is filled in
# date = ""
# revision = ""
# author = ""
"""


def _thickness_told(surface: Surface, design: FirstDesign, wish: DesignWish) -> str:
    if wish.thickness is not None:
        return "as asked"
    if design.thickness == usual_thickness(surface):
        return (
            "usual"
            if design.thickness == THICKNESS
            else "that of a model: a shell of 4 m or more would have 50 mm"
        )
    return "what these rods bear; pour it first, and the rest when it has hardened"


def _outer(wish: DesignWish) -> str:
    return "" if wish.edges == "auto" else "as asked; "


def _layers(choice: RodChoice) -> str:
    """The entries of rods in two layers."""
    if layers_of(choice.section) == 1:
        return ""
    return """\
layers = 2           # bent lath by lath, then locked by shear blocks
composite = 0.5      # how far these make them act together: 1 as if glued, 0 loose
"""


def _joint(parts: FirstParts) -> str:
    """The table of joints that turn more easily than those that follow the rods."""
    if not parts.swivels:
        return ""
    return f"""
[joint]              # what is left out follows the rods: table 1 of the paper, scaled
torsion = {_short(parts.joint.torsion)!r}    # GJ, N·m²: a tenth of that, for rods that turn on their joints (swivel couplers, bolts tightened after bending): \
stiffer ones bend the rods where the net's right angles are sheared
"""


def _check(output: Path) -> None:
    """Raises InputError where the case can't be written there."""
    if output.suffix.lower() != ".toml":
        raise InputError(
            "must end in .toml", where="--output", value=str(output), remedy="For example --output mine.toml."
        )
    if output.exists():
        raise InputError(
            "is there already and is not overwritten", where=str(output), remedy="Choose another --output."
        )
    if not output.parent.is_dir():
        raise InputError(
            "there is no such folder", where=str(output.parent), remedy="Make it, or choose another --output."
        )
    refuse_unwritable(output)


def _short(value: float) -> float:
    """Two digits more than the first."""
    return float(f"{value:.3g}")
