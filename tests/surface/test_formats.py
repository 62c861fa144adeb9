"""Every format comes out as the same shell, in metres and z up, and what a file holds besides can be chosen
from.
"""

import base64
import json
import tracemalloc
from pathlib import Path

import meshio
import numpy as np
import plyfile
import pytest
import pyvista
import rhino3dm
import trimesh

from shellform.errors import InputError
from shellform.surface import cad, occ
from shellform.surface.readers import rhino
from shellform.surface.readers.draft import Choice, Meshing
from shellform.surface.readers.gltf import surface_files
from shellform.surface.readers.meshes import write_mesh
from shellform.surface.readers.network_faces import faces_in_plan
from shellform.surface.readers.nurbs import Patch
from shellform.surface.readers.plain import read_obj
from shellform.surface.readers.reading import read_surface, surface_of
from tests.surface.brought import rhino_mesh
from tests.surface.shells import cap, compas_mesh, split, write_gltf, write_obj, write_off, write_stl, y_up

ROOT = Path(__file__).parent.parent.parent
POINTS, QUADS = cap()
TRIANGLES = split(QUADS)
SIZE = [6.0, 4.0, 1.5]
AWAY = np.array([20.0, 0.0, 0.0])


def polydata():
    return pyvista.PolyData(POINTS, np.column_stack([np.full(len(QUADS), 4), QUADS]).ravel())


def same_shell(surface, atol=1e-6):
    np.testing.assert_allclose(surface.size, SIZE, atol=atol)
    assert len(surface.vertices) == len(POINTS)
    assert len(surface.triangles) == len(TRIANGLES)
    assert len(surface.boundary) == 1
    assert surface.normals[:, 2].min() > 0.0
    place = surface.vertices - surface.vertices.mean(axis=0)
    np.testing.assert_allclose(np.sort(place[:, 2]), np.sort(POINTS[:, 2] - POINTS[:, 2].mean()), atol=atol)


def test_obj_off_and_both_kinds_of_stl_give_the_same_shell(tmp_path):
    for file in (
        write_obj(tmp_path / "a.obj", POINTS, QUADS, "# by hand\no shell\ng roof"),
        write_off(tmp_path / "a.off", POINTS, QUADS),
        write_stl(tmp_path / "b.stl", POINTS, TRIANGLES),
        write_stl(tmp_path / "t.stl", POINTS, TRIANGLES, text=True),
    ):
        same_shell(read_surface(file))


@pytest.mark.parametrize(
    ("name", "binary"), [("a.ply", True), ("a.ply", False), ("a.msh", True), ("a.msh", False)]
)
def test_meshio_s_own_files_come_back(tmp_path, name, binary):
    kind = {"ply": "ply", "msh": "gmsh"}[name[-3:]]
    meshio.Mesh(POINTS, [("quad", QUADS)]).write(tmp_path / name, file_format=kind, binary=binary)
    same_shell(read_surface(tmp_path / name))


@pytest.mark.parametrize(
    "kind", ["triangle6", "triangle10", "triangle15", "quad8", "quad9", "quad16", "quad25"]
)
def test_curved_elements_of_a_msh_file_count_by_their_corners(tmp_path, kind):
    corners = QUADS if kind.startswith("quad") else TRIANGLES
    inner = int(kind.removeprefix("triangle").removeprefix("quad")) - corners.shape[1]
    middle = np.vstack([POINTS, POINTS[corners[:, :2]].mean(axis=1)])
    cells = np.column_stack([corners, *[len(POINTS) + np.arange(len(corners))] * inner])
    meshio.Mesh(middle, [(kind, cells)]).write(tmp_path / "a.msh", file_format="gmsh")
    surface = read_surface(tmp_path / "a.msh")
    assert len(surface.vertices) == len(POINTS)
    assert surface.area == pytest.approx(read_surface(write_obj(tmp_path / "a.obj", POINTS, corners)).area)
    assert any("points of no face" in note for note in surface.mended)


@pytest.mark.parametrize("order", [2, 3, 4])
@pytest.mark.parametrize("version", [2.2, 4.1])
def test_gmsh_s_own_curved_meshes_are_read(tmp_path, order, version):
    """A quarter of a cylinder, 2 m in radius and 3 m long, of triangles of that order."""
    file = tmp_path / "a.msh"
    with occ.session():
        arc = occ.gmsh.model.occ.addCircle(0, 0, 0, 2.0, angle1=0.25 * np.pi, angle2=0.75 * np.pi)
        occ.gmsh.model.occ.extrude([(1, arc)], 0.0, 0.0, 3.0)
        occ.gmsh.model.occ.synchronize()
        occ.gmsh.option.setNumber("Mesh.MeshSizeMax", 0.2)
        occ.gmsh.option.setNumber("Mesh.MshFileVersion", version)
        occ.gmsh.model.mesh.generate(2)
        occ.gmsh.model.mesh.setOrder(order)
        occ.gmsh.write(str(file))
    surface = read_surface(file, up="y")
    assert surface.area == pytest.approx(3.0 * np.pi, rel=2e-3)
    assert len(surface.boundary) == 1


@pytest.mark.parametrize("name", ["a.vtk", "a.vtp", "grid.vtk", "grid.vtu"])
@pytest.mark.parametrize("binary", [True, False])
def test_vtk_s_own_files_come_back(tmp_path, name, binary):
    mesh = polydata().cast_to_unstructured_grid() if name.startswith("grid") else polydata()
    mesh.save(tmp_path / name, binary=binary)
    same_shell(read_surface(tmp_path / name))


@pytest.mark.parametrize("binary", [True, False])
def test_a_structured_grid_is_read_as_it_is_saved(tmp_path, binary):
    x, y = np.meshgrid(np.linspace(0.0, 8.0, 9), np.linspace(0.0, 6.0, 7), indexing="ij")
    grid = pyvista.StructuredGrid(x, y, 0.1 * x * (8.0 - x))
    grid.save(tmp_path / "a.vts", binary=binary)
    surface = read_surface(tmp_path / "a.vts")
    np.testing.assert_allclose(surface.size, [8.0, 6.0, 1.6])
    assert (len(surface.triangles), surface.mended) == (2 * 8 * 6, ())


def test_a_strip_of_triangles_in_a_vtp_file_is_read(tmp_path):
    polydata().triangulate().strip().save(tmp_path / "a.vtp")
    same_shell(read_surface(tmp_path / "a.vtp"))


@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_gltf_is_y_up_in_metres_and_its_nodes_place_the_meshes(tmp_path, name):
    surface = read_surface(write_gltf(tmp_path / name, y_up(POINTS), TRIANGLES, (3.0, 10.0, 0.0)))
    # The parent's quarter turn about the vertical swaps length and width, and the child is lifted by 10 m.
    np.testing.assert_allclose(surface.size, [4.0, 6.0, 1.5], atol=1e-6)
    np.testing.assert_allclose(surface.vertices[:, 2].max(), 11.5, atol=1e-5)
    small = read_surface(tmp_path / name, unit="mm", up="z")
    np.testing.assert_allclose(small.size, [0.004, 0.0015, 0.006], atol=1e-6)


@pytest.mark.parametrize(
    ("code", "kind", "lowest"),
    [(5120, "<i1", -127), (5121, "<u1", 0), (5122, "<i2", -32767), (5123, "<u2", 0)],
)
def test_whole_numbers_of_a_gltf_that_stand_for_shares_of_one_are_divided(tmp_path, code, kind, lowest):
    """As KHR_mesh_quantization stores coordinates: from the type's lowest number, which is -1 or 0, to its
    largest, which is 1; the node scales them back."""
    points = y_up(POINTS)
    low, high = points.min(axis=0), points.max(axis=0)
    most = np.iinfo(kind).max
    whole = np.round(lowest + (points - low) / (high - low) * (most - lowest)).astype(kind)
    if lowest < 0:
        whole[whole == lowest] -= 1  # the least that the type has, which stands for -1 too
    parts = (high - low) / (1.0 if lowest == 0 else 2.0)
    width = 4 * -(-3 * whole.itemsize // 4)  # rows begin at whole words
    rows = np.zeros((len(whole), width), "<u1")
    rows[:, : 3 * whole.itemsize] = whole.view("<u1").reshape(len(whole), -1)
    data = rows.tobytes() + TRIANGLES.astype("<u2").tobytes()
    tree = json.loads(write_gltf(tmp_path / "a.gltf", points, TRIANGLES).read_text())
    tree["extensionsRequired"] = ["KHR_mesh_quantization", "KHR_materials_unlit", "KHR_texture_transform"]
    tree["nodes"] = [{"mesh": 0, "scale": parts.tolist(), "translation": (high - parts).tolist()}]
    tree["accessors"][0] |= {"componentType": code, "normalized": True}
    tree["bufferViews"][0] |= {"byteLength": rows.size, "byteStride": width}
    tree["bufferViews"][1]["byteOffset"] = rows.size
    tree["buffers"] = [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}]
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    same_shell(read_surface(tmp_path / "a.gltf"), atol=6.0 / (most - lowest))


def test_a_gltf_buffer_may_stand_beside_the_file(tmp_path):
    file = write_gltf(tmp_path / "a.gltf", y_up(POINTS), TRIANGLES)
    tree = json.loads(file.read_text())
    (tmp_path / "a.bin").write_bytes(base64.b64decode(tree["buffers"][0]["uri"].partition(",")[2]))
    tree["buffers"][0]["uri"] = "a.bin"
    file.write_text(json.dumps(tree))
    assert len(read_surface(file).triangles) == len(TRIANGLES)
    (tmp_path / "a.bin").unlink()
    with pytest.raises(InputError, match=r"a\.bin isn't beside it"):
        read_surface(file)


def test_compas_meshes_of_both_versions_are_read(tmp_path):
    new = compas_mesh(POINTS, QUADS)
    old = {
        "datatype": "compas.datastructures.Mesh",
        "value": {**new["data"], "dva": new["data"]["default_vertex_attributes"]},
    }
    del (
        old["value"]["default_vertex_attributes"],
        old["value"]["facedata"],
        old["value"]["default_face_attributes"],
    )
    for name, tree in [("new.json", new), ("old.json", old), ("bare.json", new["data"])]:
        (tmp_path / name).write_text(json.dumps(tree))
        same_shell(read_surface(tmp_path / name))


def test_of_several_compas_meshes_one_has_to_be_named(tmp_path):
    two = [{**compas_mesh(POINTS, QUADS), "name": "shell"}, {**compas_mesh(2 * POINTS, QUADS), "name": "big"}]
    (tmp_path / "two.json").write_text(json.dumps(two))
    with pytest.raises(InputError, match=r"2 meshes.*shell, big"):
        read_surface(tmp_path / "two.json")
    np.testing.assert_allclose(read_surface(tmp_path / "two.json", name="big").size, np.array(SIZE) * 2)


def test_of_very_many_compas_meshes_the_first_names_are_told(tmp_path):
    (tmp_path / "many.json").write_text(json.dumps([compas_mesh(POINTS, QUADS)] * 210))
    with pytest.raises(InputError) as caught:
        read_surface(tmp_path / "many.json")
    assert caught.value.remedy.endswith(" Mesh 11, Mesh 12 and 198 more.")


@pytest.mark.parametrize(
    ("tree", "names"),
    [
        (lambda one, other: [one, other], "mesh 1, mesh 2"),
        (lambda one, other: {"roof": one, "site": other}, "roof, site"),
        (
            lambda one, other: [
                {**one, "attributes": {"name": "roof"}},
                {**other, "attributes": {"name": "roof"}},
            ],
            "roof 1, roof 2",
        ),
    ],
)
def test_compas_meshes_without_a_name_or_of_the_same_are_told_apart_and_chosen(tmp_path, tree, names):
    file = tmp_path / "two.json"
    file.write_text(
        json.dumps(tree(compas_mesh(POINTS, QUADS)["data"], compas_mesh(2 * POINTS, QUADS)["data"]))
    )
    with pytest.raises(InputError, match=f"2 meshes.*among {names}"):
        read_surface(file)
    for name, times in zip(names.split(", "), (1, 2), strict=True):
        np.testing.assert_allclose(read_surface(file, name=name).size, np.array(SIZE) * times)


def test_a_force_diagram_is_no_shell_unless_it_is_asked_for(tmp_path):
    form = {**compas_mesh(POINTS, QUADS)["data"], "attributes": {"name": "FormDiagram"}}
    force = {**compas_mesh(2 * POINTS, QUADS)["data"], "attributes": {"name": "ForceDiagram"}}
    (tmp_path / "a.json").write_text(json.dumps({"settings": {}, "form": form, "force": force}))
    same_shell(read_surface(tmp_path / "a.json"))
    asked = read_surface(tmp_path / "a.json", name="ForceDiagram")
    np.testing.assert_allclose(asked.size, np.array(SIZE) * 2)


def test_compas_meshes_keep_their_numbers_where_a_force_diagram_comes_before_them(tmp_path):
    file, own = tmp_path / "a.json", [compas_mesh(k * POINTS, QUADS)["data"] for k in (3, 1, 2)]
    file.write_text(json.dumps([{**own[0], "attributes": {"name": "ForceDiagram"}}, *own[1:]]))
    with pytest.raises(InputError, match=r"2 meshes.*among mesh 2, mesh 3\.$"):
        read_surface(file)
    for name, times in (("mesh 2", 1), ("mesh 3", 2), ("ForceDiagram", 3)):
        np.testing.assert_allclose(read_surface(file, name=name).size, np.array(SIZE) * times)
    file.write_text(json.dumps([{**own[0], "attributes": {"name": "ForceDiagram"}}, own[1]]))
    alone = read_surface(file)
    np.testing.assert_allclose(alone.size, SIZE)
    assert "mesh 2" not in " ".join(alone.mended)


def test_what_has_vertices_and_no_faces_in_a_compas_file_is_no_mesh(tmp_path):
    """A form diagram's network beside the mesh, as sessions hold them."""
    network = {"vertex": {"0": {"x": 0.0}, "1": {"x": 1.0}}, "edge": {"0": {"1": {}}}}
    file = tmp_path / "session.json"
    file.write_text(json.dumps({"network": network, "mesh": compas_mesh(POINTS, QUADS)}), encoding="utf-8")
    assert read_surface(file).size == pytest.approx(np.ptp(POINTS, axis=0))


def compas_network(points, faces):
    """The lines of a mesh as force density programs write them, each once, with a line that ends in
    nothing."""
    lines = sorted(
        {tuple(sorted(pair)) for face in faces for pair in zip(face, np.roll(face, 1), strict=True)}
    )
    places = np.vstack([points, points[0] - [1.0, 0.5, 0.0]])
    edges = {str(number): {} for number in range(len(places))}
    for a, b in [*lines, (0, len(points))]:
        edges[str(a)][str(b)] = {"q": -1.0}
    nodes = {str(k): dict(zip("xyz", map(float, place), strict=True)) for k, place in enumerate(places)}
    return {"dtype": "jax_fdm.datastructures/FDNetwork", "data": {"node": nodes, "edge": edges}}


def test_a_network_of_form_finding_gives_the_faces_between_its_lines(tmp_path):
    (tmp_path / "a.json").write_text(json.dumps(compas_network(POINTS, QUADS)))
    surface = read_surface(tmp_path / "a.json")
    same_shell(surface)
    assert surface.normals[:, 2].min() > 0.0
    assert any("between the lines of FDNetwork" in note for note in surface.mended)


def test_the_walk_round_a_network_is_no_face_of_it_nor_is_one_round_each_of_two():
    square = np.array([[0.0, 0, 1], [2, 0, 1], [2, 2, 1], [0, 2, 1], [1, 1, 2]])
    lines = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 4], [1, 4], [2, 4], [3, 4], [4, 3]])
    faces = faces_in_plan(square, lines, "here")
    assert sorted(map(sorted, faces)) == [[0, 1, 4], [0, 3, 4], [1, 2, 4], [2, 3, 4]]
    both = faces_in_plan(
        np.vstack([square, square + np.array([5, 0, 0])]), np.vstack([lines, lines + 5]), "here"
    )
    assert len(both) == 8


def test_a_network_whose_lines_cross_or_lie_on_each_other_in_plan_is_refused(tmp_path):
    square = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
    crossing = np.array([[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 3]])
    with pytest.raises(InputError, match="cross or touch in plan"):
        faces_in_plan(square, crossing, "here")
    tree = compas_network(
        np.vstack([POINTS, POINTS + np.array([0, 0, 1])]), np.vstack([QUADS, QUADS + len(POINTS)])
    )
    (tmp_path / "a.json").write_text(json.dumps(tree))
    mesh = read_surface(tmp_path / "a.json", piece=2)  # one above the other: two pieces, each told by itself
    same_shell(mesh)
    bowtie = np.array([[0.0, 0, 0], [2, 0, 0], [0, 2, 0], [2, 2, 0]])
    with pytest.raises(InputError, match="cross or touch in plan"):
        faces_in_plan(bowtie, np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), "here")


def test_of_several_networks_one_has_to_be_named_and_a_damaged_one_is(tmp_path):
    network = compas_network(POINTS, QUADS)
    two = [{**network, "name": "shell"}, {**network, "name": "other"}]
    (tmp_path / "two.json").write_text(json.dumps(two))
    with pytest.raises(InputError, match=r"2 networks.*shell, other"):
        read_surface(tmp_path / "two.json")
    chosen = read_surface(tmp_path / "two.json", name="other")
    same_shell(chosen)
    assert any("between the lines of other were taken" in note for note in chosen.mended)
    network["data"]["edge"]["0"]["nowhere"] = {}
    (tmp_path / "bad.json").write_text(json.dumps(network))
    with pytest.raises(InputError, match="its network FDNetwork is damaged"):
        read_surface(tmp_path / "bad.json")


def test_a_network_that_encloses_nothing_holds_no_faces(tmp_path):
    nodes = {str(k): {"x": float(k), "y": 0.0, "z": 1.0} for k in range(3)}
    tree = {"data": {"node": nodes, "edge": {"0": {"1": {}}, "1": {"2": {}}, "2": {}}}}
    (tmp_path / "a.json").write_text(json.dumps(tree))
    with pytest.raises(InputError, match="holds no faces"):
        read_surface(tmp_path / "a.json")


@pytest.mark.parametrize("loaded", ["_is_loaded", "is_loaded"])
def test_faces_without_load_in_a_compas_mesh_are_openings(tmp_path, loaded):
    mesh = compas_mesh(POINTS, QUADS)
    mesh["data"]["facedata"] = {"44": {loaded: False}}
    (tmp_path / "a.json").write_text(json.dumps(mesh))
    surface = read_surface(tmp_path / "a.json")
    assert surface.holes == 1
    assert "1 face without load was left out as an opening" in surface.mended


@pytest.mark.parametrize(
    ("unit", "up", "factor"),
    [("mm", "z", 1000.0), ("cm", "y", 100.0), ("m", "y", 1.0), ("ft", "z", 1 / 0.3048)],
)
def test_units_and_axes_are_as_stated(tmp_path, unit, up, factor):
    points = factor * (y_up(POINTS) if up == "y" else POINTS)
    same_shell(read_surface(write_obj(tmp_path / "a.obj", points, QUADS), unit=unit, up=up))


def test_objects_and_groups_of_an_obj_file_can_be_chosen(tmp_path):
    file = tmp_path / "two.obj"
    write_obj(file, POINTS, QUADS, "o shell\ng roof")
    write_obj(tmp_path / "more.obj", POINTS + AWAY, QUADS - len(POINTS) - 1, "o other\ng floor")
    file.write_text(file.read_text() + (tmp_path / "more.obj").read_text())
    same_shell(read_surface(file, name="Shell"))
    np.testing.assert_allclose(read_surface(file, layer="floor").vertices[:, 0].mean(), 20.0)
    with pytest.raises(InputError, match="There are 'shell', 'other'"):
        read_surface(file, name="dome")
    with pytest.raises(InputError, match="2 separate pieces"):
        read_surface(file)


def test_an_obj_file_of_a_group_a_panel_takes_as_much_memory_as_one_of_a_single_group(tmp_path):
    """2,500 panels of four corners each; with all corners for each panel they took 600 MB."""
    lines = []
    for k in range(2500):
        x, y = np.divmod(k, 50)
        lines += [f"v {x + a} {y + b} 1" for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        lines += [f"g panel {k}", "f -4 -3 -2 -1"]
    file = tmp_path / "panels.obj"
    file.write_text("\n".join(lines))
    tracemalloc.start()
    try:
        draft = read_obj(file, Choice())
        most = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert most < 30e6
    assert (len(draft.points), len(draft.triangles), len(draft.objects)) == (10_000, 5000, 2500)
    assert read_surface(file).mended == ("7399 vertices lay on others and were merged",)
    assert read_surface(file, layer="panel 7").mended == ()


def test_an_unknown_ending_is_read_by_its_content(tmp_path):
    same_shell(read_surface(write_obj(tmp_path / "shell.txt", POINTS, QUADS)))
    same_shell(read_surface(write_stl(tmp_path / "shell", POINTS, TRIANGLES)))
    (tmp_path / "dome.p21").write_bytes((ROOT / "tests/data/dome_mm.step").read_bytes())
    np.testing.assert_allclose(read_surface(tmp_path / "dome.p21").size, [0.9, 0.7, 0.2], rtol=1e-3)


def test_concave_polygons_are_cut_inside_themselves(tmp_path):
    # An L of six corners, of which a fan from the first would leave the L.
    outline = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]], dtype=float)
    for turn in range(6):
        order = np.roll(np.arange(6), turn)[None]
        surface = read_surface(write_obj(tmp_path / "l.obj", outline, order))
        assert surface.area == pytest.approx(3.0, rel=1e-12)


def rhino_file(file, shapes, unit="Millimeters"):
    """A 3DM file with (geometry, layer, name) shapes."""
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
    layers = {}
    for shape, layer, name in shapes:
        if layer not in layers:
            layers[layer] = model.Layers.AddLayer(layer, (0, 0, 0, 255))
        attributes = rhino3dm.ObjectAttributes()
        attributes.LayerIndex, attributes.Name = layers[layer], name
        model.Objects.Add(shape, attributes)
    model.Write(str(file), 7)
    return file


def sphere(radius):
    return rhino3dm.Sphere(rhino3dm.Point3d(0, 0, 0), radius)


def nurbs_cap(scale=1.0):
    """The paraboloid, exactly: a biquadratic Bézier surface."""
    surface = rhino3dm.NurbsSurface.Create(3, False, 3, 3, 3, 3)
    for i in range(3):
        for j in range(3):
            # Bernstein coefficients of 1 - (x² + y²)/2 over [-1, 1]²: x² has 1, -1, 1.
            z = 1.5 * (1 - ((1, -1, 1)[i] + (1, -1, 1)[j]) / 2)
            surface.Points[i, j] = rhino3dm.Point4d(
                scale * 3.0 * (i - 1), scale * 2.0 * (j - 1), scale * z, 1.0
            )
    for knots in (surface.KnotsU, surface.KnotsV):
        for k, value in enumerate((0.0, 0.0, 1.0, 1.0)):
            knots[k] = value
    return surface


def test_rhino_meshes_come_in_the_unit_of_their_file(tmp_path):
    file = rhino_file(tmp_path / "a.3dm", [(rhino_mesh(100 * POINTS, QUADS), "Shell", "roof")], "Centimeters")
    same_shell(read_surface(file), atol=1e-5)
    same_shell(read_surface(file, unit="cm"), atol=1e-5)
    with pytest.raises(InputError, match="centimeters"):
        read_surface(file, unit="mm")
    none = rhino_file(tmp_path / "b.3dm", [(rhino_mesh(POINTS, QUADS), "Shell", "roof")], "Unset")
    with pytest.raises(InputError, match="no usable unit"):
        read_surface(none)
    same_shell(read_surface(none, unit="m"), atol=1e-5)


def test_rhino_s_nurbs_surfaces_keep_their_exact_normals(tmp_path):
    surface = read_surface(rhino_file(tmp_path / "a.3dm", [(nurbs_cap(1000.0), "Shell", "roof")]))
    np.testing.assert_allclose(surface.size, SIZE, atol=2e-4)
    x, y, z = surface.vertices.T
    np.testing.assert_allclose(z, 1.5 * (1 - (x**2 / 9 + y**2 / 4) / 2), atol=1e-9)
    normal = np.column_stack([x / 6, 3 * y / 8, np.ones_like(x)])
    np.testing.assert_allclose(
        surface.normals, normal / np.linalg.norm(normal, axis=1, keepdims=True), atol=1e-9
    )


def test_rhino_s_rational_surfaces_are_round(tmp_path):
    # The upper half of a sphere's revolution, a brep with poles, on a solid that asks for a face.
    file = rhino_file(
        tmp_path / "a.3dm",
        [(rhino3dm.Extrusion.Create(half_circle(2.0), 5.0, False), "Shell", "barrel")],
        "Meters",
    )
    surface = read_surface(file, size=0.2)
    np.testing.assert_allclose(np.hypot(surface.vertices[:, 0], surface.vertices[:, 2]), 2.0, atol=1e-9)
    np.testing.assert_allclose(np.sort(surface.size), [2.0, 4.0, 5.0], atol=1e-2)


def half_circle(radius):
    points = [rhino3dm.Point3d(*p) for p in [(radius, 0, 0), (0, 0, radius), (-radius, 0, 0)]]
    return rhino3dm.Arc(*points).ToNurbsCurve()


def test_a_rhino_sphere_is_closed_and_refused(tmp_path):
    file = rhino_file(tmp_path / "a.3dm", [(sphere(1000.0).ToBrep(), "Shell", "ball")])
    for face, said in (
        (None, r"is closed.*\(surface.face, --face\)"),
        ("upper", "isn't set off from the rest"),
    ):
        with pytest.raises(InputError, match=said):
            read_surface(file, size=0.2, face=face)


def box(x):
    return rhino3dm.Brep.CreateFromBox(rhino3dm.Box(rhino3dm.BoundingBox(x, 0.0, 0.0, x + 0.6, 0.5, 0.3)))


def test_a_stack_of_blocks_is_refused_before_their_faces_are_built_and_a_surface_beside_them_is_read(
    tmp_path,
):
    blocks = [(box(float(k)), "Blocks", f"stone {k}") for k in range(51)]
    file = rhino_file(tmp_path / "a.3dm", blocks, "Meters")
    with pytest.raises(InputError, match=r"holds 51 closed solids.*choose one of them by surface.object"):
        read_surface(file)
    with pytest.raises(InputError, match="is closed"):
        read_surface(file, name="stone 7", size=0.2)
    file = rhino_file(tmp_path / "b.3dm", [*blocks, (nurbs_cap(), "Shell", "roof")], "Meters")
    with pytest.raises(InputError, match=r"beside 1 surface.*choose a surface.*'roof' on layer 'Shell'"):
        read_surface(file)
    assert read_surface(file, layer="Shell", size=0.5).size[0] == pytest.approx(6.0, rel=1e-6)


def test_blocks_of_one_name_are_not_offered_by_it(tmp_path):
    file = rhino_file(tmp_path / "a.3dm", [(box(float(k)), "Blocks", "stone") for k in range(51)], "Meters")
    with pytest.raises(InputError, match="holds 51 closed solids") as told:
        read_surface(file)
    assert told.value.remedy.endswith("upper faces joined, without the solids.")


def flat_panel(x, y, side):
    panel = rhino3dm.NurbsSurface.Create(3, False, 2, 2, 2, 2)
    for i in range(2):
        for j in range(2):
            a, b = x + i * side, y + j * side
            panel.Points[i, j] = rhino3dm.Point4d(a, b, 0.3 * a + 0.2 * b, 1.0)
    for knots in (panel.KnotsU, panel.KnotsV):
        knots[0], knots[1] = 0.0, 1.0
    return panel


def test_what_a_panel_costs_does_not_grow_with_how_many_there_are(tmp_path, monkeypatch):
    panels = [
        (rhino3dm.Brep.CreateFromSurface(flat_panel(float(i), float(j), 1.0)), "S", "")
        for i in range(15)
        for j in range(15)
    ]
    file = rhino_file(tmp_path / "a.3dm", panels, "Meters")
    beside, add = [], cad._add_patch

    def counted(patch):
        beside.append(len(cad.gmsh.model.occ.getEntities()))
        add(patch)

    monkeypatch.setattr(cad, "_add_patch", counted)
    monkeypatch.setattr(cad, "_TOGETHER", 100)
    drawn = rhino.read_rhino(file, Choice(), Meshing(1.0), unit=None)
    assert len(beside) == 225
    assert max(beside) <= 99 * 9  # each with its edges and corners
    surface = surface_of(drawn, "panels")
    assert len(surface.boundary) == 1
    assert surface.area == pytest.approx(225.0 * np.sqrt(1.0 + 0.3**2 + 0.2**2), rel=1e-9)


def test_straight_sides_are_told_by_their_ends():
    assert rhino._side_samples(flat_panel(0.0, 0.0, 1.0), 0) == 2
    assert rhino._side_samples(nurbs_cap(), 1) == rhino._SAMPLES


def test_rhino_s_trimmed_breps_are_trimmed(tmp_path):
    plane = rhino3dm.Plane(rhino3dm.Point3d(0, 0, 0), rhino3dm.Vector3d(0, 0, 1))
    disc = rhino3dm.Brep.CreateTrimmedPlane(
        plane, rhino3dm.Circle(rhino3dm.Point3d(0, 0, 0), 2.0).ToNurbsCurve()
    )
    surface = read_surface(rhino_file(tmp_path / "a.3dm", [(disc, "Shell", "disc")], "Meters"), size=0.05)
    assert surface.area == pytest.approx(np.pi * 4.0, rel=1e-3)


def test_rhino_s_patches_that_touch_are_one_surface(tmp_path):
    left, right = nurbs_cap(), nurbs_cap()
    right.Translate(rhino3dm.Vector3d(0, 4.0, 0))
    surface = read_surface(
        rhino_file(tmp_path / "a.3dm", [(left, "Shell", ""), (right, "Shell", "")], "Meters")
    )
    np.testing.assert_allclose(surface.size, [6.0, 8.0, 1.5], atol=2e-4)
    assert len(surface.boundary) == 1


def test_layers_and_names_of_a_rhino_file_are_listed_to_choose_from(tmp_path):
    shapes = [
        (nurbs_cap(), "Shell", "roof"),
        (rhino_mesh(POINTS + AWAY, QUADS), "Old", ""),
        (half_circle(1.0), "Shell", "edge"),
    ]
    file = rhino_file(tmp_path / "a.3dm", shapes, "Meters")
    with pytest.raises(
        InputError, match="both meshes and surfaces: 'roof' on layer 'Shell', 'mesh 1' on layer 'Old'"
    ):
        read_surface(file)
    with pytest.raises(InputError, match="There are 'Shell', 'Old'"):
        read_surface(file, layer="Shells")
    np.testing.assert_allclose(read_surface(file, layer="shell").size, SIZE, atol=2e-4)
    same_shell(read_surface(file, name="mesh 1"), atol=1e-5)


def test_a_rhino_file_of_curves_holds_no_surface(tmp_path):
    with pytest.raises(InputError, match="holds no surface, only Curve"):
        read_surface(rhino_file(tmp_path / "a.3dm", [(half_circle(1.0), "Shell", "edge")]))
    with pytest.raises(InputError, match=r"a.3dm: is empty. Save the surface"):
        read_surface(rhino_file(tmp_path / "a.3dm", []))


@pytest.mark.parametrize(
    ("ending", "text"),
    [("obj", "v 0 0 0\nv -3,25 0,5 1\n"), ("stl", "solid a\nfacet normal 0 0 1\nvertex 0,5 1 2\n")],
)
def test_decimals_with_a_comma_are_told_to_be_written_with_a_point(tmp_path, ending, text):
    file = tmp_path / f"a.{ending}"
    file.write_text(text)
    with pytest.raises(InputError, match=r"line [23] can't be read .*Export it anew, with decimal points\."):
        read_surface(file)


def test_rhino_s_blocks_stand_where_their_instances_are(tmp_path):
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    model.InstanceDefinitions.Add(
        "roof",
        "",
        "",
        "",
        rhino3dm.Point3d(0, 0, 0),
        (rhino_mesh(POINTS, QUADS),),
        (rhino3dm.ObjectAttributes(),),
    )
    block = model.InstanceDefinitions[0]
    model.Objects.AddInstanceObject(
        rhino3dm.InstanceReference(block.Id, rhino3dm.Transform.Translation(50.0, 0.0, 0.0))
    )
    model.Write(str(tmp_path / "a.3dm"), 7)
    surface = read_surface(tmp_path / "a.3dm")
    same_shell(surface, atol=1e-5)
    assert surface.vertices[:, 0].mean() == pytest.approx(50.0, abs=1e-4)


@pytest.mark.parametrize("stretch", [(1.0, 1.0, 1.0), (2.0, 1.0, 1.0), (1.0, 1.0, 1.5), (-1.0, 1.0, 1.0)])
def test_a_surface_of_revolution_in_a_block_is_stretched_as_its_instance_says(tmp_path, stretch):
    """A part of a ball of 3 m, cut off 1 m above its middle by its profile's end."""
    end = np.sqrt(8.0)
    profile = rhino3dm.Arc(
        rhino3dm.Point3d(0.0, 0.0, 3.0),
        rhino3dm.Point3d(3.0 * np.sin(0.5), 0.0, 3.0 * np.cos(0.5)),
        rhino3dm.Point3d(end, 0.0, 1.0),
    )
    axis = rhino3dm.Line(rhino3dm.Point3d(0.0, 0.0, 0.0), rhino3dm.Point3d(0.0, 0.0, 1.0))
    turned = rhino3dm.RevSurface.Create(profile.ToNurbsCurve(), axis, 0.0, 2.0 * np.pi)
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = rhino3dm.UnitSystem.Meters
    nothing = rhino3dm.ObjectAttributes()
    model.InstanceDefinitions.Add("cap", "", "", "", rhino3dm.Point3d(0, 0, 0), (turned,), (nothing,))
    place = rhino3dm.Transform(1.0)
    place.M00, place.M11, place.M22 = stretch
    model.Objects.AddInstanceObject(rhino3dm.InstanceReference(model.InstanceDefinitions[0].Id, place))
    model.Write(str(tmp_path / "a.3dm"), 7)
    surface = read_surface(tmp_path / "a.3dm", size=0.3)
    middle = surface.vertices / stretch
    np.testing.assert_allclose(np.linalg.norm(middle, axis=1), 3.0, atol=1e-6)
    assert middle[:, 2].min() == pytest.approx(1.0, abs=1e-6)
    assert len(surface.boundary) == 1


def test_rhino_tutorial_file_of_others_is_read_by_object():
    # 220 curves, a mesh and a plane brep of 10 × 10 mm.
    file = ROOT / "tests/data/tna_tutorial.3dm"
    for name in ("mesh 1", "brep 1"):
        np.testing.assert_allclose(read_surface(file, name=name).size, [0.01, 0.01, 0.0], atol=1e-9)


def test_a_rhinovault_session_gives_its_thrust_diagram_without_openings():
    surface = read_surface(ROOT / "tests/data/rhinovault_holes.json")
    np.testing.assert_allclose(surface.size, [9.379, 9.465, 1.5], atol=1e-3)
    assert surface.holes == 1
    pillow = read_surface(ROOT / "tests/data/rhinovault_pillow_vault.json")
    np.testing.assert_allclose(pillow.size, [10.0, 10.0, 3.535], atol=1e-3)


@pytest.mark.parametrize(("height", "told"), [(0.0, True), (0.5, False)])
def test_a_thrust_diagram_whose_vertical_equilibrium_is_not_solved_yet_is_told_to_be_flat(
    tmp_path, height, told
):
    corners = {str(k): {"x": k % 3, "y": k // 3, "z": height * (k == 4)} for k in range(9)}
    faces = {str(k): [j, j + 1, j + 4, j + 3] for k, j in enumerate((0, 1, 3, 4))}
    file = tmp_path / "session.json"
    file.write_text(json.dumps({"name": "ThrustDiagram", "vertex": corners, "face": faces}), encoding="utf-8")
    mended = read_surface(file).mended
    assert any("solve its vertical equilibrium" in each for each in mended) == told


@pytest.mark.parametrize("ending", ["stl", "obj", "ply", "off", "vtk", "vtu", "msh"])
def test_a_surface_written_as_a_mesh_comes_back_and_is_the_same_bytes_each_time(tmp_path, ending):
    surface = cad.build_surface(ROOT / "surfaces/dome.py", size=0.05)
    for name in ("dome", "again"):
        write_mesh(tmp_path / f"{name}.{ending}", surface)
    assert (tmp_path / f"dome.{ending}").read_bytes() == (tmp_path / f"again.{ending}").read_bytes()
    back = read_surface(tmp_path / f"dome.{ending}")
    np.testing.assert_allclose(back.size, surface.size, atol=1e-6)
    assert len(back.triangles) == len(surface.triangles)
    with pytest.raises(InputError, match=r"isn't a mesh format.*\.stl"):
        write_mesh(tmp_path / "dome.xyz", surface)
    (tmp_path / "none").touch()
    with pytest.raises(InputError, match="can't be written"):
        write_mesh(tmp_path / f"none/dome.{ending}", surface)
    assert len(list(tmp_path.iterdir())) == 3, "and nothing half-written stays"


def ellipse_on_the_cap(share):
    """Where the paraboloid of `nurbs_cap` is cut level, as a Rhino curve: the ellipse of half axes 3 and 2
    times `share`.
    """
    circle = rhino3dm.Circle(rhino3dm.Point3d(0, 0, 0), 1.0).ToNurbsCurve()
    circle.Transform(rhino3dm.Transform.Scale(rhino3dm.Plane.WorldXY(), 3.0 * share, 2.0 * share, 1.0))
    circle.Translate(rhino3dm.Vector3d(0, 0, 1.5 * (1 - share**2 / 2)))
    return circle


def test_curved_patches_are_cut_at_their_trims_and_holes():
    loops = [(rhino._curve(ellipse_on_the_cap(share), 1.0),) for share in (0.8, 0.3)]
    patch = rhino._patch(nurbs_cap(), loops, 1.0)
    draft = cad.mesh_patches([patch], Path("trimmed.3dm"), Meshing(0.1))
    x, y, z = draft.points.T
    np.testing.assert_allclose(z, 1.5 * (1 - (x**2 / 9 + y**2 / 4) / 2), atol=1e-5)
    level = np.sqrt(x**2 / 9 + y**2 / 4)
    assert level.min() == pytest.approx(0.3, abs=1e-4)
    assert level.max() == pytest.approx(0.8, abs=1e-4)


@pytest.mark.parametrize(
    ("side", "gap", "sewn"), [(80.0, 2e-5, True), (80.0, 1e-3, False), (0.5, 1e-7, True)]
)
def test_patches_are_sewn_over_gaps_of_up_to_a_millionth_of_their_extent(side, gap, sewn):
    def flat(first, last):
        corner = [[(x, y, 0.0) for y in (0.0, 0.5 * side)] for x in (first, last)]
        return Patch(np.array(corner), np.ones((2, 2)), ([0.0, 0.0, 1.0, 1.0],) * 2, (1, 1))

    halves = [flat(0.0, 0.5 * side), flat(0.5 * side + gap, side)]
    draft = cad.mesh_patches(halves, Path("halves.3dm"), Meshing(side))
    sides = np.sort(np.vstack([draft.triangles[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    found, count = np.unique(sides, axis=0, return_counts=True)
    middle = np.abs(draft.points[found[count == 1], 0] - 0.5 * side).max(axis=1) < 0.01 * side
    assert middle.any() == (not sewn)


def test_a_surface_of_revolution_closes_over_its_seam_and_pole(tmp_path):
    quarter = rhino3dm.Arc(
        *[rhino3dm.Point3d(*p) for p in [(3, 0, 0), (3 * 0.5**0.5, 0, 3 * 0.5**0.5), (0, 0, 3)]]
    )
    axis = rhino3dm.Line(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(0, 0, 1))
    turned = rhino3dm.RevSurface.Create(quarter.ToNurbsCurve(), axis, 0.0, 2 * np.pi)
    brep = rhino3dm.Brep.CreateFromRevSurface(turned, False, False)
    surface = read_surface(rhino_file(tmp_path / "a.3dm", [(brep, "Shell", "dome")], "Meters"), size=0.2)
    assert len(surface.boundary) == 1
    assert surface.area == pytest.approx(2 * np.pi * 9, rel=5e-3)
    np.testing.assert_allclose(np.linalg.norm(surface.vertices, axis=1), 3.0, atol=1e-6)
    np.testing.assert_allclose(surface.normals, surface.vertices / 3.0, atol=1e-3)


def ply(form, properties, elements=()):
    """A PLY file of the shell: `form` of its numbers, `properties` of vertices and faces with the numbers
    that stand before the corners and after them, `elements` before the faces."""
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[form]
    codes = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4",
    "float": "f4",
             "double": "f8", "int16": "i2", "uint16": "u2", "float64": "f8"}  # fmt: skip
    place, count, corner, quality = properties
    head = [
        "ply",
        f"format {form} 1.0",
        "comment made by hand",
        "obj_info none",
        f"element vertex {len(POINTS)}",
    ]
    head += [*(f"property {place} {axis}" for axis in "xyz"), "property uchar red", "property float quality"]
    head += [line for line, _ in elements]
    head += [f"element face {len(QUADS)}", f"property list {count} {corner} vertex_indices"]
    head += [f"property list uchar {quality} texcoord", f"property {quality} quality", "end_header"]
    rows = [[*((place, x) for x in point), ("uchar", 200), ("float", 0.5)] for point in POINTS.tolist()]
    rows += [row for _, row in elements if row]
    rows += [
        [
            (count, 4),
            *((corner, k) for k in quad),
            ("uchar", 2),
            (quality, 0.25),
            (quality, 1.0),
            (quality, 3),
        ]
        for quad in QUADS.tolist()
    ]
    text = "\n".join(head) + "\n"
    if form == "ascii":
        return (text + "\n".join(" ".join(f"{value:.9g}" for _, value in row) for row in rows)).encode()
    return text.encode() + b"".join(
        np.array(v).astype(order + codes[kind]).tobytes() for row in rows for kind, v in row
    )


MATERIALS = (
    ("element material 1", ()),
    ("property uchar ambient_red", ()),
    ("property list uchar float gloss", ()),
    (
        "property double coefficient",
        [("uchar", 7), ("uchar", 2), ("float", 1.0), ("float", 2.0), ("double", 0.5)],
    ),
)


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("elements", [(), MATERIALS])
@pytest.mark.parametrize(
    "properties",
    [
        ("float", "uchar", "int", "float"),  # MeshLab's
        ("double", "uchar", "uint", "double"),  # MeshLab's, of doubles
        ("float64", "ushort", "uint16", "float"),
        ("double", "int", "short", "double"),
        ("double", "uchar", "float", "float"),  # corners as numbers that are whole
    ],
)
def test_ply_files_are_read_with_lists_and_elements_of_any_type(tmp_path, form, elements, properties):
    (tmp_path / "a.ply").write_bytes(ply(form, properties, elements))
    same_shell(read_surface(tmp_path / "a.ply"), atol=1e-5)


def test_ply_files_of_other_libraries_are_read(tmp_path):
    trimesh.Trimesh(POINTS, TRIANGLES, process=False).export(tmp_path / "binary.ply")
    trimesh.Trimesh(POINTS, TRIANGLES, process=False).export(tmp_path / "text.ply", encoding="ascii")
    polydata().triangulate().save(tmp_path / "vtk.ply")
    vertex = np.array([tuple(p) for p in POINTS], dtype=[(axis, "f8") for axis in "xyz"])
    face = np.empty(len(QUADS), dtype=[("vertex_index", "O")])
    face["vertex_index"] = list(QUADS)
    elements = [
        plyfile.PlyElement.describe(vertex, "vertex"),
        plyfile.PlyElement.describe(face, "face", val_types={"vertex_index": "u4"}),
    ]
    plyfile.PlyData(elements, text=True).write(tmp_path / "plyfile.ply")
    text = (tmp_path / "text.ply").read_bytes().replace(b"\n", b"\r\n")
    (tmp_path / "windows.ply").write_bytes(text)
    (tmp_path / "capitals.ply").write_bytes(b"PLY" + (tmp_path / "text.ply").read_bytes()[3:])
    for name in ("binary", "text", "vtk", "plyfile", "windows", "capitals"):
        same_shell(read_surface(tmp_path / f"{name}.ply"), atol=1e-5)


def test_strips_of_triangles_in_a_ply_file_are_read(tmp_path):
    head = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    points = "0 0 0\n0 1 0\n1 0 0\n1 1 0\n2 0 0.1\n2 1 0.1\n"
    (tmp_path / "a.ply").write_text(head + points + "9 0 1 2 3 -1 2 3 4 5\n")
    surface = read_surface(tmp_path / "a.ply")
    assert len(surface.triangles) == 4
    assert surface.mended == ()


def test_a_gltf_buffer_s_name_is_decoded_and_may_stand_in_a_folder_below(tmp_path):
    file = write_gltf(tmp_path / "a.gltf", y_up(POINTS), TRIANGLES)
    tree = json.loads(file.read_text())
    (tmp_path / "the buffers").mkdir()
    content = base64.b64decode(tree["buffers"][0]["uri"].partition(",")[2])
    (tmp_path / "the buffers/größe 1.bin").write_bytes(content)
    tree["buffers"][0]["uri"] = "the%20buffers/gr%C3%B6%C3%9Fe%201.bin"
    file.write_text(json.dumps(tree))
    assert len(read_surface(file).triangles) == len(TRIANGLES)


def test_a_surface_is_read_from_its_file_and_the_buffers_that_a_scene_names_beside_it(tmp_path):
    file = write_gltf(tmp_path / "a.gltf", y_up(POINTS), TRIANGLES)
    assert surface_files(file) == [file]  # the buffer stands in it
    tree = json.loads(file.read_text())
    uris = ["one.bin", "two/b%20c.bin", "one.bin", "../out.bin", "/etc/hostname", "a%00b.bin"]
    tree["buffers"] = [{"uri": uri, "byteLength": 1} for uri in uris]
    file.write_text(json.dumps(tree))
    assert surface_files(file) == [file, tmp_path / "one.bin", tmp_path / "two/b c.bin"]
    other = tmp_path / "scene.txt"  # by its content a scene
    other.write_bytes(b" \n" + file.read_bytes())
    assert surface_files(other) == [other, *surface_files(file)[1:]]
    binary = write_gltf(tmp_path / "a.glb", y_up(POINTS), TRIANGLES)
    assert surface_files(binary) == [binary]


@pytest.mark.parametrize(
    "text",
    ["", "{", "[]", '{"buffers": 1}', '{"buffers": [{"uri": 3}]}', "glTF", "glTF" + 16 * "x", "o shell"],
)
def test_a_file_that_is_no_whole_scene_names_no_buffers(tmp_path, text):
    file = tmp_path / "a.gltf"
    assert surface_files(file) == [file]  # where it isn't there either
    file.write_text(text)
    assert surface_files(file) == [file]


def test_a_mesh_that_many_nodes_place_is_read_once_and_chosen_from_by_name(tmp_path):
    file = write_gltf(tmp_path / "a.gltf", y_up(POINTS), TRIANGLES)
    tree = json.loads(file.read_text())
    tree["nodes"] = [{"mesh": 0, "name": f"copy {k}", "translation": [10.0 * k, 0, 0]} for k in range(20_000)]
    tree["scenes"] = [{"nodes": list(range(20_000))}]
    file.write_text(json.dumps(tree))
    surface = read_surface(file, name="copy 17")
    assert len(surface.triangles) == len(TRIANGLES)
    assert surface.vertices[:, 0].mean() == pytest.approx(170.0 + y_up(POINTS)[:, 0].mean(), abs=1.0)
