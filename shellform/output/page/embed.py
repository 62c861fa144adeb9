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

_WIDEST = 1600  # pixels
_QUALITY = 82
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
    film: bool = False


def embed(files: Sequence[Path], *, budget: int) -> tuple[list[Picture], list[str]]:
    """The pictures that fit into `budget` bytes, in order, and a sentence for each that is left out: too
    large, or damaged.
    """
    found, left = [], []
    for file in files:
        try:
            kind, data, (width, height) = _read(file)
        except (OSError, ValueError) as error:
            left.append(f"The picture {file.name} can't be read: {error}")
            continue
        if len(data) > budget:
            left.append(f"The picture {file.name} is left out: the page would grow too large.")
            continue
        budget -= len(data)
        source = f"data:{kind};base64,{base64.b64encode(data).decode()}"
        found.append(Picture(file.stem, source, width, height, kind.startswith("video/")))
    return found, left


def _read(file: Path) -> tuple[str, bytes, tuple[int, int]]:
    ending = file.suffix.lower()
    if ending in _PLAIN:
        return _PLAIN[ending], file.read_bytes(), (0, 0)
    data, size = web_picture(file, widest=_WIDEST, quality=_QUALITY)
    return "image/webp", data, size
