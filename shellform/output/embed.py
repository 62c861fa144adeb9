"""Pictures as text inside the page.

PNG pictures become WebP, which takes a tenth of the bytes at a quality that shows no difference on screen, and those wider
than a page are made smaller. Films and drawings go in as they are. What would make the page too large is left out and named.
"""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from PIL import Image, UnidentifiedImageError

_WIDEST = 1600  # pixels
_QUALITY = 82
_PLAIN = {".svg": "image/svg+xml", ".gif": "image/gif", ".mp4": "video/mp4", ".webm": "video/webm"}
KINDS = (".png", ".jpg", ".jpeg", ".webp", *_PLAIN)


@dataclass(frozen=True)
class Picture:
    """A picture's file name without ending, its `source` as data URI, its size in pixels (0 where not known), and if it is a
    `film`."""

    name: str
    source: str
    width: int
    height: int
    film: bool = False


def embed(files: Sequence[Path], *, budget: int) -> tuple[list[Picture], list[str]]:
    """The pictures that fit into `budget` bytes, in order, and a sentence for each that is left out: too large, or damaged."""
    found, left = [], []
    for file in files:
        try:
            kind, data, (width, height) = _read(file)
        except (OSError, UnidentifiedImageError, ValueError, Image.DecompressionBombError) as error:
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
    with Image.open(file) as picture:
        shown = picture.convert("RGBA" if picture.mode in ("RGBA", "LA", "P") else "RGB")
    if shown.width > _WIDEST:
        shown = shown.resize((_WIDEST, round(shown.height * _WIDEST / shown.width)), Image.Resampling.LANCZOS)
    text = io.BytesIO()
    shown.save(text, "WEBP", quality=_QUALITY, method=4)
    return "image/webp", text.getvalue(), shown.size
