"""How well the designs of a published study stand: critical factor, share of drawn structures that stand,
slack cables.

The paper says nothing of it; its method and ours are told in the same table. Structures are drawn with the
default tolerances of the shell's size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

from shellform.errors import NotConverged
from shellform.gridshell.tolerances import default_tolerances
from shellform.reliability import refinement, standing
from shellform.run.folder import Run
from shellform.tables import Table

SHOWN = ("initial", "optimised", "rounded", "polished")
_SOUGHT = 3.0  # load factor up to which paths are followed


@dataclass(frozen=True)
class Stands:
    """A design of a `method` under a `load`: its `cables`, those `slack_before` any load and `slack_under`
    this one; the `critical_factor` and what `ends` its path; of `drawn` structures `stand`, so that the
    probability lies between `at_least` and `at_most`, each with 95 %. None where it wasn't found, or none was
    drawn."""

    method: str
    design: str
    load: str
    cables: int
    slack_before: int
    slack_under: int
    critical_factor: float | None
    ends: str
    drawn: int
    stand: int | None
    at_least: float | None
    at_most: float | None


def standings(run: Run, method: str, *, count: int, seed: int) -> list[Stands]:
    """Of the run's designs under the design and the additional load; `count` structures are drawn for each,
    with 0 none.

    Of one seed the structures of two runs have the same errors as far as they have the same candidate cables.
    """
    found = []
    for name in (each for each in SHOWN if each in run.designs):
        shell, design = run.shell_of(name), run.designs[name]
        cables = shell.cables(design)
        slack = {load: int((cables.tension(state) <= 0.0).sum()) for load, state in run.states[name].items()}
        for load in ("design", "additional"):
            factor, ends = None, ""
            drawn = None
            try:
                end = refinement.critical_factor(shell, design, run.loads[load], sought=_SOUGHT)
                factor, ends = end.factor, end.kind
                if count:
                    tolerances = default_tolerances(shell)
                    drawn = standing.sample(
                        shell, design, run.loads[load], tolerances, count=count, seed=seed
                    ).standing
            except NotConverged as error:
                ends = error.what
            found.append(
                Stands(
                    method,
                    name,
                    load,
                    int(design.present.sum()),
                    slack["none"],
                    slack[load],
                    factor,
                    ends,
                    0 if drawn is None else drawn.drawn,
                    None if drawn is None else drawn.standing,
                    None if drawn is None else drawn.at_least,
                    None if drawn is None else drawn.at_most,
                )
            )
    return found


def table(rows: Sequence[Stands]) -> Table:
    """The rows as a table."""
    heads = tuple(each.name for each in fields(Stands))
    return Table("standing", heads, tuple(tuple(getattr(row, head) for head in heads) for row in rows))


def page(rows: Sequence[Stands]) -> str:
    """The rows as Markdown."""
    lines = [
        "## What stands",
        "",
        "The critical factor is that of the perfect structure, over the load that is named. Structures are drawn with errors of the size's default tolerances, and each",
        "is loaded from nothing on its own path; the probability's bounds are Clopper and Pearson's, each with 95 %.",
        "",
        "| method | design | load | cables | slack before load | slack under it | critical factor | drawn structures that stand | probability |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        factor = row.ends if row.critical_factor is None else f"{row.critical_factor:.3f} ({row.ends})"
        share = "–" if row.stand is None else f"{row.stand} of {row.drawn}"
        bounds = "–" if row.at_least is None else f"{row.at_least:.3f} to {row.at_most:.3f}"
        lines.append(
            f"| {row.method} | {row.design} | {row.load} | {row.cables} | {row.slack_before} | {row.slack_under} | {factor} "
            f"| {share} | {bounds} |"
        )
    return "\n".join([*lines, ""])
