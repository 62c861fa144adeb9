"""Re-tensioning on site: from a survey of the erected grid to the next turn of the turnbuckles (the paper's
outlook, after Liew et al.).

Cables are never as long as drawn. What is known of their rest lengths l is a mean m and a covariance C, at
first the drawing and the usual error of a cable. A survey y of the nodes x(l), with noise s, teaches more
(the extended Kalman filter, iterated): with J = dx/dl at the estimate

    l <- m + K (y - x(l) - J (m - l)),   K = C J' (J C J' + s² 1)⁻¹,   C <- C - K J C,

x(l) being a re-solved equilibrium every time, and steps halved until they lead to a likelier estimate: the
sum of squares of what the survey and the belief are missed by, each over its deviation, falls. Then the turns
k, whole numbers of the turnbuckle's step h, are sought that minimise |x + J h k - goal|² + λ |h k|²
(turns.py), x and J now those of the whole grid at the estimate. λ = (noise / largest change)²: a cable isn't
turned for less than the survey can see. The first-order shape is checked by the true equilibrium on the
stable branch; turns that leave the branch are halved.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from shellform.arrays import Indices, Reals, Record, indices, reals
from shellform.errors import InputError, NotConverged, require_count, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.quantities import PLACE_DEVIATION
from shellform.site.measurements import check_noise
from shellform.site.turns import Crew as Crew  # what an adjustment is asked with
from shellform.site.turns import whole_turns
from shellform.structure.answers.sensitivity import by_rest_length, predicted, respond, state_by_design
from shellform.structure.elements.state import State
from shellform.structure.network import assemble
from shellform.structure.solve.assembly import Assembly
from shellform.structure.solve.equilibrium import find_equilibrium
from shellform.structure.solve.factorisation import NotPositiveDefinite
from shellform.tables import Table, table_text

# linearisations of one survey; where no cable becomes slack the error is of second order after each
_LEARNING = 8
_SETTLED = 0.02  # of a cable's usual error: smaller changes of the estimate end the learning
_NO_STEP = 1e-9  # of a cable's usual error: rounding says whether a smaller change is likelier
_HALVINGS = 5  # of a change that leaves the stable branch, or leads to no likelier estimate
_TRIAL = 25  # factorisations of an equilibrium next to a known one


@dataclass(frozen=True, eq=False)
class Belief(Record):
    """What is thought of the grid as built: `design` with the estimated rest lengths, their `covariance` (p,
    p), m², of the present cables, and the `state` in equilibrium under the dead `load` (n, 6)."""

    design: Design
    covariance: Reals
    state: State
    load: Reals


@dataclass(frozen=True, eq=False)
class Adjustment(Record):
    """The next round of turning.

    - `turns` (c,) of every candidate cable, in steps; `change` (c,), m, of rest length, negative where
      shorter.
    - `predicted` (n, 3), m: the shape to first order; `belief` afterwards, in the true equilibrium.
    - `misfit_before`, `misfit_predicted` and `misfit_after`, m²: sums of squares before, to first order, and
      in the true equilibrium.
    - `halved`: how often the change was, to stay on the stable branch.
    """

    turns: Indices
    change: Reals
    predicted: Reals
    belief: Belief
    misfit_before: float
    misfit_predicted: float
    misfit_after: float
    halved: int

    @property
    def cables(self) -> int:
        """How many are turned."""
        return int(np.count_nonzero(self.turns))

    @property
    def turns_in_all(self) -> int:
        """Steps of all cables, whichever way."""
        return int(np.abs(self.turns).sum())

    def schedule(self, shell: Gridshell) -> str:
        """What the crew does, cable after cable, as CSV: number among the design's own cables, as in drawings
        and model files, both nodes, turns (negative: tighten), change in mm, tension afterwards in N.
        """
        design = self.belief.design
        number = np.cumsum(design.present) - 1
        tension = np.zeros(len(self.turns))
        tension[design.present] = shell.cables(design).tension(self.belief.state)
        rows = []
        for cable in np.flatnonzero(self.turns):
            a, b = shell.cable_ends[cable].tolist()
            turn, change = f"{self.turns[cable]:+d}", f"{1e3 * self.change[cable]:+.2f}"
            rows.append((int(number[cable]), a, b, turn, change, f"{tension[cable]:.2f}"))
        heads = ("cable", "node a", "node b", "turns", "change [mm]", "tension after [N]")
        return table_text(Table("turns", heads, tuple(rows)))


@dataclass(frozen=True, eq=False)
class Replay(Record):
    """A loop of survey and adjustment played on a grid whose true lengths are known: the true sum of squares
    of distances to the goal `misfits` (r + 1,), m², before and after every round, the `adjustments` (r,), and
    the true `state` in the end."""

    misfits: Reals
    adjustments: tuple[Adjustment, ...]
    state: State

    @property
    def removed(self) -> float:
        """Share of the first misfit that is gone."""
        return float(1.0 - self.misfits[-1] / self.misfits[0])


def first_belief(design: Design, state: State, load: Reals, *, length_error: float) -> Belief:
    """What is believed before the first survey: lengths as drawn with the usual error `length_error`, m (one
    standard deviation), of a cable; `state` is the design's equilibrium under the `load`."""
    PLACE_DEVIATION.require(length_error, where="--length-error")
    count = int(design.present.sum())
    if count == 0:
        raise InputError("has no cables to turn", where="design", remedy="Name a design that has cables.")
    return Belief(design, length_error**2 * np.eye(count), state, np.asarray(load))


def learn(shell: Gridshell, belief: Belief, nodes: Indices, survey: Reals, *, noise: float) -> Belief:
    """The belief after a `survey` (m, 3), m, of the `nodes` (m,) in the model's axes, NaN where a node wasn't
    seen, with `noise`, m, a coordinate.

    Raises InputError where nothing was seen, NotConverged where no equilibrium explains it even to a
    thirtieth.
    """
    marked = indices("nodes", nodes, (None,), below=shell.node_count)
    measured = np.asarray(survey, dtype=float)
    if measured.shape != (len(marked), 3):
        remedy = f"Give {len(marked)} rows of x, y, z, m, nan where a node wasn't seen."
        raise InputError("must be a point for each node", where="survey", value=measured.shape, remedy=remedy)
    seen = np.isfinite(measured).all(axis=1)
    if not seen.any():
        raise InputError(
            "no node was seen", where="survey", remedy="Give at least one node a measured place."
        )
    check_noise(noise)
    goal, marked = measured[seen].ravel(), marked[seen]
    assembly = assemble(shell.network(belief.design))
    present = belief.design.present
    mean, state, now = belief.design.rest_length[present], belief.state, belief.design
    usual = np.sqrt(np.diag(belief.covariance).max())
    likelihood = _Likelihood(mean, belief.covariance, goal, marked, noise)
    missed = likelihood.missed(now.rest_length[present], state)
    for _ in range(_LEARNING):
        rates = _rates(shell, assembly, now, state)[marked].reshape(len(goal), -1)
        spread = belief.covariance @ rates.T
        gain = np.linalg.solve(rates @ spread + noise**2 * np.eye(len(goal)), spread.T).T
        here = now.rest_length[present]
        step = mean + gain @ (goal - state.positions[marked].ravel() - rates @ (mean - here)) - here
        if np.abs(step).max() < _NO_STEP * usual:
            break
        # Whole steps go to and fro where cables become slack by one and taut by the next.
        for _ in range(_HALVINGS):
            then, there, _ = _followed(shell, assembly, now, state, belief.load, step)
            fewer = likelihood.missed(then.rest_length[present], there)
            if fewer < missed:
                break
            step = 0.5 * step
        else:
            break
        now, state, missed = then, there, fewer
        if np.abs(now.rest_length[present] - here).max() < _SETTLED * usual:
            break
    covariance = belief.covariance - gain @ spread.T
    return Belief(now, 0.5 * (covariance + covariance.T), state, belief.load)


@dataclass(frozen=True, eq=False)
class _Likelihood(Record):
    """How unlikely lengths are, after a survey that put the `marked` nodes at the `goal` (3 m,) with
    `noise`."""

    mean: Reals
    covariance: Reals
    goal: Reals
    marked: Indices
    noise: float

    def missed(self, lengths: Reals, state: State) -> float:
        """The sum of squares of what survey and belief are missed by, each over its deviation."""
        away = (state.positions[self.marked].ravel() - self.goal) / self.noise
        off = lengths - self.mean
        return float(away @ away + off @ np.linalg.solve(self.covariance, off))


def adjust(shell: Gridshell, belief: Belief, goal: Reals, crew: Crew, *, noise: float) -> Adjustment:
    """The next turns towards the `goal` (n, 3), m, as far as the crew can; see the head. Raises
    NotConverged.
    """
    check_noise(noise)
    wanted = reals("goal", goal, (shell.node_count, 3))
    assembly = assemble(shell.network(belief.design))
    rates = _rates(shell, assembly, belief.design, belief.state)
    jacobian = rates.reshape(-1, rates.shape[2])
    away = (belief.state.positions - wanted).ravel()
    # Slack cables don't answer to a turn; nothing is known of them before they are taut.
    answers = np.abs(jacobian).max(axis=0) > 0.0
    steps = np.zeros(jacobian.shape[1], dtype=np.int64)
    steps[answers] = whole_turns(jacobian[:, answers], away, crew, weight=(noise / crew.largest) ** 2)
    design, state, halved = _followed(
        shell,
        assembly,
        belief.design,
        belief.state,
        belief.load,
        crew.step * steps.astype(float),
        step=crew.step,
    )
    present = belief.design.present
    change = np.zeros(len(present))
    change[present] = design.rest_length[present] - belief.design.rest_length[present]
    turns = np.rint(change / crew.step).astype(np.int64)
    linear = belief.state.positions + (jacobian @ change[present]).reshape(-1, 3)
    return Adjustment(
        turns=turns,
        change=change,
        predicted=linear,
        belief=replace(belief, design=design, state=state),
        misfit_before=float((away**2).sum()),
        misfit_predicted=float(((linear - wanted) ** 2).sum()),
        misfit_after=float(((state.positions - wanted) ** 2).sum()),
        halved=halved,
    )


def check_slip(slip: float) -> None:
    """Raises InputError for a crew's error of turns that is no share of them."""
    give = "a share of each turn, such as 0.05, or 0 for none"
    require_number(slip, least=0.0, most=1.0, where="--slip", give=give, share=True)


def replay(
    shell: Gridshell,
    belief: Belief,
    errors: Reals,
    goal: Reals,
    nodes: Indices,
    crew: Crew,
    *,
    noise: float,
    rounds: int,
    seed: int,
    slip: float = 0.0,
) -> Replay:
    """The loop of survey, learning and adjustment on a grid whose candidate cables are longer than believed
    by `errors` (c,), m.

    Surveys of the `nodes` have `noise`, m, a coordinate; each turned cable misses its change by `slip` of it
    (one standard deviation). It ends after `rounds`, or where no turn is worth taking. Raises NotConverged.
    """
    require_count(rounds, where="rounds", give="a number of rounds, such as 3")
    require_count(seed, least=0, where="seed", give="a whole number, such as 1")
    check_slip(slip)
    rng = np.random.default_rng(seed)
    wanted = reals("goal", goal, (shell.node_count, 3))
    wrong = reals("errors", errors, (len(belief.design.present),))
    assembly = assemble(shell.network(belief.design))
    present = belief.design.present
    true, state, halved = _followed(shell, assembly, belief.design, belief.state, belief.load, wrong[present])
    if halved:
        raise NotConverged(
            "With these errors the grid isn't on the stable branch",
            state=state,
            remedy="Plant smaller errors.",
        )
    misfits = [float(((state.positions - wanted) ** 2).sum())]
    done: list[Adjustment] = []
    for _ in range(rounds):
        survey = state.positions[nodes] + noise * rng.normal(size=(len(nodes), 3))
        belief = learn(shell, belief, nodes, survey, noise=noise)
        step = adjust(shell, belief, wanted, crew, noise=noise)
        if not step.turns.any():
            break
        moved = step.change * (1.0 + slip * rng.normal(size=len(present)))
        true, state, halved = _followed(shell, assembly, true, state, belief.load, moved[present])
        if halved:
            raise NotConverged(
                "An adjustment led the true grid off the stable branch",
                state=state,
                remedy="Allow smaller changes.",
            )
        # The crew's own inaccuracy adds to what isn't known.
        slack = np.diag((slip * step.change[present]) ** 2)
        belief = replace(step.belief, covariance=step.belief.covariance + slack)
        misfits.append(float(((state.positions - wanted) ** 2).sum()))
        done.append(step)
    return Replay(np.array(misfits), tuple(done), state)


def _rates(shell: Gridshell, assembly: Assembly, design: Design, state: State) -> Reals:
    """dx/dl (n, 3, p) of all nodes by the rest lengths of the present cables."""
    cables = shell.cables(design)
    here = assembly.with_parts((shell.beams(design.radius), cables))
    try:
        response = respond(here, state, by_rest_length(here, state, cables))
    except NotPositiveDefinite as error:
        raise NotConverged(
            "The believed state isn't stable",
            state=state,
            remedy="Start from the equilibrium of the design under this load.",
        ) from error
    result = np.zeros((6 * assembly.count, len(cables.ends)))
    result[assembly.free] = state_by_design(response)
    return result.reshape(assembly.count, 6, -1)[:, :3]


def _followed(
    shell: Gridshell,
    assembly: Assembly,
    design: Design,
    state: State,
    load: Reals,
    change: Reals,
    *,
    step: float = 0.0,
) -> tuple[Design, State, int]:
    """The design with its present rest lengths changed by (p,), m, its equilibrium, and how often the change
    was halved (to whole steps, if there is one) to stay on the stable branch. Raises NotConverged."""
    for halving in range(_HALVINGS + 1):
        part = change * 0.5**halving
        if step > 0.0:
            part = step * np.trunc(np.rint(change / step) * 0.5**halving)
        lengths = design.rest_length.copy()
        lengths[design.present] += part
        if (lengths <= 0.0).any():
            continue
        then = replace(design, rest_length=lengths)
        cables = shell.cables(design)
        here = assembly.with_parts((shell.beams(design.radius), cables))
        there = assembly.with_parts((shell.beams(design.radius), shell.cables(then)))
        for start in (None, state):
            try:
                if start is None:
                    start = predicted(here, respond(here, state, by_rest_length(here, state, cables)), part)
                found = find_equilibrium(there, start, load, limit=_TRIAL, on_branch=True)
            except (NotConverged, NotPositiveDefinite):
                continue
            if found.stable:
                return then, found.state, halving
    raise NotConverged(
        "No stable equilibrium follows the change of rest lengths, however small",
        state=state,
        remedy="Start from a stable equilibrium of the design under this load, or prop the grid first.",
    )
