"""The optimiser's checkpoint in a run folder: one file, replaced whole before every trial and deleted when
the stage is done.

It carries the key of its stage (run.py), so that it is taken up only where nothing has changed since, and a
hash of its arrays: one that was altered is computed anew.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from shellform.arrays import read_arrays
from shellform.errors import InputError
from shellform.optimiser.optimum import Checkpoint, Step
from shellform.written import whole

FILE = "optimise.npz"


def save_checkpoint(folder: Path, key: str, checkpoint: Checkpoint) -> None:
    """Writes the checkpoint of the stage with the `key`. Raises InputError where it can't be written."""
    meta = {
        "key": key,
        "hash": _hash(checkpoint.arrays),
        "numbers": dict(checkpoint.numbers),
        "history": [asdict(step) for step in checkpoint.history],
    }
    arrays: dict[str, Any] = {**checkpoint.arrays, "told": np.array(json.dumps(meta))}
    with whole(folder / FILE, ".npz") as partial:
        np.savez(partial, **arrays)


def load_checkpoint(folder: Path, key: str) -> Checkpoint | None:
    """The checkpoint of the stage with the `key`; None where there is none, or one of another case, or a
    damaged one.
    """
    if not (folder / FILE).is_file():
        return None
    try:
        arrays = dict(read_arrays(folder / FILE))
        meta = json.loads(str(arrays.pop("told")))
        if meta["key"] != key or meta["hash"] != _hash(arrays):
            return None
        return Checkpoint(meta["numbers"], arrays, tuple(Step(**step) for step in meta["history"]))
    except (InputError, KeyError, TypeError, ValueError):  # what can't be read is computed anew
        return None


def _hash(arrays: Mapping[str, np.ndarray]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype} {array.shape} ".encode() + array.tobytes())
    return digest.hexdigest()


def drop_checkpoint(folder: Path) -> None:
    """Deletes the checkpoint of a stage that is done."""
    (folder / FILE).unlink(missing_ok=True)
