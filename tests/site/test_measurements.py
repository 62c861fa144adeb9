"""Tables that come from a site, cell by cell, for a net of six nodes and two crossings."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.site import measurements
from shellform.site.measurements import (
    MeasuredRow,
    check_noise,
    counted_alike,
    has_column,
    read_groups,
    read_loads,
    read_nodes,
    read_places,
    read_table,
    read_way,
)

SHELL = SimpleNamespace(
    node_count=6,
    net=SimpleNamespace(
        grid=SimpleNamespace(
            crossing_nodes=np.array([[0, 3], [1, 5]]),
            rods=(
                SimpleNamespace(direction="u", nodes=np.array([2, 0, 4]), length=6.0),
                SimpleNamespace(direction="v", nodes=np.array([2, 3, 5]), length=0.1),
            ),
        ),
        supports=np.array([4, 2]),
    ),
    target=SimpleNamespace(positions=np.array([[k, 0.5 * k, 0.1 * k] for k in range(6)])),
)
ORIGIN = (430_000.0, 81_000.0, 400.0)


@pytest.fixture
def written(tmp_path):
    def write(text):
        file = tmp_path / "table.csv"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def test_rows_keep_the_numbers_of_their_lines_and_columns_come_in_any_order_and_case(written):
    file = written("# from site\n\n Y ; X;note\n1.5; 2;a\n  # a remark\n;3\n")
    rows = read_table(file, ("x",), ("y", "z"), empty=("y",))
    assert [row.line for row in rows] == [4, 6]
    assert rows[0] == MeasuredRow(4, {"x": 2.0, "y": 1.5})
    assert rows[1].values["x"] == 3.0
    assert math.isnan(rows[1].values["y"])


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "   "])
def test_cells_are_parted_by_the_mark_that_the_first_line_has(written, delimiter):
    text = f"x{delimiter}y\n1{delimiter}-2.5e-3\n"
    assert read_table(written(text), ("x", "y")) == [MeasuredRow(2, {"x": 1.0, "y": -0.0025})]
    assert has_column(written("# z\n\n" + text), "y")
    assert not has_column(written("# z\n" + text), "z")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", r"is empty. Columns: x, y; if wanted z"),
        ("x\n1\n", r"has no column 'y' in its first line \(found 'x'\)"),
        ("x,y,X\n1,2,3\n", "has two columns 'x'"),
        ("x,y\n", "has no rows below its first line"),
        ("x,y\n1,2\n1,2,3\n", "line 3: has 3 cells for 2 columns"),
        ("x,y\n1,2\n1\n", "line 3: y: must be a number"),
        ("x,y\n1,\n", "line 2: y: must be a number"),
        ("x,y\n,2\n", "line 2: x: must be a number"),
        ("x,y\n1,inf\n", "line 2: y: must be finite"),
    ],
)
def test_a_table_that_lacks_something_is_refused_by_line_and_column(written, text, said):
    with pytest.raises(InputError, match=said):
        read_table(written(text), ("x", "y"), ("z",), empty=("z",))


def test_nodes_are_named_by_their_number_or_by_a_crossing_whose_upper_rod_s_they_are(written):
    assert read_nodes(written("node\n5\n0\n"), SHELL).tolist() == [5, 0]
    assert read_nodes(written("crossing\n1\n0\n"), SHELL).tolist() == [5, 3]
    for text, said in [
        ("node\n6\n", r"line 2: node: must be a whole number from 0 to 5 \(found 6"),
        ("node\n-1\n", "line 2: node: must be a whole number from 0 to 5"),
        ("node\n0.5\n", "line 2: node: must be a whole number"),
        ("crossing\n2\n", "line 2: crossing: must be a whole number from 0 to 1"),
        ("node\n3\n1\n3\n", r"line 4: node: is there twice \(found 3\)"),
        ("crossing\n1\n1\n", r"line 3: crossing: is there twice \(found 1\)"),
        ("number\n1\n", "has no column 'node' or 'crossing'"),
    ]:
        with pytest.raises(InputError, match=said):
            read_nodes(written(text), SHELL)


def test_loads_stand_at_their_node_and_axis_and_those_left_out_are_nothing(written):
    load = read_loads(written("fz,node,fx\n-12.5,4,3\n2,0,-1\n"), SHELL)
    wanted = np.zeros((6, 6))
    wanted[4, :3], wanted[0, :3] = (3.0, 0.0, -12.5), (-1.0, 0.0, 2.0)
    np.testing.assert_array_equal(load, wanted)
    assert read_loads(written("crossing,fy\n1,7\n"), SHELL)[5].tolist() == [0.0, 7.0, 0.0, 0.0, 0.0, 0.0]
    with pytest.raises(InputError, match="no column fx, fy or fz"):
        read_loads(written("node,x\n1,2\n"), SHELL)


def test_places_of_nodes_that_were_not_seen_are_no_numbers(written):
    nodes, places = read_places(written("x,y,z,crossing\n1,2,3,1\n,,,0\n"), SHELL)
    assert nodes.tolist() == [5, 3]
    np.testing.assert_array_equal(places, [[1.0, 2.0, 3.0], [np.nan] * 3])
    with pytest.raises(InputError, match="line 2: node: must be a number"):
        read_places(written("x,y,z,node\n1,2,3,\n"), SHELL)


def test_groups_come_by_rising_number_and_count_the_design_s_own_cables(written):
    design = SimpleNamespace(present=np.array([True, False, True, True, False]))
    first, second = read_groups(written("cable,group\n2,10\n0,2.5\n1,10\n"), design)
    assert (first.tolist(), second.tolist()) == ([0], [3, 2])
    for text, said in [
        ("3,1", r"line 2: cable: must be a whole number from 0 to 2 \(found 3\)"),
        ("C1,1", r"line 2: cable: must be a number \(found 'C1'\). Write its number alone: 1\."),
        ("1,A", r"line 2: group: must be a number \(found 'A'\). Write its number alone, such as 12"),
    ]:
        with pytest.raises(InputError, match=said):
            read_groups(written(f"cable,group\n{text}\n"), design)


def test_a_table_that_is_not_there_is_said_not_to_be(tmp_path):
    with pytest.raises(InputError, match=r"none.csv: there is no such file. Check the path"):
        read_table(tmp_path / "none.csv", ("x",))
    with pytest.raises(InputError, match=r"is a folder, no file\. Name a file in it"):
        read_table(tmp_path, ("x",))


def test_supports_on_their_way_come_in_the_order_of_the_net_s_stop_after_stop(written):
    head = "stop,node,x,y,z\n"
    way, _ = read_way(written(head + "2,2,1,2,3\n1,4,0.5,0,0\n2,4,4,5,6\n1,2,0,0.5,0\n"), SHELL)
    assert [stop.tolist() for stop in way] == [
        [[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]],
        [[4.0, 5.0, 6.0], [1.0, 2.0, 3.0]],
    ]
    for text, said in [
        ("1,3,0,0,0\n", r"line 2: node: is no support \(found 3\). Supports: 4, 2"),
        ("1,4,0,0,0\n1,4,0,0,0\n", r"line 3: node: is there twice in one stop \(found 4\)"),
        ("1,2,0,0,0\n", r"stop 1 lacks 1 support \(found 4\)"),
        (
            "1,2,0,0,0\n1,4,0,6.07,0\n",
            r"stop 1 puts the ends of U0 6.07 m apart, farther than it is long \(found 6.0\)",
        ),
    ]:
        with pytest.raises(InputError, match=said):
            read_way(written(head + text), SHELL)
    assert len(read_way(written(head + "1,2,0,0,0\n1,4,0,6.05,0\n"), SHELL)[0]) == 1


def test_places_in_a_survey_s_coordinates_count_from_the_model_s_origin_and_are_said_to(written):
    head, stop = "stop,node,x,y,z\n", np.array([[0.5, 0.0, 0.0], [0.0, 0.5, 0.0]])
    for text in ("1,4,430000.5,81000,400\n1,2,430000,81000.5,400\n", "1,4,0.5,0,0\n1,2,0,0.5,0\n"):
        (found,), told = read_way(written(head + text), SHELL, ORIGIN)
        np.testing.assert_allclose(found, stop, atol=1e-9)
        assert [*told] == (
            ["surface.origin, (430000, 81000, 400) m, was taken off the coordinates that were given"]
            if "81000" in text
            else []
        )
    (found,), _ = read_way(written(head + "1,4,430000.5,81000,400\n1,2,430000,81000.5,400\n"), SHELL)
    assert found[0, 0] == 430_000.5


def test_an_origin_too_near_to_be_told_from_what_is_measured_stays():
    expected = np.zeros((2, 3))
    off = expected + np.array([0.3, 0.0, 0.0])
    for reach, gone in ((0.29, 0.3), (0.31, 0.0)):
        places, told = counted_alike(off, expected, (0.3, 0.0, 0.0), reach=reach)
        np.testing.assert_allclose(places, off - [gone, 0.0, 0.0])
        assert bool(told) is bool(gone)
    hidden = np.array([[430_000.0, 81_000.0, 400.0], [np.nan, np.nan, np.nan]])
    places, _ = counted_alike(hidden, expected, ORIGIN, reach=1.0)
    np.testing.assert_array_equal(places, [[0.0, 0.0, 0.0], [np.nan] * 3])


def test_noise_is_between_a_nanometre_and_a_metre():
    for noise in (1e-9, 0.0005, 1.0):
        check_noise(noise)
    for noise in (0.99e-9, 1.01, math.nan):
        with pytest.raises(InputError, match=r"--noise.*such as 0\.0001"):
            check_noise(noise)


def test_an_open_quotation_mark_is_told_by_its_line(written):
    with pytest.raises(InputError, match="line 4: can't be parted"):
        measurements.numbered_cells(written('# "\n1,2\n\n"4,5\n'))
    assert measurements.numbered_cells(written('1; "a;b"')) == [(1, ["1", "a;b"])]


def test_names_in_quotation_marks_as_other_programs_write_them_are_the_columns_own(written):
    file = written('"Node","x","y","z"\n"3",1,2,3\n')
    assert has_column(file, "node")
    assert read_places(file, SHELL)[0].tolist() == [3]
