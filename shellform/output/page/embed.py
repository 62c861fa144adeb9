"""Pictures as text inside the page.

PNG pictures become WebP, which takes a tenth of the bytes at a quality that shows no difference on screen,
and those wider than a page are made smaller. Films and drawings go in as they are. What would make the page
too large is left out and named.
"""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from shellform.output.pictures.images import web_picture
from shellform.structure.elements.threads import side_by_side

_WIDEST = 1600  # pixels
_QUALITY = 82  # of JPEG, of 100 at the most
_PLAIN = {".svg": "image/svg+xml", ".gif": "image/gif", ".mp4": "video/mp4", ".webm": "video/webm"}
KINDS = (".png", ".jpg", ".jpeg", ".webp", *_PLAIN)


@dataclass(frozen=True)
class Picture:
    """A picture's file name without ending, its `source` as data URI, its size in pixels (0 where not known),
    and if it is a `film`."""

    name: str
    source: str
    width: int
    height: int
    film: bool


def embed(files: Sequence[Path], *, budget: int) -> tuple[list[Picture], list[str]]:
    """The pictures that fit into `budget` bytes, in order, and a sentence for each that is left out: too
    large, or damaged. They are made smaller side by side.
    """
    found, left = [], []
    for file, content in zip(files, side_by_side(_content, files), strict=True):
        if isinstance(content, Exception):
            left.append(f"The picture {file.name} can't be read: {content}")
            continue
        kind, data, (width, height) = content
        if len(data) > budget:
            left.append(f"The picture {file.name} is left out: the page would grow too large.")
            continue
        budget -= len(data)
        source = f"data:{kind};base64,{base64.b64encode(data).decode()}"
        found.append(Picture(file.stem, source, width, height, kind.startswith("video/")))
    return found, left


def _content(file: Path) -> tuple[str, bytes, tuple[int, int]] | Exception:
    """As `_read`, or why it can't be read."""
    try:
        return _read(file)
    except (OSError, ValueError) as error:
        return error


def _read(file: Path) -> tuple[str, bytes, tuple[int, int]]:
    ending = file.suffix.lower()
    if ending in _PLAIN:
        return _PLAIN[ending], file.read_bytes(), (0, 0)
    data, size = web_picture(file, widest=_WIDEST, quality=_QUALITY)
    return "image/webp", data, size
