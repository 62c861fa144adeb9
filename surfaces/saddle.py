"""A vault whose crown dips: saddle-shaped in the middle, dome-shaped towards both ends, 0.9 × 0.6 m and 0.18
m high.

Its long edges stand on the ground, its ends are arches; rods are to be supported along the whole edge.
"""

import numpy as np
from scipy.interpolate import RectBivariateSpline

DEGREE = 3


def build(gmsh, *, length=0.90, width=0.60, height=0.18, dip=0.045):
    """A cubic B-spline surface through z = (height - dip (1 - s²)²)(1 - t²), s and t from -1 to 1."""
    s = t = np.linspace(-1.0, 1.0, 61)
    crown = height - dip * (1.0 - s**2) ** 2
    surface = RectBivariateSpline(s, t, crown[:, None] * (1.0 - t**2), kx=DEGREE, ky=DEGREE, s=0)
    knots = surface.get_knots()
    counts = [len(k) - DEGREE - 1 for k in knots]
    heights = surface.get_coeffs().reshape(counts)
    # With Greville's abscissae as coordinates, x and y are linear in the parameters.
    x, y = (
        np.array([k[i + 1 : i + 1 + DEGREE].mean() for i in range(n)])
        for k, n in zip(knots, counts, strict=True)
    )
    points = [
        gmsh.model.occ.addPoint(0.5 * length * x[i], 0.5 * width * y[j], heights[i, j])
        for j in range(counts[1])
        for i in range(counts[0])
    ]
    gmsh.model.occ.addBSplineSurface(points, counts[0], degreeU=DEGREE, degreeV=DEGREE)
