"""`shellform verify`: the published cases and gradient checks."""

from __future__ import annotations

from typing import Annotated

import typer

from shellform.cli.terminal import tell_cases


def verify(
    large: Annotated[
        bool, typer.Option("--large", help="Also a net of 100,000 cables, which takes a minute.")
    ] = False,
) -> None:
    """Run the published cases and gradient checks."""
    from shellform.verification import verify as rows

    tell_cases(rows(large=large))
