"""`shellform example`: each case that ships is laid beside its surface and is taken as it stands there."""

import json
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import shellform as sf
from shellform.case.case import check_script, load_case
from shellform.case.examples import EXAMPLES, lay_example
from shellform.errors import InputError
from shellform.structure.model import parse_model
from shellform.study.plan import read_study
from tests.test_optional import ROOT


@pytest.mark.parametrize("name", EXAMPLES)
def test_an_example_is_laid_with_all_it_needs_and_is_taken_there_unasked(name, tmp_path):
    files = lay_example(name, tmp_path)
    first = files[0]
    assert first.name in EXAMPLES[name].command
    if name in ("rhino", "rods"):
        area = {"rhino": 0.617, "rods": 2.75**2 * 0.617}[name]
        assert sf.read_surface(first, layer="Shell").area == pytest.approx(area, rel=1e-2)
        return
    if first.suffix == ".json":
        assert parse_model(json.loads(first.read_text(encoding="utf-8"))).loads
        return
    case = load_case(files[1] if name == "study" else first)
    if name == "study":
        assert read_study(first).study.vary
    surface = Path(case.surface.file)
    assert surface.resolve().parent == tmp_path.resolve()
    check_script(surface, allow_scripts=False)


def test_nothing_of_a_user_s_is_overwritten(tmp_path):
    lay_example("radius", tmp_path)
    lay_example("radius", tmp_path)
    (tmp_path / "vault.py").write_text("# mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"vault.py: is there already"):
        lay_example("radius", tmp_path)
    assert (tmp_path / "vault.py").read_text(encoding="utf-8") == "# mine"


def test_a_laid_script_that_was_changed_is_not_run_unasked(tmp_path):
    lay_example("radius", tmp_path)
    script = tmp_path / "vault.py"
    script.write_text(script.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    with pytest.raises(InputError, match="--allow-scripts"):
        check_script(script, allow_scripts=False)


def test_an_unknown_example_is_refused_with_those_that_there_are(tmp_path):
    with pytest.raises(InputError, match="Known: vault, paper, radius"):
        lay_example("tower", tmp_path)


def test_the_vault_s_mesh_is_its_script_s_and_is_read_without_gmsh(tmp_path):
    lay_example("vault", tmp_path)
    code = f"""import sys
sys.modules["gmsh"] = None
import shellform as sf
print(sf.read_surface(r"{tmp_path / "vault.ply"}").area)"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    built = sf.cad.build_surface(ROOT / "surfaces/vault.py", size=0.01, length=0.90, width=0.55, height=0.21)
    assert float(done.stdout) == pytest.approx(built.area, rel=1e-6)


def test_the_wheel_holds_every_case_and_surface(tmp_path):
    included = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
    included = included["targets"]["wheel"]["force-include"]
    cases = {Path(file).name for file, place in included.items() if place.startswith("shellform/_cases/")}
    assert cases == {file for example in EXAMPLES.values() for file in example.files}
    assert included["surfaces"] == "shellform/_surfaces"
    # as a wheel would lie: beside nothing of the repository
    package = tmp_path / "shellform"
    shutil.copytree(ROOT / "shellform", package, ignore=shutil.ignore_patterns("__pycache__"))
    for file, place in included.items():
        source = ROOT / file
        (shutil.copytree if source.is_dir() else _copy)(source, tmp_path / place)
    code = "from shellform.case.examples import *; [lay_example(each, each) for each in EXAMPLES]"
    subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=True)
    assert (tmp_path / "dome/dome_mm.step").is_file()


def _copy(source, target):
    target.parent.mkdir(parents=True, exist_ok=True)
    shutil.copy(source, target)
