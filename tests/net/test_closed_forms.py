"""Nets that are known in closed form."""

import numpy as np
import pytest

import shellform as sf
from shellform.net.compass import Guide, _corner, covering_lattice
from shellform.net.grid import cells
from shellform.net.quality import gaussian
from shellform.surface.shape.locate import Foot, Locator
from shellform.surface.shape.target import make_surface


class Implicit:
    """A surface f = 0 with exact feet, by Newton's method on x = p + d n; without edge, but for a circle
    about the z axis.
    """

    def __init__(self, value, gradient, hessian, radius=np.inf):
        self.value, self.gradient, self.bend, self.radius = value, gradient, hessian, radius

    def foot(self, points):
        place, factor = points.copy(), np.zeros(len(points))
        for _ in range(50):
            g, h = self.gradient(place), self.bend(place)
            matrix = np.zeros((len(points), 4, 4))
            matrix[:, :3, :3] = np.eye(3) + factor[:, None, None] * h
            matrix[:, :3, 3] = matrix[:, 3, :3] = g
            right = np.concatenate(
                [points - place - factor[:, None] * g, -self.value(place)[:, None]], axis=1
            )
            step = np.linalg.solve(matrix, right[..., None])[..., 0]
            place, factor = place + step[:, :3], factor + step[:, 3]
            if np.abs(step).max() < 1e-15:
                break
        g = self.gradient(place)
        normal = g / np.linalg.norm(g, axis=1, keepdims=True)
        distance = np.sum((points - place) * normal, axis=1)
        count = len(points)
        return Foot(
            place,
            normal,
            distance,
            np.zeros((count, 6)),
            np.zeros(count, dtype=int),
            np.zeros(count, dtype=bool),
        )

    def past_outline(self, foot):
        return np.hypot(foot.point[:, 0], foot.point[:, 1]) - self.radius

    past_edge = past_outline


def straight(along, side):
    return Guide(along), Guide(-along), Guide(side), Guide(-side)


def test_the_compass_net_of_a_mesh_of_the_sphere_has_the_published_nodes():
    n = 120
    line = np.linspace(-0.75, 0.75, n)
    x, y = (each.ravel() for each in np.meshgrid(line, line, indexing="ij"))
    points = np.column_stack([x, y, np.ones(n * n)])
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    sphere = make_surface(
        points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]), normals=points
    )
    finder = Locator(sphere, reach=0.3)
    origin = np.array([0.0, 0.0, 1.0])
    guides = straight(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    places, found = covering_lattice(finder, origin, guides, (0.1, 0.1), margin=0.1)
    at = {tuple(p): q for p, q in zip(places.tolist(), found, strict=True)}
    np.testing.assert_allclose(at[1, 1], [0.09987367, 0.09987367, 0.98997500], atol=1e-7)
    np.testing.assert_allclose(at[5, 5], [0.47459259, 0.47459259, 0.74129870], atol=1e-7)


def test_along_two_generating_curves_the_compass_net_is_a_translation_surface():
    # z = x²/2 + y²/4: from points of the two generators, one chord apart, every cell is a parallelogram.
    finder = Implicit(
        lambda p: 0.5 * p[:, 0] ** 2 + 0.25 * p[:, 1] ** 2 - p[:, 2],
        lambda p: np.column_stack([p[:, 0], 0.5 * p[:, 1], -np.ones(len(p))]),
        lambda p: np.tile(np.diag([1.0, 0.5, 0.0]), (len(p), 1, 1)),
        radius=0.8,
    )
    guides = straight(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    places, found = covering_lattice(finder, np.zeros(3), guides, (0.1, 0.15), margin=0.1)
    at = {tuple(p): q for p, q in zip(places.tolist(), found, strict=True)}
    for (i, j), point in at.items():
        if (i, 0) in at and (0, j) in at:
            np.testing.assert_allclose(point, at[i, 0] + at[0, j], atol=1e-8)


def test_asymptotic_lines_of_the_pseudosphere_keep_the_sine_gordon_law_of_angles():
    """On a surface of K = -1 the angles of a Chebyshev net satisfy d²w/du dv = sin w."""

    def radius(z):
        # The tractrix r = sech t, z = t - tanh t, by Newton's method for t
        t = np.cbrt(3.0 * z) + 0.2
        for _ in range(60):
            t = t - (t - np.tanh(t) - z) / np.maximum(np.tanh(t) ** 2, 1e-12)
        return 1.0 / np.cosh(t), t

    def pieces(p):
        r, t = radius(p[:, 2])
        slope = -1.0 / np.sinh(t)  # dr/dz
        bend = np.cosh(t) / np.sinh(t) ** 2 / np.tanh(t) ** 2  # d²r/dz²
        return r, slope, bend

    def value(p):
        return np.hypot(p[:, 0], p[:, 1]) - pieces(p)[0]

    def gradient(p):
        rho = np.hypot(p[:, 0], p[:, 1])
        return np.column_stack([p[:, 0] / rho, p[:, 1] / rho, -pieces(p)[1]])

    def hessian(p):
        rho = np.hypot(p[:, 0], p[:, 1])
        h = np.zeros((len(p), 3, 3))
        h[:, 0, 0], h[:, 1, 1] = p[:, 1] ** 2 / rho**3, p[:, 0] ** 2 / rho**3
        h[:, 0, 1] = h[:, 1, 0] = -p[:, 0] * p[:, 1] / rho**3
        h[:, 2, 2] = -pieces(p)[2]
        return h

    finder = Implicit(value, gradient, hessian)
    t0, errors = 1.2, []
    origin = np.array([1.0 / np.cosh(t0), 0.0, t0 - np.tanh(t0)])
    for steps in (6, 12):
        size = 0.3 / steps
        net = np.empty((steps + 1, steps + 1, 3))
        normal = finder.foot(origin[None]).normal[0]
        up = np.array([0.0, 0.0, 1.0]) - normal[2] * normal
        up /= np.linalg.norm(up)
        across = np.cross(normal, up)
        net[0, 0] = origin
        for axis, heading in enumerate((up + across, up - across)):
            here, ahead = origin, heading / np.linalg.norm(heading)
            for k in range(1, steps + 1):
                there = finder.foot((here + size * ahead)[None]).point[0]
                for _ in range(30):
                    there = finder.foot(
                        (here + size * (there - here) / np.linalg.norm(there - here))[None]
                    ).point[0]
                ahead = there - here
                n = finder.foot(there[None]).normal[0]
                ahead = ahead - (ahead @ n) * n
                ahead, here = ahead / np.linalg.norm(ahead), there
                net[(k, 0) if axis == 0 else (0, k)] = there
        for i in range(1, steps + 1):
            for j in range(1, steps + 1):
                point, _, good = _corner(
                    finder, net[None, i - 1, j], net[None, i, j - 1], net[None, i - 1, j - 1], (size, size)
                )
                assert good[0]
                net[i, j] = point[0]
        u, v = np.gradient(net, size, axis=0, edge_order=2), np.gradient(net, size, axis=1, edge_order=2)
        cosine = np.sum(u * v, axis=2) / np.linalg.norm(u, axis=2) / np.linalg.norm(v, axis=2)
        w = np.arccos(cosine)
        # Integrated over the whole patch: the corners' angles against the area, since K = -1.
        change = w[-1, -1] - w[-1, 0] - w[0, -1] + w[0, 0]
        diagonal = np.cross(net[1:, 1:] - net[:-1, :-1], net[:-1, 1:] - net[1:, :-1])
        area = 0.5 * np.linalg.norm(diagonal, axis=2).sum()
        errors.append(abs(change - area) / area)
    assert errors[1] < 0.02
    assert errors[1] < 0.4 * errors[0]  # second order


def roof(radius, half_angle, length, n=50):
    """A strip of a cylinder about the y axis, with its true normals."""
    turn, y = (
        each.ravel()
        for each in np.meshgrid(
            np.linspace(-half_angle, half_angle, n), np.linspace(0, length, n), indexing="ij"
        )
    )
    normals = np.column_stack([np.sin(turn), np.zeros(n * n), np.cos(turn)])
    points = radius * normals + np.column_stack([np.zeros(n * n), y, np.zeros(n * n)])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    return make_surface(
        points, np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]), normals=normals
    )


def unrolling_error(net):
    """How far crossings, unrolled from the cylinder, lie from the flat grid's."""
    x, y, z = net.crossings.T
    unrolled = np.column_stack([np.arctan2(x, z), y])
    flat = net.grid.flat[net.grid.crossing_nodes].mean(axis=1)[:, :2]
    flat, unrolled = flat - flat.mean(axis=0), unrolled - unrolled.mean(axis=0)
    u, _, v = np.linalg.svd(flat.T @ unrolled)
    return np.linalg.norm(unrolled - flat @ u @ v, axis=1).max()


@pytest.mark.parametrize("angle", [0.0, 0.5, np.pi / 4])
def test_the_compass_net_of_a_cylinder_is_the_flat_grid_rolled_up(angle):
    net = sf.pull_net(roof(1.0, 0.8, 2.0), spacing=0.12, gap=1e-4, angle=angle, method="compass")
    assert unrolling_error(net) < 0.01 * 0.12  # chords are a little shorter than arcs
    assert net.quality.shear_angle_min > 0.5 * np.pi - 2e-3
    sizes = np.cumsum([len(rod.nodes) - 1 for rod in net.grid.rods])[:-1]
    for rod, bent in zip(net.grid.rods, np.split(net.quality.curvature, sizes), strict=True):
        wanted = np.cos(angle) ** 2 if rod.direction == "u" else np.sin(angle) ** 2
        assert np.median(bent[..., 0]) == pytest.approx(wanted, abs=0.01)


@pytest.mark.parametrize(
    ("angle", "sideways", "rolled"),
    [(0.0, 1e-3, 2e-3), (0.5, 0.05, 0.15), (np.pi / 4, 0.05, 0.15)],  # askew it shears a little to bend less
)
def test_a_net_pulled_onto_a_cylinder_bends_no_more_than_the_surface_and_hardly_in_it(
    angle, sideways, rolled
):
    net = sf.pull_net(roof(1.0, 0.8, 2.0), spacing=0.12, gap=1e-4, angle=angle)
    bent = net.quality.curvature
    assert bent[..., 0].max() < 1.03
    assert np.abs(bent[..., 1]).max() < sideways
    assert unrolling_error(net) < rolled * 0.12


def test_the_gaussian_curvature_of_cells_adds_up_to_the_solid_angle_of_a_cap():
    n = 60
    line = np.linspace(-0.5, 0.5, n)
    x, y = (each.ravel() for each in np.meshgrid(line, line, indexing="ij"))
    points = np.column_stack([x, y, np.sqrt(4.0 - x * x - y * y)])
    i = np.arange(n * n).reshape(n, n)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    surface = make_surface(points, faces, normals=points / 2.0)
    net = sf.pull_net(surface, spacing=0.1, gap=1e-3, method="compass")
    corners = net.crossings[cells(net.grid)]
    area = (
        0.5
        * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1).sum()
    )
    assert gaussian(Locator(surface), corners).sum() == pytest.approx(area / 4.0, rel=0.01)
    assert net.quality.gaussian_curvature == pytest.approx(area / 4.0, rel=0.01)
