"""Damaged input is read or refused: no traceback, no crash, no hang. scripts/fuzz.py tries thousands more."""

from scripts.fuzz import asked, damaged, fuzz

QUICK = [
    "case",
    "study",
    "model",
    "obj",
    "off",
    "stl",
    "gltf",
    "glb",
    "json",
    "scan",
    "catalogue",
    "sections",
    "run",
    "log",
]


def test_a_few_hundred_damaged_files_of_every_kind_are_read_or_refused(tmp_path):
    counts, wrong = fuzz([*asked(300, 11, QUICK), ("ply", 1), ("vtp", 1), ("design", 3)], tmp_path)
    assert not wrong, "\n".join(wrong)
    assert set(counts) == {*QUICK, "ply", "vtp", "design"}
    assert sum(each["refused"] for each in counts.values()) > 150
    assert sum(each["read"] for each in counts.values()) > 20


def test_a_crash_and_a_hang_of_the_reader_are_counted_and_cost_nobody_anything(tmp_path, monkeypatch):
    import scripts.fuzz as own

    child = tmp_path / "child.py"
    child.write_text(
        "import os, sys, time\nprint('ready', flush=True)\n"
        "for line in sys.stdin:\n    number = line.split()[1]\n"
        "    time.sleep(9) if number == '2' else os._exit(3) if number == '1' else "
        "print('read', flush=True)\n"
    )
    monkeypatch.setattr(own, "__file__", str(child))
    monkeypatch.setattr(own, "_LONGEST", 0.2)
    counts, wrong = fuzz([("obj", 0), ("obj", 1), ("obj", 2), ("obj", 3)], tmp_path)
    assert counts["obj"] == {"read": 2, "BAD": 2}
    assert "crash" in wrong[0]
    assert "hang" in wrong[1]


def test_the_same_number_makes_the_same_damage():
    import random

    data = b'{"a": [1, 2.5, {"b": null}]}\n' * 3
    made = [damaged(data, random.Random(k)) for k in range(50)]
    assert made == [damaged(data, random.Random(k)) for k in range(50)]
    assert len(set(made)) > 40
