"""The Princeton beam: a lath of aluminium, clamped with its section turned, under a weight at its tip.

Dowell and Traybar (1975), An experimental study of the nonlinear stiffness of a rotor blade undergoing flap,
lag and twist deformations, AMS report 1257, Princeton; section, length and loads as in Bauchau, Han, Mikkola,
Matikainen and Gruber, J. Computational Nonlinear Dynamics 11 (2016): 3.2024 × 12.377 mm, 0.508 m, E = 71.7
GPa, Poisson's ratio 0.31, 4.448, 8.896 and 13.345 N. Bending about both axes is coupled with torsion, so that
all four stiffnesses, the sense of the local axes and the torsion constant of a rectangle are in each number.
"""

import numpy as np
import pytest

from shellform.structure.answers.analysis import analyse
from shellform.structure.elements.sections import Rectangle, isotropic, stiffness
from shellform.structure.model import parse_model
from tests.literature.rods import Piece, integrate, solve

LENGTH = 0.508
LATH = Rectangle(3.2024e-3, 12.377e-3, isotropic(young=71.7e9, poisson=0.31))


def exact(load, angle):
    """The tip (3,), m, of the extensible Kirchhoff rod."""
    cosine, sine = np.cos(angle), np.sin(angle)
    triad = np.array([[1.0, 0.0, 0.0], [0.0, cosine, -sine], [0.0, sine, cosine]])
    moment = np.zeros(3)
    for part in np.linspace(0.25, 1.0, 4):

        def free(m, force=part * load):
            return integrate([Piece(LENGTH)], stiffness(LATH), triad, (0.0, 0.0, -force), m)[-1].moment

        moment = solve(free, moment, [0.1] * 3)
    return integrate([Piece(LENGTH)], stiffness(LATH), triad, (0.0, 0.0, -load), moment)[-1].position


def tip(count, load, angle):
    axial, torsion, about_y, about_z = stiffness(LATH)
    beam = {"EA": axial, "GJ": torsion, "EIy": about_y, "EIz": about_z}
    beam["z_axis"] = [0.0, -float(np.sin(angle)), float(np.cos(angle))]
    model = {
        "format": "shellform-model",
        "version": 1,
        "nodes": [[LENGTH * k / count, 0.0, 0.0] for k in range(count + 1)],
        "beams": [{"nodes": [k, k + 1], **beam} for k in range(count)],
        "supports": [{"node": 0, "fixed": [True] * 6}],
        "loads": {"weight": [{"node": count, "force": [0.0, 0.0, -load]}]},
    }
    found = analyse(parse_model(model))
    assert (found.equilibrium.stable, found.on_branch, found.warnings) == (True, True, ())
    return found.equilibrium.state.positions[-1]


@pytest.mark.parametrize("load", [4.448, 8.896, 13.345])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 45.0, 75.0])
def test_the_tip_of_the_princeton_beam_is_that_of_the_exact_rod(load, degrees):
    """16 and 32 straight elements leave an error of order h², at most 2e-4 and 5e-5 of the way; extrapolated
    1.2e-7."""
    wanted, angle = exact(load, np.radians(degrees)), np.radians(degrees)
    coarse, fine = tip(16, load, angle), tip(32, load, angle)
    way = np.abs(wanted - [LENGTH, 0.0, 0.0]).max()
    errors = [np.abs(found - wanted).max() / way for found in (coarse, fine)]
    assert errors[0] < 2.1e-4
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.02)
    assert np.abs(fine + (fine - coarse) / 3.0 - wanted).max() < 5e-7 * way
