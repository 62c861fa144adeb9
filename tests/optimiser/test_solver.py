"""The optimiser's settings: what is refused, and what polishing changes."""

from dataclasses import fields

import pytest

from shellform.errors import InputError
from shellform.optimiser import solver
from shellform.optimiser.moving_asymptotes import MovingAsymptotes
from shellform.optimiser.solver import SequentialConvex

MAY_BE_ZERO = {
    "thin", "stiffness", "most_cables", "guards", "many", "recovery", "repairs", "idle", "kept", "least_tension",
    "stiffenings",
}  # fmt: skip


@pytest.mark.parametrize("name", [each.name for each in fields(SequentialConvex)])
def test_settings_are_positive_but_those_that_may_be_nothing(name):
    with pytest.raises(InputError, match=rf"solver\.{name}"):
        SequentialConvex(**{name: -1.0})
    if name in MAY_BE_ZERO:
        assert getattr(SequentialConvex(**{name: 0}), name) == 0
    else:
        with pytest.raises(InputError, match=rf"solver\.{name}"):
            SequentialConvex(**{name: 0.0})


@pytest.mark.parametrize("name", ["stiffness", "good", "poor", "near", "margin", "least_tension", "kept"])
def test_a_share_in_per_cent_is_refused_with_the_number_to_write(name):
    with pytest.raises(InputError, match=rf"solver\.{name}: must be .*For 97 % write 0.97\.$"):
        SequentialConvex(**{name: 97})
    assert getattr(SequentialConvex(**{name: 1.0}), name) == 1.0


@pytest.mark.parametrize("name", ["grow", "stiffer"])
def test_a_factor_in_per_cent_is_refused_with_the_number_to_write(name):
    with pytest.raises(InputError, match=rf"solver\.{name}: must be .*For 110 % write 1.1\.$"):
        SequentialConvex(**{name: 110})


@pytest.mark.parametrize("name", ["tolerance", "margin", "least_margin"])
def test_a_share_of_the_method_of_moving_asymptotes_in_per_cent_is_refused(name):
    with pytest.raises(InputError, match=rf"solver\.{name}: must be .*For 15 % write 0.15\.$"):
        MovingAsymptotes(**{name: 15})


def test_windows_shrink_and_grow():
    for shrink, grow in ((1.0, 1.6), (0.4, 0.99), (1.2, 1.6)):
        with pytest.raises(InputError, match="must shrink"):
            SequentialConvex(shrink=shrink, grow=grow)
    assert SequentialConvex(shrink=0.99, grow=1.0).grow == 1.0


def test_polishing_thins_nothing_in_steps_a_tenth_as_small_and_uses_up_a_fifth_of_the_stiffness():
    assert (solver.POLISHING.thin, solver.POLISHING.stiffness) == (False, 0.8)
    assert solver.POLISHING.smallest == pytest.approx(0.1 * SequentialConvex().smallest)
