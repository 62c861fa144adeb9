"""From a case to its design problem, the engineer's limits included.

Every limit but the deviations' holds under every load case, and those that matter before concrete comes also
without load. The critical load factor F is kept by a load case "critical NAME", F times the load case, that
every accepted design bears on its stable branch, its softest mode keeping a share of the initial design's
stiffness under the design load (engineering.py: ModalStiffness). Load steps can pass a bifurcation that is
followed by stable states again: in the end the perfect structure's path is followed closely (refinement.py),
and a design whose path ends before F isn't feasible.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from shellform.arrays import Reals
from shellform.case.build_gridshell import rod_bounds
from shellform.case.build_safety import case_tolerances, critical_factors_asked
from shellform.case.case import Case
from shellform.case.wrong_loads import refuse_unknown
from shellform.errors import InputError, NotConverged
from shellform.gridshell.edge_beams import EDGE
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.problem.constraints import AtLeast, AtMost, Constraint
from shellform.problem.engineering import (
    ConnectorTurn,
    LargestCableForce,
    LargestDeviation,
    LeastTension,
    ModalStiffness,
    RodUtilisation,
    Thrust,
    Uplift,
)
from shellform.problem.paths import follow
from shellform.problem.problem import LoadCase, Problem
from shellform.problem.terms import CableForce, CableForces, Misfit, RmsMisfit, RodRadius, Share, Term
from shellform.problem.variables import FreeRadius, RestLengths, Variable
from shellform.reliability.built_misfit import built_misfit
from shellform.reliability.requirements import SEED
from shellform.structure.answers import results
from shellform.structure.answers.stability import modes
from shellform.structure.elements.beam import Beams
from shellform.structure.network import assemble

# of the initial design's softest mode under the design load, that is left at the critical factor asked for
_SOFTEST = 0.25


def case_problem(
    case: Case, shell: Gridshell, loads: Mapping[str, Reals], start: Design, *, frees_radius: bool = True
) -> Problem:
    """The problem (2) to (6) of the case on the shell, with its limits; `start` is the initial design. With
    the radius fixed its share goes to the others in proportion, and by the paper's method that of the shape
    as built."""
    refuse_unknown(case, loads)
    entry = case.optimise
    shares: list[tuple[float, Term]] = [
        (entry.misfit, Misfit("design")),
        (entry.cable_force, CableForce("design")),
    ]
    variables = varied(case, shell, frees_radius=frees_radius)
    if frees_radius:
        shares.append((entry.rod_radius, RodRadius()))
    design, seed = LoadCase("design", loads["design"]), case.safety.seed + SEED
    if entry.built_misfit > 0.0 and entry.method != "paper":  # whose objective is (2)
        tolerances = case_tolerances(case, shell)
        shares.append((entry.built_misfit, built_misfit(shell, start, design, tolerances, seed=seed)))
    total = sum(share for share, _ in shares)
    others = [name for name in loads if name not in ("none", "design")]
    most = cable_force_planned(case)
    constraints: list[Constraint] = [AtMost(most, CableForces("design"))]
    constraints += [AtMost(entry.misfit_rms_additional, RmsMisfit(name)) for name in others]
    if entry.method != "paper":  # whose constraint (5) is on the design load; cables break under any
        constraints += [AtMost(most, LargestCableForce(name, most)) for name in loads if name != "design"]
    constraints += _engineers(case, shell, loads)
    if case.robust is not None:
        tolerances, added = case_tolerances(case, shell), case.robust.deviations
        tolerances.require_causes()  # before the search: what the design to build is off by needs some
        if case.robust.limit is not None:
            robust = built_misfit(shell, start, design, tolerances, seed=seed, deviations=added)
            constraints.append(AtMost(case.robust.limit**2 * shell.node_count, robust))
    used = dict(loads)
    further = {name: factor for name, factor in critical_factors_asked(case).items() if name != "design"}
    critical = []
    if further:
        least = _SOFTEST * _stiffness(shell, start, loads["design"])
        for name, factor in further.items():
            critical.append(f"critical {name}")
            used[critical[-1]] = factor * loads[name]
            constraints.append(AtLeast(least, ModalStiffness(critical[-1], least)))
    order = ["none", *others, *critical]
    return Problem(
        shell,
        LoadCase("design", used["design"]),
        [Share(share / total, term) for share, term in shares if share > 0.0],
        constraints,
        [LoadCase(name, used[name]) for name in order if name in used],
        variables,
        built_under=tuple(name for name in loads if loads[name].any()),
    )


def cable_force_planned(case: Case) -> float:
    """N, that a cable may pull as planned: what `limits.cable_utilisation` leaves of `cable.force_max`."""
    return case.limits.cable_utilisation * case.cable.force_max


def varied(case: Case, shell: Gridshell, *, frees_radius: bool = True) -> list[Variable]:
    """The variables of a case: the rest lengths, and the rods' radius where it has a share of the objective
    and isn't fixed."""
    entry, bounds = case.optimise, rod_bounds(case, shell)
    blocks: list[Variable] = [RestLengths(entry.rest_length_min, entry.rest_length_max)]
    if frees_radius and entry.rod_radius > 0.0:
        if entry.radius_min is not None and entry.radius_min > shell.rod.radius:
            raise InputError(
                "is above the radius of the rods, from which the search starts",
                where="optimise.radius_min",
                value=entry.radius_min,
                remedy=f"Give at most {shell.rod.radius:g}, or thicker rods in [rod].",
            )
        blocks.append(FreeRadius(*bounds))
    return blocks


def _engineers(case: Case, shell: Gridshell, loads: Mapping[str, Reals]) -> list[Constraint]:
    """The limits on rods, connectors, supports and slack cables; those on the shape under load are
    thinning's (solver.py)."""
    entry = case.limits
    found: list[Constraint] = []
    if entry.unloaded_deviation is not None:
        found.append(AtMost(entry.unloaded_deviation, LargestDeviation("none", entry.unloaded_deviation)))
    for name in loads:
        if entry.utilisation is not None:
            found.append(AtMost(entry.utilisation, RodUtilisation(name)))
        if entry.connector_turn is not None:
            found.append(AtMost(entry.connector_turn, ConnectorTurn(name)))
        if entry.uplift is not None:
            scale = max(entry.uplift, -float(loads["design"][:, 2].sum()) / len(shell.net.supports))
            found.append(AtMost(entry.uplift, Uplift(name, scale), of=scale + entry.uplift))
        if entry.thrust is not None:
            found.append(AtMost(entry.thrust, Thrust(name, entry.thrust)))
    if entry.slack_min is not None:
        longest = case.cable.rest_ratio * case.optimise.rest_length_max
        let_out = 0.5 * (1.0 + longest) if longest > 1.0 else np.inf
        for name in entry.slack_loads:
            found.append(AtLeast(entry.slack_min, LeastTension(name, entry.slack_min, let_out)))
    return found


def _stiffness(shell: Gridshell, start: Design, load: Reals) -> float:
    """Of the start's softest mode under the design load, N/m. Raises NotConverged where it doesn't bear
    that.
    """
    reached = follow(shell, start, {"design": load}, stay=True)["design"]
    found = float(modes(assemble(shell.network(start)), reached.equilibrium.state, 1).stiffness[0])
    if not (reached.on_branch and found > 0.0):
        raise NotConverged(
            f"The initial design loses stability at {reached.share:.2f} of the design load, so that no critical factor can be kept",
            state=reached.equilibrium.state,
            remedy="Choose a denser grid, thicker rods or stiffer cables.",
        )
    return found


def edge_utilisation(shell: Gridshell, beams: Beams, forces: Reals) -> float:
    """Largest stress of the edge beams over their strength; 0 without edge beams."""
    if shell.edge is None:
        return 0.0
    return float(np.nanmax(results.utilisation(beams, forces, {EDGE: shell.edge.section})))
