"""Study files are data: what they say is checked, and nothing in them is run or leads out of their folder."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.study.expressions import evaluate
from shellform.study.plan import changes, length, read_study, resolved
from tests.stubs import study_file

ENTRIES = {"net.spacing": 0.055, "rod.radius": 1e-3}


def worth(text):
    return evaluate(text, "function.x", ENTRIES.__getitem__)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("net.spacing / 27.5", 0.002),
        ("2 ** 3 ** 2 - 1", 511.0),
        ("-max(1, min(4, 3), sqrt(4)) // 2", -2.0),
        ("1 if rod.radius > 2e-3 else 2", 2.0),
        ("round(cos(2 * pi) % 0.75 * 4)", 1.0),
    ],
)
def test_arithmetic_means_what_it_says(text, value):
    assert worth(text) == pytest.approx(value)


@pytest.mark.parametrize(
    "text",
    [
        "__import__('os').system('true')",
        "().__class__.__bases__",
        "[1 for _ in (1,)]",
        "net.spacing.__class__()",
        "lambda: 1",
        "'a' * 9",
        "max(*(1, 2))",
        "round(1, ndigits=2)",
        "print(1)",
        "(x := 1)",
        "1 if",
        "9 ** 9 ** 9 ** 9",
        "(" + "+".join(["(1 < 2)"] * 9) + ") ** 9 ** 9 ** 9",  # comparisons, which Python takes for integers
        "1 / 0",
        "sqrt(-1)",
        "(-8) ** 0.5",
        "exp(1e6)",
        "1e308 * 10",
        "max()",
        "min(1)",
        "1 +" * 400 + "1",
        "True",
        "1j",
        "\0",
        "",
    ],
)
def test_whatever_is_no_arithmetic_is_refused_and_never_run(text):
    with pytest.raises(InputError, match=r"function\.x"):
        worth(text)


def test_a_grid_has_each_combination_in_order_with_entries_that_follow(tmp_path):
    plan = read_study(
        study_file(
            tmp_path,
            """
            [set]
            optimise.cable_force = 0.0
            optimise.rod_radius = 0.0
            [vary]
            net.spacing = { low = 0.1, high = 0.12, count = 3 }
            cable.stiffness = [100, 187]
            [function]
            joint.gap = "net.spacing / 60"
            optimise.misfit = "1 - optimise.cable_force - optimise.rod_radius"
            net.elements = "2 * 2"
            """,
        )
    )
    designs = list(changes(plan))
    assert length(plan) == 6 == len(designs)
    assert [each["net.spacing"] for each in designs] == pytest.approx([0.1, 0.1, 0.11, 0.11, 0.12, 0.12])
    case, values = resolved(plan, designs[3])
    assert (case.cable.stiffness, case.net.elements, case.optimise.misfit) == (187.0, 4, 1.0)
    assert case.joint.gap == pytest.approx(0.11 / 60)
    assert list(values) == ["net.spacing", "cable.stiffness", "joint.gap", "optimise.misfit", "net.elements"]


@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_samples_fill_their_ranges_and_come_back_from_the_same_seed(tmp_path, method):
    text = f"""
        method = "{method}"
        count = 24
        seed = %d
        [vary]
        net.spacing = {{ low = 0.1, high = 0.2 }}
        cable.stiffness = {{ low = 10, high = 1000, scale = "log" }}
        net.elements = {{ low = 2, high = 5, whole = true }}
        surface.dimensions.height = [0.15, 0.2]
    """
    one, again, other = (list(changes(read_study(study_file(tmp_path, text % seed)))) for seed in (1, 1, 2))
    assert one == again != other
    assert len(one) == 24
    columns = {name: np.array([each[name] for each in one]) for name in one[0]}
    assert 0.1 <= columns["net.spacing"].min() < 0.125
    assert 0.175 < columns["net.spacing"].max() <= 0.2
    assert 60 < np.median(columns["cable.stiffness"]) < 160
    assert set(columns["net.elements"]) == {2, 3, 4, 5}
    assert set(columns["surface.dimensions.height"]) == {0.15, 0.2}


def test_designs_can_be_listed_and_surfaces_taken_from_a_folder(tmp_path):
    (tmp_path / "shells").mkdir()
    for name in ("b.obj", "a.obj", "c.txt"):
        (tmp_path / "shells" / name).write_text("v 0 0 0\n")
    plan = read_study(
        study_file(
            tmp_path,
            """
            designs = [{ net.spacing = 0.1 }, { "net.spacing" = 0.11, cable.stiffness = 50 }]
            [vary]
            surface.file = { files = "shells/*.obj" }
            """,
        )
    )
    found = [(each["net.spacing"], each["surface.file"][-5:]) for each in changes(plan)]
    assert found == [(0.1, "a.obj"), (0.1, "b.obj"), (0.11, "a.obj"), (0.11, "b.obj")]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("cas = 1", "Did you mean 'case'"),
        ("[vary]\nnet.spacin = [0.1]", "Did you mean 'net.spacing'"),
        ("[vary]\nnet.spacing = { low = 0.1 }", "both low and high"),
        ("[vary]\nnet.spacing = { low = 0.2, high = 0.1, count = 3 }", "low must be below high"),
        ("[vary]\nnet.spacing = { low = 0, high = 0.1, count = 3, scale = 'log' }", "above zero"),
        ("[vary]\nnet.spacing = { low = 0.1, high = 0.2 }", "needs the range's count"),
        ("[vary]\nnet.spacing = { low = 0.1, high = 0.2, values = [1] }", "give one of"),
        ("[vary]\nnet.spacing = []", "vary.net.spacing"),
        ("[vary]\nnet.spacing = [0.1]\n[set]\nnet.spacing = 0.1", "more than one of"),
        ("method = 'latin'\n[vary]\nnet.spacing = [0.1]", "needs a count"),
        ("method = 'latin'\ncount = 3", "needs entries under [vary]"),
        (
            "method = 'search'\ncount = 3\n[vary]\nnet.spacing = [0.1]\n[column]\na = 'b'",
            "needs an [objective]",
        ),
        (
            "method = 'search'\ncount = 3\ndesigns = [{}]\n[vary]\nnet.spacing = [0.1]",
            "makes its own designs",
        ),
        ("[objective]\ndepth = 'min'", "'depth' is no column"),
        ("[function]\njoint.gap = 'cable.force'", "no number of the case"),
        ("[function]\njoint.gap = 'net.spacing'\nnet.spacing = 'joint.gap'", "follows from itself"),
        ("[set]\nnet.spacing.deep = 1", "inside a value"),
        ("[vary]\nsurface.file = { files = '../*.obj' }", "leads out of"),
        ("[vary]\nsurface.file = { files = '/etc/*' }", "leads out of"),
        ("[vary]\nsurface.file = { files = '*.step' }", "no such file"),
        ("[vary]\nsurface.file = { files = '**x' }", "surface.file"),
        ("[vary]\nsurface.file = ['../other.obj']", "leads out of"),
        (
            "[vary]\ncable.stiffness = { low = 1, high = 2, count = 99999999999999999999 }",
            "less than or equal to 1000000",
        ),
        (
            "[vary]\ncable.stiffness = { low = 1, high = 2, count = 2000 }\n"
            "cable.force_max = { low = 1, high = 2, count = 2000 }",
            "designs; up to",
        ),
    ],
)
def test_bad_study_files_are_refused_by_entry(tmp_path, text, words):
    with pytest.raises(InputError) as caught:
        read_study(study_file(tmp_path, text))
    assert words in str(caught.value)
    assert "study.toml" in str(caught.value) or "dome.toml" in str(caught.value)


def test_a_study_may_not_name_a_case_outside_its_folder(tmp_path):
    file = study_file(tmp_path / "inner", "")
    (tmp_path / "dome.toml").write_text((tmp_path / "inner/dome.toml").read_text())
    file.write_text('case = "../dome.toml"')
    with pytest.raises(InputError, match="leads out of the study file's folder"):
        read_study(file)
