"""Where curves and limits lie on the page's charts, whose frame is 396 wide and 218 high, from 52 and 230
on."""

import re

import pytest

from shellform.output.page.charts import _runs, _ticks, line_chart


def curves_of(chart):
    found = {}
    for kind, points in re.findall(r'<polyline class="([^"]*)" points="([^"]*)"', chart.svg):
        found.setdefault(kind, []).append([tuple(map(float, each.split(","))) for each in points.split()])
    return found


def test_curves_lie_to_scale_under_a_limit_that_is_shaded_from_there_upwards():
    """The axis ends a quarter of the limit above it, at 12.5."""
    values = {"a": [0.0, 5.0, 8.0, 8.0], "b": [float("nan"), 2.0, 12.0, 5.0]}
    chart = line_chart("Misfit", [0, 10, 20, 20], values, limit=10.0)
    assert curves_of(chart) == {
        "series-1 main": [[(52.0, 230.0), (250.0, 142.8), (448.0, 90.5), (448.0, 90.5)]],
        "series-2": [[(250.0, 195.1), (448.0, 20.7), (448.0, 142.8)]],
    }
    assert '<rect class="refused" x="52" y="12.0" width="396" height="43.6"/>' in chart.svg
    assert re.findall(r'class="grid" x1="52" x2="448" y1="([^"]*)"', chart.svg) == ["230.0", "142.8", "55.6"]
    assert re.findall(r'text-anchor="end">([^<]*)<', chart.svg) == ["0", "5", "10"]
    assert re.findall(r'<text x="([0-9.]*)" y="248" text-anchor="middle">([^<]*)<', chart.svg) == [
        ("52.0", "0"), ("151.0", "5"), ("250.0", "10"), ("349.0", "15"), ("448.0", "20"),
    ]  # fmt: skip
    assert chart.legend == [("series-1 main", "a"), ("series-2", "b")]


def test_values_beyond_the_axis_are_cut_at_its_ends_and_gaps_part_a_curve():
    chart = line_chart("Objective", [0, 1, 2, 3, 4], {"a": [-9.0, 3.0, float("inf"), 50.0, -2.0]}, least=-2.0, most=8.0, main=False)  # fmt: skip
    assert curves_of(chart) == {
        "series-2": [[(52.0, 230.0), (151.0, 121.0)], [(349.0, 12.0), (448.0, 230.0)]]
    }
    assert "refused" not in chart.svg


def test_a_limit_below_nothing_and_one_beyond_the_axis_are_drawn_as_they_lie():
    below = line_chart("Pull", [0, 1], {"a": [1.0, 2.0]}, limit=-4.0)
    assert curves_of(below)["series-1 main"] == [[(52.0, 48.3), (448.0, 12.0)]]
    assert 'class="refused" x="52" y="12.0" width="396" height="218.0"' in below.svg
    beyond = line_chart("Pull", [0, 1], {"a": [1.0, 2.0]}, limit=9.0, most=5.0)
    assert "refused" not in beyond.svg


def test_after_six_curves_colours_come_again_and_are_told_apart():
    chart = line_chart("Many", [0, 1], {str(k): [float(k), 1.0] for k in range(8)})
    assert [kind for kind, _ in chart.legend] == [
        "series-1 main", "series-2", "series-3", "series-4", "series-5", "series-6", "series-1 again", "series-2 again",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("low", "high", "ticks"),
    [
        (0.0, 12.5, [0.0, 5.0, 10.0]),
        (-3.0, 11.0, [0.0, 5.0, 10.0]),
        (-7.0, 3.0, [-6.0, -4.0, -2.0, 0.0, 2.0]),
        (0.0, 0.4, [0.0, 0.1, 0.2, 0.3, 0.4]),
        (0.0, 5.0, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]),
        (20.0, 5000.0, [1000.0, 2000.0, 3000.0, 4000.0, 5000.0]),
    ],
)
def test_ticks_are_round_and_about_five(low, high, ticks):
    assert _ticks(low, high) == pytest.approx(ticks)


def test_ticks_of_counts_are_whole():
    assert _ticks(0.0, 2.0, whole=True) == [0.0, 1.0, 2.0]
    assert _ticks(0.0, 2.0) == pytest.approx([0.0, 0.5, 1.0, 1.5, 2.0])
    assert _ticks(0.2, 0.25, whole=True) == [0.2]


def test_neighbouring_true_places_are_one_run():
    assert _runs([True, True, False, True, False, False, True, True]) == [[0, 1], [3], [6, 7]]


def test_an_axis_begins_where_values_do_whether_or_not_a_tick_is_there():
    """From -3 to 13.25, a quarter of 13 above the limit of 10; evaluations from 5 on."""
    chart = line_chart("Pull", [5, 10, 15], {"a": [-3.0, 10.0, 0.0]}, limit=10.0)
    height = 218.0 / 16.25
    assert curves_of(chart)["series-1 main"] == [
        [(52.0, 230.0), (250.0, round(230.0 - 13.0 * height, 1)), (448.0, round(230.0 - 3.0 * height, 1))]
    ]
    assert re.findall(r'<text x="([0-9.]*)" y="248" text-anchor="middle">([^<]*)<', chart.svg) == [
        ("91.6", "6"), ("170.8", "8"), ("250.0", "10"), ("329.2", "12"), ("408.4", "14"),
    ]  # fmt: skip


def test_one_evaluation_and_values_of_nothing_have_a_place_too():
    assert curves_of(line_chart("Misfit", [7], {"a": [3.0]}))["series-1 main"] == [[(52.0, 12.0)]]
    assert curves_of(line_chart("Misfit", [0, 1], {"a": [0.0, 0.0]}))["series-1 main"] == [
        [(52.0, 230.0), (448.0, 230.0)]
    ]
