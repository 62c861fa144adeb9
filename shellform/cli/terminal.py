"""What commands show on the terminal: the present step, and what a designer asks first."""

from __future__ import annotations

import errno
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from shellform.cli.interruption import heed
from shellform.errors import InputError, NotConverged, printable
from shellform.records.progress import Event, Kind

if TYPE_CHECKING:
    from shellform.records.summary import Summary, VerdictRecord
    from shellform.run.onsite import SiteResult

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LASTING = (Kind.BEGAN, Kind.NOTE, Kind.KEPT, Kind.DONE)  # which stay as lines


class Spinner:
    """A spinner with the present step on a terminal, until its `with` ends; what is finished stays as a line,
    there and elsewhere. Nothing if `quiet`.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        from rich.console import Console

        self.console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True, quiet=quiet)
        self.status = self.console.status("starting")

    def __enter__(self) -> Spinner:
        self.status.start()
        return self

    def __call__(self, event: Event) -> None:
        heed()
        if event.kind in _LASTING:
            self.console.print(f"{event.stage}: {event.text}")
        self.status.update(f"{event.stage}: {event.text}")

    def __exit__(self, *_: object) -> None:
        self.status.stop()


def refusal_words(error: Exception) -> tuple[str, int] | None:
    """What is said of an error, and the status with which it ends a command; None for one that is no one's
    but ours."""
    if isinstance(error, InputError):
        return f"refused: {error}", 2
    if isinstance(error, NotConverged):
        return f"no result: {error}", 3
    if isinstance(error, MemoryError):
        return "no result: the memory is full. Choose a larger spacing or fewer elements.", 3
    system = _system_words(error) if isinstance(error, OSError) else None
    if system is not None:
        return f"refused: {system}", 2
    if getattr(error, "exit_code", None) is None:
        return None
    told = getattr(error, "format_message", None)  # click's usage errors
    context = getattr(error, "ctx", None)
    remedy = f". {context.command_path} --help lists what it takes." if context else ""
    return f"refused: {str(told() if told else error).rstrip('.')}{remedy or '.'}", 2


def _system_words(error: OSError) -> str | None:
    """Of what the system refuses what can be met anywhere and isn't our fault; None for the rest."""
    if error.errno == errno.ENAMETOOLONG:
        return f"{str(error.filename)[:30]} …: the file's name is too long"
    if error.errno in _FULL:  # a file of a run tells it itself: what is left is written without a name
        place = printable(str(error.filename or "standard output or a temporary file"))
        return (
            f"{place}: can't be written: {error.strerror}. Free some space, then run the same command again."
        )
    if isinstance(error, PermissionError) and error.filename:
        return (
            f"{printable(str(error.filename))}: can't be read or written: {error.strerror}. "
            "Give yourself the right to, or name another place."
        )
    return None


def tell_designs(summary: Summary) -> None:
    """What a designer asks first."""
    from shellform.optimiser.limits_told import not_kept
    from shellform.quantities import number

    for name, design in summary.designs.items():
        cells = [
            f"{load}: {1e3 * row.deviation_max:6.1f} mm max, {1e3 * row.deviation_mean:5.1f} mean"
            + ("" if row.on_branch else " (snapped)")
            for load, row in design.loads.items()
        ]
        print(f"{name:>10}  {design.cables:4d} cables  " + "   ".join(cells))
    found = summary.optimisation
    if found is not None:
        print(f"objective {number(found.objective_start)} -> {number(found.objective_end)}: {found.status}")
        over = not_kept(found.constraints)
        if over:
            print(f"limits that the optimised design doesn't keep: {', '.join(over)}")
    for each in summary.sections or ():
        tried = (
            "no design"
            if each.objective is None
            else f"objective {number(each.objective)}, {each.cables} cables"
        )
        print(f"{each.section:>10}  {tried}{'' if each.feasible else ': ' + each.why_not}")
    for sentence in () if summary.robust is None else summary.robust.sentences:
        print(sentence)
    tell_as_built(summary)
    if summary.verdict is not None:
        tell_verdict(summary.verdict)


def tell_verdict(verdict: VerdictRecord) -> None:
    """Whether the design to build holds; each check that fails or could not be made, and what asks for
    care."""
    from shellform.records.verdict import headline

    print(headline(verdict))
    for sentence in verdict.failed:
        print(f"  fails: {sentence}")
    for name in verdict.not_examined:
        print(f"  not examined: {name}")
    for sentence in verdict.cautions:
        print(f"  caution: {sentence}")


def tell_as_built(summary: Summary) -> None:
    """Of each design, up to which factor its loads may grow and how many drawn structures stand; how the one
    to build fails first."""
    from shellform.quantities import number
    from shellform.records.words import (
        adjusted_words,
        before_load_words,
        built_shape_words,
        cause_title,
        critical_words,
        fallen_at,
        goes_slack_words,
        raising_words,
        rare_words,
        shape_notes,
        standing_words,
    )

    for name, design in summary.designs.items():
        for load, row in design.loads.items():
            parts = []
            if row.critical_factor is not None and row.critical_kind is not None:
                end = critical_words(
                    row.critical_factor,
                    row.critical_kind,
                    row.critical_factor_error,
                    row.critical_factor_halved,
                    row.critical_snap_halved,
                )
                parts.append(f"critical factor {end}")
            if row.stands is not None:
                own = row.stands
                parts.append(standing_words(own))
            if row.built_shape is not None:
                parts.append(built_shape_words(row.built_shape))
            if row.adjusted_shape is not None:
                parts.append(adjusted_words(row.adjusted_shape))
            if row.expected_stiffness is not None:
                parts.append(f"softest mode as built {number(row.expected_stiffness)} N/m")
            if parts:
                print(f"{name:>10}  {load}: {', '.join(parts)}")
    if summary.verdict is not None:
        name = summary.verdict.design
        slack = before_load_words(summary.designs, name)
        if slack and summary.documents is not None:
            slack += ": schedules/cables.csv"
        ways = summary.designs[name].ways_up if name in summary.designs else None
        raised = raising_words(ways) if ways else ""
        for note in (*shape_notes(summary, name), slack, raised):
            if note:
                print(f"{note}.")
    found = summary.failure
    if found is not None:
        slack = goes_slack_words(found.cables)
        cables = f"; {slack}" if slack else ""
        print(
            f"fails first: structure {found.number} at {fallen_at(found.factor)} of the load “{found.load}” ({found.kind}), "
            f"driven by {cause_title(found.driver)}, without which it bears {found.without[found.driver]:.2f}{cables}"
        )
    for rare in summary.rare or ():
        print(f"how rarely, {rare.design} under the load “{rare.load}”: {rare_words(rare)}")


def tell_labelled(lines: Mapping[str, Any]) -> None:
    """Labels and their values, a line each."""
    for label, value in lines.items():
        print(f"{label:>22}  {value}")


def tell_lines(result: SiteResult) -> None:
    """The lines of a command's result, then its files."""
    for line in [*result.lines, *result.files]:
        print(line)


def tell_cases(rows: Iterable[Any]) -> None:
    """The rows of the published cases as they come. Raises NotConverged where a number doesn't hold."""
    failed, cases, number = 0, set(), 0
    head = f"{'case':40} {'quantity':38} {'value':>12} {'reference':>12} {'difference':>10} {'allowed':>8}"
    print(f"{head}       source")
    for row in rows:
        heed()
        failed += not row.passed
        cases.add(row.case)
        number += 1
        numbers = f"{row.value:12.7g} {row.reference:12.7g} {row.difference:10.1e} {row.tolerance:8.0e}"
        mark = "pass" if row.passed else "FAIL"
        print(f"{row.case:40} {row.quantity:38} {numbers} {mark}  {row.source}", flush=True)
    if failed:
        raise NotConverged(
            f"{failed} of {number} numbers do not hold",
            remedy="Tell us, with what shellform --version says.",
        )
    print(f"all {number} numbers of {len(cases)} cases hold")
