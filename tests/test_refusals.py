"""Every refusal says what to do: in a remedy, or because the message is itself what must hold."""

import ast
import json
from pathlib import Path

import numpy as np
import pytest

import shellform as sf
from shellform.case.build_net import surface_of
from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.networks import from_compas, from_networkx
from shellform.problem.terms import Measurement
from shellform.site.scans import read_points
from shellform.structure.answers.results import read_sections
from shellform.structure.elements.cable import make_cables
from shellform.structure.model import read_model
from shellform.study.expressions import evaluate

ROOT = Path(__file__).parent.parent
CASE = ROOT / "scripts/vault.toml"
KINDS = {"InputError", "Damaged", "NotConverged", "NoNet"}
SAYS = ("must", "needs")
# Their words come from elsewhere (another refusal, pydantic's, the search's), nobody outside meets them, or, as where
# no surface near a crumpled one is smooth, no remedy is known to work.
EXCUSED = {
    "case/case.py": 1,
    "cli/analyse.py": 1,
    "gridshell/catalogue.py": 1,
    "output/pictures/curves.py": 2,
    "output/pictures/panel.py": 2,
    "output/pictures/plots.py": 1,
    "reliability/probability.py": 1,
    "run/first_look.py": 1,
    "run/first_refusal.py": 1,
    "structure/model.py": 1,
    "surface/readers/foreign.py": 2,
    "surface/shape/fairing.py": 2,
    "tables.py": 1,
}


def without_remedy(path):
    """The refusals of a module that neither have a remedy nor say what must hold."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in KINDS):
            continue
        said = ast.unparse(node.args[0]) if node.args else ""
        if not any(each.arg == "remedy" for each in node.keywords) and not any(word in said for word in SAYS):
            yield said


def test_every_refusal_has_a_remedy_or_says_what_must_hold():
    package = ROOT / "shellform"
    found = {
        path.relative_to(package).as_posix(): len(said)
        for path in sorted(package.rglob("*.py"))
        if (said := list(without_remedy(path)))
    }
    assert found == EXCUSED


def model(tmp_path, text):
    file = tmp_path / "model.json"
    file.write_text(text, encoding="utf-8")
    return read_model(file)


def surface(tmp_path):
    return surface_of(load_case(CASE, ["surface.dimensions={length=1.0}"]).surface)


def deep(tmp_path):
    file = tmp_path / "case.toml"
    file.write_text(f"x = {'[' * 5000}{']' * 5000}", encoding="utf-8")
    return load_case(file)


def points(tmp_path):
    file = tmp_path / "points.csv"
    file.write_text("x,y,z\n", encoding="utf-8")
    return read_points(file)


def twice(tmp_path):
    load = np.zeros((1, 6))
    cases = sf.LoadCase("wet", load), [sf.LoadCase("wet", load)]
    return sf.Problem(None, cases[0], [sf.Share(1.0, sf.Misfit("wet"))], further=cases[1])


def cable(tmp_path):
    nodes = {"nodes": [[0, 0, 0], [1, 0, 0]], "beams": [], "supports": [], "loads": {}}
    looped = {"cables": [{"nodes": [1, 1], "EA": 1.0}]}
    return model(tmp_path, json.dumps({"format": "shellform-model", "version": 1, **nodes, **looped}))


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        (surface, r"surface\.dimensions: only builder scripts.*Leave out surface\.dimensions"),
        (deep, r"nested too deeply.*Take tables and lists out"),
        (lambda _: load_case(CASE, ["net.spacing.x=1"]), r"names an entry inside a value.*net\.spacing"),
        (lambda _: load_case(CASE, [f"surface.file={300 * 'a'}"]), "is no file's name.*relative to the case"),
        (lambda tmp_path: load_case(tmp_path / "no.toml"), "can't be read.*shellform example vault"),
        (lambda _: from_networkx(7), "is no graph.*networkx"),
        (lambda _: from_compas(7), "is no graph.*COMPAS"),
        (twice, "two load cases.*a name of its own"),
        (
            lambda _: Measurement(np.zeros(2)).completed(1, 3, 4, "mine"),
            r"mine\.value.*arrays of those shapes",
        ),
        (points, "has no points.*x, y, z of a point in each line"),
        (lambda tmp_path: read_sections(tmp_path / "no.toml"), "can't be read.*a table for each kind"),
        (lambda _: make_cables([[3, 3]], rest_length=1.0, stiffness=1.0), "to itself.*two different nodes"),
        (cable, r"cables\[0\].*to itself.*two different nodes"),
        (lambda tmp_path: model(tmp_path, "{"), r"isn't JSON.*json\.dump"),
        (lambda _: evaluate("1" + "+1" * 4000, "f", float), "is longer than.*Split it"),
        (lambda _: evaluate("1e308 * 10", "f", float), "isn't finite.*Mend the expression"),
        (lambda _: evaluate("1 / 0", "f", float), "can't be worked out.*Mend the expression"),
    ],
)
def test_what_a_user_can_meet_is_refused_with_what_to_do(asked, said, tmp_path):
    with pytest.raises(InputError, match=said):
        asked(tmp_path)
