"""An optimisation that is broken off goes on from where it stood, to the same design."""

import numpy as np
import pytest

import shellform as sf


@pytest.fixture(scope="module")
def problem(shell):
    openings = [
        [[x + r * np.cos(k * np.pi / 6), y + r * np.sin(k * np.pi / 6)] for k in range(12)]
        for x, y, r in [(0.47, 0.0, 0.132), (-0.47, -0.02, 0.132), (0.02, 0.29, 0.152), (-0.05, -0.29, 0.152)]
    ]
    wet = 1.1 * shell.point_load(
        6.9, every=2, openings=openings
    )  # whose 1.2 times the start doesn't bear: all phases are passed
    return sf.Problem(
        shell,
        sf.LoadCase("wet", wet),
        [sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))],
        [sf.AtMost(20.0, sf.CableForces("wet")), sf.AtMost(0.005, sf.RmsMisfit("wetter"))],
        [sf.LoadCase("wetter", 1.2 * wet)],
    )


def told(history):
    return [
        (step.evaluation, step.objective, step.constraints, step.cables, step.stage, step.accepted)
        for step in history
    ]


def test_a_search_resumed_in_any_phase_ends_with_the_same_design_and_history_to_the_bit(shell, problem):
    kept = []
    whole = sf.optimise(problem, shell.design(), evaluations=22, keep=kept.append)
    phases = [each.numbers["phase"] for each in kept]
    assert set(phases) == {"climb", "descend", "thin"}
    wary = next(k for k, each in enumerate(kept) if phases[k] == "descend" and each.arrays["excess"].any())
    for place in (phases.index("climb"), wary, phases.index("thin")):
        again = sf.optimise(problem, shell.design(), evaluations=22, resume=kept[place])
        np.testing.assert_array_equal(again.design.rest_length, whole.design.rest_length)
        np.testing.assert_array_equal(again.design.present, whole.design.present)
        assert told(again.history) == told(whole.history)
        assert (again.factorisations, again.evaluations, again.status) == (
            whole.factorisations,
            whole.evaluations,
            whole.status,
        )
