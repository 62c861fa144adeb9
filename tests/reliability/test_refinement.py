"""Rod elements halved, Richardson's estimate, critical factors that are factors; and how structures fail."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability import refinement
from shellform.reliability.drawing import draw_errors
from shellform.reliability.failure import explained
from shellform.reliability.path_of_one import BIFURCATION, BORNE, LIMIT_POINT, Snap
from shellform.reliability.perfect import perfect, perfect_of
from shellform.reliability.refinement import critical_factor, critical_of, mesh_error, rods_halved
from shellform.reliability.standing import Workshop
from shellform.structure.answers.halved import Refined
from shellform.structure.answers.stability import modes
from shellform.structure.elements.cable import make_cables
from shellform.structure.elements.state import at_rest
from shellform.structure.model import Model
from shellform.structure.solve.residual import ResidualNorm
from shellform.verification import exact
from shellform.verification.buckling import braced_column
from shellform.verification.models import PIN, chain, in_plane, line, load_at

LARGE = Tolerances(cable_length=3e-4, supports=3e-4, marks=3e-4, load_each=0.1, load_all=0.05, connectors=0.1)


def test_richardsons_estimate_of_a_parabola_in_h_is_exact():
    found = Refined(coarse=2.0 + 0.5 * 0.1**2, fine=2.0 + 0.5 * 0.05**2)
    assert found.extrapolated == pytest.approx(2.0, abs=1e-15)
    assert found.error == pytest.approx(0.5 * 0.1**2, abs=1e-15)


def test_a_halved_model_has_twice_the_rod_elements_on_the_same_joints(dome, nominal):
    model = Model(nominal.network, {"load": nominal.load}, dome.target, ())
    finer = rods_halved(model)
    rods = (model.network.beams.kind == 0).sum()
    assert (finer.network.beams.kind == 0).sum() == 2 * rods
    assert finer.network.nodes[: len(nominal.load)] == pytest.approx(model.network.nodes, abs=0.0)
    assert finer.network.beams.rest_length.sum() == pytest.approx(model.network.beams.rest_length.sum())
    assert finer.network.cables == model.network.cables
    assert finer.loads["load"].sum() == nominal.load.sum()
    beams, nodes, count = model.network.beams, model.network.nodes, len(nominal.load)
    own = np.flatnonzero(beams.kind == 0)
    first, second = own, len(beams.ends) + np.arange(len(own))
    middle = finer.network.beams.ends[first, 1]
    np.testing.assert_array_equal(middle, count + np.arange(len(own)))
    np.testing.assert_array_equal(finer.network.beams.ends[second, 0], middle)
    np.testing.assert_array_equal(finer.network.beams.ends[second, 1], beams.ends[own, 1])
    np.testing.assert_allclose(finer.network.nodes[middle], nodes[beams.ends[own]].mean(axis=1))
    for half in (first, second):
        np.testing.assert_allclose(finer.network.beams.rest_length[half], 0.5 * beams.rest_length[own])
    assert not finer.network.fixed[count:].any()
    assert not finer.loads["load"][count:].any()


def test_the_deviation_moves_by_a_quarter_as_much_when_rods_are_halved_again(dome, nominal):
    model = Model(nominal.network, {"load": nominal.load}, dome.target, ())
    states = []
    for _ in range(4):
        states.append(perfect_of(model, "load", shapes=0).states[-1].positions[: len(nominal.load)])
        model = rods_halved(model)
    steps = [np.linalg.norm(b - a) for a, b in pairwise(states)]
    assert steps[1] / steps[2] == pytest.approx(4.0, rel=0.15)


def test_the_critical_factor_is_where_the_loaded_shell_loses_stability(dome, nominal):
    end = critical_factor(dome, dome.design(), nominal.load)
    assert 1.0 < end.factor < 3.0
    assert end.kind == LIMIT_POINT
    below, beyond = (perfect(dome, dome.design(), f * end.factor * nominal.load) for f in (0.999, 1.001))
    assert below.bears
    assert not beyond.bears


def test_a_load_that_is_borne_as_far_as_was_looked_has_no_critical_kind(dome, nominal):
    end = critical_factor(dome, dome.design(), 0.1 * nominal.load, sought=2.0)
    assert (end.factor, end.kind) == (2.0, BORNE)


def test_the_critical_factor_scales_with_the_load(dome, nominal):
    one, half = (critical_factor(dome, dome.design(), s * nominal.load).factor for s in (1.0, 0.5))
    assert half == pytest.approx(2.0 * one, rel=1e-3)


def low_arch(rise, elements=24):
    """Timoshenko's low arch, pinned, a half sine of the `rise` in radii of gyration, and the load in the same
    shape of which 1 is EI (pi/L)^4 times that radius; L = EI = 1. The height a of the arch under the load q
    is given by q = rise - a + a (rise^2 - a^2) / 4."""
    radius = 1.0 / 400.0
    points, along = line(elements), np.sin(np.pi * np.linspace(0.0, 1.0, elements + 1))
    points[:, 2] = rise * radius * along
    network = in_plane(chain(points, (radius**-2, 1.0, 1.0, 1.0), {0: PIN, elements: PIN}))
    # A taut string between the supports, which are held: forces of a size, against which none count as none.
    string = make_cables([[0, elements]], rest_length=0.5, stiffness=1.0)
    network = replace(network, cables=string)
    load = np.zeros((elements + 1, 6))
    load[:, 2] = -(np.pi**4) * radius * along / elements
    return Model(network, {"load": load}, at_rest(points), (0, elements))


@pytest.mark.parametrize(
    ("rise", "factor", "kind"),
    [
        # Fung and Kaplan, NACA TN 2840 (1952): from a rise of 22^0.5 radii on the arch sways aside where a^2
        # = rise^2 - 16, before it would snap through at a^2 = (rise^2 - 4) / 3.
        (8.0, 8.0 + 3.0 * 48.0**0.5, BIFURCATION),
        (4.4, 4.4 - 5.12**0.5 + 5.12**0.5 * (4.4**2 - 5.12) / 4.0, LIMIT_POINT),
    ],
)
def test_a_low_arch_sways_aside_before_it_snaps_through_where_it_is_high_enough(rise, factor, kind):
    model = low_arch(rise)
    share = {name: 0.5 * factor * load for name, load in model.loads.items()}
    end = critical_of(Model(model.network, share, model.start, model.supported))
    # O(h^2) of 24 chords, and what the arch isn't infinitely low.
    assert 0.5 * factor * end.factor == pytest.approx(factor, rel=0.01)
    assert end.kind == kind


def test_eulers_column_buckles_at_its_load_though_its_straight_path_goes_on():
    network = in_plane(chain(line(24), (1e6, 1.0, 1.0, 1.0), {0: PIN, 24: [False, *PIN[1:]]}))
    load = load_at(network, 24, [-4.0, 0.0, 0.0])
    end = critical_of(Model(network, {"load": load}, at_rest(network.nodes), (0, 24)))
    assert 4.0 * end.factor == pytest.approx(np.pi**2, rel=3e-3)  # O(h^2) late
    assert end.kind == BIFURCATION


def test_a_column_braced_by_prestressed_cables_buckles_at_timoshenkos_load():
    network = braced_column(24, 0.95)
    reference = exact.braced_column(50.0 / 0.95)
    model = Model(
        network, {"load": load_at(network, 24, [-8.0, 0.0, 0.0])}, at_rest(network.nodes), (0, 24, 25, 26)
    )
    end = critical_of(model)
    assert 8.0 * end.factor == pytest.approx(reference, rel=5e-3)
    assert end.kind == BIFURCATION


def test_mesh_errors_are_told_of_all_four_numbers(dome, nominal):
    found = mesh_error(dome, dome.design(), nominal.load)
    for each in (found.deviation_max, found.deviation_mean, found.stress, found.critical):
        assert each.coarse > 0.0
        assert each.fine != each.coarse
        assert abs(each.error) < 0.2 * each.coarse


def test_a_fallen_structure_is_explained_by_what_it_would_bear_without_each_cause(dome, nominal):
    workshop = Workshop(perfect(dome, dome.design(), 1.2 * nominal.load))
    outcomes = workshop.load_numbers(LARGE, seed=7, numbers=range(12))
    lost = sorted((each for each in outcomes if not each.stands), key=lambda each: each.factor)
    fallen = lost[len(lost) // 2]
    found = explained(workshop, LARGE, seed=7, number=fallen.number)
    assert set(found.without) == {name for name, value in vars(LARGE).items() if value}
    assert found.without[found.driver] == max(found.without.values()) > found.factor
    assert np.abs(found.mode[:, :3]).max() == pytest.approx(1.0)


def test_a_fallen_structure_gives_way_in_the_softest_mode_of_its_own_tangent(dome, nominal):
    """That of the perfect structure in its state is stressed by all errors: its softest is −3e4 N/m."""
    workshop = Workshop(perfect(dome, dome.design(), 1.2 * nominal.load))
    outcomes = workshop.load_numbers(LARGE, seed=7, numbers=range(12))
    number = next(each.number for each in outcomes if not each.stands and each.factor > 0.0)
    found = explained(workshop, LARGE, seed=7, number=number)

    def stiffness(own):
        held = own.assembly.free
        shape = found.mode.ravel()[held]
        tangent = own.assembly.matrix.full(own.assembly.evaluate(found.state).tangent)
        mass = ResidualNorm(own.assembly).mass_shape
        softest = modes(own.assembly, found.state, 1).stiffness[0]
        return float(shape @ (tangent @ shape) / (mass * shape * shape).sum()), softest

    errors = draw_errors(workshop.nominal.members, LARGE, 7, number)
    own, softest = workshop.with_structure(errors, stiffness)
    assert own == pytest.approx(softest, rel=1e-3, abs=1e-3)
    assert 0.0 < own < 10.0


def test_a_structure_that_stands_has_no_failure_to_explain(nominal):
    with pytest.raises(InputError, match="hasn't fallen"):
        explained(Workshop(nominal), Tolerances(), seed=0, number=0)


def test_a_snap_is_told_where_the_path_ends_with_rod_elements_halved_alone_and_the_structure_bears_on(
    dome, nominal, monkeypatch
):
    """The ends of both paths and what comes beyond are told: that a real structure goes on so is tested
    beside Workshop.beyond."""
    real, asked = refinement._limit, []
    snaps = (Snap(1.4, 0.001), Snap(1.6, 0.004))

    def ends(kinds, beyond):
        left = list(kinds)

        def limit(model, sought, resolution):
            workshop, end = real(model, 0.1, 0.05)
            kind = left.pop(0)
            return workshop, replace(end, kind=kind, factor=sought if kind == BORNE else 1.4)

        def went_on(self, errors, end, *, most, step):
            asked.append((end.factor, most))
            return beyond

        monkeypatch.setattr(refinement, "_limit", limit)
        monkeypatch.setattr(Workshop, "beyond", went_on)
        return mesh_error(dome, dome.design(), nominal.load, sought=2.0).snap

    assert ends((BORNE, BIFURCATION), (2.0, snaps)) == snaps[1]
    assert ends((BORNE, BIFURCATION), (1.9, snaps)) is None, "it falls before"
    assert ends((BORNE, BIFURCATION), (1.4, ())) is None
    assert asked == [(1.4, 2.0)] * 3
    assert ends((BORNE, BORNE), (2.0, snaps)) is None
    assert ends((LIMIT_POINT, BIFURCATION), (2.0, snaps)) is None
    assert len(asked) == 3, "nobody looks where both paths end, or neither"
