"""Mean and deviation of the misfit of structures as built: predicted, and of structures that are loaded."""

from dataclasses import replace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.perfect import perfect
from shellform.reliability.robust import sample, spread
from shellform.reliability.standing import Workshop
from shellform.structure.elements.state import State
from tests.reliability.test_built_misfit import ALL


def times(tolerances, factor):
    return sf.Tolerances(**{name: factor * value for name, value in vars(tolerances).items()})


SMALL = times(ALL, 0.1)


@pytest.fixture(scope="module")
def told(dome, loaded):
    """Predicted with a tenth of the errors."""
    return spread(dome, *loaded, SMALL, seed=1, drawn=40)


def test_the_predicted_scatter_is_that_of_the_same_structures_solved_anew(dome, loaded, told):
    """Structures of both signs, so that what is linear in the errors is in neither mean."""
    design, _, load = loaded
    workshop = Workshop(perfect(dome, design, load))
    opposite = [
        ((each.state.positions - dome.target.positions) ** 2).sum()
        for each in (workshop.load(errors) for errors in opposites(workshop, 40))
    ]
    drawn = sample(dome, design, load, SMALL, count=40, seed=1)
    assert drawn.lost == 0
    every = np.concatenate([drawn.misfits, opposite])
    assert told.deviation > 0.01 * told.nominal
    assert told.mean - told.nominal == pytest.approx(every.mean() - told.nominal, rel=0.1)
    assert told.deviation == pytest.approx(every.std(), rel=0.05)


def opposites(workshop, count):
    members = workshop.nominal.members
    for number in range(count):
        z = variables(members, 1, number)
        yield errors_of(members, SMALL, {name: -value for name, value in z.items()})


def test_each_cause_has_its_own_share_and_all_together_what_moves_the_nodes(dome, loaded, told):
    assert tuple(told.causes) == ALL.causes
    assert sum(share for share, _ in told.causes.values()) == pytest.approx(1.0)
    assert sum(variance for _, variance in told.causes.values()) == pytest.approx(1.0)
    assert told.node_deviation.shape == (dome.node_count,)
    assert (told.node_deviation**2).sum() == pytest.approx(told.mean - told.nominal)
    some = ("supports", "marks", "load_each")
    alone = {name: spread(dome, *loaded, SMALL.only(name), seed=1, drawn=40) for name in some}
    for name in some[1:]:
        one, other = (alone[each].mean - told.nominal for each in (name, some[0]))
        assert one / other == pytest.approx(told.causes[name][0] / told.causes[some[0]][0])
        assert alone[name].causes == {name: (1.0, 1.0)}


def test_causes_are_told_in_words_from_a_hundredth_of_the_scatter_on(told):
    causes = {"marks": (0.2, 0.5), "supports": (0.795, 0.5), "rod_bow": (0.005, 0.0)}
    nodes = len(told.node_deviation)
    few = replace(told, mean=4e-6 * nodes, deviation=4.2e-6, causes=causes)
    first, *causes = few.sentences()
    assert "± 4.2 × 10⁻⁶ m²" in first
    assert " 2 mm a node" in first
    assert causes == [
        "79.5 % of the scatter of the shape comes from supports.",
        "20.0 % of the scatter of the shape comes from marks.",
    ]


def test_the_prediction_is_the_same_however_many_are_drawn_at_once(dome, loaded, monkeypatch):
    whole = spread(dome, *loaded, ALL, drawn=5)
    monkeypatch.setattr(sf.robust, "_AT_ONCE", 2)
    parts = spread(dome, *loaded, ALL, drawn=5)
    assert parts.deviation == pytest.approx(whole.deviation, rel=1e-9)
    np.testing.assert_allclose(parts.node_deviation, whole.node_deviation, rtol=1e-6)
    for name, shares in whole.causes.items():
        assert parts.causes[name] == pytest.approx(shares, rel=1e-6)


def test_a_sample_of_one_seed_begins_with_the_same_structures_whatever_its_count(dome, loaded):
    design, _, load = loaded
    five, two = (sample(dome, design, load, ALL, count=count, seed=3).misfits for count in (5, 2))
    np.testing.assert_array_equal(two, five[:2])
    other = sample(dome, design, load, ALL, count=2, seed=4).misfits
    assert (other != two).all()


def test_structures_that_fall_are_counted_and_have_no_misfit(dome, loaded):
    design, _, load = loaded
    drawn = sample(dome, design, 1.9 * load, sf.Tolerances(load_all=0.3), count=6, seed=2)
    assert 0 < drawn.lost < 6
    assert len(drawn.misfits) + drawn.lost == 6


def test_what_can_t_scatter_is_refused(dome, loaded):
    design, state, load = loaded
    with pytest.raises(InputError, match="nothing is off"):
        spread(dome, design, state, load, sf.Tolerances())
    with pytest.raises(InputError, match=r"spread\.drawn"):
        spread(dome, design, state, load, ALL, drawn=0)
    with pytest.raises(InputError, match=r"sample\.count: .*at least 1"):
        sample(dome, design, load, ALL, count=0, seed=0)
    off = State(0.9 * state.positions, state.quaternions)
    with pytest.raises(NotConverged, match="isn't a stable equilibrium"):
        spread(dome, design, off, load, ALL)
