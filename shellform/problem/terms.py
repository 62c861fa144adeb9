"""What is measured on a loaded gridshell: the terms of the objective (2) and of the constraints (5) and (6).

A term says at which load case it is taken and how many values it has, and gives them with their partial
derivatives by the nodes and by the design; the chain through the equilibrium is the evaluation's. What else
the optimiser makes use of (squares, tensions) stands in the measurement too, and may be left out: whoever
uses a term never asks what it is.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals, Record, indices
from shellform.errors import InputError, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly


@dataclass(frozen=True, eq=False)
class LoadedDesign(Record):
    """What a term is taken of: a `design` of the `shell` in its equilibrium `state` under the dead `load`
    (n, 6), N and Nm; `assembly` of the design's network where whoever measures has it."""

    shell: Gridshell
    design: Design
    state: State
    load: Reals
    assembly: Assembly | None = None

    def assembled(self) -> Assembly:
        """The assembly of the design's network."""
        return self.assembly or assemble(self.shell.network(self.design))


@dataclass(frozen=True, eq=False)
class Squares(Record):
    """A value that is the sum of squares of residuals: `residual` (m,) and `by_dof` (m, 6 n) sparse. The step
    model takes its curvature from them (Gauss-Newton)."""

    residual: Reals
    by_dof: sp.csr_array


class NotANumber(InputError):
    """A term whose value is nan, or a derivative of which is nan or infinite."""


@dataclass(frozen=True, eq=False)
class Measurement(Record):
    """The `value` (g,) of a term and its partial derivatives: `by_dof` (g, 6 n) sparse, by the nodes'
    translations and spins at a fixed design; `by_rest_length` (g, c) sparse, of all candidate cables, and
    `by_radius` (g,) at a fixed state; None stands for 0.

    Two things the step model can use: `squares`, where the value is (nearly) a sum of squares, and
    `by_tension` (g, c) sparse, where it is a function of the cables' tensions alone: through either a cable
    without tension, which has no slope in its rest length, tells what its first tension would do.

    Where derivatives cost much beside the value, `late` makes the measurement with them, and they stay None
    here: designs that are refused are asked for values alone.
    """

    value: Reals
    by_dof: sp.csr_array | None = None
    by_rest_length: sp.csr_array | None = None
    by_radius: Reals | None = None
    squares: Squares | None = None
    by_tension: sp.csr_array | None = None
    late: Callable[[], Measurement] | None = None

    def whole(self) -> Measurement:
        """With its derivatives."""
        return self if self.late is None else self.late()

    def completed(self, size: int, nodes: int, cables: int, name: str) -> Measurement:
        """With zeros in the place of None. Raises InputError where a shape isn't as said, NotANumber where a
        derivative is no finite number."""
        shapes = {"by_dof": (size, 6 * nodes), "by_rest_length": (size, cables)}
        made = {each: getattr(self, each) for each in shapes}
        rate = np.zeros(size) if self.by_radius is None else np.asarray(self.by_radius, dtype=float)
        wanted = {"value": (size,), "by_radius": (size,), **shapes}
        for each, found in {"value": self.value, "by_radius": rate, **made}.items():
            if found is not None and np.shape(found) != wanted[each]:
                raise InputError(
                    f"has another shape than the size {size} of the term says, {wanted[each]}",
                    where=f"{name}.{each}",
                    value=np.shape(found),
                    remedy="Give arrays of those shapes, or another size.",
                )
        rows = {each: sp.csr_array(shapes[each] if found is None else found) for each, found in made.items()}
        for each, rates in {"by_radius": rate, **{each: found.data for each, found in rows.items()}}.items():
            if np.isfinite(self.value).all() and not np.isfinite(rates).all():
                raise NotANumber(
                    "has a derivative that is no finite number",
                    where=f"{name}.{each}",
                    value=float(rates[~np.isfinite(rates)][0]),
                    remedy="Let the term be smooth wherever a design has an equilibrium.",
                )
        return Measurement(
            np.asarray(self.value, dtype=float),
            rows["by_dof"],
            rows["by_rest_length"],
            rate,
            self.squares,
            self.by_tension,
        )


class Term(ABC):
    """Something measured at the load case `load` ("" where no equilibrium is needed). A user's own derives
    from this class and says `name`, `load` and `measure`, and `size` where it isn't 1.

    `name` heads its column in histories. `stabilises`: whether it tells how far a state is from losing its
    stability, so that a start that doesn't bear the further loads is led along its gradient. `of_shape`:
    whether it tells how far the whole shape is off, so that polishing serves it.
    """

    name: ClassVar[str]
    stabilises: ClassVar[bool] = False
    of_shape: ClassVar[bool] = False
    load: str

    def size(self, shell: Gridshell) -> int:
        """The number of values."""
        return 1

    @abstractmethod
    def measure(self, at: LoadedDesign) -> Measurement:
        """The values and their partial derivatives."""

    def at_limit(self, limit: float) -> float:
        """The value that belongs to a `limit` in the unit in which users give it. Raises InputError for one
        that can only be in another unit."""
        return limit

    @property
    def of_each_cable(self) -> bool:
        """Whether the values are the tensions of all candidate cables, so that limits on them bound single
        cables."""
        return False


def measured(term: Term, at: LoadedDesign) -> Measurement:
    """The term's measurement, complete but for derivatives that come late. Raises InputError where its shapes
    aren't those that it says, NotANumber where a value or a derivative is none."""
    shell, found = at.shell, term.measure(at)
    if not isinstance(found, Measurement):
        raise InputError(
            "is no sf.Measurement",
            where=f"{term.name}.measure",
            value=type(found).__name__,
            remedy="Return sf.Measurement(values, by_dof), whose arrays have a row for each value.",
        )
    if np.isnan(np.asarray(found.value, dtype=float)).any():
        raise NotANumber(
            "is no number",
            where=f"{term.name}.value",
            value=found.value,
            remedy="Let the term give numbers wherever a design has an equilibrium.",
        )

    def complete(measurement: Measurement) -> Measurement:
        return measurement.completed(term.size(shell), shell.node_count, len(shell.cable_ends), term.name)

    if found.late is None:
        return complete(found)
    return replace(complete(found), late=lambda: complete(found.whole()))


@dataclass(frozen=True)
class Misfit(Term):
    """d'd, m²: the sum over all nodes of the squared distance from the target (7), differentiated as such:
    (A.9) is 0/0 at zero distance, its product with d is not."""

    name = "misfit"
    of_shape = True
    load: str

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m²."""
        away = at.state.positions - at.shell.target.positions
        slope = np.hstack([2.0 * away, np.zeros_like(away)])
        return Measurement(
            np.array([float((away**2).sum())]),
            sp.csr_array(slope.reshape(1, -1)),
            squares=distance_squares(at),
        )


@dataclass(frozen=True)
class Bulges(Term):
    """The sum over all nodes of the fourth power of the distance from the target, m⁴: the misfit's sibling
    that the farthest nodes decide."""

    name = "bulges"
    load: str

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m⁴, the sum of squares of squared distances."""
        away = at.state.positions - at.shell.target.positions
        square = (away**2).sum(axis=1)
        slope = np.hstack([4.0 * square[:, None] * away, np.zeros_like(away)])
        places = np.arange(6 * len(away)).reshape(-1, 6)[:, :3]
        entries = (2.0 * away).ravel(), (np.repeat(np.arange(len(away)), 3), places.ravel())
        return Measurement(
            np.array([float((square**2).sum())]),
            sp.csr_array(slope.reshape(1, -1)),
            squares=Squares(square, sp.csr_array(entries, shape=(len(away), slope.size))),
        )


@dataclass(frozen=True)
class RmsMisfit(Term):
    """d'd over the number of nodes, m²; limits on it are given as root mean square distances, m (6)."""

    name = "misfit"
    of_shape = True
    load: str

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m²."""
        whole = Misfit(self.load).measure(at)
        count = len(at.state.positions)
        assert whole.by_dof is not None
        return Measurement(whole.value / count, whole.by_dof / count)

    def at_limit(self, limit: float) -> float:
        """Its square, with its sign: below 0 is no limit from below."""
        return limit * abs(limit)


@dataclass(frozen=True)
class CableForces(Term):
    """n, N: the tension of every candidate cable, or of the `chosen` ones (5); absent cables have none."""

    name = "cable_force"
    load: str
    chosen: tuple[int, ...] | None = None

    def size(self, shell: Gridshell) -> int:
        """As many values as candidates, or as chosen."""
        return len(shell.cable_ends) if self.chosen is None else len(self.chosen)

    def measure(self, at: LoadedDesign) -> Measurement:
        """`size` values, N. Raises InputError where a chosen cable isn't there."""
        value, by_dof, by_rest, by_tension = _tensions(at)
        if self.chosen is None:
            return Measurement(value, by_dof, by_rest, by_tension=by_tension)
        rows = indices("cable_forces.chosen", self.chosen, (None,), below=len(value))
        return Measurement(value[rows], by_dof[rows], by_rest[rows], by_tension=by_tension[rows])

    @property
    def of_each_cable(self) -> bool:
        """Whether none is left out."""
        return self.chosen is None


@dataclass(frozen=True)
class CableForce(Term):
    """The sum of all cable tensions, N: the L1 norm whose weight empties cables that aren't needed (2)."""

    name = "cable_force"
    load: str

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, N."""
        value, by_dof, by_rest, by_tension = _tensions(at)
        return Measurement(
            np.array([value.sum()]),
            sp.csr_array(by_dof.sum(axis=0).reshape(1, -1)),
            sp.csr_array(by_rest.sum(axis=0).reshape(1, -1)),
            by_tension=sp.csr_array(by_tension.sum(axis=0).reshape(1, -1)),
        )


@dataclass(frozen=True)
class RodRadius(Term):
    """The rods' radius, m."""

    name = "rod_radius"
    load: str = ""

    def measure(self, at: LoadedDesign) -> Measurement:
        """One value, m."""
        return Measurement(np.array([at.design.radius]), by_radius=np.ones(1))


@dataclass(frozen=True)
class Share:
    """A summand of the objective: its weight is such that it makes up `share` of the objective's value 1 at
    the start, of -1 where it is below 0 there. Of a term with several values it is their sum.
    """

    share: float
    term: Term

    def __post_init__(self) -> None:
        require_number(self.share, above=0.0, where="minimise", give="a share of the objective, such as 0.7")


def distance_squares(at: LoadedDesign) -> Squares:
    """The nodes' distances from the target, m, as residuals (3 n,)."""
    nodes = len(at.state.positions)
    places = np.arange(6 * nodes).reshape(-1, 6)[:, :3].ravel()
    rows = sp.csr_array((np.ones(3 * nodes), (np.arange(3 * nodes), places)), shape=(3 * nodes, 6 * nodes))
    return Squares((at.state.positions - at.shell.target.positions).ravel(), rows)


def _tensions(at: LoadedDesign) -> tuple[Reals, sp.csr_array, sp.csr_array, sp.csr_array]:
    """Tensions (c,) of all candidates, their derivatives by the nodes and by rest lengths, and what they
    are of the tensions of those present."""
    shell, design, state = at.shell, at.design, at.state
    cables = shell.cables(design)
    present = np.flatnonzero(design.present)
    count, nodes = len(shell.cable_ends), shell.node_count
    value = np.zeros(count)
    value[present] = cables.tension(state)
    rows = np.repeat(present, 6)
    by_dof = sp.csr_array(
        (cables.tension_by_position(state).ravel(), (rows, cables.dofs().ravel())),
        shape=(count, 6 * nodes),
    )
    by_rest = sp.csr_array((cables.tension_by_rest_length(state), (present, present)), shape=(count, count))
    itself = sp.csr_array((np.ones(len(present)), (present, present)), shape=(count, count))
    return value, by_dof, by_rest, itself
