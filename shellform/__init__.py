"""Designing bending-active gridshells as falsework for concrete shells.

    import shellform as sf
    from shellform import cad, render

The public names stand in `__init__.pyi`. Each is loaded when it is first used: `import shellform` itself
loads no large library.
"""

from __future__ import annotations

import sys

from shellform import lazy

__version__ = "0.4.0"
__getattr__, __dir__ = lazy.public(__name__)

_SHOWN = {
    ("shellform.net.net", "Net"): "net",
    ("shellform.gridshell.gridshell", "Gridshell"): "gridshell",
    ("shellform.optimiser.optimum", "Optimum"): "optimum",
}
_KINDS = {"image/png": "png", "text/html": "html"}


def load_ipython_extension(ipython):  # typed in the stub
    """Nets, gridshells and optima show their picture, and where HTML is shown a view to be turned and picked
    in (`%load_ext shellform`; done by itself where IPython runs).
    """
    for kind, ending in _KINDS.items():
        formatter = ipython.display_formatter.formatters[kind]
        for (home, name), thing in _SHOWN.items():
            formatter.for_type_by_name(home, name, _drawer(f"{thing}_{ending}"))


def _drawer(function):
    def drawn(thing):
        from shellform.output import notebook

        return getattr(notebook, function)(thing)

    return drawn


if "IPython" in sys.modules and (_running := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_running)
