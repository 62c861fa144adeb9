"""Sensitivities of an equilibrium (appendix A): how states and what is measured on them change with the design.

In equilibrium r = p - f(x, s) = 0 whatever the design s, so that (A.12 to A.16)

    K dx/ds = -df/ds.

For a measure g(x, s) there are two ways to its derivative: direct, solving for dx/ds once for every design variable, or adjoint,

    dg/ds = ∂g/∂s - y' df/ds,   K y = (∂g/∂x)',

solving once for every measure. Both are exact, K being symmetric in an equilibrium without applied moments; `gradients`
counts the solves and takes the cheaper way. The right-hand sides go to the solver as one block.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Reals
from shellform.structure.assembly import Assembly
from shellform.structure.beam import Beams
from shellform.structure.cable import Cables
from shellform.structure.sparse import Factor
from shellform.structure.state import State


@dataclass(frozen=True)
class Response:
    """An equilibrium ready for sensitivities: `factor` of the tangent at `state`, and `force_by_design` (f, s), the derivative
    of the internal forces on the free freedoms by the design variables: the cables' rest lengths, then the rod radius if free."""

    state: State
    factor: Factor
    force_by_design: sp.csc_array


def respond(
    assembly: Assembly, state: State, cables: Cables, columns: np.ndarray, size: int, beams_by_radius: Beams | None
) -> Response:
    """The response at the equilibrium `state`.

    `columns` (c,): the design variable of each cable of the model; `size` how many there are in all, the radius being the last
    where `beams_by_radius` is given. Raises NotPositiveDefinite where the state isn't stable.
    """
    number = np.full(6 * assembly.count, -1)
    number[assembly.free] = np.arange(len(assembly.free))
    rows = number[cables.freedoms()]
    values = cables.force_by_rest_length(state)
    taken = rows >= 0
    repeated = np.broadcast_to(columns[:, None], rows.shape)
    parts = [sp.coo_array((values[taken], (rows[taken], repeated[taken])), shape=(len(assembly.free), size))]
    if beams_by_radius is not None:
        change = np.zeros(6 * assembly.count)
        np.add.at(change, beams_by_radius.freedoms(), beams_by_radius.evaluate(state, tangent=False).force)
        last = np.full(len(assembly.free), size - 1)
        parts.append(
            sp.coo_array((change[assembly.free], (np.arange(len(last)), last)), shape=(len(last), size))
        )
    return Response(state, assembly.factor(state), sp.csc_array(sum(part.tocsc() for part in parts)))


def gradients(response: Response, by_state: Reals, by_design: Reals) -> Reals:
    """Total derivatives (g, s) of g measures, from their partial ones by the free freedoms (g, f) and by the design (g, s)."""
    if len(by_state) == 0:
        return by_design
    if len(by_state) <= response.force_by_design.shape[1]:
        return by_design + adjoint(response, by_state)
    return by_design + direct(response, by_state)


def adjoint(response: Response, by_state: Reals) -> Reals:
    """-(K⁻¹ ∂g/∂x)' ∂f/∂s (g, s), one solve for each measure."""
    multipliers = response.factor.solve(np.ascontiguousarray(by_state.T))
    return np.asarray(-(response.force_by_design.T @ multipliers).T)


def direct(response: Response, by_state: Reals) -> Reals:
    """∂g/∂x dx/ds (g, s), one solve for each design variable."""
    return np.asarray(by_state @ state_by_design(response))


def state_by_design(response: Response) -> Reals:
    """dx/ds (f, s) of the free freedoms (A.16)."""
    return -response.factor.solve(response.force_by_design.toarray())
