"""Under a limit on memory a model is solved or refused: no library ends the program by itself."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from shellform.structure.solve import pardiso
from shellform.structure.solve.addresses import has_room

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


@pytest.mark.parametrize("megabytes", [600, 650, 800])
def test_a_model_is_analysed_with_600_megabytes_of_addresses(megabytes):
    """MKL ended the program where it found no room for its parts, and CHOLMOD's BLAS crashed."""
    most = megabytes * 1_000_000
    done = subprocess.run(
        [sys.executable, "-m", "shellform", "analyse", "scripts/bent_arch.json", "--load", "snow"],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (most, most)),
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["stable"]
