"""Residuals of constraints, told as shares of the limits that users gave."""

import numpy as np
import pytest

import shellform as sf
from shellform.optimiser.limits_told import not_kept, share_of_limit
from shellform.problem.constraints import residuals


@pytest.mark.parametrize(
    ("part", "value", "share"),
    [
        (sf.AtMost(0.005, sf.RmsMisfit("wetter")), 0.006**2, 1.2),
        (sf.AtMost(20.0, sf.CableForces("wet")), 24.0, 1.2),
        (sf.AtLeast(2.0, sf.ModalStiffness("wetter", 2.0)), 1.0, 0.5),
        (sf.AtLeast(2.0, sf.ModalStiffness("wetter", 2.0)), -1.0, 0.0),
        (sf.AtLeast(0.5, sf.LeastTension("dry", 0.5)), 0.4, 0.8),
        (sf.AtLeast(0.5, sf.LeastTension("dry", 0.5)), -0.4, 0.0),  # slack: it pulls with nothing
    ],
)
def test_a_residual_is_told_as_what_was_found_over_the_limit_as_it_was_given(part, value, share):
    """Squares of distances and of stiffness are limited where users give m and N/m."""
    (residual,) = residuals(part, np.array([value]))
    assert share_of_limit(part.term.name, residual) == pytest.approx(share, abs=1e-12)


def test_limits_that_are_kept_are_not_named_and_an_offset_one_has_no_share():
    found = {"misfit.half": 0.44, "cable_force": 0.0009, "softness.half": 0.19, "uplift.none": 0.3}
    assert not_kept(found) == ["misfit.half at 120.0% of it", "softness.half at 90.0% of it", "uplift.none"]
