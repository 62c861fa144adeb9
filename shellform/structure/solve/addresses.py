"""Whether a limit on memory (ulimit -v) leaves room for a library's parts: where they find none, libraries of
compiled code end the program, with a word of their own or with a segmentation fault.
"""

from __future__ import annotations

import mmap


def has_room(size: int) -> bool:
    """Whether so many bytes of addresses are free; none are taken. True where the system has no such limit."""
    if not hasattr(mmap, "MAP_PRIVATE"):  # Windows
        return True
    try:
        mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ).close()
    except OSError:
        return False
    return True
