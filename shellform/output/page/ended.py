"""The page of a run that ended before it had a design: the cause first, then what to do, how far it came, and
what was found until then."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from shellform.output.page.template import filled, part
from shellform.quantities import extents, number
from shellform.records.summary import Summary


@dataclass(frozen=True)
class EndedRun:
    """A run that ended early.

    - `title`, and `place`: the folder's name; `version` of shellform.
    - `stage` in which it ended; `cause` and `remedy`, a sentence or more each.
    - `stages`: all, each with "done", "ended" or "" (not begun).
    - `facts` that were found, by name; `notes`; `log`: its last lines.
    - `files` of the folder with their addresses; `settings`: the case file's text.
    """

    title: str
    place: str
    version: str
    stage: str
    cause: str
    remedy: str
    stages: Sequence[tuple[str, str]]
    facts: Sequence[tuple[str, str]]
    notes: Sequence[str]
    log: Sequence[str]
    files: Sequence[tuple[str, str]]
    settings: str


def ended_page(ended: EndedRun, generator: str) -> str:
    """The page's text; `generator` is the name by which it is known again."""
    return filled(
        "ended.html",
        {"ended": ended},
        generator=generator,
        style=part("look.css") + part("style.css"),
        script="",
        data={},
        number=number,
    )


def facts(summary: Summary) -> list[tuple[str, str]]:
    """What is known of the surface, the net and the designs, in words with units."""
    found = []
    if summary.surface is not None:
        surface = summary.surface
        size = " × ".join(number(1e3 * each, 4) for each in extents(surface.size))
        found += [
            ("surface", f"{surface.source}, {size} mm, {number(surface.area)} m²"),
            ("mesh of the surface", f"{surface.triangles} triangles, {surface.holes} holes"),
        ]
    if summary.net is not None:
        net = summary.net
        found += [
            ("net", f"{net.rods} rods, {net.crossings} crossings, {net.supports} supports"),
            ("net from the surface", f"{number(1e3 * net.distance_max)} mm at most"),
            ("smallest angle between rods", f"{number(math.degrees(net.shear_angle_min))}°"),
            (
                "largest curvature",
                f"{number(net.curvature_max)} 1/m, a radius of {number(1e3 / net.curvature_max)} mm"
                if net.curvature_max > 0.0
                else "none",
            ),
        ]
        if net.rod_radius_max is not None:
            found.append(("thickest round rod that bears it", f"⌀ {number(2e3 * net.rod_radius_max)} mm"))
    for name, design in summary.designs.items():
        for load, row in design.loads.items():
            stands = "stands" if row.stable and row.on_branch else "snapped through or unstable"
            off = number(1e3 * row.deviation_max)
            found.append((f"{name} design, load {load}", f"{off} mm off at most, {stands}"))
    return found
