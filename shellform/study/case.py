"""The case file: TOML, checked entry by entry, every default filled in."""

from __future__ import annotations

import difflib
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, get_args, get_origin

import tomli_w
from pydantic import (
    BaseModel,
    Discriminator,
    Field,
    PositiveFloat,
    PositiveInt,
    Tag,
    ValidationError,
    model_validator,
)

import shellform
from shellform.design.catalogue import named, read_catalogue, shipped_catalogues
from shellform.errors import InputError
from shellform.study.entries import LimitsEntry, RobustEntry
from shellform.study.entries import Section as _Section
from shellform.written import write_text as write_text  # studies take it from here

_Polygon = list[tuple[float, float]]


class SurfaceEntry(_Section):
    """What is to be built."""

    file: str = Field(description="surface file, or a builder script, relative to the case file")
    unit: Literal["m", "cm", "mm", "in", "ft"] | None = Field(None, description="unit of files that carry none")
    up: Literal["y", "z"] | None = Field(None, description="vertical axis of the file; left out: the format's")
    size: PositiveFloat | None = Field(None, description="mesh size, m")
    layer: str = Field("", description="layer of the surface in the file")
    object: str = Field("", description="name of the surface in the file")
    face: Literal["upper", "lower"] | None = Field(None, description="face of a solid")
    piece: PositiveInt | None = Field(None, description="number of a separate piece, 1 the largest")
    fill: Literal["holes", "edges", "all"] | None = Field(None, description="openings to close")
    ground: float | None = Field(None, description="height to which open edges are closed, m; left out: the edge's lowest")
    dimensions: dict[str, PositiveFloat] = Field({}, description="named dimensions of a builder script, m")


class NetEntry(_Section):
    """The Chebyshev net."""

    spacing: PositiveFloat = Field(description="between rods, m")
    spacing_v: PositiveFloat | None = Field(None, description="along the v rods; left out: as along u, m")
    angle: float | Literal["auto"] = Field(0.0, description="of u rods against the x axis, degrees; auto: with least bending")
    offset: tuple[float, float] = Field((0.0, 0.0), description="of the net's origin from the middle, in spacings")
    elements: PositiveInt = Field(4, description="beam elements a segment")
    guides: list[list[tuple[float, float]]] | None = Field(None, description="two plan curves in place of angle and offset, m")
    method: Literal["pull", "compass"] = Field("pull", description="compass: the compass net as it is, unrelaxed")
    start: Literal["compass", "flat"] = Field("compass", description="from where the grid is pulled")
    spring_density: list[PositiveFloat] | None = Field(None, description="fictitious springs, rising, EI/s³")
    shear_stiffness: PositiveFloat = Field(0.1, description="fictitious, of a joint in the grid's plane, EI/s a radian")
    merge: float = Field(0.2, gt=0.0, lt=0.5, description="joints nearer to the edge, in spacings, are left out")
    ground: float | None = Field(None, description="height at which rods end, m")
    outline: list[tuple[float, float]] | None = Field(None, description="closed plan curve at which rods end, m")

    @model_validator(mode="after")
    def _guided(self) -> NetEntry:
        if self.guides is not None and (len(self.guides) != 2 or min(len(each) for each in self.guides) < 2):
            raise ValueError("guides must be two curves of at least two points each")
        if self.guides is not None and self.angle == "auto":
            raise ValueError("guides leave no angle to search for")
        return self


class _BoughtEntry(_Section):
    stock_length: PositiveFloat | None = Field(None, description="in which rods are bought, m; left out: the catalogue's, or 6 m")
    kerf: float = Field(0.003, ge=0.0, description="width of a saw cut, m")


class OwnRodEntry(_BoughtEntry):
    """Rods of given sizes: round, tubes or laths."""

    young: PositiveFloat = Field(description="Young's modulus, Pa")
    poisson: float = Field(0.3, ge=0.0, lt=0.5, description="Poisson's ratio, for the shear modulus")
    shear: PositiveFloat | None = Field(None, description="shear modulus, Pa, in place of poisson")
    strength: PositiveFloat = Field(description="flexural strength, Pa")
    density: float = Field(0.0, ge=0.0, description="kg/m³, for the rods' own weight")
    radius: PositiveFloat | None = Field(None, description="of round rods and tubes, m; left out: the largest that the net allows")
    wall: PositiveFloat | None = Field(None, description="of tubes, m")
    width: PositiveFloat | None = Field(None, description="of laths in the surface, m")
    height: PositiveFloat | None = Field(None, description="of laths across the surface, m")

    @model_validator(mode="after")
    def _one_shape(self) -> OwnRodEntry:
        if self.wall is not None and (self.radius is None or self.wall >= self.radius):
            raise ValueError("a tube's wall needs a radius larger than it")
        if (self.width is None) != (self.height is None):
            raise ValueError("a lath needs both width and height")
        if self.width is not None and self.radius is not None:
            raise ValueError("a rod has either a radius or a width and a height")
        return self


class StockRodEntry(_BoughtEntry):
    """Rods from a catalogue."""

    catalogue: str = Field(description="a shipped catalogue's name, or a TOML file relative to the case file")
    section: str | None = Field(None, description='like "10 mm", "42 x 3.5 mm"; left out: the stiffest that the net allows')


class JointEntry(_Section):
    """The connection of two crossing rods, a short beam."""

    axial: PositiveFloat = Field(description="EA, N")
    torsion: PositiveFloat = Field(description="GJ, N·m²")
    bending: PositiveFloat = Field(description="EI, N·m²")
    gap: PositiveFloat = Field(description="between the rods' axes, m")


class CableEntry(_Section):
    """Bracing cables."""

    stiffness: PositiveFloat = Field(description="EA, N")
    rest_ratio: float = Field(0.99, gt=0.0, lt=1.0, description="initial rest length over length in the target")
    force_max: PositiveFloat = Field(description="largest allowed tension, N (constraint 5)")


class LoadEntry(_Section):
    """Wet concrete as point loads."""

    force: PositiveFloat = Field(description="on each loaded crossing, N")
    every: PositiveInt = Field(1, description="2: every second crossing of the checkerboard")
    additional: float = Field(1.2, ge=1.0, description="factor of the additional load case")
    openings: list[_Polygon] = Field([], description="plan polygons without load, m")


class LoadCaseEntry(_Section):
    """A named load case: factors times parts. The cases "design" and "additional" must be there."""

    name: str = Field(pattern=r"^\w[\w .-]*$", description="of the case, and of its files")
    factors: dict[str, float] = Field({}, description="part = factor")
    stages: list[str] = Field([], description='parts added one after the other in the cases "NAME 1", "NAME 2", …')


class PointsEntry(_Section):
    """Point loads on crossings."""

    kind: Literal["points"]
    force: PositiveFloat = Field(description="on each loaded crossing, N")
    every: PositiveInt = Field(1, description="2: every second crossing of the checkerboard")
    openings: list[_Polygon] = Field([], description="plan polygons without load, m")
    inside: list[_Polygon] = Field([], description="plan polygons with load, m; left out: everywhere")


class _SpreadEntry(_Section):
    openings: list[_Polygon] = Field([], description="plan polygons where there is none, m")
    inside: list[_Polygon] = Field([], description="plan polygons where there is some, m; left out: everywhere")
    half: float | None = Field(None, description="only the half towards this direction in plan, degrees from x")
    strip: tuple[float, float, float] | None = Field(None, description="only between two places along a direction: degrees, m, m")
    ring: tuple[float, float] | None = Field(None, description="only between two levels, m")


class ConcreteEntry(_SpreadEntry):
    """Wet concrete on its true area."""

    kind: Literal["concrete"]
    thickness: PositiveFloat = Field(description="across the surface, m")
    density: PositiveFloat = Field(2500.0, description="kg/m³")


class SheetEntry(_SpreadEntry):
    """A membrane or reinforcement on its true area."""

    kind: Literal["membrane", "reinforcement"]
    mass: PositiveFloat = Field(description="kg/m²")


class RodsWeightEntry(_Section):
    """The rods' own weight."""

    kind: Literal["rods"]


class JointsWeightEntry(_Section):
    """The joints' own weight."""

    kind: Literal["joints"]
    mass: PositiveFloat = Field(description="of each, kg")


class OptimiseEntry(_Section):
    """Objective (2), bounds (3, 4) and constraint (6)."""

    misfit: float = Field(0.7, ge=0.0, le=1.0, description="share of the misfit in the start value of the objective")
    cable_force: float = Field(0.3, ge=0.0, le=1.0, description="share of the sum of cable forces")
    rod_radius: float = Field(0.0, ge=0.0, le=1.0, description="share of the rod radius; above 0 it is a variable")
    robust: float = Field(0.0, ge=0.0, le=1.0, description="share of the misfit's mean and deviation as [robust] says")
    rest_length_min: PositiveFloat = Field(0.01, description="bound (3), m")
    rest_length_max: float = Field(1.1, gt=1.0, description="bound (3), times the initial rest length")
    radius_min: PositiveFloat | None = Field(None, description="bound (4), m; left out: half the start's")
    misfit_rms_additional: PositiveFloat = Field(description="constraint (6) as root mean square distance a node, m")
    evaluations: PositiveInt = Field(100, description="design evaluations at the most")
    stiffness_min: float = Field(
        0.08, ge=0.0, lt=1.0, description="of the softest mode under additional loads, over the start's under the design load"
    )
    catalogue: str | None = Field(None, description="to which a free radius is rounded up; left out: the rods' own, if they have one")
    rounded: int = Field(30, ge=0, description="design evaluations for each section that is tried in rounding; 0: no rounding")
    neighbours: int = Field(1, ge=0, description="sections below and above the rounded one that are tried too")
    cables_max: PositiveInt | None = Field(None, description="cables are taken away down to this number, if limits allow")
    symmetric: bool = Field(False, description="cables that a symmetry of the net joins are polished to one length")
    polish: int = Field(20, ge=0, description="design evaluations for the design polished, without the cables' share; 0: none")

    @model_validator(mode="after")
    def _whole(self) -> OptimiseEntry:
        total = self.misfit + self.cable_force + self.rod_radius + self.robust
        if abs(total - 1.0) > 1e-9:
            raise ValueError(f"the shares misfit, cable_force, rod_radius and robust must add up to 1, not {total:g}")
        if self.symmetric and not self.polish:
            raise ValueError("symmetric lengths are found in polishing: give polish some evaluations")
        if self.catalogue is not None and not self.rod_radius:
            raise ValueError("catalogue is for a free radius: give rod_radius a share")
        return self


class FiguresEntry(_Section):
    """Pictures."""

    limit: PositiveFloat = Field(0.010, description="end of the colour scale, m")


class Case(_Section):
    """One design job."""

    title: str = ""
    surface: SurfaceEntry
    net: NetEntry
    rod: Annotated[
        Annotated[OwnRodEntry, Tag("own")] | Annotated[StockRodEntry, Tag("stock")],
        Discriminator(lambda entry: "stock" if _has(entry, "catalogue") else "own"),
    ]
    joint: JointEntry
    cable: CableEntry
    load: Annotated[
        Annotated[LoadEntry, Tag("table")] | Annotated[list[LoadCaseEntry], Tag("cases")],
        Discriminator(lambda entry: "cases" if isinstance(entry, list) else "table"),
    ]
    part: dict[
        str,
        Annotated[PointsEntry | ConcreteEntry | SheetEntry | RodsWeightEntry | JointsWeightEntry, Field(discriminator="kind")],
    ] = Field({}, description="parts of the load cases, by name")
    optimise: OptimiseEntry
    limits: LimitsEntry = Field(default_factory=lambda: LimitsEntry.model_validate({}))
    robust: RobustEntry | None = None
    figures: FiguresEntry = Field(default_factory=lambda: FiguresEntry(limit=0.010))

    @model_validator(mode="after")
    def _fitting(self) -> Case:
        if self.joint.gap >= 0.5 * self.net.spacing:
            raise ValueError(f"joint.gap ({self.joint.gap:g} m) must be well below net.spacing ({self.net.spacing:g} m)")
        return self

    @model_validator(mode="after")
    def _robust(self) -> Case:
        causes = RobustEntry.model_fields.keys() - {"deviations", "limit", "samples", "seed"}
        if self.robust is not None and not any(getattr(self.robust, name) for name in causes):
            raise ValueError(f"nothing scatters in [robust]: give one of {', '.join(sorted(causes))}")
        if self.optimise.robust and self.robust is None:
            raise ValueError("a share robust needs a table [robust] that says what scatters")
        return self

    @model_validator(mode="after")
    def _known_parts(self) -> Case:
        if isinstance(self.load, LoadEntry):
            if self.part:
                raise ValueError("the parts of [part] need load cases, each a [[load]] with a name and factors")
            return self
        names = [each.name for each in self.load]
        for needed in ("design", "additional"):
            if names.count(needed) != 1:
                raise ValueError(f"there must be one [[load]] with the name {needed!r}")
        for each in self.load:
            if names.count(each.name) > 1 or each.name == "none" or each.name.startswith("critical "):
                raise ValueError(f"the load's name {each.name!r} is taken")
            if each.stages and each.name in ("design", "additional"):
                raise ValueError(f"the load {each.name!r} is one case and can't have stages")
            for part in [*each.factors, *each.stages]:
                if part not in self.part:
                    known = ", ".join(self.part) or "none: add tables [part.NAME]"
                    raise ValueError(f"the load {each.name!r} names a part {part!r} that isn't there; known are {known}")
        return self


def load_case(path: str | Path, settings: Sequence[str] = ()) -> Case:
    """The case in a TOML file, with `settings` like "net.spacing=0.06" in place of its entries.

    The paths of its surface and catalogue are made absolute. Raises InputError naming every entry that is wrong.
    """
    data = read_toml(Path(path))
    for setting in settings:
        _set(data, setting)
    return make_case(data, Path(path))


def read_toml(file: Path) -> dict[str, Any]:
    """The tables of a TOML file. Raises InputError where it can't be read."""
    try:
        return tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"can't be read: {error}", where=str(file)) from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"isn't valid TOML: {error}", where=str(file)) from error
    except RecursionError as error:
        raise InputError("isn't valid TOML: it is nested too deeply", where=str(file)) from error


def make_case(data: Mapping[str, Any], file: Path) -> Case:
    """As `load_case`, from the tables of a file that are read already."""
    try:
        case = Case.model_validate(data)
    except ValidationError as error:
        raise InputError("; ".join(told(each, Case) for each in error.errors()), where=str(file)) from error
    place = (file.parent / case.surface.file).resolve()
    found: dict[str, Any] = {"surface": case.surface.model_copy(update={"file": str(place)})}
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
    return case.model_copy(update=found)


def _found_catalogue(source: str, file: Path) -> str:
    """A shipped catalogue's name, or the absolute path of one relative to the case file."""
    return source if source in shipped_catalogues() else str((file.parent / source).resolve())


def dump_case(case: Case) -> str:
    """The case as TOML, every default filled in."""
    return tomli_w.dumps(case.model_dump(mode="json", exclude_none=True))


def shipped_surfaces() -> Path:
    """The folder of the builder scripts that come with shellform."""
    package = Path(shellform.__file__).resolve().parent
    inside = package / "_surfaces"
    return inside if inside.is_dir() else package.parent / "surfaces"


def check_script(path: Path, *, allow_scripts: bool) -> None:
    """Raises InputError for a builder script from elsewhere, which would run its code, unless that is allowed."""
    if path.suffix == ".py" and not allow_scripts and shipped_surfaces() not in path.resolve().parents:
        raise InputError(
            "is a Python script from outside the shipped surfaces and isn't run unasked",
            where=str(path),
            remedy="Read it, and if you trust it, add --allow-scripts.",
        )


def _set(data: dict[str, Any], setting: str) -> None:
    key, equals, text = setting.partition("=")
    if not equals or not key.strip():
        raise InputError("must be KEY=VALUE", where="--set", value=setting, remedy="For example net.spacing=0.06.")
    try:
        value = tomllib.loads(f"value = {text}")["value"]
    except tomllib.TOMLDecodeError:
        value = text  # a bare word stands for itself
    set_entry(data, key.strip(), value, where="--set")


def set_entry(data: dict[str, Any], key: str, value: Any, *, where: str) -> None:
    """Puts a value in place of the entry named like "net.spacing". Raises InputError where that lies inside another value."""
    *sections, last = key.split(".")
    for section in sections:
        data = data.setdefault(section, {})
        if not isinstance(data, dict):
            raise InputError("names an entry inside a value", where=where, value=key)
    data[last] = value


def told(error: Any, root: type[BaseModel]) -> str:
    """One validation error in words: the entry of the file of `root`'s kind, what is wrong, the value, and the nearest known name."""
    kind = error["type"]
    entry, model = _entry(error["loc"], root)
    if kind == "extra_forbidden":
        near = difflib.get_close_matches(str(error["loc"][-1]), model.model_fields, n=1, cutoff=0.5)
        hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(model.model_fields)}"
        return f"{entry} is no known entry; {hint}"
    if kind == "union_tag_invalid":
        return f"{entry}.kind: must be one of {error['ctx']['expected_tags']} (found {error['ctx']['tag']!r})"
    if kind == "union_tag_not_found":
        return f"{entry}.kind is missing"
    if kind == "missing":
        return f"{entry} is missing"
    message = str(error["msg"]).removeprefix("Value error, ")
    message = message[:1].lower() + message[1:]
    value = "" if kind == "value_error" else f" (found {error['input']!r})"
    return f"{entry}: {message}{value}"


def _entry(place: Sequence[int | str], root: type[BaseModel]) -> tuple[str, Any]:
    """The name of an entry as the file has it, and the section in which it stands; where an entry may be of several kinds, the
    place that pydantic gives names the kind too."""
    names: list[str] = []
    kind: Any = root
    section: Any = root
    for part in place:
        plain = get_args(kind)[0] if get_origin(kind) is Annotated else kind
        if get_origin(plain) is UnionType and len(get_args(plain)) == 2 and NoneType in get_args(plain):  # a table that may be left out
            plain = next(each for each in get_args(plain) if each is not NoneType)
        told = {tag: each for each in get_args(plain) for tag in _tags(each)}
        if part in told:
            kind = told[part]
            continue
        names.append(str(part))
        if get_origin(plain) in (list, dict):
            kind = get_args(plain)[-1]
        elif isinstance(plain, type) and issubclass(plain, BaseModel):
            section = plain
            field = plain.model_fields.get(str(part))
            kind = Any if field is None else field.annotation
        else:
            kind = Any
    return ".".join(names) or root.__name__.lower(), section


def _tags(choice: Any) -> list[str]:
    """The names by which pydantic tells a choice of a union apart."""
    own = [each.tag for each in get_args(choice)[1:] if isinstance(each, Tag)]
    if isinstance(choice, type) and issubclass(choice, BaseModel) and "kind" in choice.model_fields:
        own += get_args(choice.model_fields["kind"].annotation)
    return own


def _has(entry: Any, name: str) -> bool:
    return name in entry if isinstance(entry, dict) else hasattr(entry, name)
