"""How a design is raised (site/ways_up.py), as its summary tells it."""

from __future__ import annotations

from shellform.gridshell.gridshell import Design, Gridshell
from shellform.records.raising import WayUpRecord
from shellform.site.ways_up import WayUp, ways_up


def raised(shell: Gridshell, design: Design) -> tuple[WayUpRecord, ...]:
    """The ways up of a design, as they were tried."""
    return tuple(_recorded(way) for way in ways_up(shell, design))


def _recorded(way: WayUp) -> WayUpRecord:
    if way.erection is None:
        return WayUpRecord(way.by, way.every, lost=way.lost)
    borne, worst = way.erection.props, way.erection.worst
    return WayUpRecord(
        way.by,
        way.every,
        utilisation=way.erection.utilisation,
        stage=worst.stage,
        reaction=max(step.reaction for step in way.erection.steps),
        push=None if borne is None else borne.push,
        pull=None if borne is None else borne.pull,
        held_down=None if borne is None else borne.pulled,
    )
