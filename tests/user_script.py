"""A script as users write it, type-checked by test_public.py as mypy sees it beside the installed package."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import scipy.sparse as sp  # type: ignore[import-untyped]  # SciPy brings no types

import shellform as sf
from shellform import cad, render


@dataclass(frozen=True)
class Sag(sf.Term):
    """The mean sag below the target, m: a term that the package doesn't have."""

    name = "sag"
    load: str

    def measure(self, at: sf.LoadedDesign) -> sf.Measurement:
        nodes = len(at.state.positions)
        sag = float((at.shell.target.positions - at.state.positions)[:, 2].mean())
        slope = np.tile([0.0, 0.0, -1.0 / nodes, 0.0, 0.0, 0.0], nodes)
        return sf.Measurement(np.array([sag]), sp.csr_array(slope.reshape(1, -1)))


def braced(surface: sf.Surface, spacing: float) -> sf.Gridshell:
    net = sf.pull_net(surface, spacing=spacing, gap=0.002, angle=np.deg2rad(45.0))
    rod = sf.Rod.round(young=40e9, radius=min(0.001, net.max_radius(young=40e9, strength=255e6)))
    joint = sf.Joint(axial=7.15e4, torsion=7.38e-4, bending=7.85e-4, gap=0.002)
    return sf.brace(net, rod, joint, sf.Cable(stiffness=187.0), below=surface)


def designed(shell: sf.Gridshell) -> sf.Optimum:
    wet = shell.point_load(6.9, every=2)
    term: sf.Term = Sag("wet")
    problem = sf.Problem(
        shell,
        design_load=sf.LoadCase("wet", wet),
        further=[sf.LoadCase("wetter", 1.2 * wet)],
        minimise=[sf.Share(0.7, sf.Misfit("wet")), sf.Share(0.3, sf.CableForce("wet"))],
        constraints=[sf.AtMost(20.0, sf.CableForces("wet")), sf.AtMost(0.01, term)],
    )
    return sf.polish(sf.optimise(problem, shell.design(rest_ratio=0.99), evaluations=10))


def main() -> None:
    shell = braced(cad.build_surface("surfaces/dome.py", size=0.02), spacing=0.1)
    try:
        best = designed(shell)
    except (sf.InputError, sf.NotConverged) as error:
        raise SystemExit(str(error)) from error
    loaded: sf.Loaded = best.loaded["wet"]
    picture = render.deviation(Path("wet.png"), shell, best.states["wet"], best.design, limit=0.010)
    print(best.status, loaded.equilibrium.energy, picture.shape)


if __name__ == "__main__":
    main()
