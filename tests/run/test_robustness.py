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


@pytest.mark.parametrize(
    ("misfits", "lost", "told", "said"),
    [
        (
            [1.0, 2.0, 6.0],
            0,
            SampleRecord(3, 0, pytest.approx(3.0), pytest.approx(np.sqrt(7.0))),
            ["Of 3 structures drawn and loaded 3 stand, with a misfit of 3 ± 2.6 m²."],
        ),
        ([5.0], 2, SampleRecord(3, 2, 5.0, None), ["2 of 3 structures drawn fall under the load"]),
        ([], 4, SampleRecord(4, 4, None, None), ["4 of 4 structures drawn fall under the load"]),
        (
            [1.0, 3.0],
            1,
            SampleRecord(3, 1, 2.0, pytest.approx(np.sqrt(2.0))),
            [
                "Of 3 structures drawn and loaded 2 stand, with a misfit of 2 ± 1.4 m²",
                "1 of 3 structures drawn fall under the load",
            ],
        ),
    ],
)
def test_a_sample_tells_its_mean_and_deviation_as_far_as_it_has_any_and_how_many_were_lost(
    misfits, lost, told, said
):
    record = Robustness(SPREAD, sample(misfits, lost), NODES).record("one")
    assert record.sample == told
    first, *others = record.sentences
    assert first == "It scatters."
    for sentence, beginning in zip(others, said, strict=True):
        assert sentence.startswith(beginning)
    assert ("safety.critical_factor" in record.sentences[-1]) == (lost > 0)


def test_causes_are_listed_by_their_share_with_the_motion_in_millimetres():
    table = Robustness(SPREAD, None, NODES).table()
    assert table.rows == (
        ("supports", "0.7500", "3.8730", "0.9000"),  # √(0.75 · (9e-4 - 4e-4) m² / 25)
        ("marks", "0.2500", "2.2361", "0.1000"),
    )


@pytest.mark.parametrize("samples", [0, 9])
def test_structures_are_drawn_where_they_are_asked_for(monkeypatch, samples):
    asked, predicted = [], []
    monkeypatch.setattr(module.robust, "spread", lambda *given, **how: predicted.append(how) or SPREAD)
    monkeypatch.setattr(module.robust, "sample", lambda *given, **how: asked.append(how) or "sample")
    found = robustness(
        SimpleNamespace(samples=samples, seed=5), SimpleNamespace(node_count=NODES), None, None, None, None
    )
    assert (found.spread, found.nodes) == (SPREAD, NODES)
    assert found.sample == ("sample" if samples else None)
    assert asked == ([{"count": 9, "seed": 5}] if samples else [])
    assert predicted == [{"seed": 5}], "from the structures that are loaded"
