"""Drawn structures as scenarios of a design problem: how much of a load each bears, with exact derivatives.

A scenario is a drawn structure that a search keeps in mind: its errors and the shapes of its imperfections
stay while the design changes, it is loaded from nothing on its own path, and how much of a load it bears has a
value and exact derivatives (borne.py), whether it falls or stands. So a design in which it falls can be led to
one in which it stands.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices
from shellform.errors import InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.problem.problem import LoadCase
from shellform.problem.terms import LoadedDesign, Measurement, Term
from shellform.reliability.borne import BorneFactor, borne
from shellform.reliability.drawing import Errors, Imperfections, built_beams, errors_of, variables
from shellform.reliability.path_of_one import Loading
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop
from shellform.structure.answers.stability import modes
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.threads import side_by_side
from shellform.structure.network import assemble

_STIFFNESS_LEFT = 0.1  # of the unloaded perfect structure's


@dataclass(frozen=True)
class Scenario:
    """A drawn structure: its `number` under a seed, and its `errors`."""

    number: int
    errors: Errors


@dataclass(frozen=True)
class FactorsAsBuilt(Term):
    """The factors of the load `case` up to which the `scenarios`, whose shapes have these `imperfections`, keep
    the stiffness `left`, N/m, none followed beyond `most`: one value a scenario. Each has an equilibrium of
    its own, so that the term needs none of the perfect structure's."""

    name = "factor_as_built"
    stabilises = True
    case: LoadCase
    scenarios: tuple[Scenario, ...]
    imperfections: Imperfections
    left: float
    most: float = 1.5
    load: str = ""

    def __post_init__(self) -> None:
        for name in ("left", "most"):
            value = getattr(self, name)
            if not (value > 0.0 and np.isfinite(value)):
                raise InputError("must be positive and finite", where=f"factors_as_built.{name}", value=value)

    def size(self, shell: Gridshell) -> int:
        """One value a scenario."""
        return len(self.scenarios)

    def measure(self, at: LoadedDesign) -> Measurement:
        """The factors. Raises NotConverged where a structure has no unloaded equilibrium."""
        shell, design = at.shell, at.design
        rate = shell.beams_by_radius(design.radius)
        found = borne_factors(shell, design, self, rates=(rate,))
        rows = np.zeros((len(found), len(shell.cable_ends)))
        rows[:, design.present] = [each.factor_by_rest_length for each in found]
        return Measurement(
            np.array([each.factor for each in found]),
            by_rest_length=sp.csr_array(rows),
            by_radius=np.array([each.factor_by_rate[0] for each in found]),
        )


def scenarios(
    shell: Gridshell,
    design: Design,
    case: LoadCase,
    tolerances: Tolerances,
    *,
    seed: int,
    numbers: Indices,
    most: float = 1.5,
) -> FactorsAsBuilt:
    """The drawn structures of these `numbers` under the `seed` as scenarios of the load `case`; imperfections
    of shape follow the softest modes of this `design`. Raises NotConverged where it has no unloaded
    equilibrium."""
    nominal = perfect(shell, design, case.force)
    left = _STIFFNESS_LEFT * float(modes(assemble(nominal.network), nominal.unloaded, 1).stiffness[0])
    drawn = tuple(
        Scenario(
            int(number), errors_of(nominal.members, tolerances, variables(nominal.members, seed, int(number)))
        )
        for number in numbers
    )
    return FactorsAsBuilt(case, drawn, nominal.imperfections, left, most)


def borne_factors(
    shell: Gridshell, design: Design, asked: FactorsAsBuilt, *, rates: tuple[Beams, ...] = ()
) -> list[BorneFactor]:
    """The factor of each scenario and its derivatives by the rest lengths and by variables on which the
    beams' stiffness depends at one of the `rates`. Raises NotConverged."""
    shape = asked.imperfections
    nominal = perfect(shell, design, asked.case.force, shapes=0, followed=False)
    workshop = Workshop(replace(nominal, imperfections=shape))

    def one(scenario: Scenario) -> BorneFactor:
        def followed(loading: Loading) -> BorneFactor:
            built = tuple(built_beams(rate, scenario.errors, shape) for rate in rates)
            return borne(loading, left=asked.left, most=asked.most, rates=built)

        return workshop.with_structure(scenario.errors, followed, number=scenario.number)

    return side_by_side(one, list(asked.scenarios))
