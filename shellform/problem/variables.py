"""What is varied: blocks of design variables, side by side in one vector.

A block says its size and bounds, reads its values off a design, puts values into one, and says what its
change does to the model: the rates of the cables' rest lengths and of the rods' radius, on which the parts'
forces and stiffness depend. The optimiser's own variables are values over a `unit`, so that one step suits
them all.
"""

from __future__ import annotations

import itertools
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals, Record
from shellform.errors import InputError, require_number
from shellform.gridshell.gridshell import Design, Gridshell

_SAME = 1e-9  # relative
_THICKEST = 100.0  # times the start's radius: what is beyond can only be in another unit


@dataclass(frozen=True, eq=False)
class Rates(Record):
    """What the model's parameters change with the values of a block (v,): `rest_length` (c, v) sparse, of all
    candidate cables, and the rods' `radius` (v,); None stands for 0."""

    rest_length: sp.csc_array | None = None
    radius: Reals | None = None


class Variable(ABC):
    """A block of variables. A user's own derives from this class and says `size`, `values`, `applied`,
    `bounds` and `rates`.

    `of_each_cable`: whether its values are the rest lengths of all candidate cables, so that the step model
    may take their tensions instead.
    """

    of_each_cable: ClassVar[bool] = False

    @abstractmethod
    def size(self, shell: Gridshell) -> int:
        """The number v of its values."""

    @abstractmethod
    def values(self, shell: Gridshell, design: Design) -> Reals:
        """The values (v,) of a design, in their own unit."""

    @abstractmethod
    def applied(self, shell: Gridshell, design: Design, values: Reals) -> Design:
        """The design with the values (v,) in place of its own."""

    @abstractmethod
    def bounds(self, shell: Gridshell, start: Design) -> tuple[Reals, Reals]:
        """The least and the largest values (v,)."""

    @abstractmethod
    def rates(self, shell: Gridshell, design: Design) -> Rates:
        """What the model's parameters change with the values at a design."""

    def unit(self, shell: Gridshell, start: Design) -> Reals:
        """(v,), positive: the size of changes that matter as much as one another; the bounds' distance, where
        it isn't said."""
        lower, upper = self.bounds(shell, start)
        return np.asarray(upper - lower, dtype=float)

    def step(self, shell: Gridshell, start: Design, design: Design) -> Reals:
        """(v,), positive: the largest change in one step; a tenth of the bounds' distance, where it isn't
        said."""
        lower, upper = self.bounds(shell, start)
        return np.asarray(0.1 * (upper - lower), dtype=float)


@dataclass(frozen=True)
class RestLengths(Variable):
    """The rest lengths, m, of all candidate cables, at least `least`, m, and at most `most` times those of
    the start (3)."""

    least: float = 0.01
    most: float = 1.1
    of_each_cable = True

    def __post_init__(self) -> None:
        where = "variables.rest_lengths"
        require_number(self.least, above=0.0, where=f"{where}.least", give="metres, such as 0.01")
        give = "a factor of the lengths at the start, such as 1.1"
        require_number(self.most, above=0.0, below=100.0, where=f"{where}.most", give=give, share=True)

    def size(self, shell: Gridshell) -> int:
        """As many as candidate cables."""
        return len(shell.cable_ends)

    def values(self, shell: Gridshell, design: Design) -> Reals:
        """m."""
        return design.rest_length

    def applied(self, shell: Gridshell, design: Design, values: Reals) -> Design:
        """With these rest lengths."""
        return Design(values, design.present, design.radius)

    def bounds(self, shell: Gridshell, start: Design) -> tuple[Reals, Reals]:
        """m. Raises InputError where they contradict each other."""
        longest = self.most * start.rest_length
        if (longest < self.least).any():
            shortest = float(longest.min())
            raise InputError(
                f"is more than the largest length of a cable, {shortest:.3g} m",
                where="variables.rest_lengths.least",
                value=self.least,
                remedy=f"Give metres below that, such as {0.5 * shortest:.2g} (in a case: optimise.rest_length_min).",
            )
        return np.full(len(start.rest_length), self.least), longest

    def rates(self, shell: Gridshell, design: Design) -> Rates:
        """Each is its own."""
        return Rates(rest_length=sp.csc_array(sp.eye_array(len(design.rest_length))))

    def unit(self, shell: Gridshell, start: Design) -> Reals:
        """The cables' lengths in the target, m."""
        return shell.cable_lengths


@dataclass(frozen=True)
class FreeRadius(Variable):
    """The rods' radius, m, between `least` and `most` (4), where they aren't given a quarter of the start's
    and the start's."""

    least: float | None = None
    most: float | None = None

    def size(self, shell: Gridshell) -> int:
        """One."""
        return 1

    def values(self, shell: Gridshell, design: Design) -> Reals:
        """m."""
        return np.array([design.radius])

    def applied(self, shell: Gridshell, design: Design, values: Reals) -> Design:
        """With this radius."""
        return replace(design, radius=float(values[0]))

    def bounds(self, shell: Gridshell, start: Design) -> tuple[Reals, Reals]:
        """m. Raises InputError where they contradict each other."""
        least = 0.25 * start.radius if self.least is None else self.least
        most = start.radius if self.most is None else self.most
        if not 0.0 < least <= most < _THICKEST * start.radius:
            raise InputError(
                f"the bounds must be positive, the lower below the upper one, and that below {_THICKEST:g} times "
                "the start's radius",
                where="variables.radius",
                value=(least, most),
                remedy=f"Give metres, such as {0.25 * start.radius:.3g} and {start.radius:.3g}.",
            )
        return np.array([least]), np.array([most])

    def rates(self, shell: Gridshell, design: Design) -> Rates:
        """Its own."""
        return Rates(radius=np.ones(1))

    def unit(self, shell: Gridshell, start: Design) -> Reals:
        """The start's radius, m."""
        return np.array([start.radius])

    def step(self, shell: Gridshell, start: Design, design: Design) -> Reals:
        """A tenth of the radius, m."""
        return np.array([0.1 * design.radius])


class Blocks:
    """The blocks of a problem side by side, as variables (s,) over their `unit` (s,) at the `start`."""

    def __init__(self, variables: Sequence[Variable], shell: Gridshell, start: Design) -> None:
        self.variables, self.shell, self.start = tuple(variables), shell, start
        ends = np.cumsum([0, *(each.size(shell) for each in self.variables)])
        self.slices = [slice(int(a), int(b)) for a, b in itertools.pairwise(ends)]
        self.size = int(ends[-1])
        self.unit: Reals = np.concatenate([each.unit(shell, start) for each in self.variables])
        if len(self.unit) != self.size or not (np.isfinite(self.unit) & (self.unit > 0.0)).all():
            raise InputError(
                "each needs a positive unit for each of its values",
                where="variables",
                remedy="Let unit return as many positive numbers as size says.",
            )
        owners = np.zeros(len(shell.cable_ends) + 1, dtype=int)
        for each in self.variables:
            owners += np.diff(_stacked(each.rates(shell, start), shell, each.size(shell)).tocsr().indptr) > 0
        if (owners > 1).any():
            raise InputError(
                "two blocks change the same cable or the radius",
                where="variables",
                remedy="Leave one out, or let one block hold both.",
            )
        self.moves_radius = bool(owners[-1])
        own = zip(self.variables, self.slices, strict=True)
        # where the rest lengths of all cables one by one stand among the variables; None where no block is
        # these
        self.each_cable = next((place for each, place in own if each.of_each_cable), None)

    def values(self, design: Design) -> Reals:
        """The values (s,) of a design, each in its own unit."""
        return np.concatenate([each.values(self.shell, design) for each in self.variables])

    def of(self, design: Design) -> Reals:
        """The variables (s,) of a design."""
        return self.values(design) / self.unit

    def design(self, variables: Reals, present: np.ndarray) -> Design:
        """The design of the variables (s,) with the cables `present` (c,); what no block varies is as at the
        start."""
        made = replace(self.start, present=present)
        for each, own in zip(self.variables, self.slices, strict=True):
            made = each.applied(self.shell, made, variables[own] * self.unit[own])
        return made

    def value_bounds(self) -> tuple[Reals, Reals]:
        """Lower and upper bounds (s,) of the values (3, 4)."""
        sides = [each.bounds(self.shell, self.start) for each in self.variables]
        lower, upper = (np.concatenate(side) for side in zip(*sides, strict=True))
        return lower, upper

    def check_start(self) -> None:
        """Raises InputError where the start lies outside the bounds; lengths of absent cables don't count."""
        values, (lower, upper) = self.values(self.start), self.value_bounds()
        outside = (values < lower - _SAME * np.abs(lower)) | (values > upper + _SAME * np.abs(upper))
        if self.each_cable is not None:
            outside[self.each_cable] &= self.start.present
        if outside.any():
            first = int(np.argmax(outside))
            raise InputError(
                "the start lies outside the bounds",
                where=f"variables[{first}]",
                value=float(values[first]),
                remedy=f"Start from a design within the bounds, here {lower[first]:.4g} to {upper[first]:.4g}, or "
                "widen them.",
            )

    def bounds(self) -> tuple[Reals, Reals]:
        """Lower and upper bounds (s,) of the variables."""
        lower, upper = self.value_bounds()
        return lower / self.unit, upper / self.unit

    def step(self, design: Design) -> Reals:
        """The largest changes (s,) of the values in one step."""
        return np.concatenate([each.step(self.shell, self.start, design) for each in self.variables])

    def rates(self, design: Design) -> sp.csc_array:
        """(c + 1, s): the derivatives of all rest lengths and of the radius by the values."""
        return sp.csc_array(
            sp.hstack(
                [
                    _stacked(each.rates(self.shell, design), self.shell, own.stop - own.start)
                    for each, own in zip(self.variables, self.slices, strict=True)
                ],
                format="csc",
            )
        )


def _stacked(rates: Rates, shell: Gridshell, size: int) -> sp.csc_array:
    """(c + 1, v) of a block. Raises InputError where a shape isn't as its size says."""
    cables = len(shell.cable_ends)
    length = sp.csc_array((cables, size)) if rates.rest_length is None else sp.csc_array(rates.rest_length)
    radius = np.zeros(size) if rates.radius is None else np.asarray(rates.radius, dtype=float)
    if length.shape != (cables, size) or radius.shape != (size,):
        raise InputError(
            f"rates must have the shapes {(cables, size)} and {(size,)}",
            where="variables",
            value=(length.shape, radius.shape),
            remedy="Let rates return derivatives by each of the block's values, as size counts them.",
        )
    return sp.csc_array(sp.vstack([length, sp.csc_array(radius[None])], format="csc"))
