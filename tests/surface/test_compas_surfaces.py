"""NURBS surfaces in COMPAS' JSON."""

import json

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.surface.readers.reading import read_surface

U, V = np.linspace(0.0, 8.0, 5), np.linspace(0.0, 6.0, 4)


def written(file, *, turned=False, dtype="compas.geometry/NurbsSurface", **changed):
    """A vault over x, 2.5 m high and straight along y, 8 × 6 m, quadratic and linear; `turned` with rows
    along v."""
    height = [0.0, 1.0, 3.0, 1.0, 0.0]
    points = [[[x, y, z] for y in V] for x, z in zip(U, height, strict=True)]
    if turned:
        points = [list(row) for row in zip(*points, strict=True)]
    data = {
        "points": points,
        "weights": np.ones(np.shape(points)[:2]).tolist(),
        "knots_u": [0.0, 1.0, 2.0, 3.0],
        "mults_u": [3, 1, 1, 3],
        "degree_u": 2,
        "knots_v": [0.0, 1.0, 2.0, 3.0],
        "mults_v": [2, 1, 1, 2],
        "degree_v": 1,
        "is_periodic_u": False,
        "is_periodic_v": False,
    } | changed
    file.write_text(json.dumps({"dtype": dtype, "data": data, "guid": "1"}), encoding="utf-8")
    return file


def test_a_compas_nurbs_surface_is_read_whichever_way_its_rows_run(tmp_path):
    one = read_surface(written(tmp_path / "rhino.json"))
    other = read_surface(written(tmp_path / "occ.json", turned=True))
    assert not one.mended
    for surface in (one, other):
        np.testing.assert_allclose(surface.size, [8.0, 6.0, 2.5], atol=0.01)
    assert other.area == pytest.approx(one.area, rel=1e-3)


def test_its_unit_is_metres_or_what_is_stated(tmp_path):
    file = written(tmp_path / "a.json")
    np.testing.assert_allclose(
        read_surface(file, unit="ft").size, np.array([8.0, 6.0, 2.5]) * 0.3048, atol=0.01
    )


def test_knots_without_the_first_and_last_are_taken_too(tmp_path):
    whole = read_surface(written(tmp_path / "whole.json"))
    short = read_surface(written(tmp_path / "short.json", mults_u=[2, 1, 1, 2], mults_v=[1, 1, 1, 1]))
    assert short.area == pytest.approx(whole.area, rel=1e-6)


def test_it_is_told_where_both_ways_make_a_surface_and_not_the_same(tmp_path):
    square = [[[x, y, 0.3 * x * (8.0 - x)] for y in np.linspace(0.0, 6.0, 5)] for x in U]
    also = {"points": square, "weights": np.ones((5, 5)).tolist(), "degree_v": 2, "mults_v": [3, 1, 1, 3]}
    assert not read_surface(written(tmp_path / "same.json", **also)).mended
    other = read_surface(written(tmp_path / "other.json", **also | {"knots_v": [0.0, 1.0, 2.5, 3.0]}))
    assert any("rows of control points" in note for note in other.mended)


def test_several_are_one_surface_or_chosen_by_name(tmp_path):
    one = json.loads(written(tmp_path / "a.json").read_text())
    other = json.loads(written(tmp_path / "b.json").read_text())
    other["data"]["points"] = np.add(other["data"]["points"], [0.0, 6.0, 0.0]).tolist()
    file = tmp_path / "both.json"
    file.write_text(json.dumps([one | {"name": "south"}, other | {"name": "north"}]))
    np.testing.assert_allclose(read_surface(file).size, [8.0, 12.0, 2.5], atol=0.01)
    np.testing.assert_allclose(read_surface(file, name="north").size, [8.0, 6.0, 2.5], atol=0.01)
    with pytest.raises(InputError, match="'south', 'north'"):
        read_surface(file, name="east")


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"mults_u": [4, 1, 1, 3]}, r"surface 1: 5 × 4 control points don't go with 9 and 6 knots.*STEP"),
        ({"weights": [[1.0]]}, "NURBS surface .* is damaged: control points"),
        ({"weights": [[np.nan] * 4] * 5}, "damaged: a weight or a knot is no number"),
        ({"knots_u": [0.0, np.inf, 2.0, 3.0]}, "damaged: a weight or a knot is no number"),
        ({"points": [[[1.0, 1.0, 1.0]] * 4] * 5}, "has no extent"),
        ({"degree_u": "two"}, "NURBS surface .* is damaged"),
        ({"points": [[[np.nan, 0.0, 0.0]] * 4] * 5}, "coordinate that is no number"),
        ({"dtype": "compas.geometry/Brep"}, "holds no COMPAS mesh.*a Brep as STEP"),
    ],
)
def test_a_compas_surface_that_cannot_be_used_is_refused_with_what_to_do(tmp_path, changed, said):
    file = written(tmp_path / "a.json", **changed)
    with pytest.raises(InputError, match=said) as caught:
        read_surface(file)
    assert str(caught.value).count(str(file)) == 1


def test_json_that_is_not_whole_is_said_to_be_so(tmp_path):
    (tmp_path / "a.json").write_text('{"mults_u": [1')
    with pytest.raises(InputError, match="isn't whole JSON"):
        read_surface(tmp_path / "a.json")
