"""What measurements tell about parameters: by hand, for two that act nearly alike and one that hardly acts."""

import numpy as np
import pytest

from shellform.site.identifiability import identifiability

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


def test_a_marker_s_reach_is_how_far_one_percent_moves_it():
    found = told(1.0)
    assert found.reach == pytest.approx([1e-5, 1e-5 * 1.01**0.5, 0.0])
    said = found.sentences()
    assert (
        said[0]
        == "a is told to ±10 % (one standard deviation); 1 % of it moves no marker by more than 0.01 mm."
    )
    assert said[2] == "The data can't tell c: 1 % of it moves no marker by more than 0 mm."
