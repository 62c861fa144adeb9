"""What the site is told after a survey, a replay and an erection: numbers by hand, from results that are
stood in for."""

import csv
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.gridshell import Design
from shellform.run import onsite
from shellform.run.erection_told import off_design
from shellform.run.onsite import Survey
from shellform.run.site_sources import Scanned, design_named, load_named
from shellform.site.erection_steps import Props

POSITIONS = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [3.0, 1.0, 0.5], [4.0, 4.0, 1.0]])
SHELL = SimpleNamespace(
    net=SimpleNamespace(spacing=0.4, grid=SimpleNamespace(crossing_nodes=np.array([[0, 1], [2, 3], [2, 4]]))),
    cable_ends=np.zeros((3, 2)),
    target=SimpleNamespace(positions=POSITIONS),
)
STATE = SimpleNamespace(positions=POSITIONS, quaternions=np.ones((5, 4)))


def moved(by):
    return SimpleNamespace(positions=POSITIONS + by, quaternions=np.ones((5, 4)))


@pytest.fixture
def run(monkeypatch, tmp_path):
    own = SimpleNamespace(
        folder=tmp_path, best="polished", designs={"initial": "first", "polished": "last"},
        states={"polished": {"none": moved([0.0, 0.0, 0.01]), "wet": moved([0.0, 0.02, 0.0])}},
        loads={"none": "no load", "wet": "concrete"}, shell_of=lambda name: SHELL,
        case=SimpleNamespace(
            surface=SimpleNamespace(origin=(430_000.0, 81_000.0, 400.0)),
            cable=SimpleNamespace(force_max=7.5),
        ),
    )  # fmt: skip
    monkeypatch.setattr(onsite, "read_run", lambda folder: own)
    return own


@pytest.mark.parametrize(
    ("turns", "halved", "second", "lines"),
    [
        ([2, 0, -3], 0, "2 cables to turn, 5 turns of 0.5 mm; afterwards 3.000 mm are predicted", 2),
        ([0, 0, 0], 0, "no turn is worth taking", 2),
        ([0, 0, 1], 2, "1 cable to turn, 1 turn of 0.5 mm", 3),
    ],
)
def test_a_survey_tells_turns_and_how_far_the_grid_is_off_before_and_after(
    monkeypatch, run, tmp_path, turns, halved, second, lines
):
    options = Survey(step=0.5e-3, largest=0.002, cables=20, noise=0.2e-3, load="wet")
    belief = SimpleNamespace(state=STATE)
    learnt = SimpleNamespace(state=moved([0.003, 0.0, 0.0]))
    now = SimpleNamespace(
        design=SimpleNamespace(
            rest_length=np.array([1.0, 2.0, 3.0]), present=np.array([1, 1, 1]), radius=0.01
        ),
        covariance=np.eye(3),
        state=moved([0.0, 0.02, 0.004]),
    )
    step = SimpleNamespace(
        turns=np.array(turns), cables=np.count_nonzero(turns), turns_in_all=np.abs(turns).sum(), misfit_before=5 * 0.005**2, misfit_after=5 * 0.003**2, halved=halved, belief=now,
        schedule=lambda shell: "turns",
    )  # fmt: skip
    asked = []
    monkeypatch.setattr(onsite, "_believed", lambda *_: ("polished", SHELL, belief))
    seen = SimpleNamespace(
        nodes=[1, 3], places=[0, 0], doubts=("One point is far.",), counted=("Taken off.",)
    )
    monkeypatch.setattr(
        onsite, "read_survey", lambda *_, unit, origin: seen if origin[0] == 430_000.0 else None
    )
    monkeypatch.setattr(onsite, "doubtful", lambda *_, noise: [f"Noise is {noise}."])
    monkeypatch.setattr(onsite.retensioning, "learn", lambda *how, noise: asked.append(noise) or learnt)

    def adjust(shell, belief, goal, crew, *, noise):
        asked.append((crew, noise))
        np.testing.assert_array_equal(goal, run.states["polished"]["wet"].positions)
        return step

    monkeypatch.setattr(onsite.retensioning, "adjust", adjust)
    found = onsite.survey(tmp_path, tmp_path / "survey.csv", options)
    assert found.lines[:3] == ["Taken off.", "One point is far.", "Noise is 0.0002."]
    assert "2 nodes were seen; the grid lies 5.000 mm from" in found.lines[3]
    assert found.lines[4].startswith(second)
    assert len(found.lines) == lines + 3
    if halved:
        assert "halved 2 times" in found.lines[5]
    assert asked[0] == 0.2e-3
    assert (asked[1][0].step, asked[1][0].largest, asked[1][0].cables) == (0.5e-3, 0.002, 20)
    with (tmp_path / "schedules/predicted.csv").open(encoding="utf-8", newline="") as file:
        first, _, last = csv.DictReader(file)
    assert (first["node"], first["x"], last["z"]) == ("1", "1.000000", "1.004000")
    assert float(first["distance before [mm]"]) == pytest.approx(np.hypot(3.0, 20.0), abs=1e-3)
    assert float(first["distance after [mm]"]) == pytest.approx(4.0)
    with np.load(tmp_path / "schedules/belief-1.npz") as kept:
        assert str(kept["origin"]) == "polished/wet"
        np.testing.assert_array_equal(kept["positions"], now.state.positions)


def test_a_replay_tells_what_is_left_after_each_round_and_draws_lengths_of_the_error_that_is_given(
    monkeypatch, run, tmp_path
):
    asked = {}

    def replay(shell, belief, errors, goal, nodes, crew, **how):
        asked.update(how, errors=errors, nodes=nodes.tolist())
        turns = [SimpleNamespace(cables=2, turns_in_all=3), SimpleNamespace(cables=1, turns_in_all=4)]
        misfits = [5 * 0.01**2, 5 * 0.004**2, 5 * 0.002**2]
        return SimpleNamespace(misfits=misfits, adjustments=turns, removed=0.96)

    monkeypatch.setattr(onsite, "_believed", lambda *_: ("polished", SHELL, None))
    monkeypatch.setattr(onsite.retensioning, "replay", replay)
    options = Survey(length_error=0.002, noise=0.3e-3)
    found = onsite.replay(tmp_path, options, rounds=2, seed=4, slip=0.05)
    assert [each.split(",") for each in found.lines[1:4]] == [
        ["0", "10.000", "0", "0"], ["1", "4.000", "2", "3"], ["2", "2.000", "1", "4"],
    ]  # fmt: skip
    assert found.lines[-1] == "96 % of the misfit, of the distances' squares, is gone after 2 rounds"
    np.testing.assert_allclose(asked["errors"], 0.002 * np.random.default_rng(4).normal(size=3))
    assert (asked["nodes"], asked["noise"], asked["rounds"], asked["seed"], asked["slip"]) == (
        [1, 3, 4], 0.3e-3, 2, 5, 0.05,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("off", "told"),
    [(4.4e-13, "where the design does before"), (2e-6, "up to 0.002 mm from where the design does")],
)
def test_a_shell_that_ends_where_its_design_lies_is_told_so_without_a_number(off, told):
    own = SimpleNamespace(states={"polished": {"none": STATE}})
    (line,) = off_design(own, "polished", "none", moved([0.0, 0.0, off]))
    assert line.startswith(f"in the end it lies {told}")


def test_an_erection_tells_its_worst_stress_and_the_largest_forces(monkeypatch, run, tmp_path):
    def step(stage, share, stress, tension, reaction):
        return SimpleNamespace(
            stage=stage, share=share, stress=stress, tension=tension, reaction=reaction, state=STATE
        )

    steps = [
        step("moving", 0.5, 80e6, 1.0, 40.0), step("moving", 1.0, 120e6, 7.5, 30.0), step("loading", 1.0, 60e6, 2.0, 9.0)
    ]  # fmt: skip
    asked, strength, borne = [], 240e6, None

    def erect(shell, own, **how):
        asked.append((own, how["load"], how["weight"], how["lift"], how["step"]))
        return SimpleNamespace(
            steps=steps, worst=steps[1], strength=strength, table=lambda: "table", props=borne
        )

    monkeypatch.setattr(onsite.erection, "erect", erect)
    found = onsite.erect(tmp_path, load="wet", lift="none", step=0.125)
    assert asked == [("last", "concrete", None, "no load", 0.125)]
    assert list(found.lines) == [
        "3 steps: moving, loading",
        "largest rod stress 120 MPa, 0.500 of the strength, at 1.00 of moving; 60 MPa in the end",
        "largest cable tension 7.5 N, largest force on a support 40 N",
        "in the end it lies up to 20 mm from where the design does under the load “wet”",
    ]
    strength = 119e6
    assert onsite.erect(tmp_path, load="wet", lift="none", step=0.125).lines[4:] == [
        "rods break on the way: erect --by scaffold, give the supports other --way points, or choose thinner or stronger rods"
    ]
    borne = Props(push=9570.4, pull=1086.4, pulled=108, rope=240.4)
    assert onsite.erect(tmp_path, load="wet", lift="none", step=0.125).lines[3:] == [
        "the scaffold pushes crossings up with up to 9.57 kN each and holds up to 108 of them down, where the grid would "
        "lift off, with up to 1.09 kN; ropes draw rods' ends in with up to 240 N",
        "in the end it lies up to 20 mm from where the design does under the load “wet”",
        "rods break on the way: prop every crossing (--props every), or choose thinner or stronger rods",
    ]
    every = onsite.erect(tmp_path, load="wet", lift="none", step=0.125, props="every")
    assert every.lines[-1].startswith("rods break on the way: prop other crossings (--props), or")
    for stage, first, told in [
        ("loading", True, "under the load: give a smaller --load"),
        ("tightening group 2", True, "as cables are tightened: leave --tighten-first out"),
        ("tightening", False, "as cables are tightened: brace otherwise"),
    ]:
        steps[1].stage = stage
        again = onsite.erect(tmp_path, load="wet", lift="none", tighten_first=first, step=0.125)
        assert again.lines[-1] == f"rods break {told}, or choose thinner or stronger rods"
    strength, run.case.cable.force_max = 240e6, 5.0
    for stage, first, told in [
        ("loading", True, " under the load{}give a smaller --load, or "),
        ("lowering", True, " on the way{}leave --tighten-first out, or "),
        ("tightening group 2", True, " as they are tightened{}leave --tighten-first out, or "),
        ("tightening", False, " as they are tightened{}"),
        ("moving", False, " on the way{}"),
    ]:
        steps[1].stage = stage
        again = onsite.erect(tmp_path, load="wet", lift="none", tighten_first=first, step=0.125)
        words = told.format(", more than the 5 N of cable.force_max: ")
        assert again.lines[-1] == f"cables pull up to 7.5 N{words}take stronger ones"
    borne = Props(push=9.0, pull=0.0, pulled=0, rope=1.5)
    assert onsite.erect(tmp_path, load="wet", lift="none", step=0.125).lines[3] == (
        "the scaffold pushes crossings up with up to 9 N each and holds none of them down; ropes draw rods' ends in with up to 1.5 N"
    )


@pytest.mark.parametrize(("residual", "doubtful"), [(0.29e-3, False), (0.32e-3, True)])
def test_a_calibration_that_leaves_more_than_the_noise_is_doubtful(
    monkeypatch, run, tmp_path, residual, doubtful
):
    found = SimpleNamespace(
        joint=SimpleNamespace(axial=1.0, torsion=2.0, bending=3.0, gap=0.004),
        after=np.array([[0.001], [np.nan], [0.003]]),
        residual=residual,
        sentences=lambda: ["torsion = 2"],
        table=lambda: "",
    )
    grid = Scanned(SHELL, None, {}, None, tmp_path)
    monkeypatch.setattr(onsite, "scanned", lambda *_, **__: grid)
    monkeypatch.setattr(onsite.calibration, "calibrate", lambda *_, **__: found)
    lines = onsite.calibrate(tmp_path, [], noise=0.2e-3).lines
    assert lines[:2] == ["torsion = 2", "distances to the model: 2.000 mm on average, 3.000 mm at most"]
    assert len(lines) == 2 + doubtful
    assert not doubtful or "0.32 mm a coordinate, 1.6 times --noise" in lines[2]


def test_a_design_and_a_load_are_those_named_or_the_usual_and_there(run):
    assert design_named(run, None) == "polished"
    assert design_named(run, "initial") == "initial"
    with pytest.raises(InputError, match=r"isn't there.*initial, polished"):
        design_named(run, "rounded")
    assert load_named("wet", SHELL, run.loads) == "concrete"
    with pytest.raises(InputError, match=r"there is no such load case.*none, wet"):
        onsite._believed(run, Survey(load="snow"))


def test_the_round_after_goes_on_from_what_was_believed_of_the_same_design_and_load(
    monkeypatch, run, tmp_path
):
    drawn = Design(np.array([1.0, 2.0, 3.0]), np.array([True, False, True]), 0.01)
    run.designs["polished"] = drawn
    kept = {
        "rest_length": np.array([1.1, 2.1, 3.1]), "present": drawn.present, "radius": np.array(0.02),
        "covariance": np.eye(3), "positions": POSITIONS, "quaternions": np.ones((5, 4)), "origin": "polished/wet",
    }  # fmt: skip

    def believed(load="wet", **changes):
        file = tmp_path / "belief.npz"
        np.savez(file, **{**kept, **changes})
        return onsite._believed(run, Survey(load=load, after=file))

    name, shell, belief = believed()
    assert (name, shell, belief.load) == ("polished", SHELL, "concrete")
    assert (belief.design.rest_length.tolist(), belief.design.radius) == ([1.1, 2.1, 3.1], 0.02)
    np.testing.assert_array_equal(belief.state.positions, POSITIONS)
    for changes in ({"origin": "initial/wet"}, {"load": "none"}):
        with pytest.raises(InputError, match="another design or load case"):
            believed(**changes)
    for changes in (
        {"positions": POSITIONS[1:]},
        {"rest_length": np.array([1.0, 2.0])},
        {"present": np.array([True, True, True])},
    ):
        with pytest.raises(InputError, match=r"belongs to another run\. Name the schedules/belief"):
            believed(**changes)
    for file, what in (
        ("no.npz", "no such file"),
        ("text.npz", r"isn't what .* leaves\. Name the schedules/belief"),
    ):
        (tmp_path / "text.npz").write_text("cable,turns\n", encoding="utf-8")
        with pytest.raises(InputError, match=what):
            onsite._believed(run, Survey(load="wet", after=tmp_path / file))
    del kept["radius"], kept["covariance"]
    with pytest.raises(InputError, match=r"lacks what a belief has.*covariance, radius"):
        believed()
    monkeypatch.setattr(
        onsite.retensioning,
        "first_belief",
        lambda own, state, load, *, length_error: (own, load, length_error),
    )
    assert onsite._believed(run, Survey(load="wet", length_error=0.003))[2] == (drawn, "concrete", 0.003)


@pytest.mark.parametrize("slip", [-0.01, 1.01, np.nan])
def test_a_turn_s_error_is_a_share_of_it(run, tmp_path, slip):
    with pytest.raises(InputError, match=r"--slip.*a share of each turn"):
        onsite.replay(tmp_path, Survey(), rounds=1, seed=0, slip=slip)
