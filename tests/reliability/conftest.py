"""A small gridshell under load, whose drawn structures are loaded in a moment."""

import numpy as np
import pytest

from shellform.reliability.perfect import perfect
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium


@pytest.fixture(scope="session")
def nominal(dome):
    """Its initial design under a load that it bears."""
    return perfect(dome, dome.design(), dome.point_load(4.5, every=2))


@pytest.fixture(scope="session")
def loaded(dome):
    """A small shell's initial design under a fraction of the paper's load."""
    load, design = dome.point_load(3.0, every=2), dome.design()
    assembly = assemble(dome.network(design))
    unloaded = find_equilibrium(assembly, dome.target, np.zeros_like(load)).state
    return design, find_equilibrium(assembly, unloaded, load, on_branch=True).state, load
