"""Small faults planted one at a time, and whether the tests notice: signs, factors, comparisons, least and
most.

    python scripts/mutants.py [--count 200] [--seed 1] [--rooms optimiser output/workshop ...] [--output
    FILE.json]
                              [--quick] [--tests TEST-FILE ...]

The likeliest test files of a fault are those of the same room that name the module, then others that do, then
all of the room. They are run once without any fault, in one process, which tells what fails anyhow and is
left out, and which of the package's functions each test calls. Then the process is forked for each fault: the
child puts the faulty function in the sound one's place and runs the tests that call it, those that do so
themselves before those whose fixtures do, and the quickest first. Tests that have processes of their own
can't be run so and are left out, by their names. A fault that no test notices is listed with
its line; what nobody could notice stands with its reason in scripts/mutants.toml. Status 1 where fewer than
90 % of the others are caught.

A fault in a compiled loop, or where nothing can be put in its place, is planted in a copy of the repository,
and whole test files are run on it, each in a process of its own: minutes for each fault, left out by --quick.
What is compiled here is copied along. A compiled loop lies inlined in others' machine code, too, whose own
files don't change: a fault in one is run with a cache of its own. A test that notices is run without any
fault, too.

The tools that are at hand (mutmut, cosmic-ray) run all tests on each fault or know one process's modules;
here a compiled loop has to be compiled anew, and the tests take a quarter of an hour.
"""

from __future__ import annotations

import argparse
import ast
import functools
import gc
import json
import multiprocessing
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from multiprocessing.process import BaseProcess
from pathlib import Path
from types import CodeType, FrameType, FunctionType
from typing import TextIO
from unittest.mock import patch

import pytest

ROOT = Path(__file__).parent.parent
KNOWN = Path(__file__).with_suffix(".toml")
CAUGHT = 0.9  # of the faults that could be noticed
LONGEST = 600  # processor seconds of one process in the tests of one fault; one that runs on is noticed
WAITING = 3600.0  # seconds on the clock, the same for one that waits for ever
FILES = 4  # test files, at most, that are run on a fault
ENOUGH = 60.0  # processor seconds of the tests that are run on a fault in a function, as they took without it
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
_REMEMBERING = type(functools.cache(len))
_LOOP = "@njit"  # before a function that is compiled
_NEXT = "\n"  # between what a child tells
_DEATH = "status"  # the first word of how a child ended that told nothing
_CALLED = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Fault:
    """A fault: the `file`, from the root; the place of the expression that it changes; what stood there,
    `before`, and what stands there `after`; and the `text` of the line that it begins in."""

    file: str
    line: int
    column: int
    end_line: int
    end_column: int
    before: str
    after: str
    text: str

    @property
    def room(self) -> str:
        """The package's room that it is in."""
        return Path(self.file).parts[1].removesuffix(".py")

    @property
    def name(self) -> str:
        """As it is called in mutants.toml, whatever other lines come and go."""
        return f"{self.file}: {self.text}: {self.before} -> {self.after}"


def faults(file: Path) -> Iterator[Fault]:
    """Every fault that could be planted in a file."""
    whole = file.read_text(encoding="utf-8")
    tree, lines = ast.parse(whole), whole.splitlines()
    for node in _code(tree):
        for changed in _changes(node):
            after = ast.unparse(ast.fix_missing_locations(changed))
            place = node.lineno, node.col_offset, node.end_lineno or 0, node.end_col_offset or 0
            text = lines[node.lineno - 1].partition("  # ")[0].strip()
            yield Fault(file.relative_to(ROOT).as_posix(), *place, ast.unparse(node), after, text)


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


def listed() -> set[str]:
    """The names of the faults that stand in mutants.toml with a reason. Raises ValueError where one is for a
    line that isn't there any more."""
    known = set(tomllib.loads(KNOWN.read_text(encoding="utf-8"))) if KNOWN.is_file() else set()
    gone = known - {fault.name for file in (ROOT / "shellform").rglob("*.py") for fault in faults(file)}
    if gone:
        raise ValueError("no such lines any more: " + "; ".join(sorted(gone)))
    return known


def sample(count: int, seed: int, rooms: Sequence[str]) -> list[Fault]:
    """So many faults, as evenly over the rooms as they come. Raises ValueError as `listed`."""
    known = listed()
    found: dict[str, list[Fault]] = {}
    for file in sorted((ROOT / "shellform").rglob("*.py")):
        if not any(part in _LEFT_OUT for part in file.parts):
            for fault in faults(file):
                if fault.name not in known and (not rooms or _is_within(fault, rooms)):
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


def _is_within(fault: Fault, rooms: Sequence[str]) -> bool:
    """Whether it is in one of the rooms, parts of rooms or modules."""
    module = Path(fault.file).with_suffix("").as_posix().removeprefix("shellform/")
    return any(module == room or module.startswith(f"{room}/") for room in rooms)


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
    near = own or sorted((ROOT / "tests").glob("test_*.py"))  # of modules that lie in no room
    alike = [file for file in near if module.name.rstrip("s") in file.name]
    general = [
        ROOT / "tests/test_public.py",
        ROOT / "tests/structure/test_solver.py",
    ]  # for what all are built on
    order = list(dict.fromkeys([*alike, *naming, *own])) or general
    return [file.relative_to(ROOT).as_posix() for file in order[:FILES]]


def with_fault(fault: Fault, whole: bytes) -> bytes:
    """A file's text with the fault in it."""
    starts = [0]
    for line in whole.splitlines(keepends=True):
        starts.append(starts[-1] + len(line))
    begin, end = starts[fault.line - 1] + fault.column, starts[fault.end_line - 1] + fault.end_column
    return whole[:begin] + f"({fault.after})".encode() + whole[end:]


def plant(fault: Fault) -> bool:
    """Puts what has the fault in the sound one's place, in this process; whether that could be done."""
    file = ROOT / fault.file
    text = with_fault(fault, file.read_bytes())
    module = sys.modules[fault.file.removesuffix(".py").replace("/", ".").removesuffix(".__init__")]
    faulty = {_key(code): code for code in _codes(compile(text, str(file), "exec"))}
    planted = False
    gc.unfreeze()  # what tests/conftest.py froze isn't among the objects
    for each in gc.get_objects():
        if isinstance(each, FunctionType) and each.__code__.co_filename == str(file):
            first, last = _lines(each.__code__)
            other = faulty.get(_key(each.__code__))
            if first <= fault.line <= last and other is not None and other != each.__code__:
                each.__code__ = other  # and in the others that were made of it
                planted = True
    if planted:
        _forget()
        return True
    for node in ast.parse(text).body:
        if isinstance(node, ast.Assign) and node.lineno <= fault.line <= fault.end_line <= (
            node.end_lineno or 0
        ):
            value = eval(compile(ast.Expression(node.value), str(file), "eval"), dict(vars(module)))
            name = ast.unparse(node.targets[0])
            before = getattr(module, name, None)
            for key, other_module in list(sys.modules.items()):
                if key.startswith("shellform") and getattr(other_module, name, module) is before:
                    setattr(other_module, name, value)
            return before is not None
    return False


def _forget() -> None:
    """What functions of the package remember was found by the sound one."""
    for each in gc.get_objects():
        if isinstance(each, _REMEMBERING) and (each.__module__ or "").startswith("shellform"):
            each.cache_clear()


def _codes(code: CodeType) -> Iterator[CodeType]:
    for each in code.co_consts:
        if isinstance(each, CodeType):
            yield each
            yield from _codes(each)


def _key(code: CodeType) -> tuple[str, int]:
    return code.co_qualname, code.co_firstlineno


def _lines(code: CodeType) -> tuple[int, int]:
    """First and last line of a function, those of functions in it included."""
    inner = [_lines(each)[1] for each in code.co_consts if isinstance(each, CodeType)]
    own = [line for _, _, line in code.co_lines() if line is not None]
    return code.co_firstlineno, max([*own, *inner], default=code.co_firstlineno)


@contextmanager
def _telling_starts() -> Iterator[list[BaseProcess]]:
    """The processes that are started meanwhile by multiprocessing, as a study's workers are. The threads that
    wait for these aren't forked, so that a forked test would wait for ever."""
    started: list[BaseProcess] = []
    start = BaseProcess.start

    def told(process: BaseProcess) -> None:
        started.append(process)
        start(process)

    with patch.object(BaseProcess, "start", told):
        yield started


class Planter:
    """A plug-in for pytest that runs the tests as they are, and then on each of the `faults` in a process
    forked from there. `rows` are what becomes of each, told to `told`; `rest` those that couldn't be
    planted."""

    def __init__(self, faults: Sequence[Fault], told: TextIO) -> None:
        self.faults, self.told = faults, told
        self.rows: dict[Fault, str] = {}
        self.rest: list[Fault] = []
        self.failed = ""
        self._now: dict[int, CodeType] = {}
        self._shared: set[tuple[str, int]] = set()
        self._fixtures: dict[str, set[tuple[str, int]]] = {}
        self._itself: dict[str, set[tuple[str, int]]] = {}
        self._seconds: dict[str, float] = {}
        self._waited: dict[str, float] = {}
        self._kept: list[pytest.FixtureDef[object]] = []

    def _trace(self, frame: FrameType, event: str, value: object) -> None:
        """At every call of any function: no more than it must."""
        self._now[id(frame.f_code)] = frame.f_code

    def _called(self) -> set[tuple[str, int]]:
        """The package's functions that were called in a test's part so far."""
        codes, package = list(self._now.values()), str(ROOT / "shellform")  # what follows is traced too
        places = ((code.co_filename, code.co_firstlineno) for code in codes)
        return {place for place in places if place[0].startswith(package)}

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """After a test's fixtures, after it, and after what clears them away."""
        if report.failed:
            self.failed = report.nodeid
        file, called = report.nodeid.split("::")[0], self._called()
        if report.when == "setup":
            self._fixtures.setdefault(file, set()).update(called)
        if report.when == "call":
            self._itself[report.nodeid] = called
        self._now = {}

    @pytest.hookimpl(wrapper=True)
    def pytest_fixture_setup(self, fixturedef: pytest.FixtureDef[object]) -> Iterator[None]:
        """Those of the whole session are kept for all faults that they don't meet."""
        found = yield
        if fixturedef.scope == "session":
            self._shared |= self._called()
            self._kept.append(fixturedef)
        return found

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """All tests, then all faults."""
        items = [*session.items]
        for k, item in enumerate(items):
            began, since, self.failed = time.process_time(), time.monotonic(), ""
            waited_for = bool(multiprocessing.active_children())  # a fixture's workers
            with _telling_starts() as starts:
                sys.settrace(self._trace)
                self._run(item, items[(k + 1) % len(items)])
                sys.settrace(None)
            self._seconds[item.nodeid] = time.process_time() - began
            self._waited[item.nodeid] = time.monotonic() - since
            if self.failed:
                print(f"left out: {self.failed} fails without any fault", file=self.told, flush=True)
            if starts or waited_for:
                print(f"left out: {item.nodeid} has processes of its own", file=self.told, flush=True)
            if self.failed or starts or waited_for:
                self._itself.pop(item.nodeid, None)
        spent = sum(self._seconds.values())
        print(f"{len(items)} tests, {spent:.0f} s of processor time", file=self.told, flush=True)
        by_name = {item.nodeid: item for item in items}
        for fault in self.faults:
            told = self._noticed(fault, by_name, items[0])
            if told is None:
                self.rest.append(fault)
                continue
            self.rows[fault] = told
            tell(fault, told, self.told)
        return True

    def _noticed(self, fault: Fault, items: Mapping[str, pytest.Item], last: pytest.Item) -> str | None:
        """What notices a fault, as `_forked`. A test in which a forked process dies or waits for ever without
        any fault too, for a thread that wasn't forked with it, is left out from then on."""
        while True:
            chosen = [items[name] for name in self._calling(fault)]
            told = self._forked(fault, chosen, last)
            if told is None or not told.startswith(_DEATH):
                return told
            name = told.split(" in ", 1)[1]
            sound = self._forked(fault, [items[name]], last, planted=False) if name in items else ""
            if not sound:
                return told
            print(f"left out: {sound} without any fault", file=self.told, flush=True)
            self._itself.pop(name)

    def _run(self, item: pytest.Item, following: pytest.Item) -> None:
        item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)

    def _calling(self, fault: Fault) -> list[str]:
        """The tests that call the function that a fault lies in."""
        first, last = _function(fault)
        near = []
        for name, seconds in self._seconds.items():
            for far, called in enumerate((self._itself.get(name, ()), self._fixtures[name.split("::")[0]])):
                if name in self._itself and any(_is_in(fault, first, last, each) for each in called):
                    near.append((bool(far), seconds, name))
                    break
        spent, names = 0.0, []
        for _, seconds, name in sorted(near):
            if not names or spent + seconds <= ENOUGH:
                spent += seconds
                names.append(name)
        return names

    def _forked(
        self, fault: Fault, items: Sequence[pytest.Item], last: pytest.Item, *, planted: bool = True
    ) -> str | None:
        """The test that notices a fault, "" where none does; None where it can't be planted. With nothing
        `planted`, the test that fails there anyhow."""
        if not items:
            return None
        reading, writing = os.pipe()
        child = os.fork()
        if not child:
            os.close(reading)
            told = "a crash"
            try:
                told = self._child(fault, items, last, writing, planted)
            finally:
                os.write(writing, f"{_NEXT}{told}".encode())
                os._exit(0)
        os.close(writing)
        with os.fdopen(reading, "rb") as pipe:
            found = pipe.read().decode()
        status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
        if status:
            return f"{_DEATH} {status} in {found.split(_NEXT)[-1]}"
        found = found.split(_NEXT)[-1]
        return None if found == "not planted" else found

    def _longest_wait(self, item: pytest.Item) -> int:
        """Seconds on the clock after which a test waits for ever. Fixtures that another test of its file had
        made may be made in it."""
        file = item.nodeid.split("::")[0]
        beside = max(waited for name, waited in self._waited.items() if name.split("::")[0] == file)
        return int(5.0 * self._waited[item.nodeid] + 2.0 * beside) + 30

    def _child(
        self, fault: Fault, items: Sequence[pytest.Item], last: pytest.Item, told: int, planted: bool
    ) -> str:
        longest = int(time.process_time() + 10.0 * sum(self._seconds[item.nodeid] for item in items)) + 60
        resource.setrlimit(resource.RLIMIT_CPU, (longest, longest))
        try:
            if planted and not plant(fault):
                return "not planted"
        except Exception as error:  # where a module stops with it before any test
            return f"{type(error).__name__} when it is planted"
        first, end = _function(fault)
        if any(_is_in(fault, first, end, each) for each in self._shared):
            for fixture in self._kept:
                fixture.cached_result = None
        for k, item in enumerate(items):
            self.failed = ""
            signal.alarm(self._longest_wait(item))
            os.write(told, f"{_NEXT}{item.nodeid}".encode())
            self._run(item, items[k + 1] if k + 1 < len(items) else last)
            if self.failed:
                return self.failed
        return ""


def _is_in(fault: Fault, first: int, last: int, called: tuple[str, int]) -> bool:
    return called[0] == str(ROOT / fault.file) and first <= called[1] <= last


def _function(fault: Fault) -> tuple[int, int]:
    """First and last line of the innermost function that a fault lies in; of its file, outside of all."""
    tree = ast.parse((ROOT / fault.file).read_text(encoding="utf-8"))
    around = [
        (min([node.lineno, *(each.lineno for each in node.decorator_list)]), node.end_lineno or 0)
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef) and node.lineno <= fault.line <= (node.end_lineno or 0)
    ]
    return max(around, default=(1, sys.maxsize))


def is_compiled(fault: Fault) -> bool:
    """Whether it lies in a compiled loop, or outside of all functions in a file of such, from where loops
    take it."""
    text = (ROOT / fault.file).read_text(encoding="utf-8")
    if _LOOP not in text:
        return False
    around = [
        node
        for node in ast.walk(ast.parse(text))
        if isinstance(node, ast.FunctionDef) and node.lineno <= fault.line <= (node.end_lineno or 0)
    ]
    loops = [each for node in around for each in node.decorator_list if _LOOP[1:] in ast.unparse(each)]
    return not around or bool(loops)


def in_one_process(faults: Sequence[Fault], tests: Sequence[str], told: TextIO) -> Planter:
    """What the tests notice of faults in functions."""
    os.environ["NUMBA_THREADING_LAYER"] = "workqueue"  # GNU's OpenMP ends a forked process at its first loop
    # MKL waits in a forked process for ever for threads that weren't forked with it
    os.environ |= {"OMP_NUM_THREADS": "1", "SHELLFORM_SOLVER": "cholmod"}
    planter = Planter(faults, told)
    files = tests or sorted({file for fault in faults for file in likeliest(fault)})
    os.chdir(ROOT)
    words = ["-q", "--no-header", "--tb=no", "-p", "no:cacheprovider", "-p", "no:xdist"]
    status = pytest.main([*words, *files], plugins=[planter])
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(f"the tests can't be run: {pytest.ExitCode(status).name}")
    return planter


def caught_by(fault: Fault, copy: Path, files: Sequence[str], left_out: Sequence[str] = ()) -> str:
    """The test in the `files`, without those `left_out`, that notices a fault; "" where none does."""
    file = copy / fault.file
    whole, then = file.read_bytes(), file.stat()
    file.write_bytes(with_fault(fault, whole))
    own = tempfile.mkdtemp(prefix="mutant-") if _LOOP.encode() in whole else None
    try:
        return failed(copy, files, own, left_out)
    finally:
        file.write_bytes(whole)
        os.utime(file, ns=(then.st_atime_ns, then.st_mtime_ns))  # by which Numba knows what it has compiled
        if own is not None:
            shutil.rmtree(own)


def failed(copy: Path, files: Sequence[str], cache: str | None = None, left_out: Sequence[str] = ()) -> str:
    """The first test in the `files` that fails, but for those `left_out`, with compiled loops in a `cache`
    where given, else beside the copy's modules."""
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
    """The test that notices a fault and passes without it; "" where there is none. `sound` remembers which
    pass."""
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


def tell(fault: Fault, told: str, output: TextIO) -> None:
    """What became of a fault."""
    kept = "caught  " if told else "SURVIVES"
    print(f"{kept} {fault.file}:{fault.line}  {fault.before}  ->  {fault.after}", file=output, flush=True)


def in_copies(faults: Sequence[Fault]) -> Iterator[tuple[Fault, str]]:
    """What the tests notice of faults that have to be planted in files."""
    with tempfile.TemporaryDirectory(prefix="mutants-") as place:
        for name in _COPIED:
            source = ROOT / name
            (shutil.copytree if source.is_dir() else shutil.copy2)(source, Path(place) / name)
        sound: dict[str, bool] = {}
        for fault in faults:
            yield fault, noticed(fault, Path(place), sound)


def main() -> int:
    """Plants, runs, tells."""
    asked = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    asked.add_argument("--count", type=int, default=200)
    asked.add_argument("--seed", type=int, default=1)
    asked.add_argument("--rooms", nargs="*", default=[])
    asked.add_argument("--output", type=Path)
    asked.add_argument("--quick", action="store_true", help="only what is planted in functions")
    asked.add_argument(
        "--tests", nargs="*", default=[], help="test files that are run instead of the likeliest"
    )
    given = asked.parse_args()
    taken = sample(given.count, given.seed, given.rooms)
    output = os.fdopen(os.dup(1), "w")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what pytest tells of every child
    planter = in_one_process([fault for fault in taken if not is_compiled(fault)], given.tests, output)
    rows = dict(planter.rows)
    rest = [] if given.quick else [fault for fault in taken if fault not in rows]
    for fault, told in in_copies(rest) if rest else ():
        rows[fault] = told
        tell(fault, told, output)
    if given.output:
        told_of = [{**asdict(fault), "caught_by": told} for fault, told in rows.items()]
        given.output.write_text(json.dumps(told_of, indent=1), encoding="utf-8")
    by_room = Counter((fault.room, bool(told)) for fault, told in rows.items())
    for room in sorted({room for room, _ in by_room}):
        both = by_room[room, True] + by_room[room, False]
        print(f"{room:14} {by_room[room, True]:4d} of {both}", file=output)
    share = sum(map(bool, rows.values())) / max(1, len(rows))
    left = "" if len(rows) == len(taken) else f"; {len(taken) - len(rows)} were not planted"
    print(f"{100.0 * share:.0f} % of {len(rows)} faults are caught{left}", file=output, flush=True)
    return 0 if share >= CAUGHT else 1


if __name__ == "__main__":
    sys.exit(main())
