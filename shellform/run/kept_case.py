"""case.toml of a run folder, and beside it the case's own catalogues, which it names: a run is read back with
the sections that it was made with, wherever the folder lies and whatever has become of the files.
"""

from __future__ import annotations

from pathlib import Path

from shellform.case.build_gridshell import own_catalogues, with_catalogues
from shellform.case.case import Case, dump_case
from shellform.errors import InputError, unreadable
from shellform.gridshell.tolerances import Tolerances
from shellform.written import make_folder, write_text

CATALOGUES = "catalogues"


def write_case(folder: Path, case: Case, tolerances: Tolerances | None = None) -> None:
    """Writes case.toml with every setting (`dump_case`) and the case's own catalogues in `CATALOGUES`, under
    their names; of two of one name the second is told apart by what it is for. Raises InputError where they
    can't be read or written."""
    written: dict[str, Path] = {}
    kept = {}
    for use, source in own_catalogues(case).items():
        name = source.name if written.get(source.name, source) == source else f"{use}-{source.name}"
        written[name] = source
        kept[use] = f"{CATALOGUES}/{name}"
        write_text(make_folder(folder / CATALOGUES) / name, _text(source))
    write_text(folder / "case.toml", dump_case(with_catalogues(case, kept), tolerances))


def _text(source: Path) -> str:
    try:
        return source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(
            unreadable(error),
            where=f"catalogue {source}",
            remedy="Put it back, or name another one in the case.",
        ) from error
