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
