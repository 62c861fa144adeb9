"""The answers to what a designer asks first, of the design to build: how far off, how many cables, which
rods, is it safe, how is it raised, what does it stand on, what to buy.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shellform.errors import how_many
from shellform.gridshell.catalogue import label
from shellform.gridshell.edge_beams import lengths, mass, rods_of_bundles
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.layers import layers_of
from shellform.net.net import Net
from shellform.quantities import newtons, number
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.check import SLACK, Cell
from shellform.records.raising import WayUpRecord, easiest
from shellform.records.summary import DocumentsRecord, LoadRecord, Summary
from shellform.records.words import (
    confidence_words,
    driven_words,
    ends_halved,
    listed,
    load_title,
    raising_words,
    shape_notes,
    standing_count_words,
    way_up_words,
)
from shellform.structure.elements.sections import mass_per_length
from shellform.structure.elements.state import State

_EDGES = {
    "ground": "on the ground", "wall": "on walls", "abutment": "on abutments", "beam": "on edge beams",
    "free": "free", "pin": "pinned in mid-air",
}  # fmt: skip


_SAFE = 0.95  # of the structures as built: fewer may be what is asked for, and aren't safe
_SPARED = 0.95  # of the rods' strength: more may be borne on the way up, and leaves nothing over


@dataclass(frozen=True)
class Answer:
    """What a designer asks first: the `question`, the answer in a few `words`, the `detail` that stands
    behind it, and if it is `good` (None: neither), or `open`: not known well enough."""

    question: str
    words: str
    detail: str
    good: bool | None = None
    open: bool = False


def answers(
    shell: Gridshell,
    name: str,
    design: Design,
    states: Mapping[str, State],
    summary: Summary,
    *,
    as_built: Cell | None = None,
    next_size: str = "",
) -> list[Answer]:
    """How far off is the shell, how many cables, which rods, is it safe beyond the load, what to buy: for the
    design to build, whose check `as_built` says how many drawn structures stand under the additional load;
    `next_size` is the size of the catalogue that its rods would be rounded to."""
    own = summary.designs.get(name)
    loads = {} if own is None else own.loads
    main, more, before = (loads.get(load) for load in ("design", "additional", "none"))
    found = [] if main is None else [_how_far(main, before, shape_notes(summary, name))]
    cables = shell.cables(design)
    pull = cables.tension(states["design"]) if "design" in states else np.zeros(len(cables.ends))
    found.append(
        Answer(
            "How many cables?",
            f"{len(cables.ends)} of {len(shell.cable_ends)}",
            f"{newtons(float(pull.max(initial=0.0)))} at most in one, {newtons(float(pull.sum()))} in all, "
            f"under the design load{_before(before)}{_slack(main, before)}",
        )
    )
    section = shell.rod.resized(design.radius).section
    bought = f"; the next size sold is {next_size}" if next_size and next_size != label(section, 2) else ""
    rods = np.array([rod.length for rod in shell.net.grid.rods])
    stressed = (
        ""
        if main is None or not math.isfinite(shell.rod.strength)
        else f"; at {100 * main.stressed:.0f} % of their strength{_as_built(main.built_shape, main.adjusted_shape)}"
    )
    locked = "" if layers_of(section) == 1 else "; bent lath by lath, then locked by shear blocks"
    found.append(
        Answer(
            "Which rods?",
            label(section, 2),
            f"{len(rods)} rods of up to {number(1e3 * float(rods.max()))} mm{stressed}{locked}{bought}",
        )
    )
    if more is not None:
        found.append(_is_safe(main, more, as_built, math.isfinite(shell.rod.strength)))
    if own is not None and own.ways_up:
        found.append(_is_raised(own.ways_up))
    if shell.net.stretches:
        found.append(_stands_on(shell.net, more, loads))
    heavy, laths = mass_per_length(section) * float(rods.sum()), layers_of(section)
    weight = f" ({number(heavy)} kg)" if heavy > 0.0 else ""
    cut_to = None if summary.documents is None else summary.documents.cut_lengths
    cut = "" if cut_to is None else f", cut to {cut_to} different lengths"
    found.append(
        Answer(
            "What to buy?",
            f"{number(laths * float(rods.sum()))} m of {'rod' if laths == 1 else 'laths, two a rod'}{weight}",
            f"{len(rods)} rods{_bars(summary.documents, name)}, {len(shell.net.grid.lattice)} connectors, {len(shell.net.supports)} supports, "
            f"{how_many(len(cables.ends), 'cable', 'cables')} of {number(float(cables.rest_length.sum()))} m in all{cut}{_beams(shell)}",
        )
    )
    return found


def _bars(documents: DocumentsRecord | None, name: str) -> str:
    """Of how many bars the design's rods are cut, and how many have to be spliced for that."""
    if documents is None or documents.design != name:
        return ""
    spliced = f", {len(documents.spliced)} of them spliced" if documents.spliced else ""
    return f" from {how_many(documents.bars, 'bar', 'bars')} of {number(documents.stock_length)} m{spliced}"


def _beams(shell: Gridshell) -> str:
    """The edge beams to buy, which may be heavier than all rods; as bundles they take rods besides."""
    if shell.edge is None:
        return ""
    bundled = rods_of_bundles(shell.net, shell.edge)
    heavy = mass(shell.net, shell.edge)
    length, weight = number(float(lengths(shell.net).sum())), f" ({number(heavy)} kg)" if heavy > 0.0 else ""
    count = how_many(len(shell.net.edges), "edge beam", "edge beams")
    of = f"bundles of {label(shell.edge.section)}: {number(bundled)} m of rods besides" if bundled else ""
    return f", {count} of {length} m in all{weight}, {of or label(shell.edge.section)}"


def _before(before: LoadRecord | None) -> str:
    """How much a cable pulls at most before any load."""
    pull = None if before is None else before.cable_force_max
    return "" if pull is None else f"; {newtons(pull)} at most before any load"


def _slack(main: LoadRecord | None, before: LoadRecord | None) -> str:
    """Which cables hang slack, before the load and under it."""
    found = [
        f"; slack {when}: {listed(load.slack)}"
        for when, load in [("before any load", before), ("under it", main)]
        if load is not None and load.slack
    ]
    none = before is not None and before.slack is not None
    return "".join(found) or ("; none slack before the load" if none else "")


def _as_built(shape: BuiltShapeRecord | None, then: BuiltShapeRecord | None) -> str:
    """What the rods of structures as built bear, and `then`, adjusted on site."""
    if shape is None or shape.stress is None:
        return ""
    usual, worst = (100.0 * each for each in shape.stress)
    told = f" as planned, {usual:.0f} as built, where they are stressed most ({worst:.0f} in the worst structure)"
    if then is None or then.stress is None:
        return told
    usual, worst = (100.0 * each for each in then.stress)
    return f"{told}, {usual:.0f} adjusted on site ({worst:.0f})"


def _stands_on(net: Net, more: LoadRecord | None, loads: Mapping[str, LoadRecord]) -> Answer:
    """The lengths of the edge by kind, and what its supports have to take at most under any of the loads."""
    lengths: dict[str, float] = {}
    for each in net.stretches:
        lengths[each.kind] = lengths.get(each.kind, 0.0) + each.length
    words = ", ".join(f"{number(length)} m {_EDGES[kind]}" for kind, length in lengths.items())
    used = None if more is None else more.edge_utilisation_max
    beams = f"; edge beams, drawn dark, at {100 * used:.0f} % of their strength" if net.edges and used else ""
    uplift = max((each.uplift_max or 0.0 for each in loads.values()), default=0.0)
    thrust = max((each.thrust_max or 0.0 for each in loads.values()), default=0.0)
    wanted = [("held down with up to", uplift), ("pushed sideways by up to", thrust)]
    needs = [f"{what} {newtons(most)}" for what, most in wanted if most > 0.0]
    taken = f", {' and '.join(needs)} each, erected or loaded" if needs else ""
    return Answer("What does its edge stand on?", words, f"{len(net.supports)} supports{taken}{beams}")


def _how_far(main: LoadRecord, before: LoadRecord | None, notes: Sequence[str]) -> Answer:
    """Of the perfect structure, of drawn ones beside it, which may be ten times as far off, and of the braced
    shell `before` any load, from where the concrete brings it into shape; what is to be noted of that."""
    question, good = "How far off is the shell?", None if main.stable and main.on_branch else False
    planned, mean, built = _mm(main.deviation_max), _mm(main.deviation_mean), main.built_shape
    if before is not None:
        notes = [f"Braced and not yet loaded it is {_mm(before.deviation_max)} off at most", *notes]
    if built is None:
        detail = ". ".join([f"{mean} in the mean, under the design load, as planned", *notes])
        return Answer(question, f"{planned} at most", detail, good)
    drawn = (
        f"at most, under the design load; {mean} and {_mm(built.deviation_mean)} in the mean. As built is the median of "
        f"{built.structures} drawn structures; the worst is {_mm(built.deviation_max_worst)} off{driven_words(built)}"
        f"{_on_site(main.adjusted_shape)}"
    )
    return Answer(
        question,
        f"{planned} as planned, {_mm(built.deviation_max)} as built",
        ". ".join([drawn, *notes]),
        good,
    )


def _on_site(then: BuiltShapeRecord | None) -> str:
    """How far off the same structures are when they have been adjusted."""
    if then is None:
        return ""
    return (
        ". With supports fixed last, where rods' ends lie on a scaffold, and cables tightened to their force before any load "
        f"{_mm(then.deviation_max)}, {_mm(then.deviation_max_worst)} in the worst of {then.structures}"
    )


def _is_safe(
    main: LoadRecord | None, more: LoadRecord, as_built: Cell | None, strength_known: bool
) -> Answer:
    """Of the additional load: from the drawn structures, where the perfect one stands at all."""
    used = more.stressed
    known = math.isfinite(used) and strength_known
    sure = ""
    safe: bool | None
    if not more.stable:
        safe, words = False, "No, it is unstable"
    elif not more.on_branch:
        safe, words = False, "No, it snaps through"
    elif known and used > 1.0 + SLACK:
        safe, words = False, "No, rods break"
    elif as_built is None or more.stands is None:
        safe, words = None, "Not examined as built"
    else:
        safe, words = as_built.holds, standing_count_words(more.stands)
        least = confidence_words(more.stands)
        sure = f"{least[:1].upper()}{least[1:]}. "
        # No fewer may stand than of an initial design that falls as often.
        if safe and more.stands.standing < _SAFE * more.stands.drawn:
            safe, words = None, f"Not surely: {words}"
            sure += "No more are asked for. "
        elif safe and as_built.caution:
            safe = None
            sure += "That some snap so far asks for care. "
    rods = f", rods at {100.0 * used:.0f} % of their strength" if known else ""
    off = f"{_mm(more.deviation_max)} off at most, {_mm(more.deviation_mean)} in the mean{rods}"
    return Answer(
        f"Is it safe {'under' if more.times is None else 'at'} {load_title('additional', more.times)}?",
        words,
        f"{sure}As planned {off}. {_collapse(main)}",
        safe,
        open=safe is None,
    )


def _is_raised(ways: Sequence[WayUpRecord]) -> Answer:
    """By which of the ways up that were tried, and what it takes."""
    best = easiest(ways)
    question, words = "How is it raised?", f"By {way_up_words(best)}"
    if best.utilisation is None:
        other = f"{raising_words(ways)}. shellform erect takes other ways and props"
        return Answer(question, "No way was found", other, open=True)
    needs = [] if best.reaction is None else [f"supports bear up to {newtons(best.reaction)}"]
    if best.push is not None and best.pull is not None:
        needs.append(f"each prop pushes with up to {newtons(best.push)}")
        if best.held_down:
            needs.append(
                f"up to {how_many(best.held_down, 'crossing is', 'crossings are')} held down with up to {newtons(best.pull)}"
            )
    detail = ". ".join([raising_words(ways), f"On it {', '.join(needs)}"])
    if best.utilisation > 1.0 + SLACK:
        return Answer(question, "Rods break on the way up", detail, good=False)
    spared = best.strength_known and best.utilisation <= _SPARED
    return Answer(question, words, detail, good=spared or None, open=not spared)


def _collapse(row: LoadRecord | None) -> str:
    """What is known of the load at which the perfect shell loses stability, from the design load's record."""
    if row is None or row.critical_factor is None or row.critical_kind is None:
        return "At which load it collapses isn't known."
    if row.critical_kind == "none":
        halved = ends_halved(row.critical_factor, row.critical_factor_halved, row.critical_snap_halved)
        return f"Stable up to {row.critical_factor:.3g} × the design load, the most that was tried{halved}."
    off = (
        ""
        if row.critical_factor_error is None
        else f", by the mesh off by {abs(row.critical_factor_error):.3f}"
    )
    return f"The perfect shell's stability ends at {row.critical_factor:.3f} × the design load ({row.critical_kind}){off}."


def _mm(metres: float) -> str:
    return f"{number(1e3 * metres, 2)} mm"
