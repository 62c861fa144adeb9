"""summary.json: what a run found, as records, and the one place where the file is read and written.

The keys are those of the fields below, in their order. Keys may be added, never renamed or dropped. Lengths
in m, forces in N, angles in rad, times in s.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from shellform.errors import ANEW, Damaged, InputError
from shellform.net.cover import BarePatch
from shellform.net.quality import NetNumbers
from shellform.records.built_shape import BuiltShapeRecord
from shellform.records.failures import FailureRecord, RareRecord
from shellform.records.files import names_format, plain, read_record, text_of
from shellform.records.optimisation import OptimisationRecord, SectionRecord
from shellform.records.raising import WayUpRecord
from shellform.records.scattering import RobustRecord
from shellform.records.stages import STAGES
from shellform.records.thicker_rods import ThickerRodsRecord
from shellform.written import write_text

FILE = "summary.json"
FORMAT, VERSION = "shellform-summary", 1


@dataclass(frozen=True)
class SurfaceRecord:
    """The surface: `source` file, `area`, m², extents `size` (3,), m, counts of `triangles` and `holes`, and
    what was `mended`, a sentence each."""

    source: str
    area: float
    size: tuple[float, float, float]
    triangles: int
    holes: int = 0
    mended: tuple[str, ...] = ()


@dataclass(frozen=True)
class EdgeRecord:
    """A stretch of the net's edge: its `kind` (ground, wall, abutment, pin, beam or free) and `name`, whether
    it goes round an `opening`, its `length`, m, and `height`: lowest and highest level, m."""

    kind: str
    name: str
    opening: bool
    length: float
    height: tuple[float, float]


@dataclass(frozen=True)
class NetRecord(NetNumbers):
    """The net: how many `crossings`, `rods` and `supports`, at a `spacing` and one along rods v, `spacing_v`,
    m; which share of what it is to cover lies beyond the rods (`uncovered_share`; None: not known of older
    runs), in which patches (`uncovered`); what was left out of it (`notes`, a sentence each);
    `rod_radius_max`, m, the farthest that a rod's outermost fibre may lie from its axis; `curvature_limit`,
    1/m, that the rods bear as the net bends them, and `curvature_utilisation`, how much of it the net uses;
    its `angle`, rad, and `offset`, in spacings, on the surface; and its `edges`."""

    spacing: float
    crossings: int
    rods: int
    supports: int
    spacing_v: float
    uncovered_share: float | None = None
    uncovered: tuple[BarePatch, ...] = ()
    notes: tuple[str, ...] = ()
    rod_radius_max: float | None = None
    curvature_limit: float | None = None
    curvature_utilisation: float | None = None
    angle: float | None = None
    offset: tuple[float, float] | None = None
    edges: tuple[EdgeRecord, ...] = ()


@dataclass(frozen=True)
class ModelRecord:
    """How large the structural model is: `nodes`, `beams`, candidate `cables`; `freedoms`, its degrees of
    freedom."""

    nodes: int
    beams: int
    cables: int
    freedoms: int


@dataclass(frozen=True)
class StandingRecord:
    """Of `drawn` imperfect structures `standing` bear the load; so at least the share `at_least` of all do,
    with `confidence`. Drawn from `seed`; `lowest`, the load factor that the weakest of them bears (1 where
    all stand). Of those that stand, so many have `snapped` at a rod's end or a cell before, by `snap`, m, at
    the most."""

    drawn: int
    standing: int
    at_least: float
    confidence: float
    seed: int
    lowest: float | None = None
    snapped: int = 0
    snap: float = 0.0


@dataclass(frozen=True)
class LoadRecord:
    """A design under one load case, which weighs `factor` times as much as the design load and is that load
    so many times where it is a `multiple` of it (taken for granted of older runs, which don't say).

    `deviation_max`, `deviation_mean`, `deviation_rms`, m: distances between a node and its place on the
    target, over all nodes. `stable`: in a stable equilibrium; `on_branch`: reached without snapping through;
    `residual`: unbalanced over largest force. Of the rods, stresses over the flexural strength:
    `rod_utilisation_max` by bending alone, `stress_utilisation_max` with axial force, `edge_utilisation_max`
    in edge beams (0 without); `connector_turn_max`, rad. Of a support at most `uplift_max`, N, to hold it
    down with, and `thrust_max`, N, sideways. `cable_force_max`, `cable_force_min`, N, and how many
    `cables_slack`. `critical_factor`: of this load, at which stability ends, by a point of `critical_kind`
    ("none": it doesn't up to `critical_sought`, the most that was tried), `critical_factor_halved` the same
    with rod elements halved, where a local snap by `critical_snap_halved`, m, ends that path alone and the
    structure bears on (None: no such one), and `critical_factor_error` what the coarser mesh is off by, as
    are `deviation_max_error`, `deviation_mean_error`, m, and `rod_utilisation_error`. `slack`: cables without
    tension, by name; `stands` and, under the design load, `built_shape`: as built; `adjusted_shape`: the same
    structures of the design to build adjusted on site (reliability/adjusting.py); `expected_stiffness`, N/m:
    the least of the softest mode on the path to this load, cables counted for what they are worth under their
    errors."""

    factor: float
    deviation_max: float
    deviation_mean: float
    deviation_rms: float
    stable: bool
    rod_utilisation_max: float
    on_branch: bool = True
    residual: float | None = None
    stress_utilisation_max: float | None = None
    connector_turn_max: float | None = None
    uplift_max: float | None = None
    thrust_max: float | None = None
    edge_utilisation_max: float | None = None
    cable_force_max: float | None = None
    cable_force_min: float | None = None
    cables_slack: int | None = None
    critical_sought: float | None = None
    critical_factor: float | None = field(default=None, metadata={"beside": "critical_sought"})
    critical_factor_error: float | None = None
    critical_factor_halved: float | None = None
    critical_snap_halved: float | None = None
    critical_kind: str | None = field(default=None, metadata={"beside": "critical_sought"})
    deviation_max_error: float | None = None
    deviation_mean_error: float | None = None
    rod_utilisation_error: float | None = None
    slack: tuple[str, ...] | None = None
    stands: StandingRecord | None = None
    built_shape: BuiltShapeRecord | None = None
    adjusted_shape: BuiltShapeRecord | None = None
    expected_stiffness: float | None = None
    multiple: bool = True

    @property
    def times(self) -> float | None:
        """How many times the design load this one is; None where it is no multiple of it."""
        return self.factor if self.multiple else None

    @property
    def stressed(self) -> float:
        """The rods' stress over their strength, with axial force where that is known."""
        return max(self.rod_utilisation_max, self.stress_utilisation_max or 0.0)

    @property
    def collapsed(self) -> bool:
        """Whether the shell doesn't stand: its numbers are of another shape than the one that was meant."""
        return not (self.stable and self.on_branch)

    def unexamined(self) -> LoadRecord:
        """Without what the stage "safety" finds."""
        return replace(
            self,
            critical_sought=None,
            critical_factor=None,
            critical_factor_error=None,
            critical_factor_halved=None,
            critical_snap_halved=None,
            critical_kind=None,
            deviation_max_error=None,
            deviation_mean_error=None,
            rod_utilisation_error=None,
            stands=None,
            built_shape=None,
            adjusted_shape=None,
            expected_stiffness=None,
        )


@dataclass(frozen=True)
class DesignRecord:
    """A design: how many `cables`, its `rod_radius`, m, their tensions under the design load
    (`cable_force_sum`, `cable_force_max`, N), and its `loads` by name. Of a rounded one the `section`,
    whether it is `feasible`, `why_not`, and its `objective`; where a critical factor was asked for, whether
    it is kept, with rod elements halved too (`critical_factor_kept`); of one to build the `ways_up`, as they
    were tried."""

    cables: int
    rod_radius: float
    cable_force_sum: float
    cable_force_max: float
    loads: Mapping[str, LoadRecord]
    section: str | None = None
    feasible: bool | None = None
    why_not: str | None = None
    objective: float | None = None
    critical_factor_kept: bool | None = None
    ways_up: tuple[WayUpRecord, ...] | None = None


@dataclass(frozen=True)
class DocumentsRecord:
    """What was drawn for the workshop: the `design`; how many `bars` of `stock_length`, m, and the fewest
    possible, `bars_least`; the share that is `waste`; rods that are `spliced`; `notes`, a sentence each; of
    how many `rest_lengths` the cables are, and to how many `cut_lengths` they are cut."""

    design: str
    stock_length: float
    bars: int
    bars_least: int
    waste: float
    spliced: tuple[int, ...]
    notes: tuple[str, ...]
    rest_lengths: int | None = None
    cut_lengths: int | None = None


@dataclass(frozen=True)
class VerdictRecord:
    """Whether the `design` to build `holds`: what `failed`, a sentence with reason and remedy each, and the
    checks that were asked for and `not_examined`. It holds where neither is (verdict.py); `cautions`, a
    sentence each, ask for care all the same, and `provided` says in a few words how it is to be built, or
    what it bears as built, where rods or cables don't bear it as it is set out."""

    design: str
    holds: bool
    failed: tuple[str, ...]
    not_examined: tuple[str, ...]
    cautions: tuple[str, ...] = ()
    provided: tuple[str, ...] = ()


@dataclass(frozen=True)
class Summary:
    """What a run found so far; a part is left out until its stage is done.

    The file's `format` and its `version`, and which `shellform` wrote it; `seconds` by stage. The `surface`,
    the `net`, the structural `model`; `designs` by name; the `optimisation`; `sections` that were tried in
    rounding; what scatter does (`robust`), how the design fails (`failure`) and how rarely (`rare`);
    `thicker` rods that would do; what was drawn (`documents`); the `verdict`; why stages `failed`, by name;
    and whether it is a `sketch`."""

    format: str = FORMAT
    version: int = VERSION
    shellform: str | None = None
    seconds: Mapping[str, float] = field(default_factory=dict)
    surface: SurfaceRecord | None = None
    net: NetRecord | None = None
    model: ModelRecord | None = None
    designs: Mapping[str, DesignRecord] = field(default_factory=dict, metadata={"if_any": True})
    optimisation: OptimisationRecord | None = None
    sections: tuple[SectionRecord, ...] | None = None
    robust: RobustRecord | None = None
    failure: FailureRecord | None = None
    rare: tuple[RareRecord, ...] | None = None
    thicker: ThickerRodsRecord | None = None
    documents: DocumentsRecord | None = None
    verdict: VerdictRecord | None = None
    failed: Mapping[str, str] = field(default_factory=dict, metadata={"if_any": True})
    sketch: bool = field(default=False, metadata={"if_any": True})

    def with_design(self, name: str, design: DesignRecord) -> Summary:
        """With this design added, or in place of the one with its name."""
        return replace(self, designs={**self.designs, name: design})

    def without_designs(self, names: Sequence[str]) -> Summary:
        """Without these designs, and without what is told of designs made from the optimised one."""
        kept = {name: design for name, design in self.designs.items() if name not in names}
        return replace(
            self,
            designs=kept,
            sections=None,
            robust=None,
            failure=None,
            rare=None,
            thicker=None,
            verdict=None,
        )

    def unexamined(self) -> Summary:
        """Without what the stage "safety" finds."""
        designs = {
            name: replace(
                design,
                loads={load: row.unexamined() for load, row in design.loads.items()},
                critical_factor_kept=None,
                ways_up=None,
            )
            for name, design in self.designs.items()
        }
        return replace(self, designs=designs, failure=None, rare=None, thicker=None)

    def with_seconds(self, stage: str, spent: float) -> Summary:
        """With the time of a stage, s."""
        return replace(self, seconds={**self.seconds, stage: round(spent, 3)})

    def totalled(self) -> Summary:
        """With the sum of all stages' times."""
        total = sum(spent for stage, spent in self.seconds.items() if stage != "total")
        return replace(self, seconds={**self.seconds, "total": round(total, 3)})


@dataclass(frozen=True)
class _Head:
    """What every version of the file has."""

    format: str
    version: int
    shellform: str | None = None


def summary_version(folder: Path) -> str:
    """The version of shellform that wrote a folder's summary; "" where there is no summary.

    Raises InputError for a file of a newer format, for a damaged one, and for one that can't be read.
    """
    path = folder / FILE
    if not names_format(path, FORMAT):
        return ""
    head = read_record(path, _Head)
    if head.format != FORMAT:
        return ""
    _refuse_newer(path, head)
    return head.shellform or "0"


def read_summary(folder: Path) -> Summary:
    """The summary in a run folder; an empty one where there is none.

    Raises InputError for a file of a newer format, and for a damaged one: a key missing or of another type.
    """
    path = folder / FILE
    if not path.is_file():
        return Summary()
    head = read_record(path, _Head)
    if head.format != FORMAT:
        raise Damaged("is no summary of shellform's", where=str(path), value=head.format, remedy=ANEW)
    _refuse_newer(path, head)
    return read_record(path, Summary)


def write_summary(folder: Path, summary: Summary) -> None:
    """Writes summary.json whole or not at all. Raises InputError where it can't be written."""
    write_text(folder / FILE, text_of(summary))


def document(summary: Summary) -> dict[str, Any]:
    """The summary as its file says it."""
    found: dict[str, Any] = plain(summary)
    return found


def _refuse_newer(path: Path, head: _Head) -> None:
    if head.version > VERSION:
        raise InputError(
            "was written by a newer shellform",
            where=str(path),
            value=head.version,
            remedy="Install that version.",
        )


def outdated(summary: Summary, stage: str) -> Summary:
    """Without what a stage and those after it will find anew, and the times that they took."""
    spent = {name: each for name, each in summary.seconds.items() if name in STAGES[: STAGES.index(stage)]}
    summary = replace(summary, seconds=spent).totalled()
    if STAGES.index(stage) <= STAGES.index("initial"):
        summary = replace(summary, model=None, designs={}, verdict=None)
    if STAGES.index(stage) <= STAGES.index("optimise"):
        summary = replace(
            summary.without_designs(("unloaded", "optimised", "rounded", "polished")), optimisation=None
        )
    if STAGES.index(stage) <= STAGES.index("safety"):
        summary = replace(summary.unexamined(), verdict=None)
    if STAGES.index(stage) <= STAGES.index("documents"):
        summary = replace(summary, documents=None)
    return summary
