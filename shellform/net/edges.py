"""What the edge of a net stands on: the ground, walls, edge beams, nothing.

A net's rods end on the curves round the surface and round its openings, or where a level or an outline cuts
them off. Each stretch of such a curve has a kind:

    ground, wall, abutment   the rods' ends are pinned there, and what they push goes into the ground
    beam                     an edge beam runs along the stretch; the rods' ends are clamped to it
    free                     the rods end there, held by nothing
    pin                      pinned in mid-air, by something that isn't part of the model

`Edges` says which: the first of its stretches that a place lies in decides, and elsewhere the geometry. What
lies within two hundredths of the surface's larger extent in plan above the ground (ground.py) stands on it;
what is higher has an edge beam, which is carried down along the edge to where the edge stops falling
steeply, its foot: an edge that undulates on the ground keeps it.
A beam round an opening is a closed ring.

The beam's axis lies on the edge itself, half a gap from the rods, with a node for each rod's end, one for
each foot, and others between them where these lie far apart. Those nodes come after the grid's own. In
the flat grid they lie where they are in the target: an edge beam is made in its final curve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from shellform.arrays import Flags, Reals, Record, reals
from shellform.errors import InputError, require_known
from shellform.net.ground import Ground, ground_under
from shellform.net.net import EdgeLine, Net, Stretch
from shellform.net.notes import NetNote, NoteKind
from shellform.net.polylines import nearest
from shellform.net.rims import OFF, End, Rim, edges_of, ends_of
from shellform.quantities import coordinates
from shellform.structure.elements.rotation import from_matrices
from shellform.structure.elements.state import State
from shellform.surface.shape.locate import Locator
from shellform.surface.shape.target import Surface

HELD = ("ground", "wall", "abutment", "pin")  # kinds of stretches that hold the rods' ends
KINDS = (*HELD, "beam", "free")
_LONGEST = 0.5  # of the spacing: edge beams' elements aren't longer
_STEEP = 0.1  # fall over length in plan: edges that stand on the ground, but unevenly, fall less
# of the spacing: ends nearer to each other share a node of the edge beam, whose elements would drown the load
# in what rounding leaves of forces: their stiffness goes with the third power of how short they are
_CLOSE = 0.2


@dataclass(frozen=True, eq=False)
class Place(Record):
    """Where a `kind` of edge is: where all that is given holds. `height`: lowest and highest level, m; `box`:
    two opposite corners (2, 3), m; `curve`: a plan curve (k, 2), m, no farther than `within`, m; `opening`:
    on the edge of an opening, or on the outer one."""

    kind: str
    name: str = ""
    height: tuple[float, float] | None = None
    box: Reals | None = None
    curve: Reals | None = None
    within: float = 0.0
    opening: bool | None = None

    def __post_init__(self) -> None:
        require_known(self.kind, KINDS, where="edges.kind", what="is no kind of edge")
        for name, shape in (("box", (2, 3)), ("curve", (None, 2))):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, reals(f"edges.{name}", getattr(self, name), shape))

    def holds(self, points: Reals, *, opening: bool) -> np.ndarray:
        """At which points (k, 3), m, of an edge."""
        inside = np.full(len(points), self.opening is None or self.opening == opening)
        if self.height is not None:
            inside &= (points[:, 2] >= self.height[0]) & (points[:, 2] <= self.height[1])
        if self.box is not None:
            inside &= ((points >= self.box.min(axis=0)) & (points <= self.box.max(axis=0))).all(axis=1)
        if self.curve is not None:
            inside &= nearest(points[:, :2], self.curve)[0] <= self.within
        return inside


@dataclass(frozen=True, eq=False)
class Edges:
    """`places` with their kinds, the first that holds deciding; elsewhere `outer` edges and edges of
    `openings` have a kind of `KINDS`, or "auto" the one that the geometry says; `ground`, m, its level (None:
    what the outer edge shows, its lowest point or a slope)."""

    places: tuple[Place, ...] = ()
    outer: str = "auto"
    openings: str = "auto"
    ground: float | None = None

    def __post_init__(self) -> None:
        for name in ("outer", "openings"):
            kind = getattr(self, name)
            require_known(kind, ("auto", *KINDS), where=f"edges.{name}", what="is no kind of edge")


def stand(net: Net, surface: Surface, edges: Edges = Edges()) -> Net:
    """The net with its edges as they are: rods' ends held where the edge is, edge beams along the others.
    Raises InputError where nothing is left that holds the shell.
    """
    ends, rims = ends_of(net, surface)
    ground = ground_under(surface, edges.ground)
    _refuse_missed(edges, rims)
    for rim in rims:
        _sort_out(rim, edges, ground)
    builder = _Builder(net, rims)
    stretches = []
    for number, rim in enumerate(rims):
        for first, last in _runs(rim.kinds):
            if rim.kinds[first] == "beam":
                builder.beam(rim, first, last, [each for each in ends if each.rim == number])
        stretches += _stretches(rim, _cut_off(net, rim))
    held = [each.node for each in ends if rims[each.rim].kinds[each.vertex] in HELD]
    if not held and not builder.feet:
        raise InputError(
            "nothing holds the shell: no part of its edge stands on the ground or a wall",
            where="edges",
            remedy="Give its level in edges.ground, or name what it stands on in [[edges.stretch]].",
        )
    if ground.slopes and any(each.kind == "ground" for each in stretches):
        note = NetNote(
            NoteKind.GROUND, f"the ground under the edge {ground.told}: [edges] ground makes it level"
        )
        net = replace(net, notes=(*net.notes, note))
    kept = set(held)
    supports = np.array(
        [node for node in net.supports.tolist() if node in kept] + builder.feet, dtype=np.int64
    )
    if not builder.lines:
        return replace(net, supports=supports, stretches=tuple(stretches))
    more = np.array(builder.places)
    grid = replace(net.grid, flat=np.vstack([net.grid.flat, more]))
    target = State(
        np.vstack([net.target.positions, more]),
        np.vstack([net.target.quaternions, _upright(Locator(surface).foot(more).normal)]),
    )
    quality = replace(net.quality, pull=np.concatenate([net.quality.pull, np.zeros(len(more))]))
    return replace(
        net,
        grid=grid,
        target=target,
        supports=supports,
        quality=quality,
        edges=tuple(builder.lines),
        stretches=tuple(stretches),
    )


def stretches_of(surface: Surface, edges: Edges = Edges()) -> tuple[Stretch, ...]:
    """What the surface's edges are, before there is a net: a first look."""
    ground, found = ground_under(surface, edges.ground), list[Stretch]()
    for rim in edges_of(surface):
        _sort_out(rim, edges, ground)
        found += _stretches(rim, np.zeros(len(rim.points), dtype=bool))
    return tuple(found)


def _cut_off(net: Net, rim: Rim) -> Flags:
    """Which (k,) of the rim's points lie where nothing is built: so far beyond the level or the outline at
    which the net ends that no rod's end counts as on the rim there."""
    return net.limits.beyond(rim.points) > OFF * net.grid.scale


def _refuse_missed(edges: Edges, rims: Sequence[Rim]) -> None:
    """Raises InputError for a place by level, box or curve that no edge comes to: what it names would be left
    out without a word."""
    points = np.vstack([rim.points for rim in rims])
    for number, place in enumerate(edges.places):
        anywhere = place.height is None and place.box is None and place.curve is None
        if anywhere or any(place.holds(rim.points, opening=rim.opening).any() for rim in rims):
            continue
        low, high = (coordinates(end(points, axis=0), 4) for end in (np.min, np.max))
        raise InputError(
            f"holds no point of the surface's edges, which reach from {low} to {high} m",
            where=f"edges.stretch[{number}]",
            value=place.name or place.kind,
            remedy="Give a place on these, in metres, wide enough to hold vertices of the mesh; or leave the stretch out.",
        )


def _sort_out(rim: Rim, edges: Edges, ground: Ground) -> None:
    """Gives each point of the rim its kind; edge beams go down to where the edge stops falling."""
    default = edges.openings if rim.opening else edges.outer
    count = len(rim.points)
    decided = np.full(count, -1)
    for number, place in enumerate(edges.places):
        decided[(decided < 0) & place.holds(rim.points, opening=rim.opening)] = number
    auto = (decided < 0) & (default == "auto")
    over = np.column_stack([rim.points[:, :2], ground.over(rim.points)])
    standing = over[:, 2] <= ground.low
    rim.kinds = [
        edges.places[number].kind
        if number >= 0
        else ("ground" if stands else "beam")
        if default == "auto"
        else default
        for number, stands in zip(decided.tolist(), standing.tolist(), strict=True)
    ]
    rim.names = [edges.places[number].name if number >= 0 else "" for number in decided.tolist()]
    rim.found = auto.tolist()
    if rim.cut:  # its ends only close the curve: held where they are low, no part of a beam
        for last in (0, count - 1):
            if rim.kinds[last] == "beam":
                rim.kinds[last], rim.found[last] = "free", False
    for first, last in _runs(rim.kinds):
        if rim.kinds[first] != "beam" or last - first + 1 >= count:
            continue
        for here, way in (((first - 1) % count, -1), ((last + 1) % count, 1)):
            while (
                rim.found[here]
                and rim.kinds[here] == "ground"
                and rim.found[(here + way) % count]
                and _falls(over[here], over[(here + way) % count])
            ):
                rim.kinds[here] = "beam"
                here = (here + way) % count


def _falls(here: Reals, there: Reals) -> bool:
    """Whether an edge falls steeply between two of its points, whose heights are those over the ground."""
    return bool(here[2] - there[2] > _STEEP * np.linalg.norm(there[:2] - here[:2]))


def _runs(kinds: Sequence[str]) -> list[tuple[int, int]]:
    """First and last place of each run of one kind round a rim; the last may lie past the end, by less than
    once round."""
    count = len(kinds)
    starts = [k for k in range(count) if kinds[k] != kinds[k - 1]]
    if not starts:
        return [(0, count - 1)]
    return [(a, b - 1) for a, b in zip(starts, [*starts[1:], starts[0] + count], strict=True)]


def _stretches(rim: Rim, cut_off: Flags) -> list[Stretch]:
    """The rim's runs of one kind and name, but for those of points (k,) that are `cut_off`; along a curve
    where the net was cut off from its first point to its last."""
    count = len(rim.points)
    labels = [
        "" if off else f"{kind}\n{name}"
        for kind, name, off in zip(rim.kinds, rim.names, cut_off.tolist(), strict=True)
    ]
    runs = _runs(labels)
    if rim.cut:
        starts = [0, *(k for k in range(1, count - 1) if labels[k] != labels[k - 1])]
        runs = [(first, next_one - 1) for first, next_one in pairwise([*starts, count - 1])]
    found = []
    for first, last in runs:
        if not labels[first % count]:
            continue
        at = np.arange(first, last + 2) % count  # up to where the next one begins
        at = at[~cut_off[at]]
        if len(at) < 2:
            continue
        whole = not rim.cut and last - first + 1 == count
        found.append(Stretch(rim.kinds[first], rim.names[first], rim.points[at], rim.opening, whole))
    return found


class _Builder:
    """Puts the nodes of edge beams together: `places` of the new nodes, the `lines` and their `feet`."""

    def __init__(self, net: Net, rims: Sequence[Rim]) -> None:
        self.net, self.rims = net, rims
        self.places: list[Reals] = []
        self.lines: list[EdgeLine] = []
        self.feet: list[int] = []

    def beam(self, rim: Rim, first: int, last: int, ends: Sequence[End]) -> None:
        """The edge beam along a run of the rim's points with the rods' ends that lie on it."""
        count, total = len(rim.points), float(rim.along[-1])
        closed = last - first + 1 == count
        inside = {k % count for k in range(first, last + 1)}
        before, after = (first - 1) % count, (last + 1) % count
        origin = 0.0 if closed else float(rim.along[before])
        own = sorted(
            (((each.at - origin) % total, each) for each in ends if each.vertex in inside),
            key=lambda pair: pair[0],
        )
        if not own:
            return
        nodes: list[int] = []
        arcs: list[float] = []
        links: list[tuple[int, int]] = []
        for group in _near(own, _CLOSE * self.net.grid.scale):
            nodes.append(self._new(np.mean([each.middle for _, each in group], axis=0)))
            arcs.append(sum(at for at, _ in group) / len(group))
            links += [(nodes[-1], each.node) for _, each in group]
        if not closed:
            length = (float(rim.along[after]) - origin) % total or total
            if rim.kinds[before] in HELD:
                nodes.insert(0, self._foot(rim.points[before]))
                arcs.insert(0, 0.0)
            if rim.kinds[after] in HELD:
                nodes.append(self._foot(rim.points[after]))
                arcs.append(length)
        path = self._filled(rim, nodes, arcs, origin, closed)
        if len(path) > (2 if closed else 1):
            self.lines.append(
                EdgeLine(np.array(path), np.array(links, dtype=np.int64), closed, rim.names[first % count])
            )

    def _filled(
        self, rim: Rim, nodes: Sequence[int], arcs: Sequence[float], origin: float, closed: bool
    ) -> list[int]:
        """The nodes in order with others on the edge between those that lie far apart."""
        total = float(rim.along[-1])
        track = np.vstack([rim.points, rim.points[:1]])
        stops = [*arcs[1:], arcs[0] + total] if closed else list(arcs[1:])
        path = []
        for k, node in enumerate(nodes):
            path.append(node)
            if k >= len(stops):
                break
            parts = int(np.ceil((stops[k] - arcs[k]) / (_LONGEST * self.net.grid.scale) - 1e-9))
            for j in range(1, parts):
                at = (origin + arcs[k] + j / parts * (stops[k] - arcs[k])) % total
                path.append(self._new(np.array([np.interp(at, rim.along, track[:, i]) for i in range(3)])))
        return path

    def _new(self, place: Reals) -> int:
        self.places.append(place)
        return len(self.net.grid.flat) + len(self.places) - 1

    def _foot(self, place: Reals) -> int:
        """The foot there; edge beams that meet on the ground have one."""
        first = len(self.net.grid.flat)
        for foot in self.feet:
            if np.array_equal(self.places[foot - first], place):
                return foot
        self.feet.append(self._new(place))
        return self.feet[-1]


def _near(ends: Sequence[tuple[float, End]], close: float) -> list[list[tuple[float, End]]]:
    """The ends with their places along the edge, m, in order, as groups no longer than `close`, m."""
    groups = list[list[tuple[float, End]]]()
    for at, each in ends:
        if not groups or at - groups[-1][0][0] > close:
            groups.append([])
        groups[-1].append((at, each))
    return groups


def _upright(normals: Reals) -> Reals:
    """Quaternions (k, 4) that turn the z axis onto unit normals (k, 3), as the grid's nodes are turned."""
    aside = np.eye(3)[np.argmin(np.abs(normals), axis=1)]
    x = np.cross(aside, normals)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return from_matrices(np.stack([x, np.cross(normals, x), normals], axis=2))
