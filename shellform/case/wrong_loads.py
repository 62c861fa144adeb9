"""What of a case's loads can't be whatever its net is: seen before there is one."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from shellform.case.build_gridshell import cases_of_parts, parts_used
from shellform.case.build_rod import rod_material
from shellform.case.build_safety import critical_factors_asked
from shellform.case.case import Case
from shellform.case.entries import LoadEntry, RodsWeightEntry
from shellform.errors import InputError, require_known
from shellform.gridshell.loads import require_density


def refuse_loads(case: Case) -> None:
    """Raises InputError for load cases that weigh nothing, add no parts or have one name, for names of none,
    and for rods whose weight isn't known where it is a load."""
    if isinstance(case.load, LoadEntry):
        refuse_unknown(case, ("none", "design", "additional"))
        return
    used = parts_used(case.load)
    for name in used:
        if isinstance(case.part[name], RodsWeightEntry):
            try:
                require_density(rod_material(case.rod))
            except InputError as error:
                raise error.within(f"part.{name}") from error
    # Loads of a node for each part: what they add up to shows which parts count, and nothing cancels out.
    rows = np.eye(len(used))[:, :, None] * np.ones(6)
    refuse_unknown(case, cases_of_parts(case.load, dict(zip(used, rows, strict=True))))


def refuse_unknown(case: Case, loads: Collection[str]) -> None:
    """Raises InputError for limits under load cases that aren't among those called `loads`."""
    others = [name for name in loads if name not in ("none", "design")]
    for name in critical_factors_asked(case):
        if name != "design":
            require_known(name, others, where="safety.critical_further", what="there is no such load case")
    for name in case.limits.slack_loads if case.limits.slack_min is not None else ():
        require_known(name, loads, where="limits.slack_loads", what="there is no such load case")
