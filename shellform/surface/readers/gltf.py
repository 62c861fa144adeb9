"""GLTF and GLB scenes (Khronos glTF 2.0): their meshes, placed by their nodes; and GLB files written.

The format's unit is the metre (many programs write others all the same: state it) and its vertical axis y.
Buffers may stand in the GLB, in the text as base64, or in files beside it or in folders below. Whole numbers
that stand for shares of one (`normalized`) are divided. Extensions that a scene needs are refused by name
unless they leave its shape alone, and so are compressed meshes (Draco, meshopt), instances and sparse
accessors; nodes with two parents too, which the format forbids: they could place a mesh without end.
"""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from shellform.arrays import Indices, Reals, Record
from shellform.errors import InputError
from shellform.surface.readers.draft import (
    MOST_BYTES,
    MOST_TRIANGLES,
    Choice,
    Draft,
    MeshObject,
    among,
    check_points,
    joined,
)

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTH = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}
_JSON, _BIN = 0x4E4F534A, 0x004E4942  # kinds of chunks of a .glb
_TRIANGLES, _STRIP, _FAN = 4, 5, 6  # modes of primitives
# Extensions that are read, or without which a scene has the same shape: whole numbers for coordinates, of
# which accessors tell, and what is seen of it
_KNOWN = ("KHR_mesh_quantization",)
_SEEN = ("KHR_materials_", "KHR_texture_", "EXT_texture_", "KHR_lights_")
_INSTANCES = "EXT_mesh_gpu_instancing"  # of a mesh, in a node
_TOLD = 80  # characters of an address that are quoted
_VERTICES, _ELEMENTS = 34962, 34963  # what a buffer view is for


def read_gltf(file: Path, choice: Choice) -> Draft:
    """The meshes of a scene; nodes' names are the objects' names. Raises InputError for what can't be
    used.
    """
    try:
        tree, inside = _opened(file)
        scene = _Scene(file, tree, inside)
        roots = (
            tree["scenes"][tree.get("scene", 0)].get("nodes", [])
            if tree.get("scenes")
            else range(len(tree.get("nodes", [])))
        )
        parts = scene.parts(scene.placed(roots), choice)
    except InputError:
        raise
    except (
        KeyError,
        IndexError,
        TypeError,
        ValueError,
        AttributeError,
        struct.error,
        OSError,
        OverflowError,
        RecursionError,
    ) as error:
        said = f"{type(error).__name__}: {error}"
        raise InputError(
            f"can't be read as glTF: {said}", where=str(file), remedy="Export it anew, uncompressed."
        ) from error
    return replace(joined(parts, Choice(), str(file)), up="y")


def _opened(file: Path) -> tuple[dict[str, Any], bytes]:
    """The scene's JSON and the GLB's binary part."""
    data = file.read_bytes()
    if data[:4] != b"glTF":
        return json.loads(data.decode("utf-8-sig")), b""
    length = struct.unpack_from("<I", data, 8)[0]
    if length > len(data):
        raise InputError(
            f"ends after {len(data)} of {length} bytes", where=str(file), remedy="Copy or export it anew."
        )
    at, tree, inside = 12, {}, b""
    while at + 8 <= length:
        size, kind = struct.unpack_from("<II", data, at)
        chunk = data[at + 8 : at + 8 + size]
        if kind == _JSON:
            tree = json.loads(chunk.decode("utf-8"))
        elif kind == _BIN:
            inside = chunk
        at += 8 + size
    return tree, inside


@dataclass(frozen=True, eq=False)
class Solid(Record):
    """What is written: triangles under a `name`, `points` (n, 3), m, z upwards, with `normals` (n, 3), in a
    `colour` (r, g, b, opacity), 0 to 1.
    """

    name: str
    points: Reals
    normals: Reals
    triangles: Indices
    colour: tuple[float, float, float, float]


def write_glb(path: Path, solids: Sequence[Solid]) -> None:
    """Writes the solids as one GLB, a node, a mesh and a material each; turned so that y is upwards, as the
    format has it.
    """
    data = b""
    views, accessors, meshes, materials = [], [], [], []

    def stored(array: NDArray[Any], kind: str, target: int) -> int:
        nonlocal data
        content = array.tobytes()
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": len(content), "target": target})
        data += content + b"\0" * (-len(content) % 4)
        code = next(number for number, name in _TYPES.items() if np.dtype(name) == array.dtype)
        entry = {"bufferView": len(views) - 1, "componentType": code, "count": len(array), "type": kind}
        if target == _VERTICES:
            entry |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        accessors.append(entry)
        return len(accessors) - 1

    for solid in solids:
        upright = [
            np.ascontiguousarray(each[:, [0, 2, 1]] * [1.0, 1.0, -1.0], dtype="<f4")
            for each in (solid.points, solid.normals)
        ]
        place, normal = (stored(each, "VEC3", _VERTICES) for each in upright)
        order = stored(solid.triangles.astype("<u4").ravel(), "SCALAR", _ELEMENTS)
        surface = {"baseColorFactor": list(solid.colour), "metallicFactor": 0.0, "roughnessFactor": 0.7}
        material: dict[str, Any] = {
            "name": solid.name,
            "pbrMetallicRoughness": surface,
            "doubleSided": solid.colour[3] < 1.0,
        }
        if solid.colour[3] < 1.0:
            material["alphaMode"] = "BLEND"
        materials.append(material)
        primitive = {
            "attributes": {"POSITION": place, "NORMAL": normal},
            "indices": order,
            "material": len(materials) - 1,
        }
        meshes.append({"name": solid.name, "primitives": [primitive]})
    tree = {
        "asset": {"version": "2.0", "generator": "shellform"},
        "scene": 0,
        "scenes": [{"nodes": list(range(len(meshes)))}],
        "nodes": [{"name": mesh["name"], "mesh": k} for k, mesh in enumerate(meshes)],
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data)}],
    }
    text = json.dumps(tree, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(data), _BIN) + data
    path.write_bytes(b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks)


@dataclass(frozen=True, eq=False)
class _Placed(Record):
    """A mesh's `primitive`, not yet loaded, at its `place` (4, 4) in the scene."""

    name: str
    layer: str
    primitive: dict[str, Any]
    place: Reals


class _Scene:
    """A scene's tables and its buffers, each loaded once."""

    def __init__(self, file: Path, tree: dict[str, Any], inside: bytes) -> None:
        self._file, self._tree, self._inside = file, tree, inside
        self._loaded: dict[int, bytes] = {}
        self._read: dict[int, NDArray[Any]] = {}
        for name in tree.get("extensionsRequired", []):
            if "draco" in name or "meshopt" in name:
                raise InputError(
                    f"is compressed ({name})", where=str(file), remedy="Export it without compression."
                )
            if name not in (*_KNOWN, _INSTANCES) and not name.startswith(_SEEN):
                raise InputError(
                    f"needs an extension that isn't read here ({name[:_TOLD]})",
                    where=str(file),
                    remedy="Export it without that extension.",
                )

    def placed(self, roots: Iterable[int]) -> list[_Placed]:
        """Every mesh that the nodes from `roots` on place, in their order."""
        entries, found, seen = self._tree.get("nodes", []), [], set()
        waiting = [(root, np.eye(4)) for root in reversed(list(roots))]
        while waiting:
            node, above = waiting.pop()
            if node in seen:
                raise InputError(
                    f"its node {node} has two parents, or its nodes go round in a circle",
                    where=str(self._file),
                    remedy="Export it anew.",
                )
            seen.add(node)
            entry = entries[node]
            here = above @ _placement(entry)
            if _INSTANCES in entry.get("extensions", {}):
                raise InputError(
                    f"its node {node} places a mesh many times by an extension that isn't read here "
                    f"({_INSTANCES})",
                    where=str(self._file),
                    remedy="Export it without instancing, as a node or a mesh for each.",
                )
            if "mesh" in entry:
                mesh = self._tree["meshes"][entry["mesh"]]
                layer = str(mesh.get("name") or "")
                name = str(entry.get("name") or layer)
                found += [_Placed(name, layer, primitive, here) for primitive in mesh["primitives"]]
            waiting += [(child, here) for child in reversed(entry.get("children", []))]
        return found

    def parts(self, placed: Sequence[_Placed], choice: Choice) -> list[MeshObject]:
        """The chosen ones of the placed meshes, loaded."""
        chosen = among([(each.layer, each.name) for each in placed], choice, str(self._file))
        result: list[MeshObject] = []
        corners = 0
        for each in (mesh for mesh, meant in zip(placed, chosen, strict=True) if meant):
            loaded = self._part(each)
            result += loaded
            corners += sum(len(one.points) + one.faces[0].size for one in loaded)
            if corners > 6 * MOST_TRIANGLES:
                raise InputError(
                    f"places its meshes {len(placed):,} times, with more than {MOST_TRIANGLES:,} triangles "
                    f"or their corners",
                    where=str(self._file),
                    remedy="Choose one by surface.object (--object), or export the surface alone.",
                )
        return result

    def _part(self, placed: _Placed) -> list[MeshObject]:
        primitive, place = placed.primitive, placed.place
        mode = primitive.get("mode", _TRIANGLES)
        if mode not in (_TRIANGLES, _STRIP, _FAN) or "POSITION" not in primitive["attributes"]:
            return []
        points = np.asarray(self._accessor(primitive["attributes"]["POSITION"], 3), dtype=float)
        check_points(points, str(self._file))
        order = (
            np.asarray(self._accessor(primitive["indices"], 1), dtype=np.int64).ravel()
            if "indices" in primitive
            else np.arange(len(points))
        )
        moved = points @ place[:3, :3].T + place[:3, 3]
        return [MeshObject(placed.name, placed.layer, moved, (_faces(order, mode),))]

    def _accessor(self, index: int, wide: int) -> NDArray[Any]:
        """The rows (n, wide) of an accessor, read once."""
        if index not in self._read:
            self._read[index] = self._rows(self._tree["accessors"][index])
        rows = self._read[index]
        if rows.shape[1] != wide:
            raise InputError(
                f"its accessor {index} has {rows.shape[1]} numbers a row, not {wide}",
                where=str(self._file),
                remedy="Export it anew.",
            )
        return rows

    def _rows(self, entry: dict[str, Any]) -> NDArray[Any]:
        if "sparse" in entry or "bufferView" not in entry:
            raise InputError(
                "has sparse accessors", where=str(self._file), remedy="Export it with plain ones."
            )
        view = self._tree["bufferViews"][entry["bufferView"]]
        kind, width, count = (
            np.dtype(_TYPES[entry["componentType"]]),
            _WIDTH[entry["type"]],
            int(entry["count"]),
        )
        row = kind.itemsize * width
        stride = view.get("byteStride") or row
        begin = view.get("byteOffset", 0) + entry.get("byteOffset", 0)
        data = self._buffer(view["buffer"])
        if count < 1 or stride < row or begin < 0 or begin + (count - 1) * stride + row > len(data):
            raise InputError(
                "its buffers are shorter than it says",
                where=str(self._file),
                remedy="Copy or export it anew.",
            )
        rows = np.ndarray((count, width), kind, data, begin, (stride, kind.itemsize)).copy()
        if entry.get("normalized") and kind.kind != "f":
            return np.maximum(rows / np.iinfo(kind).max, -1.0)  # both -128 and -127 are -1
        return rows

    def _buffer(self, index: int) -> bytes:
        if index not in self._loaded:
            uri = self._tree["buffers"][index].get("uri")
            if uri is None:
                self._loaded[index] = self._inside
            elif uri.startswith("data:"):
                self._loaded[index] = base64.b64decode(uri.partition(",")[2])
            else:
                self._loaded[index] = self._beside(uri).read_bytes()
        return self._loaded[index]

    def _beside(self, uri: str) -> Path:
        """The file that a buffer's address names, in the scene's folder or below. Raises InputError."""
        beside = _place(self._file, uri)
        if beside is None:
            raise InputError(
                f"its buffer {uri[:_TOLD]!r} lies outside its folder, where nothing is read",
                where=str(self._file),
                remedy="Copy both into one folder, or export a GLB.",
            )
        if not beside.is_file():
            raise InputError(
                f"its buffer {uri[:_TOLD]} isn't beside it",
                where=str(self._file),
                remedy="Copy both, or export a GLB.",
            )
        if beside.stat().st_size > MOST_BYTES:
            raise InputError(
                f"its buffer {uri[:_TOLD]} is {beside.stat().st_size / 1024**2:,.0f} MB large",
                where=str(self._file),
                remedy="Export a coarser mesh, or the surface alone.",
            )
        return beside


def surface_files(file: Path) -> list[Path]:
    """What a surface's file, in any format, is read from: itself and, where it is a scene, the buffers that
    it names in its folder or below, there or not. One that can't be read names none; its reader says why.
    """
    try:
        status = file.stat()
        named = _named(file, status.st_size, status.st_mtime_ns)
    except (ValueError, TypeError, AttributeError, struct.error, OSError, RecursionError, InputError):
        named = ()
    return [file, *named]


@cache
def _named(file: Path, size: int, written: int) -> tuple[Path, ...]:
    """The buffers that a file names as it was when it had this size and time: studies ask many times."""
    with open(file, "rb") as begun:
        head = begun.read(64).lstrip()
    if size > MOST_BYTES or not head.startswith((b"glTF", b"{")):
        return ()
    tree = _opened(file)[0]
    uris = [each["uri"] for each in tree.get("buffers", []) if "uri" in each]
    places = [_place(file, uri) for uri in uris if not uri.startswith("data:")]
    return tuple(dict.fromkeys(each for each in places if each is not None))


def _place(file: Path, uri: str) -> Path | None:
    """Where a buffer's address leads from a scene's file; None out of its folder."""
    folder, named = file.parent.resolve(), unquote(uri)
    place = None if "\0" in named else (folder / named).resolve()
    return place if place and place.is_relative_to(folder) else None


def _placement(entry: dict[str, Any]) -> Reals:
    """A node's transformation (4, 4)."""
    if "matrix" in entry:
        return np.array(entry["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = entry.get("rotation", (0.0, 0.0, 0.0, 1.0))
    turn = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    result = np.eye(4)
    result[:3, :3] = turn * np.array(entry.get("scale", (1.0, 1.0, 1.0)), dtype=float)
    result[:3, 3] = entry.get("translation", (0.0, 0.0, 0.0))
    return result


def _faces(order: Indices, mode: int) -> Indices:
    if mode == _TRIANGLES:
        return order[: len(order) // 3 * 3].reshape(-1, 3)
    if mode == _FAN:
        return np.column_stack([np.full(len(order) - 2, order[0]), order[1:-1], order[2:]])
    strip = np.column_stack([order[:-2], order[1:-1], order[2:]])
    strip[1::2] = strip[1::2, ::-1]  # every second triangle of a strip runs the other way
    return strip
