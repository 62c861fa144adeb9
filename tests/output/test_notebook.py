"""What a notebook shows, asked of IPython's own formatter."""

import io
import json
import subprocess
import sys
from dataclasses import replace
from html import unescape

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from PIL import Image

import shellform as sf
from shellform.errors import InputError
from shellform.net.grid import rod_names
from shellform.optimiser.optimum import Optimum, Step
from shellform.output import frames, notebook


@pytest.fixture
def shown():
    """The PNG that IPython would display, as an array."""
    ipython = InteractiveShell()
    ipython.display_formatter.active_types = ["text/plain", "image/png"]  # as a notebook's kernel sets them
    sf.load_ipython_extension(ipython)

    def show(thing):
        data, _ = ipython.display_formatter.format(thing)
        assert "text/plain" in data
        content = data["image/png"]
        return np.asarray(Image.open(io.BytesIO(content)))

    yield show
    InteractiveShell.clear_instance()


def optimum(shell):
    """An optimum that took no search: the shell's first design."""
    wet = sf.LoadCase("wet", shell.point_load(6.9, every=2))
    problem = sf.Problem(shell, wet, [sf.Share(1.0, sf.Misfit("wet"))])
    design = shell.design(rest_ratio=0.99)
    loaded = sf.follow(shell, design, {"none": 0.0 * wet.force, "wet": wet.force})
    return Optimum(problem, design, loaded, 1.0, 1.0, {}, [], "no search", 0, 0, 0, 0, 0, 0.0)


def test_a_net_a_gridshell_and_an_optimum_show_a_picture(shown, net, shell):
    pictures = [shown(net), shown(shell), shown(optimum(shell))]
    assert [picture.shape[:2] for picture in pictures[:2]] == [(560, 900)] * 2
    assert pictures[2].shape[1] == 2 * 560  # without load and under the one there is
    for picture in pictures:
        assert (picture.min(axis=2) < 200).mean() > 0.02
    assert not np.array_equal(pictures[0], pictures[1])


def test_each_says_in_a_line_what_it_is(net, shell):
    design = shell.design(rest_ratio=0.99)
    for thing, words in [
        (net, f"Net({len(net.grid.rods)} rods, "),
        (net.grid, f"Grid({len(net.grid.rods)} rods, "),
        (shell, f"{len(shell.cable_ends)} candidate cables)"),
        (design, f"Design({len(shell.cable_ends)} of {len(shell.cable_ends)} cables, rods of 1 mm radius)"),
        (optimum(shell), "0 evaluations: no search)"),
        (optimum(shell).problem, "loads wet, 1 terms, 0 constraints)"),
    ]:
        assert words in repr(thing)
        assert len(repr(thing)) < 160


def test_the_view_of_a_notebook_is_the_page_s_own_in_a_frame_that_asks_for_nothing(net, shell):
    for text in (
        notebook.net_html(net),
        notebook.gridshell_html(shell),
        notebook.optimum_html(optimum(shell)),
    ):
        assert text.startswith("<iframe srcdoc=")
        page = unescape(text)
        assert "default-src 'none'" in page
        data = json.loads(page.split('id="data">')[1].split("</script>")[0])
        (run,) = data["runs"]
        assert [rod["name"] for rod in run["rods"]] == rod_names(net.grid)
    assert list(run["designs"][0]["states"]) == ["none", "wet"]
    assert len(text) < 2_000_000


def test_results_are_tables_for_pandas(shell):
    best = optimum(shell)
    cables = frames.cables(shell, best.design, best.states).records()
    ties = shell.cables(best.design)
    assert [row["cable"] for row in cables] == [f"C{k}" for k in range(len(ties.ends))]
    assert [row["wet: force [N]"] for row in cables] == pytest.approx(
        ties.tension(best.states["wet"]).tolist()
    )
    rods = frames.rods(shell, best.design, best.states).records()
    off = sf.deviations(shell, best.states["wet"])
    assert max(row["wet: off the target [m]"] for row in rods) == pytest.approx(off.max())
    nodes = frames.nodes(shell, best.states)
    assert nodes.column("wet: off the target [m]") == pytest.approx(off.tolist())
    step = Step(1, 1.0, {"misfit": 0.7}, {"cable_force": -0.5}, 12, 1.0, True, 0.5)
    told = frames.history(replace(best, history=[step])).records()
    assert told == [
        {
            "evaluation": 1, "accepted": 1, "objective": 1.0, "term misfit": 0.7, "constraint cable_force": -0.5,
            "cables": 12, "time [s]": 0.5,
        }
    ]  # fmt: skip


def test_without_opengl_the_picture_is_made_of_lines(shown, net, monkeypatch):
    from shellform.output.pictures import scene

    def missing():
        raise InputError("VTK lacks a library")

    smooth = shown(net)
    monkeypatch.setattr(scene, "require", missing)
    lines = shown(replace(net))
    assert lines.shape == smooth.shape
    assert not np.array_equal(lines, smooth)
    assert np.mean((lines.min(axis=2) < 200) == (smooth.min(axis=2) < 200)) > 0.9


def test_importing_shellform_in_a_running_ipython_registers_its_pictures_without_loading_them():
    code = (
        "from IPython.core.interactiveshell import InteractiveShell\n"
        "ipython = InteractiveShell.instance()\n"
        "import sys, shellform\n"
        "png = ipython.display_formatter.formatters['image/png']\n"
        "assert ('shellform.net.net', 'Net') in png.deferred_printers\n"
        "assert not {'numpy', 'pyvista', 'shellform.output.notebook'} & set(sys.modules), 'loaded'\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
