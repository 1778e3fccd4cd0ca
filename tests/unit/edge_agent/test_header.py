from __future__ import annotations

from datetime import timedelta

import pytest

from nena_edge_agent.header import RESERVE, WRAP, HeaderMaker
from nena_shared.clock import ManualClock
from nena_shared.vda5050.topics import RobotKey, Topic


@pytest.mark.clause("7.2/headerId", "7.2")
def test_each_topic_is_counted_for_itself_from_0() -> None:
    clock = ManualClock()
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock)

    first = maker.make(Topic.STATE)
    clock.advance(2.0)
    second = maker.make(Topic.STATE)
    other = maker.make(Topic.CONNECTION)

    assert (first["header_id"], second["header_id"], other["header_id"]) == (0, 1, 0)
    assert second["timestamp"] - first["timestamp"] == timedelta(seconds=2)
    assert (first["manufacturer"], first["serial_number"], first["version"]) == ("ACME", "1", "2.1.0")
    assert (maker.last_id(Topic.STATE), maker.last_id(Topic.FACTSHEET)) == (1, 0)


@pytest.mark.clause("7.2/headerId")
def test_the_count_stays_within_32_bits() -> None:
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock())
    maker._counts[Topic.STATE] = WRAP - 1

    assert maker.make(Topic.STATE)["header_id"] == WRAP - 1
    assert maker.make(Topic.STATE)["header_id"] == 0


@pytest.mark.clause("7.2/headerId", "6.6/restart")
def test_after_a_restart_the_count_goes_on_behind_all_that_may_have_been_used() -> None:
    clock = ManualClock()
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock)
    used = 0
    for _ in range(3 * RESERVE):
        reserved = maker.reserve()
        used = maker.make(Topic.STATE)["header_id"]

    again = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=clock, reserved=reserved)

    assert used < again.make(Topic.STATE)["header_id"] <= used + RESERVE
    assert again.make(Topic.CONNECTION)["header_id"] == RESERVE


def test_ids_are_set_apart_seldom() -> None:
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock())
    reserved = set()
    for _ in range(3 * RESERVE):
        reserved.add(maker.reserve())
        maker.make(Topic.STATE)

    assert len(reserved) <= 3 * RESERVE // (RESERVE // 2)


def test_ids_are_set_apart_over_the_end_of_the_count() -> None:
    reserved = ((Topic.STATE, WRAP - 2),)
    maker = HeaderMaker(RobotKey("ACME", "1"), version="2.1.0", clock=ManualClock(), reserved=reserved)

    assert dict(maker.reserve())[Topic.STATE] == RESERVE - 2
