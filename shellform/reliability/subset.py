"""Probabilities of rare failures by subset simulation (Au and Beck 2001, Probabilistic Engineering Mechanics
16, 263).

With independent standard normal variables z and a limit state g(z), below zero where the structure fails,

    P(g < 0) = P(g < b_1) P(g < b_2 | g < b_1) ... P(g < 0 | g < b_m),

each b_i the quantile of share p_0 of the samples of the level before, so that every factor is about p_0 and a
probability of 1e-3 takes three levels. Where samples tie at b, as limit states do that are found to a
resolution and up to a largest value, the factor is the share of those below or at it; where b is the largest
value, of those below. Samples of a level come from Markov chains that start in those of the level before
below its b, drawn by lot where there are more than chains, in turns where there are fewer: a step draws z' =
a z + sqrt(1 - a²) e with fresh normal e, which keeps the normal distribution, and is taken if g(z') < b
(conditional sampling; Papaioannou, Betz, Zwirglmaier and Straub 2015, Probabilistic Engineering Mechanics 41,
89, whose rule for the step towards a rate of acceptance of 0.44 is used). The coefficient of variation is the
first-order one of Au and Beck with independent levels, correlations along the chains taken in (their equation
29).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import InputError

LimitState = Callable[[Reals], Sequence[float] | Reals]
"""g (k,) of points (k, d): all of one call may be found side by side."""

_SHARE = 0.1  # p_0
_LEVELS = 8  # probabilities below 1e-8 aren't told apart from 0
_ACCEPTED = 0.44  # rate that is aimed at
_FIRST_STEP = 0.6  # standard deviation of a chain's step at first
_ADAPTED = 5  # times a level at which the step is adapted


@dataclass(frozen=True, eq=False)
class Rare(Record):
    """What subset simulation found.

    - `probability` of failure, with its coefficient of `variation`.
    - `evaluations` of the limit state.
    - `levels`: values of the limit state passed on the way.
    - `reached`: the share of all points that lie beyond the last of them.
    - `failed` (k, d): the failed points of the last level, the likeliest (of smallest norm) first.
    """

    probability: float
    variation: float
    evaluations: int
    levels: tuple[float, ...]
    reached: float
    failed: Reals


def subset_simulation(limit_state: LimitState, size: int, *, count: int, seed: int) -> Rare:
    """P(g < 0) for `size` standard normal variables with `count` samples a level. Raises InputError for a
    count that isn't a multiple of ten of at least 20."""
    if count < 20 or count % 10:
        raise InputError(
            "must be a multiple of 10, at least 20",
            where="count",
            value=count,
            remedy=f"Give samples a level, such as {max(20, round(count / 10) * 10)}.",
        )
    seeds, length = round(_SHARE * count), round(1.0 / _SHARE)
    rng = np.random.Generator(np.random.Philox(seed))
    z = rng.standard_normal((count, size))
    g = np.asarray(limit_state(z), dtype=float)
    spent, probability, squares = count, 1.0, 0.0
    passed: list[float] = []
    chains = np.arange(count)[:, None]  # which samples are one chain: at first each its own
    step = _FIRST_STEP
    for _ in range(_LEVELS):
        order = np.argsort(g, kind="stable")
        bound = 0.5 * float(g[order[seeds - 1]] + g[order[seeds]])
        failing = g < 0.0
        if bound <= 0.0 or failing.mean() >= _SHARE:
            break
        if g.min() == g.max():  # nothing that leads towards a failure
            break
        if bound >= g.max():  # next to nothing lies below what is told as equal
            bound = float(np.nextafter(g.max(), -np.inf))
        inside = order[: np.searchsorted(g[order], bound, side="right")]
        probability *= len(inside) / count
        squares += _square(g <= bound, chains, len(inside) / count)
        passed.append(bound)
        begin = inside if len(inside) == seeds else np.resize(rng.permutation(inside), seeds)
        z, g, step, more = _level(limit_state, z[begin], g[begin], bound, length, step, rng)
        chains = np.arange(count).reshape(length, seeds).T
        spent += more
    failing = g < 0.0
    share = float(failing.mean())
    if share > 0.0:
        squares += _square(failing, chains, share)
    failed = z[failing]
    nearest = np.argsort((failed**2).sum(axis=1), kind="stable")
    variation = math.sqrt(squares) if share > 0.0 else math.inf
    return Rare(probability * share, variation, spent, tuple(passed), probability, failed[nearest])


def _level(
    limit_state: LimitState,
    z: Reals,
    g: Reals,
    bound: float,
    length: int,
    step: float,
    rng: np.random.Generator,
) -> tuple[Reals, Reals, float, int]:
    """Chains of `length` from each of the points below the bound, one state of all after the other."""
    points, values, spent, accepted, proposed = [z], [g], 0, 0, 0
    every = max(1, length // _ADAPTED)
    for k in range(1, length):
        keep = math.sqrt(1.0 - min(step, 1.0) ** 2)
        trial = keep * z + min(step, 1.0) * rng.standard_normal(z.shape)
        found = np.asarray(limit_state(trial), dtype=float)
        spent += len(trial)
        taken = found <= bound
        z, g = np.where(taken[:, None], trial, z), np.where(taken, found, g)
        points.append(z)
        values.append(g)
        accepted, proposed = accepted + int(taken.sum()), proposed + len(taken)
        if k % every == 0:
            step *= math.exp((accepted / proposed - _ACCEPTED) / math.sqrt(k / every))
            accepted = proposed = 0
    return np.vstack(points), np.concatenate(values), step, spent


def _square(inside: np.ndarray, chains: np.ndarray, share: float) -> float:
    """Squared coefficient of variation of a level's share, correlation along the chains included (Au and
    Beck, equations 25 to 28)."""
    number, length = chains.shape
    count = number * length
    held = inside[chains].astype(float)
    variance = share * (1.0 - share)
    if variance == 0.0:
        return 0.0
    gamma = 0.0
    for lag in range(1, length):
        covariance = float((held[:, : length - lag] * held[:, lag:]).mean()) - share**2
        gamma += 2.0 * (1.0 - lag / length) * covariance / variance
    return (1.0 - share) / (share * count) * (1.0 + max(gamma, 0.0))
