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


def test_the_cause_that_alone_matters_has_the_largest_share(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.1 * nominal.load))
    errors = Tolerances(load_all=0.1, connectors=1e-6)
    found = rare_failure(workshop, errors, seed=0, count=60, most=1.5)
    assert found.found.probability > 0.0
    assert found.shares["load_all"] > 0.8
