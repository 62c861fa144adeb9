"""Shipped and shared surfaces go to a net unattended, within the bars of issue 4."""

from pathlib import Path

import numpy as np
import pytest

import shellform as sf
from shellform.case.build_net import surface_of
from shellform.case.entries import SurfaceEntry
from shellform.net.grid import neighbours
from shellform.surface.shape.tree import Tree

ROOT = Path(__file__).parent.parent.parent
SHARED = ROOT.parent / "shared" / "surfaces"
FILES = [
    *(
        (ROOT / "surfaces" / name, angle)
        for name, angle in (("vault.py", 45.0), ("dome.py", 20.0), ("saddle.py", 45.0))
    ),
    *(
        (ROOT / "surfaces" / name, angle)
        for name, angle in (("shell_18x11.py", 0.0), ("dome_mm.step", 30.0), ("hypar.obj", 10.0))
    ),
    *(
        (SHARED / name, angle)
        for name, angle in (("hypar.obj", 45.0), ("tna_tutorial.obj", 0.0), ("tna_tutorial.3dm", 0.0))
    ),
    *((SHARED / name, 0.0) for name in ("rhinovault_pillow_vault.json", "rhinovault_holes.json")),
]
OBJECTS = {"tna_tutorial.3dm": "brep 1"}  # it holds a mesh of the same shell as well


@pytest.mark.parametrize(
    ("file", "angle"), FILES, ids=[f"{file.parent.parent.name}-{file.name}" for file, _ in FILES]
)
def test_segments_keep_half_a_percent_and_crossings_one_percent_of_the_spacing(file, angle):
    if not file.is_file():
        pytest.skip(f"{file} isn't here")
    surface = surface_of(SurfaceEntry(file=str(file), object=OBJECTS.get(file.name, "")))
    # Denser than 1/20: on the mid surface, chords differ from the rods' by curvature × gap / 2 and (curvature
    # × spacing)² / 24.
    spacing = float(max(surface.size[:2])) / 25.0
    net = sf.pull_net(surface, spacing=spacing, gap=spacing / 27.5, angle=np.deg2rad(angle))
    pairs, steps = neighbours(net.grid)
    chord = np.linalg.norm(net.crossings[pairs[:, 1]] - net.crossings[pairs[:, 0]], axis=1)
    assert np.abs(chord / steps - 1.0).max() < 0.005
    assert np.abs(net.quality.distance).max() < 0.01 * spacing
    # By the facets, which know nothing of patches: these lie off the smooth surface by their own sagitta
    corner = surface.vertices[surface.triangles]
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max()
    sagitta = longest**2 / 8.0 * float(np.abs(net.quality.curvature).max()) * 2.0
    assert Tree(corner).nearest(net.crossings)[2].max() < 0.01 * spacing + sagitta
    assert net.quality.uncovered_area < 0.02 * surface.area
    assert set(net.supports) == {node for rod in net.grid.rods for node in (rod.nodes[0], rod.nodes[-1])}
