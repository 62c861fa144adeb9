"""The optimiser's checkpoint in a run folder."""

import numpy as np

from shellform.optimiser.optimum import Checkpoint, Step
from shellform.run.checkpoint import FILE, drop_checkpoint, load_checkpoint, save_checkpoint

STEP = Step(3, 0.4, {"misfit": 0.3}, {"cable_force": -0.2}, 7, 1.0, True, 2.5)
KEPT = Checkpoint(
    {"phase": "thin", "before": float("inf"), "batch": 3, "guarded": True},
    {"braces": np.array([True, False])},
    (STEP,),
)


def test_a_checkpoint_comes_back_as_it_was(tmp_path):
    save_checkpoint(tmp_path, "key", KEPT)
    found = load_checkpoint(tmp_path, "key")
    assert (found.numbers, found.history) == (KEPT.numbers, KEPT.history)
    np.testing.assert_array_equal(found.arrays["braces"], KEPT.arrays["braces"])
    drop_checkpoint(tmp_path)
    assert load_checkpoint(tmp_path, "key") is None


def test_a_checkpoint_of_another_case_or_a_damaged_one_is_not_taken_up(tmp_path):
    save_checkpoint(tmp_path, "key", KEPT)
    assert load_checkpoint(tmp_path, "other") is None
    whole = (tmp_path / FILE).read_bytes()
    for size in (0, 10, len(whole) // 2, len(whole) - 30):
        (tmp_path / FILE).write_bytes(whole[:size])
        assert load_checkpoint(tmp_path, "key") is None


def test_a_checkpoint_whose_arrays_were_altered_is_not_taken_up(tmp_path):
    save_checkpoint(tmp_path, "key", KEPT)
    with np.load(tmp_path / FILE) as data:
        altered = {**data, "braces": np.array([True])}
    np.savez(tmp_path / FILE, **altered)
    assert load_checkpoint(tmp_path, "key") is None
