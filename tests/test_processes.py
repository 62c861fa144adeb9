"""Processes that end with the one that began them."""

import os
import signal
import subprocess
import sys
import time

import pytest

from shellform import processes

CHILD = """
import sys, time
from shellform.processes import end_with
end_with(int(sys.argv[1]))
print("bound", flush=True)
time.sleep(60)
"""
PARENT = """
import os, subprocess, sys, time
job = subprocess.Popen([sys.executable, "-c", sys.argv[1], str(os.getpid())], stdout=subprocess.PIPE, text=True)
print(job.pid, job.stdout.readline(), flush=True)
time.sleep(60)
"""


def is_running(process):
    try:
        with open(f"/proc/{process}/stat", encoding="ascii") as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


@pytest.mark.skipif(sys.platform != "linux", reason="other systems leave such a process")
def test_a_process_ends_with_the_one_that_began_it_and_at_once_where_that_ended_before():
    begun = subprocess.Popen([sys.executable, "-c", PARENT, CHILD], stdout=subprocess.PIPE, text=True)
    child = begun.stdout.readline().split()
    assert child[1] == "bound"
    assert is_running(int(child[0]))
    begun.kill()
    begun.wait()
    until = time.monotonic() + 10.0
    while is_running(int(child[0])) and time.monotonic() < until:
        time.sleep(0.01)
    assert not is_running(int(child[0]))
    begun.stdout.close()


def test_a_process_whose_parent_is_another_by_now_ends_and_on_other_systems_nothing_is_asked(monkeypatch):
    asked = []

    class Library:
        def __init__(self, name):
            assert name is None

        def prctl(self, *values):
            asked.append(values)

    monkeypatch.setattr(processes.ctypes, "CDLL", Library)
    monkeypatch.setattr(processes.sys, "platform", "linux")
    processes.end_with(os.getppid())
    assert asked == [(1, signal.SIGKILL)]
    with pytest.raises(SystemExit, match="what began it has ended"):
        processes.end_with(os.getppid() + 1)
    monkeypatch.setattr(processes.sys, "platform", "win32")
    processes.end_with(os.getppid() + 1)
    assert len(asked) == 2
