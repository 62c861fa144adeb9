"""Imports point strictly downwards, and each third-party giant has one door."""

import ast
import subprocess
import sys
from pathlib import Path

PACKAGE = Path(__file__).parent.parent / "shellform"
FLOORS = {
    "errors": 0,
    "compiled": 0,
    "arrays": 1,
    "written": 1,
    "tables": 2,
    "surface": 3,
    "structure": 3,
    "verification": 4,
    "net": 4,
    "gridshell": 5,
    "problem": 6,
    "optimiser": 7,
    "site": 8,
    "output": 9,
    "case": 10,
    "run": 11,
    "study": 12,
    "cli": 13,
}
DOORS = {
    "binpacking": {"output/workshop/nesting.py"},
    "jinja2": {"output/page/template.py"},
    "ezdxf": {"output/workshop/drawings.py"},
    "openpyxl": {"tables.py"},
    "gmsh": {"surface/occ.py"},
    "meshio": {"surface/readers/meshes.py"},
    "rhino3dm": {"surface/readers/rhino.py"},
    "vtkmodules": {"output/pictures/scene.py", "output/exchange/vtp.py", "surface/readers/vtkfiles.py"},
    "nlopt": {"optimiser/convex.py"},
    "pyvista": {"output/pictures/scene.py"},
    "vtk": {"output/pictures/scene.py"},
    "matplotlib": {"output/pictures/plots.py"},
    "PIL": {"output/pictures/images.py"},
    "imageio_ffmpeg": {"output/pictures/images.py"},
    "cvxopt": {"structure/solve/factorisation.py", "optimiser/convex.py"},
    "numba": {"compiled.py"},
    "dask": {"study/engine.py"},
    "distributed": {"study/engine.py"},
    "pyarrow": {"study/store.py"},
    "optuna": {"study/search.py"},
}
NOT_LOADED = [
    "jinja2",
    "ezdxf",
    "openpyxl",
    "gmsh",
    "meshio",
    "rhino3dm",
    "nlopt",
    "pyvista",
    "vtk",
    "matplotlib",
    "PIL",
    "IPython",
    "dask",
    "pyarrow",
    "optuna",
    "numba",
    "scipy",
    "numpy",
]


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
