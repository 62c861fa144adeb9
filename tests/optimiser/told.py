"""Stand-ins for a search whose designs, evaluations and samples are told rather than computed."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np

import shellform as sf
from shellform.optimiser.search_state import Iterate


def accepted_one(objective):
    return SimpleNamespace(objective=objective, built=f"built {objective}")


def iterate(objective=1.0, **changes):
    point = SimpleNamespace(objective=objective, design=f"design {objective}", states="states")
    first = accepted_one(objective)
    given = Iterate(point, (first,), (), 0.7, 1.0, 0.2, 0.15, False, np.zeros(3, dtype=bool), np.zeros(2))
    return replace(given, **changes)


class Searching(SimpleNamespace):
    """With so many evaluations, of which as many are left as weren't spent."""

    def left(self):
        return self.evaluations - self.evaluator.evaluations

    def __replace__(self, **changes):
        return Searching(**{**vars(self), **changes})


def told_search(monkeypatch, *modules):
    """A search that the `modules` may change as they do a true one."""

    def changed(of, **changes):
        return of.__replace__(**changes) if isinstance(of, Searching) else replace(of, **changes)

    for module in modules:
        monkeypatch.setattr(module, "replace", changed)
    return Searching(
        solver=sf.SequentialConvex(stiffness=0.25),
        evaluator=SimpleNamespace(evaluations=0, problem="problem before"),
        evaluations=100,
        softest=2.0,
        tension=4.0,
        asked=SimpleNamespace(
            trial="trial", trusted=False, confirmed="fresh", sample=lambda k: f"sample {k}"
        ),
        inner="inner",
        judging="judging",
        problem=SimpleNamespace(shell="shell"),
    )


def loaded(*names, falling=()):
    """What loads come to from a start that falls under those `falling`, at two fifths of them; each state is
    told by its load."""
    return {
        name: SimpleNamespace(
            on_branch=name not in falling, equilibrium=SimpleNamespace(state=name), share=0.4
        )
        for name in names
    }
