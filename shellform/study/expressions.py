"""Arithmetic in study files: `joint.gap = "net.spacing / 27.5"`.

An expression is data: its syntax tree is walked here, node by node, and only numbers, names of entries, + - *
/ // % **, comparisons, `a if c else b` and the functions below mean anything. Nothing is compiled or run;
every number on the way is a float, what a comparison gives too, so that no power grows without end; length
and depth are bounded.
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable
from typing import Any

from shellform.errors import InputError

_LONGEST = 500  # characters; bounds depth and time too
_BINARY: dict[type[ast.operator], Callable[[float, float], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_COMPARE: dict[type[ast.cmpop], Callable[[float, float], bool]] = {
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Eq: operator.eq,
    ast.NotEq: operator.ne,
}
_FUNCTIONS: dict[str, Callable[..., float]] = {
    "min": min,
    "max": max,
    "abs": abs,
    "sqrt": math.sqrt,
    "exp": math.exp,
    "log": math.log,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "floor": math.floor,
    "ceil": math.ceil,
    "round": round,
}
_CONSTANTS = {"pi": math.pi}


def evaluate(text: str, where: str, entry: Callable[[str], float]) -> float:
    """The value of an expression; `entry` gives the number of a case's entry by its dotted name.

    Raises InputError naming `where` it stands for whatever is no arithmetic, and where the value isn't
    finite.
    """
    if len(text) > _LONGEST:
        raise InputError(
            f"is longer than {_LONGEST} characters", where=where, remedy="Split it into functions."
        )
    try:
        tree = ast.parse(text.strip(), mode="eval")
        value = _value(tree.body, where, entry)
    except InputError:
        raise
    except (SyntaxError, ValueError, RecursionError, MemoryError, ArithmeticError, TypeError) as error:
        raise _unworkable(f"can't be worked out: {error}", where, text) from error
    if not math.isfinite(value):
        raise _unworkable("isn't finite", where, text)
    return value


def _unworkable(what: str, where: str, text: str) -> InputError:
    return InputError(
        what, where=where, value=text, remedy="Mend the expression, or the numbers that it is given."
    )


def _value(node: ast.AST, where: str, entry: Callable[[str], float]) -> float:
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        return float(node.value)  # type: ignore[arg-type]
    if isinstance(node, ast.Name | ast.Attribute):
        name = _name(node)
        if name is not None:
            return _CONSTANTS[name] if name in _CONSTANTS else float(entry(name))
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
        value = _value(node.operand, where, entry)
        return -value if isinstance(node.op, ast.USub) else value
    elif isinstance(node, ast.BinOp) and type(node.op) in _BINARY:
        found = _BINARY[type(node.op)](_value(node.left, where, entry), _value(node.right, where, entry))
        if isinstance(found, complex):
            raise ValueError("the root of a negative number")
        return float(found)
    elif isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _COMPARE:
        left, right = _value(node.left, where, entry), _value(node.comparators[0], where, entry)
        return float(_COMPARE[type(node.ops[0])](left, right))
    elif isinstance(node, ast.IfExp):
        return _value(node.body if _value(node.test, where, entry) else node.orelse, where, entry)
    elif (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in _FUNCTIONS
        and not node.keywords
    ):
        return float(_FUNCTIONS[node.func.id](*(_value(each, where, entry) for each in node.args)))
    raise InputError(
        "isn't arithmetic",
        where=where,
        value=ast.unparse(node),
        remedy=f"Known are numbers, entries like net.spacing, + - * / // % **, comparisons, a if c else b, "
        f"pi, {', '.join(_FUNCTIONS)}.",
    )


def _name(node: ast.AST) -> str | None:
    """The dotted name that a node spells, if it does."""
    parts: list[str] = []
    while isinstance(node, ast.Attribute):
        parts.append(node.attr)
        node = node.value
    return ".".join([node.id, *reversed(parts)]) if isinstance(node, ast.Name) else None
