"""The gallery: each example draws its picture, each notebook runs from the first cell to the last."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent.parent
EXAMPLES = sorted((ROOT / "scripts/examples").glob("*.py"))
NOTEBOOKS = sorted((ROOT / "scripts/examples/notebooks").glob("*.ipynb"))
RUN = """
import json, sys
from IPython.core.interactiveshell import InteractiveShell
shell = InteractiveShell.instance()
for cell in json.load(open(sys.argv[1], encoding="utf-8"))["cells"]:
    if cell["cell_type"] == "code":
        shell.run_cell("".join(cell["source"])).raise_error()
"""


def ran(arguments, folder):
    environment = os.environ | {"PYTHONPATH": str(ROOT), "IPYTHONDIR": str(folder)}
    return subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )


def test_there_are_twelve_short_examples_and_four_small_notebooks():
    assert len(EXAMPLES) >= 12
    assert all(len(file.read_text(encoding="utf-8").splitlines()) <= 50 for file in EXAMPLES)
    assert len(NOTEBOOKS) == 4
    for file in NOTEBOOKS:
        cells = json.loads(file.read_text(encoding="utf-8"))["cells"]
        assert not any(cell.get("outputs") for cell in cells), "kept without output"


@pytest.mark.slow
@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_each_example_draws_its_picture(file, tmp_path):
    done = ran([str(file)], tmp_path)
    assert done.returncode == 0, done.stderr
    (picture,) = tmp_path.glob(f"{file.stem}.*")
    assert picture.stat().st_size > 10_000


@pytest.mark.slow
@pytest.mark.parametrize("file", NOTEBOOKS, ids=lambda file: file.stem)
def test_each_notebook_runs(file, tmp_path):
    pytest.importorskip("IPython")
    done = ran(["-c", RUN, str(file)], tmp_path)
    assert done.returncode == 0, done.stdout + done.stderr
