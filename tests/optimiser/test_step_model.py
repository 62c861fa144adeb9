"""How a step's model reads a design off its tensions and other values, and what pulls on the shell where they
change."""

import itertools
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse import csr_array, lil_array

import shellform as sf
from shellform.gridshell.gridshell import Design
from shellform.optimiser.step_model import StepModel, _sums_of_squares
from shellform.optimiser.step_setting import _forces, setting
from shellform.problem.evaluation import Evaluator
from shellform.problem.terms import Squares


def model_of(variables, *, tensions=2):
    """Of three cables, of which the second is absent; lengths go along with the tensions as told."""
    shell = SimpleNamespace(cable=SimpleNamespace(stiffness=100.0), cable_ends=[0] * 3)
    start = Design(np.array([1.0, 7.0, 2.0]), np.array([True, False, True]), 0.1)
    sizes = [3 if each.of_each_cable else 1 for each in variables]
    ends = np.cumsum([0, *sizes]).tolist()
    blocks = SimpleNamespace(
        shell=shell,
        variables=variables,
        slices=[slice(a, b) for a, b in itertools.pairwise(ends)],
    )
    origin = np.array([4.0, 10.0, 0.1])[-(tensions + 1) :] if tensions else np.array([0.1])
    given = {
        "evaluator": SimpleNamespace(shell=shell, blocks=blocks),
        "point": SimpleNamespace(design=start, constraints=np.array([0.5, -0.5])),
        "tensions": tensions,
        "shortest": np.full(2, 0.95),
        "longest": np.array([1.2, 2.5]),
        "origin": origin,
        "length": np.array([1.04, 2.2]),
        "answers": SimpleNamespace(lengthened=lambda change: np.array([0.01, -0.02]) * change[:2].sum()),
        "constraints_by_y": np.array([[1.0, 2.0, 0.0], [0.0, -1.0, 3.0]]),
    }
    unset = ("assembly", "state", "lower", "upper", "step", "quadratics")
    return StepModel(**{**dict.fromkeys(unset), **given})


@pytest.mark.parametrize("order", [1, -1])
def test_a_design_is_read_off_tensions_and_other_values_in_whichever_order_their_blocks_stand(order):
    """A tension of 5 N at the length 1.04 + 0.01 belongs to the rest length 100 / 105 times that; one of
    nothing to the longest."""
    model = model_of([sf.RestLengths(), sf.FreeRadius()][::order])
    made = model.design(np.array([5.0, 10.0, 0.13]))
    assert made.rest_length == pytest.approx([1.05 / 1.05, 7.0, 2.18 / 1.1])
    assert made.radius == pytest.approx(0.13)
    made = model.design(np.array([30.0, 0.99e-4, 0.13]))
    assert made.rest_length[2] == 2.5, "less than a millionth of the stiffness is no tension"
    assert made.rest_length[0] == 0.95, "and no cable is shorter than may be"
    made = model.design(np.array([4.0, 1.01e-4, 0.13]))
    assert made.rest_length[2] == pytest.approx(2.2 + 0.2, abs=1e-3)
    assert model.constraints_at(model.origin + np.array([0.1, 0.2, 0.3])) == pytest.approx([1.0, 0.2])


class Thinner(sf.FreeRadius):
    """A value by which the radius is divided."""

    def applied(self, shell, design, values):
        return replace(design, radius=design.radius / float(values[0]))


def test_other_values_are_taken_one_block_after_the_other():
    model = replace(
        model_of([sf.FreeRadius(), sf.RestLengths(), Thinner()]), origin=np.array([4.0, 10.0, 0.1, 1.0])
    )
    assert model.design(np.array([4.0, 10.0, 0.12, 4.0])).radius == pytest.approx(0.03)


def test_where_no_block_is_the_cables_lengths_the_values_are_taken_as_they_are():
    model = model_of([sf.FreeRadius()], tensions=0)
    made = model.design(np.array([0.17]))
    assert (made.radius, made.rest_length.tolist()) == (0.17, [1.0, 7.0, 2.0])


@pytest.fixture(scope="module")
def begun(dome):
    problem = sf.Problem(
        dome,
        sf.LoadCase("wet", dome.point_load(2.0, every=2)),
        [sf.Share(1.0, sf.Misfit("wet"))],
        variables=[sf.FreeRadius(), sf.RestLengths()],
    )
    present = np.arange(len(dome.cable_ends)) % 3 != 1
    design = replace(dome.design(rest_ratio=0.98), present=present)
    return Evaluator(problem, design), design


def test_a_step_is_set_from_the_cables_unit_pulls_and_what_the_radius_does_to_forces(dome, begun):
    evaluator, design = begun
    point = SimpleNamespace(design=design, states={"wet": dome.target})
    found = setting(evaluator, point)
    count = int(design.present.sum())
    assert (found.tensions, found.each) == (count, slice(1, 1 + len(dome.cable_ends)))
    assert (found.other.sum(), bool(found.other[0])) == (1, True)
    assert found.right.shape == (len(found.assembly.free), count + 1)
    ends = dome.cable_ends[design.present]
    chord = dome.target.positions[ends[:, 1]] - dome.target.positions[ends[:, 0]]
    length = np.linalg.norm(chord, axis=1)
    assert found.length == pytest.approx(length)
    rest = design.rest_length[design.present]
    assert found.tension == pytest.approx(np.maximum(187.0 * (length / rest - 1.0), 0.0))
    whole = np.zeros(6 * dome.node_count)
    whole[found.assembly.free] = found.pull[:, [5]].toarray()[:, 0]
    whole = whole.reshape(-1, 6)
    unit = chord[5] / length[5]
    assert whole[ends[5, 1], :3] == pytest.approx(unit)
    assert whole[ends[5, 0], :3] == pytest.approx(-unit)
    assert np.count_nonzero(np.abs(whole).sum(axis=1)) == 2
    forces = [
        evaluator.assembly(replace(design, radius=radius)).evaluate(dome.target, tangent=False).force
        for radius in (design.radius * 1.0001, design.radius * 0.9999)
    ]
    slope = ((forces[0] - forces[1]) / (2e-4 * design.radius)).ravel()[found.assembly.free]
    np.testing.assert_allclose(
        found.right[:, [count]].toarray()[:, 0], slope, rtol=1e-5, atol=1e-6 * np.abs(slope).max()
    )
    taut = found.tension > 0.0
    assert found.stiffness == pytest.approx(np.where(taut, 187.0 / rest, 0.0))
    assert found.parameters.shape == (count + 1, 1 + len(dome.cable_ends))
    assert found.parameters[[count], [0]] == 1.0


def test_sums_of_squares_under_the_design_load_are_told_apart_by_their_residuals():
    rows = csr_array(np.eye(2))
    same, again = Squares(np.array([1.0, 2.0]), rows), Squares(np.array([1.0, 2.0]), csr_array(np.eye(2)))
    longer, steeper = Squares(np.array([1.0, 3.0]), rows), Squares(np.array([1.0, 2.0]), 2.0 * rows)
    wide = Squares(np.array([1.0, 2.0]), csr_array(np.eye(2, 3)))
    given = [
        (same, "wet"),
        (None, "wet"),
        (again, "wet"),
        (longer, "wet"),
        (same, "wetter"),
        (steeper, "wet"),
        (wide, "wet"),
    ]
    parts = [SimpleNamespace(term=SimpleNamespace(load=load)) for _, load in given]
    evaluator = SimpleNamespace(base="wet", problem=SimpleNamespace(minimise=parts))
    point = SimpleNamespace(summands=[SimpleNamespace(squares=each) for each, _ in given])
    found, numbers = _sums_of_squares(evaluator, point)
    assert list(map(id, found)) == list(map(id, [same, longer, steeper, wide]))
    assert numbers == [0, None, 0, 1, None, 2, 3]


def test_values_that_change_lengths_and_radius_pull_by_what_they_do_to_both(dome, begun):
    """One makes the third cable and the sixth longer, the last cable that is present among them twice as
    much, and one the rods thicker; a cable that is absent changes nothing."""
    evaluator, design = begun
    last = int(np.flatnonzero(design.present)[-1])
    assert design.present[[3, 6]].all()
    assert not design.present[4]
    rate = lil_array((len(dome.cable_ends) + 1, 2))
    for cable, by in ((3, 1.0), (6, 1.0), (last, 2.0), (4, 50.0)):
        rate[cable, 0] = by
    rate[3, 1], rate[len(dome.cable_ends), 1] = -1.0, 0.1
    rate = csr_array(rate)
    assembly = evaluator.assembly(design)
    point = SimpleNamespace(design=design)
    found = _forces(evaluator, assembly, dome.target, point, rate).toarray()
    for column in range(2):
        change = rate[:, [column]].toarray()[:, 0]
        forces = [
            evaluator.assembly(
                replace(
                    design,
                    rest_length=design.rest_length + h * change[:-1],
                    radius=design.radius + h * change[-1],
                )
            )
            .evaluate(dome.target, tangent=False)
            .force.ravel()[assembly.free]
            for h in (1e-6, -1e-6)
        ]
        slope = (forces[0] - forces[1]) / 2e-6
        np.testing.assert_allclose(found[:, column], slope, rtol=1e-4, atol=1e-5 * np.abs(slope).max())
    alone = _forces(evaluator, assembly, dome.target, point, csr_array(rate[:, [0]])).toarray()
    np.testing.assert_allclose(alone[:, 0], found[:, 0])
