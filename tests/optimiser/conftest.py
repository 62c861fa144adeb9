"""What several of the searches' tests begin with."""

import numpy as np
import pytest

import shellform as sf


@pytest.fixture(scope="session")
def stout(vault):
    """The vault with wide cells, two elements a segment and rods thicker than the paper's."""
    net = sf.pull_net(vault, spacing=0.11, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    rod = sf.Rod.round(young=40e9, radius=0.0012, strength=255e6)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=vault)


@pytest.fixture(scope="session")
def coarse(vault, shell):
    """The vault with 28 candidate cables."""
    net = sf.pull_net(vault, spacing=0.14, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    return sf.brace(net, shell.rod, shell.joint, shell.cable, below=vault)
