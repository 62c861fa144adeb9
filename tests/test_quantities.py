"""What numbers measure, and the units in which they are given by mistake."""

import re

import numpy as np
import pytest

from shellform import quantities
from shellform.errors import InputError
from shellform.quantities import LENGTHS, STRESSES, Quantity, coordinates, extents, if_other_unit, rounded

ALL = {name: each for name, each in vars(quantities).items() if isinstance(each, Quantity)}


def written(told):
    """The numbers that a remedy says to write."""
    return [float(each) for each in re.findall(r"write ([\d.e+-]+)\.(?: |$)", told)]


def test_a_number_is_told_in_the_units_in_which_it_is_likely():
    assert if_other_unit(50.0, LENGTHS, 0.002, 0.3) == " For 50 mm write 0.05."
    assert if_other_unit(5.0, LENGTHS, 0.002, 0.3) == " For 5 mm write 0.005. For 5 cm write 0.05."
    assert if_other_unit(255.0, STRESSES, 1e6, 1e10) == " For 255 MPa write 2.55e8."
    assert if_other_unit(1e9, LENGTHS, 0.002, 0.3) == ""


def test_a_number_that_was_converted_once_too_often_is_told_as_what_it_was():
    assert if_other_unit(5e-5, LENGTHS, 0.002, 0.3) == " For 50 mm write 0.05."
    assert if_other_unit(255e9, STRESSES, 1e6, 1e10) == " For 255 MPa write 2.55e8."
    assert if_other_unit(5e-9, LENGTHS, 0.002, 0.3) == ""


@pytest.mark.parametrize("name", ALL)
def test_what_is_usual_is_possible_and_in_its_first_unit_refused_with_what_to_write(name):
    quantity = ALL[name]
    low, high = quantity.usual
    for usual in np.geomspace(low, high, 9)[1:-1]:
        assert quantity.require(usual) == usual
    for given in (usual / each for each in quantity.units.values() for usual in quantity.usual):
        if not quantity.possible[0] <= given <= quantity.possible[1]:
            with pytest.raises(InputError, match="must be between") as refused:
                quantity.require(given, where="here")
            assert refused.value.where == "here"
            for each in written(refused.value.remedy):
                assert quantity.require(each) == each


def test_numbers_below_zero_are_no_size_and_none_is_one_where_it_may_be():
    for wrong in (-1.0, 0.0, np.nan, np.inf):
        with pytest.raises(InputError, match="Give a saw cut's width in metres"):
            quantities.KERF.require(wrong)
    assert quantities.KERF.or_none(0.0) == 0.0
    with pytest.raises(InputError, match="positive"):
        quantities.KERF.or_none(-1.0)


def test_a_place_that_rounds_to_nothing_less_is_told_as_0():
    assert str(rounded(np.array([-0.0004, 1.23456, -2.0]))) == "[0.0, 1.235, -2.0]"
    assert str(rounded((-0.00004, 0.00006), 4)) == "[0.0, 0.0001]"
    assert coordinates((-0.0, 0.5)) == "(0, 0.5)"


def test_an_extent_that_is_rounding_beside_the_largest_is_told_as_0():
    assert extents(np.array([16.0, 1.5e-8, 4.441e-15])) == [16.0, 0.0, 0.0]
    assert extents((16.0, 2e-8, 0.0)) == [16.0, 2e-8, 0.0]
