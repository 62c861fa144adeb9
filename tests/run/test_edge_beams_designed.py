"""A shell whose edges hang on stiff beams, from its surface to the verdict."""

from shellform.case.case import load_case
from shellform.optimiser.optimum import Checkpoint
from shellform.run import optimising
from shellform.run.run import run_case
from tests.net.edge_shells import barrel

CASE = """
[surface]
file = "barrel.obj"
[net]
spacing = 0.1
angle = 45
elements = 2
[rod]
young = 40e9
strength = 600e6
density = 2000.0
radius = 0.0012
[joint]
axial = 7.15e4
torsion = 7.38e-4
bending = 7.85e-4
gap = 0.0024
[cable]
stiffness = 2000.0
force_max = 20.0
without = false
[edges.beam]            # two million times as stiff as the rods: rounding hides the load in double precision
radius = 0.03
young = 210e9
strength = 355e6
density = 7850.0
[load]
force = 0.5
every = 2
[optimise]
misfit_rms_additional = 0.005
evaluations = 6
polish = 0
unloaded = false
[safety]
drawn = 2
compared = 1
"""


def test_a_shell_on_stiff_edge_beams_is_optimised_and_holds(tmp_path, monkeypatch):
    surface = barrel()
    lines = [f"v {x} {y} {z}" for x, y, z in surface.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in surface.triangles + 1]
    (tmp_path / "barrel.obj").write_text("\n".join(lines), encoding="utf-8")
    (tmp_path / "case.toml").write_text(CASE, encoding="utf-8")
    kept: list[Checkpoint] = []
    monkeypatch.setattr(
        optimising, "save_checkpoint", lambda folder, key, checkpoint: kept.append(checkpoint)
    )
    summary = run_case(load_case(tmp_path / "case.toml"), tmp_path / "run", until="safety")
    assert "beam" in {each.kind for each in summary.net.edges}
    assert any("additional tail" in each.arrays for each in kept)  # twice the digits were called for
    assert all(each.on_branch for each in summary.designs["initial"].loads.values())
    best = summary.designs["optimised"]
    assert best.loads["design"].deviation_max < 0.7 * summary.designs["initial"].loads["design"].deviation_max
    assert summary.verdict.holds, summary.verdict.failed
