"""Builder scripts and CAD files through gmsh: sizes, units, normals, and what is refused."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from shellform.errors import InputError, NotConverged
from shellform.surface import cad
from shellform.surface.occ import gmsh, session, silence
from shellform.surface.readers import draft
from shellform.surface.readers.reading import read_surface
from shellform.surface.readers.script import load_script

ROOT = Path(__file__).parent.parent.parent
DATA = ROOT / "tests/data"
DOME = ROOT / "surfaces/dome.py"

STRIPS = """
import math
def build(gmsh, *, gap=1e-9, turned=0.5, fold=1e-9):
    occ = gmsh.model.occ
    def strip(a, b, shift):
        angle = [math.radians(a), math.radians(b)]
        ends = [occ.addPoint(shift + math.sin(t), 0, math.cos(t)) for t in angle]
        occ.extrude([(1, occ.addCircleArc(ends[0], occ.addPoint(shift, 0, 0), ends[1]))], 0, 1, 0)
    strip(-50, -fold, math.sin(math.radians(fold)) - gap / 2)
    right = (fold, 50) if turned < 1 else (50, fold)
    strip(*right, gap / 2 - math.sin(math.radians(fold)))
"""


def script(folder, text):
    file = folder / "shell.py"
    file.write_text(text)
    return file


def ellipsoid_normals(points, length=0.9, width=0.7, height=0.2, roundness=0.72):
    foot = np.sqrt(1 - roundness**2)
    axes = np.array([0.5 * length / foot, 0.5 * width / foot, height / (1 - roundness)])
    centre = np.array([0.0, 0.0, -roundness * axes[2]])
    np.testing.assert_allclose((((points - centre) / axes) ** 2).sum(axis=1), 1.0, atol=1e-6)
    normals = (points - centre) / axes**2
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def cylinder_normals(points):
    normals = points * [1.0, 0.0, 1.0]
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_the_domes_normals_are_the_ellipsoids_own_up_to_its_pole_and_edge():
    surface = cad.build_surface(DOME, size=0.02)
    np.testing.assert_allclose(surface.normals, ellipsoid_normals(surface.vertices), atol=1e-6)


def test_dimensions_stretch_the_shell():
    surface = cad.build_surface(DOME, size=0.2, length=4.5, width=3, height=1.0)
    np.testing.assert_allclose(surface.size, [4.5, 3.0, 1.0], rtol=2e-3)
    assert cad.dimensions_of(DOME) == {"length": 0.90, "width": 0.70, "height": 0.20}


def test_a_surface_is_meshed_the_same_bit_for_bit():
    first, second = (cad.build_surface(ROOT / "surfaces/vault.py", size=0.03) for _ in range(2))
    np.testing.assert_array_equal(first.vertices, second.vertices)
    np.testing.assert_array_equal(first.triangles, second.triangles)
    np.testing.assert_array_equal(first.normals, second.normals)


@pytest.mark.parametrize("name", ["dome_mm.step", "dome_mm.igs", "dome_mm.brep"])
def test_files_in_millimetres_come_out_in_metres_with_cad_normals(name):
    surface = cad.import_surface(DATA / name, unit="mm" if name.endswith("brep") else None)
    np.testing.assert_allclose(surface.size, [0.9, 0.7, 0.2], rtol=1e-3)
    assert surface.area == pytest.approx(0.6175, rel=1e-3)
    # At the pole of the IGES face, where its parameters mean nothing, the normal is estimated: 1e-5 off.
    np.testing.assert_allclose(surface.normals, ellipsoid_normals(surface.vertices), atol=1e-4)
    assert 3000 < len(surface.triangles) < 12000  # the default size, a sixtieth of the plan


def test_a_brep_file_has_no_unit_and_is_taken_as_metres_unless_told():
    surface = cad.import_surface(DATA / "dome_mm.brep")
    np.testing.assert_allclose(surface.size, [900, 700, 200], rtol=1e-3)
    feet = cad.import_surface(DATA / "dome_mm.brep", unit="ft")
    np.testing.assert_allclose(feet.size, surface.size * 0.3048, rtol=1e-3)


@pytest.mark.parametrize(
    ("name", "written", "other"),
    [
        ("dome_mm.step", "SI_UNIT(.MILLI.,.METRE.)", "SI_UNIT($,.METRE.)"),
        ("dome_mm.igs", "2,2HMM", "6,1HM "),
    ],
)
def test_the_unit_is_the_one_that_the_file_states(tmp_path, name, written, other):
    text = (DATA / name).read_text()
    assert text.count(written) == 1
    (tmp_path / name).write_text(text.replace(written, other))
    np.testing.assert_allclose(cad.import_surface(tmp_path / name).size, [900, 700, 200], rtol=1e-3)


def test_a_fresh_process_reads_iges_first_and_prints_nothing():
    # OpenCASCADE takes no target unit before its first IGES file, and writes to standard output past Python.
    file = str(DATA / "dome_mm.igs")
    code = f"from shellform.surface import cad; s = cad.import_surface({file!r}); assert s.size[0] < 1"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert (run.returncode, run.stdout, run.stderr) == (0, "", "")


@pytest.mark.parametrize("ending", ["step", "igs", "brep"])
def test_written_geometry_comes_back_with_its_size(tmp_path, ending):
    cad.write_cad(tmp_path / f"dome.{ending}", DOME, height=0.25)
    np.testing.assert_allclose(
        cad.import_surface(tmp_path / f"dome.{ending}").size, [0.9, 0.7, 0.25], rtol=1e-3
    )


def test_a_file_may_stand_on_its_y_axis(tmp_path):
    text = "def build(gmsh, *, side=1.0):\n    gmsh.model.occ.addRectangle(0, 0, 0, side, 2 * side)\n"
    cad.write_cad(tmp_path / "wall.step", script(tmp_path, text))
    np.testing.assert_allclose(
        cad.import_surface(tmp_path / "wall.step", up="y").size, [1.0, 0.0, 2.0], atol=1e-9
    )
    with pytest.raises(InputError, match=r"surface\.up"):
        cad.import_surface(tmp_path / "wall.step", up="w")


@pytest.mark.parametrize("ending", ["step", "igs", "brep"])
@pytest.mark.parametrize("turned", [0.5, 1.0])
def test_faces_that_touch_are_sewn_and_share_smooth_normals(tmp_path, ending, turned):
    file = tmp_path / f"strips.{ending}"
    cad.write_cad(file, script(tmp_path, STRIPS), turned=turned, gap=1e-7)
    surface = cad.import_surface(file)
    assert len(surface.boundary) == 1
    assert surface.mended == ()
    np.testing.assert_allclose(surface.normals, cylinder_normals(surface.vertices), atol=1e-6)


def test_normals_across_a_fold_are_its_bisector(tmp_path):
    file = tmp_path / "fold.step"
    cad.write_cad(file, script(tmp_path, STRIPS), fold=20.0)
    surface = cad.import_surface(file)
    ridge = np.abs(surface.vertices[:, 0]) < 1e-6
    assert ridge.any()
    np.testing.assert_allclose(surface.normals[ridge], [[0, 0, 1]] * ridge.sum(), atol=1e-6)


def test_faces_that_do_not_touch_are_refused_as_pieces(tmp_path):
    cad.write_cad(tmp_path / "gap.step", script(tmp_path, STRIPS), gap=1e-3)
    with pytest.raises(InputError, match="2 separate pieces"):
        cad.import_surface(tmp_path / "gap.step")


def test_a_script_may_give_triangles_of_its_own(tmp_path):
    text = """
def build(gmsh, *, side=2.0):
    face = gmsh.model.addDiscreteEntity(2)
    points = [0, 0, 0, side, 0, 0, side, side, 0.1 * side, 0, side, 0]
    gmsh.model.mesh.addNodes(2, face, [1, 2, 3, 4], points)
    gmsh.model.mesh.addElementsByType(face, 2, [], [1, 2, 3, 1, 3, 4])
"""
    surface = cad.build_surface(script(tmp_path, text), size=0.1)
    assert len(surface.triangles) == 2
    np.testing.assert_allclose(surface.size, [2.0, 2.0, 0.2])


@pytest.mark.parametrize("dimension", [0.0, -0.9, float("nan"), float("inf"), True, "0.9"])
def test_dimensions_that_are_no_lengths_are_refused_by_name(dimension):
    with pytest.raises(InputError, match=r"surface\.dimensions\.width: must be a positive number"):
        cad.build_surface(DOME, size=0.02, width=dimension)


def test_an_unknown_dimension_is_refused_with_the_nearest_and_all_names():
    with pytest.raises(InputError, match=r"Did you mean 'width'\? Known: length, width, height"):
        cad.build_surface(DOME, size=0.02, widht=0.5)
    with pytest.raises(InputError, match=r"'rooms'.*Known: length, width, height") as refused:
        cad.build_surface(DOME, size=0.02, rooms=5)
    assert "Did you mean" not in str(refused.value)


@pytest.mark.parametrize("size", [0.0, -0.01, float("nan")])
def test_a_mesh_size_that_is_no_length_is_refused(size):
    with pytest.raises(InputError, match=r"surface\.size"):
        cad.build_surface(DOME, size=size)


def test_a_mesh_of_millions_of_triangles_is_refused_before_it_is_made():
    for size in (1e-5, 1e-300):
        with pytest.raises(InputError, match=r"more than 2,000,000 triangles.*Give 0\.00089 m or more"):
            cad.build_surface(DOME, size=size)
    with pytest.raises(InputError, match=r"more than 2,000,000 triangles.*check the surface's unit"):
        cad.import_surface(DATA / "dome_mm.brep", size=0.01)
    square = np.array([(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (0.0, 1.0)])
    with pytest.raises(InputError, match=r"more than 2,000,000 triangles.*Give 0\.0023 m or more"):
        cad.mesh_plan([square], size=1e-6)


def test_a_mesh_size_of_many_times_the_surface_is_refused_with_the_number_to_write():
    with pytest.raises(InputError, match=r"surface\.size: is 11.1 times .* For 10 mm write 0\.01\."):
        cad.build_surface(DOME, size=10.0)
    with pytest.raises(InputError, match=r"more than 2,000,000 triangles.* For 10 mm write 0\.01\."):
        cad.build_surface(DOME, size=1e-5)


def test_a_mesh_size_that_is_named_as_possible_is_taken(monkeypatch):
    monkeypatch.setattr(draft, "MOST_TRIANGLES", 2000)
    with pytest.raises(InputError, match="more than 2,000 triangles") as refused:
        cad.build_surface(DOME, size=0.001)
    named = float(refused.value.remedy.split()[1])
    found = len(cad.build_surface(DOME, size=named).triangles)
    assert 1000 < found <= 2000


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("def build(gmsh:\n", r"the script fails: SyntaxError(.|\n)*build\(gmsh, \*, length=0.90, ...\)"),
        ("import nothing_of_that_name\n", "the script fails: ModuleNotFoundError"),
        ("raise SystemExit(0)\n", "the script fails: SystemExit"),
        ("build = 3\n", r"has no function build\(gmsh"),
        ("def build(gmsh, *, length): pass\n", "its dimension 'length' has no positive default"),
        ("def build(gmsh, *, length=1.0): 1 / 0\n", "the script fails: ZeroDivisionError"),
        (
            "def build(gmsh, *, length=1.0): gmsh.model.occ.addPlaneSurface([7])\n",
            "the script fails: .*Unknown.* 7",
        ),
        ("def build(gmsh, *, length=1.0): pass\n", "makes no surface"),
        ("def build(gmsh, *, length=1.0): gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)\n", "closed"),
    ],
)
def test_a_script_that_fails_is_refused_with_its_own_message(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as refused:
        cad.build_surface(script(tmp_path, text), size=0.5)
    assert "shell.py" in str(refused.value)


def test_a_missing_script_and_one_that_is_no_python_are_refused(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        cad.build_surface(tmp_path / "none.py", size=0.1)
    with pytest.raises(
        InputError, match=r"^\\n\\udce9: there is no such file"
    ):  # a line's end, a byte that is no UTF-8
        cad.build_surface("\n\udce9", size=0.1)
    (tmp_path / "shell.txt").write_text("")
    with pytest.raises(InputError, match="isn't a Python script"):
        cad.build_surface(tmp_path / "shell.txt", size=0.1)


def test_a_form_that_does_not_converge_says_so_itself(tmp_path):
    text = """
from shellform.errors import NotConverged
def build(gmsh, *, length=1.0):
    gmsh.model.occ.addRectangle(0, 0, 0, length, length)
def form(points, triangles, edge, *, length):
    raise NotConverged("it swings")
"""
    with pytest.raises(NotConverged, match="it swings"):
        cad.build_surface(script(tmp_path, text), size=0.2)


@pytest.mark.parametrize("ending", ["step", "iges", "brep"])
def test_empty_and_garbage_files_are_refused(tmp_path, ending, capfd):
    file = tmp_path / f"shell.{ending}"
    for content in ("", "this is no CAD file\n" * 5):
        file.write_text(content)
        with pytest.raises(
            InputError, match=r"shell\.\w+: (gmsh can't read it|holds nothing).*Open it in a CAD program"
        ):
            cad.import_surface(file)
    assert capfd.readouterr().out == ""


def test_half_a_file_is_refused(tmp_path):
    (tmp_path / "half.step").write_text((DATA / "dome_mm.step").read_text()[:3000])
    with pytest.raises(InputError, match="gmsh can't read it"):
        cad.import_surface(tmp_path / "half.step")


def test_files_that_hold_no_open_surface_are_refused_with_what_to_do(tmp_path):
    with pytest.raises(InputError, match="there is no such file"):
        cad.import_surface(tmp_path / "none.step")
    (tmp_path / "shell.dwg").write_text("")
    with pytest.raises(InputError, match=r"isn't a CAD file.*\.step"):
        cad.import_surface(tmp_path / "shell.dwg")
    with pytest.raises(InputError, match=r"surface\.unit.*carry their own unit"):
        cad.import_surface(DATA / "dome_mm.step", unit="mm")
    with pytest.raises(InputError, match=r"surface\.unit.*Known: m, "):
        cad.import_surface(DATA / "dome_mm.brep", unit="furlong")
    box = "def build(gmsh, *, side=1.0): gmsh.model.occ.addBox(0, 0, 0, side, side, side)\n"
    cad.write_cad(tmp_path / "box.step", script(tmp_path, box))
    with pytest.raises(InputError, match=r"holds a solid\. Choose its upper or lower face"):
        cad.import_surface(tmp_path / "box.step")
    many = "def build(gmsh, *, side=1.0):\n  for k in range(51): gmsh.model.occ.addBox(2 * k, 0, 0, side, side, side)\n"
    cad.write_cad(tmp_path / "boxes.step", script(tmp_path, many))
    with pytest.raises(InputError, match=r"holds 51 solids, which make no one skin\. Export the surface"):
        cad.import_surface(tmp_path / "boxes.step")
    edge = "def build(gmsh, *, side=1.0): gmsh.model.occ.addCircle(0, 0, 0, side)\n"
    cad.write_cad(tmp_path / "edge.brep", script(tmp_path, edge))
    with pytest.raises(InputError, match="holds no surface, only points or curves"):
        cad.import_surface(tmp_path / "edge.brep")


def test_what_has_no_cad_geometry_is_not_written(tmp_path):
    with pytest.raises(InputError, match="is form-found on a mesh"):
        cad.write_cad(tmp_path / "vault.step", ROOT / "surfaces/vault.py")
    with pytest.raises(InputError, match="isn't a CAD file"):
        cad.write_cad(tmp_path / "dome.stl", DOME)


def test_gmsh_is_closed_after_success_and_failure_and_never_taken_from_another():
    gmsh = cad.gmsh
    cad.build_surface(DOME, size=0.1)
    with pytest.raises(InputError):
        cad.build_surface(DOME, size=1e-6)
    assert not gmsh.isInitialized()
    gmsh.initialize(argv=[], readConfigFiles=False, interruptible=False)
    try:
        with pytest.raises(InputError, match="already in use"):
            cad.build_surface(DOME, size=0.1)
        assert gmsh.isInitialized()
    finally:
        gmsh.finalize()


@pytest.mark.parametrize(
    ("cause", "remedy"),
    [
        ("libGL.so.1: cannot open shared object file", "apt-get install libgl1 libglu1-mesa"),
        ("libgmsh.so.4.15: failed to map segment from shared object", "Allow more memory (ulimit -v)"),
    ],
)
def test_why_gmsh_can_not_be_loaded_is_told_in_one_line(tmp_path, cause, remedy):
    (tmp_path / "gmsh.py").write_text(f"raise OSError({cause!r})\n")
    code = (
        "import shellform.errors as e\ntry:\n    import shellform.surface.cad\n"
        "except e.InputError as error:\n    print(error)"
    )
    path = os.pathsep.join([str(tmp_path), str(ROOT)])
    run = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": path},
    )
    assert cause in run.stdout
    assert remedy in run.stdout
    assert run.stdout.count("\n") == 1


def test_a_broken_pipe_does_not_kill_the_process_after_gmsh_was_at_work():
    """Gmsh gives SIGPIPE its deadly default back; a study's workers that went away then took the study with
    them.
    """
    code = (
        "import os; from shellform import cad; cad.build_surface('surfaces/dome.py', size=0.1); "
        "out, into = os.pipe(); os.close(out)\n"
        "try: os.write(into, b'x')\n"
        "except BrokenPipeError: print('told')"
    )
    root = Path(__file__).parent.parent.parent
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=root)
    assert (result.returncode, result.stdout.strip()) == (0, "told")


def test_a_curve_that_ends_where_it_begins_is_written_closed(tmp_path):
    from shellform.surface.occ import gmsh, session, write_curves

    angle = np.linspace(0.0, 2.0 * np.pi, 25)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(25)])
    write_curves(tmp_path / "ring.step", [ring], ["E0"])
    with session():
        gmsh.model.occ.importShapes(str(tmp_path / "ring.step"), highestDimOnly=False)
        gmsh.model.occ.synchronize()
        (curve,) = gmsh.model.getEntities(1)
        assert gmsh.model.occ.getMass(*curve) == pytest.approx(2.0 * np.pi, rel=1e-4)


def turned(*domes):
    """Turns an arc about its pole to a dome for each radius, height and place x, mm."""
    gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
    for radius, height, x in domes:
        points = [(x + radius, 0.0, 0.0), (x + 0.6 * radius, 0.0, height), (x, 0.0, height)]
        arc = gmsh.model.occ.addBezier([gmsh.model.occ.addPoint(*point) for point in points])
        gmsh.model.occ.revolve([(1, arc)], x, 0.0, 0.0, 0.0, 0.0, 1.0, 2.0 * np.pi)
    gmsh.model.occ.synchronize()


@pytest.mark.parametrize("across", [6.0, 900.0, 6000.0])
def test_a_dome_that_turns_about_its_pole_is_read_whatever_its_size(tmp_path, across):
    file = tmp_path / "dome.step"
    with session(), silence():
        turned((0.5 * across, 0.2 * across, 0.0))
        gmsh.write(str(file))
    surface = read_surface(file)
    np.testing.assert_allclose(1e3 * surface.size / across, [1.0, 1.0, 0.2], atol=3e-3)
    top = np.argmax(surface.vertices[:, 2])
    np.testing.assert_allclose(surface.normals[top], [0.0, 0.0, 1.0], atol=1e-3)


@pytest.mark.parametrize(("ending", "unit"), [("step", None), ("brep", "mm")])
def test_of_two_domes_that_do_not_touch_each_can_be_taken(tmp_path, ending, unit):
    """Sewn, their poles would come apart."""
    file = tmp_path / f"domes.{ending}"
    with session(), silence():
        turned((3000.0, 1200.0, 0.0), (500.0, 400.0, 6000.0))
        gmsh.write(str(file))
    with pytest.raises(InputError, match="2 separate pieces"):
        read_surface(file, unit=unit)
    for piece, size in ((1, [6.0, 6.0, 1.2]), (2, [1.0, 1.0, 0.4])):
        np.testing.assert_allclose(read_surface(file, unit=unit, piece=piece).size, size, atol=0.02)


def test_a_script_is_run_as_it_is_and_leaves_nothing_beside_it(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "dont_write_bytecode", False)
    for height in ("1.0", "2.0"):
        file = script(tmp_path, f"HEIGHT = {height}\n")
        os.utime(file, (1e9, 1e9))  # as copied with its time, or saved twice in a second
        assert f"{load_script(file).HEIGHT}" == height
    assert list(tmp_path.iterdir()) == [file]
