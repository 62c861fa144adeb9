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

_PICTURES = {
    ("shellform.net.net", "Net"): "net_png",
    ("shellform.gridshell.gridshell", "Gridshell"): "gridshell_png",
    ("shellform.optimiser.optimum", "Optimum"): "optimum_png",
}


def load_ipython_extension(ipython):  # typed in the stub
    """Nets, gridshells and optima show their picture where they are displayed (`%load_ext shellform`; done by
    itself where IPython runs).
    """
    formatter = ipython.display_formatter.formatters["image/png"]
    for (home, name), function in _PICTURES.items():
        formatter.for_type_by_name(home, name, _drawer(function))


def _drawer(function):
    def drawn(thing):
        from shellform.output import notebook

        return getattr(notebook, function)(thing)

    return drawn


if "IPython" in sys.modules and (_running := sys.modules["IPython"].get_ipython()) is not None:
    load_ipython_extension(_running)
