"""Under a limit on memory a model is solved or refused: no library ends the program by itself."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from shellform.structure.solve import addresses, memory, pardiso
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
    """A limit that was left to the process kept the next one from being set, and pictures from their
    memory."""
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


MEMINFO = "MemTotal:       9000 kB\nMemFree:         100 kB\nMemAvailable:   3000 kB\n"


@pytest.mark.parametrize(
    ("files", "free"),
    [
        ({"meminfo": MEMINFO}, 3000 * 1024),
        ({"meminfo": MEMINFO, "memory.max": "max\n", "memory.current": "7"}, 3000 * 1024),
        ({"meminfo": MEMINFO, "memory.max": "2000000\n", "memory.current": "1500000\n"}, 500_000),
        ({"meminfo": MEMINFO, "memory.max": "9000000\n", "memory.current": "1500000\n"}, 3000 * 1024),
        ({"memory.max": "9000000\n", "memory.current": "1500000\n"}, 7_500_000),
        ({"meminfo": "MemTotal: 9 kB\n"}, None),
        ({}, None),
    ],
)
def test_free_is_what_the_system_can_give_or_what_is_left_of_a_container_s_share(
    monkeypatch, tmp_path, files, free
):
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="ascii")
    places = {"/proc/meminfo": tmp_path / "meminfo", "/sys/fs/cgroup": tmp_path}
    monkeypatch.setattr(memory, "Path", lambda name: places[name])
    assert memory.free_memory() == free


@pytest.mark.parametrize(
    ("free", "limit"), [(2_000_000_000, 70_000_000 + 1_900_000_000), (300_000_000, 70_000_000 + 400_000_000)]
)
def test_the_limit_is_95_per_cent_of_what_is_free_or_what_loading_takes_beyond_what_is_used(
    monkeypatch, free, limit
):
    asked = []
    monkeypatch.setattr(memory, "free_memory", lambda: free)
    monkeypatch.setattr(memory, "_data_size", lambda: 70_000_000)
    monkeypatch.setattr(memory.sys, "platform", "linux")
    monkeypatch.setattr(resource, "getrlimit", lambda _: (resource.RLIM_INFINITY, 12))
    monkeypatch.setattr(resource, "setrlimit", lambda _, both: asked.append(both))
    with limited_to_free_memory():
        assert asked == [(limit, 12)]
    assert asked[1:] == [(resource.RLIM_INFINITY, 12)]


@pytest.mark.parametrize(
    ("platform", "free", "before"), [("darwin", 5, None), ("linux", None, None), ("linux", 5, 10**9)]
)
def test_no_limit_is_set_where_none_can_be_nothing_is_known_or_somebody_has_set_one(
    monkeypatch, platform, free, before
):
    monkeypatch.setattr(memory, "free_memory", lambda: free)
    monkeypatch.setattr(memory.sys, "platform", platform)
    monkeypatch.setattr(
        resource, "getrlimit", lambda _: (resource.RLIM_INFINITY if before is None else before, 12)
    )
    asked = []
    monkeypatch.setattr(resource, "setrlimit", lambda _, both: asked.append(both))
    with limited_to_free_memory():
        pass
    assert asked == []


def test_blas_is_asked_for_room_of_40_megabytes_before_each_of_its_first_products(monkeypatch):
    asked = []
    monkeypatch.setattr(addresses, "has_room", lambda size: not asked.append(size))
    addresses.take_work_areas()
    assert asked == [40_000_000, 40_000_000]
