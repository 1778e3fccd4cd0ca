from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from nena_shared.web import rate_limit
from nena_shared.web.rate_limit import RateLimit


def test_so_many_at_once_then_as_time_gives() -> None:
    limit = RateLimit(rate=2.0, burst=3)

    assert [limit.wait("a", 0.0) for _ in range(3)] == [0, 0, 0]
    assert limit.wait("a", 0.0) == pytest.approx(0.5)
    assert limit.wait("a", 0.5) == 0
    assert limit.wait("a", 0.5) > 0


def test_each_asker_has_a_bucket() -> None:
    limit = RateLimit(rate=1.0, burst=1)

    assert limit.wait("a", 0.0) == 0
    assert limit.wait("b", 0.0) == 0
    assert limit.wait("a", 0.0) > 0


def test_a_look_costs_nothing() -> None:
    limit = RateLimit(rate=1.0, burst=1)

    assert [limit.wait("a", 0.0, cost=0) for _ in range(5)] == [0] * 5
    assert limit.wait("a", 0.0) == 0
    assert limit.wait("a", 0.0, cost=0) > 0


def test_it_remembers_a_bounded_number(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rate_limit, "KEPT", 2)
    limit = RateLimit(rate=0.001, burst=1)
    for asker in "abc":
        assert limit.wait(asker, 0.0) == 0

    assert limit.wait("c", 0.0) > 0
    assert limit.wait("a", 0.0) == 0, "the quietest was forgotten"


@given(st.lists(st.floats(0, 10), max_size=50), st.floats(0.1, 100), st.integers(1, 10))
def test_never_more_than_burst_and_rate_allow(pauses: list[float], rate: float, burst: int) -> None:
    limit, now, passed = RateLimit(rate, burst), 0.0, 0
    for pause in pauses:
        now += pause
        passed += limit.wait("a", now) == 0

    assert passed <= burst + rate * now + 1e-6
