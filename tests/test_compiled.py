import os
import subprocess
import sys
from types import SimpleNamespace

import pytest

from shellform import compiled

CODE = """
import numpy as np
from shellform.structure.elements.rotation import matrix, turned
turned(np.zeros((1, 3)), np.eye(4)[:1])
matrix(np.eye(4)[0], np.empty((3, 3)))
"""


def test_compiling_is_announced_once_but_not_to_who_wants_quiet_and_what_the_cache_holds_is_not_compiled(
    tmp_path,
):
    told = []
    for wish in ({}, {}, {"SHELLFORM_QUIET": "1", "NUMBA_CACHE_DIR": str(tmp_path / "other")}):
        variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path), **wish}
        told.append(
            subprocess.run(
                [sys.executable, "-c", CODE], capture_output=True, text=True, check=True, env=variables
            ).stderr
        )
    assert told[0].count("compiling its loops") == 1
    assert "minutes of a free core in all" in told[0]
    assert told[1:] == ["", ""]


def test_where_no_place_for_a_cache_can_be_written_loops_are_compiled_all_the_same(tmp_path):
    code = (
        "import numba.core.caching as caching\n"
        "own = [each for each in caching.CacheImpl._locator_classes if 'UserProvided' in each.__name__]\n"
        "assert own\n"
        "caching.CacheImpl._locator_classes = own\n" + CODE + "import os\n"
        "print(os.environ['NUMBA_CACHE_DIR'])\n"
    )
    variables = {name: value for name, value in os.environ.items() if name != "NUMBA_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**variables, "TMPDIR": str(tmp_path)},
    )
    assert done.stdout.startswith(str(tmp_path))
    assert list(tmp_path.iterdir()) == [], "it goes with the process"


SIDE_BY_SIDE = """
import sys
import numpy as np
from shellform import compiled

kept = compiled.njit(cache=True)(__import__("loop").twice)
kind = np.dtype(sys.argv[1])
print("ready", flush=True)
sys.stdin.readline()
print(kept(np.ones(1, kind)).dtype, flush=True)
"""


def test_of_processes_side_by_side_one_compiles_a_loop_none_loses_an_entry_and_none_takes_another_s_code(
    tmp_path,
):
    (tmp_path / "loop.py").write_text("def twice(x):\n    return x + x\n", encoding="utf-8")
    variables = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "NUMBA_DEBUG_CACHE": "1",
        "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}",
    }
    kinds = ["float32", "float64", "int64", "complex64"]
    jobs = [
        subprocess.Popen(
            [sys.executable, "-c", SIDE_BY_SIDE, kind], env=variables, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )
        for kind in 2 * kinds
    ]  # fmt: skip
    for job in jobs:
        assert job.stdout.readline() == "ready\n"
    for job in jobs:
        job.stdin.write("go\n")
        job.stdin.flush()
    told = [job.communicate() for job in jobs]
    assert [text.splitlines()[-1] for text, _ in told] == 2 * kinds
    saved = [text.count("data saved") for text, _ in told]
    assert [one + other for one, other in zip(saved[:4], saved[4:], strict=True)] == [1, 1, 1, 1]
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == len(kinds)
    announced = [text.count("compiling its loops") for _, text in told]
    assert announced.count(1) >= len(kinds), "who waits may be told too"
    for kind in kinds:
        text = subprocess.run(
            [sys.executable, "-c", SIDE_BY_SIDE, kind], env=variables, input="go\n",
            capture_output=True, text=True, check=True,
        ).stdout  # fmt: skip
        assert "data loaded" in text
        assert "data saved" not in text


BROKEN_OFF = """
import sys
from numba.core.errors import TypingError
from shellform import compiled

kept = compiled.njit(cache=True)(__import__("loop").twice)
try:
    kept(1.0)
except TypingError:
    print("broken off", flush=True)
sys.stdin.readline()
"""


def test_a_process_that_lives_on_after_its_compiling_broke_off_keeps_no_other_waiting(tmp_path):
    (tmp_path / "loop.py").write_text("def twice(x):\n    return x.nothing\n", encoding="utf-8")
    variables = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}",
        "SHELLFORM_QUIET": "1",
    }
    command = [sys.executable, "-c", BROKEN_OFF]
    first = subprocess.Popen(command, env=variables, text=True, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    try:
        assert first.stdout.readline() == "broken off\n"
        second = subprocess.run(
            command, env=variables, input="go\n", capture_output=True, text=True, timeout=60, check=True
        )
    finally:
        first.communicate("go\n")
    assert second.stdout == "broken off\n"


def test_a_process_that_was_stopped_while_it_compiles_keeps_others_waiting_only_so_long(
    tmp_path, monkeypatch
):
    monkeypatch.setattr(compiled, "_LONGEST_TURN", 0.2)
    first = compiled._turn(str(tmp_path / "lock"))
    waited = compiled._compilation.seconds
    second = compiled._turn(str(tmp_path / "lock"))
    waited = compiled._compilation.seconds - waited
    assert not compiled._locked(second)
    os.close(first)
    assert compiled._locked(second)
    os.close(second)
    assert waited >= 0.2


def test_code_that_an_older_version_of_a_function_left_is_never_taken_and_other_functions_keep_theirs(
    tmp_path,
):
    variables = {
        **os.environ,
        "NUMBA_CACHE_DIR": str(tmp_path / "cache"),
        "PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}",
        "SHELLFORM_QUIET": "1",
    }
    code = (
        "import loop\nimport numpy as np\nfrom shellform import compiled\n"
        "print(*(compiled.njit(cache=True)(each)(1.0) for each in (loop.times, loop.more)))\n"
    )
    told = []
    for factor in ("2.0", "30.0"):  # two lengths, for the stamp is time and size
        text = f"def times(x):\n    return {factor} * x\n\n\ndef more(x):\n    return {factor} + x\n"
        (tmp_path / "loop.py").write_text(text, encoding="utf-8")
        told.append(
            subprocess.run(
                [sys.executable, "-c", code], env=variables, capture_output=True, text=True, check=True
            ).stdout
        )
    assert told == ["2.0 3.0\n", "30.0 31.0\n"]
    assert len(list((tmp_path / "cache").rglob("*.nbc"))) == 2


def test_long_compiling_tells_how_far_it_has_come_and_estimates_leave_it_out(tmp_path):
    code = (
        "import time\n"
        "from shellform import compiled\n"
        "compiled._compilation._next = 0.0\n"
        "began, still = time.perf_counter(), compiled.clock_without_compiling()\n"
        + CODE
        + "passed = time.perf_counter() - began\n"
        "print(passed, passed - (compiled.clock_without_compiling() - still), compiled._compilation.seconds)\n"
    )
    variables = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, env=variables
    )
    assert "1 loop compiled in" in done.stderr
    passed, left_out, compiling = map(float, done.stdout.split())
    assert 0.0 < compiling < passed
    assert left_out == pytest.approx(compiling, abs=1e-2)


@pytest.mark.parametrize("quiet", [False, True])
def test_compiling_is_told_at_its_start_and_after_10_20_and_40_s(monkeypatch, capsys, quiet):
    now = 0.0
    monkeypatch.setattr(compiled, "time", SimpleNamespace(perf_counter=lambda: now))
    compiling = compiled._Compilation(quiet=quiet)
    for loop in range(35):  # each with another within it, which isn't counted
        compiling.on_start(None)
        if loop == 0:
            begun = capsys.readouterr().err
        compiling.on_start(None)
        now += 1.0
        compiling.on_end(None)
        now += 1.0
        compiling.on_end(None)
        now += 5.0  # of other work
    assert compiling.seconds == 70.0
    told = capsys.readouterr().err.splitlines()
    if quiet:
        assert (begun, told) == ("", [])
        return
    assert begun.startswith("shellform: compiling its loops for this machine, once")
    assert told == [f"shellform: {loops} loops compiled in {2 * loops} s ..." for loops in (5, 10, 20)]
