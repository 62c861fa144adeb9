"""Rare failures of structures, by subset simulation and by counting."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.perfect import perfect
from shellform.reliability.rare import _shares, rare_failure
from shellform.reliability.standing import Workshop

ERRORS = Tolerances(supports=3e-4, load_each=0.1, load_all=0.05)


def test_subset_simulation_agrees_with_counting_fallen_structures(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.13 * nominal.load))
    drawn = workshop.load_numbers(ERRORS, seed=1, numbers=range(150))
    share = 1.0 - np.mean([each.stands for each in drawn])
    found = rare_failure(workshop, ERRORS, seed=1, count=100, most=1.5).found
    doubt = np.hypot(found.variation * found.probability, np.sqrt(share * (1.0 - share) / 150))
    assert 0.0 < share < 0.6
    assert found.probability == pytest.approx(share, abs=3.0 * doubt)


def test_broken_off_it_goes_on_with_the_factors_that_are_known(dome, nominal):
    workshop, heard = Workshop(perfect(dome, dome.design(), 1.1 * nominal.load)), []
    whole = rare_failure(
        workshop, ERRORS, seed=3, count=20, most=1.5, tell=lambda found: heard.append(list(found))
    )
    known = heard[len(heard) // 2]
    again = []
    resumed = rare_failure(
        workshop,
        ERRORS,
        seed=3,
        count=20,
        most=1.5,
        known=known,
        tell=lambda found: again.append(list(found)),
    )
    assert 0 < len(known) < len(heard[-1]) == whole.found.evaluations
    assert all(len(found) > len(known) for found in again), "none is loaded again"
    assert again[-1] == heard[-1]
    assert (resumed.found.probability, resumed.shares) == (whole.found.probability, whole.shares)


def test_the_cause_that_alone_matters_has_the_largest_share(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.1 * nominal.load))
    errors = Tolerances(load_all=0.1, connectors=1e-6)
    found = rare_failure(workshop, errors, seed=0, count=100, most=1.5)
    assert found.found.probability > 0.0
    assert found.shares["load_all"] > 0.8


def test_causes_share_the_squared_distance_of_the_failures_mean_less_what_chance_leaves_of_each_variable():
    """The median of the squares is that of one normal variable of deviation 1, so that each holds 1 by
    chance."""
    chance = 0.4549**0.5
    mean = np.array([3.0, -chance, chance, -2.0, chance])
    aside = np.array([1.0, -2.0, 0.5, 0.3, 0.0])
    found = SimpleNamespace(failed=np.array([mean + aside, mean - aside]))
    parts = np.array([9.0 + 0.4549 - 2.0, 4.0 + 2 * 0.4549 - 3.0])
    expected = parts / parts.sum()
    assert _shares(found, ["marks", "supports"], [2, 3]) == pytest.approx(
        {"marks": expected[0], "supports": expected[1]}
    )
    less = SimpleNamespace(failed=np.array([[3.0, chance, chance, 0.5, chance]]))
    assert _shares(less, ["marks", "supports"], [2, 3]) == pytest.approx({"marks": 1.0, "supports": 0.0})
    nothing = SimpleNamespace(failed=np.full((1, 5), 1.0))
    assert _shares(nothing, ["marks", "supports"], [2, 3]) == {"marks": 0.0, "supports": 0.0}
    assert _shares(SimpleNamespace(failed=np.zeros((0, 5))), ["marks", "supports"], [2, 3]) == {}
