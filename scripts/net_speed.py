"""Prints how long nets take against the bars of issue 4, and how the time grows with the number of crossings.

Run: PYTHONPATH=. python scripts/net_speed.py [--large]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import shellform as sf
from shellform.surface.shape.target import make_surface
from shellform.surface.shape.tree import Tree

SURFACES = Path(__file__).parent.parent / "surfaces"


def wave(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and triangles of a wavy surface over 2 × 2 m with `count` vertices a side."""
    line = np.linspace(-1.0, 1.0, count)
    x, y = (each.ravel() for each in np.meshgrid(line, line, indexing="ij"))
    i = np.arange(count * count).reshape(count, count)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return np.column_stack([x, y, 0.4 * np.cos(2 * x) * np.cos(1.5 * y)]), triangles


def row(name: str, seconds: float, bar: str) -> None:
    """One line of the table."""
    print(f"{name:58} {seconds:8.2f} s   bar {bar}", flush=True)


def closest_points() -> None:
    """100,000 points on 100,352 triangles, near the surface and all about it."""
    points, triangles = wave(225)
    rng = np.random.default_rng(0)
    near = points[rng.integers(0, len(points), 100_000)] + rng.normal(scale=0.02, size=(100_000, 3))
    Tree(points[triangles]).nearest(near[:2000])  # compiles
    for name, queries in (("near it", near), ("anywhere", rng.uniform(-2, 2, (100_000, 3)))):
        began = time.perf_counter()
        Tree(points[triangles]).nearest(queries)
        row(
            f"closest points, {name}: 1e5 on {len(triangles)} triangles, with tree",
            time.perf_counter() - began,
            "1 s",
        )
    for count in (225, 708):
        vertices, faces = wave(count)
        began = time.perf_counter()
        make_surface(vertices, faces)
        row(f"make_surface, {len(faces)} triangles", time.perf_counter() - began, "-")


def nets(large: bool) -> None:
    """The vault at paper scale, the 18 × 11 m shell at growing density."""
    vault = sf.cad.build_surface(SURFACES / "vault.py", size=0.01)
    shell = sf.cad.build_surface(SURFACES / "shell_18x11.py", size=0.2)
    sf.pull_net(vault, spacing=0.11, gap=0.002)  # compiles
    began = time.perf_counter()
    net = sf.pull_net(vault, spacing=0.055, gap=0.002, angle=np.deg2rad(45.0))
    row(f"paper scale, {len(net.grid.lattice)} crossings", time.perf_counter() - began, "10 s")
    counts, times = [], []
    for spacing, bar in ((1.0, "-"), (0.5, "40 s"), (0.25, "-"), *([(0.155, "600 s")] if large else [])):
        began = time.perf_counter()
        net = sf.pull_net(shell, spacing=spacing, gap=spacing / 27.5)
        times.append(time.perf_counter() - began)
        counts.append(len(net.grid.lattice))
        row(
            f"18 × 11 m at {spacing:g} m, {counts[-1]} crossings, {net.quality.factorisations} factors",
            times[-1],
            bar,
        )
    slope = np.polyfit(np.log(counts[1:]), np.log(times[1:]), 1)[0]
    print(f"time grows with the number of crossings to the power {slope:.2f}   bar about 1.3")


if __name__ == "__main__":
    closest_points()
    nets("--large" in sys.argv)
