"""What a gridshell as built is off by."""

from dataclasses import fields
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import (
    SOURCES,
    Tolerances,
    default_tolerances,
    enlarged,
    span_of,
    tolerances_of_size,
)
from shellform.plan_rectangle import axes_in_plan


def test_every_cause_has_a_source_and_a_default_above_zero_but_for_doubts_about_means(shell):
    found = default_tolerances(shell)
    for each in fields(Tolerances):
        assert (getattr(found, each.name) > 0.0) == (
            each.name not in ("cable_stiffness_all", "connectors_all", "tape")
        )
        assert len(SOURCES[each.name]) > 20


def test_the_scale_model_is_built_more_closely_than_a_shell_of_eighteen_metres(shell):
    small, large = default_tolerances(shell), tolerances_of_size(18.0, longest_rod=20.0, longest_cable=2.0)
    assert (small.cable_length, small.supports, small.marks) == (1e-4, 1e-4, 2e-4)
    assert large.cable_length == pytest.approx(2.4e-3)
    assert large.supports == 5e-3
    assert (large.marks, large.tape) == (pytest.approx(1.15e-3), 1e-4)
    assert small.tape == 0.0, "callipers have none"
    # weights hung one by one, a shape set by callipers; concrete placed unevenly, a shape as in EN 1993-1-6
    assert (small.load_uneven, small.shape) == (0.01, 1e-4)
    assert (large.load_uneven, large.shape) == (0.05, 5e-4)


def test_what_stiffnesses_rods_and_loads_are_off_by_is_as_the_sources_say_whatever_the_size():
    small = tolerances_of_size(1.99, longest_rod=2.0, longest_cable=0.1)
    large = tolerances_of_size(2.0, longest_rod=2.0, longest_cable=0.1)
    assert small.supports == 1e-4
    assert large.supports > small.supports, "a scale model is below 2 m"
    for found in (small, large):
        assert (found.cable_stiffness, found.rod_stiffness, found.connectors) == (0.05, 0.03, 0.1)
        assert (found.rod_bow, found.load_each, found.load_all) == (0.001, 0.1, 0.05)


@pytest.mark.parametrize(
    ("cable", "permitted"),
    [
        (0.1, 3e-4),
        (0.12, 3e-4),
        (0.121, 5e-4),
        (0.4, 5e-4),
        (1.0, 8e-4),
        (1.01, 1.2e-3),
        (2.0, 1.2e-3),
        (3.0, 2e-3),
    ],
)
def test_what_spans_two_to_four_metres_is_built_as_workshops_do(cable, permitted):
    """ISO 2768-1:1989, table 1, class m: 0.3 mm up to 120 mm, 0.5 to 400, 0.8 to 1000, 1.2 to 2000, 2 to
    4000. A cable's is taken whole, of others half, as deviations that 95 % keep."""
    found = tolerances_of_size(2.0, longest_rod=1.9, longest_cable=cable)
    assert (found.cable_length, found.supports, found.marks) == (permitted, 6e-4, 6e-4)
    wider = tolerances_of_size(3.99, longest_rod=4.6, longest_cable=cable)
    assert (wider.cable_length, wider.supports, wider.marks) == (permitted, 1e-3, 1e-3)
    assert (wider.load_uneven, wider.shape) == (0.05, 5e-4), "concrete is placed as on site"
    site = tolerances_of_size(4.0, longest_rod=4.6, longest_cable=cable)
    assert (site.cable_length, site.supports) == (pytest.approx(2e-3 + cable / 5000.0), 5e-3)


def test_on_site_a_tape_is_off_alike_along_a_rod_however_long_that_is_and_marks_by_themselves():
    """Directive 2004/22/EC, class II: 0.3 mm and 0.2 mm a metre, two deviations; scribed to 1 mm."""
    short, long = (tolerances_of_size(10.0, longest_rod=each, longest_cable=1.0) for each in (5.0, 60.0))
    assert (short.marks, short.tape) == (long.marks, long.tape) == (pytest.approx(1.15e-3), 1e-4)


def test_only_leaves_all_other_causes_out():
    found = Tolerances(cable_length=1e-3, supports=2e-3, load_each=0.1).only("supports")
    assert found == Tolerances(supports=2e-3)


def test_causes_are_those_that_are_not_left_out_and_where_none_is_it_is_said_what_to_give():
    rough = Tolerances(marks=1e-3, load_all=0.1)
    assert rough.causes == ("marks", "load_all")
    rough.require_causes()
    with pytest.raises(InputError, match=r"tolerances: nothing is off.*cable_length.*rod_stiffness = 0\.03"):
        Tolerances(marks=0.0).require_causes()


def test_an_unknown_cause_is_refused_with_the_known_ones():
    with pytest.raises(InputError, match="Known: cable_length"):
        Tolerances().only("cables")


@pytest.mark.parametrize("value", [-1e-3, float("nan"), float("inf")])
def test_a_tolerance_that_is_negative_or_no_number_is_refused(value):
    with pytest.raises(InputError, match=r"tolerances\.supports"):
        Tolerances(supports=value)


def test_a_share_given_in_percent_is_refused():
    with pytest.raises(InputError, match=r"Write 0\.1 for 10 %"):
        Tolerances(load_each=10.0)
    with pytest.raises(InputError, match=r"must not exceed 0\.5"):
        Tolerances(shape=0.51)
    assert Tolerances(shape=0.5, supports=0.51).supports == 0.51  # m


def test_a_size_without_extent_is_refused():
    with pytest.raises(InputError, match="span"):
        tolerances_of_size(0.0, longest_rod=1.0, longest_cable=1.0)


def test_a_shell_s_own_span_longest_rod_and_longest_cable_tell_its_tolerances():
    """The longer side of the box, wherever it stands and however it is turned; without cables their length is
    nothing."""
    places = np.array([[30.0, 5.0, 1.0], [36.0, 5.0, 4.0], [36.0, 23.0, -2.0], [30.0, 23.0, -2.0]])
    rods = [SimpleNamespace(length=length) for length in (12.0, 25.0, 7.0)]
    shell = SimpleNamespace(
        target=SimpleNamespace(positions=places),
        net=SimpleNamespace(grid=SimpleNamespace(rods=rods)),
        cable_lengths=np.array([1.0, 3.5, 2.0]),
    )
    assert span_of(shell) == 18.0
    slanting = np.column_stack([places[:, :2] @ axes_in_plan(0.7).T, places[:, 2]])
    assert span_of(SimpleNamespace(target=SimpleNamespace(positions=slanting))) == pytest.approx(18.0)
    found = default_tolerances(shell)
    assert found == tolerances_of_size(18.0, longest_rod=25.0, longest_cable=3.5)
    assert found.cable_length == pytest.approx(2.7e-3)
    shell.cable_lengths = np.zeros(0)
    assert default_tolerances(shell).cable_length == pytest.approx(2e-3)
    shell.target.positions = 0.1 * places
    assert default_tolerances(shell).cable_length == 1e-4, "a model of 1.8 m"


def test_enlarged_errors_are_larger_by_the_factor_as_far_as_shares_go():
    found = enlarged(Tolerances(cable_length=1e-3, supports=2e-3, marks=0.4, rod_bow=1e-3, load_all=0.4), 1.5)
    assert (found.cable_length, found.supports, found.marks) == pytest.approx((1.5e-3, 3e-3, 0.6))
    assert (found.rod_bow, found.load_all, found.shape) == (pytest.approx(1.5e-3), 0.5, 0.0)
