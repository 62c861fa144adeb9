"""Why a surface takes no net, and what was tried, as types: what is tried next depends on them, not on
words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum
from typing import Any

from shellform.errors import InputError, NotConverged


class Reason(Enum):
    """Why an attempt at a net failed; the value says it in a few words."""

    SHORT = "rods end short of the edge"
    BROKEN = "rods come to run in one direction"
    CIRCLING = "a guide runs in circles"
    STALLED = "the pull stalled"
    FOLDED = "the net folds"
    OVERLAPPING = "parts of the net lie on one another"
    OFF = "the net stays off the surface"
    NEAR = "crossings come nearer than their spacing"
    EMPTY = "no rod keeps two joints"
    BARE = "too much of the surface lies beyond the rods"
    BESIDE = "the net's origin lies off the surface"


class NoNet(InputError):
    """A surface that takes no net with the settings at hand, and the `reason`; how many `factorisations`
    pulls had taken, such as gave a net which then was refused."""

    def __init__(
        self, reason: Reason, what: str, *, where: str = "", value: object = None, remedy: str = ""
    ) -> None:
        self.reason, self.factorisations = reason, 0
        super().__init__(what, where=where, value=value, remedy=remedy)


class Beside(InputError):
    """An origin of a net that lies off the surface: nothing is wrong with that."""


class Stalled(NotConverged):
    """A pull that found no equilibrium: `residual` is what it came to."""

    reason = Reason.STALLED

    def __init__(
        self, what: str, *, residual: float, iterations: int, state: Any = None, remedy: str = ""
    ) -> None:
        super().__init__(what, state=state, residual=residual, iterations=iterations, remedy=remedy)


class Change(Enum):
    """What an attempt at a net changes of what was asked for; the value says it in words."""

    NOTHING = "as asked"
    LOOSER = "pulled until steps bring nothing"
    LONGER = "its rods longer"
    TIGHTER = "springs in more steps, stiffer at the end"
    GENTLER = "softer springs first and half the steps"
    SHEAR = "five times the shear stiffness"
    TURNED = "turned"
    SHIFTED = "shifted"
    FLAT = "from the flat grid"


@dataclass(frozen=True)
class Attempt:
    """One attempt at a net: what it changed, its `angle`, rad, and `offset`, spacings, why it failed (None:
    it gave the net), and the `factorisations` of its pull."""

    change: Change
    angle: float
    offset: tuple[float, float]
    reason: Reason | None
    factorisations: int = 0

    def sentence(self) -> str:
        """In words, for people."""
        where = f" at {math.degrees(self.angle):.4g}°"
        shift = f", offset {self.offset[0]:g}, {self.offset[1]:g}" if self.offset != (0.0, 0.0) else ""
        ended = self.reason.value if self.reason else "this net"
        return f"attempt {self.change.value}{where}{shift}: {ended}"
