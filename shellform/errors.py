"""The two ways in which shellform says no.

`InputError`: what was given cannot be used; nothing was computed (exit status 2).
`NotConverged`: a computation ended without a usable result; it carries what was reached (exit status 3).
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from pathlib import Path
from typing import Any

ANEW = "Make it anew: shellform design CASE.toml --output RUN --fresh."
STOPPED = 130  # exit status after Ctrl-C: 128 and the number of its signal
_WHOLE_TURN = 2.0 * math.pi * (1.0 + 1e-9)  # rad


class ShellformError(Exception):
    """Base of both, for callers who catch everything that this package says on purpose: the message is the
    `cause`, then the `remedy`, "" where there is none."""

    cause: str
    remedy: str


class InputError(ShellformError, ValueError):
    """Input that cannot be used.

    `what` is wrong, `where` it stands (file, entry, element), which `value` was found, and the `remedy`.
    The message joins them into one readable sentence or two.
    """

    def __init__(self, what: str, *, where: str = "", value: object = None, remedy: str = "") -> None:
        self.what = what
        self.where = where
        self.value = value
        self.remedy = remedy
        head = f"{printable(where)}: {what}" if where else what
        found = "" if value is None else f" (found {value!r})"
        self.cause = f"{head}{found}"
        super().__init__(f"{self.cause}. {remedy}" if remedy else self.cause)

    def within(self, place: str) -> InputError:
        """The same, found in a part of `place`."""
        where = f"{place}: {self.where}" if self.where else place
        return InputError(self.what, where=where, value=self.value, remedy=self.remedy)


def printable(text: str) -> str:
    """The text with what can't be printed, as a line's end in a file's name, written out."""
    return "".join(each if each.isprintable() else ascii(each)[1:-1] for each in text)


def how_many(count: int, one: str, many: str) -> str:
    """A number and what it counts: "1 face was", "2 faces were"."""
    return f"{count} {one if count == 1 else many}"


def unreadable(error: Exception) -> str:
    """That a file can't be read, and why: of the system's errors their words alone, without number and
    path; of bytes that are no text in UTF-8 the first and its line."""
    if isinstance(error, UnicodeDecodeError):
        line = error.object[: error.start].count(b"\n") + 1
        return f"isn't text in UTF-8 (byte {error.object[error.start]:#04x} in line {line})"
    system = error.strerror if isinstance(error, OSError) else None
    return f"can't be read: {system or error}"


def require_file(file: Path, *, where: str = "") -> None:
    """Raises InputError where there is no such file, or it is a folder; `where` it is named, unless by
    itself."""
    if file.is_dir():
        raise InputError("is a folder, no file", where=where or str(file), remedy="Name a file in it.")
    if not file.is_file():
        raise InputError(
            "there is no such file",
            where=where or str(file),
            remedy="Check the path; one in a case file is relative to it.",
        )


def require_number(
    value: float,
    *,
    where: str,
    give: str,
    above: float = -math.inf,
    least: float = -math.inf,
    below: float = math.inf,
    most: float = math.inf,
    share: bool = False,
) -> None:
    """Raises InputError for what is no finite number above or from its lower bound and below or up to its
    upper one; `give` is what to give instead, with unit and example. Of a `share` or factor that can only be
    meant in per cent the remedy names the number to write.
    """
    try:
        fits = math.isfinite(value) and above < value < below and least <= value <= most
    except (TypeError, ValueError) as error:
        raise InputError("must be a number", where=where, value=value, remedy=f"Give {give}.") from error
    if not fits:
        what = f"must be {_between(above, least, below, most)}"
        hint = if_per_cents(value, min(below, most)) if share else ""
        raise InputError(what, where=where, value=value, remedy=f"Give {give}.{hint}")


def require_angle(value: float, *, where: str, give: str) -> None:
    """Raises InputError for what is no angle, rad, and for one of more than a whole turn, as degrees are."""
    require_number(value, where=where, give=give)
    if abs(value) > _WHOLE_TURN:
        meant = math.radians(_without_turns(value, 360.0))
        raise InputError(
            f"{typed(value)} rad is more than a whole turn",
            where=where,
            value=value,
            remedy=f"Leave whole turns out, give {_without_turns(value, 2.0 * math.pi):.4g} rad; if degrees are meant, give {meant:.4g} rad.",
        )


def require_degrees(value: float, *, where: str, give: str) -> None:
    """As `require_angle`, for an angle in degrees."""
    require_number(value, where=where, give=give)
    if abs(value) > math.degrees(_WHOLE_TURN):
        raise InputError(
            f"{typed(value)}° is more than a whole turn",
            where=where,
            value=value,
            remedy=f"Leave whole turns out: for {typed(value)}° give {typed(_without_turns(value, 360.0))}.",
        )


def _without_turns(angle: float, turn: float) -> float:
    return math.fmod(angle, turn) + 0.0  # no -0


def if_per_cents(value: float, most: float) -> str:
    """What to write of a share or factor larger than the `most` that it may be whose hundredth would suit: of
    97 0.97."""
    return f" For {typed(value)} % write {typed(value / 100.0)}." if 1.0 < value < 100.0 * most else ""


def require_count(value: int, *, where: str, give: str, least: int = 1, most: float = math.inf) -> None:
    """Raises InputError for what is no whole number from `least` to `most`; `give` is what to give
    instead."""
    try:
        fits = least <= operator.index(value) <= most
    except TypeError as error:
        raise InputError(
            "must be a whole number", where=where, value=value, remedy=f"Give {give}."
        ) from error
    if not fits:
        what = f"must be at least {least}" if most == math.inf else f"must be between {least} and {most}"
        raise InputError(what, where=where, value=value, remedy=f"Give {give}.")


def require_known(value: object, known: Iterable[str], *, where: str, what: str) -> None:
    """Raises InputError for a name that isn't among those `known`; `what` says what it isn't."""
    names = list(known)  # in which a value may be sought that has no hash
    if value not in names:
        raise InputError(what, where=where, value=value, remedy=f"Known: {', '.join(names)}.")


def typed(value: float) -> str:
    """A number as people type it into a case file: 2.55e8."""
    mantissa, e, power = f"{value:.6g}".partition("e")
    return f"{mantissa}e{int(power)}" if e else mantissa


def _between(above: float, least: float, below: float, most: float) -> str:
    """The bounds in words."""
    if math.isfinite(least) and math.isfinite(most):
        return f"between {typed(least)} and {typed(most)}"
    words = []
    if math.isfinite(above):
        words.append("positive" if above == 0.0 else f"above {typed(above)}")
    if math.isfinite(least):
        words.append("0 or more" if least == 0.0 else f"at least {typed(least)}")
    if math.isfinite(below):
        words.append(f"below {typed(below)}")
    if math.isfinite(most):
        words.append(f"at most {typed(most)}")
    return " and ".join(words if math.isfinite(min(below, most)) else [*words, "finite"])


def not_installed(what: str, extra: str, error: ImportError) -> InputError:
    """That `what` was asked for needs a library of the optional dependencies `extra`, which can't be
    loaded."""
    return InputError(
        f"{what}: the library {error.name or 'asked for'} can't be loaded ({error})",
        remedy=f'Install it with: pip install "shellform[{extra}]".',
    )


class Damaged(InputError):
    """A file that shellform wrote, or should have, and that can't be taken up: what it holds has to be made
    anew.
    """


class NotConverged(ShellformError, RuntimeError):
    """A computation that ended without a usable result.

    `state` is the last state reached (what kind depends on the computation), `residual` how far from the goal
    it was, `iterations` the work spent, and `remedy` what to try next.
    """

    def __init__(
        self,
        what: str,
        *,
        state: Any = None,
        residual: float = float("nan"),
        iterations: int = 0,
        remedy: str = "",
    ) -> None:
        self.what = self.cause = what
        self.state = state
        self.residual = residual
        self.iterations = iterations
        self.remedy = remedy
        super().__init__(f"{what}. {remedy}" if remedy else what)
