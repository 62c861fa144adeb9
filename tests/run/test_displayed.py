"""A run read back, as a notebook shows it, asked of IPython's own formatter."""

import io
import json
import shutil
from html import unescape
from pathlib import Path

import numpy as np
import pytest
from IPython.core.interactiveshell import InteractiveShell
from PIL import Image

import shellform as sf
from shellform.run.folder import read_run
from tests.run.small_run import finish


@pytest.fixture(scope="module")
def shown(begun, tmp_path_factory):
    """A finished run, and what IPython would display of it by kind."""
    run = read_run(finish(Path(shutil.copytree(begun, tmp_path_factory.mktemp("displayed") / "run"))))
    ipython = InteractiveShell()
    ipython.display_formatter.active_types = ["text/plain", "image/png", "text/html"]
    sf.load_ipython_extension(ipython)
    data, _ = ipython.display_formatter.format(run)
    InteractiveShell.clear_instance()
    return run, data


def test_a_run_shows_its_design_to_build_under_each_load(shown):
    run, data = shown
    picture = np.asarray(Image.open(io.BytesIO(data["image/png"])))
    loads = len(run.states[run.best])
    assert loads >= 2
    assert picture.shape[1] == loads * 560
    assert (picture.min(axis=2) < 200).mean() > 0.02


def test_a_run_shows_the_view_of_its_page_with_all_of_its_designs(shown):
    run, data = shown
    page = unescape(data["text/html"])
    (viewed,) = json.loads(page.split('id="data">')[1].split("</script>")[0])["runs"]
    assert [each["name"] for each in viewed["designs"]] == list(run.designs)
    assert viewed["designs"][viewed["best"]]["name"] == run.best
    assert [len(each["states"]) for each in viewed["designs"]] == [
        len(run.states[name]) for name in run.designs
    ]
    assert "image/png;base64" not in page  # of the pictures none
    assert len(page) < 3_000_000
