import subprocess
import sys

import numpy as np
import pytest

from scripts.gridshell_models import gridshell
from shellform.structure import ahead
from shellform.structure.answers.third_derivatives import bilinear_by_dof
from shellform.structure.elements.beam_foreseen import foreseen
from shellform.structure.elements.beam_kernels import evaluate, local_by_dof
from shellform.structure.elements.beam_thirds import contracted
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium


def test_a_gridshell_needs_no_other_loops_over_beams_than_those_that_are_compiled_ahead():
    ahead.compile_loops()
    loops = evaluate, contracted, local_by_dof, foreseen
    known = [list(each.signatures) for each in loops]
    assert all(known)
    model = gridshell(3)
    assembly = assemble(model.network)
    rest = find_equilibrium(assembly, at_rest(model.network.nodes), model.loads["design"]).state
    shape = np.ones((6 * assembly.count, 1))
    bilinear_by_dof(assembly, rest, shape, shape)
    (beams,) = assembly.beams
    beams.local_forces_by_dof(rest)
    beams.foreseen(rest, np.zeros((assembly.count, 6)))
    assert [list(each.signatures) for each in loops] == known


@pytest.fixture
def begun(monkeypatch):
    """The processes that are begun: they would take a minute."""
    found = []

    class Noted(subprocess.Popen):
        def __init__(self, command, **options):
            super().__init__([sys.executable, "-c", "import time; time.sleep(60)"], **options)
            found.append((command, self))

    monkeypatch.setattr(subprocess, "Popen", Noted)
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    return found


def test_loops_that_no_cache_holds_are_compiled_by_a_process_that_ends_with_the_block(begun, monkeypatch):
    monkeypatch.setattr(ahead, "is_kept", lambda function: False)
    with ahead.compiling_ahead():
        ((command, process),) = begun
        assert command[-2] == "shellform.structure.ahead"
        assert process.poll() is None
    assert process.poll() not in (None, 0), "it would have gone on for a minute"


def test_nothing_is_compiled_ahead_where_it_is_kept_or_where_one_core_would_do_both(begun, monkeypatch):
    with ahead.compiling_ahead():
        assert ahead.is_kept(contracted)
    monkeypatch.setattr(ahead, "is_kept", lambda function: False)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    with ahead.compiling_ahead():
        pass
    assert begun == []
