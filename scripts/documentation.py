"""Builds the site of shellform/documentation into shellform/_site, or into a folder that is named.

    scripts/docs [FOLDER]

What can be read from the package is written by it: commands from their options, the case file from its
schema, the keys of summary.json from its records, the public names from their docstrings, verification from
the cases that `shellform verify` runs, speed from scripts/benchmark.json. The rest stands in
shellform/documentation as it is.
"""

from __future__ import annotations

import argparse
import dataclasses
import inspect
import json
import os
import re
import shutil
import subprocess
import sys
import tempfile
import typing
from collections import defaultdict
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import typer.main

import shellform
from shellform import lazy, verification
from shellform.case.case import Case
from shellform.cli.program import app
from shellform.records.summary import Summary

ROOT = Path(__file__).parent.parent
PAGES = ROOT / "shellform/documentation"
PICTURES = ROOT / "scripts/pictures"
SPEED = ROOT / "scripts/benchmark.json"
WORKER = ROOT / "scripts/iframe-worker.js"
OURS = (ROOT / "scripts/site.css", ROOT / "scripts/site.js")
SITE = ROOT / "shellform/_site"


def gather(folder: Path) -> None:
    """Puts all pages into a folder, those that are written anew and the pictures too."""
    shutil.copytree(PAGES, folder, dirs_exist_ok=True)
    shutil.copytree(PICTURES, folder / "pictures")
    for file in OURS:
        shutil.copy(file, folder)
    for name, text in {
        "reference/commands.md": commands(),
        "reference/case.md": case_file(),
        "reference/python.md": names(),
        "reference/summary.md": summary_keys(),
        "verification.md": verified(),
        "speed.md": speed(),
    }.items():
        (folder / name).write_text(text, encoding="utf-8")


def build(site: Path) -> None:
    """Builds the site; a warning ends it."""
    with tempfile.TemporaryDirectory() as temporary:
        pages = Path(temporary) / "pages"
        gather(pages)
        environment = {
            **os.environ,
            "SHELLFORM_PAGES": str(pages),
            "SHELLFORM_SITE": str(site.resolve()),
            "SHELLFORM_ROOT": str(ROOT),
            "NO_MKDOCS_2_WARNING": "1",
        }
        command = [
            sys.executable,
            "-m",
            "mkdocs",
            "build",
            "--strict",
            "--quiet",
            "-f",
            str(ROOT / "scripts/mkdocs.yml"),
        ]
        subprocess.run(command, env=environment, check=True)
    _keep_inside(site)


def _keep_inside(site: Path) -> None:
    """Puts the one script that the theme asks the network for into the site."""
    shutil.copy(WORKER, site / "assets/iframe-worker.js")
    for page in site.rglob("*.html"):
        inside = "../" * (len(page.relative_to(site).parts) - 1) + "assets/iframe-worker.js"
        text = page.read_text(encoding="utf-8")
        page.write_text(text.replace("https://unpkg.com/iframe-worker/shim", inside), encoding="utf-8")


def table(head: list[str], rows: list[list[str]]) -> str:
    """A table in Markdown."""
    cells = [head, ["---"] * len(head), *rows]
    return "\n".join(
        "| " + " | ".join(each.replace("|", "\\|").replace("\n", " ") for each in row) + " |" for row in cells
    )


def commands() -> str:
    """The page of the commands, from their own options."""
    group: Any = typer.main.get_command(app)
    parts = [
        "# Commands\n\nWritten from the program's own options; `shellform COMMAND --help` shows the same. What each "
        "writes: [the run folder](run.md).\n\nExit status everywhere: 0 done; 2 the input was refused (one message names "
        "file, entry, value and remedy); 3 no usable result, or a design to build that doesn't hold (what was computed is "
        "kept); 130 stopped by Ctrl-C (kept, and resumable).\n"
    ]
    functions = {each.callback.__name__: each.callback for each in app.registered_commands if each.callback}
    for name, command in group.commands.items():
        hints = typing.get_type_hints(functions[name])
        arguments = " ".join(_argument(each) for each in command.params if each.param_type_name == "argument")
        parts.append(
            f"## {name}\n\n{command.help}\n\n```text\nshellform {name} {arguments} [OPTIONS]\n```\n".replace(
                "  ", " "
            )
        )
        rows = []
        for each in command.params:
            if each.name == "help":
                continue
            if each.param_type_name == "argument":
                rows.append([f"`{_argument(each)}`", getattr(each, "help", None) or "", ""])
                continue
            kind = "" if each.is_flag else f" {each.metavar or _kind(hints[each.name])}"
            default = "required" if each.required else _shown(each.default)
            rows.append([f"`{each.opts[0]}{kind}`", each.help or "", default])
        parts.append(table(["argument or option", "meaning", "default"], rows) + "\n")
    return "\n".join(parts)


def _kind(hint: Any) -> str:
    """The word for what an option takes."""
    words = {Path: "PATH", int: "INTEGER", float: "NUMBER", str: "TEXT"}
    inside = [
        hint,
        *typing.get_args(hint),
        *(each for part in typing.get_args(hint) for each in typing.get_args(part)),
    ]
    return next(words[each] for each in inside if each in words)


def _argument(parameter: Any) -> str:
    name = parameter.metavar or parameter.name.upper()
    return name if parameter.required or name.startswith("[") else f"[{name}]"


def _shown(default: object) -> str:
    return "" if default is None or default is False or default == [] or callable(default) else f"`{default}`"


def case_file() -> str:
    """The page of the case file, from the schema that reads it."""
    schema = Case.model_json_schema()
    kinds = schema["$defs"]
    parts = [
        "# The case file\n\nA TOML file says what is to be designed; written from the schema that checks it. SI units. A "
        "run folder's `case.toml` has every entry, defaults included. On the command line any entry can be set: "
        "`--set net.spacing=0.06`. Entries that aren't known are refused, with the nearest known name; sizes that can't be, as 50 for 0.05 m of "
        "concrete or 40 for a modulus of 40e9 Pa, with the number to write. Beside the spacing and the surface other lengths "
        "are refused so, and what is only unusual is told.\n"
    ]
    for name, field in schema["properties"].items():
        if name == "title":
            parts.append("`title` (text): stands on drawings and the page.\n")
            continue
        parts.append(f"## [{name}]\n")
        several = _kinds(field)
        for kind in several:
            parts.append(_entry(kind, kinds[kind], heading=len(several) > 1))
    for kind in ("StretchEntry", "EdgeBeamEntry"):
        parts.append(_entry(kind, kinds[kind]))
    return "\n".join(parts)


def _kinds(field: Any) -> list[str]:
    """The names of the tables that a field of the schema may be."""
    if isinstance(field, list):
        return list(dict.fromkeys(name for each in field for name in _kinds(each)))
    if not isinstance(field, dict):
        return []
    found = [field["$ref"].rpartition("/")[2]] if "$ref" in field else []
    parts = [
        value
        for key, value in field.items()
        if key in ("anyOf", "oneOf", "items", "additionalProperties", "allOf")
    ]
    return list(dict.fromkeys(found + _kinds(parts)))


def _entry(kind: str, schema: dict[str, Any], *, heading: bool = True) -> str:
    """One table of the case file."""
    rows = [
        [
            f"`{name}`",
            _type(each),
            "**required**" if name in schema.get("required", ()) else _shown_value(each.get("default")),
            each.get("description", ""),
        ]
        for name, each in schema.get("properties", {}).items()
    ]
    title = kind.removesuffix("Entry")
    head = f"### {title} {{ #{title.lower()} }}\n\n" if heading else ""
    cells = table(["entry", "value", "default", "meaning"], rows)
    return f"{head}{schema.get('description', '')}\n\n{cells}\n"


def _type(field: dict[str, Any]) -> str:
    if "anyOf" in field or "oneOf" in field:
        return " or ".join(
            dict.fromkeys(
                _type(each) for each in field.get("anyOf", field.get("oneOf")) if each.get("type") != "null"
            )
        )
    if "$ref" in field:
        return f"table {field['$ref'].rpartition('/')[2].removesuffix('Entry')}"
    if "const" in field:
        return f"`{field['const']}`"
    if "enum" in field:
        return ", ".join(f"`{each}`" for each in field["enum"])
    if field.get("type") == "array":
        inner = field.get("items") or {}
        return (
            f"list of {_type(inner)}"
            if inner
            else f"{len(field.get('prefixItems', ())) or ''} values".strip()
        )
    words = {
        "number": "number",
        "integer": "whole number",
        "string": "text",
        "boolean": "true or false",
        "object": "table",
    }
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "exclusiveMaximum": "<", "maximum": "≤"}
    bounds = [f"{sign} {field[key]:g}" for key, sign in signs.items() if key in field]
    return " ".join([words.get(field.get("type", ""), "value"), ", ".join(bounds)]).strip()


def _shown_value(value: object) -> str:
    return "" if value is None or value == {} else f"`{json.dumps(value, ensure_ascii=False)}`"


def names() -> str:
    """The page of the public names, by room; their docstrings are put in by mkdocstrings."""
    rooms: dict[str, list[tuple[str, str]]] = defaultdict(list)
    for name, (home, original) in lazy.homes("shellform").items():
        whole = f"{home}.{original}"
        parts = whole.split(".")
        rooms[parts[1]].append((name, whole))
    for name, (home, original) in lazy.homes("shellform.study").items():
        rooms["study"].append((f"study.{name}", f"{home}.{original}"))
    text = [
        "# Python\n\nThe public names, `import shellform as sf`, by room; written from their "
        "docstrings. Lengths are in m, forces in N, angles in rad. Each name is loaded when it is first used.\n\n"
        "A record that holds arrays, itself or in a record inside it, equals itself only: `design == other` is "
        "`design is other`, and `in`, `set` and dictionaries go by that. Compare numbers: "
        "`np.array_equal(design.rest_length, other.rest_length)`. Its arrays are read-only, copied and unpickled "
        "as well; `dataclasses.replace(design, radius=0.0012)` makes another. Records of numbers and names alone, "
        "such as `Rod`, are equal where these are.\n"
    ]
    for room in sorted(rooms):
        text.append(f"## {room}\n")
        for name, whole in sorted(rooms[room], key=lambda each: each[0].lower()):
            if whole == "shellform.study.study" or name == "study":
                continue
            text.append(
                f"### sf.{name} {{ #sf-{name} }}\n\n::: {whole}\n    options:\n      show_root_toc_entry: false\n      heading_level: 4\n"
            )
    return "\n".join(text)


def summary_keys() -> str:
    """The page of summary.json, from the records that write and read it."""
    parts = [
        "# summary.json\n\nEvery number of a run, written from the records that write and read the file. SI units; "
        "a key without a value is left out. Keys may be added, never renamed or dropped. Beside it: "
        "[the run folder](run.md).\n"
    ]
    for record, place in summary_records().items():
        hints = typing.get_type_hints(record)
        rows = [[f"`{each.name}`", _value(hints[each.name])] for each in dataclasses.fields(record)]
        said = "\n\n".join(
            inspect.getdoc(each) or "" for each in record.__mro__ if dataclasses.is_dataclass(each)
        )
        parts.append(f"## {place}\n\n{said}\n\n{table(['key', 'value'], rows)}\n")
    return "\n".join(parts)


def summary_records() -> dict[type, str]:
    """The records of summary.json, and the place of each in the file."""
    found: dict[type, str] = {Summary: "the file"}
    waiting = [(Summary, "")]
    while waiting:
        record, place = waiting.pop(0)
        hints = typing.get_type_hints(record)
        for each in dataclasses.fields(record):
            several = _origin(hints[each.name])
            inside = (
                f"{place}{each.name}{'.NAME' if several is Mapping else '[]' if several is tuple else ''}"
            )
            for kind in _inside(hints[each.name]):
                if dataclasses.is_dataclass(kind) and kind not in found:
                    found[kind] = inside
                    waiting.append((kind, f"{inside}."))
    return found


def _origin(hint: Any) -> Any:
    """Mapping or tuple, where a field holds several records, be it optional."""
    return next(
        (
            typing.get_origin(each)
            for each in (hint, *typing.get_args(hint))
            if typing.get_origin(each) in (Mapping, tuple)
        ),
        None,
    )


def _inside(hint: Any) -> list[Any]:
    """The types that a hint is made of."""
    return [hint, *(inner for each in typing.get_args(hint) for inner in _inside(each))]


def _value(hint: Any) -> str:
    """The words for a field's type."""
    words = {float: "number", int: "whole number", str: "text", bool: "true or false"}
    if hint in words:
        return words[hint]
    if dataclasses.is_dataclass(hint):
        return f"table [{summary_records()[hint]}](#{_anchor(summary_records()[hint])})"
    parts = [each for each in typing.get_args(hint) if each not in (type(None), ...)]
    if typing.get_origin(hint) is tuple:
        return f"{len(parts)} values" if len(parts) > 1 else f"list of {_value(parts[0])}"
    if typing.get_origin(hint) is Mapping:
        return f"{_value(parts[1])}, by name"
    return " or ".join(_value(each) for each in parts)


def _anchor(place: str) -> str:
    """The anchor that the site gives to a heading."""
    return re.sub(r"[-\s]+", "-", re.sub(r"[^\w\s-]", "", place).strip().lower())


def verified() -> str:
    """The page of the verification, run now."""
    rows = list(verification.verify())
    held = sum(row.passed for row in rows)
    head = (
        "# Verification\n\nWritten by running the cases of `shellform verify` as the site was built, with version "
        f"{shellform.__version__}: {held} of {len(rows)} numbers of {len({row.case for row in rows})} published or exact cases "
        "hold. Your own machine's: `shellform verify`, some ten seconds. The code: `shellform/verification/`.\n\nThe difference "
        "is relative to the reference where that isn't 0; the tolerance follows from the discretisation or from the digits "
        "that were published.\n"
    )
    cells = [
        [
            row.case,
            row.quantity,
            f"{row.value:.7g}",
            f"{row.reference:.7g}",
            f"{row.difference:.1e}",
            f"{row.tolerance:.0e}",
            row.source,
        ]
        for row in rows
    ]
    return (
        head
        + "\n"
        + table(["case", "quantity", "value", "reference", "difference", "allowed", "source"], cells)
        + "\n"
    )


def speed() -> str:
    """The page of the speed, from the benchmark's last numbers that were kept."""
    found = json.loads(SPEED.read_text(encoding="utf-8"))
    cells = [
        [
            row["what"],
            f"{row['value']:.3g}",
            row["unit"],
            "" if row["bar"] is None else f"{'≤' if row['most'] else '≥'} {row['bar']:g}",
        ]
        for row in found["rows"]
    ]
    told = "; ".join([*found["notes"], f"load of the machine before: {found['load_before']:g}"])
    missed = [row["what"] for row in found["rows"] if row["holds"] is False]
    told += f". Aims not met: {'; '.join(missed)}" if missed else ""
    if f"version {shellform.__version__};" not in told:
        told = f"**Not of this version ({shellform.__version__}), but of an older one:** {told}"
    notes = (PAGES / "speed.md").read_text(encoding="utf-8")
    return notes + f"\n## The numbers\n\n{told}.\n\n" + table(["what", "value", "unit", "aim"], cells) + "\n"


if __name__ == "__main__":
    asked = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    asked.add_argument("folder", type=Path, nargs="?", default=SITE)
    build(asked.parse_args().folder)
