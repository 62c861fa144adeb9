"""The benchmark's trend: each row beside that of the run that was committed."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from scripts.benchmark_trend import committed, trend


def test_a_row_is_told_beside_the_committed_one_with_what_its_bar_did():
    before = {"ratio": (2.0, False), "bar": (1.5, True), "plain": (10.0, None)}
    assert trend("ratio", 1.5, True, before) == "-25 % from 2, did not hold before"
    assert trend("bar", 1.8, False, before) == "+20 % from 1.5, held before"
    assert trend("plain", 11.0, None, before) == "+10 % from 10"
    assert trend("another", 1.0, None, before) == "not measured before"


def test_the_committed_run_has_rows_of_each_size():
    kept = committed()
    assert len(kept) > 20
    assert {name.split(" freedoms")[0] for name in kept} >= {"7,488", "31,200", "127,296"}


@pytest.mark.parametrize("task", ["iterations(4)[0]", "sensitivities()", "million()"])
def test_each_measurement_goes_through_on_a_small_model(task):
    """No time is asserted, only that the numbers come."""
    code = (
        "import json, benchmark\n"
        "benchmark.CABLES, benchmark.MULTIHALLE = 4, (5, 2)\n"
        f"print(json.dumps([[row.what, row.value] for row in benchmark.{task}]))"
    )
    scripts = Path(__file__).parents[1] / "scripts"
    env = {**os.environ, "PYTHONPATH": os.pathsep.join([str(scripts), str(scripts.parent)])}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=env, timeout=300)
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout.splitlines()[-1])
    assert len(rows) >= 2
    assert all(value > 0.0 for _, value in rows)
