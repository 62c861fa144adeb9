"""What supports bear, and to which stretch of the edge each belongs."""

from types import SimpleNamespace

import numpy as np

from shellform.gridshell import reactions


def support(number, *force):
    return reactions.Support(number, 10 * number, "ground", "", (0.0, 0.0, 0.0), force)


def test_the_largest_of_what_supports_bear_is_told_and_what_they_bear_together():
    """The largest thrust is none of those that press or lift most."""
    found = reactions.Reactions(
        (
            support(0, 3.0, -4.0, 20.0),
            support(1, -6.0, 8.0, 1.0),
            support(2, 1.0, 0.0, -7.0),
            support(3, 0.0, 1.0, -2.0),
        )
    )
    assert (found.pressure, found.uplift, found.thrust) == (20.0, 7.0, 10.0)
    assert found.total == (-2.0, 5.0, 12.0)
    assert [each.pressure for each in found.supports] == [20.0, 1.0, 0.0, 0.0]
    assert [each.uplift for each in found.supports] == [0.0, 0.0, 7.0, 2.0]
    assert [each.thrust for each in found.supports] == [5.0, 10.0, 1.0, 1.0]


def test_a_support_belongs_to_the_held_stretch_that_is_nearest_and_to_the_ground_where_none_is_known():
    place = np.array([[0.0, 1.0, 0.0], [9.0, 9.0, 9.0], [5.0, 2.5, 0.0], [2.0, 2.9, 0.0]])
    lines = [
        SimpleNamespace(kind=kind, name=name, points=np.array([[0.0, y, 0.0], [6.0, y, 0.0]]))
        for kind, name, y in (("ground", "low", 0.0), ("free", "middle", 2.5), ("wall", "high", 5.0))
    ]
    net = SimpleNamespace(target=SimpleNamespace(positions=place), stretches=lines)
    assert reactions.edge_of(net, np.array([2, 0, 3])) == [
        ("ground", "low"),
        ("ground", "low"),
        ("wall", "high"),
    ]
    net.stretches = [lines[1]]
    assert reactions.edge_of(net, np.array([2, 0, 3])) == [("ground", "")] * 3


def test_a_support_pushes_with_what_its_node_is_short_of(monkeypatch):
    """Of the unbalanced forces of nodes 4 and 1, whose supports are numbered as the net has them."""
    forces = np.arange(36.0).reshape(6, 6) - 10.0
    shell = SimpleNamespace(net=SimpleNamespace(supports=np.array([4, 1])), network=lambda design: design)
    monkeypatch.setattr(
        reactions, "assemble", lambda _: SimpleNamespace(unbalanced=lambda _state, load: forces - load)
    )
    monkeypatch.setattr(reactions, "edge_of", lambda _net, held: [("ground", str(node)) for node in held])
    state = SimpleNamespace(positions=np.arange(18.0).reshape(6, 3))
    one, other = reactions.reactions(shell, None, state, np.full((6, 6), 0.5)).supports
    assert one == reactions.Support(0, 4, "ground", "4", (12.0, 13.0, 14.0), (13.5, 14.5, 15.5))
    assert other == reactions.Support(1, 1, "ground", "1", (3.0, 4.0, 5.0), (-4.5, -3.5, -2.5))
