"""The problem that most tests of searches solve."""

import shellform as sf


def misfit_and_force(shell, force, *, most=20.0, rms=0.005, variables=()):
    """Misfit and cable force under `force`, N, on every second crossing: cables of at most `most`, N, and a root
    mean square distance of at most `rms`, m, under 1.2 times that load; None for no such limit and load."""
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
