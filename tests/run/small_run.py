"""A run folder in seconds: the vault with rods twice as far apart, and a design with every third cable left
out in the optimised one's place."""

from dataclasses import replace

import numpy as np
from PIL import Image

from shellform.case.case import load_case
from shellform.problem.paths import follow
from shellform.records.stages import StagesDone, write_stages
from shellform.records.summary import write_summary
from shellform.run.designs import write_design
from shellform.run.folder import read_run
from shellform.run.keys import stage_keys
from shellform.run.run import run_case
from tests.records.made import optimisation

HISTORY = """evaluation,accepted,objective,term.misfit,term.cable_force,constraint.cable_force,constraint.misfit.additional,cables,stage,seconds
0,1,1.0,0.7,0.3,-0.7,22.5,281,1.0,0.6
1,0,2.0,1.7,0.3,-0.7,nan,281,1.0,0.9
2,1,0.4,0.1,0.3,-0.6,-0.5,200,1.0,1.8
"""


def small_case(root, *settings):
    """The vault with rods twice as far apart, of half as many elements."""
    return load_case(
        root / "scripts/scale_model.toml",
        ["net.spacing=0.11", "net.elements=2", "surface.size=0.03", "load.force=2.0", *settings],
    )


def begin(root, folder, *settings):
    """A run until the stage "initial": not optimised, and without pictures."""
    run_case(small_case(root, *settings), folder, until="initial")
    return folder


def finish(folder):
    """What the later stages would leave in the folder, made without optimising."""
    run = read_run(folder)
    start = run.designs["initial"]
    design = replace(start, present=start.present & (np.arange(len(start.present)) % 3 > 0))
    record = write_design(
        folder, run.shell, "optimised", design, follow(run.shell, design, run.loads), run.loads
    )
    constraints = {"cable_force": -0.5, "misfit.additional": -0.1, "softness.additional": -0.2}
    summary = run.summary.with_design("optimised", record)
    write_summary(folder, replace(summary, optimisation=optimisation(constraints)))
    (folder / "history.csv").write_text(HISTORY, encoding="utf-8")
    write_stages(folder, StagesDone(stage_keys(run.case)))
    shade = np.linspace(0, 255, 64).astype(np.uint8)
    for name in ("deviations", "optimised-design", "net-skew"):
        Image.fromarray(np.dstack([np.tile(shade, (40, 1))] * 3)).save(folder / f"figures/{name}.png")
    return folder
