"""A user's own term and variable, through public names only."""

from collections import Counter
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy.sparse as sp

import shellform as sf
from shellform.optimiser.optimise import begin
from shellform.problem.evaluation import Evaluator
from shellform.problem.terms import LoadedDesign, measured


@dataclass(frozen=True)
class Sag(sf.Term):  # how far each of some nodes lies below the target, m
    name = "sag"
    load: str
    nodes: tuple[int, ...]

    def size(self, shell):
        return len(self.nodes)

    def measure(self, at):
        nodes, rows = list(self.nodes), sp.lil_array((len(self.nodes), 6 * len(at.state.positions)))
        rows[np.arange(len(nodes)), 6 * np.array(nodes) + 2] = -1.0
        drop = at.shell.target.positions[nodes, 2] - at.state.positions[nodes, 2]
        return sf.Measurement(drop, by_dof=sp.csr_array(rows))


@dataclass(frozen=True)
class Ratios(sf.Variable):  # one rest length over target length for the cables of each quadrant
    def quadrant(self, shell):
        x, y = shell.target.positions[shell.cable_ends].mean(axis=1).T[:2]
        return (x > 0.0) + 2 * (y > 0.0)

    def size(self, shell):
        return 4

    def values(self, shell, design):
        ratio = design.rest_length / shell.cable_lengths
        return np.bincount(self.quadrant(shell), ratio, 4) / np.bincount(self.quadrant(shell), minlength=4)

    def applied(self, shell, design, values):
        return replace(design, rest_length=values[self.quadrant(shell)] * shell.cable_lengths)

    def bounds(self, shell, start):
        return np.full(4, 0.97), np.full(4, 1.01)

    def rates(self, shell, design):
        rows, quadrant = np.arange(len(shell.cable_ends)), self.quadrant(shell)
        return sf.Rates(
            rest_length=sp.csc_array((shell.cable_lengths, (rows, quadrant)), shape=(len(rows), 4))
        )


def problem(shell, *constraints, variables, minimise=None):
    wet = shell.point_load(1.0)
    shares = minimise or [sf.Share(1.0, sf.Misfit("wet"))]
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        shares,
        constraints,
        [sf.LoadCase("wetter", 1.2 * wet)],
        variables,
    )


def lowest(shell, count=3):
    design = shell.design()
    state = sf.follow(shell, design, {"wet": shell.point_load(1.0)})["wet"].equilibrium.state
    drop = shell.target.positions[:, 2] - state.positions[:, 2]
    nodes = np.argsort(-drop)[:count]
    return tuple(int(each) for each in nodes), drop[nodes]


def assert_taylor(asked, start):
    """Value and derivatives of every residual and of the objective along a random direction: what is left
    over falls with the square of the step."""
    plain = sf.comparison.Plain(asked, start)
    lower, upper = plain.bounds()
    step = 2e-4 * (upper - lower) * np.random.default_rng(1).normal(size=len(plain.start))
    slope, slopes = plain.gradient(plain.start), plain.jacobian(plain.start)
    left = []
    for size in (1.0, 0.5):
        there = plain.start + size * step
        gone = [plain.value(there) - plain.value(plain.start) - size * slope @ step]
        gone += list(plain.constraints(there) - plain.constraints(plain.start) - size * slopes @ step)
        left.append(np.linalg.norm(gone))
    assert 1.9 < np.log2(left[0] / left[1]) < 2.1
    assert left[0] < 0.05 * np.linalg.norm([slope @ step, *(slopes @ step)])


def test_a_user_s_vector_term_and_variable_improve_a_gridshell_and_their_limits_are_kept(coarse):
    nodes, drop = lowest(coarse)
    limit = sf.AtMost(0.85 * float(drop.max()), Sag("wet", nodes))
    asked = problem(coarse, limit, sf.AtMost(4.0, sf.CableForces("wet")), variables=[Ratios()])
    start = coarse.design()
    assert_taylor(asked, start)
    best = sf.optimise(asked, start, evaluations=20)
    assert best.objective < 0.95
    assert max(best.constraints.values()) <= sf.FEASIBLE
    assert best.constraints.keys() >= {"sag", "cable_force"}
    ratio = best.design.rest_length / coarse.cable_lengths
    assert len(np.unique(np.round(ratio, 12))) <= 4


def test_a_step_s_model_predicts_where_a_user_s_variable_leads_to_first_order(coarse):
    asked = problem(coarse, variables=[Ratios()])
    search, it = begin(asked, coarse.design(), sf.SequentialConvex(), lambda softest: 0.0, 10)
    model = search.models.at(it.point)
    way, left = np.array([1.0, -0.4, 0.7, 0.2]), []
    for size in (2e-4, 1e-4):
        y = model.origin + size * way
        there = sf.follow(coarse, model.design(y), {"wet": asked.loads["wet"]})["wet"].equilibrium.state
        left.append(np.abs(there.positions - model.predicted(y).positions).max())
        went = np.abs(there.positions - it.point.states["wet"].positions).max()
    assert left[1] < 0.1 * went
    assert left[1] < 0.35 * left[0]


def test_a_user_s_vector_term_is_limited_from_below_and_minimised_beside_the_cables_own_lengths(coarse):
    nodes, drop = lowest(coarse)
    sag = Sag("wet", nodes)
    shares = [sf.Share(0.5, sf.Misfit("wet")), sf.Share(0.5, sag)]
    variables = [sf.RestLengths(), sf.FreeRadius(0.0008, 0.0012)]
    bounds = sf.Between(0.1 * float(drop.min()), 2.0 * float(drop.max()), sag)
    asked = problem(coarse, bounds, variables=variables, minimise=shares)
    assert asked.places() == [slice(0, 6)]
    assert_taylor(asked, coarse.design())
    best = sf.optimise(asked, coarse.design(), evaluations=15, solver=sf.SequentialConvex(thin=False))
    assert best.objective < 0.6
    assert best.constraints["sag"] <= sf.FEASIBLE
    state = best.states["wet"]
    sunk = (coarse.target.positions - state.positions)[list(nodes), 2]
    assert sunk.min() >= 0.1 * drop.min() - sf.FEASIBLE * bounds.scale


@dataclass(frozen=True)
class Wrong(Sag):
    def size(self, shell):
        return 1


@dataclass(frozen=True)
class Askew(Ratios):
    def rates(self, shell, design):
        return sf.Rates(radius=np.ones(3))


@dataclass(frozen=True)
class InUnits(Ratios):
    units: tuple[float, ...]

    def unit(self, shell, start):
        return np.array(self.units)


@pytest.mark.parametrize("units", [(1.0, 1.0), (1.0, 1.0, 1.0, 0.0), (1.0, 1.0, np.inf, 1.0)])
def test_a_variable_without_a_positive_unit_for_each_of_its_values_is_refused(coarse, units):
    asked = problem(coarse, variables=[InUnits(units)])
    with pytest.raises(sf.InputError, match="each needs a positive unit"):
        sf.optimise(asked, coarse.design(), evaluations=1)


def test_a_term_or_variable_whose_shapes_are_not_those_that_it_says_is_refused(coarse):
    start = coarse.design()
    wrong = problem(coarse, sf.AtMost(1.0, Wrong("wet", (1, 2))), variables=[sf.RestLengths()])
    with pytest.raises(sf.InputError, match=r"sag\.value"):
        sf.optimise(wrong, start, evaluations=1)
    with pytest.raises(sf.InputError, match="rates must have the shapes"):
        sf.optimise(problem(coarse, variables=[Askew()]), start, evaluations=1)
    with pytest.raises(sf.InputError, match="two blocks change the same cable"):
        sf.optimise(problem(coarse, variables=[sf.RestLengths(), Ratios()]), start, evaluations=1)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: sf.AtMost(0.0, sf.RodRadius()), "must be positive"),
        (lambda: sf.AtLeast(np.inf, sf.RodRadius()), "must be finite"),
        (lambda: sf.AtLeast(0.0, sf.RodRadius(), of=-1.0), "positive and finite"),
        (lambda: sf.Between(2.0, 1.0, sf.RodRadius()), "must lie below"),
        (lambda: sf.RestLengths(least=0.0), "must be positive"),
        (lambda: sf.SequentialConvex(window=0.0), r"solver\.window"),
        (lambda: sf.SequentialConvex(stiffness=-1.0), r"solver\.stiffness"),
        (lambda: sf.SequentialConvex(shrink=1.5), "must shrink"),
        (lambda: sf.SequentialConvex(batch=2.5), r"solver\.batch: must be a whole number"),
        (lambda: sf.SequentialConvex(most_cables=40.0), r"solver\.most_cables: must be a whole number"),
        (lambda: sf.MovingAsymptotes(stage=8.0), r"solver\.stage: must be a whole number"),
        (lambda: sf.SequentialConvex(allowance=8.0), r"solver\.allowance: .* For 8 % write 0\.08\.$"),
        (lambda: sf.SequentialConvex(idle=20.0), r"solver\.idle: .* For 20 % write 0\.2\.$"),
        (lambda: sf.RestLengths(most=110.0), r"rest_lengths\.most: .* For 110 % write 1\.1\.$"),
        (lambda: sf.AtMost(97.0, sf.RodUtilisation("wet")), r"^constraints: .* For 97 % write 0\.97\.$"),
        (lambda: sf.AtLeast(120.0, sf.RodUtilisation("wet")), r"^constraints: .* For 120 % write 1\.2\.$"),
        (lambda: sf.Between(1.0, 97.0, sf.RodUtilisation("wet")), r"For 97 % write 0\.97\.$"),
        (lambda: sf.AtMost(23.0, sf.ConnectorTurn("wet")), r"^constraints: 23 rad .*write 0\.401\.$"),
        (lambda: sf.Between(1.0, 90.0, sf.ConnectorTurn("wet")), r"^constraints: 90 rad .*write 1\.57\.$"),
        (lambda: sf.Safety(sf.Tolerances(), probability_design=99.0), r"For 99 % write 0\.99\.$"),
        (lambda: sf.Safety(sf.Tolerances(), critical_factor=125.0), r"For 125 % write 1\.25\.$"),
        (lambda: sf.Safety(sf.Tolerances(), stiffness=50.0), r"For 50 % write 0\.5\.$"),
        (lambda: sf.Tolerances(rod_stiffness=3.0), r"For 3 % write 0\.03\.$"),
    ],
)
def test_limits_bounds_and_settings_that_make_no_sense_are_refused(make, said):
    with pytest.raises(sf.InputError, match=said):
        make()


def test_limits_that_may_be_meant_are_taken():
    assert sf.AtMost(2.0, sf.RodUtilisation("wet")).upper == 2.0
    assert sf.AtMost(1.57, sf.ConnectorTurn("wet")).upper == 1.57
    assert sf.Safety(sf.Tolerances(), critical_factor=20.0).critical_factor == 20.0


@pytest.mark.parametrize(
    ("ask", "where"),
    [
        (lambda count: sf.optimise(None, None, evaluations=count), "evaluations"),
        (
            lambda count: sf.optimise(None, None, solver=sf.MovingAsymptotes(), evaluations=count),
            "evaluations",
        ),
        (lambda count: sf.polish(None, evaluations=count), "evaluations"),
        (lambda count: sf.comparison.compare(None, None, evaluations=count), "evaluations"),
        (
            lambda count: sf.retensioning.replay(*[None] * 6, noise=1e-4, rounds=count, seed=0),
            "rounds",
        ),
        (lambda count: sf.nesting.cut(None, laths=count), "laths"),
        (lambda count: sf.render.film([], [], rate=count), "rate"),
    ],
)
@pytest.mark.parametrize("count", [2.0, 0, "2", None])
def test_a_count_that_is_none_is_refused_before_anything_is_computed(ask, where, count):
    with pytest.raises(sf.InputError, match=f"{where}: must be") as refused:
        ask(count)
    assert "such as" in refused.value.remedy


def test_seeds_that_are_none_are_refused_before_anything_is_drawn():
    for seed in (1.0, -1):
        with pytest.raises(sf.InputError, match="seed: must be"):
            sf.retensioning.replay(*[None] * 6, noise=1e-4, rounds=1, seed=seed)
        with pytest.raises(sf.InputError, match=r"sample\.seed: must be"):
            sf.robust.sample(*[None] * 4, count=1, seed=seed)


@dataclass(frozen=True)
class LateSag(Sag):  # the same, whose derivatives come when a step starts from the design
    rows: int = 1

    def measure(self, at):
        found = super().measure(at)
        whole = replace(found, by_dof=sp.csr_array(sp.vstack([found.by_dof] * self.rows)))
        return sf.Measurement(found.value, late=lambda: whole)


def test_a_term_whose_derivatives_come_late_leads_to_the_same_design_and_fewer_ask_for_them(
    coarse, monkeypatch
):
    made = Counter()
    for name in ("seed", "linearised"):
        kept = getattr(Evaluator, name)
        monkeypatch.setattr(
            Evaluator, name, lambda *given, name=name, kept=kept: made.update([name]) or kept(*given)
        )
    nodes, drop = lowest(coarse, 1)
    found = []
    for term in (Sag("wet", nodes), LateSag("wet", nodes)):
        case = problem(coarse, sf.AtMost(0.3 * drop[0], term), variables=[sf.RestLengths()])
        found.append(sf.optimise(case, coarse.design(), evaluations=12))
    early, late = found
    np.testing.assert_array_equal(late.design.rest_length, early.design.rest_length)
    assert [step.constraints for step in late.history] == [step.constraints for step in early.history]
    assert made["linearised"] <= 0.7 * made["seed"], made


def test_late_derivatives_of_another_shape_are_refused_as_early_ones_are(coarse):
    state, design = coarse.target, coarse.design()
    at = LoadedDesign(coarse, design, state, np.zeros((len(state.positions), 6)))
    told = measured(LateSag("wet", (30,), rows=2), at)
    with pytest.raises(sf.InputError, match=r"by_dof.*another shape"):
        told.whole()


@pytest.mark.parametrize("solver", [sf.SequentialConvex(), sf.MovingAsymptotes()])
def test_a_broken_limit_shows_beside_a_kept_one_of_the_same_name_whichever_comes_first(coarse, solver):
    (node,), (drop,) = lowest(coarse, 1)
    sag = Sag("wet", (node,))
    kept, broken = sf.AtLeast(-1.0, sag, of=1.0), sf.AtMost(-1.0, sag, of=1.0)
    few = sf.AtMost(0.001, sf.CableForces("wet", (0, 1)))
    for limits in ([broken, kept], [kept, broken]):
        asked = problem(coarse, *limits, variables=[sf.RestLengths()])
        best = sf.optimise(asked, coarse.design(), evaluations=1, solver=solver)
        assert best.history[0].constraints["sag"] == pytest.approx(1.0 + drop)
        assert best.constraints["sag"] > 0.5
    for limits in (
        [sf.AtMost(20.0, sf.CableForces("wet")), few],
        [few, sf.AtMost(20.0, sf.CableForces("wet"))],
    ):
        asked = problem(coarse, *limits, variables=[sf.RestLengths()])
        best = sf.optimise(asked, coarse.design(), evaluations=1, solver=solver)
        assert best.history[0].constraints["cable_force"] > 10.0


@pytest.mark.parametrize("solver", [sf.SequentialConvex(), sf.MovingAsymptotes()])
def test_the_told_terms_of_an_objective_add_up_to_it_where_two_have_one_name(coarse, solver):
    shares = [sf.Share(0.5, sf.Misfit("wet")), sf.Share(0.5, sf.RmsMisfit("wet"))]
    asked = problem(coarse, variables=[sf.RestLengths()], minimise=shares)
    best = sf.optimise(asked, coarse.design(), evaluations=2, solver=solver)
    for step in best.history:
        assert sum(step.terms.values()) == pytest.approx(step.objective, rel=1e-12)


@dataclass(frozen=True)
class Height(sf.Term):  # of the node that the target has highest, m, times a factor
    name = "height"
    load: str
    factor: float = -1.0

    def measure(self, at):
        node = int(np.argmax(at.shell.target.positions[:, 2]))
        by_dof = np.zeros((1, 6 * len(at.state.positions)))
        by_dof[0, 6 * node + 2] = self.factor
        return sf.Measurement(self.factor * at.state.positions[[node], 2], by_dof)


def test_a_search_whose_objective_is_below_0_ends_with_the_best_design_that_it_found(coarse):
    shares = [sf.Share(0.2, sf.Misfit("wet")), sf.Share(0.2, sf.CableForce("wet"))]
    shares.append(sf.Share(0.6, Height("wet")))
    asked = problem(coarse, variables=[sf.RestLengths()], minimise=shares)
    best = sf.optimise(asked, coarse.design(), evaluations=10)
    assert best.objective_start == pytest.approx(-0.2)
    assert best.history[0].terms["height"] == pytest.approx(-0.6)
    assert best.objective < -0.4
    assert best.objective <= min(step.objective for step in best.history if step.accepted) + 0.1


def test_derivatives_may_be_dense(coarse):
    asked = problem(
        coarse,
        variables=[sf.RestLengths(), sf.FreeRadius(0.0008, 0.0012)],
        minimise=[sf.Share(1.0, Height("wet"))],
    )
    assert_taylor(asked, coarse.design())


@pytest.mark.parametrize("factor", [0.0, np.inf])
def test_a_term_that_no_weight_gives_its_share_of_the_objective_is_refused(coarse, factor):
    shares = [sf.Share(0.5, sf.Misfit("wet")), sf.Share(0.5, Height("wet", factor))]
    asked = problem(coarse, variables=[sf.RestLengths()], minimise=shares)
    for solver in (sf.SequentialConvex(), sf.MovingAsymptotes()):
        with pytest.raises(sf.InputError, match="minimise: height: has no share of the objective"):
            sf.optimise(asked, coarse.design(), solver=solver, evaluations=2)


@dataclass(frozen=True)
class Slope(Height):  # no number where the node is higher than a level, m
    level: float = 0.0

    def measure(self, at):
        found = super().measure(at)
        value = found.value if abs(found.value[0]) <= self.level else np.array([np.nan])
        return replace(found, value=value)


def test_a_term_that_is_no_number_is_refused_at_the_start_and_refuses_designs_later(coarse):
    start, wet = coarse.design(), coarse.point_load(1.0)
    state = sf.follow(coarse, start, {"wet": wet})["wet"].equilibrium.state
    height = float(state.positions[np.argmax(coarse.target.positions[:, 2]), 2])
    for solver in (sf.SequentialConvex(), sf.MovingAsymptotes()):
        for nowhere in (
            problem(coarse, sf.AtMost(0.0, Slope("wet"), of=1.0), variables=[sf.RestLengths()]),
            problem(coarse, variables=[sf.RestLengths()], minimise=[sf.Share(1.0, Slope("wet"))]),
        ):
            with pytest.raises(sf.InputError, match=r"height\.value: is no number"):
                sf.optimise(nowhere, start, solver=solver, evaluations=2)
        up = problem(
            coarse,
            variables=[sf.RestLengths()],
            minimise=[sf.Share(1.0, Slope("wet", level=height + 1e-4))],
        )
        best = sf.optimise(up, start, solver=solver, evaluations=6)
        assert best.objective_start == pytest.approx(-1.0)
        assert -1.0 - 1.1e-4 / height <= best.objective <= -0.99
        assert best.rejected > 0


@dataclass(frozen=True)
class Steep(Height):  # its derivatives say what they are told to
    rate: float = 1.0
    late: bool = False

    def measure(self, at):
        found = super().measure(at)
        steep = replace(found, by_dof=np.where(found.by_dof == 0.0, 0.0, self.rate))
        return replace(found, by_dof=None, late=lambda: steep) if self.late else steep


@pytest.mark.parametrize("late", [False, True])
@pytest.mark.parametrize("rate", [np.nan, -np.inf])
def test_a_derivative_that_is_no_number_is_refused_and_not_searched_with(coarse, rate, late):
    """The search ended where it began, and said nothing."""
    steep = Steep("wet", rate=rate, late=late)
    asked = problem(coarse, variables=[sf.RestLengths()], minimise=[sf.Share(1.0, steep)])
    for solver in (sf.SequentialConvex(), sf.MovingAsymptotes()):
        with pytest.raises(sf.InputError, match=r"height\.by_dof: has a derivative that is no finite number"):
            sf.optimise(asked, coarse.design(), solver=solver, evaluations=2)


@dataclass(frozen=True)
class Bare(Height):  # the value alone
    def measure(self, at):
        return float(super().measure(at).value[0])


def test_a_term_that_gives_no_measurement_is_told_what_to_return(coarse):
    asked = problem(coarse, variables=[sf.RestLengths()], minimise=[sf.Share(1.0, Bare("wet"))])
    with pytest.raises(sf.InputError, match=r"height\.measure: is no sf\.Measurement \(found 'float'\)"):
        sf.optimise(asked, coarse.design(), evaluations=1)


@pytest.mark.parametrize("solver", [sf.SequentialConvex(), sf.MovingAsymptotes()])
def test_lengths_that_can_not_vary_are_refused(coarse, solver):
    asked = problem(coarse, variables=[sf.RestLengths(least=0.5)])
    with pytest.raises(
        sf.InputError, match=r"rest_lengths\.least: is more than the largest length .* 0\.\d+ m"
    ):
        sf.optimise(asked, coarse.design(), solver=solver, evaluations=2)


def test_a_start_without_cables_is_refused_where_their_lengths_vary_and_taken_where_only_the_radius_does(
    coarse,
):
    for more in ([], [sf.FreeRadius()]):
        asked = problem(coarse, variables=[sf.RestLengths(), *more])
        with pytest.raises(sf.InputError, match="start: has no cable whose length could vary"):
            sf.optimise(asked, coarse.unbraced(), evaluations=2)
    light = sf.LoadCase("light", coarse.point_load(0.1))
    shares = [sf.Share(1.0, sf.Misfit("light"))]
    asked = sf.Problem(coarse, light, shares, variables=[sf.FreeRadius(0.0009, 0.0012)])
    best = sf.optimise(asked, coarse.unbraced(), evaluations=2)
    assert best.objective < best.objective_start
    assert not best.design.present.any()


@pytest.mark.parametrize("chosen", [(0, 28), (-1,)])
def test_cables_that_are_not_there_have_no_force_to_limit(coarse, chosen):
    asked = problem(coarse, sf.AtMost(4.0, sf.CableForces("wet", chosen)), variables=[sf.RestLengths()])
    with pytest.raises(sf.InputError, match=r"cable_forces\.chosen\(\d,\) is out of range"):
        sf.optimise(asked, coarse.design(), evaluations=1)


def test_a_distance_below_0_limits_nothing_from_below():
    between = sf.Between(-0.1, 0.05, sf.RmsMisfit("wet"))
    assert between.lower < 0.0 < between.upper == pytest.approx(0.05**2)
    assert between.scale == pytest.approx(0.1**2 + 0.05**2)


@pytest.mark.parametrize("solver", [sf.SequentialConvex(), sf.MovingAsymptotes()])
@pytest.mark.parametrize(
    "variables",
    [
        [sf.RestLengths(), sf.FreeRadius(0.0011, 0.0012)],
        [sf.RestLengths(), sf.FreeRadius(0.0006, 0.0009)],
        [sf.RestLengths(most=0.9)],
        [sf.RestLengths(least=0.15)],
    ],
)
def test_a_start_outside_the_bounds_is_refused(coarse, solver, variables):
    asked = problem(coarse, variables=variables)
    with pytest.raises(sf.InputError, match="the start lies outside the bounds"):
        sf.optimise(asked, coarse.design(), solver=solver, evaluations=2)


def test_cables_that_are_absent_may_be_shorter_than_the_bound(coarse):
    start = coarse.design()
    rest, present = start.rest_length.copy(), start.present.copy()
    rest[3], present[3] = 0.05, False
    asked = problem(coarse, variables=[sf.RestLengths(least=0.1, most=2.5)])
    best = sf.optimise(asked, replace(start, rest_length=rest, present=present), evaluations=2)
    assert best.objective < 1.0
    assert not best.design.present[3]
