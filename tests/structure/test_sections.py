"""Cross-sections, their derivatives, stresses and the sensitivities that use them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.quantities import newtons, number
from shellform.structure.answers.results import (
    elongation,
    end_stress,
    end_stress_by_force,
    energy_by_kind,
    read_sections,
    stiffness_doubts,
    twist,
    utilisation,
)
from shellform.structure.answers.sensitivity import (
    by_load,
    by_rest_length,
    by_stiffness,
    direct,
    element_columns,
    gradients,
    predicted,
    respond,
    state_by_design,
    stiffness_rate,
    tension_rows,
)
from shellform.structure.elements.beam import make_beams
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.sections import (
    Material,
    Rectangle,
    Round,
    Tube,
    isotropic,
    mass_per_length,
    stiffness,
    stiffness_by_size,
    stress,
    stress_by_force,
    stress_by_size,
)
from shellform.structure.elements.state import at_rest
from shellform.structure.network import Network, assemble
from shellform.structure.solve import factorisation
from shellform.structure.solve.equilibrium import find_equilibrium

GFRP = isotropic(young=40e9, poisson=0.25, density=1900.0, strength=255e6)


def test_torsion_constants_of_rectangles_are_the_tabulated_ones():
    # Timoshenko and Goodier, table in art. 109: J / (a b³) for a/b = 1, 2, 10.
    for ratio, tabulated in [(1.0, 0.1406), (2.0, 0.229), (10.0, 0.312)]:
        assert Rectangle(ratio, 1.0, GFRP).constants[1] / ratio == pytest.approx(tabulated, abs=6e-4)
        assert Rectangle(1.0, ratio, GFRP).constants[1] / ratio == pytest.approx(tabulated, abs=6e-4)


def test_a_tube_without_a_hole_is_a_round_rod():
    rod, tube = Round(0.01, GFRP), Tube(0.01, 0.01 * (1 - 1e-9), GFRP)
    np.testing.assert_allclose(stiffness(tube), stiffness(rod), rtol=1e-12)
    assert mass_per_length(rod) == pytest.approx(1900 * np.pi * 1e-4)


@pytest.mark.parametrize(
    "make",
    [
        lambda r: Round(r, GFRP),
        lambda r, t: Tube(r, t, GFRP),
        lambda b, h: Rectangle(b, h, GFRP),
        lambda h, b: Rectangle(b, h, GFRP),
    ],
    ids=["round", "tube", "wide", "tall"],
)
def test_the_derivatives_of_stiffness_pass_the_taylor_test(make):
    sizes = np.array([0.013, 0.004])[: make.__code__.co_argcount]
    section = make(*sizes)
    order = list(sizes) == list(section.sizes)
    rates = stiffness_by_size(section) if order else stiffness_by_size(section)[::-1]
    for k, rate in enumerate(rates):
        errors = []
        for step in (1e-3, 5e-4):
            moved = sizes.copy()
            moved[k] *= 1.0 + step
            change = np.array(stiffness(make(*moved))) - stiffness(section)
            errors.append(np.abs(change - rate * sizes[k] * step) / np.abs(stiffness(section)))
        ratio = errors[0] / np.maximum(errors[1], 1e-16)
        assert ((ratio > 3.5) | (errors[0] < 1e-12)).all()


def test_stresses_are_those_of_the_outermost_fibre():
    rod, lath = Round(0.01, GFRP), Rectangle(0.02, 0.03, GFRP)
    assert stress(rod, 0.0, 3.0, 4.0) == pytest.approx(5.0 * 0.01 / rod.constants[2])
    assert stress(rod, -100.0, 0.0, 0.0) == pytest.approx(100.0 / (np.pi * 1e-4))
    assert stress(lath, 0.0, 1.0, 0.0) == pytest.approx(6.0 / (0.02 * 0.03**2))
    assert stress(lath, 0.0, 0.0, -1.0) == pytest.approx(6.0 / (0.03 * 0.02**2))


def test_impossible_sections_and_materials_are_refused():
    for make, message in [
        (lambda: Round(-1.0, GFRP), "radius.*positive"),
        (lambda: Tube(0.01, 0.02, GFRP), "less than the radius"),
        (lambda: Rectangle(0.01, float("inf"), GFRP), "height.*finite"),
        (lambda: Material(0.0, 1.0), "young"),
        (lambda: Material(1.0, 1.0, -1.0), "density"),
        (lambda: isotropic(young=1.0, poisson=0.5), "poisson"),
    ]:
        with pytest.raises(InputError, match=message):
            make()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("rod = 3", "must be a table"),
        ("[rod]\nshape = 'star'", "unknown shape.*round, tube, rectangle"),
        ("[rod]\nshape = ['round']", "unknown shape.*round, tube, rectangle"),
        ("[rod]\nshape = 'round'\nyoung = 1\npoisson = 0.3", "'radius' is missing"),
        ("[rod]\nshape = 'round'\nradius = 1\nyoung = 1", "shear or poisson"),
        ("[rod]\nshape = 'round'\nradius = 'thick'\nyoung = 1\nshear = 1", "must be a number"),
        ("[rod]\nshape = 'round'\nradius = 1\nyoung = 1\nshear = 1\nwidth = 2", "unknown entry 'width'"),
        ("[rod", "can't be read"),
    ],
)
def test_bad_section_files_are_refused(tmp_path, text, message):
    file = tmp_path / "sections.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError, match=message):
        read_sections(file)


def test_section_files_are_read(tmp_path):
    file = tmp_path / "sections.toml"
    file.write_text(
        "[rod]\nshape='tube'\nradius=0.02\nthickness=0.003\nyoung=40e9\nshear=4e9\nstrength=2e8\n",
        encoding="utf-8",
    )
    assert read_sections(file)["rod"] == Tube(0.02, 0.003, Material(40e9, 4e9, 0.0, 2e8))


@pytest.mark.parametrize(
    ("entry", "given", "write"),
    [
        ("radius", "4", "For 4 mm write 0.004."),
        ("thickness", "3", "For 3 mm write 0.003."),
        ("young", "40", "For 40 GPa write 4e10."),
        ("shear", "15e3", "For 15000 MPa write 1.5e10."),
        ("strength", "255", "For 255 MPa write 2.55e8."),
        ("density", "2.0", "For 2 t/m³ write 2000."),
    ],
)
def test_sections_in_another_unit_are_refused_with_the_number_to_write(tmp_path, entry, given, write):
    usual = {"radius": "0.02", "thickness": "0.003", "young": "40e9", "shear": "4e9", "density": "0"}
    file = tmp_path / "sections.toml"

    def read(entries):
        lines = "".join(f"{name} = {value}\n" for name, value in {**usual, **entries}.items())
        file.write_text(f"[rod]\nshape = 'tube'\n{lines}", encoding="utf-8")
        return read_sections(file)["rod"]

    with pytest.raises(InputError, match=rf"\[rod\]\.{entry}: must be between") as told:
        read({entry: given})
    assert write in told.value.remedy
    read({entry: re.search(r"write (\S+)\.", write)[1]})


def test_sections_that_resist_in_another_way_than_the_model_s_beams_are_told():
    network, _, section = frame()
    for times, told in ((1.0, ()), (1.012, ()), (0.988, ()), (1.014, ("EIy", "EIz")), (1.03, ("EA", "EIy"))):
        found = stiffness_doubts(network.beams, {"rod": Round(times * 0.012, GFRP)})
        assert len(found) == bool(told)
        for name in told:
            assert name in found[0]
    (doubt,) = stiffness_doubts(network.beams, {"rod": Round(2.0 * 0.012, GFRP)})
    axial, _, bending, _ = stiffness(section)
    assert doubt.startswith("beams of kind 'rod' resist with EA ")
    assert f"EIy {number(bending)} N·m², EIz {number(bending)} N·m² in the model" in doubt
    assert f"their section with EA {newtons(4.0 * axial)}, EIy {number(16.0 * bending)} N·m²" in doubt
    joint = network.beams.kinds.index("connector")
    assert joint == 1
    (doubt,) = stiffness_doubts(network.beams, {"rod": section, "connector": section})
    assert doubt.startswith("beams of kind 'connector'")


def frame(radius=0.012, connector=50.0, ratio=0.98):
    """A clamped, bent cantilever of rods with a connector in the middle and two prestressed cables."""
    angle = np.linspace(0.0, 1.0, 9)
    points = np.vstack(
        [np.column_stack([np.sin(angle), 0.1 * angle**2, 1.0 - np.cos(angle)]), [[0.8, -0.6, 0.0]]]
    )
    ends = [[k, k + 1] for k in range(8)]
    section = Round(radius, GFRP)
    rod, joint = stiffness(section), (1e6, 40.0, connector, connector)
    values = np.array([joint if k == 4 else rod for k in range(8)])
    beams = make_beams(
        points, ends, axial=values[:, 0], torsion=values[:, 1], bending_y=values[:, 2],
        bending_z=values[:, 3],
        kind=[int(k == 4) for k in range(8)], kinds=("rod", "connector"),
    )  # fmt: skip
    pairs = np.array([[9, 8], [9, 5]])
    length = np.linalg.norm(points[pairs[:, 1]] - points[pairs[:, 0]], axis=1)
    cables = make_cables(pairs, rest_length=ratio * length, stiffness=2000.0)
    fixed = np.zeros((10, 6), dtype=bool)
    fixed[[0, 9]] = True
    load = np.zeros((10, 6))
    load[8, 2], load[4, 1] = -30.0, 12.0
    return Network(points, beams, cables, fixed, np.zeros((10, 6))), load, section


def solved(network, load):
    return find_equilibrium(assemble(network), at_rest(network.nodes), load, tolerance=1e-11).state


def measured(network, state, section):
    """Some displacements, the tensions, and the bending moments at all beam ends."""
    forces = network.beams.local_forces(state)
    return np.concatenate([state.positions[[3, 8]].ravel(), network.cables.tension(state), forces.ravel()])


def rows(assembly, network, state):
    """The partial derivatives of `measured` by the free degrees of freedom."""
    picked = np.zeros((6, len(assembly.free)))
    for k, (node, axis) in enumerate([(n, a) for n in (3, 8) for a in range(3)]):
        picked[k, np.flatnonzero(assembly.free == 6 * node + axis)] = 1.0
    tensions = tension_rows(assembly, state, network.cables).toarray()
    return np.vstack(
        [picked, tensions, beam_rows(assembly, network.beams, network.beams.local_forces_by_dof(state))]
    )


def beam_rows(assembly, beams, by_dof):
    """Rows (m q, f) on the free degrees of freedom from derivatives (m, q, 12) of q values of each beam."""
    each = np.repeat(beams.dofs(), by_dof.shape[1], axis=0)
    return element_columns(assembly, each, by_dof.reshape(len(each), -1)).toarray().T


def test_sensitivities_to_rest_length_radius_connector_and_load_match_solved_neighbours():
    network, load, section = frame()
    state = solved(network, load)
    assembly = assemble(network)
    by_radius = stiffness_rate(network.beams, "rod", tuple(stiffness_by_size(section)[0]))
    by_connector = stiffness_rate(network.beams, "connector", (0.0, 0.0, 1.0, 1.0))
    response = respond(
        assembly,
        state,
        by_rest_length(assembly, state, network.cables),
        by_stiffness(assembly, state, by_radius, by_connector),
        by_load(assembly, load),
    )
    partial = np.zeros((6 + 2 + 56, 5))
    partial[6:8, :2] = np.diag(network.cables.tension_by_rest_length(state))
    partial[8:, 2] = by_radius.local_forces(state).ravel()
    partial[8:, 3] = by_connector.local_forces(state).ravel()
    picked = rows(assembly, network, state)
    total = gradients(response, picked, partial)
    np.testing.assert_allclose(
        partial + direct(response, picked), total, rtol=1e-9, atol=1e-9 * np.abs(total).max()
    )

    length = network.cables.rest_length
    variations = [
        (1e-4 * 0.012, lambda h: frame(radius=0.012 + h)[0], 2),
        (1e-2, lambda h: frame(connector=50.0 + h)[0], 3),
    ]
    for step, build, column in variations:
        ahead, behind = build(step), build(-step)
        slope = (
            measured(ahead, solved(ahead, load), section) - measured(behind, solved(behind, load), section)
        ) / (2 * step)
        np.testing.assert_allclose(total[:, column], slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())
    step = 1e-3
    slope = (
        measured(network, solved(network, (1 + step) * load), section)
        - measured(network, solved(network, (1 - step) * load), section)
    ) / (2 * step)
    np.testing.assert_allclose(total[:, 4], slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())
    for k in range(2):
        step = 1e-5
        found = []
        for sign in (1, -1):
            rest = length.copy()
            rest[k] += sign * step
            other = Network(
                network.nodes,
                network.beams,
                make_cables(network.cables.ends, rest_length=rest, stiffness=2000.0),
                network.fixed,
                network.imposed,
            )
            found.append(measured(other, solved(other, load), section))
        slope = (found[0] - found[1]) / (2 * step)
        np.testing.assert_allclose(total[:, k], slope, rtol=1e-4, atol=1e-6 * np.abs(slope).max())


def test_stresses_answer_to_the_radius_and_the_load_as_solved_neighbours_do():
    network, load, section = frame()
    state, assembly = solved(network, load), assemble(network)
    by_radius = stiffness_rate(network.beams, "rod", tuple(stiffness_by_size(section)[0]))
    response = respond(assembly, state, by_stiffness(assembly, state, by_radius), by_load(assembly, load))
    forces = network.beams.local_forces(state)
    own = end_stress_by_force(network.beams, forces, {"rod": section})
    partial = np.zeros((16, 2))
    partial[:, 0] = (own @ by_radius.local_forces(state)[:, :, None]).ravel()
    for end in range(2):
        rates = stress_by_size(section, forces[:, 0], forces[:, 2 + 3 * end], forces[:, 3 + 3 * end])[0]
        partial[end::2, 0] += np.where(network.beams.of_kind("rod"), rates, 0.0)
    by_dof = own @ network.beams.local_forces_by_dof(state)
    total = gradients(response, beam_rows(assembly, network.beams, by_dof), partial)

    def stresses(model, shape, under):
        return end_stress(model.beams, model.beams.local_forces(solved(model, under)), {"rod": shape}).ravel()

    rods = np.repeat(network.beams.of_kind("rod"), 2)
    step = 1e-4 * 0.012
    ahead, behind = frame(radius=0.012 + step), frame(radius=0.012 - step)
    slope = (stresses(ahead[0], ahead[2], load) - stresses(behind[0], behind[2], load)) / (2 * step)
    np.testing.assert_allclose(total[rods, 0], slope[rods], rtol=1e-4, atol=1e-5 * np.abs(slope[rods]).max())
    slope = (stresses(network, section, 1.001 * load) - stresses(network, section, 0.999 * load)) / 0.002
    np.testing.assert_allclose(total[rods, 1], slope[rods], rtol=1e-4, atol=1e-5 * np.abs(slope[rods]).max())


@pytest.mark.parametrize(
    "section",
    [Round(0.01, GFRP), Tube(0.01, 0.002, GFRP), Rectangle(0.02, 0.007, GFRP)],
    ids=lambda s: type(s).__name__,
)
def test_the_derivatives_of_stress_pass_the_taylor_test(section):
    at = np.array([120.0, -3.0, 2.0])
    by_force = np.array(stress_by_force(section, *at))
    by_size = stress_by_size(section, *at)
    value = stress(section, *at)
    for k in range(3):
        move = np.zeros(3)
        move[k] = 1e-4
        assert stress(section, *(at + move)) - value == pytest.approx(by_force[k] * 1e-4, rel=1e-3)
    for k, size in enumerate(section.sizes):
        sizes = list(section.sizes)
        sizes[k] = size * (1 + 1e-6)
        assert stress(type(section)(*sizes, GFRP), *at) - value == pytest.approx(
            by_size[k] * size * 1e-6, rel=1e-4
        )


def test_the_predicted_state_is_right_to_first_order():
    network, load, _ = frame()
    state, assembly = solved(network, load), assemble(network)
    response = respond(assembly, state, by_load(assembly, load))
    errors = []
    for change in (0.02, 0.01):
        guess = predicted(assembly, response, np.array([change]))
        errors.append(np.abs(guess.positions - solved(network, (1 + change) * load).positions).max())
    assert 1.7 < np.log2(errors[0] / errors[1]) < 2.3


def test_stress_and_utilisation_follow_the_section_of_each_kind():
    network, load, section = frame()
    forces = network.beams.local_forces(solved(network, load))
    found = end_stress(network.beams, forces, {"rod": section})
    assert np.isnan(found[4]).all()
    assert found[0, 0] == pytest.approx(
        abs(forces[0, 0]) / section.constants[0]
        + np.hypot(forces[0, 2], forces[0, 3]) * 0.012 / section.constants[2]
    )
    used = utilisation(network.beams, forces, {"rod": section})
    assert used[0] == pytest.approx(found[0].max() / 255e6)
    assert np.isnan(used[4])


@pytest.mark.parametrize("solver", factorisation.installed())
def test_tensions_by_rest_lengths_through_the_freedoms_they_touch_are_those_of_the_whole_solution(
    solver, monkeypatch
):
    monkeypatch.setenv("SHELLFORM_SOLVER", solver)
    network, load, _ = frame()
    state, assembly = solved(network, load), assemble(network)
    response = respond(assembly, state, by_rest_length(assembly, state, network.cables))
    picked = tension_rows(assembly, state, network.cables)
    whole = picked @ state_by_design(response)
    for _ in range(2):  # the second time with the same degrees of freedom
        np.testing.assert_allclose(
            direct(response, picked), whole, rtol=1e-9, atol=1e-10 * np.abs(whole).max()
        )
    np.testing.assert_allclose(direct(response, picked.toarray()), whole, rtol=1e-12)


def test_a_material_of_one_kind_in_all_directions_has_g_of_e_and_poisson_s_ratio():
    found = isotropic(young=42e9, poisson=0.4, density=1900.0, strength=255e6)
    assert found.shear == pytest.approx(15e9)
    assert (found.young, found.density, found.strength) == (42e9, 1900.0, 255e6)
    assert isotropic(young=39e9).shear == pytest.approx(15e9)
    assert isotropic(young=42e9, poisson=-0.5).shear == pytest.approx(42e9)
    for wrong in (-1.0, 0.5, 0.7):
        with pytest.raises(InputError, match=r"material\.poisson: must be above -1 and below 0\.5"):
            isotropic(young=42e9, poisson=wrong)


def test_a_strength_may_be_unknown_but_not_nothing_nor_less():
    assert Material(40e9, 15e9).strength == np.inf
    for wrong in (0.0, -1.0, np.nan, -np.inf):
        with pytest.raises(InputError, match=r"material\.strength: must be positive.*such as 255e6"):
            Material(40e9, 15e9, 1900.0, wrong)
    with pytest.raises(InputError, match=r"material\.young: must be positive and finite"):
        Material(np.inf, 15e9)
    with pytest.raises(InputError, match=r"material\.shear.*such as 15e9"):
        Material(40e9, -15e9)


def test_sizes_of_more_than_a_kilometre_and_walls_without_a_hole_are_refused_in_metres():
    with pytest.raises(InputError, match=r"section\.height: must be below 1000 m \(found 1001.0\)"):
        Rectangle(999.0, 1001.0, GFRP)
    assert Round(1000.0, GFRP).radius == 1000.0
    with pytest.raises(InputError, match=r"section\.thickness: must be less than the radius.*below 0\.02;"):
        Tube(0.02, 0.02, GFRP)


def test_the_torsion_constant_of_a_lath_that_is_nearly_square_changes_with_its_sides_as_derived():
    b, h, step = 0.02, 0.019, 1e-7
    rates = Rectangle(b, h, GFRP).constants_by_size[:, 1]
    for k, (db, dh) in enumerate([(step, 0.0), (0.0, step)]):
        ahead, behind = (Rectangle(b + s * db, h + s * dh, GFRP).constants[1] for s in (1, -1))
        assert rates[k] == pytest.approx((ahead - behind) / (2.0 * step), rel=1e-6)
    # 0.14057701495515551 a⁴ of a square
    assert Rectangle(0.02, 0.02, GFRP).constants[1] == pytest.approx(0.140577015 * 0.02**4, rel=1e-6)


def test_twist_is_the_second_end_s_turn_less_the_first_s_and_elongation_is_of_the_rest_length():
    assert twist(np.array([[9.0, 0.25, 9, 9, -0.5, 9, 9], [0, -0.1, 0, 0, 0.3, 0, 0]])) == pytest.approx(
        [-0.75, 0.4]
    )
    nodes = np.array([[1.0, 2.0, 3.0], [4.0, 2.0, 7.0]])
    cables = make_cables([[0, 1], [1, 0]], rest_length=[4.0, 8.0], stiffness=187.0)
    assert elongation(cables, at_rest(nodes)) == pytest.approx([0.25, -0.375])


def test_energies_of_kinds_are_half_the_work_of_their_forces_and_kinds_without_beams_are_left_out():
    network, load, _ = frame()
    network = replace(network, beams=replace(network.beams, kinds=("rod", "connector", "edge")))
    state = solved(network, load)
    found = energy_by_kind(network, state)
    assert list(found) == ["rod", "connector", "cable"]
    forces, moved_by = network.beams.local_forces(state), network.beams.local_deformations(state)
    rods = [k for k in range(8) if k != 4]
    for kind, own in (("rod", rods), ("connector", [4])):
        for name, parts in (("axial", [0]), ("torsion", [1, 4]), ("bending", [2, 3, 5, 6])):
            work = sum(0.5 * forces[k, part] * moved_by[k, part] for k in own for part in parts)
            assert found[kind][name] == pytest.approx(work)
            assert work > 0.0
    longer = network.cables.lengths(state) - network.cables.rest_length
    taut = np.maximum(longer, 0.0) ** 2 * 2000.0 / network.cables.rest_length
    assert found["cable"]["axial"] == pytest.approx(0.5 * taut.sum())
