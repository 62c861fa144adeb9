"""Rods cut from stock lengths; the door to binpacking.

A bar of stock length S yields pieces of lengths l with a saw cut of width k after each but for one that ends
with the bar: Σ (l + k) ≤ S + k. The library packs longest first, each into the fullest bar that takes it.
Where it needs more bars than a bound says that it takes (`_least`), bars are also filled one by one as full
as can be, and the better of both is taken. Of 28 cuttings of five nets 25 met the bound and three were one
bar above it.

A rod longer than the stock is spliced from pieces whose ends lie halfway between two crossings, away from the
joints. Every second such rod is divided from its other end, so that splices of neighbours stand in different
places. Of a rod of two laths one is divided from its first end and the other one from its second, never both
between the same two crossings where that can be helped: only the splices would hold such a rod there.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import binpacking
import numpy as np

from shellform.errors import InputError, require_count, require_number
from shellform.net.grid import Grid, GridRod
from shellform.quantities import KERF as SAW_CUT
from shellform.quantities import STOCK_LENGTH

STOCK = 6.0  # m
KERF = 0.003  # m
_STEP = 1e-4  # m, to which lengths are rounded up where bars are filled
_EQUAL = 1e-9  # m: what a length may exceed the stock by


@dataclass(frozen=True)
class Piece:
    """A piece of rod number `rod`, from `start` on over `length`, m, along the rod; `part` (from 1) of the
    `parts` of its `lath` (from 1).
    """

    rod: int
    part: int
    parts: int
    start: float
    length: float
    lath: int = 1


@dataclass(frozen=True)
class Bar:
    """The `pieces` cut from one stock length, and what is left of it, m."""

    pieces: tuple[Piece, ...]
    offcut: float


@dataclass(frozen=True)
class Cutting:
    """`bars` of the length `stock`, m, cut with a saw `kerf` m wide. With fewer bars than `least` it can't be
    done.
    """

    stock: float
    kerf: float
    bars: tuple[Bar, ...]
    least: int

    @property
    def spliced(self) -> tuple[int, ...]:
        """Numbers of the rods that are longer than the stock."""
        return tuple(sorted({piece.rod for bar in self.bars for piece in bar.pieces if piece.parts > 1}))

    @property
    def spliced_through(self) -> tuple[int, ...]:
        """Numbers of the rods of which more than one lath is spliced in the same place."""
        held = Counter((each.rod, each.start) for bar in self.bars for each in bar.pieces if each.part > 1)
        return tuple(sorted({rod for (rod, _), laths in held.items() if laths > 1}))

    @property
    def waste(self) -> float:
        """Share of what is bought that is no rod."""
        used = sum(piece.length for bar in self.bars for piece in bar.pieces)
        return 1.0 - used / (self.stock * len(self.bars))


def cut(grid: Grid, *, stock: float = STOCK, kerf: float = KERF, laths: int = 1) -> Cutting:
    """The grid's rods, each of as many `laths`, nested into bars of the length `stock`, m. Raises InputError
    where the stock is too short to splice rods from, and for lengths that can only be meant in mm.
    """
    require_number(
        stock, above=0.0, most=STOCK_LENGTH.possible[1], where="rod.stock_length", give=STOCK_LENGTH.give
    )
    require_number(
        kerf, least=0.0, below=stock, most=SAW_CUT.possible[1], where="rod.kerf", give=SAW_CUT.give
    )
    require_count(laths, where="laths", give="how many laths each rod is of, such as 2")
    pieces: list[Piece] = []
    spliced = 0
    for number, rod in enumerate(grid.rods):
        taken: list[float] = []
        for lath in range(1, laths + 1):
            cuts = [] if rod.length <= stock + _EQUAL else _splices(rod, stock, spliced % 2 == 1, taken)
            spliced += bool(cuts)
            taken += cuts
            ends = [0.0, *cuts, rod.length]
            pieces += [
                Piece(number, k + 1, len(ends) - 1, a, b - a, lath) for k, (a, b) in enumerate(pairwise(ends))
            ]
    needed = {k: piece.length + kerf for k, piece in enumerate(pieces)}
    room = stock + kerf + 2.0 * _EQUAL
    least = _least([*needed.values()], room)
    packed = [list(one) for one in binpacking.to_constant_volume(needed, room)]
    if len(packed) > least:
        packed = min(packed, _fullest(needed, room), key=len)
    bars = []
    for one in packed:
        held = sorted((pieces[k] for k in one), key=lambda piece: (-piece.length, piece.rod, piece.part))
        bars.append(Bar(tuple(held), max(0.0, stock - sum(piece.length + kerf for piece in held))))
    bars.sort(key=lambda bar: (bar.offcut, bar.pieces[0].rod))
    return Cutting(stock, kerf, tuple(bars), least)


def _splices(rod: GridRod, stock: float, backwards: bool, taken: Sequence[float]) -> list[float]:
    """Where a lath of the rod is divided, m from its first end, rising: each piece as long as the stock and
    the crossings allow, beside the places that are `taken` by its other laths where there are others.
    """
    middles = 0.5 * (rod.marks[:-1] + rod.marks[1:])
    way = rod.length - middles if backwards else middles
    found: list[float] = []
    begin = 0.0
    while rod.length - begin > stock + _EQUAL:
        reached = (way > begin + _EQUAL) & (way <= begin + stock + _EQUAL)
        if not reached.any():
            raise InputError(
                f"a rod of {rod.length:.3g} m can't be spliced from it halfway between its crossings",
                where="rod.stock_length",
                value=stock,
                remedy="Choose a longer stock length.",
            )
        free = reached & ~np.isin(middles, taken)
        farthest = int(np.argmax(np.where(free if free.any() else reached, way, 0.0)))
        begin = float(way[farthest])
        found.append(float(middles[farthest]))
    return sorted(found)


def _fullest(needed: Mapping[int, float], room: float) -> list[list[int]]:
    """Bar after bar: the longest piece that is left, and beside it those that fill the rest best (Gupta and
    Ho's minimum bin slack).

    The sums that pieces can have, in `_STEP`s rounded up, are the bits of a number; adding a piece shifts it.
    """
    left = sorted(needed, key=lambda k: (-needed[k], k))
    size = {k: math.ceil(needed[k] / _STEP - _EQUAL) for k in left}
    found = []
    while left:
        first, *others = left
        free = math.floor(room / _STEP + _EQUAL) - size[first]
        sums = [1]
        for k in others:
            sums.append((sums[-1] | sums[-1] << size[k]) & ((1 << free + 1) - 1 if free >= 0 else 1))
        goal, bar = sums[-1].bit_length() - 1, [first]
        for number in range(len(others), 0, -1):
            if not sums[number - 1] >> goal & 1:
                bar.append(others[number - 1])
                goal -= size[others[number - 1]]
        left = [k for k in left if k not in bar]
        found.append(bar)
    return found


def _least(needed: Sequence[float], room: float) -> int:
    """A number of bars below which the pieces don't fit (Martello and Toth's bound).

    With pieces below t left out, those above room - t have a bar each with nothing beside them, those above
    room / 2 too, and the others fill what these leave and further bars.
    """
    sizes = np.asarray(needed, dtype=float)
    least = 0
    for t in [0.0, *sizes[2.0 * sizes <= room]]:
        alone = sizes > room - t
        large = ~alone & (2.0 * sizes > room)
        small = sizes[~alone & ~large & (sizes >= t)]
        beside = float(small.sum()) - (large.sum() * room - float(sizes[large].sum()))
        least = max(least, int(alone.sum() + large.sum()) + max(0, math.ceil(beside / room - _EQUAL)))
    return least
