"""The convex problem of one step: the step model within a window, and its solution.

In windows u = (y - y0)/w the objective is slope'u + u'H u/2 with the Gauss-Newton matrix H. The constraints
are linear, held at a distance that covers what the last trial showed of their curvature (as Svanberg's
approximations, 2002, are corrected by theirs, but by a constant, which shrinks with the window). The bounds
are those of the window, of the variables (3), (4) and of cable forces (5), under the design load exactly,
under others as far as is known beforehand (further_forces.py).

Interior points (quadratic.py) solve it, and NLopt's MMA goes on from their answer. From the window's middle
MMA's separable approximations come to the optimum only while windows are narrow: of a stiff dome's first step
it found half of what could be gained after 2,000 evaluations, of the second a tenth. Where cables are to stay
taut under the further loads (guards.py), cables alike keep one length (grouping.py) or many structures are
kept in mind (minding.py), there are more constraints than MMA's dual comes to an end with.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.optimiser.convex import minimise
from shellform.optimiser.further_forces import ROUNDS, further_forces
from shellform.optimiser.guards import Guard, SolvedGuard
from shellform.optimiser.quadratic import LowRank, minimise_quadratic
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.step_model import StepModel
from shellform.optimiser.whole_answers import WholeAnswers
from shellform.problem.constraints import Constraint

_WIDE = 1e3  # windows, no bound on a group's step beside those on its cables
_TOLERANCE = 1e-9  # relative, of the convex model's optimum: well below what a step is judged by
_FEW = 8  # constraints, beyond which MMA's dual may not come to an end
_DUAL = 100  # evaluations of a dual: those that end take fewer, and the answers of others aren't kept
_KEPT = 1e-9  # of a constraint, by which MMA's answer may be worse than its start's
_LET = 1e-3  # of the least tension, by which a cable that isn't guarded yet may fall below it
_LIFTED = 0.02  # of the objective at the start, 1: what lifting cables to their least tension may cost
_NONE = 1e-3  # of the mean tension: less is none, which MMA leaves of cables that die


@dataclass(frozen=True, eq=False)
class Task(Record):
    """What a step is asked for.

    - `solver`: the settings; `model`: of the design from which it goes; `window`, N, within which it stays.
    - `tension`, N: the start's mean; `least`, N: what cables that are `tensioned` (c,) keep.
    - `bounded`: constraints by the design load's tensions, which are bounds here.
    - `guards`: of cables that may not go slack under the further loads, none where all may.
    - `climbing`: whether stability stands in for the objective.
    - `groups` (c,): of cables alike, None where none are.
    - `excess` (k,): of the constraints over their linear model in a whole window.
    - `aims`: how many of the constraints' values, the last ones, are of structures in mind.
    - `reviving`: whether cables that aren't `tensioned` may come back.
    - `lifting`: whether cables below their least tension have to rise to it; else they keep what they have.
    """

    solver: SequentialConvex
    model: StepModel
    window: float
    tension: float
    bounded: Sequence[Constraint]
    tensioned: Flags
    guards: Sequence[Guard]
    climbing: bool
    groups: Indices | None
    excess: Reals
    least: float
    aims: int
    reviving: bool
    lifting: bool = True


class Asked(NamedTuple):
    """A quadratic problem in windows u (y,), as `minimise_quadratic` takes it: least slope'u + u'H u/2 with
    rows u + values <= 0, low <= u <= high."""

    curvature: Reals | LowRank
    slope: Reals
    rows: Reals
    values: Reals
    low: Reals
    high: Reals


def propose(task: Task) -> tuple[Reals, float]:
    """The y (y,) of the model's optimum within the window, and the change of the objective that it
    predicts. Where lifting cables to their least tension costs more than that is worth, as of stiff strands
    whose errors are worth more than they pull, they keep what they have.
    """
    y, change = _optimum(task)
    # what structures are to bear may cost as much
    if change <= _LIFTED or task.aims or not _lifts(task):
        return y, change
    kept, less = _optimum(replace(task, lifting=False))
    return (kept, less) if change - less > _LIFTED else (y, change)


def _lifts(task: Task) -> bool:
    """Whether a cable that is to keep its least tension has less, so that the task has it rise."""
    own = task.model.origin[: task.model.tensions]
    below = task.tensioned[: len(own)] & (own < task.least)
    return bool(below.any()) or any(bool((held.tension < task.least).any()) for held in task.guards)


def _optimum(task: Task) -> tuple[Reals, float]:
    """The same, as the task says."""
    model = task.model
    count = model.tensions
    lower, upper = _box(task)
    width = np.full(len(model.origin), task.window)
    width[count:] = model.step * min(task.window / task.tension, 1.0)
    lower = np.minimum(np.maximum(lower, model.origin - width), model.origin + width)
    upper = np.maximum(np.minimum(upper, model.origin + width), lower)
    slope = _slope(task)
    values = model.point.constraints + task.excess
    scaled_slope, scaled_rows = slope * width, model.constraints_by_y * width
    asked_of = _within_reach(task, values, scaled_rows)
    values, scaled_rows = values[asked_of], scaled_rows[asked_of]
    scaled_curvature = _curvature(model, width)
    low, high = (lower - model.origin) / width, (upper - model.origin) / width

    def evaluate(u: Reals) -> tuple[float, Reals, Reals, Reals]:
        bent = scaled_curvature @ u
        value = float(scaled_slope @ u + 0.5 * u @ bent)
        return value, scaled_slope + bent, values + scaled_rows @ u, scaled_rows

    def solved(falls: Reals, margins: Reals) -> Reals:
        rows, limits = np.vstack([scaled_rows, falls]), np.append(values, margins)
        asked = Asked(scaled_curvature, scaled_slope, rows, limits, low, high)
        if task.groups is not None:
            return _equal_steps(task, width, asked)
        # an aim is met as far as that is worth its price, even if it could be met
        u = None if _at_their_price(task, values) else minimise_quadratic(*asked)
        if u is None:
            u = _as_far_as_can_be(task, len(values), asked)
        elif not task.guards and len(limits) <= _FEW:
            u = _from_there(evaluate, np.clip(u, low, high), low, high, task.solver.model_evaluations)
        return np.clip(np.zeros(len(width)), low, high) if u is None else u

    further = further_forces(model)
    reserves = np.zeros(len(further))
    for _ in range(ROUNDS):
        for limit, reserve in zip(further, reserves, strict=True):  # which `solved` asks for
            most = (limit.upper(reserve) - model.origin[:count]) / width[:count]
            high[:count] = np.maximum(np.minimum(high[:count], most), low[:count])
        if any(isinstance(held, SolvedGuard) for held in task.guards):
            u = _guarded_in_turn(task, width, solved)
        else:
            u = solved(*_guarding(task, width))
        y = model.origin + width * u
        beyond = np.array([limit.beyond(y[:count]) for limit in further])
        if (beyond <= 0.0).all():
            break
        reserves += np.maximum(beyond, 0.0)
    if task.groups is None:
        y[:count][y[:count] < _NONE * task.tension] = 0.0
    return y, evaluate(u)[0]


def _within_reach(task: Task, values: Reals, rows: Reals) -> Flags:
    """Which of the constraints (k,) a step is asked for, of their `values` and `rows` (k, y) in windows: all
    but limits before any load to which no step within the window leads."""
    problem = task.model.evaluator.problem
    asked = np.ones(len(values), dtype=bool)
    for part, own in zip(problem.constraints, problem.places(), strict=True):
        if part.term.load in problem.loads and not problem.loads[part.term.load].any():
            asked[own] = values[own] + np.abs(rows[own]).sum(axis=1) > 0.0
    return asked


def _from_there(
    evaluate: Callable[[Reals], tuple[float, Reals, Reals, Reals]],
    start: Reals,
    low: Reals,
    high: Reals,
    evaluations: int,
) -> Reals:
    """Where MMA comes to from a `start` (y,) that keeps the constraints: the start itself where that is
    lower."""
    before, _, values, _ = evaluate(start)
    found, _ = minimise(
        evaluate,
        start,
        low,
        high,
        constraints=len(values),
        evaluations=evaluations,
        tolerance=_TOLERANCE,
        dual_evaluations=_DUAL,
    )
    after, _, left, _ = evaluate(found)
    kept = (left <= np.maximum(values, 0.0) + _KEPT).all()
    return found if kept and after <= before else start


def _as_far_as_can_be(task: Task, count: int, asked: Asked) -> Reals | None:
    """The model's optimum in windows (y,) where more is asked for than a step can give; the first `count` of
    the values are constraints', the others guards'. Of what limits are broken by a share t remains, of what
    aims miss and of what guards ask for others, 0 <= t <= 1, each at its price."""
    curvature, slope, rows, values, low, high = asked
    size, price = len(slope), task.solver.penalty
    limits = count - task.aims
    kinds = [(slice(limits), price), (slice(count, None), price)]
    if task.aims:
        kinds.append((slice(limits, count), task.solver.aim * price))
    more = len(kinds)
    wider: Reals | LowRank
    if isinstance(curvature, LowRank):
        wider = curvature.widened(more)
    else:
        wider = np.zeros((size + more, size + more))
        wider[:size, :size] = curvature
    broken = np.zeros((len(values), more))
    for k, (own, _) in enumerate(kinds):
        broken[own, k] = np.maximum(values[own], 0.0)
    found = minimise_quadratic(
        wider,
        np.append(slope, [each for _, each in kinds] * broken.max(axis=0, initial=0.0)),
        np.hstack([rows, -broken]),
        values,
        np.append(low, np.zeros(more)),
        np.append(high, np.ones(more)),
    )
    return None if found is None else found[:size]


def _at_their_price(task: Task, values: Reals) -> bool:
    """Whether aims are missed, `values` (k,) of the constraints being at most 0 where they are met, that
    steps are to meet as far as that is worth the price by which they are judged."""
    return bool((values[len(values) - task.aims :] > 0.0).any())


def _curvature(model: StepModel, width: Reals) -> Reals | LowRank:
    """The objective's Gauss-Newton matrix (y, y) in windows of a `width` (y,)."""
    own = [
        (weight, each.hessian)
        for weight, each in zip(model.evaluator.weights, model.quadratics, strict=True)
        if each is not None
    ]
    few = [np.sqrt(weight) * each.columns for weight, each in own if isinstance(each, LowRank)]
    if not own:
        return LowRank(np.zeros((len(width), 0)))
    if few:
        return LowRank(np.hstack(few) * width[:, None])
    return np.asarray(sum(weight * each for weight, each in own)) * width * width[:, None]


def _slope(task: Task) -> Reals:
    """The objective's slope (y,), or while climbing that of the constraints that tell of stability, each as a
    share of its own size."""
    model = task.model
    if not task.climbing:
        return _exact_in_tension(model.answers.by_variables(model.point.objective_by_variables), model)
    problem = model.evaluator.problem
    slopes = np.vstack(
        [
            model.point.constraints_by_variables[where]
            for part, where in zip(problem.constraints, problem.places(), strict=True)
            if part.term.stabilises
        ]
    )
    total = (slopes / np.linalg.norm(slopes, axis=1)[:, None]).sum(axis=0)
    return model.answers.by_variables(total)


def _equal_steps(task: Task, width: Reals, asked: Asked) -> Reals:
    """The model's optimum in windows (y,) among steps that change all rest lengths of a group by the same: u
    = W⁻¹ (∂l0/∂y)⁻¹ G v. What is broken may stay so.
    """
    curvature, slope, rows, values, low, high = asked
    assert task.groups is not None
    assert isinstance(task.model.answers, WholeAnswers)
    assert isinstance(curvature, np.ndarray)
    count = len(task.groups)
    member = np.zeros((count, int(task.groups.max()) + 1))
    member[np.arange(count), task.groups] = 1.0
    steps = task.model.answers.of_rest_lengths(member) / width[:, None]
    steps /= np.abs(steps).max(axis=0)
    box = np.vstack([steps, -steps])
    v = minimise_quadratic(
        steps.T @ curvature @ steps,
        steps.T @ slope,
        np.vstack([rows @ steps, box]),
        np.concatenate([np.minimum(values, 0.0), -np.maximum(high, 0.0), np.minimum(low, 0.0)]),
        np.full(steps.shape[1], -_WIDE),
        np.full(steps.shape[1], _WIDE),
    )
    return steps @ v if v is not None else np.zeros(count)


def _guarding(task: Task, width: Reals) -> tuple[Reals, Reals]:
    """Rows (g, y) and values (g,), at most 0 where each guarded cable keeps its least tension, per window and
    in shares of what a whole window can change."""
    rows, values = [np.zeros((0, len(width)))], [np.zeros(0)]
    solver = task.solver
    for held in task.guards:
        falls, scale, asked = _falls(task, held, np.arange(len(held.tension)), width)
        # Where no step within the window lets a cable go slack, there is nothing to guard; of the others the
        # nearest count.
        near = np.argsort(-asked, kind="stable")[: int(np.clip((asked > -1.0).sum(), 0, solver.guards))]
        rows.append(falls[near] / scale[near, None])
        values.append(asked[near])
    return np.vstack(rows), np.concatenate(values)


def _guarded_in_turn(task: Task, width: Reals, solved: Callable[[Reals, Reals], Reals]) -> Reals:
    """The step (y,), in windows, `solved` for with the same rows and values, but only of cables that steps
    without them would let fall: they join until a step lets no other one fall, which is the optimum with all
    of them."""
    chosen = [np.zeros(0, dtype=np.int64) for _ in task.guards]
    rows, values = np.zeros((0, len(width))), np.zeros(0)
    while True:
        u = solved(rows, values)
        change = task.model.answers.parameters_changed(width * u)
        fallen = [_let_fall(task, held, own, change) for held, own in zip(task.guards, chosen, strict=True)]
        if not any(map(len, fallen)):
            return u
        chosen = [np.append(own, more) for own, more in zip(chosen, fallen, strict=True)]
        for held, more in zip(task.guards, fallen, strict=True):
            falls, scale, asked = _falls(task, held, more, width)
            rows, values = np.vstack([rows, falls / scale[:, None]]), np.append(values, asked)


def _let_fall(task: Task, held: Guard, chosen: Indices, change: Reals) -> Indices:
    """Guarded cables beside the `chosen` ones that a `change` (p,) of the parameters takes below their least
    tension, those that fall farthest where they are more than can be guarded."""
    tension = held.tension + held.changed(change)
    tension[chosen] = np.inf
    fallen = np.argsort(tension, kind="stable")[: (tension < (1.0 - _LET) * task.least).sum()]
    return np.asarray(fallen[: task.solver.guards - len(chosen)])


def _falls(task: Task, held: Guard, some: Indices, width: Reals) -> tuple[Reals, Reals, Reals]:
    """Of some guarded cables, the falls (k, y) of their tensions, N, in windows; what a whole window can
    change of each (k,), N; and the share of that (k,) by which it has to rise, or may fall where negative."""
    falls = -task.model.answers.by_parameters(held.by_design(some)) * width
    scale = np.abs(falls).sum(axis=1)
    recovery = task.solver.recovery if task.lifting else 0.0
    return falls, scale, np.minimum((task.least - held.tension[some]) / scale, recovery)


def _exact_in_tension(slope: Reals, model: StepModel) -> Reals:
    """Sums of tensions are linear in them and sums of squares differentiable by them, also for cables that
    are dead and so have no slope in their rest length.
    """
    count, evaluator = model.tensions, model.evaluator
    dead = model.origin[:count] <= 0.0
    if not dead.any():
        return slope
    result = slope.copy()
    total = np.zeros(count)
    present = model.point.design.present
    summands = zip(
        evaluator.weights,
        evaluator.problem.minimise,
        model.quadratics,
        model.point.summands,
        strict=True,
    )
    for weight, part, own, measurement in summands:
        if part.term.load != evaluator.base:
            continue
        if own is not None:
            total += weight * own.slope[:count]
        elif measurement.by_tension is not None:
            total += weight * measurement.by_tension.sum(axis=0)[present]
    result[:count][dead] = total[dead]
    return result


def _box(task: Task) -> tuple[Reals, Reals]:
    """Bounds of y from those of the variables, the constraints (5) on the design load's cable forces, and
    which cables pull."""
    model = task.model
    count = model.tensions
    lower, upper = model.lower.copy(), model.upper.copy()
    for part in task.bounded:
        upper[:count] = np.minimum(upper[:count], part.upper)
    if count:
        lower[:count] = np.where(task.tensioned, task.least, 0.0)
        if not task.lifting:
            lower[:count] = np.minimum(lower[:count], model.origin[:count])
        if not task.reviving:
            upper[:count] = np.where(task.tensioned, upper[:count], 0.0)
    return lower, upper
