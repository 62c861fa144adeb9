"""What is asked of two nodes under two loads on one path, for tests of the judge within a search."""

import numpy as np

from shellform.gridshell.tolerances import Tolerances
from shellform.reliability.requirements import Required
from shellform.reliability.safety import Safety

ROUGH = Tolerances(supports=1e-4, load_each=0.1, load_all=0.4)
DOWN = np.array([[0.0, 0.0, -6.0, 0.0, 0.0, 0.0]] * 2)
LOADS = {"wet": DOWN, "wetter": 1.25 * DOWN}


def asked_of(may, *, first=0, loads=None, **entries):
    safety = Safety(ROUGH, **{"critical_factor": None, "tried": 6, "drawn": 20, "seed": 3, **entries})
    return Required(safety, LOADS if loads is None else loads, "wet", may, first)
