"""Pictures as files (PNG), in pages (WebP) and films (GIF, MP4); the door to Pillow and to the ffmpeg that
imageio-ffmpeg brings.
"""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shellform.errors import InputError, not_installed
from shellform.output.pictures.legend import cable_colours, rod_colours
from shellform.written import path_to_write, whole

FILMS = (".gif", ".mp4")
_COMMON = 8  # of the commonest colours that are kept as they are
_PACKED = np.array([65536, 256, 1])  # a colour as one number
_HOLD = 1.5  # s that the last frame stays


def write_png(path: str | Path, picture: NDArray[np.uint8], *, dots: float) -> None:
    """Writes a picture (height, width, 3 or 4), `dots` pixels an inch. Raises InputError for another ending
    and where the file can't be written.
    """
    with whole(path_to_write(path, ".png")) as partial:
        partial.write_bytes(png_bytes(picture, dots=dots))


def png_bytes(picture: NDArray[np.uint8], *, dots: float = 160.0) -> bytes:
    """A picture (height, width, 3 or 4) as the content of a PNG file."""
    from PIL import Image

    content = io.BytesIO()
    Image.fromarray(picture).save(content, format="png", compress_level=4, dpi=(dots, dots))
    return content.getvalue()


def web_picture(file: Path, *, widest: int, quality: int) -> tuple[bytes, tuple[int, int]]:
    """A picture's file as WebP of a `quality` up to 100, made smaller where it has more than `widest` pixels
    across, and its size in pixels. Raises OSError or ValueError where the file is damaged, no picture, or one
    of absurdly many pixels."""
    from PIL import Image

    try:
        with Image.open(file) as picture:
            shown = picture.convert("RGBA" if picture.mode in ("RGBA", "LA", "P") else "RGB")
    except (Image.DecompressionBombError, SyntaxError) as error:  # the latter for broken chunks of a PNG
        raise ValueError(str(error)) from error
    if shown.width > widest:
        shown = shown.resize((widest, round(shown.height * widest / shown.width)), Image.Resampling.LANCZOS)
    content = io.BytesIO()
    shown.save(content, "WEBP", quality=quality, method=2)  # beyond 2, twice the time for 2 % fewer bytes
    return content.getvalue(), shown.size


def write_film(path: str | Path, frames: Sequence[NDArray[np.uint8]], *, rate: int = 12) -> None:
    """Writes frames (height, width, 3), all of one size, `rate` a second; the ending of `path` chooses the
    format.

    Raises InputError for other endings, for no frames, and where the file can't be written.
    """
    target = path_to_write(path, *FILMS)
    if not frames:
        raise InputError("has no frames", where=str(target), remedy="Draw one picture at least.")
    still = [*frames, *[frames[-1]] * round(_HOLD * rate)]
    with whole(target) as partial:
        (_write_gif if target.suffix.lower() == ".gif" else _write_mp4)(partial, still, rate)


def require(endings: Sequence[str]) -> None:
    """Raises InputError where a film with one of these endings can't be written for want of a library."""
    if ".mp4" in endings:
        _ffmpeg()


def few_colours(pictures: Sequence[NDArray[np.uint8]], count: int = 256) -> list[Any]:
    """The pictures (height, width, 3) as Pillow's palette images of at most `count` colours (128 or more),
    all with one palette, so that no scale changes on the way.

    The key's colours are in it, and the commonest, such as white. The others are cut from the shades that
    occur, each as heavy as the logarithm of how often it does: else the surface's greys would take the
    palette.
    """
    from PIL import Image

    sample = np.concatenate(
        [picture.reshape(-1, 3) for picture in (pictures[0], pictures[len(pictures) // 2], pictures[-1])]
    )
    common, often = np.unique(sample @ _PACKED, return_counts=True)
    fixed = np.vstack(
        [
            _unpacked(common[np.argsort(-often)[:_COMMON]]),
            rod_colours(np.linspace(0, 1, 48)),
            cable_colours(np.linspace(0, 1, 24)),
        ]
    )
    shades, often = np.unique((sample >> 3) @ _PACKED, return_counts=True)
    heavy = np.repeat(_unpacked(shades) * 8 + 4, np.ceil(np.log2(often + 1)).astype(int), axis=0).astype(
        np.uint8
    )
    cut = (
        Image.fromarray(heavy[None])
        .quantize(count - len(fixed), method=Image.Quantize.MEDIANCUT, kmeans=3)
        .getpalette()
        or []
    )
    palette = Image.new("P", (1, 1))
    palette.putpalette([*fixed.ravel().tolist(), *cut[: 3 * (count - len(fixed))]])
    return [
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    ]


def _unpacked(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.column_stack([numbers >> 16, (numbers >> 8) & 255, numbers & 255])


def _write_gif(path: Path, frames: Sequence[NDArray[np.uint8]], rate: int) -> None:
    pages = few_colours(frames)
    pages[0].save(
        path, format="gif", save_all=True, append_images=pages[1:], duration=round(1000 / rate), loop=0
    )


def _write_mp4(path: Path, frames: Sequence[NDArray[np.uint8]], rate: int) -> None:
    imageio_ffmpeg = _ffmpeg()
    height, width = (2 * (each // 2) for each in frames[0].shape[:2])  # the codec wants even numbers
    writer = imageio_ffmpeg.write_frames(
        str(path), (width, height), fps=rate, codec="libx264", quality=None, pix_fmt_out="yuv420p",
        macro_block_size=2,
        output_params=["-crf", "20", "-preset", "medium", "-movflags", "+faststart", "-threads", "2"],
    )  # fmt: skip
    writer.send(None)
    for frame in frames:
        writer.send(np.ascontiguousarray(frame[:height, :width]))
    writer.close()
    # ffmpeg tells of a full disc on its own standard error only.
    if not path.is_file() or not path.stat().st_size:
        raise OSError(0, "ffmpeg left no file")


def _ffmpeg() -> Any:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise not_installed("films as MP4 (GIF needs nothing more)", "film", error) from error
    return imageio_ffmpeg
