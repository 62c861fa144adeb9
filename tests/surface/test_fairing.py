"""The nearest surface that is curved no more than a cap."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from shellform.errors import InputError, NotConverged
from shellform.surface.shape import fairing
from shellform.surface.shape.fairing import faired
from shellform.surface.shape.quadratics import Quadratics, waves
from shellform.surface.shape.target import curvature, make_surface
from tests.net.edge_shells import oculus, sail


def sheet(height, size=8.0, count=25):
    """z = height(x, y) over a square, m."""
    x, y = (
        each.ravel() for each in np.meshgrid(*2 * [np.linspace(-size / 2, size / 2, count)], indexing="ij")
    )
    i = np.arange(count * count).reshape(count, count)
    a, b, c, d = (each.ravel() for each in (i[:-1, :-1], i[1:, :-1], i[1:, 1:], i[:-1, 1:]))
    faces = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    return make_surface(np.column_stack([x, y, height(x, y)]), faces)


def gable(x, y):
    """A roof of 30° on both sides of the y axis."""
    return 2.4 - np.abs(x) / np.sqrt(3.0)


def inside(surface):
    keep = np.ones(len(surface.vertices), dtype=bool)
    keep[np.concatenate(surface.boundary)] = False
    return keep


@pytest.mark.parametrize(
    ("height", "radius"),
    [(gable, 1.5), (lambda x, y: 4.0 - np.abs(x), 2.0), (lambda x, y: 3.0 - 0.7 * np.maximum(abs(x), abs(y)), 1.5)],
    ids=["gable", "steep", "pyramid"],
)  # fmt: skip
def test_creases_are_rounded_to_the_radius_as_the_package_measures_it(height, radius):
    """Jets fit cubics where the cap is kept by quadratics: a sixth is granted to the tip of a pyramid."""
    surface = sheet(height)
    found = faired(surface, radius)
    bent = np.abs(curvature(found.surface)).max(axis=1)[inside(found.surface)]
    assert bent.max() <= 1.0 / radius * 1.2
    assert np.percentile(bent, 99) <= 1.0 / radius * 1.1
    away = np.linalg.norm(found.surface.vertices - found.before.vertices, axis=1)
    np.testing.assert_allclose(found.change, away, atol=1e-12)
    assert found.change.max() < 0.6 * radius


def test_a_crease_that_runs_out_at_the_edge_is_rounded_there_too():
    found = faired(sheet(gable), 1.5)
    points = found.surface.vertices[found.before.vertices[:, 1] == 4.0]
    x, _, z = points[np.argsort(points[:, 0])].T
    bent = np.abs(np.gradient(np.gradient(z, x), x))[2:-2] / (1.0 + np.gradient(z, x)[2:-2] ** 2) ** 1.5
    assert bent.max() < 1.1 / 1.5


def test_a_crease_changes_less_than_an_arc_that_touches_both_sides_would():
    """Of a fold by 30° on each side the arc of radius R leaves it by R (1 / cos 30° - sqrt(1 - s²) - s tan
    30°) at R s from the ridge, upright; one of all surfaces that keep the cap, so that the least change is
    less."""
    radius = 1.5
    found = faired(sheet(gable), radius)
    x = found.before.vertices[:, 0]
    s = np.minimum(np.abs(x) / radius, 0.5)
    arc = (
        radius * (1.0 / np.cos(np.pi / 6) - np.sqrt(1.0 - s * s) - s * np.tan(np.pi / 6)) * np.cos(np.pi / 6)
    )
    arc -= arc[np.argmax(np.abs(x))]
    assert 0.0 < np.sqrt((found.change**2).mean()) < np.sqrt((arc**2).mean())
    assert found.change[np.abs(x) > 3.5].max() < 0.05 * found.change.max()


def test_ground_keeps_its_level():
    found = faired(sheet(gable), 1.5)
    low = found.before.vertices[:, 2] < found.before.vertices[:, 2].min() + 1e-9
    assert low.sum() > 10
    np.testing.assert_allclose(
        found.surface.vertices[low, 2], found.before.vertices[low, 2], rtol=0.0, atol=1e-12
    )


@pytest.mark.parametrize("surface", [sail(), oculus()], ids=["sail", "oculus"])
def test_what_keeps_the_cap_stays_as_it_is(surface):
    found = faired(surface, 0.2)
    assert not found.change.any()
    np.testing.assert_array_equal(found.surface.vertices, found.before.vertices)


def test_a_coarse_mesh_is_refined_until_it_shows_the_radius():
    coarse = make_surface(
        [[-4, -4, 0], [-4, 4, 0], [0, -4, 2], [0, 4, 2], [4, -4, 0], [4, 4, 0]],
        [[0, 2, 3], [0, 3, 1], [2, 4, 5], [2, 5, 3]],
    )
    found = faired(coarse, 2.0)
    assert len(found.surface.vertices) > 500
    bent = np.abs(curvature(found.surface)).max(axis=1)[inside(found.surface)]
    assert np.percentile(bent, 99) <= 0.5 * 1.1


@pytest.mark.parametrize(
    ("radius", "said"),
    [(0.0, "positive"), (np.inf, "positive"), (100.0, "size of 8 m"), (1e-4, "more than 30000 vertices")],
)
def test_radii_that_make_no_sense_are_refused(radius, said):
    with pytest.raises(InputError, match=said):
        faired(sheet(gable), radius)


def test_a_crumpled_sheet_is_refused_rather_than_flattened_in_silence():
    chance = np.random.default_rng(4)
    with pytest.raises(NotConverged) as refused:
        faired(sheet(lambda x, y: chance.normal(size=x.shape)), 7.5)
    assert not refused.value.remedy, "smaller radii are no more sure to be kept"


def test_where_cutting_all_makes_too_many_triangles_only_long_edges_are_halved(uneven, monkeypatch):
    monkeypatch.setattr(fairing, "_MOST", 6000)
    fine = fairing._refined(uneven, 0.3)
    edges = np.vstack([fine.triangles[:, [k, (k + 1) % 3]] for k in range(3)])
    assert np.linalg.norm(np.diff(fine.vertices[edges], axis=1)[:, 0], axis=1).max() <= 0.3
    assert fine.area == pytest.approx(uneven.area, rel=1e-12)
    in_the_middle = [np.hypot(*each.vertices[:, :2].T) < 0.1 for each in (uneven, fine)]
    assert np.count_nonzero(in_the_middle[1]) == np.count_nonzero(in_the_middle[0])


@pytest.fixture
def uneven():
    """A disc of rings: triangles that are long and thin round a middle of small ones."""
    turn = np.linspace(0.0, 2 * np.pi, 40, endpoint=False)
    rings = [r * np.column_stack([np.cos(turn), np.sin(turn), 0 * turn]) for r in (0.05, 1.0, 4.0)]
    number = np.arange(120).reshape(3, 40)
    inner, outer = number[:-1].ravel(), number[1:].ravel()
    inner_on, outer_on = (np.roll(each, -1, axis=1).ravel() for each in (number[:-1], number[1:]))
    faces = np.vstack(
        [np.column_stack([inner, outer, outer_on]), np.column_stack([inner, outer_on, inner_on])]
    )
    faces = np.vstack([faces, np.column_stack([np.full(40, 120), number[0], np.roll(number[0], -1)])])
    return make_surface(np.vstack([*rings, [[0.0, 0.0, 0.0]]]), faces)


def peaks(x, y):
    """Two steep ones, 3 m high and 3 m apart, that meet in a crease."""
    return 3.0 * np.maximum(*(np.exp(-((x - side) ** 2 + y**2) / 1.5) for side in (-1.5, 1.5)))


def everywhere(surface):
    return Quadratics(surface, np.ones(len(surface.vertices), dtype=bool))


def test_what_is_not_rounded_at_once_is_rounded_in_stages():
    radius, before = 2.5, fairing._refined(sheet(peaks, count=21), fairing._MESH * 2.5)
    with pytest.raises(NotConverged, match="No surface near this one"):
        fairing._rounded(before, everywhere(before), [radius])
    found = faired(sheet(peaks, count=21), radius)
    bent = np.abs(curvature(found.surface)).max(axis=1)[inside(found.surface)]
    assert np.percentile(bent, 99) <= 1.0 / radius * 1.1
    assert 1.0 < found.change.max() < 0.7 * radius, "it takes the peaks down, and fills the valley"
    far = np.abs(found.before.vertices[:, :2]).max(axis=1) > 3.9
    assert found.change[far].max() < 0.1, "what is flat stays where it is"


def lobes(x, y):
    """Six between groins that meet in the middle, with free edges."""
    r, turn = np.hypot(x, y), (np.arctan2(y, x) + np.pi / 6.0) % (np.pi / 3.0) - np.pi / 6.0
    return 1.2 + r * r * (0.025 - 0.14 * (6.0 * turn / np.pi) ** 2)


def test_what_is_not_rounded_on_a_fine_mesh_is_on_a_coarser_one():
    """A quarter of the vertices: a change travels faster from one pair of rings to the next."""
    surface, radius = sheet(lobes), 1.4
    fine, coarse = fairing._meshes(surface, radius)
    assert len(fine.vertices) > 3 * len(coarse.vertices)
    with pytest.raises(NotConverged, match="No surface near this one"):
        fairing._rounded(fine, everywhere(fine), [radius])
    found = faired(surface, radius)
    assert len(found.change) == len(coarse.vertices)
    bent = np.abs(curvature(found.surface)).max(axis=1)[inside(found.surface)]
    assert np.percentile(bent, 99) <= 1.0 / radius * 1.15


def test_what_loses_three_tenths_of_its_area_is_refused_as_another_surface():
    """A groined roof of 43 m was rounded to a disc with eight needles for feet."""
    before = sheet(gable)
    for share, kept in ((0.71, True), (0.69, False)):
        after = make_surface(np.sqrt(share) * before.vertices, before.triangles)
        if kept:
            fairing._refuse_ruin(before, after, 1.5)
            continue
        with pytest.raises(NotConverged, match=r"to 1\.5 m the surface keeps 69 % of its area"):
            fairing._refuse_ruin(before, after, 1.5)


def test_a_mesh_that_shows_the_radius_has_no_coarser_one():
    fine = fairing._refined(sheet(gable), 0.3)
    assert [len(each.vertices) for each in fairing._meshes(fine, 1.5)] == [len(fine.vertices)]


def test_stages_change_no_more_than_one_step_does():
    before, off = sheet(gable), []
    for radii in ([1.5], [0.6, 1.0, 1.5]):
        found = fairing._rounded(before, everywhere(before), radii)
        away = np.linalg.norm(found.surface.vertices - before.vertices, axis=1)
        np.testing.assert_allclose(found.change, away, atol=1e-12)
        off.append(np.sqrt((away**2).mean()))
    assert off[1] <= off[0]


def test_a_stage_whose_cap_asks_for_nothing_goes_back_to_the_surface_as_given():
    """What is least is the change from that, and not from what the stage before has come to."""
    flat = sheet(lambda x, y: np.zeros_like(x))
    moved = make_surface(flat.vertices + np.array([0.0, 0.0, 0.1]), flat.triangles)
    at, _ = fairing._at_stage(everywhere(flat), flat, moved, fairing._weights(flat), 1.0, 2)
    assert np.abs(at[inside(flat), 2]).mean() < 0.03, "sixty steps of multipliers leave a part of the way"


def test_stages_grow_from_what_the_surface_keeps_to_the_radius():
    ball = sheet(lambda x, y: np.sqrt(36.0 - x**2 - y**2), size=6.0)
    fit = everywhere(ball)
    kept = 1.0 / fit.most(ball.vertices, fairing.rough_normals(ball.vertices, ball.triangles))
    assert kept == pytest.approx(6.0, rel=0.05)
    assert fairing._stages(ball, fit, 5.0) == [5.0]
    assert fairing._stages(ball, fit, 1.2 * kept) == pytest.approx([kept, 1.2 * kept])
    assert fairing._stages(ball, fit, 10.0 * kept)[:2] == pytest.approx([1.5 * kept, 2.1 * kept])
    assert fairing._stages(ball, fit, 10.0 * kept)[-1] == 10.0 * kept


def test_meshes_on_which_stages_take_minutes_are_refused_after_the_first_attempts(monkeypatch):
    tried = []

    def refused(start, fit, radii):
        tried.append(radii)
        raise NotConverged("no surface", residual=1.0, iterations=1)

    monkeypatch.setattr(fairing, "_rounded", refused)
    for most, times in ((21**2, 4), (21**2 - 1, 2)):
        monkeypatch.setattr(fairing, "_STAGED", most)
        monkeypatch.setattr(fairing, "_refined", lambda surface, longest: surface)
        tried.clear()
        with pytest.raises(NotConverged, match="no surface"):
            faired(sheet(peaks, count=21), 2.5)
        assert len(tried) == times
        assert tried[:2] == [[2.5], [2.5]]


def scanned(height, seed, count=200, size=8.0):
    """z = height(x, y) over a square, m, at places drawn by chance, as in scans."""
    half, side = 0.5 * size, np.linspace(-0.5 * size, 0.5 * size, 25)[:-1]
    end = np.full(24, half)
    rim = [np.column_stack(each) for each in ((side, -end), (end, side), (-side, end), (-end, -side))]
    within = np.random.default_rng(seed).uniform(-0.97 * half, 0.97 * half, (count, 2))
    plan = np.vstack([*rim, within])
    return make_surface(np.column_stack([plan, height(*plan.T)]), Delaunay(plan).simplices)


def test_an_uneven_mesh_is_rounded_between_its_vertices_too(monkeypatch):
    """Quadratics fitted to two rings don't see waves as short as its sides: with a cap on them alone a crease
    that was rounded to 2 m was bent to half a metre beside slivers, and a hundredth of its vertices to less
    than a metre."""
    surface, bent = scanned(gable, 3), []
    for even in (fairing._EVEN, 0.0):
        monkeypatch.setattr(fairing, "_EVEN", even)
        found = faired(surface, 2.0)
        bent.append(np.abs(curvature(found.surface)).max(axis=1)[inside(found.surface)])
    assert np.percentile(bent[0], 99) <= 1.1 / 2.0
    assert np.percentile(bent[1], 99) > 2.0 / 2.0
    assert bent[0].max() < 0.25 * bent[1].max()


def test_waves_are_none_on_a_quadratic_and_follow_from_places_as_they_are_told_to():
    surface = scanned(lambda x, y: 0.1 * x * x - 0.05 * x * y + 0.02 * y, 1, count=60)
    fit, points = everywhere(surface), surface.vertices
    upright = np.tile([0.0, 0.0, 1.0], (len(points), 1))
    frames = fit.frames(upright)
    assert np.abs(fit.found(waves, points, frames)).max() < 1e-9
    _, rate = fit.found_by_distance(waves, points, frames, upright)
    off = np.random.default_rng(0).normal(size=len(points))
    there = fit.found(waves, points + off[:, None] * upright, frames)
    np.testing.assert_allclose(there[:, 0], rate @ off, rtol=1e-7, atol=1e-9)
    spike = (np.arange(len(points)) == fit.fitted[0]).astype(float)
    assert (rate @ spike)[0] < 0.0, "what stands out lies above its neighbours"
