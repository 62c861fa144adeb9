"""Networks of one's own: the same model from arrays, from networkx, from COMPAS, whose documented calls
stand-ins answer here; and honest errors."""

from types import SimpleNamespace

import numpy as np
import pytest

import shellform as sf
from shellform.errors import InputError
from shellform.structure.answers.analysis import analyse
from shellform.structure.elements.sections import stiffness

NODES = [[0.0, 0.0, 0.0], [0.5, 0.0, 0.3], [1.0, 0.0, 0.0]]
ROD = (2.0e6, 6.2, 8.04, 8.04)
SUPPORTS = {0: "fixed", 2: "pinned"}
LOAD = [0.0, 0.0, -20.0]


class Graph:
    """What networkx documents of a graph."""

    def __init__(self, nodes, edges):
        self._nodes, self._edges = nodes, edges

    def nodes(self, data=False):
        return list(self._nodes.items()) if data else list(self._nodes)

    def edges(self, data=False):
        return [(a, b, own) if data else (a, b) for a, b, own in self._edges]


class Compas:
    """What COMPAS documents of a graph (nodes) or a mesh (vertices)."""

    def __init__(self, points, edges, kind):
        self.points, self.lines = points, edges
        setattr(self, {"node": "nodes", "vertex": "vertices"}[kind], lambda: iter(points))
        setattr(self, f"{kind}_attribute", lambda key, name: points[key].get(name))

    def edges(self):
        return ((a, b) for a, b, _ in self.lines)

    def edge_attribute(self, edge, name):
        return next(own for a, b, own in self.lines if (a, b) == edge).get(name)


EDGES = [("a", "top", {}), ("top", "c", {}), ("a", "c", {"kind": "cable", "rest_length": 0.95})]


def points(support="support"):
    found = {"a": {support: "fixed"}, "top": {"load": LOAD}, "c": {support: True}}
    for key, place in zip(found, NODES, strict=True):
        found[key] |= dict(zip("xyz", place, strict=True))
    return found


def tied(name, value):
    return "a", "c", {"kind": "cable", name: value}


def same(one, other):
    found = [each.model.network for each in (one, other)]
    assert found[0].nodes == pytest.approx(found[1].nodes)
    assert (found[0].beams.ends == found[1].beams.ends).all()
    assert found[0].cables.rest_length == pytest.approx(found[1].cables.rest_length)
    assert (found[0].fixed == found[1].fixed).all()
    assert one.model.loads["load"] == pytest.approx(other.model.loads["load"])


def placed(**of_first):
    """The network with other attributes of its first node."""
    given = points()
    given["a"] |= of_first
    return sf.networks.from_networkx(Graph(given, EDGES), rod=ROD, cable=187.0)


class DirectedCompas:
    """COMPAS's graph, which has the names of networkx's calls and another meaning of data."""

    node_attribute = nodes = edges = staticmethod(lambda *given, **named: None)


def plain():
    load = np.zeros((3, 3))
    load[1] = LOAD
    return sf.networks.from_arrays(
        NODES, [[0, 1], [1, 2]], [[0, 2]], rod=ROD, cable=187.0, supports=SUPPORTS, loads={"load": load},
        rest_lengths=[0.95],
    )  # fmt: skip


def test_arrays_networkx_and_compas_give_the_same_model():
    wanted = plain()
    graph = sf.networks.from_networkx(Graph(points(), EDGES), rod=ROD, cable=187.0)
    same(graph, wanted)
    assert graph.index("top") == 1
    placed = {"a": {"pos": NODES[0], "support": "fixed"}, "top": {"pos": NODES[1], "load": LOAD}}
    placed["c"] = {"pos": tuple(NODES[2]), "support": "pinned"}
    same(sf.networks.from_networkx(Graph(placed, EDGES), rod=ROD, cable=187.0), wanted)
    same(sf.networks.from_compas(Compas(points(), EDGES, "node"), rod=ROD, cable=187.0), wanted)
    anchored = Compas(points("is_anchor"), EDGES, "vertex")
    same(sf.networks.from_compas(anchored, rod=ROD, cable=187.0), wanted)


def test_what_numpy_made_of_stiffnesses_and_flags_means_the_same():
    load = np.zeros((3, 3))
    load[1] = LOAD
    nodes, rods, supports = np.array(NODES), np.array([[0, 1], [1, 2]]), np.array([0, 2])
    found = [
        sf.networks.from_arrays(nodes, rods, rod=rod, supports=held, loads={"load": load})
        for rod, held in ((ROD, [0, 2]), (np.array(ROD), supports))
    ]
    same(*found)
    assert (found[0].model.network.beams.axial == found[1].model.network.beams.axial).all()
    held = points()
    held["c"]["support"] = np.True_
    same(*(sf.networks.from_networkx(Graph(each, EDGES), rod=ROD, cable=187.0) for each in (points(), held)))


def test_numbers_of_tables_and_numpy_s_own_mean_what_python_s_mean():
    """1 and 0 as of a CSV file for true and false; a length of single precision."""
    wanted = sf.networks.from_networkx(
        Graph(points(), [*EDGES[:2], tied("rest_length", 0.5)]), rod=ROD, cable=187.0
    )
    given = points()
    given["c"]["support"], given["top"]["support"] = np.int64(1), 0
    edges = [*EDGES[:2], tied("rest_length", np.float32(0.5))]
    same(sf.networks.from_networkx(Graph(given, edges), rod=ROD, cable=187.0), wanted)
    same(sf.networks.from_compas(Compas(given, edges, "node"), rod=ROD, cable=187.0), wanted)


def test_rods_and_a_cable_side_by_side_are_all_kept():
    both = [*EDGES[:2], EDGES[0], ("top", "a", {"kind": "cable"})]
    found = sf.networks.from_networkx(Graph(points(), both), rod=ROD, cable=187.0).model.network
    assert found.beams.ends.tolist() == [[0, 1], [1, 2], [0, 1]]
    assert found.cables.ends.tolist() == [[1, 0]]


def test_a_network_and_its_analysis_are_shown_in_a_line_not_as_thousands_of_numbers():
    own = sf.networks.from_arrays(
        np.arange(300.0).reshape(100, 3), [[k, k + 1] for k in range(99)], rod=ROD, supports={0: "fixed"},
        loads={"none": np.zeros((100, 3))},
    )  # fmt: skip
    for shown in (repr(own), repr(own.model.network), repr(analyse(own.model, load="none"))):
        assert "nodes=array(100 × 3)" in shown
        assert len(shown) < 2500
        assert "\n" not in shown


def test_the_model_has_the_places_stiffnesses_lengths_supports_and_forces_that_were_given():
    loads = {"wind": [[0.0, 3.0, -4.0], [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]]}
    made = sf.networks.from_arrays(
        NODES, [[0, 1], [2, 1]], [[0, 2], [1, 0]], rod=ROD, cable=187.0, supports=[2], loads=loads
    ).model
    network = made.network
    assert network.nodes.tolist() == NODES
    assert network.beams.ends.tolist() == [[0, 1], [2, 1]]
    found = network.beams.axial[1], network.beams.torsion[0], network.beams.bending_y[1]
    assert (*found, network.beams.bending_z[0]) == ROD
    assert network.cables.rest_length == pytest.approx([1.0, np.hypot(0.5, 0.3)])
    assert network.cables.stiffness.tolist() == [187.0, 187.0]
    assert network.fixed.tolist() == [[False] * 6, [False] * 6, [True] * 3 + [False] * 3]
    assert made.loads["wind"].tolist() == [[*force, 0.0, 0.0, 0.0] for force in loads["wind"]]


def test_a_rod_s_stiffnesses_are_told_apart():
    made = sf.networks.from_arrays(NODES, [[0, 1]], rod=(5.0, 6.0, 7.0, 8.0)).model.network.beams
    found = made.axial, made.torsion, made.bending_y, made.bending_z
    assert [float(each[0]) for each in found] == [5.0, 6.0, 7.0, 8.0]


def test_a_node_below_the_first_is_told_and_not_the_largest_beside_it():
    with pytest.raises(
        InputError, match=r"rods\(1, 0\) is out of range \(found -2\)\. Indices run from 0 to 2"
    ):
        sf.networks.from_arrays(NODES, [[0, 1], [-2, 2]], rod=ROD)


def test_a_node_beyond_the_last_is_told_with_how_many_there_are():
    with pytest.raises(
        InputError, match=r"rods\(1, 0\) is out of range \(found 3\)\. Indices run from 0 to 2"
    ):
        sf.networks.from_arrays(NODES, [[0, 1], [3, 2]], rod=ROD)
    assert sf.networks.from_arrays(NODES, [[0, 2]], rod=ROD).model.network.beams.ends.tolist() == [[0, 2]]


def test_a_section_gives_the_stiffnesses_and_the_model_is_solved():
    section = sf.Rod.round(young=40e9, radius=0.01, strength=255e6).section
    found = sf.networks.from_arrays(
        NODES,
        [[0, 1], [1, 2]],
        rod=section,
        supports={0: "fixed", 2: "fixed"},
        loads={"down": [[0] * 3, LOAD, [0] * 3]},
    )
    stiff = sf.networks.from_arrays(
        NODES,
        [[0, 1], [1, 2]],
        rod=(4e6 * np.pi, *stiffness(section)[1:]),
        supports={0: "fixed", 2: "fixed"},
        loads={"down": [[0] * 3, LOAD, [0] * 3]},
    )
    places = [analyse(each.model, load="down").equilibrium.state.positions for each in (found, stiff)]
    assert places[0] == pytest.approx(places[1], abs=1e-12), "EA = E pi r²"


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: sf.networks.from_arrays(NODES, [[0, 1]]), "rod: is needed"),
        (lambda: sf.networks.from_arrays(NODES, cables=[[0, 1]]), "cable: is needed"),
        (lambda: sf.networks.from_arrays(NODES, [[0, 7]], rod=ROD), "rods.* is out of range"),
        (lambda: sf.networks.from_arrays(NODES, [[-1, 1]], rod=ROD), "rods.* is out of range"),
        (lambda: sf.networks.from_arrays(NODES, [[0.5, 1]], rod=ROD), "rods must be whole numbers"),
        (lambda: sf.networks.from_arrays([[0, 0]], rod=ROD), r"nodes has the wrong shape.*\(any, 3\)"),
        (lambda: sf.networks.from_arrays([["x", 0, 0]]), "must be numbers"),
        (lambda: sf.networks.from_arrays(NODES, [[0, 1]], rod=(1.0, 2.0)), "four stiffnesses"),
        (lambda: sf.networks.from_arrays(NODES, [[0, 1]], rod=ROD, supports={0: "glued"}), "no way to hold"),
        (
            lambda: sf.networks.from_arrays(NODES, [[0, 1]], rod=ROD, loads={"w": [[0, 0, 1]]}),
            "a row for each",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, cables=[[0, 1]], cable=1.0, rest_lengths=[1, 2]),
            "another length",
        ),
        (lambda: sf.networks.from_networkx([1, 2]), "is no graph"),
        (lambda: sf.networks.from_networkx(SimpleNamespace(nodes=dict)), "is no graph"),
        (lambda: sf.networks.from_networkx(Graph({"a": {}}, [])), "node 'a': has no three numbers"),
        (
            lambda: sf.networks.from_networkx(Graph(points(), [("a", "c", {"kind": "string"})]), rod=ROD),
            "neither a rod nor a cable",
        ),
        (lambda: sf.networks.from_compas(Graph({}, [])), "no node_attribute"),
        (lambda: plain().index("z"), "is no node"),
        (
            lambda: sf.networks.from_arrays(NODES, [[0, 1], [1]], rod=ROD),
            "rods has rows of different lengths",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, supports=[True, False, True]),
            "supports: is no node's number",
        ),
        (lambda: sf.networks.from_arrays(NODES, supports=[0.5, 2]), "supports: is no node's number.*0.5"),
        (lambda: sf.networks.from_arrays(NODES, supports="pinned"), "supports: is no node's number"),
        (lambda: sf.networks.from_arrays(NODES, supports=[[0, 2]]), "supports: is no node's number"),
        (lambda: sf.networks.from_arrays(NODES, supports=2), "supports: is no node's number"),
        (lambda: sf.networks.from_arrays(NODES, supports={0: ["pinned"]}), "no way to hold"),
        (lambda: sf.networks.from_arrays(NODES, loads=[[0, 0, 1]] * 3), "loads: must have names"),
        (lambda: sf.networks.from_arrays(NODES, [[0, 1]], rod={"EA": 1.0}), "four stiffnesses"),
        (
            lambda: sf.networks.from_arrays(NODES, [[0, 1]], rod=sf.Rod.round(young=40e9, radius=0.01)),
            "four stiffnesses.*is its .section",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, rods=[[0, 1], [1, 2], [1, 0]], rod=ROD),
            r"rods\[2\]: joins the nodes that rods\[0\] joins, which would count it twice.*MultiGraph",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, cables=[[1, 2], [0, 1], [0, 1]], cable=187.0),
            r"cables\[2\]: joins the nodes that cables\[1\] joins",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, cables=[[0, 1]], cable=sf.Cable(187.0)),
            "cable: must be a number",
        ),
        (
            lambda: sf.networks.from_arrays(NODES, cables=[[0, 1]], cable=1.0, rest_lengths=[np.nan]),
            r"rest_lengths\(0,\) is not finite",
        ),
        (
            lambda: sf.networks.from_networkx(Graph(points(), [tied("rest_length", np.nan)]), cable=1.0),
            "edge 'a', 'c': rest_length: must be positive and finite",
        ),
        (
            lambda: sf.networks.from_networkx(Graph(points(), [tied("rest_length", "long")]), cable=1.0),
            "edge 'a', 'c': rest_length: must be a number",
        ),
        (lambda: placed(support=np.ones(6)), "node 'a': support: is no way to hold a node"),
        (lambda: placed(support="clamped"), "node 'a': support: is no way to hold a node.*true is pinned"),
        (lambda: placed(support=2), "node 'a': support: is no way to hold a node"),
        (lambda: placed(z=np.nan), "node 'a': has a number that is not finite"),
        (lambda: placed(load=(0, 0, np.inf)), "node 'a': load: has a number that is not finite"),
        (lambda: placed(load=-5.0), "node 'a': load: has no three numbers"),
        (lambda: placed(x=1.0), "edge 'a', 'c': has both its ends at one place"),
        (
            lambda: sf.networks.from_networkx(Graph(points(), [("a", "a", {})]), rod=ROD),
            "edge 'a', 'a': has both its ends at one place",
        ),
        (
            lambda: sf.networks.from_networkx(Graph(points(), [*EDGES, ("top", "a", {})]), rod=ROD),
            "edge 'top', 'a': is there the other way round, too.*to_undirected",
        ),
        (
            lambda: sf.networks.from_compas(Compas(points(), [("a", "c", {"kind": ["cable"]})], "node")),
            "edge 'a', 'c': kind: is neither a rod nor a cable",
        ),
        (
            lambda: sf.networks.from_compas(Compas(points() | {"a": {"is_anchor": np.ones(2)}}, [], "node")),
            "node 'a': has no three numbers",
        ),
        (lambda: sf.networks.from_networkx(DirectedCompas()), "is a graph of COMPAS.*from_compas"),
    ],
)
def test_what_is_no_network_is_refused_with_where_it_is_wrong(make, message):
    with pytest.raises(InputError, match=message):
        make()


def test_a_cable_between_nodes_in_one_place_is_refused_with_what_to_do():
    """It was told to leave its rest length out, which it had."""
    with pytest.raises(
        InputError, match=r"cables\[0\]: the cable's nodes must not coincide.*give the cable's rest_length"
    ):
        sf.networks.from_arrays([[0, 0, 0], [1, 0, 0], [1, 0, 0]], cables=[[1, 2]], cable=187.0, supports=[0])
