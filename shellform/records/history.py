"""history.csv: a row a trial of the optimiser, written from its steps and read back as the same."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path

from shellform.errors import ANEW, Damaged
from shellform.optimiser.optimum import Step, by_constraint
from shellform.tables import Table, table_text
from shellform.written import write_text

FILE = "history.csv"
_TERM, _CONSTRAINT = "term.", "constraint."


def write_history(folder: Path, history: Sequence[Step]) -> None:
    """Writes history.csv into a run folder. Raises InputError where it can't be written."""
    terms, constraints = list(history[0].terms), list(by_constraint(history))
    names = [f"{_TERM}{name}" for name in terms] + [f"{_CONSTRAINT}{name}" for name in constraints]
    heads = ("evaluation", "accepted", "objective", *names, "cables", "stage", "seconds")
    rows = tuple(
        (
            step.evaluation,
            int(step.accepted),
            step.objective,
            *(step.terms[name] for name in terms),
            *(step.constraints.get(name) for name in constraints),
            step.cables,
            step.stage,
            round(step.seconds, 3),
        )
        for step in history
    )
    write_text(folder / FILE, table_text(Table("history", heads, rows), exact=True, line_end="\r\n"))


def read_history(folder: Path) -> tuple[Step, ...]:
    """The steps in a run folder; none where nothing was optimised. Raises InputError where the file is
    damaged: a column missing, or no number in a cell.
    """
    path = folder / FILE
    if not path.is_file():
        return ()
    try:
        with path.open(encoding="utf-8", newline="") as rows:
            return tuple(_step(number, row) for number, row in enumerate(csv.DictReader(rows), 1))
    except KeyError as error:
        raise Damaged(
            f"is damaged: column {error.args[0]} is missing", where=str(path), remedy=ANEW
        ) from error
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise Damaged(f"is damaged: {error}", where=str(path), remedy=ANEW) from error


def _step(number: int, row: Mapping[str, str]) -> Step:
    if None in row or None in row.values():  # as DictReader leaves cells too many, and too few
        raise ValueError(f"row {number} has another length than the heads")
    return Step(
        evaluation=int(row["evaluation"]),
        objective=float(row["objective"]),
        terms=_group(row, _TERM),
        constraints=_group({name: value for name, value in row.items() if value}, _CONSTRAINT),
        cables=int(row["cables"]),
        stage=float(row["stage"]),
        accepted=bool(int(row["accepted"])),
        seconds=float(row["seconds"]),
    )


def _group(row: Mapping[str, str], prefix: str) -> dict[str, float]:
    return {name.removeprefix(prefix): float(row[name]) for name in row if name.startswith(prefix)}
