"""Imports point strictly downwards, and each third-party giant has one door."""

import ast
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "shellform"
FLOORS = {"errors": -1, "compiled": -1, "arrays": 0, "written": 0, "surface": 1, "structure": 1, "net": 2, "design": 3, "output": 4, "notebook": 5, "study": 5, "terminal": 5, "commands": 6, "cli": 7}
DOORS = {
    "binpacking": {"output/nesting.py"},
    "jinja2": {"output/template.py"},
    "ezdxf": {"output/drawings.py"},
    "openpyxl": {"output/tables.py"},
    "gmsh": {"surface/occ.py"},
    "meshio": {"surface/meshes.py"},
    "rhino3dm": {"surface/rhino.py"},
    "vtkmodules": {"output/scene.py", "output/vtp.py", "surface/vtkfiles.py"},
    "nlopt": {"design/convex.py"},
    "pyvista": {"output/scene.py"},
    "vtk": {"output/scene.py"},
    "matplotlib": {"output/plots.py"},
    "PIL": {"output/images.py"},
    "imageio_ffmpeg": {"output/images.py"},
    "cvxopt": {"structure/sparse.py", "design/convex.py"},
    "numba": {"compiled.py"},
    "dask": {"study/sweep.py"},
    "distributed": {"study/sweep.py"},
    "pyarrow": {"study/store.py"},
    "optuna": {"study/search.py"},
}
NOT_LOADED = ["jinja2", "ezdxf", "openpyxl", "gmsh", "meshio", "rhino3dm", "nlopt", "pyvista", "vtk", "matplotlib", "PIL", "IPython", "dask", "pyarrow", "optuna", "numba", "scipy", "numpy"]


def imports(path: Path) -> list[str]:
    found = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            found += [name.name for name in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module:
            found += [f"{node.module}.{name.name}" for name in node.names] + [node.module]
    return found


def modules() -> list[Path]:
    return [p for p in PACKAGE.rglob("*.py") if p.name not in ("__init__.py", "__main__.py")]


def test_imports_point_strictly_downwards_between_floors():
    for path in modules():
        room = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        for name in imports(path):
            parts = name.split(".")
            if parts[0] == "shellform" and len(parts) > 1 and parts[1] in FLOORS and parts[1] != room:
                assert FLOORS[parts[1]] < FLOORS[room], f"{path} imports {name}"


def test_each_giant_is_imported_behind_its_door_only():
    for path in modules():
        here = str(path.relative_to(PACKAGE))
        for name in imports(path):
            giant = name.split(".")[0]
            assert here in DOORS.get(giant, {here}), f"{here} imports {giant}"


def test_importing_shellform_loads_no_large_library():
    code = f"import sys, shellform; print([m for m in {NOT_LOADED} if m in sys.modules])"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stdout.strip() == "[]"


def test_the_public_names_of_the_package_exist():
    import shellform as sf

    for name in dir(sf):
        if not name.startswith("_") and name not in ("annotations", "importlib", "Any"):
            assert getattr(sf, name) is not None
