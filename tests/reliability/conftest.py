"""Small gridshells whose drawn structures are loaded in a moment."""

import numpy as np
import pytest

import shellform as sf
from shellform.reliability.perfect import perfect


@pytest.fixture(scope="session")
def dome(tmp_path_factory):
    """The vault with wide cells and two elements a segment."""
    from pathlib import Path

    root = Path(__file__).parent.parent.parent
    surface = sf.cad.build_surface(root / "surfaces/vault.py", size=0.02)
    net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)


@pytest.fixture(scope="session")
def nominal(dome):
    """Its initial design under a load that it bears."""
    return perfect(dome, dome.design(), dome.point_load(4.5, every=2))
