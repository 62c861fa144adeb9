"""The case file: TOML, checked entry by entry, every default filled in."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

import tomli_w
from pydantic import (
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    ValidationError,
    model_validator,
)

import shellform
from shellform.case.beside_spacing import refuse_others, refuse_rods
from shellform.case.build_rod import given_section
from shellform.case.edge_entries import EdgesEntry
from shellform.case.entries import (
    CableEntry,
    ConcreteEntry,
    Entry,
    FiguresEntry,
    JointEntry,
    JointsWeightEntry,
    LoadCaseEntry,
    LoadEntry,
    NetEntry,
    OptimiseEntry,
    OwnRodEntry,
    PointsEntry,
    RodsWeightEntry,
    SheetEntry,
    StockRodEntry,
    SurfaceEntry,
    TitleBlockEntry,
)
from shellform.case.limit_entries import LimitsEntry, RobustEntry
from shellform.case.older_names import with_present_names
from shellform.case.safety_entries import SafetyEntry, TolerancesEntry
from shellform.case.wrong_entries import refusal
from shellform.errors import InputError, unreadable
from shellform.gridshell.catalogue import named, read_catalogue, shipped_catalogues
from shellform.gridshell.gridshell import Rod
from shellform.gridshell.joints import following
from shellform.gridshell.tolerances import SOURCES, Tolerances
from shellform.surface.readers.reading import ENDINGS
from shellform.written import encoded

_SURFACES = {".py", *ENDINGS}
_NAME = 255  # bytes, of a file or folder on the systems in use
_RodEntry = Annotated[
    Annotated[OwnRodEntry, Tag("own")] | Annotated[StockRodEntry, Tag("stock")],
    Discriminator(lambda entry: "stock" if _has(entry, "catalogue") else "own"),
]
_ROD: TypeAdapter[OwnRodEntry | StockRodEntry] = TypeAdapter(_RodEntry)


class Case(Entry):
    """One design job."""

    title: str = ""
    surface: SurfaceEntry
    net: NetEntry
    rod: _RodEntry
    joint: JointEntry
    cable: CableEntry
    load: Annotated[
        Annotated[LoadEntry, Tag("table")] | Annotated[list[LoadCaseEntry], Tag("cases")],
        Discriminator(lambda entry: "cases" if isinstance(entry, list) else "table"),
    ]
    part: dict[
        str,
        Annotated[
            PointsEntry | ConcreteEntry | SheetEntry | RodsWeightEntry | JointsWeightEntry,
            Field(discriminator="kind"),
        ],
    ] = Field({}, description="parts of the load cases, by name")
    edges: EdgesEntry = Field(default_factory=lambda: EdgesEntry.model_validate({}))
    optimise: OptimiseEntry
    limits: LimitsEntry = Field(default_factory=lambda: LimitsEntry.model_validate({}))
    robust: RobustEntry | None = None
    tolerances: TolerancesEntry = Field(default_factory=lambda: TolerancesEntry.model_validate({}))
    safety: SafetyEntry = Field(default_factory=lambda: SafetyEntry.model_validate({}))
    title_block: TitleBlockEntry = Field(default_factory=lambda: TitleBlockEntry.model_validate({}))
    figures: FiguresEntry = Field(default_factory=lambda: FiguresEntry(limit=None))

    @model_validator(mode="after")
    def _fitting(self) -> Case:
        if isinstance(self.rod, OwnRodEntry):
            refuse_rods(self.rod, self.net)
        refuse_others(self.net, self.joint, self.cable, self.tolerances, self.optimise)
        return self

    @model_validator(mode="after")
    def _known_parts(self) -> Case:
        if isinstance(self.load, LoadEntry):
            if self.part:
                raise ValueError(
                    "the parts of [part] need load cases, each a [[load]] with a name and factors"
                )
            return self
        names = [each.name for each in self.load]
        for needed in ("design", "additional"):
            if names.count(needed) != 1:
                raise ValueError(
                    f"there must be one [[load]] with the name {needed!r}; add it, or rename another"
                )
        for each in self.load:
            if names.count(each.name) > 1 or each.name == "none" or each.name.startswith("critical "):
                raise ValueError(f"the load's name {each.name!r} is taken; choose another")
            if each.stages and each.name in ("design", "additional"):
                raise ValueError(
                    f"the load {each.name!r} is one case and can't have stages; give them to a [[load]] of another name"
                )
            for part in [*each.factors, *each.stages]:
                if part not in self.part:
                    known = ", ".join(self.part) or "none: add tables [part.NAME]"
                    raise ValueError(
                        f"the load {each.name!r} names a part {part!r} that isn't there; known are {known}"
                    )
        return self


def load_case(path: str | Path, settings: Sequence[str] = ()) -> Case:
    """The case in a TOML file, with `settings` like "net.spacing=0.06" in place of its entries.

    The paths of its surface and catalogue are made absolute. Raises InputError naming every entry that is
    wrong.
    """
    data = read_toml(Path(path))
    for setting in settings:
        _set(data, setting)
    return make_case(data, Path(path))


def read_toml(file: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError where it can't be read."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8-sig"))
    except OSError as error:
        there = "Name a file that is there, or lay one with: shellform example vault (of a study: study)."
        kept = file / "case.toml"
        raise InputError(
            unreadable(error),
            where=str(file),
            remedy=f"The case that a run is of lies in its folder: {kept}." if kept.is_file() else there,
        ) from error
    except ValueError as error:  # TOMLDecodeError, and Python's for a number of thousands of digits
        suffix = file.suffix.lower()
        if suffix in _SURFACES:
            kind = "JSON" if suffix == ".json" else "a surface file"  # models are JSON, too
            made = shlex.quote(f"{file.stem}.toml")
            raise InputError(
                f"is {kind}, no TOML",
                where=str(file),
                remedy=f"Make a case for the surface in it: shellform new {shlex.quote(str(file))} --output {made}.",
            ) from error
        if isinstance(error, UnicodeDecodeError):
            raise InputError(
                unreadable(error), where=str(file), remedy="Name a TOML file, and save it as UTF-8."
            ) from error
        raise InputError(
            f"isn't valid TOML: {error}",
            where=str(file),
            remedy="Mend that line: NAME = VALUE, text in quotation marks, lists in [ ].",
        ) from error
    except RecursionError as error:
        raise InputError(
            "isn't valid TOML: it is nested too deeply",
            where=str(file),
            remedy="Take tables and lists out of one another.",
        ) from error


def make_case(data: Mapping[str, Any], file: Path, *, where: str = "") -> Case:
    """As `load_case`, from the tables of a file that are read already. Refusals name the file, or where else
    (`where`) what is wrong stands."""
    where = where or str(file)
    if "surface" not in data and isinstance(data.get("case"), str):
        raise InputError(
            f"is a study of the case {data['case']}, no case",
            where=str(file),
            remedy=f"Run it by shellform study, or name {data['case']} itself.",
        )
    try:
        case = Case.model_validate(with_joint(with_present_names(data), file, where=where))
    except ValidationError as error:
        raise refusal(error, Case, where, follows={"joint": "rod"}) from error
    try:
        return case.model_copy(update=_found_files(case, file))
    except InputError as error:
        raise error.within(where) from error


def _found_files(case: Case, file: Path) -> dict[str, Any]:
    """The tables that name files, with these by their absolute paths. Raises InputError for names of none,
    and for sections that a catalogue hasn't got."""
    name = case.surface.file
    if "\0" in name or max(len(part.encode()) for part in ("", *Path(name).parts)) > _NAME:
        raise InputError(
            "is no file's name",
            where="surface.file",
            value=f"{name[:30]} …",
            remedy="Name the surface's file, relative to the case file.",
        )
    place = (file.parent / name).resolve()
    fill = _fill(case)
    found: dict[str, Any] = {
        "surface": case.surface.model_copy(update={"file": str(place)} | ({"fill": fill} if fill else {}))
    }
    if case.edges.beam.catalogue is not None and case.edges.beam.section is not None:
        source = _found_catalogue(case.edges.beam.catalogue, file)
        named(read_catalogue(source), case.edges.beam.section, where="edges.beam.section")
        beam = case.edges.beam.model_copy(update={"catalogue": source})
        found["edges"] = case.edges.model_copy(update={"beam": beam})
    if case.optimise.catalogue is not None:
        source = _found_catalogue(case.optimise.catalogue, file)
        read_catalogue(source)
        found["optimise"] = case.optimise.model_copy(update={"catalogue": source})
    if isinstance(case.rod, StockRodEntry):
        source = _found_catalogue(case.rod.catalogue, file)
        stock = read_catalogue(source)
        if case.rod.section is not None:
            named(stock, case.rod.section)
        found["rod"] = case.rod.model_copy(update={"catalogue": source})
    return found


def with_joint(data: Mapping[str, Any], file: Path, *, where: str = "") -> Mapping[str, Any]:
    """The tables of a case file with what [joint] leaves out as fits the rods; as they are where these are
    refused. Raises InputError where their size isn't given, naming the file or `where` they stand instead."""
    given = data.get("joint", {})
    missing = [name for name in JointEntry.model_fields if isinstance(given, Mapping) and name not in given]
    if not missing:
        return data
    try:
        rod = _ROD.validate_python(data.get("rod"))
    except ValidationError:
        return data  # what is wrong with the rods is told first
    if isinstance(rod, StockRodEntry):
        rod = rod.model_copy(update={"catalogue": _found_catalogue(rod.catalogue, file)})
    try:
        section = given_section(rod)
    except InputError as error:
        raise error.within(where or str(file)) from error
    if section is None:
        raise InputError(
            f"{', '.join(missing)} can't follow the rods, whose size is left out",
            where=f"{where or file}: joint",
            remedy="Give the rods' size (rod.radius, rod.width and rod.height, or rod.section), or the joint in full.",
        )
    fitting = following(Rod(section))
    return {**data, "joint": {name: getattr(fitting, name) for name in missing} | dict(given)}


def _fill(case: Case) -> Literal["holes", "edges", "all"] | None:
    """What is filled, surface.fill and what [edges] says taken together."""
    given, edges = case.surface.fill, case.edges
    holes = edges.openings == "fill" or given in ("holes", "all")
    outer = edges.outer == "fill" or given in ("edges", "all")
    return "all" if holes and outer else "holes" if holes else "edges" if outer else None


def _found_catalogue(source: str, file: Path) -> str:
    """A shipped catalogue's name, or the absolute path of one relative to the case file."""
    return source if source in shipped_catalogues() else str((file.parent / source).resolve())


def dump_case(case: Case, tolerances: Tolerances | None = None) -> str:
    """The case as TOML, every default filled in; those of `tolerances` that follow the shell's size stand in
    comments, with their sources."""
    text = tomli_w.dumps(case.model_dump(mode="json", exclude_none=True))
    if tolerances is None:
        return text
    lines = [
        f"# {each.name} = {getattr(tolerances, each.name):.6g}  # {SOURCES[each.name]}"
        for each in fields(Tolerances)
        if getattr(case.tolerances, each.name) is None
    ]
    head = "[tolerances]\n"
    return text.replace(head, head + "".join(f"{line}\n" for line in lines), 1)


def shipped_surfaces() -> Path:
    """The folder of the builder scripts that come with shellform."""
    package = Path(shellform.__file__).resolve().parent
    inside = package / "_surfaces"
    return inside if inside.is_dir() else package.parent / "surfaces"


def check_script(path: Path, *, allow_scripts: bool) -> None:
    """Raises InputError for a builder script whose code isn't that of a shipped one, unless that is
    allowed."""
    if path.suffix == ".py" and path.is_file() and not allow_scripts and not _shipped(path):
        raise InputError(
            "is a Python script from outside the shipped surfaces and isn't run unasked",
            where=str(path),
            remedy="Read it, and if you trust it, add --allow-scripts.",
        )


def _shipped(script: Path) -> bool:
    """Whether a script is, to the byte, one that comes with shellform, wherever it lies."""
    code = script.read_bytes()
    return any(code == each.read_bytes() for each in shipped_surfaces().glob("*.py"))


def _set(data: dict[str, Any], setting: str) -> None:
    key, equals, text = setting.partition("=")
    if not equals or not key.strip():
        raise InputError(
            "must be KEY=VALUE", where="--set", value=setting, remedy="For example net.spacing=0.06."
        )
    encoded(setting, "--set")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except ValueError:
        value = text  # a bare word stands for itself
    except RecursionError as error:
        raise InputError(
            "its value is nested too deeply",
            where=f"--set {key.strip()}",
            remedy="Take its lists out of one another.",
        ) from error
    set_entry(data, key.strip(), value, where="--set")


def set_entry(data: dict[str, Any], key: str, value: Any, *, where: str) -> None:
    """Puts a value in place of the entry named like "net.spacing". Raises InputError where that lies inside
    another value.
    """
    *tables, last = key.split(".")
    for table in tables:
        data = data.setdefault(table, {})
        if not isinstance(data, dict):
            raise InputError(
                "names an entry inside a value",
                where=where,
                value=key,
                remedy="Name an entry of a table, as net.spacing.",
            )
    data[last] = value


def _has(entry: Any, name: str) -> bool:
    return name in entry if isinstance(entry, dict) else hasattr(entry, name)
