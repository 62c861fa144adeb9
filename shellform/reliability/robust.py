"""How the misfit of structures as built scatters: predicted about the perfect structure, by cause of error,
and found of drawn structures that are loaded on their own paths.

At the perfect structure's equilibrium, with the errors of one cause alone, drawn structure j moves by X_jc
to first order (first_order.py); with all it moves by the sum of these, X_j, and with the opposite errors by
-X_j. With d the distances from the target the misfits are |d + X_j|² and |d - X_j|², their mean

    d'd + mean |X_j|²,

and of their deviation the part 4 mean (d'X_j)² comes of where the perfect structure is off. A cause's shares
are those of mean |X_jc|² and of mean (d'X_jc)².

How equilibria curve is left out: on the vault with eleven cables the mean is told 3 % and the deviation 1 %
below those of the same 400 structures re-solved, with twice the errors 15 and 26 %. Where errors bring a
shell near its limit load, a sample tells.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals, Record
from shellform.errors import require_count
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.quantities import number
from shellform.reliability.drawing import errors_by_cause
from shellform.reliability.first_order import moved_from
from shellform.reliability.perfect import TO_ITS_END, perfect
from shellform.reliability.standing import Workshop
from shellform.structure.elements.state import State
from shellform.structure.network import assemble

DRAWN = 96  # structures, and as many with opposite errors, by which is predicted
_TOLD = 0.01  # of the scatter, from which on a cause is told in a sentence
_AT_ONCE = 8  # whose motions by all causes are kept at the same time


@dataclass(frozen=True, eq=False)
class Spread(Record):
    """How the misfit scatters, to first order in the errors: `nominal`, m², without errors; its `mean` and
    standard `deviation`; `causes`: each one's share of the scatter of the shape, mean |X_j|², and of that
    part of the misfit's variance that comes of where the perfect structure is off; `node_deviation` (n,), m:
    the root mean square motion of each node."""

    nominal: float
    mean: float
    deviation: float
    causes: Mapping[str, tuple[float, float]]
    node_deviation: Reals

    def sentences(self) -> list[str]:
        """Mean and deviation, and the causes by their share of the scatter, from a hundredth of it on."""
        built, planned = (
            1e3 * np.sqrt(each / len(self.node_deviation)) for each in (self.mean, self.nominal)
        )
        result = [
            f"As built the misfit is {number(self.mean)} ± {number(self.deviation, 2)} m² (mean and standard deviation, to "
            f"first order), {number(float(built))} mm a node in root mean square, against {number(self.nominal)} m² and "
            f"{number(float(planned))} mm as planned."
        ]
        for name, (share, _) in sorted(self.causes.items(), key=lambda each: -each[1][0]):
            if share >= _TOLD:
                result.append(f"{100.0 * share:.1f} % of the scatter of the shape comes from {name}.")
        return result


@dataclass(frozen=True, eq=False)
class MisfitSample(Record):
    """Misfits, m², of drawn structures at rest under the load, and how many are `lost`: they fall, and have
    none.
    """

    misfits: Reals
    lost: int


def spread(
    shell: Gridshell,
    design: Design,
    state: State,
    load: Reals,
    tolerances: Tolerances,
    *,
    seed: int = 0,
    drawn: int = DRAWN,
) -> Spread:
    """The scatter of the misfit about the stable equilibrium `state` of the design under the dead `load`
    (n, 6), predicted from so many structures `drawn` under the seed and their opposites. Raises InputError
    where no tolerance is given, NotConverged where the state isn't stable or the design has no unloaded
    equilibrium."""
    require_count(drawn, where="spread.drawn", give=f"a number of structures, such as {DRAWN}")
    tolerances.require_causes()
    causes = tolerances.causes
    nominal, away = perfect(shell, design, load, step=TO_ITS_END), state.positions - shell.target.positions
    assembly, members = assemble(nominal.network), nominal.members

    squares, along = np.zeros((drawn, len(away))), np.zeros(drawn)
    shape, variance = np.zeros(len(causes)), np.zeros(len(causes))
    for first in range(0, drawn, _AT_ONCE):
        numbers = range(first, min(first + _AT_ONCE, drawn))
        own = errors_by_cause(members, tolerances, seed, numbers)
        some = [errors for each in own.values() for errors in each]
        moved = moved_from(assembly, state, load, design.present, some, nominal.imperfections)
        motions = moved.translations.reshape(len(causes), len(numbers), *away.shape)
        shape += (motions**2).sum(axis=(1, 2, 3))
        variance += (np.einsum("cknj,nj->ck", motions, away) ** 2).sum(axis=1)
        together = motions.sum(axis=0)
        squares[numbers] = (together**2).sum(axis=2)
        along[numbers] = np.einsum("knj,nj->k", together, away)
    misfit, even = float((away**2).sum()), squares.sum(axis=1)
    return Spread(
        misfit,
        misfit + float(even.mean()),
        float(np.sqrt(even.var() + 4.0 * (along**2).mean())),
        dict(zip(causes, zip(_shares(shape), _shares(variance), strict=True), strict=True)),
        np.sqrt(squares.mean(axis=0)),
    )


def _shares(sums: Reals) -> list[float]:
    found: list[float] = (sums / max(float(sums.sum()), 1e-300)).tolist()
    return found


def sample(
    shell: Gridshell, design: Design, load: Reals, tolerances: Tolerances, *, count: int, seed: int
) -> MisfitSample:
    """Misfits of `count` drawn structures, each loaded from nothing with the dead `load` (n, 6) on its own
    path (standing.py): under one seed those by which `spread` predicts, and the same ones whatever the count.
    Raises NotConverged where the design has no unloaded equilibrium."""
    require_count(count, where="sample.count", give="a number of structures to draw, such as 100")
    require_count(seed, least=0, where="sample.seed", give="a whole number, such as 1")
    workshop = Workshop(perfect(shell, design, load, step=TO_ITS_END))
    outcomes = workshop.load_numbers(tolerances, seed=seed, numbers=range(count))
    rest = [each.state.positions for each in outcomes if each.stands]
    misfits = [float(((each - shell.target.positions) ** 2).sum()) for each in rest]
    return MisfitSample(np.array(misfits), count - len(rest))
