"""A first look at a surface tells what the net then comes to."""

import pytest

from shellform.case.build_net import net_settings
from shellform.case.entries import NetEntry
from shellform.net.chebyshev import net_at
from shellform.run.first_look import expected


@pytest.mark.parametrize(
    "entries", [{"elements": 2, "spacing_v": 0.1}, {"elements": 1}, {"spacing": 0.1, "spacing_v": 0.06}]
)
def test_crossings_and_freedoms_to_expect_are_those_of_the_spacings_and_elements_that_the_case_has(
    vault, entries
):
    entry = NetEntry(**{"spacing": 0.06, **entries})
    told = expected(vault, entry)
    net = net_at(vault, net_settings(entry, 0.0024), angle=0.0, offset=(0.0, 0.0))
    assert told.crossings == pytest.approx(len(net.grid.lattice), rel=0.15)
    assert told.freedoms == pytest.approx(6 * net.node_count, rel=0.15)
