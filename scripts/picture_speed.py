"""How long pictures of a run take: the first in a fresh process, with all imports and the reading of the run; those that follow; films' frames.

    python scripts/picture_speed.py runs/scale_model
"""

import subprocess
import sys
import tempfile
import time
from pathlib import Path

FIRST, NEXT = 8.0, 1.0  # s allowed, at paper scale on 2 cores without a graphics card
ONE = "from shellform.study.pictures import Wish, draw_run; draw_run(sys.argv[1], Wish('initial', 'design'))"


def main(run: str) -> None:
    from shellform.output import render
    from shellform.output.page import single
    from shellform.output.panel import Look, Skin
    from shellform.study.folder import read_run
    from shellform.study.pictures import panel_of

    began = time.perf_counter()
    subprocess.run([sys.executable, "-c", f"import sys; {ONE}", run], check=True, stdout=subprocess.DEVNULL)
    _tell("first picture, fresh process", time.perf_counter() - began, FIRST)

    from shellform.output import scene

    known = read_run(run)
    panel, look = panel_of(known, known.best, "design"), Look(surface=Skin(known.surface.vertices, known.surface.triangles))
    with tempfile.TemporaryDirectory() as folder:
        render.picture(Path(folder) / "warm.png", panel, look)
        for what, count, work in [
            ("a further picture, alone", 3, lambda k: render.picture(Path(folder) / f"{k}.png", panel, look)),
            ("a page of lines, PDF", 3, lambda k: render.picture(Path(folder) / f"{k}.pdf", panel, look)),
        ]:
            began = time.perf_counter()
            for k in range(count):
                work(k)
            _tell(what, (time.perf_counter() - began) / count, NEXT)
        began = time.perf_counter()
        render.pictures([Path(folder) / f"{k}.png" for k in range(8)], [panel] * 8, look)
        _tell("one of eight pictures in a row", (time.perf_counter() - began) / 8, NEXT)
        began = time.perf_counter()
        for _ in scene.drawn(single([panel] * 8, Look(size=(960, 600)))):
            pass
        _tell("a film's frame, 960 × 600", (time.perf_counter() - began) / 8, NEXT)


def _tell(what: str, seconds: float, allowed: float) -> None:
    print(f"{what:34} {seconds:6.2f} s  {seconds / allowed:5.2f} of the {allowed:g} s allowed")


if __name__ == "__main__":
    main(sys.argv[1])
