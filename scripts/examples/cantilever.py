"""Any network of rods: a cantilever at large rotations, beside the small-deflection theory."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from shellform.structure.answers.analysis import analyse
from shellform.structure.model import parse_model

COUNT, EI = 16, 8.04
rod = {"EA": 2.0e6, "GJ": 6.2, "EIy": EI, "EIz": EI, "z_axis": [0, 1, 0]}
forces = np.linspace(2.0, 30.0, 8).tolist()
sunk = []
for force in forces:
    model = parse_model(
        {
            "format": "shellform-model",
            "version": 1,
            "nodes": [[k / COUNT, 0.0, 0.0] for k in range(COUNT + 1)],
            "beams": [{"nodes": [k, k + 1], **rod} for k in range(COUNT)],
            "supports": [{"node": 0, "fixed": [True] * 6}],
            "loads": {"tip": [{"node": COUNT, "force": [0.0, 0.0, -force]}]},
        }
    )
    sunk.append(-analyse(model, load="tip").equilibrium.state.positions[-1, 2])
figure, axes = plt.subplots(figsize=(7, 4))
axes.plot(forces, 1e3 * np.array(sunk), "o-", label="large rotations")
axes.plot(forces, 1e3 * np.array(forces) / (3.0 * EI), "--", label="P l³ / 3 EI")
axes.set(xlabel="force at the tip, N", ylabel="the tip sinks by, mm")
axes.legend()
figure.savefig("cantilever.png", dpi=150)
