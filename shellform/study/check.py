"""`shellform check` and `shellform net`: a first look at a surface, and its net alone."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np

from shellform.errors import InputError
from shellform.net.files import net_document, save_net
from shellform.net.orient import oriented_net
from shellform.study.case import load_case, write_text
from shellform.study.run import Report, net_summary, read_surface
from shellform.surface.target import largest_curvature

_GAP = 1.0 / 27.5  # of the spacing, as in the paper's scale model


def check_file(file: Path, *, unit: str | None, allow_scripts: bool) -> dict[str, str]:
    """What a surface file or a case's surface is, as labelled lines."""
    case = load_case(file) if file.suffix.lower() == ".toml" else None
    entry = case.surface if case else None
    path = Path(entry.file) if entry else file
    if not path.is_file():
        raise InputError("there is no such file", where=str(path))
    surface = read_surface(
        path,
        unit=entry.unit if entry else unit,
        up=entry.up if entry else "z",
        size=entry.size if entry else None,
        dimensions=entry.dimensions if entry else None,
        allow_scripts=allow_scripts,
    )
    x, y, z = surface.size
    bent = largest_curvature(surface)
    told = {
        "surface": str(path),
        "format": path.suffix,
        "size": f"{x:.4g} × {y:.4g} × {z:.4g} m (is the unit right?)",
        "area": f"{surface.area:.4g} m²",
        "triangles": str(len(surface.triangles)),
        "holes": str(surface.holes),
        "mended": "; ".join(surface.mended) or "nothing",
        "largest curvature": f"{bent:.3g} 1/m, radius {1.0 / bent:.3g} m" if bent > 0.0 else "none",
    }
    if case:
        spacing = case.net.spacing
        told["crossings to expect"] = f"about {surface.area / spacing**2:.0f} at {spacing:g} m"
        told["freedoms to expect"] = f"about {48 * surface.area / spacing**2:.0f}"
        largest = case.rod.strength / (case.rod.young * bent) if bent > 0.0 else float("inf")
        told["largest rod radius"] = f"at least {largest:.3g} m (equation 1, at the surface's largest curvature)"
    else:
        told["largest rod radius"] = f"{6.4e-3 / bent:.3g} m in GFRP (strength/E = 255 MPa/40 GPa)" if bent > 0.0 else "any"
    return told


def net_alone(
    file: Path,
    folder: Path,
    *,
    spacing: float,
    unit: str | None,
    angle: str,
    gap: float | None,
    allow_scripts: bool,
    report: Report,
) -> dict[str, Any]:
    """Writes net.json, net.npz and summary.json of the net on a surface file; returns the net's summary."""
    if not file.is_file():
        raise InputError("there is no such file", where=str(file))
    surface = read_surface(file, unit=unit, allow_scripts=allow_scripts)
    settings = {"spacing": spacing, "gap": gap or _GAP * spacing}
    net, found, offset = oriented_net(surface, settings, angle=_angle(angle), progress=lambda text: report("net", text))
    told = net_summary(net) | {"angle": found, "offset": list(offset)}
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"can't be written: {error}", where=str(folder)) from error
    save_net(folder / "net.npz", net)
    write_text(folder / "net.json", json.dumps(net_document(net)))
    head = {"source": str(file), "area": surface.area, "size": surface.size.tolist(), "triangles": len(surface.triangles)}
    document = {"format": "shellform-summary", "version": 1, "surface": head, "net": told}
    write_text(folder / "summary.json", json.dumps(document, indent=1))
    return told


def _angle(text: str) -> float | Literal["auto"]:
    """An angle, rad, from degrees or the word auto."""
    if text == "auto":
        return "auto"
    try:
        return float(np.deg2rad(float(text)))
    except ValueError as error:
        raise InputError("must be degrees or auto", where="--angle", value=text) from error
