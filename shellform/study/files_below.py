"""The files that a study file names: beside it, or below."""

from __future__ import annotations

from pathlib import Path

from shellform.errors import InputError


def inside(file: Path, name: str, where: str) -> Path:
    """The place that a path in the study file means. Raises InputError where it leads out of its folder."""
    root = file.parent.resolve()
    place = (root / name).resolve()
    if root != place and root not in place.parents:
        raise InputError(
            "leads out of the study file's folder",
            where=f"{file}: {where}",
            value=name,
            remedy="Put the study file beside or above it.",
        )
    return place


def matching(file: Path, pattern: str, where: str) -> list[str]:
    """The files that a pattern in the study file means. Raises InputError where there are none, and where
    it leads out of its folder.
    """
    root = file.parent.resolve()
    if Path(pattern).is_absolute() or ".." in Path(pattern).parts or not pattern.strip():
        raise InputError(
            "leads out of the study file's folder",
            where=f"{file}: {where}",
            value=pattern,
            remedy="Put the study file beside or above them.",
        )
    try:
        found = sorted(str(inside(file, str(each), where)) for each in root.glob(pattern) if each.is_file())
    except (ValueError, NotImplementedError, OSError) as error:
        raise InputError(
            f"is no pattern: {error}",
            where=f"{file}: {where}",
            value=pattern,
            remedy="For example shells/*.obj.",
        ) from error
    if not found:
        raise InputError(
            "there is no such file",
            where=f"{file}: {where}",
            value=pattern,
            remedy="Name a file below the study file's folder.",
        )
    return found
