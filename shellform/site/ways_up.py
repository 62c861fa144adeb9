"""How a design can be raised: one way up after the other, until one is found on which its rods keep their
strength.

The first is the usual one (erection.py): supports that move in, or a scaffold under every second crossing
where there are edge beams or rods in two layers. Then come scaffolds, under every crossing and under every
second one: either may bend rods less than the other.
"""

from __future__ import annotations

from dataclasses import dataclass

from shellform.errors import NotConverged
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.site.erection import SCAFFOLD, erect, usual_way_up
from shellform.site.erection_steps import Erection


@dataclass(frozen=True, eq=False)
class WayUp:
    """One way up, `by` supports that move in or a scaffold, under `every` crossing or under every second one:
    the `erection`, or the reason why none was `lost`: found."""

    by: str
    every: bool
    erection: Erection | None
    lost: str = ""

    @property
    def bears(self) -> bool:
        """Whether the rods keep their strength on it."""
        return self.erection is not None and self.erection.utilisation <= 1.0


def ways_up(shell: Gridshell, design: Design) -> list[WayUp]:
    """The ways up that were tried, of which the last one bears, if any does."""
    found = list[WayUp]()
    usual = usual_way_up(shell)
    for by, every in dict.fromkeys([(usual, False), (SCAFFOLD, True), (SCAFFOLD, False)]):
        props = shell.net.grid.crossing_nodes[:, 0] if every else None
        try:
            found.append(WayUp(by, every, erect(shell, design, by=by, props=props)))
        except NotConverged as error:
            found.append(WayUp(by, every, None, error.what))
        if found[-1].bears:
            break
    return found
