"""`shellform design`: the whole job."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from shellform.cli.options import Json, Quiet, Scripts
from shellform.cli.terminal import Spinner, tell_designs

if TYPE_CHECKING:
    from shellform.records.progress import Report
    from shellform.records.summary import Summary


def design(
    case: Annotated[Path, typer.Argument(help="Case file (TOML).")],
    output: Annotated[Path, typer.Option(help="Run folder.")],
    until: Annotated[
        str,
        typer.Option(
            help="Last stage: surface, net, initial, optimise, safety, figures, documents or report."
        ),
    ] = "report",
    fresh: Annotated[bool, typer.Option("--fresh", help="Compute every stage anew.")] = False,
    sketch: Annotated[
        bool, typer.Option("--sketch", help="A first look in seconds: coarse, not examined, one picture.")
    ] = False,
    watch: Annotated[
        bool, typer.Option("--watch", help="Again whenever the case or its surface changes, until Ctrl-C.")
    ] = False,
    profile: Annotated[
        bool, typer.Option("--profile", help="Write what each stage takes: profile.json, and on the page.")
    ] = False,
    settings: Annotated[
        list[str] | None, typer.Option("--set", help="KEY=VALUE in place of an entry.")
    ] = None,
    allow_scripts: Scripts = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Run the whole job; run again, it goes on where it stopped. Status 3 where the design to build doesn't
    hold.
    """
    from shellform.case.case import load_case
    from shellform.run.run import run_case
    from shellform.structure.ahead import compiling_ahead

    def once(ending: Callable[[Report], Report] = lambda report: report) -> Summary:
        with Spinner(quiet=quiet) as spinner, compiling_ahead():
            summary = run_case(
                load_case(case, settings or ()),
                output,
                until=until,
                fresh=fresh,
                allow_scripts=allow_scripts,
                profile=profile,
                sketch=sketch,
                report=ending(spinner),
            )
        if as_json:
            _tell_json(summary)
        elif not quiet:
            tell_designs(summary)
            first = output / ("figures/sketch.png" if sketch else "report.html")
            print(f"Everything is in {output}" + (f"; look at {first} first" if until == "report" else ""))
        return summary

    if watch:
        from shellform.cli.watching import case_files, watched

        load_case(case, settings or ())  # what is wrong from the outset is refused
        watched(lambda: case_files(case, settings or ()), once)
    judged = once().verdict
    if judged is not None and (judged.failed or (not judged.holds and not sketch and _examined(until))):
        raise typer.Exit(3)


def _tell_json(summary: Summary) -> None:
    from shellform.records.summary import document

    print(json.dumps(document(summary), indent=1), flush=True)


def _examined(until: str) -> bool:
    """Whether the stages up to this one examine the designs as built."""
    from shellform.records.stages import STAGES

    return STAGES.index(until) >= STAGES.index("safety")
