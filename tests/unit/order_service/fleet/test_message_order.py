"""Which messages are new."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from nena_order_service.fleet.robot import MessageOrder

START = datetime(2026, 1, 1, tzinfo=UTC)


def at(seconds: float) -> datetime:
    return START + timedelta(seconds=seconds)


def order_at(header_id: int, seconds: float) -> MessageOrder:
    order = MessageOrder()
    assert order.is_new(header_id, at(seconds), 0.0)
    return order


def test_rising_headers_are_new() -> None:
    order = order_at(5, 5)
    assert order.is_new(6, at(6), 0.0)
    assert order.is_new(7, at(6), 0.0), "several messages within a hundredth of a second"


@pytest.mark.clause("7.2/headerId")
def test_the_same_message_again_is_not_new_however_often() -> None:
    order = order_at(5, 5)
    assert [order.is_new(5, at(5), 0.0) for _ in range(10)] == [False] * 10


@pytest.mark.clause("7.2/headerId")
def test_an_overtaken_message_is_not_new() -> None:
    order = order_at(5, 5)
    assert not order.is_new(4, at(4), 0.0)
    assert order.is_new(6, at(6), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_a_restart_at_zero_is_new_at_once() -> None:
    assert order_at(5000, 5).is_new(0, at(6), 0.0)


def test_a_clock_that_was_set_back_does_not_matter_while_headers_rise() -> None:
    assert order_at(5, 5000).is_new(6, at(0), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_the_count_may_run_over() -> None:
    assert order_at(2**32 - 1, 5).is_new(0, at(6), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_a_restart_with_a_lost_clock_is_believed_after_some_messages_and_seconds() -> None:
    order = order_at(5000, 5000)
    judged = [order.is_new(number, at(number), now=4.0 * number) for number in range(5)]
    assert judged == [False, False, False, True, True]


def test_old_messages_that_come_in_a_heap_are_no_restart() -> None:
    order = order_at(5000, 5000)
    assert not any(order.is_new(number, at(number), now=9.0) for number in range(100))


def test_a_few_overtaken_messages_are_no_restart() -> None:
    order = order_at(50, 50)
    assert not order.is_new(48, at(48), 0.0)
    assert not order.is_new(47, at(47), 0.0)
    assert not order.is_new(48, at(48), 0.0)
    assert not order.is_new(46, at(46), 0.0)


@pytest.mark.clause("7.2/headerId")
def test_after_a_new_connection_any_message_is_new() -> None:
    order = order_at(5000, 5000)
    order.restart()
    assert order.is_new(0, at(0), 0.0)
    assert not order.is_new(0, at(0), 0.0)
