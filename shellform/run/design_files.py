"""The files of designs in a run folder (documentation/reference/run.md): which cables, how long, which
radius, and the state under each load, as arrays by name."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np

from shellform.arrays import read_arrays, reals
from shellform.errors import ANEW, Damaged, InputError
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.structure.elements.state import State
from shellform.written import write_arrays


def design_file(name: str) -> str:
    """Where a design's file stands in a run folder."""
    return f"designs/{name}.npz"


def write_design_file(folder: Path, name: str, design: Design, states: Mapping[str, State]) -> None:
    """Writes a design and its states by load case. Raises InputError where that can't be done."""
    write_arrays(
        folder / design_file(name),
        rest_length=design.rest_length,
        present=design.present,
        radius=np.array(design.radius),
        **{f"{load}_positions": state.positions for load, state in states.items()},
        **{f"{load}_quaternions": state.quaternions for load, state in states.items()},
    )


def read_design(
    folder: Path, name: str, shell: Gridshell, loads: Sequence[str]
) -> tuple[Design, dict[str, State]]:
    """A design of the shell and its states under the `loads`. Raises InputError for the file of another state
    of the case, and for a damaged one."""
    data = read_arrays(folder / design_file(name))
    wanted = [
        "rest_length",
        "present",
        "radius",
        *(f"{load}_{what}" for load in loads for what in ("positions", "quaternions")),
    ]
    missing = [each for each in wanted if each not in data]
    if missing or data["present"].shape != (len(shell.cable_ends),):
        raise InputError(
            "belongs to another state of the case: the run is half-finished",
            where=str(data.path),
            remedy="Run shellform design on it again: it goes on.",
        )
    with undamaged(data.path):
        design = Design(data["rest_length"], data["present"], float(data["radius"]))
        states = {
            load: State(
                reals("positions", data[f"{load}_positions"], (shell.node_count, 3)),
                reals("quaternions", data[f"{load}_quaternions"], (shell.node_count, 4)),
            )
            for load in loads
        }
    return design, states


@contextmanager
def undamaged(path: Path) -> Iterator[None]:
    """Raises Damaged naming the file where what it holds makes no sense: somebody altered it."""
    try:
        yield
    except Damaged:
        raise
    except (InputError, ValueError, TypeError, IndexError, AttributeError, OverflowError) as error:
        raise Damaged(f"is damaged: {error}", where=str(path), remedy=ANEW) from error
