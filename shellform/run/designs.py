"""Designs of a run that is being made: followed under every load, kept in its folder, and forgotten when they
are outdated.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shellform.arrays import Reals
from shellform.case.case import Case
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.problem.paths import follow
from shellform.run.figures import write_states
from shellform.run.folder import Report, keep_design
from shellform.structure.elements.state import State
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.loading import Loaded
from shellform.written import write_text


@dataclass(frozen=True)
class Making:
    """A run that is being made: its `case`, its `folder`, whom to `report` progress to, and the `keys` of its
    stages.
    """

    case: Case
    folder: Path
    report: Report
    keys: Mapping[str, str]

    def path(self, name: str) -> Path:
        """Of a file in the folder."""
        return self.folder / name

    def tell(self, summary: Mapping[str, Any]) -> None:
        """Writes summary.json."""
        write_text(self.path("summary.json"), json.dumps(summary, indent=1))


def followed(shell: Gridshell, design: Design, loads: Mapping[str, Reals]) -> dict[str, Loaded]:
    """As `follow`; where a snap-through doesn't settle, the last state stands for it, and is marked by its
    residual.
    """
    try:
        return follow(shell, design, loads)
    except NotConverged as error:
        if not isinstance(error.state, State):
            raise
        lost = Loaded(
            Equilibrium(error.state, float("nan"), error.residual, error.iterations, False, 1), 0.0, 0
        )
        return {name: lost for name in loads}


def keep(
    making: Making,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
    summary: dict[str, Any],
) -> None:
    """Writes a design's model file, states and summary."""
    summary["designs"][name] = keep_design(making.folder, shell, name, design, loaded, loads)
    write_states(making.folder, shell, name, design, {each: loaded[each].equilibrium.state for each in loads})
    making.tell(summary)


def forget(making: Making, names: Sequence[str], summary: dict[str, Any]) -> None:
    """Takes designs of an earlier run away, some of which this one may not make, with every picture and film
    of them.
    """
    for name in names:
        summary["designs"].pop(name, None)
        for part in (f"designs/{name}.npz", f"designs/{name}.json"):
            making.path(part).unlink(missing_ok=True)
        pictures = [file for file in making.folder.glob("figures/*") if name in file.stem.split("-")]
        for file in [*making.folder.glob(f"states/{name}-*.vtp"), *pictures]:
            file.unlink()
    for key in ("sections", "robust"):
        summary.pop(key, None)
        making.path(f"schedules/{key}.csv").unlink(missing_ok=True)
