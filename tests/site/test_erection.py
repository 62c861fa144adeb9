"""From the flat grid to the braced shell, and what the rods bear on the way."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.gridshell.reactions import reactions
from shellform.net.grid import ROD
from shellform.site.erection import erect, laid_out
from shellform.structure.network import assemble
from shellform.structure.solve.drive import Drive
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.loading import advance


@pytest.fixture(scope="module")
def erection(shell):
    return erect(shell, shell.design())


def test_erection_begins_flat_and_free_of_stress_and_ends_in_the_design_s_equilibrium(shell, erection):
    first, last = erection.steps[0], erection.steps[-1]
    assert first.stage == "moving supports"
    assert first.share == 0.0
    # The supports lie on the target, whose edge isn't exactly level; laid out they are.
    np.testing.assert_allclose(first.state.positions, laid_out(shell).positions, atol=1e-9)
    assert first.stress < 1.0
    none = np.zeros((shell.node_count, 6))
    expected = find_equilibrium(assemble(shell.network(shell.design())), shell.target, none).state
    np.testing.assert_allclose(last.state.positions, expected.positions, atol=1e-8)
    assert last.tension == pytest.approx(shell.cables(shell.design()).tension(expected).max(), rel=1e-5)


def test_rods_bear_more_on_the_way_than_when_erected_and_heights_rise(shell, erection):
    moving = [each for each in erection.steps if each.stage == "moving supports"]
    heights = [each.height for each in moving]
    assert heights == sorted(heights)
    assert erection.worst.stress > 1.05 * moving[-1].stress
    assert 0.0 < erection.worst.share < 1.0
    assert erection.utilisation == pytest.approx(erection.worst.stress / 255e6)
    assert erection.table().count("\n") == 1 + len(erection.steps)


def test_the_way_up_passes_the_states_found_on_the_way_down(shell, erection):
    moving = [each for each in erection.steps if each.stage == "moving supports"]
    low, high = moving[2], moving[-1]
    assembly = assemble(shell.network(shell.unbraced()))
    imposed = np.zeros((shell.node_count, 6))
    supports = shell.net.supports
    imposed[supports, :3] = (high.state.positions - low.state.positions)[supports]
    none = np.zeros_like(imposed)
    reached = advance(assembly, low.state, Drive(none, imposed, none), step=0.1, stay=True)
    assert reached.on_branch
    np.testing.assert_allclose(reached.equilibrium.state.positions, high.state.positions, atol=1e-7)


def test_the_largest_stress_is_that_of_a_curvature_like_the_net_s(shell, erection):
    # Rods bend rather than stretch: stress over E r is a curvature.
    curvature = erection.worst.stress / (shell.rod.young * shell.rod.radius)
    assert 0.5 * shell.net.quality.curvature_max < curvature < 2.0 * shell.net.quality.curvature_max


def test_a_step_tells_the_largest_stress_of_all_rod_ends_and_where_it_is(shell, erection):
    radius, beams = shell.rod.radius, shell.beams(shell.rod.radius)
    area, inertia = np.pi * radius**2, 0.25 * np.pi * radius**4
    for step in (erection.steps[0], erection.worst, erection.steps[-1]):
        force = beams.local_forces(step.state)[beams.of_kind(ROD)]
        moments = np.hypot(force[:, [2, 5]], force[:, [3, 6]])  # about y and z, at both ends
        stress = (np.abs(force[:, :1]) / area + moments * radius / inertia).max(axis=1)
        assert step.stress == pytest.approx(stress.max(), rel=1e-9)
        assert stress[step.element] == pytest.approx(stress.max(), rel=1e-9)


def test_groups_lift_way_points_weight_and_a_load_are_stages_of_their_own(shell):
    design = replace(shell.design(), present=np.arange(len(shell.cable_ends)) % 2 == 0)
    cables = np.flatnonzero(design.present)
    supports = shell.net.supports
    half = 0.5 * (laid_out(shell).positions[supports] + shell.target.positions[supports])
    lift, weight = 0.1 * shell.point_load(-0.1), shell.point_load(0.01)
    weight[supports, 2] -= 0.3  # which goes into the ground there, and counts in what supports bear
    done = erect(
        shell,
        design,
        way=[half],
        groups=[cables[:70], cables[70:]],
        lift=lift,
        weight=weight,
        load=shell.point_load(0.1),
        step=0.25,
    )
    stages = list(dict.fromkeys(each.stage for each in done.steps))
    assert stages == [
        "lifting",
        "moving supports",
        "lowering",
        "tightening group 1",
        "tightening group 2",
        "loading",
    ]
    expected = sf.follow(shell, design, {"all": weight + shell.point_load(0.1)})["all"].equilibrium.state
    np.testing.assert_allclose(done.steps[-1].state.positions, expected.positions, atol=1e-6)
    unbraced = replace(design, present=np.zeros(len(design.present), dtype=bool))
    carried = {"lifting": (0.0, 1.0), "moving supports": (1.0, 0.0), "lowering": (1.0, -1.0)}
    for each in done.steps:
        # What supports bear is in equilibrium with the weight, and with the share of the lift that acts then.
        if each.stage in carried:
            own, before = unbraced, carried[each.stage]
            acting = weight + (before[0] + each.share * before[1]) * lift
        elif each.stage == "loading":
            own, acting = design, weight + each.share * shell.point_load(0.1)
        else:
            continue
        found = reactions(shell, own, each.state, acting)
        off = assemble(shell.network(own)).evaluate(each.state, tangent=False).force - acting
        off[supports] = 0.0
        assert np.abs(off).max() < 1e-4
        assert each.reaction == pytest.approx(max(np.linalg.norm(one.force) for one in found.supports))
        place = each.state.positions
        assert each.height == pytest.approx(place[:, 2].max() - place[supports, 2].min())
    for stage in stages:
        shares = [each.share for each in done.steps if each.stage == stage]
        assert shares == sorted(shares)
        assert shares[-1] == 1.0
        assert shares[0] == 0.0 or stage.startswith("tightening") or stage == "loading"


def test_erections_that_can_t_be_are_refused(dome):
    design = dome.design()
    with pytest.raises(InputError, match=r"between 0.0001 and 1.*a share of the way"):
        erect(dome, design, step=0.0)
    with pytest.raises(InputError, match="every cable of the design once"):
        erect(dome, design, groups=[[0, 1]], step=1.0)
    with pytest.raises(NotConverged, match=r"doesn't stand under the weight.*smaller weight"):
        erect(dome, design, weight=1e4 * dome.point_load(1.0), step=1.0)
    with pytest.raises(NotConverged, match="bears 0"):
        erect(dome, dome.unbraced(), load=dome.point_load(30.0), step=0.5)
    with pytest.raises(NotConverged, match="loses stability"):
        erect(dome, replace(design, rest_length=0.6 * design.rest_length), step=0.5)
    apart = 1.2 * dome.target.positions[dome.net.supports]
    with pytest.raises(NotConverged, match="No stable path"):
        erect(dome, dome.unbraced(), way=[-apart], step=0.5)
