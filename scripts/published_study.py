"""One of the paper's two studies of section 4.1 and a table beside what the paper says of it.

    scripts/published_study fixed                   # rods of 2 mm: runs/published_fixed, about 95 s
    # radius free: runs/published_radius, beside runs/published_fixed if it is there
    scripts/published_study radius
    # of a run that is finished already, which is not computed again
    scripts/published_study fixed --run runs/mine

The table is published.md and published.csv in the run's folder. Exit status: 0 done, 2 input refused, 3 no
result.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shellform.case.case import load_case
from shellform.errors import InputError, NotConverged
from shellform.records.progress import Event
from shellform.run.folder import Run, read_run
from shellform.run.run import run_case

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scripts import published  # noqa: E402

CASES = {"fixed": "scale_model.toml", "radius": "scale_model_radius.toml"}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="scripts/published_study", description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=published.STUDIES)
    parser.add_argument("--run", type=Path, help="folder of a finished run, which is not computed again")
    parser.add_argument("--output", type=Path, help="folder of the run; runs/published_STUDY where left out")
    parser.add_argument(
        "--fixed", type=Path, help="the run of the fixed radius with which the free one is compared"
    )
    asked = parser.parse_args(arguments)
    try:
        for file in write(asked.study, asked.run, asked.output, asked.fixed):
            print(file)
    except InputError as error:
        print(f"published_study: refused: {error}", file=sys.stderr)
        return 2
    except NotConverged as error:
        print(f"published_study: no result: {error}", file=sys.stderr)
        return 3
    return 0


def write(study: str, done: Path | None, output: Path | None, fixed: Path | None) -> list[Path]:
    """The table of a finished run, or of one that is made now; its files."""
    folder = done or output or ROOT / f"runs/published_{study}"
    if done is None:
        run_case(load_case(ROOT / "scripts" / CASES[study]), folder, report=tell)
    run = read_run(folder)
    if published.study_of(run) != study:
        other = published.study_of(run)
        raise InputError(
            f"is a run of the study {other!r}", where=str(folder), remedy=f"Asked for was {study!r}."
        )
    return published.write_beside(run, fixed=_fixed(fixed) if study == "radius" else None)


def tell(event: Event) -> None:
    """A line of progress."""
    print(f"{event.stage:9} {event.text}", flush=True)


def _fixed(folder: Path | None) -> Run | None:
    usual = ROOT / "runs/published_fixed"
    if folder is None and not (usual / "summary.json").is_file():
        print(
            "published_study: run the study 'fixed' first for the lines that compare the two", file=sys.stderr
        )
        return None
    return read_run(folder or usual)


if __name__ == "__main__":
    sys.exit(main())
