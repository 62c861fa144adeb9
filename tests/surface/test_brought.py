"""Files as designers bring them go to a net unattended, by the functions of the command line; what they must
say of themselves they say.
"""

import json

import numpy as np
import pytest

from shellform.records.progress import unheard
from shellform.run.first_look import check_file, net_alone
from tests.surface.brought import BROUGHT

SPACING_ERROR, DISTANCE = 0.005, 0.01  # of the spacing
SIZES = {  # m, of each file's shell: from its dimensions in the file's unit and axes, filled edges aside
    "compas_fd hypar, OBJ, m": (5, 5, 3),
    "RhinoVAULT with a hole, JSON, filled": (9.38, 9.47, 1.52),
    "RhinoVAULT pillow, JSON": (10, 10, 3.54),
    "dome, STEP, mm": (0.9, 0.7, 0.2),
    "dome, IGES, mm": (0.9, 0.7, 0.2),
    "dome, BREP, mm stated": (0.9, 0.7, 0.2),
    "compas_tna plate, Rhino 3DM, mm": (0.01, 0.01, 0),
    "NURBS by layer, Rhino 3DM, cm": (12.8, 10, 4.2),
    "mesh, Rhino 3DM, ft": (9.144, 7.315, 2.134),
    "barrel, Rhino 3DM, mm, y up": (8, 6, 1.8),
    "vault, dirty STL, mm, y up": (0.902, 0.551, 0.21),
    "full-size shell, GLB, y up": (11, 18, 4.2),
    "dome, binary PLY, cm": (0.9, 0.7, 0.2),
    "clipped ellipsoid, VTP": (6.86, 5.14, 0.97),
    "saddle, second-order MSH": (4, 4, 1),
    "saddle, VTU with lines": (0.9, 0.6, 0.18),
    "cap, OFF, mm": (7, 6, 1.9),
    "two patches, OBJ, cm": (7, 6, 1.766),
    "solid dome, STEP, mm, y up": (10.392, 10.392, 3),
    "arched shell, STEP, filled": (10.09, 10.09, 2.5),
    "cap, COMPAS JSON, y up": (9, 9, 2),
}


@pytest.mark.parametrize("name", BROUGHT)
def test_every_file_brought_is_read_at_its_true_size_in_one_piece(tmp_path, name):
    brought = BROUGHT[name]
    found = check_file(brought.make(tmp_path), brought.stated, allow_scripts=False)
    np.testing.assert_allclose(found.surface.size, SIZES[name], rtol=0.01, atol=1e-9)
    assert found.surface.holes == 0


FURTHER = {  # what the net misses, in parts of the spacing, where more than DISTANCE
    "clipped ellipsoid, VTP": 0.0115,  # beside an edge of long and thin triangles
    "arched shell, STEP, filled": 0.016,  # at the feet of the fill
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BROUGHT)
def test_every_file_brought_goes_to_a_net_unattended(tmp_path, name):
    brought = BROUGHT[name]
    told = net_alone(
        brought.make(tmp_path),
        tmp_path / "run",
        brought.stated,
        spacing=brought.spacing,
        angle=brought.angle,
        gap=None,
        allow_scripts=False,
        report=unheard,
    ).net
    net = json.loads((tmp_path / "run/net.json").read_text(encoding="utf-8"))
    assert told.crossings == len(net["crossings"]) > 60
    assert told.spacing_error_max < SPACING_ERROR
    assert told.distance_max < FURTHER.get(name, DISTANCE) * brought.spacing
    assert not folded_cells(net)


def folded_cells(net):
    """Cells of the lattice whose two triangles don't look the same way, or that turn against their
    neighbours.
    """
    place = {tuple(each["lattice"]): np.array(each["target"]) for each in net["crossings"]}
    folded = []
    for (i, j), corner in place.items():
        around = [place.get((i + a, j + b)) for a, b in ((1, 0), (1, 1), (0, 1))]
        if all(each is not None for each in around):
            b, c, d = around
            first, second = np.cross(b - corner, c - corner), np.cross(c - corner, d - corner)
            if first @ second <= 0.0:
                folded.append((i, j))
    return folded
