"""Rate limits of clients and of robots."""

from __future__ import annotations

from functools import partial

import pytest
from hypothesis import given
from hypothesis import strategies as st
from structlog.testing import capture_logs

from nena_shared import rate_limit
from nena_shared.rate_limit import BYTES_PER_MESSAGE, MessageRate, RateLimit


def test_burst_then_steady_rate() -> None:
    limit = RateLimit(rate=2.0, burst=3)

    assert [limit.wait("a", 0.0) for _ in range(3)] == [0, 0, 0]
    assert limit.wait("a", 0.0) == pytest.approx(0.5)
    assert limit.wait("a", 0.5) == 0
    assert limit.wait("a", 0.5) > 0


def test_each_client_has_its_own_limit() -> None:
    limit = RateLimit(rate=1.0, burst=1)

    assert limit.wait("a", 0.0) == 0
    assert limit.wait("b", 0.0) == 0
    assert limit.wait("a", 0.0) > 0


def test_check_costs_nothing() -> None:
    limit = RateLimit(rate=1.0, burst=1)

    assert [limit.wait("a", 0.0, cost=0) for _ in range(5)] == [0] * 5
    assert limit.wait("a", 0.0) == 0
    assert limit.wait("a", 0.0, cost=0) > 0


def test_number_of_stored_clients_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
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


def exceeded(rate: MessageRate, topic: str, size: int, now: float) -> bool:
    return rate.exceeded(topic, size, now, read=lambda: None)


def test_a_topic_beyond_its_rate_is_dropped_and_others_are_not() -> None:
    rate = MessageRate(2.0, 3)

    assert [exceeded(rate, "a", 10, 0.0) for _ in range(5)] == [False] * 3 + [True] * 2
    assert not exceeded(rate, "b", 10, 0.0)
    assert not exceeded(rate, "a", 10, 0.5)


def test_a_long_message_counts_as_several() -> None:
    rate = MessageRate(1.0, 10)

    assert not exceeded(rate, "a", 12 * BYTES_PER_MESSAGE, 0.0), "one is always read"
    assert exceeded(rate, "a", 10, 2.0)
    assert not exceeded(rate, "a", 10, 3.0)


def test_dropped_messages_are_logged_once_a_minute() -> None:
    rate = MessageRate(0.001, 1)
    with capture_logs() as logs:
        for second in range(0, 90, 10):
            exceeded(rate, "a", 10, float(second))

    assert [each["topic"] for each in logs] == ["a", "a"]


def test_the_last_dropped_message_of_a_topic_is_read_once_its_rate_allows() -> None:
    rate, found = MessageRate(1.0, 1), list[int]()

    def receive(number: int, now: float) -> None:
        if not rate.exceeded("a", 10, now, read=partial(receive, number, 2.0)):
            found.append(number)

    for number in range(5):
        receive(number, 0.0)
    for now in (0.5, 2.0, 2.5, 9.0):
        rate.read_postponed(now)

    assert found == [0, 4]


def test_a_dropped_message_is_not_read_after_a_newer_one() -> None:
    rate, found = MessageRate(1.0, 1), list[int]()
    for number, now in ((0, 0.0), (1, 0.1), (2, 1.1)):
        if not rate.exceeded("a", 10, now, read=partial(found.append, number)):
            found.append(number)
    rate.read_postponed(9.0)

    assert found == [0, 2]


def test_few_and_short_messages_are_postponed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rate_limit, "POSTPONED", 1)
    rate, found = MessageRate(1.0, 1), list[str]()
    for topic, size in (("long", BYTES_PER_MESSAGE + 1), ("a", 10), ("b", 10)):
        for _ in range(2):
            rate.exceeded(topic, size, 0.0, read=partial(found.append, topic))
    rate.read_postponed(9.0)

    assert found == ["a"]


@pytest.mark.provokes_failures
def test_a_postponed_message_that_cannot_be_read_hinders_nothing() -> None:
    rate, found = MessageRate(1.0, 1), list[str]()

    def fail() -> None:
        raise ZeroDivisionError

    for topic, read in (("a", fail), ("b", partial(found.append, "b"))):
        for _ in range(2):
            rate.exceeded(topic, 10, 0.0, read=read)
    with capture_logs() as logs:
        rate.read_postponed(9.0)

    assert found == ["b"]
    assert [each["topic"] for each in logs] == ["a"]
