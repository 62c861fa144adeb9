"""What is kept of a run's designs: their records' numbers, and files that are forgotten."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design
from shellform.records.summary import Summary
from shellform.run import designs as module
from shellform.run.designs import followed, forget, slack_names, write_design
from shellform.structure.elements.state import State
from shellform.structure.solve.equilibrium import Equilibrium
from shellform.structure.solve.loading import Loaded
from shellform.structure.solve.residual import OF_LOAD
from tests.records.made import design as record_of

STATE = State(np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0, 0.0], (3, 1)))
LOADS = {
    "none": np.zeros((3, 6)),
    "design": np.array([[0.0, 0.0, -2.0, 0, 0, 0], [0.0, 0.0, -6.0, 0, 0, 0], [0.0] * 6]),
    "wind": np.array([[1.0, 0.0, 0.0, 0, 0, 0], [0.0, 0.0, 3.0, 0, 0, 0], [0.0] * 6]),
}
DESIGN = Design(np.array([1.0, 2.0, 3.0]), np.array([True, False, True]), 0.012)


def reached(residual=1e-9, stable=True, share=1.0):
    return Loaded(Equilibrium(STATE, 1.0, residual, 5, stable, 1), share, 0)


def test_where_nothing_settles_the_last_state_stands_for_every_load_and_is_marked(monkeypatch):
    lost = NotConverged("lost", state=STATE, residual=0.3, iterations=9)

    def fails(*_):
        raise lost

    monkeypatch.setattr(module, "follow", fails)
    found = followed(None, DESIGN, LOADS)
    assert list(found) == list(LOADS)
    for each in found.values():
        assert (each.equilibrium.state, each.equilibrium.residual, each.equilibrium.stable) == (
            STATE,
            0.3,
            False,
        )
        assert each.share == 0.0
    lost.state = None
    with pytest.raises(NotConverged):
        followed(None, DESIGN, LOADS)


@pytest.mark.parametrize(
    ("load", "residual", "stable", "anew"),
    [
        ("none", 1.01 * OF_LOAD, True, True),
        ("none", OF_LOAD, True, False),
        ("none", 1.0, False, False),
        ("design", 1.0, True, False),
    ],
)
def test_an_unloaded_state_is_settled_with_twice_the_digits_where_it_is_stable_and_not_exact(
    monkeypatch, load, residual, stable, anew
):
    settled = Equilibrium(STATE, 1.0, 1e-14, 1, True, 1)
    monkeypatch.setattr(module, "assemble", lambda network: network)
    monkeypatch.setattr(module, "with_twice_the_digits", lambda assembly: f"{assembly} exactly")
    monkeypatch.setattr(module, "extended", lambda state: ("extended", state))

    def found(assembly, state, force):
        assert (assembly, state) == ("network exactly", ("extended", STATE))
        return settled

    monkeypatch.setattr(module, "find_equilibrium", found)
    given = reached(residual, stable)
    shell = SimpleNamespace(network=lambda design: "network")
    told = module._settled(shell, DESIGN, given, LOADS[load])
    expected = dataclasses.replace(given, equilibrium=settled) if anew else given
    assert vars(told) == vars(expected)


def test_a_design_s_record_counts_by_its_cables_and_by_the_design_load(monkeypatch, tmp_path):
    models = []
    monkeypatch.setattr(module, "write_model", lambda file, model: models.append(model))
    monkeypatch.setattr(module, "Model", lambda network, loads, target, supports: (list(loads), supports))
    monkeypatch.setattr(module, "deviations", lambda shell, state: np.array([0.003, 0.004, 0.0]))
    push = np.zeros((3, 6))
    push[0, :3], push[1], push[2, :3] = (1.0, 0.0, -1.5), -99.0, (2.1, -2.8, 4.0)
    assembly = SimpleNamespace(unbalanced=lambda state, load: push)
    monkeypatch.setattr(module, "assemble", lambda network: assembly)
    monkeypatch.setattr(module, "edge_utilisation", lambda shell, beams, forces: 0.6)
    monkeypatch.setattr(module.results, "twist", lambda deformations: np.array([0.1, -0.3, 0.9]))
    beams = SimpleNamespace(
        local_deformations=lambda state: None,
        local_forces=lambda state: None,
        of_kind=lambda kind: np.array([True, True, False]),
    )
    cables = SimpleNamespace(tension=lambda state: np.array([4.0, 0.0, 7.0, -1e-9]))
    shell = SimpleNamespace(
        net=SimpleNamespace(supports=np.array([2, 0])),
        network=lambda design: "network",
        target=STATE,
        cables=lambda design: cables,
        beams=lambda radius: beams,
        bending_utilisation=lambda design, state: np.array([0.2, 0.7, 0.4]),
        utilisation=lambda design, state: np.array([0.5, 0.8]),
    )
    (tmp_path / "designs").mkdir()
    found = write_design(
        tmp_path, shell, "initial", DESIGN, {name: reached(1e-9, name != "wind") for name in LOADS}, LOADS
    )
    assert models == [(["design", "wind"], (2, 0))], "loads that weigh or push anywhere"
    assert (found.cables, found.rod_radius) == (2, 0.012)
    assert found.cable_force_sum == pytest.approx(11.0)
    assert found.cable_force_max == 7.0
    factors = {name: row.factor for name, row in found.loads.items()}
    assert factors == {"none": 0.0, "design": 1.0, "wind": -0.375}
    assert {name: row.multiple for name, row in found.loads.items()} == {
        "none": True,
        "design": True,
        "wind": False,
    }
    assert math.copysign(1.0, factors["none"]) == 1.0, "no -0"
    row = found.loads["wind"]
    assert (row.deviation_max, row.deviation_mean) == (0.004, pytest.approx(7e-3 / 3))
    assert row.deviation_rms == pytest.approx(5e-3 / math.sqrt(3))
    assert (row.stable, row.rod_utilisation_max, row.thrust_max) == (False, 0.7, 3.5)
    assert (row.stress_utilisation_max, row.edge_utilisation_max) == (0.8, 0.6)
    assert (row.uplift_max, row.connector_turn_max) == (1.5, 0.3), "of supports and connectors alone"
    assert (row.cable_force_max, row.cable_force_min, row.cables_slack) == (7.0, -1e-9, 2)
    assert row.slack == ("C1", "C3")
    with np.load(tmp_path / "designs/initial.npz") as kept:
        assert {"design_positions", "none_quaternions", "rest_length"} < set(kept)


@pytest.mark.parametrize(
    ("parts", "multiple"),
    [
        ((1.2, 1.2), True),
        ((0.3, 0.3), True),
        ((0.0, 0.0), True),
        ((1.2, 1.0), False),
        ((0.0, 4.0 / 3.0), False),  # weighs as much
        ((1.0, 1.0 + 1e-6), False),
        ((-1.0, -1.0), False),  # pulls upwards
    ],
)
def test_a_load_is_a_multiple_of_the_design_load_where_all_its_parts_are(parts, multiple):
    own, concrete = np.zeros((2, 4, 6))
    own[:, 2], concrete[1:, 2] = -0.1, -6.9
    load = parts[0] * own + parts[1] * concrete
    assert module._is_multiple(load, own + concrete) is multiple


def test_cables_without_pull_are_named_as_in_the_schedules():
    assert slack_names(np.array([1e-12, 0.0, 2.0, -3.0])) == ("C1", "C3")


def test_what_was_made_of_a_design_is_forgotten_with_its_pictures_and_nothing_else(tmp_path):
    gone = (
        "designs/optimised.npz", "designs/optimised.json", "designs/optimised-drawn.json",
        "states/optimised-none.vtp", "figures/optimised-design.png", "figures/film-optimised.mp4",
        "schedules/sections.csv", "schedules/robust.csv",
    )  # fmt: skip
    kept = (
        "designs/initial.npz", "states/initial-none.vtp", "figures/initial-design.png", "figures/optimisedly.png",
        "schedules/rods.csv", "states/optimised.txt",
    )  # fmt: skip
    for name in (*gone, *kept):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text("", encoding="utf-8")
    summary = Summary(designs={"initial": record_of(), "optimised": record_of()})
    assert list(forget(tmp_path, ("optimised", "polished"), summary).designs) == ["initial"]
    assert [name for name in gone if (tmp_path / name).exists()] == []
    assert [name for name in kept if not (tmp_path / name).exists()] == []
