"""Numbers, load cases and designs in words, for the terminal and the page."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from shellform.quantities import newtons, number
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.failures import RareRecord
from shellform.records.raising import SCAFFOLD, WayUpRecord, easiest
from shellform.records.summary import DesignRecord, StandingRecord, Summary

_SPENT = 1.25  # times the initial design's deviation as built, from which on it is worth a word
_SAME = 1e-6  # relative: factors that count as equal
_LISTED = 8  # names, where there are more of them
LOADS = {"none": "no load", "design": "the design load", "additional": "the additional load"}
TITLES = {
    "unbraced": "Unbraced",
    "initial": "Initial",
    "unloaded": "Optimised unloaded",
    "optimised": "Optimised",
    "rounded": "Rounded",
    "polished": "Polished",
}
_CONSTRAINTS = {
    "cable_force": "cable forces",
    "misfit": "misfit",
    "deviation": "largest deviation",
    "built_misfit": "misfit as built",
    "softness": "stiffness of the softest mode",
    "utilisation": "rods' stress",
    "connector_turn": "connectors' turning",
    "slackness": "least pull of a cable",
    "uplift": "uplift of supports",
    "thrust": "thrust on supports",
}

_CAUSES = {
    "cable_length": "the cables' lengths",
    "cable_stiffness": "the cables' stiffness",
    "supports": "the supports' places",
    "marks": "the marks on the rods",
    "rod_stiffness": "the rods' stiffness",
    "rod_bow": "the rods' bow",
    "connectors": "the connectors' stiffness",
    "load_each": "the load's error at each crossing",
    "load_all": "the error of the whole load",
    "load_uneven": "more load on one half",
    "shape": "the shape's imperfection",
    "cable_stiffness_all": "all cables' stiffness",
    "connectors_all": "all connectors' stiffness",
    "tape": "the tapes that rods are marked by",
}


def cause_title(name: str) -> str:
    """A cause of error (gridshell/tolerances.py) in words."""
    return _CAUSES.get(name, name.replace("_", " "))


def load_title(name: str, factor: float | None = None) -> str:
    """A load case in words; `factor`: how many times the design load it is, None where it isn't known or no
    multiple of it."""
    words = LOADS.get(name, f"“{name}”")
    return f"{factor:.3g} × the load" if name == "additional" and factor is not None else words


def design_title(name: str) -> str:
    """A design in words."""
    return TITLES.get(name, name)


def constraint_titles(names: Iterable[str]) -> dict[str, str]:
    """The optimiser's constraints in words, by name: their quantity, and their load case where they have one.
    Those under the design load name none, which is told where the same quantity is limited under other loads
    too."""
    parts = {name: name.partition(".")[::2] for name in names}
    elsewhere = {kind for kind, load in parts.values() if load}
    titles = {}
    for name, (kind, load) in parts.items():
        under = load or ("design" if kind in elsewhere else "")
        words = _CONSTRAINTS.get(kind, kind.replace("_", " "))
        titles[name] = f"{words}, {'no' if under == 'none' else under} load" if under else words
    return titles


def fallen_at(factor: float) -> str:
    """The load factor at which a structure falls, to a thousandth where a hundredth would say that it bears
    its load."""
    return f"{factor:.3f}" if f"{factor:.2f}" == "1.00" else f"{factor:.2f}"


def standing_words(own: StandingRecord) -> str:
    """How many structures as built stand, and how sure that is."""
    return f"{standing_count_words(own)} ({confidence_words(own)})"


def standing_count_words(own: StandingRecord) -> str:
    """How many structures as built stand."""
    snapped = (
        f", {own.snapped} of them after a rod's end or a cell has snapped by up to {number(1e3 * own.snap, 2)} mm"
        if own.snapped
        else ""
    )
    return f"{own.standing} of {own.drawn} structures as built stand{snapped}"


def confidence_words(own: StandingRecord) -> str:
    """Which share stands at the least, and how sure that is."""
    least, sure = math.floor(100.0 * own.at_least), number(100.0 * own.confidence)
    return f"at least {least:.0f} % with {sure} % confidence"


def built_shape_words(own: BuiltShapeRecord) -> str:
    """How far drawn structures are off."""
    mean, most, worst = (
        number(1e3 * each, 2) for each in (own.deviation_mean, own.deviation_max, own.deviation_max_worst)
    )
    return (
        f"as built {most} mm off at most and {mean} mm in the mean, in the median of {own.structures} structures, "
        f"{worst} mm in the worst{driven_words(own)}{_strain_words(own)}"
    )


def adjusted_words(own: BuiltShapeRecord) -> str:
    """How far drawn structures are off, and what they bear, once they have been adjusted on site."""
    most, worst = (number(1e3 * each, 2) for each in (own.deviation_max, own.deviation_max_worst))
    return (
        f"adjusted on site, as a scaffold allows, {most} mm off at most in the median of {own.structures}, "
        f"{worst} mm in the worst{_strain_words(own)}"
    )


def _strain_words(own: BuiltShapeRecord) -> str:
    """How much rods and cables bear as built; "" of older runs."""
    found = ""
    if own.stress is not None:
        usual, worst = (number(100.0 * each) for each in own.stress)
        found += f", rods at {usual} % of their strength ({worst} % in the worst)"
    if own.pull is not None:
        usual, worst = map(newtons, own.pull)
        found += f", a cable at {usual} ({worst})"
    return found


def driven_words(own: BuiltShapeRecord) -> str:
    """By which cause of error nodes are moved farthest; "" where none is known."""
    driver = max(own.causes, key=lambda name: own.causes[name], default="")
    return f", driven by {cause_title(driver)}" if driver else ""


def listed(names: Sequence[str]) -> str:
    """Names, the first of them where there are many, and how many others."""
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{', '.join(names[:_LISTED])}{more}"


def run_on(parts: Sequence[str]) -> list[str]:
    """The parts of one sentence: those after the first begin small."""
    return [part if k == 0 else part[:1].lower() + part[1:] for k, part in enumerate(parts)]


def goes_slack_words(cables: Sequence[str]) -> str:
    """Which cables go slack on the way; "" where none does."""
    return f"{', '.join(cables)} {'goes' if len(cables) == 1 else 'go'} slack" if cables else ""


def before_load_words(designs: Mapping[str, DesignRecord], name: str) -> str:
    """Which cables of the design hang slack before any load; "" where none does."""
    row = designs[name].loads.get("none") if name in designs else None
    if row is None or not row.slack:
        return ""
    hang = "hangs" if len(row.slack) == 1 else "hang"
    return f"Before any load {listed(row.slack)} {hang} slack"


def way_up_words(way: WayUpRecord) -> str:
    """What brings the grid up."""
    if way.by != SCAFFOLD:
        return "supports that move in"
    return f"a scaffold under every {'' if way.every else 'second '}crossing"


def borne_words(way: WayUpRecord, of: str = "") -> str:
    """How much of their strength rods bear on the way up, said to be `of` that, or that there is none."""
    if way.utilisation is None:
        return f"no stable path by {way_up_words(way)}"
    share = 100.0 * way.utilisation
    digits = 3 if share <= 100.0 else 4  # 100.4 is too much
    return f"{number(share, digits)} %{of} by {way_up_words(way)}"


def raising_words(ways: Sequence[WayUpRecord]) -> str:
    """How a design can be raised, what its rods bear then, and what they would bear otherwise."""
    best = easiest(ways)
    if best.utilisation is None:
        return f"No stable path was found on which the grid goes up: {best.lost}"
    if not best.strength_known:
        return f"The grid goes up by {way_up_words(best)}; the rods' strength, of which they bear some, isn't known"
    others = "".join(f", {borne_words(each)}" for each in ways if each is not best)
    return f"On the way up rods bear up to {borne_words(best, ' of their strength')}{others}"


def exceeds(pull: float, limit: float) -> bool:
    """Whether a cable pulls more than the limit by what is told of both."""
    return pull > limit and newtons(pull) != newtons(limit)


def shape_notes(summary: Summary, name: str) -> list[str]:
    """What is to be noted of the design's shape, a sentence each, if anything is."""
    wished = None if summary.optimisation is None else summary.optimisation.deviation_wished
    notes = far_off_words(summary.designs, name, wished), spent_words(summary.designs, name)
    return [each for each in notes if each]


def spent_words(designs: Mapping[str, DesignRecord], name: str) -> str:
    """What leaving cables away has cost the design of its shape as built, where that is much, and what keeps
    it."""
    initial, own = (_built(designs.get(each)) for each in ("initial", name))
    if initial is None or own is None or own.deviation_mean < _SPENT * initial.deviation_mean:
        return ""
    before, after = (number(1e3 * each.deviation_mean, 2) for each in (initial, own))
    return (
        f"Structures as built were {before} mm off in the mean with all cables, and are {after} mm with those that are left: a "
        "share optimise.built_misfit of the objective, such as 0.3, or a larger one, keeps cables for it"
    )


def far_off_words(designs: Mapping[str, DesignRecord], name: str, wished: float | None) -> str:
    """That the design is farther off its shape than was `wished` for, m, where it is, and what would require
    it."""
    row = designs[name].loads.get("design") if name in designs else None
    if row is None or wished is None or row.deviation_max <= wished:
        return ""
    off, most = (number(1e3 * each) for each in (row.deviation_max, wished))
    if off == most:
        return ""
    return (
        f"The shape is {off} mm off where it is farthest, more than the {most} mm of optimise.deviation, which spares cables for "
        "it and requires nothing; limits.deviation does"
    )


def _built(row: DesignRecord | None) -> BuiltShapeRecord | None:
    """The shape as built under the design load, where it was looked at."""
    load = None if row is None else row.loads.get("design")
    return None if load is None else load.built_shape


def rare_words(found: RareRecord) -> str:
    """How rarely structures as built fall under a load."""
    if found.variation is None:
        rarer = "" if found.probability == 1.0 else f": less than one in {1.0 / found.probability:,.0f}"
        return f"none of {found.structures} structures falls that subset simulation led towards it{rarer}"
    causes = sorted(found.shares.items(), key=lambda each: -each[1])[:2]
    by = " and ".join(f"{cause_title(name)} ({100.0 * share:.0f} %)" for name, share in causes if share > 0.0)
    return (
        f"about one structure in {1.0 / found.probability:,.0f} falls (coefficient of variation "
        f"{found.variation:.2g}, from {found.structures} structures){f', driven by {by}' if by else ''}"
    )


def critical_words(
    factor: float,
    kind: str,
    error: float | None = None,
    halved: float | None = None,
    snap: float | None = None,
) -> str:
    """Where a path ends, and how far that is off by the mesh where it is known; where it doesn't end, but
    does with rod elements `halved`, at which factor, and by a local `snap` of how many m if by one."""
    if kind == "none":
        return f"beyond {factor:.3g} ×{ends_halved(factor, halved, snap)}"
    return f"{factor:.3f} × ({kind})" + ("" if error is None else f" ± {abs(error):.3f}")


def ends_halved(factor: float, halved: float | None, snap: float | None = None) -> str:
    """That a path which doesn't end up to a factor does with rod elements halved, and where that is a local
    `snap`, m, that it bears on; empty where it doesn't."""
    if halved is None or halved >= factor * (1.0 - _SAME):
        return ""
    told = f", but {halved:.3f} × with rod elements halved"
    if snap is None:
        return told
    return f"{told}, where a rod's end or a cell snaps by {number(1e3 * snap, 2)} mm and it bears on"
