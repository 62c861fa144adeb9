"""Pictures of analysed models."""

import numpy as np

from shellform.output.pictures.model_states import draw_analysis
from shellform.structure.answers.analysis import analyse
from shellform.structure.model import parse_model


def test_an_analysis_is_drawn_with_its_critical_shape_and_its_modes(tmp_path):
    rod = {"EA": 1e5, "GJ": 1.0, "EIy": 1.0, "EIz": 1.0, "z_axis": [0, 1, 0]}
    model = parse_model(
        {
            "format": "shellform-model",
            "version": 1,
            "nodes": [[0, 0, k / 8] for k in range(9)],
            "beams": [{"nodes": [k, k + 1], **rod} for k in range(8)],
            "supports": [
                {"node": 0, "fixed": [True] * 6},
                {"node": 8, "fixed": [True, True, False, False, False, True]},
            ],
            "loads": {"push": [{"node": 8, "force": [0, 0, -4.0]}]},
        }
    )
    files = draw_analysis(analyse(model, mode_count=2, critical_to=10.0), tmp_path / "new")
    assert [file.name for file in files] == ["state.png", "critical.png", "mode-1.png", "mode-2.png"]
    import matplotlib.image

    for file in files:
        assert np.ptp(matplotlib.image.imread(file)) > 0.5
