"""The paper-scale vault, pulled and braced once for all tests."""

from pathlib import Path

import numpy as np
import pytest

import shellform as sf

ROOT = Path(__file__).parent.parent


@pytest.fixture(scope="session")
def vault():
    return sf.cad.build_surface(ROOT / "surfaces/vault.py", size=0.01)


@pytest.fixture(scope="session")
def net(vault):
    return sf.pull_net(vault, spacing=0.055, gap=0.002, angle=np.deg2rad(45.0))


@pytest.fixture(scope="session")
def shell(vault, net):
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=vault)
