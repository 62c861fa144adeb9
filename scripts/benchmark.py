"""Speed and memory of the structural core, measured in one go on at most two cores; prints the ratios,
whether the bars hold, and the change since the run that was committed.

    scripts/benchmark [--sizes 12 25 51] [--no-peers] [--million] [--peers-python PYTHON] [--output FILE.json]
        [--against FILE.json]

Times are medians, and what is compared is measured in turns, because other work on the machine slows both
down. The models are gridshell_models.gridshell, from their stress-free curved shape to equilibrium under a
load that grows with the size of a cell.
"""

from __future__ import annotations

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path

CORES = 2
if hasattr(os, "sched_setaffinity"):
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:CORES])
os.environ["OMP_NUM_THREADS"] = str(CORES)

# Libraries count the cores when they are loaded.
import numpy as np  # noqa: E402
from benchmark_trend import COMMITTED, committed, trend  # noqa: E402
from gridshell_models import gridshell  # noqa: E402
from peers import environment  # noqa: E402

import shellform  # noqa: E402
from shellform.structure.answers import sensitivity  # noqa: E402
from shellform.structure.elements.state import at_rest  # noqa: E402
from shellform.structure.model import Model, write_model  # noqa: E402
from shellform.structure.network import assemble  # noqa: E402
from shellform.structure.solve import factorisation, pardiso  # noqa: E402
from shellform.structure.solve.assembly import Assembly  # noqa: E402
from shellform.structure.solve.equilibrium import _Relaxation, find_equilibrium  # noqa: E402
from shellform.structure.solve.residual import ResidualNorm, held  # noqa: E402

HERE = Path(__file__).parent
SIZES = (12, 25, 51)  # rods in each direction: 7,488, 31,200 and 127,296 degrees of freedom
CABLES = 13  # rods, for 288 cables
MULTIHALLE = (184, 3)  # rods and elements: 33,856 crossings
# of the largest force, moments over the length of an element; the peers compute in that unit of length
TOLERANCE = 1e-7
MATCH = 0.01  # of the largest and of the root mean square displacement of the crossings
OPENSEES = ("SparseSYM", "UmfPack")  # BandSPD and ProfileSPD take 40 times as long


@dataclass(frozen=True)
class Row:
    """One line of the table; `bar` is the largest or the smallest value that will do, as `most` says."""

    what: str
    value: float
    unit: str = ""
    bar: float | None = None
    most: bool = True

    @property
    def holds(self) -> bool | None:
        if self.bar is None:
            return None
        return self.value <= self.bar if self.most else self.value >= self.bar

    def __str__(self) -> str:
        bar = "" if self.bar is None else f"{'at most' if self.most else 'at least'} {self.bar:g}"
        return f"{self.what:74} {self.value:10.3g} {self.unit:5} {bar:14} {'' if self.holds is None else 'yes' if self.holds else 'NO'}"


def model_of(rods: int) -> Model:
    return gridshell(rods, loaded=-0.4 * (12 / rods) ** 2)


def seconds(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def walk(assembly: Assembly, model: Model) -> _Relaxation:
    return _Relaxation(assembly, at_rest(model.network.nodes), model.loads["design"], np.inf, TOLERANCE)


def iterations(rods: int) -> tuple[list[Row], float, int]:
    """One iteration beside the bare factorisations of its matrix: rows, the iteration's median time, and the
    number of degrees of freedom.
    """
    model = model_of(rods)
    assembly = assemble(model.network)
    size = len(assembly.free)
    rounds = max(3, 200_000 // size)
    families = {}
    for name in factorisation.installed():
        os.environ["SHELLFORM_SOLVER"] = name
        families[name] = factorisation.Symmetric(assembly.matrix.indptr, assembly.matrix.indices)
        if name == "mkl":  # one of its own: how a matrix is laid out depends on the number of threads
            families["mkl, 2 threads"] = factorisation.Symmetric(
                assembly.matrix.indptr, assembly.matrix.indices
            )
    del os.environ["SHELLFORM_SOLVER"]
    step: list[float] = []
    share: list[float] = []
    work: list[float] = []
    bare: dict[str, list[float]] = {name: [] for name in families}
    bare_work: dict[str, list[float]] = {name: [] for name in families}
    for turn in range(rounds + 1):  # the first one analyses patterns and isn't counted
        way = walk(assembly, model)
        while way.residual > TOLERANCE:
            values = held(assembly, way.now)
            before, worked = assembly.clock["assembly"], time.process_time()
            took = seconds(lambda way=way: way.step(False))
            if turn:
                work.append(time.process_time() - worked)
                step.append(took)
                share.append((assembly.clock["assembly"] - before) / took)
            for name, family in families.items():
                if name == "superlu" and turn != 1:
                    continue
                limit = pardiso._TWO_THREADS_FROM
                pardiso._TWO_THREADS_FROM = 0 if name.endswith("threads") else limit
                worked = time.process_time()
                took = seconds(lambda family=family, values=values: family.factor(values))
                pardiso._TWO_THREADS_FROM = limit
                if turn:
                    bare[name].append(took)
                    bare_work[name].append(time.process_time() - worked)
    medians = {name: statistics.median(times) for name, times in bare.items()}
    one = statistics.median(step)
    fastest = min((name for name in medians if not name.endswith("threads")), key=medians.__getitem__)
    rows = [Row(f"{size:,} freedoms: one iteration", 1e3 * one, "ms")]
    rows += [
        Row(f"{size:,} freedoms: bare Cholesky, {name}", 1e3 * took, "ms") for name, took in medians.items()
    ]
    rows.append(
        Row(
            f"{size:,} freedoms: iteration over the fastest bare Cholesky ({fastest})",
            one / medians[fastest],
            "",
            1.6,
        )
    )
    # What the processors did, both threads added up: no other work on the machine gets into it, and two
    # threads gain nothing.
    ratio = statistics.median(work) / statistics.median(bare_work[fastest])
    rows.append(Row(f"{size:,} freedoms: the same in processor time", ratio))
    rows.append(
        Row(f"{size:,} freedoms: assembly's share of an iteration", 100 * statistics.median(share), "%", 25.0)
    )
    return rows, one, size


def beside_peers(rods: int, python: str, missing: dict[str, str]) -> list[Row]:
    """Ours and the peers in turns on one model; asserts that the results match."""
    model = model_of(rods)
    load = model.loads["design"]
    crossings = np.flatnonzero(load.any(axis=1))
    rounds = 3 if rods < 40 else 1
    step: list[float] = []
    total: list[float] = []

    def ours() -> np.ndarray:
        began = time.perf_counter()
        assembly = assemble(model.network)
        found = find_equilibrium(assembly, at_rest(model.network.nodes), load, tolerance=TOLERANCE)
        total.append(time.perf_counter() - began)
        way = walk(assembly, model)
        while way.residual > TOLERANCE:
            step.append(seconds(lambda: way.step(False)))
        return found.state.positions - model.network.nodes

    own = ours()
    total.clear()
    step.clear()
    assembly = assemble(model.network)
    scale = ResidualNorm(assembly).scale(assembly.evaluate(at_rest(model.network.nodes + own)), load)
    unit = float(np.median(assembly.arms))
    told: dict[str, list[dict[str, float]]] = {}
    differences: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as folder:
        file, moved = Path(folder) / "model.json", Path(folder) / "moved.npy"
        write_model(file, model)
        todo = [("opensees", solver) for solver in OPENSEES] * rounds + [("kratos", "sparse_lu")] * (
            1 if rods > 40 else 2
        )
        for name, solver in todo:
            if name in missing:
                continue
            ours()
            ours()
            command = [
                python,
                str(HERE / "peers" / f"{name}.py"),
                str(file),
                str(moved),
                "--tolerance",
                str(TOLERANCE * scale),
                "--unit",
                str(unit),
            ]
            # Threads that wait for each other in a loop made Kratos ten times slower beside other work on the
            # machine.
            quiet = {**os.environ, "OMP_WAIT_POLICY": "PASSIVE"}
            done = subprocess.run([*command, "--solver", solver], capture_output=True, text=True, env=quiet)
            lines = [line for line in done.stdout.splitlines() if line.startswith("{")]
            if not lines:
                raise SystemExit(
                    f"{name} with {solver} ended without a result:\n{done.stdout[-2000:]}{done.stderr[-2000:]}"
                )
            answer = json.loads(lines[-1])
            if not answer["converged"]:
                raise SystemExit(f"{answer['name']} found no equilibrium with {rods} rods")
            told.setdefault(answer["name"], []).append(answer)
            differences[name] = difference(own[crossings], np.load(moved)[crossings])
    rows = [Row(f"{len(assembly.free):,} freedoms: shellform in total", statistics.median(total), "s")]
    for name, bar in (("OpenSees", 8.0), ("Kratos", 18.0)):
        runs = {full: answers for full, answers in told.items() if full.startswith(name)}
        if not runs:
            continue
        for key, what, mine in (("iteration", "an iteration", step), ("seconds", "in total", total)):
            times = {
                full: statistics.median(answer[key] for answer in answers) for full, answers in runs.items()
            }
            best = min(times, key=times.__getitem__)
            rows.append(Row(f"{len(assembly.free):,} freedoms: {best} {what}", times[best], "s"))
            rows.append(
                Row(
                    f"{len(assembly.free):,} freedoms: {name} over shellform {what}",
                    times[best] / statistics.median(mine),
                    "x",
                    bar,
                    False,
                )
            )
        apart = 100 * differences[name.lower()]
        rows.append(
            Row(
                f"{len(assembly.free):,} freedoms: displacements differ from those of {name} by",
                apart,
                "%",
                100 * MATCH,
            )
        )
    return rows


def difference(own: np.ndarray, other: np.ndarray) -> float:
    """The larger of the relative differences of the largest displacement and, root mean square, of all."""
    sizes = [np.linalg.norm(each, axis=1).max() for each in (own, other)]
    apart = np.sqrt(((own - other) ** 2).sum() / (own**2).sum())
    return float(max(abs(sizes[1] / sizes[0] - 1.0), apart))


def sensitivities() -> list[Row]:
    """All cable forces and the misfit by all rest lengths, and one adjoint gradient, in iterations of the
    same model.
    """
    model = gridshell(CABLES, cable_rest=0.995)
    network, cables, load = model.network, model.network.cables, model.loads["design"]
    assembly = assemble(network)
    found = find_equilibrium(assembly, at_rest(network.nodes), load)
    number = np.full(6 * assembly.count, -1)
    number[assembly.free] = np.arange(len(assembly.free))
    target = np.flatnonzero(load.any(axis=1))
    dofs = (6 * target[:, None] + np.arange(3)).ravel()
    misfit = np.zeros((1, len(assembly.free)))
    misfit[0, number[dofs]] = 2.0 * (found.state.positions - network.nodes)[target].ravel()
    step: list[float] = []
    whole: list[float] = []
    single: list[float] = []
    for turn in range(12):
        way = walk(assembly, model)
        while way.residual > TOLERANCE:
            took = seconds(lambda way=way: way.step(False))
            if turn:
                step.append(took)
        began = time.perf_counter()
        response = sensitivity.respond(
            assembly, found.state, sensitivity.by_rest_length(assembly, found.state, cables)
        )
        rows = sensitivity.tension_rows(assembly, found.state, cables)
        forces = sensitivity.direct(response, rows)
        forces[np.diag_indices(len(forces))] += cables.tension_by_rest_length(found.state)
        then = time.perf_counter()
        by_misfit = sensitivity.adjoint(response, misfit)
        done = time.perf_counter()
        if turn:
            whole.append(done - began)
            single.append(done - then)
    moves = sensitivity.state_by_design(response)
    plain = rows @ moves
    plain[np.diag_indices(len(plain))] += cables.tension_by_rest_length(found.state)
    for quick, slow in ((forces, plain), (by_misfit, misfit @ moves)):
        assert np.abs(quick - slow).max() <= 1e-7 * np.abs(slow).max()
    one = statistics.median(step)
    what = f"{len(cables.ends)} cable forces and the misfit by {len(cables.ends)} rest lengths, {len(assembly.free):,} freedoms"
    return [
        Row(what, statistics.median(whole) / one, "iter.", 6.0),
        Row("one adjoint gradient, the factor shared", statistics.median(single) / one, "iter.", 0.3),
    ]


def alone(task: str, *arguments: str, **variables: str) -> dict[str, float]:
    """What a fresh process answers to a task."""
    command = [sys.executable, str(Path(__file__).resolve()), "--task", task, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, env={**os.environ, **variables})
    if done.returncode:
        raise SystemExit(f"The task {task} ended with {done.returncode}:\n{done.stderr[-2000:]}")
    return dict(json.loads(done.stdout.splitlines()[-1]))


def solve(rods: int, elements: int) -> dict[str, float]:
    """Task: a model of its own to equilibrium; seconds, and the process's peak memory, GB."""
    import resource

    model = gridshell(rods, elements, loaded=-0.4 * (12 / rods) ** 2)
    began = time.perf_counter()
    assembly = assemble(model.network)
    found = find_equilibrium(
        assembly, at_rest(model.network.nodes), model.loads["design"], tolerance=TOLERANCE
    )
    return {
        "seconds": time.perf_counter() - began,
        "memory": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024 / 1e9,
        "freedoms": len(assembly.free),
        "factorisations": found.factorisations,
        "stable": found.stable,
        "residual": found.residual,
    }


def memory(rods: int) -> list[Row]:
    told = alone("solve", str(rods), "4")
    return [
        Row(
            f"peak memory with {told['freedoms']:,} freedoms, in a process of its own",
            told["memory"],
            "GB",
            2.0,
        )
    ]


def million() -> list[Row]:
    told = alone("solve", *map(str, MULTIHALLE))
    what = f"{told['freedoms']:,} freedoms, {MULTIHALLE[0] ** 2:,} crossings, to equilibrium"
    return [
        Row(f"{what}: time", told["seconds"], "s"),
        Row(f"{what}: peak memory", told["memory"], "GB"),
        Row(f"{what}: factorisations", told["factorisations"]),
    ]


def first() -> dict[str, float]:
    """Task: a small model; seconds of the first and of the second analysis in this process."""
    model = gridshell(3, 2)

    def analyse() -> None:
        assembly = assemble(model.network)
        find_equilibrium(assembly, at_rest(model.network.nodes), model.loads["design"])

    return {"first": seconds(analyse), "second": seconds(analyse)}


def compilation() -> list[Row]:
    with tempfile.TemporaryDirectory() as folder:
        began = time.perf_counter()
        alone("first", NUMBA_CACHE_DIR=folder)
        whole = time.perf_counter() - began
        warm = [alone("first", NUMBA_CACHE_DIR=folder) for _ in range(3)]
    loading = statistics.median(told["first"] - told["second"] for told in warm)
    return [
        Row("first process ever: start, compilation and analysis of a small model", whole, "s", 20.0),
        Row("a later process: loading the compiled kernels", loading, "s", 1.0),
    ]


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), help="rods in each direction")
    parser.add_argument("--no-peers", action="store_true", help="leave OpenSees and Kratos out")
    parser.add_argument("--peers-python", help="a Python 3.12 with the peers (also SHELLFORM_PEERS_PYTHON)")
    parser.add_argument("--million", action="store_true", help="a Mannheim Multihalle as well")
    parser.add_argument("--output", type=Path, help="write the table as JSON")
    parser.add_argument(
        "--against",
        type=Path,
        default=COMMITTED,
        help="a kept run to tell the trend from (scripts/benchmark.json)",
    )
    parser.add_argument("--task", nargs="+", help=argparse.SUPPRESS)
    chosen = parser.parse_args()
    if chosen.task:
        task, *rest = chosen.task
        print(json.dumps(first() if task == "first" else solve(*map(int, rest))))
        return 0
    rows: list[Row] = []
    notes = [f"version {shellform.__version__}; {CORES} cores; factorised by {factorisation.backend_name()}"]

    def tell(more: list[Row]) -> None:
        rows.extend(more)
        for row in more:
            print(row, trend(row.what, row.value, row.holds, before), sep="  ", flush=True)

    before = committed(chosen.against)
    busy = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
    print(
        f"{CORES} cores; load before the start {busy:.1f} (below 0.5 is quiet); factorised by {factorisation.backend_name()}\n",
        flush=True,
    )
    measured = {}
    for rods in chosen.sizes:
        more, one, size = iterations(rods)
        measured[size] = one
        tell(more)
    low, high = min(measured), max(measured)
    if low < high:
        exponent = np.log(measured[high] / measured[low]) / np.log(high / low)
        tell(
            [
                Row(
                    f"an iteration grows from {low:,} to {high:,} freedoms as n to the power",
                    float(exponent),
                    "",
                    1.3,
                )
            ]
        )
    tell(sensitivities())
    tell(compilation())
    tell(memory(max(chosen.sizes)))
    if not chosen.no_peers:
        python, missing = environment.find(chosen.peers_python)
        for sentence in sorted(set(missing.values())):
            notes.append(sentence)
            print(sentence, flush=True)
        if python:
            notes.append(environment.versions(python))
        for rods in chosen.sizes:
            if python and len(missing) < len(environment.PACKAGES):
                tell(beside_peers(rods, python, missing))
    if chosen.million:
        tell(million())
    if chosen.output:
        table = [asdict(row) | {"holds": row.holds} for row in rows]
        chosen.output.write_text(
            json.dumps({"load_before": busy, "notes": notes, "rows": table}, indent=1), encoding="utf-8"
        )
    failed = sum(row.holds is False for row in rows)
    print(f"\n{sum(row.holds is True for row in rows)} bars hold, {failed} don't")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
