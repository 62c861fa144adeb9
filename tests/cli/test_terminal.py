"""What commands tell on the terminal of designs as built."""

import errno
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
import typer

from shellform.cli import design as commands
from shellform.cli.terminal import Spinner, refusal_words, tell_as_built, tell_cases, tell_designs
from shellform.errors import InputError, NotConverged
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.failures import FailureRecord
from shellform.records.optimisation import SectionRecord
from shellform.records.summary import StandingRecord, VerdictRecord
from tests.records.made import design, load, optimisation, summary


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


def test_of_the_design_to_build_cables_that_hang_slack_before_any_load_are_told(capsys):
    told = replace(
        summary(["polished"]),
        designs={"polished": design("none", slack=("C5", "C7"))},
        verdict=VerdictRecord("polished", True, (), ()),
    )
    tell_as_built(told)
    assert "Before any load C5, C7 hang slack" in capsys.readouterr().out


def test_what_a_designer_asks_first_is_told_in_millimetres_with_what_snapped_and_was_tried(capsys):
    rows = {"design": load("design", deviation_max=0.0123, deviation_mean=0.0045, on_branch=False)}
    sections = (
        SectionRecord("⌀ 8 mm", 0.004, 12.0, True, 0.456, 0.01, 0.002, 30, 0.8, True, ""),
        SectionRecord("⌀ 10 mm", 0.005, 14.0, False, 0.4, 0.01, 0.002, 31, 0.8, False, "it is too stiff"),
        SectionRecord("⌀ 6 mm", 0.003, 9.0, False, None, None, None, None, None, False, "it falls"),
    )
    given = replace(
        summary(["initial"]),
        designs={"initial": design(cables=42, loads=rows)},
        optimisation=optimisation({"cable_force": 0.0011, "misfit": 0.0009, "uplift": 0.25}),
        sections=sections,
        verdict=VerdictRecord("initial", False, ("Stands: unstable.",), ("As built",)),
    )
    tell_designs(given)
    lines = [each.strip() for each in capsys.readouterr().out.splitlines()]
    assert lines == [
        "initial    42 cables  design:   12.3 mm max,   4.5 mean (snapped)",
        "objective 1 -> 0.4: no better design",
        "limits that the optimised design doesn't keep: cable_force at 100.1% of it, uplift",
        "⌀ 8 mm  objective 0.456, 30 cables",
        "⌀ 10 mm  objective 0.4, 31 cables: it is too stiff",
        "⌀ 6 mm  no design: it falls",
        "The initial design does not hold: 1 check fails.",
        "fails: Stands: unstable.",
        "not examined: As built",
    ]


def test_how_it_fails_first_is_told_with_the_cables_that_go_slack(capsys):
    failure = FailureRecord(
        "initial", "wind", 7, 0.873, "limit point", "marks", {"marks": 1.1, "shape": 0.9}, ("C3", "C12")
    )
    for cables, slack in (
        (("C3", "C12"), "; C3, C12 go slack"),
        (("C5",), "; C5 goes slack"),
        ((), ""),
    ):
        found = replace(failure, cables=cables)
        tell_as_built(replace(summary(["initial"]), failure=found))
        told = capsys.readouterr().out
        assert "fails first: structure 7 at 0.87 of the load “wind” (limit point), driven by" in told
        assert told.rstrip().endswith(f"without which it bears 1.10{slack}")


def test_published_numbers_that_do_not_hold_are_counted(capsys):
    def row(case, passed):
        return SimpleNamespace(
            case=case, quantity="q", value=1.0, reference=2.0, difference=0.5, tolerance=0.1, passed=passed, source="s"
        )  # fmt: skip

    tell_cases([row("a", True), row("a", True), row("b", True)])
    assert capsys.readouterr().out.endswith("all 3 numbers of 2 cases hold\n")
    with pytest.raises(NotConverged, match="2 of 3 numbers do not hold"):
        tell_cases([row("a", False), row("b", True), row("b", False)])
    assert capsys.readouterr().out.count("FAIL") == 2


@pytest.mark.parametrize(
    ("error", "status", "words"),
    [
        (InputError("is wrong", where="net"), 2, "refused: net: is wrong"),
        (NotConverged("lost"), 3, "no result: lost"),
        (MemoryError(), 3, "the memory is full"),
        (OSError(errno.ENAMETOOLONG, "too long", "a" * 300), 2, f"refused: {30 * 'a'} …"),
        (OSError(errno.ENOSPC, "No space left"), 2, "refused: standard output or a temporary file: can't be"),
        (
            OSError(errno.EFBIG, "too large", "a.tmp"),
            2,
            "a.tmp: can't be written: too large. Free some space",
        ),
        (
            PermissionError(errno.EACCES, "not yours", "a\nb"),
            2,
            "a\\nb: can't be read or written: not yours. Give",
        ),
    ],
)
def test_errors_end_a_command_with_2_where_the_input_is_refused_and_with_3_without_a_result(
    error, status, words
):
    told, found = refusal_words(error)
    assert found == status
    assert words in told


def test_errors_of_ours_are_not_told_as_refusals():
    for error in (ValueError("oh"), OSError(errno.EINVAL, "no", "file"), PermissionError(errno.EPERM, "no")):
        assert refusal_words(error) is None


HOLDS = VerdictRecord("polished", True, (), ())
FAILS = VerdictRecord("polished", False, ("Stands: no.",), ())
OPEN = VerdictRecord("polished", False, (), ("As built",))
CARE = VerdictRecord("polished", True, (), (), ("As built: it snaps.",))


@pytest.mark.parametrize(
    ("verdict", "until", "sketch", "status"),
    [
        (HOLDS, "report", False, None),
        (CARE, "report", False, None),
        (FAILS, "report", False, 3),
        (FAILS, "initial", False, 3),
        (FAILS, "report", True, 3),
        (OPEN, "report", False, 3),
        (OPEN, "safety", False, 3),
        (OPEN, "optimise", False, None),  # nothing was to be examined yet
        (OPEN, "report", True, None),  # nor by a sketch
        (None, "net", False, None),
    ],
)
def test_a_design_ends_with_3_where_it_fails_or_was_to_be_examined_and_is_not(
    monkeypatch, capsys, verdict, until, sketch, status
):
    import shellform.case.case
    import shellform.run.run

    asked = {}
    monkeypatch.setattr(shellform.case.case, "load_case", lambda file, settings: (file, settings))

    def run_case(case, output, **how):
        asked.update(how, case=case, output=output)
        return replace(summary(["polished"]), verdict=verdict)

    monkeypatch.setattr(shellform.run.run, "run_case", run_case)
    try:
        commands.design(Path("a.toml"), Path("run"), until=until, sketch=sketch)
        ended = None
    except typer.Exit as end:
        ended = end.exit_code
    assert ended == status
    assert (asked["case"], asked["output"], asked["until"]) == ((Path("a.toml"), ()), Path("run"), until)
    first = "figures/sketch.png" if sketch else "report.html"
    assert (f"look at {Path('run') / first} first" in capsys.readouterr().out) == (until == "report")


def test_what_is_watched_is_the_case_with_its_settings(monkeypatch):
    import shellform.case.case
    import shellform.cli.watching

    asked = []
    monkeypatch.setattr(shellform.case.case, "load_case", lambda file, settings: asked.append(list(settings)))
    monkeypatch.setattr(
        shellform.cli.watching, "case_files", lambda file, settings: asked.append(list(settings))
    )

    def watched(files, once):
        files()
        raise KeyboardInterrupt

    monkeypatch.setattr(shellform.cli.watching, "watched", watched)
    for settings in (None, ["net.spacing=0.4"]):
        with pytest.raises(KeyboardInterrupt):
            commands.design(Path("a.toml"), Path("run"), watch=True, settings=settings)
    assert asked == [[], [], ["net.spacing=0.4"], ["net.spacing=0.4"]]


def test_a_command_that_is_refused_gives_the_terminal_its_cursor_back(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with pytest.raises(InputError), Spinner():
        raise InputError("is too large")
    shown = capsys.readouterr().err
    assert shown.rindex("\x1b[?25h") > shown.rindex("\x1b[?25l")
