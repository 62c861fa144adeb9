"""The page in headless Chromium: it draws, is picked in, searched, sorted, printed, used by keys and read on
a phone, and asks for nothing.

Skipped only where there is no Chromium, neither playwright's own (playwright install chromium) nor the
system's; scripts/test installs one.
"""

import base64
import io
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from shellform.output.page.study_page import study_page
from shellform.problem.paths import deviations
from shellform.run.folder import read_run
from shellform.run.pages import write_report
from tests.output.test_study_page import content
from tests.run.small_run import begin, finish

ROOT = Path(__file__).parent.parent.parent
LAST = "document.querySelector('.pane.second canvas').toDataURL()"
SYSTEM = ("chromium", "chromium-browser", "google-chrome")


@pytest.fixture(scope="module")
def browser():
    sync_api = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install shellform[test]"
    )
    with sync_api.sync_playwright() as player:
        own = Path(player.chromium.executable_path)
        found = (
            own if own.is_file() else next((path for name in SYSTEM if (path := shutil.which(name))), None)
        )
        if found is None:
            pytest.skip("there is no Chromium here: playwright install chromium, or apt-get install chromium")
        chromium = player.chromium.launch(executable_path=str(found))
        yield chromium
        chromium.close()


@pytest.fixture(scope="module")
def folder(begun, tmp_path_factory):
    return finish(Path(shutil.copytree(begun, tmp_path_factory.mktemp("browsed") / "run")))


@pytest.fixture(scope="module")
def run(folder):
    return read_run(folder)


@pytest.fixture(scope="module")
def file(folder):
    return write_report([folder])


@pytest.fixture
def visit(browser):
    """Opens a file and fails afterwards if the page said an error or asked for anything."""
    contexts, wrong = [], []

    def open_file(path, **how):
        context = browser.new_context(
            **{"viewport": {"width": 1280, "height": 900}, "reduced_motion": "reduce", **how}
        )
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("dialog", lambda dialog: (wrong.append(dialog.message), dialog.dismiss()))
        page.on(
            "request",
            lambda asked: None if asked.url.startswith(("data:", path.as_uri())) else wrong.append(asked.url),
        )
        page.goto(path.as_uri())
        page.wait_for_function("document.querySelector('.run:not([hidden]) .told').textContent !== ''")
        return page

    yield open_file
    for context in contexts:
        context.close()
    assert not wrong


def picture(page):
    """The canvas' pixels (h, w, 3) once what was asked for is drawn."""
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    data = page.evaluate(
        "document.querySelector('.run:not([hidden]) canvas').toDataURL('image/png').split(',')[1]"
    )
    return np.asarray(Image.open(io.BytesIO(base64.b64decode(data))).convert("RGB"), dtype=int)


def changed(first, second):
    """The share of pixels that differ clearly."""
    return float((np.abs(first - second).max(axis=2) > 24).mean())


def choose(page, name, value):
    page.locator(f".run:not([hidden]) label:has(input[name={name}][value={value}])").click()


def cells(page, table, column):
    return page.eval_on_selector_all(
        f"[data-table={table}] tbody tr td:nth-child({column})",
        "cells => cells.map(cell => cell.textContent)",
    )


def hovered(page, kind):
    """A place on the canvas, in the window's pixels, where the pointer finds a cable or rod, and what the
    page says of it.
    """
    page.locator("canvas").first.scroll_into_view_if_needed()
    box = page.locator("canvas").first.bounding_box()
    for share in np.linspace(0.3, 0.7, 25):
        x, y = box["x"] + share * box["width"], box["y"] + (0.35 + 0.3 * share) * box["height"]
        page.mouse.move(x, y)
        page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
        told = page.locator(".tip").first.text_content() if page.locator(".tip").first.is_visible() else ""
        if told.startswith(kind):
            return x, y, told
    raise AssertionError(f"no {kind} was found")


def test_the_view_draws_the_shell_and_the_summary_stands_on_the_first_screen(visit, file):
    page = visit(file)
    drawn = picture(page)
    background = drawn[2, 2]
    assert (np.abs(drawn - background).max(axis=2) > 40).mean() > 0.01
    for words in ("How far off is the shell?", "Is it safe at 1.2 × the load?", "What to buy?"):
        box = page.get_by_text(words).first.bounding_box()
        assert box["y"] + box["height"] < 900
    page.wait_for_function(
        "[...document.querySelectorAll('.gallery img')].every((each) => each.complete && each.naturalWidth > "
        "0)"
    )
    assert page.locator(".gallery img").count() == 3


def test_a_cable_picked_by_the_mouse_shows_the_numbers_of_the_run(visit, file, run):
    page = visit(file)
    x, y, told = hovered(page, "Cable")
    before = picture(page)
    page.mouse.click(x, y)
    number = int(re.match(r"Cable C(\d+)", told)[1])
    assert page.locator(".picked h3").text_content().startswith(f"Cable C{number}")
    assert changed(before, picture(page)) > 0.0, "it is drawn in another colour"
    assert page.locator("[data-table=cables] tr[aria-selected=true] td").first.text_content() == f"C{number}"
    design = run.designs["optimised"]
    cables = run.shell.cables(design)
    assert (
        f"rest length {1e3 * cables.rest_length[number]:.2f} mm" in page.locator(".picked p").text_content()
    )
    for line, load in zip(page.locator(".picked tbody tr").all(), run.loads, strict=True):
        length, force = line.locator("td").all_text_contents()
        state = run.states["optimised"][load]
        assert float(length) == pytest.approx(1e3 * cables.lengths(state)[number], abs=0.006)
        tension = cables.tension(state)[number]
        assert force == "slack" if tension == 0.0 else float(force) == pytest.approx(tension, abs=0.006)
    x, y, _ = hovered(page, "Rod")
    page.mouse.click(x, y)
    assert page.locator(".picked h3").text_content().startswith("Rod")


def test_switching_design_and_load_changes_picture_words_and_tables(visit, file, run):
    page = visit(file)
    first, forces = picture(page), cells(page, "cables", 6)
    choose(page, "load", "none")
    assert changed(first, picture(page)) > 0.001, "no arrows, other colours"
    assert cells(page, "cables", 6) != forces
    choose(page, "design", "initial")
    away = 1e3 * deviations(run.shell, run.states["initial"]["none"])
    told = page.locator(".told").first.text_content()
    assert told.startswith("Initial design under no load")
    assert float(re.search(r"([\d.]+) mm off at most", told)[1]) == pytest.approx(away.max(), rel=0.06)
    assert len(cells(page, "cables", 1)) == run.designs["initial"].present.sum()
    choose(page, "design", "unbraced")
    assert "no cables" in page.locator(".told").first.text_content()
    assert not page.locator(".cables-legend").is_visible()


def test_what_is_shown_can_be_switched_turned_and_scaled(visit, file):
    page = visit(file)
    now = picture(page)
    for change in (
        lambda: page.check("input[name=surface]"),
        lambda: page.uncheck("input[name=cables]"),
        lambda: page.uncheck("input[name=loads]"),
        lambda: page.select_option("select[name=scale]", "state"),
        lambda: page.select_option("select[name=colour]", "stress"),
        lambda: page.locator("input[name=exaggerate]").fill("20"),
        lambda: page.get_by_role("button", name="Top", exact=True).click(),
        lambda: page.get_by_role("button", name="Zoom in").click(),
    ):
        change()
        after = picture(page)
        assert changed(now, after) > 0.001
        now = after
    box = page.locator("canvas").first.bounding_box()
    page.mouse.move(box["x"] + 200, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 320, box["y"] + 160, steps=4)
    page.mouse.up()
    assert changed(now, picture(page)) > 0.01, "a drag turns the shell"


def test_the_colours_fit_the_design_and_its_cables_are_saved_as_shown(visit, file, tmp_path):
    page = visit(file)
    off = float(re.search(r"([\d.]+) mm off at most", page.locator(".told").first.text_content())[1])
    ticks = page.locator(".rods-legend .ticks span").all_text_contents()
    end = float(ticks[-1].removeprefix("≥ "))
    assert [float(each.removeprefix("≥ ")) for each in ticks] == pytest.approx(
        end * np.linspace(0.0, 1.0, 5), abs=9e-3 * end
    ), "a number stands where it says"
    assert off <= 1.01 * end <= 2.6 * off
    with page.expect_download() as begun:
        page.locator("[data-save=cables]").click()
    begun.value.save_as(tmp_path / "cables.csv")
    head, *rows = (tmp_path / "cables.csv").read_text(encoding="utf-8").splitlines()
    assert head.startswith("Cable,From crossing,To crossing,Rest length [mm]")
    assert [row.split(",")[0] for row in rows] == cells(page, "cables", 1)


def test_a_second_design_stands_beside_the_first_under_one_camera_and_one_scale(visit, file):
    page = visit(file)
    second = page.locator(".pane.second canvas")
    assert not second.is_visible()
    page.select_option("[name=beside]", label="Initial")
    assert second.is_visible()
    told = page.locator(".told").all_text_contents()
    assert told[0].startswith("Optimised design under the design load")
    assert told[1].startswith("Initial design under the design load")
    before = page.evaluate(LAST)
    page.get_by_role("button", name="Top", exact=True).click()
    picture(page)
    assert page.evaluate(LAST) != before, "the second turns with the first"
    choose(page, "load", "none")
    assert page.locator(".told").nth(1).text_content().startswith("Initial design under no load")
    page.select_option("[name=beside]", label="the same under the design load")
    assert page.locator(".told").nth(1).text_content().startswith("Optimised design under the design load")
    page.select_option("[name=beside]", "")
    assert not second.is_visible()


def test_the_distance_of_two_crossings_is_that_of_the_state(visit, file, run):
    page = visit(file)
    page.fill("[name=from]", "3")
    page.fill("[name=to]", "20")
    pairs = run.net.grid.crossing_nodes[[3, 20]]
    for name, load in [("optimised", "design"), ("optimised", "none")]:
        choose(page, "load", load)
        a, b = run.states[name][load].positions[pairs].mean(axis=1)
        told = page.locator(".measure output").text_content()
        assert float(told.split(" mm")[0]) == pytest.approx(1e3 * np.linalg.norm(b - a), abs=0.006)
    page.fill("[name=to]", "100000")
    assert "numbered from 0 to" in page.locator(".measure output").text_content()
    page.click("[data-measure]")
    canvas = page.locator("canvas").first
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    for share in np.linspace(0.2, 0.8, 20):
        page.mouse.click(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        if "straight from crossing" in page.locator(".measure output").text_content():
            break
    assert "straight from crossing" in page.locator(".measure output").text_content()
    assert not page.locator(".picked h3").count(), "a click measures, it doesn't pick"


def test_a_cut_takes_away_what_lies_beyond_and_draws_the_section(visit, file):
    page = visit(file)
    whole = picture(page)
    page.select_option("[name=cut]", "x")
    half = picture(page)
    assert changed(whole, half) > 0.005
    assert page.locator(".profile path.target").count() == 1
    assert page.locator(".profile circle").count() > 4
    page.locator("[name=level]").fill("10")
    assert changed(half, picture(page)) > 0.002
    assert re.search(r"at x = -?\d+\.\d\d mm", page.locator(".profile figcaption").text_content())
    page.select_option("[name=cut]", "")
    assert changed(whole, picture(page)) < 0.001


def test_the_way_leads_from_the_flat_grid_to_the_poured_shell(visit, file):
    page = visit(file)
    poured = picture(page)
    assert page.locator(".way").text_content() == "flat → erected → braced → poured"
    seen = []
    for share in ("0", "20", "33", "67", "100"):
        page.locator("[name=moment]").fill(share)
        seen.append(picture(page))
    assert changed(seen[0], seen[1]) > 0.01
    assert changed(seen[1], seen[2]) > 0.005
    assert changed(poured, seen[-1]) < 0.001
    page.locator("[name=moment]").fill("0")
    assert page.locator(".told").first.text_content() == "Optimised design: flat."
    page.locator("[name=moment]").fill("15")
    assert "drawn straight between" in page.locator(".told").first.text_content()
    choose(page, "load", "none")
    assert page.locator("[name=moment]").input_value() == "100", "a load is shown as computed"


def test_pictures_tables_and_the_view_are_saved(visit, file, tmp_path):
    page = visit(file)
    for what, ending in [("[data-save=picture]", ".png"), ("[data-save-picture]", ".webp")]:
        with page.expect_download() as begun:
            page.locator(what).first.click()
        assert begun.value.suggested_filename.endswith(ending)
        begun.value.save_as(tmp_path / "picture")
        with Image.open(tmp_path / "picture") as saved:
            assert saved.width > 60
    with page.expect_download() as begun:
        page.locator("[data-save-table=checks]").click()
    begun.value.save_as(tmp_path / "checks.csv")
    assert (tmp_path / "checks.csv").read_text(encoding="utf-8").startswith("Check,Optimised")


def test_the_links_lead_to_the_files_of_the_run(visit, folder, tmp_path):
    for page_file in (folder / "report.html", tmp_path / "elsewhere.html"):
        page = visit(write_report([folder], page_file))
        addresses = page.eval_on_selector_all(".files a", "links => links.map((link) => link.href)")
        assert len(addresses) > 5
        assert all(Path(address.removeprefix("file://")).is_file() for address in addresses)


def test_tables_are_sorted_and_searched(visit, file):
    page = visit(file)
    sort = page.get_by_role("button", name="Sort by Force [N]")
    for sign in (1, -1):
        sort.click()
        forces = [0.0 if text == "slack" else float(text) for text in cells(page, "cables", 6)]
        assert forces == sorted(forces, reverse=sign < 0)
    number = cells(page, "cables", 1)[3]
    page.fill("[data-search=cables]", number)
    found = cells(page, "cables", 1)
    assert number in found
    assert page.locator("[data-table=cables] tbody tr").count() < len(forces)
    assert f"of {len(forces)} rows" in page.locator("[id$=-cables] .count").text_content()
    page.fill("[data-search=rods]", "u3")
    assert cells(page, "rods", 1) == ["U3"]
    page.get_by_role("button", name="Sort by Cables").click()
    column = page.eval_on_selector_all(
        "[id$=-designs] tbody tr td:nth-child(2)", "cells => cells.map(cell => Number(cell.textContent))"
    )
    assert column == sorted(column)


def test_numbers_are_sorted_by_what_they_are_worth_in_whatever_unit_they_are_told(visit, file):
    page = visit(file)
    worth = [
        "−1.5 mm",
        "3 × 10⁻¹⁰",
        "2 × 10⁻⁴",
        "950 N",
        "40.9 kN",
        "12\u202f300\u202f000",
        "1.2 × 10¹²",
        "–",
    ]
    page.evaluate(
        """texts => {
            const body = document.querySelector("[id$=-designs] tbody"), [own] = body.rows;
            const rows = texts.map(() => own.cloneNode(true));
            rows.forEach((row, k) => { row.cells[1].textContent = texts[k]; });
            body.replaceChildren(...rows);
        }""",
        [worth[k] for k in (4, 0, 7, 6, 2, 3, 1, 5)],
    )
    for expected in (worth, worth[::-1]):
        page.get_by_role("button", name="Sort by Cables").click()
        column = page.locator("[id$=-designs] tbody tr td:nth-child(2)")
        assert column.all_text_contents() == expected


def test_forces_of_kilonewtons_are_read_in_these_in_legend_and_table(visit, file, tmp_path):
    larger = 1e3
    page = visit(file)
    small = [page.locator(".cables-legend .ticks span").last.text_content(), *cells(page, "cables", 6)]
    head, data, rest = re.split(r'(?<=id="data">)(.*?)(?=</script>)', file.read_text(encoding="utf-8"))
    content = json.loads(data)
    for each in content["runs"]:
        each["force"] *= larger
        for state in [state for design in each["designs"] for state in design["states"].values()]:
            state["force"] = [larger * value for value in state["force"]]
    heavy = tmp_path / "heavy.html"
    heavy.write_text(head + json.dumps(content) + rest, encoding="utf-8")
    page = visit(heavy)
    caption = page.locator(".cables-legend figcaption").text_content()
    assert caption == "Cables: force, kilonewtons; slack ones faint"
    large = [page.locator(".cables-legend .ticks span").last.text_content(), *cells(page, "cables", 6)]
    for before, now in zip(small, large, strict=True):
        assert now == before or float(now) == pytest.approx(float(before), abs=6e-3)
    assert page.get_by_role("button", name="Sort by Largest of all loads [kN]").is_visible()


def test_everything_is_reached_by_keys(visit, file):
    page = visit(file)
    page.locator("input[name=load]:checked").focus()
    page.keyboard.press("ArrowRight")
    assert "1.2 × the load" in page.locator(".told").first.text_content()
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.name") == "beside"
    page.keyboard.press("Tab")
    assert page.evaluate("document.activeElement.tagName") == "CANVAS"
    page.keyboard.press("0")
    still = picture(page)
    page.keyboard.press("ArrowLeft")
    turned = picture(page)
    assert changed(still, turned) > 0.005
    page.keyboard.press("+")
    assert changed(turned, picture(page)) > 0.005
    page.keyboard.press("0")
    assert changed(still, picture(page)) < 0.001
    page.keyboard.press("n")
    page.keyboard.press("n")
    second = page.locator("[data-table=cables] tbody tr").nth(1)
    assert second.get_attribute("aria-selected") == "true"
    page.keyboard.press("Escape")
    assert page.locator("[aria-selected=true]").count() == 0
    page.locator("[data-table=rods] tbody tr").first.focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("Enter")
    assert page.locator(".picked h3").text_content().startswith(f"Rod {cells(page, 'rods', 1)[1]}")
    page.locator("[id$=-rods] .see").press("Enter")
    assert 0 <= page.locator(".viewer").bounding_box()["y"] < 400, "from the row to the view"
    page.locator(".gallery button").first.focus()
    page.keyboard.press("Enter")
    assert page.locator("dialog").is_visible()
    page.keyboard.press("Escape")
    assert not page.locator("dialog").is_visible()


def test_it_prints_to_pages_with_all_that_is_folded_or_scrolled_away(visit, file, run):
    from pypdf import PdfReader

    page = visit(file, color_scheme="dark")
    paper = PdfReader(io.BytesIO(page.pdf(format="A4", print_background=False)))
    assert len(paper.pages) >= 4
    assert all(float(each.mediabox.width) < float(each.mediabox.height) for each in paper.pages)
    text = " ".join(" ".join(each.extract_text() for each in paper.pages).split())
    assert run.case.title in text
    assert "rest_ratio = 0.99" in text, "the settings are unfolded"
    assert f"C{run.designs['optimised'].present.sum() - 1}" in text, "the whole table is printed"
    assert "Drag turns" not in text


def test_a_phone_shows_it_without_scrolling_sideways(visit, file):
    page = visit(
        file, viewport={"width": 360, "height": 740}, device_scale_factor=2, is_mobile=True, has_touch=True
    )
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    drawn = picture(page)
    assert (np.abs(drawn - drawn[2, 2]).max(axis=2) > 40).mean() > 0.01
    page.locator("canvas").first.scroll_into_view_if_needed()
    box = page.locator("canvas").first.bounding_box()
    for share in np.linspace(0.35, 0.65, 13):
        page.touchscreen.tap(box["x"] + share * box["width"], box["y"] + 0.5 * box["height"])
        if page.locator(".picked h3").count():
            break
    assert re.match("(Cable|Rod) ", page.locator(".picked h3").text_content())
    canvas = page.locator("canvas").first
    assert canvas.evaluate("each => getComputedStyle(each).touchAction") == "none", "now one finger turns it"
    page.evaluate("document.activeElement.blur()")
    assert canvas.evaluate("each => getComputedStyle(each).touchAction") == "pan-y", "and scrolls again"


def test_on_a_laptop_the_view_begins_on_the_first_screen(visit, file):
    page = visit(file, viewport={"width": 1366, "height": 680})
    assert page.locator("canvas").first.bounding_box()["y"] < 560


def test_dark_and_light_follow_the_reader_s_wish(visit, file):
    shades = {}
    for scheme in ("light", "dark"):
        page = visit(file, color_scheme=scheme)
        paper = page.evaluate("getComputedStyle(document.body).backgroundColor")
        shades[scheme] = (
            np.mean([int(each) for each in re.findall(r"\d+", paper)]),
            picture(page)[2, 2].mean(),
        )
    assert shades["light"][0] > 200 > 60 > shades["dark"][0]
    assert shades["light"][1] > 200 > 100 > shades["dark"][1]
    page.emulate_media(color_scheme="light")
    assert picture(page)[2, 2].mean() > 200, "also while it is open"


def test_titles_and_names_from_elsewhere_stay_text(visit, folder, tmp_path):
    title = "</script><img src=x onerror=alert(1)> & {{ 7 * 7 }} <!--"
    odd = Path(shutil.copytree(folder, tmp_path / "<b>run"))
    settings = (odd / "case.toml").read_text(encoding="utf-8")
    (odd / "case.toml").write_text(
        re.sub("title = .*", lambda _: f"title = '{title}'", settings), encoding="utf-8"
    )
    (odd / "figures/net-skew.png").rename(odd / "figures/net-'onload='alert(2).png")
    page = visit(write_report([odd], tmp_path / "page.html"))
    assert page.locator("h1").text_content() == title
    assert page.title().startswith(title)
    assert page.locator(".kicker").text_content() == "<b>run"
    assert page.locator("img[src=x]").count() == 0


def test_several_runs_are_compared_and_stand_in_tabs(visit, folder, tmp_path):
    other = begin(ROOT, tmp_path / "other", "title=other")
    page = visit(write_report([folder, other], tmp_path / "page.html"))
    assert page.locator(".compare tbody tr").count() >= 2
    first = picture(page)
    page.get_by_role("tab").first.focus()
    page.keyboard.press("ArrowRight")
    assert page.locator(".run:not([hidden]) h1").text_content() == "other"
    assert "Initial design" in page.locator(".run:not([hidden]) .told").first.text_content()
    assert changed(first, picture(page)) > 0.001
    page.get_by_role("tab").first.click()
    assert changed(first, picture(page)) < 0.001, "and back"
    page.locator(".compare tbody a").nth(1).click()
    assert page.locator(".run:not([hidden]) h1").text_content() == "other"


def test_a_study_s_designs_tell_their_values_under_the_pointer_in_colours_and_sizes(browser, tmp_path):
    (tmp_path / "study.html").write_text(study_page(content()), encoding="utf-8")
    context = browser.new_context(viewport={"width": 1280, "height": 900})
    page, wrong = context.new_page(), []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda said: wrong.append(said.text) if said.type == "error" else None)
    page.goto((tmp_path / "study.html").as_uri())
    page.select_option("[name=colour]", label="spacing of the rods [mm]")
    page.select_option("[name=size]", label="cables")
    assert "Colour: spacing of the rods [mm], 100" in page.locator("#key").text_content()
    fills = page.eval_on_selector_all("circle", "dots => dots.map((dot) => dot.style.fill)")
    assert len(set(fills)) == len(fills) == 3
    assert (
        len(set(page.eval_on_selector_all("circle", "dots => dots.map((dot) => dot.getAttribute('r'))"))) == 3
    )
    page.locator("circle.front").first.hover(force=True)
    assert page.locator(".hint").is_visible()
    hint = page.locator(".hint").text_content()
    assert hint.startswith("Design ")
    assert "misfit [mm]: " in hint
    assert not wrong
    context.close()


def test_without_webgl_the_page_says_so_and_the_rest_works(visit, file, browser):
    context = browser.new_context()
    context.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page = context.new_page()
    page.goto(file.as_uri())
    assert (
        "The view can't be drawn: this browser has no WebGL 2" in page.locator(".told").first.text_content()
    )
    page.locator("[data-table=cables] tbody tr").first.click()
    assert page.locator(".picked h3").text_content().startswith("Cable")
    context.close()
