"""Deviation maps and convergence plots."""

import re
from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.output.exchange import vtp
from shellform.output.pictures import plots, render, sheets
from shellform.output.pictures.legend import key, key_height
from shellform.output.pictures.panel import Look, Panel, scale_of


@pytest.fixture(scope="module")
def panel():
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9)))
    number = np.arange(81).reshape(9, 9)
    beams = np.vstack(
        [
            np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()]),
            np.column_stack([number[:-1].ravel(), number[1:].ravel()]),
        ]
    )
    place = np.column_stack([x, y, 0.5 - 0.2 * (x**2 + y**2)])
    cables = np.column_stack([number[:-1, :-1].ravel(), number[1:, 1:].ravel()])
    forces = np.where(np.arange(64) % 2, 1.0, 0.0)
    return Panel("a cap", place, beams, np.zeros(81), cables, forces, np.arange(9), np.array([40]), 0.01)


def test_the_same_panel_gives_the_same_picture_and_another_deviation_another(panel):
    first = render.image(panel, Look(size=(300, 200)))
    second = render.image(panel, Look(size=(300, 200)))
    assert first.shape == (200, 300, 3)
    assert np.abs(first.astype(int) - second).max() <= 2
    far = render.image(replace(panel, deviation=np.full(81, 0.01)), Look(size=(300, 200)))
    assert (np.abs(first.astype(int) - far).max(axis=2) > 40).sum() > 500


@pytest.mark.parametrize("size", [(480, 300), (1600, 900), (600, 1400)])
@pytest.mark.parametrize("letters", [0.0, 60.0])
def test_the_words_of_a_key_stand_clear_of_its_bars_and_within_its_height(panel, size, letters):
    look = Look(size=size, letters=letters, dots=72)
    height = key_height(look)
    words, bars = key(scale_of([panel], look, size), size[0], height)
    assert len(bars) == 2
    for word in words:
        foot, top = word.at[1], word.at[1] + word.pixels
        assert foot >= 0.0
        assert top <= height
        for bar in bars:
            assert top <= bar.low or foot >= bar.high, (word, bar)
    assert {word.text for word in words if word.at[1] > bars[0].high} == {
        "deviation from the target",
        "cable force (pale: slack)",
    }


@pytest.mark.parametrize("letters", [5.0, 9.0, 14.0])
def test_letters_that_are_given_keep_their_height_however_long_the_words_and_titles_hide_no_picture(
    panel, letters
):
    look = Look(size=(360, 260), letters=letters, dots=72)
    long = replace(panel, title="a cap of a title that is longer than what stands below it is wide")
    page = sheets.table([[panel, long]], look, heading="what is above it, and is broken as well " * 2)
    first, second, above, key_of = page.drawings
    for drawing in (above, first, second):
        for word in drawing.words:
            assert word.pixels in (round(0.9 * letters), round(letters), round(1.25 * letters))
            assert 0.0 <= word.at[1] <= drawing.size[1] - word.pixels
            assert word.at[0] + 0.6 * word.pixels * len(word.text) <= drawing.size[0]
    assert " ".join(word.text for word in second.words).startswith(long.title)
    assert {word.pixels for word in key_of.words} == {round(0.9 * letters)}
    points = page.camera.seen(panel.positions)[:, 1] / page.camera.height + 0.5
    assert points.max() * first.size[1] < min(word.at[1] for word in second.words)


def test_letters_that_leave_no_room_for_the_picture_are_refused_and_smaller_ones_taken(panel):
    look = Look(size=(160, 120), letters=14.0, dots=72)
    with pytest.raises(InputError, match="too small for its letters") as refused:
        sheets.single([panel], look)
    assert "--font-size" in refused.value.remedy
    sheets.single([panel], replace(look, letters=5.0))


def test_a_cable_that_pulls_beyond_the_scale_is_drawn_as_one_at_its_end(tmp_path, panel):
    look, drawn = Look(size=(300, 200), force=2.0), []
    for k, most in enumerate((2.0, 5.0)):
        forces = np.where(panel.cable_forces > 0.0, most, 0.0)
        render.picture(tmp_path / f"{k}.svg", replace(panel, cable_forces=forces), look)
        text = (tmp_path / f"{k}.svg").read_text(encoding="utf-8")
        drawn.append(re.findall(r'style="[^"]*stroke-width: [^"]*"', text))
    assert len(drawn[0]) > 10
    assert drawn[0] == drawn[1]


def test_a_sheet_and_a_vtp_file_are_written(tmp_path, panel):
    render.sheet(tmp_path / "sheet.png", [[panel, panel]], Look(size=(200, 150)))
    vtp.write_vtp(tmp_path / "state.vtp", panel, {"N": np.ones(len(panel.beams))})
    assert (tmp_path / "sheet.png").read_bytes()[:4] == b"\x89PNG"
    assert b"deviation" in (tmp_path / "state.vtp").read_bytes()


def test_wrong_shapes_views_and_scales_are_refused(panel):
    with pytest.raises(InputError, match="deviation"):
        replace(panel, deviation=np.zeros(3))
    with pytest.raises(InputError, match="view"):
        render.image(panel, Look(view="inside"))
    with pytest.raises(InputError, match="positive"):
        render.image(panel, Look(limit=0.0))


def test_both_histories_are_drawn(tmp_path):
    plots.objective_history(tmp_path / "a.png", [0, 1], {"misfit": [0.7, 0.2], "cable_force": [0.3, 0.2]})
    plots.constraint_history(tmp_path / "b.svg", [0, 1], {"misfit.additional": [23.0, 0.0]})
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"
    assert "<svg" in (tmp_path / "b.svg").read_text(encoding="utf-8")
