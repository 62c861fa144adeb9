"""Which thicker rods are tried and which are named, with counts that are stood in for."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.gridshell.tolerances import Tolerances
from shellform.records.as_built import AsBuilt
from shellform.reliability.probability import counted
from shellform.reliability.safety import Judgement, UnderLoad
from shellform.run import thicker
from shellform.structure.elements.sections import BeamStiffness

ROD = sf.Rod.round(young=40e9, radius=0.01, strength=255e6)
FIRST = Design(np.array([1.0]), np.array([True]), 0.01)
ASKED = AsBuilt(0.95, None, 200)


LOADS = {"design": np.ones((1, 6))}


@pytest.mark.parametrize(
    ("stand", "at"), [((10, 37, 38, 40), 2), ((38, 40), 0), ((37, 37), None), ((None, 40), 1)]
)
def test_of_thicker_rods_the_first_are_named_of_which_no_more_fall_than_may(monkeypatch, stand, at):
    """Of 40 two, where 0.95 are to stand; where there is no unloaded state (None) none stands."""
    tried = [(f"name {k}", "shell", replace(FIRST, radius=0.011 + 0.001 * k)) for k in range(len(stand))]
    monkeypatch.setattr(thicker, "_thicker", lambda *_: iter(tried))
    asked = []

    def judged(shell, design, loads, safety):
        count = stand[round((design.radius - 0.011) / 0.001)]
        if count is None:
            raise NotConverged("there is none")
        asked.append(
            (loads, safety.probability_design, safety.probability_additional, safety.critical_factor)
        )
        fallen = tuple(range(safety.drawn - count))
        under = UnderLoad(counted(safety.drawn, count, seed=1), safety.probability_design, fallen)
        return Judgement({"design": under}, None, () if under.holds else ("falls",))

    monkeypatch.setattr(thicker, "judge", judged)
    found = thicker.rods_that_stand(None, FIRST, LOADS, Tolerances(), ASKED, seed=1)
    assert asked[0] == (LOADS, 0.95, None, None)
    if at is None:
        assert found is None
        return
    assert (found.radius, found.standing, found.drawn, found.section) == (
        tried[at][2].radius,
        stand[at],
        40,
        f"name {at}",
    )


def test_rods_become_a_tenth_thicker_each_time_up_to_what_the_net_allows(monkeypatch):
    monkeypatch.setattr(thicker, "max_radius", lambda net, rod: 0.0165)
    radii = [own.radius for _, _, own in thicker._thicker(SimpleNamespace(net=None, rod=ROD), FIRST, None)]
    assert radii == pytest.approx([0.011, 0.013, 0.015])
    monkeypatch.setattr(thicker, "max_radius", lambda net, rod: 1.0)
    assert len(list(thicker._thicker(SimpleNamespace(net=None, rod=ROD), FIRST, None))) == 8


def test_a_section_is_stiffer_that_bends_less_easily_in_its_softer_direction():
    def rod(y, z):
        return SimpleNamespace(rod=SimpleNamespace(stiffness=BeamStiffness(1.0, 9.0, y, z)))

    assert thicker._stiffer(rod(5.0, 3.0), rod(9.0, 2.0))
    assert not thicker._stiffer(rod(5.0, 3.0), rod(3.0, 3.0))
    assert not thicker._stiffer(rod(9.0, 1.9), rod(2.0, 2.0))
