"""Loads at which the straight, the plane or the circular ceases to be stable."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shellform.structure.network import assemble
from shellform.structure.state import at_rest
from shellform.structure.verification import exact
from shellform.structure.verification.case import Row, rows
from shellform.structure.verification.models import chain, critical, in_plane, line, load_at, order

# Held freedoms of the ends in the x-z plane: (first end, last end), the last free to slide along x.
_COLUMNS = {
    "clamped-free": ([True] * 6, [False] * 6, 0.25 * np.pi**2),
    "pinned-pinned": ([True, True, True, True, False, True], [False, True, True, True, False, True], np.pi**2),
    "clamped-pinned": ([True] * 6, [False, True, True, True, False, True], exact.clamped_column()),
    "clamped-clamped": ([True] * 6, [False, True, True, True, True, True], 4.0 * np.pi**2),
}


def column(kind: str, elements: int) -> float:
    """PL²/EI at which a column of the kind buckles in the plane."""
    first, last, reference = _COLUMNS[kind]
    network = in_plane(chain(line(elements), (1e6, 1.0, 1.0, 1.0), {0: first, elements: last}))
    load = load_at(network, elements, [-1.0, 0.0, 0.0])
    return critical(assemble(network), at_rest(network.nodes), load, 0.8 * reference, 1.2 * reference)


def columns() -> Iterator[Row]:
    """Euler's columns, L = EI = 1, EA = 1e6, 48 elements: a straight chain buckles O(h²) late, (kL)² h²/12 = 1e-3 at most."""
    numbers = [(kind, column(kind, 48), _COLUMNS[kind][2]) for kind in _COLUMNS]
    yield from rows("Euler column, PL²/EI", "Euler 1744; Timoshenko and Gere 1961", 2e-3, numbers)
    errors = [column("clamped-clamped", n) - 4.0 * np.pi**2 for n in (12, 24)]
    yield Row("clamped column, 12, 24 elements", "order of the buckling load", order(errors), 2.0, 0.05, "O(h²)")
