"""The convex problem of one step: the model in tensions (tensions.py) within a window, and its solution.

In windows u = (y - y0)/w the objective is slope'u + u'H u/2 with the misfit's Gauss-Newton matrix H. The
constraints are linear, held at a distance that covers what the last trial showed of their curvature (as
Svanberg's approximations, 2002, are corrected by theirs, but by a constant, which shrinks with the window).
The bounds are those of the window, of rest lengths (3), the radius (4) and cable forces (5) under the first
load. NLopt's MMA solves it. Where cables are to stay taut under the additional loads (guard.py), or cables
alike keep one length (grouping.py), it has hundreds of constraints and goes to the interior-point method
(convex.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Indices, Reals
from shellform.optimiser.convex import minimise, minimise_quadratic
from shellform.optimiser.guards import Guard
from shellform.optimiser.tensions import TensionModel
from shellform.problem.engineering import Softness
from shellform.problem.problem import Evaluator, Point, Problem
from shellform.problem.robust import RobustMisfit
from shellform.problem.terms import AtMost, CableForce, CableForces, Misfit

_MODEL_EVALUATIONS = 2000  # of the convex model, some 50 microseconds each
_WIDE = 1e3  # windows, no bound on a group's step beside those on its cables
_GUARDS = 400  # constraints for each load
# of what a window can change at most: by so much cables below that tension must gain under additional loads
_RECOVERY = 0.1
_BRACE = 0.05  # least tension of the cables that are kept while thinning, in mean tensions of the start


@dataclass(frozen=True)
class Task:
    """What a step is asked for: from the `point` and its `model`, within a `window`, N, `tension` being the
    start's mean, N, and `base` the first load's name; limits `bounded` by that load's cable forces; cables
    (c,) that are `braces` and keep a least tension; `guards` of cables that may not go slack under the other
    loads, none where all may; whether the softest modes stand in for the objective, `climbing`; `groups` (c,)
    of cables alike; `excess` (k,) of the limits over their linear model in a whole window."""

    evaluator: Evaluator
    point: Point
    model: TensionModel
    base: str
    window: float
    tension: float
    bounded: Sequence[AtMost]
    braces: Flags
    guards: Sequence[Guard]
    climbing: bool
    groups: Indices | None
    excess: Reals


def propose(task: Task) -> tuple[Reals, float]:
    """The y (y,) of the model's optimum within the window, and the change of the objective that it
    predicts.
    """
    model = task.model
    count = len(model.length)
    lower, upper = _box(task)
    width = np.full(len(model.origin), task.window)
    if task.evaluator.problem.frees_radius:
        width[-1] = 0.1 * model.origin[-1] * min(task.window / task.tension, 1.0)
    lower = np.minimum(np.maximum(lower, model.origin - width), model.origin + width)
    upper = np.maximum(np.minimum(upper, model.origin + width), lower)
    slope = task.point.objective_by_variables @ model.variables_by_y
    curvature = sum(
        weight * model.misfit_hessian
        for weight, part in zip(task.evaluator.weights, task.evaluator.problem.minimise, strict=True)
        if isinstance(part.term, (Misfit, RobustMisfit)) and part.term.load == task.base
    )
    slope = _exact_in_tension(slope, task)
    if task.climbing:
        slope = _stiffening(task) @ model.variables_by_y
    rows = task.point.constraints_by_variables @ model.variables_by_y
    values = task.point.constraints + task.excess
    falls, margins = _guarding(task, width)
    scaled_slope, scaled_rows = slope * width, np.vstack([rows * width, falls])
    values = np.append(values, margins)
    scaled_curvature = np.asarray(curvature) * width * width[:, None]

    low, high = (lower - model.origin) / width, (upper - model.origin) / width

    def evaluate(u: Reals) -> tuple[float, Reals, Reals, Reals]:
        bent = scaled_curvature @ u
        value = float(scaled_slope @ u + 0.5 * u @ bent)
        return value, scaled_slope + bent, values + scaled_rows @ u, scaled_rows

    u: Reals | None
    if task.groups is not None:
        u = _equal_steps(
            task, width, scaled_curvature, scaled_slope, scaled_rows, np.minimum(values, 0.0), low, high
        )
    elif task.guards:
        u = minimise_quadratic(scaled_curvature, scaled_slope, scaled_rows, values, low, high)
        if u is None:  # more is asked for than a step can give: limits and guards may keep what they have
            u = minimise_quadratic(
                scaled_curvature, scaled_slope, scaled_rows, np.minimum(values, 0.0), low, high
            )
        if u is None:
            u = np.clip(np.zeros(len(width)), low, high)
    else:
        u, _ = minimise(
            evaluate,
            np.clip(np.zeros(len(width)), low, high),
            low,
            high,
            constraints=len(values),
            evaluations=_MODEL_EVALUATIONS,
            tolerance=1e-9,
        )
    y = model.origin + width * u
    if task.groups is None:
        y[:count][y[:count] < 1e-3 * task.tension] = 0.0
    return y, evaluate(u)[0]


def _equal_steps(
    task: Task,
    width: Reals,
    curvature: Reals,
    slope: Reals,
    rows: Reals,
    values: Reals,
    low: Reals,
    high: Reals,
) -> Reals:
    """The model's optimum in windows (y,) among steps that change all rest lengths of a group by the same: u
    = W⁻¹ (∂l0/∂y)⁻¹ G v.
    """
    assert task.groups is not None
    present = task.point.design.present
    lengths = (
        task.model.variables_by_y[np.flatnonzero(present)]
        * task.evaluator.problem.shell.cable_lengths[present, None]
    )
    count = len(task.groups)
    member = np.zeros((count, int(task.groups.max()) + 1))
    member[np.arange(count), task.groups] = 1.0
    steps = np.linalg.solve(lengths, member) / width[:, None]
    steps /= np.abs(steps).max(axis=0)
    box = np.vstack([steps, -steps])
    v = minimise_quadratic(
        steps.T @ curvature @ steps,
        steps.T @ slope,
        np.vstack([rows @ steps, box]),
        np.concatenate([values, -np.maximum(high, 0.0), np.minimum(low, 0.0)]),
        np.full(steps.shape[1], -_WIDE),
        np.full(steps.shape[1], _WIDE),
    )
    return steps @ v if v is not None else np.zeros(count)


def _stiffening(task: Task) -> Reals:
    """The gradient (s,) of the limits on the softest modes, each as a share of its own size."""
    problem = task.evaluator.problem
    own = [
        where
        for part, where in zip(problem.limits, places(problem), strict=True)
        if isinstance(part.term, Softness)
    ]
    slopes = np.vstack([task.point.constraints_by_variables[where] for where in own])
    return np.asarray((slopes / np.linalg.norm(slopes, axis=1)[:, None]).sum(axis=0))


def _guarding(task: Task, width: Reals) -> tuple[Reals, Reals]:
    """Rows (g, y) and values (g,), at most 0 where each guarded cable keeps its least tension, per window and
    in shares of what a whole window can change."""
    rows, values = [np.zeros((0, len(width)))], [np.zeros(0)]
    shell, design = task.evaluator.problem.shell, task.point.design
    lengths = (
        task.model.variables_by_y[np.flatnonzero(design.present)] * shell.cable_lengths[design.present, None]
    )
    if task.evaluator.problem.frees_radius:
        lengths = np.vstack(
            [lengths, task.model.variables_by_y[-1] * design.radius / task.point.variables[-1]]
        )
    for held in task.guards:
        falls = -(held.tension_by_design @ lengths) * width
        scale = np.abs(falls).sum(axis=1)
        asked = np.minimum((_BRACE * task.tension - held.tension) / scale, _RECOVERY)
        # Where no step within the window lets a cable go slack, there is nothing to guard; of the others the
        # nearest count.
        near = np.argsort(-asked, kind="stable")[: int(np.clip((asked > -1.0).sum(), 0, _GUARDS))]
        rows.append(falls[near] / scale[near, None])
        values.append(asked[near])
    return np.vstack(rows), np.concatenate(values)


def _exact_in_tension(slope: Reals, task: Task) -> Reals:
    """The sum of tensions is linear in them, also for cables that are dead and so have no slope in their rest
    length.
    """
    count = len(task.model.length)
    dead = task.model.origin[:count] <= 0.0
    if not dead.any():
        return slope
    result = slope.copy()
    total = np.zeros(count)
    for weight, part in zip(task.evaluator.weights, task.evaluator.problem.minimise, strict=True):
        if part.term.load != task.base:
            continue
        if isinstance(part.term, (Misfit, RobustMisfit)):
            total += weight * task.model.misfit_by_y[:count]
        elif isinstance(part.term, CableForce):
            total += weight
    result[:count][dead] = total[dead]
    return result


def _box(task: Task) -> tuple[Reals, Reals]:
    """Bounds of y from bounds (3), (4) and the limits (5) on the base load's cable forces."""
    stiffness = task.evaluator.problem.shell.cable.stiffness
    shortest = task.evaluator.problem.rest_length_min
    upper = stiffness * (task.model.length / shortest - 1.0)
    for part in task.bounded:
        upper = np.minimum(upper, part.limit)
    lower = np.where(task.braces, _BRACE * task.tension, 0.0)
    if task.evaluator.problem.frees_radius:
        low, high = task.evaluator.bounds()
        scale = task.evaluator.start.radius
        lower, upper = np.append(lower, low[-1] * scale), np.append(upper, high[-1] * scale)
    return lower, upper


def places(problem: Problem) -> list[slice]:
    """Where each limit's values stand among the constraints."""
    count = len(problem.shell.cable_ends)
    found, first = [], 0
    for part in problem.limits:
        size = 1
        if isinstance(part.term, CableForces):
            size = count if part.term.chosen is None else len(part.term.chosen)
        found.append(slice(first, first + size))
        first += size
    return found
