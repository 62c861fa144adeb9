"""A run that ends early: what was found is judged and shown, and where there is no design yet, the page says
why it ended."""

from __future__ import annotations

from dataclasses import replace
from urllib.parse import quote

import shellform
from shellform.errors import InputError, ShellformError
from shellform.output.page.ended import EndedRun, ended_page, facts
from shellform.output.page.report import GENERATOR
from shellform.records.stages import STAGES, read_stages
from shellform.records.summary import Summary, read_summary, write_summary
from shellform.run import log
from shellform.run.folder import LOCK, read_run
from shellform.run.judged import judged
from shellform.run.pages import FILE, write_page
from shellform.run.workspace import Workspace
from shellform.written import is_partial, write_text

_LINES = 25  # of the log


def break_off(workspace: Workspace, stage: str, error: ShellformError) -> None:
    """Writes summary and page of a run whose `stage` ended with an `error`: with the designs that were found
    and their verdict, or, without any, with the cause alone."""
    summary = read_summary(workspace.folder)
    summary = replace(summary, failed={**summary.failed, stage: str(error)})
    write_summary(workspace.folder, summary)
    if summary.designs:
        run = read_run(workspace.folder)
        run = replace(run, summary=replace(summary, verdict=judged(run)))
        write_summary(workspace.folder, run.summary)
        write_page([run], workspace.path(FILE))
        return
    write_text(workspace.path(FILE), ended_page(_ended(workspace, stage, error, summary), GENERATOR))


def _ended(workspace: Workspace, stage: str, error: ShellformError, summary: Summary) -> EndedRun:
    folder = workspace.folder
    done = read_stages(folder)
    lines = workspace.path(log.FILE).read_text(encoding="utf-8", errors="replace").splitlines()
    return EndedRun(
        title=workspace.case.title or folder.resolve().name,
        place=folder.name or str(folder),
        version=shellform.__version__,
        stage=stage,
        cause=error.cause,
        remedy=error.remedy,
        stages=[(name, "ended" if name == stage else "done" if name in done.keys else "") for name in STAGES],
        facts=facts(summary),
        notes=(
            [
                "This is the input's fault, or beyond what can be built: nothing is to be gained by running it again."
            ]
            if isinstance(error, InputError)
            else []
        ),
        log=lines[-_LINES:],
        files=[
            (name, quote(name))
            for name in sorted(
                file.relative_to(folder).as_posix()
                for file in folder.rglob("*")
                if file.is_file() and file.name not in (LOCK, FILE) and not is_partial(file)
            )
        ],
        settings=workspace.path("case.toml").read_text(encoding="utf-8-sig"),
    )
