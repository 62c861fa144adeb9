"""`shellform design`: the whole job."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from shellform.cli.options import Json, Quiet, Scripts
from shellform.cli.terminal import Spinner, tell_designs


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
    profile: Annotated[
        bool, typer.Option("--profile", help="Write what each stage takes: profile.json, and on the page.")
    ] = False,
    sketch: Annotated[
        bool, typer.Option("--sketch", help="A first look in seconds: coarse, not examined, one picture.")
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
    from shellform.records.summary import document
    from shellform.run.run import run_case

    first = "figures/sketch.png" if sketch else "report.html"
    report = Spinner(quiet=quiet)
    summary = run_case(
        load_case(case, settings or ()),
        output,
        until=until,
        fresh=fresh,
        allow_scripts=allow_scripts,
        profile=profile,
        sketch=sketch,
        report=report,
    )
    report.close()
    if as_json:
        print(json.dumps(document(summary), indent=1))
    elif not quiet:
        tell_designs(summary)
        print(
            f"Everything is in {output}"
            + (f"; look at {output / first} first" if until == "report" else "")
        )
    judged = summary.verdict
    if judged is not None and (judged.failed or (not judged.holds and not sketch and _examined(until))):
        raise typer.Exit(3)


def _examined(until: str) -> bool:
    """Whether the stages up to this one examine the designs as built."""
    from shellform.records.stages import STAGES

    return STAGES.index(until) >= STAGES.index("safety")
