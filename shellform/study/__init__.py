"""Cases, runs and studies. What a script needs of them is loaded when it is first used:

summary = study.run_case(study.load_case("case.toml", ["net.spacing=0.06"]), "runs/mine")
found = study.run_study("study.toml", "runs/study", workers=2)
table = study.read_table(found.table.parent, ["cables"])
"""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "load_case": "shellform.case.case",
    "run_case": "shellform.run.run",
    "run_study": "shellform.study.studies",
    "read_study": "shellform.study.plan",
    "read_table": "shellform.study.store",
}


def __getattr__(name: str) -> Any:
    if name in _HOMES:
        return getattr(importlib.import_module(_HOMES[name]), name)
    raise AttributeError(f"module 'shellform.study' has no attribute {name!r}")
