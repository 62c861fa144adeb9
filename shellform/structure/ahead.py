"""Compiles the longest element loops in a process of its own, while another makes a surface and its net or
installs what else they need.

On a machine where nothing is compiled yet those of the beams' third derivatives take half of the time, and
are needed last.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from shellform.compiled import is_kept
from shellform.processes import command_of, end_with, surroundings
from shellform.structure.answers.third_derivatives import bilinear_by_dof
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.beam_thirds import contracted
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.elements.threads import cores
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium


@contextmanager
def compiling_ahead() -> Iterator[None]:
    """Within the block another process compiles, where it is to be done and there is a core for it. With the
    block it ends, done or not."""
    if is_kept(contracted) or cores() < 2:
        yield
        return
    with subprocess.Popen(
        [*command_of(__name__), str(os.getpid())],
        env=surroundings() | {"SHELLFORM_QUIET": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,  # what goes wrong there is told where the loop is needed
    ) as beside:
        try:
            yield
        finally:
            beside.kill()


def compile_loops() -> None:
    """Compiles what is in no cache yet: a rod of two elements with a cable tells how its stiffness changes,
    comes to rest, and tells its forces' derivatives and where a motion leads."""
    places = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0]])
    one = np.ones(2)
    rod = make_beams(places, np.array([[0, 1], [1, 2]]), axial=one, torsion=one, bending_y=one, bending_z=one)
    cable = make_cables(np.array([[0, 2]]), rest_length=one[:1], stiffness=one[:1])
    fixed = np.zeros((3, 6), dtype=bool)
    fixed[0] = True
    network = Network(places, rod, cable, fixed, np.zeros((3, 6)))
    assembly, load = assemble(network), np.zeros((3, 6))
    load[2, 2] = 0.01
    shape = np.ones((18, 1))
    bilinear_by_dof(assembly, at_rest(places), shape, shape)  # first, while the other process needs the rest
    rest = find_equilibrium(assembly, at_rest(places), load).state
    rod.local_forces_by_dof(rest)
    rod.foreseen(rest, load)


if __name__ == "__main__":
    end_with(int(sys.argv[1]))
    compile_loops()
