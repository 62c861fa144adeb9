"""What measurements tell about parameters: by hand, for two that act nearly alike and one that hardly
acts."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.site.identifiability import identifiability, nuisance

NOISE = 1e-5  # m


def told(sign, third=0.0):
    """Of a, of b, which moves one marker nearly as a does or against it, and of c."""
    jacobian = 1e-3 * np.array([[1.0, sign, 0.0], [0.0, 0.1, 0.0], [0.0, 0.0, third]])
    return identifiability(("a", "b", "c"), jacobian, jacobian, NOISE)


@pytest.mark.parametrize(
    ("sign", "fixed", "lost"), [(1.0, "product", "quotient"), (-1.0, "quotient", "product")]
)
def test_of_two_that_act_alike_the_product_is_known_and_of_two_that_act_against_each_other_the_quotient(
    sign, fixed, lost
):
    found = told(sign)
    # s² (J'J)⁻¹ = 1e-4 [[101, -+100], [-+100, 100]]
    assert found.deviation[:2] == pytest.approx([0.1 * 1.01**0.5, 0.1])
    assert found.correlation[0, 1] == found.correlation[1, 0] == pytest.approx(-sign / 1.01**0.5)
    assert f"they fix their {fixed} far better than their {lost}" in " ".join(found.sentences())


def test_what_moves_no_marker_is_not_told_and_does_not_blur_the_others():
    for third in (0.0, 1e-5):
        found = told(1.0, third)
        assert found.tellable == ("a", "b")
        assert found.deviation[2] > 0.5
        assert found.deviation[:2] == pytest.approx(told(1.0).deviation[:2])
    assert told(1.0, 1.0 / 60.0).tellable == ("a", "b")  # to 60 %, where half is the most
    assert told(1.0, 1.0 / 40.0).tellable == ("a", "b", "c")
    known = told(1.0, 0.1)
    assert known.tellable == ("a", "b", "c")
    assert known.deviation[2] == pytest.approx(0.1)
    assert known.singular.max() == pytest.approx(1e2 * np.linalg.norm([[1.0, 1.0], [0.0, 0.1]], 2))


def test_of_parameters_that_move_all_markers_alike_one_alone_is_told():
    """Of a combination that moves nothing the data know nothing, not all."""
    jacobian = 1e-3 * np.array([[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    found = identifiability(("a", "b", "c"), jacobian, jacobian, NOISE)
    assert len(found.tellable) == 2
    assert np.isinf(found.deviation[:2]).sum() == 1
    assert found.deviation[2] == pytest.approx(0.01)


def test_a_marker_s_reach_is_how_far_one_percent_moves_it():
    found = told(1.0)
    assert found.reach == pytest.approx([1e-5, 1e-5 * 1.01**0.5, 0.0])
    said = found.sentences()
    assert (
        said[0]
        == "a is told to ±10 % (one standard deviation); 1 % of it moves no marker by more than 0.01 mm."
    )
    assert said[2] == "The data can't tell c: 1 % of it moves no marker by more than 0 mm."


def test_of_several_markers_the_one_that_moves_most_tells_the_reach():
    """Of two markers one moves by 3, 4, 12 mm and one by 1, 2, 2 mm for the whole of a parameter."""
    rates = 1e-3 * np.array([[1.0, 2.0, 2.0, 3.0, 4.0, 12.0]]).T
    assert identifiability(("a",), rates, rates, NOISE).reach == pytest.approx([0.01 * 13e-3])


def test_parameters_are_told_apart_up_to_a_correlation_of_095():
    for share, apart in ((0.36, True), (0.28, False)):  # cosines 0.941 and 0.963
        jacobian = np.array([[1.0, 1.0], [0.0, share]]) @ np.diag([1.0, 1.0 / np.hypot(1.0, share)])
        said = " ".join(identifiability(("a", "b"), jacobian, np.zeros((3, 2)), 0.01).sentences())
        assert ("tell a and b apart" not in said) == apart, said


PLACES = np.array([[1.0, 0.0, 0.5], [-2.0, 1.0, 0.0], [0.5, 3.0, 0.0], [9.0, 9.0, 9.0]])


def left(moved, frames, seen=None, offsets=False):
    """What is left of how markers 0 to 2 moved (scans, 3, 3) where the nuisances are taken away."""
    seen = np.ones(moved.shape[:2], dtype=bool) if seen is None else seen
    states = [SimpleNamespace(positions=PLACES + k) for k in range(len(moved))]
    basis = nuisance(states, np.arange(3), frames, seen, offsets)
    assert basis.T @ basis == pytest.approx(np.eye(basis.shape[1]), abs=1e-12)
    rows = moved[seen].ravel()
    return np.linalg.norm(rows - basis @ (basis.T @ rows)) / np.linalg.norm(rows)


def carried(shift, turn, scan=0):
    """How a small motion of the scanner moves the markers of a scan."""
    return np.asarray(shift) + np.cross(turn, (PLACES + scan)[:3])


def test_a_scanner_s_place_takes_away_small_motions_of_all_its_scans_together():
    shift, turn, still = [0.3, -0.2, 0.7], [0.1, 0.5, -0.4], np.zeros((3, 3))
    both = np.stack([carried(shift, turn), carried(shift, turn, 1)])
    only = np.stack([still, carried(shift, turn, 1)])
    assert left(both, [4, 4]) == pytest.approx(0.0, abs=1e-12)
    assert left(only, [4, 4]) > 0.3, "one scanner moved once"
    assert left(only, [4, 7]) == pytest.approx(0.0, abs=1e-12)
    assert left(only, [4, None]) == pytest.approx(1.0), "the second is in the model's axes"
    assert left(both[::-1].copy(), [None, None]) == 1.0
    stretched = np.stack([PLACES[:3], PLACES[:3] + 1.0])
    assert left(stretched, [4, 4]) > 0.3, "no rigid motion"


def test_a_marker_off_its_node_is_so_in_all_scans_and_coordinates_out_of_sight_have_no_rows():
    off = np.zeros((2, 3, 3))
    off[:, 1] = [0.2, -0.1, 0.4]
    assert left(off, [None, None], offsets=True) == pytest.approx(0.0, abs=1e-12)
    assert left(off, [None, None]) == 1.0
    off[0, 1] = 0.0
    assert left(off, [None, None], offsets=True) == pytest.approx(0.5**0.5)
    seen = np.array([[True, False, True], [True, True, True]])
    assert left(off, [None, None], seen, offsets=True) == pytest.approx(0.0, abs=1e-12)
    basis = nuisance([SimpleNamespace(positions=PLACES)] * 2, np.arange(3), [0, 1], seen, False)
    assert basis.shape == (15, 11), "two markers fix a scan but for a turn about their line"
