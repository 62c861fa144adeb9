"""Letters that the usual font lacks: in a font of the machine that has them, else told."""

from dataclasses import replace
from types import SimpleNamespace

import matplotlib.font_manager
import pytest
from pypdf import PdfReader

from shellform.output.pictures import letters
from shellform.output.pictures.plots import Label, PaperPage, write_pages
from shellform.output.workshop import drawings
from shellform.output.workshop.schedules import TitleBlock

IN_STIX = "\u20dd\u20e4"  # which DejaVu Sans lacks; STIXGeneral comes with Matplotlib too
NOWHERE = "山田"


@pytest.fixture
def fonts(monkeypatch):
    """A machine with those fonts alone that come with Matplotlib."""
    own = [each for each in letters.fontManager.ttflist if "mpl-data" in each.fname]
    monkeypatch.setattr(letters, "fontManager", SimpleNamespace(ttflist=own))
    letters._chosen.cache_clear()
    yield
    letters._chosen.cache_clear()


def test_words_are_set_in_the_usual_font_and_others_only_for_what_it_lacks(fonts):
    assert letters.families("Größe 1 : 50 – ⌀ ж") == ["DejaVu Sans"]
    first, other = letters.families(f"a {IN_STIX}")
    assert first == "DejaVu Sans"
    font = matplotlib.font_manager.get_font(matplotlib.font_manager.findfont(other))
    assert {ord(letter) for letter in IN_STIX} <= set(font.get_charmap())
    assert letters.without_font(f"a {IN_STIX}") == ""


def test_letters_of_another_font_are_words_of_the_pdf(fonts, tmp_path):
    label = Label((20.0, 20.0), 5.0, f"A{IN_STIX[0]}")
    write_pages(tmp_path / "page.pdf", [PaperPage(100.0, 50.0, (), (label,))])
    page = PdfReader(tmp_path / "page.pdf").pages[0]
    names = [str(font.get_object()["/BaseFont"]) for font in page["/Resources"]["/Font"].values()]
    assert any("DejaVu" not in name for name in names)
    assert not any("LastResort" in name.replace(" ", "") for name in names)
    assert IN_STIX[0] in page.extract_text()


def test_letters_that_no_font_has_are_told(fonts, built):
    assert drawings.letters_note(built) == ()
    (note,) = drawings.letters_note(replace(built, block=TitleBlock(author=f"{NOWHERE} A")))
    assert f"has the letters {NOWHERE}," in note
    assert "Noto Sans CJK" in note


def test_wide_letters_count_as_wide(built, fonts):
    assert letters.columns("abc") == 3.0
    assert letters.columns(NOWHERE) == 3.5
    sheet = drawings.layout.flat_grid(built)
    page = drawings.paper_page(sheet, replace(built, title=NOWHERE * 20), "1 / 1")
    (job,) = [label for label in page.labels if label.text == NOWHERE * 20]
    # a full-width letter is as wide as its font is high, of which a capital is 0.73
    assert 40 * job.height / 0.73 <= 110.0
