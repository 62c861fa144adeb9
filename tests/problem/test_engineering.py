"""The engineer's limits against re-solved neighbours."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.problem import engineering
from shellform.problem.engineering import (
    SHARPNESS,
    ConnectorTurn,
    LargestCableForce,
    LargestDeviation,
    LeastTension,
    ModalStiffness,
    RodUtilisation,
    Thrust,
    Uplift,
    _smooth,
)
from shellform.problem.evaluation import Evaluator
from shellform.problem.terms import LoadedDesign
from shellform.structure.elements.state import moved


@pytest.fixture(scope="module")
def wet(shell):
    return shell.point_load(3.0, every=2)


def smooth_largest(values, sharpness):
    """Kreisselmeier and Steinhauser's."""
    return np.log(np.exp(sharpness * (values - values.max())).sum()) / sharpness + values.max()


def test_the_smooth_largest_of_three_values_and_its_derivatives_by_hand():
    """e^0, e^-1 and e^-3 over their sum; 1.4177 above the largest over the sharpness."""
    shares = np.exp([-1.0, 0.0, -3.0])
    weight, value = _smooth(np.array([4.5, 5.0, 3.5]), 2.0)
    assert weight == pytest.approx(shares / shares.sum())
    assert value == pytest.approx(5.0 + np.log(shares.sum()) / 2.0)
    assert _smooth(np.array([-7.0]), 2.0)[1] == -7.0


def limited(shell, wet, term):
    shares = [sf.Share(0.6, sf.Misfit("wet")), sf.Share(0.4, sf.RodRadius())]
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        shares,
        [sf.AtMost(1.0, term)],
        variables=[sf.RestLengths(), sf.FreeRadius(0.0005, 0.0014)],
    )


@pytest.mark.parametrize(
    "name",
    ["stress", "deviation", "connectors", "cables", "least tension", "uplift", "thrust", "modal stiffness"],
)
def test_the_gradient_of_each_limit_agrees_with_re_solved_equilibria(shell, wet, name):
    term = {
        "stress": RodUtilisation("wet"),
        "deviation": LargestDeviation("wet", 0.005),
        "connectors": ConnectorTurn("wet"),
        "cables": LargestCableForce("wet", 5.0),
        "least tension": LeastTension("wet", 0.5),
        "uplift": Uplift("wet", 2.0),
        "thrust": Thrust("wet", 5.0),
        "modal stiffness": ModalStiffness("wet", 1.0),
    }[name]
    evaluator = Evaluator(limited(shell, wet, term), shell.design())
    states = {key: loaded.equilibrium.state for key, loaded in evaluator.begin().items()}
    point = evaluator.linearised(evaluator.seed(shell.design(), states, 1.0))
    rng = np.random.default_rng(3)
    direction = np.append(rng.normal(size=len(point.variables) - 1), 0.7)
    slopes = []  # central differences at two steps, whose error falls with the square of the step
    for step in (2e-5, 1e-5):
        designs = [
            evaluator.blocks.design(point.variables + s * step * direction, point.design.present)
            for s in (1, -1)
        ]
        plus, minus = (evaluator.evaluate(each, states, 1.0) for each in designs)
        slopes.append((plus.constraints[0] - minus.constraints[0]) / (2 * step))
    # Extrapolated to a step of 0, what is left is the gradient's own error.
    best = (4.0 * slopes[1] - slopes[0]) / 3.0
    assert point.constraints_by_variables[0] @ direction == pytest.approx(best, rel=1e-5)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_slope_of_the_largest_turn_is_1_along_the_turn_whichever_way_it_goes(dome, way):
    nodes = dome.net.grid.crossing_nodes[7]
    axis = np.diff(dome.target.positions[nodes], axis=0)[0]
    spin = np.zeros((dome.node_count, 6))
    spin[nodes[1], 3:] = way * axis / np.linalg.norm(axis)
    turned = LoadedDesign(dome, dome.design(), moved(dome.target, 0.9 * spin), np.zeros_like(spin))
    told = ConnectorTurn("wet").measure(turned)
    assert 0.5 < told.value[0] < 1.3, "more than others are turned in the net"
    assert (told.by_dof @ spin.ravel())[0] == pytest.approx(1.0, rel=0.05)


def test_the_smooth_maximum_is_never_below_the_largest_and_little_above(shell, wet):
    evaluator = Evaluator(limited(shell, wet, RodUtilisation("wet")), shell.design())
    state = evaluator.begin()["wet"].equilibrium.state
    design = shell.design()
    told = RodUtilisation("wet").measure(LoadedDesign(shell, design, state, wet)).value[0]
    beams = shell.beams(design.radius)
    forces = beams.local_forces(state)[beams.of_kind("rod")]
    inertia = 0.25 * np.pi * design.radius**4
    stress = [
        np.abs(forces[:, 0]) / (np.pi * design.radius**2)
        + np.hypot(forces[:, 2 + e], forces[:, 3 + e]) * design.radius / inertia
        for e in (0, 3)
    ]
    largest = np.max(stress) / shell.rod.strength
    assert largest <= told <= largest + np.log(2 * len(forces)) / SHARPNESS


def test_of_many_ends_used_to_the_full_the_smooth_maximum_is_a_twenty_fifth_too_high():
    assert np.log(3000) / SHARPNESS == pytest.approx(0.04, abs=1e-3)


def test_supports_that_would_lift_are_told_with_their_force(shell, wet):
    evaluator = Evaluator(limited(shell, wet, Uplift("wet", 2.0)), shell.design())
    state = evaluator.begin()["wet"].equilibrium.state
    told = Uplift("wet", 2.0).measure(LoadedDesign(shell, shell.design(), state, wet)).value[0]
    assembly = evaluator.assembly(shell.design())
    reaction = (assembly.evaluate(state, tangent=False).force - wet)[shell.net.supports, 2]
    assert reaction.sum() == pytest.approx(-wet[:, 2].sum(), rel=1e-6)
    assert -reaction.min() <= told <= -reaction.min() + 2.0 * np.log(len(reaction)) / SHARPNESS


def test_a_term_is_the_same_on_an_assembly_at_hand_as_on_one_of_its_own(shell, wet):
    evaluator = Evaluator(limited(shell, wet, ModalStiffness("wet", 1.0)), shell.design())
    state, design = evaluator.begin()["wet"].equilibrium.state, shell.design()
    for term in (ModalStiffness("wet", 1.0), Uplift("wet", 2.0), RodUtilisation("wet")):
        alone = term.measure(LoadedDesign(shell, design, state, wet))
        there = term.measure(LoadedDesign(shell, design, state, wet, evaluator.assembly(design)))
        assert there.value.tobytes() == alone.value.tobytes()
        assert there.whole().value.tobytes() == alone.whole().value.tobytes() == alone.value.tobytes()
        assert there.whole().by_dof.toarray().tobytes() == alone.whole().by_dof.toarray().tobytes()


def test_beams_are_made_once_for_a_radius_and_anew_for_another(shell):
    radius = shell.rod.radius
    made = shell.beams(radius)
    assert shell.beams(radius) is made
    thicker = shell.beams(1.1 * radius)
    assert (thicker.axial > made.axial).any()
    for k in range(20):
        shell.beams((1.2 + 0.01 * k) * radius)
    assert shell.beams(radius).axial.tobytes() == made.axial.tobytes()


def test_limits_that_make_no_sense_are_refused(shell, wet):
    with pytest.raises(InputError, match=r"least_tension\.scale"):
        LeastTension("wet", 0.0)
    for far in (0.0, np.nan, 105):
        with pytest.raises(InputError, match=r"least_tension\.let_out: must be.*such as 1\.05"):
            LeastTension("wet", 0.5, let_out=far)
    with pytest.raises(InputError, match=r"largest_cable_force\.scale"):
        LargestCableForce("wet", 0.0)
    with pytest.raises(InputError, match=r"largest_deviation\.scale"):
        LargestDeviation("wet", 0.0)
    with pytest.raises(InputError, match=r"modal_stiffness\.scale"):
        ModalStiffness("wet", -1.0)
    with pytest.raises(InputError, match=r"uplift\.scale"):
        Uplift("wet", 0.0)
    with pytest.raises(InputError, match=r"thrust\.scale"):
        Thrust("wet", 0.0)
    hung = dataclasses.replace(shell, cable_ends=np.array([shell.net.supports[:2]]))
    for term in (Uplift("wet"), Thrust("wet")):
        with pytest.raises(InputError, match=rf"{term.name}: isn't known where cables end at supports"):
            term.measure(LoadedDesign(hung, hung.design(), hung.target, wet))
    unknown = dataclasses.replace(shell, rod=sf.Rod.round(young=40e9, radius=0.001))
    state = shell.target
    with pytest.raises(InputError, match="strength"):
        RodUtilisation("wet").measure(LoadedDesign(unknown, shell.design(), state, wet))


def test_the_largest_cable_force_is_told_little_above_and_cables_let_out_are_not_slack(shell, wet):
    design = shell.design()
    state = (
        Evaluator(limited(shell, wet, LargestCableForce("wet", 5.0)), design).begin()["wet"].equilibrium.state
    )
    pull = shell.cables(design).tension(state)
    told = LargestCableForce("wet", 5.0).measure(LoadedDesign(shell, design, state, wet)).value[0]
    assert pull.max() <= told <= pull.max() + 5.0 * np.log(len(pull)) / SHARPNESS
    lengths = design.rest_length.copy()
    lengths[7] = 1.08 * shell.cable_lengths[7]
    loose = dataclasses.replace(design, rest_length=lengths)
    assert LeastTension("wet", 0.5).measure(LoadedDesign(shell, loose, state, wet)).value[0] < -4.0
    others = LeastTension("wet", 0.5, let_out=1.05).measure(LoadedDesign(shell, loose, state, wet)).value[0]
    least = LeastTension("wet", 0.5).measure(LoadedDesign(shell, design, state, wet)).value[0]
    assert others >= least - 1e-12
    assert pull.min() - 0.5 * np.log(len(pull)) / 10.0 <= least <= pull.min()
    assert (pull > 0.0).all()
    assert told == pytest.approx(smooth_largest(pull, 200.0 / 5.0), rel=1e-9)
    assert least == pytest.approx(-smooth_largest(-pull, 10.0 / 0.5), rel=1e-9)
    none = shell.unbraced()
    assert LargestCableForce("wet", 5.0).measure(LoadedDesign(shell, none, state, wet)).value[0] == 0.0
    assert LeastTension("wet", 0.5).measure(LoadedDesign(shell, none, state, wet)).value[0] == 1.0


def test_the_softest_modes_count_by_the_squares_of_their_stiffness_with_its_sign(monkeypatch):
    """In the square of the scale: a mode at 3 N/m beside one at 2 N/m counts for little on a scale of 2."""
    stiffness = np.array([2.0, 2.1, 3.0, -0.5])
    monkeypatch.setattr(
        engineering, "modes", lambda *_: SimpleNamespace(stiffness=stiffness, shapes=np.ones((4, 2, 6)))
    )
    monkeypatch.setattr(
        engineering.residual, "ResidualNorm", lambda _: SimpleNamespace(mass_shape=np.ones(12))
    )
    at = LoadedDesign(None, None, None, None, SimpleNamespace(free=np.arange(12)))
    for last, scale in ((-0.5, 2.0), (2.0, 2.0), (2.0, 20.0)):
        stiffness[3] = last
        squares = stiffness * np.abs(stiffness)
        value = ModalStiffness("wet", scale).measure(at).value
        assert value == pytest.approx([-smooth_largest(-squares, 200.0 / scale**2)])
    assert value[0] < 4.0 - 0.5, "on a large scale they aren't told apart"
