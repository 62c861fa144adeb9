"""Drawn structures of shells whose edges hang on edge beams."""

import numpy as np

import shellform as sf
from shellform.gridshell.edge_beams import Bundle, EdgeBeam
from shellform.gridshell.tolerances import Tolerances, default_tolerances
from shellform.net.edges import stand
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.members import members_of
from shellform.reliability.standing import sample
from shellform.structure.elements.sections import isotropic
from tests.net.edge_shells import barrel


def arches():
    surface = barrel()
    net = stand(sf.pull_net(surface, spacing=0.1, gap=0.0024, angle=np.deg2rad(45.0), elements=2), surface)
    rod = sf.Rod.round(young=40e9, radius=0.0012, strength=600e6, density=2000.0)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.0024)
    edge = EdgeBeam(Bundle(0.0012, 19, 0.5, isotropic(young=40e9, density=2000.0, strength=600e6)))
    return sf.brace(net, rod, joint, sf.Cable(stiffness=2000.0), below=surface, edge=edge)


def test_edge_beams_are_drawn_without_error_and_the_structures_stand_or_fall_as_others_do():
    shell = arches()
    members = members_of(shell)
    beams = shell.beams(shell.rod.radius)
    np.testing.assert_array_equal(members.beam_length, beams.rest_length)
    every = errors_of(members, default_tolerances(shell), variables(members, 1, 0))
    own = beams.kind >= 2
    assert own.any()
    assert not every.beam_length[own].any()
    assert not every.beam_curvature[own].any()
    load = shell.point_load(0.5, every=2)
    exact = sample(shell, shell.design(), load, Tolerances(), count=1, seed=0).outcomes[0]
    assert exact.stands
    assert exact.far < 1e-6
    drawn = sample(shell, shell.design(), load, default_tolerances(shell), count=2, seed=0)
    assert all(each.far > 1e-5 for each in drawn.outcomes)
