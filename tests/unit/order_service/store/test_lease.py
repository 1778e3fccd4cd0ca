"""The lease of the active order service, by a clock that the test sets."""

from __future__ import annotations

import pytest

from nena_order_service.store import leadership
from nena_order_service.store.leadership import HANG_SECONDS, LEASE_SECONDS, Lease


class Clock:
    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> Clock:
    made = Clock()
    monkeypatch.setattr(leadership, "seconds_since_boot", made)
    return made


def test_the_lease_ends_before_the_database_frees_the_lock() -> None:
    assert LEASE_SECONDS < HANG_SECONDS


def test_a_term_begins_with_the_first_renewal(clock: Clock) -> None:
    lease = Lease()
    assert lease.term() is None
    lease.renew(clock.now)
    assert lease.term() == 1


def test_a_term_counts_from_the_request_not_from_the_answer(clock: Clock) -> None:
    lease = Lease()
    asked_at = clock.now
    clock.now += LEASE_SECONDS
    lease.renew(asked_at)
    assert lease.term() is None


def test_a_term_renewed_in_time_continues(clock: Clock) -> None:
    lease = Lease()
    for _ in range(10):
        lease.renew(clock.now)
        clock.now += 0.9 * LEASE_SECONDS
        assert lease.term() == 1


def test_after_any_interruption_a_new_term_begins(clock: Clock) -> None:
    lease = Lease()
    lease.renew(clock.now)
    clock.now += LEASE_SECONDS
    assert lease.term() is None
    lease.renew(clock.now)
    assert lease.term() == 2
    lease.end()
    assert lease.term() is None
    lease.renew(clock.now)
    assert lease.term() == 3


def test_it_waits_for_the_previous_leaders_lease(clock: Clock) -> None:
    lease = Lease()
    lease.not_before = clock.now + 1.0
    lease.renew(clock.now)
    assert lease.term() is None
    clock.now += 1.0
    assert lease.term() == 1
