"""Files for other programs, each read back by another library and compared with the design."""

import ast
import re
import sys
from dataclasses import replace

import gmsh
import numpy as np
import pytest
import pyvista
import rhino3dm
import trimesh

import shellform.surface
from shellform.errors import InputError
from shellform.net.grid import rod_names
from shellform.output.exchange import exports
from shellform.output.workshop.schedules import cable_crossings, rounds
from shellform.structure.network import assemble
from shellform.surface.occ import session


@pytest.fixture(scope="module")
def loads(shell):
    load = shell.point_load(6.9, every=2)
    return {"none": np.zeros_like(load), "design": load, "additional": 1.2 * load}


@pytest.fixture(scope="module")
def folder(built, vault, loads, tmp_path_factory):
    place = tmp_path_factory.mktemp("models")
    files = exports.write_exports(place, built, vault, loads)
    assert sorted(files) == sorted(place.iterdir())
    return place


def test_the_vtu_file_has_every_element_with_displacements_and_forces(folder, built):
    mesh = pyvista.read(folder / "gridshell.vtu")
    ties = built.shell.cables(built.design)
    network = built.shell.network(built.design)
    assert mesh.n_cells == len(network.beams.ends) + len(ties.ends)
    assert np.asarray(mesh.points) == pytest.approx(built.shell.target.positions, abs=1e-12)
    for name, state in built.states.items():
        assert mesh.points + mesh.point_data[f"displacement {name} [m]"] == pytest.approx(
            state.positions, abs=1e-9
        )
        forces = mesh.cell_data[f"cable force {name} [N]"]
        assert forces[mesh.cell_data["kind"] == 2] == pytest.approx(ties.tension(state))


def test_the_3dm_file_has_rods_cables_and_supports_on_layers_in_metres(folder, built, vault):
    model = rhino3dm.File3dm.Read(str(folder / "gridshell.3dm"))
    assert model.Settings.ModelUnitSystem == rhino3dm.UnitSystem.Meters
    layers = {layer.Index: layer.Name for layer in model.Layers}
    found = {}
    for each in model.Objects:
        found.setdefault(layers[each.Attributes.LayerIndex], {})[each.Attributes.Name] = each
    state, grid = built.states["design"], built.grid
    for k, rod in enumerate(grid.rods):
        curve = found[f"rods {rod.direction}"][f"{rod.direction.upper()}{k}"].Geometry
        assert curve.IsValid
        assert curve.Degree == min(3, len(rod.nodes) - 1)
        place = state.positions[rod.nodes]
        along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(place, axis=0), axis=1)))
        points = np.array([(p.X, p.Y, p.Z) for p in map(curve.PointAt, along.tolist())])
        assert points == pytest.approx(place, abs=1e-12), "the curve goes through the nodes"
    ties = built.shell.cables(built.design)
    assert len(found["cables"]) == len(ties.ends)
    strings = dict(found["cables"]["C3"].Attributes.GetUserStrings())
    assert float(strings["rest length [m]"]) == pytest.approx(ties.rest_length[3], abs=1e-6)
    assert float(strings["force under design [N]"]) == pytest.approx(ties.tension(state)[3], abs=1e-6)
    for load in built.states:
        assert f"force under {load} [N]" in strings
        told = dict(found["supports"]["S2"].Attributes.GetUserStrings())
        assert len(told[f"on the support under {load} [N]"].split()) == 3
    rod = dict(found[f"rods {grid.rods[0].direction}"]["U0"].Attributes.GetUserStrings())
    assert rod["section"] == "⌀ 2 mm"
    assert [int(k) for k in rod["crossings"].split()] == grid.rods[0].crossings.tolist()
    assert dict(found["target"]["target"].Attributes.GetUserStrings())["job"] == "The vault"
    assert len(found["supports"]) == len(built.shell.net.supports)
    assert len(found["crossings"]) == len(grid.lattice)
    assert len(found["target"]["target"].Geometry.Vertices) == len(vault.vertices)


def test_the_3dm_file_says_from_where_its_coordinates_count(built, vault, tmp_path):
    moved = replace(built, origin=(430000.0, 81000.25, 400.0))
    for case, told in ((moved, " ".join(moved.origin_notes)), (built, None)):
        exports.write_3dm(tmp_path / "model.3dm", case, vault)
        model = rhino3dm.File3dm.Read(str(tmp_path / "model.3dm"))
        (target,) = (each for each in model.Objects if each.Attributes.Name == "target")
        assert dict(target.Attributes.GetUserStrings()).get("coordinates") == told


def test_what_the_3dm_file_s_objects_say_of_themselves_is_true_under_each_load(folder, built):
    model = rhino3dm.File3dm.Read(str(folder / "gridshell.3dm"))
    layers = {layer.Index: layer.Name for layer in model.Layers}
    said, shell = {}, built.shell
    for each in model.Objects:
        own = {name: each.split() for name, each in each.Attributes.GetUserStrings()}
        said[layers[each.Attributes.LayerIndex], each.Attributes.Name] = own
    ties, network = shell.cables(built.design), shell.network(built.design)

    def numbers(layer, name, word):
        return np.array(said[layer, name][word], dtype=float)

    for load, state in built.states.items():
        push = -assemble(network).evaluate(state, tangent=False).force[:, :3]
        for k, node in enumerate(shell.net.supports):
            told = numbers("supports", f"S{k}", f"on the support under {load} [N]")
            np.testing.assert_allclose(told, push[node], atol=1e-6)
        for k in range(len(ties.ends)):
            told = [
                numbers("cables", f"C{k}", f"{word} under {load} {unit}")[0]
                for word, unit in (("length", "[m]"), ("force", "[N]"))
            ]
            np.testing.assert_allclose(told, [ties.lengths(state)[k], ties.tension(state)[k]], atol=1e-6)
        away = np.linalg.norm(state.positions - shell.target.positions, axis=1)
        for k, rod in enumerate(built.grid.rods):
            told = numbers(
                f"rods {rod.direction}", rod_names(built.grid)[k], f"off the target at most under {load} [m]"
            )
            assert told == pytest.approx(away[rod.nodes].max(), abs=1e-6)
        for k, pair in enumerate(built.grid.crossing_nodes):
            told = numbers("crossings", str(k), f"under {load} [m]")
            np.testing.assert_allclose(told, state.positions[pair].mean(axis=0), atol=1e-6)
    for k, pair in enumerate(built.grid.crossing_nodes):
        told = numbers("crossings", str(k), "target [m]")
        np.testing.assert_allclose(told, shell.target.positions[pair].mean(axis=0), atol=1e-6)
    for k, rod in enumerate(built.grid.rods):
        name = f"rods {rod.direction}", rod_names(built.grid)[k]
        np.testing.assert_allclose(numbers(*name, "marks from the first end [m]"), rod.marks, atol=1e-6)
        assert numbers(*name, "length [m]") == pytest.approx(rod.length, abs=1e-6)
    turns = rounds(shell, built.design)
    for k, pair in enumerate(cable_crossings(shell, built.design).tolist()):
        assert said["cables", f"C{k}"]["crossings"] == list(map(str, pair))
        assert said["cables", f"C{k}"]["tensioning round"] == [str(turns[k])]


def test_the_glb_file_has_closed_tubes_of_the_rods_volume(folder, built):
    scene = trimesh.load(folder / "gridshell.glb")
    sides, radius = exports.SIDES, built.design.radius
    area = 0.5 * sides * radius**2 * np.sin(2.0 * np.pi / sides)  # of a regular polygon
    place = built.states["design"].positions
    for direction in "uv":
        part = scene.geometry[f"rods {direction}"]
        part.merge_vertices(merge_norm=True, merge_tex=True)
        assert part.is_watertight
        length = sum(
            np.linalg.norm(np.diff(place[rod.nodes], axis=0), axis=1).sum()
            for rod in built.grid.rods
            if rod.direction == direction
        )
        assert part.volume == pytest.approx(area * length, rel=2e-3)
    assert set(scene.geometry) == {"rods u", "rods v", "cables", "supports", "target"}
    high = scene.geometry["rods v"].bounds[1][1]  # the format's y axis is upwards
    assert high == pytest.approx(place[:, 2].max() + radius, abs=radius)


def test_the_glb_file_draws_each_lath_of_two_layers_beside_the_rod_s_axis(
    built, vault, tmp_path, monkeypatch
):
    drawn, tubes = [], exports._tubes

    def noted(ways, radius):
        drawn.append(ways)
        return tubes(ways, radius)

    monkeypatch.setattr(exports, "_levels", lambda built: (-0.004, 0.004))
    monkeypatch.setattr(exports, "_tubes", noted)
    exports.write_glb(tmp_path / "two.glb", built, vault)
    state = built.states["design"]
    rods = [rod.nodes for direction in "uv" for rod in built.grid.rods if rod.direction == direction]
    laths = [way for ways in drawn[:2] for way in ways]
    assert len(laths) == 2 * len(rods)
    for nodes, lower, upper in zip(rods, laths[::2], laths[1::2], strict=True):
        np.testing.assert_allclose(0.5 * (lower + upper), state.positions[nodes], atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(upper - lower, axis=1), 0.008, atol=1e-12)


def test_the_step_file_has_a_curve_of_each_rod_and_cable_at_the_right_scale(folder, built):
    with session():
        gmsh.model.occ.importShapes(str(folder / "gridshell.step"), highestDimOnly=False)
        gmsh.model.occ.synchronize()
        curves = gmsh.model.getEntities(1)
        lengths = [gmsh.model.occ.getMass(*curve) for curve in curves]
    place = built.states["design"].positions
    rods = [np.linalg.norm(np.diff(place[rod.nodes], axis=0), axis=1).sum() for rod in built.grid.rods]
    cables = built.shell.cables(built.design).lengths(built.states["design"])
    assert lengths == pytest.approx([*rods, *cables], rel=1e-3)
    text = (folder / "gridshell.step").read_text(encoding="utf-8")
    parts = re.findall(r"PRODUCT\('([^']*)','", text)
    names = [*rod_names(built.grid), *(f"C{k}" for k in range(len(cables)))]
    assert parts == ["gridshell", *names, "points"], "each curve is a part under its name"
    assert re.findall(r"OCCURRENCE\('\d+','([^']*)'", text) == [*names, "points"]


def test_the_script_is_that_of_the_design(folder, built):
    text = (folder / "gridshell-opensees.py").read_text(encoding="utf-8")
    names = [node.targets[0].id for node in ast.parse(text).body if isinstance(node, ast.Assign)]
    assert names[:8] == ["NODES", "SECTIONS", "BEAMS", "CABLES", "SUPPORTS", "START", "LOAD", "MOVED"]
    assert "The vault, test" in text


def test_the_script_goes_from_the_bent_grid_without_load_to_the_design_load(folder, built):
    tree = ast.parse((folder / "gridshell-opensees.py").read_text(encoding="utf-8"))
    told = {
        node.targets[0].id: np.array(ast.literal_eval(node.value))
        for node in tree.body
        if isinstance(node, ast.Assign) and node.targets[0].id in ("NODES", "START", "MOVED")
    }
    unloaded, loaded = (built.states[name].positions for name in ("none", "design"))
    np.testing.assert_allclose(told["NODES"] + told["START"][:, :3], unloaded, atol=1e-12)
    np.testing.assert_allclose(told["MOVED"], loaded - unloaded, atol=1e-12)


def test_an_unknown_load_and_a_folder_in_the_way_are_refused(built, vault, loads, tmp_path):
    with pytest.raises(InputError, match="is no load case"):
        exports.write_exports(tmp_path, built, vault, loads, load="snow")
    (tmp_path / "file").write_text("in the way")
    for write in (
        lambda place: exports.write_vtu(place / "a.vtu", built),
        lambda place: exports.write_3dm(place / "a.3dm", built, vault),
        lambda place: exports.write_glb(place / "a.glb", built, vault),
        lambda place: exports.write_step(place / "a.step", built),
        lambda place: exports.write_script(place / "a.py", built, loads["design"]),
    ):
        with pytest.raises(InputError, match="can't be written"):
            write(tmp_path / "file")


def test_without_gmsh_s_libraries_everything_but_the_step_file_is_written(
    built, vault, loads, tmp_path, monkeypatch
):
    monkeypatch.delitem(sys.modules, "shellform.surface.occ")
    monkeypatch.delattr(shellform.surface, "occ")
    monkeypatch.setitem(sys.modules, "gmsh", None)
    assert "gmsh can't be loaded" in exports.no_step()
    exports.write_exports(tmp_path, built, vault, loads)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "blender.py",
        "grasshopper.py",
        "gridshell-opensees.py",
        "gridshell.3dm",
        "gridshell.glb",
        "gridshell.vtu",
    ]


def test_what_a_library_can_not_write_is_said_plainly(tmp_path):
    from shellform.surface.occ import write_curves
    from shellform.surface.readers.rhino import Item, write_rhino

    (tmp_path / "model.3dm").mkdir()  # rhino3dm says no without a reason
    with pytest.raises((InputError, OSError), match="can't write"):
        write_rhino(tmp_path / "model.3dm", [Item("rods u", "U0", np.eye(3))], {"rods u": "#000000"})
    (tmp_path / "model.step").mkdir()
    with pytest.raises(InputError, match=r"can't (write the curves|be written)"):
        write_curves(tmp_path / "model.step", [np.eye(3)], ["U0"])
