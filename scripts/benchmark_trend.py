"""How a run of the benchmark stands beside the one that was committed."""

from __future__ import annotations

import json
from pathlib import Path

COMMITTED = Path(__file__).parent / "benchmark.json"


def committed(file: Path = COMMITTED) -> dict[str, tuple[float, bool | None]]:
    """Of each row of a kept run its value, and whether its bar held."""
    rows = json.loads(file.read_text(encoding="utf-8"))["rows"]
    return {row["what"]: (row["value"], row["holds"]) for row in rows}


def trend(what: str, value: float, holds: bool | None, before: dict[str, tuple[float, bool | None]]) -> str:
    """The change of a row since the kept run, in words. Seconds and milliseconds compare machines too, ratios
    don't."""
    if what not in before:
        return "not measured before"
    then, held = before[what]
    turned = {(True, False): ", held before", (False, True): ", did not hold before"}
    change = f"{100.0 * (value / then - 1.0):+.0f} %" if then else "from nothing"
    return f"{change} from {then:.3g}{'' if held is None or holds is None else turned.get((held, holds), '')}"
