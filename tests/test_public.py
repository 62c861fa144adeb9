"""What `import shellform as sf` shows: to a reader of `dir`, to editors and to type checkers."""

import inspect
import os
import shutil
import subprocess
import sys
import sysconfig
import typing
from pathlib import Path

import pytest

import shellform as sf
from shellform import lazy
from tests.test_layers import DOORS
from tests.test_readme import EXAMPLE

ROOT = Path(__file__).parent.parent
NAMES = sorted(lazy.homes("shellform"))
GIANTS = sorted({*DOORS, "scipy", "IPython", "trimesh"})


def test_every_public_name_is_what_the_stub_says():
    for package in (sf, sf.study):
        for name, (home, original) in lazy.homes(package.__name__).items():
            found = getattr(package, name)
            whole = f"{home}.{original}"
            assert found is (
                sys.modules[whole] if whole in sys.modules else vars(sys.modules[home])[original]
            )


def test_dir_shows_the_public_names_and_nothing_else():
    assert [name for name in dir(sf) if not name.startswith("__")] == NAMES
    assert "__version__" in dir(sf)
    assert [name for name in dir(sf.study) if not name.startswith("__")] == sorted(
        lazy.homes("shellform.study")
    )


def test_an_unknown_name_is_an_attribute_error_that_says_which():
    with pytest.raises(AttributeError, match="'shellform' has no attribute 'Problems'"):
        sf.Problems  # noqa: B018


def classes_in(hint: object) -> set[type]:
    if isinstance(hint, type) and not typing.get_args(hint):
        return {hint}
    return {each for part in typing.get_args(hint) for each in classes_in(part)}


def hinted(thing: object) -> set[type]:
    """The classes in the signature of a function, or of a class' fields and public methods."""
    parts = [thing]
    if isinstance(thing, type):
        inside = [getattr(each, "fget", each) for name, each in vars(thing).items() if name[0] != "_"]
        parts += [each for each in inside if inspect.isfunction(each)]
    home = vars(sys.modules[thing.__module__])
    unknown = {name: each for name, each in classes().items() if name not in home}  # under TYPE_CHECKING
    hints = [hint for part in parts for hint in typing.get_type_hints(part, localns=unknown).values()]
    return {each for hint in hints for each in classes_in(hint)}


def classes() -> dict[str, type]:
    """The classes of all modules of the package that are loaded."""
    loaded = [module for name, module in sys.modules.items() if name.startswith("shellform.")]
    found = [each for module in loaded for each in vars(module).values() if isinstance(each, type)]
    return {each.__name__: each for each in found}


def test_every_type_in_a_public_signature_can_be_imported_from_the_package():
    things = [getattr(sf, name) for name in NAMES]
    rooms = {each.__name__ for each in things if inspect.ismodule(each)}
    named = [each for each in things if isinstance(each, type) or inspect.isfunction(each)]
    hidden = {
        f"{used.__module__}.{used.__name__}, of {each.__name__}"
        for each in named
        for used in hinted(each) - set(named)
        if used.__module__.startswith("shellform.") and used.__module__ not in rooms
    }
    assert not hidden, "\n".join(sorted(hidden))


@pytest.fixture(scope="module")
def checked(tmp_path_factory) -> list[str]:
    """What `mypy --strict` says of a user's files, shellform being installed as a wheel would be. The giants
    are skipped: no public type comes from them, and reading them takes a minute.
    """
    folder = tmp_path_factory.mktemp("user")
    environment = folder / "venv"
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", environment], check=True)
    (packages,) = environment.glob("lib/python*/site-packages")
    shutil.copytree(ROOT / "shellform", packages / "shellform", ignore=shutil.ignore_patterns("__pycache__"))
    (packages / "others.pth").write_text(sysconfig.get_path("purelib"))
    shutil.copy(ROOT / "tests/user_script.py", folder / "script.py")
    shown = [f"reveal_type(sf.{name})" for name in NAMES]
    shown += [f"reveal_type(sf.study.{name})" for name in sorted(lazy.homes("shellform.study"))]
    (folder / "shown.py").write_text("\n".join(["import shellform as sf", *shown]))
    (folder / "example.py").write_text(EXAMPLE, encoding="utf-8")
    sections = [f"[mypy-{each}.*]\nfollow_imports = skip" for each in GIANTS]
    (folder / "mypy.ini").write_text("\n".join(["[mypy]", *sections]))
    (folder / "wrong.py").write_text("import shellform as sf\nsf.Problems\nsf.Rod.round(young='stiff')\n")
    strict = [sys.executable, "-m", "mypy", "--strict", "--no-color-output"]
    told = subprocess.run(
        [
            *strict,
            "--python-executable",
            environment / "bin/python",
            "script.py",
            "example.py",
            "shown.py",
            "wrong.py",
        ],
        cwd=folder,
        env={name: value for name, value in os.environ.items() if name not in ("PYTHONPATH", "MYPYPATH")},
        capture_output=True,
        text=True,
        check=False,
    )
    assert not told.stderr
    return told.stdout.splitlines()


@pytest.mark.parametrize("file", ["script.py", "example.py"])
def test_a_user_s_script_and_the_readme_s_example_are_clean_under_strict_types(checked, file):
    assert [line for line in checked if line.startswith(file)] == []


def test_type_checkers_see_a_type_behind_every_public_name(checked):
    seen = [line.partition("Revealed type is ")[2] for line in checked if line.startswith("shown.py")]
    assert len(seen) == len(NAMES) + len(lazy.homes("shellform.study"))
    assert [text for text in seen if text in ("", '"Any"')] == []


def test_type_checkers_refuse_an_unknown_name_and_a_wrong_argument(checked):
    wrong = [line for line in checked if line.startswith("wrong.py") and "error" in line]
    assert "attr-defined" in wrong[0]
    assert any("arg-type" in line for line in wrong[1:])
