"""A full-size shell: 18 × 11 m in plan, 4.2 m high, the size that table 1 of the paper compares its scale
model to.

Funicular like vault.py, over a plan of its own, rounder at one end and straighter along one side.
"""

from shellform.surface.funicular import thrust_heights

# The plan's edge, a closed spline through these points, m at the default size.
OUTLINE = [
    (9.0, 0.4),
    (7.6, 3.6),
    (4.2, 5.3),
    (0.0, 5.5),
    (-4.2, 5.2),
    (-7.6, 3.6),
    (-9.0, -0.2),
    (-7.8, -3.7),
    (-4.4, -5.3),
    (0.2, -5.5),
    (4.6, -5.1),
    (7.9, -3.3),
]


def build(gmsh, *, length=18.0, width=11.0, height=4.2):
    """The plan; `form` raises it by `height`."""
    points = [gmsh.model.occ.addPoint(length / 18.0 * x, width / 11.0 * y, 0.0) for x, y in OUTLINE]
    edge = gmsh.model.occ.addSpline([*points, points[0]])
    gmsh.model.occ.addPlaneSurface([gmsh.model.occ.addCurveLoop([edge])])


def form(points, triangles, edge, *, length, width, height):
    """The plan's mesh raised to the funicular shape."""
    raised = points.copy()
    raised[:, 2] = thrust_heights(points[:, :2], triangles, edge, rise=height)
    return raised
