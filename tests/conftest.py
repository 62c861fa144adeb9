"""The paper-scale vault, pulled and braced once for all tests."""

import gc
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import shellform as sf
from shellform.output.workshop.schedules import Built
from shellform.structure.elements.state import State
from tests.run.small_run import begin

ROOT = Path(__file__).parent.parent


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collected without searches for garbage, of which there is none; nor do later ones go through what was
    collected, which stays until the end."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """Files of few tests first, whole runs among them: what is handed out last is over in a moment, and no
    process waits for the other's (scripts/test)."""
    count = Counter(item.path for item in items)
    items.sort(key=lambda item: count[item.path])


@pytest.fixture(scope="session")
def vault():
    return sf.cad.build_surface(ROOT / "surfaces/vault.py", size=0.01)


@pytest.fixture(scope="session")
def net(vault):
    return sf.pull_net(vault, spacing=0.055, gap=0.002, angle=np.deg2rad(45.0))


def braced(net, surface):
    """A net with the paper's rods, connectors and cables."""
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)


@pytest.fixture(scope="session")
def shell(vault, net):
    return braced(net, vault)


@pytest.fixture(scope="session")
def dome():
    """The vault with wide cells and two elements a segment: solved in a twentieth of the time."""
    surface = sf.cad.build_surface(ROOT / "surfaces/vault.py", size=0.02)
    net = sf.pull_net(surface, spacing=0.11, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    return braced(net, surface)


def built_as(shell):
    """A gridshell with every second cable, in states that stand for solved ones: nodes sink with their
    height.
    """
    present = np.arange(len(shell.cable_ends)) % 2 == 0
    design = replace(shell.design(rest_ratio=0.98), present=present)
    place = shell.target.positions

    def sunk(share):
        return State(place * [1.0, 1.0, 1.0 - share], shell.target.quaternions)

    return Built(
        shell,
        design,
        {"none": sunk(-0.01), "design": sunk(0.0), "additional": sunk(0.02)},
        sunk(-0.02),
        "test",
        "The vault",
    )


@pytest.fixture(scope="session")
def built(shell):
    return built_as(shell)


@pytest.fixture(scope="session")
def begun(tmp_path_factory):
    """A run left after its initial design, made once for all tests of run folders."""
    folder = tmp_path_factory.mktemp("begun") / "run"
    return begin(ROOT, folder)
