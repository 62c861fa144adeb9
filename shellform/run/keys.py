"""The keys of a run's stages: what tells whether a stage that is done is still that of the case."""

from __future__ import annotations

import hashlib
import json
import os
from functools import cache
from pathlib import Path

import shellform
from shellform.case.build_gridshell import catalogue_bytes, has_edge_cells
from shellform.case.build_safety import SEARCHED
from shellform.case.case import Case
from shellform.records.stages import STAGES
from shellform.surface.readers.gltf import surface_files

_NEEDS = {
    "surface": ["surface"],
    "net": ["net", "joint", "edges"],
    "initial": ["rod", "cable", "load", "part", "edge_beam"],
    "optimise": ["optimise", "limits", "robust", "tolerances", "safety"],
    "safety": ["told"],
    "figures": ["figures", "title"],
    "documents": ["stock", "title_block"],
    "report": [],
}


def stage_keys(case: Case, *, sketch: bool = False) -> dict[str, str]:
    """A hash for each stage of all that it depends on; of the surface file that is its name and content, with
    that of the buffers beside it, and of the case's own catalogues the same, wherever they lie. The designs
    of a `sketch` are no others'.
    """
    entries = case.model_dump(mode="json")
    file = Path(case.surface.file)
    entries["surface"]["file"] = file.name
    for entry in (entries["rod"], entries["optimise"], entries["edges"]["beam"]):
        if Path(entry.get("catalogue") or "").is_absolute():  # one of the case's own, wherever it lies
            entry["catalogue"] = Path(entry["catalogue"]).name
    stock = catalogue_bytes(case)
    # No design depends on these.
    entries["stock"] = {name: entries["rod"].pop(name) for name in ("stock_length", "kerf")}
    entries["cable"]["edge_cells"] = has_edge_cells(case)
    entries["stock"] |= {"adjustment": entries["cable"].pop("adjustment")}
    entries["edge_beam"] = entries["edges"].pop("beam")  # no net depends on its section
    # No search depends on these, but for how many it draws itself.
    told = {name: entries["safety"].pop(name) for name in ("drawn", "compared", "confidence", "rare")}
    entries["told"] = told | {"built_deviation": entries["limits"].pop("built_deviation")}
    entries["safety"] |= {"searched": min(told["drawn"], SEARCHED)}
    digest = hashlib.sha256(shellform.__version__.encode() + _surface_content(file))
    keys = {}
    for stage in STAGES:
        digest.update(stock if stage == "initial" else b"")
        digest.update(b"sketch" if stage == "initial" and sketch else b"")
        digest.update(json.dumps({name: entries[name] for name in _NEEDS[stage]}, sort_keys=True).encode())
        keys[stage] = digest.hexdigest()
    return keys


def _surface_content(file: Path) -> bytes:
    """Hashes of what a surface is read from; what is named and isn't there has none: its reader says so."""
    found = b""
    for each in surface_files(file):
        if each == file or os.path.isfile(each):  # Path.is_file raises for names that no file can have
            status = each.stat()
            found += _content(str(each), status.st_size, status.st_mtime_ns)
    return found


@cache
def _content(file: str, size: int, written: int) -> bytes:
    """A hash of a file as it was when it had this size and time: studies ask for the same ones many times."""
    with open(file, "rb") as content:
        return hashlib.file_digest(content, "sha256").digest()
