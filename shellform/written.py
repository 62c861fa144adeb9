"""Files appear whole or not at all: each is written beside its place and then moved there.

So an interrupted run leaves nothing half-written, and a full disc or a closed folder is told in one sentence.
Beside its place a file has a name of its own that can't be foreseen and nothing had before: two processes
never write to the same one, and no symbolic link in a folder that somebody else made leads a writer
elsewhere. A writer holds a lock on it, which ends with its process: what is left without one may be deleted.
What is no file, a device or a pipe, is never replaced by one. Where somebody named a link, it is followed.
"""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from shellform.errors import InputError

try:
    import fcntl
except ImportError:  # Windows
    fcntl = None  # type: ignore[assignment]

_REMEDIES = {
    errno.ENOSPC: "Free some space, then run the same command again: what was finished is kept.",
    errno.EDQUOT: "Free some space, then run the same command again: what was finished is kept.",
    errno.EFBIG: "Choose a file system that takes larger files, or raise the limit on their size.",
    errno.EEXIST: "A file stands there: name a folder.",
    errno.ENOTDIR: "A part of that path is a file: choose another folder.",
    errno.EACCES: "Choose a folder that you may write to.",
    errno.EPERM: "Choose a folder that you may write to.",
    errno.EROFS: "Choose a folder that you may write to.",
    errno.ELOOP: "Delete the symbolic link: links in a folder are not followed.",
    errno.ENOENT: "Was the folder deleted meanwhile? Run the same command again.",
    errno.EPIPE: "Whoever was reading it has ended: let it read to the end.",
    errno.ENXIO: "Give the name of a file.",
}
_PART = ".part-"
_STEM = 100  # characters of a file's name that its partial one has too


@contextlib.contextmanager
def whole(path: str | Path, ending: str = "") -> Iterator[Path]:
    """The place to write to; what is there at the end of the block becomes `path`. Makes the folder.

    A link there is replaced, not followed. Raises InputError for another `ending`, for a device or a pipe,
    and where the file can't be written; what stood there before is left as it was.
    """
    target = Path(path)
    if ending and target.suffix.lower() != ending:
        raise InputError(
            "has another ending", where=str(target), value=target.suffix, remedy=f"Use {ending}."
        )
    if not target.name:
        raise InputError("is a folder", where=str(target), remedy="Give the name of a file in it, too.")
    if _is_no_file(target):
        raise InputError(
            "is a device, a pipe or a socket, which no file takes the place of",
            where=str(target),
            remedy="Choose another name or folder.",
        )
    partial = _beside(target)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with _made(partial):
            yield partial
            os.replace(partial, target)
    except OSError as error:
        raise refusal(target, error) from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink(missing_ok=True)


def refuse_unwritable(path: str | Path) -> None:
    """Raises InputError where `write_named` could write no file, before what it is to hold is computed."""
    if _is_no_file(Path(path)) or _is_standard_output(Path(path)):
        return
    target = Path(os.path.realpath(path))
    if target.is_dir():
        raise InputError("is a folder, no file", where=str(path), remedy="Name a file in it.")
    there = next(each for each in target.parents if each.exists())  # writing makes the folders below it
    partial = there / _beside(target).name
    try:
        with _made(partial):
            partial.unlink()
    except OSError as error:
        raise refusal(target, error) from error


def _beside(target: Path) -> Path:
    return target.with_name(f"{target.stem[:_STEM]}{_PART}{secrets.token_hex(8)}{target.suffix}")


def _is_no_file(target: Path) -> bool:
    """Whether a device, a pipe or a socket stands there, or a link leads to one."""
    try:
        kind = target.stat().st_mode
    except OSError:  # nothing is there, or what writing will tell
        return False
    return not (stat.S_ISREG(kind) or stat.S_ISDIR(kind))


def refuse_overwriting(files: Iterable[Path], read: Iterable[Path | None]) -> None:
    """Raises InputError where one of the `files` that are to be written is one that is `read`, by whatever
    name."""
    known = [each for each in read if each is not None and each.exists()]
    for file in files:
        if file.exists() and any(map(file.samefile, known)):
            raise InputError(
                "is read and would be overwritten",
                where=str(file),
                remedy="Give it another name, and name that, or choose another --output.",
            )


def is_partial(file: Path) -> bool:
    """Whether a file is one that `whole` is writing, or was when its process was killed."""
    return _PART in file.name


def clear(place: Path) -> None:
    """Deletes what writers that were killed left in a folder; what somebody is still writing stays."""
    for file in place.glob(f"*{_PART}*"):
        with contextlib.suppress(OSError):
            _clear_one(file)


@contextlib.contextmanager
def _made(partial: Path) -> Iterator[None]:
    """Makes a file that nobody had, and holds a lock on it."""
    while True:
        opened = os.open(partial, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666)  # follows no link
        if fcntl is None:  # Windows can't move a file that is open
            os.close(opened)
            yield
            return
        with contextlib.suppress(OSError):  # a file system without locks
            fcntl.flock(opened, fcntl.LOCK_EX)
        if partial.exists():  # not cleared away before it was held
            break
        os.close(opened)
    try:
        yield
    finally:
        os.close(opened)


def _clear_one(file: Path) -> None:
    if fcntl is None:
        file.unlink()
        return
    opened = os.open(file, os.O_RDONLY | os.O_NOFOLLOW)
    try:
        fcntl.flock(opened, fcntl.LOCK_EX | fcntl.LOCK_NB)
        file.unlink()
    finally:
        os.close(opened)


def write_text(path: str | Path, text: str, ending: str = "") -> None:
    """Writes a text file in UTF-8. Raises InputError as `whole`, and where it names what isn't UTF-8."""
    content = encoded(text, str(path))
    with whole(path, ending) as partial:
        partial.write_bytes(content)


def write_named(path: str | Path, text: str) -> None:
    """As `write_text`, to a place that somebody named: a link is followed; a device or a pipe, which no file
    may take the place of, and what standard output goes to, as /dev/stdout, is written into."""
    target = Path(path)
    if not _is_no_file(target) and not _is_standard_output(target):
        write_text(os.path.realpath(target), text)
        return
    content = encoded(text, str(target))
    try:
        with target.open("ab") as opened:  # after what stands there already, as where it is left out
            opened.write(content)
    except OSError as error:
        raise refusal(target, error) from error


def _is_standard_output(target: Path) -> bool:
    try:
        return os.path.samestat(target.stat(), os.fstat(1))
    except OSError:  # it isn't there, or there is no standard output
        return False


def encoded(text: str, where: str) -> bytes:
    """Text in UTF-8. The bytes of a path or an option that Python couldn't read, for it was told that the
    system knows fewer letters, come out as they were given. Raises InputError where they are no UTF-8.
    """
    try:
        content = text.encode("utf-8", errors="surrogateescape")
        content.decode("utf-8")
    except UnicodeError as error:
        strange = next(
            part for part in text.split() if any("\ud800" <= letter <= "\udfff" for letter in part)
        )
        raise InputError(
            "has letters that are no UTF-8",
            where=where,
            value=strange[:80].encode("ascii", errors="backslashreplace").decode(),
            remedy="Rename the file or folder, or give the option in UTF-8.",
        ) from error
    return content


def write_arrays(path: str | Path, **arrays: Any) -> None:
    """Writes arrays by name into an .npz file, for `arrays.read_arrays`. Raises InputError as `whole`."""
    with whole(path, ".npz") as partial:
        np.savez_compressed(partial, **arrays)


def refusal(path: Path, error: OSError) -> InputError:
    """What to say where a file or folder can't be written."""
    remedy = _REMEDIES.get(error.errno or 0, "")
    return InputError(f"can't be written: {error.strerror or error}", where=str(path), remedy=remedy)


def make_folder(path: str | Path) -> Path:
    """Makes a folder and those above it. Raises InputError where that can't be done, and where its name is no
    UTF-8, so that no page could name it."""
    place = Path(path)
    encoded(str(place), "the folder")
    try:
        place.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise refusal(place, error) from error
    return place


def path_to_write(path: str | Path, *endings: str) -> Path:
    """The path of a file to write. Raises InputError for other endings and missing folders."""
    target = Path(path)
    if target.suffix.lower() not in endings:
        raise InputError(
            "has another ending", where=str(target), value=target.suffix, remedy=f"Use {', '.join(endings)}."
        )
    if not target.parent.is_dir():
        raise InputError("the folder doesn't exist", where=str(target.parent), remedy="Make it first.")
    return target
