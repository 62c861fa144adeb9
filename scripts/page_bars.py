"""What a page has to keep, seen in a headless Chromium: `python scripts/page_bars.py PAGE...`.

Each page, a run's, a study's or the documentation's, is opened as on a laptop, light and dark, and on a
phone: it is smaller than 8 MB, asks for nothing but files beside it, says no error, doesn't scroll sideways,
draws first within 2 s, and axe-core finds nothing wrong with it. axe-core is fetched by npm into a folder
that is thrown away. Needs playwright and a Chromium.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import Browser, sync_playwright

LARGEST = 8e6  # bytes
FIRST_DRAW = 2000.0  # ms
LONGEST = 30000.0  # ms, that a page is waited for
WINDOWS: dict[str, dict[str, Any]] = {
    "laptop": {"viewport": {"width": 1280, "height": 800}},
    "dark": {"viewport": {"width": 1280, "height": 800}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True},
}
DRAWN = "performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? null"
WIDTHS = "[document.documentElement.scrollWidth, innerWidth]"
AXE = "axe.run(document, {preload: false, resultTypes: ['violations']}).then((found) => found.violations.map((each) => [each.id, each.nodes.map((node) => node.html.slice(0, 120))]))"


def axe_core() -> str:
    """The text of axe-core, by npm."""
    with tempfile.TemporaryDirectory() as folder:
        command = ["npm", "install", "--silent", "--no-audit", "--no-fund", "--prefix", folder, "axe-core@4"]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        return (Path(folder) / "node_modules/axe-core/axe.min.js").read_text(encoding="utf-8")


def broken(browser: Browser, page: Path, axe: str) -> Iterator[str]:
    """What a page doesn't keep, in words."""
    if page.stat().st_size >= LARGEST:
        yield f"{page.stat().st_size / 1e6:.1f} MB"
    for name, window in WINDOWS.items():
        context = browser.new_context(reduced_motion="reduce", **window)
        tab, wrong = context.new_page(), list[str]()
        tab.on("pageerror", lambda error, wrong=wrong: wrong.append(str(error)))
        tab.on("console", lambda said, wrong=wrong: wrong.append(said.text) if said.type == "error" else None)
        tab.on(
            "request",
            lambda asked, wrong=wrong: (
                None if asked.url.startswith(("file:", "data:", "blob:")) else wrong.append(asked.url)
            ),
        )
        tab.goto(page.resolve().as_uri(), wait_until="load")
        while (drawn := tab.evaluate(DRAWN)) is None and tab.evaluate("performance.now()") < LONGEST:
            tab.wait_for_timeout(50)  # not by wait_for_function, which the page's own policy forbids
        tab.wait_for_timeout(500)
        whole, seen = tab.evaluate(WIDTHS)
        if drawn is None:
            yield f"{name}: nothing drawn after {LONGEST:.0f} ms"
        elif drawn > FIRST_DRAW:
            yield f"{name}: first drawn after {drawn:.0f} ms"
        if whole > seen:
            yield f"{name}: {whole} pixels wide in a window of {seen}"
        tab.evaluate(axe)
        for rule, nodes in tab.evaluate(AXE):
            yield f"{name}: axe {rule}: {len(nodes)} × {nodes[0]}"
        yield from (f"{name}: {each}" for each in wrong)
        context.close()


def main(pages: list[Path]) -> int:
    """Prints what each page keeps; 1 where one doesn't."""
    axe, failed = axe_core(), 0
    with sync_playwright() as player:
        own = player.chromium.executable_path
        browser = player.chromium.launch(
            executable_path=own if Path(own).is_file() else shutil.which("chromium")
        )
        for page in pages:
            found = list(broken(browser, page, axe))
            print(f"{page}: {'; '.join(found) or 'all kept'}", flush=True)
            failed += bool(found)
        browser.close()
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main([Path(each) for each in sys.argv[1:]]))
