"""What is told of kinds of work: each its own time, in any thread, and nothing where nobody listens."""

import time
from concurrent.futures import ThreadPoolExecutor

import pytest

from shellform.work_clock import Work, counts_as, listener, listening, measured


def busy(steps=20_000):
    return sum(k * k for k in range(steps))


@counts_as(Work.SUBSTITUTIONS)
def inner():
    return busy()


@counts_as(Work.EIGENVECTORS)
def outer():
    return busy() + inner() + inner()


def test_a_kind_s_time_is_its_own_without_what_is_done_within_it_under_another():
    with listening() as clock:
        since, began = time.perf_counter(), time.thread_time()
        outer()
        whole, passed = time.thread_time() - began, time.perf_counter() - since
        found = clock.taken()
    assert {work: each.calls for work, each in found.items()} == {
        Work.EIGENVECTORS: 1,
        Work.SUBSTITUTIONS: 2,
    }
    assert 0.0 < sum(each.processor for each in found.values()) <= whole
    assert all(each.clock > 0.0 for each in found.values())
    assert sum(each.clock for each in found.values()) <= passed
    assert found[Work.EIGENVECTORS].processor < whole - found[Work.SUBSTITUTIONS].processor + 1e-9
    assert clock.taken() == {}, "what was told is not told again"


def test_threads_side_by_side_each_add_their_own():
    with listening() as clock, ThreadPoolExecutor(2) as pool:
        for each in [pool.submit(outer) for _ in range(6)]:
            each.result()
        found = clock.taken()
    assert (found[Work.EIGENVECTORS].calls, found[Work.SUBSTITUTIONS].calls) == (6, 12)


def test_an_error_ends_its_kind_of_work():
    @counts_as(Work.CONVEX)
    def fails():
        raise ArithmeticError

    with listening() as clock:
        with pytest.raises(ArithmeticError):
            fails()
        clock.taken()
        busy()
        assert clock.taken() == {}


def test_where_nobody_listens_a_measured_function_is_the_function_itself():
    assert listener() is None
    assert measured(Work.LOOPS, busy) is busy
    with listening() as clock:
        assert measured(Work.LOOPS, busy)() == busy()
        assert clock.taken()[Work.LOOPS].calls == 1
    assert listener() is None
