"""Deviation maps of a synthetic dome: what the pictures show, what is refused, what is left on the disc."""

import functools
import itertools
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import imageio_ffmpeg
import numpy as np
import pytest
import pyvista as pv
from PIL import Image, ImageSequence

from shellform.errors import InputError
from shellform.output.exchange import vtp
from shellform.output.pictures import images, legend, render, scene, sheets, vectors, view
from shellform.output.pictures.panel import Look, Panel, Skin, scale_of

SIZE = (400, 300)
SMALL = Look(size=SIZE)


def dome(side=9, pieces=4):
    """A square grid of rods on a dome 1 m wide and 0.3 m high, of `pieces` elements a segment, diagonals as
    cables.
    """
    line = np.linspace(-0.5, 0.5, (side - 1) * pieces + 1)
    nodes, number, beams = [], {}, []

    def node(x, y):
        key = (round(x, 9), round(y, 9))
        if key not in number:
            number[key] = len(nodes)
            nodes.append([x, y, 0.3 - 0.6 * (x * x + y * y)])
        return number[key]

    for across in line[::pieces]:
        along = [node(x, across) for x in line], [node(across, y) for y in line]
        for rod in along:
            beams += itertools.pairwise(rod)
    knots = [[node(x, y) for x in line[::pieces]] for y in line[::pieces]]
    cables = [(knots[i][j], knots[i + 1][j + 1]) for i in range(side - 1) for j in range(side - 1)]
    edge = sorted({*knots[0], *knots[-1], *(row[0] for row in knots), *(row[-1] for row in knots)})
    inner = [each for row in knots[1:-1:2] for each in row[1:-1:2]]
    return np.array(nodes), np.array(beams), np.array(cables), np.array(edge), np.array(inner)


@functools.cache
def panel():
    nodes, beams, cables, supports, loads = dome()
    deviation = np.abs(np.random.default_rng(1).normal(scale=0.004, size=len(nodes)))
    forces = np.linspace(0.5, 12.0, len(cables))
    return Panel("A dome", nodes, beams, deviation, cables, forces, supports, loads, 0.001)


def bare(**changes):
    """The dome's rods alone, for counting pixels."""
    none = np.empty((0, 2), int)
    alone = {"cables": none, "cable_forces": np.empty(0), "supports": [], "load_points": []}
    return replace(panel(), **{**alone, **changes})


def above(picture):
    """The part of a picture between title and colour bar."""
    return picture[45 : SIZE[1] - legend.key_height(SMALL)].astype(int)


def ink(picture, axis=None):
    """Pixels that are not white."""
    return (picture.min(axis=2) < 250).sum() if axis is None else (picture.min(axis=2) < 250).any(axis=axis)


def test_the_same_panel_gives_the_same_picture():
    first = render.image(panel(), SMALL)
    second = render.image(panel(), SMALL)
    assert first.shape == (300, 400, 3)
    assert first.dtype == np.uint8
    assert ink(above(first)) > 500
    assert np.abs(first.astype(int) - second).max() <= 1


@pytest.mark.parametrize("share", [0.0, 0.5, 1.0, 30.0])
def test_rods_have_the_colour_of_the_bar_at_their_deviation(share):
    count = len(panel().positions)
    picture = above(render.image(bare(deviation=np.full(count, share * 0.010)), SMALL))
    wanted = legend.rod_colours(np.array([share]))[0].astype(float)
    seen = picture[picture.min(axis=2) < 200].astype(float)
    # shading dims a colour, but does not turn it
    turned = (seen @ wanted) / (np.linalg.norm(seen, axis=1) * np.linalg.norm(wanted) + 1e-9)
    assert np.median(turned) > 0.97


def test_colours_are_those_of_viridis_and_stay_at_its_ends():
    ends = legend.rod_colours(np.array([0.0, 0.5, 1.0, 7.0]))
    np.testing.assert_array_equal(ends, [[68, 1, 84], [33, 145, 140], [253, 231, 37], [253, 231, 37]])


def test_slack_cables_are_fainter_than_taut_ones():
    only = {"beams": np.empty((0, 2), int), "supports": [], "load_points": []}
    taut = above(render.image(replace(panel(), **only, cable_forces=np.full(64, 5.0)), SMALL))
    slack = above(render.image(replace(panel(), **only, cable_forces=np.zeros(64)), SMALL))
    assert (255 - slack).sum() < 0.5 * (255 - taut).sum()
    assert ink(slack) > 500


def test_a_cable_is_as_thick_as_its_force():
    only = {"beams": np.empty((0, 2), int), "supports": [], "load_points": []}
    half = np.arange(64) < 32
    uneven = above(render.image(replace(panel(), **only, cable_forces=np.where(half, 12.0, 0.1)), SMALL))
    even = above(render.image(replace(panel(), **only, cable_forces=np.full(64, 12.0)), SMALL))
    assert 0.4 * (255 - even).sum() < (255 - uneven).sum() < 0.85 * (255 - even).sum()


def test_a_gridshell_without_cables_loads_or_supports_is_drawn():
    assert ink(above(render.image(bare(), SMALL))) > 500


def test_supports_and_loads_are_marked():
    plain = above(render.image(bare(), Look(size=SIZE, frame=panel().positions)))
    supported = above(render.image(bare(supports=panel().supports), Look(size=SIZE, frame=panel().positions)))
    unloaded = above(render.image(bare(), Look(size=SIZE, frame=np.add(panel().positions, [0.0, 0.0, 0.04]))))
    loaded = above(
        render.image(
            bare(load_points=panel().load_points),
            Look(size=SIZE, frame=np.add(panel().positions, [0.0, 0.0, 0.04])),
        )
    )
    assert (np.abs(plain - supported).max(axis=2) > 60).sum() > 50
    assert (np.abs(unloaded - loaded).max(axis=2) > 60).sum() > 50


@pytest.mark.parametrize("view", ["best", "top", "front", "side"])
def test_the_whole_shell_lies_in_the_frame_also_when_it_has_snapped_through(view):
    inverted = replace(panel(), positions=panel().positions * [1.0, 1.0, -1.4])
    for each in (panel(), inverted):
        picture = above(render.image(each, Look(size=SIZE, view=view)))
        across, down = ink(picture, axis=0), ink(picture, axis=1)
        assert not across[[0, -1]].any()
        assert not down[-1]
        assert across.mean() > 0.4 or down.mean() > 0.5


def test_pictures_with_one_frame_share_their_camera():
    inverted = bare(positions=panel().positions * [1.0, 1.0, -1.0])
    both = np.vstack([panel().positions, inverted.positions])
    first = above(render.image(bare(), Look(size=SIZE, frame=both, view="front")))
    second = above(render.image(inverted, Look(size=SIZE, frame=both, view="front")))
    np.testing.assert_allclose(
        np.flatnonzero(ink(first, 0))[[0, -1]], np.flatnonzero(ink(second, 0))[[0, -1]], atol=1
    )
    assert np.flatnonzero(ink(first, 1))[0] < np.flatnonzero(ink(second, 1))[0]


def test_a_target_surface_shows_through():
    corners = np.array([[-0.5, -0.5, 0.0], [0.5, -0.5, 0.0], [0.5, 0.5, 0.0], [-0.5, 0.5, 0.0]])
    plain = above(render.image(bare(), Look(size=SIZE, view="top", frame=corners)))
    covered = above(
        render.image(bare(), Look(size=SIZE, view="top", surface=Skin(corners, [[0, 1, 2], [0, 2, 3]])))
    )
    assert (np.abs(plain - covered).max(axis=2) > 5).mean() > 0.2
    dark = plain.max(axis=2) < 120  # rods stand above it
    assert dark.sum() > 500
    assert np.abs(plain - covered)[dark].mean() < 30


def test_elements_without_length_do_not_make_their_rods_vanish():
    positions = np.array(panel().positions)
    first, second = panel().beams[5]
    positions[second] = positions[first]
    whole, pinched = (
        ink(above(render.image(bare(), SMALL))),
        ink(above(render.image(bare(positions=positions), SMALL))),
    )
    assert pinched > 0.95 * whole


def test_a_sheet_has_the_size_of_its_panels_and_one_scale_and_camera(tmp_path):
    good, bad = (
        bare(deviation=np.zeros(len(panel().positions))),
        bare(deviation=np.full(len(panel().positions), 0.5)),
    )
    render.sheet(tmp_path / "sheet.png", [[good, bad], [good]], SMALL)
    page = np.flipud(pv.read(tmp_path / "sheet.png").point_data.active_scalars.reshape(-1, 800, 3))
    assert page.shape == (600 + legend.key_height(SMALL), 800, 3)
    upper, lower = page[45:300, :400].astype(int), page[345:600, :400].astype(int)
    assert ink(upper) > 500
    assert np.abs(upper - lower).max() <= 1
    np.testing.assert_array_equal(
        ink(page[45:300, :400], 0), ink(page[45:300, 400:], 0)
    )  # yellow at the same pixels
    assert ink(page[300:600, 400:]) == 0  # the short row's end stays white
    assert [path.name for path in tmp_path.iterdir()] == ["sheet.png"]


def test_a_picture_on_the_disc_is_the_image(tmp_path):
    render.picture(tmp_path / "a.png", panel(), SMALL)
    read = np.flipud(pv.read(tmp_path / "a.png").point_data.active_scalars.reshape(300, 400, 3))
    assert np.abs(read.astype(int) - render.image(panel(), SMALL)).max() <= 1


def test_a_state_file_holds_rods_then_cables_with_their_values(tmp_path):
    given = panel()
    vtp.write_vtp(tmp_path / "state.vtp", given, {"N": np.arange(len(given.beams))})
    mesh = pv.read(tmp_path / "state.vtp")
    np.testing.assert_allclose(mesh.points, given.positions)
    np.testing.assert_array_equal(mesh.lines.reshape(-1, 3)[:, 1:], np.vstack([given.beams, given.cables]))
    np.testing.assert_allclose(mesh.point_data["deviation"], given.deviation)
    rods = len(given.beams)
    assert np.isnan(mesh.cell_data["cable_force"][:rods]).all()
    np.testing.assert_allclose(mesh.cell_data["cable_force"][rods:], given.cable_forces)
    np.testing.assert_allclose(mesh.cell_data["N"][:rods], np.arange(rods))
    assert np.isnan(mesh.cell_data["N"][rods:]).all()
    np.testing.assert_array_equal(mesh.cell_data["cable"], [0] * rods + [1] * len(given.cables))


def test_lines_without_cables_and_with_vectors_are_written(tmp_path):
    nodes = np.eye(3)
    vtp.write_lines(tmp_path / "a.vtp", nodes, [[0, 1], [1, 2]], [], {"spin": nodes}, {"N": [1.0, 2.0]})
    mesh = pv.read(tmp_path / "a.vtp")
    np.testing.assert_allclose(mesh.point_data["spin"], nodes)
    np.testing.assert_allclose(mesh.cell_data["N"], [1.0, 2.0])


def test_values_of_the_wrong_length_are_refused_before_anything_is_written(tmp_path):
    with pytest.raises(InputError, match=r"cell_data\['N'\] has the wrong shape.*Give 3 or 2 rows"):
        vtp.write_lines(tmp_path / "a.vtp", np.eye(3), [[0, 1], [1, 2]], [[0, 2]], {}, {"N": [1.0]})
    with pytest.raises(InputError, match=r"point_data\['d'\]"):
        vtp.write_lines(tmp_path / "a.vtp", np.eye(3), [[0, 1]], [], {"d": [1.0]}, {})
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("positions", np.empty((0, 3)), "no nodes"),
        ("positions", np.full((3, 3), np.nan), "not finite"),
        ("beams", [[0, 10**6]], "out of range"),
        ("beams", [0, 1], "wrong shape"),
        ("deviation", np.zeros(3), "deviation has the wrong shape"),
        ("deviation", None, "can't be negative"),
        ("cable_forces", np.zeros(3), "cable_forces has the wrong shape"),
        ("supports", [[0, 1]], "wrong shape"),
        ("load_points", [-1], "out of range"),
        ("rod_radius", 0.0, "above zero"),
    ],
)
def test_panels_of_wrong_arrays_are_refused(name, value, message):
    if value is None:
        value = np.full(len(panel().positions), -1.0)
    with pytest.raises(InputError, match=message):
        replace(panel(), **{name: value})


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"view": "inside"}, "Known: best, top, front, side"),
        ({"limit": 0.0}, "must be positive"),
        ({"limit": np.nan}, "must be positive"),
        ({"size": (20, 20)}, "too small"),
        ({"size": (64000, 400)}, "too large"),
        ({"thickness": -1.0}, "thickness: must be 0 or more"),
        ({"force": np.inf}, "force: must be 0 or more"),
        ({"frame": [1.0, 2.0]}, "frame has the wrong shape"),
    ],
)
def test_arguments_that_cannot_be_drawn_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        render.image(panel(), Look(**{"size": SIZE, **given}))


def test_a_surface_of_wrong_corners_is_refused():
    with pytest.raises(InputError, match="surface triangles"):
        Skin(np.eye(3), [[0, 1, 7]])


def test_empty_sheets_other_endings_and_missing_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match="no panels"):
        render.sheet(tmp_path / "a.png", [[]])
    with pytest.raises(InputError, match=r"Use \.png, \.svg, \.pdf"):
        render.picture(tmp_path / "a.jpg", panel())
    with pytest.raises(InputError, match=r"Use \.vtp"):
        vtp.write_vtp(tmp_path / "a.vtk", panel())
    with pytest.raises(InputError, match="folder doesn't exist"):
        render.picture(tmp_path / "none/a.png", panel())
    assert not list(tmp_path.iterdir())


def test_a_file_that_cannot_be_written_is_refused_and_leaves_nothing(tmp_path):
    (tmp_path / "a.vtp").mkdir()
    with pytest.raises(InputError, match="can't be written"):
        vtp.write_vtp(tmp_path / "a.vtp", panel())
    assert [path.name for path in tmp_path.iterdir()] == ["a.vtp"]


def test_nothing_is_drawn_without_a_context_and_the_packages_are_named(monkeypatch):
    monkeypatch.setattr(scene, "_window_works", lambda: False)
    with pytest.raises(InputError, match="apt-get install libegl1"):
        render.image(panel(), SMALL)


def test_where_vtk_s_library_is_missing_states_and_lines_are_still_written(tmp_path):
    code = (
        "import sys; sys.modules['vtkmodules.vtkRenderingOpenGL2'] = None  # as an import that fails\n"
        "import numpy as np\n"
        "from shellform.errors import InputError\n"
        "from shellform.output.exchange import vtp\n"
        "from shellform.output.pictures import render\n"
        "from shellform.output.pictures.panel import Panel\n"
        "panel = Panel('a', np.eye(3), [[0, 1], [1, 2]], np.zeros(3), [[0, 2]], [1.0], [0], [], 0.01)\n"
        "vtp.write_vtp('a.vtp', panel); render.picture('a.svg', panel)\n"
        "try:\n    render.picture('a.png', panel)\n"
        "except InputError as error:\n    print(error)\n"
    )
    root = str(Path(__file__).parent.parent.parent)
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": root},
        capture_output=True,
        text=True,
        check=True,
    )
    assert "PyVista can't be loaded" in done.stdout
    assert "apt-get install libegl1" in done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.svg", "a.vtp"]


@pytest.mark.skipif(sys.platform != "linux", reason="VTK chooses its window at run time on Linux")
def test_a_window_without_a_context_is_found_out_before_vtk_crashes():
    # OSMesa is asked for where it isn't installed, which leaves VTK with what it has on a machine without GL
    # libraries
    code = (
        "import ctypes.util, sys; from shellform.output.pictures import scene\n"
        "sys.exit(0 if scene._window_works() is bool(ctypes.util.find_library('OSMesa')) else 1)"
    )
    asked = {**os.environ, "VTK_DEFAULT_OPENGL_WINDOW": "vtkOSOpenGLRenderWindow"}
    done = subprocess.run(
        [sys.executable, "-c", code], env=asked, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


def test_drawing_without_a_display_says_nothing_on_standard_error():
    code = "from shellform.output.pictures import scene; assert scene._window_works()"
    shell = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    done = subprocess.run([sys.executable, "-c", code], env=shell, capture_output=True, text=True, check=True)
    assert done.stderr == ""


def test_cables_have_a_scale_of_their_own_with_a_key_only_where_one_is_taut():
    none = replace(panel(), cable_forces=np.zeros(64))
    taut, slack = (
        render.image(each, SMALL)[-legend.key_height(SMALL) :].astype(int) for each in (panel(), none)
    )
    brick = legend.cable_colours(np.array([0.999]))[0]
    assert (np.abs(taut - brick).max(axis=2) < 4).sum() > 5
    assert (np.abs(slack - brick).max(axis=2) < 4).sum() == 0


def test_large_forces_are_told_in_kilonewtons_and_rounding_as_nothing():
    strong = replace(
        panel(), cable_forces=1000.0 * panel().cable_forces, deviation=np.full(len(panel().positions), 1e-16)
    )
    scale = scale_of([strong], SMALL, SIZE)
    told = legend.title(strong, scale, SIZE)[1].text
    assert told == "deviation: maximum 0 mm, mean 0 mm; 64 cables, 12 kN at most"
    assert "12 kN" in [word.text for word in legend.key(scale, SIZE[0], legend.key_height(SMALL))[0]]
    assert legend.title(panel(), scale_of([panel()], SMALL, SIZE), SIZE)[1].text.endswith(
        "64 cables, 12 N at most"
    )


@pytest.mark.parametrize(
    ("taut", "words"),
    [
        (64, "; 64 cables, 12 N at most"),
        (9, "; 9 of 64 cables taut, 12 N at most"),
        (0, "; 0 of 64 cables taut"),
    ],
)
def test_cables_that_hang_slack_are_counted_too(taut, words):
    forces = np.where(np.arange(64) < taut, 12.0, 0.0)
    some = replace(panel(), cable_forces=forces)
    told = legend.title(some, scale_of([some], SMALL, SIZE), SIZE)[1].text
    assert told.endswith(f" mm{words}")
    assert "cable" not in legend.title(bare(), scale_of([bare()], SMALL, SIZE), SIZE)[1].text


@pytest.mark.parametrize("force", [10.8, 16.4, 0.37, 3.0, 99.6, 1234.0])
def test_a_number_of_the_key_lies_within_a_hundredth_of_the_scale_from_its_tick(force):
    strong = replace(panel(), cable_forces=force / panel().cable_forces.max() * panel().cable_forces)
    words = [
        word
        for word in legend.key(scale_of([strong], SMALL, SIZE), SIZE[0], legend.key_height(SMALL))[0]
        if word.at[0] > 0.6 * SIZE[0]
    ]
    ticks = [
        float(word.text.split()[0])
        for word in sorted(words, key=lambda word: word.at[0])
        if word.text[0].isdigit()
    ]
    largest = force / 1000.0 if force >= 1e3 else force
    assert ticks == pytest.approx(np.linspace(0.0, largest, len(ticks)), abs=0.0101 * largest)


def test_a_value_beyond_the_scale_is_told_at_its_end_and_long_titles_shrink():
    within, beyond = (
        legend.key(
            scale_of([bare(deviation=np.full(len(panel().positions), far))], SMALL, SIZE),
            400,
            legend.key_height(SMALL),
        )[0]
        for far in (0.01, 0.02)
    )
    assert "≥ 10.0 mm" in [word.text for word in beyond]
    assert "10.0 mm" in [word.text for word in within]
    short, long = (
        legend.title(replace(panel(), title="A" * count), scale_of([panel()], SMALL, SIZE), SIZE)[0]
        for count in (10, 90)
    )
    assert long.pixels < short.pixels


def test_both_scales_run_in_lightness_alone_evenly_enough_for_the_colour_blind():
    def lightness(colours):
        linear = np.where(
            colours / 255.0 <= 0.04045, colours / 255.0 / 12.92, ((colours / 255.0 + 0.055) / 1.055) ** 2.4
        )
        return 116.0 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16.0

    share = np.linspace(0.0, 1.0, 21)
    for colours, sign in [(legend.rod_colours(share), 1.0), (legend.cable_colours(share), -1.0)]:
        steps = sign * np.diff(lightness(colours))
        assert (steps > 0.0).all()
        assert steps.max() < 2.0 * steps.mean()


def test_rods_are_drawn_as_thick_as_can_be_seen_or_as_they_are():
    seen, true, twenty = (
        ink(above(render.image(bare(), Look(size=SIZE, thickness=times)))) for times in (0.0, 1.0, 20.0)
    )
    assert true < seen < twenty


def test_without_a_background_the_picture_laid_on_white_is_the_picture():
    through = render.image(panel(), Look(size=SIZE, transparent=True, surface=Skin(np.eye(3), [[0, 1, 2]])))
    solid = render.image(panel(), Look(size=SIZE, surface=Skin(np.eye(3), [[0, 1, 2]])))
    assert through.shape == (300, 400, 4)
    share = through[..., 3:] / 255.0
    laid = share * through[..., :3] + (1.0 - share) * 255.0
    assert np.abs(laid - solid).max() <= 3
    assert (share == 0.0).mean() > 0.4
    assert ((share > 0.2) & (share < 0.5)).mean() > 0.02  # the surface


def test_the_best_view_has_the_long_axis_across_and_looks_at_what_opens_towards_it():
    turned = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    long = panel().positions * [2.0, 1.0, 1.0]
    along, across = (above(render.image(bare(positions=place), SMALL)) for place in (long, long @ turned.T))
    np.testing.assert_allclose(ink(along), ink(across), rtol=0.01)
    assert ink(along) > 500
    leaning = panel().positions + np.outer(panel().positions[:, 1], [0.0, 0.0, -0.8])
    away = _fitted(leaning).away
    assert away[1] > 0.0  # it falls towards +y, and is seen from there
    assert _fitted(panel().positions).away[1] < 0.0


@pytest.mark.parametrize(
    ("name", "away", "right"), [("top", 2, 0), ("front", 1, 0), ("side", 0, 1), ("best", None, None)]
)
def test_a_camera_s_axes_are_unit_vectors_and_those_of_plain_views_the_shell_s(name, away, right):
    seen = _fitted(panel().positions, replace(SMALL, view=name))
    axes = np.column_stack([seen.right, seen.up, seen.away])
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) > 0.0
    if away is not None:
        assert (np.abs(seen.away).argmax(), np.abs(seen.right).argmax()) == (away, right)


def _fitted(positions, look=SMALL):
    given = bare(positions=positions)
    return view.fitted([given], look, scale_of([given], look, SIZE), SIZE)


def test_an_arrow_of_lines_is_as_wide_as_it_is_long_never_thinner_than_a_hair_and_seen_from_above_a_dot(
    monkeypatch,
):
    drawn = []
    monkeypatch.setattr(
        vectors.plots, "strokes", lambda axes, ends, widths, colours: drawn.append((ends, widths))
    )
    monkeypatch.setattr(vectors.plots, "areas", lambda axes, corners, colour: drawn.append(corners))
    tails = np.array([[0.0, 100.0], [50.0, 10.0], [80.0, 0.5]])
    heads = np.array([[0.0, 0.0], [50.0, 0.0], [80.0, 0.0]])
    vectors._arrows(None, tails, heads, 1.0)
    (shafts, widths), tips, (dots, size) = drawn
    np.testing.assert_allclose(widths, [6.0, 0.8])
    np.testing.assert_allclose(shafts[0], [[0.0, 100.0], [0.0, 36.0]])
    np.testing.assert_allclose(tips[0], [[0.0, 1.0], [11.0, 36.0], [-11.0, 36.0]])
    np.testing.assert_allclose((dots[0], [[size[0]] * 2] * 2), ([[80.0, 0.0]] * 2, [[2.4] * 2] * 2))


@pytest.mark.parametrize(("ending", "head"), [(".svg", b"<?xml"), (".pdf", b"%PDF")])
def test_a_page_of_lines_is_small_repeats_to_the_byte_and_needs_no_opengl(
    tmp_path, ending, head, monkeypatch
):
    monkeypatch.setattr(scene, "_window_works", lambda: False)
    for name in "ab":
        render.picture(tmp_path / f"{name}{ending}", panel(), SMALL)
    content = (tmp_path / f"a{ending}").read_bytes()
    assert content.startswith(head)
    assert content == (tmp_path / f"b{ending}").read_bytes()
    assert len(content) < 200_000


def test_lines_are_drawn_where_the_pixels_are():
    given = bare(supports=panel().supports)
    lines, pixels = (
        above(each)
        for each in (vectors.rasterised(sheets.single([given], SMALL)[0]), render.image(given, SMALL))
    )
    assert np.mean((lines.min(axis=2) < 200) == (pixels.min(axis=2) < 200)) > 0.95
    flat = replace(given, positions=given.positions * [1.0, 1.0, 0.0], load_points=panel().load_points)
    top = vectors.rasterised(
        sheets.single([flat], Look(size=SIZE, view="top", surface=Skin(np.eye(3), [[0, 1, 2]])))[0]
    )
    assert ink(above(top)) > 500


def test_pictures_drawn_one_after_the_other_are_those_drawn_alone(tmp_path):
    far = replace(panel(), deviation=np.full(len(panel().positions), 0.02))
    render.pictures([tmp_path / "a.png", tmp_path / "b.png"], [panel(), far], SMALL)
    for name, given in [("a", panel()), ("b", far)]:
        assert (
            np.abs(
                np.asarray(Image.open(tmp_path / f"{name}.png")).astype(int) - render.image(given, SMALL)
            ).max()
            <= 1
        )
    render.pictures([tmp_path / "a.svg"], [panel()], SMALL)
    assert "<path" in (tmp_path / "a.svg").read_text(encoding="utf-8")


def test_a_film_has_a_frame_for_each_panel_and_one_camera(tmp_path):
    lower = [replace(panel(), positions=panel().positions * [1.0, 1.0, share]) for share in (0.0, 0.5, 1.0)]
    files = [tmp_path / "film.gif", tmp_path / "film.mp4"]
    render.film(files, lower, Look(size=(240, 180), view="front"), rate=10)
    frames = [np.asarray(frame.convert("RGB")) for frame in ImageSequence.Iterator(Image.open(files[0]))]
    assert frames[0].shape == (180, 240, 3)
    assert len(frames) == 3  # Pillow holds the last one instead of repeating it
    tops = [np.flatnonzero((frame[45:140].min(axis=2) < 200).any(axis=1))[0] for frame in frames]
    assert tops[0] > tops[1] > tops[2]
    bars = [frame[140:].astype(int) for frame in frames]
    assert np.abs(bars[0] - bars[2]).max() <= 2
    film = imageio_ffmpeg.read_frames(str(files[1]))
    about = next(film)
    assert about["size"] == (240, 180)
    assert sum(1 for _ in film) == 3 + 15


def test_films_of_nothing_or_with_other_endings_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"Use \.gif, \.mp4"):
        render.film([tmp_path / "a.avi"], [panel()], SMALL)
    with pytest.raises(InputError, match="has no panels"):
        render.film([tmp_path / "a.gif"], [], SMALL)
    with pytest.raises(InputError, match="has no frames"):
        images.write_film(tmp_path / "a.gif", [])
    (tmp_path / "b.mp4").mkdir()
    with pytest.raises(InputError, match="can't be written"):
        images.write_film(tmp_path / "b.mp4", [np.zeros((60, 80, 3), dtype=np.uint8)])
    assert [path.name for path in tmp_path.iterdir()] == ["b.mp4"]


def test_letters_on_paper_have_the_height_asked_for_and_stay_letters(tmp_path):
    look = Look(size=(1200, 750), dots=300.0, letters=8.0)
    render.picture(tmp_path / "a.svg", panel(), look)
    text = (tmp_path / "a.svg").read_text(encoding="utf-8")
    width, height = re.search(r'width="([\d.]+)pt" height="([\d.]+)pt"', text).groups()
    assert (float(width), float(height)) == pytest.approx((1200 / 300 * 72, 750 / 300 * 72))
    assert "deviation from the target</text>" in text
    heights = [float(each) for each in re.findall(r"font-size: ([\d.]+)px", text)]
    # whole pixels round them, and the keys' letters are 0.9 as high
    assert max(heights) == pytest.approx(8.0, abs=0.3)
    assert min(heights) > 0.85 * 8.0
    render.picture(tmp_path / "a.pdf", panel(), look)
    assert (
        b"/TrueType" in (tmp_path / "a.pdf").read_bytes()
        or b"CIDFontType2" in (tmp_path / "a.pdf").read_bytes()
    )
    render.picture(tmp_path / "a.png", panel(), look)

    assert Image.open(tmp_path / "a.png").info["dpi"] == pytest.approx((300.0, 300.0), abs=0.02)
