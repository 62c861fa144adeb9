"""The checks of a run, and the verdict on its design to build."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from shellform.case.build_rod import rod_sizes
from shellform.case.build_safety import critical_factors_asked, is_required
from shellform.case.case import Case
from shellform.records.as_built import AsBuilt, Farthest
from shellform.records.check import Cell, Check
from shellform.records.checks import checks
from shellform.records.limited import Bounds
from shellform.records.stages import SHOWING
from shellform.records.summary import VerdictRecord
from shellform.records.verdict import to_build, verdict
from shellform.run.folder import Run
from shellform.run.sizes import OF_SPAN, may_come_off

_SKETCH = Cell("a sketch: coarse elements, few evaluations, no structures drawn", None)


def run_checks(run: Run) -> list[Check]:
    """Every check of the run's designs."""
    limits = run.case.limits
    bounds = Bounds(
        force=run.case.cable.force_max,
        misfit=run.case.optimise.misfit_rms_additional,
        deviation=limits.deviation,
        built=limits.built_deviation,
        unloaded=limits.unloaded_deviation,
        stress=limits.utilisation,
        turn=limits.connector_turn,
        uplift=limits.uplift,
        thrust=limits.thrust,
        slack=limits.slack_min,
        slack_loads=tuple(limits.slack_loads),
        critical=critical_factors_asked(run.case),
        safety=replace(asked_as_built(run.case), snap=_farthest_snap(run)),
        rods=rod_sizes(
            run.case.rod,
            run.shell.rod,
            free=run.case.optimise.rod_radius > 0.0,
            keeps=limits.utilisation is not None,
            least=run.case.optimise.radius_min,
        ),
        uncovered=run.case.net.uncovered_max,
        pull=limits.cable_utilisation,
    )
    found = checks({name: run.shell_of(name) for name in run.designs}, run.designs, run.summary, bounds)
    if run.summary.sketch:
        found = [*found, Check("Full job", "done", dict.fromkeys(run.designs, _SKETCH))]
    return found


def asked_as_built(case: Case) -> AsBuilt:
    """How many drawn structures the case asks to stand."""
    safety = case.safety
    return AsBuilt(safety.probability_design, safety.probability_additional, safety.drawn, is_required(case))


def _farthest_snap(run: Run) -> Farthest:
    """How far a structure as built may snap on its way without asking for care: the least of the deviations
    that the case limits or wishes for, and where it says none, what `new` would wish for."""
    limits = run.case.limits
    said = {
        "limits.built_deviation": limits.built_deviation,
        "limits.deviation": limits.deviation,
        "optimise.deviation": run.case.optimise.deviation,
    }
    known = [Farthest(far, entry) for entry, far in said.items() if far is not None]
    usual = Farthest(may_come_off(run.surface, 0.0), f"a {OF_SPAN:g}th of the span")
    return min(known, key=lambda each: each.far, default=usual)


def judged(run: Run) -> VerdictRecord:
    """The verdict on the run's design to build."""
    found = run_checks(run)
    record = verdict(found, to_build(found, list(run.designs)))
    return broken_off(record, run.summary.failed)


def broken_off(record: VerdictRecord, failed: Mapping[str, str]) -> VerdictRecord:
    """The verdict where a stage ended without a result: that is what fails first."""
    ended = tuple(
        f"The stage “{stage}” ended without a result: {why}"
        for stage, why in failed.items()
        if stage not in SHOWING
    )
    return replace(record, holds=False, failed=(*ended, *record.failed)) if ended else record
