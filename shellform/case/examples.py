"""The cases that come with the package, laid beside their surfaces in a folder of the user's.

In the repository they stand in scripts/ and their surfaces in surfaces/; in a wheel both lie in the package.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import shellform
from shellform.case.case import shipped_surfaces
from shellform.errors import InputError, require_known
from shellform.written import whole


@dataclass(frozen=True)
class Example:
    """A shipped case: what it is `about`, its `files` in the folder of the cases, the `surface` that they
    name ("" for none), and the `command` to begin with.
    """

    about: str
    files: tuple[str, ...]
    surface: str
    command: str


EXAMPLES = {
    "vault": Example(
        "a first design: a vault of 0.9 × 0.55 m, rods of 2.4 mm",
        ("vault.toml",),
        "vault.ply",
        "shellform design vault.toml --output run",
    ),
    "paper": Example(
        "the paper's scale model: the same vault, rods of 2 mm, nearly too thin for it",
        ("scale_model.toml",),
        "vault.py",
        "shellform design scale_model.toml --output run",
    ),
    "radius": Example(
        "the same vault, the rods' radius found as well",
        ("scale_model_radius.toml",),
        "vault.py",
        "shellform design scale_model_radius.toml --output run",
    ),
    "full-size": Example(
        "a shell of 18 × 11 m",
        ("full_size.toml",),
        "shell_18x11.py",
        "shellform design full_size.toml --output run",
    ),
    "dome": Example(
        "a dome from a CAD file (STEP, in mm)",
        ("dome.toml",),
        "dome_mm.step",
        "shellform design dome.toml --output run",
    ),
    "rhino": Example(
        "the same dome as a mesh in a Rhino file",
        (),
        "dome.3dm",
        "shellform new dome.3dm --layer Shell --output mine.toml",
    ),
    "rods": Example(
        "a dome of 2.48 × 1.93 m as a mesh in a Rhino file (in mm), for rods of 8 mm",
        (),
        "large_dome.3dm",
        'shellform new large_dome.3dm --layer Shell --rod "gfrp_rods/8 mm" --output mine.toml',
    ),
    "model": Example(
        "an arch of one bent rod and a cable as a model file of one's own",
        ("bent_arch.json",),
        "",
        "shellform analyse bent_arch.json --load snow --output result.json",
    ),
    "study": Example(
        "eight designs of the vault: how the weights of the objective trade off",
        ("study_weights.toml", "scale_model.toml"),
        "vault.py",
        "shellform study study_weights.toml --output study",
    ),
}


def lay_example(name: str, folder: str | Path) -> list[Path]:
    """Writes the files of an example into a folder and returns them, the one to compute first. Raises
    InputError for an unknown name, and where a file of that name with other content is there.
    """
    require_known(name, EXAMPLES, where="NAME", what="is no example")
    example, place = EXAMPLES[name], Path(folder)
    contents = {
        each: _at_home((_cases() / each).read_text(encoding="utf-8")).encode() for each in example.files
    }
    if example.surface:
        contents[example.surface] = (shipped_surfaces() / example.surface).read_bytes()
    for each, content in contents.items():
        file = place / each
        if file.exists() and (not file.is_file() or file.read_bytes() != content):
            raise InputError("is there already", where=str(file), remedy="Choose another folder.")
    for each, content in contents.items():
        with whole(place / each) as partial:
            partial.write_bytes(content)
    return [place / each for each in contents]


def _cases() -> Path:
    package = Path(shellform.__file__).resolve().parent
    inside = package / "_cases"
    return inside if inside.is_dir() else package.parent / "scripts"


def _at_home(text: str) -> str:
    """A case whose files all stand in its own folder."""
    return (
        text.replace('"../surfaces/', '"').replace("scripts/shellform", "shellform").replace("scripts/", "")
    )
