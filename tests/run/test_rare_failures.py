"""What is kept and told of how rarely a design falls."""

from types import SimpleNamespace

import pytest

from shellform.run import rare_failures


@pytest.mark.parametrize(("failed", "probability", "variation"), [((1, 2), 0.004, 0.3), ((), 0.0005, None)])
def test_how_rarely_it_falls_is_the_probability_or_the_least_share_that_was_reached(
    monkeypatch, tmp_path, failed, probability, variation
):
    (tmp_path / "designs").mkdir()
    told, known = [], []
    monkeypatch.setattr(rare_failures, "Workshop", lambda nominal: nominal)
    one = SimpleNamespace(name="one", tolerances=None, key=lambda seed: "key", nominal=lambda load: None)

    def rare(workshop, tolerances, *, seed, count, known, tell):
        asked.append((seed, count, list(known)))
        tell([-0.25, 0.0, 0.5])
        found = SimpleNamespace(
            failed=failed, probability=0.004, reached=0.0005, variation=0.3, evaluations=620
        )
        return SimpleNamespace(found=found, shares={"marks": 0.7})

    asked = known
    monkeypatch.setattr(rare_failures, "rare_failure", rare)

    def once():
        return rare_failures.rare_of(tmp_path, one, "wind", count=20, seed=7, tell=told.append)

    found = once()
    assert (found.design, found.load, found.structures, found.shares) == ("one", "wind", 620, {"marks": 0.7})
    assert (found.probability, found.variation) == (probability, variation)
    once()
    assert asked == [(7, 20, []), (7, 20, pytest.approx([-0.25, 0.0, 0.5]))], "it goes on from what was kept"
    assert told == [3, 3]
    kept = rare_failures.read_drawn(tmp_path, "one-rare", "key 20").paths["wind"]
    assert kept.stand == (False, True, True)
    rare_failures.rare_of(tmp_path, one, "snow", count=20, seed=7, tell=told.append)
    assert asked[-1] == (7, 20, []), "nothing of another load"
    assert set(rare_failures.read_drawn(tmp_path, "one-rare", "key 20").paths) == {"wind", "snow"}
