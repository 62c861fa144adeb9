"""A slow oracle for equilibria: the energy of equations (12) to (18) with fifty digits, and its gradient by
central differences, which at that many digits are exact.

Written from the equations alone; it shares no line with the package. Networks are small: energies are Python
loops.
"""

import numpy as np
from mpmath import asin, cos, mp, mpf, sin, sqrt

from shellform.structure.elements.beam import make_beams
from shellform.structure.network import Network
from shellform.verification.models import CLAMP, no_cables

DIGITS = 50
_STEP = mpf(10) ** -18  # of the differences: errors of its square


def random_network(seed):
    """A bent chain of 3 to 7 rods with a branch, clamped at its first node: size 1e-6 to 1e3 m, rods 1 to
    1e-4 of it long, stiffnesses apart by up to 1e12; and a load that bends it well.
    """
    chance = np.random.default_rng(seed)
    count = int(chance.integers(3, 8))
    size = 10.0 ** chance.uniform(-6, 3)
    spread = chance.uniform(0.0, 12.0)
    lengths = size * 10.0 ** chance.uniform(-4.0 * chance.integers(0, 2), 0.0, count)
    ways = chance.normal([1.5, 0.0, 0.0], size=(count, 3))
    steps = ways / np.linalg.norm(ways, axis=1)[:, None] * lengths[:, None]
    nodes, ends = [np.zeros(3)], []
    for k in range(count):
        root = k if chance.random() < 0.8 else int(chance.integers(0, k + 1))
        nodes.append(nodes[root] + steps[k])
        ends.append([root, k + 1])
    apart = chance.uniform(0.0, 1.0, count)
    bending = 10.0 ** (spread * (apart - apart.min()) / np.ptp(apart))
    slender = lengths * 10.0 ** chance.uniform(-3.0, -1.0, count)
    points = np.array(nodes)
    beams = make_beams(
        points, ends, axial=bending / slender**2, torsion=0.8 * bending, bending_y=bending, bending_z=1.3 * bending,
        z_axis=[[0.123, 0.456, 0.789]] * count,
    )  # fmt: skip
    fixed = np.zeros((count + 1, 6), dtype=bool)
    fixed[0] = CLAMP
    load = np.zeros((count + 1, 6))
    load[-1, :3] = chance.normal(size=3)
    network = Network(points, beams, no_cables(), fixed, np.zeros((count + 1, 6)))
    reach = np.linalg.norm(points - points[-1], axis=1)[np.array(ends)].max(axis=1)
    # A force under which the softest rod turns by about half a radian.
    load[-1, :3] *= 0.5 / np.linalg.norm(load[-1, :3]) / (lengths * reach / bending).max()
    return network, load


def unbalanced(network, load, state):
    """The largest unbalanced force at a state, digits beyond double precision included, moments over the
    longest rod that meets the node, over the largest applied force.
    """
    with_digits = mp.workdps(DIGITS)
    with with_digits:
        place, turn = _exact(state)
        beams = network.beams
        worst = mpf(0)
        for node in range(len(network.nodes)):
            those = [k for k in range(len(beams.ends)) if node in beams.ends[k]]
            arm = mpf(float(max(beams.rest_length[k] for k in those)))
            for dof in range(6):
                if network.fixed[node, dof]:
                    continue
                step = _STEP * (mpf(float(min(beams.rest_length[k] for k in those))) if dof < 3 else 1)
                slope = sum(
                    sign
                    * sum(_energy(beams, k, *_shifted(place, turn, node, dof, sign * step)) for k in those)
                    for sign in (1, -1)
                ) / (2 * step)
                gap = abs(mpf(float(load[node, dof])) - slope)
                worst = max(worst, gap if dof < 3 else gap / arm)
        return float(worst / mpf(float(np.abs(load).max())))


def _exact(state):
    tail = np.zeros((len(state.positions), 7)) if state.tail is None else state.tail
    whole = np.hstack([state.positions, state.quaternions])
    exact = [
        [mpf(float(a)) + mpf(float(b)) for a, b in zip(*rows, strict=True)]
        for rows in zip(whole, tail, strict=True)
    ]
    return [row[:3] for row in exact], [_unit(row[3:]) for row in exact]


def _unit(q):
    size = sqrt(sum(x * x for x in q))
    return [x / size for x in q]


def _shifted(place, turn, node, dof, step):
    place, turn = list(place), list(turn)
    if dof < 3:
        place[node] = [x + (step if i == dof else 0) for i, x in enumerate(place[node])]
    else:
        p = [cos(step / 2), mpf(0), mpf(0), mpf(0)]
        p[dof - 2] = sin(step / 2)
        turn[node] = _product(p, turn[node])
    return place, turn


def _product(p, q):
    a, b, c, d = p
    e, f, g, h = q
    return [
        a * e - b * f - c * g - d * h,
        a * f + b * e + c * h - d * g,
        a * g - b * h + c * e + d * f,
        a * h + b * g - c * f + d * e,
    ]


def _rotated(q, v):
    w, x, y, z = q
    return [
        (1 - 2 * (y * y + z * z)) * v[0] + 2 * (x * y - w * z) * v[1] + 2 * (x * z + w * y) * v[2],
        2 * (x * y + w * z) * v[0] + (1 - 2 * (x * x + z * z)) * v[1] + 2 * (y * z - w * x) * v[2],
        2 * (x * z - w * y) * v[0] + 2 * (y * z + w * x) * v[1] + (1 - 2 * (x * x + y * y)) * v[2],
    ]


def _cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def _dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def _energy(beams, k, place, turn):
    """Equations (12) to (18) of one beam, e_z normal to the chord and to a_y + b_y."""
    a, b = beams.ends[k]
    chord = [q - p for p, q in zip(place[a], place[b], strict=True)]
    length, rest = sqrt(_dot(chord, chord)), mpf(float(beams.rest_length[k]))
    triads = [
        [_rotated(turn[n], [mpf(float(x)) for x in beams.frames[k, end, :, axis]]) for axis in range(3)]
        for end, n in enumerate((a, b))
    ]
    x = [c / length for c in chord]
    z = _cross(x, [p + q for p, q in zip(triads[0][1], triads[1][1], strict=True)])
    z = [c / sqrt(_dot(z, z)) for c in z]
    y = _cross(z, x)
    t = [
        [
            asin((_dot(z, ay) - _dot(y, az)) / 2),
            asin((_dot(z, ax) - _dot(x, az)) / 2),
            asin((_dot(y, ax) - _dot(x, ay)) / 2),
        ]
        for ax, ay, az in triads
    ]
    ea, gj, ey, ez = (
        mpf(float(v[k])) for v in (beams.axial, beams.torsion, beams.bending_y, beams.bending_z)
    )
    bent = sum(
        e * (4 * t[0][i] ** 2 + 4 * t[0][i] * t[1][i] + 4 * t[1][i] ** 2) for e, i in ((ey, 1), (ez, 2))
    )
    return (ea * (length - rest) ** 2 + gj * (t[0][0] - t[1][0]) ** 2 + bent) / (2 * rest)
