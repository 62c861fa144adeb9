"""Pictures as files (PNG) and films (GIF, MP4); the door to Pillow and to the ffmpeg that imageio-ffmpeg brings."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from shellform.errors import InputError
from shellform.written import door, whole

FILMS = (".gif", ".mp4")
_HOLD = 1.5  # s that the last frame stays


def write_png(path: str | Path, picture: NDArray[np.uint8]) -> None:
    """Writes a picture (height, width, 3 or 4). Raises InputError for another ending and where the file can't be written."""
    with whole(door(path, ".png")) as partial:
        partial.write_bytes(png_bytes(picture))


def png_bytes(picture: NDArray[np.uint8]) -> bytes:
    """A picture (height, width, 3 or 4) as the content of a PNG file."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, format="png", compress_level=4)
    return content.getvalue()


def write_film(path: str | Path, frames: Sequence[NDArray[np.uint8]], *, rate: int = 12) -> None:
    """Writes frames (height, width, 3), all of one size, `rate` a second; the ending of `path` chooses the format.

    Raises InputError for other endings, for no frames, and where the file can't be written.
    """
    target = door(path, *FILMS)
    if not frames:
        raise InputError("has no frames", where=str(target))
    still = [*frames, *[frames[-1]] * round(_HOLD * rate)]
    with whole(target) as partial:
        (_write_gif if target.suffix.lower() == ".gif" else _write_mp4)(partial, still, rate)


def _write_gif(path: Path, frames: Sequence[NDArray[np.uint8]], rate: int) -> None:
    """With one palette for all frames, of the colours that the first, the middle and the last have, so that no scale changes on the way."""
    from PIL import Image

    sample = Image.fromarray(np.vstack([frames[0], frames[len(frames) // 2], frames[-1]]))
    palette = sample.quantize(256, method=Image.Quantize.MAXCOVERAGE)
    pages = [Image.fromarray(frame).quantize(palette=palette, dither=Image.Dither.NONE) for frame in frames]
    pages[0].save(path, format="gif", save_all=True, append_images=pages[1:], duration=round(1000 / rate), loop=0)


def _write_mp4(path: Path, frames: Sequence[NDArray[np.uint8]], rate: int) -> None:
    import imageio_ffmpeg

    height, width = (2 * (each // 2) for each in frames[0].shape[:2])  # the codec wants even numbers
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=rate, codec="libx264", quality=None, pix_fmt_out="yuv420p", macro_block_size=2,
        output_params=["-crf", "20", "-preset", "medium", "-movflags", "+faststart", "-threads", "2"],
    )  # fmt: skip
    writer.send(None)
    for frame in frames:
        writer.send(np.ascontiguousarray(frame[:height, :width]))
    writer.close()
    if not path.is_file() or not path.stat().st_size:  # ffmpeg tells of a full disc on its own standard error only
        raise OSError(0, "ffmpeg left no file")
