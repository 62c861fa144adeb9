"""How a fallen structure is explained: what it bears without each cause, and which cables have left it."""

from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import failure

ROUGH = Tolerances(supports=1e-4, marks=2e-4, load_all=0.1)


class Fallen:
    """A structure that falls at the factor 0.6, and bears more of its load without the errors of some
    cause."""

    def __init__(self, factor=0.6, finer=None):
        self.factor, self.finer, self.asked = factor, finer, []
        pulls = {
            "unloaded": [1.0, 1.0, 1.0, 1.0],
            "half": [1.0, 1.0, 0.0, -1.0],
            "whole": [0.0, 1.0, 1.0, 1.0],
        }
        cables = SimpleNamespace(tension=lambda state: np.array(pulls[state]))
        self.nominal = SimpleNamespace(
            members="members",
            present="present",
            imperfections="shape",
            network=SimpleNamespace(cables=cables),
            factors=np.array([0.0, 0.5, 1.0]),
            states=("unloaded", "half", "whole"),
        )

    def with_structure(self, errors, work):
        assert all(np.any(value) for value in errors.values()), "the structure itself"
        return work(SimpleNamespace(softest=lambda state: ("softest", state)))

    def fall(self, errors, *, most, resolution=1 / 64, tell=True):
        self.asked.append((most, resolution, tell))
        without = [name for name, value in errors.items() if not any(value)]
        bears = {"supports": 0.7, "marks": 1.2, "load_all": 0.9}
        own = self.factor if resolution == 1 / 64 else self.finer or self.factor
        factor = bears[without[0]] if without else own
        return SimpleNamespace(factor=factor, kind="limit point", state="end")


@pytest.fixture
def explained(monkeypatch):
    z = {name: np.array([2.0, 3.0]) for name in ("supports", "marks", "load_all", "rod_bow")}

    def built(cables, present, errors, shape):
        assert (present, shape) == ("present", "shape")
        assert all(np.any(value) for value in errors.values()), "of the structure itself"
        return SimpleNamespace(tension=lambda state: np.array([0.0, 0.5, -1.0, -2.0]))

    monkeypatch.setattr(
        failure, "variables", lambda members, seed, number: z if (seed, number) == (5, 8) else None
    )
    monkeypatch.setattr(failure, "errors_of", lambda members, tolerances, z: z)
    monkeypatch.setattr(failure, "built_cables", built)
    return lambda workshop: failure.explained(workshop, ROUGH, seed=5, number=8)


def test_a_fall_is_explained_by_what_would_be_borne_without_each_cause_the_most_helpful_first(explained):
    workshop = Fallen()
    found = explained(workshop)
    assert list(found.without.items()) == [("marks", 1.2), ("load_all", 0.9), ("supports", 0.7)]
    assert (found.driver, found.number, found.factor, found.kind) == ("marks", 8, 0.6, "limit point")
    fine = 1 / 1024
    assert workshop.asked == [(1.0, fine, True), *3 * [(1.5, fine, False)]]
    assert (found.mode, found.state) == (("softest", "end"), "end")


def test_what_falls_in_the_count_s_steps_alone_is_explained_by_these(explained):
    """In small ones it may go on after a snap."""
    assert explained(Fallen(0.6, finer=1.0)).factor == 0.6
    assert explained(Fallen(0.6, finer=0.605)).factor == 0.605


def test_cables_have_left_that_are_slack_in_it_and_pull_in_the_perfect_structure_under_a_load_as_large(
    explained,
):
    """At 0.6 the state at half the load is the nearest: there the third is slack, too, and the fourth."""
    assert explained(Fallen()).cables.tolist() == [0]
    assert explained(Fallen(0.8)).cables.tolist() == [2, 3]


@pytest.mark.parametrize("factor", [1.0, 0.0])
def test_what_bears_its_load_or_has_no_unloaded_state_has_no_fall_to_explain(explained, factor):
    with pytest.raises(InputError, match="hasn't fallen"):
        explained(Fallen(factor))
    explained(Fallen(0.999))
    explained(Fallen(0.001))
