"""Rods in two layers: bent as single laths, locked by shear blocks, stressed by both."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import layers
from shellform.gridshell.catalogue import label
from shellform.gridshell.gridshell import erection_stress
from shellform.gridshell.layers import (
    LOCK,
    TwoLayers,
    locked_bending,
    locks,
    locks_along,
    rod_bending_stress,
    rod_forces,
    rod_stress,
)
from shellform.gridshell.tolerances import Tolerances
from shellform.net.grid import ROD
from shellform.output.workshop.block_schedule import block_marks, block_table
from shellform.output.workshop.nesting import cut
from shellform.problem.engineering import ConnectorTurn, RodUtilisation
from shellform.problem.paths import deviations, follow
from shellform.problem.terms import LoadedDesign
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.members import members_of
from shellform.reliability.refinement import rods_halved
from shellform.site.erection import erect
from shellform.structure.elements.beam import joined, make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.sections import Material, Rectangle, Round, mass_per_length, stiffness
from shellform.structure.elements.state import at_rest, from_vectors
from shellform.structure.model import Model, read_model, write_model
from shellform.structure.network import Network, assemble
from shellform.structure.solve.equilibrium import find_equilibrium
from tests.gridshell.slopes import slopes_hold
from tests.net.edge_shells import sail

LARCH = Material(12e9, 0.75e9, 460.0, 24e6)
LATH = Rectangle(0.050, 0.035, LARCH)


def test_two_laths_with_a_gap_have_the_second_moment_of_the_textbook():
    """50 × 35 mm twice, 35 mm between them: 2 b h³/12 loose, 2 (b h³/12 + b h (h)²) glued, 26 times one."""
    glued, loose = TwoLayers(LATH, 1.0), TwoLayers(LATH, 0.0)
    alone = 0.050 * 0.035**3 / 12
    assert loose.constants[2] == pytest.approx(2.0 * alone)
    assert locked_bending(loose)[0] == pytest.approx(12e9 * 2.0 * alone)
    assert locked_bending(glued)[0] == pytest.approx(12e9 * 26.0 * alone)
    assert locked_bending(glued)[1] == pytest.approx(12e9 * 2.0 * 0.035 * 0.050**3 / 12)
    assert mass_per_length(glued) == pytest.approx(2.0 * 460.0 * 0.050 * 0.035)
    assert label(glued) == "2 layers of 50 × 35 mm"


def test_laths_bear_what_bending_them_cost_and_then_the_load_s_share():
    """A cantilever bent to κ₀ = 0.12 /m and locked there, then bent on by a moment m at its end:

        b κ + B (κ - κ₀) = m,  σ = E κ h/2 + B |κ - κ₀| / (a A)

    with b = 4287.5, B = 25 725 N·m² (γ = 0.5), a A = 1.225e-4 m³. For m = 1.2 kN·m: κ = 0.142841 /m,
    σ = 29.997 + 4.797 MPa by hand. Blocks rest on chords, laths on arcs: 1e-5."""
    pair, count, bent = TwoLayers(LATH, 0.5), 33, 0.12
    along = np.linspace(0.0, 3.0, count)
    flat = np.column_stack([along, 0.0 * along, 0.0 * along])
    ends = np.column_stack([np.arange(count - 1), np.arange(1, count)])
    ea, gj, eiy, eiz = stiffness(pair)
    laths = make_beams(flat, ends, axial=ea, torsion=gj, bending_y=eiy, bending_z=eiz)
    curved = np.column_stack([np.sin(bent * along) / bent, 0.0 * along, (np.cos(bent * along) - 1.0) / bent])
    state = from_vectors(curved, np.column_stack([0.0 * along, bent * along, 0.0 * along]))
    blocks = locks_along(state, ends, np.tile([0.0, 1.0, 0.0], (count - 1, 1)), pair.locking)
    fixed = np.zeros((count, 6), dtype=bool)
    fixed[0] = True
    beams = joined(laths, blocks)
    cables = make_cables(np.zeros((0, 2), dtype=int), rest_length=[], stiffness=[])
    network = Network(flat, beams, cables, fixed, np.zeros((count, 6)))
    load = np.zeros((count, 6))
    load[-1, 4] = 1200.0
    found = find_equilibrium(assemble(network), state, load).state
    assert found.rotations[-1, 1] / 3.0 == pytest.approx(0.142841, rel=1e-4)
    assert rod_stress(pair, beams, beams.local_forces(found)) == pytest.approx(34.794e6, rel=1e-4)


def test_two_laths_have_twice_the_constants_of_one_and_bear_half_of_the_moments_each():
    pair, moments = TwoLayers(LATH), (np.array([300.0, -40.0]), np.array([-20.0, 500.0]))
    assert pair.composite == layers.TOGETHER == 0.5, "where nothing is known of the blocks"
    assert pair.constants == pytest.approx([2.0 * each for each in LATH.constants])
    assert pair.constants_by_size == pytest.approx(2.0 * LATH.constants_by_size)
    # W = b h² / 6 about either axis
    of_y, of_z = 0.05 * 0.035**2 / 6.0, 0.035 * 0.05**2 / 6.0
    assert pair.bending(*moments) == pytest.approx([150.0 / of_y + 10.0 / of_z, 20.0 / of_y + 250.0 / of_z])
    by_y, by_z = pair.bending_by_moment(*moments)
    assert by_y == pytest.approx([0.5 / of_y, -0.5 / of_y])
    assert by_z == pytest.approx([-0.5 / of_z, 0.5 / of_z])
    rods = TwoLayers(Round(0.02, LARCH))
    for k, found in enumerate(rods.bending_by_moment(*moments)):
        plus, minus = (rods.bending(*(moments + s * np.eye(2)[k][:, None])) for s in (1e-3, -1e-3))
        assert found == pytest.approx((plus - minus) / 2e-3, rel=1e-5)
    step = 1e-7
    for k, found in enumerate(pair.bending_by_size(*moments)):
        sizes = np.array(LATH.sizes)
        wider, thinner = (pair.with_sizes(sizes + s * step * np.eye(2)[k]) for s in (1.0, -1.0))
        assert wider.composite == 0.5
        slope = (wider.bending(*moments) - thinner.bending(*moments)) / (2.0 * step)
        assert found == pytest.approx(slope, rel=1e-5)


def test_what_blocks_lock_and_how_it_stresses_the_laths_follows_from_their_distance():
    """a = 70 mm, A = 1750 mm²: B = 0.6 · 12 GPa · 1750 mm² · (70 mm)² / 2."""
    pair = TwoLayers(LATH, 0.6)
    assert pair.apart == pytest.approx(0.07)
    assert pair.locking == pytest.approx(30870.0)
    assert pair.couple_stress(np.array([245.0, -122.5])) == pytest.approx([2e6, 1e6])
    assert pair.couple_stress_by_moment(np.array([3.0, -5.0, 0.0])) == pytest.approx(
        [1.0 / 1.225e-4, -1.0 / 1.225e-4, 0.0]
    )


def test_only_two_layers_that_blocks_hold_are_locked_with_the_axes_of_their_rods():
    """A rod along x on the other side of the origin."""
    place = np.array([[-10.0, -3.0, 1.0], [-9.0, -3.0, 1.0]])
    net = SimpleNamespace(grid=SimpleNamespace(rod_ends=np.array([[0, 1]]), flat=place))
    pair = TwoLayers(LATH, 0.6)
    assert locks(net, LATH, at_rest(place)) is None
    assert locks(net, TwoLayers(LATH, 0.0), at_rest(place)) is None
    made = locks(net, pair, at_rest(place))
    assert made.kinds == (LOCK,)
    assert made.bending_y == pytest.approx([pair.locking])
    assert not np.hstack([made.axial, made.torsion, made.bending_z]).any()
    np.testing.assert_allclose(made.frames[0], [np.eye(3)] * 2, atol=1e-12)


def test_what_locks_bear_is_added_to_the_forces_and_the_stress_of_their_rods():
    """Of a connector between two elements of rods, whose locks come last."""
    kinds = np.array([ROD, "connector", ROD, LOCK, LOCK])
    beams = SimpleNamespace(of_kind=lambda kind: kinds == kind)
    forces = np.arange(35.0).reshape(5, 7) - 9.0
    found = rod_forces(beams, forces)
    np.testing.assert_array_equal(found, forces[[0, 2]] + forces[[3, 4]])
    pair, own, locked = TwoLayers(LATH, 0.6), forces[[0, 2]], forces[[3, 4]]
    of_y, of_z = 0.05 * 0.035**2 / 3.0, 0.035 * 0.05**2 / 3.0  # of both laths
    alone = np.abs(own[:, [2, 5]]) / of_y + np.abs(own[:, [3, 6]]) / of_z
    couple = np.abs(locked[:, [2, 5]]) / 1.225e-4
    assert rod_bending_stress(pair, beams, forces) == pytest.approx(alone + couple)
    assert rod_bending_stress(LATH, beams, forces) == pytest.approx(2.0 * alone), "in one layer"
    loose = SimpleNamespace(of_kind=lambda kind: kinds[:3] == kind)
    assert rod_bending_stress(pair, loose, forces[:3]) == pytest.approx(alone)
    np.testing.assert_array_equal(rod_forces(loose, forces[:3]), own)


@pytest.fixture(scope="module")
def shells():
    """A sail on its corners of laths of 12 × 6 mm, sliding, half locked and in one layer, and their load."""
    surface = sail(size=3.0, rise=0.3)
    net = sf.pull_net(surface, spacing=0.5, gap=0.006, angle=np.deg2rad(45.0), elements=2)
    lath = Rectangle(0.012, 0.006, LARCH)
    joint, cable = sf.Joint(axial=1e5, torsion=0.5, bending=0.5, gap=0.006), sf.Cable(stiffness=2e3)
    found = {
        name: sf.brace(net, sf.Rod(section), joint, cable, below=surface)
        for name, section in (
            ("single", lath), ("loose", TwoLayers(lath, 0.0)), ("locked", TwoLayers(lath, 0.5))
        )
    }  # fmt: skip
    return found, found["single"].point_load(1.0)


@pytest.fixture(scope="module")
def solved(shells):
    found, load = shells
    return {
        name: {
            case: each.equilibrium.state
            for case, each in follow(shell, shell.design(), {"none": 0.0 * load, "design": load}).items()
        }
        for name, shell in found.items()
    }


def test_two_layers_are_bent_as_easily_as_one_and_stand_stiffer(shells, solved):
    found, _ = shells
    single, locked = found["single"], found["locked"]
    assert erection_stress(single.net, locked.rod.section) == erection_stress(single.net, single.rod.section)
    sunk = {
        name: float((deviations(found[name], own["design"]) - deviations(found[name], own["none"])).max())
        for name, own in solved.items()
    }
    assert sunk["locked"] < 0.6 * sunk["loose"] < 0.6 * sunk["single"]


def test_shear_blocks_are_marked_in_the_middle_between_neighbouring_crossings(shells):
    found, _ = shells
    assert block_marks(found["single"]) == []
    shell = found["locked"]
    grid, marks = shell.net.grid, block_marks(shell)
    wanted = []
    for rod in grid.rods:
        first, last = 1e3 * grid.flat[rod.nodes[[0, -1]], :2]
        share = 1e3 * rod.marks / np.linalg.norm(last - first)
        places = first + share[:, None] * (last - first)
        wanted += [(a + b) / 2.0 for a, b in itertools.pairwise(places)]
    strokes = np.array([mark.points for mark in marks])
    np.testing.assert_allclose(strokes.mean(axis=1), wanted, atol=1e-6)
    length = np.linalg.norm(strokes[:, 1] - strokes[:, 0], axis=1)
    np.testing.assert_allclose(length, 0.04 * 1e3 * min(grid.spacing, grid.spacing_v))


def test_locks_have_no_stress_in_the_target_and_local_axes_of_their_rods(shells, solved):
    shell = shells[0]["locked"]
    beams = shell.beams(shell.rod.radius)
    locked, rods = beams.of_kind("lock"), beams.of_kind("rod")
    assert locked.sum() == rods.sum() > 0
    np.testing.assert_array_equal(beams.ends[locked], beams.ends[rods])
    np.testing.assert_allclose(beams.local_forces(shell.target)[locked], 0.0, atol=1e-9)
    own = replace(beams, bending_y=beams.bending_y * locked, bending_z=0.0 * beams.bending_z)
    state = solved["locked"]["design"]
    turned = beams.local_deformations(state)[rods] - beams.local_deformations(shell.target)[rods]
    fresh = own.local_deformations(state)[locked]
    np.testing.assert_allclose(fresh[:, [2, 5]], turned[:, [2, 5]], atol=0.02 * np.abs(turned).max())


def test_utilisation_adds_what_erection_left_and_what_blocks_bear(shells, solved):
    found, _ = shells
    shell, state = found["locked"], solved["locked"]["design"]
    section, beams = shell.rod.section, shell.beams(shell.rod.radius)
    forces = beams.local_forces(state)
    own, locked = forces[beams.of_kind("rod")], forces[beams.of_kind("lock")]
    by_hand = [
        np.abs(own[:, 0]) / (2 * 0.012 * 0.006)
        + 0.5 * np.abs(own[:, 2 + end]) * 6 / (0.012 * 0.006**2)
        + 0.5 * np.abs(own[:, 3 + end]) * 6 / (0.006 * 0.012**2)
        + np.abs(locked[:, 2 + end]) / (0.012 * 0.012 * 0.006)
        for end in (0, 3)
    ]
    np.testing.assert_allclose(
        shell.utilisation(shell.design(), state), np.max(by_hand, axis=0) / section.material.strength
    )
    total = shell.rod_forces(shell.design(), state)
    np.testing.assert_allclose(total[:, 2], own[:, 2] + locked[:, 2])
    table = block_table(shell, shell.design(), {"design": state}, ["a"] * len(shell.net.grid.rods))
    assert max(row[4] for row in table.rows) > 0.0


def test_blocks_carry_what_the_laths_forces_change_by_between_two_crossings_and_all_of_it_at_rods_ends(
    shells, solved
):
    shell = shells[0]["locked"]
    states = solved["locked"]
    rods = shell.net.grid.rods
    table = block_table(shell, shell.design(), states, [f"R{k}" for k in range(len(rods))])
    assert table.columns[2:] == ("from [m]", "to [m]", "none: carried [N]", "design: carried [N]")
    beams = shell.beams(shell.rod.radius)
    locked, rows = beams.of_kind("lock"), iter(table.rows)
    ends = list(map(tuple, beams.ends[locked].tolist()))
    found = [dict(zip(ends, beams.local_forces(each)[locked], strict=True)) for each in states.values()]
    for k, rod in enumerate(rods):
        stops = np.concatenate([[0.0], rod.marks, [rod.length]])
        nodes = [int(rod.nodes[0]), *(int(rod.nodes[at]) for at in rod.at), int(rod.nodes[-1])]
        along = rod.nodes.tolist()
        for stretch in range(len(nodes) - 1):
            if nodes[stretch] == nodes[stretch + 1]:
                continue
            name, number, begin, end, *carried = next(rows)
            assert (name, number) == (f"R{k}", stretch)
            assert (begin, end) == pytest.approx(tuple(stops[stretch : stretch + 2]))
            a, b = along.index(nodes[stretch]), along.index(nodes[stretch + 1])
            for told, forces in zip(carried, found, strict=True):
                # the laths' axes lie 12 mm apart, and a moment turns an element's second end the other way
                first = 0.0 if a == 0 else forces[along[a], along[a + 1]][2] / 0.012
                last = 0.0 if b == len(along) - 1 else -forces[along[b - 1], along[b]][5] / 0.012
                assert told == pytest.approx(abs(last - first))
    assert next(rows, None) is None


def test_gradients_hold_with_two_layers(shells):
    found, load = shells
    problem = sf.Problem(
        found["locked"],
        sf.LoadCase("wet", load),
        [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.RodRadius())],
        [sf.AtMost(0.9, RodUtilisation("wet"))],
        variables=[sf.RestLengths(), sf.FreeRadius(0.004, 0.008)],
    )
    slopes_hold(problem, found["locked"].design(), 3.0)


def test_the_turn_of_connectors_divides_by_no_torsion_of_locks(shells, solved):
    found, load = shells
    shell, design = found["locked"], found["locked"].design()
    with np.errstate(all="raise"):
        ConnectorTurn("wet").measure(LoadedDesign(shell, design, solved["locked"]["design"], load))


def test_erection_slides_and_the_load_finds_locked_rods(shells):
    found, load = shells
    loose, locked = (
        erect(found[name], found[name].design(), by="supports", load=load, step=0.5)
        for name in ("loose", "locked")
    )
    assert [each.stage for each in loose.steps].count("loading") == 2
    for one, other in zip(loose.steps, locked.steps, strict=True):
        if one.stage != "loading":
            np.testing.assert_array_equal(one.state.positions, other.state.positions)
    sunk = [
        float(np.ptp([step.height for step in each.steps if step.stage in ("tightening", "loading")][-3:]))
        for each in (loose, locked)
    ]
    assert sunk[1] < sunk[0]


def test_locks_are_cut_with_their_rods_and_scatter_with_them(shells, solved, tmp_path):
    found, load = shells
    shell = found["locked"]
    supports = tuple(int(node) for node in shell.net.supports)
    write_model(
        tmp_path / "m.json", Model(shell.network(shell.design()), {"load": load}, shell.target, supports)
    )
    model = read_model(tmp_path / "m.json")
    finer = rods_halved(model)
    beams = finer.network.beams
    assert beams.of_kind("lock").sum() == beams.of_kind("rod").sum() == 2 * len(shell.net.grid.rod_ends)
    np.testing.assert_allclose(beams.local_forces(finer.start)[beams.of_kind("lock")], 0.0, atol=1e-8)
    alone = rods_halved(replace(model, start=None)).network.beams
    assert alone.of_kind("lock").sum() == len(shell.net.grid.rod_ends), "no start tells how locks are bent"
    assembly, none = assemble(finer.network), 0.0 * finer.loads["load"]
    before = find_equilibrium(assembly, finer.start, none).state
    after = find_equilibrium(assembly, before, finer.loads["load"]).state
    sunk = np.linalg.norm(after.positions - before.positions, axis=1).max()
    own = solved["locked"]
    expected = np.linalg.norm(own["design"].positions - own["none"].positions, axis=1).max()
    assert sunk == pytest.approx(expected, rel=0.06)
    members = members_of(shell)
    errors = errors_of(members, Tolerances(rod_stiffness=0.1), variables(members, 1, 0))
    for rod in members.rods:
        np.testing.assert_array_equal(errors.beam_stiffness[rod.locks], errors.beam_stiffness[rod.elements])


def test_each_rod_takes_two_laths_of_stock(shells):
    grid = shells[0]["locked"].net.grid
    twice = cut(grid, stock=6.0, laths=2)
    assert sum(len(bar.pieces) for bar in twice.bars) == 2 * len(grid.rods)


def test_blocks_that_lock_more_than_glue_are_refused():
    with pytest.raises(InputError, match="between 0 and 1"):
        TwoLayers(LATH, 1.01)
