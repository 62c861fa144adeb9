"""What is asked of a design as built, and whether it holds: drawn structures on their own paths, and the
perfect one with rod elements halved.

Load cases that are shares of a larger one lie on its path: each drawn structure is loaded once, with the
largest, and stands under a smaller one where its branch goes on beyond it. So the same structures are judged
under the design load and under the additional one.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shellform.arrays import Reals
from shellform.errors import InputError, require_count, require_number
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.path_of_one import RESOLUTION, Limit
from shellform.reliability.perfect import TO_ITS_END, perfect
from shellform.reliability.probability import CONFIDENCE, Standing, counted
from shellform.reliability.refinement import critical_of, model_under, rods_halved
from shellform.reliability.standing import Workshop

SAME = 1e-9  # relative: shares and factors of a load that count as equal


@dataclass(frozen=True)
class Safety:
    """What is asked of a design with these `tolerances`.

    - `probability_design`: share of structures that stand under the design load.
    - `probability_additional`: the same under every other load; None: no less than of the initial design, but
      never more than under the design load.
    - `critical_factor`: of the perfect structure under the design load, on the mesh with rod elements halved;
      None: any.
    - `stiffness`: share of the start's softest mode that a search keeps at first.
    - `margin`: least tension that a search leaves to cables under the design load, in deviations of what the
      median cable is off by.
    - `drawn`, `seed`: structures with which a finished design is judged.
    - `tried`, `enlarged`: structures with which a search judges, under a seed of their own, their errors
      larger by this factor (requirements.py).
    """

    tolerances: Tolerances
    probability_design: float = 0.99
    probability_additional: float | None = None
    critical_factor: float | None = 1.25
    stiffness: float = 0.5
    margin: float = 0.5
    drawn: int = 60
    seed: int = 1
    tried: int = 12
    enlarged: float = 1.5

    def __post_init__(self) -> None:
        for name in ("probability_design", "probability_additional"):
            value = getattr(self, name)
            if value is not None:
                give = "a share of structures, such as 0.99"
                require_number(value, least=0.0, below=1.0, where=f"safety.{name}", give=give, share=True)
        if self.critical_factor is not None:
            give = "a factor of the load, such as 1.25, or None for any"
            where = "safety.critical_factor"
            require_number(self.critical_factor, least=1.0, below=100.0, where=where, give=give, share=True)
        for name, usual in (("drawn", 60), ("tried", 12)):
            give = f"a number of structures, such as {usual}"
            require_count(getattr(self, name), where=f"safety.{name}", give=give)
        give = "deviations of what a cable is off by, such as 0.5, or 0 for none"
        require_number(self.margin, least=0.0, where="safety.margin", give=give)
        give = "a share of the start's stiffness, such as 0.5"
        require_number(self.stiffness, above=0.0, most=1.0, where="safety.stiffness", give=give, share=True)
        give = "a factor of the errors, such as 1.5"
        require_number(self.enlarged, least=1.0, most=3.0, where="safety.enlarged", give=give)

    def required(self, load: str, design_load: str, initial: float | None) -> float:
        """The share of structures asked for under a load, the initial design's share under it being `initial`
        (None: not known)."""
        if load == design_load:
            return self.probability_design
        if self.probability_additional is not None:
            return self.probability_additional
        return self.probability_design if initial is None else min(initial, self.probability_design)


@dataclass(frozen=True)
class UnderLoad:
    """What was found under one load: its `standing`, the share that was `required`, and the numbers of the
    drawn structures that have `fallen`."""

    standing: Standing
    required: float
    fallen: tuple[int, ...]

    @property
    def holds(self) -> bool:
        """Whether as many stand as are required."""
        return len(self.fallen) <= allowed(self.required, self.standing.drawn)


@dataclass(frozen=True, eq=False)
class Judgement:
    """What was found of a design: by load case, and the `critical` end of the perfect structure's path under
    the design load on the halved mesh, followed up to `sought` (None: no factor is asked for); `failed` says
    what isn't held, a sentence each."""

    loads: Mapping[str, UnderLoad]
    critical: Limit | None
    failed: tuple[str, ...]

    @property
    def holds(self) -> bool:
        """Whether all holds that is asked for."""
        return not self.failed


def allowed(probability: float, drawn: int) -> int:
    """How many of the drawn structures may fall."""
    return int(np.floor((1.0 - probability) * drawn + 1e-6))


def judge(
    shell: Gridshell,
    design: Design,
    loads: Mapping[str, Reals],
    safety: Safety,
    *,
    initial: Judgement | None = None,
    design_load: str = "design",
) -> Judgement:
    """The design judged under the dead `loads` (n, 6), those that are zero left out; `initial` is the initial
    design's judgement. Raises InputError where there is no design load, NotConverged where the perfect
    structure has no unloaded equilibrium."""
    if design_load not in loads or not loads[design_load].any():
        raise InputError(
            "there is no design load to judge a design under",
            where="loads",
            value=design_load,
            remedy='Name a load case "design", or the one to judge by.',
        )
    found: dict[str, UnderLoad] = {}
    failed = []
    for largest, shares in paths(loads).items():
        workshop = Workshop(perfect(shell, design, loads[largest], step=TO_ITS_END))
        outcomes = workshop.load_numbers(
            safety.tolerances,
            seed=safety.seed,
            numbers=range(safety.drawn),
            marks=tuple(shares.values()),
        )
        for name, share in shares.items():
            fallen = tuple(
                each.number
                for each in outcomes
                if (not each.stands if share == 1.0 else each.factor < share * (1.0 - SAME))
            )
            standing = counted(
                safety.drawn, safety.drawn - len(fallen), seed=safety.seed, confidence=CONFIDENCE
            )
            before = None
            if initial is not None and name in initial.loads:
                before = initial.loads[name].standing.standing / initial.loads[name].standing.drawn
            found[name] = UnderLoad(standing, safety.required(name, design_load, before), fallen)
    for name in loads:
        if name in found and not found[name].holds:
            own = found[name]
            failed.append(
                f"under the load {name!r} {own.standing.standing} of {own.standing.drawn} drawn structures stand, and "
                f"{own.standing.drawn - allowed(own.required, own.standing.drawn)} are required"
            )
    critical = None
    if safety.critical_factor is not None:
        critical = critical_on_halved(shell, design, loads[design_load], safety.critical_factor)
        if critical.factor < safety.critical_factor * (1.0 - SAME):
            failed.append(
                f"the critical factor is {critical.factor:.3f} with rod elements halved, and "
                f"{safety.critical_factor:g} is required"
            )
    return Judgement({name: found[name] for name in loads if name in found}, critical, tuple(failed))


def critical_on_halved(shell: Gridshell, design: Design, load: Reals, sought: float) -> Limit:
    """The end of the perfect structure's path under the dead `load` (n, 6) on the mesh with rod elements
    halved, followed up to the factor `sought`; the factor 0 where the unloaded state isn't stable on that
    mesh. Raises NotConverged where there is none."""
    model = rods_halved(model_under(shell, design, load))
    return critical_of(model, sought=sought, resolution=RESOLUTION)


def paths(loads: Mapping[str, Reals]) -> dict[str, dict[str, float]]:
    """The loads that paths are followed for, and for each the load cases that lie on its path with their
    shares of it, itself included; loads of zero are left out."""
    size = {name: float(np.linalg.norm(load)) for name, load in loads.items()}
    found: dict[str, dict[str, float]] = {}
    for name in sorted((name for name in loads if size[name] > 0.0), key=lambda name: -size[name]):
        for largest, shares in found.items():
            share = float(np.vdot(loads[name], loads[largest])) / size[largest] ** 2
            off = np.linalg.norm(loads[name] - share * loads[largest])
            if share > 0.0 and off <= SAME * size[name]:  # what pulls upwards has a path of its own
                shares[name] = 1.0 if share >= 1.0 - SAME else share  # of the same load, but for rounding
                break
        else:
            found[name] = {name: 1.0}
    return found
