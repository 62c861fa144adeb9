"""Whether a limit on memory (ulimit -v) leaves room for a library's parts: where they find none, libraries of
compiled code end the program, with a word of their own or with a segmentation fault, or try for ever.
"""

from __future__ import annotations

import mmap

_WORK_AREA = 40_000_000  # bytes; OpenBLAS takes 33.6e6


def has_room(size: int) -> bool:
    """Whether so many bytes of addresses are free; none are taken. True where the system has no such
    limit."""
    if not hasattr(mmap, "MAP_PRIVATE"):  # Windows
        return True
    try:
        mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS).close()
    except OSError:
        return False
    return True


def take_work_areas() -> None:
    """Has NumPy's and SciPy's OpenBLAS take their work areas, which they keep. Each takes its own at its
    first call, and where it is refused it tries again for ever. Raises MemoryError where there is no room for
    them.
    """
    import numpy as np
    from scipy.linalg.blas import dgemm

    large = np.eye(200)  # small products are done without
    for product in (lambda: large @ large, lambda: dgemm(1.0, large, large)):
        if not has_room(_WORK_AREA):
            raise MemoryError("a limit on memory leaves no room for BLAS")
        product()
