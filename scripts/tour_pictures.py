"""Makes the documentation's pictures from a finished run of scripts/scale_model_radius.toml, small enough to
be kept beside the code.

scripts/shellform design scripts/scale_model_radius.toml --output runs/scale_model
python scripts/tour_pictures.py runs/scale_model
"""

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from shellform.output.pictures import render
from shellform.output.pictures.images import few_colours, write_film
from shellform.output.pictures.panel import Look, Skin
from shellform.run.figures import Wish, look_of, panel_of
from shellform.run.films import draw_film
from shellform.run.folder import Run, read_run

HERE = Path(__file__).parent / "pictures"
MAPS = ("utilisation", "curvature", "shear", "mode")


def main(folder: str) -> None:
    run = read_run(folder)
    skin = Skin(run.surface.vertices, run.surface.triangles)
    best = panel_of(run, run.best, "design")
    _save(
        "optimised-design",
        render.image(best, Look(limit=float(best.deviation.max()), size=(1200, 750), surface=skin)),
    )
    rows = [
        [panel_of(run, name, load) for load in ("none", "design", "additional")]
        for name in ("unbraced", "initial", "unloaded", run.best)
    ]
    look = look_of(run, Wish(size=(480, 330)), [panel for row in rows for panel in row])
    _save("deviations", render.sheet(None, rows, look, heading=run.case.title))
    _save("maps", _four(run))
    film(run)


def film(run: Run) -> None:
    """The erection at every second step, as a small GIF."""
    (whole,) = draw_film(run, "erection", Wish(quantity="utilisation", size=(640, 400), endings=(".gif",)))
    frames = []
    with Image.open(whole) as pages:
        for k in range(0, pages.n_frames, 2):
            pages.seek(k)
            frames.append(np.asarray(pages.convert("RGB")))
    write_film(HERE / "erection.gif", frames, rate=8)


def _four(run: Run) -> np.ndarray:
    pictures = []
    for quantity in MAPS:
        panel = panel_of(run, run.best, "design", quantity)
        pictures.append(render.image(panel, look_of(run, Wish(quantity=quantity, size=(720, 450)), [panel])))
    return np.vstack([np.hstack(pictures[:2]), np.hstack(pictures[2:])])


def _save(name: str, picture: np.ndarray) -> None:
    """As a PNG of 192 colours: a third of the size, and the eye sees no difference."""
    few_colours([picture], 192)[0].save(HERE / f"{name}.png", optimize=True)


if __name__ == "__main__":
    main(sys.argv[1])
