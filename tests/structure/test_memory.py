"""Under a limit on memory a model is solved or refused: no library ends the program by itself."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from shellform.structure.solve import addresses, pardiso
from shellform.structure.solve.addresses import has_room
from shellform.structure.solve.memory import limited_to_free_memory

resource = pytest.importorskip("resource")
ROOT = Path(__file__).parent.parent.parent


def test_room_is_asked_for_and_not_taken():
    assert has_room(1_000_000)
    assert not has_room(1 << 60)


def test_a_solver_whose_parts_find_no_room_is_left_out(monkeypatch):
    monkeypatch.setattr(pardiso, "has_room", lambda size: False)
    pardiso.library.cache_clear()
    try:
        assert pardiso.library() is None
    finally:
        pardiso.library.cache_clear()


def test_work_areas_are_taken_only_where_there_is_room_for_them(monkeypatch):
    monkeypatch.setattr(addresses, "has_room", lambda size: False)
    with pytest.raises(MemoryError, match="no room for BLAS"):
        addresses.take_work_areas()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux refuses memory under a limit")
def test_the_limit_to_what_is_free_ends_with_what_it_was_set_for():
    """A limit that was left to the process kept the next one from being set, and pictures from their memory."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with limited_to_free_memory():
        within = resource.getrlimit(resource.RLIMIT_DATA)[0]
        assert 0 < within != before[0]
    with pytest.raises(MemoryError), limited_to_free_memory():
        raise MemoryError
    assert resource.getrlimit(resource.RLIMIT_DATA) == before


@pytest.mark.parametrize("megabytes", [650, 700, 800])
def test_a_model_is_analysed_with_650_megabytes_of_addresses(megabytes):
    """MKL ended the program where it found no room for its parts, CHOLMOD's BLAS crashed, SciPy's tried for
    ever."""
    done = _under_limit(megabytes, "analyse", "scripts/bent_arch.json", "--load", "snow")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["stable"]


@pytest.mark.parametrize(("command", "megabytes"), [("analyse", 200), ("analyse", 600), ("check", 1200)])
def test_a_limit_that_leaves_no_room_for_the_libraries_is_refused(command, megabytes):
    done = _under_limit(megabytes, command, "scripts/bent_arch.json")
    assert done.returncode == 2
    assert "leaves no room for the libraries" in done.stderr
    assert "Traceback" not in done.stderr


def _under_limit(megabytes, *arguments):
    most = megabytes * 1_000_000
    return subprocess.run(
        [sys.executable, "-m", "shellform", *arguments],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most)),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
