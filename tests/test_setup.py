"""The scripts' set-up installs what is locked, and says so where it can't; tests come in the order in which
no process waits for another."""

import os
import subprocess
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.conftest import pytest_collection_modifyitems

AHEAD = "shellform.structure.ahead"
SETUP = Path(__file__).parent.parent / "scripts/setup"
# In place of a virtual environment's Python: notes what it is asked for, and lets the locked install fail as
# told.
PYTHON = """#!/usr/bin/env bash
echo "$*" >> "$CALLS"
case "$*" in *--require-hashes*) if [ -n "$FAILS" ]; then echo "$FAILS"; exit 1; fi ;; esac
"""


@pytest.fixture
def set_up(tmp_path):
    (tmp_path / "venv/bin").mkdir(parents=True)
    stub = tmp_path / "venv/bin/python"
    stub.write_text(PYTHON, encoding="utf-8")
    stub.chmod(0o755)

    def run(extras, fails="", before="true"):
        calls = tmp_path / "calls"
        calls.write_text("", encoding="utf-8")
        done = subprocess.run(
            ["bash", "-eu", "-c", f"{before}; extras={extras}; source {SETUP}; echo ready"],
            env={**os.environ, "SHELLFORM_VENV": str(tmp_path / "venv"), "CALLS": str(calls), "FAILS": fails},
            capture_output=True,
            text=True,
            check=False,
        )
        told = calls.read_text(encoding="utf-8").splitlines()
        return done, [line for line in told if AHEAD not in line]  # which it doesn't wait for

    return run


def test_users_get_what_is_locked_without_tests_and_mkl_and_only_once(set_up):
    done, (_, locked, package) = set_up("all")
    assert done.stdout == "ready\n"
    assert "--require-hashes" in locked
    assert [word.rpartition("/")[2] for word in locked.split() if word.endswith(".txt")] == ["all.txt"]
    assert "--no-deps" in package
    assert "MKL" not in done.stderr
    assert set_up("all")[1] == []


def test_what_beams_need_is_installed_first_and_compiles_their_loops_meanwhile(set_up, tmp_path):
    kept = tmp_path / "kept"
    (tmp_path / "venv/bin/python").write_text(
        f'#!/usr/bin/env bash\necho "$PPID $*" >> {kept}\n'
        f'[ -e {kept}.names ] || grep -oE "^[a-z]+" "${{@: -1}}" > {kept}.names\nexit 0\n',
        encoding="utf-8",
    )
    done, _ = set_up("all")
    assert done.stdout == "ready\n"
    until = time.monotonic() + 20.0
    while AHEAD not in kept.read_text(encoding="utf-8") and time.monotonic() < until:
        time.sleep(0.05)
    first, *others = kept.read_text(encoding="utf-8").splitlines()
    assert "--require-hashes" in first
    assert "--no-deps" in first
    (ahead,) = [line for line in others if AHEAD in line]
    parent, *_, number = ahead.split()
    assert number == parent, "with which it ends"
    names = set((tmp_path / "kept.names").read_text(encoding="utf-8").split())
    assert names == {"cvxopt", "llvmlite", "numba", "numpy", "scipy"}


def test_a_shell_that_knows_no_number_of_its_own_sets_up_too(set_up):
    """That of macOS."""
    assert set_up("all", before="unset BASHPID")[0].stdout == "ready\n"


def test_the_tests_set_up_serves_users_too_and_announces_the_licence_of_mkl(set_up):
    done, calls = set_up("all,mkl,docs,test")
    assert "proprietary" in done.stderr
    assert len(calls) == 3
    assert set_up("all")[1] == []


def test_a_file_that_is_not_the_locked_one_ends_the_set_up(set_up):
    done, calls = set_up("all", "THESE PACKAGES DO NOT MATCH THE HASHES FROM THE REQUIREMENTS FILE.")
    assert done.returncode == 2
    assert "DO NOT MATCH" in done.stderr
    assert len(calls) == 2


def test_where_the_lock_does_not_fit_the_bounds_are_installed_and_that_is_said(set_up):
    done, calls = set_up("all", "ERROR: No matching distribution found for numpy==2.4.6")
    assert done.stdout == "ready\n"
    assert "No matching distribution" in done.stderr
    assert "what pyproject.toml's bounds allow" in done.stderr
    assert calls[-1].endswith("[all]")


def test_files_of_few_tests_come_before_those_of_many_and_each_stays_whole():
    items = [SimpleNamespace(path=path, number=k) for k, path in enumerate("aaaabbccd")]
    pytest_collection_modifyitems(items)
    assert "".join(each.path for each in items) == "dbbccaaaa"
    assert [each.number for each in items if each.path == "a"] == [0, 1, 2, 3]
