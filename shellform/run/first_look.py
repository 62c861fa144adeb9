"""`shellform check` and `shellform net`: a first look at a surface, and its net alone."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pydantic import ValidationError

import shellform
from shellform.case.beside_surface import doubts, refuse_beside
from shellform.case.build_gridshell import joint_of
from shellform.case.build_net import net_record, refuse_distant, size_text, surface_of, surface_record
from shellform.case.build_rod import given_section, rod_material
from shellform.case.case import Case, SurfaceEntry, load_case
from shellform.case.entries import Entry, NetEntry
from shellform.case.wrong_entries import refusal
from shellform.errors import InputError, require_degrees, require_file
from shellform.gridshell.gridshell import Rod
from shellform.gridshell.joints import doubts as joint_doubts
from shellform.gridshell.joints import usual_gap
from shellform.net.chebyshev import NetSettings
from shellform.net.cover import patches_told
from shellform.net.edges import stand
from shellform.net.net import Net
from shellform.net.orientation import oriented_net
from shellform.net.refusal import NoNet, Stalled
from shellform.net.saved import net_document, save_net
from shellform.quantities import number
from shellform.records import stages
from shellform.records.files import plain
from shellform.records.progress import Event, Kind, Report
from shellform.records.summary import NetRecord, Summary, SurfaceRecord, write_summary
from shellform.run.figures import pictures_possible
from shellform.run.folder import BUILDABLE, alone, refuse_overwriting
from shellform.run.way_out import COVERED, with_way_out
from shellform.surface.readers.reading import FORMATS, kind_of, states_unit
from shellform.surface.readers.stated import stated_unit
from shellform.surface.shape.target import Surface, largest_curvature
from shellform.written import write_text

YOUNG, STRENGTH = 40e9, 255e6  # Pa, of the paper's GFRP rods


@dataclass(frozen=True)
class Expected:
    """What to expect of a case's net: about so many `crossings`, and degrees of `freedoms`, at its
    `spacing`, m."""

    spacing: float
    crossings: int
    freedoms: int


@dataclass(frozen=True)
class FirstLook:
    """What a surface is: its record, the file's `format` and `unit`, its largest curvature, 1/m, and the
    largest radius, m, of rods bent to that by equation (1) (None: any), from which the net's may
    differ either way; of a case what to expect of its net, and its `doubts`: what may have been given in
    another unit, a sentence each."""

    surface: SurfaceRecord
    format: str
    unit: str
    curvature_max: float
    rod_radius_max: float | None
    expected: Expected | None = None
    doubts: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """As JSON says it: the surface's keys stand beside the others."""
        found: dict[str, Any] = plain(self.surface)
        found |= {"format": self.format, "unit": self.unit, "curvature_max": self.curvature_max}
        found |= {"rod_radius_max": self.rod_radius_max}
        if self.expected is None:
            return found
        return found | {"expected": plain(self.expected), "doubts": list(self.doubts)}


def check_file(file: Path, options: Mapping[str, Any], *, allow_scripts: bool) -> FirstLook:
    """What a surface file or a case's surface is, in SI units; `options` are the entries of [surface] in a
    case.

    Of a case what to expect of its net is said too; it has these entries itself. Raises InputError.
    """
    case = load_case(file) if file.suffix.lower() == ".toml" else None
    if case is not None and options:
        name, value = next(iter(options.items()))
        raise InputError(
            f"is for surface files, and a case says itself how its surface is read: surface.{name}",
            where=f"--{name.replace('_', '-')}",
            value=value,
            remedy=f"Leave it out, or write {name} in [surface] of {file}.",
        )
    entry = surface_entry(file, options) if case is None else surface_entry(None, case.surface.model_dump())
    path = Path(entry.file)
    surface = surface_of(entry, allow_scripts=allow_scripts)
    if case is not None:
        try:
            refuse_beside(case, surface)
        except InputError as error:
            raise error.within(str(file)) from error
    bent = largest_curvature(surface)
    material = rod_material(case.rod) if case else None
    young, strength = (material.young, material.strength) if material else (YOUNG, STRENGTH)
    return FirstLook(
        surface=surface_record(surface, str(path)),
        format="builder script" if path.suffix == ".py" else FORMATS[kind_of(path)],
        unit=_unit(path, entry.unit),
        curvature_max=bent,
        rod_radius_max=largest_radius(young, strength, bent),
        expected=None if case is None else expected(surface, case.net),
        doubts=() if case is None else (*doubts(case, surface), *_of_joints(case)),
    )


def _of_joints(case: Case) -> Iterator[str]:
    """What of the joints doesn't fit rods whose size is given."""
    section = given_section(case.rod)
    if section is not None:
        for doubt in joint_doubts(joint_of(case.joint), Rod(section)):
            yield f"{doubt.told()}."


def expected(surface: Surface, net: NetEntry) -> Expected:
    """What to expect of the net on a surface. At each crossing two rods have as many nodes as elements in a
    segment, of six freedoms each; those at the rods' ends come to it."""
    cells = surface.area / (net.spacing * (net.spacing_v or net.spacing))
    return Expected(net.spacing, round(cells), round(2 * 6 * net.elements * cells))


def largest_radius(young: float, strength: float, curvature: float) -> float | None:
    """Of rods on a surface, m, by equation (1) at its largest `curvature`, 1/m; None where it is flat. Moduli
    in Pa.
    """
    return strength / (young * curvature) if curvature > 0.0 else None


def labelled(found: FirstLook) -> dict[str, str]:
    """What `check_file` found, as labelled lines."""
    surface, bent = found.surface, found.curvature_max
    lines = {
        "surface": surface.source,
        "format": found.format,
        "unit": found.unit,
        "size": size_text(surface.size),
        "area": f"{number(surface.area, 4)} m²",
        "triangles": str(surface.triangles),
        "holes": str(surface.holes),
        "mended": surface.mended[0] if surface.mended else "nothing",
        **{f"mended {k}": text for k, text in enumerate(surface.mended[1:], 2)},
        "largest curvature": f"{number(bent)} 1/m, radius {number(1.0 / bent)} m" if bent > 0.0 else "none",
    }
    source = "in GFRP, strength/E = 255 MPa/40 GPa, at the surface's largest curvature"
    if found.expected is not None:
        lines["crossings to expect"] = f"about {found.expected.crossings} at {found.expected.spacing:g} m"
        lines["freedoms to expect"] = f"about {found.expected.freedoms}"
        source = "equation 1, at the surface's largest curvature"
    largest = found.rod_radius_max
    lines["largest rod radius"] = (
        "any" if largest is None else f"about {number(largest)} m ({source}; the net decides)"
    )
    return lines | {f"doubt {k}": text for k, text in enumerate(found.doubts, 1)}


def labelled_net(found: Summary) -> dict[str, str]:
    """What `net_alone` found, as labelled lines."""
    assert found.surface is not None
    assert found.net is not None
    net = found.net
    lines = {
        "size": size_text(found.surface.size),
        "rods": f"{net.rods} at {net.spacing:g} m, with {net.crossings} crossings and {net.supports} supports",
        "off the surface": f"{number(net.distance_max, 2)} m at most, {number(net.distance_mean, 2)} m in the mean",
        "off their spacing": f"{100.0 * net.spacing_error_max:.2f} % at most",
        "sharpest angle": f"{math.degrees(net.shear_angle_min):.3g}° between two rods",
        "largest curvature": f"{number(net.curvature_max)} 1/m of a rod",
        "area without rods": _uncovered(net),
    }
    if net.angle is not None:
        lines["angle of u rods"] = f"{math.degrees(net.angle):.4g}° against the x axis"
    lengths: dict[str, float] = {}
    for each in net.edges:
        lengths[each.kind] = lengths.get(each.kind, 0.0) + each.length
    lines["edge"] = ", ".join(f"{number(length)} m {kind}" for kind, length in lengths.items())
    return lines | {f"note {k}": text for k, text in enumerate(net.notes, 1)}


def _uncovered(net: NetRecord) -> str:
    if not net.uncovered:
        return "none"
    share = 100.0 * (net.uncovered_share or 0.0)
    return f"{number(net.uncovered_area, 2)} m², {number(share, 2)} %: {patches_told(net.uncovered)}"


class _Asked(Entry):
    """The part of a case that a file and options say."""

    surface: SurfaceEntry


def surface_entry(file: Path | None, options: Mapping[str, Any]) -> SurfaceEntry:
    """The [surface] entry of a file with options as a case has them. Raises InputError naming the option that
    is wrong.
    """
    given = {**({} if file is None else {"file": str(file)}), **options}
    try:
        entry = _Asked.model_validate({"surface": given}).surface
    except ValidationError as error:
        raise refusal(error, _Asked) from error
    require_file(Path(entry.file), where=entry.file)
    return entry


def _unit(path: Path, stated: str | None) -> str:
    if path.suffix == ".py":
        return "m"
    kind = kind_of(path)
    if states_unit(path):
        found = stated_unit(path, kind) if kind != "3dm" else None
        return (stated or "the file's own") if found is None else f"{found}, as the file states"
    return stated or "m, as none is stated (--unit)"


def net_alone(
    file: Path,
    folder: Path,
    options: Mapping[str, Any],
    *,
    spacing: float,
    angle: str,
    gap: float | None,
    allow_scripts: bool,
    report: Report,
) -> Summary:
    """Writes net.json, net.npz and summary.json of the net on a surface file; returns what summary.json says.

    `options` are the entries of [surface] in a case; `angle` degrees or "auto".
    """
    refuse_overwriting(folder)
    if (folder / stages.FILE).is_file():
        raise InputError(
            "holds a run of shellform design",
            where=str(folder),
            remedy="Choose another --output for the net alone.",
        )
    turned = _angle(angle)
    surface = surface_of(surface_entry(file, options), allow_scripts=allow_scripts)
    for mended in surface.mended:
        report(Event("surface", mended, Kind.NOTE))
    report(Event("surface", f"size {size_text(surface.size)}", Kind.NOTE))
    settings = NetSettings(spacing=spacing, gap=usual_gap(spacing) if gap is None else gap)

    def say(text: str) -> None:
        report(Event("net", text))

    refuse_distant(surface)

    def pulled(target: Surface) -> tuple[Net, float, tuple[float, float]]:
        return oriented_net(target, settings, angle=turned, progress=say)

    try:
        net, found, offset = pulled(surface)
    except (NoNet, Stalled) as error:
        raise with_way_out(error, surface, COVERED * spacing, folder / BUILDABLE, pulled, say) from error
    net = stand(net, surface)
    summary = Summary(
        shellform=shellform.__version__,
        surface=surface_record(surface, str(file)),
        net=net_record(net, angle=found, offset=offset),
    )
    with alone(folder):
        save_net(folder / "net.npz", net)
        write_text(folder / "net.json", json.dumps(net_document(net)))
        write_summary(folder, summary)
    if pictures_possible(report):
        from shellform.output.pictures.net_maps import draw_net

        draw_net(net, folder / "figures", surface)
    return summary


def _angle(text: str) -> float | Literal["auto"]:
    """An angle, rad, from degrees or the word auto."""
    if text == "auto":
        return "auto"
    try:
        degrees = float(text)
    except ValueError:
        degrees = math.nan
    if not math.isfinite(degrees):
        raise InputError(
            "must be degrees or auto", where="--angle", value=text, remedy="For example --angle 45."
        )
    require_degrees(degrees, where="--angle", give="degrees, such as 45, or auto")
    return math.radians(degrees)
