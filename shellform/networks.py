"""Networks of one's own as models: from plain arrays, from networkx graphs, from COMPAS graphs and meshes.

None of these libraries is imported: what they document is used, `graph.nodes(data=True)` and
`graph.edges(data=True)` of networkx, `nodes()` or `vertices()`, `edges()`, `node_attribute` and its likes of
COMPAS. The result is a model (structure/model.py) that `analyse` solves and `write_model` writes, with the
keys that its nodes had. SI units: m, N.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from shellform.arrays import Reals, Record, indices, reals
from shellform.errors import InputError, require_number
from shellform.structure.elements.sections import Section, stiffness
from shellform.structure.model import Model, parse_model
from shellform.structure.network import repeated

_FIXED = {"pinned": [True] * 3 + [False] * 3, "fixed": [True] * 6}
Rod = Section | Sequence[float] | Reals
"""A section of a material, or its stiffnesses (EA, GJ, EI_y, EI_z), N and N·m²."""

_Lines = list[tuple[int, int, dict[str, float]]]  # two nodes, and what the line has of its own


@dataclass(frozen=True, eq=False)
class OwnNetwork(Record):
    """A `model`, and the `keys` (n,) that its nodes had where they came from, in order."""

    model: Model
    keys: tuple[Hashable, ...]

    def index(self, key: Hashable) -> int:
        """The node's number. Raises InputError where there is none."""
        if key not in self.keys:
            raise InputError(
                "is no node of the network", where="key", value=key, remedy="Name a node as the graph does."
            )
        return self.keys.index(key)


def from_arrays(
    nodes: ArrayLike,
    rods: ArrayLike = (),
    cables: ArrayLike = (),
    *,
    rod: Rod | None = None,
    cable: float | None = None,
    supports: Mapping[int, str] | Sequence[int] = (),
    loads: Mapping[str, ArrayLike] | None = None,
    rest_lengths: ArrayLike | None = None,
) -> OwnNetwork:
    """A network of `nodes` (n, 3), m, `rods` (m, 2) and `cables` (c, 2) between them; `rod` is their section,
    `cable` the axial stiffness EA, N; `supports` are node numbers, pinned, or each with "pinned" or "fixed";
    `loads` by name (n, 3), N; `rest_lengths` (c,), m, of the cables (left out: as they are drawn). Raises
    InputError naming what is wrong."""
    places = reals("nodes", nodes, (None, 3))
    beams, ties = (
        indices(name, ends, (None, 2), below=len(places))
        for name, ends in (("rods", rods), ("cables", cables))
    )
    for name, ends in (("rods", beams), ("cables", ties)):
        again, earlier = repeated(ends)
        if len(again):
            raise InputError(
                f"joins the nodes that {name}[{earlier[0]}] joins, which would count it twice",
                where=f"{name}[{again[0]}]",
                value=ends[again[0]].tolist(),
                remedy="Leave one of the two out; where two are meant side by side, give a networkx.MultiGraph.",
            )
    rest = None if rest_lengths is None else reals("rest_lengths", rest_lengths, (None,))
    if rest is not None and len(rest) != len(ties):
        raise InputError(
            "has another length than cables",
            where="rest_lengths",
            value=rest.shape,
            remedy="Give a rest length for each cable, or leave rest_lengths out.",
        )
    if not isinstance(loads, Mapping | None):
        raise InputError(
            "must have names",
            where="loads",
            value=type(loads).__name__,
            remedy='Give arrays by name: {"snow": forces}.',
        )
    forces = {name: reals(f"loads[{name!r}]", force, (None, 3)) for name, force in (loads or {}).items()}
    for name, force in forces.items():
        if len(force) != len(places):
            raise InputError(
                "needs a row for each node",
                where=f"loads[{name!r}]",
                value=force.shape,
                remedy=f"Give {len(places)} rows of a force, N; zeros where nothing pulls.",
            )
    return _built(
        range(len(places)),
        places.tolist(),
        [(a, b, {}) for a, b in beams.tolist()],
        [
            (a, b, {} if rest is None else {"rest_length": float(rest[k])})
            for k, (a, b) in enumerate(ties.tolist())
        ],
        {node: _holding(f"supports[{node}]", how) for node, how in _supported(supports).items()},
        {name: dict(enumerate(force.tolist())) for name, force in forces.items()},
        rod,
        cable,
    )


def from_networkx(graph: Any, *, rod: Rod | None = None, cable: float | None = None) -> OwnNetwork:
    """A networkx graph: nodes have their place as `pos` (x, y, z) or as x, y and z, may have a `support`
    ("pinned", "fixed" or true) and a `load` (fx, fy, fz), N, which makes the load case "load"; edges are
    rods, or cables where their `kind` is "cable", which may have a `rest_length`, m. Raises InputError naming
    the node or edge."""
    if not callable(getattr(graph, "nodes", None)) or not callable(getattr(graph, "edges", None)):
        raise InputError(
            "is no graph: it has no nodes() and edges()",
            where="graph",
            value=type(graph).__name__,
            remedy="Give a graph of networkx, or arrays to from_arrays.",
        )
    if hasattr(graph, "node_attribute"):
        raise InputError(
            "is a graph of COMPAS",
            where="graph",
            value=type(graph).__name__,
            remedy="Give it to from_compas.",
        )
    nodes = [(key, dict(data)) for key, data in graph.nodes(data=True)]
    edges = [(a, b, dict(data)) for a, b, data in graph.edges(data=True)]
    return _from_attributes(nodes, edges, rod, cable)


def from_compas(data: Any, *, rod: Rod | None = None, cable: float | None = None) -> OwnNetwork:
    """A COMPAS graph, network or mesh: attributes x, y and z, `support` (or `is_support`, `is_anchor`) and
    `load` of nodes or vertices, `kind` and `rest_length` of edges, as for networkx. Raises InputError naming
    the node or edge."""
    kind = next((each for each in ("node", "vertex") if hasattr(data, f"{each}_attribute")), None)
    if kind is None or not callable(getattr(data, "edges", None)):
        raise InputError(
            "is no graph, network or mesh of COMPAS: it has no node_attribute or vertex_attribute",
            where="data",
            value=type(data).__name__,
            remedy="Give a Graph, Network or Mesh of COMPAS, or arrays to from_arrays.",
        )
    keys: Iterable[Hashable] = data.nodes() if kind == "node" else data.vertices()
    of: Callable[[Hashable, str], Any] = getattr(data, f"{kind}_attribute")

    def attributes(key: Hashable) -> dict[str, Any]:
        found = {name: of(key, name) for name in ("x", "y", "z", "load")}
        held = (of(key, name) for name in ("support", "is_support", "is_anchor"))
        return {**found, "support": next((each for each in held if not _is_free(each)), None)}

    nodes = [(key, attributes(key)) for key in keys]
    edges = [
        (a, b, {name: data.edge_attribute((a, b), name) for name in ("kind", "rest_length")})
        for a, b in data.edges()
    ]
    return _from_attributes(nodes, edges, rod, cable)


def _from_attributes(
    nodes: Sequence[tuple[Hashable, Mapping[str, Any]]],
    edges: Sequence[tuple[Hashable, Hashable, Mapping[str, Any]]],
    rod: Rod | None,
    cable: float | None,
) -> OwnNetwork:
    keys = tuple(key for key, _ in nodes)
    number = {key: k for k, key in enumerate(keys)}
    places, held, loads = [], {}, {}
    for k, (key, data) in enumerate(nodes):
        place = data["pos"] if data.get("pos") is not None else [data.get(axis) for axis in "xyz"]
        where = f"node {key!r}"
        places.append(_three(where, place, "Give pos = (x, y, z), or x, y and z."))
        if not _is_free(data.get("support")):
            held[k] = _holding(f"{where}: support", data["support"])
        if data.get("load") is not None:
            loads[k] = _three(f"{where}: load", data["load"], "Give three components, N.")
    rods, cables, seen = _Lines(), _Lines(), set[tuple[bool, Hashable, Hashable]]()
    for a, b, data in edges:
        where, kind, own = f"edge {a!r}, {b!r}", data.get("kind"), {}
        if not (kind is None or (isinstance(kind, str) and kind in ("rod", "cable"))):
            raise InputError(
                "is neither a rod nor a cable",
                where=f"{where}: kind",
                value=kind,
                remedy='Set kind to "rod" or "cable".',
            )
        if a == b or places[number[a]] == places[number[b]]:
            raise InputError(
                "has both its ends at one place",
                where=where,
                value=places[number[a]],
                remedy="Leave the edge out, or move one of its nodes.",
            )
        tied = kind == "cable"
        if (tied, b, a) in seen:  # edges side by side of a multigraph all run one way
            raise InputError(
                "is there the other way round, too, which would count it twice",
                where=where,
                remedy="Leave one of the two out; of a directed graph give graph.to_undirected().",
            )
        seen.add((tied, a, b))
        if data.get("rest_length") is not None:
            require_number(
                data["rest_length"], above=0.0, where=f"{where}: rest_length", give="metres, such as 0.055"
            )
            own["rest_length"] = float(data["rest_length"])
        (cables if tied else rods).append((number[a], number[b], own))
    return _built(keys, places, rods, cables, held, {"load": loads} if loads else {}, rod, cable)


def _built(
    keys: Iterable[Hashable],
    places: Sequence[Sequence[float]],
    rods: _Lines,
    cables: _Lines,
    held: Mapping[int, str],
    loads: Mapping[str, Mapping[int, Sequence[float]]],
    rod: Rod | None,
    cable: float | None,
) -> OwnNetwork:
    if rods and rod is None:
        raise InputError(
            "is needed: the network has rods", where="rod", remedy="Give a section, or EA, GJ, EI_y, EI_z."
        )
    if cables and cable is None:
        raise InputError(
            "is needed: the network has cables", where="cable", remedy="Give their axial stiffness EA, N."
        )
    if cable is not None:
        require_number(cable, above=0.0, where="cable", give="their axial stiffness EA, N, such as 187.0")
    of_rods = {} if rod is None else _stiffnesses(rod)
    model = parse_model(
        {
            "format": "shellform-model",
            "version": 1,
            "nodes": [list(map(float, place)) for place in places],
            "beams": [{"nodes": [int(a), int(b)], **of_rods, **own} for a, b, own in rods],
            "cables": [{"nodes": [int(a), int(b)], "EA": float(cable or 0.0), **own} for a, b, own in cables],
            "supports": [{"node": int(node), "fixed": _FIXED[how]} for node, how in sorted(held.items())],
            "loads": {
                name: [
                    {"node": int(node), "force": list(map(float, force))}
                    for node, force in sorted(forces.items())
                    if any(force)
                ]
                for name, forces in loads.items()
            },
        }
    )
    return OwnNetwork(model, tuple(keys))


def _stiffnesses(rod: Any) -> dict[str, float]:
    """A rod's stiffnesses by their names in the model file. Raises InputError for what are no four of
    them."""
    given = stiffness(rod) if hasattr(rod, "constants") else rod
    try:
        values = np.asarray(given, dtype=float)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (4,):
        raise InputError(
            "needs four stiffnesses",
            where="rod",
            value=given,
            remedy="Give EA in N and GJ, EI_y, EI_z in N·m², or a section: that of an sf.Rod is its .section.",
        )
    return dict(zip(("EA", "GJ", "EIy", "EIz"), values.tolist(), strict=True))


def _is_free(how: object) -> bool:
    """Whether a node's `support` is none: left out, false, 0 or empty."""
    return how is None or (np.isscalar(how) and not how)


def _holding(where: str, how: Any) -> str:
    """How a node is held: "pinned" or "fixed", as its `support` says; true, or 1 as of a table, is pinned.
    Raises InputError for any other."""
    if np.isscalar(how) and how in _FIXED:
        return str(how)
    if np.isscalar(how) and not isinstance(how, str) and how == 1:
        return "pinned"
    raise InputError(
        "is no way to hold a node", where=where, value=how, remedy='Give "pinned" or "fixed"; true is pinned.'
    )


def _supported(supports: Mapping[int, str] | Sequence[int]) -> dict[int, Any]:
    """How each support is held, by the node's number. Raises InputError for what are no numbers: a flag isn't
    one."""
    strange: list[object] = []
    try:
        held = dict(supports) if isinstance(supports, Mapping) else dict.fromkeys(supports, "pinned")
        strange += [node for node in held if isinstance(node, bool) or not isinstance(node, int | np.integer)]
    except TypeError:  # no list, or one of lists
        strange.append(supports)
    if strange:
        raise InputError(
            "is no node's number",
            where="supports",
            value=strange[0],
            remedy='Give numbers counted from 0, or each with "pinned" or "fixed"; of flags np.flatnonzero(flags).',
        )
    return held


def _three(where: str, given: Any, remedy: str) -> list[float]:
    try:
        values = [float(each) for each in given]
    except (TypeError, ValueError) as error:
        raise InputError("has no three numbers", where=where, value=given, remedy=remedy) from error
    if len(values) != 3:
        raise InputError("has no three numbers", where=where, value=given, remedy=remedy)
    if not np.isfinite(values).all():
        raise InputError("has a number that is not finite", where=where, value=values, remedy=remedy)
    return values
