"""One load step of a model file in OpenSeesPy: co-rotational frames and trusses, full Newton-Raphson. Prints
one line of JSON.

    python opensees.py MODEL.json DISPLACEMENTS.npy --tolerance N [--unit M] [--solver SparseSYM]

`seconds` is the time to equilibrium, with the numbering and the symbolic analysis, as the user waits for it;
`iteration` is that of an iteration of a second, small load step, in which nothing is set up any more.
"""

from __future__ import annotations

import json
import time

import model as models
import numpy as np
import openseespy.opensees as ops

SOLVERS = {
    "SparseSYM": ("SparseSYM",),
    "UmfPack": ("UmfPack",),
    "BandSPD": ("BandSPD",),
    "ProfileSPD": ("ProfileSPD",),
}


def build(model: models.Model) -> None:
    """The model in OpenSees' one global domain; tags are numbers from 1."""
    ops.wipe()
    ops.model("basic", "-ndm", 3, "-ndf", 6)
    for tag, (place, fixed) in enumerate(
        zip(model.nodes.tolist(), model.fixed.astype(int).tolist(), strict=True), 1
    ):
        ops.node(tag, *place)
        if any(fixed):
            ops.fix(tag, *fixed)
    beams = zip((model.ends + 1).tolist(), model.stiffness.tolist(), model.z_axis.tolist(), strict=True)
    for tag, (ends, (axial, torsion, bending_y, bending_z), z_axis) in enumerate(beams, 1):
        ops.geomTransf("Corotational", tag, *z_axis)
        # A, E, G, J, Iy, Iz with E = G = 1
        ops.element("elasticBeamColumn", tag, *ends, axial, 1.0, 1.0, torsion, bending_y, bending_z, tag)
    ends = model.cable_ends
    length = np.linalg.norm(model.nodes[ends[:, 1]] - model.nodes[ends[:, 0]], axis=1)
    for k, (pair, own, stiffness, rest) in enumerate(
        zip(
            (ends + 1).tolist(),
            length.tolist(),
            model.cable_stiffness.tolist(),
            model.cable_rest.tolist(),
            strict=True,
        )
    ):
        elastic, strained = 2 * k + 1, 2 * k + 2
        # EA (l - l0) / l0 in terms of the strain over the distance of the nodes
        ops.uniaxialMaterial("Elastic", elastic, stiffness * own / rest, 0.0, 0.0)
        if rest != own:
            ops.uniaxialMaterial("InitStrainMaterial", strained, elastic, 1.0 - rest / own)
        ops.element("corotTruss", len(model.ends) + k + 1, *pair, 1.0, elastic if rest == own else strained)
    ops.timeSeries("Linear", 1)
    ops.pattern("Plain", 1, 1)
    for node in np.flatnonzero(model.load.any(axis=1)).tolist():
        ops.load(node + 1, *model.load[node].tolist())


def main() -> None:
    chosen = models.arguments(list(SOLVERS))
    model = models.read(chosen.model, chosen.unit)
    build(model)
    ops.constraints("Plain")
    # A band needs Cuthill and McKee's order; the others order their equations themselves.
    ops.numberer("RCM" if chosen.solver.endswith("SPD") else "Plain")
    ops.system(*SOLVERS[chosen.solver])
    ops.test("NormUnbalance", chosen.tolerance, 30, 0, 0)  # the largest component
    ops.algorithm("Newton")
    ops.integrator("LoadControl", 1.0)
    ops.analysis("Static")
    began = time.perf_counter()
    failed = ops.analyze(1)
    seconds = time.perf_counter() - began
    iterations = ops.testIter()
    moved = np.array([ops.nodeDisp(tag + 1)[:3] for tag in range(len(model.nodes))])
    np.save(chosen.displacements, chosen.unit * moved)
    ops.integrator("LoadControl", 0.01)
    began = time.perf_counter()
    again = ops.analyze(1)
    iteration = (time.perf_counter() - began) / max(ops.testIter(), 1)
    print(
        json.dumps(
            {
                "name": f"OpenSeesPy, {chosen.solver}",
                "converged": failed == 0 and again == 0,
                "iterations": iterations,
                "iteration": iteration,
                "seconds": seconds,
            }
        )
    )


if __name__ == "__main__":
    main()
