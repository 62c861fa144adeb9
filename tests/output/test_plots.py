"""Convergence plots: what is drawn, what is refused, and that the same history gives the same file."""

import csv
import io

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.output.pictures import plots

ROWS = """evaluation,accepted,objective,term.misfit,term.cable_force,constraint.cable_force,constraint.misfit.additional,cables
0,1,1.0,0.7,0.3,-0.7,23.4,293
1,0,9.0,8.7,0.3,-0.6,99.0,280
2,1,0.6,0.35,0.25,-0.4,0.0,130
"""
TERMS = {"misfit": [0.7, 0.35], "cable_force": [0.3, 0.25]}


def rows():
    return list(csv.DictReader(io.StringIO(ROWS)))


def drawn(monkeypatch):
    """The figures that are saved, instead of the files."""
    figures = []
    monkeypatch.setattr(plots, "_save", lambda figure, path: figures.append(figure))
    return figures


def test_rows_and_columns_of_a_history_read_alike_and_leave_out_rejected_designs():
    from_rows = plots.read_history(rows())
    from_columns = plots.read_history({name: [row[name] for row in rows()] for name in rows()[0]})
    assert from_rows == from_columns
    assert from_rows.evaluation == [0.0, 2.0]
    assert from_rows.terms == TERMS
    assert from_rows.constraints == {"cable_force": [-0.7, -0.4], "misfit.additional": [23.4, 0.0]}
    assert from_rows.cables == [293.0, 130.0]


def test_a_history_may_count_iterations_and_do_without_cables():
    read = plots.read_history({"iteration": [0, 1], "term.misfit": [1.0, 0.5]})
    assert read.evaluation == [0.0, 1.0]
    assert read.cables is None


def test_the_objective_is_drawn_as_the_sum_of_its_terms(monkeypatch):
    figures = drawn(monkeypatch)
    plots.objective_history("a.png", [0, 2], TERMS, cables=[293, 130])
    axes, beside = figures[0].axes
    lines = {line.get_label(): line.get_ydata() for line in axes.get_lines()}
    np.testing.assert_allclose(lines["objective"], [1.0, 0.6])
    np.testing.assert_allclose(lines["cable force"], TERMS["cable_force"])
    np.testing.assert_allclose(beside.get_lines()[0].get_ydata(), [293, 130])
    assert axes.get_ylim()[0] == 0.0


def test_more_lines_than_colours_are_all_drawn_and_all_differ(monkeypatch):
    figures = drawn(monkeypatch)
    plots.constraint_history("a.png", [0, 1], {f"c{k}": [-0.1 * k, 0.0] for k in range(14)})
    lines = [line for line in figures[0].axes[0].get_lines() if line.get_label().startswith("c")]
    assert len({(line.get_color(), line.get_linestyle()) for line in lines}) == 14


@pytest.mark.parametrize(("start", "scale"), [(23.4, "symlog"), (0.5, "linear"), (-0.5, "linear")])
def test_the_constraint_axis_is_logarithmic_only_where_the_range_is_large(monkeypatch, start, scale):
    figures = drawn(monkeypatch)
    plots.constraint_history("a.png", [0, 1], {"misfit": [start, 0.0]})
    axes = figures[0].axes[0]
    assert axes.get_yscale() == scale
    low, high = axes.get_ylim()
    assert low < min(start, 0.0)
    assert high > max(start, 0.0)


def test_designs_without_an_equilibrium_leave_a_gap(monkeypatch):
    figures = drawn(monkeypatch)
    plots.constraint_history("a.png", [0, 1, 2], {"misfit": [1.0, np.inf, 0.5]})
    assert np.isnan(figures[0].axes[0].get_lines()[0].get_ydata()).tolist() == [False, True, False]


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_the_ending_chooses_the_format_and_the_same_history_gives_the_same_bytes(tmp_path, ending, head):
    first, second = tmp_path / f"a.{ending}", tmp_path / f"b.{ending}"
    for path in (first, second):
        plots.constraint_history(path, [0, 2], {"misfit": [23.4, 0.0]})
    assert first.read_bytes().startswith(head)
    assert first.read_bytes() == second.read_bytes()
    assert sorted(path.name for path in tmp_path.iterdir()) == [first.name, second.name]


def test_no_global_state_of_matplotlib_is_touched(tmp_path):
    import matplotlib

    before = dict(matplotlib.rcParams)
    plots.objective_history(tmp_path / "a.svg", [0, 2], TERMS)
    assert dict(matplotlib.rcParams) == before


def test_other_endings_and_missing_folders_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"Use \.png, \.svg, \.pdf"):
        plots.objective_history(tmp_path / "a.bmp", [0, 2], TERMS)
    with pytest.raises(InputError, match="folder doesn't exist"):
        plots.objective_history(tmp_path / "none/a.png", [0, 2], TERMS)


def test_a_file_that_cannot_be_written_is_refused_and_leaves_nothing(tmp_path):
    (tmp_path / "a.png").mkdir()
    with pytest.raises(InputError, match="can't be written"):
        plots.objective_history(tmp_path / "a.png", [0, 2], TERMS)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_histories_that_cannot_be_drawn_are_refused(tmp_path):
    with pytest.raises(InputError, match="evaluation or iteration"):
        plots.read_history([])
    with pytest.raises(InputError, match="must be numbers"):
        plots.read_history({"evaluation": [0, 1], "term.misfit": ["a", "b"]})
    with pytest.raises(InputError, match="differ in length"):
        plots.read_history({"evaluation": [0, 1], "term.misfit": [1.0]})
    with pytest.raises(InputError, match="other columns"):
        plots.read_history([{"evaluation": 0}, {"iteration": 0}])
    with pytest.raises(InputError, match="differ in length"):
        plots.objective_history(tmp_path / "a.png", [0, 1], {"misfit": [1.0]})
    with pytest.raises(InputError, match="nothing to draw"):
        plots.constraint_history(tmp_path / "a.png", [0, 1], {})
