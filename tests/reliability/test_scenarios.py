"""How much of a load drawn structures bear, and its derivatives by what the design varies."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.tolerances import Tolerances
from shellform.net.grid import CONNECTOR
from shellform.problem.evaluation import Evaluator
from shellform.problem.problem import LoadCase
from shellform.problem.terms import LoadedDesign
from shellform.reliability import borne
from shellform.reliability import scenarios as scenarios_module
from shellform.reliability.drawing import PERFECT, draw_errors
from shellform.reliability.perfect import perfect
from shellform.reliability.scenarios import FactorsAsBuilt, Scenario, borne_factors, remembered, scenarios
from shellform.reliability.standing import Workshop
from shellform.structure.answers.sensitivity import stiffness_rate

AS_BUILT = Tolerances(
    cable_length=3e-4,
    supports=3e-4,
    marks=3e-4,
    load_each=0.1,
    load_all=0.05,
    connectors=0.1,
    rod_bow=1e-3,
    shape=5e-4,
)
NUMBERS = np.arange(
    2
)  # the branch of the first ends at a limit point, of the second where a cable goes slack
STEP = 1e-6  # relative: errors of central differences are about 1e-8 of the slope beside rounding


@pytest.fixture(scope="module")
def case(dome):
    return LoadCase("design", dome.point_load(6.0, every=2))


@pytest.fixture(scope="module")
def asked(dome, case):
    return scenarios(
        dome, dome.design(), case, lambda _: AS_BUILT, seed=7, least=dict.fromkeys(NUMBERS, 1.0), most=3.0
    )


def factors(shell, design, asked):
    return np.array([each.factor for each in borne_factors(shell, design, asked)])


def test_the_factor_is_where_the_path_of_the_drawn_structure_ends(dome, case, asked):
    nominal = perfect(dome, dome.design(), case.force)
    found = factors(dome, dome.design(), asked)
    for scenario, factor in zip(asked.scenarios, found, strict=True):
        end = Workshop(nominal).limit(scenario.errors, most=3.0, step=0.25, resolution=1e-4)
        # A tenth of the stiffness is left: of a root, a hundredth of the distance over which it falls.
        assert 0.98 * end.factor < factor <= end.factor + 1e-4


def test_factors_follow_the_rest_lengths_to_first_order(dome, asked):
    design = dome.design()
    change = np.random.default_rng(0).normal(size=len(design.rest_length)) * design.rest_length
    told = [each.factor_by_rest_length @ change for each in borne_factors(dome, design, asked)]
    longer, shorter = (
        replace(design, rest_length=design.rest_length + sign * STEP * change) for sign in (1.0, -1.0)
    )
    found = (factors(dome, longer, asked) - factors(dome, shorter, asked)) / (2.0 * STEP)
    assert found == pytest.approx(told, rel=1e-5)


@pytest.mark.parametrize("varied", ["radius", "axial", "torsion", "bending"])
def test_factors_follow_stiffnesses_to_first_order(dome, asked, varied):
    # Connectors as soft along their axis that it matters.
    shell, design = replace(dome, joint=replace(dome.joint, axial=71.5)), dome.design()
    if varied == "radius":
        rate, size = shell.beams_by_radius(design.radius), design.radius
        changed = [(shell, replace(design, radius=size * (1.0 + sign * 1e-5))) for sign in (1.0, -1.0)]
    else:
        place = {"axial": (1, 0, 0, 0), "torsion": (0, 1, 0, 0), "bending": (0, 0, 1, 1)}[varied]
        rate, size = (
            stiffness_rate(shell.beams(design.radius), CONNECTOR, place),
            getattr(shell.joint, varied),
        )
        joints = [replace(shell.joint, **{varied: size * (1.0 + sign * 1e-3)}) for sign in (1.0, -1.0)]
        changed = [(replace(shell, joint=joint), design) for joint in joints]
    told = [size * each.factor_by_rate[0] for each in borne_factors(shell, design, asked, rates=(rate,))]
    more, less = (factors(*each, asked) for each in changed)
    assert (more - less) / (2e-5 if varied == "radius" else 2e-3) == pytest.approx(told, rel=1e-5)


def test_a_structure_that_bears_what_is_asked_for_has_no_slope(dome, asked):
    found = borne_factors(dome, dome.design(), replace(asked, most=0.5))
    assert [each.factor for each in found] == [0.5] * len(NUMBERS)
    assert not np.any([each.factor_by_rest_length for each in found])


def test_a_remembered_structure_bears_the_same_as_one_that_is_loaded_from_nothing(dome, asked):
    design = dome.design()
    known = remembered(dome, design, asked)
    for scenario, factor in zip(known.scenarios, factors(dome, design, asked), strict=True):
        assert scenario.near is not None
        assert 0.8 * factor < scenario.near[0] <= 0.9 * factor
    nearby = replace(design, rest_length=0.999 * design.rest_length)
    assert factors(dome, nearby, known) == pytest.approx(factors(dome, nearby, asked), rel=1e-6)


def test_where_no_state_nearby_is_known_that_leads_to_the_branch_it_is_loaded_from_nothing(dome, asked):
    design = dome.design()
    known = remembered(dome, design, asked)
    beyond = [
        replace(each, near=(1.5 * factor, each.near[1]))
        for each, factor in zip(known.scenarios, factors(dome, design, asked), strict=True)
    ]
    lost = replace(known, scenarios=tuple(beyond))
    assert factors(dome, design, lost) == pytest.approx(factors(dome, design, asked), rel=1e-6)


def test_the_structure_without_errors_is_a_scenario_too(dome, case):
    design = dome.design()
    alone = scenarios(dome, design, case, lambda _: AS_BUILT, seed=7, least={PERFECT: 1.25}, most=3.0)
    nominal = perfect(dome, design, case.force)
    none = draw_errors(nominal.members, Tolerances(), 7, 0)
    end = Workshop(nominal).limit(none, most=3.0, step=0.25, resolution=1e-4)
    assert factors(dome, design, alone)[0] == pytest.approx(end.factor, rel=0.02)
    value = alone.measure(LoadedDesign(dome, design, nominal.unloaded, case.force)).value
    assert value == pytest.approx(factors(dome, design, alone) / 1.25)


def test_scenarios_are_terms_of_a_problem(dome, case, asked):
    design = dome.design()
    problem = sf.Problem(
        dome,
        case,
        [sf.Share(1.0, sf.Misfit("design"))],
        [sf.AtLeast(1.0, asked)],
        variables=[sf.RestLengths(), sf.FreeRadius()],
    )
    evaluator = Evaluator(problem, design)
    states = {"design": perfect(dome, design, 0.5 * case.force).states[-1]}
    found = evaluator.linearised(evaluator.seed(design, states, 1.0))
    assert found.constraints == pytest.approx(1.0 - factors(dome, design, asked))
    assert found.constraints_by_variables.any(axis=1).all()


def test_a_structure_whose_end_isnt_found_is_left_out_of_those_that_are_remembered(dome, asked, monkeypatch):
    def of_the_second(loading, **how):
        if loading.number == asked.scenarios[0].number:
            raise NotConverged("not found", state=None, remedy="Leave it out.")
        return borne.borne(loading, **how)

    monkeypatch.setattr(scenarios_module, "borne", of_the_second)
    kept = remembered(dome, dome.design(), asked)
    assert [each.number for each in kept.scenarios] == [asked.scenarios[1].number]
    with pytest.raises(NotConverged, match="not found"):
        remembered(dome, dome.design(), replace(asked, scenarios=asked.scenarios[:1]))


def test_a_structure_that_leads_nowhere_from_its_end_is_given_up_and_said(dome, asked, monkeypatch):
    tried = []

    def nowhere(loading, point, goal):
        tried.append(goal)
        assert len(tried) < 100, "the search for a stiffer state goes on for ever"

    monkeypatch.setattr(borne, "_moved", nowhere)
    soft = replace(asked, left=1e3 * asked.left)  # more than is left anywhere near the end
    with pytest.raises(NotConverged, match=r"structure 0 as built bears was not found\. Leave it out"):
        factors(dome, dome.design(), soft)
    assert tried[-1] > 0.0


def test_without_a_stiffness_that_is_left_there_is_no_end_of_the_branch(asked):
    with pytest.raises(InputError, match="positive"):
        replace(asked, left=0.0)


def told_scenarios(least):
    case = LoadCase("wet", np.full((2, 6), -1.0))
    own = tuple(Scenario(number, f"errors {number}", factor) for number, factor in least.items())
    return FactorsAsBuilt(case, own, "imperfections", 0.5, 1.7, 1e-3)


def test_factors_are_told_over_what_each_is_to_bear_with_their_derivatives(monkeypatch):
    """Of three candidate cables the second is absent."""
    found = [
        SimpleNamespace(factor=1.2, factor_by_rest_length=np.array([3.0, -2.0]), factor_by_rate=[5.0]),
        SimpleNamespace(factor=0.9, factor_by_rest_length=np.array([1.0, 4.0]), factor_by_rate=[-6.0]),
    ]
    shell = SimpleNamespace(cable_ends=[0] * 3, beams_by_radius=lambda radius: ("rate", radius))
    design = SimpleNamespace(present=np.array([True, False, True]), radius=0.1)
    asked = told_scenarios({4: 0.8, 7: 1.25})
    monkeypatch.setattr(
        scenarios_module, "borne_factors", lambda *given, rates: found if rates == (("rate", 0.1),) else None
    )
    told = asked.measure(SimpleNamespace(shell=shell, design=design))
    assert told.value == pytest.approx([1.2 / 0.8, 0.9 / 1.25])
    np.testing.assert_allclose(told.by_rest_length.toarray(), [[3.75, 0.0, -2.5], [0.8, 0.0, 3.2]])
    assert told.by_radius == pytest.approx([6.25, -4.8])
    assert asked.size(shell) == 2


def test_scenarios_keep_a_tenth_of_the_unloaded_structure_s_softest_stiffness(monkeypatch):
    nominal = SimpleNamespace(
        network="network", unloaded="unloaded", members="members", imperfections="shapes"
    )
    monkeypatch.setattr(scenarios_module, "perfect", lambda *_: nominal)
    monkeypatch.setattr(scenarios_module, "assemble", lambda network: network)
    monkeypatch.setattr(
        scenarios_module,
        "modes",
        lambda assembly, state, count: SimpleNamespace(stiffness=[6.0] if state == "unloaded" else None),
    )
    monkeypatch.setattr(scenarios_module, "draw_errors", lambda *given: given)
    case = LoadCase("wet", np.ones((2, 6)))
    found = scenarios(
        None,
        None,
        case,
        lambda number: f"rough {number}",
        seed=5,
        least={3: 1.0, 8: 0.9},
        most=1.4,
        exact=0.01,
    )
    assert (found.left, found.most, found.exact) == (pytest.approx(0.6), 1.4, 0.01)
    assert [(each.number, each.least, each.errors) for each in found.scenarios] == [
        (3, 1.0, ("members", "rough 3", 5, 3)),
        (8, 0.9, ("members", "rough 8", 5, 8)),
    ]


def test_a_scenario_is_remembered_at_nine_tenths_of_what_it_bears(monkeypatch):
    """The second has no such state, and of the third no end is found."""
    seen = []

    def end(workshop, asked, scenario):
        if scenario.number == 9:
            raise NotConverged("lost")
        return SimpleNamespace(factor=0.5 + 0.1 * scenario.number)

    class Making:
        def with_structure(self, errors, work, *, number):
            def followed(*given):
                seen.append((errors, number, given))
                return (None if number == 2 else SimpleNamespace(state="near")), 0.7

            return work(SimpleNamespace(followed=followed))

    monkeypatch.setattr(scenarios_module, "_end", end)
    monkeypatch.setattr(scenarios_module, "_workshop", lambda *_: Making())
    found = remembered(None, None, told_scenarios({1: 1.0, 2: 1.0, 9: 1.0}))
    assert [(each.number, each.near) for each in found.scenarios] == [(1, (0.7, "near")), (2, None)]
    assert sorted(seen, key=lambda each: each[1]) == [
        ("errors 1", 1, (pytest.approx(0.54), borne.CAREFUL, 1 / 16)),
        ("errors 2", 2, (pytest.approx(0.63), borne.CAREFUL, 1 / 16)),
    ]
    with pytest.raises(NotConverged, match="lost"):
        remembered(None, None, told_scenarios({9: 1.0}))
    assert remembered(None, None, told_scenarios({})).scenarios == ()


@pytest.mark.parametrize("name", ["left", "most", "exact"])
def test_what_bounds_a_scenario_is_positive(name):
    for wrong in (0.0, -1.0, np.nan):
        with pytest.raises(InputError, match=rf"factors_as_built\.{name}"):
            replace(told_scenarios({}), **{name: wrong})
