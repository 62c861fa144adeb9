"""Whole steps to the equilibrium next to a state, and what is left to relaxation."""

from dataclasses import replace

import numpy as np
import pytest

from shellform.structure.network import assemble
from shellform.structure.solve import whole_steps
from shellform.structure.solve.equilibrium import LostBranch, find_equilibrium
from shellform.structure.solve.residual import ResidualNorm
from shellform.structure.solve.whole_steps import WholeSteps, next_equilibrium


@pytest.fixture(scope="module")
def bent(dome):
    """A small shell's assembly, its unloaded state, and a load that it bears."""
    assembly, load = assemble(dome.network(dome.design())), dome.point_load(3.0, every=2)
    return assembly, find_equilibrium(assembly, dome.target, 0.0 * load).state, load


@pytest.fixture
def relaxed(monkeypatch):
    """How often relaxation is asked, on the branch."""
    asked = []

    def find(*given, on_branch, **how):
        assert on_branch
        asked.append(given)
        return find_equilibrium(*given, on_branch=on_branch, **how)

    monkeypatch.setattr(whole_steps, "find_equilibrium", find)
    return asked


def test_whole_steps_come_to_what_relaxation_finds_in_fewer_factorisations(bent, relaxed):
    assembly, start, load = bent
    found = next_equilibrium(assembly, start, load)
    slow = find_equilibrium(assembly, start, load, on_branch=True)
    assert not relaxed
    np.testing.assert_allclose(found.state.positions, slow.state.positions, atol=1e-8)
    assert found.energy == pytest.approx(slow.energy, rel=1e-8)
    assert (found.stable, found.negative) == (True, 0)
    assert found.residual == ResidualNorm(assembly).residual(assembly.evaluate(found.state), load) <= 1e-8
    assert (
        0 < found.factorisations < slow.factorisations + 1
    )  # which doesn't count the last one, of stability


def test_where_definiteness_is_lost_relaxation_says_so_and_all_factorisations_count(bent, relaxed):
    assembly, start, load = bent
    with pytest.raises(LostBranch) as told:
        next_equilibrium(assembly, start, 40.0 * load)
    steps = WholeSteps(assembly)
    assert steps.newton(start, 40.0 * load, limit=10, tolerance=1e-8) is None
    with pytest.raises(LostBranch) as alone:
        find_equilibrium(assembly, start, 40.0 * load, on_branch=True)
    assert len(relaxed) == 1
    assert steps.spent > 0
    assert told.value.iterations == steps.spent + alone.value.iterations


def test_relaxation_has_to_come_to_rest_within_its_limit(bent, relaxed, monkeypatch):
    assembly, start, load = bent
    monkeypatch.setattr(whole_steps, "_PATIENCE", 1)
    found = next_equilibrium(assembly, start, load)
    assert len(relaxed) == 1
    assert found.factorisations == 1 + find_equilibrium(assembly, start, load, on_branch=True).factorisations


def test_moments_that_turn_in_space_are_left_to_relaxation(bent, relaxed):
    assembly, start, load = bent
    turning = load.copy()
    turning[len(load) // 2, 3:] = [0.0, 1e-6, 2e-6]
    next_equilibrium(assembly, start, turning)
    assert len(relaxed) == 1


def test_a_residual_counts_only_where_that_is_told_to_be_none(bent):
    assembly, start, load = bent
    steps = WholeSteps(assembly)
    here = steps.newton(start, load, limit=10, tolerance=1e-5)
    assert here is not None
    assert steps.counts(start, here.state, here.balance, load, 1e-5)
    tiny = 1e-6 * load  # of which 1e-6 may be left, not 1e-5 of the rods' forces
    off = assembly.evaluate(start)
    assert not steps.counts(start, start, off, load, 1e-5)
    assert steps.measure.most(off, tiny, 1e-5) < 1e-5


def test_an_element_turned_too_far_on_the_way_does_not_count(bent):
    assembly, start, load = bent
    steps = WholeSteps(assembly)
    here = steps.newton(start, load, limit=10, tolerance=1e-8)
    assert here is not None
    for turned, counts in ((0.0, True), (0.9, True), (3.0, False)):
        balance = replace(here.balance, turned=turned)
        assert steps.counts(start, here.state, balance, load, 1e-8) is counts
