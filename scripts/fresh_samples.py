"""Whether the share of structures that stand, as runs tell it, agrees with fresh samples of the same designs.

The design to build of each RUN is drawn again under a seed of its own, as often as before, under each load;
the table has both counts with Clopper and Pearson's bounds, both at the confidence of the run, and says
whether they overlap.

Run: PYTHONPATH=. python scripts/fresh_samples.py RUN ... [--seed 977]
Status 1 where bounds don't overlap.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from shellform.case.build_safety import case_tolerances
from shellform.records.verdict import to_build
from shellform.reliability.perfect import TO_ITS_END, perfect
from shellform.reliability.probability import Standing, counted
from shellform.reliability.safety import paths
from shellform.reliability.standing import Workshop
from shellform.run.folder import read_run
from shellform.run.judged import run_checks


@dataclass(frozen=True)
class Row:
    """Of a `run`'s `design` under a `load`: what was `told`, and what is found of `fresh` structures."""

    run: str
    design: str
    load: str
    told: Standing
    fresh: Standing

    @property
    def agrees(self) -> bool:
        """Whether the bounds overlap."""
        return self.told.at_least <= self.fresh.at_most and self.fresh.at_least <= self.told.at_most


def compared(folder: Path, seed: int) -> Iterator[Row]:
    """The design to build of a run, drawn again."""
    run = read_run(folder)
    name = to_build(run_checks(run), list(run.designs))
    shell, design = run.shell_of(name), run.designs[name]
    for largest, shares in paths(run.loads).items():
        before = run.summary.designs[name].loads[largest].stands
        if before is None:
            continue
        workshop = Workshop(perfect(shell, design, run.loads[largest], step=TO_ITS_END))
        outcomes = workshop.load_numbers(
            case_tolerances(run.case, shell),
            seed=seed,
            numbers=range(before.drawn),
            marks=tuple(shares.values()),
        )
        for load, share in shares.items():
            told = run.summary.designs[name].loads[load].stands
            if told is None:
                continue
            stand = sum(
                each.stands if share == 1.0 else each.factor >= share * (1.0 - 1e-9) for each in outcomes
            )
            yield Row(
                folder.name,
                name,
                load,
                counted(told.drawn, told.standing, seed=told.seed, confidence=told.confidence),
                counted(told.drawn, stand, seed=seed, confidence=told.confidence),
            )


def _words(found: Standing) -> str:
    return f"{found.standing} of {found.drawn} ({found.at_least:.3f} to {found.at_most:.3f})"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("runs", type=Path, nargs="+")
    parser.add_argument("--seed", type=int, default=977)
    given = parser.parse_args()
    print("| run | design | load | told | fresh | agree |\n| --- | --- | --- | --- | --- | --- |")
    off = 0
    for folder in given.runs:
        for row in compared(folder, given.seed):
            off += not row.agrees
            agree = "yes" if row.agrees else "**no**"
            cells = (row.run, row.design, row.load, _words(row.told), _words(row.fresh), agree)
            print(f"| {' | '.join(cells)} |", flush=True)
    sys.exit(1 if off else 0)


if __name__ == "__main__":
    main()
