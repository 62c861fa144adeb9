"""The ladder of attempts: nothing where the first succeeds, the same net each time where it doesn't, and what
was tried where none helps.
"""

import dataclasses
import math

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.net.chebyshev import NetSettings, NetTuning, net_at
from shellform.net.ladder import LADDER, Rung, _changed, _vain, climbed_net
from shellform.net.notes import NetNote, NoteKind
from shellform.net.orientation import oriented_net
from shellform.net.pull import _watched
from shellform.net.refusal import Attempt, Change, NoNet, Reason, Stalled
from shellform.net.saved import load_net, save_net
from shellform.surface.shape.target import make_surface
from tests.net.test_settings import ball, bowl
from tests.surface.test_fairing import sheet

SETTINGS = NetSettings(spacing=0.9, gap=0.9 / 27.5, elements=2)
ANY = NetSettings(spacing=0.25, gap=0.005)


@pytest.fixture(scope="module")
def umbrella():
    """Four hypars that meet in creases, 12 × 12 m."""
    line = np.linspace(-6.0, 6.0, 29)
    x, y = (each.ravel() for each in np.meshgrid(line, line, indexing="ij"))
    i = np.arange(29 * 29).reshape(29, 29)
    a, b, c, d = i[:-1, :-1].ravel(), i[1:, :-1].ravel(), i[1:, 1:].ravel(), i[:-1, 1:].ravel()
    z = 2.4 * (1.0 - np.abs(x / 6.0)) * (1.0 - np.abs(y / 6.0))
    return make_surface(
        np.column_stack([x, y, z]), np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    )


@pytest.fixture(scope="module")
def tighter(umbrella):
    """Its net, off the creases at the first attempt."""
    return climbed_net(umbrella, SETTINGS, angle=math.pi / 4)[0]


def test_where_the_first_attempt_succeeds_nothing_is_changed():
    surface, settings = bowl(), NetSettings(spacing=0.25, gap=0.005, elements=2)
    plain = sf.pull_net(surface, spacing=0.25, gap=0.005, elements=2, angle=0.3)
    net, given = climbed_net(surface, settings, angle=0.3)
    assert given == Attempt(Change.NOTHING, 0.3, (0.0, 0.0), None, net.quality.factorisations)
    assert net.attempts == ()
    assert net.notes == plain.notes
    assert (net.target.positions == plain.target.positions).all()
    assert (net.quality.curvature == plain.quality.curvature).all()


def test_an_attempt_that_is_known_to_fail_is_not_made_again(umbrella):
    heard = []
    known = NoNet(Reason.OFF, "the net stays off the surface")
    _, given = climbed_net(
        umbrella, SETTINGS, angle=math.pi / 4, failed=known, watch=lambda what, residual: heard.append(what)
    )
    assert given.change is Change.TIGHTER
    assert len(set(heard)) == 3, "springs of three densities, and none of an attempt before them"


def test_no_further_rung_is_climbed_once_failed_pulls_took_what_they_may(umbrella):
    known = Stalled("stalled", residual=1.0, iterations=200)
    with pytest.raises(Stalled, match="1 attempts"):
        climbed_net(umbrella, SETTINGS, angle=math.pi / 4, failed=known, most=100)


def test_a_net_that_stays_off_creases_is_pulled_tighter_and_says_so(umbrella, tighter, tmp_path):
    with pytest.raises(NoNet) as caught:
        net_at(umbrella, SETTINGS, angle=math.pi / 4)
    assert caught.value.reason is Reason.OFF
    said = []
    net, angle, _ = oriented_net(umbrella, SETTINGS, angle=math.pi / 4, progress=said.append)
    assert [(each.change, each.reason) for each in net.attempts] == [
        (Change.NOTHING, Reason.OFF),
        (Change.TIGHTER, None),
    ]
    assert angle == math.pi / 4
    assert net.quality.distance_max < 0.05 * net.spacing
    assert net.notes[-2:] == tuple(NetNote(NoteKind.ATTEMPT, each.sentence()) for each in net.attempts)
    assert net.attempts[0].sentence() in said
    save_net(tmp_path / "net.npz", net)
    assert load_net(tmp_path / "net.npz").attempts == net.attempts
    assert (tighter.target.positions == net.target.positions).all()


def test_a_surface_that_takes_no_net_is_refused_with_all_that_was_tried():
    with pytest.raises(
        NoNet, match=r"bends to a radius of .* attempts, with other angles.* one direction"
    ) as caught:
        climbed_net(ball(30), NetSettings(spacing=0.3, gap=0.005, elements=2), angle=0.1)
    assert caught.value.reason is Reason.BROKEN


def test_settings_that_can_not_work_are_refused_at_once():
    tried = []
    with pytest.raises(InputError, match="must be numbers"):
        climbed_net(bowl(), ANY, angle=math.nan, progress=tried.append)
    assert tried == []


def test_the_net_turns_no_further_than_its_tolerance(monkeypatch):
    turns = []

    def fails(surface, settings, *, angle, offset, progress):
        turns.append(math.degrees(angle))
        raise NoNet(Reason.SHORT, "too short")

    monkeypatch.setattr("shellform.net.ladder.net_at", fails)
    with pytest.raises(NoNet, match="too short"):
        climbed_net(bowl(), ANY, angle=math.radians(45.0), tolerance=math.radians(6.0))
    assert min(turns) == pytest.approx(40.0)
    assert max(turns) == pytest.approx(50.0)


def test_the_ladder_is_left_where_pulls_that_failed_have_cost_too_much(monkeypatch):
    calls = []

    def stalls(surface, settings, *, angle, offset, progress):
        calls.append(settings)
        raise Stalled("stalled", residual=0.9, iterations=250)

    monkeypatch.setattr("shellform.net.ladder.net_at", stalls)
    with pytest.raises(Stalled, match="4 attempts") as caught:
        climbed_net(bowl(), ANY, angle=0.0)
    assert len(calls) == 4
    assert caught.value.residual == 0.9


def test_pulls_whose_net_is_refused_cost_as_much_as_those_that_stall(monkeypatch):
    calls = []

    def leaves(surface, settings, *, angle, offset, progress):
        calls.append(settings)
        error = NoNet(Reason.OFF, "stays off")
        error.factorisations = 300
        raise error

    monkeypatch.setattr("shellform.net.ladder.net_at", leaves)
    with pytest.raises(NoNet, match="3 attempts"):
        climbed_net(bowl(), ANY, angle=0.0)
    assert len(calls) == 3


def test_a_net_that_is_refused_tells_what_its_pull_took(umbrella):
    with pytest.raises(NoNet) as caught:
        net_at(umbrella, SETTINGS, angle=math.pi / 4)
    assert caught.value.factorisations > 0


def test_rungs_keep_to_what_was_stated():
    placed = dataclasses.replace(ANY, guides=([], []))
    assert all(
        _vain(rung, placed, None) == (rung.change in (Change.TURNED, Change.SHIFTED))
        for rung in LADDER
        if rung.change is not Change.LOOSER
    )
    tighter = next(rung for rung in LADDER if rung.change is Change.TIGHTER)
    assert _vain(tighter, dataclasses.replace(ANY, spring_density=[5.0]), None)
    assert not _vain(tighter, ANY, None)
    looser = next(rung for rung in LADDER if rung.change is Change.LOOSER)
    assert _vain(looser, ANY, Stalled("", residual=0.5, iterations=1))
    assert not _vain(looser, ANY, Stalled("", residual=1e-6, iterations=1))
    softer, stiffer = (dataclasses.replace(ANY, shear_stiffness=each) for each in (0.2, 1.0))
    assert _changed(softer, dataclasses.replace(Rung(Change.SHEAR), shear=5.0)) == stiffer


def test_a_rung_changes_of_the_tuning_that_was_given_what_it_names_alone():
    own = NetTuning(limit=110, tail=3, tolerance=1e-4, reach=0.7)
    given = dataclasses.replace(ANY, tuning=own)
    assert _changed(given, LADDER[0]) == given
    changed = {
        rung.change: _changed(given, rung).tuning for rung in LADDER if rung.change is not Change.SHIFTED
    }
    assert changed[Change.LONGER] == dataclasses.replace(own, tail=2)
    assert changed[Change.SHEAR] == own
    assert (changed[Change.FLAT].reach, changed[Change.FLAT].limit, changed[Change.FLAT].tail) == (
        0.5,
        110,
        3,
    )


def test_a_relaxation_that_comes_no_nearer_is_ended_early_but_not_one_on_its_way():
    watch = _watched(None, 5.0)
    for k in range(300):
        watch(k, 0.5)  # far from rest it may wander
    for k in range(39):
        watch(k, 4.9e-6 * 0.999**k)
    with pytest.raises(NotConverged, match="stays at"):
        watch(39, 4.8e-6)
    falling = _watched(None, 5.0)
    for k in range(300):
        falling(k, 1e-3 * 0.99**k)


def test_a_corrugated_barrel_is_covered_at_an_angle_where_rods_run_far_past_its_edge_before_others_reach_it():
    """Rods askew to the corrugation leave the surface spacings before those of the other direction do."""
    x, y, _ = (sheet(lambda x, y: 0.0 * x, size=15.0, count=61).vertices * [2.0, 1.0, 1.0]).T
    height = 3.0 + 0.7 * np.cos(x) - 2.5 * (y / 7.5) ** 2
    surface = make_surface(np.column_stack([x, y, height]), sheet(lambda x, y: 0.0 * x, count=61).triangles)
    net = sf.pull_net(surface, spacing=0.9, gap=0.03, elements=2, method="compass", angle=np.pi / 4)
    assert net.quality.uncovered_area < 0.01 * surface.area


def test_a_net_that_creases_bring_nearer_than_its_spacing_says_so_and_is_none_where_none_may_be(
    umbrella, tighter, monkeypatch
):
    (told,) = (note.text for note in tighter.notes if note.kind is NoteKind.NEAR)
    assert "nearer than their spacing" in told
    # no further than where that net is found
    rungs = tuple(rung for rung in LADDER if rung.change in (Change.NOTHING, Change.TIGHTER))
    monkeypatch.setattr("shellform.net.ladder.LADDER", rungs)
    with pytest.raises(NoNet, match="nearer than their spacing"):
        climbed_net(umbrella, SETTINGS, angle=math.pi / 4, near=False)


def test_a_rung_whose_origin_lies_off_the_surface_is_one_attempt_and_not_the_end():
    """Half a spacing from the middle of an L lies in its bend, where nothing is."""
    whole = sheet(lambda x, y: 0.3 - 0.3 * (x**2 + y**2), size=1.0, count=41)
    middles = whole.vertices[whole.triangles].mean(axis=1)
    bend = whole.triangles[~((middles[:, 0] > 0.0) & (middles[:, 1] > 0.0))]
    used, triangles = np.unique(bend, return_inverse=True)
    surface = make_surface(whole.vertices[used], triangles.reshape(-1, 3))
    settings = NetSettings(spacing=0.2, gap=0.002, elements=2, tuning=NetTuning(limit=2))
    said = []
    with pytest.raises(Stalled, match=r"ended: .*origin lies off the surface") as refused:
        climbed_net(surface, settings, angle=0.0, progress=said.append)
    assert "offset" not in refused.value.remedy
    assert any("origin lies off" in each for each in said[:-1])
    assert "from the flat grid" in said[-1]
    with pytest.raises(InputError, match=r"net\.offset: the net's origin lies off the surface") as given:
        climbed_net(surface, settings, angle=0.0, offset=(0.7, 0.7))
    assert "smaller offset" in given.value.remedy
