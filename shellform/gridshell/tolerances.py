"""What a gridshell as built is off by: standard deviations of lengths, places, stiffnesses, loads and shape.

Every entry is the standard deviation of a normal variable of mean 0 (stiffnesses: of the logarithm). Where a
standard states a permissible deviation that is meant to hold for nearly all pieces, half of it is taken, so
that 95 % of the pieces keep it; a cable's permissible deviation is taken whole, since its ends slip too.
`SOURCES` names where each default is from; `default_tolerances` evaluates them for the real size. A model
below 2 m is built with jigs and callipers, what spans less than 4 m in a workshop, to whose general
tolerances dimensions are kept that far; both have defaults of their own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Final

from shellform.errors import InputError, if_per_cents, require_known, require_number
from shellform.gridshell.gridshell import Gridshell
from shellform.plan_rectangle import longest_side
from shellform.quantities import PLACE_DEVIATION

SCALE_MODEL_BELOW: Final = 2.0  # m of span
WORKSHOP_BELOW: Final = 4.0  # m of span: the largest dimension in `_MEDIUM`
# m: ISO 2768-1, class m (medium): up to which dimension, and what is permitted either way
_MEDIUM: Final = (
    (0.006, 1e-4),
    (0.03, 2e-4),
    (0.12, 3e-4),
    (0.4, 5e-4),
    (1.0, 8e-4),
    (2.0, 1.2e-3),
    (4.0, 2e-3),
)
LARGEST_SHARE: Final = 0.5  # relative deviations beyond this are no tolerances
LENGTHS: Final = ("cable_length", "supports", "marks")  # the deviations that are lengths

SOURCES: Final[Mapping[str, str]] = {
    "cable_length": "cut length and turnbuckle: EN 1090-2 annex B, length of a cut member, 2 mm + L/5000; "
    "in a workshop (spans of 2 to 4 m): ISO 2768-1, class m; scale model: set by callipers to 0.1 mm",
    "cable_stiffness": "EN 12385-10 and VDI 2358 leave the modulus of a strand to tests; 5 % about the "
    "maker's mean",
    "supports": "DIN 18202 table 1 permits 10 mm in plan up to 1 m between points that are set out, two "
    "deviations; in a workshop (spans of 2 to 4 m): ISO 2768-1, class m, 2 mm, two deviations; scale "
    "model: drilled base plate, 0.1 mm",
    "marks": "scribed to 1 mm, beside half of the 0.3 mm that a tape of class II may be off anywhere (2004/22/EC); "
    "in a workshop (spans of 2 to 4 m): ISO 2768-1, class m, of the longest rod, two deviations; scale "
    "model: 0.2 mm",
    "rod_stiffness": "JCSS Probabilistic Model Code part 3.2, modulus of elasticity: coefficient of "
    "variation 0.03",
    "rod_bow": "EN 10219-2 (tubes) and EN 13706-2 (pultruded profiles): bow of 0.2 % of the length, two "
    "deviations",
    "connectors": "couplers of one make scatter by 10 % about their mean stiffness in tests (EN 74-1 asks "
    "for its characteristic)",
    "load_each": "thickness of 50 mm to 10 mm, two deviations (EN 13670, 10.6): 10 % of what a crossing "
    "carries",
    "load_all": "JCSS Probabilistic Model Code part 2.1: concrete's density 0.04, with the mean thickness "
    "0.05 together",
    "load_uneven": "EN 12812, 8.2.5: concrete is placed unevenly; one half 5 % more and the other 5 % less; "
    "scale model: weights are hung crossing by crossing, 1 %",
    "shape": "EN 1993-1-6, 8.7: imperfections in the shape of the softest modes; half of L/1000, what other "
    "causes don't hold; scale model: what callipers leave, 0.1 mm in a metre",
    "cable_stiffness_all": "the maker's mean modulus is taken as tested, unless a doubt about it is given here",
    "connectors_all": "the make's mean stiffness is taken as tested, unless a doubt about it is given here",
    "tape": "half of the 0.2 mm a metre that a tape of class II may be off (2004/22/EC), alike along a rod; in a "
    "workshop and of a scale model counted in the marks",
}


@dataclass(frozen=True)
class Tolerances:
    """Standard deviations; 0 leaves a cause out.

    In m:
    - `cable_length` of each cable; `supports`: of each coordinate of each support; `marks`: of each
      crossing's place along each rod, its ends included.

    Relative:
    - `cable_stiffness` of each cable, `rod_stiffness` of each rod (all four constants), `connectors` of each
      connector; `cable_stiffness_all` and `connectors_all` of all together.
    - `load_each` of what each crossing carries, `load_all` of the whole load, `load_uneven` of one half of
      the plan against the other, in either direction of two at right angles.
    - `tape`: of all lengths along each rod, which its marks are measured with.
    - `rod_bow`: rise of each rod's own arc over its length, about either axis.
    - `shape`: amplitude of each of the softest modes over the span.
    """

    cable_length: float = 0.0
    cable_stiffness: float = 0.0
    supports: float = 0.0
    marks: float = 0.0
    rod_stiffness: float = 0.0
    rod_bow: float = 0.0
    connectors: float = 0.0
    load_each: float = 0.0
    load_all: float = 0.0
    load_uneven: float = 0.0
    shape: float = 0.0
    cable_stiffness_all: float = 0.0
    connectors_all: float = 0.0
    tape: float = 0.0

    def __post_init__(self) -> None:
        for each in fields(self):
            value, where = getattr(self, each.name), f"tolerances.{each.name}"
            length = each.name in LENGTHS
            give = "metres, such as 0.0001" if length else "a share, such as 0.03 for 3 %"
            require_number(value, least=0.0, where=where, give=f"{give}, or 0 for none")
            if length:
                PLACE_DEVIATION.require(value, where=where, least=0.0)
            elif value > LARGEST_SHARE:
                raise InputError(
                    f"is a share and must not exceed {LARGEST_SHARE:g}",
                    where=where,
                    value=value,
                    remedy=f"Write 0.1 for 10 %.{if_per_cents(value, LARGEST_SHARE)}",
                )

    @property
    def causes(self) -> tuple[str, ...]:
        """The names of those that aren't left out."""
        return tuple(each.name for each in fields(self) if getattr(self, each.name) > 0.0)

    def require_causes(self) -> None:
        """Raises InputError where all are left out."""
        if not self.causes:
            raise InputError(
                "nothing is off",
                where="tolerances",
                remedy=f"Give one of {', '.join(each.name for each in fields(self))} more than 0, such as "
                "rod_stiffness = 0.03.",
            )

    def only(self, *names: str) -> Tolerances:
        """The same with all other causes left out. Raises InputError for an unknown name."""
        known = [each.name for each in fields(self)]
        for name in names:
            require_known(name, known, where="tolerances", what="there is no such cause")
        return Tolerances(**{name: getattr(self, name) for name in names})


def tolerances_of_size(span: float, *, longest_rod: float, longest_cable: float) -> Tolerances:
    """The defaults for a shell of that `span`, its longest rod and cable, m (SOURCES)."""
    for name, value in (("span", span), ("longest_rod", longest_rod)):
        require_number(value, above=0.0, where=name, give="metres, such as 0.9")
    model = span < SCALE_MODEL_BELOW
    if model:
        cable_length, supports, marks, tape = 1e-4, 1e-4, 2e-4, 0.0
    elif span < WORKSHOP_BELOW:
        cable_length, supports = _medium(longest_cable), 0.5 * _medium(span)
        marks, tape = 0.5 * _medium(longest_rod), 0.0
    else:
        cable_length, supports = 2e-3 + longest_cable / 5000.0, 5e-3
        marks, tape = 1e-3 + 0.5 * 0.3e-3, 0.5 * 0.2e-3
    return Tolerances(
        cable_length=cable_length,
        cable_stiffness=0.05,
        supports=supports,
        marks=marks,
        rod_stiffness=0.03,
        rod_bow=0.001,
        connectors=0.1,
        load_each=0.1,
        load_all=0.05,
        load_uneven=0.01 if model else 0.05,
        shape=1e-4 if model else 5e-4,
        tape=tape,
    )


def _medium(dimension: float) -> float:
    """What ISO 2768-1 permits a `dimension`, m, to be off either way in class m, m; beyond the table what its
    largest may be."""
    return next((off for most, off in _MEDIUM if dimension <= most), _MEDIUM[-1][1])


def enlarged(tolerances: Tolerances, factor: float) -> Tolerances:
    """The same causes with deviations larger by a factor, as far as they may go."""
    farthest = PLACE_DEVIATION.possible[1]
    most = {each.name: farthest if each.name in LENGTHS else LARGEST_SHARE for each in fields(Tolerances)}
    return Tolerances(**{name: min(factor * getattr(tolerances, name), own) for name, own in most.items()})


def default_tolerances(shell: Gridshell) -> Tolerances:
    """The defaults for a gridshell of its size."""
    return tolerances_of_size(
        span_of(shell),
        longest_rod=max(rod.length for rod in shell.net.grid.rods),
        longest_cable=float(shell.cable_lengths.max(initial=0.0)),
    )


def span_of(shell: Gridshell) -> float:
    """The longest side, m, of the box round the target, however it is turned in plan."""
    return longest_side(shell.target.positions)
