"""The run folder (contracts/run-folder.md): what the stages leave in it, and how it is read back.

Every file is written whole or not at all. `read_run` gives the nouns that pictures, drawings and the page are
made from.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import shellform
from shellform.arrays import Reals, read_arrays
from shellform.case.build_gridshell import gridshell, rounding_catalogue
from shellform.case.build_problem import shown
from shellform.case.case import Case, load_case
from shellform.errors import InputError
from shellform.gridshell.catalogue import named
from shellform.gridshell.gridshell import Design, Gridshell, Rod
from shellform.net.files import load_net
from shellform.net.net import Net
from shellform.optimiser.optimum import Step
from shellform.problem.paths import deviations
from shellform.structure.elements.state import State
from shellform.structure.model import Model, write_model
from shellform.structure.solve.loading import Loaded
from shellform.surface.shape.target import Surface
from shellform.written import write_arrays

DESIGNS = ("unbraced", "initial", "unloaded", "optimised", "rounded", "polished")
FORMAT, VERSION = "shellform-summary", 1  # of summary.json
WRITTEN = (
    "case.toml", "summary.json", "stages.json", "history.csv", "surface.npz", "net.npz", "net.json", "designs", "states", "figures",
    "drawings", "schedules", "models", "optimise.npz", "report.html", "log.txt",
)  # fmt: skip

Report = Callable[[str, str], None]
"""Called with the stage and a line of progress."""


@dataclass(frozen=True)
class Run:
    """A run read back: its `designs` by name, their `states` by design and load case, the `loads` (n, 6) by
    name, and the `summary`.
    """

    folder: Path
    case: Case
    surface: Surface
    shell: Gridshell
    loads: Mapping[str, Reals]
    designs: Mapping[str, Design]
    states: Mapping[str, Mapping[str, State]]
    summary: Mapping[str, Any]

    @property
    def net(self) -> Net:
        """The shell's net."""
        return self.shell.net

    @property
    def best(self) -> str:
        """The name of the design to build: the last made of the polished, the rounded, the optimised and the
        initial one.
        """
        return [
            name
            for name in ("unbraced", "initial", "optimised", "rounded", "polished")
            if name in self.designs
        ][-1]

    def shell_of(self, name: str) -> Gridshell:
        """The shell with the rods of a design: those of a rounded one come from the catalogue."""
        section = self.summary["designs"].get(name, {}).get("section")
        catalogue = rounding_catalogue(self.case)
        if section is None or catalogue is None:
            return self.shell
        return replace(self.shell, rod=Rod(named(catalogue, section)))


def read_run(folder: str | Path) -> Run:
    """A run with at least one design, finished or not: what the summary tells of is there.

    Raises InputError for another folder, a damaged one, one without designs, and one of a newer version.
    """
    place = Path(folder)
    if not (place / "case.toml").is_file():
        raise InputError("is no run folder", where=str(place), remedy="Make one with shellform design.")
    summary = read_json(place / "summary.json")
    _refuse_newer(place, summary)
    ready = [name for name in DESIGNS if name in summary.get("designs", {})]
    if not ready:
        raise InputError(
            "the run has no designs yet",
            where=str(place),
            remedy="Run shellform design on it again: it goes on.",
        )
    for file in (
        place / name for name in ("surface.npz", "net.npz", *(f"designs/{each}.npz" for each in ready))
    ):
        if not file.is_file():
            raise InputError(
                "isn't there: the run is unfinished",
                where=str(file),
                remedy="Run shellform design on it again: it goes on.",
            )
    case = load_case(place / "case.toml")
    surface = load_surface(place / "surface.npz")
    shell, loads = gridshell(case, load_net(place / "net.npz"), surface)
    designs, states = {}, {}
    for name in ready:
        data = read_arrays(place / f"designs/{name}.npz")
        wanted = [
            "rest_length",
            "present",
            "radius",
            *(f"{each}_{what}" for each in loads for what in ("positions", "quaternions")),
        ]
        missing = [each for each in wanted if each not in data]
        if missing or len(data["present"]) != len(shell.cable_ends):
            raise InputError(
                "belongs to another state of the case: the run is half-finished",
                where=str(place / f"designs/{name}.npz"),
                remedy="Run shellform design on it again: it goes on.",
            )
        designs[name] = Design(data["rest_length"], data["present"], float(data["radius"]))
        states[name] = {each: State(data[f"{each}_positions"], data[f"{each}_quaternions"]) for each in loads}
    return Run(place, case, surface, shell, loads, designs, states, summary)


def refuse_overwriting(place: Path) -> None:
    """Raises InputError for a folder in which files that shellform didn't write would be overwritten, or
    those of a newer version.
    """
    if not place.exists():
        return
    if not place.is_dir():
        raise InputError("is a file, not a folder", where=str(place), remedy="Choose another --output.")
    summary = {} if not _ours(place / "summary.json") else read_json(place / "summary.json")
    if summary.get("format") == FORMAT:
        _refuse_newer(place, summary)
        if _number(summary.get("shellform", "0")) > _number(shellform.__version__):
            raise InputError(
                "holds a run of a newer shellform", where=str(place), value=summary["shellform"],
                remedy="Install that version, choose another --output, or let --fresh overwrite it.",
            )  # fmt: skip
        return
    there = [] if (place / "stages.json").is_file() else [name for name in WRITTEN if (place / name).exists()]
    if there:
        raise InputError(
            f"is no run folder, and {', '.join(there)} in it would be overwritten",
            where=str(place),
            remedy="Choose another --output, or let --fresh overwrite it.",
        )


def _ours(path: Path) -> bool:
    """Whether a file seems to be a summary, be it damaged: the word stands at its beginning."""
    return path.is_file() and FORMAT.encode() in path.read_bytes()[:200]


def _refuse_newer(place: Path, summary: Mapping[str, Any]) -> None:
    if summary.get("version", VERSION) > VERSION:
        raise InputError(
            "was written by a newer shellform",
            where=str(place),
            value=summary["version"],
            remedy="Install that version.",
        )


def _number(version: str) -> tuple[int, ...]:
    return tuple(int(part) for part in version.split(".") if part.isdigit())


def save_surface(path: Path, surface: Surface) -> None:
    """Writes the surface so that `load_surface` gives the same."""
    write_arrays(path, vertices=surface.vertices, triangles=surface.triangles, normals=surface.normals)


def load_surface(path: Path, source: str = "") -> Surface:
    """A saved surface."""
    data = read_arrays(path)
    return Surface(data["vertices"], data["triangles"], data["normals"], source)


def keep_design(
    folder: Path,
    shell: Gridshell,
    name: str,
    design: Design,
    loaded: Mapping[str, Loaded],
    loads: Mapping[str, Reals],
) -> dict[str, Any]:
    """Writes a design's model file and states; returns its part of the summary."""
    supports = tuple(int(node) for node in shell.net.supports)
    network = shell.network(design)
    model = Model(network, {each: loads[each] for each in loads if loads[each].any()}, shell.target, supports)
    write_model(folder / f"designs/{name}.json", model)
    states = {each: loaded[each].equilibrium.state for each in loads}
    write_arrays(
        folder / f"designs/{name}.npz",
        rest_length=design.rest_length,
        present=design.present,
        radius=np.array(design.radius),
        **{f"{each}_positions": state.positions for each, state in states.items()},
        **{f"{each}_quaternions": state.quaternions for each, state in states.items()},
    )
    pull = shell.cables(design).tension(states["design"])
    return {
        "cables": int(design.present.sum()),
        "rod_radius": design.radius,
        "cable_force_sum": float(pull.sum()),
        "cable_force_max": float(pull.max(initial=0.0)),
        "loads": {
            each: {
                "factor": round(float(loads[each][:, 2].sum() / loads["design"][:, 2].sum()), 12)
                + 0.0,  # no -0
                **_deviation(shell, states[each]),
                "stable": loaded[each].equilibrium.stable,
                "on_branch": loaded[each].on_branch,
                "residual": loaded[each].equilibrium.residual,
                "rod_utilisation_max": float(shell.bending_utilisation(design, states[each]).max()),
                **shown(shell, design, states[each], loads[each]),
            }
            for each in loads
        },
    }


def history_text(history: Sequence[Step]) -> str:
    """The content of history.csv."""
    text = io.StringIO()
    terms, constraints = list(history[0].terms), list(history[0].constraints)
    writer = csv.writer(text)
    head = [f"term.{name}" for name in terms] + [f"constraint.{name}" for name in constraints]
    writer.writerow(["evaluation", "accepted", "objective", *head, "cables", "stage", "seconds"])
    for step in history:
        values = [step.terms[name] for name in terms] + [step.constraints[name] for name in constraints]
        writer.writerow(
            [
                step.evaluation,
                int(step.accepted),
                step.objective,
                *values,
                step.cables,
                step.stage,
                round(step.seconds, 3),
            ]
        )
    return text.getvalue()


def _deviation(shell: Gridshell, state: State) -> dict[str, float]:
    away = deviations(shell, state)
    return {
        "deviation_max": float(away.max()),
        "deviation_mean": float(away.mean()),
        "deviation_rms": float(np.sqrt((away**2).mean())),
    }


def read_json(path: Path) -> dict[str, Any]:
    """The object in a JSON file, empty where there is none. Raises InputError where the file is damaged."""
    if not path.is_file():
        return {}
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(f"is damaged: {error}", where=str(path), remedy="Run again with --fresh.") from error
    if not isinstance(data, dict):
        raise InputError("is damaged", where=str(path), remedy="Run again with --fresh.")
    return data
