"""Search for the front of several objectives: the door to Optuna.

NSGA-II (Deb et al., IEEE Trans. Evol. Comput. 6 (2002) 182) asks for one generation after the other; each is
a batch of designs on the study's engine. Its random numbers come from the study's seed and it is told the
results in the order in which it asked, so that the same study always asks for the same designs: a second call
asks again, finds what is computed in the store, and goes on from there.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator, Iterable, Mapping
from typing import Any

from shellform.errors import not_installed
from shellform.study.front import objectives, signed
from shellform.study.outcome import Row, Status, Value
from shellform.study.plan import Plan


def generations(
    plan: Plan,
) -> Generator[Callable[[], Iterable[Mapping[str, Value]]], list[Row], None]:
    """Generation after generation, each told the rows (with the study's columns) of the one before."""
    try:
        import optuna
    except ImportError as error:
        raise not_installed('method = "search"', "study", error) from error
    entry, signs = plan.study, signed(plan.study.objective)
    optuna.logging.set_verbosity(optuna.logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # constraints_func is called experimental
        sampler = optuna.samplers.NSGAIISampler(
            population_size=entry.population,
            seed=entry.seed,
            constraints_func=_excess if entry.limit else None,
        )
    search = optuna.create_study(directions=["minimize"] * len(signs), sampler=sampler)
    left = int(entry.count or 0)
    while left > 0:
        trials = [search.ask() for _ in range(min(left, entry.population))]
        left -= len(trials)
        designs = [{name: _asked(plan, trial, name) for name in entry.vary} for trial in trials]
        rows = yield lambda designs=designs: designs  # type: ignore[misc]
        for trial, row in zip(trials, rows, strict=True):
            goals = objectives(row.columns, signs) if row.status is Status.DONE else None
            if goals is None:
                search.tell(trial, state=optuna.trial.TrialState.FAIL)
                continue
            if entry.limit:
                trial.set_user_attr(
                    "excess", [limit.beyond(row.columns[name]) for name, limit in entry.limit.items()]
                )
            search.tell(trial, goals)


def _excess(trial: Any) -> list[float]:
    """How far a design is beyond each limit; below zero it keeps it."""
    found: list[float] = trial.user_attrs["excess"]
    return found


def _asked(plan: Plan, trial: Any, name: str) -> Value:
    if name in plan.lists:
        values = plan.lists[name]
        found: Value = (
            values[trial.suggest_int(name, 0, len(values) - 1)]
            if _ordered(values)
            else trial.suggest_categorical(name, values)
        )
        return found
    entry = plan.study.vary[name]
    log = entry.scale == "log"
    if entry.whole:
        number: int = trial.suggest_int(name, *entry.whole_ends, log=log)
        return number
    value: float = trial.suggest_float(name, entry.low, entry.high, log=log)
    return value


def _ordered(values: Any) -> bool:
    """Whether a list is of rising numbers, between which a mean of parents makes sense."""
    return all(type(each) in (int, float) for each in values) and list(values) == sorted(values)
