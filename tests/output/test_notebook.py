"""What a notebook shows, asked of IPython's own formatter."""

import io
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from PIL import Image

import shellform as sf
from shellform.errors import InputError
from shellform.optimiser.optimum import Optimum


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
