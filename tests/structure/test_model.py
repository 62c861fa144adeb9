"""The model file and its analysis, as a stranger would use them."""

import copy
import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.structure.answers.analysis import analyse
from shellform.structure.answers.result_document import result
from shellform.structure.elements.sections import Material, Round
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
        (lambda m: m["beams"][3].update(rest_length=np.nan), r"beams\[3\].rest_length.*positive.*nan"),
        (lambda m: m["beams"][3].update(EIz=np.nan), r"beams\[3\].EIz.*positive.*nan"),
        (lambda m: m["cables"][0].update(rest_length=np.nan), r"cables\[0\].rest_length.*positive.*nan"),
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


def changed_file(tmp_path, change):
    """A file as json.dump writes it, which knows NaN and Infinity."""
    model = copy.deepcopy(bow())
    change(model)
    file = tmp_path / "model.json"
    file.write_text(json.dumps(model), encoding="utf-8")
    return file


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m["beams"][3].update(EA=np.nan),
            r"beams\[3\]\.EA: must be a positive number .*nan.*newtons",
        ),
        (lambda m: m["beams"][3].update(GJ=np.inf), r"beams\[3\]\.GJ: must be a positive number .*inf"),
        (lambda m: m["beams"][3].update(z_axis=[0, np.nan, 1]), r"beams\[3\]\.z_axis: .*nan.*finite"),
        (
            lambda m: m["cables"][0].update(rest_length=-np.inf),
            r"cables\[0\]\.rest_length: must be a positive",
        ),
        (lambda m: m["nodes"].__setitem__(3, [np.nan, 0, 0]), r"nodes\[3\]: .*nan.*finite"),
        (
            lambda m: m["supports"][1].update(displacement=[0, 0, np.inf, 0, 0, 0]),
            r"supports\[1\]\.displacement.*inf.*finite",
        ),
        (
            lambda m: m["loads"]["push"][1].update(force=[0, np.nan, 0]),
            r"loads\.push\[1\]\.force: .*nan.*finite",
        ),
        (
            lambda m: m.update(start={"positions": 9 * [[0, 0, np.nan]], "rotations": 9 * [[0, 0, 0]]}),
            r"start\.positions\[0\]: .*nan.*finite",
        ),
        (lambda m: m.update(version=np.nan), r"version: expected a whole number"),
    ],
)
def test_a_number_that_is_not_finite_is_told_with_its_field_and_element(tmp_path, change, message):
    with pytest.raises(InputError, match=rf"model\.json: {message}"):
        read_model(changed_file(tmp_path, change))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            lambda m: m["loads"]["push"][1].update(node=1.0),
            r"loads\.push\[1\]\.node: expected a whole number",
        ),
        (
            lambda m: m["loads"]["push"][1].update(forces=[1]),
            r"loads\.push\[1\]: unknown field.*mean 'force'",
        ),
        (lambda m: m["loads"].update(none=3), r"loads\.none: expected an array"),
        (lambda m: m.update(loads=[]), "loads: expected an object"),
    ],
)
def test_what_is_wrong_with_a_load_is_told_with_its_name(tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        read_model(changed_file(tmp_path, change))
    model = copy.deepcopy(bow())
    change(model)
    with pytest.raises(InputError, match=message):
        parse_model(model)


def test_a_wrong_load_in_a_file_that_is_broken_farther_on_is_told_without_its_name(tmp_path):
    text = json.dumps({**bow(), "loads": {"push": [{"node": 1.0}]}})
    (tmp_path / "model.json").write_text(text[:-1], encoding="utf-8")
    with pytest.raises(InputError, match=r"loads\[0\]\.node: expected a whole number"):
        read_model(tmp_path / "model.json")


def test_a_model_that_is_no_utf_8_is_told_so(tmp_path):
    for content in (json.dumps(bow()).encode("utf-16"), b'{"format": "\xfc"}'):
        (tmp_path / "model.json").write_bytes(content)
        with pytest.raises(InputError, match=r"model\.json: isn't text in UTF-8 .*Save it as UTF-8"):
            read_model(tmp_path / "model.json")


def test_what_only_a_lenient_reader_takes_is_no_json(tmp_path):
    (tmp_path / "model.json").write_text('{"format": "\\ud800"}', encoding="utf-8")
    with pytest.raises(InputError, match="isn't JSON"):
        read_model(tmp_path / "model.json")


def test_numpy_s_numbers_and_arrays_make_a_model_as_lists_do_and_other_things_none():
    model = bow()
    model["nodes"] = np.array(model["nodes"])
    model["beams"] = [
        {**each, "EA": np.float64(each["EA"]), "nodes": np.array(each["nodes"])} for each in model["beams"]
    ]
    given, expected = parse_model(model).network, parse_model(bow()).network
    assert given.nodes.tolist() == expected.nodes.tolist()
    assert given.beams.axial.tolist() == expected.beams.axial.tolist()
    with pytest.raises(InputError, match="model: holds a object"):
        parse_model({**bow(), "nodes": object()})


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


def test_a_model_s_loads_have_a_row_for_each_node_and_can_not_be_changed():
    model = parse_model(bow())
    assert not model.loads["push"].flags.writeable
    with pytest.raises(InputError, match=r"loads\.push has the wrong shape \(found \(9, 3\)\)"):
        replace(model, loads={"push": model.loads["push"][:, :3]})


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
    assert 0.0 < told["seconds"]["assembly"] < told["seconds"]["total"] < 600.0
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
    for lead in ("four", "4::0.001", "4:xy:0.001", "4:w:0.001"):
        bad = subprocess.run(
            [*call, "--load", "push", "--lead", lead], capture_output=True, text=True, check=False
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


def test_what_the_elements_of_a_model_are_given_is_what_they_have():
    """Ends of a cable in one place ask for its rest length; where left out it is the distance of its
    nodes."""
    model = bow()
    model["nodes"] += [[3, 4, 1], [3, 4, 1]]
    tie = {"EA": 187.0}
    model["cables"] = [{"nodes": [0, 9], **tie}, {"nodes": [9, 10], **tie, "rest_length": 0.25}]
    cables = parse_model(model).network.cables
    assert cables.rest_length == pytest.approx([np.sqrt(26.0), 0.25])
    model["cables"].append({"nodes": [10, 9], **tie})
    with pytest.raises(InputError, match="must not coincide") as told:
        parse_model(model)
    assert (told.value.where, told.value.value) == ("cables[2]", [10, 9])
    model["cables"][2]["nodes"] = [9, 9]
    with pytest.raises(InputError, match="to itself"):
        parse_model(model)


def test_forces_on_one_node_add_up_and_a_load_on_a_node_beyond_the_last_is_refused():
    model = bow()
    model["loads"] = {
        "gust": [
            {"node": 8, "force": [1, 2, 3]},
            {"node": 3, "moment": [0.5, 0, -0.25]},
            {"node": 8, "force": [0, -5, 0.5], "moment": [7, 0, 0]},
        ]
    }
    load = parse_model(model).loads["gust"]
    assert load[8].tolist() == [1, -3, 3.5, 7, 0, 0]
    assert load[3].tolist() == [0, 0, 0, 0.5, 0, -0.25]
    assert np.flatnonzero(load.any(axis=1)).tolist() == [3, 8]
    model["loads"]["gust"][2]["node"] = 9
    with pytest.raises(InputError, match=r"loads\.gust\[2\]\.node.*Nodes run from 0 to 8"):
        parse_model(model)


def test_beams_with_axes_add_what_stiffness_they_are_given_beside_others_without():
    model = bow()
    model["start"] = None
    tilted = [[0.6, 0, -0.8], [0, 1, 0], [0.8, 0, 0.6]]
    straight = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
    own = {"axes": [straight, tilted], "rest_length": 0.13}
    model["beams"] += [
        {"nodes": [0, 1], "EA": 5.0, "GJ": 0, "EIy": 0, "EIz": 2.0, **own},
        {"nodes": [1, 2], "EA": 0, "GJ": 7.0, "EIy": 3.0, "EIz": 0, **own},
    ]
    beams = parse_model(model).network.beams
    for values, wanted in (
        (beams.axial, [1e5, 5.0, 0.0]),
        (beams.torsion, [1.0, 0.0, 7.0]),
        (beams.bending_y, [1.0, 0.0, 3.0]),
        (beams.bending_z, [1.0, 2.0, 0.0]),
    ):
        assert values[7:].tolist() == wanted
    assert beams.built_in.tolist() == [False] * 8 + [True] * 2
    np.testing.assert_allclose(beams.frames[8, 1].T, tilted, err_msg="rows of the file, columns here")
    del model["beams"][9]["axes"]
    with pytest.raises(InputError, match=r"beams\[9\]\.EA.*positive.*newtons"):
        parse_model(model)


@pytest.mark.parametrize(
    ("value", "refused"), [(0.6e-30, True), (1.4e-30, False), (0.9e30, False), (1.1e30, True)]
)
def test_numbers_beyond_what_can_be_calculated_with_are_refused_with_what_to_give(value, refused):
    model = bow()
    model["beams"][3]["GJ"] = value
    if refused:
        with pytest.raises(InputError, match=r"beams\[3\]\.GJ.*\(1e-30 to 1e\+30\).*N·m², such as 0\.03"):
            parse_model(model)
    else:
        assert parse_model(model).network.beams.torsion[3] == value
    place = bow()
    place["nodes"][3][2] = -value
    if value > 1e30:
        with pytest.raises(InputError, match=r"nodes\[3\]: must be below 1e\+30"):
            parse_model(place)
    else:
        parse_model(place)


def test_a_remedy_says_what_to_write_where_that_is_known():
    model = bow()
    model["beams"][3]["EA"] = "much"
    with pytest.raises(InputError, match=r"Write a number there") as told:
        parse_model(model)
    assert told.value.where == "beams[3].EA"
    model = bow()
    model["nodes"][2] = [1.0, 2.0]
    with pytest.raises(InputError, match=r"nodes\[2\].*Write an array of length 3 there"):
        parse_model(model)


def test_a_result_tells_how_far_nodes_moved_what_supports_bear_and_the_stresses_of_the_sections():
    model = bow()
    model["supports"][0]["displacement"] = [0.02, 0, 0, 0, 0, 0]
    model["supports"][1]["displacement"] = [0.02, 0, 0, 0, 0, 0]
    model["nodes"] = [[5 + x, y - 7, z] for x, y, z in model["nodes"]]
    rod = Round(0.01, Material(40e9, 15e9, strength=2e8))
    found = analyse(parse_model(model), load="push", factor=0.5)
    told = result(found, sections={"rod": rod})
    assert told["displacements"][0] == pytest.approx([0.01, 0.0, 0.0], abs=1e-12)
    assert told["displacements"][4][0] == pytest.approx(0.01, abs=1e-9)
    assert told["displacements"][8][2] < 0.0
    bottom, top = told["reactions"]
    assert (bottom["node"], top["node"]) == (0, 8)
    assert bottom["force"][2] == pytest.approx(2.0, rel=1e-6)
    assert bottom["force"][1] + top["force"][1] == pytest.approx(-0.005, rel=1e-6)
    assert (bottom["moment"][0], top["force"][2], top["moment"][0]) == (0.0, 0.0, 0.0), "what isn't held"
    worst = np.max(told["stresses"])
    first = told["beam_forces"][3]
    largest = (
        abs(first["N"]) / rod.constants[0] + np.hypot(first["My_b"], first["Mz_b"]) * 0.01 / rod.constants[2]
    )
    assert told["stresses"][3][1] == pytest.approx(largest)
    assert max(told["utilisation"]) == pytest.approx(worst / 2e8)
    with pytest.raises(InputError, match=r"no beams of kind 'lath'.*It has: rod") as refused:
        result(found, sections={"lath": rod})
    assert refused.value.where == "--sections"
    unknown = result(found, sections={})
    assert unknown["stresses"][3] == [None, None]
    assert unknown["utilisation"][3] is None
