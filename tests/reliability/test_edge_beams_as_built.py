"""Drawn structures of shells whose edges hang on edge beams."""

from dataclasses import replace

import numpy as np

import shellform as sf
from shellform.gridshell.edge_beams import Bundle, EdgeBeam
from shellform.gridshell.tolerances import Tolerances, default_tolerances
from shellform.net.edges import stand
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.members import members_of, zones_of
from shellform.reliability.standing import sample
from shellform.structure.elements.sections import isotropic
from shellform.structure.network import assemble
from shellform.structure.solve import equilibrium
from shellform.structure.solve.residual import ResidualNorm
from tests.net.edge_shells import barrel

GFRP = EdgeBeam(Bundle(0.0012, 19, 0.5, isotropic(young=40e9, density=2000.0, strength=600e6)))


def arches(edge=GFRP, moved=0.0):
    surface = barrel()
    if moved:
        surface = replace(surface, vertices=surface.vertices + np.array([moved, 0.0, 0.0]))
    net = stand(sf.pull_net(surface, spacing=0.1, gap=0.0024, angle=np.deg2rad(45.0), elements=2), surface)
    rod = sf.Rod.round(young=40e9, radius=0.0012, strength=600e6, density=2000.0)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.0024)
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


def test_edge_beams_weigh_on_the_crossings_beside_them_wherever_the_surface_lies():
    near, far = arches(), arches(moved=3.0)
    own = zones_of(near)
    np.testing.assert_array_equal(own, zones_of(far))
    crossings = near.net.grid.crossing_nodes
    beside = np.setdiff1d(
        np.arange(near.node_count), np.concatenate([rod.nodes for rod in near.net.grid.rods])
    )
    assert len(beside)
    middle = near.target.positions[crossings].mean(axis=1)
    apart = np.linalg.norm(middle[own[beside]] - near.target.positions[beside], axis=1)
    assert apart.max() < 0.15, "a cell across"


def test_edge_beams_whose_last_digits_are_near_what_is_to_be_told_are_loaded_in_double_precision(monkeypatch):
    # as of a barrel of ten metres, whose design was refused: the bound of what rounding leaves is ten times
    # what is left, and without load more than what may be left
    steel = isotropic(young=210e9, density=7850.0, strength=355e6)
    shell = arches(EdgeBeam(Bundle(0.03, 7, 0.5, steel)))
    load = shell.point_load(0.5, every=2)
    assembly = assemble(shell.network(shell.design()))
    measure = ResidualNorm(assembly)
    balance = assembly.evaluate(shell.target)
    none = 0.0 * load
    assert measure.rounding(balance, shell.target, none) > 2.0 * measure.most(balance, none, 1e-8)

    def never(assembly):
        raise AssertionError("twice the digits were taken")

    monkeypatch.setattr(equilibrium, "with_twice_the_digits", never)
    found = sample(shell, shell.design(), load, Tolerances(load_each=0.1), count=2, seed=1)
    assert found.standing.drawn == 2
