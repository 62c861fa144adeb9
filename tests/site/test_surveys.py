"""Surveys as they come from a site, and what is doubtful about them: numbers by hand."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.gridshell import Design
from shellform.site import surveys
from shellform.site.surveys import Surveyed, doubtful, read_survey

POSITIONS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 1.0, 0.5], [4.0, 4.0, 1.0]])
SHELL = SimpleNamespace(
    net=SimpleNamespace(spacing=0.4, grid=SimpleNamespace(crossing_nodes=np.array([[0, 1], [2, 3], [2, 4]]))),
    target=SimpleNamespace(positions=POSITIONS),
)
STATE = SimpleNamespace(positions=POSITIONS)
WIDE = SimpleNamespace(
    positions=5.0 * np.array([[0, 0, 0], [2, 0, 0], [4, 0, 0.0], [0, 4, 1], [4, 4, 1]])
)  # 20 m
NARROW = SimpleNamespace(net=SimpleNamespace(spacing=0.5, grid=SHELL.net.grid), target=WIDE)
NOISE = 0.2e-3


@pytest.mark.parametrize(("unit", "metre"), [("m", 1.0), ("mm", 1e3)])
def test_named_nodes_are_taken_as_far_as_they_were_seen_and_refused_beyond_half_a_spacing(
    monkeypatch, tmp_path, unit, metre
):
    def read(by):
        places = POSITIONS[[1, 2, 4]] + [[0.0, 0.0, 0.0], [0.0, 0.0, by], [np.nan, 0.0, 0.0]]
        return lambda path, shell: (np.array([1, 2, 4]), metre * places)

    monkeypatch.setattr(surveys.measurements, "has_column", lambda path, name: name == "crossing")
    monkeypatch.setattr(surveys.measurements, "read_places", read(-0.199))
    monkeypatch.setattr(surveys.measurements, "named_by", lambda path: "node")
    found = read_survey(tmp_path, SHELL, STATE, unit=unit)
    assert (found.nodes.tolist(), found.names, found.doubts) == ([1, 2], ("node 1", "node 2"), ())
    np.testing.assert_allclose(found.places, [[1.0, 0.0, 0.0], [2.0, 0.0, -0.199]])
    monkeypatch.setattr(surveys.measurements, "read_places", read(-0.201))
    with pytest.raises(InputError, match=r"node 2 lies 201\.0 mm from"):
        read_survey(tmp_path, SHELL, STATE, unit=unit)
    with pytest.raises(InputError, match="isn't a known unit"):
        read_survey(tmp_path, SHELL, STATE, unit="mile")
    nowhere = np.full((1, 3), np.nan)
    monkeypatch.setattr(surveys.measurements, "read_places", lambda *_: (np.array([1]), nowhere))
    with pytest.raises(InputError, match="no node was seen"):
        read_survey(tmp_path, SHELL, STATE, unit="m")


@pytest.mark.parametrize("zero", [(0.0, 0.0, 0.0), (430_000.0, 81_000.0, 400.0)])
def test_named_nodes_may_have_the_coordinates_of_the_survey_that_the_model_counts_from(tmp_path, zero):
    lines = [
        f"{k},{','.join(f'{x:.6f}' for x in place + zero + [0.0, 0.0, 0.01])}"
        for k, place in enumerate(POSITIONS)
    ]
    file = tmp_path / "survey.csv"
    file.write_text("\n".join(["node,x,y,z", *lines]), encoding="utf-8")
    shell = SimpleNamespace(net=SHELL.net, target=SHELL.target, node_count=5)
    found = read_survey(file, shell, STATE, unit="m", origin=(430_000.0, 81_000.0, 400.0))
    np.testing.assert_allclose(found.places, POSITIONS + np.array([0.0, 0.0, 0.01]), atol=1e-9)
    assert [*found.counted] == (
        ["surface.origin, (430000, 81000, 400) m, was taken off the coordinates that were given"]
        if any(zero)
        else []
    )
    if any(zero):
        with pytest.raises(InputError, match="from where it is expected"):
            read_survey(file, shell, STATE, unit="m")


@pytest.mark.parametrize(
    ("off", "answer"), [(0.2, "taken"), (0.3, "doubted"), (0.39, "doubted"), (0.41, "refused")]
)
def test_a_named_node_of_a_narrow_grid_may_be_off_by_a_fiftieth_of_the_extent_and_is_doubted_from_half_a_spacing_on(
    monkeypatch, tmp_path, off, answer
):
    """Shells are off by a share of their span, however near their crossings: 207 mm at 0.5 m."""
    places = WIDE.positions + np.array([[0.0, 0.0, off if k == 2 else 0.0] for k in range(5)])
    monkeypatch.setattr(surveys.measurements, "has_column", lambda path, name: name == "node")
    monkeypatch.setattr(surveys.measurements, "read_places", lambda path, shell: (np.arange(5), places))
    monkeypatch.setattr(surveys.measurements, "named_by", lambda path: "node")
    if answer == "refused":
        with pytest.raises(InputError, match=r"node 2 lies 410\.0 mm from"):
            read_survey(tmp_path, NARROW, WIDE, unit="m")
        return
    doubts = read_survey(tmp_path, NARROW, WIDE, unit="m").doubts
    assert [each.partition(",")[0] for each in doubts] == (
        [] if answer == "taken" else [f"node 2 lies {1e3 * off:.1f} mm from where it is expected"]
    )


def test_points_without_names_are_laid_onto_the_crossings_within_half_a_spacing(monkeypatch, tmp_path):
    asked = []

    def match(points, expected, *, reach):
        asked.append((points, expected.tolist(), reach))
        places = np.array([[1.0, 2.0, 3.0], [np.nan, 0.0, 0.0], [4.0, 5.0, 6.0]])
        return SimpleNamespace(places=lambda points: places, doubts=("far",), outliers=np.array([3, 7]))

    monkeypatch.setattr(surveys.measurements, "has_column", lambda path, name: False)
    monkeypatch.setattr(surveys, "read_points", lambda path, *, unit: unit)
    monkeypatch.setattr(surveys, "match", match)
    found = read_survey(tmp_path, SHELL, STATE, unit="cm")
    assert asked == [("cm", POSITIONS[[1, 3, 4]].tolist(), 0.2)]
    assert (found.nodes.tolist(), found.places.tolist()) == ([1, 4], [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    assert (found.names, found.laid) == (("crossing 0", "crossing 2"), True)
    assert found.doubts == ("far", "2 points belong to no crossing and 1 crossing has no point")


def belief(*lengths, error=1e-3):
    """Two of three cables, of the lengths, in the state of all tests."""
    design = Design(np.array([9.0, *lengths]), np.array([False, True, True]), 0.01)
    return SimpleNamespace(design=design, covariance=error**2 * np.eye(2), state=STATE)


def survey(*off, laid=False):
    """All five nodes, each so far off."""
    return Surveyed(
        np.arange(5), POSITIONS + np.array(off), tuple(f"crossing {k}" for k in range(5)), laid=laid
    )


DRAWN = belief(1.0, 2.0)


def test_nothing_is_doubtful_about_a_survey_within_its_noise():
    off = NOISE * np.random.default_rng(0).normal(size=(5, 3))
    assert doubtful(survey(*off), DRAWN, belief(1.003, 1.999), noise=NOISE) == []


def test_a_survey_off_as_a_whole_is_said_to_be():
    (told,) = doubtful(survey([0.003, 0.0, 0.004]), DRAWN, DRAWN, noise=NOISE)
    assert "moved as a whole by 5.0 mm the survey would fit" in told
    assert "to 0.00 mm a coordinate" in told
    (told,) = doubtful(survey([0.003, 0.0, 0.004], laid=True), DRAWN, DRAWN, noise=NOISE)
    assert "supports, marks or the load are off too; with --noise 0.003" in told


def test_a_point_off_by_itself_is_named():
    off = np.zeros((5, 3))
    off[3, 1] = 0.02
    (told,) = doubtful(survey(*off, laid=True), DRAWN, DRAWN, noise=NOISE)
    assert told.startswith("doubtful: crossing 3 lies 20.0 mm from where any lengths of cables bring it")


@pytest.mark.parametrize(("off", "word"), [(0.005, "longer"), (-0.005, "shorter")])
def test_lengths_that_no_cable_is_cut_to_are_doubtful(off, word):
    (told,) = doubtful(survey([0.0, 0.0, 0.0]), DRAWN, belief(1.0, 2.0 + off), noise=NOISE)
    assert f"C1 would have to be 5.0 mm {word} than it is taken to be, 5 times what is usual" in told
    assert "--load" in told
    assert doubtful(survey([0.0, 0.0, 0.0]), DRAWN, belief(1.0, 2.0 + 0.7 * off), noise=NOISE) == []
