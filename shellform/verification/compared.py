"""One compared number, and how a case states its numbers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass


@dataclass(frozen=True)
class Comparison:
    """One compared number of a `case`; `tolerance` on the difference, relative to the reference where that
    isn't 0.
    """

    case: str
    quantity: str
    value: float
    reference: float
    tolerance: float
    source: str

    @property
    def name(self) -> str:
        """Case and quantity in one line."""
        return f"{self.case}: {self.quantity}"

    @property
    def difference(self) -> float:
        """Value minus reference, over the reference where that isn't 0."""
        gap = self.value - self.reference
        return abs(gap / self.reference) if self.reference else abs(gap)

    @property
    def passed(self) -> bool:
        """Whether the difference is within the tolerance."""
        return bool(self.difference <= self.tolerance)


def rows(
    case: str, source: str, tolerance: float, numbers: Iterable[tuple[str, float, float]]
) -> Iterator[Comparison]:
    """Rows of one case from (quantity, value, reference)."""
    for quantity, value, reference in numbers:
        yield Comparison(case, quantity, float(value), float(reference), tolerance, source)
