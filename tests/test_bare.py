"""The first day on a bare Debian, as start.md has it: scripts/bare builds its container, or says why it
can't."""

import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
NOTHING_THERE = 77


def test_the_newcomer_types_what_the_start_page_says():
    page = (ROOT / "shellform/documentation/start.md").read_text(encoding="utf-8")
    typed = re.search(r"## A first design.*?```sh\n(.*?)```", page, re.DOTALL)[1].splitlines()
    script = (ROOT / "scripts/first_day").read_text(encoding="utf-8")
    assert len(typed) == 4
    assert [line for line in typed if line not in script] == []


def test_the_container_has_nothing_but_python_and_a_user_without_root():
    lines = (ROOT / "scripts/Containerfile").read_text(encoding="utf-8").splitlines()
    (installed,) = [line for line in lines if "apt-get install" in line]
    packages = installed.split("install ")[1].split(" && ")[0].split()
    assert {each for each in packages if not each.startswith("-")} == {
        "ca-certificates",
        "python3",
        "python3-venv",
    }
    assert lines.index("USER newcomer") < next(k for k, line in enumerate(lines) if line.startswith("CMD"))


@pytest.mark.slow
def test_the_first_day_on_a_bare_debian_ends_with_a_design_that_holds():
    done = subprocess.run([str(ROOT / "scripts/bare")], capture_output=True, text=True, check=False)
    if done.returncode == NOTHING_THERE:
        pytest.skip(done.stderr.strip())
    assert done.returncode == 0, done.stdout[-4000:] + done.stderr[-4000:]
    assert "holds: all checks do" in done.stdout
    assert re.search(r"page and pictures after \d+ s", done.stdout)
