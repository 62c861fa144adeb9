"""Work side by side on the cores."""

import threading

import pytest

from shellform.structure.elements import threads


@pytest.fixture(params=["1", "2"])
def asked(request, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", request.param)
    return int(request.param)


def test_results_come_in_the_order_of_the_items_on_as_many_threads_as_asked_for(asked):
    both, names = threading.Barrier(asked), set()

    def work(item):
        both.wait(10.0)  # ends only where `asked` threads are at work at once
        names.add(threading.current_thread().name)
        return 2 * item

    assert threads.side_by_side(work, [3, 1, 2, 7]) == [6, 2, 4, 14]
    assert len(names) == asked


def test_an_error_in_one_item_is_raised(asked):
    with pytest.raises(ZeroDivisionError):
        threads.side_by_side(lambda item: 1 // item, [1, 0, 2])


def test_results_in_turn_come_in_order_while_the_next_ones_are_worked_on(asked):
    later = threading.Event()

    def work(item):
        if item == 0 and asked > 1:
            assert later.wait(10.0)  # set by an item that comes after it
        if item == 2:
            later.set()
        return 2 * item

    assert list(threads.in_turn(work, range(9))) == [2 * item for item in range(9)]


def test_what_has_not_begun_is_left_out_once_no_more_results_are_taken(asked):
    begun = []
    results = threads.in_turn(lambda item: begun.append(item) or item, range(100))
    assert next(results) == 0
    results.close()
    assert 1 <= len(begun) <= 4 * asked
    count = len(begun)
    assert not list(results)
    assert len(begun) == count


def test_an_error_in_an_item_is_raised_in_its_turn(asked):
    results = threads.in_turn(lambda item: 1 // item, [1, 1, 0, 2])
    assert [next(results), next(results)] == [1, 1]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_dense_algebra_within_the_block_runs_on_one_thread():
    import numpy as np
    from threadpoolctl import threadpool_info, threadpool_limits

    def counts():
        return {each["num_threads"] for each in threadpool_info() if each["user_api"] == "blas"}

    np.ones((4, 4)) @ np.ones((4, 4))
    with threadpool_limits(2):  # whatever the machine and its environment say
        before = counts()
        assert 2 in before  # of a library built for one thread it stays 1
        with threads.dense_on_one():
            assert counts() == {1}
        assert counts() == before


def test_work_within_an_item_stays_on_its_thread(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "2")
    seen = []

    def work(_):
        own, names = threading.current_thread().name, set()
        threads.side_by_side(lambda _: names.add(threading.current_thread().name), range(4))
        threads.share(lambda *_: names.add(threading.current_thread().name), 10_000)
        seen.append(names == {own})

    threads.side_by_side(work, range(2))
    assert seen == [True, True]


@pytest.mark.parametrize(("asked", "count"), [("3", 3), ("12", 12), ("0", 5), ("-2", 5), ("", 5), ("two", 5)])
def test_as_many_cores_are_used_as_are_asked_for_or_granted(monkeypatch, asked, count):
    monkeypatch.setenv("OMP_NUM_THREADS", asked)
    monkeypatch.setattr(threads.os, "sched_getaffinity", lambda _: set(range(5)), raising=False)
    assert threads.cores() == count


@pytest.mark.parametrize(("told", "count"), [(6, 6), (None, 1)])
def test_where_the_system_grants_none_by_number_all_that_there_are_count(monkeypatch, told, count):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delattr(threads.os, "sched_getaffinity", raising=False)
    monkeypatch.setattr(threads.os, "cpu_count", lambda: told)
    assert threads.cores() == count


@pytest.mark.parametrize(
    ("count", "parts"),
    [
        (999, [(0, 999)]),
        (1000, [(0, 500), (500, 1000)]),
        (1501, [(0, 500), (500, 1000), (1000, 1501)]),
        (9000, [(0, 3000), (3000, 6000), (6000, 9000)]),
        (0, [(0, 0)]),
    ],
)
def test_a_loop_is_shared_in_equal_parts_from_500_elements_a_core_on(monkeypatch, count, parts):
    monkeypatch.setattr(threads, "cores", lambda: 3)
    done = []
    threads.share(lambda start, stop, more: done.append((start, stop, more)), count, "more")
    assert sorted(done) == [(*part, "more") for part in parts]


def test_a_loop_within_an_item_that_has_a_core_to_itself_is_not_shared(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 3)
    done = []

    def work(item):
        threads.share(lambda start, stop: done.append((start, stop)), 9000)
        return item

    assert threads.side_by_side(work, [1, 2]) == [1, 2]
    assert done == [(0, 9000)] * 2


def test_an_error_in_any_part_of_a_loop_is_raised(monkeypatch):
    monkeypatch.setattr(threads, "cores", lambda: 3)
    with pytest.raises(ZeroDivisionError):
        threads.share(lambda start, _: 1 // (start - 6000), 9000)
