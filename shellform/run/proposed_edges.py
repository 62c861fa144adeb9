"""What the proposed case and its summary say of edges and edge beams."""

from __future__ import annotations

from collections.abc import Sequence

from shellform.errors import how_many
from shellform.gridshell.catalogue import label
from shellform.gridshell.edge_beams import Bundle
from shellform.net.ground import Ground
from shellform.net.net import Stretch
from shellform.run.first_edges import TUBES
from shellform.run.first_trial import FirstDesign
from shellform.structure.elements.sections import mass_per_length


def edges_told(stretches: Sequence[Stretch], ground: Ground) -> str:
    """What was found, in a line: "2 stretches on the ground, 2 edge beams, 1 of them round an opening"."""
    beams = [each for each in stretches if each.kind == "beam"]
    standing, walls = len(stretches) - len(beams), all(each.kind in ("wall", "beam") for each in stretches)
    rings = sum(each.opening for each in beams)
    sloping = f", which {ground.told}" if ground.slopes and not walls else ""
    told = f"{how_many(standing, 'stretch', 'stretches')} on {'walls' if walls else 'the ground'}{sloping}"
    if not beams:
        return told
    lowest = min(float(ground.over(each.points).min()) for each in stretches)
    highest = max(float(ground.over(each.points).max()) for each in beams) - lowest
    over = "over it" if sloping else "above the lowest"
    return f"{told}, {how_many(len(beams), 'edge beam', 'edge beams')} up to {highest:.3g} m {over}" + (
        f", {rings} of them round openings" if rings else ""
    )


def edge_beams_table(design: FirstDesign) -> str:
    """The entries of [edges.beam]."""
    section, told = design.parts.edge.section, _edges_came_to(design)
    if isinstance(section, Bundle):
        return f"""\
rods = {section.count}            # {told}in a bundle, as the rods are; or width and height, radius and wall, catalogue and section
composite = {section.composite!r}      # how far they act together: 1 as if glued, 0 loose"""
    return f"""\
catalogue = "{TUBES}"
section = "{named(label(section))}"    # {told}rolled to the edge's curve; or rods in a bundle, width and height, radius and wall"""


def edge_beams_told(design: FirstDesign) -> str:
    """What they are, and what they weigh."""
    edge = design.parts.edge
    return f"{edge.label}, {mass_per_length(edge.section):.3g} kg/m"


def _edges_came_to(design: FirstDesign) -> str:
    """What the initial design's edge beams came to: no cable lifts an edge, so that what it sags by stays in
    the shape."""
    if not design.placed.net.edges:
        return ""
    tried = design.tried
    return (
        f"stressed to {tried.edge:.0%} of their strength, up to {tried.sag_told} off under 1.2 × the load; "
    )


def named(told: str) -> str:
    """A section's label as it is typed."""
    return told.replace("⌀", "").replace("×", "x").strip()
