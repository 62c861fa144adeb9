"""Cables: slack, hanging and prestressed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from shellform.structure.cable import make_cables
from shellform.structure.network import Network
from shellform.structure.verification.case import Row
from shellform.structure.verification.models import load_at, ropes, solved


def slack_pair() -> tuple[float, float]:
    """Tensions of two collinear cables with a load between them along the line."""
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    cables = make_cables([[0, 1], [1, 2]], rest_length=1.0, stiffness=187.0)
    network = ropes(points, cables, [0, 2])
    fixed = network.fixed.copy()
    fixed[1, 1:3] = True
    network = Network(points, network.beams, cables, fixed, network.imposed)
    first, second = cables.tension(solved(network, load_at(network, 1, [1.0, 0.0, 0.0])))
    return float(first), float(second)


def slack() -> Iterator[Row]:
    """Statics: of two collinear unstressed cables loaded in the middle one carries all, the other exactly nothing."""
    first, second = slack_pair()
    yield Row("collinear pair", "tension of the loaded cable", first, 1.0, 1e-8, "statics")
    yield Row("collinear pair", "tension of the slack cable", second, 0.0, 0.0, "statics")
