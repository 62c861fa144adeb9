"""Shells raised by a scaffold, with edge beams and without."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.edge_beams import Bundle, EdgeBeam
from shellform.gridshell.layers import TwoLayers
from shellform.net.edges import stand
from shellform.site import erection as erection_module
from shellform.site import scaffold
from shellform.site.erection import erect
from shellform.site.scaffold import Scaffold
from shellform.structure.elements import rotation
from shellform.structure.elements.sections import isotropic
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from tests.gridshell.dishes import dish
from tests.net.edge_shells import barrel

STAGES = ["raising", "drawing in", "pinning", "clamping", "lowering", "striking props", "tightening"]


def vault(spacing=0.11, gap=0.002):
    """A barrel vault whose two arches hang on edge beams."""
    surface = barrel()
    net = sf.pull_net(surface, spacing=spacing, gap=gap, angle=np.deg2rad(45.0), elements=2)
    rod = sf.Rod.round(young=40e9, radius=0.0012, strength=600e6, density=2000.0)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=gap)
    bundle = EdgeBeam(Bundle(0.0012, 19, 0.5, isotropic(young=40e9, density=2000.0, strength=600e6)))
    return sf.brace(stand(net, surface), rod, joint, sf.Cable(stiffness=187.0), below=surface, edge=bundle)


@pytest.fixture(scope="module")
def arches():
    return vault()


@pytest.fixture(scope="module")
def erection(arches):
    return erect(arches, arches.design())


def unloaded(shell, design):
    none = np.zeros((shell.node_count, 6))
    return find_equilibrium(assemble(shell.network(design)), shell.target, none).state


def of_stage(erection, stage):
    return [step for step in erection.steps if step.stage == stage]


def rods_only(shell, state):
    """Forces (n, 6), N, that hold the grid without its edge beams in the state."""
    beams = shell.beams(shell.rod.radius)
    own = beams.chosen(np.flatnonzero(~(beams.of_kind("edge") | beams.of_kind("clamp"))))
    every = np.ones((shell.node_count, 6), dtype=bool)
    network = replace(shell.network(shell.unbraced()), beams=own, fixed=every)
    return assemble(network).unbalanced(state, np.zeros((shell.node_count, 6)))


def test_a_shell_with_edge_beams_is_raised_from_the_flat_grid_and_ends_in_the_design_s_equilibrium(
    arches, erection
):
    assert list(dict.fromkeys(step.stage for step in erection.steps)) == STAGES
    for stage in STAGES:
        shares = [step.share for step in of_stage(erection, stage)]
        assert shares == sorted(shares)
        assert shares[-1] == pytest.approx(1.0)
        assert shares[0] == pytest.approx(0.0, abs=1e-12) or stage == "tightening"
    first, last = erection.steps[0], erection.steps[-1]
    assert first.stress < 1.0
    nodes = np.unique(arches.net.grid.rod_ends)
    flat = first.state.positions[nodes]
    assert np.ptp(flat[:, 2]) == pytest.approx(arches.net.grid.gap, rel=1e-6)
    assert flat[:, 2].min() == pytest.approx(arches.target.positions[:, 2].min(), abs=1e-9)
    beams = np.setdiff1d(np.arange(arches.node_count), nodes)
    np.testing.assert_array_equal(first.state.positions[beams], arches.target.positions[beams])
    expected = unloaded(arches, arches.design())
    np.testing.assert_allclose(last.state.positions, expected.positions, atol=1e-8)
    heights = [step.height for step in of_stage(erection, "raising")]
    assert heights == sorted(heights)


def test_unbraced_and_with_props_struck_it_stands_as_its_design_without_cables(arches, erection):
    alone = of_stage(erection, "striking props")[-1]
    expected = unloaded(arches, arches.unbraced())
    np.testing.assert_allclose(alone.state.positions, expected.positions, atol=1e-8)
    assert alone.props is None


def test_on_the_way_up_rods_bear_hardly_more_than_when_they_are_up(erection):
    raising = of_stage(erection, "raising")
    stress = [step.stress for step in raising]
    assert stress == sorted(stress)
    assert erection.worst.stress < 1.1 * raising[-1].stress


def test_rods_of_a_narrow_grid_with_thick_joints_bear_no_more_than_their_share_on_the_way_up():
    """Both layers of a steep grid rose in proportion, which the distance between them doesn't: 75 MPa at four
    tenths of the way to 82, and 2.6 times their strength in a dome of 60 m."""
    shell = vault(spacing=0.055, gap=0.012)
    raising = of_stage(erect(shell, shell.unbraced(), step=0.5), "raising")
    final = raising[-1].stress
    for step in raising:
        assert step.stress < 1.05 * step.share * final + 1e4


def test_ropes_that_lead_ends_bend_rods_by_no_more_than_a_share_of_what_the_shell_does_however_narrow_the_grid(
    arches,
):
    """A rope's pull k L bends the segment of length l at its end by k L l, the shell its rods by EI/L."""
    shares = []
    for shell in (arches, vault(spacing=0.055)):
        held = Scaffold(shell, shell.unbraced(), np.zeros((shell.node_count, 6)), None, 0.5)
        across, along = np.ptp(shell.target.positions, axis=0).max(), shell.net.grid.scale
        shares.append(held.soft * across**2 * along / min(shell.rod.stiffness.bending))
    assert shares[0] == pytest.approx(shares[1], rel=1e-12)
    assert shares[0] == pytest.approx(120.0)


def test_at_its_full_height_a_raised_grid_lies_at_the_target_where_that_overhangs_too(arches):
    raised = object.__new__(Scaffold)
    over = np.deg2rad([0.0, 60.0, 120.0])
    turned = np.column_stack([np.cos(over / 2), np.sin(over / 2), 0.0 * over, 0.0 * over])
    target = replace(arches.target, quaternions=np.array(arches.target.quaternions))
    nodes = np.flatnonzero(arches.net.grid.layer)[:3]
    quaternions = np.array(target.quaternions)
    quaternions[nodes] = turned
    net = replace(arches.net, target=replace(target, quaternions=quaternions))
    raised.shell, raised.ground = replace(arches, net=net), -0.1
    np.testing.assert_allclose(raised._heights(nodes, 1.0), net.target.positions[nodes, 2], atol=1e-12)
    aside, middle = net.grid.layer[nodes], -0.1 + 0.5 * net.grid.gap
    np.testing.assert_allclose(raised._heights(nodes, 0.0), middle + aside, atol=1e-12)


def test_a_raised_grid_is_held_by_its_props_from_below_and_its_ropes_from_the_side_alone(arches, erection):
    props = scaffold._propped(arches, None)
    clamps = np.vstack([line.clamps for line in arches.net.edges])[:, 1]
    pinned = np.intersect1d(arches.net.supports, arches.net.grid.rod_ends)
    ends = np.union1d(pinned, clamps)
    step = of_stage(erection, "raising")[5]
    force = rods_only(arches, step.state)
    assert step.props.push == pytest.approx(force[props, 2].max(), rel=1e-6)
    assert step.props.pull == pytest.approx(max(-force[props, 2].min(), 0.0), rel=1e-6)
    assert step.props.rope == pytest.approx(np.linalg.norm(force[ends, :2], axis=1).max(), rel=1e-6)
    assert step.reaction == pytest.approx(np.abs(force[ends, 2]).max(), rel=1e-6)
    # At half of the way the net is at half of its height, its slope's sine at half of the target's: the lower
    # rods, half a gap beside it, lie a little lower than at half of theirs.
    upright = rotation.matrices(arches.target.quaternions[props])[:, 2, 2]
    beside = 0.5 * arches.net.grid.gap
    lowest = arches.target.positions[:, 2].min()
    final = of_stage(erection, "raising")[-1].state.positions[props, 2]
    net = 0.5 * (lowest + beside) + 0.5 * (final + beside * upright)
    now = np.cos(np.arcsin(0.5 * np.sqrt(1.0 - upright**2)))
    assert step.share == 0.5
    np.testing.assert_allclose(step.state.positions[props, 2], net - beside * now, atol=1e-9)
    assert step.state.positions[props, 2].max() < 0.5 * (lowest + final).max()
    assert np.abs(force[:, :3].sum(axis=0)).max() < 1e-6 * step.props.push
    force[props, 2] = 0.0
    force[ends, :3] = 0.0
    assert np.abs(force[np.unique(arches.net.grid.rod_ends)]).max() < 1e-5 * step.props.push


def test_ends_are_on_their_seats_when_they_are_pinned_and_turned_as_on_the_target_before_they_are_clamped(
    arches, erection
):
    clamps = np.vstack([line.clamps for line in arches.net.edges])[:, 1]
    pinned = of_stage(erection, "pinning")[-1].state
    np.testing.assert_allclose(pinned.positions[clamps], arches.target.positions[clamps], atol=1e-9)
    turned = next(step for step in of_stage(erection, "clamping") if step.share == pytest.approx(0.5)).state
    np.testing.assert_allclose(turned.positions[clamps], arches.target.positions[clamps], atol=1e-9)
    alike = np.abs(np.sum(turned.quaternions[clamps] * arches.target.quaternions[clamps], axis=1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-12)


def test_under_its_weight_the_shell_ends_where_the_weight_alone_brings_it_and_a_load_follows(arches):
    weight, load = arches.point_load(0.2), arches.point_load(0.5)
    done = erect(arches, arches.design(), weight=weight, load=load, step=0.5)
    assert done.steps[-1].stage == "loading"
    expected = sf.follow(arches, arches.design(), {"all": weight + load})["all"].equilibrium.state
    np.testing.assert_allclose(done.steps[-1].state.positions, expected.positions, atol=1e-6)
    heavier = of_stage(done, "raising")[-1].props
    lighter = of_stage(erect(arches, arches.design(), step=0.5), "raising")[-1].props
    assert heavier.push > lighter.push


def test_a_weight_that_rounding_hides_beside_the_rods_ends_no_way_up(arches, erection):
    weight = np.zeros((arches.node_count, 6))
    weight[arches.net.supports[0], 2] = -1e-4
    done = erect(arches, arches.design(), weight=weight, step=0.5)
    last = erection.steps[-1].state.positions
    np.testing.assert_allclose(done.steps[-1].state.positions, last, atol=1e-7)


def test_cables_can_be_tightened_before_the_scaffold_goes_which_ends_in_the_same_shape(arches, erection):
    done = erect(arches, arches.design(), tighten_first=True, step=0.5)
    stages = list(dict.fromkeys(step.stage for step in done.steps))
    assert stages == [*STAGES[:4], "tightening", "lowering", "striking props"]
    assert of_stage(done, "tightening")[-1].props is not None
    np.testing.assert_allclose(done.steps[-1].state.positions, erection.steps[-1].state.positions, atol=1e-8)


@pytest.mark.parametrize("by", ["supports", "scaffold"])
def test_a_load_that_the_shell_bears_in_part_is_refused_though_a_step_leaps_over_its_snap(by):
    """A dish of 2 m that bears 0.93 N a crossing came to rest under 1.21 N, beyond its snap."""
    shell, design = dish(0.1, 0.4, 0.002, 0.25 * np.pi, 0.999)
    with pytest.raises(NotConverged, match=r"bears 0\.77 of the load only"):
        erect(shell, design, by=by, load=shell.point_load(1.21), step=1.0)


def test_where_forces_that_go_in_proportion_would_let_the_shell_snap_places_are_let_down(
    arches, erection, monkeypatch
):
    passed = Scaffold._passed

    def snapping(self, site, stage, state, drive, *rest, **how):
        if stage in ("lowering", "striking props") and drive.load.any():
            raise NotConverged("snaps", state=state)
        return passed(self, site, stage, state, drive, *rest, **how)

    monkeypatch.setattr(Scaffold, "_passed", snapping)
    done = erect(arches, arches.unbraced(), step=0.5)
    let_down = of_stage(erection, "striking props")[-1].state
    np.testing.assert_allclose(done.steps[-1].state.positions, let_down.positions, atol=1e-8)
    assert of_stage(done, "lowering")[-1].props.push < 1e-5 * of_stage(done, "lowering")[0].props.push


def test_a_shell_on_the_ground_ends_by_a_scaffold_as_by_supports_that_move_which_bend_rods_and_push_more(
    shell,
):
    design = shell.design()
    lifted, moved = (
        erect(shell, design, by="scaffold", step=0.5),
        erect(shell, design, by="supports", step=0.5),
    )
    assert list(dict.fromkeys(step.stage for step in lifted.steps)) == [
        "raising", "drawing in", "pinning", "lowering", "tightening"
    ]  # fmt: skip
    np.testing.assert_allclose(lifted.steps[-1].state.positions, moved.steps[-1].state.positions, atol=1e-8)
    assert max(step.reaction for step in lifted.steps) < max(step.reaction for step in moved.steps)
    assert lifted.worst.stress < moved.worst.stress


def test_a_scaffold_bears_every_second_crossing_by_its_lower_rod_where_the_target_is_no_steeper_than_60_degrees(
    arches,
):
    lower, upper = arches.net.grid.crossing_nodes.T
    second = arches.net.grid.lattice.sum(axis=1) % 2 == 0
    assert scaffold._propped(arches, None).tolist() == lower[second].tolist()
    assert scaffold._propped(arches, [upper[4], lower[2], lower[4]]).tolist() == sorted([lower[2], lower[4]])
    steep = barrel(half=1.4)
    net = sf.pull_net(steep, spacing=0.11, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    given = replace(arches, net=stand(net, steep), cable_ends=np.zeros((0, 2), dtype=np.int64))
    lower = net.grid.crossing_nodes[net.grid.lattice.sum(axis=1) % 2 == 0, 0]
    aside = np.abs(net.target.positions[lower, 1])
    # On the circle of 0.5 m in radius 60° lie 0.433 m from the middle.
    away = np.abs(aside - 0.5 * np.sin(np.pi / 3.0)) > 0.02
    kept = np.isin(lower, scaffold._propped(given, None))
    np.testing.assert_array_equal(kept[away], aside[away] < 0.43)
    assert 0 < kept.sum() < len(lower)


def test_rods_in_two_layers_are_locked_on_the_scaffold_and_the_shell_ends_where_it_was_designed(arches):
    """Blocks are put in where the laths lie then, next to the target, on which designs take them to be
    without stress."""
    laths = sf.Rod(TwoLayers(arches.rod.resized(0.0009).section, 0.5))
    shell = replace(arches, rod=laths)
    design = shell.design()
    load = shell.point_load(-0.5, every=2)
    done = erect(shell, design, load=load, step=0.5)
    expected = find_equilibrium(assemble(shell.network(design)), shell.target, load).state
    away = np.linalg.norm(done.steps[-1].state.positions - expected.positions, axis=1).max()
    loose = find_equilibrium(
        assemble(replace(shell, rod=sf.Rod(replace(laths.section, composite=0.0))).network(design)),
        shell.target,
        load,
    ).state
    assert away < 0.3 * np.linalg.norm(loose.positions - expected.positions, axis=1).max()
    before = [step for step in done.steps if step.stage == "clamping"][-1]
    ends = shell.locked_in(before.state).beams(design.radius)
    locks = ends.of_kind("lock")
    assert np.abs(ends.local_forces(before.state)[locks]).max() < 1e-9, "without stress where they are put in"


def test_two_layers_go_up_by_a_scaffold_unless_supports_are_to_move_on_a_way(shell):
    laths = replace(shell, rod=sf.Rod(TwoLayers(shell.rod.section, 0.5)))
    assert erection_module._way_up(laths, None, moving=[], propped=[]) == "scaffold"
    assert erection_module._way_up(laths, None, moving=["way"], propped=[]) == "supports"
    assert erection_module._way_up(shell, None, moving=[], propped=[]) == "supports"


def test_a_single_prop_brings_up_a_small_vault(arches, erection):
    middle = np.argmax(arches.net.crossings[:, 2])
    done = erect(arches, arches.design(), props=arches.net.grid.crossing_nodes[middle], step=0.5)
    np.testing.assert_allclose(done.steps[-1].state.positions, erection.steps[-1].state.positions, atol=1e-8)


def test_ways_up_that_can_t_be_are_refused(arches, shell):
    design = arches.design()
    with pytest.raises(InputError, match=r"erect\.by.*Known: supports, scaffold"):
        erect(arches, design, by="balloon")
    with pytest.raises(InputError, match=r"edge beams.*by a scaffold"):
        erect(arches, design, by="supports")
    for what in ({"way": [np.zeros((3, 3))]}, {"lift": np.zeros((arches.node_count, 6))}):
        (name,) = what
        with pytest.raises(InputError, match=rf"goes with supports that move in.*{name}.*Leave it out\.$"):
            erect(arches, design, **what)
    way = [np.zeros((3, 3))]
    with pytest.raises(InputError, match="Leave it out, or erect by supports"):
        erect(shell, shell.design(), by="scaffold", way=way)
    for what in ({"props": [0]}, {"tighten_first": True}):
        (name,) = what
        with pytest.raises(InputError, match=rf"goes with a scaffold.*{name}.*, or erect by a scaffold"):
            erect(shell, shell.design(), by="supports", **what)
        # What goes with either can't be had by another way up.
        with pytest.raises(InputError, match=r"goes with supports that move in.*way.*Leave it out\.$"):
            erect(shell, shell.design(), way=way, **what)
        with pytest.raises(InputError, match=rf"goes with a scaffold.*{name}.*Leave it out\.$"):
            erect(shell, shell.design(), by="supports", way=way, **what)
    beam = int(arches.net.edges[0].nodes[1])
    with pytest.raises(InputError, match=f"props.*is no node of a rod.*{beam}"):
        erect(arches, design, props=[beam])


def test_ways_up_that_end_on_the_way_say_where_and_what_helps(arches, monkeypatch):
    design, load = arches.design(), arches.point_load(1.0)
    with pytest.raises(NotConverged, match=r"bears 0\.\d\d of the weight by itself.*cables first"):
        erect(arches, design, weight=3.0 * load, step=0.5)
    with pytest.raises(NotConverged, match=r"by itself\. Give a smaller weight"):
        erect(arches, design, weight=3.0 * load, step=0.5, tighten_first=True)
    with pytest.raises(
        NotConverged, match=r"onto the scaffold.*stage 'pinning'.*other crossings, or give a sm"
    ):
        erect(arches, design, weight=1000.0 * load, step=0.5)
    with pytest.raises(NotConverged, match=r"by itself\. Give a smaller weight\.$"):  # it has no cables
        erect(arches, arches.unbraced(), weight=3.0 * load, step=0.5)
    monkeypatch.setattr(scaffold, "find_equilibrium", lost)
    with pytest.raises(NotConverged, match=r"lie still on its scaffold\. Prop more crossings\.$"):
        erect(arches, design, step=0.5)
    with pytest.raises(
        NotConverged, match=r"lie still on its scaffold\. Prop.*, or give a smaller weight\.$"
    ):
        erect(arches, design, weight=load, step=0.5)


@pytest.mark.parametrize(
    ("tighten_first", "remedy"),
    [(False, r"Tighten the cables first \(--tighten-first\)"), (True, "Choose stiffer rods")],
)
def test_of_a_shell_that_falls_of_nothing_but_its_own_cables_no_smaller_weight_is_asked(
    arches, monkeypatch, tighten_first, remedy
):
    def snapping(self, site, stage, state, drive, *rest, **how):
        if stage == "lowering":
            raise NotConverged("snaps", state=state)
        return passed(self, site, stage, state, drive, *rest, **how)

    def unstable(assembly, start, load):
        found = find_equilibrium(assembly, start, load)
        return replace(found, stable=not assembly.cables)  # all but the grid before it has any

    passed = Scaffold._passed
    monkeypatch.setattr(Scaffold, "_passed", snapping)
    monkeypatch.setattr(scaffold, "find_equilibrium", unstable)
    with pytest.raises(NotConverged, match=rf"it doesn't stand by itself\. {remedy}\.$"):
        erect(arches, arches.design(), tighten_first=tighten_first, step=0.5)


def lost(_assembly, start, _load):
    raise NotConverged("lost", state=start)


def test_a_shell_let_down_to_another_shape_than_it_stands_in_is_refused(arches, monkeypatch):
    def away(self, *_):
        return replace(self.shell.target, positions=1.1 * self.shell.target.positions)

    def snapping(self, site, stage, state, drive, *rest, **how):
        if stage == "lowering":
            if drive.load.any():
                raise NotConverged("snaps", state=state)
            return state
        return passed(self, site, stage, state, drive, *rest, **how)

    passed = Scaffold._passed
    monkeypatch.setattr(Scaffold, "_standing", away)
    monkeypatch.setattr(Scaffold, "_passed", snapping)
    with pytest.raises(NotConverged, match=r"loses stability as what holds it goes, in 'lowering'"):
        erect(arches, arches.design(), step=0.5)
