"""`shellform render`: which files it writes for which wish, and what it refuses."""

import re
import shutil
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from PIL import Image

from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.output.pictures import render
from shellform.output.pictures.panel import scale_end
from shellform.problem.paths import deviations
from shellform.run import films
from shellform.run.figures import FAILURE, Wish, draw_designs, draw_failure, draw_run, look_of, panel_of, wish
from shellform.run.films import draw_film
from shellform.run.folder import read_run
from shellform.run.scales import colour_limit
from tests.command import shellform

ROOT = Path(__file__).parent.parent.parent
NOTHING = {
    "design": None, "load": None, "quantity": None, "limit": None, "view": "best", "size": None,
    "thickness": 0.0, "transparent": False,
    "kind": None, "film": None,
}  # fmt: skip


@pytest.fixture(scope="module")
def run(begun, tmp_path_factory):
    return read_run(shutil.copytree(begun, tmp_path_factory.mktemp("pictures") / "run"))


def names(files: list[Path]) -> list[str]:
    return [file.name for file in files]


def test_pictures_in_a_folder_of_their_own_leave_those_of_the_page_as_they_are(run, tmp_path):
    small = Wish("initial", "design", size=(320, 200))
    (shown,) = draw_designs(run, small)
    before = shown.read_bytes()
    asked = replace(small, size=(240, 160), folder=tmp_path / "print")
    (printed,) = draw_designs(run, asked)
    assert printed == tmp_path / "print" / shown.name
    assert printed.read_bytes() != before
    assert shown.read_bytes() == before
    assert shown.parent == run.folder / "figures"


def test_all_designs_under_all_loads_are_drawn_with_a_sheet_of_them(run):
    files = draw_run(run.folder, Wish(size=(320, 200)))
    designs = [
        f"{design}-{load}.png"
        for design in ("unbraced", "initial")
        for load in ("none", "design", "additional")
    ]
    assert names(files) == [*designs, "deviations.png"]
    sheet = Image.open(files[-1])
    assert sheet.size[0] == 3 * 160
    assert Image.open(files[0]).size == (320, 200)


@pytest.mark.parametrize("quantity", ["utilisation", "curvature", "shear", "mode", "spring"])
def test_a_quantity_and_a_view_stand_in_the_file_s_name(run, quantity):
    files = draw_designs(run, Wish("initial", "design", quantity, view="top", size=(320, 200)))
    assert names(files) == [
        "net-springs.png" if quantity == "spring" else f"{quantity}-initial-design-top.png"
    ]
    assert np.ptp(np.asarray(Image.open(files[0]))) > 100


def test_histories_are_drawn_from_the_run_s_file_as_wide_as_asked_and_missed_where_nothing_was_optimised(
    run, tmp_path
):
    with pytest.raises(InputError, match=r"history.csv: isn't there: nothing was optimised yet"):
        draw_designs(run, Wish(quantity="history"))
    text = (
        "evaluation,accepted,objective,term.misfit,constraint.cable_force,cables,stage,seconds\n"
        "0,1,1.0,1.0,-0.7,293,1.0,0.1\n1,1,0.6,0.6,0.0,130,1.0,0.2\n"
    )
    (run.folder / "history.csv").write_text(text, encoding="utf-8")
    assert names(draw_designs(run, Wish(quantity="history", endings=(".pdf",)))) == [
        "objective.pdf",
        "constraints.pdf",
    ]
    paper = ["--quantity", "history", "--format", "svg", "--width-mm", "85", "--font-size", "7"]
    assert shellform("render", run.folder, *paper, "--output", tmp_path).returncode == 0
    for name in ("objective.svg", "constraints.svg"):
        text = (tmp_path / name).read_text(encoding="utf-8")
        assert 25.4 / 72.0 * float(re.search(r'width="([\d.]+)pt"', text)[1]) == pytest.approx(85.0, abs=0.1)
        assert {*re.findall(r"font(?:-size)?:[^;]*?([\d.]+)px", text)} == {"7"}
    (run.folder / "history.csv").unlink()


def test_a_sheet_in_print_is_as_wide_as_asked_for_and_all_its_letters_are_as_high_as_in_one_picture(
    run, tmp_path
):
    asked = wish(**{**NOTHING, "kind": "svg"}, width_mm=180.0, font_size=8.0, folder=tmp_path)
    *_, one, sheet = (file.read_text(encoding="utf-8") for file in draw_designs(run, asked))
    heights = {}
    for text in (one, sheet):
        wide = float(re.search(r'width="([\d.]+)pt"', text)[1])
        assert 25.4 / 72.0 * wide == pytest.approx(180.0, abs=0.5)
        heights[text] = {float(each) for each in re.findall(r"font(?:-size)?:[^;]*?([\d.]+)px", text)}
    assert min(heights[one]) == pytest.approx(0.9 * 8.0, abs=0.2)
    assert min(heights[sheet]) == min(heights[one])
    words = " ".join(re.findall(r">([^<>]+)</text>", sheet))
    largest = 1e3 * deviations(run.shell_of("initial"), run.states["initial"]["design"]).max()
    assert f"initial design, design load deviation: maximum {largest:.1f} mm" in words, "broken, not lost"


def test_a_net_s_springs_are_drawn_as_wide_and_up_to_what_is_asked(run, tmp_path):
    asked = wish(
        **{**NOTHING, "quantity": "spring", "kind": "svg", "limit": 5.0}, width_mm=85.0, folder=tmp_path
    )
    (file,) = draw_designs(run, asked)
    text = file.read_text(encoding="utf-8")
    assert 25.4 / 72.0 * float(re.search(r'width="([\d.]+)pt"', text)[1]) == pytest.approx(85.0, abs=0.1)
    assert ">5.00 EI/s²<" in text


def test_scales_end_at_one_two_or_five_times_a_power_of_ten():
    assert [scale_end(x) for x in (0.00131, 0.002, 0.0021, 0.5, 0.7, 29.0)] == [
        0.002,
        0.002,
        0.005,
        0.5,
        1.0,
        50.0,
    ]


def test_the_design_to_build_fills_the_colours_unless_the_case_says_where_they_end(run):
    largest = deviations(run.shell_of(run.best), run.states[run.best]["design"]).max()
    assert run.case.figures.limit is None
    assert largest <= colour_limit(run) <= 2.5 * largest
    figures = run.case.figures.model_copy(update={"limit": 0.01})
    assert colour_limit(replace(run, case=run.case.model_copy(update={"figures": figures}))) == 0.01


def test_one_scale_of_colours_and_one_of_forces_hold_for_all_panels(run):
    panels = [panel_of(run, "initial", load) for load in run.loads]
    look = look_of(run, Wish(), panels)
    assert look.limit == colour_limit(run)
    assert look.force == max(panel.cable_forces.max() for panel in panels)
    assert look_of(run, Wish(limit=0.02), panels).limit == 0.02
    bent = [panel_of(run, "initial", "design", "curvature")]
    assert look_of(run, Wish(quantity="curvature"), bent).limit == pytest.approx(
        run.shell.rod.strength / (run.shell.rod.young * 0.001)
    )


def test_titles_name_design_and_load(run):
    assert panel_of(run, "initial", "additional").title == "initial design, additional load"


def test_the_picture_of_a_failure_tells_the_numbers_of_the_state_that_fails_not_of_the_mode_drawn_out(
    run, tmp_path, monkeypatch
):
    state, shown = run.states["initial"]["design"], []
    mode = np.zeros((len(state.positions), 6))
    mode[:, 2] = -1.0
    (tmp_path / "states").mkdir()
    np.savez(tmp_path / FAILURE, positions=state.positions, quaternions=state.quaternions, mode=mode)
    failure = SimpleNamespace(design="initial", load="design", number=7, factor=0.91)
    monkeypatch.setattr(render, "pictures", lambda files, panels, look: shown.extend(panels))
    failing = replace(run, folder=tmp_path, summary=replace(run.summary, failure=failure))
    assert names(draw_failure(failing)) == ["failure.png"]
    (seen,) = shown
    usual = panel_of(run, "initial", "design")
    assert seen.deviation == pytest.approx(usual.deviation)
    assert seen.cable_forces == pytest.approx(usual.cable_forces)
    assert (seen.positions[:, 2] < usual.positions[:, 2] - 1e-3).all()
    assert seen.title.endswith(
        "initial design, structure 7 as it fails at 0.91 of design load, the mode drawn out"
    )


def test_the_pour_and_the_erection_are_filmed_from_the_first_state_to_the_last(run):
    asked = Wish("initial", size=(240, 160), endings=(".gif",))
    (pour,) = draw_film(run, "pour", asked)
    assert pour.name == "pour-initial-design.gif"
    assert Image.open(pour).n_frames == 25
    (rise,) = draw_film(
        run, "erection", Wish("initial", quantity="utilisation", size=(240, 160), endings=(".gif",))
    )
    assert rise.name == "erection-initial.gif"
    assert Image.open(rise).n_frames > 25


def test_a_film_of_an_erection_by_a_scaffold_shows_few_of_the_steps_in_which_little_moves(run, monkeypatch):
    def step(stage, share):
        return SimpleNamespace(stage=stage, share=share)

    steps = [step("raising", k / 24) for k in range(25)]
    steps += [step("pinning", k / 24) for k in range(25)] + [step("tightening", k / 24) for k in range(1, 25)]
    shown = films._shown(steps)
    assert shown[:25] == steps[:25]
    assert shown[30:] == steps[50:]
    assert [each.share for each in shown[25:30]] == [0.0, 0.25, 0.5, 0.75, 1.0]
    asked = []

    def erect(shell, design, *, by, tighten_first, load, step):
        asked.append((by, tighten_first))
        raise NotConverged("enough")

    monkeypatch.setattr(films, "erect", erect)
    with pytest.raises(NotConverged, match="enough"):
        draw_film(run, "erection", Wish("initial", by="scaffold", endings=(".gif",)))
    with pytest.raises(NotConverged, match="enough"):
        draw_film(run, "erection", Wish("initial", by="scaffold", tighten_first=True, endings=(".gif",)))
    assert asked == [("scaffold", False), ("scaffold", True)]


def test_in_a_film_cables_tightened_on_the_scaffold_stay_when_it_goes(run, monkeypatch):
    """Their rest lengths come down while they are tightened, and neither before nor after."""
    state, design = run.states["initial"]["none"], run.designs["initial"]
    stages = [
        ("raising", 1.0),
        ("tightening", 0.5),
        ("tightening", 1.0),
        ("lowering", 0.5),
        ("lowering", 1.0),
    ]
    steps = [SimpleNamespace(stage=stage, share=share, state=state) for stage, share in stages]
    shown = []
    monkeypatch.setattr(films, "erect", lambda *_, **__: SimpleNamespace(steps=steps))
    monkeypatch.setattr(films, "_shown", list)
    monkeypatch.setattr(
        "shellform.output.pictures.maps.panel_of", lambda _, each, *__, **___: shown.append(each)
    )
    films._erection(run, "initial", Wish("initial", by="scaffold", tighten_first=True), lambda event: None)
    assert [each.present.any() for each in shown] == [False, True, True, True, True]
    over = [float((each.rest_length - design.rest_length).sum()) for each in shown[1:]]
    assert over[0] > 0.0
    assert over[1:] == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)


def test_a_shell_poured_in_stages_is_filmed_through_all_of_them(run, monkeypatch):
    text = (
        (ROOT / "scripts/full_size_poured.toml")
        .read_text(encoding="utf-8")
        .replace("../surfaces", str(ROOT / "surfaces"))
    )
    file = run.folder / "staged.toml"
    file.write_text(
        text + '\n[[load]]\nname = "pour"\nfactors = { rods = 1.0 }\nstages = ["west", "east"]\n',
        encoding="utf-8",
    )
    staged = replace(run, case=load_case(file))
    assert films._stages(staged, None) == ["pour 1", "pour 2"]
    assert films._stages(staged, "pour 1") == ["pour 1"]
    assert films._stages(staged, "additional") == ["additional"]
    assert films._stages(run, None) == ["design"]
    monkeypatch.setattr(films, "_stages", lambda *_: ["design", "additional"])
    (film,) = draw_film(run, "pour", Wish("initial", size=(240, 160), endings=(".gif",)))
    assert film.name == "pour-initial-additional.gif"
    assert Image.open(film).n_frames == 2 * 24 + 1


def test_the_options_of_the_command_become_a_wish():
    assert wish(**NOTHING) == Wish()
    asked = wish(**{**NOTHING, "size": "640x400", "kind": "pdf", "quantity": "mode", "transparent": True})
    assert asked == Wish(quantity="mode", size=(640, 400), transparent=True, endings=(".pdf",))
    assert wish(**{**NOTHING, "film": "pour"}).endings == (".gif", ".mp4")
    assert wish(**{**NOTHING, "film": "erection", "kind": "mp4"}) == Wish(
        quantity="utilisation", endings=(".mp4",)
    )


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"film": "lunch"}, "Known: pour, erection"),
        (
            {"film": "pour", "quantity": "mode"},
            "can't be filmed.*Films show deviation, utilisation, curvature, shear",
        ),
        ({"film": "pour", "transparent": True}, "can't be filmed.*Leave --transparent out"),
        ({"film": "pour", "by": "scaffold"}, r"--by: says how a grid is erected.*--film erection"),
        ({"film": "pour", "kind": "png"}, "Known: gif, mp4"),
        ({"kind": "gif"}, "Known: png, svg, pdf"),
        ({"quantity": "colour"}, "Known: deviation, utilisation, curvature, shear, mode, spring, history"),
        ({"size": "640"}, "WIDTHxHEIGHT"),
        ({"limit": 0.0}, "--limit: must be positive"),
        ({"thickness": -1.0}, "^--rods: must be 0 or more"),
        ({"view": "left"}, "^--view: is no view.*Known: best, top, front, side"),
        ({"size": "0x0"}, "^--size: is too small"),
        ({"size": "9000x200"}, "^--size: is too large"),
        (
            {"width_mm": 1000.0},
            "^--width-mm: 1000 mm at 300 dots an inch make 11811 × 7382.*a smaller one, or fewer",
        ),
        (
            {"width_mm": 180.0, "dpi": 20.0},
            "^--width-mm: .* make 142 × 89 pixels.*a larger one, or more dots",
        ),
        ({"width_mm": 180.0, "size": "0x0"}, "^--size: is too small"),
    ],
)
def test_options_that_make_no_sense_are_refused(given, message):
    with pytest.raises(InputError, match=message):
        wish(**{**NOTHING, **given})


def test_unknown_designs_and_loads_are_refused(run):
    with pytest.raises(InputError, match=r"--design: isn't there.*Known: unbraced, initial"):
        draw_designs(run, Wish(design="polished"))
    with pytest.raises(InputError, match="--load: isn't there"):
        draw_designs(run, Wish(load="snow"))
    with pytest.raises(InputError, match="--load: isn't there"):
        draw_film(run, "pour", Wish(load="snow", endings=(".gif",)))
