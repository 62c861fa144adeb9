"""Load cases, parts and rods of a case: how they are read, what they weigh, and every message."""

import json
from pathlib import Path

import numpy as np
import pytest

from shellform.case.beside_surface import refuse_beside
from shellform.case.build_gridshell import gridshell, rod_bounds, rod_limits, rod_of
from shellform.case.build_rod import given_section
from shellform.case.case import dump_case, load_case
from shellform.errors import InputError
from shellform.gridshell.catalogue import read_catalogue
from shellform.gridshell.gridshell import max_radius
from shellform.records.progress import Kind
from shellform.run.run import run_case
from shellform.structure.elements.sections import Rectangle, Round, Tube

ROOT = Path(__file__).parent.parent.parent
PLAIN = (
    (ROOT / "scripts/scale_model.toml")
    .read_text(encoding="utf-8")
    .replace("../surfaces", str(ROOT / "surfaces"))
)
PARTS = """
[part.wet]
kind = "concrete"
thickness = 0.0025
density = 50000.0
[part.west]
kind = "concrete"
thickness = 0.0025
density = 50000.0
half = 180.0
[part.east]
kind = "concrete"
thickness = 0.0025
density = 50000.0
half = 0.0
[part.foot]
kind = "concrete"
thickness = 0.0025
density = 50000.0
ring = [-1.0, 0.1]
[part.band]
kind = "reinforcement"
mass = 1.5
strip = [90.0, -0.1, 0.1]
[part.cloth]
kind = "membrane"
mass = 0.5
[part.rods]
kind = "rods"
[part.joints]
kind = "joints"
mass = 0.001
[part.tip]
kind = "points"
force = 5.0
inside = [[[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]]]

[[load]]
name = "design"
factors = { wet = 1.0, rods = 1.0, joints = 1.0, cloth = 1.0 }
[[load]]
name = "pour"
factors = { rods = 1.0 }
stages = ["west", "east"]
[[load]]
name = "additional"
factors = { wet = 1.2 }
[[load]]
name = "rest"
factors = { foot = 1.0, band = 1.0, tip = 2.0 }

[optimise]
"""


def with_loads(text=PLAIN):
    head, _, rest = text.partition("[load]")
    return (
        head.replace("strength = 255e6", "density = 2000.0\nstrength = 255e6")
        + PARTS
        + rest.partition("[optimise]\n")[2]
    )


def with_rod(rod, text=PLAIN):
    head, _, rest = text.partition("[rod]")
    return f"{head}[rod]\n{rod}\n{rest[rest.index('[joint]') :]}"


def read(tmp_path, text):
    file = tmp_path / "case.toml"
    file.write_text(text, encoding="utf-8")
    return load_case(file)


def test_a_case_with_parts_and_a_catalogue_survives_being_written(tmp_path):
    case = read(tmp_path, with_rod('catalogue = "gfrp_rods"\nsection = "2 mm"', with_loads()))
    assert read(tmp_path, dump_case(case)) == case


def test_load_cases_weigh_what_their_parts_weigh(tmp_path, net, vault):
    shell, loads = gridshell(read(tmp_path, with_loads()), net, vault)
    assert list(loads) == ["none", "design", "additional", "pour 1", "pour 2", "rest"]
    total = {name: -load[:, 2].sum() for name, load in loads.items()}
    wet = 9.81 * 0.0025 * 50_000.0 * vault.area
    rods = 9.81 * 2000.0 * np.pi * 1e-6 * sum(rod.length for rod in net.grid.rods)
    joints = 9.81 * 0.001 * len(net.crossings)
    assert total["none"] == 0.0
    assert total["design"] == pytest.approx(wet + rods + joints + 9.81 * 0.5 * vault.area)
    assert total["additional"] == pytest.approx(1.2 * wet)
    assert total["pour 2"] == pytest.approx(wet + rods)
    west = loads["pour 1"][:, 2] < loads["pour 2"].min() * 0.5
    assert (shell.target.positions[west, 0] < 0.03).all()  # no node with much load lies on the eastern half
    assert total["rest"] > 2.0 * 5.0


def test_the_table_of_point_loads_is_as_before(tmp_path, net, vault):
    shell, loads = gridshell(read(tmp_path, PLAIN), net, vault)
    case = read(tmp_path, PLAIN)
    np.testing.assert_array_equal(
        loads["design"], shell.point_load(6.9, every=2, openings=case.load.openings)
    )
    np.testing.assert_array_equal(loads["additional"], 1.2 * loads["design"])


def test_rods_are_round_tubes_laths_or_out_of_a_catalogue(tmp_path, net):
    material = "young = 40e9\nstrength = 255e6\n"
    for text, kind, sizes in [
        ("radius = 0.001", Round, (0.001,)),
        ("radius = 0.001\nwall = 0.0002", Tube, (0.001, 0.0002)),
        ("width = 0.002\nheight = 0.001\nshear = 4e9", Rectangle, (0.002, 0.001)),
    ]:
        section = rod_of(read(tmp_path, with_rod(material + text)).rod, net).section
        assert isinstance(section, kind)
        assert section.sizes == sizes
        assert section.material.shear == (4e9 if "shear" in text else pytest.approx(40e9 / 2.6))
    free = read(tmp_path, with_rod(material)).rod
    assert given_section(free) is None
    assert rod_of(free, net).radius == net.max_radius(young=40e9, strength=255e6)
    named = read(tmp_path, with_rod('catalogue = "gfrp_tubes"\nsection = "6 x 1 mm"')).rod
    assert rod_of(named, net).section.sizes == (0.003, 0.001)
    stock = read(tmp_path, with_rod('catalogue = "gfrp_rods"')).rod
    chosen = rod_of(stock, net)
    sizes = [section.radius for section in read_catalogue("gfrp_rods").sections]
    assert chosen.radius <= max_radius(net, chosen)
    assert sizes[sizes.index(chosen.radius) + 1] > max_radius(net, chosen)


def test_a_catalogue_s_file_lies_beside_the_case(tmp_path, net):
    shipped = Path(read_catalogue.__code__.co_filename).parent.parent / "catalogues/gfrp_rods.toml"
    (tmp_path / "ours.toml").write_bytes(shipped.read_bytes())
    case = read(tmp_path, with_rod('catalogue = "ours.toml"'))
    assert case.rod.catalogue == str(tmp_path / "ours.toml")
    assert rod_of(case.rod, net).radius > 0.0


def test_the_radius_is_bounded_by_the_net_or_by_the_catalogue(tmp_path, net, vault):
    case = read(tmp_path, PLAIN)
    shell, _ = gridshell(case, net, vault)
    low, high = rod_bounds(case, shell)
    assert low == pytest.approx(0.0005)
    assert high == pytest.approx(net.max_radius(young=40e9, strength=255e6))
    case = read(tmp_path, with_rod('catalogue = "gfrp_rods"'))
    shell, _ = gridshell(case, net, vault)
    assert rod_bounds(case, shell) == (pytest.approx(0.00075), shell.rod.radius)
    limits = rod_limits(case.rod, net)
    assert shell.rod.radius <= limits.radius_max
    assert limits.curvature_utilisation == pytest.approx(shell.rod.radius / limits.radius_max)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (
            "thickness = 0.0025",
            "thicknes = 0.0025",
            "part.wet.thicknes is no known entry.*Did you mean 'part.wet.thickness'",
        ),
        ("thickness = 0.0025", "thickness = -1.0", "part.wet.thickness.*greater than 0"),
        (
            'kind = "concrete"',
            'kind = "snow"',
            "part.wet.kind is no known kind.*found 'snow'.*Write one of 'points'",
        ),
        ('kind = "concrete"', "", "part.wet.kind is missing.*Write one of 'points'"),
        ("wet = 1.2", "wett = 1.2", "'additional' names a part 'wett'.*known are wet, west"),
        ('["west", "east"]', '["west", "south"]', "'pour' names a part 'south'"),
        ('name = "additional"', 'name = "more"', r"one \[\[load\]\] with the name 'additional'"),
        (
            'name = "additional"',
            'nam = "additional"',
            "load.2.name is missing; load.2.nam.*Add load.2.name .*Did you mean 'load.2.name'",
        ),
        ('name = "rest"', 'name = "pour"', "'pour' is taken"),
        ('name = "rest"', 'name = "none"', "'none' is taken"),
        ('name = "rest"', 'name = "a/b"', "load.3.name.*'a/b'"),
        ("factors = { wet = 1.2 }", 'stages = ["wet"]', "'additional' is one case"),
        ("radius = 0.001", "wall = 0.001", "rod: a tube's wall needs a radius"),
        ("radius = 0.001", "width = 0.001", "rod: a lath needs both"),
        ("radius = 0.001", "radius = 0.001\nwidth = 0.001\nheight = 0.001", "rod: a rod has either"),
    ],
)
def test_wrong_loads_and_rods_are_named(tmp_path, old, new, said):
    text = with_loads()
    assert old in text
    with pytest.raises(InputError, match=said):
        read(tmp_path, text.replace(old, new, 1))


def test_parts_without_load_cases_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"parts of \[part\] need load cases"):
        read(tmp_path, PLAIN + '\n[part.rods]\nkind = "rods"\n')


ON_NO_NET = [
    ("density = 2000.0\nstrength", "strength", "part.rods: rod.density"),
    (
        "factors = { wet = 1.0, rods = 1.0, joints = 1.0, cloth = 1.0 }",
        "factors = { wet = 0.0 }",
        "'design': weighs nothing",
    ),
    ("factors = { foot = 1.0, band = 1.0, tip = 2.0 }", "", "load 'rest': names no part"),
    ('name = "rest"', 'name = "pour 1"', "a stage has the name of another case"),
]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("ring = [-1.0, 0.1]", "ring = [5.0, 6.0]", "part.foot: load: no part of the surface"),
        *ON_NO_NET,
    ],
)
def test_loads_that_do_not_fit_the_net_are_named(tmp_path, net, vault, old, new, said):
    text = with_loads()
    assert old in text
    with pytest.raises(InputError, match=said):
        gridshell(read(tmp_path, text.replace(old, new, 1)), net, vault)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        *ON_NO_NET,
        (
            "[cable]",
            '[limits]\nslack_min = 1.0\nslack_loads = ["pour"]\n[cable]',
            "slack_loads.*'pour'.*pour 2",
        ),
        ("[cable]", "[safety.critical_further]\nstorm = 1.2\n[cable]", "critical_further.*'storm'.*Known"),
    ],
)
def test_loads_that_can_t_be_on_any_net_are_refused_before_there_is_one(tmp_path, vault, old, new, said):
    text = with_loads()
    refuse_beside(read(tmp_path, text), vault)
    assert old in text
    with pytest.raises(InputError, match=said):
        refuse_beside(read(tmp_path, text.replace(old, new, 1)), vault)


def test_parts_of_which_one_takes_another_s_weight_off_are_loads_as_long_as_something_weighs(tmp_path, vault):
    """A factor below 0 is no reason for a refusal before the parts are weighed."""
    text = with_loads().replace("wet = 1.0, rods = 1.0, joints = 1.0", "wet = 1.0, west = -1.0")
    refuse_beside(read(tmp_path, text), vault)


def test_the_weight_of_rods_may_be_unknown_where_no_load_has_it(tmp_path, vault):
    text = with_loads().replace("density = 2000.0\nstrength", "strength")
    text = text.replace("rods = 1.0, ", "").replace("{ rods = 1.0 }", "{}")
    refuse_beside(read(tmp_path, text), vault)


def test_rods_that_do_not_fit_are_named(tmp_path, net, vault):
    with pytest.raises(InputError, match=r"rod.section.*'7.5 mm'.*Known: ⌀ 1.5 mm"):
        read(tmp_path, with_rod('catalogue = "gfrp_rods"\nsection = "7.5 mm"'))
    with pytest.raises(InputError, match=r"catalogue .*bamboo: is neither shipped nor a file\. Shipped are"):
        read(tmp_path, with_rod('catalogue = "bamboo"'))
    case = read(tmp_path, with_rod('catalogue = "gfrp_rods"\nsection = "20 mm"'))
    with pytest.raises(InputError, match="they break"):
        gridshell(case, net, vault)


def test_a_run_follows_every_case_and_starts_again_where_the_catalogue_has_changed(tmp_path):
    shipped = (
        Path(read_catalogue.__code__.co_filename).parent.parent / "catalogues/gfrp_rods.toml"
    ).read_text(encoding="utf-8")
    (tmp_path / "ours.toml").write_text(shipped, encoding="utf-8")
    text = with_rod('catalogue = "ours.toml"\nsection = "2.5 mm"', with_loads())
    text = text.replace("wet = 1.0, rods = 1.0, joints = 1.0", "wet = 0.5, rods = 1.0, joints = 1.0")
    for usual, quick in [
        ("size = 0.01", "size = 0.02"),
        ("spacing = 0.055", "spacing = 0.055\nelements = 2"),
        ("[cable]\n", "[cable]\nwithout = false\n"),
    ]:
        assert usual in text
        text = text.replace(usual, quick)
    case = read(tmp_path, text)
    said = []

    def run():
        said.clear()
        return run_case(
            case,
            tmp_path / "run",
            until="initial",
            report=lambda event: said.append((event.stage, event.kind)),
        )

    summary = run()
    cases = summary.designs["initial"].loads
    assert list(cases) == ["none", "design", "additional", "pour 1", "pour 2", "rest"]
    assert cases["none"].factor == 0.0
    assert cases["design"].factor == 1.0
    assert cases["additional"].factor == pytest.approx(1.2 / 0.5, rel=0.05)
    model = json.loads((tmp_path / "run/designs/initial.json").read_text(encoding="utf-8"))
    assert set(model["loads"]) == set(cases) - {"none"}
    for name in cases:
        assert (tmp_path / f"run/states/initial-{name}.vtp").is_file()
    run()
    assert ("initial", Kind.KEPT) in said
    (tmp_path / "ours.toml").write_text(shipped.replace("young = 40e9", "young = 41e9"), encoding="utf-8")
    run()
    assert ("net", Kind.KEPT) in said
    assert ("initial", Kind.DONE) in said
