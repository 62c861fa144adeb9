"""Study files are data: what they say is checked, and nothing in them is run or leads out of their folder."""

import tomllib

import numpy as np
import pytest
from pydantic import ValidationError
from scipy.stats import qmc

from shellform.errors import InputError
from shellform.study import plan as plans
from shellform.study.expressions import evaluate
from shellform.study.outcome import OWN_COLUMNS
from shellform.study.plan import Study, changes, length, placed, read_study, resolved
from shellform.study.varied import LimitEntry, VaryEntry, drawn, ranged
from tests.command import ROOT
from tests.stubs import CASE, study_file

ENTRIES = {"net.spacing": 0.055, "rod.radius": 1e-3}


def test_a_case_given_for_a_study_is_said_to_be_one():
    with pytest.raises(InputError, match=r'is a case, no study.*shellform design.*case = "vault\.toml"'):
        read_study(ROOT / "scripts/vault.toml")


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
        ("[vary]\nnet.offset = [[0.5, 0.5], [0.0, 0.0]]", "list designs under [[designs]]"),
        ("[vary]\nnet.spacing = [0.1, inf]", "a number is finite"),
        ("[vary]\nnet.spacing = { low = 0, high = 0.1, count = 3, scale = 'log' }", "above zero"),
        ("[vary]\nnet.spacing = { low = 0.1, high = 0.2 }", "needs the range's count"),
        ("[vary]\nnet.spacing = { low = 0.1, high = 0.2, values = [1] }", "give one of"),
        ("[vary]\nnet.spacing = []", "vary.net.spacing"),
        ("[vary]\nnet.spacing = [0.1]\n[set]\nnet.spacing = 0.1", "more than one of"),
        ("designs = [{ net.spacing = 0.1 }]\n[vary]\nnet.spacing = [0.1]", "more than one of [[designs]]"),
        ("designs = [{ joint.gap = 0.1 }]\n[function]\njoint.gap = 0.002", "more than one of [[designs]]"),
        *(
            (f"[column]\n'{name}' = 'designs.best.cables'", f"has a column '{name}' of its own")
            for name in (*OWN_COLUMNS, "case.net.spacing")
        ),
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


@pytest.mark.parametrize(
    ("entry", "values"),
    [
        ({"low": 2.0, "high": 8.0}, [2.0, 3.5, 5.0, 8.0]),
        ({"low": 2.0, "high": 32.0, "scale": "log"}, [2.0, 4.0, 8.0, 32.0]),
        ({"low": -3.4, "high": 5.6, "whole": True}, [-3, -1, 1, 5]),
        ({"low": 10.0, "high": 2560.0, "scale": "log", "whole": True}, [10, 40, 160, 2560]),
    ],
)
def test_a_range_is_walked_from_low_to_high_in_equal_steps_or_equal_ratios(entry, values):
    found = [ranged(VaryEntry(**entry), at) for at in (0.0, 0.25, 0.5, 1.0)]
    assert found == pytest.approx(values)
    assert {type(each) for each in found} == {int if entry.get("whole") else float}


def test_whole_numbers_of_a_range_lie_within_it_and_each_is_drawn_as_often():
    for scale, low, high, values in (("linear", 1.4, 4.6, [2, 3, 4]), ("linear", 1, 4, [1, 2, 3, 4])):
        entry = VaryEntry(low=low, high=high, scale=scale, whole=True)
        found = [drawn(entry, (k + 0.5) / 120) for k in range(120)]
        assert {each: found.count(each) for each in sorted(set(found))} == dict.fromkeys(
            values, 120 // len(values)
        )
    log = VaryEntry(low=0.5, high=8.2, scale="log", whole=True)
    found = [drawn(log, k / 200) for k in range(200)]
    assert set(found) == set(range(1, 9))
    assert found.count(1) > found.count(2) > found.count(8)
    with pytest.raises(ValidationError, match="no whole number lies between"):
        VaryEntry(low=1.2, high=1.8, whole=True)


def test_a_limit_is_a_largest_value_or_says_what_is_the_least_and_the_most(tmp_path):
    given = 'case = "dome.toml"\n[column]\na = "x"\nb = "y"\n[limit]\na = 3\nb = { least = 0.97 }\n'
    study = Study.model_validate(tomllib.loads(given))
    assert study.limit == {"a": LimitEntry(most=3.0), "b": LimitEntry(least=0.97)}
    for wrong, said in (("{}", "give a number"), ("{ least = 3, most = 2 }", "least must not be above most")):
        with pytest.raises(ValidationError, match=said):
            Study.model_validate(tomllib.loads(given.replace("a = 3", f"a = {wrong}")))


def test_rounding_leads_no_value_out_of_its_range():
    for low, high in ((0.1, 0.7), (1e-3, 0.3)):
        entry = VaryEntry(low=low, high=high, scale="log")
        assert (ranged(entry, 0.0), ranged(entry, 1.0)) == (low, high)
        assert all(low <= ranged(entry, at) <= high for at in (-1e-16, 1e-17, 1.0 - 1e-16, 1.0 + 1e-16))


@pytest.mark.parametrize("method", ["random", "latin", "sobol"])
def test_samples_are_scipy_s_of_the_study_s_seed(tmp_path, method):
    """Of 5 designs in two entries: the first 5 of Sobol's 8."""
    plan = read_study(
        study_file(
            tmp_path,
            f"""
            method = "{method}"
            count = 5
            seed = 7
            [vary]
            net.spacing = {{ low = 0.1, high = 0.2 }}
            cable.stiffness = [100, 150, 187]
            """,
        )
    )
    points = {
        "random": lambda: np.random.default_rng(7).random((5, 2)),
        "latin": lambda: qmc.LatinHypercube(2, rng=7).random(5),
        "sobol": lambda: qmc.Sobol(2, rng=7).random_base2(3)[:5],
    }[method]()
    found = list(changes(plan))
    assert [each["net.spacing"] for each in found] == pytest.approx(0.1 + 0.1 * points[:, 0])
    assert [each["cable.stiffness"] for each in found] == [
        [100, 150, 187][int(3 * at)] for at in points[:, 1]
    ]


def test_each_value_of_a_list_has_the_same_share_of_the_unit_interval(tmp_path):
    text = "method = 'latin'\ncount = 4\n[vary]\ncable.stiffness = [100, 150, 187]"
    plan = read_study(study_file(tmp_path, text))
    at = (0.0, 0.33, 0.34, 0.66, 0.67, 0.999, 1.0)
    found = [placed(plan, "cable.stiffness", each) for each in at]
    assert found == [100, 100, 150, 150, 187, 187, 187]


@pytest.mark.parametrize("own", [0, 1, 3])
@pytest.mark.parametrize("method", ["grid", "latin"])
def test_listed_designs_are_each_combined_with_all_that_varies(tmp_path, method, own):
    listed = ", ".join(f"{{ rod.radius = {1e-3 + 1e-4 * k} }}" for k in range(own))
    text = f"""
        method = "{method}"
        {"count = 5" if method == "latin" else ""}
        designs = [{listed}]
        [vary]
        net.spacing = [0.1, 0.11]
    """
    plan = read_study(study_file(tmp_path, text))
    designs = list(changes(plan))
    assert length(plan) == len(designs) == max(1, own) * (2 if method == "grid" else 5)
    assert len({each.get("rod.radius") for each in designs}) == max(1, own)


def test_entries_follow_from_the_case_s_own_and_whole_ones_stay_whole(tmp_path):
    text = """
        [vary]
        net.spacing = [0.1]
        [function]
        joint.gap = "net.elements / 1000"
        net.elements = "rod.radius * 5000"
        cable.force_max = 30
        cable.stiffness = "cable.force_max * 5"
    """
    case, values = resolved(read_study(study_file(tmp_path, text)), {"net.spacing": 0.1})
    assert (case.net.elements, case.cable.force_max, case.cable.stiffness) == (5, 30.0, 150.0)
    assert case.joint.gap == pytest.approx(0.005), "from what follows from others, not from the case's"
    assert [(name, type(each)) for name, each in values.items()] == [
        ("net.spacing", float),
        ("joint.gap", float),
        ("net.elements", int),
        ("cable.force_max", float),
        ("cable.stiffness", float),
    ]


JOINT = CASE[CASE.index("[joint]") : CASE.index("[cable]")]


def test_what_follows_from_a_joint_that_follows_the_rods_follows_each_design_s_own(tmp_path):
    """A joint's gap is twice the rods' radius; its stiffnesses grow with the fourth power of it."""
    own = "[vary]\nrod.radius = [0.001, 0.002]\n[function]\ncable.stiffness = '1e6 * joint.gap + 1e4 * joint.torsion'"
    made = '[vary]\nnet.spacing = [0.1, 0.2]\n[function]\nrod.radius = "net.spacing / 100"\ncable.stiffness = "1e6 * joint.gap"'
    for text in (own, made):
        file = study_file(tmp_path, text)
        file.with_name("dome.toml").write_text(CASE.replace(JOINT, ""), encoding="utf-8")
        plan = read_study(file)
        cases = [resolved(plan, each)[0] for each in changes(plan)]
        assert [case.joint.gap for case in cases] == pytest.approx([0.002, 0.004])
        for case in cases:
            joint = case.joint
            said = 1e6 * joint.gap + (1e4 * joint.torsion if text is own else 0.0)
            assert case.cable.stiffness == pytest.approx(said, rel=1e-12)
    given = JOINT.replace("gap = 0.002\n", "")
    file.with_name("dome.toml").write_text(CASE.replace(JOINT, given), encoding="utf-8")
    file.write_text('case = "dome.toml"\n' + own, encoding="utf-8")
    plan = read_study(file)
    found = [resolved(plan, each)[0].cable.stiffness for each in changes(plan)]
    assert found == pytest.approx([2000.0 + 7.38, 4000.0 + 7.38]), "the torsion is the case's own"


def test_rods_that_are_refused_are_told_where_something_follows_from_their_joint(tmp_path):
    file = study_file(tmp_path, "[set]\nrod.radius = -1\n[function]\ncable.stiffness = 'joint.gap'")
    file.with_name("dome.toml").write_text(CASE.replace(JOINT, ""), encoding="utf-8")
    with pytest.raises(InputError, match=r"rod\.radius"):
        read_study(file)


def test_what_follows_for_a_count_and_is_not_whole_is_refused_and_not_rounded(tmp_path):
    with pytest.raises(InputError, match=r"net\.elements"):
        read_study(study_file(tmp_path, "[vary]\nnet.spacing = [0.1]\n[function]\nnet.elements = 2.5"))


@pytest.mark.parametrize("name", ["net", "net.spacing.deep", "surface.file", "surface.nothing"])
def test_nothing_follows_from_what_is_no_number_of_the_case(tmp_path, name):
    with pytest.raises(InputError, match="is no number of the case") as told:
        read_study(study_file(tmp_path, f"[function]\njoint.gap = '{name}'"))
    assert told.value.value == name


def test_a_study_without_objective_is_fine_but_for_a_search(tmp_path):
    text = "[vary]\nnet.spacing = [0.1, 0.11]\n[column]\na = 'net.spacing'"
    plan = read_study(study_file(tmp_path, text))
    assert (plan.study.objective, length(plan)) == ({}, 2)
    assert Study(case="dome.toml").objective == {"misfit": "min", "cables": "min"}


def test_a_grid_s_range_of_one_value_is_its_low_and_equal_whole_numbers_are_one(tmp_path):
    text = """
        [vary]
        net.spacing = { low = 0.1, high = 0.2, count = 1 }
        net.elements = { low = 2, high = 4, count = 9, whole = true }
    """
    plan = read_study(study_file(tmp_path, text))
    assert plan.lists == {"net.spacing": [0.1], "net.elements": [2, 3, 4]}


def test_a_design_may_take_up_to_a_year():
    year = 365 * 86400.0
    assert 0.98 * year < plans._LONGEST <= year
    assert Study(case="a", longest=31e6).longest == 31e6
    for wrong in (0.0, 32e6):
        with pytest.raises(ValidationError, match="longest"):
            Study(case="a", longest=wrong)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("3 < 2", 0.0), ("2 < 3", 1.0), ("2 <= 2", 1.0), ("3 >= 4", 0.0), ("4 > 4", 0.0), ("2 == 2", 1.0), ("2 != 2", 0.0),
        ("7 // 2", 3.0), ("-7 % 4", 1.0), ("+net.spacing - -1", 1.055), ("5 if 0 else 6", 6.0), ("abs(-2.5) * 3", 7.5),
        ("ceil(2.1) - floor(2.9)", 1.0), ("log(exp(3))", 3.0), ("sin(pi / 6)", 0.5), ("tan(pi / 4)", 1.0),
    ],
)  # fmt: skip
def test_each_sign_and_function_of_an_expression_has_its_usual_meaning(text, value):
    found = worth(text)
    assert found == pytest.approx(value)
    assert type(found) is float


def test_an_expression_may_have_500_characters():
    assert worth("1" + " " * 498 + "") == 1.0
    assert worth("1+" * 249 + "1 ") == 250.0
    with pytest.raises(InputError, match="longer than 500 characters"):
        worth("1+" * 250 + "1")


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ("[vary]\nnet.spaceing = [0.05, 0.06]", r"[vary]: net.spaceing is no known entry"),
        ("[vary]\nnet.spacing = [60, 70]", r"[vary]: net.spacing: must be between"),
        ("[set]\nnet.elements = 1000\n[vary]\nnet.spacing = [0.05]", r"[set]: net.elements"),
        ("[[designs]]\nrod.radius = 0.0\n[vary]\nnet.spacing = [0.05]", r"[[designs]]: rod.radius"),
        ('[vary]\nnet.spacing = [0.05]\n[function]\njoint.gap = "net.spacing"', r"[function]: joint.gap"),
        ("[set]\nnet.elements = 2\n[vary]\nrod.radius = [-1.0]", r"[vary]: rod.radius"),
        (
            '[set]\nedges.beam = {catalogue = "edge_tubes", section = "9 mm"}',
            "[set]: edges.beam.section: is not in",
        ),
    ],
)
def test_a_study_s_wrong_entry_is_told_with_its_file_and_table(tmp_path, tables, said):
    file = study_file(tmp_path, tables)
    with pytest.raises(InputError) as refused:
        read_study(file)
    assert str(refused.value).startswith(f"{file}: {said}")
