"""What the first process on a machine compiles computes as what later ones find in the cache."""

import importlib
import pkgutil

from numba.core.dispatcher import Dispatcher

import shellform


def loops():
    """All compiled functions of the package, by their names."""
    found = {}
    for module in pkgutil.walk_packages(shellform.__path__, "shellform."):
        if ".structure." in module.name or ".surface.shape." in module.name or ".net." in module.name:
            for name, thing in vars(importlib.import_module(module.name)).items():
                if isinstance(thing, Dispatcher):
                    found[f"{module.name}.{name}"] = thing
    return found


def test_no_compiled_function_calls_one_whose_sums_may_be_contracted():
    """Of such a one each that calls it has a copy, contracted in its own way; which copy is run depends on
    what was compiled and what came from the cache."""
    every = loops()
    contracted = {
        id(each)
        for each in every.values()
        if each.targetoptions.get("fastmath") and each.targetoptions.get("inline") != "always"
    }
    assert len(contracted) == 1, "the beams' own, or the test finds none"
    calling = [
        name
        for name, each in every.items()
        for used in each.py_func.__code__.co_names
        if id(each.py_func.__globals__.get(used)) in contracted
    ]
    assert calling == []
