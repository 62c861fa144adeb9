"""Cases, runs and studies. `run_study` and `read_table` are loaded when they are first used."""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {"run_study": "shellform.study.studies", "read_study": "shellform.study.plan", "read_table": "shellform.study.store"}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'shellform.study' has no attribute {name!r}")
