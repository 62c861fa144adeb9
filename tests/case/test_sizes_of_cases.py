"""Numbers of a case in another unit than the one that is asked for."""

import re
from pathlib import Path

import pytest

from shellform.case.beside_surface import doubts, refuse_beside
from shellform.case.case import load_case
from shellform.errors import InputError
from shellform.run.first_look import check_file
from shellform.surface.readers.reading import read_surface

ROOT = Path(__file__).parent.parent.parent
DOME, VAULT, HALL = (ROOT / f"scripts/{name}.toml" for name in ("dome", "scale_model_radius", "full_size"))


@pytest.fixture(scope="module")
def vault():
    """0.9 × 0.55 × 0.21 m."""
    return read_surface(ROOT / "surfaces/vault.ply")


def told(case, *settings, beside=None):
    """What is said of a case with wrong entries, `beside` a surface if it is read."""
    with pytest.raises(InputError) as refused:
        read(case, settings, beside)
    return str(refused.value)


def read(case, settings, beside):
    """The case, that fits the surface."""
    found = load_case(case, settings)
    if beside is not None:
        refuse_beside(found, beside)
    return found


def meant(said):
    """What a remedy says to write, first."""
    return re.search(r"For \S+ \S+ write ([\d.e+-]+)\.(?: |$)", said)[1]


@pytest.mark.parametrize(
    ("case", "entry", "given", "write"),
    [
        (DOME, "part.concrete.thickness", "50", 0.05),
        (DOME, "part.concrete.thickness", "11", 0.011),
        (DOME, "part.concrete.thickness", "0.00005", 0.05),
        (DOME, "part.concrete.density", "2.5", 2500.0),
        (DOME, "part.concrete.density", "25", 2548.42),
        (DOME, "part.concrete.density", "2.5e6", 2500.0),
        (DOME, "net.spacing", "500", 0.5),
        (DOME, "net.spacing", "0.000048", 0.048),
        (DOME, "net.spacing_v", "500", 0.5),
        (DOME, "rod.kerf", "3", 0.003),
        (DOME, "rod.stock_length", "6000", 6.0),
        (DOME, "rod.stock_length", "0.006", 6.0),
        (DOME, "joint.gap", "2.4", 0.0024),
        (DOME, "cable.stiffness", "17.9", 17900.0),
        (DOME, "cable.stiffness", "0.0179", 17900.0),
        (VAULT, "cable.stiffness", "0.187", 187.0),
        (DOME, "cable.force_max", "0.103", 103.0),
        (DOME, "cable.adjustment", "20", 0.02),
        (DOME, "optimise.rest_length_min", "10", 0.01),
        (DOME, "tolerances.supports", "2", 0.002),
        (HALL, "tolerances.cable_length", "1", 0.001),
        (HALL, "tolerances.marks", "0.5", 0.0005),
        (VAULT, "rod.young", "40", 40e9),
        (VAULT, "rod.young", "40e3", 40e9),
        (VAULT, "rod.shear", "4.5", 4.5e9),
        (VAULT, "rod.strength", "255", 255e6),
        (VAULT, "rod.strength", "0.255", 255e6),
        (VAULT, "rod.strength", "255e3", 255e6),
        (VAULT, "rod.strength", "255e9", 255e6),
        (VAULT, "rod.density", "2.0", 2000.0),
        (VAULT, "rod.density", "20", 20e3),
        (VAULT, "rod.radius", "1.3", 0.0013),
        (VAULT, "rod.radius", "0.0000013", 0.0013),
        (VAULT, "rod.radius", "0.65", 0.00065),
        (HALL, "rod.radius", "24", 0.024),
    ],
)
def test_what_is_in_another_unit_is_refused_with_the_number_to_write(case, entry, given, write):
    said = told(case, f"{entry}={given}")
    assert f"{entry}: " in said
    assert "found" in said
    assert float(meant(said)) == write
    load_case(case, [f"{entry}={meant(said)}"])


def test_what_follows_the_rods_is_not_missing_where_these_are_wrong():
    said = told(DOME, "rod.kerf=3")
    assert "joint" not in said


def test_edge_beams_and_weights_on_an_area_are_refused_alike():
    for beam, write in [
        ("{radius = 4.0}", 0.004),
        ("{width = 60.0, height = 0.04}", 0.06),
        ("{rods = 19, young = 210}", 210e9),
        ("{rods = 19, strength = 355}", 355e6),
        ("{rods = 19, density = 7.85}", 7850.0),
    ]:
        assert float(meant(told(DOME, f"edges.beam={beam}"))) == write
    assert float(meant(told(DOME, 'part.rods={kind = "membrane", mass = 1000}'))) == 1.0
    assert float(meant(told(DOME, 'part.rods={kind = "joints", mass = 800}'))) == 0.8


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("load.force=1e40", "load.force: must be between 1e-6 and 1e8 N"),
        ("joint.axial=1e30", "joint.axial: must be between 1e-6 and 1e14 N,"),
        ("joint.torsion=1e-30", "joint.torsion: must be between 1e-15 and 1e14 N·m²"),
        ("joint.bending=1e30", "joint.bending: must be between 1e-15 and 1e14 N·m²"),
        ("cable.stiffness=1e30", "cable.stiffness: must be between"),
        ("net.elements=10000000000", "net.elements: input should be less than or equal to 100 "),
        ("safety.drawn=10000000000", "safety.drawn: input should be less than or equal to 1000000"),
        ("safety.rare=10000000000", "safety.rare: input"),
        ("optimise.evaluations=10000000000", "optimise.evaluations: input"),
        ("robust.samples=10000000000", "robust.samples: input"),
        ("cable.force_max=0.001", "is what cables of 187 N bear at a strain of 5.3 × 10⁻⁶, to which none can be set"),
    ],
)  # fmt: skip
def test_what_no_shell_can_have_is_refused_at_the_door(setting, said):
    assert said in told(VAULT, setting)


@pytest.mark.parametrize(
    ("case", "settings"),
    [
        (HALL, ["net.spacing=2.5", "rod.radius=0.06", "joint.gap=0.12"]),  # a hall of 100 m
        (VAULT, ["rod.young=11e9", "rod.strength=30e6", "rod.density=460"]),  # timber
        (VAULT, ["rod.young=0.3e9", "rod.strength=20e6", "rod.density=920"]),  # polyethylene
        (VAULT, ["rod.young=900e9", "rod.strength=4e9", "rod.density=2200"]),  # carbon
        (VAULT, ["rod.young=1e9", "rod.strength=10e6", "rod.density=100"]),  # foam
        (VAULT, ["rod.young=0.4e6", "rod.strength=0.2e6", "rod.density=35"]),  # soft foam
        (VAULT, ["cable.stiffness=7.0"]),  # rubber bands
        (DOME, ["part.concrete.density=50000"]),  # a model whose load on an area is that of a shell
        (DOME, ["part.concrete.thickness=0.002"]),
        (DOME, ["rod.kerf=0", "tolerances.supports=0", "cable.adjustment=0"]),
    ],
)
def test_unusual_materials_models_and_halls_are_read(case, settings):
    assert load_case(case, settings)


@pytest.mark.parametrize(
    ("entry", "given", "write"),
    [
        ("limits.deviation", "5", 0.005),
        ("limits.built_deviation", "10", 0.01),
        ("limits.unloaded_deviation", "10", 0.01),
        ("optimise.deviation", "5.5", 0.0055),
        ("optimise.misfit_rms_additional", "4.36", 0.00436),
        ("robust.limit", "2", 0.002),
        ("figures.limit", "10", 0.01),
        ("part.concrete.thickness", "0.5", 0.005),
    ],
)
def test_lengths_larger_than_the_surface_bears_are_refused_with_the_number_to_write(
    vault, entry, given, write
):
    said = told(DOME, f"{entry}={given}", beside=vault)
    assert f"{entry}: " in said
    assert float(meant(said)) == write
    refuse_beside(load_case(DOME, [f"{entry}={meant(said)}"]), vault)


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("edges.ground=200", "edges.ground: lies away .* write 0.2"),
        ("net.ground=-300", "net.ground: lies away .* write -0.3"),
        ("net.outline=[[100, 100], [400, 100], [400, 200]]", r"net.outline: .* write 0.1, 0.1, 0.4, 0.1 …"),
        ("net.guides=[[[100, 20], [300, 20]], [[0, -0.2], [0, 0.2]]]", r"net.guides\[0\]: "),
        ('edges.stretch=[{kind = "wall", curve = [[100, 50], [400, 50]]}]', r"edges.stretch\[0\].curve: "),
        ("part.concrete.openings=[[[100, 50], [400, 50], [400, 200]]]", r"part.concrete.openings\[0\]: "),
        ("part.concrete.inside=[[[100, 50], [400, 50], [400, 200]]]", r"part.concrete.inside\[0\]: "),
        ("edges.ground=1e9", "lies away from the surface.*Give metres.$"),
    ],
)
def test_levels_and_curves_far_from_the_surface_are_refused(vault, setting, said):
    assert re.search(said, told(DOME, setting, beside=vault))


@pytest.mark.parametrize(
    ("settings", "left_out"),
    [
        (["optimise.misfit_rms_additional=1.0"], "optimise.misfit_rms_additional={}"),
        (["limits.deviation=20"], "limits.deviation={}"),
        (["cable.force_max=1e4", "cable.stiffness=187"], "cable.force_max={}"),
    ],
)
def test_a_limit_as_large_as_a_wrong_unit_s_is_told_how_it_limits_nothing(vault, settings, left_out):
    said = told(VAULT, *settings, beside=vault)
    number = re.search(r"or (?:cable\.force_max = )?(\S+) for no limit", said)[1]
    case = read(VAULT, [*settings, left_out.format(number)], vault)
    assert doubts(case, vault) == ()


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("optimise.misfit_rms_additional=1e3", "is 1000 m: more than the surface's larger side, so that it"),
        (
            "cable.force_max=1e9",
            r"is 1 × 10⁹ N: so much as no cable of 187 N bears, so that it limits nothing",
        ),
    ],
)
def test_a_limit_that_is_in_no_other_unit_either_limits_nothing_and_is_told(vault, setting, said):
    case = read(VAULT, [setting], vault)
    (doubt,) = doubts(case, vault)
    assert re.search(said, doubt), doubt


def test_light_points_beside_concrete_leave_no_doubt(vault):
    clips = 'part.rods={kind = "points", force = 0.01}'
    assert doubts(read(DOME, [clips], vault), vault) == ()


def test_cables_that_begin_beyond_their_largest_force_are_told_a_ratio_with_which_they_do_not(vault):
    case = load_case(VAULT, ["cable.rest_ratio=0.9"])
    (doubt,) = doubts(case, vault)
    ratio = re.search(r"With (cable.rest_ratio = \S+) cables begin within it\.", doubt)[1]
    assert doubts(load_case(VAULT, [ratio]), vault) == ()


def test_openings_of_the_vault_s_case_in_millimetres_are_refused(vault):
    case = load_case(VAULT)
    refuse_beside(case, vault)
    corners = [[[1e3 * x, 1e3 * y] for x, y in polygon] for polygon in case.load.openings]
    assert "For millimetres write 0.602, 0, 0.584, 0.066 …" in told(
        VAULT, f"load.openings={corners}", beside=vault
    )


def test_shipped_cases_leave_no_doubt(vault):
    for case in (DOME, VAULT):
        assert doubts(load_case(case), vault) == ()


@pytest.mark.parametrize(
    ("case", "settings", "said"),
    [
        (
            VAULT,
            ["load.force=6900"],
            "load.force is 6\u202f900 N: .*as 47 m of concrete. .*For 6900 mN write 6.9.",
        ),
        (VAULT, ["load.force=0.0069"], "load.force is 0.0069 N: 1.14 N/m², .*For 0.0069 kN write 6.9."),
        (
            VAULT,
            ["load.force=400"],
            "load.force is 400 N: .*as 2.7 m of concrete. Is the unit right.$",
        ),
        (DOME, ["part.concrete.density=25000"], "10 times what concrete has.* For 25000 N/m³ write 2548.42."),
        (DOME, ["part.concrete.thickness=0.1"], "a 9th of the surface's .* For 0.1 cm write 0.001."),
        (
            VAULT,
            ["rod.density=40000"],
            "density is 40000 kg/m³: more than any .* For 40000 N/m³ write 4077.47.",
        ),
        (DOME, ['part.rods={kind = "membrane", mass = 400}'], "mass is 400 kg/m².*For 400 g/m² write 0.4."),
        (DOME, ['part.rods={kind = "joints", mass = 5}'], "mass is 5 kg: .*For 5 g write 0.005."),
        (DOME, ["net.outline=[[-400, -200], [400, -200], [400, 200]]"], "887 times as wide as the surface"),
        (DOME, ["cable.force_max=5"], "less than the 52.1 N to which cable.rest_ratio strains"),
    ],
)
def test_what_is_only_unusual_is_told(vault, case, settings, said):
    case = load_case(case, settings)
    refuse_beside(case, vault)
    (doubt,) = doubts(case, vault)
    assert re.search(said, doubt), doubt


def test_rods_that_are_deeper_than_wide_may_be_so_beside_any_spacing():
    lath = ["rod={young = 12e9, strength = 30e6, width = 0.01, height = 0.02}"]
    assert load_case(DOME, lath).rod.height == 0.02
    with pytest.raises(InputError, match=r"rod.width: makes rods 0.06 m wide, which are 0.048 m apart"):
        load_case(DOME, ["rod={young = 12e9, strength = 30e6, width = 0.06, height = 0.01}"])


def test_a_gap_as_wide_as_half_the_spacing_is_refused():
    assert re.search(r"joint.gap: must be well below net.spacing \(0.055 m\)", told(VAULT, "joint.gap=0.1"))
    assert "rods more than 0.056 m apart (net.spacing)" in told(VAULT, "rod.radius=0.014", "joint.gap=0.028")
    load_case(VAULT, ["rod.radius=0.014", "joint.gap=0.028", "net.spacing=0.0561"])


@pytest.mark.parametrize(
    ("setting", "said"),
    [
        ("rod.section=51 mm", "rod.section: is not in the catalogue"),
        ('edges.beam={catalogue = "edge_tubes", section = "51 mm"}', "edges.beam.section: is not in the"),
        ("rod.catalogue=bamboo", "catalogue "),
        ("surface.file=" + 300 * "a", "surface.file: is no file's name"),
    ],
)
def test_names_of_nothing_are_refused_with_the_case_file_in_which_they_stand(setting, said):
    assert told(DOME, setting).startswith(f"{DOME}: {said}")
    assert told(DOME, "joint.gap=0.002", setting).startswith(f"{DOME}: {said}")


def test_what_can_t_be_on_the_surface_is_refused_by_check_with_the_case_file(tmp_path):
    text = DOME.read_text(encoding="utf-8").replace("../surfaces", (ROOT / "surfaces").as_posix())
    file = tmp_path / "case.toml"
    file.write_text(text.replace("thickness = 0.011", "thickness = 0.5"), encoding="utf-8")
    with pytest.raises(InputError) as refused:
        check_file(file, {}, allow_scripts=False)
    assert str(refused.value).startswith(f"{file}: part.concrete.thickness: makes a block")
