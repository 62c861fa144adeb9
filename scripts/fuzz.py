"""Thousands of damaged inputs for every reader: each is read or refused with a message, within 40 s of
a processor, and leaves no torn file.

    scripts/fuzz.py [--count 10000] [--seed 1] [--kind KIND …]

Good files of each kind are damaged at random: bits turned, pieces cut, doubled, moved and filled with junk,
numbers made huge, negative, not a number, values of JSON exchanged for others or for one another, keys
swapped and doubled, references led round in circles, text written as other systems do. A child process reads
them, so that a crash or a hang costs nobody anything but is counted. What fails is kept in a folder that is
named at the end.
"""

from __future__ import annotations

import argparse
import collections
import contextlib
import io
import json
import os
import random
import re
import select
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
if str(ROOT) not in sys.path:
    sys.path.insert(0, str(ROOT))
_LONGEST = (
    40.0  # seconds of a processor, which other work on the machine doesn't change; a reader may take 30
)
_PATIENCE = 30.0  # times as long on the clock
_LOOK = 0.2  # s between two looks
_GONE = 5.0  # s in which a process that says nothing more has ended
_MEMORY = 6 * 1024**3
_NUMBERS = [
    b"0",
    b"-1",
    b"nan",
    b"inf",
    b"-inf",
    b"1e308",
    b"-1e308",
    b"1e-308",
    b"9" * 5000,
    b"-0",
    b"true",
    b"99999999999999999999",
    b"0.5",
    b"2147483648",
    b"1e5",
    b"3",
    b"",
]
_VALUES = [
    None,
    True,
    -1,
    0,
    1e308,
    -1e308,
    float("nan"),
    float("inf"),
    10**400,
    "",
    "x",
    [],
    {},
    [[]],
    [None],
    {"a": 1},
    2**63,
    "9" * 5000,
]
_FOREIGN = {
    "step",
    "igs",
    "brep",
    "3dm",
    "ply",
    "msh",
    "vtk",
    "vtp",
    "vtu",
}  # read in a process of their own, a second each
_SHARES = {
    "case": 16,
    "study": 10,
    "model": 16,
    "obj": 7,
    "off": 6,
    "stl": 7,
    "gltf": 7,
    "glb": 6,
    "json": 7,
    "scan": 6,
}
_SHARES |= {"analyse": 10, "report": 1}  # whole commands, on what their readers let pass
_SHARES |= {
    "table": 10,
    "setting": 10,
    "words": 10,
    "check": 2,
    "net": 0.5,
}  # and what is given beside a file
_SHARES |= {"catalogue": 4, "sections": 3, "run": 4, "log": 4, "design": 1} | dict.fromkeys(
    sorted(_FOREIGN), 0.25
)


_TABLES = {
    "loads.csv": "node,fx,fy,fz\n3,0,0,-0.5\n7,0.1,0,-0.5\n11,0,0,-1e-1\n",
    "groups.csv": "cable,group\n0,1\n1,1\n2,2\n",
    "markers.csv": "crossing\n0\n3\n5\n8\n",
    "props.csv": "crossing\n1\n2\n4\n7\n",
    "way.csv": "stop,node,x,y,z\n1,0,0.1,0.2,0.0\n2,0,0.1,0.2,0.0\n",
    "survey.csv": "crossing,x,y,z\n0,0.1,0.2,0.1\n3,0.2,0.2,0.1\n5,0.3,0.2,0.1\n8,0.3,0.3,0.1\n",
}
# Command lines; one word, marked "?", is replaced by another.
_LINES = [
    *(["analyse", "MODEL", "--load", "tip", option, "?"] for option in (
        "--factor", "--increments", "--tolerance", "--lead", "--limit", "--modes", "--critical", "--sections",
        "--method", "--output",
    )),
    ["analyse", "MODEL", "--load", "?"],
    ["analyse", "?"],
    *(["survey", "RUN", "survey.csv", option, "?"] for option in (
        "--unit", "--noise", "--length-error", "--step", "--largest", "--cables", "--load", "--design", "--after",
    )),
    *(["survey", "RUN", "--replay", "1", option, "?"] for option in ("--seed", "--slip", "--markers", "--noise")),
    *(["erect", "RUN", option, "?"] for option in (
        "--step", "--load", "--weight", "--lift", "--design", "--way", "--by", "--props",
    )),
    *(["calibrate", "RUN", "survey.csv=none", option, "?"] for option in (
        "--unit", "--noise", "--free", "--design", "--markers", "--output",
    )),
    ["calibrate", "RUN", "survey.csv=?"],
    *(["render", "RUN", option, "?"] for option in ("--load", "--design", "--quantity", "--view", "--film")),
    *(["render", "RUN", "--load", "?", option, "?"] for option in ("--size", "--limit", "--dpi", "--format")),
    *(["check", "SURFACE", option, "?"] for option in ("--unit", "--size", "--up", "--layer", "--object", "--face")),
    *(["net", "SURFACE", "--output", "out", "--spacing", "?"] for _ in range(1)),
    *(["net", "SURFACE", "--output", "out", "--spacing", "0.3", option, "?"] for option in ("--angle", "--gap")),
    *(["new", "SURFACE", "--output", "new.toml", option, "?"] for option in ("--rod", "--edges", "--unit")),
    ["new", "?", "--output", "new.toml"],
    *(["design", "CASE", "--output", "out", "--until", "surface", "--set", entry + "=?"] for entry in (
        "title", "surface.size", "surface.file", "net.spacing", "net.offset", "rod.radius", "load.force", "part.x.kind",
    )),
    ["design", "CASE", "--output", "out", "--until", "?"],
    ["design", "CASE", "--until", "surface", "--output", "?"],
    ["study", "STUDY", "--output", "out", "--scheduler", "?"],
    ["study", "?", "--output", "out"],
    ["report", "RUN", "--output", "?"],
    ["report", "?"],
    ["example", "?"],
    ["?"],
]  # fmt: skip
_WORDS = [
    *(number.decode() for number in _NUMBERS),
    *("-", "--", "..", "/", "/none/x", ".", "ü\u202e𝄞", "\udcff", "a" * 5000, "0x10", "1_000", "١", "1,5", "1;2", "x=1", "="),
    *("[" * 3000, "none", "design", "best", "png", " ", "\n", "1e-300", "-3", "0.02", "17:z:-0.05", "1:x:nan", "9x9", "0x0"),
    *("[0.5, nan]", "{a = 1}", "{}", "[]", '"', "true", "1979-05-27", "-1e9x1e9", "case.toml", "../..", "survey.csv", "CON"),
]  # fmt: skip


def damaged(data: bytes, chance: random.Random, *, numbers: bool = False) -> bytes:
    """A file's bytes after one to four accidents, to its `numbers` alone where a command is to go on from
    them."""
    for _ in range(chance.choice([1, 1, 1, 2, 4])):
        data = (_number if numbers else chance.choice(_ACCIDENTS))(data, chance)
    return data


def _bits(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.choice([1, 3, 30])):
        if changed:
            changed[chance.randrange(len(changed))] ^= 1 << chance.randrange(8)
    return bytes(changed)


def _cut(data: bytes, chance: random.Random) -> bytes:
    a, b = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return data[:a] if chance.random() < 0.3 else data[:a] + data[b:]


def _double(data: bytes, chance: random.Random) -> bytes:
    a, b = sorted(chance.randrange(len(data) + 1) for _ in range(2))
    return data[:b] + data[a:b] * chance.choice([1, 1, 5]) + data[b:]


def _junk(data: bytes, chance: random.Random) -> bytes:
    at = chance.randrange(len(data) + 1)
    junk = chance.choice(
        [
            chance.randbytes(chance.randrange(1, 40)),
            b"\0" * 9,
            b"[" * 3000,
            b"{" * 90,
            b"\xff\xfe",
            "ü\u202e𝄞".encode(),
            b'"',
            b"\n",
        ]
    )
    return data[:at] + junk + data[at:]


def _number(data: bytes, chance: random.Random) -> bytes:
    found = list(re.finditer(rb"-?\d+(\.\d*)?([eE][-+]?\d+)?", data[:200_000]))
    if not found:
        return _bits(data, chance)
    one = chance.choice(found)
    other = chance.choice(_NUMBERS)
    if chance.random() < 0.5:  # one that may be meant
        other = (
            f"{float(one[0]) * chance.choice([-1, 1, 1]) * 10.0 ** chance.randrange(-12, 13):.6g}".encode()
        )
    return data[: one.start()] + other + data[one.end() :]


def _lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    a, b = chance.randrange(len(lines)), chance.randrange(len(lines))
    lines[a], lines[b] = lines[b], lines[a] if chance.random() < 0.5 else lines[b]
    if chance.random() < 0.3:
        del lines[a]
    return b"\n".join(lines)


def _value(data: bytes, chance: random.Random) -> bytes:
    """Another value somewhere in a JSON document; elsewhere another number."""
    try:
        tree = json.loads(data)
    except (ValueError, RecursionError):
        return _number(data, chance)
    places: list[tuple[object, object]] = []
    todo = [tree]
    while todo and len(places) < 20_000:
        each = todo.pop()
        for key in each if isinstance(each, dict) else range(len(each)) if isinstance(each, list) else []:
            places.append((each, key))
            todo.append(each[key])
    if not places:
        return data
    branch, key = chance.choice(places)
    what = chance.random()
    if what < 0.2:
        del branch[key]  # type: ignore[attr-defined]
    elif what < 0.4:  # what stands elsewhere in the document; a reference may come to lead back to itself
        other, place = chance.choice(places)
        branch[key], other[place] = other[place], branch[key]  # type: ignore[index]
    elif what < 0.5:
        branch[key] = chance.randrange(-1, 70)  # type: ignore[index]
    elif what < 0.6 and isinstance(branch[key], list):  # type: ignore[index]
        branch[key] = 2 * branch[key]  # type: ignore[index]
    else:
        branch[key] = chance.choice(_VALUES)  # type: ignore[index]
    try:
        return json.dumps(tree).encode()
    except (ValueError, RecursionError):  # a branch was put into itself
        return data


def _keys(data: bytes, chance: random.Random) -> bytes:
    """Two keys of a TOML or JSON document swapped, or one doubled or in another's place."""
    found = list(
        re.finditer(rb'(?m)^[ \t]*[\w.]+(?= *=)|"[^"\n]{1,40}"(?= *:)|^\[+[\w.]+\]+', data[:200_000])
    )
    if len(found) < 2:
        return _lines(data, chance)
    first, second = sorted(chance.sample(found, 2), key=lambda each: each.start())
    a, b = chance.choice(
        [(second[0], first[0]), (first[0], first[0]), (second[0], second[0]), (first[0], second[0] + b"x")]
    )
    return data[: first.start()] + a + data[first.end() : second.start()] + b + data[second.end() :]


def _written(data: bytes, chance: random.Random) -> bytes:
    """As other systems and editors write text."""
    how = chance.randrange(6)
    if how == 0:
        return b"\xef\xbb\xbf" + data
    if how == 1:
        return data.replace(b"\n", b"\r\n")
    if how == 2:
        return data.replace(b"\n", b"\r")
    if how == 3:
        return data.rstrip(b"\n")
    try:
        text = data.decode()
    except UnicodeDecodeError:
        return data.replace(b".", b",")
    return text.encode("utf-16") if how == 4 else text.replace(".", ",").encode()


_ACCIDENTS: list[Callable[[bytes, random.Random], bytes]] = [
    _bits,
    _cut,
    _double,
    _junk,
    _number,
    _number,
    _lines,
    _value,
    _value,
    _value,
    _keys,
    _keys,
    _written,
]


def sound(folder: Path) -> dict[str, list[Path]]:
    """Good files of each kind; made in `folder`."""
    import pyvista

    from shellform.case.case import load_case
    from shellform.run.run import run_case
    from shellform.study.outcome import Outcome, Status
    from shellform.study.store import Log
    from tests.cli.test_commands import MODEL
    from tests.stubs import study_file
    from tests.surface.shells import cap
    from tests.surface.test_bad_files import every_format

    folder.mkdir(parents=True, exist_ok=True)
    files: dict[str, list[Path]] = collections.defaultdict(list)
    for file in every_format(folder):
        files[{"iges": "igs", "brp": "brep"}.get(file.suffix[1:], file.suffix[1:])].append(file)
    points, _quads = cap()
    pyvista.PolyData(points).save(folder / "points.vtp")
    study = study_file(
        folder / "study",
        "[set]\noptimise.evaluations = 3\n[vary]\nnet.spacing = { low = 0.1, high = 0.12, count = 3 }\ncable.stiffness = [100, 187]\n"
        '[function]\njoint.gap = "net.spacing / 60"\n[column]\ncables = "designs.best.cables"\n[objective]\ncables = "min"\n',
    )
    files["study"] = [study]
    files["case"] = [
        study.with_name("dome.toml"),
        ROOT / "scripts/full_size_poured.toml",
        ROOT / "scripts/scale_model.toml",
    ]
    files["design"] = [study.with_name("dome.toml")]
    whole = {
        **MODEL,
        "cables": [{"nodes": [0, 2], "EA": 5.0, "rest_length": 1.9}],
        "springs": [],
        "start": {"positions": MODEL["nodes"], "quaternions": [[1, 0, 0, 0]] * 3},
    }
    for name, model in [
        ("model.json", MODEL),
        ("whole.json", {k: v for k, v in whole.items() if k != "springs"}),
    ]:
        (folder / name).write_text(json.dumps(model))
        files["model"].append(folder / name)
    files["analyse"] = files["model"]
    (folder / "scan.csv").write_text(
        "# x y z\n" + "\n".join(f"{k},{0.5 * k},{0.1 * k * k}" for k in range(30))
    )
    files["scan"] = [folder / "scan.csv"]
    for name, text in _TABLES.items():
        (folder / name).write_text(text)
    files["table"] = [folder / name for name in _TABLES]
    files["setting"] = files["words"] = files["design"]
    files["check"] = [*files["obj"], *files["gltf"], *files["json"], *files["design"]]
    files["net"] = [*files["obj"], *files["off"]]
    (folder / "sections.toml").write_text(
        '[rod]\nshape = "tube"\nradius = 0.02\nwall = 0.003\nyoung = 4e10\npoisson = 0.3\nstrength = 2e8\n'
    )
    files["sections"] = [folder / "sections.toml"]
    files["catalogue"] = sorted((ROOT / "shellform").rglob("gfrp_*.toml"))
    run = folder / "run"
    run_case(load_case(study.with_name("dome.toml")), run, until="initial")
    files["run"] = [
        file
        for file in run.rglob("*")
        if file.suffix in (".json", ".npz", ".toml") and "states" not in file.parts
    ]
    files["report"] = files["run"]
    with Log(folder / "results.jsonl") as log:
        log.add([Outcome(f"{k:032d}", Status.DONE, values={"x": k}) for k in range(20)])
    files["log"] = [folder / "results.jsonl"]
    return dict(files)


def attempt(kind: str, number: int, files: dict[str, list[Path]], place: Path) -> str:
    """Damages a file of a kind by the number and reads it; says "read", "refused", or what went wrong."""
    from shellform.errors import InputError, NotConverged

    chance = random.Random(f"{kind} {number}")
    good = chance.choice(files[kind])
    data = damaged(good.read_bytes(), chance, numbers=kind == "analyse" and number % 4 > 0)
    shutil.rmtree(place, ignore_errors=True)
    place.mkdir(parents=True)
    bad = place / good.name
    if kind in ("table", "words"):
        shutil.copytree(next(each for each in files["run"] if each.name == "case.toml").parent, place / "run")
        for name, text in _TABLES.items():
            (place / name).write_text(text)
    if kind in ("run", "report"):
        run = next(each for each in good.parents if (each / "case.toml").is_file())
        shutil.copytree(run, place / "run")
        bad = place / "run" / good.relative_to(run)
    elif kind in ("study", "design"):
        shutil.copy(files["design"][0], place)
    bad.write_bytes(good.read_bytes() if kind in ("setting", "words") else data)
    try:
        if kind == "words":
            _line(chance, files, place)
        elif kind == "setting":
            _setting(chance, bad)
        else:
            _read(kind, bad, place)
    except (InputError, NotConverged) as error:
        said = str(error)
        return (
            "refused"
            if said.strip() and "\n" not in said[:40] and "Traceback" not in said
            else f"BAD no message: {said!r}"
        )
    except RecursionError:
        return "BAD RecursionError"
    except Exception:  # what the readers must never raise
        return "BAD " + " | ".join(traceback.format_exc().strip().splitlines()[-5:])
    finally:
        torn = [file.name for file in place.rglob("*") if ".part" in file.name]
        if torn:
            print(f"torn {torn}", file=sys.stderr)
    return "read"


def _read(kind: str, bad: Path, place: Path) -> None:
    if kind == "case":
        from shellform.case.case import dump_case, load_case

        dump_case(load_case(bad))
    elif kind == "study":
        from shellform.study.plan import changes, read_study, resolved

        plan = read_study(bad)
        for own, _ in zip(changes(plan), range(5), strict=False):
            resolved(plan, own)
    elif kind == "analyse":
        way = ["--critical", "3"] if len(bad.read_bytes()) % 2 else ["--increments", "2"]
        _command("analyse", bad, "--load", "tip", *way, "--output", place / "found.json")
    elif kind == "report":
        _command("report", place / "run", "--output", place / "page.html")
    elif kind == "table":
        way = {
            "loads.csv": ["erect", place / "run", "--step", "1", "--load", bad],
            "groups.csv": ["erect", place / "run", "--step", "1", "--groups", bad],
            "way.csv": ["erect", place / "run", "--step", "1", "--way", bad],
            "props.csv": ["erect", place / "run", "--step", "1", "--props", bad],
            "markers.csv": ["survey", place / "run", "--replay", "1", "--markers", bad],
            "survey.csv": ["survey", place / "run", bad],
        }[bad.name]
        _command(*way, "--output", place / "out")
    elif kind == "check":
        _command("check", bad)
    elif kind == "net":
        _command("net", bad, "--spacing", "0.3", "--output", place / "out")
    elif kind == "model":
        from shellform.structure.model import read_model

        read_model(bad)
    elif kind == "scan":
        from shellform.site.scan_points import read_points

        read_points(bad)
    elif kind == "sections":
        from shellform.structure.answers.results import read_sections

        read_sections(bad)
    elif kind == "catalogue":
        from shellform.gridshell.catalogue import read_catalogue

        read_catalogue(bad)
    elif kind == "run":
        from shellform.run.folder import read_run

        read_run(place / "run")
    elif kind == "log":
        from shellform.study.store import Log

        with Log(bad) as log:
            for key in log:
                log.get(key)
    elif kind == "design":
        from shellform.case.case import load_case
        from shellform.run.run import run_case

        case = load_case(bad)
        if (
            case.net.spacing > 0.05 and (case.surface.size or 1.0) > 0.01 and case.net.elements < 9
        ):  # no larger jobs than the sound one
            run_case(case, place / "out", until="surface")
    else:
        from shellform.surface.readers.reading import read_surface

        read_surface(bad)


def _setting(chance: random.Random, case: Path) -> None:
    """An entry of a case, or one beside them, given another value by --set."""
    import tomllib

    from shellform.case.case import dump_case, load_case

    sound = load_case(case)
    tables = tomllib.loads(dump_case(sound))
    entries = [
        f"{table}.{name}" for table, entry in tables.items() if isinstance(entry, dict) for name in entry
    ]
    key = chance.choice(
        [*entries, *tables, "x", "net.x", "net.spacing.x", "load.0.force", "..", "part.a.kind", "title"]
    )
    dump_case(load_case(case, [f"{key}={chance.choice(_WORDS)}"]))


def _line(chance: random.Random, files: dict[str, list[Path]], place: Path) -> None:
    """A command line with one of its words replaced."""
    word = chance.choice(_WORDS)
    known = {
        "MODEL": files["model"][0],
        "RUN": place / "run",
        "SURFACE": files["obj"][0],
        "CASE": files["design"][0],
        "STUDY": files["study"][0],
    }
    line = chance.choice(_LINES)
    with contextlib.chdir(place):
        _command(*(known.get(each, each.replace("?", word)) for each in line))


def _command(*words: str | Path) -> None:
    """A command line in this process. Raises InputError where it ends with the status of bad input or of no
    result, and what it raises itself."""
    from shellform.cli import program
    from shellform.errors import InputError

    sys.argv, told = ["shellform", *map(str, words)], io.StringIO()
    status: object = 0
    with contextlib.redirect_stderr(told):
        try:
            program.main()
        except SystemExit as end:
            status = end.code
    if status in (2, 3):
        raise InputError(told.getvalue().rpartition("shellform: ")[2].strip())
    if status:
        raise RuntimeError(f"status {status}: {told.getvalue()[-300:]}")


def child(folder: Path) -> None:
    """Reads lines of kind and number, and answers each with a line."""
    import resource

    said = sys.stdout
    sys.stdout = io.StringIO()
    files = sound(folder / "sound")
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    print("ready", file=said, flush=True)
    for line in sys.stdin:
        kind, number = line.split()
        print(attempt(kind, int(number), files, folder / "try"), file=said, flush=True)


def fuzz(
    asks: list[tuple[str, int]], folder: Path, tell: Callable[[str], None] = lambda text: None
) -> tuple[dict[str, collections.Counter[str]], list[str]]:
    """Has all attempts made; returns counts of answers by kind, and what went wrong."""
    counts: dict[str, collections.Counter[str]] = collections.defaultdict(collections.Counter)
    wrong: list[str] = []
    process: subprocess.Popen[str] | None = None
    for done, (kind, number) in enumerate(asks):
        if process is None:
            command = [sys.executable, str(Path(__file__).resolve()), "--child", str(folder)]
            process = subprocess.Popen(
                command,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                cwd=ROOT,
            )
            if _answer(process, 300.0) != "ready":
                raise RuntimeError("the child didn't start")
        assert process.stdin is not None
        process.stdin.write(f"{kind} {number}\n")
        process.stdin.flush()
        told = _answer(process, _LONGEST * 1.5)
        if told is None:
            try:
                told = f"BAD crash, status {process.wait(_GONE)}"
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
                told = "BAD hang"
            process = None
        counts[kind][told.split()[0]] += 1
        if told.startswith("BAD"):
            wrong.append(f"{kind} {number}: {told}")
            tell(wrong[-1])
        if done % 500 == 499:
            tell(f"{done + 1} of {len(asks)}, {len(wrong)} wrong")
    if process is not None and process.stdin is not None:
        process.stdin.close()
        process.wait()
    return dict(counts), wrong


def _answer(process: subprocess.Popen[str], longest: float) -> str | None:
    """The next line of a process; None where it ends, or takes longer."""
    assert process.stdout is not None
    began, before = time.monotonic(), _spent(process.pid)
    while not select.select([process.stdout], [], [], _LOOK)[0]:
        if _spent(process.pid) - before > longest or time.monotonic() - began > _PATIENCE * longest:
            return None
    return process.stdout.readline().strip() or None


def _spent(process: int) -> float:
    """Processor time of a process and of those that it began, s; of none where it has ended."""
    try:
        words = Path(f"/proc/{process}/stat").read_text().rsplit(")", 1)[1].split()
        begun = [each.read_text().split() for each in Path(f"/proc/{process}/task").glob("*/children")]
    except OSError:
        return 0.0
    own = sum(int(word) for word in words[11:15]) / os.sysconf("SC_CLK_TCK")
    return own + sum(_spent(int(each)) for child in begun for each in child)


def asked(count: int, seed: int, kinds: list[str]) -> list[tuple[str, int]]:
    """What to try: kinds by their shares, in mixed order."""
    total = sum(_SHARES[kind] for kind in kinds)
    asks = [
        (kind, 1_000_000 * seed + k)
        for kind in kinds
        for k in range(max(1, round(count * _SHARES[kind] / total)))
    ]
    random.Random(seed).shuffle(asks)
    return asks


def main() -> int:
    """Status 0 where nothing went wrong."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--count", type=int, default=10_000)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", nargs="*", default=list(_SHARES), choices=list(_SHARES))
    parser.add_argument("--child", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child)
        return 0
    folder = Path(tempfile.mkdtemp(prefix="fuzz"))
    began = time.monotonic()
    counts, wrong = fuzz(
        asked(options.count, options.seed, options.kind), folder, lambda text: print(text, flush=True)
    )
    for kind, each in sorted(counts.items()):
        print(f"{kind:>10}  " + ", ".join(f"{count} {what}" for what, count in sorted(each.items())))
    total = sum(sum(each.values()) for each in counts.values())
    print(f"{total} inputs in {time.monotonic() - began:.0f} s: {len(wrong)} went wrong")
    shutil.rmtree(folder, ignore_errors=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
