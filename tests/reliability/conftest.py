"""A small gridshell under load, whose drawn structures are loaded in a moment."""

import pytest

from shellform.reliability.perfect import perfect


@pytest.fixture(scope="session")
def nominal(dome):
    """Its initial design under a load that it bears."""
    return perfect(dome, dome.design(), dome.point_load(4.5, every=2))
