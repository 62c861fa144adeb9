"""Which columns a study's table has, of which kind, and what stands in them."""

import csv
import datetime

import pytest

from shellform.study import store
from shellform.study.outcome import ListedDesign, Outcome, Status
from shellform.study.store import Log, line_of, picked, read_table, write_table

BEST = "designs.best.loads.design.deviation_rms"


def of(key, status=Status.DONE, **values):
    return Outcome(key, status, "", {name.replace("__", "."): value for name, value in values.items()})


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ((True, False), 0),
        ((3, 4), 1),
        ((3.5, 4.5), 2),
        (("a", "b"), 3),
        ((True, 3), 2),
        ((3, 4.5), 2),
        ((4.5, 3), 2),
        ((4.5, "a"), 3),
        ((True, "a"), 3),
        ((True, 3, 4), 2),
        ((3, 3, True), 2),
    ],
)
def test_a_column_has_its_values_kind_and_of_several_the_one_that_holds_them_all(tmp_path, values, kind):
    with Log(tmp_path / "log") as log:
        log.add([of(f"k{k}", x=value) for k, value in enumerate(values)])
        assert log.kinds == {"x": kind}
    with Log(tmp_path / "log") as log:
        assert log.kinds == {"x": kind}


def test_what_is_tried_again_does_not_stand_until_it_has_ended(tmp_path):
    with Log(tmp_path / "log") as log:
        log.add([of("a"), of("b", Status.CRASHED), of("c", Status.OVERTIME), of("d", Status.REFUSED)])
        assert [key in log for key in "abcde"] == [True, False, False, True, False]
        assert [log.old(key) for key in "abcd"] == [False] * 4
        assert (len(log), log.get("b").status, log.get("e")) == (4, Status.CRASHED, None)
    with Log(tmp_path / "log") as log:
        log.add([of("b", x=1), of("e")])
        assert [log.old(key) for key in "abcde"] == [True, False, False, True, False]
        assert ("b" in log, log.get("b").values) == (True, {"x": 1})
        log.add([of("a", Status.CRASHED)])
        assert "a" not in log
        found = [each and each.status for each in log.outcomes("dxa")]
        assert found == [Status.REFUSED, None, Status.CRASHED]


@pytest.mark.parametrize(
    ("present", "verdict", "best"),
    [
        (("initial",), None, "initial"),
        (("initial", "optimised"), None, "optimised"),
        (("initial", "optimised", "rounded"), None, "rounded"),
        (("initial", "optimised", "rounded", "polished"), None, "polished"),
        (("initial", "polished"), "initial", "initial"),
        (("initial", "optimised"), "polished", "optimised"),
    ],
)
def test_the_best_design_is_the_one_that_the_verdict_is_of_else_the_latest(present, verdict, best):
    values = {f"designs.{name}.cables": k for k, name in enumerate(present)}
    values |= {} if verdict is None else {"verdict.design": verdict}
    found = picked(
        values | {"net.spacing": 0.1}, {"n": "designs.best.cables", "s": "net.spacing", "no": "x.y"}
    )
    assert found == {"n": present.index(best), "s": 0.1, "no": None}


def test_the_table_has_a_row_for_each_design_with_a_result_in_the_study_s_order(monkeypatch, tmp_path):
    """Seven designs of which one has no result yet, written in groups of two."""
    monkeypatch.setattr(store, "_GROUP", 2)
    designs = [
        ListedDesign(key, {"a": k, "b": k % 2 == 0 if k < 4 else 0.5 * k}) for k, key in enumerate("pqrstuv")
    ]
    (tmp_path / "designs.jsonl").write_text("".join(map(line_of, designs)))
    with Log(tmp_path / "log") as log:
        log.add(
            [
                Outcome(key, Status.DONE, "", values, {"net": 0.25, "here": 2.0}, f"w{key}")
                for key, values in (
                    ("v", {"x": 1, "designs.initial.cables": 7}),
                    ("u", {"x": 2.5, "word": "so"}),
                    ("t", {"x": 3, "designs.initial.cables": 5, "designs.optimised.cables": 4.5}),
                    ("s", {}),
                    ("r", {"x": True, "flag": False}),
                    ("p", {"x": 6}),
                )
            ]
        )
        columns = {"n": "designs.best.cables", "w": "word", "none": "designs.best.nothing"}
        assert write_table(tmp_path, log, columns) == 6
    _, parquet = store.arrow()
    groups = parquet.ParquetFile(tmp_path / "table.parquet")
    assert [groups.metadata.row_group(k).num_rows for k in range(groups.num_row_groups)] == [2, 2, 2]
    table = read_table(tmp_path)
    assert table.column_names == [
        "number", "key", "status", "reason", "case.a", "case.b", "n", "w", "none",
        "designs.initial.cables", "designs.optimised.cables", "flag", "word", "x",
    ]  # fmt: skip
    found = table.to_pydict()
    assert (found["number"], "".join(found["key"])) == ([0, 2, 3, 4, 5, 6], "prstuv")
    assert (found["case.a"], found["case.b"]) == ([0, 2, 3, 4, 5, 6], [1.0, 1.0, 0.0, 2.0, 2.5, 3.0])
    assert found["n"] == [None, None, None, 4.5, None, 7.0]
    assert (found["w"], found["none"]) == ([None] * 4 + ["so", None], [None] * 6)
    assert found["x"] == [6.0, 1.0, None, 3.0, 2.5, 1.0]
    assert found["flag"] == [None, False] + [None] * 4
    types = {name: str(kind) for name, kind in zip(table.schema.names, table.schema.types, strict=True)}
    assert (types["case.a"], types["n"], types["none"], types["flag"], types["word"]) == (
        "int64", "double", "double", "bool", "string",
    )  # fmt: skip
    with open(tmp_path / "table.csv", newline="") as file:
        short = list(csv.DictReader(file))
    assert list(short[0]) == table.column_names[:9], "what was asked for alone"
    assert [float(row["n"] or -1) for row in short] == [-1, -1, -1, 4.5, -1, 7.0]
    with open(tmp_path / "seconds.csv", newline="") as file:
        spent = list(csv.reader(file))
    assert spent[:3] == [
        ["number", "key", "worker", "stage", "seconds"],
        ["0", "p", "wp", "net", "0.25"],
        ["0", "p", "wp", "here", "2.0"],
    ]
    assert len(spent) == 13


@pytest.mark.parametrize(
    ("kinds", "kind"),
    [
        ({}, 2),
        ({"initial": 1}, 1),
        ({"initial": 1, "polished": 1}, 1),
        ({"initial": 1, "optimised": 2}, 2),
        ({"initial": 0, "rounded": 1}, 2),
        ({"initial": 1, "optimised": 3}, 3),
    ],
)
def test_a_column_of_the_best_design_holds_what_any_of_its_designs_may_have(kinds, kind):
    own = {BEST.replace(".best.", f".{name}."): each for name, each in kinds.items()}
    assert store._kind_of_pick(BEST, own) == kind
    assert store._kind_of_pick("net.spacing", {**own, "net.spacing": 1}) == 1


@pytest.mark.parametrize(
    ("value", "cell"),
    [
        (True, True),
        (3, 3),
        (0.1, 0.1),
        ("a, b", "a, b"),
        ([0.1, [True, "b"]], '[0.1, [true, "b"]]'),
        (datetime.date(2026, 5, 31), "2026-05-31"),
        (datetime.time(7, 30), "07:30:00"),
        ([datetime.datetime(2026, 5, 31, 7, 30)], '["2026-05-31T07:30:00"]'),
    ],
)
def test_a_cell_has_plain_values_as_they_are_and_others_as_text(value, cell):
    assert store.cell_of(value) == cell
    assert type(store.cell_of(value)) is type(cell)
