"""What measurements tell about parameters, in numbers and in words.

With J the derivative of what is measured by the logarithms q of the parameters and s the noise of a
measurement, the covariance of the best fit is s² (J'J)⁻¹: its diagonal gives the parameters' relative
deviations, its off-diagonal which of them can be exchanged for one another.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Flags, Indices, Reals, Record
from shellform.structure.elements.state import State

TELLABLE = 0.5  # relative deviation of a parameter beyond which the data don't tell it
_UNKNOWN = 1e-12  # of the largest: information that is rounding alone
_APART = 0.95  # correlation of two parameters from which they can't be told apart


@dataclass(frozen=True, eq=False)
class Identifiability(Record):
    """What data of a given noise tell about parameters.

    - `names` (p,).
    - `deviation` (p,): relative standard deviations, infinite where nothing is told; parameters that aren't
      told count as known to the others.
    - `correlation` (p, p) of their errors.
    - `singular` (p,): values of the Jacobian over the noise; `directions` (p, p): the logarithms' that belong
      to them, as rows.
    - `reach` (p,), m: how far the marker that moves most goes when the parameter grows by 1 %.
    """

    names: tuple[str, ...]
    deviation: Reals
    correlation: Reals
    singular: Reals
    directions: Reals
    reach: Reals

    @property
    def tellable(self) -> tuple[str, ...]:
        """The names that the data tell to within `TELLABLE`."""
        return tuple(name for name, each in zip(self.names, self.deviation, strict=True) if each <= TELLABLE)

    def sentences(self) -> list[str]:
        """The same in words: each parameter's deviation, and which aren't told or not told apart."""
        result = []
        for name, deviation, reach in zip(self.names, self.deviation, self.reach, strict=True):
            moves = f"1 % of it moves no marker by more than {1e3 * reach:.2g} mm"
            if deviation > TELLABLE:
                result.append(f"The data can't tell {name}: {moves}.")
            else:
                result.append(
                    f"{name} is told to ±{100.0 * deviation:.2g} % (one standard deviation); {moves}."
                )
        for i in range(len(self.names)):
            for j in range(i):
                if abs(self.correlation[i, j]) > _APART:
                    kept, lost = (
                        ("quotient", "product") if self.correlation[i, j] > 0.0 else ("product", "quotient")
                    )
                    result.append(
                        f"The data can't tell {self.names[j]} and {self.names[i]} apart (correlation "
                        f"{self.correlation[i, j]:.3f}): they fix "
                        f"their {kept} far better than their {lost}; add a load state that bends the grid in "
                        "another way."
                    )
        return result


def identifiability(names: Sequence[str], jacobian: Reals, raw: Reals, noise: float) -> Identifiability:
    """From derivatives (r, p), m, by the logarithms, projected and as they are.

    The parameter that is told worst is taken for known as long as it isn't told at all: it mustn't blur the
    others.
    """
    size = len(names)
    _, singular, directions = np.linalg.svd(jacobian / noise, full_matrices=False)
    reach = 0.01 * np.linalg.norm(raw.reshape(-1, 3, size), axis=1).max(axis=0, initial=0.0)
    deviation, correlation, kept = np.full(size, np.inf), np.eye(size), list(range(size))
    while kept:
        information = (jacobian[:, kept] / noise).T @ (jacobian[:, kept] / noise)
        scale = np.sqrt(np.diag(information))
        if not (scale > 0.0).all():
            kept.pop(int(np.argmin(scale)))
            continue
        # Scaled to a unit diagonal, stiffnesses of which one hardly matters don't spoil the inverse.
        known, along = np.linalg.eigh(information / np.outer(scale, scale))
        if known[0] < _UNKNOWN * known[-1]:  # nothing tells this combination of them
            kept.pop(int(np.argmax(np.abs(along[:, 0]))))
            continue
        covariance = along / known @ along.T / np.outer(scale, scale)
        deviation[kept] = np.sqrt(np.diag(covariance))
        correlation = np.eye(size)
        correlation[np.ix_(kept, kept)] = covariance / np.outer(deviation[kept], deviation[kept])
        worst = int(np.argmax(deviation[kept]))
        if deviation[kept[worst]] <= TELLABLE:
            break
        kept.pop(worst)
    return Identifiability(tuple(names), deviation, correlation, singular, directions, reach)


def nuisance(
    states: Sequence[State], markers: Indices, frames: Sequence[int | None], seen: Flags, offsets: bool
) -> Reals:
    """An orthonormal basis (r, k) of what rigid motions of the frames and offsets of the markers do to the
    seen coordinates.
    """
    place = np.stack([state.positions[markers] for state in states])
    middle = place.reshape(-1, 3).mean(axis=0)
    size = float(np.abs(place - middle).max())
    columns = []
    for frame in sorted({each for each in frames if each is not None}):
        own = np.array([each == frame for each in frames])[:, None, None]
        for axis in np.eye(3):
            columns.append(own * np.broadcast_to(axis, place.shape))
            columns.append(own * np.cross(axis, (place - middle) / size))
    if offsets:
        for marker in range(len(markers)):
            for k in range(3):
                each = np.zeros(place.shape)
                each[:, marker, k] = 1.0
                columns.append(each)
    rows = 3 * int(seen.sum())
    if not columns:
        return np.zeros((rows, 0))
    matrix = np.stack([each[seen].ravel() for each in columns], axis=1)
    left, singular, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(left[:, singular > 1e-10 * singular[0]])
