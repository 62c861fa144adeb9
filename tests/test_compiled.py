import os
import subprocess
import sys

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
