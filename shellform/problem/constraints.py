"""Constraints on terms: at most, at least, between.

The optimiser sees residuals, at most 0 where a constraint is met, as shares of a `scale` in the unit of the
term's values: value / scale - upper / scale, and lower / scale - value / scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_number
from shellform.gridshell.gridshell import Gridshell
from shellform.problem.terms import Term


class Constraint(Protocol):
    """lower <= every value of `term` <= upper, in the values' unit, infinite where there is no such side.
    Residuals are shares of `scale`, positive, in the same unit."""

    @property
    def term(self) -> Term: ...
    @property
    def lower(self) -> float: ...
    @property
    def upper(self) -> float: ...
    @property
    def scale(self) -> float: ...


@dataclass(frozen=True)
class _OneSided:
    """A `limit` in the unit in which the term takes limits; residuals are shares of it, or of `of`, which a
    limit of 0 needs."""

    limit: float
    term: Term
    of: float | None = None

    def __post_init__(self) -> None:
        _check(self.limit, self.of)
        _check_unit(self.limit, self.term)

    @property
    def _at(self) -> float:
        """The limit in the values' unit."""
        return self.term.at_limit(self.limit)

    @property
    def scale(self) -> float:
        """In the values' unit."""
        return abs(self._at) if self.of is None else self.of


@dataclass(frozen=True)
class AtMost(_OneSided):
    """Every value of the term is at most `limit`, in the unit in which the term takes limits; its residuals
    are shares of the limit, or of `of`, which a limit of 0 needs."""

    @property
    def lower(self) -> float:
        """None."""
        return -np.inf

    @property
    def upper(self) -> float:
        """In the values' unit."""
        return self._at


@dataclass(frozen=True)
class AtLeast(_OneSided):
    """Every value of the term is at least `limit`, in the unit in which the term takes limits; its residuals
    are shares of the limit, or of `of`, which a limit of 0 needs."""

    @property
    def lower(self) -> float:
        """In the values' unit."""
        return self._at

    @property
    def upper(self) -> float:
        """None."""
        return np.inf


@dataclass(frozen=True)
class Between:
    """Every value of the term lies between `least` and `most`, in the unit in which the term takes limits;
    residuals are shares of their distance."""

    least: float
    most: float
    term: Term

    def __post_init__(self) -> None:
        if not (np.isfinite([self.least, self.most]).all() and self.least < self.most):
            raise InputError(
                "the lower limit must lie below the upper one, both finite",
                where="constraints",
                value=(self.least, self.most),
                remedy="Change places of the two, or take AtLeast or AtMost for one side only.",
            )
        for limit in (self.least, self.most):
            _check_unit(limit, self.term)

    @property
    def lower(self) -> float:
        """In the values' unit."""
        return self.term.at_limit(self.least)

    @property
    def upper(self) -> float:
        """In the values' unit."""
        return self.term.at_limit(self.most)

    @property
    def scale(self) -> float:
        """In the values' unit."""
        return self.upper - self.lower


def count(constraint: Constraint, shell: Gridshell) -> int:
    """The number of residuals: one a value and side."""
    return constraint.term.size(shell) * (int(constraint.upper < np.inf) + int(constraint.lower > -np.inf))


def residuals(constraint: Constraint, values: Reals) -> Reals:
    """At most 0 where met: those of the upper side, then those of the lower side."""
    scale, sides = constraint.scale, []
    if constraint.upper < np.inf:
        sides.append(values / scale - constraint.upper / scale)
    if constraint.lower > -np.inf:
        sides.append(constraint.lower / scale - values / scale)
    return np.concatenate(sides)


def residual_rows(constraint: Constraint, rows: Reals) -> Reals:
    """The residuals' derivatives from those of the values, `rows` (g, s)."""
    sides = []
    if constraint.upper < np.inf:
        sides.append(rows / constraint.scale)
    if constraint.lower > -np.inf:
        sides.append(-rows / constraint.scale)
    return np.vstack(sides)


def _check(limit: float, of: float | None) -> None:
    require_number(limit, where="constraints", give="a limit in the term's unit, or leave the constraint out")
    if of is None and not limit > 0.0:
        raise InputError(
            "a limit must be positive",
            where="constraints",
            value=limit,
            remedy="Or say of what size its violations are a share, with `of`.",
        )
    if of is not None:
        require_number(
            of, above=0.0, where="constraints.of", give="the size of values that matter, in the term's unit"
        )


def _check_unit(limit: float, term: Term) -> None:
    """Raises InputError for a limit that can't be in the unit in which the term takes them."""
    try:
        term.at_limit(limit)
    except InputError as error:
        raise error.within("constraints") from error
