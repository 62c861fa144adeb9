"""Bounds on a probability from a count."""

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.reliability.probability import counted


def test_where_all_stand_the_bound_is_the_root_of_the_doubt():
    """p^n = 1 - c: so many would stand by chance (rule of three)."""
    assert counted(200, 200, seed=0).at_least == pytest.approx(0.05 ** (1 / 200), rel=1e-12)
    assert counted(200, 200, seed=0).at_most == 1.0


def test_clopper_and_pearsons_published_limits_come_out():
    """Brown, Cai and DasGupta 2001 and R's binom.test(7, 10): 95 % two-sided 0.3475471, 0.9332605."""
    found = counted(10, 7, seed=0, confidence=0.975)
    assert found.at_least == pytest.approx(0.3475471, abs=5e-8)
    assert found.at_most == pytest.approx(0.9332605, abs=5e-8)


def test_the_bound_holds_at_least_as_often_as_it_says():
    rng = np.random.default_rng(0)
    for p in (0.5, 0.9, 0.99):
        held = [counted(60, int(s), seed=0, confidence=0.9).at_least <= p for s in rng.binomial(60, p, 2000)]
        assert np.mean(held) > 0.9 - 0.02


def test_none_standing_bounds_nothing_from_below():
    assert counted(5, 0, seed=0).at_least == 0.0


def test_299_structures_of_which_all_stand_show_99_percent():
    """Wilks 1941: n = ln 0.05 / ln 0.99."""
    assert counted(298, 298, seed=0).at_least < 0.99 <= counted(299, 299, seed=0).at_least


@pytest.mark.parametrize(("drawn", "standing"), [(5, 6), (5, -1), (0, 0)])
def test_impossible_counts_are_refused(drawn, standing):
    with pytest.raises(InputError, match="drawn"):
        counted(drawn, standing, seed=0)


@pytest.mark.parametrize("confidence", [0.0, 1.0])
def test_a_certain_confidence_is_refused(confidence):
    with pytest.raises(InputError, match="confidence"):
        counted(5, 5, seed=0, confidence=confidence)
