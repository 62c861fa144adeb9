"""What the terms of an objective (2) are weighed by: each makes up its share of the value 1 at the start."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design
from shellform.problem.problem import Problem
from shellform.problem.terms import LoadedDesign, measured
from shellform.structure.solve.loading import Loaded


def start_weights(problem: Problem, start: Design, reached: Mapping[str, Loaded]) -> Reals:
    """What the objective's terms are multiplied by, so that each makes up its share of 1 at the start; those
    at a load that the start doesn't bear are taken at the design load.

    A term below 0 makes up its share of -1. Raises InputError for one that is 0, to which no weight gives a
    share.
    """
    base, loads, values = problem.design_load.name, problem.loads, []
    for part in problem.minimise:
        name = part.term.load if part.term.load and reached[part.term.load].on_branch else base
        at = LoadedDesign(problem.shell, start, reached[name].equilibrium.state, loads[name])
        value = float(measured(part.term, at).value.sum())
        if value == 0.0 or not np.isfinite(value):
            raise InputError(
                "has no share of the objective, which is weighed at the start: it must be finite and not 0 there",
                where=f"minimise: {problem.column(part.term)}",
                value=value,
                remedy="Begin from another design, such as one with cables in tension, or leave the term out.",
            )
        values.append(value)
    return np.array([part.share for part in problem.minimise]) / np.abs(values)
