"""Drawn structures: the same whatever else is drawn, loaded as `shellform analyse` does, and counted."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from shellform.errors import InputError
from shellform.gridshell.tolerances import Tolerances, default_tolerances
from shellform.reliability import path_of_one, standing
from shellform.reliability.branch import STRAY, Branch
from shellform.reliability.drawing import built_beams, built_cables, built_load, errors_of, sizes, variables
from shellform.reliability.path_of_one import BORNE, ENDED, UNLOADED, Limit
from shellform.reliability.perfect import perfect, perfect_of
from shellform.reliability.resting import Resting
from shellform.reliability.standing import Workshop, sample
from shellform.structure.answers.analysis import analyse
from shellform.structure.elements.state import State
from shellform.structure.model import Model, read_model, write_model
from shellform.structure.solve.loading import SMALLEST

LARGE = Tolerances(cable_length=3e-4, supports=3e-4, marks=3e-4, load_each=0.1, load_all=0.05, connectors=0.1)


def drawn(nominal, tolerances, number, seed=7):
    return errors_of(nominal.members, tolerances, variables(nominal.members, seed, number))


def as_model(nominal, errors):
    """The drawn structure as a model file's content; shapes and bows have no place there."""
    network = nominal.network
    beams = built_beams(network.beams, errors)
    cables = built_cables(network.cables, nominal.present, errors)
    other = replace(network, beams=beams, cables=cables, imposed=network.imposed + errors.supports)
    return Model(other, {"design": built_load(nominal.load, errors)}, nominal.start, ())


@pytest.mark.parametrize("share", [1.0, 1.2])
def test_a_drawn_structure_ends_as_the_analysis_of_its_own_model_says(dome, share):
    nominal = perfect(dome, dome.design(), share * dome.point_load(4.5, every=2))
    workshop = Workshop(nominal)
    reference = analyse(as_model(nominal, drawn(nominal, Tolerances(), 0))).equilibrium.state
    for number in range(12):
        errors = drawn(nominal, LARGE, number)
        found = workshop.load(errors, number=number)
        told = analyse(as_model(nominal, errors))
        far = np.linalg.norm(told.equilibrium.state.positions - reference.positions, axis=1).max()
        stands = told.converged and told.equilibrium.stable and far < 0.05 * nominal.members.span
        assert found.stands == stands, number
        if stands:
            assert found.state.positions == pytest.approx(told.equilibrium.state.positions, abs=1e-8)


@pytest.mark.parametrize(
    ("share", "tolerances"), [(1.0, LARGE), (1.2, LARGE), (0.7, Tolerances(marks=1e-3, supports=5e-4))]
)
def test_what_rests_beside_the_perfect_structure_comes_there_from_nothing_too(dome, share, tolerances):
    """In fewer factorisations; what doesn't is loaded from nothing, and falls where it falls. In the last one
    some snap on the way."""
    nominal = perfect(dome, dome.design(), share * dome.point_load(4.5, every=2))
    workshop, stood = Workshop(nominal), 0
    for number in range(12):
        errors = drawn(nominal, tolerances, number)
        found, expected = (
            workshop.rests(errors, resolution=1 / 32),
            workshop.fall(errors, most=1.0, resolution=1 / 32),
        )
        assert found.factor == expected.factor, number
        if workshop.with_structure(errors, lambda loading: loading.beside()) is not None:
            stood += 1
            assert found.factorisations < expected.factorisations
            assert found.state.positions == pytest.approx(expected.state.positions, abs=1e-5)
        else:
            assert found.factorisations > expected.factorisations
    assert stood >= 3


def test_what_rested_in_another_design_is_found_next_to_there_in_fewer_factorisations(dome):
    """Supports 1 mm off leave the first tangent beside the perfect structure indefinite."""
    load, far = dome.point_load(4.5, every=2), Tolerances(supports=1e-3)
    start = dome.design()
    other = replace(start, rest_length=0.999 * start.rest_length)
    before, nominal = perfect(dome, start, load), perfect(dome, other, load)
    first, workshop = Workshop(before), Workshop(nominal)
    helped = 0
    for number in range(6):
        errors = drawn(nominal, far, number)
        rest = first.rests(errors, resolution=1 / 32)
        if rest.factor < 1.0:
            continue
        known = Resting(before.states[-1], {number: rest.state})
        expected = workshop.rests(errors, resolution=1 / 32)
        found = workshop.rests(errors, resolution=1 / 32, number=number, before=known)
        assert found.factor == expected.factor
        assert found.state.positions == pytest.approx(expected.state.positions, abs=1e-5)
        helped += found.factorisations < 0.5 * expected.factorisations
        unknown = workshop.rests(errors, resolution=1 / 32, number=number + 1, before=known)
        assert unknown.factorisations == expected.factorisations
    assert helped >= 3


def test_nothing_rests_beside_a_perfect_structure_that_falls(dome):
    nominal = perfect(dome, dome.design(), 2.5 * dome.point_load(4.5, every=2))
    assert not nominal.bears
    workshop, errors = Workshop(nominal), drawn(nominal, LARGE, 0)
    assert workshop.with_structure(errors, lambda loading: loading.beside()) is None
    found, expected = (
        workshop.rests(errors, resolution=1 / 32),
        workshop.fall(errors, most=1.0, resolution=1 / 32),
    )
    assert (found.factor, found.factorisations) == (expected.factor, expected.factorisations)


def test_an_equilibrium_far_from_where_the_errors_lead_is_none_beside(dome, monkeypatch):
    nominal = perfect(dome, dome.design(), dome.point_load(4.5, every=2))
    workshop, errors = Workshop(nominal), drawn(nominal, LARGE, 1)
    assert workshop.with_structure(errors, lambda loading: loading.beside()) is not None
    monkeypatch.setattr(path_of_one, "STRAY", 1e-9)
    assert workshop.with_structure(errors, lambda loading: loading.beside()) is None


def test_small_steps_lead_to_the_same_states(nominal):
    workshop = Workshop(nominal)
    for number in range(6):
        errors = drawn(nominal, LARGE, number)
        large, small = workshop.load(errors), workshop.load(errors, step=1 / 64, smallest=1 / 256)
        assert large.stands == small.stands
        if large.stands:
            assert large.state.positions == pytest.approx(small.state.positions, abs=1e-8)


def test_a_structure_has_the_same_bits_whatever_the_count_the_order_and_the_threads(nominal, monkeypatch):
    tolerances = replace(LARGE, rod_bow=1e-3, shape=5e-4)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    alone = Workshop(nominal).load_numbers(tolerances, seed=3, numbers=[4, 2])
    monkeypatch.setenv("OMP_NUM_THREADS", "3")
    among = Workshop(nominal).load_numbers(tolerances, seed=3, numbers=range(6))
    for one, other in zip(alone, (among[4], among[2]), strict=True):
        assert (one.number, one.factor, one.far) == (other.number, other.factor, other.far)
        assert one.state.positions.tobytes() == other.state.positions.tobytes()


def test_causes_are_drawn_each_on_its_own_with_mean_zero_and_deviation_one(nominal):
    causes = list(sizes(nominal.members))
    z = {name: [] for name in causes}
    for number in range(40):
        for name, values in variables(nominal.members, 1, number).items():
            z[name].append(values)
    every = [np.concatenate(z[name]) for name in causes]
    for name, values in zip(causes, every, strict=True):
        assert abs(values.mean()) < 4.0 / np.sqrt(len(values)), name
        assert abs(values.std() - 1.0) < 4.0 / np.sqrt(2 * len(values)), name
    assert len(np.unique(np.concatenate(every))) == sum(map(len, every))


def test_two_designs_of_a_shell_are_drawn_with_the_same_errors(dome, nominal):
    half = replace(dome.design(), present=np.arange(len(dome.cable_ends)) % 2 == 0)
    other = perfect(dome, half, 0.1 * nominal.load)
    errors = drawn(nominal, LARGE, 5)
    one = built_cables(nominal.network.cables, nominal.present, errors)
    two = built_cables(other.network.cables, other.present, errors)
    assert one.rest_length[half.present] == pytest.approx(two.rest_length, abs=0.0)


def test_without_errors_the_perfect_structure_comes_out(nominal):
    found = Workshop(nominal).load(drawn(nominal, Tolerances(), 0))
    assert found.stands
    assert found.factor == 1.0
    assert found.far < 1e-9


def test_marks_move_crossings_along_the_rod_and_keep_its_elements_in_one_piece(nominal):
    errors = drawn(nominal, Tolerances(marks=1e-4), 1)
    z = variables(nominal.members, 7, 1)["marks"]
    first = 0
    for rod in nominal.members.rods:
        own = 1e-4 * z[first : first + len(rod.marks)]
        first += len(rod.marks)
        place = np.append(0.0, np.cumsum(errors.beam_length[rod.elements]))
        assert place[rod.marks] == pytest.approx(own - own[0], abs=1e-15)


def test_an_uneven_load_has_the_same_sum_and_one_half_heavier(nominal):
    errors = drawn(nominal, Tolerances(load_uneven=0.1), 2)
    assert errors.load.std() > 0.01
    assert errors.load.mean() == pytest.approx(1.0, abs=1e-12)


def test_a_model_file_is_drawn_and_loaded_like_the_shell_it_came_from(dome, nominal, tmp_path):
    file = tmp_path / "model.json"
    supports = tuple(int(node) for node in dome.net.supports)
    write_model(file, Model(nominal.network, {"design": nominal.load}, dome.target, supports))
    model = perfect_of(read_model(file), "design")
    assert len(model.members.rods) == len(nominal.members.rods)
    for one, other in zip(model.members.rods, nominal.members.rods, strict=True):
        assert one.elements.tolist() == other.elements.tolist()
        assert one.marks.tolist() == other.marks.tolist()
    assert model.states[-1].positions == pytest.approx(nominal.states[-1].positions, abs=1e-8)
    assert Workshop(model).load_numbers(LARGE, seed=0, numbers=[0])[0].stands


def test_an_unknown_load_case_of_a_model_is_refused(dome, nominal):
    model = Model(nominal.network, {"design": nominal.load}, dome.target, ())
    with pytest.raises(InputError, match="Known: design"):
        perfect_of(model, "wind")


def test_a_model_without_start_is_refused(nominal):
    with pytest.raises(InputError, match="start"):
        perfect_of(Model(nominal.network, {"design": nominal.load}, None, ()), "design")


@pytest.mark.parametrize(("share", "stands"), [(0.048, True), (0.052, False)])
def test_what_comes_to_rest_farther_than_a_twentieth_of_the_span_from_the_planned_place_has_fallen(
    nominal, share, stands
):
    end = nominal.states[-1]
    aside = np.array([share * nominal.members.span, 0.0, 0.0])
    shifted = State(end.positions + aside, end.quaternions)
    elsewhere = Workshop(replace(nominal, states=(*nominal.states[:-1], shifted)))
    found = elsewhere.load(errors_of(nominal.members, Tolerances(), variables(nominal.members, 1, 0)))
    assert found.factor == 1.0
    assert found.far == pytest.approx(share * nominal.members.span, rel=1e-3)
    assert found.stands is stands


def test_a_sample_counts_those_that_stand(dome, nominal):
    found = sample(dome, dome.design(), nominal.load, default_tolerances(dome), count=8, seed=1)
    assert found.standing.drawn == len(found.outcomes) == 8
    assert found.standing.standing == sum(each.stands for each in found.outcomes)


def test_no_structure_at_all_is_refused(dome, nominal):
    with pytest.raises(InputError, match="at least 1"):
        sample(dome, dome.design(), nominal.load, LARGE, count=0, seed=0)


def test_a_negative_seed_is_refused(nominal):
    with pytest.raises(InputError, match="seed"):
        variables(nominal.members, -1, 0)


def test_next_to_a_load_it_is_known_surely_whether_a_structure_stands_under_it(nominal):
    none = drawn(nominal, Tolerances(), 0)
    workshop = Workshop(nominal)
    end = workshop.limit(none, most=3.0, step=0.25, resolution=1e-4).factor
    coarse = workshop.limit(none, most=3.0, step=1.0, resolution=0.25).factor
    assert coarse < end - 0.02  # else this test says nothing
    just = [end - 0.01, end + 0.01]
    marked = [workshop.limit(none, most=3.0, step=1.0, resolution=0.25, marks=[mark]) for mark in just]
    assert marked[0].factor >= just[0]
    assert marked[1].factor < just[1]
    assert workshop.load(none, marks=[end - 0.01]).factor >= min(end - 0.01, 1.0)


def test_an_iteration_with_foreseen_deformations_ends_where_one_with_the_state_s_own_does(
    nominal, monkeypatch
):
    workshop = Workshop(nominal)
    mixed = [workshop.load(drawn(nominal, LARGE, number)) for number in range(6)]
    monkeypatch.setattr(Branch, "foreseen", lambda *_: None)
    plain = [workshop.load(drawn(nominal, LARGE, number)) for number in range(6)]
    for one, other in zip(mixed, plain, strict=True):
        assert one.stands == other.stands
        assert one.factorisations <= other.factorisations
        if one.stands:
            assert one.state.positions == pytest.approx(other.state.positions, abs=1e-8)


def test_a_structure_whose_first_tangent_is_indefinite_is_relaxed_to_the_same_state(nominal, monkeypatch):
    errors = drawn(nominal, LARGE, 3)
    workshop = Workshop(nominal)
    expected = workshop.load(errors)
    real = Branch.newton
    monkeypatch.setattr(
        Branch,
        "newton",
        lambda self, *given, **named: real(self, *given, **named) if named["limit"] < 15 else None,
    )
    found = workshop.load(errors)
    assert found.factorisations > expected.factorisations
    assert found.stands == expected.stands
    assert found.state.positions == pytest.approx(expected.state.positions, abs=1e-8)


def test_a_structure_of_which_one_spot_snaps_goes_on_and_ends_as_the_analysis_of_its_own_model_says(dome):
    """Marks a millimetre off on cells of 110: two of sixteen snap by 5 and 7 mm at a rod's end, and bear the
    whole load."""
    nominal = perfect(dome, dome.design(), dome.point_load(3.0, every=2))
    coarse, workshop = Tolerances(marks=1e-3, supports=5e-4), Workshop(nominal)
    made = workshop.load_numbers(coarse, seed=1, numbers=range(16))
    snapped = [each for each in made if each.stands and each.snaps]
    assert len(snapped) >= 2
    assert any(not each.stands for each in made)
    assert all(own.far <= STRAY * nominal.members.span for each in made for own in each.snaps), (
        "else it falls"
    )
    for each in snapped:
        assert all(0.0 < own.factor < 1.0 and own.far < STRAY * nominal.members.span for own in each.snaps)
        errors = drawn(nominal, coarse, each.number, seed=1)
        end = workshop.limit(errors, most=1.0)
        assert end.factor < 1.0, "without going on after snaps it ends there"
        assert each.snaps[0].factor == pytest.approx(end.factor, abs=1e-9)
        gone = np.linalg.norm(each.state.positions - end.state.positions, axis=1).max()
        assert 0.4 * gone < each.snaps[0].far < gone, "the rest of the load moves nodes too"
        assert workshop.fall(errors, most=1.0).factor == 1.0
        told = analyse(as_model(nominal, errors))
        assert told.converged
        assert told.equilibrium.stable
        assert each.state.positions == pytest.approx(told.equilibrium.state.positions, abs=1e-6)


def test_beyond_the_end_of_its_path_a_structure_goes_on_as_from_nothing_or_falls_there(dome):
    nominal = perfect(dome, dome.design(), dome.point_load(3.0, every=2))
    coarse, workshop = Tolerances(marks=1e-3, supports=5e-4), Workshop(nominal)
    goes_on, falls = 0, 0
    for each in workshop.load_numbers(coarse, seed=1, numbers=range(16)):
        if each.stands and not each.snaps:
            continue
        errors = drawn(nominal, coarse, each.number, seed=1)
        end = workshop.limit(errors, most=1.0, resolution=SMALLEST)
        factor, snaps = workshop.beyond(errors, end, most=1.0, resolution=SMALLEST)
        if each.stands:
            goes_on += 1
            assert factor == 1.0
            assert snaps[0].factor == end.factor
            assert snaps[0].far == pytest.approx(each.snaps[0].far, rel=1e-3)
        elif not each.snaps:
            falls += 1
            assert (factor, snaps) == (end.factor, ())
    assert goes_on >= 2
    assert falls >= 1


def test_no_more_than_so_many_spots_may_snap_before_a_structure_counts_as_fallen(dome, monkeypatch):
    nominal = perfect(dome, dome.design(), dome.point_load(3.0, every=2))
    coarse = Tolerances(marks=1e-3, supports=5e-4)
    monkeypatch.setattr(path_of_one, "SNAPS", 0)
    made = Workshop(nominal).load_numbers(coarse, seed=1, numbers=range(12))
    assert not any(each.snaps for each in made)
    assert not made[9].stands


def test_a_structure_rests_under_a_share_of_the_load_where_one_loaded_with_that_alone_does(dome):
    share, load = 1.0 / 1.2, dome.point_load(4.5, every=2)
    more, less = perfect(dome, dome.design(), 1.2 * load), perfect(dome, dome.design(), load)
    made = Workshop(more).load_numbers(LARGE, seed=7, numbers=range(12), resting=share)
    alone = Workshop(less)
    looked_at = [each for each in made if each.resting is not None]
    assert any(not each.stands for each in looked_at), "one that falls later rested there before"
    for each in looked_at:
        expected = alone.load(drawn(less, LARGE, each.number), number=each.number)
        assert each.resting.positions == pytest.approx(expected.state.positions, abs=1e-8)
        assert np.abs(each.resting.positions - each.state.positions).max() > 1e-5
    for each in made:
        assert (each.resting is None) == (each.factor < share)
    for each, same in zip(made, Workshop(more).load_numbers(LARGE, seed=7, numbers=range(12)), strict=True):
        assert same.resting is None, "where nobody asks"
        assert (same.factor, same.stands) == (each.factor, each.stands)


def test_a_structure_that_has_snapped_beyond_a_load_tells_where_it_rested_before(dome):
    share, coarse = 0.2, Tolerances(marks=1e-3, supports=5e-4)
    nominal = perfect(dome, dome.design(), dome.point_load(3.0, every=2))
    made = Workshop(nominal).load_numbers(coarse, seed=1, numbers=range(16), resting=share)
    beyond = [each for each in made if each.snaps and each.snaps[0].factor > share]
    assert len(beyond) >= 2
    workshop = Workshop(perfect(dome, dome.design(), share * dome.point_load(3.0, every=2)))
    for each in beyond:
        alone = workshop.load(drawn(nominal, coarse, each.number, seed=1))
        assert not alone.snaps
        assert each.resting.positions == pytest.approx(alone.state.positions, abs=1e-8)
        assert len(each.snaps) >= 1, "which are told as before"


END, BESIDE = SimpleNamespace(state="end"), SimpleNamespace(state="beside")


class Beside:
    """A workshop's structure that ends so."""

    def __init__(self, end, factor, beside=None):
        self.end, self.factor, self.near, self.asked, self.spent = end, factor, beside, [], 9

    def beside(self):
        return self.near

    def borne(self, *given, **how):
        self.asked.append(("borne", given, how))
        return self.end, self.factor

    def followed(self, *given, **how):
        self.asked.append(("followed", given, how))
        return self.end, self.factor

    def kind(self, end):
        return f"kind of {end.state}"


@pytest.fixture
def workshop(monkeypatch):
    """One whose structures are told."""
    made = object.__new__(Workshop)
    made.nominal = SimpleNamespace(unloaded="unloaded", members="members")

    def limit(way, structure, *given, **how):
        monkeypatch.setattr(made, "with_structure", lambda errors, work, **_: work(structure), raising=False)
        return getattr(made, way)("errors", *given, **how)

    return made, limit


@pytest.mark.parametrize(
    ("way", "path", "told", "usual"),
    [
        (
            "limit",
            "followed",
            {"begin": "known", "marks": (0.9,)},
            {"begin": None, "marks": (), "heeding": True},
        ),
        ("fall", "borne", {}, {}),
    ],
)
def test_a_structure_s_limit_is_the_end_of_its_branch_and_its_fall_where_snaps_end(
    workshop, way, path, told, usual
):
    _, limit = workshop
    structure = Beside(END, 0.8)
    found = limit(way, structure, most=1.5, step=0.5, resolution=1 / 128, **told)
    assert vars(found) == vars(Limit(0.8, "kind of end", "end", 9))
    assert structure.asked == [(path, (1.5, 0.5, 1 / 128), usual | told)]
    assert limit(way, structure, most=0.8).kind == BORNE
    assert structure.asked[-1] == (path, (0.8, 1.0, 1 / 64), usual)
    assert limit(way, structure, most=0.9, tell=False).kind == ENDED
    assert vars(limit(way, Beside(None, 0.0), most=0.9)) == vars(Limit(0.0, UNLOADED, "unloaded", 9))


def test_a_structure_that_rests_beside_the_perfect_one_is_not_loaded_from_nothing(workshop):
    _, limit = workshop
    structure = Beside(END, 0.8, BESIDE)
    assert vars(limit("rests", structure, resolution=1 / 32)) == vars(Limit(1.0, BORNE, "beside", 9))
    assert structure.asked == []
    structure.near = None
    assert vars(limit("rests", structure, resolution=1 / 32, marks=(0.7,))) == vars(
        Limit(0.8, ENDED, "end", 9)
    )
    assert structure.asked == [("borne", (1.0, 1.0, 1 / 32), {"marks": (0.7,)})]


def test_drawn_structures_are_loaded_number_by_number_and_counted(monkeypatch, workshop):
    made, _ = workshop
    heard = []

    def load(errors, **how):
        heard.append((errors, how))
        return SimpleNamespace(stands=how["number"] % 3 != 0)

    monkeypatch.setattr(made, "load", load)
    monkeypatch.setattr(standing, "draw_errors", lambda *given: given)
    made.load_numbers("rough", seed=4, numbers=[5, 2], step=0.5, marks=(0.8,), resting=0.3)
    assert sorted(heard, key=lambda each: each[1]["number"]) == [
        (("members", "rough", 4, k), {"number": k, "step": 0.5, "marks": (0.8,), "resting": 0.3})
        for k in (2, 5)
    ]
    monkeypatch.setattr(standing, "perfect", lambda *given: given)
    monkeypatch.setattr(standing, "Workshop", lambda nominal: made)
    found = standing.sample("shell", "design", "load", "rough", count=7, seed=4, confidence=0.9)
    assert (found.standing.drawn, found.standing.standing, found.standing.seed) == (7, 4, 4)
    assert (found.standing.confidence, len(found.outcomes)) == (0.9, 7)


@pytest.mark.parametrize(("resting", "end"), [(None, "found"), (0.3, ("rested", "found", 0.3, 0.5, 1 / 128))])
def test_where_a_structure_rests_under_a_share_is_looked_for_where_it_is_asked(
    monkeypatch, workshop, resting, end
):
    made, _ = workshop
    structure = SimpleNamespace(
        outcome=lambda step, smallest, marks: (
            "found" if (step, smallest, marks) == (0.5, 1 / 128, (0.8,)) else None
        ),
        rested=lambda *given: ("rested", *given),
    )
    monkeypatch.setattr(made, "with_structure", lambda errors, work, *, number: (work(structure), number))
    found = made.load("errors", number=3, step=0.5, smallest=1 / 128, marks=(0.8,), resting=resting)
    assert found == (end, 3)
