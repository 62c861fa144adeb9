"""Where errors take a structure, to first order, beside structures drawn and solved again."""

from dataclasses import fields, replace

import numpy as np
import pytest

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.drawing import errors_of, variables
from shellform.reliability.first_order import moved_by_cause, moved_from
from shellform.reliability.standing import Workshop
from shellform.structure.network import assemble

ONE = Tolerances(**{each.name: 0.01 for each in fields(Tolerances)})
SIZES = {"cable_length": 1e-4, "supports": 1e-4, "marks": 1e-4, "shape": 1e-4, "rod_bow": 1e-3}


def of_one(cause, times=1.0):
    return replace(Tolerances(), **{cause: times * SIZES.get(cause, 0.02)})


@pytest.mark.parametrize("cause", ONE.causes)
def test_the_error_of_the_first_order_falls_with_the_square_of_the_errors(nominal, cause):
    """The slope of |x(h) - x(0) - h dx| over h between 1/4, 1/8 and 1/16 of an error is two."""
    state, load, workshop = nominal.states[-1], nominal.factors[-1] * nominal.load, Workshop(nominal)
    assembly, left = assemble(nominal.network), []
    for times in (1 / 4, 1 / 8, 1 / 16):
        errors = errors_of(nominal.members, of_one(cause, times), variables(nominal.members, 3, 0))
        moved = moved_from(assembly, state, load, nominal.present, [errors], nominal.imperfections)
        (way,) = moved.translations
        end = workshop.load(errors)
        assert end.stands
        left.append(np.abs(end.state.positions - state.positions - way).max())
    assert left[-1] < 1e-9 or np.log2(left[0] / left[2]) / 2.0 == pytest.approx(2.0, abs=0.35)


def test_causes_are_told_apart_and_each_moves_the_shell_as_drawn_structures_do(nominal):
    small = replace(Tolerances(), supports=1e-5, marks=3e-5, load_each=0.01)
    told = moved_by_cause(nominal, small, seed=2, drawn=12)
    assert set(told) == {"supports", "marks", "load_each"}
    workshop, place = Workshop(nominal), nominal.states[-1].positions
    for cause, expected in told.items():
        alone = replace(Tolerances(), **{cause: getattr(small, cause)})
        made = workshop.load_numbers(alone, seed=2, numbers=range(12))
        squares = [((each.state.positions - place) ** 2).sum(axis=1).mean() for each in made]
        assert np.sqrt(np.mean(squares)) == pytest.approx(expected, rel=0.02)


def test_where_nothing_is_off_no_cause_is_told(nominal):
    assert moved_by_cause(nominal, Tolerances()) == {}
