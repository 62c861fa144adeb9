"""The table of what a run's stages took, by kind of work."""

from __future__ import annotations

from dataclasses import dataclass

from shellform.records.profile import Profile, StageProfile, WorkRecord


@dataclass(frozen=True)
class ProfileTable:
    """`heads` of the columns behind the stages' names, and `rows`: each stage's name and cells, the sum
    last."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, tuple[str, ...]], ...]


def profile_table(profile: Profile) -> ProfileTable:
    """The table; without rows where nothing was measured."""
    stages = dict(profile.stages)
    if not stages:
        return ProfileTable((), ())
    kinds = list(dict.fromkeys(kind for each in stages.values() for kind in each.work))
    kinds.sort(key=lambda kind: -sum(_of(each, kind).processor for each in stages.values()))
    every = list(stages.values())
    peaks = [each.memory_peak for each in every if each.memory_peak is not None]
    total = StageProfile(
        "",
        sum(each.clock for each in every),
        sum(each.processor for each in every),
        sum(each.waiting for each in every),
        {kind: _sum([_of(each, kind) for each in every]) for kind in kinds},
        max(peaks, default=None),
    )
    rows = tuple((name, _cells(each, kinds)) for name, each in {**stages, "total": total}.items())
    return ProfileTable(
        ("clock,\u00a0s", "processor,\u00a0s", "waiting,\u00a0s", "memory,\u00a0MB", *kinds), rows
    )


def _cells(stage: StageProfile, kinds: list[str]) -> tuple[str, ...]:
    memory = "–" if stage.memory_peak is None else f"{stage.memory_peak / 1e6:.0f}"
    times = (stage.clock, stage.processor, stage.waiting)
    return (*(f"{each:.2f}" for each in times), memory, *(_told(stage, kind) for kind in kinds))


def _told(stage: StageProfile, kind: str) -> str:
    each = _of(stage, kind)
    if not each.calls:
        return "–"
    return f"{each.processor:.2f}" if kind == "other" else f"{each.processor:.2f}\u00a0({each.calls:,})"


def _of(stage: StageProfile, kind: str) -> WorkRecord:
    return stage.work.get(kind, WorkRecord(0, 0.0, 0.0))


def _sum(every: list[WorkRecord]) -> WorkRecord:
    return WorkRecord(
        sum(each.calls for each in every),
        sum(each.clock for each in every),
        sum(each.processor for each in every),
    )
