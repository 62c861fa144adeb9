"""What the edges of nets stand on."""

import numpy as np
import pytest

import shellform as sf
from shellform.case.build_net import edge_records
from shellform.errors import InputError
from shellform.net.edges import Edges, Place, _near, stand, stretches_of
from shellform.net.notes import NoteKind
from shellform.net.rims import _chains
from shellform.net.saved import load_net, net_document, save_net
from tests.net.edge_shells import barrel, oculus, opened, sail, undulating, waisted

SPACING = 0.055


@pytest.fixture(scope="module")
def vault_of_two_arches():
    surface = barrel()
    return surface, pulled(surface)


@pytest.fixture(scope="module")
def round_opening():
    surface = oculus()
    return surface, pulled(surface)


def pulled(surface, **settings):
    return sf.pull_net(surface, spacing=SPACING, gap=0.002, angle=np.deg2rad(45.0), elements=2, **settings)


def kinds(net):
    return sorted(each.kind for each in net.stretches)


@pytest.mark.parametrize(
    "place",
    [
        Place("wall", "north", height=(100.0, 200.0)),  # in millimetres
        Place("wall", "north", box=[[5.0, -9, -9], [9, 9, 9]]),
        Place("wall", "north", curve=[[0.0, 2.0], [0.4, 2.0]], within=0.01),
        Place("wall", "north", box=[[0.3, -9, -9], [9, 9, 9]], opening=True),  # which there is none of
    ],
)
def test_a_stretch_that_no_edge_comes_to_is_refused_by_its_number_and_told_where_edges_are(
    vault_of_two_arches, place
):
    surface, net = vault_of_two_arches
    before = Place("wall", "ends", box=[[0.3, -9, -9], [9, 9, 9]])
    with pytest.raises(InputError, match=r"holds no point of the surface's edges.*reach from") as error:
        stand(net, surface, Edges((before, place)))
    assert (error.value.where, error.value.value) == ("edges.stretch[1]", "north")
    rim = surface.vertices[surface.boundary[0]]
    assert ", ".join(f"{each:.4g}" for each in rim.max(axis=0)) in str(error.value)


def test_a_stretch_that_others_decide_before_it_and_one_of_openings_where_there_are_none_may_stand(
    vault_of_two_arches,
):
    surface, net = vault_of_two_arches
    first = Place("wall", "ends", box=[[0.3, -9, -9], [9, 9, 9]])
    later = [Place("free", "later", box=[[0.3, -9, -9], [9, 9, 9]]), Place("pin", opening=True)]
    found = stand(net, surface, Edges((first, *later)))
    assert {each.name for each in found.stretches} == {"", "ends"}


def test_a_net_on_the_ground_all_round_is_what_it_was(vault, net):
    found = stand(net, vault)
    assert found.grid is net.grid
    assert found.target is net.target
    assert found.quality is net.quality
    np.testing.assert_array_equal(found.supports, net.supports)
    assert found.edges == ()
    assert [(each.kind, each.whole) for each in found.stretches] == [("ground", True)]


def test_arches_hang_on_edge_beams_that_come_down_to_feet_on_the_ground(vault_of_two_arches):
    surface, net = vault_of_two_arches
    found = stand(net, surface)
    assert kinds(found) == ["beam", "beam", "ground", "ground"]
    assert len(found.edges) == 2
    for line in found.edges:
        assert not line.closed
        place = found.target.positions[line.nodes]
        np.testing.assert_allclose(place[[0, -1], 2], 0.0, atol=1e-9)
        np.testing.assert_allclose(np.abs(place[:, 0]), 0.4, atol=2e-4)
        length = np.linalg.norm(np.diff(place, axis=0), axis=1)
        assert length.max() <= 0.5 * SPACING * 1.001
        assert length.sum() == pytest.approx(2 * 0.9 * 0.5, rel=1e-3)
        assert set(line.nodes[[0, -1]]) <= set(found.supports)


def test_the_record_of_an_edge_tells_from_where_up_to_where_it_reaches(vault_of_two_arches):
    surface, net = vault_of_two_arches
    told = edge_records(stand(net, surface))
    assert {each.kind for each in told} == {"ground", "beam"}
    for each in told:
        assert each.height[0] == pytest.approx(0.0, abs=2e-3)
        assert (each.height[1] > 0.1) == (each.kind == "beam")


def test_ends_round_a_cut_are_told_apart_at_gaps_wherever_the_first_one_lies():
    round_it = np.linspace(0.0, 2.0 * np.pi, 10, endpoint=False)
    round_it[3:7] += 0.2  # gaps after 2 and after 6
    round_it[7:] += 0.4
    middle = np.column_stack([np.cos(round_it), np.sin(round_it), np.zeros(10)])
    ends = np.arange(10)
    chains = [each.tolist() for each in _chains(ends, middle, 0.7)]
    assert chains == [[3, 4, 5, 6], [7, 8, 9, 0, 1, 2]]
    assert [each.tolist() for each in _chains(ends, middle, 2.0)] == [ends.tolist()]


def test_an_edge_that_undulates_on_the_ground_stands_on_it_but_where_it_is_high():
    """A beam that went on down to where such an edge stops falling left it three supports."""
    surface = undulating()
    found = stand(pulled(surface), surface)
    low = 0.02 * surface.size[:2].max()
    ends = found.target.positions[found.rod_ends]
    standing = ends[:, 2] < low - 0.0005
    assert 0.5 < standing.mean() < 0.95
    assert set(found.rod_ends[standing].tolist()) <= set(found.supports.tolist())
    assert len(found.edges) == 4


def test_nothing_is_held_above_the_ground_unasked(vault_of_two_arches, round_opening):
    for surface, net in (vault_of_two_arches, round_opening):
        found = stand(net, surface)
        low = 0.02 * surface.size[:2].max() + 0.5 * net.grid.gap
        assert found.target.positions[found.supports, 2].max() <= low
        assert net.target.positions[net.supports, 2].max() > 5 * low


def test_rods_end_on_the_edge_beam_down_to_its_foot_however_coarse_the_mesh():
    """Arches of five sides of 0.18 m: of the lowest ones half would count as ground, 0.05 m over it."""
    surface = barrel(across=6)
    found = stand(pulled(surface), surface)
    low = 0.02 * surface.size[:2].max()
    assert found.target.positions[found.supports, 2].max() <= low + 0.5 * found.grid.gap
    for stretches in (found.stretches, stretches_of(surface)):
        assert [each.kind for each in stretches] == ["ground", "beam"] * 2
        assert max(each.points[:, 2].max() for each in stretches[::2]) <= low


def test_every_rod_s_end_is_held_or_clamped_to_an_edge_beam_by_half_the_gap(
    vault_of_two_arches, round_opening
):
    for surface, net in (vault_of_two_arches, round_opening):
        found = stand(net, surface)
        clamps = np.vstack([line.clamps for line in found.edges])
        own = set(found.rod_ends.tolist())
        assert own == (set(found.supports.tolist()) & own) | set(clamps[:, 1].tolist())
        assert not set(found.supports.tolist()) & set(clamps[:, 1].tolist())
        reach = np.linalg.norm(
            found.target.positions[clamps[:, 1]] - found.target.positions[clamps[:, 0]], axis=1
        )
        assert reach.min() == pytest.approx(0.5 * found.grid.gap, rel=1e-6)
        assert reach.max() < 0.2 * SPACING  # ends nearer to each other share a node between them


def test_the_edge_beam_of_an_opening_is_a_closed_ring(round_opening):
    surface, net = round_opening
    found = stand(net, surface)
    assert kinds(found) == ["beam", "ground"]
    (line,) = found.edges
    assert line.closed
    assert len(line.ends) == len(line.nodes)
    place = found.target.positions[line.nodes]
    np.testing.assert_allclose(np.linalg.norm(place[:, :2], axis=1), 0.12, atol=2e-3)


def test_a_shell_on_four_points_has_four_arches_that_share_their_feet():
    surface = sail()
    found = stand(pulled(surface), surface)
    assert len(found.edges) == 4
    feet = {int(node) for line in found.edges for node in line.nodes[[0, -1]]}
    assert len(feet) == 4
    np.testing.assert_allclose(np.abs(found.target.positions[sorted(feet), :2]), 0.45, atol=1e-9)


def test_the_grid_s_own_nodes_keep_their_numbers_and_places(vault_of_two_arches):
    surface, net = vault_of_two_arches
    found = stand(net, surface)
    count = len(net.grid.flat)
    np.testing.assert_array_equal(found.grid.flat[:count], net.grid.flat)
    np.testing.assert_array_equal(found.target.positions[:count], net.target.positions)
    np.testing.assert_array_equal(found.grid.flat[count:], found.target.positions[count:])


def test_free_edges_hold_nothing_and_pins_are_there_where_they_are_asked_for(vault_of_two_arches):
    surface, net = vault_of_two_arches
    free = stand(net, surface, Edges((Place("free", box=[[0.3, -9, -9], [9, 9, 9]]),)))
    assert kinds(free) == ["beam", "free", "ground", "ground"] or kinds(free) == ["beam", "free", "ground"]
    assert free.target.positions[free.supports, 0].max() < 0.4 - 1e-6 or len(free.edges) == 1
    pinned = stand(net, surface, Edges(outer="pin"))
    np.testing.assert_array_equal(pinned.supports, net.supports)
    assert pinned.edges == ()


def test_walls_are_named_by_height_box_and_curve(vault_of_two_arches):
    surface, net = vault_of_two_arches
    top = surface.vertices[:, 2].max()
    for place in (
        Place("wall", "north", height=(0.5 * top, 2 * top), box=[[0.3, -9, -9], [9, 9, 9]]),
        Place("wall", "north", curve=[[0.4, -0.2], [0.4, 0.2]], within=0.01),
    ):
        found = stand(net, surface, Edges((place,)))
        walls = [each for each in found.stretches if each.kind == "wall"]
        assert [each.name for each in walls] == ["north"]
        on = [node for node in found.supports if found.target.positions[node, 2] > 0.25 * top]
        assert on
        assert (found.target.positions[on, 0] > 0.39).all()
        # The beams beside the wall stand on the ground and on the wall.
        assert len(found.edges) == 3


def test_openings_can_be_told_apart_from_the_outer_edge(round_opening):
    surface, net = round_opening
    found = stand(net, surface, Edges(openings="free"))
    assert kinds(found) == ["free", "ground"]
    assert found.edges == ()
    other = stand(net, surface, Edges((Place("pin", opening=True),)))
    np.testing.assert_array_equal(other.supports, net.supports)


def test_the_ground_s_level_can_be_given():
    surface = barrel(raised=0.5)
    net = pulled(surface)
    assert kinds(stand(net, surface)) == ["beam", "beam", "ground", "ground"]
    with pytest.raises(InputError, match="nothing holds the shell") as caught:
        stand(net, surface, Edges(ground=0.0))
    assert "edges.ground" in str(caught.value)


def test_an_edge_stands_on_the_ground_whose_level_is_given_wherever_that_is():
    surface = barrel(raised=0.5)
    net = pulled(surface)
    found = stand(net, surface, Edges(ground=0.5))
    np.testing.assert_array_equal(found.supports, stand(net, surface).supports)
    assert kinds(stand(net, surface, Edges(ground=0.9))) == ["ground"], "what lies under it stands on it too"


def test_where_two_places_hold_the_first_decides(vault_of_two_arches):
    surface, net = vault_of_two_arches
    right = [[0.3, -9, -9], [9, 9, 9]]
    for one, other in (("wall", "free"), ("free", "wall")):
        found = stand(
            net, surface, Edges((Place(one, "first", box=right), Place(other, "second", box=right)))
        )
        assert {each.kind for each in found.stretches} - {"ground", "beam"} == {one}
        assert "second" not in {each.name for each in found.stretches}


def test_ends_nearer_than_a_fifth_of_the_spacing_share_a_node_and_groups_grow_no_longer():
    ends = [(at, None) for at in (0.0, 0.12, 0.19, 0.21, 0.3, 0.7)]
    groups = [[at for at, _ in group] for group in _near(ends, 0.2)]
    assert groups == [[0.0, 0.12, 0.19], [0.21, 0.3], [0.7]]


def test_a_net_cut_off_by_an_outline_has_its_edge_along_it():
    surface = barrel(length=1.2)
    outline = [[-0.35, -9.0], [0.35, -9.0], [0.35, 9.0], [-0.35, 9.0]]
    net = pulled(surface, outline=outline)
    found = stand(net, surface)
    beams = [line for line in found.edges if len(line.clamps) > 5]
    assert len(beams) == 2
    for line in beams:
        np.testing.assert_allclose(np.abs(found.target.positions[line.clamps[:, 0], 0]), 0.35, atol=5e-3)

    cut = [each for each in found.stretches if np.ptp(each.points[:, 0]) < 0.1]
    assert {each.kind for each in cut} == {"beam", "ground"}
    for side in (-0.35, 0.35):
        own = [each for each in cut if abs(each.points[0, 0] - side) < 0.1]
        assert sum(each.length for each in own) == pytest.approx(2.0 * 0.5 * 0.9, rel=0.05), "an arch"


def test_a_net_cut_off_by_an_outline_within_its_surface_has_an_edge_all_round():
    surface, angles = barrel(length=1.2), np.linspace(0.0, 2.0 * np.pi, 60, endpoint=False)
    outline = 0.25 * np.column_stack([np.cos(angles), np.sin(angles)])
    found = stand(pulled(surface, outline=outline), surface, Edges(outer="wall"))
    (cut,) = [each for each in found.stretches if np.ptp(each.points[:, 0]) < 0.6]
    assert cut.whole
    assert cut.length == pytest.approx(np.linalg.norm(np.diff(cut.points, axis=0), axis=1).sum())
    np.testing.assert_array_equal(cut.points[0], cut.points[-1])


def test_a_net_with_edge_beams_comes_back_from_its_file(tmp_path, vault_of_two_arches):
    surface, net = vault_of_two_arches
    found = stand(
        net, surface, Edges((Place("wall", "north", height=(0.1, 9.0), box=[[0.3, -9, -9], [9, 9, 9]]),))
    )
    save_net(tmp_path / "net.npz", found)
    again = load_net(tmp_path / "net.npz")
    for one, other in zip(found.edges, again.edges, strict=True):
        np.testing.assert_array_equal(one.nodes, other.nodes)
        np.testing.assert_array_equal(one.clamps, other.clamps)
        assert (one.closed, one.name) == (other.closed, other.name)
    for one, other in zip(found.stretches, again.stretches, strict=True):
        np.testing.assert_array_equal(one.points, other.points)
        assert (one.kind, one.name, one.opening, one.whole) == (
            other.kind,
            other.name,
            other.opening,
            other.whole,
        )
    document = net_document(found)
    assert {each["kind"] for each in document["edges"]} == {"ground", "wall", "beam"}
    assert len(document["edge_beams"]) == len(found.edges)


def test_unknown_kinds_are_refused_with_those_known():
    for make in (lambda: Edges(outer="flying"), lambda: Place("fill")):
        with pytest.raises(InputError, match="is no kind of edge") as caught:
            make()
        assert "beam" in caught.value.remedy


def test_no_rod_runs_beside_an_edge_with_hardly_a_joint():
    """Rods of the grid's outermost lines lie 3 cm inside the arched ends, where joints are left out, and have
    joints near the feet alone: with these the whole arch between them leaned out by a quarter of a metre."""
    net = sf.pull_net(waisted(), spacing=1.0, gap=0.03, angle=0.0, elements=2)
    free = []
    for rod in net.grid.rods:
        fastened = np.concatenate([[0.0], rod.marks, [rod.length]])
        free.append(float(np.diff(fastened).max()))
    assert max(free) < 2.5, "of the spacing"
    along = {rod.index for rod in net.grid.rods if rod.direction == "v"}
    assert along == set(range(-3, 4)), "the lines at 4 m are left out, and no others"
    assert any(
        each.kind is NoteKind.RODS and each.text.startswith("2 rods that run beside") for each in net.notes
    )


def test_rods_beside_an_opening_that_go_on_beyond_it_stay():
    """One of 14 joints has 4 spacings without any beside the opening. Left out it took joints on either side
    along, of which other rods then had too few, until no net was left."""
    net = sf.pull_net(opened(), spacing=0.7, gap=0.02, angle=0.0, offset=(0.5, 0.5), elements=1)
    free = [np.diff([0.0, *rod.marks, rod.length]).max() / 0.7 for rod in net.grid.rods]
    assert max(free) > 2.5
    assert (len(net.grid.rods), len(net.grid.lattice)) == (35, 180), "four of a single joint stay"
    assert not any("beside the edge" in each.text for each in net.notes)


@pytest.mark.parametrize(
    ("cut", "kept"),
    [
        ({"outline": [(-0.2, -0.5), (0.2, -0.5), (0.2, 0.5), (-0.2, 0.5)]}, 0.5),
        ({"ground": 0.08}, None),
    ],
)
def test_what_lies_beyond_a_level_or_an_outline_is_no_edge_and_loads_nothing(
    vault_of_two_arches, tmp_path, cut, kept
):
    """A barrel of 0.8 m, of which the middle half is built, or what lies above a level."""
    surface, whole = vault_of_two_arches
    net = stand(pulled(surface, **cut), surface, Edges(ground=cut.get("ground")))
    save_net(tmp_path / "net.npz", net)
    for each in (net, load_net(tmp_path / "net.npz")):
        load = sf.loads.concrete(each, surface, thickness=0.003, density=2400.0)
        area = -load[:, 2].sum() / (9.81 * 0.003 * 2400.0)
        assert area == pytest.approx(net.cover.area, rel=1e-2), "which is sampled"
        if kept is not None:
            assert area == pytest.approx(kept * surface.area, rel=1e-9)
        points = np.vstack([stretch.points for stretch in each.stretches])
        assert (net.limits.beyond(points) <= 0.5 * net.spacing).all()
    assert sf.loads.concrete(whole, surface, thickness=0.003)[:, 2].sum() == pytest.approx(
        -9.81 * 0.003 * 2500.0 * surface.area
    )
