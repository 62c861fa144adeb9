"""`shellform check` and `shellform net`: a first look at a surface, and its net alone."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import ValidationError

import shellform
from shellform.errors import InputError
from shellform.net.files import net_document, save_net
from shellform.net.orient import oriented_net
from shellform.study.case import SurfaceEntry, load_case
from shellform.study.folder import FORMAT, VERSION, Report, refuse_overwriting
from shellform.study.pictures import pictures_possible
from shellform.study.shape import net_summary, surface_of, surface_summary, told_size
from shellform.study.shell import rod_material
from shellform.surface.reading import FORMATS, kind_of
from shellform.surface.target import largest_curvature
from shellform.written import folder as made
from shellform.written import write_text

_GAP = 1.0 / 27.5  # of the spacing, as in the paper's scale model


def check_file(file: Path, options: Mapping[str, Any], *, allow_scripts: bool) -> dict[str, str]:
    """What a surface file or a case's surface is, as labelled lines; `options` are the entries of [surface] in a case.

    For a case they take the place of its own.
    """
    case = load_case(file) if file.suffix.lower() == ".toml" else None
    entry = surface_entry(file, options) if case is None else surface_entry(None, {**case.surface.model_dump(), **options})
    path = Path(entry.file)
    surface = surface_of(entry, allow_scripts=allow_scripts)
    bent = largest_curvature(surface)
    told = {
        "surface": str(path),
        "format": "builder script" if path.suffix == ".py" else FORMATS[kind_of(path)],
        "unit": _unit(path, entry.unit),
        "size": told_size(surface),
        "area": f"{surface.area:.4g} m²",
        "triangles": str(len(surface.triangles)),
        "holes": str(surface.holes),
        "mended": "nothing" if not surface.mended else surface.mended[0],
        **{f"mended {k}": text for k, text in enumerate(surface.mended[1:], 2)},
        "largest curvature": f"{bent:.3g} 1/m, radius {1.0 / bent:.3g} m" if bent > 0.0 else "none",
    }
    if case:
        spacing = case.net.spacing
        told["crossings to expect"] = f"about {surface.area / spacing**2:.0f} at {spacing:g} m"
        told["freedoms to expect"] = f"about {48 * surface.area / spacing**2:.0f}"
        material = rod_material(case.rod)
        largest = material.strength / (material.young * bent) if bent > 0.0 else float("inf")
        told["largest rod radius"] = f"at least {largest:.3g} m (equation 1, at the surface's largest curvature)"
    else:
        told["largest rod radius"] = f"{6.4e-3 / bent:.3g} m in GFRP (strength/E = 255 MPa/40 GPa)" if bent > 0.0 else "any"
    return told


def surface_entry(file: Path | None, options: Mapping[str, Any]) -> SurfaceEntry:
    """The [surface] entry of a file with options as a case has them. Raises InputError naming the option that is wrong."""
    given = {**({} if file is None else {"file": str(file)}), **options}
    try:
        entry = SurfaceEntry.model_validate(given)
    except ValidationError as error:
        first = error.errors()[0]
        where = ".".join(["surface", *(str(part) for part in first["loc"])])
        raise InputError(str(first["msg"]).lower(), where=where, value=first["input"]) from error
    if not Path(entry.file).is_file():
        raise InputError("there is no such file", where=entry.file)
    return entry


def _unit(path: Path, stated: str | None) -> str:
    if path.suffix == ".py":
        return "m"
    if kind_of(path) in ("step", "iges", "3dm"):
        return "the file's own"
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
) -> dict[str, Any]:
    """Writes net.json, net.npz and summary.json of the net on a surface file; returns the surface's size and the net's summary.

    `options` are the entries of [surface] in a case; `angle` degrees or "auto".
    """
    refuse_overwriting(folder)
    if (folder / "stages.json").is_file():
        raise InputError("holds a run of shellform design", where=str(folder), remedy="Choose another --output for the net alone.")
    surface = surface_of(surface_entry(file, options), allow_scripts=allow_scripts)
    report("surface", f"size {told_size(surface)}")
    settings = {"spacing": spacing, "gap": gap or _GAP * spacing}
    net, found, offset = oriented_net(surface, settings, angle=_angle(angle), progress=lambda text: report("net", text))
    told = net_summary(net) | {"angle": found, "offset": list(offset)}
    made(folder)
    save_net(folder / "net.npz", net)
    write_text(folder / "net.json", json.dumps(net_document(net)))
    document = {"format": FORMAT, "version": VERSION, "shellform": shellform.__version__, "surface": surface_summary(surface, str(file)), "net": told}
    write_text(folder / "summary.json", json.dumps(document, indent=1))
    if pictures_possible(report):
        from shellform.output.nets import draw_net

        draw_net(net, folder / "figures")
    return {"size": told_size(surface), **told}


def _angle(text: str) -> float | Literal["auto"]:
    """An angle, rad, from degrees or the word auto."""
    if text == "auto":
        return "auto"
    try:
        return float(np.deg2rad(float(text)))
    except ValueError as error:
        raise InputError("must be degrees or auto", where="--angle", value=text) from error
