"""Cut list, nesting, cable schedule and setting-out, read back from their files and compared with the net."""

import csv
import itertools
from dataclasses import replace
from types import SimpleNamespace

import binpacking
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from openpyxl import load_workbook

import shellform as sf
from shellform import tables
from shellform.errors import InputError
from shellform.gridshell.layers import TwoLayers
from shellform.gridshell.reactions import reactions
from shellform.net.grid import lattice_grid
from shellform.output.workshop import nesting, schedules
from shellform.output.workshop.cable_forces import force_notes, tightening_notes
from shellform.output.workshop.directions import edge_away, fixing_note, rods_away
from shellform.output.workshop.setting_out import elevations, support_plan
from shellform.site.measurements import read_places
from shellform.structure.elements.sections import Material, Rectangle
from shellform.structure.elements.state import at_rest, moved


@pytest.fixture(scope="module")
def read(built, tmp_path_factory):
    """All tables as written to CSV: a list of rows by name."""
    folder = tmp_path_factory.mktemp("schedules")
    tables.write_tables(folder, schedules.all_tables(built, nesting.cut(built.grid, stock=0.8)))
    found = {}
    for path in folder.glob("*.csv"):
        with path.open(encoding="utf-8", newline="") as file:
            found[path.stem] = list(csv.DictReader(file))
    found["folder"] = folder
    return found


def test_the_cut_list_has_every_rod_with_its_length_and_marks(read, net):
    rows = read["rods"]
    assert [row["rod"] for row in rows] == [
        f"{rod.direction.upper()}{k}" for k, rod in enumerate(net.grid.rods)
    ]
    assert sum(float(row["length [m]"]) for row in rows) == pytest.approx(
        sum(rod.length for rod in net.grid.rods), abs=1e-4
    )
    for row, rod in zip(rows, net.grid.rods, strict=True):
        marks = [float(mark) for mark in row["marks from the first end [mm]"].split()]
        assert marks == pytest.approx((1e3 * rod.marks).tolist(), abs=5.1e-2)
        assert row["crossing numbers"].split() == [str(k) for k in rod.crossings]
        assert row["section"] == "⌀ 2 mm"
        assert row["mass [kg]"] == ""  # the density isn't known


def test_each_crossing_is_marked_once_on_both_rods_that_cross_there(read, net):
    rows = read["marks"]
    assert len(rows) == 2 * len(net.grid.lattice)
    pairs = {(row["rod"], row["crosses rod"]) for row in rows}
    assert all((b, a) in pairs for a, b in pairs)
    for row in rows:
        rod, other = (net.grid.rods[int(row[each][1:])] for each in ("rod", "crosses rod"))
        assert {rod.direction, other.direction} == {"u", "v"}
        assert int(row["crossing"]) in other.crossings
        place = rod.nodes[rod.at[int(row["mark"]) - 1]]
        along = np.linalg.norm(net.grid.flat[place] - net.grid.flat[rod.nodes[0]])
        assert float(row["from the first end [m]"]) == pytest.approx(along, abs=1e-6)
        assert place in net.grid.crossing_nodes[int(row["crossing"])]


def test_masses_are_density_times_section_times_length(built):
    rod = sf.Rod.round(young=40e9, radius=0.001, strength=255e6, density=1900.0)
    heavy = replace(built, shell=replace(built.shell, rod=rod))
    found = schedules.rods(heavy, nesting.cut(built.grid)).column("mass [kg]")
    total = 1900.0 * np.pi * 0.001**2 * sum(one.length for one in built.grid.rods)
    assert sum(found) == pytest.approx(total)


def covered(cutting, grid):
    """The stretches of each rod that bars yield, from its first end on."""
    found = {}
    for bar in cutting.bars:
        used = sum(piece.length for piece in bar.pieces) + cutting.kerf * (len(bar.pieces) - 1)
        assert used <= cutting.stock + 1e-7
        assert bar.offcut == pytest.approx(max(0.0, cutting.stock - used - cutting.kerf), abs=1e-7)
        for piece in bar.pieces:
            found.setdefault(piece.rod, []).append((piece.start, piece.length, piece.part, piece.parts))
    assert sorted(found) == list(range(len(grid.rods)))
    for number, pieces in found.items():
        at = 0.0
        for part, (start, length, said, parts) in enumerate(sorted(pieces), 1):
            assert start == pytest.approx(at, abs=1e-9)
            assert (said, parts) == (part, len(pieces))
            at += length
        assert at == pytest.approx(grid.rods[number].length)
    return found


@settings(max_examples=30, deadline=None)
@given(st.floats(0.12, 3.0), st.floats(0.0, 0.02))
def test_bars_yield_every_rod_whole_whatever_the_stock_and_the_saw(net, stock, kerf):
    cutting = nesting.cut(net.grid, stock=stock, kerf=kerf)
    found = covered(cutting, net.grid)
    assert len(cutting.bars) >= cutting.least
    assert cutting.spliced == tuple(k for k, rod in enumerate(net.grid.rods) if rod.length > stock + 1e-9)
    for number in cutting.spliced:
        marks = net.grid.rods[number].marks
        for start, *_ in sorted(found[number])[1:]:
            assert np.abs(marks - start).min() > 0.4 * net.spacing


def test_as_many_bars_are_bought_as_must_be_where_that_is_known():
    grid = lattice_grid(
        np.array([(i, j) for i in range(4) for j in range(5)]), spacing=(1.0, 1.0), gap=0.01, elements=1
    )
    # u rods of 3 m (5), v rods of 4 m (4): bars of 7 m take one of each, and the fifth u rod stands alone.
    cutting = nesting.cut(grid, stock=7.0, kerf=0.0)
    assert (len(cutting.bars), cutting.least) == (5, 5)
    assert cutting.waste == pytest.approx(1.0 - 31.0 / 35.0)
    assert (
        len(nesting.cut(grid, stock=7.0, kerf=0.001).bars) == 5 + 2
    )  # with a saw cut no two of a 3 and a 4 fit, but two of 3 do
    # Two pieces need one cut between them: the bar's end is the second one's.
    assert len(nesting.cut(grid, stock=7.001, kerf=0.001).bars) == 5


def test_bars_are_filled_as_full_as_can_be_where_the_library_buys_too_many():
    # Longest first puts 4 and 4 together and needs three bars of 10; 4 + 3 + 3 twice needs two.
    needed = dict(enumerate([4.0, 4.0, 3.0, 3.0, 3.0, 3.0]))
    assert len(binpacking.to_constant_volume(needed, 10.0)) == 3
    packed = nesting._fullest(needed, 10.0)
    assert sorted(sorted(needed[k] for k in bar) for bar in packed) == [[3.0, 3.0, 4.0], [3.0, 3.0, 4.0]]
    assert sorted(k for bar in packed for k in bar) == list(needed)
    assert nesting._least(list(needed.values()), 10.0) == 2


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from([1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]), min_size=1, max_size=7))
def test_no_packing_at_all_needs_fewer_bars_than_the_bound(sizes):
    def best(left, bars):
        if not left:
            return len(bars)
        one, *others = left
        tried = [
            best(others, [*bars[:k], bar - one, *bars[k + 1 :]]) for k, bar in enumerate(bars) if bar >= one
        ]
        return min([*tried, best(others, [*bars, 8.0 - one])])

    fewest = best(sizes, [])
    assert nesting._least(sizes, 8.0) <= fewest <= len(nesting._fullest(dict(enumerate(sizes)), 8.0))


def test_splicing_is_said_in_the_list_and_neighbours_are_divided_from_opposite_ends():
    grid = lattice_grid(
        np.array([(i, j) for i in range(8) for j in range(3)]), spacing=(1.0, 1.0), gap=0.01, elements=1
    )
    cutting = nesting.cut(grid, stock=5.0, kerf=0.0)
    starts = [
        sorted(start for start, *_ in pieces)[1]
        for rod, pieces in sorted(covered(cutting, grid).items())
        if rod < 3
    ]
    assert starts == [4.5, 2.5, 4.5]
    (told, warned) = schedules.cutting_notes(cutting, schedules.rod_names(grid))
    assert "bars of 5 m" in told
    assert "3 rods are longer than the stock and must be SPLICED" in warned
    assert "U0 to U2" in warned


@pytest.mark.parametrize(
    ("stock", "kerf", "word"),
    [
        (0.05, 0.0, "can't be spliced"),
        (-1.0, 0.0, "rod.stock_length"),
        (6000.0, 0.003, "rod.stock_length.*metres as they are sold"),
        (1.0, 1.0, "rod.kerf"),
        (6.0, 3.0, "rod.kerf.*a saw cut's width in metres"),
    ],
)
def test_stock_that_can_not_be_used_is_refused(net, stock, kerf, word):
    with pytest.raises(InputError, match=word):
        nesting.cut(net.grid, stock=stock, kerf=kerf)


def test_the_cable_schedule_gives_lengths_and_forces_of_the_states(read, built):
    rows, ties = read["cables"], built.shell.cables(built.design)
    assert len(rows) == built.design.present.sum()
    for name, head in [("none", "erected"), ("design", "design"), ("additional", "additional")]:
        state = built.states[name]
        assert [float(row[f"{head}: force [N]"]) for row in rows] == pytest.approx(
            ties.tension(state).tolist(), abs=1e-6
        )
        assert [float(row[f"{head}: clear length [m]"]) for row in rows] == pytest.approx(
            ties.lengths(state).tolist(), abs=1e-6
        )
    for row in rows:
        ends = [int(row["from crossing"]), int(row["to crossing"])]
        lattice = built.grid.lattice[ends]
        assert np.abs(lattice[1] - lattice[0]).tolist() == [1, 1]  # a diagonal
        apart = np.linalg.norm(np.subtract(*built.shell.target.positions[built.grid.crossing_nodes[ends, 0]]))
        assert float(row["design: clear length [m]"]) == pytest.approx(apart, abs=1e-6)


def test_stages_of_the_pour_come_between_the_erected_and_the_poured_grid(built):
    poured = replace(built, states={**built.states, "pour 1": built.hung, "pour 2": built.hung})
    heads = [head for head in schedules.cables(poured).columns if head.endswith("force [N]")]
    assert [head.partition(":")[0] for head in heads] == [
        "erected",
        "pour 1",
        "pour 2",
        "design",
        "additional",
    ]


def test_turnbuckles_reach_from_the_length_hung_in_to_the_rest_length(read):
    for row in read["cables"]:
        rest, hung = float(row["rest length [m]"]), float(row["hung in at [m]"])
        assert float(row["turnbuckle shortest [m]"]) == pytest.approx(0.98 * min(rest, hung), abs=2e-6)
        assert float(row["turnbuckle longest [m]"]) == pytest.approx(1.02 * max(rest, hung), abs=2e-6)


def test_the_cable_schedule_tells_the_largest_force_at_each_stage_and_what_is_above_the_limit():
    pulls = {"erected": np.array([20.79, 0.0, 3.0]), "design": np.array([19.8, 7.0, 20.9])}
    assert force_notes(pulls, "erected", 20.0) == (
        "Largest force: erected 20.8 N (C0), design 20.9 N (C2). The limit is 20 N (cable.force_max).",
        "More than that: C0 (erected), C2 (design).",
        "Slack before any load: C1.",
    )
    assert len(force_notes(pulls, "erected", 20.9)) == 2
    assert force_notes(pulls, "erected", None)[0] == "Largest force: erected 20.8 N (C0), design 20.9 N (C2)."
    assert force_notes({"erected": np.zeros(0)}, "erected", 20.0) == (), "no cables"


def test_cables_are_to_be_tightened_to_their_force_where_one_pulls_before_any_load():
    (told,) = tightening_notes(np.array([0.0, 3.0]))
    assert told.startswith("Tighten a cable to its force before any load")
    assert tightening_notes(np.zeros(2)) == tightening_notes(np.zeros(0)) == ()


def test_the_cable_schedule_of_a_design_has_these_notes(built):
    notes = schedules.cables(replace(built, force_limit=1e-3)).notes
    assert any(note.startswith("More than that: C") for note in notes)
    assert any(note.startswith("Tighten a cable to its force") for note in notes)


def test_cables_are_tightened_from_the_supports_to_the_crown(read, built):
    rows = sorted(read["cables"], key=lambda row: int(row["tensioning order"]))
    assert [int(row["tensioning order"]) for row in rows] == list(range(1, len(rows) + 1))
    rounds = [int(row["tensioning round"]) for row in rows]
    assert rounds == sorted(rounds)
    height = built.shell.net.crossings[:, 2]
    mean = [
        np.mean([height[int(row["from crossing"])] for row in rows if int(row["tensioning round"]) == k])
        for k in (1, max(rounds))
    ]
    assert mean[0] < mean[1]


def test_a_cable_s_round_is_how_many_crossings_it_lies_from_the_nearest_end_of_a_rod(built):
    grid, table = built.grid, schedules.cables(built)
    near = {}
    for rod in grid.rods:
        for k, crossing in enumerate(rod.crossings.tolist()):
            away = min(k, len(rod.crossings) - 1 - k)
            near[crossing] = min(near.get(crossing, away), away)
    ends = zip(table.column("from crossing"), table.column("to crossing"), strict=True)
    own = [min(near[int(a)], near[int(b)]) for a, b in ends]
    ranks = {step: k for k, step in enumerate(sorted(set(own)), 1)}
    assert len(ranks) > 2
    assert [ranks[step] for step in own] == [int(each) for each in table.column("tensioning round")]


def test_within_a_round_cables_stand_as_they_go_round_the_middle_of_the_plan_wherever_it_lies(built):
    shell, order = built.shell, schedules.tension_order(built.shell, built.design)
    turns = schedules.rounds(shell, built.design)[order]
    away = shell.target.positions[shell.cable_ends[built.design.present]].mean(axis=1)
    away = (away - shell.net.crossings.mean(axis=0))[order]
    for turn in range(1, turns.max() + 1):
        angles = np.arctan2(away[turns == turn, 1], away[turns == turn, 0])
        assert (np.diff(angles) >= 0.0).all()
    far = replace(shell.target, positions=shell.target.positions + np.array([30.0, -20.0, 0.0]))
    moved = replace(shell, net=replace(shell.net, target=far))
    np.testing.assert_array_equal(schedules.tension_order(moved, built.design), order)


def test_supports_and_survey_targets_stand_where_the_net_has_them(read, built):
    net = built.shell.net
    for number, row in enumerate(read["supports"]):
        assert [float(row[f"{axis} [m]"]) for axis in "xyz"] == pytest.approx(
            net.target.positions[net.supports[number]].tolist(), abs=1e-6
        )
        rod = net.grid.rods[int(row["rod"][1:])]
        assert rod.nodes[0 if row["end"] == "first" else -1] == net.supports[number]
        assert float(row["rise of the rod [rad]"]) > 0.0  # every rod of the vault goes up from its foot
    assert len(read["survey"]) == len(net.grid.lattice)
    upper = net.target.positions[net.grid.crossing_nodes[:, 1]]
    for k, row in enumerate(read["survey"]):
        assert [float(row[f"target: {axis} [m]"]) for axis in "xyz"] == pytest.approx(
            upper[k].tolist(), abs=1e-6
        )
        assert float(row["design: off the target [m]"]) == pytest.approx(0.0, abs=1e-6)
        assert float(row["erected: z [m]"]) == pytest.approx(1.01 * upper[k, 2], abs=1e-6)
        assert float(row["additional: off the target [m]"]) == pytest.approx(
            0.02 * abs(upper[k, 2]), abs=1e-6
        )


def test_a_survey_that_finds_each_crossing_where_the_schedule_expects_it_finds_nothing_off(
    built, read, tmp_path
):
    axes = [f"erected: {axis} [m]" for axis in "xyz"]
    lines = [",".join(row[each] for each in ("crossing", *axes)) for row in read["survey"]]
    file = tmp_path / "survey.csv"
    file.write_text("crossing,x,y,z\n" + "\n".join(lines))
    nodes, places = read_places(file, built.shell)
    np.testing.assert_allclose(places, built.states["none"].positions[nodes], atol=1e-6)


def test_supports_are_pressed_on_with_all_of_the_load_also_what_stands_on_them(shell):
    load = 0.3 * shell.point_load(6.9, every=2)
    load[shell.net.supports, 2] = -0.1
    loads = {"none": np.zeros_like(load), "design": load}
    found = sf.follow(shell, shell.design(), loads)
    built = schedules.Built(
        shell,
        shell.design(),
        {name: each.equilibrium.state for name, each in found.items()},
        loads=loads,
    )
    table = schedules.supports(built)
    for name, weight in (("erected", 0.0), ("design", float(load[:, 2].sum()))):
        total = [sum(table.column(f"{name}: on the support along {axis} [N]")) for axis in "xyz"]
        assert total == pytest.approx([0.0, 0.0, weight], abs=1e-4)
    held = reactions(shell, built.design, built.states["design"], load).supports
    assert table.column("design: on the support along z [N]") == pytest.approx([-s.force[2] for s in held])


def test_splices_are_told_with_the_moment_that_they_bear(built, net):
    cutting = nesting.cut(built.grid, stock=0.6)
    table = schedules.splices(built, cutting)
    assert len(table.rows) == sum(piece.part > 1 for bar in cutting.bars for piece in bar.pieces)
    (warning,) = table.notes
    assert "SPLICED" in warning
    stiffness = built.shell.rod.stiffness[2]
    first = np.concatenate([[0], np.cumsum([len(rod.nodes) - 1 for rod in net.grid.rods])])
    moments = table.column("design: bending moment [N m]")
    for name, at, before, after, moment in zip(
        *(table.column(head) for head in table.columns[:4]), moments, strict=True
    ):
        number = int(name[1:])
        rod = net.grid.rods[number]
        marks = rod.marks[[rod.crossings.tolist().index(before), rod.crossings.tolist().index(after)]]
        assert at == pytest.approx(marks.mean())
        # In the state on the target the moment is EI times the net's curvature, here at the splice's own
        # element and its neighbours.
        near = first[number] + int(np.searchsorted(rod.arc, at)) - 1
        around = stiffness * net.curvature[near - 1 : near + 2]
        assert around.min() * 0.99 <= moment <= around.max() * 1.01


def test_without_splices_their_list_says_so(built, tmp_path):
    tables.write_tables(tmp_path, [schedules.splices(built, nesting.cut(built.grid))])
    assert (tmp_path / "splices.csv").read_text(encoding="utf-8").count("\n") == 1
    assert "splices.csv\n- No rod is spliced.\n" in (tmp_path / "notes.txt").read_text(encoding="utf-8")
    assert load_workbook(tmp_path / "schedules.xlsx")["splices"]["A1"].value == "No rod is spliced."


def test_the_workbook_holds_the_same_tables(read, built):
    book = load_workbook(read["folder"] / "schedules.xlsx")
    wanted = schedules.all_tables(built, nesting.cut(built.grid, stock=0.8))
    assert book.sheetnames == [table.name for table in wanted]
    for table in wanted:
        rows = list(book[table.name].iter_rows(values_only=True))
        notes = len(table.notes)
        assert [row[0] for row in rows[:notes]] == list(table.notes)
        assert list(rows[notes]) == list(table.columns)
        for row, found in zip(table.rows, rows[notes + 1 :], strict=True):
            for value, cell in zip(row, found, strict=True):
                assert cell == (
                    pytest.approx(value, rel=1e-14)
                    if isinstance(value, float)
                    else None
                    if value == ""
                    else value
                )


def test_a_folder_that_can_not_be_written_to_is_named(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(InputError, match="can't be written"):
        tables.write_tables(tmp_path / "file", [tables.Table("a", ("x [m]",), ((1.0,),))])


def test_tables_and_states_that_do_not_fit_are_refused(built):
    with pytest.raises(InputError, match="row 1"):
        tables.Table("a", ("x",), ((1,), (1, 2)))
    with pytest.raises(InputError, match="is no column"):
        tables.Table("a", ("x",), ((1,),)).column("y")
    with pytest.raises(InputError, match="state without load"):
        replace(built, states={"design": built.hung})


def test_each_support_s_bearing_and_rise_are_those_of_its_rod_s_tangent_there(built):
    table, place = schedules.supports(built), built.shell.target.positions
    bearing, rise = (
        np.array(table.column(f"{name} of the rod [rad]"), dtype=float) for name in ("bearing", "rise")
    )
    feet = np.column_stack([table.column(f"{axis} [m]") for axis in "xyz"]).astype(float)
    leads = np.column_stack([np.cos(rise) * np.cos(bearing), np.cos(rise) * np.sin(bearing), np.sin(rise)])
    off, off_chord = [], []
    for name, foot, lead in zip(table.column("rod"), feet, leads, strict=True):
        nodes = place[built.grid.rods[int(name[1:])].nodes]
        nodes = nodes if np.allclose(nodes[0], foot) else nodes[::-1]
        arc = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(nodes, axis=0), axis=1)))
        tangent = np.array([np.polyfit(arc[:4], nodes[:4, axis], 3)[-2] for axis in range(3)])
        off.append(np.linalg.norm(lead - tangent / np.linalg.norm(tangent)))
        off_chord.append(np.linalg.norm(lead - (nodes[1] - nodes[0]) / arc[1]))
    assert max(off) < 0.4 * max(off_chord)
    assert (rise > 0.0).all()


def test_it_is_told_how_much_rods_turn_in_their_supports(built):
    net, target = built.shell.net, built.shell.target
    across = np.cross(rods_away(net, target)[int(net.supports[5])], [0.0, 0.0, 1.0])
    turn = np.zeros((len(target.positions), 6))
    turn[net.supports[5], 3:] = np.radians(3.0) * across / np.linalg.norm(across)
    told = replace(built, states={**built.states, "none": target, "design": moved(target, turn)})
    (note,) = [each for each in schedules.supports(told).notes if "turn in their supports" in each]
    assert "erected up to 0.0°" in note
    assert "design up to 3.0° (S5)" in note


def test_an_edge_beam_leaves_its_foot_along_the_parabola_through_its_first_nodes():
    along = np.array([0.0, 0.1, 0.25, 0.3])
    curve = np.column_stack([along, 0.2 * along, 0.5 * along - 0.8 * along**2])
    lead = edge_away(curve)
    tangent = np.array([1.0, 0.2, 0.5]) / np.linalg.norm([1.0, 0.2, 0.5])
    assert np.linalg.norm(lead - tangent) < 0.15 * np.linalg.norm(edge_away(curve[:2]) - tangent)
    assert edge_away(curve[:2]) == pytest.approx(curve[1] / np.linalg.norm(curve[1]))


def test_each_piece_begins_a_saw_cut_after_the_one_before_it(built):
    cutting = nesting.cut(built.grid, stock=3.0, kerf=0.004)
    table = schedules.bars(built, cutting)
    rows = list(zip(*(table.column(head) for head in table.columns), strict=True))
    beside = [(a, b) for a, b in itertools.pairwise(rows) if a[0] == b[0]]
    assert len(beside) > 5
    for (*_, length, at, _, _), following in beside:
        assert following[5] == pytest.approx(at + length + 0.004, abs=1e-9)
    assert all(row[5] == 0.0 for row in rows if row[1] == 1)
    pieces = [piece for bar in cutting.bars for piece in bar.pieces]
    assert {piece.parts for piece in pieces} == {1}
    assert all(row[3] == "" for row in rows)
    spliced = nesting.cut(built.grid, stock=0.5)
    told = [str(row[3]) for row in schedules.bars(built, spliced).rows]
    pieces = [piece for bar in spliced.bars for piece in bar.pieces]
    assert told == [f"{each.part} of {each.parts}" if each.parts > 1 else "" for each in pieces]
    assert len(set(told)) > 2
    last = [row for row in rows if row[7] is not None]
    assert len(last) == len(cutting.bars)
    for *_, length, at, _, offcut in last:
        assert offcut == pytest.approx(max(0.0, 3.0 - at - length - 0.004), abs=1e-9)


def test_turnbuckles_reach_from_the_length_hung_in_to_the_rest_length_and_two_percent_beyond(built):
    longer = np.where(np.arange(len(built.design.present)) % 4 < 2, 1.0, 1.06)  # slack as they are hung in
    built = replace(built, design=replace(built.design, rest_length=longer * built.design.rest_length))
    table, shell = schedules.cables(built), built.shell
    ends = shell.cable_ends[built.design.present]
    a, b = (built.hung.positions[ends[:, side]] for side in range(2))
    hung = np.sqrt(((b - a) ** 2).sum(axis=1))
    wanted = np.linalg.norm(shell.target.positions[ends[:, 0]] - shell.target.positions[ends[:, 1]], axis=1)
    assert np.abs(hung - wanted).max() > 1e-4, "else either could stand in the table"
    rest = built.design.rest_length[built.design.present]
    assert 0 < (rest < hung).sum() < len(rest)
    told = {name: np.array(table.column(name), dtype=float) for name in table.columns if name.endswith("[m]")}
    np.testing.assert_allclose(told["hung in at [m]"], hung)
    np.testing.assert_allclose(told["turnbuckle shortest [m]"], 0.98 * np.minimum(rest, hung))
    np.testing.assert_allclose(told["turnbuckle longest [m]"], 1.02 * np.maximum(rest, hung))


def test_the_files_speak_of_millimetres_and_degrees(built, tmp_path):
    cutting = nesting.cut(built.grid, stock=0.8)
    schedules.write_schedules(tmp_path, built, cutting)
    for table in schedules.all_tables(built, cutting):
        text = (tmp_path / f"{table.name}.csv").read_text(encoding="utf-8")
        heads, *rows = csv.reader(text.splitlines())
        assert not [head for head in heads if "[m]" in head or "[rad]" in head]
        for head, other in zip(table.columns, heads, strict=True):
            factor = 1e3 if "[m]" in head else 180.0 / np.pi if "[rad]" in head else 1.0
            for value, row in zip(table.column(head), rows, strict=True):
                cell = row[heads.index(other)]
                assert not isinstance(value, float) or float(cell) == pytest.approx(
                    factor * value, abs=5.1e-4
                )


def test_coordinates_that_count_from_a_survey_s_origin_say_so_wherever_they_are_listed(built):
    moved = replace(built, origin=(430000.0, 81000.25, 400.0))
    told = "Coordinates count from (430000, 81000.25, 400) m: add it for those of the survey."
    for make in (schedules.supports, schedules.survey, support_plan, elevations):
        assert told in make(moved).notes
        assert not any("count from" in note for note in make(built).notes)
    assert "of the surface's file" in elevations(built).notes[0]
    assert "file" not in elevations(moved).notes[0]


def test_a_shoe_is_three_times_as_wide_as_the_rod_s_larger_side():
    """Of a lath of 20 × 60 mm: 180 mm."""
    asked = []
    rod = SimpleNamespace(
        resized=lambda radius: (
            asked.append(radius) or SimpleNamespace(section=SimpleNamespace(fibres=(0.01, 0.03)))
        )
    )
    built = SimpleNamespace(shell=SimpleNamespace(rod=rod), design=SimpleNamespace(radius=0.04))
    assert schedules.shoe_width(built) == pytest.approx(0.18)
    assert asked == [0.04], "the design's, not the first one's"


def test_supports_lead_along_the_tangents_of_rods_and_of_edge_beams_at_their_feet(monkeypatch):
    """A rod U0 of five nodes and an edge beam E0 of five others, of which three stand on the ground; the
    first of the beam's feet is the rod's second end too, and is called after the rod."""
    place = np.array(
        [
            [1.0, 2.0, 0.5], [1.0, 5.0, 4.5], [3.0, 6.0, 6.0], [9.0, 6.0, 3.0], [12.0, 2.0, 3.0],
            [7.0, 8.0, 5.0], [5.0, 9.0, 7.0], [3.0, 2.0, 2.0], [-1.0, -1.0, 1.0],
        ]
    )  # fmt: skip
    rod = SimpleNamespace(direction="u", nodes=np.arange(5))
    net = SimpleNamespace(
        grid=SimpleNamespace(rods=(rod,), flat=place),
        edges=(SimpleNamespace(nodes=np.array([4, 5, 6, 7, 8])),),
        supports=np.array([8, 0, 4]),
        target=at_rest(place),
    )
    built = SimpleNamespace(
        grid=net.grid,
        shell=SimpleNamespace(net=net, target=net.target),
        states={"none": net.target},
        origin_notes=("from there",),
    )
    push = np.outer(np.arange(9.0), [1.0, -2.0, 3.0])
    monkeypatch.setattr(schedules, "support_forces", lambda _: {"none": push, "design": 10.0 * push})
    monkeypatch.setattr(schedules, "clashing_supports", lambda _: [(0, 1, 0.0125), (1, 2, 0.02)])
    monkeypatch.setattr(schedules, "shoe_width", lambda _: 0.03)
    table = schedules.supports(built)
    beam, first, second = table.rows
    assert beam[:6] == ("S0", "E0", "second", -1.0, -1.0, 1.0)
    # the parabola's: its second chord is √3 times as long as the first one, (4, 3, 1)
    k = 1.0 + np.sqrt(3.0)
    x, y, z = k * np.array([4.0, 3.0, 1.0]) - np.array([6.0, 10.0, 6.0]) / k
    assert beam[6:9] == (pytest.approx(np.arctan2(y, x)), pytest.approx(np.arctan2(z, np.hypot(x, y))), "S1")
    assert beam[9:] == (8.0, -16.0, 24.0, 80.0, -160.0, 240.0)
    assert first[:6] == ("S1", "U0", "first", 1.0, 2.0, 0.5)
    assert first[6:9] == (pytest.approx(np.pi / 2.0), pytest.approx(np.arctan2(4.0, 3.0)), "S0, S2")
    assert first[9:] == (0.0,) * 6
    assert second[:6] == ("S2", "U0, E0", "second, first", 12.0, 2.0, 3.0)
    assert second[6:9] == (pytest.approx(np.arctan2(4.0, -3.0)), pytest.approx(0.0), "S1")
    assert second[9:] == (4.0, -8.0, 12.0, 40.0, -80.0, 120.0)
    assert table.columns[9:] == tuple(
        f"{name}: on the support along {axis} [N]" for name in ("erected", "design") for axis in "xyz"
    )
    assert table.notes[3].startswith("Fix supports, and rods' ends to edge beams, last, where these ends lie")
    assert table.notes[4] == "From these directions rods turn in their supports: erected up to 0.0° (S1)."
    assert "nearer than 30 mm" in table.notes[5]
    assert table.notes[5].endswith("clash: S0 and S1, 12.5 mm, S1 and S2, 20.0 mm.")
    assert table.notes[6:] == ("from there",)


@pytest.mark.parametrize(
    ("supports", "edges", "told"),
    [
        ([0], (), "Fix supports last, where rods' ends lie"),
        ([0], ("a beam",), "Fix supports, and rods' ends to edge beams, last, where these ends lie"),
        ([1], ("a beam",), "Fix edge beams' feet, and rods' ends to the beams, last, where they lie"),
        ([1], (), ""),
    ],
)
def test_supports_are_to_be_fixed_last_where_a_rod_ends_on_one(supports, edges, told):
    place = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    rod = SimpleNamespace(nodes=np.arange(3), direction="u")
    net = SimpleNamespace(
        grid=SimpleNamespace(rods=(rod,), flat=place),
        edges=edges,
        supports=np.array(supports),
        target=at_rest(place),
    )
    assert [note[: len(told)] for note in fixing_note(net)] == ([told] if told else [])


def test_an_edge_beam_s_first_foot_leads_along_the_beam(monkeypatch):
    place = np.array([[1.0, 1.0, 0.0], [4.0, -3.0, 5.0], [0.0, 0.0, 0.0], [2.0, 2.0, 2.0]])
    net = SimpleNamespace(
        grid=SimpleNamespace(rods=(), flat=place),
        edges=(SimpleNamespace(nodes=np.arange(4)),),
        supports=np.array([0]),
        target=at_rest(place),
    )
    built = SimpleNamespace(
        grid=net.grid,
        shell=SimpleNamespace(net=net, target=net.target),
        states={"none": net.target},
        origin_notes=(),
    )
    monkeypatch.setattr(schedules, "support_forces", lambda _: {"none": np.ones((4, 3))})
    monkeypatch.setattr(schedules, "clashing_supports", lambda _: [])
    monkeypatch.setattr(schedules, "shoe_width", lambda _: 0.03)
    table = schedules.supports(built)
    (row,) = table.rows
    assert row == (
        "S0",
        "E0",
        "first",
        1.0,
        1.0,
        0.0,
        pytest.approx(np.arctan2(-7.5, 6.5)),  # 2 (3, -4, 5) - (-1, -1, 0) / 2, the two chords alike
        pytest.approx(np.arctan2(10.0, np.hypot(6.5, 7.5))),
        "",
        1.0,
        1.0,
        1.0,
    )
    assert table.notes[4].endswith("clash: none.")


@pytest.mark.parametrize("density", [460.0, 0.0])
@pytest.mark.parametrize("layers", [1, 2])
def test_a_rod_s_line_tells_its_mass_its_bars_and_its_parts(density, layers):
    """U0 of 3 m whole, V1 of 7 m from two bars, of laths of 50 × 35 mm: 0.805 kg/m each."""
    lath = Rectangle(0.050, 0.035, Material(12e9, 0.75e9, density, 24e6))
    section = TwoLayers(lath) if layers == 2 else lath
    rods = (
        SimpleNamespace(direction="u", length=3.0, marks=np.array([0.25, 2.5]), crossings=np.array([4, 1])),
        SimpleNamespace(
            direction="v", length=7.0, marks=np.array([1.0, 3.0, 6.5]), crossings=np.array([0, 1, 2])
        ),
    )
    rod = SimpleNamespace(resized=lambda radius: SimpleNamespace(section=section) if radius == 0.02 else None)
    built = SimpleNamespace(
        shell=SimpleNamespace(rod=rod, net=None, edge=None),
        design=SimpleNamespace(radius=0.02),
        grid=SimpleNamespace(rods=rods),
    )
    pieces = [
        [nesting.Piece(1, 2, 2, 5.0, 2.0), nesting.Piece(0, 1, 1, 0.0, 3.0)],
        [nesting.Piece(1, 1, 2, 0.0, 5.0)],
    ]
    if layers == 2:
        pieces += [
            [nesting.Piece(1, 1, 2, 0.0, 2.0, 2), nesting.Piece(0, 1, 1, 0.0, 3.0, 2)],
            [nesting.Piece(1, 2, 2, 2.0, 5.0, 2)],
        ]
    cutting = nesting.Cutting(6.0, 0.003, tuple(nesting.Bar(tuple(each), 1.0) for each in pieces), 2)
    table = schedules.rods(built, cutting)
    whole, spliced = table.rows
    assert (whole[:3], spliced[:3]) == (("U0", "u", 3.0), ("V1", "v", 7.0))
    assert (whole[4], spliced[4]) == (
        (None, None) if density == 0.0 else pytest.approx((layers * 2.415, layers * 5.635))
    )
    assert whole[5:] == (2, "250.0 2500.0", "4 1", "B1" if layers == 1 else "B1, B3", "")
    parts = (
        "part 1: B2, part 2: B1"
        if layers == 1
        else "lath 1, part 1: B2, lath 1, part 2: B1, lath 2, part 1: B3, lath 2, part 2: B4"
    )
    assert spliced[5:] == (3, "1000.0 3000.0 6500.0", "0 1 2", parts, "spliced")
    told = [row[3] for row in schedules.bars(built, cutting).rows]
    if layers == 2:
        assert told == ["lath 1, 2 of 2", "", "lath 1, 1 of 2", "lath 2, 1 of 2", "", "lath 2, 2 of 2"]
    else:
        assert told == ["2 of 2", "", "1 of 2"]
    assert ("Each rod is two laths" in " ".join(table.notes)) == (layers == 2)
    assert ("No masses" in " ".join(table.notes)) == (density == 0.0)


def test_shear_blocks_are_listed_where_rods_have_two_layers(monkeypatch, built):
    cutting = nesting.cut(built.grid)
    names = ["rods", "bars", "splices", "marks", "cables", "supports", "survey"]
    assert [table.name for table in schedules.all_tables(built, cutting)] == names
    monkeypatch.setattr(schedules, "layers_of", lambda _: 2)
    assert [table.name for table in schedules.all_tables(built, cutting)] == [*names, "shear_blocks"]


def test_supports_clash_where_they_stand_nearer_than_a_shoe_is_wide(monkeypatch):
    feet = np.array([[5.0, 5.0, 5.0], [2.0, 1.0, 0.0], [2.0, 1.03, 0.04], [2.0, 1.0, 0.06], [0.0, 0.0, 0.0]])
    shell = SimpleNamespace(
        target=SimpleNamespace(positions=feet), net=SimpleNamespace(supports=np.array([4, 3, 1, 2]))
    )
    monkeypatch.setattr(schedules, "shoe_width", lambda _: 0.055)
    found = schedules.clashing_supports(SimpleNamespace(shell=shell))
    assert [pair[:2] for pair in found] == [(1, 3), (2, 3)], "by their numbers, not by their nodes"
    assert [apart for *_, apart in found] == pytest.approx([0.0013**0.5, 0.05])
    shell.net.supports = np.array([], dtype=int)
    assert schedules.clashing_supports(SimpleNamespace(shell=shell)) == []


@pytest.mark.parametrize(
    ("name", "wrong"), [("adjustment", -0.02), ("force_limit", 0.0), ("force_limit", np.nan)]
)
def test_a_turnbuckle_s_range_or_a_limit_that_is_none_is_refused(built, name, wrong):
    with pytest.raises(InputError, match=f"{name}: must be .*or leave it out"):
        replace(built, **{name: wrong})
