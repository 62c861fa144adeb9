"""Low dishes, which lose their stability and have it again within a few hundredths of their load."""

import numpy as np

import shellform as sf
from shellform.structure.network import assemble
from shellform.structure.solve import path
from shellform.structure.solve.drive import forces
from shellform.structure.solve.equilibrium import find_equilibrium


def dish(rise, spacing, radius, angle, rest_ratio):
    """A gridshell on a dish of 2 m, and its initial design."""
    side = np.linspace(-1.0, 1.0, 13)
    x, y = (each.ravel() for each in np.meshgrid(side, side, indexing="ij"))
    number = np.arange(169).reshape(13, 13)
    a, b, c, d = (
        each.ravel() for each in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:])
    )
    surface = sf.make_surface(
        np.column_stack([x, y, rise * (1.0 - x**2) * (1.0 - y**2)]),
        np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])]),
    )
    net = sf.pull_net(surface, spacing=spacing, gap=0.01, angle=angle, elements=2)
    joint = sf.Joint(axial=1e6, torsion=1.0, bending=1.0, gap=0.01)
    rod, cable = sf.Rod.round(young=40e9, radius=radius), sf.Cable(stiffness=1e5)
    shell = sf.brace(net, rod, joint, cable, below=surface)
    return shell, shell.design(rest_ratio=rest_ratio)


def first_critical(shell, design, load, borne):
    """The load factor of the first point of the path by arc length that isn't stable."""
    assembly = assemble(shell.network(design))
    start = find_equilibrium(assembly, shell.target, np.zeros_like(load)).state
    for found in path.follow(assembly, start, forces(load), goal=1.1 * borne, first=0.01, most=2500):
        if found.event or not found.equilibrium.stable:
            return found.factor
    raise AssertionError("stable as far as was looked")
