"""A run where it is displayed in Jupyter or IPython: its best design under each load, and the view of its
page with all of its designs."""

from __future__ import annotations

from shellform.output.notebook import design_png, view_html
from shellform.output.page.report import viewed
from shellform.run.folder import Run
from shellform.run.pages import shown_run


def run_png(run: Run) -> bytes:
    """The design to build under each of its loads, coloured by the deviation from the target."""
    heading = run.case.title or run.folder.resolve().name
    return design_png(run.shell_of(run.best), run.designs[run.best], run.states[run.best], run.loads, heading)


def run_html(run: Run) -> str:
    """The view of the run's page, by itself."""
    return view_html(viewed(shown_run(run, budget=0)))
