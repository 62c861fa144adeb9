"""Draws the README's picture of the page: `python scripts/page_picture.py RUN`, where RUN has a report.html; needs playwright and a Chromium."""

import io
import shutil
import sys
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright


def main(run: Path) -> None:
    """Photographs the first screen and the view, with a cable picked, into scripts/pictures/report.png."""
    with sync_playwright() as player:
        own = player.chromium.executable_path
        browser = player.chromium.launch(executable_path=own if Path(own).is_file() else shutil.which("chromium"))
        page = browser.new_page(viewport={"width": 1280, "height": 1060})
        page.goto((run / "report.html").resolve().as_uri())
        page.select_option("select[name=scale]", "state")
        page.check("input[name=surface]")
        for _ in range(60):
            page.locator("canvas").press("n")
        page.evaluate("document.activeElement.blur(); scrollTo(0, 0)")
        page.wait_for_timeout(500)
        picture = Image.open(io.BytesIO(page.screenshot()))
        browser.close()
    picture.convert("RGB").quantize(192, dither=Image.Dither.NONE).save(Path(__file__).parent / "pictures/report.png", optimize=True)


main(Path(sys.argv[1]))
