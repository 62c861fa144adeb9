"""A calibration's table, and the fit of stiffnesses on which nodes depend by their logarithms alone."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.site import calibration
from shellform.site.calibration import Calibration
from shellform.site.markers import Markers

JOINT = sf.Joint(axial=100.0, torsion=2.0, bending=5.0, gap=0.01)
PLACES = np.random.default_rng(0).normal(size=(4, 3))
RATES = 0.01 * np.random.default_rng(1).normal(size=(2, 4, 6, 2))  # of two scans by torsion and bending


def test_the_table_has_millimetres_of_both_models_their_means_and_their_largest_without_markers_that_are_missing():
    before = np.array([[0.003, 0.001], [0.005, np.nan]])
    after = np.array([[0.001, np.nan], [0.0005, np.nan]])
    made = Calibration(
        JOINT, (), (), None, Markers(np.array([7, 4]), np.array([3, -1]), ("V5", "U1")), (), before, after, 0.0, (), 0, 0
    )  # fmt: skip
    rows = made.table().splitlines()
    assert rows[0] == "pos.,node,crossing,rod,1 start,1,2 start,2"
    assert rows[1] == "1,7,3,V5,3.000,1.000,1.000,"
    assert rows[2] == "2,4,,U1,5.000,0.500,,"
    assert rows[3] == "mean,,,,4.000,0.750,1.000,"
    assert rows[4] == "max,,,,5.000,1.000,1.000,"


def test_markers_are_called_as_drawings_call_them_and_by_node_between_crossings():
    made = Markers(np.array([7, 4]), np.array([3, -1]), ("V5", "U1"))
    assert made.called([0, 1]) == "crossing 3 (rod V5), node 4 of rod U1"


class Model:
    """Nodes move by RATES times the logarithms; trials with more than thrice the bending leave the branch."""

    def __init__(self):
        self.trials = 0
        self.shell = SimpleNamespace(joint=JOINT)

    def states(self, joint):
        q = np.log([joint.torsion / JOINT.torsion, joint.bending / JOINT.bending])
        return [SimpleNamespace(positions=PLACES + each[:, :3] @ q) for each in RATES]

    def near(self, joint, _states):
        self.trials += 1
        return None if joint.bending > 3.0 * JOINT.bending else self.states(joint)

    def jacobian(self, _joint, _states, names):
        return RATES[..., [("torsion", "bending").index(name) for name in names]]


def fit(truth, noise=0.0, frame=None, hidden=False, begun=JOINT):
    model = Model()
    points = [each.positions + noise for each in model.states(truth)]
    if hidden:
        points[1][2] = np.nan
    matches = [SimpleNamespace(places=lambda given: given)] * 2
    scans = [SimpleNamespace(points=each, frame=frame) for each in points]
    return calibration._Fit(model, begun, model.states(begun), scans, matches, np.arange(4), False)


@pytest.mark.parametrize("bending", [9.0, 2.0, 14.9])
def test_stiffnesses_are_found_by_their_logarithms_and_others_stay(bending):
    truth = sf.Joint(axial=100.0, torsion=3.1, bending=bending, gap=0.01)
    joint, states = fit(truth, hidden=True).solve(("torsion", "bending"))
    assert (joint.torsion, joint.bending) == pytest.approx((3.1, bending), rel=1e-6)
    assert (joint.axial, joint.gap) == (100.0, 0.01)
    assert states[1].positions == pytest.approx(Model().states(truth)[1].positions)
    joint, _ = fit(sf.Joint(axial=100.0, torsion=3.1, bending=5.0, gap=0.01)).solve(("torsion",))
    assert joint.torsion == pytest.approx(3.1, rel=1e-6)
    assert joint.bending == 5.0


def test_a_stiffness_is_sought_up_to_a_thousand_times_that_of_the_start_however_often_it_is_fitted():
    far = sf.Joint(axial=100.0, torsion=1e8, bending=2.0, gap=0.01)
    once, _ = fit(far).solve(("torsion",))
    assert once.torsion == pytest.approx(1e3 * JOINT.torsion, rel=1e-3)
    again, _ = fit(far, begun=once).solve(("torsion",))
    assert again.torsion == pytest.approx(1e3 * JOINT.torsion, rel=1e-3)


def test_the_deviation_of_a_coordinate_is_that_of_the_residuals_over_what_is_left_to_them():
    """Each of 8 markers is 2 mm off along x: 8 · 4 mm² over 24 coordinates less two stiffnesses; one
    scanner's place takes them all away, and six coordinates."""
    off = np.array([0.002, 0.0, 0.0])
    assert fit(JOINT, off).dof == 24
    assert fit(JOINT, off).deviation(2) == pytest.approx(np.sqrt(32e-6 / 22.0))
    assert fit(JOINT, off).deviation(24) == np.inf
    assert fit(JOINT, off, hidden=True).dof == 21
    assert fit(JOINT, off, frame=0).dof == 18
    assert fit(JOINT, off, frame=0).deviation(2) == pytest.approx(0.0, abs=1e-12)
