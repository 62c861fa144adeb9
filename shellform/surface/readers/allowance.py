"""What memory and processor time a reader's process may take: as much as files of its size do, and then as
the mesh does that is made of its surfaces. A damaged file may ask for all there is, and never come to an end.

Measured: OpenCASCADE takes 0.5 s of a processor and 0.1 GB for a dome of 10 kB, and its mesh 45 µs and 0.9 kB
a triangle.
"""

from __future__ import annotations

import math
from pathlib import Path

try:
    import resource
except ImportError:  # not on Windows, where the clock alone ends a reader
    resource = None  # type: ignore[assignment]

_MEMORY = 1.5e9  # bytes, of any file: libraries and threads' stacks too
_MEMORY_A_BYTE = 30.0  # of the file
_MEMORY_A_TRIANGLE = 2000.0  # bytes
_SECONDS = 30.0  # of a processor, for any file: sound ones take a few, on slow machines a few times that
_SECONDS_A_BYTE = 3e-5  # of the file
_SECONDS_A_TRIANGLE = 5e-4  # … more, once it is known how many there are


def allow_file(file: Path) -> None:
    """Limits this process to what reading a file of its size takes. More memory is refused to it, and beyond
    the time the system ends it by SIGXCPU."""
    if resource is None:
        return
    size = file.stat().st_size
    _set(resource.RLIMIT_DATA, _MEMORY + _MEMORY_A_BYTE * size)
    _set(resource.RLIMIT_CPU, _SECONDS + _SECONDS_A_BYTE * size)


def allow_mesh(triangles: float) -> None:
    """Raises the limits of `allow_file` by what a mesh of about so many triangles takes."""
    if resource is None:
        return
    _set(resource.RLIMIT_DATA, resource.getrlimit(resource.RLIMIT_DATA)[0] + _MEMORY_A_TRIANGLE * triangles)
    _set(resource.RLIMIT_CPU, resource.getrlimit(resource.RLIMIT_CPU)[0] + _SECONDS_A_TRIANGLE * triangles)


def _set(kind: int, most: float) -> None:
    hard = resource.getrlimit(kind)[1]
    wanted = math.ceil(most)
    resource.setrlimit(kind, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard))
