"""Files written whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from shellform.errors import InputError


@contextmanager
def whole(path: str | Path, ending: str = "") -> Iterator[Path]:
    """A path beside `path`, with the same ending, to write to; it takes the place of `path` once everything is written.

    Makes the folder. Raises InputError for another `ending` and where the file can't be written; what stood there before is left as it was.
    """
    target = Path(path)
    if ending and target.suffix.lower() != ending:
        raise InputError("has another ending", where=str(target), value=target.suffix, remedy=f"Use {ending}.")
    partial = target.with_name(f"{target.stem}.part{target.suffix}")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        os.replace(partial, target)
    except OSError as error:
        raise InputError(f"can't be written: {error}", where=str(target), remedy="Choose another folder.") from error
    finally:
        if partial.is_file():
            partial.unlink()
