"""Checks at the door: every array of a dataclass passes here once and is read-only afterwards, in copies of
it as well.
"""

from __future__ import annotations

import zipfile
import zlib
from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from shellform.errors import ANEW, Damaged, InputError

Reals = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]

Shape = Sequence[int | None]
_T = TypeVar("_T", bound=np.generic)
_FEW = 6  # numbers of an array that are told themselves: a point, a load


class Record:
    """A frozen dataclass that holds arrays. It is made with eq=False, for a comparison of arrays has no one
    truth value: it equals itself only. NumPy unpickles and copies a read-only array as a writable one; here
    it becomes read-only again. Its text tells arrays by their sizes, not by thousands of numbers.
    """

    __eq__ = object.__eq__  # and not that of another base, which compares its own fields only
    __hash__ = object.__hash__

    def __setstate__(self, state: dict[str, Any]) -> None:
        for name, value in state.items():
            object.__setattr__(self, name, _locked(value))

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        cls.__repr__ = cls.__repr__  # type: ignore[method-assign]  # a dataclass keeps what stands in its class

    def __repr__(self) -> str:
        told = (
            f"{each.name}={_told(getattr(self, each.name))}" for each in fields(cast(Any, self)) if each.repr
        )
        return f"{type(self).__qualname__}({', '.join(told)})"


def reals(name: str, value: ArrayLike, shape: Shape, *, positive: bool = False) -> Reals:
    """A read-only float64 copy of `value` with the given shape (None: any length), all finite.

    A scalar is broadcast where the shape has no None. `positive` asks for values above zero.
    Raises InputError naming `name` and the first offending index.
    """
    try:
        raw = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InputError(
            f"{name} must be numbers", value=_short(value), remedy=f"Give {_wanted(shape)}."
        ) from error
    raw = _shaped(name, raw, shape)
    if not np.isfinite(raw).all():
        where = _first(~np.isfinite(raw))
        raise InputError(
            f"{name}{where} is not finite", value=float(raw[where]), remedy="Give finite numbers."
        )
    if positive and not (raw > 0).all():
        where = _first(raw <= 0)
        raise InputError(
            f"{name}{where} must be above zero",
            value=float(raw[where]),
            remedy="Give numbers above zero, in SI units.",
        )
    return frozen(raw)


def indices(name: str, value: ArrayLike, shape: Shape, *, below: int) -> Indices:
    """A read-only int64 copy of `value` with the given shape, every entry in [0, below)."""
    raw = regular(name, value, shape)
    if raw.size == 0:
        raw = raw.astype(np.int64)
    if raw.dtype.kind not in "iu":
        raise InputError(
            f"{name} must be whole numbers",
            value=_short(value),
            remedy="Give integers, not floats.",
        )
    raw = _shaped(name, raw, shape)
    outside = (raw < 0) | (raw >= below)
    if outside.any():
        where = _first(outside)
        remedy = f"Indices run from 0 to {below - 1}."
        raise InputError(f"{name}{where} is out of range", value=int(raw[where]), remedy=remedy)
    return frozen(raw.astype(np.int64))


def flags(name: str, value: ArrayLike, shape: Shape) -> Flags:
    """A read-only boolean copy of `value` with the given shape."""
    raw = regular(name, value, shape)
    if raw.dtype.kind != "b":
        raise InputError(
            f"{name} must be true or false",
            value=_short(value),
            remedy="Give booleans: a comparison, or an array of dtype bool.",
        )
    return frozen(_shaped(name, raw, shape))


def regular(name: str, value: ArrayLike, shape: Shape) -> NDArray[Any]:
    """`value` as an array. Raises InputError where its rows have different lengths."""
    try:
        return np.asarray(value)
    except ValueError as error:
        raise InputError(
            f"{name} has rows of different lengths", value=_short(value), remedy=f"Give {_wanted(shape)}."
        ) from error


def frozen(raw: NDArray[_T]) -> NDArray[_T]:
    """A read-only copy."""
    copy = np.array(raw, order="C", copy=True)
    copy.setflags(write=False)
    return copy


def read_only(raw: NDArray[_T]) -> NDArray[_T]:
    """A read-only view. A loop is compiled for arrays that can be written to and again for those that can't:
    what it doesn't write to is given to it as this, whichever it is."""
    view = raw.view()
    view.setflags(write=False)
    return view


def _told(value: object) -> str:
    """`value` in a line; by its size an array, tuple, list or dictionary of more than `_FEW` entries."""
    if isinstance(value, np.ndarray):
        few = value.size <= _FEW
        return str(value.tolist()) if few else f"array({' × '.join(map(str, value.shape))})"
    if isinstance(value, tuple | list | dict) and len(value) > _FEW:
        return f"{type(value).__name__} of {len(value)}"
    if isinstance(value, dict):
        return "{" + ", ".join(f"{name!r}: {_told(each)}" for name, each in value.items()) + "}"
    if type(value) in (tuple, list):
        told = ", ".join(map(_told, cast(Sequence[object], value)))
        return f"[{told}]" if isinstance(value, list) else f"({told}{',' * (len(cast(Any, value)) == 1)})"
    return repr(value)


def _locked(value: Any) -> Any:
    """`value`, the arrays in it read-only."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif type(value) is tuple:
        for each in value:
            _locked(each)
    elif type(value) is dict:
        _locked(tuple(value.values()))
    return value


class Arrays(dict[str, Any]):
    """The arrays of a file by name. Raises InputError for a name that isn't there."""

    def __init__(self, path: Path, content: dict[str, Any]) -> None:
        super().__init__(content)
        self.path = path

    def __missing__(self, name: str) -> Any:
        raise Damaged(f"is damaged: {name} is missing", where=str(self.path), remedy=ANEW)


def read_arrays(path: Path) -> Arrays:
    """All arrays of an .npz file; no objects are unpacked. Raises InputError where it is missing or
    damaged.
    """
    if not path.is_file():
        raise InputError("isn't there", where=str(path), remedy=ANEW)
    try:
        with open(path, "rb") as file, np.load(file, allow_pickle=False) as data:
            return Arrays(path, {name: data[name] for name in data.files})
    except (
        OSError,
        EOFError,
        ValueError,
        TypeError,
        AttributeError,
        NotImplementedError,
        RuntimeError,
        MemoryError,
    ) as error:
        cause: Exception = error
    except (KeyError, OverflowError, SyntaxError, zipfile.BadZipFile, zlib.error) as error:
        cause = error
    raise Damaged(f"is damaged: {cause}", where=str(path), remedy=ANEW) from cause


def _shaped(name: str, raw: NDArray[_T], shape: Shape) -> NDArray[_T]:
    if raw.ndim == 0 and None not in shape:
        raw = np.broadcast_to(raw, [n for n in shape if n is not None])
    if raw.size == 0 and None in shape:
        raw = raw.reshape([0 if n is None else n for n in shape])
    if raw.ndim != len(shape) or any(n is not None and n != m for n, m in zip(shape, raw.shape, strict=True)):
        raise InputError(f"{name} has the wrong shape", value=raw.shape, remedy=f"Give {_wanted(shape)}.")
    return raw


def _first(mask: Flags) -> tuple[int, ...]:
    return tuple(int(i) for i in np.argwhere(mask)[0])


def _wanted(shape: Shape) -> str:
    return "an array of shape (" + ", ".join("any" if n is None else str(n) for n in shape) + ")"


def _short(value: object) -> str:
    text = repr(value)
    return text if len(text) < 60 else text[:57] + "..."
