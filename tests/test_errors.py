"""What refusals say: where, what was found, between which bounds it must be, and what to give instead."""

import math
import re

import pytest

from shellform.errors import (
    InputError,
    NotConverged,
    how_many,
    if_per_cents,
    not_installed,
    printable,
    require_angle,
    require_count,
    require_degrees,
    require_known,
    require_number,
    unreadable,
)


def refused(value, **bounds):
    with pytest.raises(InputError) as told:
        require_number(value, where="rod.radius", give="metres, such as 0.012", **bounds)
    return str(told.value)


@pytest.mark.parametrize(
    ("bounds", "good", "bad", "words"),
    [
        ({"above": 0.0}, [1e-300, 7.0], [0.0, -2.0, math.inf], "positive and finite"),
        ({"above": -1.0}, [-0.99], [-1.0, -3.0], "above -1 and finite"),
        ({"least": 0.0}, [0.0, 7.0], [-1e-300, math.nan], "0 or more and finite"),
        ({"least": 2.5}, [2.5], [2.49], "at least 2.5 and finite"),
        ({"below": 0.5}, [0.49, -7.0], [0.5, 3.0], "below 0.5"),
        ({"most": 4.0}, [4.0], [4.01], "at most 4"),
        ({"least": 2.0, "most": 4.0}, [2.0, 4.0], [1.99, 4.01], "between 2 and 4"),
        ({"above": -1.0, "below": 0.5}, [0.0], [-1.0, 0.5], "above -1 and below 0.5"),
        ({"above": 0.0, "most": 9.0}, [9.0], [0.0, 9.1], "positive and at most 9"),
        ({"least": 0.0, "below": 9.0}, [0.0], [9.0, -1.0], "0 or more and below 9"),
        ({}, [0.0, -7.0], [math.inf, -math.inf, math.nan], "finite"),
    ],
)
def test_a_number_is_refused_beyond_its_bounds_which_are_said_with_what_to_give(bounds, good, bad, words):
    for value in good:
        require_number(value, where="rod.radius", give="metres", **bounds)
    for value in bad:
        assert refused(value, **bounds) == (
            f"rod.radius: must be {words} (found {value!r}). Give metres, such as 0.012."
        )


def test_what_is_no_number_is_refused_as_such():
    assert "must be a number (found 'thick'). Give metres" in refused("thick", above=0.0)
    assert "must be a number. Give metres" in refused(None)


def test_a_count_is_refused_below_and_beyond_its_bounds_and_where_it_is_no_whole_number():
    for value, bounds, words in (
        (0, {}, "at least 1"),
        (2, {"least": 3}, "at least 3"),
        (2, {"least": 3, "most": 7}, "between 3 and 7"),
        (8, {"least": 3, "most": 7}, "between 3 and 7"),
        (2.0, {}, "a whole number"),
        ("2", {}, "a whole number"),
    ):
        with pytest.raises(InputError, match=f"^--limit: must be {words}.*Give a number of steps"):
            require_count(value, where="--limit", give="a number of steps", **bounds)
    for value, bounds in ((1, {}), (10**9, {}), (3, {"least": 3, "most": 7}), (7, {"least": 3, "most": 7})):
        require_count(value, where="--limit", give="a number of steps", **bounds)


@pytest.mark.parametrize("value", [405.0, -405.0, 720.0, -720.0, 45.0, 1e9, 359.99999 + 360.0])
@pytest.mark.parametrize(("require", "turn"), [(require_angle, 2.0 * math.pi), (require_degrees, 360.0)])
def test_an_angle_of_more_than_a_whole_turn_is_refused_and_what_is_named_in_its_place_is_taken(
    require, turn, value
):
    if abs(value) <= turn:
        require(value, where="net.angle", give="an angle")
        return
    with pytest.raises(InputError, match=r"^net\.angle: .* is more than a whole turn") as told:
        require(value, where="net.angle", give="an angle")
    named = [float(each) for each in re.findall(r"give ([-+.e\d]*\d)", told.value.remedy)]
    assert math.cos(2.0 * math.pi * named[0] / turn) == pytest.approx(
        math.cos(2.0 * math.pi * value / turn), abs=1e-3
    )
    for each in named:
        require(each, where="net.angle", give="an angle")


def test_degrees_of_more_than_a_whole_turn_are_told_in_degrees():
    for value, said in ((405.0, "for 405° give 45."), (-720.0, "for -720° give 0."), (1e9, "give 280.")):
        with pytest.raises(InputError, match=said) as told:
            require_degrees(value, where="net.angle", give="degrees, such as 45")
        assert "rad" not in str(told.value)
    with pytest.raises(InputError, match=r"must be finite.*Give degrees, such as 45"):
        require_degrees(math.nan, where="net.angle", give="degrees, such as 45")


def test_a_name_is_refused_that_is_none_of_those_known_which_are_listed_and_so_is_what_has_no_hash():
    require_known("cm", {"m": 1.0, "cm": 0.01}, where="--unit", what="isn't a known unit")
    for value in ("furlong", ["m"], None):
        with pytest.raises(InputError, match=r"^--unit: isn't a known unit.* Known: m, cm\.$") as told:
            require_known(value, {"m": 1.0, "cm": 0.01}, where="--unit", what="isn't a known unit")
        assert told.value.value == value


def test_a_refusal_within_a_file_says_both_places_and_keeps_the_rest():
    inner = InputError("is odd", where="beams[3]", value=0, remedy="Mend it.")
    outer = inner.within("a\nb.json")
    assert str(outer) == r"a\nb.json: beams[3]: is odd (found 0). Mend it."
    assert (outer.what, outer.value, outer.remedy) == ("is odd", 0, "Mend it.")
    assert str(InputError("is odd").within("m.json")) == "m.json: is odd"
    assert printable("a\tø\u2028b") == r"a\tø\u2028b"


def test_what_ended_without_a_result_carries_what_was_reached():
    told = NotConverged("It stalled", state="here", residual=0.25, iterations=7, remedy="Go slower.")
    assert (str(told), told.state, told.residual, told.iterations) == (
        "It stalled. Go slower.",
        "here",
        0.25,
        7,
    )
    bare = NotConverged("It stalled")
    assert str(bare) == "It stalled"
    assert math.isnan(bare.residual)


def test_a_library_that_is_missing_is_named_with_the_command_that_installs_it():
    told = str(not_installed("pictures", "render", ImportError("No module named 'vtk'", name="vtk")))
    assert "pictures: the library vtk can't be loaded (No module named 'vtk')" in told
    assert 'pip install "shellform[render]"' in told
    assert "the library asked for can't" in str(not_installed("pictures", "render", ImportError("broken")))


def test_one_is_told_in_the_singular_and_any_other_number_in_the_plural():
    assert [how_many(count, "face was", "faces were") for count in (0, 1, 2)] == [
        "0 faces were",
        "1 face was",
        "2 faces were",
    ]


def test_a_file_that_can_not_be_read_is_told_in_words_without_the_system_s_number_and_its_path_again(
    tmp_path,
):
    with pytest.raises(FileNotFoundError) as missing:
        (tmp_path / "none.toml").read_text(encoding="utf-8")
    assert unreadable(missing.value) == "can't be read: No such file or directory"
    assert unreadable(OSError("gone")) == "can't be read: gone"
    assert unreadable(ValueError("no text")) == "can't be read: no text"


def test_a_refusal_is_its_cause_and_then_its_remedy():
    given = {"where": "rod.radius", "value": -1.0}
    for error, cause in (
        (InputError("is odd", **given, remedy="Give 2."), "rod.radius: is odd (found -1.0)"),
        (NotConverged("It stalls", remedy="Give 2."), "It stalls"),
    ):
        assert (error.cause, error.remedy, str(error)) == (cause, "Give 2.", f"{cause}. Give 2.")
    for bare in (InputError("is odd", **given), NotConverged("It stalls")):
        assert (str(bare), bare.remedy) == (bare.cause, "")


def test_per_cents_are_suspected_between_the_whole_and_a_hundred_times_what_may_be():
    assert if_per_cents(97.0, 1.0) == " For 97 % write 0.97."
    assert if_per_cents(199.0, 2.0) == " For 199 % write 1.99."
    assert [if_per_cents(value, 1.0) for value in (1.0, 100.0, 150.0)] == [""] * 3
