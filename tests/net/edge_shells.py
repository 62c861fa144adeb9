"""Shells whose edges don't all stand on the ground, from formulas."""

import numpy as np

from shellform.surface.shape.target import make_surface


def _sheet(place, rows, columns, *, closed=False):
    """A surface of places (rows * columns, 3) in order; `closed` round the columns."""
    triangles = []
    for i in range(rows - 1):
        for j in range(columns if closed else columns - 1):
            a, b = i * columns + j, i * columns + (j + 1) % columns
            triangles += [(a, a + columns, b + columns), (a, b + columns, b)]
    return make_surface(place, np.array(triangles))


def barrel(length=0.8, radius=0.5, half=0.9, raised=0.0, across=40):
    """A barrel vault on two straight lines along x, an arch of `across` vertices at either end; `raised` m
    over z = 0."""
    x, angle = (
        each.ravel()
        for each in np.meshgrid(
            np.linspace(-length / 2, length / 2, 40), np.linspace(-half, half, across), indexing="ij"
        )
    )
    place = np.column_stack([x, radius * np.sin(angle), radius * (np.cos(angle) - np.cos(half)) + raised])
    return _sheet(place, 40, across)


def oculus(radius=0.6, hole=0.12, rise=0.22):
    """A paraboloid on a circle with a round opening in the middle."""
    r, angle = (
        each.ravel()
        for each in np.meshgrid(
            np.linspace(hole, radius, 24), 2.0 * np.pi * np.arange(96) / 96, indexing="ij"
        )
    )
    place = np.column_stack([r * np.cos(angle), r * np.sin(angle), rise * (1.0 - (r / radius) ** 2)])
    return _sheet(place, 24, 96, closed=True)


def sail(size=0.9, rise=0.16):
    """z = rise (2 - (2x/a)² - (2y/a)²) over a square: it stands on its four corners."""
    x, y = (each.ravel() for each in np.meshgrid(*2 * [np.linspace(-size / 2, size / 2, 41)], indexing="ij"))
    z = rise * (2.0 - (2.0 * x / size) ** 2 - (2.0 * y / size) ** 2)
    return _sheet(np.column_stack([x, y, z]), 41, 41)


def undulating(radius=0.6, rise=0.22, wave=0.025):
    """A paraboloid on a circle whose edge rises and falls by 0.025 m four times round, a little more than
    what counts as ground."""
    r, angle = (
        each.ravel()
        for each in np.meshgrid(np.linspace(0.0, radius, 24)[1:], 2.0 * np.pi * np.arange(96) / 96, indexing="ij")
    )  # fmt: skip
    share = r / radius
    z = rise * (1.0 - share**2) + 0.5 * wave * share**2 * (1.0 + np.cos(4.0 * angle))
    ring = _sheet(np.column_stack([r * np.cos(angle), r * np.sin(angle), z]), 23, 96, closed=True)
    middle = np.array([(0.0, 0.0, rise)])
    cap = [(len(ring.vertices), k, (k + 1) % 96) for k in range(96)]
    return make_surface(np.vstack([ring.vertices, middle]), np.vstack([ring.triangles, cap]))


def waisted(length=8.0, half=4.0, rise=1.6, waist=0.03, flare=0.5):
    """A low barrel on two straight lines along x, whose arched ends lie `waist` m beyond x = ±length/2 in the
    middle and `flare` m farther out at their feet."""
    along, across = (each.ravel() for each in np.meshgrid(np.linspace(-1.0, 1.0, 41), np.linspace(-1.0, 1.0, 41), indexing="ij"))  # fmt: skip
    x = along * (0.5 * length + waist + flare * across**4)
    return _sheet(np.column_stack([x, half * across, rise * (1.0 - across**2)]), 41, 41)


def opened(size=10.0, rise=1.2, count=41):
    """A low dome over a square, with a rectangular opening of 3 × 2 m off its middle."""
    x, y = (
        each.ravel() for each in np.meshgrid(*2 * [np.linspace(-size / 2, size / 2, count)], indexing="ij")
    )
    z = rise * (1.0 - (2.0 * x / size) ** 2) * (1.0 - (2.0 * y / size) ** 2)
    whole = _sheet(np.column_stack([x, y, z]), count, count)
    middle = whole.vertices[whole.triangles].mean(axis=1)
    kept = whole.triangles[(np.abs(middle[:, 0]) > 1.5) | (np.abs(middle[:, 1] - 2.5) > 1.0)]
    used = np.unique(kept)
    return make_surface(whole.vertices[used], np.searchsorted(used, kept))
