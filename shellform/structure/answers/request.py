"""What an analysis is asked for, checked, and the state that it starts from."""

from __future__ import annotations

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_count, require_known, require_number
from shellform.structure.elements import rotation
from shellform.structure.elements.state import State
from shellform.structure.model import Model
from shellform.structure.network import Network

_MOST = 1_000_000  # increments: of the smallest structure they take 15 minutes
# of factors and ways: products of larger ones overflow, as of forces, which models refuse (refusals.py)
_SMALLEST, _LARGEST = 1e-30, 1e30
METHODS = ("relaxation", "dynamic", "newton", "path")


def check_request(
    *,
    factor: float,
    increments: int,
    tolerance: float,
    method: str,
    lead: tuple[int, int, float] | None,
    limit: int,
    mode_count: int,
    critical_to: float | None,
    node_count: int,
) -> None:
    """Raises InputError for numbers, methods and leads that make no sense on so many nodes."""
    require_count(increments, where="--increments", give="a number of load steps, such as 10", most=_MOST)
    require_number(factor, where="--factor", give="a factor of the load, such as 1")
    _check_size(factor, "--factor")
    if not 0.0 < tolerance < 1.0:
        raise InputError(
            "must be between 0 and 1", where="--tolerance", value=tolerance, remedy="For example 1e-9."
        )
    require_known(method, METHODS, where="--method", what="unknown method")
    require_count(limit, where="--limit", give="a number of iterations, such as 100")
    require_count(mode_count, least=0, where="--modes", give="a number of modes, such as 3, or 0 for none")
    if critical_to is not None:
        require_number(critical_to, where="--critical", give="a factor of the load, such as 3")
        if critical_to == 0.0:
            raise InputError(
                "no path leads to the factor 0",
                where="--critical",
                remedy="Give a factor of the load other than 0, such as 3.",
            )
        _check_size(critical_to, "--critical")
    if lead is not None and method != "path":
        raise InputError(
            "leads a path, and none is followed",
            where="--lead",
            value=method,
            remedy='Ask for the method "path", or leave the lead out.',
        )
    if lead is not None and not (
        len(lead) == 3
        and 0 <= lead[0] < node_count
        and lead[1] in (0, 1, 2)
        and np.isfinite(lead[2])
        and _SMALLEST <= abs(lead[2]) <= _LARGEST
    ):
        raise InputError(
            f"must be a node, an axis 0 to 2 and a displacement of {_SMALLEST:g} to {_LARGEST:g} m either way",
            where="--lead",
            value=lead,
            remedy=f"For example {node_count // 2}:z:-0.05, of nodes from 0 to {node_count - 1}.",
        )


def _check_size(factor: float, where: str) -> None:
    """Raises InputError for a load factor other than 0 of a size that no analysis is made for."""
    if factor != 0.0 and not _SMALLEST <= abs(factor) <= _LARGEST:
        raise InputError(
            f"must be between {_SMALLEST:g} and {_LARGEST:g} in size",
            where=where,
            value=factor,
            remedy="Give a factor such as 3, and forces in newtons in the load case.",
        )


def with_supports_moved(network: Network, state: State) -> State:
    """The state with held degrees of freedom where the supports want them at load factor 1."""
    positions, quaternions = state.positions.copy(), state.quaternions.copy()
    held = network.fixed[:, :3]
    positions[held] = (network.nodes + network.imposed[:, :3])[held]
    turned = network.fixed[:, 3:].all(axis=1)
    quaternions[turned] = rotation.from_vectors(network.imposed[turned, 3:])
    return State(positions, quaternions)


def check_imposed_turns(network: Network) -> None:
    """Raises InputError for a turn imposed on a node that may turn about another axis."""
    partly = (
        network.fixed[:, 3:].any(axis=1)
        & ~network.fixed[:, 3:].all(axis=1)
        & network.imposed[:, 3:].any(axis=1)
    )
    if partly.any():
        raise InputError(
            "a rotation can be imposed only where all three rotations are fixed",
            where=f"supports at node {int(np.argmax(partly))}",
            remedy="Fix all three rotations of that node, or impose none.",
        )


def chosen_load(model: Model, name: str | None) -> Reals:
    """The load (n, 6) of the case `name`; where there is none, that of the only case, or none. "none" is the
    structure without load unless a case has that name. Raises InputError.
    """
    if name is None:
        if len(model.loads) > 1:
            raise InputError(
                "the model has several load cases",
                remedy=f"Choose one with --load: {', '.join(model.loads)}.",
            )
        return next(iter(model.loads.values()), np.zeros((len(model.network.nodes), 6)))
    if name == "none" and name not in model.loads:
        return np.zeros((len(model.network.nodes), 6))
    if name not in model.loads:
        known = ", ".join(model.loads) or "none"
        raise InputError("there is no such load case", where="--load", value=name, remedy=f"Known: {known}.")
    return model.loads[name]
