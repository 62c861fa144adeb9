"""How long pictures of a run take: the first in a fresh process, with all imports and the reading of the run;
those that follow; films' frames.

python scripts/picture_speed.py runs/scale_model
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

FIRST, NEXT = 8.0, 1.0  # s allowed, at paper scale on 2 cores without a graphics card
ONE = "from shellform.run.figures import Wish, draw_run; draw_run(sys.argv[1], Wish('initial', 'design'))"


def main(run: str) -> None:
    from shellform.output.pictures import render, scene
    from shellform.output.pictures.panel import Look, Skin
    from shellform.output.pictures.sheets import single
    from shellform.run.figures import panel_of
    from shellform.run.folder import read_run

    print(
        f"{'':34} {'by the clock':>14} {'allowed':>8} {'of it':>6} {'processor':>10}   (load {os.getloadavg()[0]:.1f})"
    )
    with _timed("first picture, fresh process", FIRST):
        subprocess.run(
            [sys.executable, "-c", f"import sys; {ONE}", run], check=True, stdout=subprocess.DEVNULL
        )
    known = read_run(run)
    panel, look = (
        panel_of(known, known.best, "design"),
        Look(surface=Skin(known.surface.vertices, known.surface.triangles)),
    )
    with tempfile.TemporaryDirectory() as folder:
        render.picture(Path(folder) / "warm.png", panel, look)
        with _timed("a further picture, alone", NEXT):
            render.picture(Path(folder) / "a.png", panel, look)
        with _timed("one of eight pictures in a row", NEXT, 8):
            render.pictures([Path(folder) / f"{k}.png" for k in range(8)], [panel] * 8, look)
        with _timed("a page of lines, PDF", NEXT):
            render.picture(Path(folder) / "a.pdf", panel, look)
        with _timed("a film's frame, 960 × 600", NEXT, 8):
            list(scene.paint(single([panel] * 8, Look(size=(960, 600)))))


@contextmanager
def _timed(what: str, allowed: float, count: int = 1) -> Iterator[None]:
    clock, processor = time.perf_counter(), sum(os.times()[:4])
    yield
    seconds, work = (time.perf_counter() - clock) / count, (sum(os.times()[:4]) - processor) / count
    print(f"{what:34} {seconds:12.2f} s {allowed:6g} s {seconds / allowed:6.2f} {work:8.2f} s")


if __name__ == "__main__":
    main(sys.argv[1])
