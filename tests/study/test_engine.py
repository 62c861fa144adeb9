"""How jobs are handed out and lost workers waited for, with a cluster that is made up."""

import threading
from types import SimpleNamespace

import distributed
import pytest

from shellform.errors import InputError
from shellform.study import engine as engines
from shellform.study.engine import Engine, Manned, NoWorkers, _Threads
from shellform.study.jobs import Job
from shellform.study.outcome import Status


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(seconds=100.0)
    monkeypatch.setattr(engines, "time", SimpleNamespace(monotonic=lambda: now.seconds))
    return now


def test_workers_are_counted_once_a_second_and_waited_for_as_long_as_the_study_has_patience(clock):
    there, counted, told = {"a": 2, "b": 1}, [], []

    def nthreads():
        counted.append(clock.seconds)
        return dict(there)

    seen = _Threads(Engine(SimpleNamespace(nthreads=nthreads), "", 6.0), told.append)
    for seconds in (100.0, 100.5, 101.0, 101.5):
        clock.seconds = seconds
        seen.look()
    assert counted == [100.0, 101.5]
    assert (seen.number, seen.most) == (3, 2), "threads, and workers"
    there.clear()
    for seconds in (103.0, 105.0, 109.0):
        clock.seconds = seconds
        seen.look()
    assert told[2:] == [Manned(0, 2, 0.0, 0.0), Manned(0, 2, 2.0, 2.0), Manned(0, 2, 6.0, 6.0)]
    clock.seconds = 110.25
    with pytest.raises(NoWorkers, match="no worker for 7 s"):
        seen.look()
    assert told[-1] == Manned(0, 2, 7.25, 7.25)


def test_up_to_eight_workers_a_core_may_be_asked_for(monkeypatch):
    class Begun(Exception):
        pass

    def begin(**how):
        assert how["n_workers"] == 24
        assert how["threads_per_worker"] == 1
        raise Begun

    monkeypatch.setattr(engines, "granted_cores", lambda: 3)
    monkeypatch.setattr(distributed, "LocalCluster", begin)
    with pytest.raises(Begun), engines.engine(workers=24):
        pass
    with (
        pytest.raises(InputError, match=r"at most 8 for each of the 3 cores \(found 25\)"),
        engines.engine(workers=25),
    ):
        pass


class Ended:
    """In place of Dask's queue: one job ends at each asking, the one that was handed out first."""

    def __init__(self, *_, **__):
        self.thread_condition = threading.Condition()
        self.waiting = []

    def update(self, futures):
        self.waiting += futures

    def has_ready(self):
        return bool(self.waiting)

    def next_batch(self, block):
        return [self.waiting.pop(0)]


class Client:
    """Remembers what is handed out."""

    loop = None

    def __init__(self):
        self.handed, self.stages = [], []

    def nthreads(self):
        return {"a": 1, "b": 1}

    def map(self, work, jobs, befores, key, pure):
        self.handed.append([job.key for job in jobs])
        return [
            SimpleNamespace(key=name, job=job, before=before)
            for name, job, before in zip(key, jobs, befores, strict=True)
        ]

    def submit(self, work, job, before, key):
        self.stages.append((job.key, before))
        return f"future of {job.key}"


def test_twice_as_many_jobs_are_handed_out_as_there_are_threads_and_one_for_each_that_ends(
    monkeypatch, clock
):
    monkeypatch.setattr(distributed, "as_completed", Ended)
    monkeypatch.setattr(engines, "_answers", lambda _, futures: [each.job.key for each in futures])
    client, drawn = Client(), []

    def jobs():
        for k in range(7):
            drawn.append(k)
            yield Job(f"k{k}", None, "net", "r")

    swept = engines.sweep(Engine(client, "", 60.0), jobs(), None)
    assert next(swept) == ["k0"]
    assert drawn == [0, 1, 2, 3]
    assert [*swept] == [[f"k{k}"] for k in range(1, 7)]
    assert [keys for keys in client.handed if keys] == [["k0", "k1", "k2", "k3"], ["k4"], ["k5"], ["k6"]]


def test_what_jobs_share_is_handed_out_once_while_one_of_them_is_running(monkeypatch, clock):
    monkeypatch.setattr(distributed, "as_completed", Ended)
    monkeypatch.setattr(
        engines, "_answers", lambda _, futures: [(each.job.key, each.before) for each in futures]
    )
    client = Client()
    first, second = Job("s", None, "surface", "r"), Job("n", None, "net", "r")
    before = [(first, second), (first,), (), (), (), (), (first,)]
    jobs = [Job(f"k{k}", None, "initial", "r", each) for k, each in enumerate(before)]
    found = [each for batch in engines.sweep(Engine(client, "", 60.0), jobs, None) for each in batch]
    assert found == [
        ("k0", "future of n"), ("k1", "future of s"), *((f"k{k}", None) for k in range(2, 6)), ("k6", "future of s"),
    ]  # fmt: skip
    assert client.stages == [("s", None), ("n", "future of s"), ("s", None)], "the last one begins it anew"


def test_a_job_that_was_lost_is_tried_once_more_alone_and_then_given_up(monkeypatch, clock):
    """The second takes each worker with it, the third is lost the first time alone."""
    monkeypatch.setattr(distributed, "as_completed", Ended)
    client = Client()

    def answers(_, futures):
        for job in (each.job.key for each in futures):
            times = sum(job in keys for keys in client.handed)
            if job == "k1" or (job == "k2" and times == 1):
                raise distributed.scheduler.KilledWorker(job, SimpleNamespace(address="w"), 3)
        return [each.job.key for each in futures]

    monkeypatch.setattr(engines, "_answers", answers)
    jobs = [Job(f"k{k}", None, "net", "r") for k in range(4)]
    *found, (lost,) = engines.sweep(Engine(client, "", 60.0), jobs, None)
    assert [batch for batch in found if batch] == [["k0"], ["k3"], ["k2"]]
    assert [keys for keys in client.handed if keys] == [["k0", "k1", "k2", "k3"], ["k1"], ["k2"]]
    assert (lost.key, lost.status) == ("k1", Status.CRASHED)
    assert lost.reason == "took 3 workers with it: out of memory, or a fault in a library"
