"""What no shell can be read from is refused with a message that says what is wrong and what to do; foreign
readers can't take us down.
"""

import json
import os
import re
import resource
import signal
import subprocess
import sys
import time
from pathlib import Path

import meshio
import numpy as np
import pytest
import pyvista

from shellform.errors import InputError
from shellform.surface import cad
from shellform.surface.readers import draft, foreign, reading
from shellform.surface.readers.reading import read_surface
from shellform.surface.units import turned_back
from tests.surface.shells import cap, compas_mesh, split, write_gltf, write_obj, write_off, write_stl

ROOT = Path(__file__).parent.parent.parent
DATA = ROOT / "tests/data"
POINTS, QUADS = cap()
TRIANGLES = split(QUADS)
SETTINGS = {"unit": None, "size": None, "up": "z", "layer": "", "name": "", "face": None}


def refused(file, *words, **choice):
    with pytest.raises(InputError) as caught:
        read_surface(file, **choice)
    said = str(caught.value)
    assert str(file) in said or "surface." in said
    assert caught.value.remedy
    for word in words:
        assert word in said, said


def every_format(folder):
    """One good file of each format that isn't a copy of shellform's own."""
    mesh = pyvista.PolyData(POINTS, np.column_stack([np.full(len(QUADS), 4), QUADS]).ravel())
    files = [
        write_obj(folder / "a.obj", POINTS, QUADS),
        write_off(folder / "a.off", POINTS, QUADS),
        write_stl(folder / "binary.stl", POINTS, TRIANGLES),
        write_stl(folder / "text.stl", POINTS, TRIANGLES, text=True),
        write_gltf(folder / "a.gltf", POINTS, TRIANGLES),
        write_gltf(folder / "a.glb", POINTS, TRIANGLES),
    ]
    (folder / "a.json").write_text(json.dumps(compas_mesh(POINTS, QUADS)))
    for name, binary in [("a.ply", True), ("text.ply", False), ("a.msh", True), ("text.msh", False)]:
        kind = {"ply": "ply", "msh": "gmsh"}[name[-3:]]
        meshio.Mesh(POINTS, [("quad", QUADS)]).write(folder / name, file_format=kind, binary=binary)
        files.append(folder / name)
    for name in ("a.vtk", "a.vtp"):
        mesh.save(folder / name)
        files.append(folder / name)
    mesh.cast_to_unstructured_grid().save(folder / "a.vtu")
    x, y = np.meshgrid(np.linspace(0.0, 8.0, 9), np.linspace(0.0, 6.0, 7), indexing="ij")
    pyvista.StructuredGrid(x, y, 0.1 * x * (8.0 - x)).save(folder / "a.vts")
    copies = [DATA / name for name in ("dome_mm.step", "dome_mm.igs", "dome_mm.brep", "tna_tutorial.3dm")]
    return [*files, folder / "a.json", folder / "a.vtu", folder / "a.vts", *copies]


def test_files_cut_off_in_the_middle_are_refused_in_every_format(tmp_path):
    for file in every_format(tmp_path):
        data = file.read_bytes()
        half = tmp_path / f"half-{file.name}"
        half.write_bytes(data[: len(data) * 2 // 5])
        refused(half)


def test_empty_files_and_files_that_are_not_there_are_refused(tmp_path):
    refused_name = tmp_path / "none.obj"
    with pytest.raises(InputError, match="there is no such file"):
        read_surface(refused_name)
    for ending in reading.ENDINGS:
        (tmp_path / f"empty{ending}").write_bytes(b"")
        refused(tmp_path / f"empty{ending}", "is empty")


def test_a_file_named_as_what_it_is_not_is_refused_with_its_true_format(tmp_path):
    for file in every_format(tmp_path):
        wrong = tmp_path / f"wrong-{file.stem}-{file.suffix[1:]}{'.off' if file.suffix != '.off' else '.stl'}"
        wrong.write_bytes(file.read_bytes())
        refused(wrong, "by its content, though its ending is", "Rename it to")


def test_junk_is_refused_whatever_its_ending(tmp_path):
    for ending in reading.ENDINGS:
        (tmp_path / f"junk{ending}").write_text("this is a letter, not a shell\n")
        refused(tmp_path / f"junk{ending}")
    (tmp_path / "letter.txt").write_text("this is a letter, not a shell\n")
    refused(tmp_path / "letter.txt", "in no format that is read here", ".step")
    (tmp_path / "shell.3mf").write_bytes(b"PK\x03\x04 and so on")
    refused(tmp_path / "shell.3mf", "zip archive")


def test_files_of_points_or_curves_alone_hold_no_faces(tmp_path):
    for name, text in [
        ("points.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n"),
        ("lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n"),
        ("points.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n0 1 0\n"),
    ]:
        (tmp_path / name).write_text(text)
        refused(tmp_path / name, "holds no faces")
    for name in ("lines.vtk", "lines.ply", "lines.msh"):
        kind = {"vtk": "vtk", "ply": "ply", "msh": "gmsh"}[name[-3:]]
        cells = (
            [("line", np.array([[0, 1], [1, 2]]))]
            if kind != "ply"
            else [("triangle", np.zeros((0, 3), dtype=int))]
        )
        meshio.Mesh(POINTS[:3], cells).write(tmp_path / name, file_format=kind)
        refused(tmp_path / name, "no faces")
    (tmp_path / "none.json").write_text(json.dumps(compas_mesh(POINTS, QUADS[:0])))
    refused(tmp_path / "none.json", "holds no faces")
    (tmp_path / "data.json").write_text('{"spacing": 3}')
    refused(tmp_path / "data.json", "no COMPAS mesh")
    pyvista.ImageData(dimensions=(3, 3, 3)).save(tmp_path / "image.vtk")
    refused(tmp_path / "image.vtk", "no faces")
    (tmp_path / "table.vtk").write_text(
        "# vtk DataFile Version 3.0\ntable\nASCII\nDATASET TABLE\nROW_DATA 2\nFIELD FieldData 1\n"
        "a 1 2 float\n1 2\n"
    )
    refused(tmp_path / "table.vtk", "holds no points")


def test_coordinates_that_are_no_numbers_are_named_by_vertex(tmp_path):
    for value in (np.nan, np.inf):
        points = POINTS.copy()
        points[7, 1] = value
        for file in (
            write_obj(tmp_path / "a.obj", points, QUADS),
            write_off(tmp_path / "a.off", points, QUADS),
            write_stl(tmp_path / "a.stl", points, TRIANGLES),
            write_gltf(tmp_path / "a.glb", points, TRIANGLES),
        ):
            refused(file, "coordinate that is no number")
    write_obj(tmp_path / "a.obj", points, QUADS)
    refused(tmp_path / "a.obj", "vertex 8")
    write_obj(tmp_path / "a.obj", 1e300 * POINTS, QUADS)
    refused(tmp_path / "a.obj", "coordinates of up to 3e+300 m")


def test_lines_that_can_not_be_read_are_quoted_by_number(tmp_path):
    good = write_obj(tmp_path / "a.obj", POINTS, QUADS).read_text()
    for bad in ("v 1 2", "v one two three", "f 1 2 x"):
        (tmp_path / "a.obj").write_text(good + bad + "\n")
        refused(tmp_path / "a.obj", f"line {good.count(chr(10)) + 1}", bad)
    text = write_off(tmp_path / "a.off", POINTS, QUADS).read_text().splitlines()
    (tmp_path / "a.off").write_text("\n".join([*text[:10], "0 0 x", *text[11:]]))
    refused(tmp_path / "a.off", "line 11")
    (tmp_path / "a.off").write_text("OFF\n")
    refused(tmp_path / "a.off", "ends after its first line")
    (tmp_path / "a.off").write_text("\n".join(text[:10]))
    refused(tmp_path / "a.off", f"ends after 7 of {len(POINTS) + len(QUADS)} vertices and faces")
    (tmp_path / "a.off").write_text("\n".join([*text[:-1], f"3 0 1 {10**20}"]))
    refused(tmp_path / "a.off", "a number beyond all counts")
    (tmp_path / "a.off").write_text("OFF\n\n3 x 0\n")
    refused(tmp_path / "a.off", "line 3")
    (tmp_path / "a.off").write_text("OFF BINARY\n\1\2")
    refused(tmp_path / "a.off", "isn't a text OFF file")
    (tmp_path / "a.obj").write_bytes(b"v 0 0 0\nv\0\n")
    refused(tmp_path / "a.obj", "isn't a text file")
    stl = write_stl(tmp_path / "a.stl", POINTS, TRIANGLES, text=True).read_text()
    (tmp_path / "a.stl").write_text(stl.replace("vertex", "vertex x", 1))
    refused(tmp_path / "a.stl", "line 4")
    lines = stl.splitlines()
    del lines[4]
    (tmp_path / "a.stl").write_text("\n".join(lines))
    refused(tmp_path / "a.stl", "not three a facet")


@pytest.mark.parametrize(
    ("face", "found", "said"),
    [
        ("0 1 2", 0, "indices count from 1"),
        ("1 2 0/3", 0, "indices count from 1"),
        ("1 2 -118", -118, "a face names a vertex before the first of 117"),
        ("1 2 119/3", 119, "a face names a vertex after the last of 118"),
        (f"1 2 {10**20}", 10**20, "a face names a vertex after the last of 118"),
    ],
)
def test_an_index_of_no_vertex_in_an_obj_is_told_as_written_with_its_line(tmp_path, face, found, said):
    """Of 117 vertices before that line and one after it, which it may name."""
    good = write_obj(tmp_path / "a.obj", POINTS, QUADS).read_text()
    (tmp_path / "a.obj").write_text(f"{good}f {face}\nv 9 9 9\nf 1 2 3\n")
    refused(tmp_path / "a.obj", f"a.obj, line {good.count(chr(10)) + 1}: {said}", f"found {found}")


def test_faces_that_come_before_their_vertices_in_an_obj_are_read(tmp_path):
    file = write_obj(tmp_path / "a.obj", POINTS, QUADS)
    area = read_surface(file).area
    file.write_text("\n".join(reversed(file.read_text().splitlines())))
    assert read_surface(file).area == pytest.approx(area)


def test_gltf_files_that_need_what_is_not_here_are_refused_by_name(tmp_path):
    tree = json.loads(write_gltf(tmp_path / "a.gltf", POINTS, TRIANGLES).read_text())
    for change, word in [
        ({"extensionsRequired": ["KHR_draco_mesh_compression"]}, "compressed (KHR_draco_mesh_compression)"),
        (
            {"extensionsRequired": ["KHR_mesh_quantization", "VENDOR_shape"]},
            "needs an extension that isn't read here (VENDOR_shape)",
        ),
        (
            {"nodes": [{"mesh": 0, "extensions": {"EXT_mesh_gpu_instancing": {"attributes": {}}}}]},
            "(EXT_mesh_gpu_instancing)",
        ),
        ({"nodes": [{"children": [0]}]}, "go round in a circle"),
        ({"accessors": [{**each, "sparse": {}} for each in tree["accessors"]]}, "sparse"),
        ({"accessors": [{**each, "sparse": {}, "normalized": True} for each in tree["accessors"]]}, "sparse"),
        ({"accessors": [{**each, "count": 10000} for each in tree["accessors"]]}, "shorter than it says"),
        ({"meshes": []}, "can't be read as glTF"),
    ]:
        (tmp_path / "a.gltf").write_text(json.dumps({**tree, **change}))
        refused(tmp_path / "a.gltf", word)


def test_a_gltf_file_nested_without_end_and_a_face_of_thousands_of_corners_are_refused(tmp_path):
    (tmp_path / "a.gltf").write_text('{"asset": {}, "bufferViews": ' + 9000 * "[")
    refused(tmp_path / "a.gltf", "can't be read as glTF")
    mesh = compas_mesh(POINTS, QUADS)
    mesh["data"]["face"]["3"] = 5000 * [1, 2]
    (tmp_path / "a.json").write_text(json.dumps(mesh))
    refused(tmp_path / "a.json", "a face of 10,000 corners; up to 1,000 are read")


def test_a_damaged_compas_mesh_is_named(tmp_path):
    mesh = compas_mesh(POINTS, QUADS)
    mesh["data"]["face"]["3"] = [0, 1, 9999]
    (tmp_path / "a.json").write_text(json.dumps(mesh))
    refused(tmp_path / "a.json", "its mesh Mesh is damaged")
    mesh = compas_mesh(POINTS, QUADS)
    mesh["data"]["vertex"]["0"]["x"] = 10**400
    (tmp_path / "a.json").write_text(json.dumps(mesh))
    refused(tmp_path / "a.json", "its mesh Mesh is damaged")


def test_a_solid_is_refused_without_a_choice_of_face_and_read_with_one(tmp_path):
    script = tmp_path / "solid.py"
    script.write_text(
        "def build(gmsh, *, side=2.0):\n"
        "    occ = gmsh.model.occ\n"
        "    ball = occ.addSphere(0, 0, -side, 2 * side)\n"
        "    hole = occ.addSphere(0, 0, -side, 1.9 * side)\n"
        "    box = occ.addBox(-3 * side, -3 * side, -4 * side, 6 * side, 6 * side, 4 * side)\n"
        "    occ.cut([(3, ball)], [(3, hole), (3, box)])\n"
    )
    for ending in ("step", "brep"):
        file = tmp_path / f"solid.{ending}"
        cad.write_cad(file, script)
        refused(file, "holds a solid", "--face")
        upper, lower = (read_surface(file, face=face) for face in ("upper", "lower"))
        for surface, radius in [(upper, 4.0), (lower, 3.8)]:
            away = surface.vertices + np.array([0, 0, 2.0])
            np.testing.assert_allclose(np.linalg.norm(away, axis=1), radius, atol=1e-6)
            np.testing.assert_allclose(surface.normals, away / radius, atol=1e-6)
            assert surface.vertices[:, 2].min() == pytest.approx(0.0, abs=1e-6)
        assert any("the upper face of a solid was taken" in note for note in upper.mended)
    with pytest.raises(InputError, match="upper or lower"):
        read_surface(file, face="outer")


@pytest.mark.parametrize("ending", ["step", "brep"])
def test_a_surface_beside_solids_is_taken_and_a_face_of_one_or_the_other_refused(tmp_path, ending):
    """Two squares that touch, beside a block, with a line and a point far away."""
    script = tmp_path / "both.py"
    script.write_text(
        "def build(gmsh, *, side=1.0):\n"
        "    occ = gmsh.model.occ\n"
        "    occ.addBox(5 * side, 0, 0, side, side, 2 * side)\n"
        "    occ.addRectangle(0, 0, 1, side, side)\n"
        "    occ.addRectangle(side, 0, 1, side, side)\n"
        "    far = [occ.addPoint(x * side, 0, 0) for x in (50, 60, 90)]\n"
        "    occ.addLine(*far[:2])\n"
    )
    file = tmp_path / f"both.{ending}"
    cad.write_cad(file, script)
    surface = read_surface(file)
    assert surface.area == pytest.approx(2.0)
    np.testing.assert_allclose(surface.size, [2.0, 1.0, 0.0], atol=1e-9)
    assert len(surface.triangles) > 2000  # of a sixtieth of the surface's plan, and not of all that is there
    assert any("it holds 1 solid and 2 surfaces: solids were left out" in note for note in surface.mended)
    refused(file, "holds 1 solid and 2 surfaces", "Leave the face out", face="upper")


@pytest.mark.parametrize("ending", ["step", "iges", "brep"])
def test_a_face_of_a_cad_file_without_solids_is_refused(tmp_path, ending):
    script = tmp_path / "one.py"
    script.write_text("def build(gmsh, *, side=1.0): gmsh.model.occ.addRectangle(0, 0, 0, side, side)\n")
    file = tmp_path / f"one.{ending}"
    cad.write_cad(file, script)
    refused(file, "surface.face", "isn't closed", "Leave surface.face (--face) out", face="upper")


@pytest.mark.parametrize("ending", ["step", "iges", "brep"])
@pytest.mark.parametrize(("setting", "entry"), [("layer", "surface.layer"), ("name", "surface.object")])
def test_layers_and_objects_of_cad_files_are_refused(tmp_path, ending, setting, entry):
    script = tmp_path / "one.py"
    script.write_text("def build(gmsh, *, side=1.0): gmsh.model.occ.addRectangle(0, 0, 0, side, side)\n")
    file = tmp_path / f"one.{ending}"
    cad.write_cad(file, script)
    with pytest.raises(InputError, match=rf"{entry}.*no layers and names are read.*roof.*--piece"):
        read_surface(file, **{setting: "roof"})


def test_two_shells_in_a_cad_file_are_refused_or_chosen_from(tmp_path):
    script = tmp_path / "two.py"
    script.write_text(
        "def build(gmsh, *, side=1.0):\n"
        "    gmsh.model.occ.addRectangle(0, 0, 0, side, side)\n"
        "    gmsh.model.occ.addRectangle(3 * side, 0, 0, 2 * side, side)\n"
    )
    cad.write_cad(tmp_path / "two.step", script)
    refused(tmp_path / "two.step", "2 separate pieces, of 2, 1 m²")
    np.testing.assert_allclose(read_surface(tmp_path / "two.step", piece=2).size, [1.0, 1.0, 0.0], atol=1e-9)


def test_files_beyond_the_stated_limits_are_refused_before_they_are_read(tmp_path, monkeypatch):
    huge = tmp_path / "huge.stl"
    with huge.open("wb") as file:
        file.truncate(2 * 1024**3)  # takes no room on the disk
    refused(huge, "is 2,048 MB large; up to 512 MB are read")
    monkeypatch.setattr(draft, "MOST_TRIANGLES", 100)
    refused(write_obj(tmp_path / "a.obj", POINTS, QUADS), "has 192 triangles; up to 100 are read")


@pytest.mark.parametrize(
    ("code", "words"),
    [
        ("import os, signal; os.kill(os.getpid(), signal.SIGSEGV)", ["meshio crashed on it (SIGSEGV)"]),
        ("import os; os._exit(3)", ["meshio failed on it: without a word"]),
        ("raise RuntimeError('no such luck')", ["meshio failed on it: RuntimeError: no such luck"]),
        (
            "import numpy; read = lambda *a, **k: numpy.ones(10**15)",
            ["can't be read as MSH", "Unable to allocate"],
        ),
        ("raise MemoryError", ["needs more memory"]),
        ("import time; time.sleep(60)", ["meshio hadn't come to an end after 2 s"]),
        (
            "import os, signal; os.kill(os.getpid(), signal.SIGXCPU)",
            ["meshio took more time of a processor than files of its size do"],
        ),
    ],
)
def test_a_reader_that_crashes_hangs_or_floods_the_memory_becomes_a_message(
    tmp_path, monkeypatch, code, words
):
    file = tmp_path / "a.msh"
    meshio.Mesh(POINTS, [("quad", QUADS)]).write(file, file_format="gmsh")
    (tmp_path / "meshio.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{ROOT}")
    longest = 2.0 if "sleep" in code else 60.0  # else a busy machine takes longer to begin
    with pytest.raises(InputError) as caught:
        foreign.read_foreign(file, "msh", SETTINGS, longest=longest)
    for word in [str(file), *words]:
        assert word in str(caught.value)
    assert (
        "Open it in the program" in caught.value.remedy
        or "Check that" in caught.value.remedy
        or "coarser" in caught.value.remedy
    )


@pytest.mark.parametrize(
    ("code", "longest", "words"),
    [
        ("while True: pass", 2.0, "the builder script hadn't come to an end after 2 s. Check the script."),
        ("import os; os.abort()", 60.0, "the builder script crashed on it (SIGABRT). Check the script."),
    ],
)
def test_a_stranger_s_builder_script_hangs_or_crashes_in_a_process_of_its_own(tmp_path, code, longest, words):
    (tmp_path / "own.py").write_text(f"{code}\ndef build(gmsh, *, width=1.0): pass\n")
    with pytest.raises(InputError, match=re.escape(words)):
        foreign.read_foreign(
            tmp_path / "own.py", "script", {"size": None, "dimensions": {"width": 1.0}}, longest=longest
        )


@pytest.mark.skipif(sys.platform != "linux", reason="where no other system ends a reader with its run")
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_reader_is_left_behind_where_a_command_is_ended(tmp_path, how):
    """The reader went on for up to 600 s after SIGKILL and SIGTERM."""
    began = tmp_path / "began"
    (tmp_path / "own.py").write_text(
        f"import os, time\nopen({str(began)!r} + '~', 'w').write(str(os.getpid()))\n"
        f"os.rename({str(began)!r} + '~', {str(began)!r})\n"
        "time.sleep(300)\ndef build(gmsh, *, width=1.0): pass\n"
    )
    code = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "from pathlib import Path\nfrom shellform.surface.readers.foreign import read_foreign\n"
        f"read_foreign(Path({str(tmp_path / 'own.py')!r}), 'script', {{'size': None, 'dimensions': {{'width': 1.0}}}})"
    )
    with subprocess.Popen([sys.executable, "-c", code], stderr=subprocess.DEVNULL) as command:
        until(began.is_file, 60.0)
        reader = Path("/proc") / began.read_text()
        assert reader.exists()
        command.send_signal(how)
        command.wait(30.0)
    until(lambda: not reader.exists() or "Z" in (reader / "stat").read_text().rsplit(")", 1)[1], 10.0)


def until(true, longest):
    end = time.monotonic() + longest
    while not true():
        assert time.monotonic() < end
        time.sleep(0.05)


def test_a_damaged_file_that_asks_for_all_memory_is_refused_within_two_gigabytes(tmp_path):
    """One such BREP file took 12 GB in 3 minutes."""
    text = (DATA / "dome_mm.brep").read_text().replace("Polygon3D 0", "Polygon3D 2147483647")
    (tmp_path / "a.brep").write_text(text)
    code = (
        "import resource\nfrom shellform.surface.readers.reading import read_surface\n"
        "from shellform.errors import InputError\n"
        f"try: read_surface({str(tmp_path / 'a.brep')!r}, unit='mm')\n"
        "except InputError as error: print(error)\n"
        "used = resource.getrusage(resource.RUSAGE_CHILDREN)\n"
        "print(used.ru_maxrss / 1e6, used.ru_utime + used.ru_stime)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    said, used = done.stdout.strip().splitlines()
    assert "a.brep: gmsh " in said
    memory, seconds = map(float, used.split())
    assert memory < 2.0
    assert seconds < 30.0


def test_a_reader_may_take_what_its_file_and_its_mesh_need_and_no_more(tmp_path):
    (tmp_path / "small").write_bytes(b"x")
    (tmp_path / "large").write_bytes(bytes(10**6))
    code = (
        "import resource, sys\nfrom pathlib import Path\n"
        "from shellform.surface.readers.allowance import allow_file, allow_mesh\n"
        "def told(): print(*(resource.getrlimit(kind)[0] for kind in (resource.RLIMIT_DATA, resource.RLIMIT_CPU)))\n"
        "resource.setrlimit(resource.RLIMIT_DATA, (5 * 10**9, 5 * 10**9))\n"
        f"for name in ('small', 'large'): allow_file(Path({str(tmp_path)!r}, name)); told()\n"
        "allow_mesh(1e6); told(); allow_mesh(1e6); told()\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    found = [tuple(map(int, line.split())) for line in done.stdout.splitlines()]
    # bytes and seconds; the process's own limit holds in the end
    assert found == [(1500000030, 31), (1530000000, 60), (3530000000, 560), (5000000000, 1060)]


def test_a_file_is_read_without_room_for_temporary_ones_and_within_limits_of_memory_and_file_size():
    def narrow():
        for kind, most in ((resource.RLIMIT_FSIZE, 0), (resource.RLIMIT_AS, 4 * 1024**3)):
            resource.setrlimit(kind, (most, most))

    code = f"from shellform.surface.readers.reading import read_surface\nread_surface({str(DATA / 'dome_mm.step')!r})"
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        env={**os.environ, "TMPDIR": "/proc", "PYTHONPATH": str(ROOT)},
        preexec_fn=narrow,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_refusal_in_the_reader_s_process_comes_back_whole():
    with pytest.raises(InputError) as caught:
        foreign.read_foreign(DATA / "dome_mm.step", "step", {**SETTINGS, "unit": "mm"})
    assert (caught.value.where, caught.value.value, caught.value.remedy) == (
        "surface.unit",
        "mm",
        "Leave the unit out.",
    )


def test_a_file_that_may_not_be_read_is_refused(tmp_path, monkeypatch):
    file = write_obj(tmp_path / "a.obj", POINTS, QUADS)

    def forbidden(*arguments, **options):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", forbidden)  # the tests may run as root, who may read all
    refused(file, "can't be read: Permission denied")


def test_a_shell_on_its_side_is_told(tmp_path):
    lying = read_surface(write_obj(tmp_path / "a.obj", POINTS[:, [2, 0, 1]], QUADS), up="z")
    assert any("it stands upright" in note and "--up" in note for note in lying.mended)
    assert not read_surface(write_obj(tmp_path / "a.obj", POINTS, QUADS)).mended


LYING = {
    "y": np.column_stack([POINTS[:, 0], POINTS[:, 2], -POINTS[:, 1]]),
    "x": np.column_stack([POINTS[:, 2], POINTS[:, 0], POINTS[:, 1]]),
}


@pytest.mark.parametrize("axis", LYING)
def test_a_shell_with_another_axis_up_is_set_upright_unasked_and_told(tmp_path, axis):
    file = write_obj(tmp_path / "a.obj", LYING[axis], QUADS)
    found, asked = read_surface(file), read_surface(file, up=axis)
    np.testing.assert_array_equal(found.vertices, asked.vertices)
    np.testing.assert_array_equal(found.triangles, asked.triangles)
    np.testing.assert_allclose(
        asked.vertices, read_surface(write_obj(tmp_path / "b.obj", POINTS, QUADS)).vertices
    )
    assert any(f"{axis} axis is taken for the vertical" in note for note in found.mended)
    assert not asked.mended
    as_told = read_surface(file, up="z")
    assert as_told.size[2] > asked.size[2]
    assert any("it stands upright" in note for note in as_told.mended)


def test_a_form_drawn_as_it_hangs_is_told_and_turned_over_where_that_is_asked_for(tmp_path):
    bowl = np.column_stack([POINTS[:, 0], -POINTS[:, 1], -POINTS[:, 2]])
    file = write_obj(tmp_path / "a.obj", bowl, QUADS)
    assert any("as it hangs" in note and "--up -z" in note for note in read_surface(file).mended)
    turned = read_surface(file, up="-z")
    np.testing.assert_allclose(turned.vertices, POINTS)
    assert not turned.mended


def told_axis(notes):
    """The one that what was told of a surface names to give."""
    (axis,) = {found for note in notes for found in re.findall(r"--up (\S+)\)", note)}
    return axis


@pytest.mark.parametrize("axis", ["x", "y", "z", "-x", "-y", "-z"])
@pytest.mark.parametrize("given", ["x", "y", "z", "-x", "-y", "-z", None])
def test_the_axis_that_is_told_of_a_shell_on_its_side_or_its_head_sets_it_upright(tmp_path, axis, given):
    """Saddles don't tell which side is up: a dome on a level edge does."""
    x, y = np.meshgrid(np.linspace(-1.0, 1.0, 9), np.linspace(-1.0, 1.0, 9))
    dome = np.column_stack([x.ravel(), y.ravel(), 0.4 * ((1.0 - x**2) * (1.0 - y**2)).ravel()])
    grid = np.arange(81).reshape(9, 9)
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    file = write_obj(tmp_path / "a.obj", turned_back(dome, axis), faces)
    found = read_surface(file, up=given)
    if given == axis or (given is None and not axis.startswith("-")):
        assert not any("turn it over" in note or "stands upright" in note for note in found.mended)
        return
    found = read_surface(file, up=told_axis(n for n in found.mended if "is taken" not in n))
    assert not found.mended
    np.testing.assert_allclose(found.size, [2.0, 2.0, 0.4], atol=1e-6)
    assert found.vertices[np.concatenate(found.boundary), 2].max() < 1e-6


def test_a_wall_is_told_to_stand_upright_whichever_axis_is_vertical(tmp_path):
    """A ring of walls with little of a roof."""
    turn, level = np.meshgrid(np.linspace(0.0, 2.0 * np.pi, 25)[:-1], np.linspace(0.0, 2.0, 5))
    ring = np.column_stack([np.cos(turn.ravel()), np.sin(turn.ravel()), level.ravel()])
    grid = np.column_stack([np.arange(120).reshape(5, 24), 24 * np.arange(5)])
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    (told,) = read_surface(write_obj(tmp_path / "a.obj", ring, faces)).mended
    assert "any other of its axes" in told
    assert "--up" not in told


def test_coordinates_that_32_bits_have_rounded_are_told(tmp_path):
    """At 2,600,000 m numbers of 32 bits lie a quarter of a metre apart."""
    away = 20.0 * POINTS + np.array([2_600_000.0, 0.0, 0.0])
    rounded = away.astype(np.float32).astype(float)
    for points, told in ((rounded, True), (away, False), (POINTS.astype(np.float32).astype(float), False)):
        notes = read_surface(write_obj(tmp_path / "a.obj", points, QUADS)).mended
        assert any("0.25 m apart" in note and "32 bits" in note for note in notes) is told
    in_mm = read_surface(write_obj(tmp_path / "a.obj", rounded, QUADS), unit="mm").mended
    assert any("0.00025 m apart" in note for note in in_mm)


def test_which_axis_is_vertical_is_found_before_openings_are_filled(tmp_path):
    """A barrel between two open arches, y up: with z up it lies on its side, where its ends can't be filled
    down to a ground, or come out flat."""
    turn, along = np.meshgrid(np.linspace(0.1 * np.pi, 0.9 * np.pi, 13), np.linspace(-1.5, 1.5, 9))
    corners = np.column_stack([2.0 * np.cos(turn.ravel()), 2.0 * np.sin(turn.ravel()), along.ravel()])
    grid = np.arange(corners.shape[0]).reshape(9, 13)
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    file = write_obj(tmp_path / "barrel.obj", corners, faces)
    found, asked = read_surface(file, fill="edges"), read_surface(file, up="y", fill="edges")
    np.testing.assert_array_equal(found.vertices, asked.vertices)
    np.testing.assert_array_equal(found.triangles, asked.triangles)
    assert found.area > read_surface(file).area


def test_wrong_settings_are_refused_before_the_file_is_read(tmp_path):
    file = write_obj(tmp_path / "a.obj", POINTS, QUADS)
    for choice, word in [
        ({"unit": "furlong"}, "surface.unit"),
        ({"up": "w"}, "surface.up"),
        ({"fill": "some"}, "surface.fill"),
    ]:
        with pytest.raises(InputError, match=word.replace(".", r"\.")):
            read_surface(file, **choice)


@pytest.mark.parametrize(
    ("corners", "words"),
    [
        ("3 0 1 7", "names vertex 8, of 4"),
        ("3 0 1 2.5", "can't be read as PLY"),
        ("3 0 1", "can't be read as PLY"),
    ],
)
def test_a_ply_file_whose_faces_can_not_be_is_refused(tmp_path, corners, words):
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    head += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    (tmp_path / "a.ply").write_text(head + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n" + corners + "\n")
    refused(tmp_path / "a.ply", words)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("vertex_indices", "edges", "no list vertex_indices"),
        ("uchar int", "uchar float", "no whole numbers"),
        ("property float z\n", "property float height\n", "holds no points"),
        ("float y", "list uchar float y", "PLY"),
        ("vertex 4", "vertex 4000000000000", "PLY|memory"),
        ("ascii", "binary_little_endian", "PLY"),
    ],
)
def test_a_ply_file_whose_head_says_something_else_is_refused(tmp_path, old, new, words):
    text = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
    text += "element face 1\nproperty list uchar int vertex_indices\nend_header\n"
    text += "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 " + ("3.5" if new == "uchar float" else "3") + "\n"
    assert old in text
    (tmp_path / "a.ply").write_text(text.replace(old, new))
    with pytest.raises(InputError, match=words):
        read_surface(tmp_path / "a.ply")


def gltf_tree(folder):
    return json.loads(write_gltf(folder / "a.gltf", POINTS, TRIANGLES).read_text())


def test_gltf_nodes_with_two_parents_and_in_circles_are_refused(tmp_path):
    tree = gltf_tree(tmp_path)
    doubled = [{"children": [k + 1, k + 1]} for k in range(60)] + [{"mesh": 0}]
    shared = [{"children": [1, 2]}, {"children": [3]}, {"children": [3]}, {"mesh": 0}]
    circle = [{"children": [1]}, {"children": [0], "mesh": 0}]
    for nodes in (doubled, shared, circle):
        changed = {**tree, "nodes": nodes, "scenes": [{"nodes": [0]}]}
        (tmp_path / "a.gltf").write_text(json.dumps(changed))
        refused(tmp_path / "a.gltf", "has two parents, or its nodes go round in a circle")


def test_a_gltf_file_that_places_one_mesh_beyond_all_limits_is_refused(tmp_path):
    tree = gltf_tree(tmp_path)
    nodes = [{"mesh": 0}] * 60_000
    (tmp_path / "a.gltf").write_text(
        json.dumps({**tree, "nodes": nodes, "scenes": [{"nodes": list(range(len(nodes)))}]})
    )
    refused(tmp_path / "a.gltf", "places its meshes 60,000 times")


@pytest.mark.parametrize("uri", ["../secret.bin", "%2e%2e/secret.bin", "/etc/hostname", "link.bin"])
def test_a_gltf_buffer_outside_the_file_s_folder_is_not_read(tmp_path, uri):
    (tmp_path / "secret.bin").write_bytes(bytes(100_000))
    inner = tmp_path / "scene"
    inner.mkdir()
    (inner / "link.bin").symlink_to(tmp_path / "secret.bin")
    tree = gltf_tree(inner)
    tree["buffers"][0]["uri"] = uri
    (inner / "a.gltf").write_text(json.dumps(tree))
    refused(inner / "a.gltf", "lies outside its folder")


@pytest.mark.parametrize("entry", [{"count": -1}, {"byteOffset": -8}, {"count": 10**12}])
def test_gltf_accessors_beyond_their_buffers_are_refused(tmp_path, entry):
    tree = gltf_tree(tmp_path)
    tree["accessors"][0] |= entry
    (tmp_path / "a.gltf").write_text(json.dumps(tree))
    refused(tmp_path / "a.gltf", "buffers are shorter than it says")


def test_separate_pieces_are_listed_with_their_sizes_and_the_option_given_takes_each(tmp_path):
    away = np.vstack([POINTS, 0.5 * POINTS + [20.0, 0.0, 0.0]])
    write_obj(tmp_path / "a.obj", away, np.vstack([QUADS, QUADS + len(POINTS)]))
    with pytest.raises(InputError) as caught:
        read_surface(tmp_path / "a.obj")
    for number in (1, 2):
        surface = read_surface(tmp_path / "a.obj", piece=number)
        size = " × ".join(f"{extent:.3g}" for extent in surface.size)
        assert f"--piece {number} is {size} m about (" in caught.value.remedy
