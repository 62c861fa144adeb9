"""Edge beams and what supports bear."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import edge_beams as module
from shellform.gridshell.edge_beams import Bundle, EdgeBeam, lengths, mass, weight
from shellform.gridshell.reactions import Reactions, Support, reactions
from shellform.net.edges import stand
from shellform.output.exchange.opensees import opensees_script
from shellform.output.workshop import nesting, schedules
from shellform.output.workshop.edge_schedule import bundled_note, edge_table
from shellform.output.workshop.marks import Words, overlap
from shellform.output.workshop.schedules import Built
from shellform.output.workshop.setting_out import support_plan
from shellform.problem.paths import follow
from shellform.quantities import number
from shellform.structure.answers.sensitivity import reaction_rows
from shellform.structure.elements.sections import Material, Rectangle, isotropic
from shellform.structure.elements.state import at_rest, moved
from shellform.structure.model import Model, read_model, write_model
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.residual import ResidualNorm
from tests.gridshell.slopes import slopes_hold
from tests.net.edge_shells import barrel

GFRP = isotropic(young=40e9, density=2000.0, strength=600e6)
BUNDLE = EdgeBeam(Bundle(0.0012, 19, 0.5, GFRP))


@pytest.fixture(scope="module")
def arches():
    """A barrel vault whose two arches hang on edge beams, loaded with 1 N on every second crossing."""
    surface = barrel()
    net = sf.pull_net(surface, spacing=0.08, gap=0.002, angle=np.deg2rad(45.0), elements=2)
    rod = sf.Rod.round(young=40e9, radius=0.0012, strength=600e6, density=2000.0)
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    shell = sf.brace(stand(net, surface), rod, joint, sf.Cable(stiffness=187.0), below=surface, edge=BUNDLE)
    return shell, shell.point_load(1.0, every=2)


@pytest.fixture(scope="module")
def solved(arches):
    shell, load = arches
    found = follow(shell, shell.design(), {"none": 0.0 * load, "design": load})
    return {name: each.equilibrium.state for name, each in found.items()}


def test_edge_beams_and_clamps_have_no_stress_in_the_target(arches):
    shell, _ = arches
    beams = shell.beams(shell.rod.radius)
    own = beams.kind >= 2
    assert [beams.kinds[k] for k in np.unique(beams.kind)] == ["rod", "connector", "edge", "clamp"]
    np.testing.assert_allclose(beams.local_forces(shell.target)[own], 0.0, atol=1e-6)
    assert np.abs(beams.local_forces(shell.target)[beams.kind == 0]).max() > 1e-3


def test_clamps_no_stiffer_than_short_rods_give_way_by_nothing_that_counts(arches, solved):
    """Against clamps as stiff as the edge beam, 19 rods."""
    shell, load = arches
    stiff = replace(shell)
    own = shell._edges.kind == shell._edges.kinds.index("clamp")
    heavier = replace(
        shell._edges,
        **{
            name: np.where(own, value, getattr(shell._edges, name))
            for name, value in zip(
                ("axial", "torsion", "bending_y", "bending_z"), BUNDLE.stiffness, strict=True
            )
        },
    )
    object.__setattr__(stiff, "_edges", heavier)
    other = follow(stiff, stiff.design(), {"design": load})["design"].equilibrium.state
    moved_by = np.linalg.norm(solved["design"].positions - shell.target.positions, axis=1).max()
    off = np.linalg.norm(solved["design"].positions - other.positions, axis=1).max()
    assert off < 0.01 * moved_by  # 0.6 %


def test_heavy_edge_beams_leave_less_to_rounding_than_rods_and_joints_do(arches, solved):
    """Clamps and elements a twentieth of the spacing long, as stiff as 91 rods, left forty times what may be
    told as equilibrium on a barrel of 30 m: every state was solved with twice the digits."""
    shell, load = arches
    heavy = replace(shell, edge=EdgeBeam(Bundle(0.0012, 91, 0.5, GFRP)))
    beams = heavy.beams(heavy.rod.radius)
    lengths_of, stiff = beams.rest_length, 12.0 * beams.bending_y / beams.rest_length**3
    edge, clamp = (beams.of_kind(kind) for kind in ("edge", "clamp"))
    assert lengths_of[edge].min() > 0.05 * heavy.net.grid.scale
    assert stiff[clamp].max() < 12.0 * max(shell.rod.stiffness[2:]) / (0.5 * shell.net.grid.gap) ** 3 * (
        1 + 1e-9
    )
    assembly = assemble(heavy.network(heavy.design()))
    norm = ResidualNorm(assembly)
    balance = assembly.evaluate(solved["design"])
    assert not norm.drowns(balance, solved["design"], load, 1e-8)


def test_rods_push_edge_beams_out_and_they_push_back(arches, solved):
    shell, _ = arches
    beams = shell.beams(shell.rod.radius)
    own = beams.kind == beams.kinds.index("edge")
    assert np.abs(beams.local_forces(solved["none"])[own]).max() > 1e-3


def test_reactions_add_up_to_the_load(arches, solved):
    shell, load = arches
    found = reactions(shell, shell.design(), solved["design"], load)
    assert found.total == pytest.approx((0.0, 0.0, -load[:, 2].sum()), abs=1e-5)
    assert {each.kind for each in found.supports} == {"ground"}
    assert len(found.supports) == len(shell.net.supports)
    assert found.thrust == max(each.thrust for each in found.supports)
    for each in found.supports:
        assert each.pressure * each.uplift == 0.0


def test_what_acts_on_a_support_itself_goes_into_the_ground_there(arches, solved):
    shell, load = arches
    own = np.zeros_like(load)
    own[shell.net.supports[1], :3] = (0.5, -0.25, -2.0)
    before, after = (reactions(shell, shell.design(), solved["design"], each) for each in (load, load + own))
    for k, (one, other) in enumerate(zip(before.supports, after.supports, strict=True)):
        more = (-0.5, 0.25, 2.0) if k == 1 else (0.0, 0.0, 0.0)
        assert np.subtract(other.force, one.force) == pytest.approx(more, abs=1e-9)


def test_a_support_is_pressed_lifted_and_pushed_by_its_own_force():
    down, up, side = (
        Support(k, 0, "ground", "", (0.0, 0.0, 0.0), force)
        for k, force in enumerate([(3.0, -4.0, 2.0), (0.0, 1.0, -1.5), (6.0, 8.0, 0.0)])
    )
    assert (down.pressure, down.uplift, down.thrust) == (2.0, 0.0, 5.0)
    assert (up.pressure, up.uplift, up.thrust) == (0.0, 1.5, 1.0)
    assert (side.pressure, side.uplift, side.thrust) == (0.0, 0.0, 10.0)
    every = Reactions((down, up, side))
    assert (every.pressure, every.uplift, every.thrust) == (2.0, 1.5, 10.0)
    assert every.total == (9.0, 5.0, 0.5)


def test_the_schedule_of_edge_beams_is_in_equilibrium_and_names_the_rods_that_are_clamped(arches, solved):
    shell, _ = arches
    grid, place = shell.net.grid, shell.target.positions
    names = [f"R{k}" for k in range(len(grid.rods))]
    table = edge_table(shell, shell.design(), solved, names)
    rows = list(zip(*(table.column(head) for head in table.columns), strict=True))
    assert len(rows) == sum(len(line.nodes) for line in shell.net.edges)
    beams = shell.beams(shell.rod.radius)
    forces = beams.local_forces(solved["design"])[beams.kind == beams.kinds.index("edge")]
    at, element = 0, 0
    for k, line in enumerate(shell.net.edges):
        own = rows[at : at + len(line.nodes)]
        assert {row[0] for row in own} == {f"E{k}"}
        np.testing.assert_allclose([row[2:5] for row in own], place[line.nodes])
        steps = np.linalg.norm(np.diff(place[line.nodes], axis=0), axis=1)
        np.testing.assert_allclose([row[1] for row in own], np.append(0.0, np.cumsum(steps)))
        clamped: dict[int, set[int]] = {}
        for node, end in line.clamps.tolist():
            clamped.setdefault(node, set()).add(end)
        for row, node in zip(own, line.nodes.tolist(), strict=True):
            told = re.findall(r"R(\d+) (first|second)", str(row[5]))
            ends = [int(grid.rods[int(rod)].nodes[{"first": 0, "second": -1}[side]]) for rod, side in told]
            assert (len(ends), set(ends)) == (len(clamped.get(node, ())), clamped.get(node, set()))
            places = [float(mm) for mm in re.findall(r"\(([+-]\d+) mm\)", str(row[5]))]
            assert places == sorted(places)
            assert len(places) == (len(ends) if len(ends) > 1 else 0)
            if len(ends) > 1:  # told from one another by where they are, to the millimetre
                apart = np.linalg.norm(place[ends[-1]] - place[ends[0]])
                assert abs(places[-1] - places[0] - 1e3 * apart) < 1e3 * grid.gap + 1.0
        last = len(line.ends)
        # the axial force, and the moments as they turn both ends: what one element begins with the one before
        # ends with
        for j in range(1, last):  # the moment, torsion with it, goes on where nothing is clamped
            if int(line.nodes[j]) not in clamped:
                before, after = forces[element + j - 1], forces[element + j]
                assert np.hypot(own[j][9], after[1]) == pytest.approx(np.linalg.norm(before[4:]), rel=1e-5)
        assert own[last][8] == pytest.approx(forces[element + last - 1][0])
        assert own[last][9] == pytest.approx(np.hypot(*forces[element + last - 1][5:]))
        assert own[0][9] == pytest.approx(np.hypot(*forces[element][2:4]))
        at, element = at + len(line.nodes), element + last
    assert table.columns[8:] == ("design: axial force [N]", "design: bending moment [N m]")
    told = " ".join(table.notes)
    assert f"{mass(shell.net, BUNDLE) / 2.0:.3g} kg" in told
    single = 19.0 * lengths(shell.net)
    assert f"{number(single[0])} m of rods" in told
    (besides,) = bundled_note(shell)
    assert f"{number(single.sum())} m of them are bought besides" in besides
    assert bundled_note(replace(shell, edge=EdgeBeam(Rectangle(0.01, 0.01, GFRP)))) == ()
    built, cutting = Built(shell, shell.design(), solved), nesting.cut(grid, stock=6.0, kerf=0.003)
    assert schedules.rods(built, cutting).notes[-1] == schedules.bars(built, cutting).notes[-1] == besides


def test_a_model_file_gives_the_design_with_edge_beams_again(arches, solved, tmp_path):
    shell, load = arches
    supported = tuple(int(node) for node in shell.net.supports)
    write_model(
        tmp_path / "m.json", Model(shell.network(shell.design()), {"design": load}, shell.target, supported)
    )
    model = read_model(tmp_path / "m.json")
    again = find_equilibrium(assemble(model.network), model.start, 0.0 * load).state
    np.testing.assert_allclose(again.positions, solved["none"].positions, atol=1e-8)


def test_gradients_hold_with_edge_beams(arches):
    shell, load = arches
    shares = [
        sf.Share(0.5, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet")), sf.Share(0.2, sf.RodRadius())
    ]  # fmt: skip
    problem = sf.Problem(
        shell,
        sf.LoadCase("wet", load),
        shares,
        [sf.AtMost(0.005, sf.RmsMisfit("wet"))],
        variables=[sf.RestLengths(), sf.FreeRadius(0.001, 0.0014)],
    )
    slopes_hold(problem, shell.design(), 0.5)


def test_rates_of_reactions_hold_at_feet_of_edge_beams(arches, solved):
    shell, _ = arches
    assembly = assemble(shell.network(shell.design()))
    foot = int(shell.net.edges[0].nodes[0])
    rows = reaction_rows(assembly, solved["design"], 6 * foot + np.arange(3)).toarray()
    step = np.zeros(6 * assembly.count)
    step[assembly.free] = np.random.default_rng(3).normal(size=len(assembly.free))
    h = 1e-7
    there = [
        assembly.evaluate(moved(solved["design"], s * h * step.reshape(-1, 6)), tangent=False).force[foot, :3]
        for s in (1.0, -1.0)
    ]
    slope = (there[0] - there[1]) / (2 * h)
    np.testing.assert_allclose(rows @ step[assembly.free], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max())


def test_a_net_with_edge_beams_needs_to_know_what_they_are(arches):
    shell, _ = arches
    with pytest.raises(InputError, match="hang on edge beams"):
        replace(shell, edge=None)


def test_a_net_without_edge_beams_has_none_whatever_is_said_of_them(arches):
    shell, _ = arches
    plain = replace(shell, net=replace(shell.net, edges=()))
    assert shell.edge is not None
    assert plain.edge is None


def test_opensees_refuses_what_it_cannot_say(arches, solved):
    shell, load = arches
    with pytest.raises(InputError, match="built into the bent state") as caught:
        opensees_script(
            shell.network(shell.design()), [solved["none"], solved["design"]], load, title="t", name="n",
            case="c"
        )  # fmt: skip
    assert "shellform analyse" in caught.value.remedy


def test_stiffer_edge_beams_hold_the_shape_better(arches, solved):
    shell, _ = arches
    stiff = replace(shell, edge=EdgeBeam(Rectangle(0.02, 0.02, GFRP)))
    unloaded = np.zeros((len(shell.net.grid.flat), 6))
    state = find_equilibrium(assemble(stiff.network(stiff.design())), stiff.target, unloaded).state
    off = [
        np.linalg.norm(each.positions - shell.target.positions, axis=1).max()
        for each in (solved["none"], state)
    ]
    assert off[1] < off[0]


def test_edge_beams_are_named_beside_their_middles_on_the_plan_of_supports(arches):
    shell, _ = arches
    state = shell.target
    sheet = support_plan(Built(shell, shell.design(), {"none": state, "design": state}))
    words = [mark for mark in sheet.marks if isinstance(mark, Words) and mark.layer == "EDGE_BEAMS"]
    assert [each.text for each in words] == ["E0", "E1"]
    for each, line in zip(words, shell.net.edges, strict=True):
        middle = 1e3 * state.positions[line.nodes[len(line.nodes) // 2], :2]
        assert np.linalg.norm(np.array(each.place) - middle) < 1e3 * shell.net.spacing
    others = [mark for mark in sheet.marks if isinstance(mark, Words)]
    assert not any(overlap(a.box, b.box) for a in words for b in others if a is not b)


def test_edge_beams_weigh_what_they_are_long(arches):
    shell, _ = arches
    assert lengths(shell.net) == pytest.approx([0.9, 0.9], rel=2e-3)
    whole = mass(shell.net, BUNDLE)
    assert whole == pytest.approx(1.8 * 2000.0 * 19 * np.pi * 0.0012**2, rel=2e-3)
    assert -weight(shell.net, BUNDLE)[:, 2].sum() == pytest.approx(9.81 * whole, rel=1e-9)


def test_a_bundle_of_seven_glued_rods_has_the_second_moment_of_the_textbook():
    """Six rods 2r round a middle one: I = 7 π r⁴/4 + 12 π r⁴ by Steiner's theorem, Σ y² = ½ Σ d² = 12 r²."""
    r = 0.003
    area, torsion, inertia, other = Bundle(r, 7, 1.0, GFRP).constants
    assert area == pytest.approx(7 * np.pi * r**2)
    assert inertia == pytest.approx((7 / 4 + 12) * np.pi * r**4)
    assert other == inertia
    assert torsion == pytest.approx(7 * np.pi * r**4 / 2)
    assert Bundle(r, 7, 0.0, GFRP).constants[2] == pytest.approx(7 * np.pi * r**4 / 4)
    assert Bundle(r, 7, 1.0, GFRP).fibres == (pytest.approx(3 * r), pytest.approx(3 * r))


def test_a_loose_bundle_is_stressed_as_its_rods_are_each_with_its_share():
    r, moment = 0.003, np.array([2.0])
    loose = Bundle(r, 19, 0.0, GFRP).bending(moment, 0.0 * moment)
    assert loose == pytest.approx(moment / 19 * r / (np.pi * r**4 / 4))


@pytest.mark.parametrize("composite", [0.0, 0.4])
def test_a_bundle_s_derivatives_are_those_of_its_constants_and_stresses(composite):
    def made(radius):
        return Bundle(radius, 7, composite, GFRP)

    r, h, m = 0.003, 1e-8, (np.array([2.0]), np.array([-1.0]))
    slope = (np.array(made(r + h).constants) - made(r - h).constants) / (2 * h)
    np.testing.assert_allclose(made(r).constants_by_size[0], slope, rtol=1e-6)
    slope = (made(r + h).bending(*m) - made(r - h).bending(*m)) / (2 * h)
    np.testing.assert_allclose(made(r).bending_by_size(*m)[0], slope, rtol=1e-6)
    by_y, by_z = made(r).bending_by_moment(*m)
    assert by_y == pytest.approx(
        (made(r).bending(m[0] + h, m[1]) - made(r).bending(m[0] - h, m[1])) / (2 * h), rel=1e-6
    )
    assert by_z == pytest.approx(
        (made(r).bending(m[0], m[1] + h) - made(r).bending(m[0], m[1] - h)) / (2 * h), rel=1e-6
    )


def test_bundles_that_are_none_are_refused():
    for radius, count, composite, where in (
        (0.0, 7, 0.5, "radius"), (0.01, 0, 0.5, "rods"), (0.01, 500, 0.5, "rods"),
        (0.01, 7, 1.5, "composite"),
    ):  # fmt: skip
        with pytest.raises(InputError) as caught:
            Bundle(radius, count, composite, Material(1e9, 4e8))
        assert caught.value.where == f"edges.beam.{where}"


def test_rods_of_a_bundle_are_packed_about_their_middle_up_to_a_hexagon_of_twelve_rings():
    """Two lie r off their middle, three 2 r / √3; of 469 the farthest 24 r."""
    for count, squares, farthest in ((1, 0.0, 0.0), (2, 2.0, 1.0), (3, 4.0, 2.0 / 3**0.5)):
        bundle = Bundle(0.003, count, 1.0, GFRP)
        own, area = 0.25 * np.pi * 0.003**4, np.pi * 0.003**2
        assert bundle.constants[2] == pytest.approx(count * own + 0.5 * area * squares * 0.003**2)
        assert bundle.fibres == pytest.approx((0.003 * (farthest + 1.0),) * 2)
    whole = Bundle(0.003, 469, 0.5, GFRP)
    assert whole.fibres[0] == pytest.approx(0.003 * 13.0)
    places = whole._places / 0.003
    assert places.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-9)
    apart = np.linalg.norm(places[:, None] - places, axis=2) + 9.0 * np.eye(469)
    assert apart.min(axis=1) == pytest.approx(np.full(469, 2.0)), (
        "each touches another and none lies in another"
    )
    with pytest.raises(InputError, match="a number of rods up to 469"):
        Bundle(0.003, 470, 0.5, GFRP)


def test_a_clamp_is_as_stiff_as_the_edge_beam_but_no_stiffer_between_its_ends_than_a_rod_half_the_gap_long():
    """EA and GJ go with the length, EI with its cube: of clamps as long, three times and ten times as
    long."""
    reach = np.array([[0.0, 0.0, 0.2], [0.0, 0.6, 0.0], [1.2, 1.6, 0.0]])
    found = module._no_stiffer((100.0, 200.0, 300.0, 400.0), (10.0, 5.0, 2.0, 1.0), reach, 0.2)
    wanted = [[10.0, 30.0, 100.0], [5.0, 15.0, 50.0], [2.0, 54.0, 300.0], [1.0, 27.0, 400.0]]
    assert np.array(found) == pytest.approx(np.array(wanted))


LINE = SimpleNamespace(ends=np.array([[0, 1], [1, 2]]), clamps=np.array([[3, 1]]))
NET = SimpleNamespace(
    edges=(LINE,),
    target=at_rest([[9.0, 5.0, 1.0], [12.0, 5.0, 1.0], [12.0, 7.0, 1.0], [12.0, 5.0, 1.3]]),
    grid=SimpleNamespace(gap=0.2, flat=np.zeros((4, 3))),
)


def test_edge_beams_come_with_their_clamps_and_weigh_half_an_element_on_each_node():
    """Elements of 3 and 2 m, and a clamp of 0.3 m, three times half the gap."""
    rod = (10.0, 5.0, 2.0, 1.0)
    made = module.edge_beams(NET, EdgeBeam(Rectangle(0.05, 0.03, isotropic(young=1e9))), rod)
    assert [made.kinds[k] for k in made.kind] == ["edge", "edge", "clamp"]
    assert made.ends.tolist() == [[0, 1], [1, 2], [3, 1]]
    assert made.rest_length == pytest.approx([3.0, 2.0, 0.3])
    assert made.axial == pytest.approx([1.5e6, 1.5e6, 30.0])
    assert made.bending_y == pytest.approx([112.5, 112.5, 54.0])
    assert made.bending_z == pytest.approx([312.5, 312.5, 27.0])
    assert made.frames[:2, 0, :, 2] == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 2)), (
        "z stands across the surface"
    )
    heavy = EdgeBeam(Rectangle(0.05, 0.03, isotropic(young=1e9, density=800.0)))  # 1.2 kg/m
    assert lengths(NET).tolist() == [5.0]
    assert mass(NET, heavy) == pytest.approx(6.0)
    down = weight(NET, heavy)
    assert down[:, 2] == pytest.approx(-9.81 * 1.2 * np.array([1.5, 2.5, 1.0, 0.0]))
    assert not down[:, [0, 1, 3, 4, 5]].any()
    assert module.edge_beams(SimpleNamespace(edges=()), None, rod) is None
    with pytest.raises(InputError, match="edge beams"):
        module.edge_beams(NET, None, rod)
