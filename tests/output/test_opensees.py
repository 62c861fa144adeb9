"""The script for OpenSeesPy: what it holds, and that OpenSees finds our displacements with it."""

import ast
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import shellform as sf
from shellform.errors import InputError
from shellform.output.exchange.opensees import opensees_script
from shellform.structure.elements.state import at_rest


def lists(text):
    """The lists in the script by name."""
    tree = ast.parse(text)
    assigned = [
        node for node in tree.body if isinstance(node, ast.Assign) and isinstance(node.value, ast.List)
    ]
    return {node.targets[0].id: ast.literal_eval(node.value) for node in assigned}


def test_the_script_holds_the_network_the_start_and_the_load(shell):
    design = shell.design()
    load = shell.point_load(6.9, every=2)
    network = shell.network(design)
    text = opensees_script(
        network, [shell.target, shell.target], load, title='A "vault" \\', name="vault.py", case="design"
    )
    told = lists(text)
    assert np.array(told["NODES"]) == pytest.approx(network.nodes)
    assert len(told["BEAMS"]) == len(network.beams.ends)
    a, b, section, *axis = told["BEAMS"][-1]
    assert [a, b] == network.beams.ends[-1].tolist()
    assert told["SECTIONS"][section] == pytest.approx(list(shell.joint.stiffness))
    assert np.dot(axis, network.nodes[b] - network.nodes[a]) == pytest.approx(0.0, abs=1e-12)
    assert [row[3] for row in told["CABLES"]] == pytest.approx(design.rest_length.tolist())
    assert sorted(row[0] for row in told["SUPPORTS"]) == sorted(shell.net.supports.tolist())
    assert np.array(told["START"])[:, :3] == pytest.approx(shell.target.positions - network.nodes)
    assert sum(row[3] for row in told["LOAD"]) == pytest.approx(load[:, 2].sum())


def test_the_script_begins_without_load_and_compares_with_what_the_load_moves(built):
    shell, design = built.shell, built.design
    network = shell.network(design)
    # The loaded state's rotations must be of no account.
    before, after = built.states["none"], at_rest(built.states["additional"].positions)
    load = shell.point_load(6.9, every=2)
    told = lists(opensees_script(network, [before, after], load, title="", name="", case="additional"))
    np.testing.assert_allclose(np.array(told["START"])[:, :3], before.positions - network.nodes)
    turned = Rotation.from_quat(before.quaternions[:, [1, 2, 3, 0]]).as_rotvec()
    assert np.abs(turned).max() > 0.5
    np.testing.assert_allclose(np.array(told["START"])[:, 3:], turned, atol=1e-12)
    np.testing.assert_allclose(np.array(told["MOVED"]), after.positions - before.positions)
    cable = network.cables.ends[-1].tolist()
    assert list(told["CABLES"][-1][:3]) == [*cable, 187.0]
    node = int(np.flatnonzero(load.any(axis=1))[0])
    assert told["LOAD"][0] == (node, *load[node].tolist())


def test_rods_are_told_to_stand_upright_on_the_flat_grid(shell):
    network, flat = shell.network(shell.design()), [shell.target] * 2
    told = lists(
        opensees_script(network, flat, np.zeros((len(network.nodes), 6)), title="", name="", case="")
    )
    rods = [
        row for row in told["BEAMS"] if told["SECTIONS"][row[2]][0] == pytest.approx(shell.rod.stiffness[0])
    ]
    assert len(rods) == len(shell.net.grid.rod_ends)
    # Curvature out of the surface is about the local y axis, which vecxz, the local z axis, leaves in the
    # plane.
    np.testing.assert_allclose(np.abs([row[3:] for row in rods]), [[0.0, 0.0, 1.0]] * len(rods), atol=1e-12)


def test_a_bow_bent_from_a_shorter_rod_is_refused(shell):
    network = shell.network(shell.design())
    beams = replace(network.beams, rest_length=0.9 * network.beams.rest_length)
    with pytest.raises(InputError, match=re.escape("beams[0].rest_length")):
        opensees_script(
            replace(network, beams=beams),
            [shell.target] * 2,
            np.zeros((len(network.nodes), 6)),
            title="",
            name="",
            case="",
        )


def opensees_python():
    """A Python that has OpenSees: this one, that of SHELLFORM_PEERS_PYTHON, or that of the benchmark's
    cache.
    """
    cache = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
    for python in [
        os.environ.get("SHELLFORM_PEERS_PYTHON"),
        cache / "shellform-peers/bin/python",
        sys.executable,
    ]:
        if python and Path(python).is_file():
            done = subprocess.run(
                [python, "-c", "import openseespy.opensees"], capture_output=True, check=False
            )
            if done.returncode == 0:
                return str(python)
    return None


@pytest.mark.slow
def test_opensees_finds_our_displacements_with_it(tmp_path, shell):
    python = opensees_python()
    if python is None:
        pytest.skip("OpenSeesPy isn't installed (SHELLFORM_PEERS_PYTHON names a Python that has it)")
    design, load = shell.design(), shell.point_load(6.9, every=2)
    loads = {
        "none": np.zeros_like(load),
        "design": 0.4 * load,
    }  # well below where this one snaps, loaded to its edges
    found = sf.follow(shell, design, loads)
    states = [found[name].equilibrium.state for name in loads]
    text = opensees_script(
        shell.network(design), states, loads["design"], title="vault", name="vault.py", case="design"
    )
    (tmp_path / "vault.py").write_text(text, encoding="utf-8")
    done = subprocess.run(
        [python, "vault.py", "moved.csv"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    moved = np.loadtxt(tmp_path / "moved.csv", delimiter=",", skiprows=1)
    ours = states[1].positions - states[0].positions
    largest = np.linalg.norm(ours, axis=1).max()
    assert largest > 5e-4
    assert np.linalg.norm(moved - ours, axis=1).max() < 1e-4 * largest  # the bar is 1 %
