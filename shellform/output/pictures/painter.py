"""Pages as pixels: shaded by VTK where it is installed, else as the lines of the vector pictures.

VTK takes 600 MB and a driver for OpenGL, and the drawings say the same without it; so it is an optional
dependency, shellform[pictures]. Where it is installed and can't draw, that is an error, as it is asked for.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from shellform.output.pictures.sheets import Canvas

AS_LINES = 'PNG pictures are drawn as lines; for shaded ones: pip install "shellform[pictures]"'


def shades() -> bool:
    """Whether the libraries that draw shaded pictures are installed."""
    return all(find_spec(name) is not None for name in ("pyvista", "vtkmodules"))


def require() -> None:
    """Raises InputError, naming the packages to install, where VTK is installed and can't draw."""
    if shades():
        from shellform.output.pictures import scene

        scene.require()


def paint(pages: Iterable[Canvas]) -> Iterator[NDArray[np.uint8]]:
    """The pages as arrays (height, width, 3), or 4 without a background. Raises InputError as `require`
    does.
    """
    if shades():
        from shellform.output.pictures import scene

        yield from scene.paint(pages)
        return
    from shellform.output.pictures import vectors

    for page in pages:
        yield vectors.rasterised(page)
