"""Public names that are loaded when they are first used, from a package's stub."""

import importlib
import sys

import pytest

STUB = """
from package import room as room
from package.house import Door as Door, wide as broad
from package.house import _hidden as _hidden
Gate = Door
COUNT = 3
hint: int
"""


@pytest.fixture
def package(tmp_path, monkeypatch):
    place = tmp_path / "package"
    place.mkdir()
    code = "from shellform.lazy import public\n\n__getattr__, __dir__ = public(__name__)\n"
    (place / "__init__.py").write_text(code, encoding="utf-8")
    (place / "__init__.pyi").write_text(STUB, encoding="utf-8")
    (place / "room.py").write_text("size = 12.5\n", encoding="utf-8")
    house = "class Door:\n    pass\n\n\nwide = 0.9\nother = 0.7\n_hidden = 5\n"
    (place / "house.py").write_text(house, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    yield importlib.import_module("package")
    for name in [each for each in sys.modules if each.split(".")[0] == "package"]:
        del sys.modules[name]


def test_a_package_s_names_are_those_of_its_stub_and_nothing_is_loaded_before_one_is_used(package):
    assert "package.house" not in sys.modules
    assert [name for name in dir(package) if not name.startswith("__")] == ["Door", "Gate", "broad", "room"]
    assert "__name__" in dir(package)
    assert package.broad == 0.9
    assert "package.room" not in sys.modules
    assert package.room.size == 12.5
    assert package.Gate is package.Door is sys.modules["package.house"].Door


@pytest.mark.parametrize("name", ["wide", "other", "_hidden", "COUNT", "hint", "house2"])
def test_what_the_stub_does_not_export_is_no_name_of_the_package(package, name):
    with pytest.raises(AttributeError, match=f"module 'package' has no attribute '{name}'"):
        getattr(package, name)
