"""Sensitivities of an equilibrium (appendix A): how states and what is measured on them change with the
design.

In equilibrium r = p - f(x, s) = 0 whatever the design s, so that (A.12 to A.16)

    K dx/ds = -df/ds.

For a measure g(x, s) there are two ways to its derivative: direct, solving for dx/ds once for every design
variable, or adjoint,

    dg/ds = ∂g/∂s - y' df/ds,   K y = (∂g/∂x)',

solving once for every measure. Both are exact, K being symmetric in an equilibrium without applied moments;
`gradients` counts the solves and takes the cheaper way. The right-hand sides go to the solver as one block,
with one factor for all. Where the measures are as local as the variables (tensions by rest lengths), `direct`
condenses K to the few degrees of freedom that they touch.

A design variable is a column of df/ds: `by_rest_length` for cables, `by_stiffness` for whatever the beams'
stiffness depends on (a rod's radius or another size, a connector's EA, GJ or EI), `by_load` for the load
factor. A measure is a row of ∂g/∂x: `tension_rows`, `reaction_rows`, or rows of its own.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from shellform.arrays import Indices, Reals, Record
from shellform.structure.elements.beam import Beams
from shellform.structure.elements.cable import Cables
from shellform.structure.elements.parts import Part
from shellform.structure.elements.state import State, moved
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.factorisation import Factor, NotPositiveDefinite, Symmetric
from shellform.structure.solve.residual import held

_MOST = 4000  # degrees of freedom to which K is condensed: a dense matrix of 128 MB
_AT_ONCE = 2**26  # numbers of a block that is solved for at once: 512 MB
# degrees of freedom that a design variable and the measures touch, for each variable: two nodes' translations
# shared by several cables
_FEW = 3


@dataclass(frozen=True, eq=False)
class Response(Record):
    """An equilibrium ready for sensitivities: `factor` of the tangent at `state`, and `force_by_design` (f,
    s), the derivative of the unbalanced internal forces on the free degrees of freedom by the design
    variables; `family` and `tangent` (nnz,) are what was factorised."""

    state: State
    factor: Factor
    force_by_design: sp.csc_array
    family: Symmetric
    tangent: Reals


def respond(assembly: Assembly, state: State, *columns: sp.csc_array) -> Response:
    """The response at the equilibrium `state` to the design variables of all `columns` (f, k), in order.

    Raises NotPositiveDefinite where the state isn't stable, a rod's rotation about its own axis disregarded.
    """
    balance = assembly.evaluate(state)
    tangent = balance.tangent
    assert tangent is not None
    together = sp.csc_array(sp.hstack(columns, format="csc"))
    try:
        factor = assembly.matrix.factor(tangent)
    except NotPositiveDefinite:
        tangent = held(assembly, balance)
        factor = assembly.matrix.factor(tangent)
    return Response(state, factor, together, assembly.matrix, tangent)


def by_rest_length(assembly: Assembly, state: State, cables: Cables) -> sp.csc_array:
    """Derivative (f, c), N/m, of the internal forces by the cables' rest lengths (A.23)."""
    return element_columns(assembly, cables.dofs(), cables.force_by_rest_length(state))


def element_columns(assembly: Assembly, dofs: Indices, values: Reals) -> sp.csc_array:
    """A column (f, m) on the free degrees of freedom for each element, from its `values` (m, k) at its `dofs`
    (m, k).
    """
    rows = assembly.number[dofs]
    taken = rows >= 0
    columns = np.broadcast_to(np.arange(len(rows))[:, None], rows.shape)
    return sp.csc_array((values[taken], (rows[taken], columns[taken])), shape=(len(assembly.free), len(rows)))


def by_stiffness(assembly: Assembly, state: State, *rates: Part) -> sp.csc_array:
    """Derivatives (f, k) of the internal forces by k variables, on each of which the beams' stiffness depends
    at one of the `rates`: end forces are linear in the stiffness, so that beams with the rate for a stiffness
    have the derivative for end forces (A.27 to A.29)."""
    change = [force_by_stiffness(rate, state)[assembly.free] for rate in rates]
    return sp.csc_array(np.stack(change, axis=1) if change else np.zeros((len(assembly.free), 0)))


def force_by_stiffness(rate: Part, state: State) -> Reals:
    """The same derivative (6 n,) by one variable, at every degree of freedom, held ones too."""
    change = np.zeros(6 * len(state.positions))
    np.add.at(change, rate.dofs(), rate.evaluate(state, tangent=False).force)
    return change


def stiffness_rate(beams: Beams, kind: str, rate: tuple[float, float, float, float]) -> Beams:
    """The beams with the derivatives of EA, GJ, EI_y, EI_z by one variable for the stiffness of one kind, and
    none for the rest.
    """
    chosen = beams.of_kind(kind)
    axial, torsion, bending_y, bending_z = (np.where(chosen, value, 0.0) for value in rate)
    return replace(beams, axial=axial, torsion=torsion, bending_y=bending_y, bending_z=bending_z)


def by_load(assembly: Assembly, load: Reals) -> sp.csc_array:
    """The column (f, 1) of the factor of a dead load (n, 6)."""
    return sp.csc_array(-load.ravel()[assembly.free][:, None])


def tension_rows(assembly: Assembly, state: State, cables: Cables) -> sp.csr_array:
    """Derivative (c, f), N/m, of the tensions by the free degrees of freedom at fixed rest lengths; they add
    -EA l/l0² by their own.
    """
    return sp.csr_array(element_columns(assembly, cables.dofs(), cables.tension_by_position(state)).T)


def reaction_rows(assembly: Assembly, state: State, dofs: Indices) -> sp.csr_array:
    """Derivative (k, f), N/m and N/rad, of the internal forces at held `dofs` (k,) by the free ones: of
    the reactions, the load given.
    """
    wanted = np.full(6 * assembly.count, -1)
    wanted[dofs] = np.arange(len(dofs))
    number = assembly.number
    result = sp.csr_array((len(dofs), len(assembly.free)))
    for part in assembly.parts:
        own = part.dofs()
        size = own.shape[1] if own.ndim == 2 else 0
        touched = np.flatnonzero((wanted[own] >= 0).any(axis=1)) if size else np.zeros(0, dtype=np.int64)
        if not len(touched):
            continue
        packed = part.evaluate(state, tangent=True).tangent
        assert packed is not None
        lower = np.tril_indices(size)
        full = np.zeros((len(touched), size, size))
        full[:, lower[0], lower[1]] = full[:, lower[1], lower[0]] = packed[touched]
        rows = np.broadcast_to(wanted[own[touched]][:, :, None], full.shape)
        columns = np.broadcast_to(number[own[touched]][:, None, :], full.shape)
        kept = (rows >= 0) & (columns >= 0)
        result = result + sp.csr_array((full[kept], (rows[kept], columns[kept])), shape=result.shape)
    return result


def gradients(response: Response, by_state: Reals, by_design: Reals) -> Reals:
    """Total derivatives (g, s) of g measures, from their partial ones by the free degrees of freedom (g, f)
    and by the design (g, s).
    """
    if by_state.shape[0] == 0:
        return by_design
    if by_state.shape[0] <= response.force_by_design.shape[1]:
        return by_design + adjoint(response, by_state)
    return by_design + direct(response, by_state)


def adjoint(response: Response, by_state: Reals | sp.csr_array) -> Reals:
    """-(K⁻¹ ∂g/∂x)' ∂f/∂s (g, s), one solve for each measure."""
    found = np.empty((by_state.shape[0], response.force_by_design.shape[1]))
    some = max(1, _AT_ONCE // max(by_state.shape[1], 1))
    for first in range(0, len(found), some):
        own = slice(first, first + some)
        multipliers = response.factor.solve(_dense(by_state[own].T))
        found[own] = -(response.force_by_design.T @ multipliers).T
    return found


def direct(response: Response, by_state: Reals | sp.csr_array) -> Reals:
    """∂g/∂x dx/ds (g, s), one solve for each design variable, or through the few degrees of freedom that both
    touch.
    """
    if sp.issparse(by_state):
        kept = _touched(response, sp.csr_array(by_state))
        if len(kept) <= min(_FEW * response.force_by_design.shape[1], _MOST):
            moves = response.family.solve_kept(
                response.tangent, kept, response.force_by_design[kept].toarray()
            )
            if moves is not None:
                return np.asarray(-(by_state[:, kept] @ moves))
    return np.asarray(by_state @ state_by_design(response))


def _touched(response: Response, by_state: sp.csr_array) -> np.ndarray:
    """The degrees of freedom, ascending, that the design's forces act on or that the measures read.

    dx/ds is wanted there only, and K condensed to them says as much of it as K: the solves are dense ones of
    their number.
    """
    marked = np.zeros(by_state.shape[1], dtype=bool)
    marked[response.force_by_design.indices] = True
    marked[by_state.indices] = True
    return np.flatnonzero(marked)


def state_by_design(response: Response) -> Reals:
    """dx/ds (f, s) of the free degrees of freedom (A.16)."""
    return -response.factor.solve(_dense(response.force_by_design))


def state_change(response: Response, change: Reals) -> Reals:
    """The free degrees of freedom's changes (f,) with a `change` (s,) of the design variables, to first
    order."""
    return np.asarray(-response.factor.solve(response.force_by_design @ change))


def predicted(assembly: Assembly, response: Response, change: Reals) -> State:
    """Where the equilibrium goes with a `change` (s,) of the design variables, to first order: a start for
    the next one.
    """
    step = assembly.by_node(state_change(response, change))
    return moved(response.state, assembly.chords.corrected(response.state, step))


def _dense(matrix: Reals | sp.csc_array) -> Reals:
    return np.asfortranarray(sp.csc_array(matrix).toarray() if sp.issparse(matrix) else matrix)
