"""`design --watch`: a command done again whenever one of its files changes, until Ctrl-C.

Files are looked at twice a second, by size and time, and taken up once they are as they were half a second
before: whoever saves may still be writing. A run under way ends at its next event when a file changes; what
it has computed is kept, as after Ctrl-C.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NoReturn

from shellform.cli.terminal import refusal_words
from shellform.errors import InputError
from shellform.records.progress import Event, Report

_EVERY = 0.5  # s

Stamps = Mapping[Path, tuple[int, int] | None]


class _Overtaken(BaseException):
    """A file has changed under a run. No stage may take it for an error of its own."""


def watched(
    files: Callable[[], Sequence[Path]], once: Callable[[Callable[[Report], Report]], object]
) -> NoReturn:
    """Does `once` and again whenever one of the `files` (asked for anew each time) changes.

    `once` gets what makes of its report one that ends the run where it is overtaken. What it refuses or finds
    no result for is told on standard error and waited out; any other error is raised.
    """
    while True:
        before = _stamps(files())
        try:
            once(partial(_ending, before))
        except _Overtaken:
            pass
        except Exception as error:
            if _stamps(list(before)) == before:  # else it is the end of an overtaken run
                said = refusal_words(error)
                if said is None:
                    raise
                print(f"shellform: {said[0]}", file=sys.stderr)
        if _stamps(list(before)) == before:
            names = " or ".join(each.name for each in before)
            print(f"shellform: waiting for a change of {names}; Ctrl-C ends", file=sys.stderr, flush=True)
        _wait(before)


def case_files(case: Path, settings: Sequence[str]) -> list[Path]:
    """The case's file and, where the case can be read, those of its surface and of its own catalogues; where
    it can't be, what it names as one."""
    from shellform.case.build_gridshell import own_catalogues
    from shellform.case.case import load_case
    from shellform.surface.readers.gltf import surface_files

    try:
        read = load_case(case, settings)
        return [case, *surface_files(Path(read.surface.file)), *dict.fromkeys(own_catalogues(read).values())]
    except InputError:  # which `once` tells
        return [case, *_catalogues_named(case)]


def _catalogues_named(case: Path) -> list[Path]:
    """The files that a case which is refused names as catalogues: what is wrong may stand in one of them."""
    from shellform.case.case import read_toml
    from shellform.gridshell.catalogue import shipped_catalogues

    try:
        data = read_toml(case)
    except InputError:
        return []
    edges = data.get("edges")
    tables = [data.get("optimise"), data.get("rod"), edges.get("beam") if isinstance(edges, dict) else None]
    named = [table["catalogue"] for table in tables if isinstance(table, dict) and "catalogue" in table]
    own = [each for each in named if isinstance(each, str) and each not in shipped_catalogues()]
    return [(case.parent / each).resolve() for each in dict.fromkeys(own) if "\0" not in each]


def _wait(seen: Stamps) -> None:
    """Until a file is another than was seen, and has come to rest."""
    now = _stamps(list(seen))
    while True:
        time.sleep(_EVERY)
        last, now = now, _stamps(list(seen))
        if now != seen and now == last:
            return


def _ending(before: Stamps, report: Report) -> Report:
    """A report that ends the run when a file is no longer as it was `before`."""

    def heard(event: Event) -> None:
        report(event)
        if _stamps(list(before)) != before:
            raise _Overtaken

    return heard


def _stamps(files: Sequence[Path]) -> Stamps:
    """Time and size of each; None for one that isn't there."""
    found: dict[Path, tuple[int, int] | None] = {}
    for file in files:
        try:
            status = file.stat()
        except OSError:  # while an editor puts a new one in its place
            found[file] = None
        else:
            found[file] = (status.st_mtime_ns, status.st_size)
    return found
