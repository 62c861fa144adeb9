"""What commands tell on the terminal of designs as built."""

from dataclasses import replace

from shellform.cli.terminal import tell_as_built
from shellform.records.summary import BuiltShapeRecord, StandingRecord, VerdictRecord
from tests.records.made import design, optimisation, summary


def test_each_load_of_a_design_tells_what_is_known_of_it_as_built(capsys):
    known = design(
        "design",
        critical_factor=1.31,
        critical_kind="limit point",
        critical_factor_error=0.02,
        stands=StandingRecord(200, 199, 0.9765, 0.95, 0),
        built_shape=BuiltShapeRecord(20, 0.0071, 0.0088, 0.0021, {"supports": 0.001}),
    )
    told = replace(summary(["initial"]), designs={"initial": known})
    tell_as_built(told)
    (line,) = [each for each in capsys.readouterr().out.splitlines() if " design: " in each]
    for words in (
        "critical factor 1.310 × (limit point) ± 0.020",
        "199 of 200 structures as built stand",
        "as built 7.1 mm off at most and 2.1 mm in the mean",
    ):
        assert words in line
    lost = design("design", critical_factor=None, critical_kind="not found: no equilibrium", stands=None)
    tell_as_built(replace(summary(["initial"]), designs={"initial": lost}))
    assert "critical factor" not in capsys.readouterr().out


def test_of_the_design_to_build_it_is_told_where_its_shape_is_farther_off_than_was_wished_for(capsys):
    told = replace(summary(["polished"]), verdict=VerdictRecord("polished", True, (), ()))
    for wished, words in (
        (0.003, "The shape is 4 mm off where it is farthest, more than the 3 mm of"),
        (0.004, ""),
    ):
        tell_as_built(replace(told, optimisation=optimisation(deviation_wished=wished)))
        out = capsys.readouterr().out
        assert words in out
        assert ("The shape is" in out) == bool(words)
