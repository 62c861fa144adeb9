"""What is asked for without the library that it needs names the optional dependencies to install; pictures go
without VTK.
"""

import os
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
# Run first: these libraries aren't there.
WITHOUT = """import sys
class Without:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in {missing}:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name.split(".")[0])
sys.meta_path.insert(0, Without())
import importlib.util
spec = importlib.util.find_spec
importlib.util.find_spec = lambda name, package=None: None if name in {missing} else spec(name, package)
"""
ASKED = {
    "study": ("pyarrow", "from shellform.study import store; store.arrow()"),
    "study ": ("distributed", "from shellform.study.engine import engine; engine(workers=1).__enter__()"),
    "film": ("imageio_ffmpeg", "from shellform.output.pictures import images; images.require(['.mp4'])"),
    "cad-exchange": (
        "vtkmodules",
        "from shellform.surface.readers import vtkfiles; vtkfiles.read_vtk('a.vtk', None, 'vtk')",
    ),
}


def run(code, *missing, folder=ROOT):
    text = WITHOUT.format(missing=set(missing)) + code
    return subprocess.run(
        [sys.executable, "-c", text],
        cwd=folder,
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )


@pytest.mark.parametrize("extra", ASKED)
def test_what_lacks_a_library_names_the_optional_dependencies_to_install(extra):
    library, code = ASKED[extra]
    told = run(code, library).stderr.strip().splitlines()[-1]
    assert f"library {library} can't be loaded" in told
    assert f'pip install "shellform[{extra.strip()}]"' in told
    assert extra.strip() in PROJECT["optional-dependencies"]


def test_png_pictures_are_drawn_as_lines_where_vtk_is_not_installed(tmp_path):
    done = run(
        "import numpy as np\n"
        "from shellform.output.pictures import render\n"
        "from shellform.output.pictures.panel import Panel\n"
        "panel = Panel('rod', np.eye(3), [[0, 1], [1, 2]], [0.0, 0.001, 0.002], [[0, 2]], [3.0], [0], [1], 0.01)\n"
        "picture = render.picture('a.png', panel)\n"
        "assert picture.shape == (1000, 1600, 3) and (picture < 128).any()\n",
        "pyvista",
        "vtkmodules",
        folder=tmp_path,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "a.png").read_bytes().startswith(b"\x89PNG")


def test_all_holds_every_optional_dependency_of_users_but_the_proprietary_one():
    extras = PROJECT["optional-dependencies"]
    (everything,) = extras["all"]
    named = set(everything.removeprefix("shellform[").removesuffix("]").split(","))
    assert named == set(extras) - {"all", "mkl", "docs", "test"}


def test_the_version_stands_in_one_place():
    assert "version" in PROJECT["dynamic"]
    assert "version" not in PROJECT
    assert "\nversion:" not in (ROOT / "CITATION.cff").read_text(encoding="utf-8")
