"""Which way the net should lie: the angle and the offset with the least bending and shear.

The cost of a net is the mean over its rods of (curvature × spacing)² / 2 and over its crossings of 0.1 × (90°
- angle)² / 2, the elastic energy of a segment in EI/s as the pull has it. First the compass nets of angles
all round are compared, which cost little; the best of them, apart from each other, are then pulled, and the
best of those with other offsets, in processes of their own if asked for. Two elements a segment tell nets
apart.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace
from multiprocessing import get_context
from typing import Any, Literal

import numpy as np

from shellform.compiled import set_num_threads
from shellform.errors import InputError
from shellform.net.chebyshev import Method, NetSettings, NetTuning, net_at, require_settings
from shellform.net.ladder import climbed_net
from shellform.net.net import Net
from shellform.net.pull import SHEAR_STIFFNESS
from shellform.net.refusal import Beside, NoNet, Stalled
from shellform.processes import end_with
from shellform.surface.shape.target import Surface

_ANGLES = 12  # compass nets, over a quarter turn: u and v are alike
_BEST = 4  # angles that are pulled
_ELEMENTS = 2  # of a segment
_TAILS = (0, 2)  # segments; longer rods where at no angle a compass net covers the surface
_OFFSETS = ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5), (0.5, 0.5))


Job = tuple[float, tuple[float, float], Method, int]
"""Angle, rad, offset in spacings, how the net is made, and the segments by which its rods are longer."""


@dataclass(frozen=True)
class TriedNet:
    """One net of the search: `angle`, rad, `offset` in spacings, its `cost`, infinite where there is none,
    and why, with the `remedy` where that is so at every angle.
    """

    angle: float
    offset: tuple[float, float]
    cost: float
    reason: str = ""
    remedy: str = "Choose a smaller spacing."


def cost(net: Net) -> float:
    """The mean elastic energy of a segment and its joint in EI/s."""
    bent = 0.5 * float((net.curvature**2).mean()) * net.grid.scale**2
    sheared = 0.5 * SHEAR_STIFFNESS * float(((0.5 * math.pi - net.quality.shear_angle) ** 2).mean())
    return bent + sheared


def oriented_net(
    surface: Surface,
    settings: NetSettings,
    *,
    angle: float | Literal["auto"],
    offset: tuple[float, float] = (0.0, 0.0),
    workers: int = 2,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[Net, float, tuple[float, float]]:
    """The net with the `settings` at the `angle`, rad, and `offset`, or at the angle that `best_orientation`
    finds, with its offset where none is given, or the first on the ladder from there; and which these are."""
    if angle == "auto":
        fixed = offset if any(offset) else None
        best, _ = best_orientation(surface, settings, offset=fixed, workers=workers, progress=progress)
        angle, offset = best.angle, best.offset

    def watch(what: str, residual: float) -> None:
        progress(f"{what}, residual {residual:.1e}")

    net, given = climbed_net(surface, settings, angle=angle, offset=offset, progress=progress, watch=watch)
    return net, given.angle, given.offset


def best_orientation(
    surface: Surface,
    settings: NetSettings,
    *,
    offset: tuple[float, float] | None = None,
    workers: int = 1,
    progress: Callable[[str], None] = lambda text: None,
) -> tuple[TriedNet, list[TriedNet]]:
    """The best trial, at the `offset` (None: the best of four), and all of those pulled, the best compass
    net's where no pull succeeds.

    Raises InputError for settings that no angle helps, as it is, and where no orientation gives a net.
    """
    require_settings(surface, settings)
    quarter = 0.5 * math.pi
    if settings.spacing_v not in (None, settings.spacing):
        quarter = math.pi  # u and v differ
    angles = [quarter * k / _ANGLES for k in range(_ANGLES)]
    at = offset or _OFFSETS[0]
    tried: list[TriedNet] = []
    with _runner(surface, settings, workers) as run:

        def stage(name: str, jobs: list[Job]) -> list[TriedNet]:
            found = []
            for k, trial in enumerate(run(jobs), start=1):
                found.append(trial)
                said = f"cost {trial.cost:.4g}" if math.isfinite(trial.cost) else "no net"
                progress(
                    f"{name} {k}/{len(jobs)}: angle {math.degrees(trial.angle):.1f}°, offset {trial.offset}: "
                    f"{said}"
                )
            return found

        for tail in _TAILS:
            compass = stage("compass net", [(angle, at, "compass", tail) for angle in angles])
            usable = sorted(
                (trial for trial in compass if math.isfinite(trial.cost)), key=lambda trial: trial.cost
            )
            if usable:
                break
        if not usable:
            raise InputError(
                f"no angle gives a net: {compass[0].reason}",
                where="net.angle",
                value="auto",
                remedy=compass[0].remedy,
            )
        pulled = stage("pulled net", [(trial.angle, at, "pull", tail) for trial in usable[:_BEST]])
        best = min(pulled, key=lambda trial: trial.cost)
        tried += pulled
        # Between the best angle and its neighbours, and with other offsets
        half = 0.5 * quarter / _ANGLES
        turned = stage("pulled net", [(best.angle + side * half, at, "pull", tail) for side in (-1.0, 1.0)])
        best = min([best, *turned], key=lambda trial: trial.cost)
        others = _OFFSETS[1:] if offset is None else ()
        shifted = stage("pulled net", [(best.angle, other, "pull", tail) for other in others])
        tried += turned + shifted
        best = min([best, *shifted], key=lambda trial: trial.cost)
    if not math.isfinite(best.cost):
        return usable[0], tried  # for the ladder to begin at
    return best, tried


@contextmanager
def _runner(
    surface: Surface, settings: NetSettings, workers: int
) -> Iterator[Callable[[list[Job]], Iterator[TriedNet]]]:
    """Runs trials one by one, or in processes that each know the surface; gives them back in their order."""
    if workers == 1:
        yield lambda jobs: (_try(surface, settings, job) for job in jobs)
        return
    # Not forked: numba's threads don't survive that.
    pool = ProcessPoolExecutor(
        workers,
        mp_context=get_context("spawn"),
        initializer=_begin,
        initargs=(os.getpid(), surface, settings),
    )
    try:
        yield lambda jobs: pool.map(_run, jobs)
    finally:
        pool.shutdown(cancel_futures=True)


_work: dict[str, Any] = {}


def _begin(parent: int, surface: Surface, settings: NetSettings) -> None:
    end_with(parent)
    set_num_threads(1)
    _work.update(surface=surface, settings=settings)


def _run(job: Job) -> TriedNet:
    return _try(_work["surface"], _work["settings"], job)


def _try(surface: Surface, settings: NetSettings, job: Job) -> TriedNet:
    angle, offset, method, tail = job
    elements = min(settings.elements, _ELEMENTS)
    changed = replace(settings, method=method, elements=elements, tuning=NetTuning(tail=tail))
    try:
        net = net_at(surface, changed, angle=angle, offset=offset)
    except (NoNet, Stalled) as error:
        return TriedNet(angle, offset, math.inf, error.what)
    except Beside as error:  # at this angle, perhaps, and not at others
        return TriedNet(angle, offset, math.inf, error.what, error.remedy)
    return TriedNet(angle, offset, float(np.round(cost(net), 12)))
