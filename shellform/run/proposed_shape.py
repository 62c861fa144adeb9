"""What a case that `shellform new` proposes says of the shape and of what rods bear in it: what it may be off
by as planned and as built, and the search for it.

As planned a wish, which spares cables, since a search may end a little beyond it; as built a limit. No search
brings structures as built nearer: where drawn ones of the initial design are beyond it, the case says so, and
what stands nearer.

Once structures as built are adjusted on site their errors add 0.04 of the strength to the rods' stress, and
0.15 in the worst of twenty, in the median of seventy designs, and 3 to 8 % to the cables' largest pull, in
ten of eleven: a tenth of the rods' strength and 7 % of what cables may pull are left for that where the
initial design leaves more.
"""

from __future__ import annotations

from shellform.gridshell.joints import PAPER_SPACING
from shellform.records.remedies import rounded_up
from shellform.run.first_finish import far_told
from shellform.run.first_refusal import WayOut
from shellform.run.first_steadier import strays_told
from shellform.run.first_trial import FirstDesign, millimetres
from shellform.run.sizes import BUILT_OF_SPAN, OF_SPAN, may_come_off, may_stray
from shellform.surface.shape.target import Surface

# of the rods' strength and of the cables' limit, that a search may use of a design that begins with `_BEGUN`
_LEFT, _LEFT_OF_CABLES = 0.9, 0.93
_BEGUN = 0.85
_EVALUATIONS, _POLISHED = 30, 10  # that the case proposed asks for: a first answer in minutes


def stray_told(design: FirstDesign, surface: Surface, steady: WayOut | None) -> str:
    """How far drawn structures stray, where that is too far, and what they do as is `steady`, if that is
    known; else empty."""
    told = strays_told(design, surface)
    if steady is None or steady.design.strays is None:
        return told
    return f"{told}; with --edges {steady.wish.edges} by up to {millimetres(steady.design.strays)}"


def rods_strength(design: FirstDesign) -> str:
    """The entry of [limits] for the rods' stress."""
    begun = max(design.tried.stress, design.tried.unloaded)
    return _leaving("utilisation", "of the rods' strength, under any load", _LEFT, begun)


def cables_pull(design: FirstDesign) -> str:
    """The entry of [limits] for the cables' pull."""
    return _leaving("cable_utilisation", "of cable.force_max, as planned", _LEFT_OF_CABLES, design.tried.pull)


def _leaving(entry: str, of: str, share: float, begun: float) -> str:
    """The entry by which a search uses a `share` of something, told as `of` that, where the initial design,
    which has `begun` with so much of it, leaves more; else all of it."""
    if begun <= _BEGUN:
        return f"{entry} = {share!r}    # {of}: the rest is for errors of building"
    return (
        f"{entry} = 1.0    # {of}; {share!r} would leave some for errors of building, and the "
        f"initial design comes to {begun:.2f}"
    )


def built_deviation(surface: Surface, design: FirstDesign, stray: str) -> str:
    """The entry of [limits] for the shape as built, with what is told of structures that `stray`."""
    most = may_stray(surface, design.thickness)
    why = f"a {BUILT_OF_SPAN:g}th of the span" if most > design.thickness else "the concrete's thickness"
    return (
        f"built_deviation = {rounded_up(most)!r}    # m, under the design load, in the worst of twenty structures as built: {why}"
        f"{stray and f'; {stray}'}\n"
        f"# unloaded_deviation = {rounded_up(most)!r}    # m, of the braced shell before any load: fewer cables let the load move it farther into its shape"
    )


def optimise_table(surface: Surface, design: FirstDesign) -> str:
    """The table of the search."""
    off = may_come_off(surface, design.thickness)
    why = f"a {OF_SPAN:g}th of the span" if off > 0.5 * design.thickness else "half the concrete's thickness"
    far, misfit = far_told(design, surface), float(f"{0.005 * design.spacing / PAPER_SPACING:.3g}")
    return f"""\
[optimise]
misfit = 0.7         # w1
cable_force = 0.3    # w2
# built_misfit = 0.3 # of the shape as built, with 0.35 for the others: keeps cables that hold structures as built in shape
misfit_rms_additional = {misfit!r}     # m, constraint (6): the paper's 5 mm × {design.spacing / PAPER_SPACING:.3g}
deviation = {rounded_up(off)!r}    # m, {why}: beyond it no cable is taken away for shape; limits.deviation requires it{far and f"; {far}"}
# allowance = 1.0    # of the objective, 1 at the start, that taking cables away may cost in all: fewer cables, with the shape up to that deviation off
evaluations = {_EVALUATIONS}     # a first answer in minutes; 100 leave fewer cables
polish = {_POLISHED}
unloaded = false     # true: make the design without regard to the loads too, to compare with
"""
