"""A page in one HTML file, from a template, a style and a script of `assets/` and numbers as JSON (door to
Jinja2).

`assets/base.html` holds what all pages share: the head with its policy, the style, the numbers, the script.
What comes from elsewhere is made harmless here: the template escapes text, the JSON has no "<", and the
page's policy refuses every script but its own and every request.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Callable, Mapping
from importlib import resources
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined


def part(name: str) -> str:
    """The text of a file of `assets/`."""
    return resources.files("shellform.output.page").joinpath("assets", name).read_text(encoding="utf-8")


def filled(
    name: str,
    content: Mapping[str, Any],
    *,
    generator: str,
    style: str,
    script: str,
    data: Mapping[str, Any],
    number: Callable[..., str],
) -> str:
    """The page `name` with its `content` and the `data` that the script draws; `number` writes
    numbers, in the template as a filter. `generator` is the name in the head by which the page is known
    again."""
    environment = Environment(
        loader=FunctionLoader(part),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["number"] = number
    shared = {
        "generator": generator,
        "style": style,
        "script": script,
        "script_hash": base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        "data": json.dumps(data, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c"),
    }
    return environment.get_template(name).render({**content, **shared})
