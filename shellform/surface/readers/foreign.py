"""Readers of foreign libraries and of nested formats, and builder scripts, in a process of their own, so that
a crash, a hang or a flood of memory in them becomes a message.

The child imports one reader (gmsh, rhino3dm, meshio, plyfile or VTK; 0.3 to 0.5 s) and no SciPy, which would
take as long, reads, and hands its arrays back through a pipe: no file is needed for that.
"""

from __future__ import annotations

import io
import json
import os
import signal
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from shellform.errors import InputError, NotConverged, ShellformError
from shellform.processes import answering, command_of, end_with, surroundings
from shellform.surface.readers.allowance import allow_file, allow_mesh
from shellform.surface.readers.draft import Choice, Draft, Meshing

_LONGEST = 600.0  # seconds for one file
_MEMORY = 0.8  # of the machine's, for the reader
# how the system ends what took too long
_OUT_OF_TIME = -signal.SIGXCPU if hasattr(signal, "SIGXCPU") else None
# threads' stacks are memory
_ONE_THREAD = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
_ANEW = "Open it in the program that wrote it, check it, and export it anew or in another format."
_LIBRARIES = {
    "step": "gmsh", "iges": "gmsh", "brep": "gmsh", "3dm": "rhino3dm", "ply": "plyfile", "msh": "meshio",
    "vtk": "VTK", "vtu": "VTK", "vtp": "VTK", "vts": "VTK", "gltf": "the glTF reader", "script": "the builder script",
    "compas surface": "gmsh",
}  # fmt: skip


def read_foreign(file: Path, kind: str, settings: Mapping[str, Any], *, longest: float = _LONGEST) -> Draft:
    """What the reader of `kind` makes of a file. Raises InputError for what it refuses, and where it crashes,
    hangs or fills the memory.

    `settings` are `unit`, `size`, `up`, `layer`, `name` and `face`, as `read_surface` has them; of a builder
    script `size` and `dimensions`. Raises NotConverged where a script finds no form.
    """
    request = json.dumps({"file": str(file), "kind": kind, "settings": dict(settings), "parent": os.getpid()})
    try:
        child = subprocess.run(
            command_of("shellform.surface.readers.foreign"),
            input=request.encode(),
            capture_output=True,
            timeout=longest,
            env=surroundings() | _ONE_THREAD,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise InputError(
            f"{_LIBRARIES[kind]} hadn't come to an end after {longest:g} s",
            where=str(file),
            remedy=_remedy(kind),
        ) from error
    if child.returncode == _OUT_OF_TIME:
        raise InputError(
            f"{_LIBRARIES[kind]} took more time of a processor than files of its size do, and was ended",
            where=str(file),
            remedy=_remedy(kind),
        )
    if child.returncode < 0:
        name = signal.Signals(-child.returncode).name
        raise InputError(f"{_LIBRARIES[kind]} crashed on it ({name})", where=str(file), remedy=_remedy(kind))
    if child.returncode or not child.stdout:
        said = (child.stderr.decode(errors="replace").strip().splitlines() or ["without a word"])[-1]
        raise InputError(f"{_LIBRARIES[kind]} failed on it: {said}", where=str(file), remedy=_remedy(kind))
    with np.load(io.BytesIO(child.stdout), allow_pickle=False) as data:
        answer = json.loads(str(data["answer"]))
        if "refused" in answer:
            raise InputError(**answer["refused"])
        if "no result" in answer:
            raise NotConverged(**answer["no result"])
        normals = data.get("normals")
        return Draft(
            data["points"],
            data["triangles"],
            normals,
            answer["metres"],
            answer["up"],
            tuple(answer["notes"]),
            tuple(answer["objects"]),
            answer["of_solid"],
        )


def _remedy(kind: str) -> str:
    """What to do about a reader that failed: where memory is limited, that may be why."""
    usual = "Check the script." if kind == "script" else _ANEW
    if _allowed() is None:
        return usual
    return f"Raise the limit on memory (ulimit -v): it may be too small for the library. Else: {usual}"


def _serve() -> None:
    """The child's whole life: one request from standard input, one answer."""
    request = json.loads(sys.stdin.read())
    pipe = answering()
    end_with(request["parent"])
    _limit_memory()
    file = Path(request["file"])
    if request["kind"] != "script":  # whose work isn't told by its size
        allow_file(file)
    arrays: dict[str, Any] = {}
    try:
        draft = _read(file, request["kind"], request["settings"])
        answer: dict[str, Any] = {
            "metres": draft.metres,
            "up": draft.up,
            "notes": list(draft.notes),
            "objects": list(draft.objects),
            "of_solid": draft.of_solid,
        }
        arrays = {"points": draft.points, "triangles": draft.triangles}
        if draft.normals is not None:
            arrays["normals"] = draft.normals
    except InputError as error:
        value = (
            error.value
            if isinstance(error.value, str | int | float)
            else None
            if error.value is None
            else repr(error.value)
        )
        answer = {
            "refused": {"what": error.what, "where": error.where, "value": value, "remedy": error.remedy}
        }
    except NotConverged as error:  # a script that looks for a form
        answer = {"no result": {"what": error.what, "remedy": error.remedy}}
    except MemoryError:
        what = "needs more memory to read than files of its size do, or than this machine has or allows (ulimit -v)"
        answer = {"refused": {"what": what, "where": request["file"], "remedy": "Export a coarser mesh."}}
    content = io.BytesIO()
    np.savez(content, answer=np.array(json.dumps(answer)), **arrays)
    with os.fdopen(pipe, "wb") as out:
        out.write(content.getbuffer())


def _read(file: Path, kind: str, settings: Mapping[str, Any]) -> Draft:
    if kind == "script":
        from shellform.surface import cad

        return cad.read_script(file, size=settings["size"], dimensions=settings["dimensions"])
    choice, unit = Choice(settings["layer"], settings["name"]), settings["unit"]
    meshing = Meshing(settings["size"], settings["up"], settings["face"], allow_mesh)
    if kind == "compas surface":
        from shellform.surface.readers import compas_surfaces

        return compas_surfaces.read_compas_surfaces(file, choice, meshing, unit=unit)
    if _LIBRARIES[kind] == "gmsh":
        from shellform.surface import cad

        _refuse_choice(file, choice)
        return cad.read_cad(file, kind, meshing, unit=unit)
    if kind == "3dm":
        from shellform.surface.readers import rhino

        return rhino.read_rhino(file, choice, meshing, unit=unit)
    if kind == "ply":
        from shellform.surface.readers import ply

        return ply.read_ply(file, choice)
    if kind == "msh":
        from shellform.surface.readers import meshes

        return meshes.read_msh(file, choice)
    if kind == "gltf":
        from shellform.surface.readers import gltf

        return gltf.read_gltf(file, choice)
    from shellform.surface.readers import vtkfiles

    return vtkfiles.read_vtk(file, choice, kind)


def _refuse_choice(file: Path, choice: Choice) -> None:
    """Raises InputError where a layer or an object of a CAD file is asked for: gmsh tells neither."""
    for entry, wanted in (("surface.layer", choice.layer), ("surface.object", choice.name)):
        if wanted:
            raise InputError(
                f"of a CAD file like {file} no layers and names are read",
                where=entry,
                value=wanted,
                remedy="Leave it out; of separate surfaces one is chosen by surface.piece (--piece).",
            )


def _limit_memory() -> None:
    try:
        import resource
    except ImportError:  # not on Windows, where the system's own limit has to do
        return
    most = int(_MEMORY * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))
    most = min(most, _allowed() or most)
    resource.setrlimit(resource.RLIMIT_AS, (most, most))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))


def _allowed() -> int | None:
    """The bytes of memory that this process may have (ulimit -v); None where there is no limit."""
    try:
        import resource
    except ImportError:
        return None
    soft = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if soft == resource.RLIM_INFINITY else soft


if __name__ == "__main__":
    try:
        _serve()
    except ShellformError as refusal:  # a library that can't be loaded
        sys.exit(str(refusal))
