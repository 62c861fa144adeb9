"""The scales that a run's pictures and page share, so that one is read beside the other."""

from __future__ import annotations

from shellform.output.pictures.panel import scale_end
from shellform.problem.paths import deviations
from shellform.run.folder import Run


def colour_limit(run: Run) -> float:
    """The end of the scale of deviations, m: the case's, or one that the design to build fills under the
    design load (of a run that ended before that: under the first of its loads)."""
    if run.case.figures.limit is not None:
        return run.case.figures.limit
    states = run.states[run.best]
    state = states["design"] if "design" in states else next(iter(states.values()))
    return scale_end(float(deviations(run.shell_of(run.best), state).max()))


def force_limit(run: Run) -> float:
    """The largest tension of all designs and loads, N."""
    return max(
        float(run.shell_of(name).cables(design).tension(state).max(initial=0.0))
        for name, design in run.designs.items()
        for state in run.states[name].values()
    )
