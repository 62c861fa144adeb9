"""In which fonts words on paper are set: DejaVu Sans, which comes with Matplotlib, and for letters that it
lacks (Chinese, Japanese and Korean ones of names) an installed font that has them; the door to its fonts.
"""

from __future__ import annotations

import unicodedata
from functools import cache

from matplotlib.font_manager import FontProperties, findfont, fontManager, get_font

FIRST = "DejaVu Sans"
_LAST_RESORT = "Last Resort"  # Matplotlib's font of boxes, which has every letter


def families(text: str) -> list[str]:
    """The names of the fonts that a text is set in, in the order in which a letter is looked for: after the
    first one those that have most of what is left, as long as any has some of it."""
    return _chosen(_lacking(text))[0]


def without_font(text: str) -> str:
    """The letters of a text that no installed font has: they become boxes."""
    return "".join(map(chr, sorted(_chosen(_lacking(text))[1])))


def columns(text: str) -> float:
    """How many letters wide a text is: those of East Asian scripts are as wide as two narrow ones."""
    return sum(1.75 if unicodedata.east_asian_width(letter) in "WF" else 1.0 for letter in text)


def _lacking(text: str) -> frozenset[int]:
    return frozenset(ord(letter) for letter in text if not letter.isspace()) - _letters(_first())


@cache
def _first() -> str:
    return str(findfont(FontProperties(family=FIRST)))


@cache
def _chosen(lacking: frozenset[int]) -> tuple[list[str], frozenset[int]]:
    found = [FIRST]
    if not lacking:  # as nearly always: then no other font is opened
        return found, lacking
    fonts: dict[str, str] = {}
    for each in sorted(fontManager.ttflist, key=lambda each: (each.style != "normal", each.fname)):
        if not each.name.startswith(_LAST_RESORT):
            fonts.setdefault(each.name, each.fname)
    while lacking:
        has = {name: len(lacking & _letters(file)) for name, file in fonts.items()}
        best = max(sorted(has), key=lambda name: has[name], default=None)
        if best is None or not has[best]:
            break
        found.append(best)
        lacking = lacking - _letters(fonts[best])
    return found, lacking


@cache
def _letters(file: str) -> frozenset[int]:
    try:
        return frozenset(get_font(file).get_charmap())
    except (OSError, RuntimeError):  # one that can't be read is none
        return frozenset()
