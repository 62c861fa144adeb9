"""What is off, cause by cause: derivatives of the internal forces held against structures that are varied,
for three cables and three short beams."""

from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from shellform.errors import InputError
from shellform.gridshell import scatter
from shellform.gridshell.scatter import (
    Lengths,
    Loads,
    Realisation,
    Stiffness,
    Supports,
    groups_of,
    halves,
    unpacked,
)
from shellform.gridshell.tolerances import Tolerances
from shellform.net.grid import CONNECTOR
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest, from_vectors, moved

PLACES = np.array([[0.0, 0.0, 0.0], [0.5, 0.1, 0.0], [0.7, -0.3, 0.2], [0.1, 0.4, 0.5]])
CABLES = make_cables([[0, 1], [1, 2], [3, 0]], rest_length=[0.48, 0.9, 0.6], stiffness=[200.0, 300.0, 150.0])
BEAMS = make_beams(
    PLACES, [[0, 1], [1, 2], [2, 3]], axial=[50.0, 70.0, 90.0], torsion=[0.3, 0.2, 0.5], bending_y=[0.4, 0.7, 0.6],
    bending_z=[0.8, 0.5, 0.9], kind=[0, 1, 1], kinds=("rod", CONNECTOR),
)  # fmt: skip
BENT = from_vectors(
    PLACES + 0.03 * np.random.default_rng(1).normal(size=(4, 3)),
    0.2 * np.random.default_rng(2).normal(size=(4, 3)),
)
LOAD = np.random.default_rng(3).normal(size=(4, 6))
BUILT = Realisation(BEAMS, CABLES, LOAD, np.zeros((4, 6)))
LOADS = sp.csc_array(np.random.default_rng(4).normal(size=(24, 2)))
MULTIPLIERS = np.random.default_rng(5).normal(size=(24, 3))


def connectors(together):
    chosen = np.array([1, 2])
    return Stiffness("connectors", BEAMS.chosen(chosen), 0.2, together, chosen)


GROUPS = {
    "each cable's stiffness": Stiffness("cable_stiffness", CABLES, 0.1, False, np.arange(3)),
    "all cables' stiffness": Stiffness("cable_stiffness_all", CABLES, 0.1, True, np.arange(3)),
    "cables' lengths": Lengths("cable_length", CABLES, 0.004),
    "each connector": connectors(False),
    "all connectors": connectors(True),
    "loads": Loads("load_each", LOADS, 0.3),
}


def internal(built, state):
    """Internal forces (6 n,) less the load."""
    result = -built.load.ravel()
    for part in (built.beams, built.cables):
        np.add.at(result, part.dofs(), part.evaluate(state, tangent=False).force)
    return result


@pytest.fixture(params=GROUPS, name="group")
def _group(request):
    return GROUPS[request.param]


def columns(group, state=BENT):
    return group.forces(state).toarray()


def test_forces_and_their_curvature_are_the_derivatives_of_the_varied_structure_s_internal_forces(group):
    step, middle = 1e-3, internal(BUILT, BENT)
    first, second = columns(group), group.curvature(BENT).toarray()
    assert first.shape == second.shape == (24, group.count)
    for k in range(group.count):
        z = step * np.eye(group.count)[k]
        plus, minus = (internal(group.varied(BUILT, s * z), BENT) for s in (1.0, -1.0))
        np.testing.assert_allclose(first[:, k], (plus - minus) / (2 * step), atol=1e-6 * np.abs(first).max())
        np.testing.assert_allclose(second[:, k], (plus - 2 * middle + minus) / step**2, atol=1e-5)
    assert not group.motion(4).toarray().any()


def test_derivatives_by_the_state_are_those_of_the_forces_in_states_nearby_spins_about_global_axes_included(
    group,
):
    """A node's spin, as any step, is taken in halves to either side."""
    own, step = MULTIPLIERS[:, : group.count], 1e-6
    wanted = np.zeros_like(own)
    for dof in range(24):
        there, here = (
            columns(group, moved(BENT, s * step * np.eye(24)[dof].reshape(4, 6))) for s in (1.0, -1.0)
        )
        wanted[dof] = ((there - here) * own).sum(axis=0) / (2 * step)
    np.testing.assert_allclose(group.by_state(BENT, own), wanted, atol=1e-6 * max(1.0, np.abs(wanted).max()))


def test_derivatives_by_rest_lengths_are_those_of_cables_cut_longer(group):
    own, step = MULTIPLIERS[:, : group.count], 1e-7
    wanted = np.zeros(3)
    for k in range(3):
        both = []
        for s in (1.0, -1.0):
            cut = make_cables(
                CABLES.ends,
                rest_length=CABLES.rest_length + s * step * np.eye(3)[k],
                stiffness=CABLES.stiffness,
            )
            other = (
                Lengths(group.name, cut, group.deviation)
                if isinstance(group, Lengths)
                else Stiffness(group.name, cut, group.deviation, group.together, group.chosen)
                if getattr(group, "part", None) is CABLES
                else group
            )
            both.append((columns(other) * own).sum())
        wanted[k] = (both[0] - both[1]) / (2 * step)
    found = np.broadcast_to(group.by_rest_length(BENT, own), (3,))
    np.testing.assert_allclose(found, wanted, atol=1e-5 * max(1.0, np.abs(wanted).max()))
    assert found[1] == 0.0, "it is slack"


def test_stiffness_varies_by_an_exponential_of_the_chosen_alone_and_lengths_and_loads_in_proportion():
    z = np.array([0.5, -2.0])
    varied = GROUPS["each connector"].varied(BUILT, z)
    for name in ("axial", "torsion", "bending_y", "bending_z"):
        ratio = getattr(varied.beams, name) / getattr(BEAMS, name)
        assert ratio == pytest.approx([1.0, np.exp(0.1), np.exp(-0.4)])
    assert varied.cables is CABLES
    softer = GROUPS["all cables' stiffness"].varied(BUILT, np.array([-3.0])).cables
    assert softer.stiffness == pytest.approx(np.exp(-0.3) * CABLES.stiffness)
    longer = GROUPS["cables' lengths"].varied(BUILT, np.array([1.0, -2.0, 0.0])).cables
    assert longer.rest_length == pytest.approx([0.484, 0.892, 0.6])
    heavier = GROUPS["loads"].varied(BUILT, z).load
    assert heavier == pytest.approx(LOAD + 0.3 * (LOADS.toarray() @ z).reshape(4, 6))


def test_supports_move_by_their_deviation_each_in_its_own_direction_and_strain_nothing_where_they_stay():
    group = Supports("supports", np.array([6, 7, 20]), 0.005)
    motion = group.motion(4).toarray()
    assert motion.shape == (24, group.count) == (24, 3)
    assert motion[[6, 7, 20], [0, 1, 2]] == pytest.approx([0.005] * 3)
    assert motion.sum() == pytest.approx(0.015)
    started = Realisation(BEAMS, CABLES, LOAD, np.full((4, 6), 0.1))
    offset = group.varied(started, np.array([1.0, -2.0, 0.5])).offset - 0.1
    assert offset[1, :2] == pytest.approx([0.005, -0.01])
    assert offset[3, 2] == pytest.approx(0.0025)
    assert np.count_nonzero(offset) == 3
    assert (started.offset == 0.1).all(), "what was given stays as it was"
    assert not columns(group).any()
    assert not group.by_state(BENT, MULTIPLIERS).any()


def test_one_half_of_the_plan_is_heavier_by_as_much_as_the_other_is_lighter_and_by_the_share_on_average():
    places = np.array([[0.0, 10.0, 1.0], [1.0, 10.0, 2.0], [5.0, 40.0, 3.0], [6.0, 20.0, 9.0]])
    shares = halves(places)
    assert shares[:, 0] == pytest.approx(np.array([-3.0, -2.0, 2.0, 3.0]) / 2.5)
    assert shares[:, 1] == pytest.approx(np.array([-10.0, -10.0, 20.0, 0.0]) / 10.0)
    assert halves(places * [1.0, 0.0, 1.0])[:, 1].tolist() == [0.0] * 4, "in a row there is no other half"


def shell(cables=CABLES):
    """Two crossings, whose rods' nodes are 0, 1 and 2, 3, and supports at 2 and 0."""
    flat = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [3.0, 1.0, 0.0], [2.0, 1.0, 1.0]])
    grid = SimpleNamespace(flat=flat, crossing_nodes=np.array([[0, 1], [2, 3]]))
    return SimpleNamespace(
        net=SimpleNamespace(grid=grid, supports=np.array([2, 0])), target=at_rest(PLACES), cables=lambda _: cables, beams=lambda _: BEAMS
    )  # fmt: skip


def groups(load, **off):
    found = groups_of(shell(), SimpleNamespace(radius=0.01), load, Tolerances(**off))
    return {each.name: each for each in found}


def test_each_cause_that_is_given_has_its_group_and_none_else():
    load = np.zeros((4, 6))
    load[[0, 1, 3], 2] = -2.0, -3.0, -7.0
    causes = {
        "cable_stiffness": (0.05, 3), "cable_stiffness_all": (0.02, 1), "cable_length": (0.003, 3), "supports": (0.004, 6),
        "connectors": (0.1, 2), "connectors_all": (0.07, 1), "load_each": (0.2, 2), "load_all": (0.06, 1), "load_uneven": (0.03, 2),
    }  # fmt: skip
    together = groups(load, **{name: deviation for name, (deviation, _) in causes.items()})
    assert set(together) == set(causes)
    for name, (deviation, count) in causes.items():
        alone = groups(load, **{name: deviation})
        assert list(alone) == [name]
        assert (
            (alone[name].deviation, alone[name].count)
            == (together[name].deviation, count)
            == (deviation, count)
        )
    assert together["supports"].dofs.tolist() == [12, 13, 14, 0, 1, 2]
    assert together["connectors"].chosen.tolist() == [1, 2]
    each = together["load_each"].parts.toarray().reshape(4, 6, 2)
    assert each[:, 2].tolist() == [[-2.0, 0.0], [-3.0, 0.0], [0.0, 0.0], [0.0, -7.0]]
    assert np.count_nonzero(each) == 3
    assert together["load_all"].parts.toarray().ravel().tolist() == load.ravel().tolist()
    uneven = together["load_uneven"].parts.toarray().reshape(4, 6, 2)
    np.testing.assert_allclose(uneven, load[:, :, None] * halves(PLACES)[:, None])


def test_where_nothing_is_off_it_is_said_what_could_be():
    for off in ({}, {"load_all": 0.1}, {"marks": 0.001, "rod_bow": 0.001, "shape": 0.001}):
        with pytest.raises(InputError, match=r"nothing is off.*cable_length.*load_uneven"):
            groups(np.zeros((4, 6)), **off)
    bare = shell(CABLES.__class__(CABLES.ends[:0], CABLES.rest_length[:0], CABLES.stiffness[:0]))
    off = Tolerances(cable_stiffness=0.1, cable_length=0.001, cable_stiffness_all=0.1)
    with pytest.raises(InputError, match="the design a cable"):
        groups_of(bare, SimpleNamespace(radius=0.01), np.zeros((4, 6)), off)


def test_a_node_s_load_is_counted_to_the_crossing_that_is_nearest_on_the_flat_grid():
    """The second crossing's rods lie 1 apart in plan, and its middle at 2.5."""
    given = shell()
    given.net.grid.flat = np.vstack([given.net.grid.flat, [[1.2, 0.5, 0.0], [1.4, 0.5, 9.0]]])
    assert scatter.zones_of(given).tolist() == [0, 0, 1, 1, 0, 1]


def test_packed_lower_triangles_are_unpacked_to_symmetric_matrices():
    assert unpacked(np.array([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]), 3).tolist() == [
        [[1, 2, 4], [2, 3, 5], [4, 5, 6]]
    ]
