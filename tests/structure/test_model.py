"""The model file and its analysis, as a stranger would use them."""

import copy
import json
import subprocess
import sys

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.answers.analysis import analyse
from shellform.structure.answers.result_document import result
from shellform.structure.model import parse_model, read_model, write_model
from shellform.structure.network import doubts


def bow():
    """A column of eight beams with a slack cable from end to end, pushed by its upper end."""
    rod = {"EA": 1e5, "GJ": 1.0, "EIy": 1.0, "EIz": 1.0, "z_axis": [0, 1, 0]}
    return {
        "format": "shellform-model",
        "version": 1,
        "nodes": [[0, 0, k / 8] for k in range(9)],
        "beams": [{"nodes": [k, k + 1], **rod} for k in range(8)],
        "cables": [{"nodes": [0, 8], "EA": 100.0, "rest_length": 1.01}],
        "supports": [
            {"node": 0, "fixed": [True, True, True, False, True, True]},
            {"node": 8, "fixed": [True, True, False, False, True, True]},
        ],
        "loads": {
            "push": [{"node": 8, "force": [0, 0, -4.0]}, {"node": 4, "force": [0, 0.01, 0]}],
            "none": [],
        },
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m: m.update(format="other"), "format.*must be 'shellform-model'"),
        (lambda m: m.update(version=2), "version.*not known"),
        (lambda m: m.pop("nodes"), "'nodes' is missing"),
        (lambda m: m.update(nodes=[]), "nodes: there are none"),
        (lambda m: m["nodes"][3].append(1.0), r"nodes\[3\].*length 3"),
        (lambda m: m["beams"][3].update(EIx=1), r"beams\[3\].*unknown field 'EIx'.*Did you mean 'EI"),
        (lambda m: m["beams"][3].pop("EA"), r"beams\[3\].*'EA' is missing"),
        (lambda m: m["beams"][3].update(EA="1"), r"beams\[3\].EA.*expected a number"),
        (lambda m: m["beams"][3].update(EA=-1.0), r"beams\[3\].EA.*positive"),
        (lambda m: m["beams"][3].update(rest_length=0.0), r"beams\[3\].rest_length.*positive"),
        (lambda m: m["beams"][3].update(EIy=1e300), r"beams\[3\].EIy.*beyond what can be calculated"),
        (lambda m: m["nodes"].__setitem__(3, [1e300, 0, 0]), r"nodes\[3\].*below 1e\+30, in SI units"),
        (lambda m: m["beams"][3].update(nodes=[3, 99]), r"beams\[3\].nodes.*out of range.*0 to 8"),
        (lambda m: m["beams"][3].update(nodes=[3, 2**70]), r"beams"),
        (lambda m: m["beams"][3].update(nodes=[3, 3]), r"beams\[3\].*coincide"),
        (lambda m: m["beams"][3].update(z_axis=[0, 0, 1]), r"beams\[3\].*along the beam"),
        (lambda m: m["cables"][0].update(nodes=[1, 1]), r"cables\[0\].*itself"),
        (lambda m: m["cables"][0].update(EA=0), r"cables\[0\].EA.*positive"),
        (lambda m: m["supports"][1].update(node=9), r"supports\[1\].node.*out of range"),
        (lambda m: m["supports"][1].update(node=0), r"supports\[1\].*already"),
        (lambda m: m["supports"][1].update(fixed=[1, 1, 1, 1, 1, 1]), r"supports\[1\].fixed.*true or false"),
        (lambda m: m["loads"]["push"][0].update(node=-1), r"loads.push\[0\].node.*out of range"),
        (
            lambda m: m.update(start={"positions": [[0, 0, 0]], "rotations": []}),
            "start.positions.*One row a node",
        ),
        (lambda m: m.update(supports=[]), "nothing restrains"),
    ],
)
def test_a_bad_model_is_refused_with_field_and_element(change, message):
    model = copy.deepcopy(bow())
    change(model)
    with pytest.raises(InputError, match=message):
        analyse(parse_model(model), load="push")


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", '{"format": NaN}', "\ufeff", '"x"', "[" * 100_000])
def test_a_file_that_is_no_model_is_refused_by_name(tmp_path, text):
    file = tmp_path / "broken.json"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=r"broken\.json"):
        read_model(file)


def test_a_missing_file_is_refused(tmp_path):
    with pytest.raises(InputError, match="can't be read"):
        read_model(tmp_path / "nowhere.json")


def test_a_model_comes_back_from_its_file_bit_by_bit(tmp_path):
    once = parse_model(bow())
    write_model(tmp_path / "m.json", once)
    again = read_model(tmp_path / "m.json")
    for name in ("nodes", "fixed", "imposed"):
        assert (getattr(once.network, name) == getattr(again.network, name)).all()
    for name in ("ends", "axial", "bending_y", "rest_length", "frames"):
        np.testing.assert_array_equal(getattr(once.network.beams, name), getattr(again.network.beams, name))
    assert again.supported == once.supported
    np.testing.assert_array_equal(again.loads["push"], once.loads["push"])


def test_what_is_rarely_meant_is_told_by_element():
    model = bow()
    model["nodes"].append([0, 0, 0.5])
    model["beams"].append(
        {
            "nodes": [8, 9],
            "EA": 1e5,
            "GJ": 1.0,
            "EIy": 1.0,
            "EIz": 1e-14,
            "rest_length": 5.0,
            "z_axis": [0, 1, 0],
        }
    )
    told = " ".join(doubts(parse_model(model).network))
    assert "nodes[4] and nodes[9]" in told
    assert "beams[8]" in told
    assert "times as stiff as" in told
    assert "rest lengths far from" in told
    assert doubts(parse_model(bow()).network) == []


def test_a_straight_rod_free_to_spin_is_solved_and_mentioned():
    model = bow()
    for support in model["supports"]:
        support["fixed"][5] = False
    found = analyse(parse_model(model), load="push")
    assert found.converged
    assert found.equilibrium.stable
    assert any("spin" in warning and "nodes[0]" in warning for warning in found.warnings)


def test_bad_requests_are_refused():
    model = parse_model(bow())
    for request, message in [
        ({"load": "pull"}, "no such load case"),
        ({}, "several load cases"),
        ({"load": "push", "increments": 0}, "increments"),
        ({"load": "push", "tolerance": 2.0}, "tolerance"),
        ({"load": "push", "method": "magic"}, "relaxation, dynamic, newton, path"),
        ({"load": "push", "limit": 0}, "limit"),
        ({"load": "push", "method": "path", "lead": (99, 0, 1.0)}, "axis 0 to 2"),
    ]:
        with pytest.raises(InputError, match=message):
            analyse(model, **request)


def test_an_imposed_turn_needs_all_three_rotations_fixed():
    model = bow()
    model["supports"][0]["displacement"] = [0, 0, 0, 0, 0.1, 0]
    with pytest.raises(InputError, match="all three rotations"):
        analyse(parse_model(model), load="push")


@pytest.mark.parametrize("method", ["relaxation", "newton", "path"])
def test_every_method_ends_in_the_same_state_and_tells_its_increments(method):
    found = analyse(parse_model(bow()), load="push", increments=2, method=method)
    told = result(found)
    assert told["converged"]
    assert told["stable"]
    assert told["increments"][-1]["factor"] == 1.0
    assert told["increments"][-1]["negative_pivots"] == 0
    assert sum(each["iterations"] for each in told["increments"]) == told["iterations"]
    assert told["displacements"][4][1] == pytest.approx(3.484e-4, rel=0.015)  # PL³/48EI · 3 (tan 1 - 1), h²
    json.dumps(told, allow_nan=False)


def test_past_the_critical_load_relaxation_finds_the_buckled_shape_and_the_path_the_critical_factor():
    model = parse_model(bow())
    found = analyse(model, load="push", factor=4.0, critical_to=4.0, mode_count=2)
    told = result(found)
    assert found.converged
    assert abs(told["displacements"][4][1]) > 0.2
    # The lateral load makes an imperfect column: no bifurcation, no limit point below 4 × 4 N.
    assert told["critical"] == {"factor": None, "sought_to": 4.0}
    assert len(told["modes"]) == 2


def test_a_stop_after_a_bounded_number_of_factorisations_keeps_the_last_state():
    model = bow()
    model["supports"][0]["fixed"][3] = True
    found = analyse(parse_model(model), load="push", factor=400.0, limit=3)
    told = result(found)
    assert not told["converged"]
    assert "factorisations" in told["message"]
    assert np.isfinite(told["displacements"]).all()


def test_the_forces_in_the_result_balance_the_load_and_the_energies_add_up():
    told = result(analyse(parse_model(bow()), load="push"))
    up = sum(each["force"][2] for each in told["reactions"])
    assert up == pytest.approx(4.0, rel=1e-7)
    parts = sum(sum(kind.values()) for kind in told["energy_by_kind"].values())
    assert parts == pytest.approx(told["energy"], rel=1e-9)
    assert told["cable_elongations"][0] < 0.0
    assert told["cable_forces"][0] == 0.0


def test_the_command_prints_notes_and_refuses_with_status_2(tmp_path):
    file = tmp_path / "m.json"
    file.write_text(json.dumps(bow()), encoding="utf-8")
    call = [sys.executable, "-m", "shellform", "analyse", str(file)]
    good = subprocess.run(
        [*call, "--load", "push", "--path", "--lead", "4:y:0.001"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert good.returncode == 0, good.stderr
    assert json.loads(good.stdout)["converged"]
    bad = subprocess.run(
        [*call, "--load", "push", "--lead", "four"], capture_output=True, text=True, check=False
    )
    assert bad.returncode == 2
    assert "NODE:AXIS:METRES" in bad.stderr


def block(side):
    """A cube of rods of side³ nodes: its factor fills up as no gridshell's does."""
    rod = {"EA": 1e5, "GJ": 1.0, "EIy": 1.0, "EIz": 1.0}
    number = np.arange(side**3).reshape(side, side, side)
    along = [
        (number[:-1], number[1:]),
        (number[:, :-1], number[:, 1:]),
        (number[:, :, :-1], number[:, :, 1:]),
    ]
    beams = [
        {"nodes": [int(i), int(j)], **rod, "z_axis": [1, 0, 0] if axis == 2 else [0, 0, 1]}
        for axis, (starts, ends) in enumerate(along)
        for i, j in zip(starts.ravel(), ends.ravel(), strict=True)
    ]
    return {
        "format": "shellform-model",
        "version": 1,
        "nodes": np.argwhere(number >= 0).tolist(),
        "beams": beams,
        "supports": [{"node": int(node), "fixed": [True] * 6} for node in number[:, :, 0].ravel()],
        "loads": {"push": [{"node": side - 1, "force": [0, 0, -1.0]}]},
    }


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux refuses memory under a limit")
@pytest.mark.parametrize(("model", "status"), [(bow(), 0), (block(22), 3)], ids=["small", "large"])
def test_without_free_memory_a_small_model_is_solved_and_a_large_one_ends_with_a_message_and_status_3(
    tmp_path, model, status
):
    file = tmp_path / "m.json"
    file.write_text(json.dumps(model), encoding="utf-8")
    code = (
        "import sys; from shellform.structure.solve import memory; memory.free_memory = lambda: 0; "
        "from shellform.cli.program import main; sys.argv[1:] = ['analyse', sys.argv[1], '--load', 'push']; "
        "main()"
    )
    found = subprocess.run(
        [sys.executable, "-c", code, str(file)], capture_output=True, text=True, check=False
    )
    assert found.returncode == status, found.stderr
    assert ("memory is full" in found.stderr) == (status == 3)
