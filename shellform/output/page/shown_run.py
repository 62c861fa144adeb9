"""What the page of a run is made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from shellform.arrays import Reals, Record
from shellform.gridshell.gridshell import Design, Gridshell
from shellform.optimiser.optimum import Step
from shellform.output.page.embed import Picture
from shellform.records.check import Check
from shellform.records.profile import Profile
from shellform.records.summary import Summary, VerdictRecord
from shellform.structure.elements.state import State
from shellform.surface.shape.target import Surface


@dataclass(frozen=True, eq=False)
class ShownRun(Record):
    """One run on the page.

    What was found:
    - `surface`; `loads` (n, 6), N, by name; `designs` by name, each with its `shells` (rods may differ) and
      its `states` by load case, of which `best` is to be built.
    - `summary` of the run, and `checks` and `verdict` made from it; `history` of the optimiser.
    - `next_size`: of the catalogue, that the rods to build would be rounded to ("": no catalogue, or none is
      stiff enough).
    - `profile`, empty where none was made.

    What is shown of it:
    - `title`, and `place`: the folder's name; `notes`: what is missing or to be known.
    - `settings`: the case file's text; `pictures`.
    - `limit`, m: the end of the colour scale.
    - `files` of the run folder, which is reached from the page by the relative address `home` ("": it stands
      in it).
    """

    title: str
    place: str
    shells: Mapping[str, Gridshell]
    surface: Surface
    loads: Mapping[str, Reals]
    designs: Mapping[str, Design]
    states: Mapping[str, Mapping[str, State]]
    best: str
    summary: Summary
    checks: Sequence[Check]
    verdict: VerdictRecord
    history: Sequence[Step]
    settings: str
    pictures: Sequence[Picture]
    limit: float
    notes: Sequence[str]
    files: Sequence[str]
    home: str = ""
    next_size: str = ""
    profile: Profile = field(default_factory=Profile)

    @property
    def shell(self) -> Gridshell:
        """The shell of the design to build."""
        return self.shells[self.best]
