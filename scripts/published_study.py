"""One of the paper's two studies of section 4.1 and a table beside what the paper says of it.

    scripts/published_study fixed                   # rods of 2 mm: runs/published_fixed, about 95 s
    # radius free: runs/published_radius, beside runs/published_fixed if it is there
    scripts/published_study radius
    # of runs that are finished already, which are not computed again
    scripts/published_study fixed --run runs/mine --method runs/mine_paper
    # a quick look
    scripts/published_study fixed --set net.elements=2 --set optimise.evaluations=15 --structures 10

Each study is run twice, by default as shellform designs, and by the paper's own method (optimise.method =
"paper", in runs/published_STUDY_paper). The tables are published.md, published.csv and, with critical
factors, drawn structures and slack cables of all designs, published_standing.csv, in the first run's folder.
Exit status: 0 done, 2 input refused, 3 no result.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from shellform.case.case import load_case
from shellform.case.limit_entries import LimitsEntry
from shellform.errors import InputError, NotConverged
from shellform.records.progress import Event
from shellform.run.folder import Run, read_run
from shellform.run.run import run_case

ROOT = Path(__file__).resolve().parent.parent
sys.path.insert(0, str(ROOT))

from scripts import published, published_standing  # noqa: E402

CASES = {"fixed": "scale_model.toml", "radius": "scale_model_radius.toml"}


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(prog="scripts/published_study", description=__doc__.splitlines()[0])
    parser.add_argument("study", choices=published.STUDIES)
    parser.add_argument("--run", type=Path, help="folder of a finished run, which is not computed again")
    parser.add_argument("--output", type=Path, help="folder of the run; runs/published_STUDY where left out")
    parser.add_argument(
        "--fixed", type=Path, help="the run of the fixed radius with which the free one is compared"
    )
    parser.add_argument("--method", type=Path, help="folder of a finished run by the paper's method")
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE", help="of both runs' cases")
    parser.add_argument("--structures", type=int, default=60, help="drawn for each design and load; 0: none")
    parser.add_argument("--seed", type=int, default=0, help="of the drawing")
    asked = parser.parse_args(arguments)
    try:
        for file in write(
            asked.study,
            asked.run,
            asked.output,
            asked.fixed,
            asked.method,
            settings=asked.set,
            structures=asked.structures,
            seed=asked.seed,
        ):
            print(file)
    except InputError as error:
        print(f"published_study: refused: {error}", file=sys.stderr)
        return 2
    except NotConverged as error:
        print(f"published_study: no result: {error}", file=sys.stderr)
        return 3
    return 0


def write(
    study: str,
    done: Path | None,
    output: Path | None,
    fixed: Path | None,
    method: Path | None,
    *,
    settings: list[str],
    structures: int,
    seed: int,
) -> list[Path]:
    """The tables of a finished run, or of one that is made now, and of the paper's method; their files. A
    finished run without a finished one by the paper's method stands alone."""
    folder = done or output or ROOT / f"runs/published_{study}"
    if done is None:
        case = ROOT / "scripts" / CASES[study]
        run_case(load_case(case, settings), folder, report=tell)
        if method is None:
            method = folder.with_name(f"{folder.name}_paper")
            # the paper knows its own bounds and constraints, and no engineer's limits
            asked = load_case(case, [*settings, "optimise.method=paper", *published.PAPER[study]])
            run_case(asked.model_copy(update={"limits": LimitsEntry()}), method, report=tell)
    run = read_run(folder)
    if published.study_of(run) != study:
        other = published.study_of(run)
        raise InputError(
            f"is a run of the study {other!r}", where=str(folder), remedy=f"Asked for was {study!r}."
        )
    by_paper = None if method is None else read_run(method)
    stands = []
    for each, name in ((by_paper, "paper's"), (run, "default")):
        if each is not None and each.states:
            print(f"published_study: what stands, {name} method", flush=True)
            stands += published_standing.standings(each, name, count=structures, seed=seed)
    return published.write_beside(
        run, fixed=_fixed(fixed) if study == "radius" else None, method=by_paper, stands=stands
    )


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
