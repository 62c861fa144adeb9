"""Designing bending-active gridshells as falsework for concrete shells.

    import shellform as sf
    from shellform import cad, render

The public names stand in `__init__.pyi`. Each is loaded when it is first used: `import shellform` itself
loads no large library.
"""

from __future__ import annotations

import sys
from importlib import import_module

from shellform import lazy

__version__ = "0.4.0"
__getattr__, __dir__ = lazy.public(__name__)

_SHOWN = {
    ("shellform.net.net", "Net"): "shellform.output.notebook.net",
    ("shellform.gridshell.gridshell", "Gridshell"): "shellform.output.notebook.gridshell",
    ("shellform.optimiser.optimum", "Optimum"): "shellform.output.notebook.optimum",
    ("shellform.run.folder", "Run"): "shellform.run.displayed.run",
}
_KINDS = {"image/png": "png", "text/html": "html"}


def load_ipython_extension(ipython):  # typed in the stub
    """Nets, gridshells, optima and runs show their picture, and where HTML is shown a view to be turned and
    picked in (`%load_ext shellform`; done by itself where IPython runs).
    """
    for kind, ending in _KINDS.items():
        formatter = ipython.display_formatter.formatters[kind]
        for (home, name), thing in _SHOWN.items():
            formatter.for_type_by_name(home, name, _drawer(f"{thing}_{ending}"))


def _drawer(address):
    home, function = address.rsplit(".", 1)

    def drawn(thing):
        return getattr(import_module(home), function)(thing)

    return drawn


if "IPython" in sys.modules and (_running := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_running)
