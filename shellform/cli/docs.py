"""`shellform docs`: the documentation, without a network."""

from __future__ import annotations

from typing import Annotated

import typer


def docs(
    show: Annotated[
        bool, typer.Option("--open/--no-open", help="Open it in the browser, or tell only where it is.")
    ] = True,
) -> None:
    """Open the documentation that came with this version; it needs no network."""
    import webbrowser
    from pathlib import Path

    import shellform
    from shellform.errors import InputError

    package = Path(shellform.__file__).resolve().parent
    start = package / "_site/index.html"
    if not start.is_file():
        raise InputError(
            "the site isn't built here",
            where=str(start),
            remedy=f"Build it with scripts/docs, or read the pages in {package / 'documentation'}.",
        )
    print(start)
    if show and not webbrowser.open(start.as_uri()):
        print("No browser can be opened from here: open that file in one.")
