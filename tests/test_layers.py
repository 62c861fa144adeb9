"""Imports point strictly downwards at every depth, lazy ones included; each third-party giant has one door; a
module holds one thing.
"""

import ast
import subprocess
import sys
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

PACKAGE = Path(__file__).parent.parent / "shellform"

# The floors of each package from the ground up; an import between two of its members points to a lower floor.
# A module belongs to the longest name here that it starts with. A package that isn't named has no fixed
# floors inside, and no circle either. The doors to gmsh stand in the middle of the readers: they hand over
# the same drafts, mended alike, and some readers ask gmsh to mesh what they found.
FLOORS = {
    "shellform": [
        ["errors", "work_clock", "lazy", "processes"],
        ["compiled", "quantities"],
        ["arrays", "written"],
        ["tables", "plan_rectangle"],
        ["structure"],
        ["surface"],
        ["verification", "net", "networks"],
        ["gridshell"],
        ["problem"],
        ["reliability"],
        ["optimiser"],
        ["site", "records"],
        ["output"],
        ["case"],
        ["run"],
        ["study"],
        ["cli"],
    ],
    "shellform.surface": [
        ["units", "shape", "bounded"],
        ["readers.draft", "readers.script", "readers.nurbs", "readers.stated", "readers.allowance"],
        ["readers.seams", "readers.sides"],
        ["readers.outliers", "readers.teeth"],
        ["readers.mend"],
        ["occ"],
        ["imports"],
        ["cad"],
        ["readers"],
        ["funicular"],
    ],
    "shellform.structure": [
        ["elements", "refusals"],
        ["solve"],
        ["network", "model_document"],
        ["model"],
        ["answers"],
        ["ahead"],
    ],
    "shellform.output": [["pictures"], ["workshop"], ["exchange"], ["frames"], ["page"], ["notebook"]],
}
# Behind which module each library lies. Of VTK two parts are used for two things that have no line in
# common: to draw, to read VTK's own files. Of CVXOPT two: CHOLMOD, and interior points.
DOORS = {
    "binpacking": "output/workshop/nesting.py",
    "cvxopt": "optimiser/quadratic.py",
    "cvxopt.cholmod": "structure/solve/factorisation.py",
    "dask": "study/engine.py",
    "distributed": "study/engine.py",
    "ezdxf": "output/workshop/drawings.py",
    "gmsh": "surface/occ.py",
    "imageio_ffmpeg": "output/pictures/images.py",
    "jinja2": "output/page/template.py",
    "matplotlib": "output/pictures/plots.py",
    "meshio": "surface/readers/meshes.py",
    "nlopt": "optimiser/convex.py",
    "numba": "compiled.py",
    "openpyxl": "tables.py",
    "optuna": "study/search.py",
    "PIL": "output/pictures/images.py",
    "pyarrow": "study/store.py",
    "pyvista": "output/pictures/scene.py",
    "plyfile": "surface/readers/ply.py",
    "rhino3dm": "surface/readers/rhino.py",
    "threadpoolctl": "structure/elements/threads.py",
    "vtk": "output/pictures/scene.py",
    "vtkmodules": "output/pictures/scene.py",
}
ALSO = {  # the further doors, for the reason above
    "cvxopt": {"structure/solve/factorisation.py"},
    "matplotlib": {"output/pictures/letters.py"},  # its fonts
    "vtkmodules": {"surface/readers/vtkfiles.py"},
}
SMALL = {"numpy", "scipy", "msgspec", "pydantic", "rich", "tomli_w", "typer"}  # used where they are needed
NOT_LOADED = sorted({*DOORS, *SMALL, "IPython"} - {"cvxopt.cholmod"})

LONGEST_MODULE, LONGEST_FUNCTION = 400, 80  # lines
# Kernels are straight-line arithmetic over one element, compiled as a whole: a seam would cost a call per
# element, or arrays between the halves.
KERNELS = {
    "structure/elements/beam_kernels.py": {"evaluate"},
    "surface/shape/locate.py": {"_inside"},  # a Newton iteration whose arrays are the caller's
}
LONG_MODULES: dict[str, str] = {  # module -> why it can't be cut
    "structure/elements/beam_kernels.py": "one compiled kernel and the pieces inlined into it",
}
SAME_NAME: dict[str, str] = {}  # public class -> why two rooms may share its name


def name_of(path: Path) -> str:
    parts = path.relative_to(PACKAGE.parent).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


@cache
def modules() -> dict[str, Path]:
    """The package's modules by dotted name, packages by their `__init__`."""
    return {name_of(path): path for path in sorted(PACKAGE.rglob("*.py")) if path.name != "__main__.py"}


@cache
def tree(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def imported(path: Path, package: str) -> set[str]:
    """The dotted names that a file imports at any depth, in functions and under TYPE_CHECKING too, with what
    a package's stub loads for it.
    """
    found = set()
    for node in ast.walk(tree(path)):
        if isinstance(node, ast.Import):
            found |= {each.name for each in node.names}
        elif isinstance(node, ast.ImportFrom):
            level = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            home = ".".join([*level, *([node.module] if node.module else [])])
            found |= {f"{home}.{each.name}" for each in node.names}
    stub = path.with_suffix(".pyi")
    return found | (imported(stub, package) if stub.exists() and stub != path else set())


@cache
def graph() -> dict[str, set[str]]:
    """Module -> modules of the package that it imports. The face of the package, `shellform/__init__`, stands
    above all of them and isn't part of the graph.
    """
    edges = {}
    for name, path in modules().items():
        package = name if path.name == "__init__.py" else name.rpartition(".")[0]
        used = set()
        for each in imported(path, package):
            while each and each not in modules():  # an attribute of a module
                each = each.rpartition(".")[0]
            used.add(each)
        edges[name] = used - {"", "shellform", name}
    del edges["shellform"]
    return edges


def circles(edges: dict[str, set[str]]) -> list[list[str]]:
    """The strongly connected components of more than one module (Tarjan 1972)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in sorted(edges[node]):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            component = [stack.pop()]
            while component[-1] != node:
                component.append(stack.pop())
            if len(component) > 1:
                found.append(sorted(component))

    for node in sorted(edges):
        if node not in index:
            visit(node)
    return found


def members(package: str) -> dict[str, int]:
    """The floor of each member of a package by its dotted name."""
    return {f"{package}.{each}": level for level, floor in enumerate(FLOORS[package]) for each in floor}


def member_of(module: str, package: str) -> str:
    """The member of a package that a module belongs to, or "" for none."""
    inside = [each for each in members(package) if f"{module}.".startswith(f"{each}.")]
    return max(inside, key=len, default="")


def test_circles_of_imports_are_found():
    assert circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a", "e"}, "e": set()}) == [["a", "b", "c"]]
    assert (
        member_of("shellform.surface.readers.mend", "shellform.surface") == "shellform.surface.readers.mend"
    )
    assert member_of("shellform.surface.readers.gltf", "shellform.surface") == "shellform.surface.readers"
    assert "shellform.output.pictures.vectors" in graph()["shellform.output.notebook"]  # within a function
    assert "shellform.run.run" in graph()["shellform.study"]  # in a stub


def test_no_modules_import_each_other_in_a_circle_at_any_depth():
    found = circles(graph())
    assert not found, "\n".join(" <-> ".join(each) for each in found)


@pytest.mark.parametrize("package", FLOORS)
def test_imports_point_strictly_downwards_between_floors(package):
    floor = members(package)
    upwards = []
    for name, used in graph().items():
        here = member_of(name, package)
        for other in used:
            there = member_of(other, package)
            if here and there and here != there and floor[there] >= floor[here]:
                upwards.append(f"{name} imports {other}")
    assert not upwards, "\n".join(upwards)


def test_every_room_has_its_floor_and_every_floor_its_room():
    for package in FLOORS:
        inside = {name for name in graph() if name.startswith(f"{package}.")}
        assert {name for name in inside if not member_of(name, package)} == set()
        assert set(members(package)) <= set(modules())


def test_rooms_ask_the_face_of_the_package_for_nothing_but_its_version_and_place():
    for name, path in modules().items():
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ImportFrom) and node.module == "shellform":
                assert {f"shellform.{each.name}" for each in node.names} <= {*modules()}, name
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                assert node.value.id != "shellform" or node.attr in ("__version__", "__file__"), name


def test_each_giant_is_imported_behind_its_door_only():
    for name, path in modules().items():
        here = path.relative_to(PACKAGE).as_posix()
        for each in imported(path, name):
            giant = each.split(".")[0]
            if (
                giant == "shellform"
                or giant in sys.stdlib_module_names
                or giant in SMALL | {"IPython", "mkl"}
            ):
                continue
            assert giant in DOORS, f"{here} imports {each}: name its door"
            assert here in {DOORS[giant], *ALSO.get(giant, ())}, f"{here} imports {each}"


def test_importing_shellform_loads_no_large_library():
    code = f"import sys, shellform; print([m for m in {NOT_LOADED} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_designing_does_not_wait_for_scipys_statistics():
    code = (
        "import sys, shellform.run.optimising, shellform.run.examination; print('scipy.stats' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"


def test_a_process_that_reads_a_surface_file_loads_no_scipy():
    readers = "foreign, compas_surfaces, gltf, meshes, ply, rhino, vtkfiles"
    code = (
        f"import sys, shellform.surface.cad; from shellform.surface.readers import {readers}; "
        "print('scipy' in sys.modules)"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "False"


def test_no_module_is_longer_than_a_reader_can_hold():
    length = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in modules().values()
    }
    long = [f"{name} has {lines} lines" for name, lines in length.items() if lines > LONGEST_MODULE]
    long = [each for each in long if each.split()[0] not in LONG_MODULES]
    assert not long, "\n".join(long)
    assert [name for name in LONG_MODULES if length[name] <= LONGEST_MODULE] == []  # no longer needed


def test_no_function_is_longer_than_a_screen_but_kernels():
    long, kernels = [], defaultdict(set)
    for path in modules().values():
        here = path.relative_to(PACKAGE).as_posix()
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                lines = (node.end_lineno or 0) - node.lineno + 1
                if lines > LONGEST_FUNCTION and node.name in KERNELS.get(here, ()):
                    kernels[here].add(node.name)
                elif lines > LONGEST_FUNCTION:
                    long.append(f"{here}: {node.name} has {lines} lines")
    assert not long, "\n".join(long)
    assert kernels == KERNELS


def test_no_two_public_classes_have_one_name():
    homes = defaultdict(list)
    for name, path in modules().items():
        for node in tree(path).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes[node.name].append(name)
    twice = {name: where for name, where in homes.items() if len(where) > 1}
    told = [f"{name}: {', '.join(where)}" for name, where in twice.items() if name not in SAME_NAME]
    assert not told, "\n".join(told)
    assert set(SAME_NAME) <= set(twice)


def commands() -> set[str]:
    """The modules of the commands. Each is named as what a user types, even where a room does the work under
    the same word: `shellform net` stands in cli/net.py.
    """
    from shellform.cli.program import app

    return {each.callback.__module__ for each in app.registered_commands if each.callback is not None}


def test_each_command_stands_in_the_module_of_its_name():
    assert len(commands()) >= 12
    assert commands() <= {name for name in modules() if name.startswith("shellform.cli.")}


def test_each_modules_name_is_its_own():
    homes = defaultdict(list)
    for name in set(modules()) - commands():
        parent, _, last = name.rpartition(".")
        heart = parent.rpartition(".")[2] == last  # of a room, which is named as the room: net/net.py
        if not heart:
            homes[last].append(name)
    told = [", ".join(sorted(names)) for names in homes.values() if len(names) > 1]
    assert not told, "\n".join(told)
