"""What can't be built is said with the nearest surface that can be, and that one can."""

import re
import tomllib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError, NotConverged
from shellform.net.refusal import NoNet, Stalled
from shellform.records.progress import unheard
from shellform.run import first_refusal, way_out
from shellform.run.first_design import first_design
from shellform.run.first_look import net_alone
from shellform.run.first_net import Allowance
from shellform.run.first_refusal import shares
from shellform.run.plinths import Plinths
from shellform.run.propose import propose_case
from shellform.run.sizes import MOST_CROSSINGS, DesignWish
from shellform.run.unbuildable import Falls, Unbuildable, Why
from shellform.run.way_out import with_way_out
from shellform.surface.readers.reading import read_surface
from shellform.surface.shape.fairing import Faired
from tests.run.test_propose import as_obj
from tests.surface.test_fairing import gable, sheet

STANDS = SimpleNamespace(thickness=0.05)  # a design


def pulled(surface):
    return sf.pull_net(surface, spacing=0.8, gap=0.02, angle=np.pi / 4, elements=2)


def named(refusal):
    """The surface file that a refusal names."""
    return Path(re.search(r"goes on is (\S+\.obj)", refusal.remedy).group(1))


def test_a_crease_that_no_net_covers_is_rounded_and_the_net_goes_on(tmp_path):
    surface = sheet(gable)
    with pytest.raises((NoNet, Stalled)) as refused:
        pulled(surface)
    heard = []
    told = with_way_out(refused.value, surface, 3.0, tmp_path / "out", pulled, heard.append)
    assert type(told) is type(refused.value)
    assert told.what == refused.value.what
    assert told.remedy.endswith(refused.value.remedy)
    assert re.search(r" off at most, at \(0, \S+, 2.4\) m", told.remedy)
    file = named(told)
    assert {each.name for each in file.parent.iterdir()} >= {"surface.obj", "change.vtu", "change.png"}
    pulled(read_surface(file))
    cad = file.with_suffix(".step")
    if cad.exists():
        assert read_surface(cad).area == pytest.approx(read_surface(file).area, rel=0.01)


@pytest.mark.parametrize(
    ("mean", "most", "said"),
    [(0.19, 0.19, False), (0.21, 0.21, True), (0.19, 0.49, False), (0.19, 0.51, True)],
)
def test_a_rounded_surface_far_off_the_drawn_one_is_said_to_be_hardly_its_shape(
    tmp_path, monkeypatch, mean, most, said
):
    surface = sheet(gable)
    height, change = float(surface.size[2]), np.full(len(surface.vertices), mean)
    change[0], change[1] = most, 2.0 * mean - most

    def far(surface, radius):
        return Faired(surface, surface, change * height)

    monkeypatch.setattr(way_out, "faired", far)
    refusal = InputError("is no shell", where="surface")
    told = with_way_out(refusal, surface, 3.0, tmp_path / "out", lambda surface: None, unheard)
    assert (": hardly the shape that was drawn (change.png)" in told.remedy) == said
    assert (f"in the mean, {100 * mean:.0f} % of its height" in told.remedy) == said


def test_a_refusal_stays_as_it_was_where_rounding_helps_nothing(tmp_path):
    def never(surface):
        raise InputError("no", where="net")

    refusal = InputError("is no shell", where="surface", remedy="Draw another.")
    heard = []
    assert with_way_out(refusal, sheet(gable), 1.5, tmp_path / "out", never, heard.append) is refusal
    assert len(heard) == 3
    assert not (tmp_path / "out").exists()


def test_a_surface_that_can_not_be_rounded_is_not_rounded_further(tmp_path):
    def never(surface):
        raise AssertionError("nothing to try")

    refusal = InputError("is no shell", where="surface", remedy="Draw another.")
    heard = []
    assert with_way_out(refusal, sheet(gable), 30.0, tmp_path / "out", never, heard.append) is refusal
    assert len(heard) == 1
    assert "more than the surface's size" in heard[0]


@pytest.mark.parametrize(
    ("most", "radii"),
    [
        (
            2.0,
            [1.5, 2.25, 1.5 * 1.5**0.5],
        ),  # the one between is refused by the net: nothing lies between these
        (1.7, [1.5, 2.25, 1.5 * 1.5**0.5, 1.5 * 1.5**0.25]),
        (1.4, [1.5]),  # there is none before it
        (9.0, [1.5, 2.25, 3.3]),
    ],
)
def test_between_a_radius_to_which_a_surface_is_rounded_and_one_to_which_it_is_not_others_are_tried(
    tmp_path, monkeypatch, most, radii
):
    """An L in plan was rounded to 2.94 m, too little, and couldn't be to 5 m: at 3.83 m it stands."""
    asked, tried, surface = [], [], sheet(gable)

    def rounded(surface, radius):
        asked.append(radius)
        if radius > most:
            raise NotConverged("No surface near this one", residual=1.0, iterations=1)
        return Faired(surface, surface, np.full(len(surface.vertices), 0.1))

    def never(rounded, share):
        tried.append(share)
        raise InputError("no", where="net")

    monkeypatch.setattr(way_out, "faired", rounded)
    assert way_out.nearest_buildable(surface, 1.5, tmp_path / "out", never, unheard) is None
    assert asked == pytest.approx(radii)
    assert tried == pytest.approx([each / 1.5 for each in radii if each <= most]), "each with its own share"


@pytest.mark.parametrize(
    ("shares", "stands", "tried", "offered"),
    [
        ((1.0, 1.7, 2.9), 1.2, (1.0, 1.7, 1.7**0.5), 1.7**0.5),
        ((1.0, 1.7, 2.9), 1.5, (1.0, 1.7, 1.7**0.5), 1.7),
        ((1.0, 1.7, 2.9), 0.5, (1.0,), 1.0),  # the first that is tried
        ((1.0, 1.5), 1.2, (1.0, 1.5), 1.5),  # too near for one between
    ],
)
def test_a_nearer_surface_than_the_first_that_is_taken_is_tried_where_one_was_refused_before(
    tmp_path, monkeypatch, shares, stands, tried, offered
):
    """A groined vault had no net at 4.28 m, for a hundredth of a percent, and lay 3.2 m off at 7.28 m."""
    surface, asked = sheet(gable), []

    def rounded(surface, radius):
        return Faired(surface, surface, np.full(len(surface.vertices), 0.01 * radius))

    def again(rounded, share):
        asked.append(share)
        if share < stands:
            raise InputError("no", where="net")

    monkeypatch.setattr(way_out, "faired", rounded)
    found = way_out.nearest_buildable(surface, 2.0, tmp_path / "out", again, unheard, shares)
    assert asked == pytest.approx(tried)
    assert f"creases rounded to {2.0 * offered:.3g} m, {0.02 * offered:.3g} m off at most" in found.told


def test_a_nearer_surface_than_one_that_stands_on_its_own_edges_is_not_tried_on_walls(monkeypatch):
    tried = []

    def search(surface, wish, say, allowance, *, finer):
        tried.append(wish.edges)
        if len(tried) != 3:
            raise NotConverged("falls", residual=0.0, iterations=0)
        return STANDS

    monkeypatch.setattr(first_refusal, "standing_design", search)
    again = first_refusal._Rounded(DesignWish(), Allowance(), lambda text: None)
    for share, edges in ((1.0, ["auto", "wall"]), (1.7, ["auto"]), (1.3, ["auto"])):
        before = len(tried)
        if share == 1.7:
            again(sheet(gable), share)
        else:
            with pytest.raises(NotConverged):
                again(sheet(gable), share)
        assert tried[before:] == edges
    assert (again.design, again.wish, again.options) == (STANDS, DesignWish(), "")


def test_with_most_of_the_work_done_no_nearer_surface_is_tried():
    again = first_refusal._Rounded(DesignWish(), Allowance(1000), lambda text: None)
    again.design = STANDS
    again._brief.left = round(0.5 * again._brief.work) - 1
    with pytest.raises(InputError, match="since a rounder one stands"):
        again(sheet(gable), 1.3)


def test_surfaces_are_rounded_to_what_nets_cover_before_what_is_sure_to_bear_the_load():
    def refusal(spacing, radius):
        return Unbuildable("no", why=Why.NET, where="rod", remedy="Round it.", spacing=spacing, radius=radius)

    assert shares(refusal(0.75, 20.0)) == pytest.approx([0.2, 0.5, 1.0, 1.7, 2.89])
    assert shares(refusal(1.0, 6.0)) == pytest.approx([0.7, 1.0, 1.7, 2.89])
    assert shares(refusal(1.0, 3.0)) == pytest.approx([1.4, 1.7 * 1.4, 2.89 * 1.4])


@pytest.mark.slow
def test_net_names_a_surface_with_which_it_goes_on(tmp_path):
    """A fold of twice 45 degrees; one of twice 30 is covered since nets are tried in more ways."""
    file = as_obj(tmp_path / "fold.obj", sheet(lambda x, y: 4.0 - np.abs(x)))
    settings = {"spacing": 0.8, "angle": "45", "gap": None, "allow_scripts": False, "report": unheard}
    with pytest.raises((NoNet, Stalled)) as refused:
        net_alone(file, tmp_path / "net", {}, **settings)
    net_alone(named(refused.value), tmp_path / "again", {}, **settings)


@pytest.mark.parametrize(
    ("stands", "remedy"), [(True, "With --thickness 0.012 this goes on"), (False, "rounder form")]
)
def test_where_no_rounded_surface_helps_a_first_layer_of_concrete_is_offered_if_a_design_stood_with_it(
    tmp_path, monkeypatch, stands, remedy
):
    tried = []

    def search(surface, wish, say, allowance, *, finer=False):
        tried.append(wish.thickness)
        if not (stands and wish.thickness):
            raise InputError("no", where="rod")
        return STANDS

    monkeypatch.setattr(first_refusal, "standing_design", search)
    refusal = Unbuildable(
        "no",
        why=Why.CURVATURE,
        where="rod",
        remedy="Round it.",
        spacing=0.8,
        radius=2.0,
        design=SimpleNamespace(thickness=0.012),
    )
    told = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", lambda text: None
    ).offered
    assert tried[-1] == 0.012
    assert remedy in told.remedy
    assert ("--thickness" in told.remedy) == stands
    other = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(thickness=0.05), tmp_path / "case.toml", lambda text: None
    ).offered
    assert "--thickness" not in other.remedy, "another was asked for"


def test_a_rounded_surface_that_falls_on_edge_beams_is_offered_on_walls(tmp_path, monkeypatch):
    tried = []

    def search(surface, wish, say, allowance, *, finer=False):
        tried.append(wish.edges)
        if wish.edges != "wall":
            raise NotConverged("falls", residual=0.0, iterations=0)
        return STANDS

    monkeypatch.setattr(first_refusal, "standing_design", search)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    told = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", lambda text: None
    ).offered
    assert tried == ["auto", "wall"]
    assert "(the first in metres, with --edges wall)" in told.remedy
    assert named(told).is_file()
    before = named(told).stat().st_mtime_ns
    again = first_refusal.with_ways_out(refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", print)
    assert again.way_out.file == tmp_path / "case-buildable-2" / "surface.obj", "a case may name the first"
    assert again.way_out.wish.edges == "wall"
    assert again.way_out.design is STANDS, "which whoever goes on has finished, and nothing is searched twice"
    assert named(told).stat().st_mtime_ns == before


@pytest.mark.parametrize("asked", [None, 0.05])
def test_a_thin_layer_that_stood_on_a_rounded_surface_is_the_way_out_where_nothing_else_is(
    tmp_path, monkeypatch, asked
):
    """A groined roof of 43 m, rounded and on walls, stood with 9 mm in 40 of 40 structures, and was refused
    without a way out."""
    thin, tried = SimpleNamespace(thickness=0.009), []

    def search(surface, wish, say, allowance, *, finer=False):
        tried.append((wish.edges, finer))
        raise Falls("falls", remedy="", design=thin if wish.edges == "wall" and not finer else None)

    monkeypatch.setattr(first_refusal, "standing_design", search)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    wish = DesignWish(thickness=asked)
    found = first_refusal.with_ways_out(refusal, sheet(gable), wish, tmp_path / "a.toml", lambda text: None)
    if asked is not None:
        assert found.way_out is None, "another was asked for"
        return
    assert found.way_out.design is thin
    assert (found.way_out.wish.edges, found.way_out.wish.thickness) == ("wall", 0.009)
    assert "(the first in metres, with --edges wall --thickness 0.009)" in found.offered.remedy
    assert named(found.offered).is_file()
    assert ("wall", False) in tried[:2]


@pytest.mark.parametrize(
    ("bore", "stands", "tried"),
    [
        (0.6, True, [("wall", 30.0)]),
        (0.6, False, [("wall", 30.0)]),
        (0.21, True, [("wall", 30.0)]),
        (0.19, True, []),  # none came near
        (None, True, [("auto", None)]),  # no net covers any of them: the roundest
        (0.0, True, []),  # they fall at once
    ],
)
def test_finer_spacings_are_tried_on_the_rounded_surface_that_came_nearest_where_none_stood(
    tmp_path, monkeypatch, bore, stands, tried
):
    """A roof of 14 m with four arched doors stands on rods every 0.6 m and falls on those every 0.85 m."""
    brief, finely = [], []

    def search(surface, wish, say, allowance, *, finer):
        if finer:
            finely.append((wish.edges, wish.angle, surface.vertices[:, 2].max()))
            assert allowance.thorough
            assert allowance.thins
            assert allowance.thin_layers
            if stands:
                return STANDS
        else:
            brief.append((wish.edges, surface.vertices[:, 2].max()))
            assert not allowance.thorough
        if bore is None:
            raise refusal
        allowance.angle = 30.0
        allowance.bore = bore if len(brief) == 4 else min(bore, 0.18)  # the second, on walls
        raise NotConverged("falls", residual=0.0, iterations=0)

    monkeypatch.setattr(first_refusal, "standing_design", search)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    found = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", lambda text: None
    )
    assert [each[:2] for each in finely] == tried
    if tried and stands:
        assert finely[0][2] == brief[3 if bore else -1][1], "the very same surface"
        assert found.way_out.design is STANDS
        assert found.way_out.wish == DesignWish(edges=tried[0][0])
        assert ("(the first in metres, with --edges wall)" in found.offered.remedy) == (tried[0][0] == "wall")
    else:
        assert found.way_out is None
    again = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(spacing=0.5), tmp_path / "case.toml", lambda text: None
    )
    assert again.way_out is None, "another spacing was asked for"


def test_a_rounded_surface_is_tried_on_the_plinths_that_whoever_follows_gets(tmp_path, monkeypatch):
    cut, tried = sheet(lambda x, y: 2.0 - 0.02 * y * y), []
    monkeypatch.setattr(
        first_refusal, "standing_design", lambda surface, *_, **__: tried.append(surface) or STANDS
    )
    monkeypatch.setattr(first_refusal, "plinths_for", lambda surface: Plinths(cut, 0.1, 0.1, 0.5))
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    told = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", print
    ).offered
    assert tried == [cut]
    assert read_surface(named(told)).size[2] > cut.size[2], "it is offered whole"


def test_where_what_is_above_plinths_is_not_rounded_the_surface_that_reaches_down_into_them_is(
    tmp_path, monkeypatch
):
    """A roof of 45 m on feet wasn't rounded to 4.2 m above its plinths, and is with its feet, 3 cm off in the
    mean."""
    uncut, cut = sheet(gable), sheet(lambda x, y: 2.0 - 0.02 * y * y)
    asked = []

    def rounded(surface, radius):
        asked.append(surface)
        if surface is cut:
            raise NotConverged("No surface near this one", residual=1.0, iterations=1)
        return Faired(surface, surface, np.full(len(surface.vertices), 0.1))

    monkeypatch.setattr(way_out, "faired", rounded)
    monkeypatch.setattr(first_refusal, "standing_design", lambda *_, **__: STANDS)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    place = tmp_path / "case.toml"
    found = first_refusal.with_ways_out(refusal, cut, DesignWish(), place, print, uncut=uncut)
    assert asked == [cut, uncut]
    assert found.way_out.design is STANDS
    assert first_refusal.with_ways_out(refusal, cut, DesignWish(), place, print).way_out is None


def test_of_a_radius_that_nobody_asked_for_no_remedy_is_told(tmp_path):
    refusal = InputError("is no shell", where="surface", remedy="Draw another.")
    surface, heard = sheet(gable), []
    radius = 1.1 * float(surface.size[:2].max())
    assert with_way_out(refusal, surface, radius, tmp_path / "out", pulled, heard.append) is refusal
    (told,) = heard
    assert told.startswith(f"rounded to {radius:.3g} m: is more than the surface's size of ")
    assert told.endswith("it would be another one")


def test_two_fifths_of_the_work_are_left_for_rounded_surfaces_whatever_came_before(tmp_path, monkeypatch):
    """A dome on four points had none left, since walls had been tried: it stands on walls, 4 mm off."""
    left = []

    def search(surface, wish, say, allowance, *, finer=False):
        left.append(allowance.left)
        allowance.spend(allowance.left)
        raise NotConverged("falls", residual=0.0, iterations=0)

    monkeypatch.setattr(first_refusal, "standing_design", search)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    heard, worth = [], Allowance()
    worth.part(1.0).spend(worth.work)
    told = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", heard.append, worth
    ).offered
    assert left[0] == round(0.8 * 0.4 * worth.work)
    assert "no surface near it" in told.what
    assert any("left untried" in each for each in heard), "rounder ones, once that is spent"


def test_a_fifth_of_the_work_is_left_for_walls_whatever_came_before(tmp_path, monkeypatch):
    """A translational shell of 30 m, which stands on walls, was told to take a rounder form instead."""
    left, worth = [], Allowance()
    worth.part(1.0).spend(worth.work)
    monkeypatch.setattr(first_refusal, "_walls_may_help", lambda *_: True)
    monkeypatch.setattr(first_refusal, "_on_walls", lambda *given: left.append(given[-1]) or "walls")
    refusal = Unbuildable("no", why=Why.STRENGTH, where="rod", remedy="Round it.", spacing=0.4, radius=1.7)
    found = first_refusal.with_ways_out(
        refusal, sheet(gable), DesignWish(), tmp_path / "case.toml", lambda text: None, worth
    )
    assert found.way_out == "walls"
    assert worth.left == round(0.2 * worth.work)
    assert not left[0].over


def test_what_a_part_of_the_work_spends_the_whole_has_spent_and_neither_goes_on_without_the_other():
    whole = Allowance(1000)
    search, walls = whole.part(0.5), whole.part(0.6)
    assert (search.left, walls.left) == (500, 600)
    search.spend(100.4, times=2)
    assert (search.left, walls.left, whole.left) == (300, 600, 800)
    search.spend(300)
    assert search.over
    assert not walls.over
    walls.spend(499)
    assert not walls.over
    walls.spend(1)
    assert walls.over, "its own share isn't spent, but the whole is"
    assert walls.left == 100


def test_the_rest_is_a_share_of_what_is_left():
    whole = Allowance(1000)
    whole.spend(600)
    brief, last = whole.rest(0.8, thorough=False, thins=False), whole.rest(1.0, thin_layers=True)
    assert (brief.left, brief.thorough, brief.thins, brief.thin_layers) == (320, False, False, False)
    assert (last.left, last.thorough, last.thins, last.thin_layers) == (400, True, True, True)


@pytest.mark.parametrize(
    ("wish", "thickness", "options"),
    [
        (DesignWish(), 0.008, "with --thickness 0.008)"),
        (DesignWish(), 0.016, None),  # a layer: `new` writes the case of that by itself
        (DesignWish(thickness=0.008), 0.008, None),  # as asked
    ],
)
def test_a_rounded_surface_that_bears_less_than_a_layer_is_offered_with_what_it_bears(
    tmp_path, monkeypatch, wish, thickness, options
):
    """A blob of 55 m with a crease, rounded to 10 m, bears 8 mm of concrete."""
    stands = SimpleNamespace(thickness=thickness)

    def search(surface, wish, say, allowance, *, finer):
        allowance.bore = 0.3
        if not finer:
            raise NotConverged("falls", residual=0.0, iterations=0)
        return stands

    monkeypatch.setattr(first_refusal, "standing_design", search)
    monkeypatch.setattr(first_refusal, "_on_edge_beams", lambda *_: False)
    refusal = Unbuildable("no", why=Why.NET, where="net", remedy="Round it.", spacing=0.4, radius=1.7)
    found = first_refusal.with_ways_out(refusal, sheet(gable), wish, tmp_path / "case.toml", print)
    assert found.way_out.design is stands
    assert found.way_out.wish.thickness == (thickness if options or wish.thickness else None)
    first_layer = ": pour that first, and the rest when it has hardened" in found.offered.remedy
    assert ("--thickness" in found.offered.remedy) == first_layer == (options is not None)
    assert options is None or options in found.offered.remedy


def test_a_shell_of_more_crossings_than_usual_is_asked_for_is_worth_more_work():
    surface = sheet(gable)
    usual, fine = (Allowance.for_size(surface, spacing) for spacing in (None, 0.1))
    times = surface.area / 0.1**2 / MOST_CROSSINGS
    assert 2.0 < times < 20.0
    assert (usual.left, fine.left) == (Allowance.work, pytest.approx(times * Allowance.work, rel=1e-4))
    assert Allowance.for_size(surface, 2.0).left == Allowance.work, "coarse nets are no reason for less"
    for absurd in (1e-3, 1e-200):
        assert Allowance.for_size(surface, absurd).left == 20 * Allowance.work


@pytest.mark.slow
def test_a_roof_of_flat_pieces_is_refused_for_its_crease_with_a_vault_on_which_new_goes_on(tmp_path):
    file = as_obj(tmp_path / "roof.obj", sheet(lambda x, y: 3.0 - 0.45 * np.abs(x), count=29))
    with pytest.raises(Unbuildable, match="curved most") as refused:
        first_design(read_surface(file), DesignWish())
    assert refused.value.radius == pytest.approx(4.0)
    with pytest.raises(InputError) as told:
        propose_case(file, tmp_path / "roof.toml", {}, allow_scripts=False)
    assert "--way-out goes on so at once" in told.value.remedy
    propose_case(named(told.value), tmp_path / "vault.toml", {}, allow_scripts=False)
    propose_case(file, tmp_path / "roof.toml", {}, allow_scripts=False, way_out=True)
    two, one = (tomllib.loads((tmp_path / f"{each}.toml").read_text("utf-8")) for each in ("vault", "roof"))
    assert one.pop("title") == "roof, nearest buildable surface"
    assert two.pop("title") == "surface"
    here, there = (tmp_path / each["surface"].pop("file") for each in (one, two))
    assert here.read_bytes() == there.read_bytes()
    assert one == two, "one command gives what two do"
