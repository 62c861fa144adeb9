"""Options that several commands share."""

import inspect
from collections.abc import Mapping
from typing import Any

from shellform.cli import options


def test_a_command_takes_each_surface_option_by_name_and_gets_those_that_were_given():
    got = []

    def command(file: str, surface_options: Mapping[str, Any], *, depth: int = 2) -> None:
        got.append((file, dict(surface_options), depth))

    taking = options.with_surface_options(command)
    names = list(inspect.signature(taking).parameters)
    assert names == ["file", *options._SURFACE, "depth"]
    none = dict.fromkeys(options._SURFACE)
    taking(file="a.obj", **{**none, "unit": "mm", "fill": "holes"}, depth=3)
    assert got == [("a.obj", {"unit": "mm", "fill": "holes"}, 3)]
