"""The stage "safety": every design examined as it will be built.

For every load case the critical factor of the perfect structure, on the design's mesh and with rod elements
halved, and how many of its structures as built stand. Load cases that are shares of a larger one lie on its
path, and are judged on it. Designs to compare with are drawn a few times (`safety.compared`); of those that
may be built, from the last one on, each that isn't known to fail is drawn in full until one holds. Of the one
to build the most likely failure is told, where it falls too often, which rods would stand (thicker.py), and
how it is raised (raised.py).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from shellform.case.build_rod import stock
from shellform.case.build_safety import case_tolerances, critical_factors_asked
from shellform.case.case import Case
from shellform.case.entries import StockRodEntry
from shellform.errors import NotConverged
from shellform.records.as_built import falls, keeps_factor
from shellform.records.checks import BUILT
from shellform.records.drawn import DrawnPath, take_drawn
from shellform.records.failures import FailureRecord, RareRecord
from shellform.records.progress import Event, Kind
from shellform.records.summary import DesignRecord, LoadRecord, StandingRecord, Summary, write_summary
from shellform.records.thicker_rods import ThickerRodsRecord
from shellform.records.verdict import failed, open_checks, to_build
from shellform.reliability.failure import explained
from shellform.reliability.guide import guide
from shellform.reliability.path_of_one import SOUGHT
from shellform.reliability.perfect import perfect
from shellform.reliability.probability import counted
from shellform.reliability.refinement import mesh_error
from shellform.reliability.safety import SAME, paths
from shellform.reliability.standing import Workshop
from shellform.run.figures import FAILURE
from shellform.run.folder import Run, read_run
from shellform.run.judged import asked_as_built, judged, run_checks
from shellform.run.pace import time_words
from shellform.run.raised import raised
from shellform.run.rare_failures import rare_of
from shellform.run.sampling import LOOKED_AT, Clock, Examined, drawn_of
from shellform.run.shape_as_built import adjusted_shape, built_shape
from shellform.run.thicker import rods_that_stand
from shellform.run.workspace import Workspace
from shellform.structure.elements.threads import side_by_side
from shellform.written import write_arrays

_BEYOND = 1.5  # times the factor asked for, up to which a path is followed at least
# In structures drawn, measured: 33 on a scaffold at once, 60 where supports that move in break rods before.
_RAISING_TAKES = 50
_ADJUSTED_TAKES = 30  # the same of the twenty that are adjusted on site
_GUIDED = 0.25  # of the largest load, the steps in which the guide looks along the path


def examine(workspace: Workspace) -> Summary:
    """Examines the run's designs and returns its summary with what was found and the verdict. Raises
    InputError as the run folder's readers."""
    run = read_run(workspace.folder)
    entry = workspace.case.safety
    every = [_of_run(run, name) for name in run.designs]
    summary = fresh = run.summary.unexamined()
    alike = _alike(every, entry.seed)
    own = [each for each in every if each.name not in alike]
    workspace.say("safety", f"critical factors of {len(own)} designs", Kind.BEGAN)

    def examined(each: Examined) -> DesignRecord:
        return _critical(workspace.case, each, fresh.designs[each.name])

    for each, record in zip(own, side_by_side(examined, own), strict=True):
        summary = summary.with_design(each.name, record)
    for name, same in alike.items():
        told, kept = summary.designs[same].loads, summary.designs[same].critical_factor_kept
        record = replace(summary.designs[name], loads=told, critical_factor_kept=kept)
        summary = summary.with_design(name, record)
    write_summary(workspace.folder, summary)
    sampled = [each for each in every if each.name != "unbraced"]
    routes = len(paths(run.loads))
    planned = routes * (entry.compared * len(sampled) + entry.drawn - entry.compared)
    clock = Clock(planned, _RAISING_TAKES + _ADJUSTED_TAKES)
    for each in sampled:
        if each.name in alike:
            take_drawn(workspace.folder, alike[each.name], each.name, each.key(entry.seed))
        summary = _stand(workspace, each, entry.compared, summary, clock)
    if entry.probability_additional is None and "initial" in run.designs:
        summary = _bar(workspace, _of_run(run, "initial"), summary, clock)
    built = {each.name: each for each in sampled if each.name in BUILT}
    for name in reversed(list(built) or ["initial"]):
        now = replace(run, summary=summary)
        if failed(run_checks(now), name):
            continue
        summary = _stand(workspace, built.get(name) or _of_run(run, name), entry.drawn, summary, clock)
        found = run_checks(replace(run, summary=summary))
        if not failed(found, name) and not open_checks(found, name):
            break
    best = ""
    while (leading := to_build(run_checks(replace(run, summary=summary)), list(run.designs))) != best:
        best = leading
        if best != "unbraced":  # in full it may turn out worse than another one that was drawn a few times
            summary = _stand(workspace, _of_run(run, best), entry.drawn, summary, clock)
            summary = _raised(workspace, _of_run(run, best), summary, clock)
    chosen = _of_run(run, best)
    if best != "unbraced":
        summary = _adjusted(workspace, chosen, summary)
        summary = replace(summary, failure=_failure(workspace, chosen, entry.drawn))
        if entry.rare:
            summary = replace(summary, rare=_rare(workspace, chosen))
        if falls(summary.designs, best, asked_as_built(workspace.case)):
            summary = replace(summary, thicker=_thicker(workspace, run))
    return replace(summary, verdict=judged(replace(run, summary=summary)))


def _alike(every: Sequence[Examined], seed: int) -> dict[str, str]:
    """By name, of the designs that are the same as an earlier one the name of the first such: polishing may
    have found none better."""
    first: dict[str, str] = {}
    named = [(each.name, first.setdefault(each.key(seed), each.name)) for each in every]
    return {name: same for name, same in named if same != name}


def _bar(workspace: Workspace, initial: Examined, summary: Summary, clock: Clock) -> Summary:
    """With the initial design drawn in full where it falls under a further load: no fewer are to stand under
    that, and a few structures tell their number by a fifth and more."""
    entry = workspace.case.safety
    for name, row in summary.designs["initial"].loads.items():
        if name != "design" and row.stands is not None and row.stands.standing < row.stands.drawn:
            clock.kept(len(paths(initial.loads)) * (entry.compared - entry.drawn))  # so many more to draw
            return _stand(workspace, initial, entry.drawn, summary, clock)
    return summary


def _raised(workspace: Workspace, each: Examined, summary: Summary, clock: Clock) -> Summary:
    """With how a design can be raised, which the clock counts as what comes afterwards."""
    record = summary.designs[each.name]
    if record.ways_up is not None:
        return summary
    text, left = f"how the {each.name} design is raised", clock.left()
    workspace.report(Event("safety", text, Kind.BEGAN, clock.fraction(), left))
    clock.afterwards = 0
    return summary.with_design(each.name, replace(record, ways_up=raised(each.shell, each.design)))


def _thicker(workspace: Workspace, run: Run) -> ThickerRodsRecord | None:
    """Rods with which the initial design stands as often as is asked."""
    workspace.say("safety", "which rods stand", Kind.BEGAN)
    initial, asked = _of_run(run, "initial"), asked_as_built(workspace.case)
    rod, seed = workspace.case.rod, workspace.case.safety.seed
    return rods_that_stand(
        initial.shell,
        initial.design,
        initial.loads,
        initial.tolerances,
        asked,
        seed=seed,
        catalogue=stock(rod, rod.catalogue) if isinstance(rod, StockRodEntry) else None,
    )


def _of_run(run: Run, name: str) -> Examined:
    shell = run.shell_of(name)
    return Examined(name, shell, run.designs[name], run.loads, case_tolerances(run.case, shell))


def _critical(case: Case, each: Examined, record: DesignRecord) -> DesignRecord:
    """The record of a design with its critical factors, and what its numbers are off by the mesh."""
    asked = critical_factors_asked(case)
    rows = dict(record.loads)
    for largest, shares in paths(each.loads).items():
        followed = "design" if "design" in shares else largest
        rows |= _with_ends({name: rows[name] for name in shares}, each, followed, shares, asked)
    kept = all(keeps_factor(rows[name], least) for name, least in asked.items() if name in rows)
    return replace(record, loads=rows, critical_factor_kept=kept if asked else None)


def _with_ends(
    rows: Mapping[str, LoadRecord],
    each: Examined,
    followed: str,
    shares: Mapping[str, float],
    asked: Mapping[str, float],
) -> dict[str, LoadRecord]:
    """The loads' records with what the path of the one that is `followed` tells of each; their `shares` of
    the largest are given."""
    times = {name: share / shares[followed] for name, share in shares.items()}
    sought = max(SOUGHT, *(_BEYOND * asked.get(name, 0.0) * larger for name, larger in times.items()))
    try:
        error = mesh_error(each.shell, each.design, each.loads[followed], sought=sought)
    except NotConverged as lost:
        return {name: replace(rows[name], critical_kind=f"not found: {lost.what}") for name in shares}
    ended = {}
    for name, larger in times.items():
        ended[name] = replace(
            rows[name],
            critical_sought=sought / larger,
            critical_factor=error.critical.coarse / larger,
            critical_factor_halved=error.critical.fine / larger,
            critical_factor_error=error.critical.error / larger,
            critical_kind=error.kinds[0],
            critical_snap_halved=None if error.snap is None else error.snap.far,
        )
    strength = each.shell.rod.strength
    ended[followed] = replace(
        ended[followed],
        deviation_max_error=error.deviation_max.error,
        deviation_mean_error=error.deviation_mean.error,
        rod_utilisation_error=error.stress.error / strength if np.isfinite(strength) else None,
    )
    return ended


def _stand(workspace: Workspace, each: Examined, count: int, summary: Summary, clock: Clock) -> Summary:
    """With how many of a design's structures stand under each load; unchanged where as many were drawn
    before.
    """
    rows = dict(summary.designs[each.name].loads)
    entry = workspace.case.safety
    for largest, shares in paths(each.loads).items():
        before = rows[largest].stands
        if before is not None and before.drawn >= count and before.seed == entry.seed:
            continue
        path = _drawn(workspace, each, largest, count, clock)
        if path is None:
            continue
        first = before is None
        guided = _guided(each, largest, shares, entry.seed) if first else {}
        for name, share in shares.items():
            own = replace(rows[name], stands=_standing(path, share, workspace.case))
            if name == "design" and (before is None or before.drawn < LOOKED_AT):
                own = replace(own, built_shape=built_shape(path, each, entry.seed))
            rows[name] = replace(own, expected_stiffness=guided.get(name, own.expected_stiffness))
    record = replace(summary.designs[each.name], loads=rows)
    summary = summary.with_design(each.name, record)
    write_summary(workspace.folder, summary)
    return summary


def _adjusted(workspace: Workspace, each: Examined, summary: Summary) -> Summary:
    """With what the design's first structures come to under the design load when they are adjusted on site;
    unchanged where none was looked at."""
    record = summary.designs[each.name]
    row = record.loads["design"]
    if row.built_shape is None or not each.tolerances.causes:
        return summary
    workspace.say("safety", f"the {each.name} design adjusted on site", Kind.BEGAN)
    entry = workspace.case.safety
    shape = adjusted_shape(workspace.folder, each, entry.drawn, entry.seed)
    if shape is None:
        text = (
            f"no structure of the {each.name} design rests under the design load once it is adjusted on site"
        )
        workspace.say("safety", text, Kind.NOTE)
    own = replace(record, loads={**record.loads, "design": replace(row, adjusted_shape=shape)})
    return summary.with_design(each.name, own)


def _drawn(workspace: Workspace, each: Examined, load: str, count: int, clock: Clock) -> DrawnPath | None:
    """The first structures of a design under a load; None, and a note, where the perfect one has no unloaded
    equilibrium."""

    def tell(done: int) -> None:
        left = clock.left()
        workspace.report(
            Event(
                "safety",
                f"{each.name} design as built: structure {done} of {count} under the load “{load}”, about {time_words(left)} left of this stage",
                fraction=clock.fraction(),
                seconds_left=left,
            )
        )

    try:
        return drawn_of(
            workspace.folder,
            each,
            load,
            count=count,
            seed=workspace.case.safety.seed,
            clock=clock,
            tell=tell,
        )
    except NotConverged as error:
        workspace.say("safety", f"the {each.name} design was not drawn: {error.what}", Kind.NOTE)
        return None


def _guided(each: Examined, largest: str, shares: Mapping[str, float], seed: int) -> dict[str, float]:
    """The guide (reliability/guide.py) for the loads, whose `shares` of the largest are given; a load to
    which the perfect path doesn't lead has none."""
    nominal = perfect(each.shell, each.design, each.loads[largest], shapes=0, step=_GUIDED)
    found = guide(nominal, each.tolerances, seed=seed)
    return {
        name: found.least_to(share)
        for name, share in shares.items()
        if found.factors[-1] >= share * (1.0 - SAME)
    }


def _standing(path: DrawnPath, share: float, case: Case) -> StandingRecord:
    """Under a load that is a share of the path's own."""
    fallen = {
        number: factor
        for number, (factor, stands) in enumerate(zip(path.factors, path.stand, strict=True))
        if not stands and (share == 1.0 or factor < share * (1.0 - SAME))
    }
    snaps = {own.number: own for own in path.snaps if own.factor < share and own.number not in fallen}
    drawn = len(path.factors)
    entry = case.safety
    found = counted(drawn, drawn - len(fallen), seed=entry.seed, confidence=entry.confidence)
    return StandingRecord(
        drawn,
        found.standing,
        found.at_least,
        entry.confidence,
        entry.seed,
        min(fallen.values(), default=share) / share,
        len(snaps),
        max((own.far for own in path.snaps if own.number in snaps and own.factor < share), default=0.0),
    )


def _rare(workspace: Workspace, each: Examined) -> tuple[RareRecord, ...] | None:
    """How rarely a design's structures fall under each load; None, and a note, where the perfect one has no
    unloaded equilibrium."""
    entry = workspace.case.safety

    def tell(load: str, done: int) -> None:
        text = f"how rarely the {each.name} design falls under the load “{load}”: structure {done}"
        workspace.report(Event("safety", text))

    try:
        return tuple(
            rare_of(
                workspace.folder,
                each,
                load,
                count=entry.rare,
                seed=entry.seed,
                tell=partial(tell, load),
            )
            for load, force in each.loads.items()
            if force.any()
        )
    except NotConverged as error:
        workspace.say("safety", f"how rarely it falls was not found: {error.what}", Kind.NOTE)
        return None


def _failure(workspace: Workspace, each: Examined, count: int) -> FailureRecord | None:
    """How a design most likely fails, under the smallest load under which one of its structures falls by
    itself; None where none does."""
    workspace.path(FAILURE).unlink(missing_ok=True)
    if not each.tolerances.causes:  # the perfect structure falls, of which its critical factor tells
        return None
    clock = Clock(0)
    lies = {load: (largest, own[load]) for largest, own in paths(each.loads).items() for load in own}
    loaded = [load for load in each.loads if load in lies]
    for load in sorted(loaded, key=lambda name: float(np.linalg.norm(each.loads[name]))):
        route, share = lies[load]
        path = _drawn(workspace, each, route, count, clock)
        if path is None:
            continue
        fallen = sorted(
            (factor / share, number)
            for number, factor in enumerate(path.factors)
            if 0.0 < factor < min(share, 1.0) * (1.0 - SAME)
        )
        if not fallen:
            continue
        _, number = fallen[len(fallen) // 2]
        workspace.say("safety", f"how structure {number} fails", Kind.BEGAN)
        workshop = Workshop(perfect(each.shell, each.design, each.loads[route]))
        found = explained(workshop, each.tolerances, seed=workspace.case.safety.seed, number=number)
        write_arrays(
            workspace.path(FAILURE),
            positions=found.state.positions,
            quaternions=found.state.quaternions,
            mode=found.mode,
        )
        return FailureRecord(
            each.name,
            load,
            number,
            found.factor / share,
            found.kind,
            found.driver,
            {cause: factor / share for cause, factor in found.without.items()},
            tuple(f"C{k}" for k in found.cables),
        )
    return None
