"""Rods, edge beams and what they are laid with, of sizes that there can't be."""

import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.gridshell import loads
from shellform.gridshell.edge_beams import EdgeBeam
from shellform.gridshell.possible_rods import require_rods_material
from shellform.gridshell.tolerances import Tolerances, enlarged
from shellform.run.onsite import Survey
from shellform.run.sizes import DesignWish
from shellform.structure.elements.sections import Rectangle, Round, isotropic


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: sf.Rod.round(young=40.0, radius=0.001), r"material.young: .* For 40 GPa write 4e10\."),
        (lambda: sf.Rod.round(young=40e9, radius=1.3), r"rod.section: .* For 1.3 mm write 0.0013\."),
        (lambda: sf.Rod.round(young=40e9, radius=0.001, strength=255), r"material.strength: .* 255 MPa"),
        (lambda: sf.Rod.round(young=40e9, radius=0.001, density=2.0), r"material.density: .* 2 t/m³"),
        (lambda: sf.Joint(7e4, 7e-4, 8e-4, 2.4), r"joint.gap: .* For 2.4 mm write 0.0024\."),
        (lambda: EdgeBeam(Round(4.0, isotropic(young=40e9))), r"edges.beam: .* For 4 mm write 0.004\."),
        (lambda: EdgeBeam(Round(0.004, isotropic(young=210.0))), r"For 210 GPa write 2.1e11\."),
        (lambda: Tolerances(supports=2.0), r"tolerances.supports: .* For 2 mm write 0.002\."),
        (lambda: DesignWish(thickness=50.0), r"--thickness: .* For 50 mm write 0.05\."),
        (lambda: DesignWish(spacing=500.0), r"--spacing: .* For 500 mm write 0.5\."),
        (lambda: Survey(step=0.25), r"--step: .* For 0.25 mm write 0.00025\."),
        (lambda: Survey(largest=1.5), r"--largest: .* For 1.5 mm write 0.0015\."),
        (lambda: Survey(noise=2.0), r"--noise: .* For 2 mm write 0.002\."),
        (lambda: Survey(length_error=2.0), r"--length-error: .* For 2 mm write 0.002\."),
        (lambda: loads.pressure(50.0, 2500.0), r"load.thickness: .* For 50 mm write 0.05\."),
        (lambda: loads.pressure(0.05, 2.5), r"load.density: .* For 2.5 t/m³ write 2500\."),
    ],
)
def test_records_refuse_what_is_in_another_unit_with_the_number_to_write(make, said):
    with pytest.raises(InputError, match=said):
        make()


def test_no_material_is_so_light_and_stiff_or_so_stiff_and_weak():
    require_rods_material(900e9, None, 4e9, 2200.0, where="rod")
    require_rods_material(40e9, None, float("inf"), 0.0, where="rod")
    with pytest.raises(InputError, match=r"rod.density: is too little .* For 20 kN/m³ write 2038.74\."):
        require_rods_material(40e9, None, 255e6, 20.0, where="rod")
    with pytest.raises(InputError, match=r"rod.strength: is less than a 100000th .* 255000 kPa write"):
        require_rods_material(40e9, 15e9, 255e3, 2000.0, where="rod")


def test_rods_as_thick_as_they_are_apart_make_no_grid(net, vault):
    joint, cable = sf.Joint(7.15e4, 7.38e-4, 7.85e-4, net.grid.gap), sf.Cable(187.0)
    with pytest.raises(InputError, match=r"rod.section: makes rods 1.2 m wide.*For 0.6 mm write 0.0006\."):
        sf.brace(net, sf.Rod.round(young=40e9, radius=0.6), joint, cable, below=vault)
    lath = sf.Rod(Rectangle(0.8, 0.002, isotropic(young=12e9)))
    with pytest.raises(InputError, match=r"rod.section: makes rods 0.8 m wide.*For 0.8 mm write 0.0008\."):
        sf.brace(net, lath, joint, cable, below=vault)


def test_an_edge_beam_may_be_higher_than_any_rod():
    beam = Rectangle(0.4, 1.2, isotropic(young=11e9, strength=28e6, density=450.0))
    assert EdgeBeam(beam).section.sizes == (0.4, 1.2)
    with pytest.raises(InputError, match=r"rod.section: must be between 1e-5 and 0.9 m"):
        sf.Rod(beam)


def test_concrete_as_thick_as_a_fifth_of_its_surface_is_refused(net, vault):
    thick = 0.21 * float(vault.size.max())
    with pytest.raises(InputError, match=r"load.thickness: makes a block of a surface"):
        loads.concrete(net, vault, thickness=thick)
    assert loads.concrete(net, vault, thickness=0.1 * thick)[:, 2].sum() < 0.0


def test_enlarged_places_stay_what_a_place_may_be_off():
    assert enlarged(Tolerances(supports=0.9), 1.5).supports == 1.0
