"""The benchmark's trend: each row beside that of the run that was committed."""

from scripts.benchmark_trend import committed, trend


def test_a_row_is_told_beside_the_committed_one_with_what_its_bar_did():
    before = {"ratio": (2.0, False), "bar": (1.5, True), "plain": (10.0, None)}
    assert trend("ratio", 1.5, True, before) == "-25 % from 2, did not hold before"
    assert trend("bar", 1.8, False, before) == "+20 % from 1.5, held before"
    assert trend("plain", 11.0, None, before) == "+10 % from 10"
    assert trend("another", 1.0, None, before) == "not measured before"


def test_the_committed_run_has_rows_of_each_size():
    kept = committed()
    assert len(kept) > 20
    assert {name.split(" freedoms")[0] for name in kept} >= {"7,488", "31,200", "127,296"}
