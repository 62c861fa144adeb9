"""What plots of a search take, read from its history."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from shellform.errors import InputError


@dataclass(frozen=True)
class History:
    """What the plots take: one entry an accepted design."""

    evaluation: list[float]
    terms: dict[str, list[float]]
    constraints: dict[str, list[float]]
    cables: list[float] | None


def read_history(table: Mapping[str, Sequence[object]] | Iterable[Mapping[str, object]]) -> History:
    """The columns of an optimiser's history, from rows (as of csv.DictReader on history.csv) or from named
    columns.

    Wanted: `evaluation` (or `iteration`), `term.NAME` and `constraint.NAME` for each; `cables` and `accepted`
    if there. Rows with `accepted` 0 are left out. Raises InputError for missing columns, ragged ones and what
    is no number.
    """
    columns = dict(table) if isinstance(table, Mapping) else _turned(list(table))
    step = next((name for name in ("evaluation", "iteration") if name in columns), None)
    if step is None or not len(columns[step]):
        raise InputError(
            "has no rows with a column evaluation or iteration",
            where="history",
            value=sorted(columns),
            remedy="Draw the history.csv of a run that has been optimised.",
        )
    wanted = [
        step,
        *(
            name
            for name in columns
            if name.startswith(("term.", "constraint.")) or name in ("cables", "accepted")
        ),
    ]
    numbers: dict[str, list[float]] = {}
    for name in wanted:
        try:
            numbers[name] = [float(value) for value in columns[name]]  # type: ignore[arg-type]
        except (TypeError, ValueError) as error:
            raise InputError(
                f"column {name} must be numbers: {error}",
                where="history",
                remedy="Leave that column out, or write nan where a number is missing.",
            ) from error
        if len(numbers[name]) != len(columns[step]):
            raise InputError(
                f"column {name} and {step} differ in length",
                where="history",
                value=len(numbers[name]),
                remedy=f"Give {len(columns[step])} values, nan where one is missing.",
            )
    keep = [bool(flag) for flag in numbers.pop("accepted", [1.0] * len(columns[step]))]
    kept = {
        name: [v for v, good in zip(values, keep, strict=True) if good] for name, values in numbers.items()
    }

    def group(prefix: str) -> dict[str, list[float]]:
        return {name.removeprefix(prefix): values for name, values in kept.items() if name.startswith(prefix)}

    return History(kept[step], group("term."), group("constraint."), kept.get("cables"))


def _turned(rows: Sequence[Mapping[str, object]]) -> dict[str, Sequence[object]]:
    names = list(rows[0]) if rows else []
    for number, row in enumerate(rows):
        if list(row) != names:
            raise InputError(
                f"row {number} has other columns than the first",
                where="history",
                value=sorted(row),
                remedy=f"Give every row {', '.join(map(str, names))}, in that order.",
            )
    return {name: [row[name] for row in rows] for name in names}
