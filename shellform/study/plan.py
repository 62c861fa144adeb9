"""The study file: a base case, what varies, and which numbers are of interest; and the designs that this
makes.

    case = "scale_model.toml"        # beside the study file, or below it
    method = "latin"                 # grid, random, latin, sobol, search
    count = 64
    [set]                            # for all designs
    optimise.evaluations = 30
    [vary]
    net.spacing = { low = 0.050, high = 0.060 }
    cable.stiffness = [100, 187, 400]
    surface.file = { files = "shells/*.step" }
    [function]
    joint.gap = "net.spacing / 27.5"
    [column]
    cables = "designs.best.cables"
    [objective]
    cables = "min"

Samples are SciPy's (`scipy.stats.qmc`) from a seed, so that the same file always makes the same designs in
the same order.
"""

from __future__ import annotations

import copy
import itertools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from shellform.case.case import Case, make_case, read_toml, set_entry, with_joint
from shellform.case.wrong_entries import refusal
from shellform.errors import InputError
from shellform.study.expressions import evaluate
from shellform.study.files_below import inside, matching
from shellform.study.outcome import OWN_COLUMNS, Value
from shellform.study.varied import MOST, LimitEntry, StudyEntry, VaryEntry, drawn, ranged

_LONGEST = 31e6  # s, a year
_LEAVES = {"values", "low", "high", "count", "scale", "whole", "files"}
_COLUMNS = {
    "misfit": "designs.best.loads.design.deviation_rms",
    "cables": "designs.best.cables",
    "rod_radius": "designs.best.rod_radius",
    "utilisation": "designs.best.loads.design.rod_utilisation_max",
}

Unit = Callable[[float], Value]
"""From [0, 1) to a value."""


class Study(StudyEntry):
    """A study file's entries."""

    title: str = ""
    case: str = Field(description="case file, beside or below the study file")
    until: Literal["surface", "net", "initial", "optimise", "safety", "figures", "documents", "report"] = (
        Field("safety", description="last stage of each design; optimise: not examined as built")
    )
    keep: Literal["all", "best", "none"] = Field("best", description="run folders that stay")
    method: Literal["grid", "random", "latin", "sobol", "search"] = Field(
        "grid", description="how the varied entries combine"
    )
    count: int | None = Field(None, ge=1, le=MOST, description="of designs, for all methods but grid")
    population: int = Field(24, ge=2, le=10_000, description="of a search's generation")
    seed: int = Field(1, ge=0, lt=2**32)
    longest: float = Field(21600.0, gt=0.0, le=_LONGEST, description="time for one design, s")
    set: dict[str, Any] = Field({}, description="entries for all designs")
    vary: dict[str, VaryEntry] = Field({}, description="entries that vary")
    designs: list[dict[str, Any]] = Field(
        [], description="designs listed one by one; each is combined with all that varies"
    )
    function: dict[str, str | float] = Field({}, description="entries that follow from others")
    column: dict[str, str] = Field(
        _COLUMNS, description="name = path in summary.json; designs.best is the one to build"
    )
    objective: dict[str, Literal["min", "max"]] = Field({}, description="columns to be small or large")
    limit: dict[str, LimitEntry] = Field(
        {},
        description="of a column in a usable design: its largest value, or what it is to be at least or at most",
    )

    @field_validator("set", "function", mode="before")
    @classmethod
    def _plain(cls, value: Any) -> Any:
        return _flat(value, ())

    @field_validator("vary", mode="before")
    @classmethod
    def _ways(cls, value: Any) -> Any:
        found = _flat(value, _LEAVES)
        if not isinstance(found, dict):
            return found
        return {k: {"values": v} if isinstance(v, list) else v for k, v in found.items()}

    @field_validator("limit", mode="before")
    @classmethod
    def _largest(cls, value: Any) -> Any:
        if not isinstance(value, dict):
            return value
        return {k: v if isinstance(v, dict) else {"most": v} for k, v in value.items()}

    @field_validator("designs", mode="before")
    @classmethod
    def _each_plain(cls, value: Any) -> Any:
        return [_flat(each, ()) for each in value] if isinstance(value, list) else value

    @model_validator(mode="before")
    @classmethod
    def _usual(cls, data: Any) -> Any:
        """Without columns of its own a study is after misfit and cables."""
        if isinstance(data, dict) and "column" not in data and "objective" not in data:
            return {**data, "objective": {"misfit": "min", "cables": "min"}}
        return data

    @model_validator(mode="after")
    def _whole(self) -> Study:
        if self.method != "grid" and self.count is None:
            raise ValueError(f"method {self.method!r} needs a count; add count = 200, say")
        if self.method != "grid" and not self.vary:
            raise ValueError(
                f"method {self.method!r} needs entries under [vary], such as net.spacing = {{ low = 0.05, high = 0.06 }}"
            )
        if self.method == "search" and self.designs:
            raise ValueError("a search makes its own designs; leave [[designs]] out, or take another method")
        if self.method == "search" and not self.objective:
            raise ValueError('a search needs an [objective], such as misfit = "min"')
        listed = dict.fromkeys(name for each in self.designs for name in each)
        for first, where in ((self.set, "[set]"), (listed, "[[designs]]")):
            taken = [*first, *self.vary, *self.function]
            for name in taken:
                if taken.count(name) > 1:
                    raise ValueError(
                        f"{name} stands in more than one of {where}, [vary] and [function]; keep one"
                    )
        for name in self.column:
            if name in OWN_COLUMNS or name.startswith("case."):
                raise ValueError(f"a table has a column {name!r} of its own; give yours another name")
        for name in [*self.objective, *self.limit]:
            if name not in self.column:
                raise ValueError(f"{name!r} is no column; known are {', '.join(self.column)}")
        return self


@dataclass(frozen=True)
class Plan:
    """A study read and checked: its entries, the file, the base case's tables and entries, and how each
    varied entry is drawn.
    """

    study: Study
    file: Path
    tables: Mapping[str, Any]
    base: Mapping[str, Any]
    lists: Mapping[str, Sequence[Value]]
    ranges: Mapping[str, Unit]


def read_study(path: str | Path) -> Plan:
    """The plan in a study file. Raises InputError naming every entry that is wrong."""
    file = Path(path)
    entries = read_toml(file)
    if "case" not in entries and isinstance(entries.get("surface"), dict):
        raise InputError(
            "is a case, no study",
            where=str(file),
            remedy=f'Run it by shellform design, or write a study with case = "{file.name}" and what is to [vary].',
        )
    try:
        study = Study.model_validate(entries)
    except ValidationError as error:
        raise refusal(error, Study, str(file)) from error
    return make_plan(study, file)


def make_plan(study: Study, file: Path) -> Plan:
    """The plan of a study's entries; paths are relative to `file`."""
    case = inside(file, study.case, "case")
    tables = read_toml(case)
    base = make_case(tables, case).model_dump(mode="json")
    lists: dict[str, Sequence[Value]] = {}
    ranges: dict[str, Unit] = {}
    for name, entry in study.vary.items():
        if entry.files is not None:
            lists[name] = matching(file, entry.files, f"vary.{name}.files")
        elif entry.values is not None:
            lists[name] = [
                str(inside(file, str(each), f"vary.{name}")) if name == "surface.file" else each
                for each in entry.values
            ]
        elif study.method == "grid":
            if entry.count is None:
                where = f"{file}: vary.{name}"
                raise InputError(
                    "a grid needs the range's count", where=where, remedy="For example count = 5."
                )
            at = [k / max(1, entry.count - 1) for k in range(entry.count)]
            lists[name] = list(dict.fromkeys(ranged(entry, each) for each in at))
        else:
            ranges[name] = lambda at, entry=entry: drawn(entry, at)  # type: ignore[misc]
    plan = Plan(study, file, tables, base, lists, ranges)
    if length(plan) > MOST:
        raise InputError(
            f"makes {length(plan):,} designs; up to {MOST:,} are taken",
            where=str(file),
            remedy="Give fewer values a variable, or sample them.",
        )
    if study.method != "search":
        resolved(plan, next(iter(changes(plan))))  # what is wrong with all designs is wrong with the study
    return plan


def length(plan: Plan) -> int:
    """How many designs a plan makes; for a search, at the most."""
    study = plan.study
    sampled = (
        math.prod(len(each) for each in plan.lists.values())
        if study.method == "grid"
        else int(study.count or 0)
    )
    return sampled * max(1, len(study.designs))


def changes(plan: Plan) -> Iterator[dict[str, Value]]:
    """The entries that each design has of its own, in order, without those that follow from others."""
    for listed in plan.study.designs or [{}]:
        for each in _samples(plan):
            yield {**each, **listed}


def _samples(plan: Plan) -> Iterator[dict[str, Value]]:
    study, names = plan.study, list(plan.study.vary)
    if study.method == "grid":
        for values in itertools.product(*(plan.lists[name] for name in names)):
            yield dict(zip(names, values, strict=True))
        return
    from scipy.stats import qmc

    count = int(study.count or 0)
    if study.method == "random":
        import numpy as np

        points = np.random.default_rng(study.seed).random((count, len(names)))
    elif study.method == "latin":
        points = qmc.LatinHypercube(len(names), rng=study.seed).random(count)
    else:
        points = qmc.Sobol(len(names), rng=study.seed).random_base2(math.ceil(math.log2(max(count, 2))))[
            :count
        ]
    for point in points:
        yield {name: placed(plan, name, float(at)) for name, at in zip(names, point, strict=True)}


def placed(plan: Plan, name: str, at: float) -> Value:
    """The value of a varied entry at a place in [0, 1)."""
    if name in plan.ranges:
        return plan.ranges[name](at)
    values = plan.lists[name]
    return values[min(int(at * len(values)), len(values) - 1)]


def resolved(plan: Plan, own: Mapping[str, Value]) -> tuple[Case, dict[str, Value]]:
    """A design's case, and the entries in which it differs: its `own` and those that follow from them.

    Raises InputError where the case is refused.
    """
    study, case = plan.study, plan.file.parent / plan.study.case
    given: dict[str, Any] = {**study.set, **own}
    found: dict[str, float] = {}
    asked: list[str] = []

    def entry(name: str) -> float:
        if name in found:
            return found[name]
        if name in study.function:
            if name in asked:
                raise InputError(
                    "follows from itself",
                    where=f"{plan.file}: function.{name}",
                    remedy="Take the function out of its own expression.",
                )
            asked.append(name)
            text = study.function[name]
            found[name] = (
                float(text)
                if not isinstance(text, str)
                else evaluate(text, f"{plan.file}: function.{name}", entry)
            )
            return found[name]
        value = given[name] if name in given else followed(name)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(
                "is no number of the case",
                where=f"{plan.file}: function",
                value=name,
                remedy="Name an entry of the case that is a number, as net.spacing, or another function.",
            )
        return float(value)

    def followed(name: str) -> Any:
        """An entry as the base case has it; of a joint that it leaves out, as fits this design's rods."""
        value = _value_of(plan.base, name)
        if value is None or not name.startswith("joint.") or _value_of(plan.tables, name) is not None:
            return value
        rods = {each: value for each, value in given.items() if each.startswith("rod.")}
        follow = [each for each in study.function if each.startswith("rod.")]
        entries = rods | {each: _as_the_base(plan, each, entry(each)) for each in follow}
        fitting = _value_of(with_joint(_tables(plan, entries), case, where=str(plan.file)), name)
        if fitting is None:
            _made(plan, entries, own)  # says what is wrong with the rods
        return fitting

    follow = {name: _as_the_base(plan, name, entry(name)) for name in study.function}
    return _made(plan, {**given, **follow}, own), {**own, **follow}


def _made(plan: Plan, entries: Mapping[str, Value], own: Mapping[str, Value]) -> Case:
    """The base case with entries in place of its own. What is wrong with it stands in the study, for the case
    itself isn't refused: a refusal names the first of its tables with which it is."""
    file, study = plan.file.parent / plan.study.case, plan.study
    try:
        return make_case(_tables(plan, entries), file)
    except InputError:
        listed = {name for name in own if any(name in each for each in study.designs)}
        names = {"[set]": study.set, "[vary]": own.keys() - listed, "[[designs]]": listed}
        taken: set[str] = set()
        for table, more in names.items():
            taken |= set(more)
            where = f"{plan.file}: {table}"
            make_case(_tables(plan, {k: v for k, v in entries.items() if k in taken}), file, where=where)
        return make_case(_tables(plan, entries), file, where=f"{plan.file}: [function]")


def _tables(plan: Plan, entries: Mapping[str, Value]) -> dict[str, Any]:
    """The base case's tables with entries in place of its own."""
    tables = copy.deepcopy(dict(plan.tables))
    for name, value in entries.items():
        set_entry(tables, name, value, where=f"{plan.file}: {name}")
    return tables


def _as_the_base(plan: Plan, name: str, value: float) -> Value:
    """Whole numbers stay whole, so that a count may follow from others."""
    return round(value) if isinstance(_value_of(plan.base, name), int) and value == round(value) else value


def _value_of(tables: Any, name: str) -> Any:
    for part in name.split("."):
        if not isinstance(tables, Mapping) or part not in tables:
            return None
        tables = tables[part]
    return tables


def _flat(value: Any, leaves: Any, prefix: str = "") -> Any:
    """Nested tables as one, by dotted names; a table with one of `leaves` is a value."""
    if not isinstance(value, dict):
        return value
    found: dict[str, Any] = {}
    for key, each in value.items():
        if isinstance(each, dict) and not (leaves and leaves & each.keys()):
            found |= _flat(each, leaves, f"{prefix}{key}.")
        else:
            found[f"{prefix}{key}"] = each
    return found
