"""From a case's tables [tolerances] and [safety] to what is asked of a design as built."""

from __future__ import annotations

from dataclasses import fields, replace

from shellform.case.case import Case
from shellform.gridshell.gridshell import Gridshell
from shellform.gridshell.tolerances import Tolerances, default_tolerances
from shellform.reliability.safety import Safety

SEARCHED = 200  # structures at the most with which a search confirms its design


def case_tolerances(case: Case, shell: Gridshell) -> Tolerances:
    """The case's tolerances, those left out by the shell's size. Raises InputError for a value that is
    none.
    """
    given = {each.name: getattr(case.tolerances, each.name) for each in fields(Tolerances)}
    return replace(
        default_tolerances(shell), **{name: value for name, value in given.items() if value is not None}
    )


def case_safety(case: Case, shell: Gridshell) -> Safety | None:
    """What a search has to keep; None where nothing is required. Its seed is the one by which a finished
    design is judged; a search draws under another (reliability/requirements.py), so that the sample that
    is told is a fresh one."""
    entry = case.safety
    if not is_required(case):
        return None
    return Safety(
        tolerances=case_tolerances(case, shell),
        probability_design=entry.probability_design,
        probability_additional=entry.probability_additional,
        critical_factor=critical_factors_asked(case).get("design"),
        drawn=min(entry.drawn, SEARCHED),
        seed=entry.seed,
    )


def critical_factors_asked(case: Case) -> dict[str, float]:
    """The least critical factor by load case."""
    if not is_required(case):
        return {}
    own = case.safety.critical_factor
    return ({"design": own} if own > 0.0 else {}) | case.safety.critical_further


def is_required(case: Case) -> bool:
    """Whether a design has to keep what [safety] asks for: the paper's own method is only told."""
    return case.safety.required and case.optimise.method != "paper"
