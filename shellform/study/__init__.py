"""Cases, runs and studies. What a script needs of them is loaded when it is first used:

summary = study.run_case(study.load_case("case.toml", ["net.spacing=0.06"]), "runs/mine")
found = study.run_study("study.toml", "runs/study", workers=2)
table = study.read_table(found.table.parent, ["cables"])
"""

from __future__ import annotations

from shellform import lazy

__getattr__, __dir__ = lazy.public(__name__)
