"""Rare failures: subset simulation against closed forms and brute force."""

import numpy as np
import pytest
from scipy.stats import chi2, norm

from shellform.errors import InputError
from shellform.reliability.subset import _level, _square, subset_simulation


def plane(beta, size):
    """P(sum z / sqrt(d) > beta) = P(-beta)."""
    return lambda z: beta - z.sum(axis=1) / np.sqrt(size)


@pytest.mark.parametrize(("beta", "size"), [(2.0, 50), (3.0902, 50), (3.0902, 800)])
def test_the_probability_beyond_a_plane_is_the_normal_distributions(beta, size):
    """Unbiased to a few percent over thirty runs of 500 samples a level, whatever the dimension."""
    found = [subset_simulation(plane(beta, size), size, count=500, seed=seed) for seed in range(30)]
    exact = norm.cdf(-beta)
    mean = np.mean([each.probability for each in found])
    spread = np.std([each.probability for each in found]) / exact
    assert mean == pytest.approx(exact, rel=4.0 * spread / np.sqrt(30))
    assert np.mean([each.variation for each in found]) == pytest.approx(spread, rel=0.5)


def test_the_probability_outside_a_sphere_is_chi_squares():
    exact = chi2.sf(60.0, 30)
    found = [subset_simulation(lambda z: 60.0 - (z**2).sum(axis=1), 30, count=500, seed=s) for s in range(20)]
    values = np.array([each.probability for each in found])
    assert values.mean() == pytest.approx(exact, abs=4.0 * values.std() / np.sqrt(20))


def test_one_in_a_thousand_takes_a_few_hundred_solves():
    found = subset_simulation(plane(3.0902, 100), 100, count=200, seed=1)
    assert found.evaluations < 800
    assert found.probability == pytest.approx(1e-3, rel=3.0 * found.variation)
    assert 0.1 < found.variation < 0.8


def test_a_kinked_limit_state_agrees_with_brute_force():
    def kinked(z):
        return np.minimum(2.6 - z[:, 0], 2.2 - np.abs(z[:, 1]) - 0.3 * z[:, 2])

    z = np.random.default_rng(0).standard_normal((400_000, 3))
    brute = (kinked(z) < 0.0).mean()
    found = [subset_simulation(kinked, 3, count=300, seed=s).probability for s in range(20)]
    assert np.mean(found) == pytest.approx(brute, abs=4.0 * np.std(found) / np.sqrt(20))


def test_a_common_failure_is_counted_at_once():
    found = subset_simulation(plane(0.5, 4), 4, count=200, seed=0)
    assert found.levels == ()
    assert found.evaluations == 200
    share = found.probability  # of independent samples
    assert found.variation == pytest.approx(np.sqrt((1.0 - share) / (200 * share)))
    assert len(found.failed) == round(200 * share)


@pytest.mark.parametrize(
    ("cap", "step"), [(0.2, 0.0), (0.05, 0.0), (0.015, 0.0), (1.0, 1 / 8)], ids=["20%", "5%", "1.5%", "steps"]
)
def test_samples_that_tie_are_counted_as_the_share_that_they_are(cap, step):
    """Of a plane with P = 3e-3 whose limit state is told up to what a share `cap` of all bears less than, or
    to `step` alone."""
    exact, most = 3e-3, norm.ppf(cap) - norm.ppf(3e-3)

    def told(z):
        g = np.minimum(plane(-norm.ppf(exact), 5)(z), most if cap < 1.0 else np.inf)
        return np.floor(g / step) * step if step else g

    found = [subset_simulation(told, 5, count=200, seed=seed) for seed in range(60)]
    values = np.array([each.probability for each in found])
    assert values.mean() == pytest.approx(exact, abs=3.0 * values.std() / np.sqrt(60))
    if cap < 0.1:  # the first level passed
        first = [each.reached for each in found if len(each.levels) == 1]
        assert np.mean(first or [cap]) == pytest.approx(cap, rel=0.3)


def test_what_never_fails_has_no_failed_point():
    found = subset_simulation(lambda z: np.full(len(z), 1.0), 3, count=50, seed=0)
    assert found.probability == 0.0
    assert found.variation == np.inf
    assert len(found.failed) == 0
    assert (found.evaluations, found.reached) == (50, 1.0), "nothing leads towards a failure"


def test_a_failure_too_rare_to_be_met_is_known_to_be_rarer_than_the_last_level():
    found = subset_simulation(plane(9.0, 3), 3, count=100, seed=0)
    assert found.probability == 0.0
    assert 1e-8 <= found.reached < 2e-8, "eight levels of a tenth, or a little more where states repeat"


def test_the_failed_point_nearest_to_the_origin_comes_first():
    found = subset_simulation(plane(3.0, 2), 2, count=400, seed=2)
    assert found.failed[0] == pytest.approx([3.0 / np.sqrt(2.0)] * 2, abs=0.6)


def test_the_same_seed_gives_the_same_probability():
    first, again = (subset_simulation(plane(2.5, 9), 9, count=100, seed=5) for _ in range(2))
    assert first.probability == again.probability


@pytest.mark.parametrize("count", [10, 105])
def test_a_count_that_cannot_be_shared_out_is_refused(count):
    with pytest.raises(InputError, match="multiple of 10"):
        subset_simulation(plane(2.0, 2), 2, count=count, seed=0)


def test_chains_step_farther_where_most_trials_are_taken_and_less_far_where_few_are():
    """From 0.6 of a deviation; the share that is taken is to come to 0.44."""
    begin = np.zeros((100, 20))
    for bound, farther in [(np.inf, True), (-np.inf, False)]:
        *_, step, spent = _level(
            lambda z: z[:, 0], begin, begin[:, 0], bound, 10, 0.6, np.random.default_rng(5)
        )
        assert spent == 900
        changes = (1.0 / np.sqrt([1, 2, 3, 4])).sum()  # after 2, 4, 6 and 8 of the chains' states
        assert step == pytest.approx(0.6 * np.exp((0.56 if farther else -0.44) * changes))


@pytest.mark.parametrize(
    ("inside", "share", "square"),
    [
        # one chain of two stays inside: as two samples of their own, (1 - p) / (2 p)
        ([[1, 1, 1], [0, 0, 0]], 1 / 2, 1 / 2),
        ([[1, 1], [0, 0], [0, 0]], 1 / 3, 2 / 3),
        # one that turns round is told no better than six samples of their own
        ([[1, 1, 0], [0, 0, 1]], 1 / 2, 1 / 6),
        # of neighbours 1/2 are both inside, of those two apart 1/3, by chance 25/81: 31/40 and 1/10 of the
        # variance
        ([[1, 1, 0], [1, 1, 1], [0, 0, 0]], 5 / 9, 4 / 45 * (1 + 2 * (2 / 3 * 31 / 40 + 1 / 3 * 1 / 10))),
        ([[1, 1], [1, 1]], 1.0, 0.0),
    ],
)
def test_a_chain_s_samples_tell_less_than_as_many_of_their_own(inside, share, square):
    """The square of the coefficient of variation, (1 - p) / (p N) (1 + gamma), gamma the sum of 2 (1 - lag /
    length) times the correlation over each lag."""
    chains = np.arange(np.size(inside)).reshape(np.shape(inside))
    assert _square(np.array(inside, dtype=bool).ravel(), chains, share) == pytest.approx(square)


def test_a_level_s_bound_lies_halfway_between_the_tenth_that_goes_on_and_the_next_one():
    """Of twenty samples between the second and the third."""
    z = np.random.Generator(np.random.Philox(3)).standard_normal((20, 2))
    ordered = np.sort(5.0 - z[:, 0])
    found = subset_simulation(lambda z: 5.0 - z[:, 0], 2, count=20, seed=3)
    assert found.levels[0] == pytest.approx(0.5 * (ordered[1] + ordered[2]), rel=1e-12)
