"""Small faults planted one at a time, and whether the tests notice: signs, factors, comparisons, least and most.

    python scripts/mutants.py [--count 200] [--seed 1] [--rooms optimiser records ...] [--output FILE.json]

Each fault is planted in a copy of the repository, and the likeliest test files are run on it: those of the
same room that name the module, then others that do, then all of the room. A fault that no test notices is
listed with its line; what nobody could notice stands with its reason in scripts/mutants.toml. Status 1 where
fewer than 90 % of the others are caught. A test that notices is run without any fault, too: one that fails then is
left out and told.

What is compiled here is copied along. A loop that is compiled lies inlined in others' machine code, too, whose own
files don't change: a fault in one is run with a cache of its own.

The tools that are at hand (mutmut, cosmic-ray) run all tests on each fault or know one process's modules; here
a compiled loop has to be compiled anew, and the tests take a quarter of an hour.
"""

from __future__ import annotations

import argparse
import ast
import json
import os
import random
import resource
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

ROOT = Path(__file__).parent.parent
KNOWN = Path(__file__).with_suffix(".toml")
CAUGHT = 0.9  # of the faults that could be noticed
LONGEST = 600  # processor seconds of one process in the tests of one fault; one that runs on is noticed
WAITING = 3600.0  # seconds on the clock, the same for one that waits for ever
FILES = 4  # test files, at most, that are run on a fault
_LEFT_OUT = ("verification", "__pycache__")  # published numbers are no behaviour
_COPIED = (
    "shellform",
    "surfaces",
    "scripts",
    "tests",
    "pyproject.toml",
    "README.md",
    "CHANGELOG.md",
    "LICENSE",
)
_COMPARED: dict[type[ast.cmpop], type[ast.cmpop]] = {
    ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
}  # fmt: skip
_COMPUTED: dict[type[ast.operator], type[ast.operator]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
_CALLED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Fault:
    """A fault: the `file`, from the root; the place of the expression that it changes; what stood there,
    `before`, and what stands there `after`."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    before: str
    after: str

    @property
    def room(self) -> str:
        """The package's room that it is in."""
        return Path(self.file).parts[1].removesuffix(".py")

    @property
    def name(self) -> str:
        """As it is called in mutants.toml, whatever lines come and go."""
        return f"{self.file}: {self.before} -> {self.after}"


def faults(file: Path) -> Iterator[Fault]:
    """Every fault that could be planted in a file."""
    tree = ast.parse(file.read_text(encoding="utf-8"))
    for node in _code(tree):
        for changed in _changes(node):
            after = ast.unparse(ast.fix_missing_locations(changed))
            place = node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0
            yield Fault(file.relative_to(ROOT).as_posix(), *place, ast.unparse(node), after)


def _code(node: ast.AST) -> Iterator[ast.expr]:
    """The expressions that are computed: no annotations, no decorators, no text."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for each in value if isinstance(value, list) else [value]:
            if isinstance(each, ast.JoinedStr):
                continue
            if isinstance(each, ast.expr):
                yield each
            if isinstance(each, ast.AST):
                yield from _code(each)


def _changes(node: ast.expr) -> Iterator[ast.expr]:
    if isinstance(node, ast.Compare) and len(node.ops) == 1 and type(node.ops[0]) in _COMPARED:
        yield ast.Compare(node.left, [_COMPARED[type(node.ops[0])]()], node.comparators)
    if isinstance(node, ast.BinOp) and type(node.op) in _COMPUTED and not _is_text(node):
        yield ast.BinOp(node.left, _COMPUTED[type(node.op)](), node.right)
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield node.operand
    if isinstance(node, ast.BoolOp):
        yield ast.BoolOp(ast.And() if isinstance(node.op, ast.Or) else ast.Or(), node.values)
    if isinstance(node, ast.Constant) and isinstance(node.value, float) and node.value:
        yield ast.Constant(2.0 * node.value)
    if isinstance(node, ast.Call):
        called = node.func
        if isinstance(called, ast.Name) and called.id in _CALLED:
            yield ast.Call(ast.Name(_CALLED[called.id], ast.Load()), node.args, node.keywords)
        if isinstance(called, ast.Attribute) and called.attr in _CALLED:
            other = ast.Attribute(called.value, _CALLED[called.attr], ast.Load())
            yield ast.Call(other, node.args, node.keywords)


def _is_text(node: ast.BinOp) -> bool:
    """Whether words or lists are joined, not numbers added."""
    kinds = (ast.JoinedStr, ast.List, ast.Tuple, ast.ListComp)
    sides = (node.left, node.right)
    return any(
        isinstance(e, kinds) or (isinstance(e, ast.Constant) and isinstance(e.value, str)) for e in sides
    )


def sample(count: int, seed: int, rooms: Sequence[str]) -> list[Fault]:
    """So many faults, as evenly over the rooms as they come."""
    known = set(tomllib.loads(KNOWN.read_text(encoding="utf-8"))) if KNOWN.is_file() else set()
    found: dict[str, list[Fault]] = {}
    for file in sorted((ROOT / "shellform").rglob("*.py")):
        if not any(part in _LEFT_OUT for part in file.parts):
            for fault in faults(file):
                if fault.name not in known and (not rooms or fault.room in rooms):
                    found.setdefault(fault.room, []).append(fault)
    chance = random.Random(seed)
    for each in found.values():
        chance.shuffle(each)
    chosen: list[Fault] = []
    while len(chosen) < count and any(found.values()):
        for each in found.values():
            if each and len(chosen) < count:
                chosen.append(each.pop())
    return chosen


def likeliest(fault: Fault) -> list[str]:
    """The test files that are run on a fault, from the root."""
    module = Path(fault.file).with_suffix("")
    words = f"{module.parent.as_posix().replace('/', '.')}.{module.name}", f"import {module.name}"
    room = ROOT / "tests" / fault.room
    own = sorted(room.glob("test_*.py")) if room.is_dir() else []
    rest = sorted(set((ROOT / "tests").rglob("test_*.py")) - set(own))
    naming = [
        file for file in (*own, *rest) if any(word in file.read_text(encoding="utf-8") for word in words)
    ]
    alike = [file for file in own if module.name.rstrip("s") in file.name]
    general = [
        ROOT / "tests/test_public.py",
        ROOT / "tests/structure/test_solver.py",
    ]  # for what all are built on
    order = list(dict.fromkeys([*alike, *naming, *own])) or general
    return [file.relative_to(ROOT).as_posix() for file in order[:FILES]]


def caught_by(fault: Fault, copy: Path, files: Sequence[str], left_out: Sequence[str] = ()) -> str:
    """The test in the `files`, without those `left_out`, that notices a fault; "" where none does."""
    file = copy / fault.file
    whole, then = file.read_bytes(), file.stat()
    lines = whole.decode().splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line.encode()))
    begin, end = starts[fault.line - 1] + fault.column, starts[fault.end_line - 1] + fault.end_column
    file.write_bytes(whole[:begin] + f"({fault.after})".encode() + whole[end:])
    own = tempfile.mkdtemp(prefix="mutant-") if b"njit" in whole else None
    try:
        return failed(copy, files, own, left_out)
    finally:
        file.write_bytes(whole)
        os.utime(file, ns=(then.st_atime_ns, then.st_mtime_ns))  # by which Numba knows what it has compiled
        if own is not None:
            shutil.rmtree(own)


def failed(copy: Path, files: Sequence[str], cache: str | None = None, left_out: Sequence[str] = ()) -> str:
    """The first test in the `files` that fails, but for those `left_out`, with compiled loops in a `cache` where
    given, else beside the copy's modules."""
    if not files:
        return ""
    command = [sys.executable, "-m", "pytest", "-x", "-q", "--no-header", "--tb=no", "-p", "no:cacheprovider"]
    environment = {**os.environ, "PYTHONPATH": str(copy)} | (
        {} if cache is None else {"NUMBA_CACHE_DIR": cache}
    )
    try:
        done = subprocess.run(
            [*command, *(f"--deselect={each}" for each in left_out), *files], cwd=copy, env=environment, capture_output=True, text=True, timeout=WAITING,
            check=False, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (LONGEST, LONGEST)),
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        return "a hang"
    if done.returncode in (0, 5):
        return ""
    told = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    return told[0] if told else f"status {done.returncode}"


def noticed(fault: Fault, copy: Path, sound: dict[str, bool]) -> str:
    """The test that notices a fault and passes without it; "" where there is none. `sound` remembers which pass."""
    while True:
        files = [name for name in likeliest(fault) if sound.get(name, True)]
        told = caught_by(fault, copy, files, [name for name, passes in sound.items() if not passes])
        if not told.startswith(("FAILED", "ERROR")):
            return told
        test = told.split(" - ")[0].split(maxsplit=1)[1]
        if test not in sound:
            why = failed(copy, [test])
            sound[test] = not why
            if why:
                print(f"left out: {test} fails without any fault", flush=True)
        if sound[test]:
            return told


def main() -> int:
    """Plants, runs, tells."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("--count", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--rooms", nargs="*", default=[])
    asked.add_argument("--output", type=Path)
    given = asked.parse_args()
    chosen = sample(given.count, given.seed, given.rooms)
    rows, by_room = [], Counter[tuple[str, bool]]()
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        for name in _COPIED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, Path(place) / name)
        sound: dict[str, bool] = {}
        for fault in chosen:
            told = noticed(fault, Path(place), sound)
            rows.append({**asdict(fault), "caught_by": told})
            by_room[fault.room, bool(told)] += 1
            print(
                f"{'caught  ' if told else 'SURVIVES'} {fault.file}:{fault.line}  {fault.before}  ->  {fault.after}",
                flush=True,
            )
            if given.output:
                given.output.write_text(json.dumps(rows, indent=1), encoding="utf-8")
    for room in sorted({room for room, _ in by_room}):
        print(f"{room:14} {by_room[room, True]:4d} of {by_room[room, True] + by_room[room, False]}")
    share = sum(bool(row["caught_by"]) for row in rows) / max(1, len(rows))
    print(f"{100.0 * share:.0f} % of {len(rows)} faults are caught")
    return 0 if share >= CAUGHT else 1


if __name__ == "__main__":
    sys.exit(main())
