"""One load step of a model file in Kratos: co-rotational beams and cables, full Newton-Raphson. Prints one
line of JSON.

    python kratos.py MODEL.json DISPLACEMENTS.npy --tolerance N [--unit M] [--solver sparse_lu]

`iteration` is the time to equilibrium over the number of iterations: each sets its factorisation up anew.
"""

from __future__ import annotations

import json
import time

import KratosMultiphysics as KM
import KratosMultiphysics.LinearSolversApplication
import KratosMultiphysics.StructuralMechanicsApplication as SMA
import model as models
import numpy as np
from KratosMultiphysics import python_linear_solver_factory

YOUNG = 1e6  # Pa; with Poisson's ratio 0 the shear modulus is half of it, and the section's sizes follow
SOLVERS = [
    "sparse_lu",
    "skyline_lu_factorization",
]  # those of the wheel that are direct; without MKL there is no pardiso_ldlt


def build(model: models.Model) -> KM.ModelPart:
    """The model as a model part; numbers from 1. Local axes don't matter: EIy = EIz."""
    if (model.stiffness[:, 2] != model.stiffness[:, 3]).any():
        raise ValueError("this script doesn't turn sections: EIy and EIz must be equal")
    global kept
    kept = KM.Model()
    part = kept.CreateModelPart("Structure")
    part.ProcessInfo[KM.DOMAIN_SIZE] = 3
    for variable in (
        KM.DISPLACEMENT,
        KM.ROTATION,
        KM.REACTION,
        KM.REACTION_MOMENT,
        KM.VOLUME_ACCELERATION,
        SMA.POINT_LOAD,
        SMA.POINT_MOMENT,
    ):
        part.AddNodalSolutionStepVariable(variable)
    for number, place in enumerate(model.nodes.tolist(), 1):
        part.CreateNewNode(number, *place)
    sections = np.unique(model.stiffness, axis=0)
    for number, (axial, torsion, bending, _) in enumerate(sections.tolist(), 1):
        own = part.CreateNewProperties(number)
        own[KM.YOUNG_MODULUS], own[KM.POISSON_RATIO], own[KM.DENSITY] = (
            YOUNG,
            0.0,
            1.0,
        )  # Kratos asks for one, and no weight is applied
        own[SMA.CROSS_AREA], own[SMA.TORSIONAL_INERTIA] = axial / YOUNG, 2.0 * torsion / YOUNG
        own[SMA.I22] = own[SMA.I33] = bending / YOUNG
        own.SetValue(KM.CONSTITUTIVE_LAW, KM.KratosGlobals.GetConstitutiveLaw("BeamConstitutiveLaw").Clone())
    section = (np.argmin(np.abs(model.stiffness[:, None] - sections[None]).sum(axis=2), axis=1) + 1).tolist()
    for number, (ends, one) in enumerate(zip((model.ends + 1).tolist(), section, strict=True), 1):
        part.CreateNewElement("CrBeamElement3D2N", number, ends, part.GetProperties()[one])
    length = np.linalg.norm(model.nodes[model.cable_ends[:, 1]] - model.nodes[model.cable_ends[:, 0]], axis=1)
    if len(length) and (
        np.abs(model.cable_rest / length - 1.0).max() > 1e-9 or np.ptp(model.cable_stiffness) > 0.0
    ):
        raise ValueError("this script gives all cables one stiffness and no prestress")
    if len(length):
        own = part.CreateNewProperties(len(sections) + 1)
        own[KM.YOUNG_MODULUS], own[KM.DENSITY], own[SMA.CROSS_AREA] = (
            YOUNG,
            1.0,
            model.cable_stiffness[0] / YOUNG,
        )
        own[SMA.TRUSS_PRESTRESS_PK2] = 0.0
        own.SetValue(KM.CONSTITUTIVE_LAW, KM.KratosGlobals.GetConstitutiveLaw("TrussConstitutiveLaw").Clone())
        for number, ends in enumerate((model.cable_ends + 1).tolist(), len(model.ends) + 1):
            part.CreateNewElement("CableElement3D2N", number, ends, own)
    KM.VariableUtils().AddDof(KM.DISPLACEMENT_X, KM.REACTION_X, part)
    KM.VariableUtils().AddDof(KM.DISPLACEMENT_Y, KM.REACTION_Y, part)
    KM.VariableUtils().AddDof(KM.DISPLACEMENT_Z, KM.REACTION_Z, part)
    KM.VariableUtils().AddDof(KM.ROTATION_X, KM.REACTION_MOMENT_X, part)
    KM.VariableUtils().AddDof(KM.ROTATION_Y, KM.REACTION_MOMENT_Y, part)
    KM.VariableUtils().AddDof(KM.ROTATION_Z, KM.REACTION_MOMENT_Z, part)
    dofs = [
        KM.DISPLACEMENT_X,
        KM.DISPLACEMENT_Y,
        KM.DISPLACEMENT_Z,
        KM.ROTATION_X,
        KM.ROTATION_Y,
        KM.ROTATION_Z,
    ]
    nodes = part.Nodes
    for node, axis in np.argwhere(model.fixed).tolist():
        nodes[node + 1].Fix(dofs[axis])
    if model.load[:, 3:].any():
        raise ValueError("this script applies forces only")
    for number, node in enumerate(np.flatnonzero(model.load.any(axis=1)).tolist(), 1):
        part.CreateNewCondition("PointLoadCondition3D1N", number, [node + 1], part.GetProperties()[1])
        nodes[node + 1].SetSolutionStepValue(SMA.POINT_LOAD, model.load[node, :3].tolist())
    return part


def main() -> None:
    chosen = models.arguments(SOLVERS)
    KM.Logger.GetDefaultOutput().SetSeverity(KM.Logger.Severity.WARNING)
    model = models.read(chosen.model, chosen.unit)
    part = build(model)
    settings = KM.Parameters(json.dumps({"solver_type": chosen.solver}))
    solver = python_linear_solver_factory.ConstructSolver(settings)
    # Kratos divides the norm by the number of freedoms: with this the root mean square is at most the
    # tolerance.
    free = int((~model.fixed).sum())
    strategy = KM.ResidualBasedNewtonRaphsonStrategy(
        part,
        KM.ResidualBasedIncrementalUpdateStaticScheme(),
        KM.ResidualCriteria(1e-14, chosen.tolerance / free**0.5),
        KM.ResidualBasedBlockBuilderAndSolver(solver),
        30,
        False,
        False,
        True,
    )
    strategy.SetEchoLevel(0)
    strategy.Check()
    strategy.Initialize()
    part.CloneTimeStep(1.0)
    part.ProcessInfo[KM.STEP] = 1
    began = time.perf_counter()
    strategy.InitializeSolutionStep()
    strategy.Predict()
    converged = strategy.SolveSolutionStep()
    seconds = time.perf_counter() - began
    iterations = part.ProcessInfo[KM.NL_ITERATION_NUMBER]
    moved = np.array([list(node.GetSolutionStepValue(KM.DISPLACEMENT)) for node in part.Nodes])
    np.save(chosen.displacements, chosen.unit * moved)
    print(
        json.dumps(
            {
                "name": f"Kratos, {chosen.solver}",
                "converged": bool(converged),
                "iterations": iterations,
                "iteration": seconds / max(iterations, 1),
                "seconds": seconds,
            }
        )
    )


if __name__ == "__main__":
    main()
