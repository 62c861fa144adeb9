"""Steps along the branch of one structure, with tangents that aren't positive definite on the way."""

import numpy as np
import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.standing import Workshop
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.whole_steps import ON_THE_WAY, Mass


def test_a_mass_begins_with_the_largest_force_over_a_length_and_eases_by_tenths():
    mass = Mass(50.0, 0.5)
    assert mass.value == 0.0
    assert mass.grow()
    assert mass.value == 100.0
    mass.ease()
    assert mass.value == pytest.approx(31.6, rel=1e-2), "which was too little before: its root is left"
    other = Mass(50.0, 0.5)
    other.ease()
    assert (other.value, other.grow(), other.value) == (0.0, True, 1.0), "a hundredth where steps had led on"


def test_a_mass_that_is_too_little_grows_at_least_twofold_until_that_leads_nowhere():
    mass, values = Mass(2.0, 1.0), []
    while mass.grow():
        values.append(mass.value)
        assert len(values) < 30
    ratios = np.array(values[1:]) / values[:-1]
    assert (ratios >= 2.0 - 1e-12).all()
    assert 0.5e4 * 2.0 < values[-1] <= 1e4 * 2.0


def test_a_mass_eases_to_none_below_a_hundredth_of_the_first():
    mass = Mass(1.0, 1.0)
    mass.grow()
    steps = []
    while mass.value:
        steps.append(mass.value)
        mass.ease()
    assert steps[0] == 1.0
    assert min(steps) > 0.01


def test_nothing_grows_from_no_force():
    assert not Mass(0.0, 1.0).grow()


def test_where_the_first_tangent_is_indefinite_damped_steps_lead_to_what_relaxation_finds(nominal):
    """Supports 2 to 4 mm off on cells of 110: of ten structures some have no first tangent to begin with."""
    workshop, indefinite = Workshop(nominal), 0
    tolerances = Tolerances(marks=1e-3, supports=1.5e-3)
    for number in range(10):
        errors = errors_of(nominal.members, tolerances, variables(nominal.members, 7, number))

        def both(loading):
            none = np.zeros_like(loading.load)
            begin, foreseen = loading._taken_along(nominal.unloaded, none, loading.bench.unloaded)
            ways = {"limit": 25, "tolerance": ON_THE_WAY, "foreseen": foreseen}
            plain = loading.newton(begin, none, **ways)
            before = loading.spent
            damped = loading.newton(begin, none, **ways, damped=True)
            took = loading.spent - before
            if plain is not None:
                assert np.array_equal(damped.state.positions, plain.state.positions)
                return 0
            rest = find_equilibrium(loading.assembly, begin, none, limit=150)
            assert damped.state.positions == pytest.approx(rest.state.positions, abs=1e-6)
            assert took < rest.factorisations
            return 1

        indefinite += workshop.with_structure(errors, both)
    assert indefinite > 0
