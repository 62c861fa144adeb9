"""The design problem on the paper-scale vault: gradients, tension model, optimum."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.optimiser.convex import minimise
from shellform.optimiser.optimise import begin
from shellform.optimiser.proposal import propose
from shellform.optimiser.solver import SequentialConvex
from shellform.optimiser.trials import attempt, task
from shellform.problem.evaluation import Evaluator
from shellform.problem.paths import in_tension
from shellform.structure.answers.sensitivity import adjoint, by_rest_length, direct, respond
from shellform.structure.answers.stability import modes

TWELVE = [(np.cos(k * np.pi / 6), np.sin(k * np.pi / 6)) for k in range(12)]


def round_opening(x, y, radius):
    return [[x + radius * c, y + radius * s] for c, s in TWELVE]


@pytest.fixture(scope="module")
def wet(shell):
    openings = [
        round_opening(0.47, 0.0, 0.132),
        round_opening(-0.47, -0.02, 0.132),
        round_opening(0.02, 0.29, 0.152),
        round_opening(-0.05, -0.29, 0.152),
    ]
    return shell.point_load(6.9, every=2, openings=openings)


def problem(shell, wet, *, radius=False):
    shares = [
        sf.Share(0.6 if radius else 0.7, sf.Misfit("wet")),
        sf.Share(0.2 if radius else 0.3, sf.CableForce("wet")),
    ]
    if radius:
        shares.append(sf.Share(0.2, sf.RodRadius()))
    limits = [sf.AtMost(20.0, sf.CableForces("wet")), sf.AtMost(0.005, sf.RmsMisfit("wetter"))]
    variables = [sf.RestLengths(), sf.FreeRadius(0.0005, 0.0014)] if radius else [sf.RestLengths()]
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        shares,
        limits,
        further=[sf.LoadCase("wetter", 1.1 * wet)],
        variables=variables,
    )


def searched(asked, start, window, kept):
    """The beginning of a search whose softest modes keep a share `kept` of some mode's stiffness, N/m."""
    return begin(asked, start, SequentialConvex(window=window), kept, 100)


def test_gradients_of_objective_and_constraints_agree_with_re_solved_equilibria(shell, wet):
    evaluator = Evaluator(problem(shell, wet, radius=True), shell.design())
    reached = evaluator.begin()
    states = {name: loaded.equilibrium.state for name, loaded in reached.items()}
    point = evaluator.linearised(evaluator.seed(shell.design(), states, 1.0))
    rng = np.random.default_rng(0)
    direction = 1e-5 * rng.normal(size=len(point.variables))
    at = evaluator.blocks.design
    every = shell.design().present
    plus, minus = (
        evaluator.evaluate(at(point.variables + s * direction, every), states, 1.0) for s in (1, -1)
    )
    slope = (plus.objective - minus.objective) / 2
    assert point.objective_by_variables @ direction == pytest.approx(slope, rel=1e-5)
    slopes = (plus.constraints - minus.constraints) / 2
    predicted = point.constraints_by_variables @ direction
    np.testing.assert_allclose(predicted, slopes, atol=1e-5 * np.abs(slopes).max())
    only_radius = np.zeros(len(point.variables))
    only_radius[-1] = 1e-5
    plus, minus = (
        evaluator.evaluate(at(point.variables + s * only_radius, every), states, 1.0) for s in (1, -1)
    )
    assert point.objective_by_variables @ only_radius == pytest.approx(
        (plus.objective - minus.objective) / 2, rel=1e-5
    )


def test_a_change_of_rest_lengths_and_radius_is_predicted_to_second_order(dome):
    load = dome.point_load(3.0, every=2)
    evaluator = Evaluator(problem(dome, load, radius=True), dome.design())
    states = {name: loaded.equilibrium.state for name, loaded in evaluator.begin().items()}
    point = evaluator.seed(dome.design(), states, 1.0)
    shorter = 0.001 * np.random.default_rng(5).normal(size=len(dome.cable_ends))
    errors = []
    for size in (1.0, 0.5):
        rest = (1.0 + size * shorter) * point.design.rest_length
        design = replace(point.design, rest_length=rest, radius=(1.0 + 0.02 * size) * point.design.radius)
        near = evaluator.predicted(point, design, but="wetter")
        assert set(near) == {"wet"}
        found = evaluator._settled(evaluator.assembly(design), near["wet"], load).state
        errors.append(np.abs(found.positions - near["wet"].positions).max())
    assert errors[0] > 1e-7
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_direct_and_adjoint_sensitivities_are_the_same(shell, wet):
    evaluator = Evaluator(problem(shell, wet), shell.design())
    state = evaluator.begin()["wet"].equilibrium.state
    design = shell.design()
    assembly = evaluator.assembly(design)
    response = respond(assembly, state, by_rest_length(assembly, state, shell.cables(design)))
    rows = np.random.default_rng(1).normal(size=(3, response.force_by_design.shape[0]))
    one, other = direct(response, rows), adjoint(response, rows)
    np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(one).max())


def test_the_tension_model_predicts_the_next_equilibrium_to_second_order(shell, wet):
    search, it = searched(problem(shell, wet), shell.design(), 0.2, lambda softest: 0.0)
    model = search.models.at(it.point)
    rng = np.random.default_rng(2)
    change = np.where(model.origin > 0.5, 0.05 * rng.normal(size=len(model.origin)), 0.0)
    errors = []
    for size in (1.0, 0.5):
        y = model.origin + size * change
        design = model.design(y)
        found = search.evaluator._settled(search.evaluator.assembly(design), model.predicted(y), wet).state
        tension = shell.cables(design).tension(found)
        errors.append(np.abs(tension - y).max())
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_no_candidate_cable_ends_at_a_support_or_rises_above_the_surface(shell, vault):
    from shellform.surface.shape.locate import Locator

    assert not np.isin(shell.cable_ends, shell.net.supports).any()
    place = shell.target.positions[shell.cable_ends]
    assert (Locator(vault).foot(place.mean(axis=1)).distance <= 0.0).all()


def test_a_short_optimisation_improves_the_fit_and_keeps_every_limit(shell, wet):
    best = sf.optimise(
        problem(shell, wet), shell.design(), solver=sf.SequentialConvex(thin=False), evaluations=6
    )
    assert best.objective < 0.5
    assert max(best.constraints.values()) <= sf.FEASIBLE
    assert all(each.on_branch and each.equilibrium.stable for each in best.loaded.values())
    assert in_tension(shell, best.design, best.states["wet"]).sum() == best.design.present.sum()


def test_svanberg_s_two_bar_truss_is_solved_to_its_published_optimum():
    # Svanberg 1987: minimise x1 sqrt(1 + x2²) with two stress limits; f = 1.5086525 at (1.4116311,
    # 0.3770724).
    def evaluate(x):
        area, half = x
        root = np.sqrt(1 + half**2)
        value, slope = area * root, np.array([root, area * half / root])
        limits, slopes = [], []
        for sign in (1, -1):
            part = 8 / area + sign / (area * half)
            limits.append(0.124 * root * part - 1)
            by_area = 0.124 * root * (-8 / area**2 - sign / (area**2 * half))
            by_half = 0.124 * half / root * part + 0.124 * root * (-sign / (area * half**2))
            slopes.append([by_area, by_half])
        return value, slope, np.array(limits), np.array(slopes)

    best, _ = minimise(
        evaluate,
        np.array([1.5, 0.5]),
        np.array([0.2, 0.1]),
        np.array([4.0, 1.6]),
        constraints=2,
        evaluations=200,
        tolerance=1e-12,
    )
    np.testing.assert_allclose(best, [1.4116311, 0.3770724], atol=2e-5)
    assert evaluate(best)[0] == pytest.approx(1.5086525, abs=1e-5)


def test_svanberg_s_cantilever_is_solved_to_its_published_optimum():
    # Svanberg 1987: minimise 0.0624 sum(x) with sum(c / x³) <= 1; f = 1.3399564.
    share = np.array([61.0, 37.0, 19.0, 7.0, 1.0])

    def evaluate(x):
        limit = np.array([(share / x**3).sum() - 1.0])
        return 0.0624 * x.sum(), np.full(5, 0.0624), limit, (-3.0 * share / x**4)[None]

    best, _ = minimise(
        evaluate,
        np.full(5, 5.0),
        np.full(5, 1.0),
        np.full(5, 10.0),
        constraints=1,
        evaluations=500,
        tolerance=1e-12,
    )
    np.testing.assert_allclose(best, [6.0160, 5.3092, 4.4943, 3.5015, 2.1527], atol=2e-3)
    assert evaluate(best)[0] == pytest.approx(1.3399564, abs=2e-6)


def test_a_start_outside_the_bounds_is_refused():
    with pytest.raises(InputError, match="outside the bounds"):
        minimise(
            lambda x: (0.0, x, x, x), np.zeros(1), np.ones(1), 2 * np.ones(1), constraints=0, evaluations=1
        )


def test_a_start_that_does_not_carry_the_design_load_is_told_the_paper_s_advice(shell, wet):
    with pytest.raises(NotConverged, match="denser grid"):
        sf.optimise(problem(shell, 3.0 * wet), shell.design(), evaluations=3)


def test_bad_rods_joints_cables_and_loads_are_refused(shell, net, vault):
    with pytest.raises(InputError, match="positive"):
        sf.Rod.round(young=-1.0, radius=0.001)
    with pytest.raises(InputError, match="positive"):
        sf.Joint(axial=0.0, torsion=1.0, bending=1.0, gap=0.1)
    with pytest.raises(InputError, match="finite"):
        sf.Cable(stiffness=float("nan"))
    thick = sf.Rod.round(young=40e9, radius=0.01, strength=255e6)
    with pytest.raises(InputError, match="they break"):
        sf.brace(net, thick, shell.joint, shell.cable, below=vault)
    other = sf.Joint(axial=1.0, torsion=1.0, bending=1.0, gap=0.003)
    with pytest.raises(InputError, match="gap"):
        sf.brace(net, shell.rod, other, shell.cable, below=vault)
    with pytest.raises(InputError, match="no crossing is loaded"):
        shell.point_load(1.0, openings=[[[-9, -9], [9, -9], [9, 9], [-9, 9]]])
    with pytest.raises(InputError, match="add up to 1"):
        sf.Problem(shell, sf.LoadCase("a", np.zeros((1, 6))), [sf.Share(0.5, sf.Misfit("a"))])
    with pytest.raises(InputError, match="no load case"):
        sf.Problem(shell, sf.LoadCase("a", np.zeros((1, 6))), [sf.Share(1.0, sf.Misfit("b"))])
    with pytest.raises(InputError, match="same name"):
        sf.Problem(
            shell,
            sf.LoadCase("a", np.zeros((1, 6))),
            [sf.Share(1.0, sf.Misfit("a"))],
            further=[sf.LoadCase("a", np.ones((1, 6)))],
        )
    with pytest.raises(InputError, match="nothing is varied"):
        sf.Problem(shell, sf.LoadCase("a", np.zeros((1, 6))), [sf.Share(1.0, sf.Misfit("a"))], variables=[])
    with pytest.raises(InputError, match="needs a name"):
        sf.LoadCase("", np.zeros((1, 6)))


def test_a_load_case_keeps_a_copy_of_forces_that_can_be_and_has_a_row_for_each_node(shell):
    force = shell.point_load(1.0)
    case = sf.LoadCase("wet", force)
    force *= 2.0
    assert case.force == pytest.approx(shell.point_load(1.0))
    assert not case.force.flags.writeable
    assert len(repr(case)) < 60
    with pytest.raises(InputError, match=r"load case 'wet': force\(0, 0\) is not finite"):
        sf.LoadCase("wet", np.full_like(force, np.nan))
    with pytest.raises(InputError, match=r"load case 'wet': force has the wrong shape.*\(any, 6\)"):
        sf.LoadCase("wet", force[:, :3])
    for wrong in (force[:1], force[:5]):
        with pytest.raises(InputError, match=r"loads\['wet'\] has the wrong shape"):
            sf.follow(shell, shell.design(), {"wet": wrong})
        problem = sf.Problem(shell, sf.LoadCase("wet", wrong), [sf.Share(1.0, sf.Misfit("wet"))])
        with pytest.raises(InputError, match=r"loads\['wet'\] has the wrong shape"):
            sf.optimise(problem, shell.design(), evaluations=1)


def test_which_cables_a_design_has_is_told_by_flags_and_kept_as_a_copy(shell):
    present = np.ones(len(shell.cable_ends), dtype=bool)
    design = sf.Design(0.99 * shell.cable_lengths, present, 0.001)
    present[:] = False
    assert design.present.all()
    assert not design.present.flags.writeable
    with pytest.raises(InputError, match="present must be true or false"):
        sf.Design(0.99 * shell.cable_lengths, present.astype(int), 0.001)  # would be numbers of cables
    assert (
        sf.Design(0.99 * shell.cable_lengths, design.present.tolist(), 0.001).present == design.present
    ).all()


@pytest.mark.parametrize(
    "window", [0.2, 0.3]
)  # in the larger one eleven cables die, which leap in their rest lengths
def test_a_step_keeps_the_distance_from_a_limit_that_the_last_trial_asked_for(shell, wet, window):
    search, it = searched(problem(shell, wet), shell.design(), window, lambda softest: 0.0)
    under = search.evaluator.assembly(it.point.design)
    softest = float(modes(under, it.point.states["wetter"], 1).stiffness[0])
    search, it = searched(problem(shell, wet), shell.design(), window, lambda _: 0.9 * softest)
    model = search.models.at(it.point)
    first, it = attempt(search, it, model, propose(task(search, it, model))[0])
    again, it = attempt(search, it, model, propose(task(search, it, model))[0])
    assert first.constraints.max() > 0.1  # the linear model of the softest mode said 0 at most
    # What eleven cables that die leave of it depends on the last bits: 5 to 13 % were seen.
    assert -0.2 < again.constraints.max() < 0.2 * first.constraints.max()
