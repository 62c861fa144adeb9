"""Files as designers bring them, written by other programs and libraries than shellform: in mm, cm, feet and
m, y up and z up, clean and dirty.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import gmsh
import meshio
import numpy as np
import pyvista
import rhino3dm

from shellform.surface import cad
from shellform.surface.funicular import thrust_shell
from tests.surface.shells import cap, compas_mesh, write_gltf, write_obj, write_off, write_stl, y_up

ROOT = Path(__file__).parent.parent.parent
DATA, SURFACES = ROOT / "tests/data", ROOT / "surfaces"


@dataclass(frozen=True)
class Brought:
    """A file, `make`-n in a folder; what has to be stated of it; the `spacing`, m, of a net on it and its
    `angle`, degrees.
    """

    make: Callable[[Path], Path]
    spacing: float
    stated: dict[str, Any] = field(default_factory=dict)
    angle: float = 0.0


def rhino_model(unit):
    model = rhino3dm.File3dm()
    model.Settings.ModelUnitSystem = getattr(rhino3dm.UnitSystem, unit)
    return model


def rhino_add(model, layer, shape, name=""):
    attributes = rhino3dm.ObjectAttributes()
    attributes.LayerIndex = model.Layers.AddLayer(layer, (0, 0, 0, 255))
    attributes.Name = name
    model.Objects.Add(shape, attributes)


def rhino_mesh(points, quads):
    mesh = rhino3dm.Mesh()
    for x, y, z in points.tolist():
        mesh.Vertices.Add(x, y, z)
    for face in quads.tolist():
        mesh.Faces.AddFace(*face)
    return mesh


def nurbs_in_centimetres(folder):
    """A bicubic patch, with its site, an older mesh and its axes on other layers."""
    model = rhino_model("Centimeters")
    surface = rhino3dm.NurbsSurface.Create(3, False, 4, 4, 5, 5)
    rise = np.array([0.0, 0.8, 1.0, 0.8, 0.0])
    for i in range(5):
        for j in range(5):
            place = (
                300.0 * (i - 2) + 20.0 * (j - 2),
                250.0 * (j - 2),
                400.0 * (0.5 * rise[i] + 0.5 * rise[j] - 0.15 * (i == 4)),
            )
            surface.Points[i, j] = rhino3dm.Point4d(*place, 1.0)
    for knots in (surface.KnotsU, surface.KnotsV):
        for k, value in enumerate((0.0, 0.0, 0.0, 0.5, 1.0, 1.0, 1.0)):
            knots[k] = value
    rhino_add(model, "Shell", surface, "final")
    points, quads = cap()
    rhino_add(model, "Old", rhino_mesh(100 * points + 3000.0, quads), "draft 3")
    rhino_add(model, "Axes", rhino3dm.LineCurve(rhino3dm.Point3d(0, 0, 0), rhino3dm.Point3d(900, 0, 0)))
    model.Write(str(folder / "design.3dm"), 7)
    return folder / "design.3dm"


def mesh_in_feet(folder):
    model = rhino_model("Feet")
    points, quads = cap(columns=20, rows=14, length=30.0, width=24.0, rise=7.0)
    rhino_add(model, "Default", rhino_mesh(points, quads))
    model.Write(str(folder / "mesh.3dm"), 6)
    return folder / "mesh.3dm"


def barrel_brep(folder):
    """An extrusion: a flat arc drawn out, millimetres, as a Rhino brep of one face."""
    model = rhino_model("Millimeters")
    points = [rhino3dm.Point3d(*p) for p in [(-4000, 0, 0), (0, 0, 1800), (4000, 0, 0)]]
    rhino_add(
        model,
        "Shell",
        rhino3dm.Extrusion.Create(rhino3dm.Arc(*points).ToNurbsCurve(), 6000.0, False),
        "barrel",
    )
    model.Write(str(folder / "barrel.3dm"), 7)
    return folder / "barrel.3dm"


def dirty_stl(folder):
    """The paper-scale vault in millimetres and y up, as loose triangles in single precision, every seventh
    turned over, some twice.
    """
    vault = cad.build_surface(SURFACES / "vault.py", size=0.02)
    faces = vault.triangles.copy()
    faces[::7] = faces[::7, ::-1]
    return write_stl(folder / "vault.stl", 1000.0 * y_up(vault.vertices), np.vstack([faces, faces[:40]]))


def glb(folder):
    """The full-size shell, as a scene from a modelling program."""
    shell = cad.build_surface(SURFACES / "shell_18x11.py", size=0.5)
    return write_gltf(folder / "shell.glb", y_up(shell.vertices), shell.triangles, (5.0, 2.0, -3.0))


def ply_in_centimetres(folder):
    dome = cad.build_surface(SURFACES / "dome.py", size=0.03)
    meshio.Mesh(100.0 * dome.vertices, [("triangle", dome.triangles)]).write(folder / "dome.ply", binary=True)
    return folder / "dome.ply"


def clipped_vtp(folder):
    """The top of an ellipsoid as PyVista clips it: slivers along the cut, a pole of many triangles, several
    points at one place.
    """
    whole = pyvista.ParametricEllipsoid(4.0, 3.0, 2.0, u_res=40, v_res=40, w_res=40)
    cut = whole.clip("z", origin=(0, 0, 1.03), invert=False).triangulate()
    cut.extract_surface(algorithm="dataset_surface").save(folder / "half.vtp")
    return folder / "half.vtp"


def second_order_msh(folder):
    """A saddle on curved triangles, by gmsh itself, z = (x² - y²)/8."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        grid = np.linspace(-2.0, 2.0, 4)
        # Control points of x² on four uniform Bernstein abscissae over [-2, 2]: 4, -4/3, -4/3, 4.
        square = np.array([4.0, -4 / 3, -4 / 3, 4.0])
        tags = [
            occ.addPoint(x, y, (square[i] - square[j]) / 8)
            for j, y in enumerate(grid)
            for i, x in enumerate(grid)
        ]
        occ.addBSplineSurface(tags, 4)
        occ.synchronize()
        gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
        gmsh.model.mesh.generate(2)
        gmsh.model.mesh.setOrder(2)
        gmsh.write(str(folder / "saddle.msh"))
    finally:
        gmsh.finalize()
    return folder / "saddle.msh"


def vtu(folder):
    shell = cad.build_surface(SURFACES / "saddle.py", size=0.03)
    cells = [("triangle", shell.triangles), ("line", shell.triangles[:5, :2])]
    meshio.Mesh(shell.vertices, cells).write(folder / "saddle.vtu")
    return folder / "saddle.vtu"


def off_in_millimetres(folder):
    points, quads = cap(columns=24, rows=20, length=7000.0, width=6000.0, rise=1900.0)
    return write_off(folder / "cap.off", points, quads)


def two_patches_obj(folder):
    """Two patches of one paraboloid in centimetres, meshed apart, with a gap of half a millimetre and
    T-junctions.
    """

    def patch(x0, x1, columns, rows):
        x, y = np.meshgrid(np.linspace(x0, x1, columns + 1), np.linspace(-300, 300, rows + 1), indexing="ij")
        points = np.column_stack([x.ravel(), y.ravel(), 200 - (x.ravel() / 40) ** 2 - (y.ravel() / 30) ** 2])
        at = np.arange(len(points)).reshape(columns + 1, rows + 1)
        return points, np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], axis=-1).reshape(-1, 4)

    (left, first), (right, second) = patch(-350, 0, 14, 24), patch(0.05, 350, 16, 36)
    return write_obj(folder / "patches.obj", np.vstack([left, right]), np.vstack([first, second + len(left)]))


def solid_step(folder):
    """A dome 10 cm thick as a solid, millimetres and y up."""
    gmsh.initialize(interruptible=False)
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        occ = gmsh.model.occ
        gmsh.option.setString("Geometry.OCCTargetUnit", "MM")
        ball, hole = occ.addSphere(0, -3000, 0, 6000), occ.addSphere(0, -3000, 0, 5900)
        below = occ.addBox(-9000, -12000, -9000, 18000, 12000, 18000)
        occ.cut([(3, ball)], [(3, hole), (3, below)])
        occ.synchronize()
        gmsh.write(str(folder / "solid.step"))
    finally:
        gmsh.finalize()
    return folder / "solid.step"


def arched_step(folder):
    """A thrust shell on four corners 2.8 m wide, as a fitted B-spline in STEP; its arches are to be
    closed.
    """
    outline = [(-3, -5), (3, -5), (5, -3), (5, 3), (3, 5), (-3, 5), (-5, 3), (-5, -3)]
    shell = thrust_shell(outline, supports=[(1, 2), (3, 4), (5, 6), (7, 0)], rise=2.5, size=0.4)
    cad.write_fitted(folder / "arches.step", shell)
    return folder / "arches.step"


def compas_y_up(folder):
    points, quads = cap(columns=16, rows=16, length=9.0, width=9.0, rise=2.0)
    (folder / "mesh.json").write_text(json.dumps(compas_mesh(y_up(points), quads)))
    return folder / "mesh.json"


# Spacings: the chord of a segment s under a curvature κ is shorter by (κs)²/24, so that κs has to stay below
# 0.3 for half a per cent.
BROUGHT = {
    "compas_fd hypar, OBJ, m": Brought(lambda folder: SURFACES / "hypar.obj", 0.35),
    "RhinoVAULT with a hole, JSON, filled": Brought(
        lambda folder: DATA / "rhinovault_holes.json", 0.6, {"fill": "all"}
    ),
    "RhinoVAULT pillow, JSON": Brought(lambda folder: DATA / "rhinovault_pillow_vault.json", 0.7),
    "dome, STEP, mm": Brought(lambda folder: DATA / "dome_mm.step", 0.055),
    "dome, IGES, mm": Brought(lambda folder: DATA / "dome_mm.igs", 0.055),
    "dome, BREP, mm stated": Brought(lambda folder: DATA / "dome_mm.brep", 0.055, {"unit": "mm"}),
    "compas_tna plate, Rhino 3DM, mm": Brought(
        lambda folder: DATA / "tna_tutorial.3dm", 0.001, {"object": "mesh 1"}
    ),
    "NURBS by layer, Rhino 3DM, cm": Brought(nurbs_in_centimetres, 0.8, {"layer": "shell"}),
    "mesh, Rhino 3DM, ft": Brought(mesh_in_feet, 0.6),
    "barrel, Rhino 3DM, mm, y up": Brought(barrel_brep, 0.5),
    "vault, dirty STL, mm, y up": Brought(dirty_stl, 0.055, {"unit": "mm", "up": "y"}, 45.0),
    "full-size shell, GLB, y up": Brought(glb, 1.1, {}, 45.0),
    "dome, binary PLY, cm": Brought(ply_in_centimetres, 0.055, {"unit": "cm"}),
    "clipped ellipsoid, VTP": Brought(clipped_vtp, 0.4),
    "saddle, second-order MSH": Brought(second_order_msh, 0.25),
    "saddle, VTU with lines": Brought(vtu, 0.045),
    "cap, OFF, mm": Brought(off_in_millimetres, 0.5, {"unit": "mm"}),
    "two patches, OBJ, cm": Brought(two_patches_obj, 0.5, {"unit": "cm"}),
    "solid dome, STEP, mm, y up": Brought(solid_step, 0.7, {"up": "y", "face": "upper"}),
    "arched shell, STEP, filled": Brought(arched_step, 0.5, {"fill": "edges"}, 45.0),
    "cap, COMPAS JSON, y up": Brought(compas_y_up, 0.7, {"up": "y"}),
}
