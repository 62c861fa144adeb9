"""Running out of memory as an error that can be told, instead of being killed by the system.

Linux promises more memory than there is and kills a process that takes it at its word. Under a limit on its
data the process is refused the memory instead, and Python, NumPy and the solvers raise MemoryError. Libraries
that are just being loaded don't: refused a few kilobytes they crash or end in errors that tell nothing, so a
part is left to them in any case.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_SHARE = 0.95  # of what is free when the work begins
# bytes; a small model with all that it loads takes 60e6, and 200e6 where its loops are compiled too
_LOADING = 400_000_000


@contextmanager
def limited_to_free_memory() -> Iterator[None]:
    """Limits the data of this process, within, to what is free now, or to what loading takes if that is more,
    where the system can (Linux) and nobody has set a limit already.
    """
    free = free_memory()
    if sys.platform != "linux" or free is None:
        yield
        return
    import resource

    before, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if before != resource.RLIM_INFINITY:
        yield
        return
    resource.setrlimit(resource.RLIMIT_DATA, (_data_size() + max(int(_SHARE * free), _LOADING), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, (before, hard))


def free_memory() -> int | None:
    """Bytes that can be had without swapping: the system's, or what is left of a container's share; None
    where neither is told.
    """
    system = kernel_entry(Path("/proc/meminfo"), "MemAvailable:")
    group = Path("/sys/fs/cgroup")
    try:
        limit = (group / "memory.max").read_text(encoding="ascii").strip()
        left = (
            None
            if limit == "max"
            else int(limit) - int((group / "memory.current").read_text(encoding="ascii"))
        )
    except (OSError, ValueError):
        left = None
    known = [value for value in (system, left) if value is not None]
    return min(known) if known else None


def _data_size() -> int:
    return kernel_entry(Path("/proc/self/status"), "VmData:") or 0


def kernel_entry(file: Path, name: str) -> int | None:
    """A value in kB of a file of the kernel's, in bytes; None where there is none."""
    try:
        line = next(line for line in file.read_text(encoding="ascii").splitlines() if line.startswith(name))
    except (OSError, StopIteration):
        return None
    return 1024 * int(line.split()[1])
