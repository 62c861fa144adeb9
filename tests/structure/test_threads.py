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
