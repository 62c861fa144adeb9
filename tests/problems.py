"""The problem that most tests of searches solve, and a term's gradient against re-solved equilibria."""

import numpy as np
import pytest

import shellform as sf
from shellform.problem.evaluation import Evaluator
from shellform.problem.terms import LoadedDesign
from shellform.structure.network import assemble
from shellform.structure.solve.equilibrium import find_equilibrium


def misfit_and_force(shell, force, *, most=20.0, rms=0.005, variables=()):
    """Misfit and cable force under `force`, N, on every second crossing: cables of at most `most`, N, and a
    root mean square distance of at most `rms`, m, under 1.2 times that load; None for no such limit and
    load."""
    wet = shell.point_load(force, every=2)
    limits = [sf.AtMost(most, sf.CableForces("wet"))]
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))],
        limits if rms is None else [*limits, sf.AtMost(rms, sf.RmsMisfit("wetter"))],
        [] if rms is None else [sf.LoadCase("wetter", 1.2 * wet)],
        variables=[sf.RestLengths(), *variables],
    )


def solved(shell, design, near, load):
    """The equilibrium of the design near a state, to rounding."""
    return find_equilibrium(
        assemble(shell.network(design)), near, load, tolerance=1e-11, on_branch=True
    ).state


def assert_gradient_as_re_solved(shell, design, state, load, term):
    """The derivative of a term of one value under the load "wet" along a random change of all rest lengths,
    and by the radius, is that of differences of re-solved equilibria (Richardson's, of fourth order)."""
    problem = sf.Problem(
        shell,
        sf.LoadCase("wet", load),
        [sf.Share(0.6, sf.Misfit("wet")), sf.Share(0.4, sf.RodRadius())],
        [sf.AtMost(0.01, term)],
        variables=[sf.RestLengths(), sf.FreeRadius(0.0005, 0.0014)],
    )
    evaluator = Evaluator(problem, design)
    point = evaluator.linearised(evaluator.seed(design, {"wet": solved(shell, design, state, load)}, 1.0))
    for direction in (
        np.append(np.random.default_rng(3).normal(size=len(point.variables) - 1), 0.0),
        np.eye(len(point.variables))[-1],
    ):
        values = []
        for h in (4e-6, -4e-6, 2e-6, -2e-6):
            other = evaluator.blocks.design(point.variables + h * direction, design.present)
            there = solved(shell, other, point.states["wet"], load)
            values.append(term.measure(LoadedDesign(shell, other, there, load)).value[0] / 0.01)
        wide, near = (values[0] - values[1]) / 8e-6, (values[2] - values[3]) / 4e-6
        assert point.constraints_by_variables[0] @ direction == pytest.approx(
            (4.0 * near - wide) / 3.0, rel=1e-5
        )
