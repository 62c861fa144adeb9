"""Draws the documentation's pictures of pages: `python scripts/page_picture.py DIR`, where DIR is a run with
a report.html, or a study with a study.html whose picture is named as the folder; needs playwright and a
Chromium."""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import Page, sync_playwright

PICTURES = Path(__file__).parent / "pictures"


def main(place: Path) -> None:
    """Photographs the page into scripts/pictures/report.png or study_NAME.png."""
    study = place / "study.html"
    with sync_playwright() as player:
        own = player.chromium.executable_path
        browser = player.chromium.launch(
            executable_path=own if Path(own).is_file() else shutil.which("chromium")
        )
        page = browser.new_page(viewport={"width": 1280, "height": 1060})
        page.goto((study if study.is_file() else place / "report.html").resolve().as_uri())
        point_at_a_design(page) if study.is_file() else pick_a_cable(page)
        page.wait_for_timeout(500)
        picture = Image.open(io.BytesIO(page.screenshot()))
        browser.close()
    file = PICTURES / (f"study_{place.resolve().name}.png" if study.is_file() else "report.png")
    picture.convert("RGB").quantize(192, dither=Image.Dither.NONE).save(file, optimize=True)


def pick_a_cable(page: Page) -> None:
    """The first screen and the view of a run's page, with a cable picked."""
    page.select_option("select[name=scale]", "state")
    page.check("input[name=surface]")
    for _ in range(60):
        page.locator("canvas").first.press("n")
    page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")


def point_at_a_design(page: Page) -> None:
    """The scatter plot of a study's page with the pointer at a design on the front."""
    page.locator("circle.front").first.hover()


main(Path(sys.argv[1]))
