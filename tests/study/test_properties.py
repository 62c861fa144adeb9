"""What must hold of every net file, case file and cable cut, whatever numbers and words they hold."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from shellform.case.case import dump_case, load_case
from shellform.gridshell.grouping import cut_lengths
from shellform.net.grid import lattice_grid
from shellform.net.net import Net
from shellform.net.notes import NetNote, NoteKind
from shellform.net.quality import Quality
from shellform.net.saved import load_net, save_net
from shellform.structure.elements.state import from_vectors
from tests.stubs import study_file

few = settings(max_examples=15, deadline=None)
above = st.floats(1e-6, 1e6)
lengths = st.lists(st.floats(1e-3, 1e3), min_size=1, max_size=40).map(np.array)


@st.composite
def nets(draw):
    """A net of a rectangle of the lattice, at places and with a quality drawn at random."""
    chance, (rows, columns) = (
        np.random.default_rng(draw(st.integers(0, 2**32 - 1))),
        draw(st.tuples(*[st.integers(2, 5)] * 2)),
    )
    lattice = np.array([[i, j] for i in range(-1, rows - 1) for j in range(columns)])
    grid = lattice_grid(
        lattice,
        spacing=(draw(above), draw(above)),
        gap=draw(st.floats(1e-9, 1.0)),
        elements=draw(st.integers(1, 3)),
    )
    count = grid.node_count
    target = from_vectors(chance.normal(size=(count, 3)), chance.normal(size=(count, 3)))
    scalars = dict(
        zip(
            ("distance_max", "spacing_error_max", "shear_angle_min", "uncovered_area"),
            chance.random(4).tolist(),
            strict=True,
        )
    )
    others = (
        "distance_mean",
        "curvature_max",
        "curvature_out_of_plane_max",
        "curvature_in_plane_max",
        "pull_max",
        "pull_mean",
        "gaussian_curvature",
    )
    maps = {name: chance.normal(size=count) for name in ("distance", "shear_angle", "spacing_error", "pull")}
    quality = Quality(
        **scalars,
        **dict.fromkeys(others, draw(st.floats(-1e300, 1e300))),
        factorisations=3,
        curvature=chance.normal(size=(4, 2, 2)),
        **maps,
    )
    ends = np.unique(np.concatenate([rod.nodes[[0, -1]] for rod in grid.rods]))
    notes = st.builds(NetNote, st.sampled_from(NoteKind), st.text(max_size=20))
    return Net(grid, target, ends, quality, tuple(draw(st.lists(notes, max_size=3))))


@few
@given(nets())
def test_net_files_give_back_every_number_and_word(tmp_path_factory, net):
    file = tmp_path_factory.mktemp("net") / "net.npz"
    save_net(file, net)
    again = load_net(file)
    assert again.notes == net.notes
    assert again.quality.summary() == net.quality.summary()
    assert (again.grid.spacing, again.grid.spacing_v, again.grid.gap) == (
        net.grid.spacing,
        net.grid.spacing_v,
        net.grid.gap,
    )
    for one, two in (
        (again.target, net.target),
        (again.grid, net.grid),
        (again.quality, net.quality),
        (again, net),
    ):
        for name, value in vars(two).items():
            if isinstance(value, np.ndarray):
                np.testing.assert_array_equal(getattr(one, name), value, name)
    for rod, other in zip(again.grid.rods, net.grid.rods, strict=True):
        assert (rod.direction, rod.index) == (other.direction, other.index)
        for name in ("nodes", "arc", "crossings", "at"):
            np.testing.assert_array_equal(getattr(rod, name), getattr(other, name), name)


@few
@given(st.data())
def test_case_files_give_back_every_number(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("case")
    case = load_case(study_file(folder, "").with_name("dome.toml"))
    stiffness = data.draw(above)
    drawn = {
        "net": {"spacing": data.draw(st.floats(0.02, 10.0)), "angle": data.draw(st.floats(-90.0, 90.0))},
        "cable": {"stiffness": stiffness, "force_max": stiffness * data.draw(st.floats(1e-3, 1.0))},
        "load": {"force": data.draw(above)},
        "rod": {"radius": data.draw(st.floats(1e-5, 0.009))},
    }
    changed = case.model_copy(
        update={name: getattr(case, name).model_copy(update=values) for name, values in drawn.items()}
    )
    file = folder / "again.toml"
    file.write_text(dump_case(changed), encoding="utf-8")
    assert load_case(file) == changed


@few
@given(lengths, st.floats(0.0, 10.0))
def test_cut_lengths_are_reached_by_each_cable_s_turnbuckle_with_as_few_as_can_be(rest, adjustment):
    cut = cut_lengths(rest, adjustment)
    assert (cut <= rest).all()
    assert (rest <= cut + adjustment).all()
    different = np.unique(cut)
    assert np.isin(different, rest).all()
    # Each needs a cut of its own: none of the shortest of each group reaches another's within one turnbuckle.
    assert (different[1:] > different[:-1] + adjustment).all()


@few
@given(lengths, st.floats(0.0, 10.0), st.randoms(use_true_random=False))
def test_cut_lengths_do_not_depend_on_the_order_of_the_cables(rest, adjustment, chance):
    order = list(range(len(rest)))
    chance.shuffle(order)
    np.testing.assert_array_equal(cut_lengths(rest[order], adjustment), cut_lengths(rest, adjustment)[order])
