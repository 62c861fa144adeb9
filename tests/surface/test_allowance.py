"""How much memory and time a reader's process may take."""

from types import SimpleNamespace

import pytest

from shellform.surface.readers import allowance

NO_LIMIT = -1


class Limits:
    """In place of the system's: `soft` and `hard` ones by kind."""

    RLIMIT_DATA, RLIMIT_CPU, RLIM_INFINITY = "data", "cpu", NO_LIMIT

    def __init__(self, **hard):
        self.soft = {}
        self.hard = {"data": NO_LIMIT, "cpu": NO_LIMIT, **hard}

    def getrlimit(self, kind):
        return self.soft.get(kind, NO_LIMIT), self.hard[kind]

    def setrlimit(self, kind, both):
        self.soft[kind], self.hard[kind] = both


def file_of(size):
    return SimpleNamespace(stat=lambda: SimpleNamespace(st_size=size))


def test_a_file_may_take_half_a_minute_and_1500_megabytes_and_more_by_its_size(monkeypatch):
    limits = Limits()
    monkeypatch.setattr(allowance, "resource", limits)
    allowance.allow_file(file_of(0))
    assert limits.soft == {"data": 1_500_000_000, "cpu": 30}
    allowance.allow_file(file_of(2_000_001))
    assert limits.soft == {"data": 1_560_000_030, "cpu": 91}, "30 bytes and 30 µs a byte, seconds rounded up"
    allowance.allow_mesh(100_000.0)
    assert limits.soft == {"data": 1_760_000_030, "cpu": 141}, "2 kB and 0.5 ms a triangle more"
    assert limits.hard == {"data": NO_LIMIT, "cpu": NO_LIMIT}


@pytest.mark.parametrize(("hard", "given"), [(20, 20), (31, 31), (1000, 31)])
def test_no_more_is_asked_for_than_the_system_allows(monkeypatch, hard, given):
    limits = Limits(cpu=hard)
    monkeypatch.setattr(allowance, "resource", limits)
    allowance.allow_file(file_of(10_000))
    assert (limits.soft["cpu"], limits.hard["cpu"]) == (given, hard)


def test_where_the_system_knows_no_limits_none_are_set(monkeypatch):
    monkeypatch.setattr(allowance, "resource", None)
    allowance.allow_file(file_of(10))
    allowance.allow_mesh(10.0)
