"""The design problem (equations 2 to 6): what is varied, under which load cases, what is minimised and what
is kept."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record, reals
from shellform.errors import InputError
from shellform.gridshell.gridshell import Gridshell
from shellform.problem.constraints import Constraint, count
from shellform.problem.terms import Share, Term
from shellform.problem.variables import RestLengths, Variable

FEASIBLE = 1e-3  # largest violation, over the limit, of a design that counts as feasible


@dataclass(frozen=True, eq=False)
class LoadCase(Record):
    """A `name` by which terms refer to the dead load `force` (n, 6), N and Nm."""

    name: str
    force: Reals

    def __post_init__(self) -> None:
        if not self.name:
            raise InputError(
                "a load case needs a name", where="problem", remedy='Give one, as in LoadCase("wet", force).'
            )
        object.__setattr__(self, "force", reals(f"load case {self.name!r}: force", self.force, (None, 6)))

    def __repr__(self) -> str:
        loaded = int(self.force.any(axis=1).sum())
        return f"LoadCase({self.name!r}, {loaded} of {len(self.force)} nodes loaded)"


@dataclass(frozen=True, eq=False)
class Problem:
    """Minimise the sum of `minimise`, subject to `constraints`, over the `variables` of a `shell` that bears
    the `design_load` and `further` load cases.

    `decisive` names the load case at which the stiffness that cables give against buckling is looked at;
    where it isn't named, the one with the largest forces. `built_under` names those under which the design
    has to stand as built, where that is asked for; where none is named, all.
    """

    shell: Gridshell
    design_load: LoadCase
    minimise: Sequence[Share]
    constraints: Sequence[Constraint] = ()
    further: Sequence[LoadCase] = ()
    variables: Sequence[Variable] = (RestLengths(),)
    decisive: str = ""
    built_under: Sequence[str] = ()

    def __post_init__(self) -> None:
        names = [case.name for case in self.load_cases]
        if len(set(names)) < len(names):
            raise InputError(
                "two load cases have the same name",
                where="problem",
                value=", ".join(names),
                remedy="Give each load case a name of its own.",
            )
        for name in sorted({term.load for term in self.terms} | {self.decisive, *self.built_under}):
            if name and name not in names:
                raise InputError(
                    f"there is no load case {name!r}", where="problem", remedy=f"Known: {', '.join(names)}."
                )
        if not self.variables:
            raise InputError(
                "nothing is varied", where="problem.variables", remedy="Name variables, as RestLengths()."
            )
        total = sum(part.share for part in self.minimise)
        if abs(total - 1.0) > 1e-9:
            raise InputError(
                "the shares of the objective must add up to 1",
                where="problem.minimise",
                value=total,
                remedy="Divide each share by their sum.",
            )

    def __repr__(self) -> str:
        loads = ", ".join(case.name for case in self.load_cases)
        return f"Problem({self.shell!r}, loads {loads}, {len(self.minimise)} terms, {len(self.constraints)} constraints)"

    @property
    def load_cases(self) -> list[LoadCase]:
        """The design load, then the further ones."""
        return [self.design_load, *self.further]

    @property
    def loads(self) -> dict[str, Reals]:
        """Forces (n, 6) of the load cases by name."""
        return {case.name: case.force for case in self.load_cases}

    @property
    def terms(self) -> list[Term]:
        """The terms of the objective, then those of the constraints."""
        return [part.term for part in self.minimise] + [part.term for part in self.constraints]

    def column(self, term: Term) -> str:
        """A term's name in histories: its own, and its load case's where that isn't the design load."""
        return term.name if term.load in ("", self.design_load.name) else f"{term.name}.{term.load}"

    def used(self) -> list[str]:
        """The load cases that are needed: the design load and those of the terms."""
        needed = {term.load for term in self.terms} | {self.design_load.name}
        return [name for name in self.loads if name in needed]

    def decisive_load(self) -> str:
        """The name of the load case at which the stiffness that cables give is looked at, one that is
        used.
        """
        used, loads = self.used(), self.loads
        if self.decisive in used:
            return self.decisive
        return max(used, key=lambda name: float(np.linalg.norm(loads[name])))

    def places(self) -> list[slice]:
        """Where each constraint's residuals stand among all of them."""
        ends = np.cumsum([0, *(count(part, self.shell) for part in self.constraints)])
        return [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
