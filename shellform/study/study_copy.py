"""The copy of the study's file in its folder, and what tells it from one that somebody wrote."""

from __future__ import annotations

from pathlib import Path

from shellform.errors import InputError
from shellform.written import write_text

COPY = "study.toml"
_HEAD = "# Copied by shellform study from "


def keep_copy(place: Path, file: Path) -> None:
    """Copies the study's file into its folder, unless it stands there."""
    if not _is_there(place, file):
        write_text(place / COPY, f"{_HEAD}{file.name}\n{file.read_text(encoding='utf-8')}")


def refuse_not_copied(place: Path, file: Path) -> None:
    """Raises InputError for a file in place of the copy that isn't one and says something else."""
    copy = place / COPY
    if not copy.is_file() or _is_there(place, file):
        return
    text = copy.read_text(encoding="utf-8", errors="replace")
    if not text.startswith(_HEAD) and text != file.read_text(encoding="utf-8"):
        raise InputError(
            "is no copy of a study, and this one's would overwrite it",
            where=str(copy),
            remedy="Choose another --output, or move it away; delete it where an older shellform left it.",
        )


def _is_there(place: Path, file: Path) -> bool:
    """Whether the study's file stands where its copy would."""
    return (place / COPY).exists() and (place / COPY).samefile(file)
