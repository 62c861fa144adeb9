"""`shellform verify`: the published cases and gradient checks."""

from __future__ import annotations

from shellform.cli.terminal import tell_cases


def verify() -> None:
    """Run the published cases and gradient checks."""
    from shellform.verification import verify as rows

    tell_cases(rows())
