"""From a free radius to sections that can be bought (operation 4): rounded up, the cables optimised again,
and the sections beside it tried too.

The cables' lengths are optimised anew with the section fixed, the same objective but for the radius' share
and the same constraints, from the cables that the design with the free radius keeps; where these don't bear
the load with the section, from all candidates. All sections are compared by the objective of the free
problem, its weights those of the initial design.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from shellform.arrays import Reals
from shellform.errors import NotConverged
from shellform.gridshell.catalogue import Catalogue, label, neighbours, rounded_up
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import ROD
from shellform.optimiser.limits_told import not_kept
from shellform.optimiser.moving_asymptotes import MovingAsymptotes
from shellform.optimiser.optimise import optimise
from shellform.optimiser.optimum import Optimum
from shellform.optimiser.solver import SequentialConvex
from shellform.problem.paths import deviations, follow
from shellform.problem.problem import Problem
from shellform.problem.terms import LoadedDesign, measured
from shellform.problem.weights import start_weights
from shellform.reliability.safety import Safety
from shellform.structure.answers.stability import modes
from shellform.structure.elements.sections import mass_per_length
from shellform.structure.network import assemble


@dataclass(frozen=True, eq=False)
class CandidateSection:
    """A section of the catalogue that is tried.

    - `section`: its name; `shell` with it; `optimum`, None where none was found; `mass`, kg, of the rods.
    - `objective` of the problem with the free radius; `deviation_max`, `deviation_mean`, m, from the target,
      and stress `utilisation`, under the design load; `cables`: how many.
    - `why` it isn't feasible, empty where it is.
    - `rounded_up`: whether it is the one that the free radius is rounded up to.
    """

    section: str
    shell: Gridshell
    optimum: Optimum | None
    objective: float
    deviation_max: float
    deviation_mean: float
    cables: int
    utilisation: float
    mass: float
    why: str
    rounded_up: bool


def tried(
    best: Optimum,
    start: Design,
    catalogue: Catalogue,
    problem_of: Callable[[Gridshell], Problem],
    *,
    evaluations: int,
    beside: int,
    solver: SequentialConvex | MovingAsymptotes | None = None,
    safety: Safety | None = None,
    progress: Callable[[str], None] = lambda text: None,
) -> list[CandidateSection]:
    """The section next above the optimum's radius and `beside` of them below and above, by rising stiffness,
    each with its cables optimised.

    `start` is the initial design, of all candidate cables; `problem_of` gives the problem with a fixed
    section; `solver` and `safety` are those by which the optimum was made. The stiffness that the optimum
    kept, as far as a section has it at all, is asked of each. Raises InputError where no section that the net
    allows is stiff enough.
    """
    shell = best.problem.shell
    needed = {best.problem.design_load.name, *(share.term.load for share in best.problem.minimise)} - {""}
    loads = {name: load for name, load in best.problem.loads.items() if name in needed}
    weights = start_weights(best.problem, start, follow(shell, start, loads, stay=len(loads) > 1))
    up = rounded_up(shell, best.design, catalogue)[0].rod.section
    found = []
    for other, design in neighbours(shell, best.design, catalogue, count=beside):
        name = label(other.rod.section)
        progress(f"cables for rods {name}")
        optimum, why = _optimised(
            problem_of(other),
            [design, _whole(start, design)],
            best.stiffness,
            evaluations,
            solver or SequentialConvex(),
            safety,
        )
        found.append(_candidate(name, other, optimum, why, weights, best.problem, other.rod.section == up))
    return found


def chosen(trials: Sequence[CandidateSection]) -> CandidateSection | None:
    """The rounded-up section if it is feasible, else the feasible one with the least objective, else the
    rounded-up one; None without any optimum.
    """
    up = next(each for each in trials if each.rounded_up)
    feasible = [each for each in trials if not each.why]
    if not up.why or not feasible:
        return up if up.optimum is not None else None
    return min(feasible, key=lambda each: each.objective)


def rods_mass(shell: Gridshell) -> float:
    """Of all rods, kg."""
    beams = shell.beams(shell.rod.radius)
    return float(beams.rest_length[beams.of_kind(ROD)].sum() * mass_per_length(shell.rod.section))


def _whole(start: Design, design: Design) -> Design:
    return Design(start.rest_length, start.present, design.radius)


def _optimised(
    problem: Problem,
    starts: Sequence[Design],
    least: float,
    evaluations: int,
    solver: SequentialConvex | MovingAsymptotes,
    safety: Safety | None,
) -> tuple[Optimum | None, str]:
    """The best design from the first of the starts that leads to a feasible one, or the last found; and why
    it isn't feasible.
    """
    optimum, why = None, ""
    for start in starts:
        try:
            found = optimise(
                problem,
                start,
                solver=replace(solver, stiffness=_share(problem, start, least))
                if isinstance(solver, SequentialConvex)
                else solver,
                evaluations=evaluations,
                safety=safety,
                initial=starts[-1],
            )
        except NotConverged as error:
            why = why or error.what
            continue
        optimum, why = found, broken(found)
        if not why:
            break
    return optimum, why


def broken(optimum: Optimum) -> str:
    """The limits that the optimum doesn't keep, in words; empty where it keeps all."""
    lost = [name for name in optimum.problem.loads if not optimum.loaded[name].on_branch]
    over = not_kept(optimum.constraints)
    said = [f"not stable under {', '.join(lost)}"] if lost else []
    return "; ".join(said + ([f"beyond its limit: {', '.join(over)}"] if over else []))


def _share(problem: Problem, start: Design, least: float) -> float:
    """`least`, N/m, as a share of the start's softest mode under the design load, at the most all of it: rods
    thinner than the optimum's have less than that kept, and a solver takes shares alone."""
    name = problem.design_load.name
    reached = follow(problem.shell, start, {name: problem.design_load.force}, stay=True)[name]
    softest = (
        modes(assemble(problem.shell.network(start)), reached.equilibrium.state, 1).stiffness[0]
        if reached.on_branch
        else 0.0
    )
    return min(float(least / softest), 1.0) if softest > 0.0 else 0.0


def _candidate(
    name: str,
    shell: Gridshell,
    optimum: Optimum | None,
    why: str,
    weights: Reals,
    problem: Problem,
    up: bool,
) -> CandidateSection:
    nothing = float("nan")
    if optimum is None:
        return CandidateSection(
            section=name,
            shell=shell,
            optimum=None,
            objective=nothing,
            deviation_max=nothing,
            deviation_mean=nothing,
            cables=0,
            utilisation=nothing,
            mass=rods_mass(shell),
            why=why,
            rounded_up=up,
        )
    base = problem.design_load.name
    state = optimum.states[base]
    away = deviations(shell, state)
    objective = 0.0
    for weight, part in zip(weights, problem.minimise, strict=True):
        name_of_load = part.term.load or base
        at = LoadedDesign(shell, optimum.design, optimum.states[name_of_load], problem.loads[name_of_load])
        objective += weight * float(measured(part.term, at).value.sum())
    used = float(shell.utilisation(optimum.design, state).max())
    if used > 1.0:
        why = "; ".join(
            [
                *([why] if why else []),
                f"the rods are used to {used:.0%} of their strength under the {base} load",
            ]
        )
    return CandidateSection(
        section=name,
        shell=shell,
        optimum=optimum,
        objective=float(objective),
        deviation_max=float(away.max()),
        deviation_mean=float(away.mean()),
        cables=int(optimum.design.present.sum()),
        utilisation=used,
        mass=rods_mass(shell),
        why=why,
        rounded_up=up,
    )
