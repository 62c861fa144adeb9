"""What a run tells the site: calibration of connectors from scans, re-tensioning from surveys, and erection
(`shellform calibrate`, `survey`, `erect`).

Each reads CSV files (site/measurements.py, site/scans.py), calls its module of shellform/site, and leaves its
tables in the run's folder `schedules`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import tomli_w

from shellform.arrays import Indices, Reals, read_arrays
from shellform.errors import (
    Damaged,
    InputError,
    how_many,
    require_count,
    require_file,
    require_known,
)
from shellform.gridshell.gridshell import Gridshell
from shellform.quantities import PLACE_DEVIATION, TURN, newtons
from shellform.run.erection_told import EVERY, broken_told, off_design, pulled_told, scaffold_told
from shellform.run.folder import Run, read_run
from shellform.run.site_sources import design_named, load_named, named_files, scan_under, scanned
from shellform.site import calibration, erection, measurements, retensioning
from shellform.site.scans import counted_alike
from shellform.site.surveys import doubtful, read_survey
from shellform.structure.elements.state import State
from shellform.tables import Table, table_text
from shellform.written import make_folder, refuse_overwriting, write_arrays, write_text

# times the noise: of the hundreds of coordinates of a scan their deviation is told to a few percent
_ABOVE = 1.5


@dataclass(frozen=True)
class SiteResult:
    """Lines to print and the files that were written."""

    lines: Sequence[str]
    files: Sequence[Path]


def calibrate(
    source: Path,
    scans: Sequence[str],
    *,
    design: str | None = None,
    markers: Path | None = None,
    unit: str = "m",
    noise: float = calibration.NOISE,
    free: Sequence[str] = (),
    placed: bool = False,
    offsets: bool = False,
    output: Path | None = None,
    allow_scripts: bool = False,
) -> SiteResult:
    """Connector stiffness from scans "POINTS.csv=LOAD" of the grid built as a run's `design`, or before it
    is braced, with the best design's rods or a case's; LOAD is a load case or a CSV file of forces. Writes
    calibration.csv and calibration.toml. Raises InputError, NotConverged."""
    measurements.check_noise(noise)
    grid = scanned(source, design, output, allow_scripts=allow_scripts)
    shell = grid.shell
    files = [grid.folder / "calibration.csv", grid.folder / "calibration.toml"]
    refuse_overwriting(files, [source, markers, *named_files(scans)])
    pairs = [scan_under(each, grid, unit, None if placed else 0) for each in scans]
    pairs, counted = counted_alike(pairs, shell.target.positions, grid.origin)
    nodes = _marked(markers, shell)
    found = calibration.calibrate(
        shell, grid.design, pairs, nodes, free=free or calibration.PARAMETERS, noise=noise, offsets=offsets
    )
    joint = {name: getattr(found.joint, name) for name in (*calibration.PARAMETERS, "gap")}
    write_text(files[0], found.table())
    write_text(files[1], tomli_w.dumps({"joint": joint}))
    seen = 1e3 * found.after[np.isfinite(found.after)]
    line = f"distances to the model: {seen.mean():.3f} mm on average, {seen.max():.3f} mm at most"
    lines = [*counted, *found.sentences(), line]
    if found.residual > _ABOVE * noise:
        lines.append(
            f"doubtful: that is {1e3 * found.residual:.2f} mm a coordinate, {found.residual / noise:.1f} times --noise: check that "
            "each scan has the load that it was taken under, and --design the grid that was built"
        )
    return SiteResult(lines, files)


@dataclass(frozen=True)
class Survey:
    """How a survey is read and what the crew can do: see `shellform survey --help`."""

    design: str | None = None
    load: str = "none"
    unit: str = "m"
    noise: float = calibration.NOISE
    length_error: float = 1e-3
    step: float = 0.25e-3
    largest: float = 1.5e-3
    cables: int = 60
    after: Path | None = None

    def __post_init__(self) -> None:
        measurements.check_noise(self.noise)
        PLACE_DEVIATION.require(self.length_error, where="--length-error")
        TURN.require(self.step, where="--step")
        TURN.require(self.largest, where="--largest")

    @property
    def crew(self) -> retensioning.Crew:
        """What the crew can do in a round."""
        return retensioning.Crew(self.step, self.largest, self.cables)


def survey(folder: Path, measured: Path, options: Survey, output: Path | None = None) -> SiteResult:
    """The next turns of the turnbuckles from a survey of a run's grid as built. Writes turns.csv,
    predicted.csv and belief-1.npz, or the number of the round, which `options.after` of the next one names:
    told again, a round gives the same turns. Raises InputError, NotConverged."""
    run = read_run(folder)
    name, shell, belief = _believed(run, options)
    round_ = 1 if options.after is None else 1 + int(read_arrays(options.after).get("round", np.array(1)))
    where = make_folder(output or run.folder / "schedules")
    files = [where / each for each in ("turns.csv", "predicted.csv", f"belief-{round_}.npz")]
    refuse_overwriting(files, (measured, options.after))  # told again, the round would be another
    goal = run.states[name][options.load].positions
    origin = run.case.surface.origin
    seen = read_survey(measured, shell, belief.state, unit=options.unit, origin=origin)
    learnt = retensioning.learn(shell, belief, seen.nodes, seen.places, noise=options.noise)
    step = retensioning.adjust(shell, learnt, goal, options.crew, noise=options.noise)
    write_text(files[0], step.schedule(shell))
    write_text(files[1], _predicted(shell, learnt.state, step, goal))
    now = step.belief
    write_arrays(
        files[2],
        rest_length=now.design.rest_length,
        present=now.design.present,
        radius=np.array(now.design.radius),
        covariance=now.covariance,
        positions=now.state.positions,
        quaternions=now.state.quaternions,
        origin=np.array(f"{name}/{options.load}"),
        round=np.array(round_),
    )
    size = len(goal)
    lines = [
        *seen.counted,
        *seen.doubts,
        *doubtful(seen, belief, learnt, noise=options.noise),
        f"{how_many(len(seen.nodes), 'node was', 'nodes were')} seen; the grid lies {_mm(step.misfit_before, size)} mm from where it "
        f"should be (root mean square)",
        f"{how_many(step.cables, 'cable', 'cables')} to turn, {how_many(step.turns_in_all, 'turn', 'turns')} "
        f"of {1e3 * options.step:g} mm; "
        f"afterwards {_mm(step.misfit_after, size)} mm are predicted"
        if step.cables
        else "no turn is worth taking: what is left is below what the survey can see or the crew can do",
    ]
    if step.halved:
        lines.append(
            f"the turns were halved {how_many(step.halved, 'time', 'times')}, to stay on the stable branch"
        )
    return SiteResult(lines, files)


def replay(
    folder: Path,
    options: Survey,
    *,
    rounds: int,
    seed: int,
    slip: float,
    markers: Path | None = None,
    output: Path | None = None,
) -> SiteResult:
    """The loop of survey and turning played with random length errors, `options.noise` and the crew's `slip`.
    Writes replay.csv. Raises InputError, NotConverged.
    """
    require_count(rounds, where="--replay", give="a number of rounds, such as 3")
    retensioning.check_slip(slip)
    run = read_run(folder)
    file = make_folder(output or run.folder / "schedules") / "replay.csv"
    refuse_overwriting([file], [options.after, markers])
    name, shell, belief = _believed(run, options)
    nodes = _marked(markers, shell)
    errors = options.length_error * np.random.default_rng(seed).normal(size=len(shell.cable_ends))
    goal = run.states[name][options.load].positions
    played = retensioning.replay(
        shell,
        belief,
        errors,
        goal,
        nodes,
        options.crew,
        noise=options.noise,
        rounds=rounds,
        seed=seed + 1,
        slip=slip,
    )
    turned = [(0, 0), *((each.cables, each.turns_in_all) for each in played.adjustments)]
    text = table_text(
        Table(
            "replay",
            ("round", "rms distance from the design [mm]", "cables turned", "turns"),
            tuple(
                (round_, _mm(misfit, len(goal)), cables, turns)
                for round_, (misfit, (cables, turns)) in enumerate(zip(played.misfits, turned, strict=True))
            ),
        )
    )
    write_text(file, text)
    gone = f"{100.0 * played.removed:.0f} % of the misfit, of the distances' squares, is gone after {how_many(len(played.adjustments), 'round', 'rounds')}"
    return SiteResult([*text.splitlines(), gone], [file])


def erect(
    folder: Path,
    *,
    design: str | None = None,
    by: str | None = None,
    props: str | None = None,
    tighten_first: bool = False,
    load: str | None = None,
    weight: str | None = None,
    lift: str | None = None,
    groups: Path | None = None,
    way: Path | None = None,
    step: float = erection.STEP,
    output: Path | None = None,
) -> SiteResult:
    """From the flat grid to the erected, tightened and loaded shell. `props`: EVERY crossing, or a file that
    names them. Writes erection.csv, a line a step, and erection.npz with the shapes. Raises InputError,
    NotConverged.
    """
    run = read_run(folder)
    name = design_named(run, design)
    shell = run.shell_of(name)
    where = make_folder(output or run.folder / "schedules")
    files = [where / "erection.csv", where / "erection.npz"]
    refuse_overwriting(files, [Path(each) for each in (props, load, weight, lift, groups, way) if each])
    carried = [None if each is None else load_named(each, shell, run.loads) for each in (load, weight, lift)]
    origin = run.case.surface.origin
    stops, counted = ([], ()) if way is None else measurements.read_way(way, shell, origin)
    done = erection.erect(
        shell,
        run.designs[name],
        by=by,
        props=_propped(props, shell),
        tighten_first=tighten_first,
        way=stops,
        groups=None if groups is None else measurements.read_groups(groups, run.designs[name]),
        load=carried[0],
        weight=carried[1],
        lift=carried[2],
        step=step,
    )
    write_text(files[0], done.table())
    write_arrays(
        files[1],
        positions=np.stack([each.state.positions for each in done.steps]),
        stage=np.array([each.stage for each in done.steps]),
    )
    worst, last = done.worst, done.steps[-1]
    tight = max(done.steps, key=lambda each: each.tension)
    borne = done.props
    return SiteResult(
        [
            *counted,
            f"{len(done.steps)} steps: {', '.join(dict.fromkeys(each.stage for each in done.steps))}",
            f"largest rod stress {1e-6 * worst.stress:.0f} MPa, {worst.stress / done.strength:.3f} of the "
            f"strength, at {worst.share:.2f} of {worst.stage}; "
            f"{1e-6 * last.stress:.0f} MPa in the end",
            f"largest cable tension {newtons(tight.tension)}, largest force on a "
            f"support {newtons(max(each.reaction for each in done.steps))}",
            *([] if borne is None else [scaffold_told(borne)]),
            *([] if weight else off_design(run, name, load or "none", last.state)),
            *(
                [broken_told(worst.stage, borne, tighten_first, props == EVERY)]
                if worst.stress > done.strength
                else []
            ),
            *pulled_told(tight.stage, tight.tension, run.case.cable.force_max, tighten_first),
        ],
        files,
    )


def _propped(props: str | None, shell: Gridshell) -> Indices | None:
    """The nodes that a scaffold props (None: the usual ones)."""
    if props == EVERY:
        return shell.net.grid.crossing_nodes[:, 0]
    return None if props is None else measurements.read_nodes(Path(props), shell)


def _believed(run: Run, options: Survey) -> tuple[str, Gridshell, retensioning.Belief]:
    """The design's name, its shell, and what is believed of it: as drawn, or after the round before."""
    name = design_named(run, options.design)
    require_known(options.load, run.loads, where="--load", what="there is no such load case")
    shell, load = run.shell_of(name), run.loads[options.load]
    design, state = run.designs[name], run.states[name][options.load]
    if options.after is None:
        believed = retensioning.first_belief(design, state, load, length_error=options.length_error)
        return name, shell, believed
    remedy = "Name the schedules/belief-1.npz of the round before, or its number's."
    require_file(options.after)
    try:
        data = read_arrays(options.after)
    except Damaged as error:
        raise InputError(
            "isn't what shellform survey leaves", where=str(options.after), remedy=remedy
        ) from error
    lacking = {
        "rest_length",
        "present",
        "radius",
        "covariance",
        "positions",
        "quaternions",
        "origin",
    } - data.keys()
    if lacking:
        raise InputError(
            "was not left by shellform survey: it lacks what a belief has",
            where=str(options.after),
            value=", ".join(sorted(lacking)),
            remedy=remedy,
        )
    if str(data["origin"]) != f"{name}/{options.load}":
        raise InputError(
            "belongs to another design or load case",
            where=str(options.after),
            value=str(data["origin"]),
            remedy="Give the --design and --load of that round.",
        )
    if (
        data["positions"].shape != state.positions.shape
        or data["rest_length"].shape != design.rest_length.shape
        or not np.array_equal(data["present"], design.present)
    ):
        raise InputError("belongs to another run", where=str(options.after), remedy=remedy)
    known = replace(design, rest_length=data["rest_length"], radius=float(data["radius"]))
    there = State(data["positions"], data["quaternions"])
    return name, shell, retensioning.Belief(known, data["covariance"], there, load)


def _marked(markers: Path | None, shell: Gridshell) -> Indices:
    """The nodes (m,) that a file names, or of all crossings the upper rod's."""
    return shell.net.grid.crossing_nodes[:, 1] if markers is None else measurements.read_nodes(markers, shell)


def _predicted(shell: Gridshell, before: State, step: retensioning.Adjustment, goal: Reals) -> str:
    """predicted.csv: each crossing's predicted place, m, and how far it is from its goal before and after the
    turns, mm.
    """
    after = step.belief.state.positions
    rows = []
    for crossing, node in enumerate(shell.net.grid.crossing_nodes[:, 1].tolist()):
        away = [
            f"{1e3 * float(np.linalg.norm(each[node] - goal[node])):.3f}"
            for each in (before.positions, after)
        ]
        rows.append((crossing, node, *(f"{each:.6f}" for each in after[node]), *away))
    heads = ("crossing", "node", "x", "y", "z", "distance before [mm]", "distance after [mm]")
    return table_text(Table("predicted", heads, tuple(rows)))


def _mm(misfit: float, nodes: int) -> str:
    return f"{1e3 * np.sqrt(misfit / nodes):.3f}"
