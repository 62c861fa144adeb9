"""A script for OpenSeesPy that computes a load case of a network anew: for a second opinion.

The nodes stand where they are free of stress (a gridshell's flat grid), and so do the co-rotational elements
on them. The displacements and rotations of the unloaded, bent state are given to them in one step: from zero,
a node's rotation vector is its total rotation, which is what OpenSees' co-rotational transformation takes
from its first increment. Elements notice what their nodes were given only after a solution: a first analysis,
with all nodes held but for one degree of freedom, does that (without it the first iteration begins with the
cables' prestress alone and is lost). Then everything but the supports is let go, equilibrium without load is
found from there, and the load is applied in increments by full Newton-Raphson, with a line search where that
fails.

Cables are co-rotational trusses of a material without compression: with the strain e over the distance L of
their stress-free nodes, N = EA (l - l⁰)/l⁰ = (EA L/l⁰) (e + 1 - l⁰/L) where positive.

OpenSees' frames are linear in their co-rotated frame as ours are, but turn that frame otherwise: both agree
as elements get shorter.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from shellform.arrays import Reals, reals
from shellform.errors import InputError
from shellform.structure.elements.state import State
from shellform.structure.network import Network

_HEAD = '''"""{title}

Written by shellform for OpenSeesPy (pip install openseespy; its wheels need Python 3.12). Run it:

    python {name} [DISPLACEMENTS.csv]

It finds the bent grid without load, applies the load {load!r} and compares with what shellform found. Units: m, N, rad.
Tags are shellform's numbers plus 1: nodes, then rods and connectors, then cables, as in the model file.
"""

import csv
import sys

import openseespy.opensees as ops

'''

_BODY = '''
STEPS = 10  # increments of the load
TOLERANCE = {tolerance!r}  # N, the unbalanced force at which an increment is done


def build():
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, place in enumerate(NODES, 1):
        ops.node(tag, *place)
    tag = 0
    for a, b, section, *z_axis in BEAMS:
        tag += 1
        axial, torsion, bending_y, bending_z = SECTIONS[section]
        ops.geomTransf("Corotational", tag, *z_axis)
        ops.element("elasticBeamColumn", tag, a + 1, b + 1, axial, 1.0, 1.0, torsion, bending_y, bending_z, tag)  # E = G = 1
    for k, (a, b, stiffness, rest) in enumerate(CABLES):
        tag += 1
        apart = sum((p - q) ** 2 for p, q in zip(NODES[a], NODES[b])) ** 0.5
        ops.uniaxialMaterial("Elastic", 2 * k + 1, stiffness * apart / rest, 0.0, 0.0)  # no compression
        ops.uniaxialMaterial("InitStrainMaterial", 2 * k + 2, 2 * k + 1, 1.0 - rest / apart)
        ops.element("corotTruss", tag, a + 1, b + 1, 1.0, 2 * k + 2)
    for tag, displacement in enumerate(START, 1):
        for dof, value in enumerate(displacement, 1):
            ops.setNodeDisp(tag, dof, value, "-commit")
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    for node, *force in LOAD:
        ops.load(node + 1, *force)


def settle():
    """The equilibrium without load from the start."""
    held = {{node: fixed for node, *fixed in SUPPORTS}}
    loose = next(node for node in range(len(NODES)) if node not in held)
    for node in range(len(NODES)):
        ops.fix(node + 1, *([1, 1, 1, 1, 1, 0] if node == loose else [1] * 6))
    advance(0.0, 1)
    for node in range(len(NODES)):
        for dof, fixed in enumerate(held.get(node, [0] * 6), 1):
            if not fixed and (node, dof) != (loose, 6):
                ops.remove("sp", node + 1, dof)
    return advance(0.0, 1)


def advance(step, times):
    """The places of the nodes after so many steps of the load."""
    for _ in range(times):
        for algorithm in [("Newton",), ("NewtonLineSearch", "-type", "Bisection")]:
            ops.wipeAnalysis()
            ops.constraints("Plain")
            ops.numberer("Plain")
            ops.system("UmfPack")
            ops.test("NormUnbalance", TOLERANCE, 100, 0, 0)
            ops.algorithm(*algorithm)
            ops.integrator("LoadControl", step)
            ops.analysis("Static")
            if ops.analyze(1) == 0:
                break
        else:
            sys.exit("no equilibrium was found")
    return [[ops.nodeCoord(tag, k) + ops.nodeDisp(tag, k) for k in (1, 2, 3)] for tag in range(1, len(NODES) + 1)]


def main():
    build()
    before = settle()
    after = advance(1.0 / STEPS, STEPS)
    moved = [[q - p for p, q in zip(*pair)] for pair in zip(before, after)]
    size = [sum(v * v for v in each) ** 0.5 for each in moved]
    off = [sum((v - w) ** 2 for v, w in zip(*pair)) ** 0.5 for pair in zip(moved, MOVED)]
    largest = max(sum(v * v for v in each) ** 0.5 for each in MOVED)
    print(f"largest displacement under the load: {{max(size):.6e}} m, by shellform {{largest:.6e}} m")
    print(f"largest difference: {{max(off):.3e}} m, {{100.0 * max(off) / largest:.4f}} % of it")
    if len(sys.argv) > 1:
        with open(sys.argv[1], "w", newline="", encoding="utf-8") as file:
            csv.writer(file).writerows([["x [m]", "y [m]", "z [m]"], *moved])


main()
'''


def opensees_script(
    network: Network, states: Sequence[State], load: Reals, *, title: str, name: str, case: str
) -> str:
    """The text of the script: `network`, its two `states` without and with the dead load `load` (n, 6), N and
    N·m.

    Raises InputError where a beam's rest length isn't the distance of its nodes, which the elements there
    can't say.
    """
    nodes, beams, cables = network.nodes, network.beams, network.cables
    bent, loaded = states
    forces = reals("load", load, (len(nodes), 6))
    if beams.built_in.any():
        raise InputError(
            "is built into the bent state, which OpenSees' frames can't say: they are without stress where "
            "their nodes are",
            where=f"beams[{int(np.argmax(beams.built_in))}]",
            remedy="Check this design with shellform analyse, which reads its model file.",
        )
    apart = np.linalg.norm(nodes[beams.ends[:, 1]] - nodes[beams.ends[:, 0]], axis=1)
    off = np.abs(beams.rest_length / apart - 1.0) > 1e-6
    if off.any():
        which = int(np.argmax(off))
        raise InputError(
            "its rest length isn't the distance of its nodes, which OpenSees' frames can't say",
            where=f"beams[{which}].rest_length",
            value=float(beams.rest_length[which]),
            remedy="Export another design, or analyse it with shellform analyse.",
        )
    stiffness = np.column_stack([beams.axial, beams.torsion, beams.bending_y, beams.bending_z])
    sections, section = np.unique(stiffness, axis=0, return_inverse=True)
    held = np.flatnonzero(network.fixed.any(axis=1))
    loaded_nodes = np.flatnonzero(forces.any(axis=1))
    start = np.hstack([bent.positions - nodes, bent.rotations])
    data = {
        "NODES": nodes.tolist(),
        "SECTIONS": sections.tolist(),
        "BEAMS": [
            (a, b, k, *axis)
            for (a, b), k, axis in zip(
                beams.ends.tolist(), section.ravel().tolist(), beams.frames[:, 0, :, 2].tolist(), strict=True
            )
        ],
        "CABLES": [
            (a, b, stiff, rest)
            for (a, b), stiff, rest in zip(
                cables.ends.tolist(), cables.stiffness.tolist(), cables.rest_length.tolist(), strict=True
            )
        ],
        "SUPPORTS": [
            (node, *row)
            for node, row in zip(held.tolist(), network.fixed[held].astype(int).tolist(), strict=True)
        ],
        "START": start.tolist(),
        "LOAD": [
            (node, *row)
            for node, row in zip(loaded_nodes.tolist(), forces[loaded_nodes].tolist(), strict=True)
        ],
        "MOVED": (loaded.positions - bent.positions).tolist(),
    }
    meaning = {
        "NODES": "places without stress",
        "SECTIONS": "EA, GJ, EIy, EIz",
        "BEAMS": "ends, section, a vector in the local x-z plane",
        "CABLES": "ends, EA, rest length",
        "SUPPORTS": "node, which of its degrees of freedom are held",
        "START": "displacements and rotation vectors of the bent grid without load",
        "LOAD": "node, force, moment",
        "MOVED": "displacements by shellform from there to the loaded state",
    }
    scale = float(np.abs(forces).max(initial=0.0)) or float(np.abs(beams.axial).max()) * 1e-9
    head = _HEAD.format(title=title.replace('"', "'").replace("\\", "/"), name=name, load=case)
    lists = "\n".join(
        f"{key} = [  # {meaning[key]}\n" + "".join(f"    {row},\n" for row in rows) + "]\n"
        for key, rows in data.items()
    )
    return head + lists + _BODY.format(tolerance=1e-6 * scale)
