"""What terms, limits and variables amount to: their values and units, which gradients alone don't tell."""

from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
import scipy.sparse as sp

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell.reactions import reactions
from shellform.problem.constraints import count, residual_rows, residuals
from shellform.problem.engineering import (
    ConnectorTurn,
    LargestCableForce,
    LargestDeviation,
    ModalStiffness,
    Thrust,
    Uplift,
)
from shellform.problem.evaluation import Evaluator
from shellform.problem.terms import LoadedDesign, Measurement
from shellform.problem.variables import Blocks, Rates, Variable
from shellform.structure.elements import state as states


@pytest.fixture
def moved(dome):
    """The dome's design without its cables 3 and 8, its nodes off by known distances."""
    away = np.random.default_rng(5).normal(size=dome.target.positions.shape) * 1e-3
    state = replace(dome.target, positions=dome.target.positions + away)
    present = np.ones(len(dome.cable_ends), dtype=bool)
    present[[3, 8]] = False
    design = replace(dome.design(rest_ratio=0.97), present=present)
    return LoadedDesign(dome, design, state, dome.point_load(2.0, every=2)), away


def test_the_misfit_is_the_sum_of_squared_distances_and_its_mean_has_limits_as_lengths(moved):
    at, away = moved
    assert sf.Misfit("wet").measure(at).value == pytest.approx([(away**2).sum()])
    rms = sf.RmsMisfit("wet")
    assert rms.measure(at).value == pytest.approx([(away**2).sum() / len(away)])
    assert rms.at_limit(0.005) == pytest.approx(2.5e-5)
    slope = sf.RmsMisfit("wet").measure(at).by_dof.toarray().reshape(-1, 6)
    np.testing.assert_allclose(slope[:, :3], 2.0 * away / len(away))
    np.testing.assert_array_equal(slope[:, 3:], 0.0)


def test_bulges_are_fourth_powers_of_distances_with_their_derivatives_and_squares(moved):
    at, away = moved

    def value(places):
        return sf.Bulges("wet").measure(replace(at, state=replace(at.state, positions=places))).value[0]

    found = sf.Bulges("wet").measure(at)
    assert found.value == pytest.approx([(np.linalg.norm(away, axis=1) ** 4).sum()], rel=1e-12)
    assert (found.squares.residual**2).sum() == pytest.approx(found.value[0], rel=1e-12)
    slope = found.by_dof.toarray().ravel()
    np.testing.assert_allclose(2.0 * found.squares.residual @ found.squares.by_dof, slope, rtol=1e-12)
    aside = np.random.default_rng(6).normal(size=away.shape)
    expected = slope @ np.hstack([aside, np.zeros_like(aside)]).ravel()
    errors = [
        abs(
            (value(at.state.positions + h * aside) - value(at.state.positions - h * aside)) / (2.0 * h)
            - expected
        )
        for h in (1e-4, 5e-5)
    ]
    assert errors[0] < 0.1 * abs(expected)
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2.0, abs=0.01), "Taylor"


def test_cable_forces_are_stiffness_times_strain_and_absent_cables_have_none(moved):
    at, _ = moved
    ends = at.state.positions[at.shell.cable_ends]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    force = np.maximum(187.0 * (length / at.design.rest_length - 1.0), 0.0) * at.design.present
    assert sf.CableForces("wet").measure(at).value == pytest.approx(force)
    assert sf.CableForces("wet", (8, 1)).measure(at).value == pytest.approx([0.0, force[1]])
    assert sf.CableForce("wet").measure(at).value == pytest.approx([force.sum()])
    largest = LargestCableForce("wet", 5.0).measure(at).value[0]
    assert force.max() - 1e-9 <= largest <= force.max() + 5.0 * np.log(len(force)) / 200.0
    assert sf.RodRadius().measure(at).value == pytest.approx([at.design.radius])
    assert (force[at.design.present] > 0.0).sum() > 40


class Told(sf.RodRadius):
    """The rods' radius, and at which designs it was asked for."""

    asked: ClassVar[list[sf.Design]] = []

    def measure(self, at):
        self.asked.append(at.design)
        return super().measure(at)


def test_what_needs_no_equilibrium_is_measured_once_for_a_design_in_whatever_states(dome):
    wet = sf.LoadCase("wet", dome.point_load(2.0, every=2))
    problem = sf.Problem(dome, wet, [sf.Share(0.5, sf.Misfit("wet")), sf.Share(0.5, Told())])
    design = dome.design()
    evaluator = Evaluator(problem, design)
    state = evaluator.begin()["wet"].equilibrium.state
    other = replace(state, positions=state.positions + 1e-3)
    Told.asked.clear()
    first, again = evaluator.seed(design, {"wet": state}, 1.0), evaluator.seed(design, {"wet": other}, 1.0)
    assert Told.asked == [design]
    assert again.terms[1] == first.terms[1]
    assert again.terms[0] > first.terms[0]
    evaluator.seed(replace(design, radius=0.9 * design.radius), {"wet": state}, 1.0)
    assert len(Told.asked) == 2
    evaluator.problem = replace(problem, minimise=[problem.minimise[0], sf.Share(0.5, Told())])
    evaluator.seed(design, {"wet": state}, 1.0)  # another term
    assert len(Told.asked) == 3


def test_limits_are_told_as_shares_of_themselves_above_and_below():
    term = sf.RodRadius()
    values = np.array([3.0, 5.0])
    assert residuals(sf.AtMost(4.0, term), values) == pytest.approx([-0.25, 0.25])
    assert residuals(sf.AtLeast(4.0, term), values) == pytest.approx([0.25, -0.25])
    assert residuals(sf.AtMost(4.0, term, of=8.0), values) == pytest.approx([-0.125, 0.125])
    assert residuals(sf.AtMost(0.0, term, of=2.0), values) == pytest.approx([1.5, 2.5])
    assert residuals(sf.Between(3.5, 4.5, term), values) == pytest.approx([-1.5, 0.5, 0.5, -1.5])
    rows = np.array([[1.0, 2.0]])
    np.testing.assert_allclose(residual_rows(sf.AtMost(4.0, term), rows), [[0.25, 0.5]])
    np.testing.assert_allclose(residual_rows(sf.AtLeast(4.0, term), rows), [[-0.25, -0.5]])
    np.testing.assert_allclose(residual_rows(sf.Between(3.5, 4.5, term), rows), [[1.0, 2.0], [-1.0, -2.0]])


def test_residuals_are_counted_by_value_and_side(dome):
    forces = sf.CableForces("wet")
    assert count(sf.AtMost(4.0, forces), dome) == len(dome.cable_ends)
    assert count(sf.AtLeast(4.0, forces), dome) == len(dome.cable_ends)
    assert count(sf.Between(1.0, 4.0, forces), dome) == 2 * len(dome.cable_ends)
    assert count(sf.AtMost(4.0, sf.CableForces("wet", (1, 2, 3))), dome) == 3


def test_connectors_turns_and_supports_forces_are_those_of_the_state(dome):
    load = dome.point_load(2.0, every=2)
    design = dome.design()
    state = sf.follow(dome, design, {"wet": load})["wet"].equilibrium.state
    at = LoadedDesign(dome, design, state, load)
    bears = np.array([each.force for each in reactions(dome, design, state, load).supports])
    lifts, pushes = -bears[:, 2].min(), np.hypot(bears[:, 0], bears[:, 1]).max()
    uplift, thrust = Uplift("wet", 2.0).measure(at).value[0], Thrust("wet", 5.0).measure(at).value[0]
    assert lifts <= uplift <= lifts + 2.0 * np.log(len(bears)) / 200.0
    assert pushes <= thrust <= pushes + 5.0 * np.log(len(bears)) / 200.0
    turn = ConnectorTurn("wet").measure(at).value[0]
    nodes = dome.net.grid.crossing_nodes
    one, other = (matrix_x(state.quaternions[nodes[:, k]]) for k in (0, 1))
    largest = np.arccos(np.clip((one * other).sum(axis=1), -1.0, 1.0)).max()
    assert 0.98 * largest <= turn <= 1.02 * largest + 0.1 * np.log(len(nodes)) / 200.0


def test_the_largest_deviation_is_that_of_the_farthest_node_and_has_no_slope_where_nothing_is_off(dome):
    still = LoadedDesign(dome, dome.design(), dome.target, np.zeros((dome.node_count, 6)))
    told = LargestDeviation("wet", 0.01).measure(still)
    assert told.value[0] == pytest.approx(0.01 * np.log(dome.node_count) / 200.0)
    assert not told.by_dof.toarray().any()
    step = np.zeros((dome.node_count, 6))
    step[7, :3], step[9, :3], step[4, 3:] = (0.02, 0.0, -0.01), (0.0, 0.01, 0.0), 0.3
    told = LargestDeviation("wet", 0.01).measure(replace(still, state=states.moved(dome.target, step)))
    assert told.value[0] == pytest.approx(np.hypot(0.02, 0.01), rel=1e-9)
    slope = np.zeros_like(step)
    slope[7, :3] = step[7, :3] / np.hypot(0.02, 0.01)
    np.testing.assert_allclose(told.by_dof.toarray().reshape(-1, 6), slope, atol=1e-9)


def matrix_x(quaternions):
    """The x axis of each frame."""
    w, x, y, z = quaternions.T
    return np.column_stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)])


def test_rest_lengths_go_from_a_centimetre_to_a_tenth_more_and_the_radius_from_a_quarter(dome):
    start = dome.design(rest_ratio=0.98)
    blocks = Blocks([sf.RestLengths(), sf.FreeRadius()], dome, start)
    lower, upper = blocks.value_bounds()
    cables = len(dome.cable_ends)
    np.testing.assert_allclose(lower, [*np.full(cables, 0.01), 0.25 * start.radius])
    np.testing.assert_allclose(upper, [*(1.1 * start.rest_length), start.radius])
    unit = np.array([*dome.cable_lengths, start.radius])
    np.testing.assert_allclose(blocks.unit, unit)
    np.testing.assert_allclose(np.array(blocks.bounds()), [lower / unit, upper / unit])
    np.testing.assert_allclose(blocks.of(start), [*np.full(cables, 0.98), 1.0])
    again = blocks.design(0.9 * blocks.of(start), start.present)
    np.testing.assert_allclose(again.rest_length, 0.9 * start.rest_length)
    assert again.radius == pytest.approx(0.9 * start.radius)
    assert blocks.step(start)[-1] == pytest.approx(0.1 * start.radius)
    assert (blocks.moves_radius, blocks.each_cable) == (True, slice(0, cables))
    only = Blocks([sf.RestLengths()], dome, start)
    assert (only.moves_radius, only.each_cable) == (False, slice(0, cables))
    given = sf.FreeRadius(0.0004, 0.002).bounds(dome, start)
    np.testing.assert_allclose(given, [[0.0004], [0.002]])


def test_a_radius_s_bounds_may_meet_and_not_cross(dome):
    start = dome.design()
    assert sf.FreeRadius(0.001, 0.001).bounds(dome, start)[0] == 0.001
    for least, most in ((0.0011, 0.001), (0.0, 0.001), (-0.001, 0.001)):
        with pytest.raises(InputError, match=r"variables\.radius"):
            sf.FreeRadius(least, most).bounds(dome, start)


def test_a_problem_uses_the_loads_of_its_terms_and_looks_at_the_largest(dome):
    wet = dome.point_load(2.0, every=2)
    cases = [sf.LoadCase(name, share * wet) for name, share in (("more", 1.2), ("idle", 3.0), ("less", 0.5))]
    shares = [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("less"))]
    limits = [sf.AtMost(20.0, sf.CableForces("wet")), sf.Between(1e-4, 0.005, sf.RmsMisfit("more"))]
    problem = sf.Problem(dome, sf.LoadCase("wet", wet), shares, limits, cases)
    assert problem.used() == ["wet", "more", "less"]
    assert problem.decisive_load() == "more"
    assert replace(problem, decisive="less").decisive_load() == "less"
    assert replace(problem, decisive="idle").decisive_load() == "more"
    cables = len(dome.cable_ends)
    assert problem.places() == [slice(0, cables), slice(cables, cables + 2)]
    for wrong in (0.2, 0.3 + 2e-9):
        with pytest.raises(InputError, match="must add up to 1"):
            replace(problem, minimise=[shares[0], sf.Share(wrong, sf.CableForce("less"))])
    replace(problem, minimise=[shares[0], sf.Share(0.3 + 5e-10, sf.CableForce("less"))])


@pytest.mark.parametrize(
    ("least", "most"), [(1.0, np.inf), (-np.inf, 1.0), (np.nan, 1.0), (2.0, 2.0), (3.0, 2.0)]
)
def test_limits_on_two_sides_are_finite_and_in_order(least, most):
    with pytest.raises(InputError, match="must lie below"):
        sf.Between(least, most, sf.RodRadius())


def test_a_limit_on_one_side_is_positive_or_says_of_what_its_violations_are_a_share():
    term = sf.RodRadius()
    for limit, of in ((0.0, None), (-1.0, None), (np.nan, 1.0), (np.inf, None), (1.0, 0.0), (1.0, -2.0)):
        for side in (sf.AtMost, sf.AtLeast):
            with pytest.raises(InputError, match="constraints"):
                side(limit, term, of)
    assert (sf.AtMost(-3.0, term, of=2.0).scale, sf.AtLeast(1e-9, term).scale) == (2.0, 1e-9)
    assert (sf.AtMost(3.0, term).lower, sf.AtLeast(3.0, term).upper) == (-np.inf, np.inf)


def test_limits_are_kept_in_the_values_unit_where_that_is_another_one():
    """Lengths for squares of lengths; stiffnesses for their squares with the sign."""
    rms, soft = sf.RmsMisfit("wet"), ModalStiffness("wet", 1.0)
    limit = sf.Between(0.003, 0.005, rms)
    assert (limit.lower, limit.upper, limit.scale) == pytest.approx((9e-6, 2.5e-5, 1.6e-5))
    assert (sf.AtMost(0.005, rms).upper, sf.AtMost(0.005, rms).scale) == pytest.approx((2.5e-5, 2.5e-5))
    assert [soft.at_limit(each) for each in (3.0, -3.0)] == [9.0, -9.0]


class Knob(Variable):
    """Two variables of the user's own, the second of which lengthens cable 1 by half as much and the rods'
    radius."""

    def __init__(self, unit=None, rates=None):
        self.own_unit, self.own_rates = unit, rates

    def size(self, shell):
        return 2

    def values(self, shell, design):
        return np.array([3.0, design.rest_length[1]])

    def applied(self, shell, design, values):
        return design

    def bounds(self, shell, start):
        return np.array([1.0, 2.0]), np.array([5.0, 10.0])

    def unit(self, shell, start):
        return super().unit(shell, start) if self.own_unit is None else self.own_unit

    def rates(self, shell, design):
        if self.own_rates is not None:
            return self.own_rates
        lengths = sp.lil_array((len(shell.cable_ends), 2))
        lengths[1, 1] = 0.5
        return Rates(sp.csc_array(lengths), np.array([0.0, 2.0]))


def test_variables_of_one_s_own_count_in_the_distance_of_their_bounds_and_step_by_a_tenth_of_it(dome):
    start = dome.design()
    blocks = Blocks([Knob()], dome, start)
    assert blocks.unit.tolist() == [4.0, 8.0]
    assert blocks.step(start).tolist() == pytest.approx([0.4, 0.8])
    assert np.array(blocks.bounds()).tolist() == [[0.25, 0.25], [1.25, 1.25]]
    assert (blocks.moves_radius, blocks.each_cable, blocks.size) == (True, None, 2)
    rates = blocks.rates(start).toarray()
    assert (rates[1].tolist(), rates[-1].tolist()) == ([0.0, 0.5], [0.0, 2.0])
    assert np.count_nonzero(rates) == 2


def test_blocks_that_change_the_same_cable_or_radius_or_have_no_units_are_refused(dome):
    start, cables = dome.design(), len(dome.cable_ends)
    for other in (sf.RestLengths(), sf.FreeRadius(), Knob()):
        with pytest.raises(InputError, match="two blocks change the same"):
            Blocks([Knob(), other], dome, start)
    for unit in ([1.0, 0.0], [1.0, -1.0], [np.inf, 1.0], [np.nan, 1.0], [1.0], [1.0, 1.0, 1.0]):
        with pytest.raises(InputError, match="positive unit"):
            Blocks([Knob(np.array(unit))], dome, start)
    for rates in (
        Rates(sp.csc_array((cables, 3))),
        Rates(sp.csc_array((cables + 1, 2))),
        Rates(radius=np.zeros(3)),
    ):
        with pytest.raises(InputError, match="rates must have the shapes"):
            Blocks([Knob(rates=rates)], dome, start)


def test_a_free_radius_has_bounds_in_metres_the_lower_below_the_upper_one(dome):
    start = dome.design()
    for wrong in ((0.002, 0.001), (-0.001, 0.001), (0.001, np.inf), (0.5, 2.0), (np.nan, 0.002)):
        with pytest.raises(
            InputError, match=r"variables\.radius: .*below 100 times.*Give metres, such as 0\.00025"
        ):
            sf.FreeRadius(*wrong).bounds(dome, start)
    assert [each.item() for each in sf.FreeRadius(0.0005, 0.05).bounds(dome, start)] == [0.0005, 0.05]


def test_rest_lengths_bounds_are_positive():
    for wrong in ({"least": 0.0}, {"most": 0.0}, {"least": -0.01}):
        with pytest.raises(InputError, match=r"variables\.rest_lengths"):
            sf.RestLengths(**wrong)


@pytest.mark.parametrize(
    "wrong",
    [
        {"value": np.zeros(3)},
        {"by_radius": np.zeros(1)},
        {"by_dof": sp.csr_array((2, 23))},
        {"by_rest_length": sp.csr_array((1, 5))},
    ],
)
def test_a_measurement_of_other_shapes_than_its_term_says_is_refused_by_name(wrong):
    """Of 2 values, 4 nodes and 5 cables."""
    right = {"value": np.array([1.0, 2.0])}
    whole = Measurement(**right).completed(2, 4, 5, "own")
    assert (whole.by_dof.shape, whole.by_rest_length.shape) == ((2, 24), (2, 5))
    assert whole.by_radius.tolist() == [0.0, 0.0]
    with pytest.raises(InputError) as told:
        Measurement(**{**right, **wrong}).completed(2, 4, 5, "own")
    assert told.value.where == f"own.{next(iter(wrong))}"


def test_load_cases_and_problems_that_cannot_be_meant_are_refused(dome):
    force = dome.point_load(2.0, every=2)
    with pytest.raises(InputError, match="needs a name"):
        sf.LoadCase("", force)
    wet, shares = sf.LoadCase("wet", force), [sf.Share(1.0, sf.Misfit("wet"))]
    for further, changes, said in (
        ([sf.LoadCase("wet", 1.2 * force)], {}, "the same name"),
        ([], {"decisive": "dry"}, "no load case 'dry'"),
        ([], {"built_under": ["wet", "dry"]}, "no load case 'dry'"),
        ([], {"constraints": [sf.AtMost(1.0, sf.Misfit("dry"))]}, "no load case 'dry'"),
        ([], {"variables": []}, "nothing is varied"),
    ):
        with pytest.raises(InputError, match=said):
            sf.Problem(dome, wet, shares, further=further, **changes)
    found = sf.Problem(
        dome, wet, [*shares[:0], sf.Share(0.4, sf.RodRadius()), sf.Share(0.6, sf.Misfit("wet"))]
    )
    assert found.column(sf.RodRadius()) == "rod_radius"
    assert (found.column(sf.Misfit("wet")), found.column(sf.Misfit("wetter"))) == ("misfit", "misfit.wetter")
    with pytest.raises(InputError, match="minimise"):
        sf.Share(0.0, sf.RodRadius())
