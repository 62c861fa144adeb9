"""A stand-in for the scale model of the paper's section 4.1, whose own surface is not public.

A funicular vault over an irregular plan of about 0.90 × 0.55 m, 0.21 m high, closed to the ground all round:
the shape in which a uniform weight of the surface is borne by thrust alone, form-found with the force density
method.
"""

from shellform.surface.funicular import thrust_heights

# The plan's edge, a closed spline through these points, in half lengths and half widths: lopsided on purpose.
OUTLINE = [
    (1.00, 0.06),
    (0.86, 0.62),
    (0.45, 0.96),
    (-0.05, 0.99),
    (-0.52, 0.90),
    (-0.90, 0.60),
    (-1.00, -0.05),
    (-0.80, -0.70),
    (-0.36, -0.99),
    (0.14, -0.97),
    (0.58, -0.92),
    (0.90, -0.55),
]


def build(gmsh, *, length=0.90, width=0.55, height=0.21):
    """The plan; `form` raises it by `height`."""
    points = [gmsh.model.occ.addPoint(0.5 * length * x, 0.5 * width * y, 0.0) for x, y in OUTLINE]
    edge = gmsh.model.occ.addSpline([*points, points[0]])
    gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop([edge])])


def form(points, triangles, edge, *, length, width, height):
    """The plan's mesh raised to the funicular shape."""
    raised = points.copy()
    raised[:, 2] = thrust_heights(points[:, :2], triangles, edge, rise=height)
    return raised
