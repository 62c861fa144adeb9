"""Which design is to be built, and the verdict on it: holds, does not hold, or is not examined. What holds
may ask for care all the same, which changes nothing in that. Terminal, summary.json and page all show the one
made here."""

from __future__ import annotations

from collections.abc import Sequence

from shellform.errors import how_many
from shellform.records.check import ADJUSTED, UNASKED, Cell, Check
from shellform.records.checks import BUILT
from shellform.records.summary import VerdictRecord
from shellform.records.words import run_on


def failed(found: Sequence[Check], design: str) -> list[Check]:
    """The checks that don't hold for the design."""
    return _that(found, design, holds=False)


def open_checks(found: Sequence[Check], design: str) -> list[Check]:
    """The checks that were asked for and not, or not enough, examined."""
    return _that(found, design, holds=None)


def asked(found: Sequence[Check], design: str) -> int:
    """How many checks were made of the design."""
    return len(_that(found, design, holds=True)) + len(failed(found, design))


def _that(found: Sequence[Check], design: str, *, holds: bool | None) -> list[Check]:
    """The checks asked for of which the design `holds` so much (None: that isn't known)."""
    cells = ((check, check.cells.get(design, UNASKED)) for check in found)
    return [check for check, cell in cells if cell.asked and cell.holds is holds]


def verdict(found: Sequence[Check], design: str) -> VerdictRecord:
    """Whether the design holds, by its checks: the reason and then the remedy of each that fails."""
    broken = tuple(_sentence(check, check.cells[design]) for check in failed(found, design))
    unknown = tuple(check.name for check in open_checks(found, design))
    cells = [check.cells.get(design, UNASKED) for check in found]
    provided = dict.fromkeys(cell.provided for cell in cells if cell.provided)
    in_order = tuple(sorted(provided, key=lambda each: each != ADJUSTED))  # before what it is adjusted with
    return VerdictRecord(
        design, not broken and not unknown, broken, unknown, _cautions(found, design), in_order
    )


def _cautions(found: Sequence[Check], design: str) -> tuple[str, ...]:
    """What asks for care of a design, each once, after the names of the checks that say it."""
    named: dict[str, list[str]] = {}
    for check in found:
        cell = check.cells.get(design, UNASKED)
        if cell.caution:
            named.setdefault(cell.caution, []).append(check.name)
    return tuple(f"{', '.join(run_on(names))}: {caution}." for caution, names in named.items())


def to_build(found: Sequence[Check], designs: Sequence[str]) -> str:
    """The design to build: of the optimised, rounded and polished ones the last that holds, else the last
    that lacks only examination. Where none does, the last that fails in nothing in which the one before it
    holds, and fails nowhere by more. Before any of them is made, the initial one."""
    built = [name for name in BUILT if name in designs]
    for lacking in (False, True):
        for name in reversed(built):
            if not failed(found, name) and (lacking or not open_checks(found, name)):
                return name
    if not built:
        return "initial" if "initial" in designs else designs[-1]
    best = built[0]
    for name in built[1:]:
        broken, before = failed(found, name), {check.name for check in failed(found, best)}
        worse = any(_worth(check.cells[name]) < _worth(check.cells[best]) for check in broken)
        if {check.name for check in broken} <= before and not worse:
            best = name
    return best


def headline(record: VerdictRecord) -> str:
    """The verdict in a line, the same everywhere."""
    name = f"The {record.design} design"
    if record.failed:
        return f"{name} does not hold: {how_many(len(record.failed), 'check fails', 'checks fail')}."
    if record.not_examined:
        return f"{name} is not examined: {how_many(len(record.not_examined), 'check is', 'checks are')} still open."
    care = f", with {how_many(len(record.cautions), 'caution', 'cautions')}" if record.cautions else ""
    return f"{name} holds{provisos(record)}: all checks do{care}."


def provisos(record: VerdictRecord) -> str:
    """How the design holds, in words that follow "holds"; nothing where it bears being set out."""
    return f", {', '.join(record.provided)}" if record.provided else ""


def _sentence(check: Check, cell: Cell) -> str:
    """Reason, then remedy."""
    return f"{check.name}: {cell.found}, asked for: {check.limit}.{' ' + cell.remedy if cell.remedy else ''}"


def _worth(cell: Cell) -> float:
    """The share of structures that stand, of a cell that tells it; 0 for every other."""
    return cell.share if cell.share is not None else 0.0
