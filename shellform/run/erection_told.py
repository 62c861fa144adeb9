"""What `shellform erect` says of an erection, in sentences."""

from __future__ import annotations

import numpy as np

from shellform.quantities import newtons, number
from shellform.records.words import exceeds
from shellform.run.folder import Run
from shellform.site.erection_steps import Props
from shellform.structure.elements.state import State

_NOTHING = 1e-6  # m: so near a shell lies where its design does
EVERY = "every"  # crossing is propped, as it is asked for


def off_design(run: Run, design: str, load: str, state: State) -> list[str]:
    """How far a shell that was erected ends from where its design lies; nothing of a load that the run
    doesn't have."""
    known = run.states[design].get(load)
    if known is None:
        return []
    far = float(np.linalg.norm(state.positions - known.positions, axis=1).max())
    under = "before any load" if load == "none" else f"under the load “{load}”"
    if far < _NOTHING:
        return [f"in the end it lies where the design does {under}"]
    return [f"in the end it lies up to {number(1e3 * far, 2)} mm from where the design does {under}"]


def broken_told(stage: str, borne: Props | None, tighten_first: bool, every: bool) -> str:
    """That rods break, most of all in a `stage`, and what helps: another way up only on the way up, and more
    props only where not `every` crossing has one."""
    when, helps = (
        "on the way",
        "prop other crossings (--props)" if every else "prop every crossing (--props every)",
    )
    if stage == "loading":
        when, helps = "under the load", "give a smaller --load"
    elif stage.startswith("tightening"):
        when, helps = (
            "as cables are tightened",
            "leave --tighten-first out" if tighten_first else "brace otherwise",
        )
    elif borne is None:
        helps = "erect --by scaffold, give the supports other --way points"
    return f"rods break {when}: {helps}, or choose thinner or stronger rods"


def pulled_told(stage: str, pull: float, most: float, tighten_first: bool) -> list[str]:
    """That cables pull more than they may, N, most of all in a `stage`, and what helps; nothing where they
    don't."""
    if not exceeds(pull, most):
        return []
    when, helps = "on the way", ""
    if stage == "loading":
        when, helps = "under the load", "give a smaller --load, or "
    elif stage.startswith("tightening"):
        when = "as they are tightened"
    if tighten_first and stage != "loading":
        helps = "leave --tighten-first out, or "
    return [
        f"cables pull up to {newtons(pull)} {when}, more than the {newtons(most)} of cable.force_max: {helps}take stronger ones"
    ]


def scaffold_told(borne: Props) -> str:
    """What a scaffold bears."""
    held = (
        f"holds up to {borne.pulled} of them down, where the grid would lift off, with up to {newtons(borne.pull)}"
        if borne.pulled
        else "holds none of them down"
    )
    return (
        f"the scaffold pushes crossings up with up to {newtons(borne.push)} each and {held}; ropes draw rods' ends in "
        f"with up to {newtons(borne.rope)}"
    )
