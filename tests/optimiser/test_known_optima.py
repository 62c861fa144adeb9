"""Designs whose optimum is known in closed form: a bow, and a cable against a spring.

Both are gridshells of one straight rod in the plane x-z. A gridshell's supports are pins; the one thing that
these two need besides is a support that slides, so that `InPlane` says which degrees of freedom are held and
leaves everything else, from `Problem` to `sf.optimise`, as it is.
"""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

import shellform as sf
from shellform.net.grid import Grid, GridRod
from shellform.net.net import Net
from shellform.net.quality import MAPS, Quality
from shellform.structure.elements.state import from_vectors
from shellform.verification import exact

JOINT = sf.Joint(axial=1.0, torsion=1.0, bending=1.0, gap=0.002)  # of which there is none
X, Y, Z, RX, RY, RZ = range(6)


class InPlane(sf.Gridshell):
    """Pinned at its supports, but for the rod's second end, which slides along x; in the plane x-z."""

    def network(self, design):
        made = super().network(design)
        fixed = made.fixed.copy()
        fixed[:, [Y, RX, RZ]] = True
        fixed[self.net.grid.rods[0].nodes[-1], X] = False
        return dataclasses.replace(made, fixed=fixed, imposed=np.zeros_like(made.imposed))


def net_of(flat, rod_nodes, target, supports):
    """A net of one rod without crossings."""
    along = np.linalg.norm(flat[rod_nodes] - flat[0], axis=1)
    rod = GridRod("u", 0, rod_nodes, along, np.zeros(0, dtype=int), np.zeros(0, dtype=int))
    grid = Grid(
        flat, (rod,), np.zeros((0, 2), dtype=int), np.zeros((0, 2), dtype=int), float(along[1]), JOINT.gap
    )
    maps = {name: np.zeros((1, 2, 2) if name == "curvature" else 1) for name in MAPS}
    numbers = {field.name: 0.0 for field in dataclasses.fields(Quality) if field.name not in MAPS}
    return Net(grid, target, supports, Quality(**numbers, **maps))


def line(place):
    place = np.asarray(place, dtype=float)
    return np.column_stack([place, np.zeros_like(place), np.zeros_like(place)])


def elastica(alpha, s):
    """Places (k, 3) and slopes (k,) at arc lengths s of a pinned elastica of length 1 with end slope `alpha`
    (Love 1927, art. 263)."""
    k = np.sin(0.5 * alpha)
    quarter = ellipk(k * k)
    sine, cosine, _, phase = ellipj(quarter * (1.0 - 2.0 * s), k * k)
    x = (exact.second_kind(0.5 * np.pi, k * k) - exact.second_kind(phase, k * k)) / quarter - s
    return np.column_stack([x, 0.0 * s, k * cosine / quarter]), 2.0 * np.arcsin(k * sine)


TIE = 200.0  # EA of the bow's cable, EI and length of its rod being 1
HEIGHT = 0.3


def bow(elements):
    """A round rod that one cable from end to end bends to the elastica of the given height, its target."""
    alpha = brentq(lambda a: exact.buckled(a)[2] - HEIGHT, 0.1, 2.0, xtol=1e-15)
    s = np.linspace(0.0, 1.0, elements + 1)
    place, slope = elastica(alpha, s)
    turn = np.zeros_like(place)
    turn[:, 1] = -slope
    radius = 5e-4  # EA L²/EI = 4/r² = 1.6e7: the rod's own shortening is 7e-7
    rod = sf.Rod.round(young=4.0 / (np.pi * radius**4), radius=radius)
    ends = np.array([0, elements])
    net = net_of(line(s), np.arange(elements + 1), from_vectors(place, turn), ends)
    return InPlane(net, rod, JOINT, sf.Cable(stiffness=TIE), ends[None])


def test_a_bow_gets_the_closed_form_rest_length_for_its_height():
    """Theory: under the thrust P a pinned rod of length L and bending stiffness EI takes the elastica with k
    = sin(alpha/2), alpha its end slope: P L²/EI = 4 K(k)², height/L = k/K(k), chord c/L = 2 E(k)/K(k) - 1.
    The cable along the chord carries P, so that it is l0 = c/(1 + P/EA) long when stress-free. Straight
    elements are O(h²): the error falls by 4 as they are halved, 80 elements are within 1e-5, and the
    extrapolation (4 l(h/2) - l(h))/3 leaves what the rod's finite EA and O(h⁴) do."""
    thrust, chord, height = exact.buckled(
        brentq(lambda a: exact.buckled(a)[2] - HEIGHT, 0.1, 2.0, xtol=1e-15)
    )
    assert height == pytest.approx(HEIGHT, abs=1e-14)
    wanted = chord / (1.0 + thrust / TIE)
    found, misfit = [], []
    for elements in (20, 40, 80):
        shell = bow(elements)
        none = np.zeros((elements + 1, 6))
        problem = sf.Problem(shell, sf.LoadCase("none", none), [sf.Share(1.0, sf.Misfit("none"))])
        exactly = sf.SequentialConvex(thin=False, settled=1e-7)
        best = sf.optimise(problem, shell.design(rest_ratio=0.9), solver=exactly)
        assert best.evaluations <= 10
        assert best.states["none"].positions[:, 2].max() == pytest.approx(HEIGHT, abs=0.2 / elements**2)
        found.append(float(best.design.rest_length[0]))
        misfit.append(sf.deviations(shell, best.states["none"]).max())
    errors = np.array(found) / wanted - 1.0
    np.testing.assert_allclose(errors[:-1] / errors[1:], 4.0, rtol=0.08)
    np.testing.assert_allclose(np.array(misfit)[:-1] / np.array(misfit)[1:], 4.0, rtol=0.02)
    assert abs(errors[-1]) < 1e-5
    assert (4.0 * found[2] - found[1]) / 3.0 == pytest.approx(wanted, rel=2e-8)


SPRING, LENGTHENING, EA = 1000.0, 0.02, 187.0  # N/m; m, how much longer the target is; N


def pulled():
    """A rod from x = 0 to 1, a spring along its axis, and a cable from its end to a pin at 2; the target is
    longer by LENGTHENING."""
    flat = line([0.0, 1.0, 2.0])
    radius = 0.01
    rod = sf.Rod.round(young=SPRING / (np.pi * radius**2), radius=radius)
    target = from_vectors(line([0.0, 1.0 + LENGTHENING, 2.0]), np.zeros((3, 3)))
    net = net_of(flat, np.array([0, 1]), target, np.array([0, 1, 2]))
    return InPlane(net, rod, JOINT, sf.Cable(stiffness=EA), np.array([[1, 2]]))


def optimum_at(share):
    shell = pulled()
    problem = sf.Problem(
        shell,
        sf.LoadCase("none", np.zeros((3, 6))),
        [sf.Share(1.0 - share, sf.Misfit("none")), sf.Share(share, sf.CableForce("none"))],
    )
    best = sf.optimise(problem, shell.design(rest_ratio=0.99), solver=sf.SequentialConvex(thin=False))
    return best, float(shell.cables(best.design).tension(best.states["none"]).sum())


def least_deadly_share():
    """The share of the L1 term at which the cable dies, and the misfit and tension of the start that weight
    it.
    """
    rest = 0.99 * (1.0 - LENGTHENING)
    # N = EA (l/l0 - 1) with l = 1 - u and N = k u.
    start = EA * (1.0 / rest - 1.0) / (SPRING + EA / rest)
    misfit, tension = (start - LENGTHENING) ** 2, SPRING * start
    ratio = 2.0 * LENGTHENING / SPRING * tension / misfit
    return ratio / (1.0 + ratio), misfit, tension


@pytest.mark.parametrize("part", [0.3, 0.9, 0.999, 1.001, 1.5])
def test_a_cable_against_a_spring_dies_at_the_l1_weight_of_theory(part):
    """Theory: a spring k that a cable stretches by u = N/k, wanted u*, has f = w1 (N/k - u*)² + w2 N, a
    parabola over N >= 0 with its minimum at N = k u* - k² w2/(2 w1), or at N = 0, without a cable, from w2/w1
    = 2 u*/k on: the slope of the misfit at the slack cable. Shares s of the L1 term and 1 - s of the misfit
    give w2/w1 = s d0²/((1 - s) N0), with misfit d0² and tension N0 of the start."""
    deadly, misfit, tension = least_deadly_share()
    share = part * deadly
    best, found = optimum_at(share)
    wanted = SPRING * LENGTHENING - SPRING**2 * share * misfit / (2.0 * (1.0 - share) * tension)
    assert (wanted > 0.0) == (part < 1.0)
    if wanted > 0.0:
        assert best.design.present.all()
        assert found == pytest.approx(wanted, rel=1e-3)
    else:
        assert not best.design.present.any()
        assert found == 0.0
    assert best.objective == pytest.approx(
        (1.0 - share) * (max(wanted, 0.0) / SPRING - LENGTHENING) ** 2 / misfit
        + share * max(wanted, 0.0) / tension,
        rel=1e-6,
    )
