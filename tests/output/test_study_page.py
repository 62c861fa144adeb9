"""The page of a study stands alone, tells what is in the table, and runs nothing but its own script."""

import json
import math
import re
from dataclasses import is_dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from shellform.output.page import measures
from shellform.output.page.measures import entry_measure, summary_measure
from shellform.output.page.study_page import (
    StudyContent,
    StudyRow,
    chosen,
    number_text,
    rank_correlations,
    spread,
    study_page,
    thumbnail,
)
from shellform.records import summary

CASE = Path(measures.__file__).parents[2] / "case"


def content(**changes):
    """Five designs, one refused and one without a number."""

    def row(k, misfit, cables, reason=""):
        columns = {"case.net.spacing": 0.1 + 0.01 * k, "misfit": misfit, "cables": cables}
        return StudyRow(k, f"k{k}", not reason, "refused" if reason else "done", reason, columns)

    rows = [row(k, 1e-3 * k, 9 - k) for k in range(5)]
    rows[3] = row(3, None, None, "</script><script>alert(1)</script>")
    rows[4] = row(4, float("nan"), 5)
    given = {
        "title": "Weights <b>",
        "rows": rows,
        "varied": ["case.net.spacing"],
        "found": ["misfit", "cables"],
        "measures": {
            "case.net.spacing": entry_measure("net.spacing"),
            "misfit": summary_measure("designs.best.loads.design.deviation_rms"),
        },
        "goals": {"misfit": 1.0, "cables": 1.0},
        "front": ["k0", "k1"],
        "best": ["k0", "k1"],
        "links": {"k0": "runs/k0/report.html"},
        "pictures": {"k0": "<svg></svg>"},
        "designs": {"done": 4, "failed": 1},
        "correlation": {"case.net.spacing": {"misfit": 1.0, "cables": -1.0}},
        "notes": [],
    }
    return StudyContent(**{**given, **changes})


def test_the_page_asks_for_nothing_and_escapes_what_comes_from_elsewhere():
    page = study_page(content())
    assert "default-src 'none'" in page
    assert not re.search(r"""(src|href)=["']?(https?:)?//""", page)
    assert "<b>" not in page
    assert page.count("<script") == 2
    assert "&lt;/script&gt;" in page
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert [row[:3] for row in data["rows"]] == [[0, 1, 100.0], [1, 1, 110.0], [2, 0, 120.0], [4, 0, 140.0]]
    assert data["rows"][3][3:] == [None, 5]
    assert data["links"] == {"0": "runs/k0/report.html"}
    assert "−1.00" in page
    assert '<a href="runs/k0/report.html">Design 0</a>' in page


def test_rank_correlation_is_spearmans():
    given = {"a": [1, 2, 3, 4, None, "x"], "same": 6 * [1.0], "word": list("abcdef")}
    found = {
        "up": [1.0, 10.0, 100.0, 1000.0, 5.0, 6.0],
        "down": [4, 3, 2, 1, 7, 8],
        "other": [1, 3, 2, 4, 9, 9],
    }
    told = rank_correlations(given, found)
    assert list(told) == ["a"]
    assert told["a"] == pytest.approx({"up": 1.0, "down": -1.0, "other": 0.8})


def test_large_studies_are_thinned_but_for_the_front():
    assert chosen(3, [1]) == [0, 1, 2]
    few = chosen(100_000, [7, 99_998])
    assert {0, 7, 99_998, 99_999} <= set(few)
    assert len(few) <= 4002
    assert spread([str(k) for k in range(100)], 3) == ["0", "50", "99"]
    assert spread([], 3) == []


def test_a_thumbnail_shows_each_rod_in_the_colour_of_its_distance(shell):
    target = shell.target
    assert thumbnail(shell, target, 0.01).count("<path") == 1
    moved = target.positions.copy()
    moved[: len(moved) // 2, 2] += 0.02
    drawn = thumbnail(shell, type(target)(moved, target.quaternions), 0.01)
    assert {"#440154", "#fde725"} <= set(re.findall(r'stroke="(#\w+)"', drawn))
    assert "20.0 mm off at most" in drawn
    assert len(drawn) < 60_000


def test_a_thumbnail_is_seen_from_40_degrees_above_the_ground_and_30_from_y(dome):
    place = dome.target.positions
    drawn = re.findall(r"M(\S+) (\S+?)L(\S+) (\S+?)(?=M|\")", thumbnail(dome, dome.target, 0.01, width=4000))
    lines = np.array(drawn, dtype=float).reshape(-1, 2, 2)
    up, aside = np.deg2rad(40.0), np.deg2rad(30.0)
    sight = np.array([-np.sin(aside) * np.cos(up), np.cos(aside) * np.cos(up), -np.sin(up)])
    rods = np.diff(place[dome.net.grid.rod_ends], axis=1)[:, 0]
    seen = np.linalg.norm(rods - np.outer(rods @ sight, sight), axis=1)
    length = np.linalg.norm(np.diff(lines, axis=1)[:, 0], axis=1)
    scale = length.sum() / seen.sum()
    assert np.sort(length) == pytest.approx(np.sort(scale * seen), abs=0.3)  # ends stand to a tenth
    top = place[dome.net.grid.rod_ends][:, 0, 2].argmax()
    assert lines[top, 0, 1] < lines[:, 0, 1].mean(), "what is high stands high in the picture"


def test_columns_are_told_in_units_that_a_designer_uses():
    page = study_page(content())
    data = json.loads(page.split('id="data">')[1].split("</script>")[0])
    assert data["names"] == ["spacing of the rods [mm]", "misfit [mm]", "cables"]
    assert data["rows"][1][3] == 1.0, "1 mm, not 0.001"
    assert data["goals"] == [1, 2]
    assert (
        "root mean square of the distances from the target under the design load of the design to build"
        in page
    )
    for name in ("colour", "size"):
        assert f'select name="{name}"' in page
    assert number_text(14400.0) == "14\u202f400", "not 1.44e+04"
    assert (number_text(None), number_text(math.nan), number_text(12)) == ("–", "–", "12")
    stands = summary_measure("designs.best.loads.design.stands.standing").words
    assert stands == "of these, structures that stand under the design load of the design to build"
    planned, built = (
        summary_measure(f"designs.best.loads.design.{way}deviation_max") for way in ("", "built_shape.")
    )
    assert planned.words.startswith("largest distance from the target under")
    assert built == replace(planned, words=planned.words.replace("target", "target as built"))
    adjusted = summary_measure("designs.best.loads.design.adjusted_shape.deviation_max").words
    assert adjusted == planned.words.replace("target", "target adjusted on site")
    unknown = summary_measure("net.something_new")
    assert (unknown.words, unknown.unit, unknown.factor) == ("net.something_new", "", 1.0)


def test_every_measure_of_a_summary_is_one_of_its_fields():
    fields = {
        each.name
        for record in vars(summary).values()
        if is_dataclass(record)
        for each in record.__dataclass_fields__.values()
    }
    known = set(measures._FOUND) - {"total"}
    assert known <= fields


def test_every_measure_of_a_case_is_an_entry_that_it_has():
    for name in measures._ENTRIES:
        table, _, entry = name.partition(".")
        text = "".join(path.read_text(encoding="utf-8") for path in CASE.glob("*.py"))
        assert re.search(rf"^    {table}: ", text, re.MULTILINE), name
        assert re.search(rf"^    {entry}: ", text, re.MULTILINE), name
