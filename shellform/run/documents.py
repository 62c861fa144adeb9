"""What goes to the workshop, to the site and to other programs: drawings, schedules and models of a run's
best design.
"""

from __future__ import annotations

import numpy as np

from shellform.case.case import Case, StockRodEntry
from shellform.errors import NotConverged
from shellform.gridshell.catalogue import read_catalogue
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.net.grid import rod_names
from shellform.output.exchange import exports
from shellform.output.workshop import drawings, nesting, schedules
from shellform.output.workshop.schedules import Built, TitleBlock
from shellform.output.workshop.splice_schedule import cutting_notes
from shellform.output.workshop.turnbuckles import cut_counts
from shellform.problem.paths import follow
from shellform.records.progress import Event, Kind, Report, unheard
from shellform.records.summary import DocumentsRecord
from shellform.run.folder import Run
from shellform.structure.elements.state import State

_UNKNOWN = (
    "The grid without cables doesn't come to rest: the lengths that cables are hung in at are those in the wanted shape.",
)


def built_design(run: Run) -> Built:
    """The run's best design, a rounded one with the catalogue's rods; its cables are hung into the erected
    grid of these rods before bracing, or where that doesn't come to rest, into the target.
    """
    block, shell = run.case.title_block, run.shell_of(run.best)
    return Built(
        shell=shell,
        design=run.designs[run.best],
        states=run.states[run.best],
        hung=_erected(shell, run.designs[run.best].unbraced()),
        name=run.best,
        title=run.case.title,
        adjustment=run.case.cable.adjustment,
        block=TitleBlock(block.date, block.revision, block.author),
        origin=run.case.surface.origin,
        loads=run.loads,
        force_limit=run.case.cable.force_max,
    )


def _erected(shell: Gridshell, design: Design) -> State | None:
    """The state without load of a design without cables; None where none is found."""
    try:
        found = follow(shell, design, {"none": np.zeros((shell.node_count, 6))})
    except NotConverged:
        return None
    return found["none"].equilibrium.state


def stock_length(case: Case) -> float:
    """In which length, m, rods are bought: the case's, the catalogue's, or 6 m."""
    rod = case.rod
    sold = read_catalogue(rod.catalogue).stock_length if isinstance(rod, StockRodEntry) else None
    return rod.stock_length or sold or nesting.STOCK


def write_documents(run: Run, *, report: Report = unheard) -> DocumentsRecord:
    """Writes drawings/, schedules/ and models/ of a run and returns their part of the summary.

    Raises InputError where they can't be written. Without gmsh's system libraries there is no STEP file, and
    a line that says why.
    """
    built = built_design(run)
    cutting = nesting.cut(
        run.net.grid, stock=stock_length(run.case), kerf=run.case.rod.kerf, laths=run.case.rod.layers
    )
    report(Event("documents", f"schedules of the {built.name} design"))
    schedules.write_schedules(run.folder / "schedules", built, cutting)
    report(Event("documents", "drawings"))
    drawings.write_drawings(run.folder / "drawings", built, cutting)
    report(Event("documents", "models"))
    exports.write_exports(run.folder / "models", built, run.surface, run.loads)
    if exports.no_step():
        report(Event("documents", f"no STEP file: {exports.no_step()}", Kind.NOTE))
    bars, *spliced = cutting_notes(cutting, rod_names(run.net.grid))
    doubts = (
        *spliced,
        *(_UNKNOWN if built.hung is None else ()),
        *schedules.turnbuckles_of_cables(built),
        *drawings.letters_note(built),
    )
    for note in doubts:
        report(Event("documents", note, Kind.NOTE))
    cut = cut_counts(built.shell.cables(built.design).rest_length, built.adjustment)
    return DocumentsRecord(
        design=built.name,
        stock_length=cutting.stock,
        bars=len(cutting.bars),
        bars_least=cutting.least,
        waste=cutting.waste,
        spliced=tuple(cutting.spliced),
        notes=(bars, *doubts),
        rest_lengths=cut.rest_lengths,
        cut_lengths=cut.cut_lengths,
    )
