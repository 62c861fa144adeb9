"""One shell, a saddle-free cap over an oblong plan, as meshes for tests, and files of it written in other
ways than shellform's own.
"""

import base64
import json

import numpy as np


def cap(columns=12, rows=8, length=6.0, width=4.0, rise=1.5):
    """Vertices (v, 3), m, and quadrilaterals (q, 4) of a paraboloid on its four corners."""
    x, y = np.meshgrid(np.linspace(-1, 1, columns + 1), np.linspace(-1, 1, rows + 1), indexing="ij")
    points = np.column_stack(
        [length / 2 * x.ravel(), width / 2 * y.ravel(), rise * (1 - (x**2 + y**2).ravel() / 2)]
    )
    at = np.arange(len(points)).reshape(columns + 1, rows + 1)
    quads = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)
    return points, quads


def split(quads):
    return np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def y_up(points):
    """As turned_up undoes it."""
    return np.column_stack([points[:, 0], points[:, 2], -points[:, 1]])


def write_obj(file, points, faces, head=""):
    lines = [
        head,
        *(f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()),
        *("f " + " ".join(str(k + 1) for k in face) for face in faces.tolist()),
    ]
    file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return file


def write_off(file, points, faces):
    rows = [f"{x!r} {y!r} {z!r}" for x, y, z in points.tolist()] + [
        f"{len(f)} " + " ".join(map(str, f)) for f in faces.tolist()
    ]
    file.write_text(
        "\n".join(["OFF", f"# a comment\n{len(points)} {len(faces)} 0", *rows]) + "\n", encoding="utf-8"
    )
    return file


def write_stl(file, points, triangles, text=False):
    corner = points[triangles]
    if text:
        facets = [
            "facet normal 0 0 1\nouter loop\n"
            + "\n".join(f"vertex {a!r} {b!r} {c!r}" for a, b, c in t.tolist())
            + "\nendloop\nendfacet"
            for t in corner
        ]
        file.write_text("solid shell\n" + "\n".join(facets) + "\nendsolid shell\n", encoding="utf-8")
        return file
    facets = np.zeros(len(triangles), np.dtype([("n", "<f4", 3), ("c", "<f4", (3, 3)), ("x", "<u2")]))
    facets["c"] = corner
    file.write_bytes(b"solid in name only".ljust(80) + np.uint32(len(triangles)).tobytes() + facets.tobytes())
    return file


def write_gltf(file, points, triangles, translation=(0.0, 0.0, 0.0)):
    """A glTF with its buffer inside, or a GLB, of y-up points that a node turns a quarter about y and
    moves.
    """
    data = points.astype("<f4").tobytes() + triangles.astype("<u2").tobytes()
    tree = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"name": "root", "children": [1], "rotation": [0, 2**-0.5, 0, 2**-0.5]},
            {"name": "shell", "mesh": 0, "translation": list(translation)},
        ],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": len(points), "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": triangles.size, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": 12 * len(points)},
            {"buffer": 0, "byteOffset": 12 * len(points), "byteLength": 2 * triangles.size},
        ],
        "buffers": [{"byteLength": len(data)}],
    }
    if file.suffix == ".gltf":
        tree["buffers"][0]["uri"] = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
        file.write_text(json.dumps(tree), encoding="utf-8")
        return file
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    data += b"\0" * (-len(data) % 4)
    size = 12 + 8 + len(text) + 8 + len(data)
    chunks = (
        np.uint32(len(text)).tobytes() + b"JSON" + text + np.uint32(len(data)).tobytes() + b"BIN\0" + data
    )
    file.write_bytes(b"glTF" + np.array([2, size], "<u4").tobytes() + chunks)
    return file


def compas_mesh(points, faces):
    """COMPAS 2's layout."""
    return {
        "dtype": "compas.datastructures/Mesh",
        "data": {
            "attributes": {},
            "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
            "default_face_attributes": {},
            "vertex": {str(k): {"x": x, "y": y, "z": z} for k, (x, y, z) in enumerate(points.tolist())},
            "face": {str(k): face for k, face in enumerate(faces.tolist())},
            "facedata": {},
        },
    }
