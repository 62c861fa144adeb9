"""What scatter does to a design is told in the units of people, from a spread and a sample with known
numbers."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.records.scattering import CauseRecord, SampleRecord
from shellform.run import robustness as module
from shellform.run.robustness import Robustness, robustness

NODES = 25
SPREAD = SimpleNamespace(
    nominal=4e-4,
    mean=9e-4,
    deviation=2e-4,
    linear=16e-4,
    node_deviation=np.array([0.001, 0.004, 0.002]),
    causes={"marks": (0.25, 0.1), "supports": (0.75, 0.9)},
    sentences=lambda: ["It scatters."],
)


def sample(misfits, lost):
    return SimpleNamespace(misfits=np.array(misfits), lost=lost)


def test_misfits_are_told_as_root_mean_square_distances_of_a_node_too():
    record = Robustness(SPREAD, None, NODES).record("polished")
    assert (record.design, record.misfit, record.misfit_mean, record.misfit_deviation) == (
        "polished", 4e-4, 9e-4, 2e-4,
    )  # fmt: skip
    assert record.deviation_rms == pytest.approx(0.004)
    assert record.deviation_rms_mean == pytest.approx(0.006)
    assert record.wander_max == 0.004
    assert record.causes == {"marks": CauseRecord(0.25, 0.1), "supports": CauseRecord(0.75, 0.9)}
    assert (record.sentences, record.sample) == (("It scatters.",), None)
    less = SimpleNamespace(**{**vars(SPREAD), "mean": -1e-9})
    assert Robustness(less, None, NODES).record("one").deviation_rms_mean == 0.0, "what rounding leaves"


@pytest.mark.parametrize(
    ("misfits", "lost", "told"),
    [
        ([1.0, 2.0, 6.0], 0, SampleRecord(3, 0, pytest.approx(3.0), pytest.approx(np.sqrt(7.0)))),
        ([5.0], 2, SampleRecord(3, 2, 5.0, None)),
        ([], 4, SampleRecord(4, 4, None, None)),
        ([1.0, 3.0], 1, SampleRecord(3, 1, 2.0, pytest.approx(np.sqrt(2.0)))),
    ],
)
def test_a_sample_tells_its_mean_and_deviation_as_far_as_it_has_any_and_how_many_were_lost(
    misfits, lost, told
):
    record = Robustness(SPREAD, sample(misfits, lost), NODES).record("one")
    assert record.sample == told
    assert len(record.sentences) == 1 + (lost > 0)
    if lost:
        assert record.sentences[1].startswith(f"{lost} of {told.count} structures drawn have no equilibrium")
        assert "safety.critical_factor" in record.sentences[1]


def test_causes_are_listed_by_their_share_with_the_motion_in_millimetres():
    table = Robustness(SPREAD, None, NODES).table()
    assert table.rows == (
        ("supports", "0.7500", "6.9282", "0.9000"),  # √(0.75 · 16e-4 m² / 25)
        ("marks", "0.2500", "4.0000", "0.1000"),
    )


@pytest.mark.parametrize("samples", [0, 9])
def test_structures_are_drawn_where_they_are_asked_for(monkeypatch, samples):
    asked = []
    monkeypatch.setattr(module.robust, "spread", lambda *given: SPREAD)
    monkeypatch.setattr(module.robust, "sample", lambda *given, **how: asked.append(how) or "sample")
    found = robustness(
        SimpleNamespace(samples=samples, seed=5), SimpleNamespace(node_count=NODES), None, None, None, None
    )
    assert (found.spread, found.nodes) == (SPREAD, NODES)
    assert found.sample == ("sample" if samples else None)
    assert asked == ([{"count": 9, "seed": 5}] if samples else [])
