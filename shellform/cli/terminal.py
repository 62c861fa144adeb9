"""What commands show on the terminal: the present step, and what a designer asks first."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from shellform.errors import NotConverged


class Progress:
    """A spinner with the present step on a terminal; what is finished stays as a line, there and elsewhere.
    Nothing if `quiet`.
    """

    def __init__(self, *, quiet: bool = False) -> None:
        from rich.console import Console

        self.console = Console(stderr=True, highlight=False, markup=False, soft_wrap=True, quiet=quiet)
        self.status = self.console.status("starting")
        self.status.start()

    def __call__(self, stage: str, text: str) -> None:
        if text.startswith(("done", "kept", "loading", "no pictures", "note", "size", "going on")):
            self.console.print(f"{stage}: {text}")
        self.status.update(f"{stage}: {text}")

    def close(self) -> None:
        """Ends the spinner."""
        self.status.stop()


def tell_designs(summary: dict[str, Any]) -> None:
    """What a designer asks first."""
    for name, design in summary.get("designs", {}).items():
        row = design["loads"]
        cells = [
            f"{each}: {1e3 * row[each]['deviation_max']:6.1f} mm max, {1e3 * row[each]['deviation_mean']:5.1f} mean"
            + ("" if row[each]["on_branch"] else " (snapped)")
            for each in row
        ]
        print(f"{name:>10}  {design['cables']:4d} cables  " + "   ".join(cells))
    if "optimisation" in summary:
        told = summary["optimisation"]
        print(f"objective {told['objective_start']:.3g} -> {told['objective_end']:.3g}: {told['status']}")
        over = [f"{name} by {value:.1%}" for name, value in told["constraints"].items() if value > 1e-3]
        if over:
            print(f"limits that are not kept: {', '.join(over)}")
    for name, design in summary.get("designs", {}).items():
        if not design.get("critical_factor_kept", True):
            print(
                f"the {name} design loses stability before the critical factor asked for (critical_factor in summary.json)"
            )
    for each in summary.get("sections", []):
        found = (
            f"objective {each['objective']:.3g}, {each['cables']} cables"
            if each["objective"] is not None
            else "no design"
        )
        print(f"{each['section']:>10}  {found}{'' if each['feasible'] else ': ' + each['why_not']}")
    for sentence in summary.get("robust", {}).get("sentences", []):
        print(sentence)


def tell_labelled(lines: Mapping[str, Any]) -> None:
    """Labels and their values, a line each."""
    for label, value in lines.items():
        print(f"{label:>22}  {value}")


def tell_lines(told: Any) -> None:
    """The lines of a command's result, then its files."""
    for line in [*told.lines, *told.files]:
        print(line)


def tell_cases(rows: Iterable[Any]) -> None:
    """The rows of the published cases as they come. Raises NotConverged where a number doesn't hold."""
    failed, cases, number = 0, set(), 0
    head = f"{'case':40} {'quantity':38} {'value':>12} {'reference':>12} {'difference':>10} {'allowed':>8}"
    print(f"{head}       source")
    for row in rows:
        failed += not row.passed
        cases.add(row.case)
        number += 1
        numbers = f"{row.value:12.7g} {row.reference:12.7g} {row.difference:10.1e} {row.tolerance:8.0e}"
        mark = "pass" if row.passed else "FAIL"
        print(f"{row.case:40} {row.quantity:38} {numbers} {mark}  {row.source}", flush=True)
    if failed:
        raise NotConverged(f"{failed} of {number} numbers do not hold")
    print(f"all {number} numbers of {len(cases)} cases hold")
