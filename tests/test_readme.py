"""The README's example runs as printed, its links lead somewhere, and the map of the package is true."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.test_layers import FLOORS, modules

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")
EXAMPLE = re.search(r"## In Python\n\n```python\n(.*?)```", README, re.DOTALL)[1]
GUIDE = (ROOT / "shellform/documentation/how-to/contribute.md").read_text(encoding="utf-8")
ARCHITECTURE = GUIDE[GUIDE.index("## Architecture\n") :]


def test_the_readme_is_a_screen_and_a_half():
    assert len(README.splitlines()) <= 80
    assert len(EXAMPLE.splitlines()) <= 16


def test_the_readme_s_links_lead_somewhere():
    links = re.findall(r"\]\(([^)]*)\)", README)
    assert len(links) > 5
    assert [link for link in links if not (ROOT / link).is_file()] == []


def test_the_example_runs_character_for_character_as_printed(tmp_path):
    (tmp_path / "example.py").write_text(EXAMPLE, encoding="utf-8")
    (tmp_path / "surfaces").symlink_to(ROOT / "surfaces")
    done = subprocess.run(
        [sys.executable, "example.py"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    objective, left, all_cables = re.fullmatch(r"(\S+) with (\d+) of (\d+) cables\n", done.stdout).groups()
    assert 0.0 < float(objective) < 1.0
    assert 0 < int(left) < int(all_cables)
    assert (tmp_path / "wet.png").read_bytes().startswith(b"\x89PNG")


def test_the_map_names_every_room_and_no_other_in_the_order_of_the_floors():
    rows = [row for row in ARCHITECTURE.splitlines() if row.startswith("| `")]
    mapped = [re.findall(r"`(\w+)`", row.split("|")[1]) for row in rows]
    floor = {room: level for level, rooms in enumerate(FLOORS["shellform"]) for room in rooms}
    named = [room for row in mapped for room in row]
    assert sorted(named) == sorted(floor)
    assert [floor[room] for room in named] == sorted(floor[room] for room in named)


@pytest.mark.parametrize("task", ["A surface format", "A term", "A constraint", "A picture", "An exporter"])
def test_it_says_how_to_add_one_and_names_files_that_are_there(task):
    told = re.search(rf"\*\*{task}\.\*\*(.*?)\n\n", ARCHITECTURE, re.DOTALL)[1]
    files = re.findall(r"`([\w./]+\.py)`", told)
    known = {path.relative_to(ROOT).as_posix() for path in ROOT.glob("tests/**/*.py")}
    known |= {path.relative_to(ROOT).as_posix() for path in modules().values()}
    for name in files:
        assert [each for each in known if each.endswith(f"/{name}") or each == name], name
    for name in re.findall(r"`(\w+(?:/\w+)*)/`", told):
        assert (ROOT / "shellform" / name).is_dir(), name
