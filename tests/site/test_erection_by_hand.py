"""The stages of an erection, step by step, on fakes of which height, stress and forces are known."""

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.site import erection, erection_steps
from shellform.site.erection_steps import Erection, ErectionStep, Holding, Props, laid_out
from shellform.structure.elements.ropes import Ropes
from shellform.structure.elements.rotation import matrices

NONE = np.zeros((4, 6))


def told(stage, share, stress, **other):
    numbers = {"height": 0.0, "element": 0, "tension": 0.0, "reaction": 0.0} | other
    return ErectionStep(stage, share, stress=stress, state=None, **numbers)


def test_the_worst_step_is_that_of_the_largest_stress_and_the_table_has_its_units():
    low = told("moving supports", 0.25, 80e6, height=1.2345, element=7, tension=0.5, reaction=12.0)
    high = told("moving supports", 0.5, 123.456e6, height=2.0)
    built = Erection((low, high, told("tightening", 1.0, 90e6)), 240e6)
    assert built.worst is high
    assert built.utilisation == pytest.approx(0.5144)
    rows = built.table().splitlines()
    assert rows[1] == "moving supports,0.250,1234.50,80.00,0.333,7,0.500,12.000"
    assert rows[2].split(",")[2:5] == ["2000.00", "123.46", "0.514"]
    assert built.props is None
    unknown = Erection((low,), np.inf)
    assert (unknown.utilisation, unknown.table().splitlines()[1].split(",")[4]) == (0.0, "")


def test_the_table_of_a_grid_on_a_scaffold_tells_what_that_bears_as_long_as_it_is_there():
    steps = (
        told("raising", 0.5, 1e6, props=Props(push=9.0, pull=2.5, pulled=3, rope=0.25)),
        told("lowering", 0.0, 1e6, props=Props(push=8.0, pull=4.0, pulled=2, rope=0.0)),
        told("tightening", 1.0, 1e6),
    )
    built = Erection(steps, 240e6)
    assert built.props == Props(push=9.0, pull=4.0, pulled=3, rope=0.25)
    rows = [row.split(",") for row in built.table().splitlines()]
    assert rows[0][8:] == [
        "largest push of the scaffold [N]", "largest pull of the scaffold [N]", "crossings held down",
        "largest force of a rope [N]",
    ]  # fmt: skip
    assert rows[1][8:] == ["9.000", "2.500", "3", "0.250"]
    assert rows[3][8:] == ["", "", "", ""]


def test_what_a_scaffold_bears_are_the_forces_at_its_props_and_what_ropes_leave_is_borne_by_pins():
    """Node 0 is propped, 2 too; the ends 1 and 3 are drawn by ropes of 10 N/m, by 0.3 and 0.4 m."""
    forces = np.zeros((4, 3))
    forces[0, 2], forces[2, 2], forces[1], forces[3] = 7.0, -3.0, (3.0, 1.0, -2.0), (0.0, 4.0, 1.5)
    place = np.zeros((4, 3))
    place[1, 0], place[3, 1] = 0.3, 0.4
    ropes = Ropes(np.array([1, 3]), np.zeros((2, 2)), 10.0)
    props, ends = np.array([0, 2]), np.array([1, 3])
    state = SimpleNamespace(positions=place, tail=None)
    drawn = Holding(0.0, ends, props, 0.1, ropes, drawn=True)
    assert drawn.told(forces.copy(), state) == (pytest.approx(2.0), Props(7.0, 3.0, 1, pytest.approx(1.0)))
    pinned = Holding(0.0, ends, props, 3.5, ropes, drawn=False)
    assert pinned.told(forces.copy(), state) == (pytest.approx(np.hypot(1.0, 2.0)), Props(7.0, 3.0, 0, 0.0))
    assert Holding(0.0, props, None, 0.1).told(forces.copy(), state) == (7.0, None)


def shell(**other):
    """Of four nodes in an oblong, of which 0, 1 and 3 are supports."""
    flat = np.array([[0.0, 0.0, 0.1], [4.0, 0.0, 0.1], [2.0, 1.0, 0.0], [4.0, 2.0, 0.1]])
    net = SimpleNamespace(grid=SimpleNamespace(flat=flat), supports=np.array([0, 1, 3]))
    return SimpleNamespace(net=net, **other)


@pytest.mark.parametrize("degrees", [25.0, 100.0, -160.0])
def test_the_flat_grid_is_laid_out_turned_and_shifted_to_its_supports_at_their_mean_height(degrees):
    """The supports close in by a tenth and lie at different heights."""
    given = shell()
    flat = given.net.grid.flat
    c, s = np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    place = 0.9 * flat @ turn.T + np.array([7.0, -3.0, 0.0])
    place[:, 2] = [2.0, 2.3, 9.0, 2.6]
    given.target = SimpleNamespace(positions=place)
    found = laid_out(given)
    middle, there = flat[[0, 1, 3]].mean(axis=0), place[[0, 1, 3]].mean(axis=0)
    np.testing.assert_allclose(found.positions, (flat - middle) @ turn.T + there, atol=1e-12)
    assert found.positions[:, 2] == pytest.approx([2.3, 2.3, 2.2, 2.3])
    np.testing.assert_allclose(matrices(found.quaternions), [turn] * 4, atol=1e-12)


def test_a_step_tells_the_largest_of_each_and_the_height_over_the_lowest_support(monkeypatch):
    forces = np.zeros((4, 6))
    forces[0, :3], forces[1, :3], forces[2, :3], forces[3, :3] = (3, 4, 0), (0, 0, -12), (99, 0, 0), (1, 2, 2)
    forces[3, 3:] = 50.0  # a moment is no reaction
    rod = SimpleNamespace(resized=lambda radius: SimpleNamespace(section=radius))
    given = shell(
        rod=rod,
        cables=lambda design: SimpleNamespace(tension=lambda state: np.array(design.tensions)),
    )
    monkeypatch.setattr(
        erection_steps,
        "rod_stress",
        lambda _section, _beams, _forces: np.array([[5.0, 6.0], [4.0, 9.0], [8.0, 1.0]]),
    )
    beams = SimpleNamespace(local_forces=lambda state: None)
    assembly = SimpleNamespace(beams=[beams], unbalanced=lambda state, load: forces - load)
    state = SimpleNamespace(positions=np.array([[0, 0, 1.5], [0, 0, 1.0], [0, 0, 4.0], [0, 0, 2.0]]))
    for tensions, tension in (([2.0, 7.0, 3.0], 7.0), ([], 0.0)):
        site = erection_steps.Site(given, SimpleNamespace(radius=0.01, tensions=tensions), assembly)
        found = site.step("lifting", 0.5, state, 0.0 * forces)
        assert (found.stage, found.share, found.height) == ("lifting", 0.5, 3.0)
        assert (found.stress, found.element, found.tension) == (9.0, 1, tension)
        assert found.reaction == 12.0
    load = np.zeros((4, 6))
    load[1, 2] = -12.0  # which goes into the ground there
    assert site.step("lifting", 0.5, state, load).reaction == 5.0


class Step(NamedTuple):
    stage: str
    share: float
    state: int
    load: float


def drives(monkeypatch, *, way=(), lift=None, borne=1.0):
    """What the supports and the load are driven by on the way down, with the steps that are told; a state is
    how many drives came before."""
    asked = []

    def advance(_assembly, state, drive, *, step, smallest, stay, report):
        assert stay
        assert step == 0.5
        asked.append((state, drive))
        for share in (0.5, borne):
            report(share, SimpleNamespace(state=state + 1))
        return SimpleNamespace(
            on_branch=borne == 1.0, share=borne, equilibrium=SimpleNamespace(state=state + 1)
        )

    given = shell(target=SimpleNamespace(positions=np.arange(12.0).reshape(4, 3)))
    monkeypatch.setattr(erection, "advance", advance)
    monkeypatch.setattr(erection, "laid_out", lambda _: SimpleNamespace(positions=-np.ones((4, 3))))
    site = SimpleNamespace(
        shell=given,
        assembly=None,
        step=lambda stage, share, state, load: Step(stage, share, state, load[2, 2]),
    )
    weight = NONE.copy()
    weight[2, 2] = -5.0
    steps = erection._taken_down(site, 0, way, NONE if lift is None else lift, weight, 0.5)
    return asked, steps


def test_taken_down_the_supports_go_back_from_the_target_by_all_way_points_to_the_flat_grid(monkeypatch):
    place = np.arange(12.0).reshape(4, 3)[[0, 1, 3]]
    way = [0.25 * place, 0.5 * place]
    asked, steps = drives(monkeypatch, way=way)
    assert [state for state, _ in asked] == [0, 1, 2]
    moves = [drive.imposed[[0, 1, 3], :3] for _, drive in asked]
    np.testing.assert_allclose(moves, [-0.5 * place, -0.25 * place, -1.0 - 0.25 * place])
    for _, drive in asked:
        assert not drive.load.any()
        assert not drive.imposed[2].any()
        assert not drive.imposed[:, 3:].any()
        assert drive.base[2, 2] == -5.0
    assert [step[0] for step in steps] == 7 * ["moving supports"]
    assert [step[1] for step in steps] == pytest.approx([0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 1])
    assert [step[2] for step in steps] == [3, 3, 2, 2, 1, 1, 0]


def test_a_lift_acts_from_before_the_supports_move_until_they_have_arrived(monkeypatch):
    """Steps are put in the order of building: 8 N upwards on a node of 5 N."""
    lift = NONE.copy()
    lift[2, 2] = 8.0
    asked, steps = drives(monkeypatch, lift=lift)
    assert [(drive.at(0.0)[2, 2], drive.at(1.0)[2, 2]) for _, drive in asked] == [
        (-5.0, 3.0),
        (3.0, 3.0),
        (3.0, -5.0),
    ]
    assert [drive.imposed.any() for _, drive in asked] == [False, True, False]
    wanted = [
        ("lifting", 0.0, 3, -5.0), ("lifting", 0.5, 3, -1.0), ("lifting", 1.0, 2, 3.0),
        ("moving supports", 0.0, 2, 3.0), ("moving supports", 0.5, 2, 3.0), ("moving supports", 1.0, 1, 3.0),
        ("lowering", 0.0, 1, 3.0), ("lowering", 0.5, 1, -1.0), ("lowering", 1.0, 0, -5.0),
    ]  # fmt: skip
    assert steps == wanted


def test_supports_that_go_by_a_way_point_under_a_lift_are_one_stage(monkeypatch):
    lift = NONE.copy()
    lift[2, 2] = 8.0
    _, steps = drives(monkeypatch, way=[np.zeros((3, 3))], lift=lift)
    moving = [step.share for step in steps if step.stage == "moving supports"]
    assert moving == pytest.approx([0.0, 0.25, 0.5, 0.75, 1.0])


def test_a_path_that_snaps_is_told_by_the_share_of_its_stage_that_building_reaches(monkeypatch):
    """Of the second of two parts, which is the first on the way down, three tenths are left: 1 - 0.7 / 2."""
    with pytest.raises(NotConverged, match=r"snaps at 0\.65 of the stage 'moving supports'"):
        drives(monkeypatch, way=[np.zeros((3, 3))], borne=0.7)


def tightened(monkeypatch, reached, *, rest=(0.9, 1.9, 2.9), start=(1.0, 2.5, 2.0), widest=0.5, holding=None):
    """The lengths tried, in order, and what comes of it: of three cables 0 and 2 are tightened."""
    tried = []

    def solve(assembly, state, _load, *, limit, on_branch):
        tried.append(assembly)
        stable = reached(assembly)
        if stable is None:
            raise NotConverged("off", state=state)
        return SimpleNamespace(stable=stable, state=SimpleNamespace(positions=place))

    place = np.array(
        [[0.0, 0, 0], [start[0], 0, 0], [0, 1, 0], [start[1], 1, 0], [0, 2, 0], [start[2], 2, 0]]
    )
    given = SimpleNamespace(
        cable_ends=np.arange(6).reshape(3, 2), beams=lambda radius: None, cables=lambda design: design.rest_length.copy()
    )  # fmt: skip
    monkeypatch.setattr(erection, "find_equilibrium", solve)

    def site(design, _assembly):
        return SimpleNamespace(step=lambda stage, share, _state, _load: (stage, share, design.rest_length[0]))

    own = SimpleNamespace(
        shell=given,
        assembly=SimpleNamespace(with_parts=lambda parts: parts[1]),
        beside=site,
        holding=holding,
    )
    every = np.ones(3, dtype=bool)
    now, goal = sf.Design([7.0, 8.0, 9.0], every, 0.01), sf.Design(rest, every, 0.01)
    state = SimpleNamespace(positions=place)
    done = erection._tightened(own, now, goal, state, np.array([0, 2]), NONE, "tightening", widest)
    return np.array(tried), *done


def test_cables_are_tightened_from_where_they_hang_straight_and_those_too_long_stay_at_their_rest_length(
    monkeypatch,
):
    tried, now, _, steps = tightened(monkeypatch, lambda _: True)
    np.testing.assert_allclose(tried, [[0.95, 8.0, 2.9], [0.9, 8.0, 2.9]])
    assert now.rest_length == pytest.approx([0.9, 8.0, 2.9])
    assert [step[:2] for step in steps] == [("tightening", 0.5), ("tightening", 1.0)]
    assert [step[2] for step in steps] == pytest.approx([0.95, 0.9])


@pytest.mark.parametrize(("widest", "shares"), [(0.3, [0.3, 0.6, 0.9, 1.0]), (0.1, 0.1 * np.arange(1, 11))])
def test_tightening_goes_on_in_equal_steps_and_ends_with_the_whole(monkeypatch, widest, shares):
    """Ten tenths are one but for rounding."""
    tried, now, _, steps = tightened(monkeypatch, lambda _: True, widest=widest)
    assert [step[1] for step in steps] == pytest.approx(shares)
    assert steps[-1][1] == 1.0
    assert len(tried) == len(shares)
    assert now.rest_length[0] == 0.9


@pytest.mark.parametrize("answer", [None, False])
def test_steps_of_tightening_that_leave_the_branch_are_halved_and_end_below_a_256th(monkeypatch, answer):
    tries = []

    def reached(lengths):
        tries.append((1.0 - lengths[0]) / 0.1)
        return True if tries[-1] < 0.6 else answer

    lost = r"At 0\.60 of the stage 'tightening' the grid loses stability\. Tighten the cables in other groups"
    with pytest.raises(NotConverged, match=rf"{lost} or before a scaffold goes"):
        tightened(monkeypatch, reached)
    assert tries[:3] == pytest.approx([0.5, 1.0, 0.75])
    assert len(tries) == 12
    assert tries[-1] - tries[-2] == pytest.approx(1 / 256), "no shorter one is tried"
    with pytest.raises(NotConverged, match=rf"{lost} or before a scaffold goes"):
        tightened(monkeypatch, reached, holding=SimpleNamespace(props=None))
    with pytest.raises(NotConverged, match=rf"{lost}\.$"):  # the scaffold is still there
        tightened(monkeypatch, reached, holding=SimpleNamespace(props=np.array([0])))


def test_groups_hold_every_present_cable_once():
    design = SimpleNamespace(present=np.array([True, False, True, True]))
    assert [team.tolist() for team in erection._teams(design, None)] == [[0, 2, 3]]
    assert [team.tolist() for team in erection._teams(design, [[3], [0, 2]])] == [[3], [0, 2]]
    assert erection._teams(SimpleNamespace(present=np.zeros(3, dtype=bool)), None) == []
    for groups, said in (
        ([[0, 2]], r"every cable of the design once \(found 'C2 in none'\)"),
        ([[0, 2], [3, 0]], r"every cable of the design once \(found 'C0 2 times'\)"),
        ([[0, 1, 2, 3]], r"no cable of the design \(found 'candidate 1 1 times'\)"),
        ([], r"every cable of the design once \(found 'C0 in none'\)"),
    ):
        with pytest.raises(InputError, match=said + ".*each of the 3 cables one row"):
            erection._teams(design, groups)


def erected(monkeypatch, *, groups=None, load=None, borne=True, section=None, **how):
    """What a shell of three cables, of 1, 2 and 3 m, is tightened from, in which stages, and what is told."""
    seen = SimpleNamespace(stages=[], slack=None, steps=None, sections=[])
    rod = SimpleNamespace(
        resized=lambda radius: SimpleNamespace(section=radius), section=section, strength=5e6
    )
    given = shell(
        rod=rod, node_count=4, cable_lengths=np.array([1.0, 2.0, 3.0]), target="target", beams=lambda radius: None,
        cables=lambda design: None, locked_in=lambda state: SimpleNamespace(locked_in=state),
    )  # fmt: skip
    given.net.edges = ()

    class Site:
        def __init__(self, _shell, design, assembly=None, holding=None):
            self.shell, self.holding, self.design, self.assembly = _shell, holding, design, assembly

        def step(self, stage, share, state, load):
            return stage, share, state, load[2, 2]

    def loaded(site, state, *rest, own=erection._loaded):
        assert site.shell.locked_in == state, "layers are locked as they lie"
        return own(site, state, *rest)

    def down(_site, _state, _way, _lift, _weight, step):
        seen.steps = step
        return [("down",)]

    def tighten(_site, now, design, state, team, load, stage, widest):
        seen.slack = now.rest_length.copy() if seen.slack is None else seen.slack
        seen.stages.append((stage, team.tolist(), load[2, 2], widest))
        return design, state + 1, []

    def advance(assembly, state, drive, *, step, stay, heeding, report):
        assert (state, stay, heeding) == (len(seen.stages), True, True)
        report(0.4, SimpleNamespace(state="loaded"))
        assert (drive.at(0.0)[2, 2], drive.at(0.4)[2, 2]) == (-2.0, -5.2)
        return SimpleNamespace(on_branch=borne, share=0.4, equilibrium=SimpleNamespace(state="loaded"))

    monkeypatch.setattr(erection, "Site", Site)
    monkeypatch.setattr(erection, "_taken_down", down)
    monkeypatch.setattr(erection, "_tightened", tighten)
    monkeypatch.setattr(erection, "advance", advance)
    monkeypatch.setattr(erection, "_loaded", loaded)
    monkeypatch.setattr(erection, "find_equilibrium", lambda *_: SimpleNamespace(state=0))
    weight = NONE.copy()
    weight[2, 2] = -2.0
    design = sf.Design([0.9, 3.5, 2.9], np.ones(3, dtype=bool), 0.01)
    done = erection.erect(given, design, groups=groups, weight=weight, load=load, **how)
    return done, seen


def test_cables_hang_half_as_long_again_as_they_are_and_are_tightened_in_a_stage_or_group_after_group(
    monkeypatch,
):
    """One is longer at rest."""
    done, seen = erected(monkeypatch)
    assert seen.slack == pytest.approx([1.5, 3.5, 4.5])
    assert seen.stages == [("tightening", [0, 1, 2], -2.0, 0.1)]
    assert seen.steps == erection.STEP == 0.1
    assert done.steps == (("down",),)
    assert done.strength == 5e6
    _, seen = erected(monkeypatch, groups=[[2, 0], [1]], step=0.25)
    assert seen.stages == [
        ("tightening group 1", [2, 0], -2.0, 0.25), ("tightening group 2", [1], -2.0, 0.25)
    ]  # fmt: skip


def test_a_load_follows_on_top_of_the_weight_as_far_as_the_shell_bears_it(monkeypatch):
    load = NONE.copy()
    load[2, 2] = -8.0
    done, _ = erected(monkeypatch, load=load)
    assert done.steps[-1] == ("loading", 0.4, "loaded", pytest.approx(-5.2))
    with pytest.raises(NotConverged, match=r"bears 0\.40 of the load only"):
        erected(monkeypatch, load=load, borne=False)


def test_a_step_is_a_ten_thousandth_of_a_stage_to_all_of_it(monkeypatch):
    for step in (1.5e-4, 1.0):
        assert erected(monkeypatch, step=step)[1].steps == step
    for step in (0.9e-4, 1.1):
        with pytest.raises(InputError, match=r"erect\.step.*such as 0\.1"):
            erected(monkeypatch, step=step)
