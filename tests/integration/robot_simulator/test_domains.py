"""The ROS domains that tests share out among themselves."""

from __future__ import annotations

import pytest

from support import ros
from support.ros import Participant, own_domain_id
from support.waiting import wait_until

pytestmark = pytest.mark.ros


@pytest.fixture(autouse=True)
def no_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the domains of other tests alone."""
    monkeypatch.setattr(ros, "_free", [])


def test_empty_domain_is_reused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who is in a domain in which this process never was cannot be known at once."""
    with own_domain_id() as first:
        pass
    with own_domain_id() as second:
        assert second != first
    monkeypatch.setattr(Participant, "DISCOVERY", 0.0)
    with own_domain_id() as third:
        assert third == first


def test_occupied_domain_is_not_reused(monkeypatch: pytest.MonkeyPatch) -> None:
    with own_domain_id() as first:
        left_over = Participant(first)
    monkeypatch.setattr(Participant, "DISCOVERY", 0.0)
    wait_until(lambda: not ros._participants[first].alone, what="the participants see each other")
    with own_domain_id() as second:
        assert second != first
    assert left_over.context.ok()
