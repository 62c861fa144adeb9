"""What the cases brought to light, each as small as it can be."""

import numpy as np
import pytest

from shellform import verification
from shellform.structure.answers.stability import critical_load
from shellform.structure.elements.state import at_rest
from shellform.structure.network import assemble
from shellform.structure.solve.drive import forces
from shellform.verification import buckling, suites
from shellform.verification.cables import hypar
from shellform.verification.compared import Comparison
from shellform.verification.models import (
    CLAMP,
    PIN,
    chain,
    in_plane,
    line,
    load_at,
    polyline,
    solved,
)


@pytest.mark.parametrize(("axial", "load"), [(1e8, 1e-6), (1e10, 1e-5)])
def test_a_small_load_on_a_stiff_rod_moves_it(axial, load):
    rod = chain(line(20), (axial, 1.0, 1.0, 1.0), {0: CLAMP})
    tip = solved(rod, load_at(rod, 20, [0.0, 0.0, load])).positions[-1, 2]
    assert 3.0 * tip / load == pytest.approx(1.0, rel=1e-3)


def test_a_small_load_across_a_strongly_compressed_rod_is_amplified():
    beam = in_plane(
        chain(line(40), (1e8, 1.0, 1.0, 1.0), {0: PIN, 40: [False, True, True, False, False, False]})
    )
    load = load_at(beam, 40, [-5.0, 0.0, 0.0]) + load_at(beam, 20, [0.0, 0.0, -1e-4])
    u = 0.5 * np.sqrt(5.0)
    sag = -48.0 * solved(beam, load).positions[20, 2] / 1e-4
    assert sag == pytest.approx(3.0 * (np.tan(u) - u) / u**3, rel=1e-2)


def test_lateral_buckling_of_a_frame_is_a_bifurcation():
    points = polyline([[0.0, 0.0, 0.0], [240.0, 0.0, 0.0], [240.0, 0.0, -240.0]], 10)
    frame = chain(points, buckling.FRAME, {0: CLAMP})
    load = load_at(frame, 20, [1.0, 0.0, 0.0])
    found = critical_load(assemble(frame), at_rest(points), forces(load), goal=1.4)
    assert np.abs((found.mode * load).sum()) < 1e-12  # the load does no work on the mode
    assert found.kind == "bifurcation"


def test_the_large_cases_come_only_where_they_are_asked_for(monkeypatch):
    def small():
        yield Comparison("small", "number", 1.0, 1.0, 0.0, "here")

    def large():
        yield Comparison("large", "number", 1.0, 1.0, 0.0, "here")

    monkeypatch.setattr(verification, "CASES", (small,))
    monkeypatch.setattr(verification, "LARGE", (large,))
    assert [row.case for row in verification.verify()] == ["small"]
    assert [row.case for row in verification.verify(large=True)] == ["small", "large"]


def test_a_net_like_the_large_one_is_found_back_exactly():
    network, shape = hypar(20)
    found = solved(network, start=at_rest(np.where(network.fixed[:, :3], shape, shape * [1.0, 1.0, 1.1])))
    np.testing.assert_allclose(found.positions, shape, atol=1e-8)


@pytest.mark.slow
def test_a_net_of_100_000_cables_is_found_back():
    assert all(row.passed for row in suites.large_net())
