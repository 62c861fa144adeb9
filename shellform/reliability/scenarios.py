"""Drawn structures as scenarios of a design problem: how much of a load each bears, with exact derivatives.

A scenario is a drawn structure that a search keeps in mind: its errors and the shapes of its imperfections
stay while the design changes, it is loaded from nothing on its own path, and how much of a load it bears has
a value and exact derivatives (borne.py), whether it falls or stands. So a design in which it falls can be led
to one in which it stands. Once it was followed in a design (`remembered`), it is loaded in designs nearby
from a state not far from its end, where Newton's steps lead there with every tangent definite.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import scipy.sparse as sp

from shellform.errors import NotConverged, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.problem.problem import LoadCase
from shellform.problem.terms import LoadedDesign, Measurement, Term
from shellform.reliability.borne import CAREFUL, EXACT, BorneFactor, borne
from shellform.reliability.drawing import Errors, Imperfections, built_beams, draw_errors
from shellform.reliability.path_of_one import Loading
from shellform.reliability.perfect import perfect
from shellform.reliability.standing import Workshop
from shellform.structure.answers.stability import modes
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.state import State
from shellform.structure.elements.threads import side_by_side
from shellform.structure.network import assemble

_STIFFNESS_LEFT = 0.1  # of the unloaded perfect structure's
_BEFORE = 0.9  # of the factor that a scenario bears, where it is remembered …
_BEFORE_RESOLUTION = 1 / 16  # … or this much of the load before


@dataclass(frozen=True, eq=False)
class Scenario:
    """A drawn structure: its `number` under a seed, its `errors`, the factor of the load that it is to bear
    at `least`, and where it is remembered, a factor that it bears with its state, `near`."""

    number: int
    errors: Errors
    least: float = 1.0
    near: tuple[float, State] | None = None


@dataclass(frozen=True, eq=False)
class FactorsAsBuilt(Term):
    """The factors of the load `case` up to which the `scenarios`, whose shapes have these `imperfections`,
    keep the stiffness `left`, N/m, over those that they are to bear: one value a scenario, none followed
    beyond the factor `most`, the end of none sought closer than to a relative error `exact` of the stiffness
    left. Each has an equilibrium of its own, so that the term needs none of the perfect structure's."""

    name = "factor_as_built"
    stabilises = True
    case: LoadCase
    scenarios: tuple[Scenario, ...]
    imperfections: Imperfections
    left: float
    most: float = 1.5
    exact: float = EXACT
    load: str = ""

    def __post_init__(self) -> None:
        for name, give in [
            ("left", "N/m, a share of what the softest mode has, such as 1"),
            ("most", "a factor of the load, such as 1.5"),
            ("exact", f"a resolution of the factor, such as {EXACT:g}"),
        ]:
            require_number(getattr(self, name), above=0.0, where=f"factors_as_built.{name}", give=give)

    def size(self, shell: Gridshell) -> int:
        """One value a scenario."""
        return len(self.scenarios)

    def measure(self, at: LoadedDesign) -> Measurement:
        """The factors over the least ones. Raises NotConverged where a structure has no unloaded
        equilibrium."""
        shell, design = at.shell, at.design
        rate = shell.beams_by_radius(design.radius)
        found = borne_factors(shell, design, self, rates=(rate,))
        share = 1.0 / np.array([each.least for each in self.scenarios])
        rows = np.zeros((len(found), len(shell.cable_ends)))
        rows[:, design.present] = [each.factor_by_rest_length for each in found]
        return Measurement(
            share * np.array([each.factor for each in found]),
            by_rest_length=sp.csr_array(share[:, None] * rows),
            by_radius=share * np.array([each.factor_by_rate[0] for each in found]),
        )


def scenarios(
    shell: Gridshell,
    design: Design,
    case: LoadCase,
    tolerances: Callable[[int], Tolerances],
    *,
    seed: int,
    least: Mapping[int, float],
    most: float = 1.5,
    exact: float = EXACT,
) -> FactorsAsBuilt:
    """The drawn structures of the numbers in `least` under the `seed`, each with its number's `tolerances`,
    as scenarios of the load `case`, with the factors of it that they are to bear; imperfections of shape
    follow the softest modes of this `design`. Raises NotConverged where it has no unloaded equilibrium."""
    nominal = perfect(shell, design, case.force)
    left = _STIFFNESS_LEFT * float(modes(assemble(nominal.network), nominal.unloaded, 1).stiffness[0])
    own = tuple(
        Scenario(number, draw_errors(nominal.members, tolerances(number), seed, number), factor)
        for number, factor in least.items()
    )
    return FactorsAsBuilt(case, own, nominal.imperfections, left, most, exact)


def remembered(shell: Gridshell, design: Design, asked: FactorsAsBuilt) -> FactorsAsBuilt:
    """The same with a factor and a state of each scenario in this design, not far from its end; without those
    whose end isn't found. Raises NotConverged where none is."""
    workshop = _workshop(shell, design, asked)

    def one(scenario: Scenario) -> Scenario | NotConverged:
        try:
            end = _end(workshop, asked, scenario)
        except NotConverged as error:
            return error

        def followed(loading: Loading) -> tuple[float, State] | None:
            here, factor = loading.followed(_BEFORE * end.factor, CAREFUL, _BEFORE_RESOLUTION)
            return None if here is None else (factor, here.state)

        near = workshop.with_structure(scenario.errors, followed, number=scenario.number)
        return replace(scenario, near=near)

    found = side_by_side(one, list(asked.scenarios))
    known = tuple(each for each in found if isinstance(each, Scenario))
    lost = [each for each in found if isinstance(each, NotConverged)]
    if lost and not known:
        raise lost[0]
    return replace(asked, scenarios=known)


def borne_factors(
    shell: Gridshell, design: Design, asked: FactorsAsBuilt, *, rates: tuple[Beams, ...] = ()
) -> list[BorneFactor]:
    """The factor of each scenario and its derivatives by the rest lengths and by variables on which the
    beams' stiffness depends at one of the `rates`. Raises NotConverged."""
    workshop = _workshop(shell, design, asked)
    return side_by_side(partial(_end, workshop, asked, rates=rates), list(asked.scenarios))


def _end(
    workshop: Workshop, asked: FactorsAsBuilt, scenario: Scenario, *, rates: tuple[Beams, ...] = ()
) -> BorneFactor:
    def followed(loading: Loading) -> BorneFactor:
        built = tuple(built_beams(rate, scenario.errors, asked.imperfections) for rate in rates)
        return borne(
            loading, left=asked.left, most=asked.most, rates=built, exact=asked.exact, near=scenario.near
        )

    return workshop.with_structure(scenario.errors, followed, number=scenario.number)


def _workshop(shell: Gridshell, design: Design, asked: FactorsAsBuilt) -> Workshop:
    nominal = perfect(shell, design, asked.case.force, shapes=0, step=0.0)
    return Workshop(replace(nominal, imperfections=asked.imperfections))
