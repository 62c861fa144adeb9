"""Fresh samples that agree or don't, and the turns between them, with descents and samples that are told."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from shellform.optimiser import agreeing, minding
from tests.optimiser.told import accepted_one, iterate, told_search


@pytest.fixture
def search(monkeypatch):
    return told_search(monkeypatch, minding, agreeing)


@pytest.fixture
def samples(search, monkeypatch):
    """Fresh samples that tell whether the last design stands, and turns led by what falls in them."""
    told = SimpleNamespace(stands=[], ends=[], judged=[], log=[])

    def fresh(search, it):
        told.judged.append(it.accepted[-1].objective)
        return SimpleNamespace(stands=told.stands.pop(0)), replace(it, samples=it.samples + 1)

    def descend(fine, it):
        told.log.append(("descend", fine.evaluations))
        search.evaluator.evaluations += 10
        end = told.ends.pop(0)
        return it if end is None else replace(it, accepted=(*it.accepted, accepted_one(end)))

    def sound(search, last):
        return SimpleNamespace(objective=last.objective) if last.objective != 0.666 else None

    def lead_by(search, it, built, least):
        told.log.append((built, least))
        return replace(it, mind="some")

    monkeypatch.setattr(agreeing, "fresh", fresh)
    monkeypatch.setattr(agreeing, "sound", sound)
    monkeypatch.setattr(agreeing, "accepted_design", lambda search, found: accepted_one(found.objective))
    monkeypatch.setattr(agreeing, "aims", lambda asked, judged: asked)
    monkeypatch.setattr(agreeing, "lead_by", lead_by)
    monkeypatch.setattr(agreeing, "last_sound", lambda search, it: it)
    monkeypatch.setattr(agreeing, "descend", descend)
    told.agreed = lambda it=None: agreeing.agreed(search, it or iterate(1.0, phase="agree"))
    return told


def test_a_sample_in_which_nothing_falls_agrees_at_once(samples):
    samples.stands = [True]
    agrees, it = samples.agreed()
    assert agrees
    assert (it.samples, it.stood, it.led_to, samples.log) == (1, 1, 1.0, [])


def test_what_falls_in_a_sample_leads_a_turn_and_the_next_sample_judges_its_design(samples):
    samples.stands, samples.ends = [False, False, True, True], [0.95, 0.9, 0.89]
    agrees, it = samples.agreed()
    assert agrees
    assert samples.judged == [1.0, 0.95, 0.9, 0.89]
    assert samples.log == [
        ("built 1.0", "sample 1"),
        ("descend", 12),
        ("built 0.95", "sample 2"),
        ("descend", 22),
        ("built 0.9", {}),
        ("descend", 32),
    ], "a tenth of a hundred and twenty evaluations a turn"
    assert [each.objective for each in it.accepted] == [1.0, 0.95, 0.9, 0.89]
    assert it.led_to == 0.89


def test_where_turns_go_on_after_a_sample_agreed_and_no_later_one_does_the_design_that_stood_is_taken(
    samples,
):
    samples.stands, samples.ends = [False, True, *[False] * 20], [0.9, *[0.8] * 20]
    agrees, it = samples.agreed()
    assert agrees
    assert [each.objective for each in it.accepted] == [1.0, 0.9]
    assert (it.stood, it.led_to) == (2, 0.9)


def test_no_sample_agrees_where_the_evaluations_end_before(samples, search):
    samples.stands, samples.ends = [False] * 20, [0.9 - 0.01 * k for k in range(20)]
    agrees, _ = samples.agreed()
    assert not agrees
    assert search.evaluator.evaluations == 120, "a fifth more than were asked for"


def test_after_a_turn_without_a_step_a_sample_can_lead_on_and_not_agree(samples):
    samples.stands, samples.ends = [False, True], [None]
    agrees, it = samples.agreed()
    assert not agrees
    assert samples.judged == [1.0, 1.0]
    assert it.stood == 0
    samples.stands, samples.ends = [False, False, True], [None, 0.8]
    agrees, it = samples.agreed(iterate(1.0, phase="agree", paused=True))
    assert agrees
    assert it.accepted[-1].objective == 0.8
    assert samples.stands == [], "paused it takes the first one with which a sample agrees"


def test_a_turn_without_a_step_is_the_last_one_after_a_dozen_samples_or_at_the_design_that_stood(samples):
    samples.stands, samples.ends = [False], [None]
    agrees, it = samples.agreed(iterate(1.0, phase="agree", samples=11))
    assert not agrees
    assert it.samples == 12
    samples.stands, samples.ends = [False, False], [None, None]
    agrees, it = samples.agreed(iterate(1.0, phase="agree", samples=10))
    assert it.samples == 12
    stood = iterate(1.0, phase="agree", until=8, begun=1, stood=1, led_to=1.0, mind="some", samples=1)
    samples.stands, samples.ends = [], [None]
    agrees, it = samples.agreed(stood)
    assert agrees, "with it a sample has agreed"


def test_a_turn_to_a_design_that_its_path_does_not_lead_to_ends_the_search(samples):
    samples.stands, samples.ends = [False], [0.666]
    agrees, _ = samples.agreed()
    assert not agrees
    assert samples.judged == [1.0]


def test_nothing_is_drawn_where_nothing_is_asked_or_it_is_left_to_whoever_judges(samples, search):
    nothing = iterate(1.0, accepted=())
    assert samples.agreed(nothing) == (True, nothing)
    search.asked.confirmed = None
    it = iterate()
    assert samples.agreed(it) == (True, it)
    search.asked = None
    assert samples.agreed(it) == (True, it)


@pytest.mark.parametrize(("trusted", "left"), [(True, 41), (False, 25)])
def test_thinning_leaves_two_fifths_of_the_evaluations_where_trials_are_not_trusted(search, trusted, left):
    search.evaluations, search.asked.trusted = 41, trusted
    assert agreeing.leaving_some(search).evaluations == left
    search.asked = None
    assert agreeing.leaving_some(search).evaluations == 41


@pytest.mark.parametrize(
    ("taut", "changes", "pauses"),
    [(29, {}, True), (30, {}, False), (29, {"trusted": True}, False), (29, {"confirmed": None}, False)],
)
def test_thinning_pauses_once_fewer_than_three_quarters_of_the_cables_are_left(
    search, monkeypatch, taut, changes, pauses
):
    monkeypatch.setattr(agreeing, "taut_count", lambda *_: taut)
    for name, value in changes.items():
        setattr(search.asked, name, value)
    assert agreeing.pausing(search, iterate(counted=40)) == pauses
    search.asked = None
    assert not agreeing.pausing(search, iterate(counted=40))
