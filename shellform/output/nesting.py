"""Rods cut from stock lengths; the door to binpacking.

A bar of stock length S yields pieces of lengths l with a saw cut of width k after each but for one that ends with the bar:
Σ (l + k) ≤ S + k. The library packs longest first, each into the fullest bar that takes it; that this can't be done with fewer bars is
shown, where it is so, by the bound Σ (l + k) / (S + k) and by the pieces of which no two fit into one bar.

A rod longer than the stock is spliced from pieces whose ends lie halfway between two crossings, away from the joints. Every second
such rod is divided from its other end, so that splices of neighbours stand in different places.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import binpacking
import numpy as np

from shellform.errors import InputError
from shellform.net.grid import Grid, GridRod

STOCK = 6.0  # m
KERF = 0.003  # m
_EQUAL = 1e-9  # m: what a length may exceed the stock by


@dataclass(frozen=True)
class Piece:
    """A piece of rod number `rod`, from `start` on over `length`, m, along the rod; `part` (from 1) of the rod's `parts`."""

    rod: int
    part: int
    parts: int
    start: float
    length: float


@dataclass(frozen=True)
class Bar:
    """The `pieces` cut from one stock length, and what is left of it, m."""

    pieces: tuple[Piece, ...]
    offcut: float


@dataclass(frozen=True)
class Cutting:
    """`bars` of the length `stock`, m, cut with a saw `kerf` m wide. With fewer bars than `least` it can't be done."""

    stock: float
    kerf: float
    bars: tuple[Bar, ...]
    least: int

    @property
    def spliced(self) -> tuple[int, ...]:
        """Numbers of the rods that are longer than the stock."""
        return tuple(sorted({piece.rod for bar in self.bars for piece in bar.pieces if piece.parts > 1}))

    @property
    def waste(self) -> float:
        """Share of what is bought that is no rod."""
        used = sum(piece.length for bar in self.bars for piece in bar.pieces)
        return 1.0 - used / (self.stock * len(self.bars))


def cut(grid: Grid, *, stock: float = STOCK, kerf: float = KERF) -> Cutting:
    """The grid's rods nested into bars of the length `stock`, m. Raises InputError where the stock is too short to splice rods from."""
    if not (stock > 0.0 and math.isfinite(stock)):
        raise InputError("must be positive", where="rod.stock_length", value=stock)
    if not 0.0 <= kerf < stock:
        raise InputError("must lie between 0 and the stock length", where="rod.kerf", value=kerf)
    pieces: list[Piece] = []
    spliced = 0
    for number, rod in enumerate(grid.rods):
        cuts = [] if rod.length <= stock + _EQUAL else _splices(rod, stock, backwards=spliced % 2 == 1)
        spliced += bool(cuts)
        ends = [0.0, *cuts, rod.length]
        pieces += [
            Piece(number, k + 1, len(ends) - 1, a, b - a) for k, (a, b) in enumerate(pairwise(ends))
        ]
    needed = {k: piece.length + kerf for k, piece in enumerate(pieces)}
    room = stock + kerf + 2.0 * _EQUAL
    bins = binpacking.to_constant_volume(needed, room)
    bars = []
    for one in bins:
        held = sorted((pieces[k] for k in one), key=lambda piece: (-piece.length, piece.rod, piece.part))
        bars.append(Bar(tuple(held), max(0.0, stock - sum(piece.length + kerf for piece in held))))
    bars.sort(key=lambda bar: (bar.offcut, bar.pieces[0].rod))
    return Cutting(stock, kerf, tuple(bars), _least([*needed.values()], room))


def _splices(rod: GridRod, stock: float, *, backwards: bool) -> list[float]:
    """Where the rod is divided, m from its first end, rising: each piece as long as the stock and the crossings allow."""
    places = 0.5 * (rod.marks[:-1] + rod.marks[1:])
    if backwards:
        places = rod.length - places[::-1]
    found: list[float] = []
    begin = 0.0
    while rod.length - begin > stock + _EQUAL:
        reached = places[(places > begin + _EQUAL) & (places <= begin + stock + _EQUAL)]
        if not len(reached):
            raise InputError(
                f"a rod of {rod.length:.3g} m can't be spliced from it halfway between its crossings",
                where="rod.stock_length",
                value=stock,
                remedy="Choose a longer stock length.",
            )
        begin = float(reached[-1])
        found.append(begin)
    return [rod.length - place for place in found[::-1]] if backwards else found


def _least(needed: Sequence[float], room: float) -> int:
    """A number of bars below which the pieces don't fit: by their sum, and by those of which no two fit into one bar."""
    sizes = np.sort(needed)[::-1]
    whole = math.ceil(float(sizes.sum()) / room - _EQUAL)
    # Piece k, counted from the longest, fits beside none before it if even with the shortest of them, itself, it is too long.
    alone = int((2.0 * sizes > room).sum())
    return max(whole, alone)
