"""Rare failures of structures, by subset simulation and by counting."""

import numpy as np
import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.perfect import perfect
from shellform.reliability.rare import rare_failure
from shellform.reliability.standing import Workshop

ERRORS = Tolerances(supports=3e-4, load_each=0.1, load_all=0.05)


def test_subset_simulation_agrees_with_counting_fallen_structures(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.13 * nominal.load))
    drawn = workshop.drawn(ERRORS, seed=1, numbers=range(150))
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
    found = rare_failure(workshop, errors, seed=0, count=60, most=1.5)
    assert found.found.probability > 0.0
    assert found.shares["load_all"] > 0.8
