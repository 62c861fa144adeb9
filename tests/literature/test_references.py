"""The literal references of `shellform verify`, recomputed as exact rods (rods.py): to the last digit that is
quoted.
"""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq, minimize, root

from shellform.verification import beams, buckling, cables, exact, limit_points, suites, twisted
from tests.literature.rods import Piece, about_y, extremum, integrate, solve


def agree(found, quoted, digits):
    np.testing.assert_allclose(found, quoted, rtol=0.0, atol=0.51 * 10.0**-digits)


@pytest.mark.parametrize(("torsion", "load"), beams.BENDS)
def test_the_45_degree_bend_is_a_kirchhoff_rod(torsion, load):
    stiffness = (1e7, torsion, 8.333e5, 8.333e5)
    triad = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])  # bent about -z, towards y
    arc = [Piece(25.0 * np.pi, bend=-0.01)]
    moment = np.zeros(3)
    for part in np.linspace(0.2, 1.0, 5):

        def free(m, force=part * load):
            return integrate(arc, stiffness, triad, (0.0, 0.0, force), m)[-1].moment

        moment = solve(free, moment, [8e3] * 3)
    tip = integrate(arc, stiffness, triad, (0.0, 0.0, load), moment)[-1].position
    agree(tip, beams.BENDS[torsion, load], 5)


def exact_helix(share):
    """Tip of the roll-up with a force across its plane, followed up to a share of its load."""
    rod, stiffness = [Piece(10.0)], (1e4, 100.0, 100.0, 100.0)

    def miss(m, part):
        return integrate(rod, stiffness, np.eye(3), (0.0, 0.0, 50.0 * part), m)[-1].moment - [
            0.0,
            0.0,
            200.0 * np.pi * part,
        ]

    start, before = np.zeros(3), 0.0
    for part in np.linspace(0.0, share, max(2, round(share / 0.005) + 1))[1:]:
        guess = start + np.array([0.0, 0.0, 200.0 * np.pi * (part - before)])
        start, before = solve(lambda m, p=part: miss(m, p), guess, [50.0] * 3), part
    return integrate(rod, stiffness, np.eye(3), (0.0, 0.0, 50.0 * share), start)[-1].position


def test_the_roll_up_out_of_its_plane_is_a_kirchhoff_rod():
    agree(exact_helix(0.02), beams.HELIX, 5)
    agree(exact_helix(0.1), beams.ONE_TURN, 5)


@pytest.mark.parametrize("share", [0.03, 0.1])
def test_the_roll_up_out_of_its_plane_is_followed_to_whole_turns(share):
    np.testing.assert_allclose(beams.helix(50, share), exact_helix(share), atol=0.02)


class Lee:
    """Lee's frame: unknown slope at the first pin and force there; the far end has to be at the other pin,
    without moment.
    """

    pieces = (Piece(120.0), Piece(24.0, turn=0.5 * np.pi))
    scale = (1.0, 0.1, 0.1, 1.0)

    def ends(self, slope, along, up, load):
        pieces = [*self.pieces, Piece(96.0, force=(0.0, 0.0, -load))]
        stiffness = (4320.0, 1440.0, 1440.0, 1440.0)
        return integrate(pieces, stiffness, about_y(slope - 0.5 * np.pi), (along, 0.0, up), (0.0, 0.0, 0.0))

    def misses(self, unknown):
        end = self.ends(*unknown)[-1]
        return [end.position[0] - 120.0, end.position[2] - 120.0, end.moment[1]]

    def place(self, unknown):
        """Displacements down and along under the load."""
        here = self.ends(*unknown)[1].position
        return np.array([120.0 - here[2], here[0] - 24.0])

    def under(self, load, start):
        return np.append(solve(lambda x: self.misses([*x, load]), start[:3], self.scale[:3]), load)

    def at(self, which, value, start):
        return solve(lambda x: [*self.misses(x), self.place(x)[which] - value], start, self.scale)


@pytest.fixture(scope="module")
def lee_path():
    """States of Lee's frame from rest to its last branch: by load to 1.5, by the displacement along up to
    90.
    """
    frame, x = Lee(), np.zeros(4)
    path = {}
    for load in np.arange(0.25, 1.51, 0.25):
        path[load] = x = frame.under(load, x)
    for along in np.arange(10.0, 90.1, 2.0):
        path[along] = x = frame.at(1, along, x)
    return path


def test_lee_s_frame_is_an_extensible_elastica(lee_path):
    for load, quoted in beams.LEE.items():
        agree(Lee().place(lee_path[load]), quoted, 4)


def test_the_limits_of_lee_s_frame_are_those_of_the_elastica(lee_path):
    frame, found = Lee(), []
    for start, low, high in [(26.0, 26.0, 28.0), (90.0, 89.0, 91.0)]:
        along = extremum(lambda u, x=lee_path[start]: frame.at(1, u, x)[3], low, high, 0.02)
        state = frame.at(1, along, lee_path[start])
        found.append((state[3], frame.place(state)[0]))
    for (load, drop), (quoted_load, quoted_drop) in zip(found, limit_points.LEE_LIMITS, strict=True):
        agree(load, quoted_load, 5)
        agree(drop, quoted_drop, 3)


def test_williams_toggle_is_an_extensible_elastica():
    stiffness = (1.885e6, 9.274e3, 9.274e3, 9.274e3)
    slope = np.arctan2(0.386, 12.943)
    member = [Piece(np.hypot(12.943, 0.386))]

    def load(drop):
        def misses(x):
            end = integrate(member, stiffness, about_y(-slope), (x[0], 0.0, x[1]), (0.0, x[2], 0.0))[-1]
            tangent = end.triad[:, 0]
            # The crown stays level with the rigid joint: the tangent keeps its slope there.
            return [
                end.position[0] - 12.943,
                end.position[2] - (0.386 - drop),
                tangent[2] - np.tan(slope) * tangent[0],
            ]

        # Half the crown's load goes down each member.
        return -2.0 * solve(misses, [-300.0 * (drop > 0.0), -10.0, 0.0], [100.0, 10.0, 100.0])[1]

    first = extremum(load, 0.18, 0.28, 1e-3)
    second = extremum(load, 0.36, 0.43, 1e-3)
    for drop, (quoted_load, quoted_drop) in zip((first, second), limit_points.TOGGLE, strict=True):
        agree(load(drop), quoted_load, 4)
        agree(drop, quoted_drop, 5)


def test_the_arch_of_215_degrees_is_an_extensible_elastica():
    stiffness, half = (1e8, 1e6, 1e6, 1e6), np.radians(107.5)
    top, span = 100.0 * (1.0 - np.cos(half)), 200.0 * np.sin(half)

    def ends(x):
        sides = [Piece(100.0 * half, bend=0.01), Piece(100.0 * half, bend=0.01, force=(0.0, 0.0, -x[3]))]
        return integrate(sides, stiffness, about_y(-half), (x[0], 0.0, x[1]), (0.0, x[2], 0.0))

    def at(drop, start):
        def misses(x):
            crown, hinge = ends(x)
            fallen = top - crown.position[2]
            return [hinge.position[0] - span, hinge.position[2], 0.01 * hinge.moment[1], fallen - drop]

        return solve(misses, start, [100.0, 100.0, 1e4, 100.0])

    x = np.zeros(4)
    for drop in np.arange(3.0, 114.1, 3.0):
        x = at(drop, x)
    drop = extremum(lambda v: at(v, x)[3], 112.0, 116.0, 0.02)
    agree([at(drop, x)[3], drop], limit_points.ARCH, 3)


def test_the_right_angle_frame_s_tip_load_makes_the_linearised_rod_singular():
    legs = [Piece(240.0), Piece(240.0, turn=0.5 * np.pi)]

    def tip_moment(load, moment):
        return integrate(legs, buckling.FRAME, np.eye(3), (load, 0.0, 0.0), moment)[-1].moment

    def singular(load):
        plane = [0.0]
        for part in (0.25, 0.5, 0.75, 1.0):
            plane = solve(lambda m, p=part * load: [tip_moment(p, [0.0, m[0], 0.0])[1]], plane, [100.0])
        h = 0.1
        sides = [h * np.eye(3)[k] for k in (0, 2)]
        start = np.array([0.0, plane[0], 0.0])
        slopes = [
            (tip_moment(load, start + d) - tip_moment(load, start - d))[[0, 2]] / (2.0 * h) for d in sides
        ]
        return np.linalg.det(np.array(slopes))

    agree([brentq(singular, 0.9, 1.2), brentq(singular, -0.75, -0.6)], buckling.FRAME_TIP, 5)


def test_the_loaded_saddle_net_is_the_minimum_of_its_energy():
    network, shape = cables.hypar()
    (a, b), rest, axial = network.cables.ends.T, network.cables.rest_length, network.cables.stiffness
    load, free = cables.hypar_load(shape)[:, :3], ~network.fixed[:, :3]

    def parts(x):
        place = shape.copy()
        place[free] = x
        chord = place[b] - place[a]
        length = np.linalg.norm(chord, axis=1)
        tension = axial * np.maximum(length / rest - 1.0, 0.0)
        pull = (tension / length)[:, None] * chord
        unbalanced = -load
        np.add.at(unbalanced, b, pull)
        np.subtract.at(unbalanced, a, pull)
        energy = 0.5 * (tension * (length - rest)).sum() - (load * place).sum()
        return energy, unbalanced[free], tension, place

    x = minimize(lambda x: parts(x)[:2], shape[free], jac=True, method="BFGS", options={"maxiter": 5000}).x
    for _ in range(5):  # Newton's, by differences: SciPy's root gives up where BLAS rounds on one thread
        slope = [(parts(x + h)[1] - parts(x - h)[1]) / 2e-7 for h in 1e-7 * np.eye(len(x))]
        x = x - np.linalg.solve(np.transpose(slope), parts(x)[1])
    _, unbalanced, tension, place = parts(x)
    assert np.abs(unbalanced).max() < 1e-8
    agree((place - shape)[list(cables.HYPAR_NODES), 2], cables.HYPAR[:2], 8)
    agree(tension.max(), cables.HYPAR[2], 5)
    assert (tension == 0.0).sum() == cables.HYPAR[3]


def test_the_star_dome_s_limits_are_those_of_hooke_s_bars():
    points, ends = limit_points.star_dome()
    (a, b), axial = ends.T, 3.03e5 * 3.17
    rest = np.linalg.norm(points[b] - points[a], axis=1)
    free = np.delete(np.arange(21), 2)  # all but the apex' height and the supports

    def balance(place):
        """Forces (39,) that hold the nodes, and their derivative."""
        force, slope = np.zeros(39), np.zeros((39, 39))
        for i, j, l0 in zip(a, b, rest, strict=True):
            chord = place[j] - place[i]
            length = np.linalg.norm(chord)
            e, pull = chord / length, axial * (length / l0 - 1.0)
            block = axial / l0 * np.outer(e, e) + pull / length * (np.eye(3) - np.outer(e, e))
            both = np.r_[3 * i : 3 * i + 3, 3 * j : 3 * j + 3]
            force[both] += pull * np.concatenate([-e, e])
            slope[np.ix_(both, both)] += np.block([[block, -block], [-block, block]])
        return force, slope

    def at(drop, start):
        place = start.copy()
        place[0, 2] = 8.216 - drop
        for _ in range(12):
            force, slope = balance(place)
            place.reshape(-1)[free] -= np.linalg.solve(slope[np.ix_(free, free)], force[free])
        return place, -balance(place)[0][2]

    place, found = points, []
    for drop in np.arange(0.1, 3.01, 0.1):
        place, _ = at(drop, place)
        if abs(drop - 0.7) < 1e-9 or abs(drop - 3.0) < 1e-9:
            limit = extremum(lambda w, start=place: at(w, start)[1], drop - 0.1, drop + 0.15, 1e-3)
            found.append([at(limit, place)[1], limit])
            # All that the apex' height doesn't hold is stable: the symmetric path is the one a load follows.
            slope = balance(place)[1][np.ix_(free, free)]
            assert np.linalg.eigvalsh(slope)[0] > 0.0
    agree(np.array(found)[:, 0], [load for load, _ in limit_points.DOME], 3)
    agree(np.array(found)[:, 1], [drop for _, drop in limit_points.DOME], 5)


def test_the_second_kind_s_integral_holds_also_where_scipy_s_jumps():
    m = 0.256899060094085
    for phase in (1.3425595440263027, -0.5220281, 0.3, 0.5 * np.pi):
        wanted = quad(lambda t: np.sqrt(1.0 - m * np.sin(t) ** 2), 0.0, phase, epsabs=1e-13)[0]
        assert exact.second_kind(phase, m) == pytest.approx(wanted, abs=1e-12)


def hooke_dome(drop):
    """Load and ring's place of Hamel's star dome at a drop of its crown, one sector of six with Hooke's
    bars."""
    axial, radius, low, high = 0.0155 * 3e7, 9.8425, 2.4472, 3.2346
    crown, ring = np.array([0.0, 0.0, high]), np.array([radius, 0.0, low])
    feet = [np.array([17.0472, side * 9.8425, 0.0]) for side in (1.0, -1.0)]
    next_ = [np.array([0.5, side * np.sqrt(0.75), 1.0]) for side in (1.0, -1.0)]

    def pull(a, b, rest):
        length = np.linalg.norm(b - a)
        return axial * (length / rest - 1.0) * (b - a) / length

    def forces(place):
        here, top = np.array([place[0], 0.0, place[1]]), crown - [0.0, 0.0, drop]
        total = pull(here, top, np.linalg.norm(crown - ring))
        for turn in next_:
            there = np.array([place[0] * turn[0], place[0] * turn[1], place[1]])
            total = total + pull(here, there, radius)
        for foot in feet:
            total = total + pull(here, foot, np.linalg.norm(foot - ring))
        return total[[0, 2]]

    found = root(forces, [radius, low], tol=1e-13).x
    here = np.array([found[0], 0.0, found[1]])
    return -6.0 * pull(here, crown - [0.0, 0.0, drop], np.linalg.norm(crown - ring))[2]


def test_hamel_s_dome_carries_what_hooke_s_bars_carry():
    for drop, load in suites.TRUSS_DOME:
        agree(hooke_dome(drop), load, 4)
    limit = -minimize(lambda drop: -hooke_dome(drop[0]), [0.3], method="Nelder-Mead", tol=1e-10).fun
    agree(limit, suites.TRUSS_DOME_LIMIT, 4)


def test_the_table_of_nine_thrusts_is_that_of_the_elliptic_integrals():
    for degrees, thrust, along, across in twisted.THRUSTS:
        found = exact.column(np.radians(degrees))
        # Cut off, not rounded, here and there.
        euler = 0.25 * np.pi**2
        np.testing.assert_allclose(
            (found[0] / euler, *found[1:]), (thrust, along, across), rtol=0, atol=1.6e-3
        )


def test_jayaraman_and_knudsen_s_cable_is_an_elastic_catenary():
    given = (1000.0, 0.0, 412.8837 + 613.0422, 3.16, 0.85 * 19e6, 412.8837)
    moved = np.subtract(exact.catenary(*given, 8000.0)[2:], exact.catenary(*given, 0.0)[2:])
    np.testing.assert_allclose(moved, suites.JAYARAMAN, atol=2e-3)


def test_the_torque_under_thrust_goes_over_into_that_without_and_the_column_s_load():
    assert exact.twist_under_thrust(1e-6) == pytest.approx(exact.clamped_twist(), rel=1e-6)
    assert exact.twist_under_thrust(0.0) == exact.clamped_twist()
    near = exact.twist_under_thrust(4.0 * np.pi**2 - 1e-3)
    assert near > 0.0
