"""Messages retained from before a robot changed its version are ignored."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import pytest

from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.robot_sources import RobotSources
from nena_shared.vda5050.topics import RobotKey, TopicScheme

pytestmark = pytest.mark.clause("4.2")

ROBOT = RobotKey("ACME", "r1")
OLD, NEW = TopicScheme("uagv", "v2"), TopicScheme("vda5050", "v3")
START = datetime(2026, 1, 1, tzinfo=UTC)


class Ear:
    def __init__(self) -> None:
        self.sources = RobotSources()

    def hears(
        self,
        scheme: TopicScheme,
        *,
        retained: bool,
        at: float = 0.0,
        robot: RobotKey = ROBOT,
        says: ConnectionState = ConnectionState.ONLINE,
    ) -> bool:
        message = Connection(
            header_id=0,
            timestamp=START + timedelta(seconds=at),
            version="2.1.0",
            manufacturer=robot.manufacturer,
            serial_number=robot.serial_number,
            connection_state=says,
        )
        return self.sources.accepts(robot, scheme, message, retained=retained)


def test_retained_messages_on_other_topics_are_ignored_after_a_live_one() -> None:
    ear = Ear()

    assert ear.hears(NEW, retained=False)
    assert not ear.hears(OLD, retained=True, at=99)
    assert ear.hears(NEW, retained=True)


def test_newer_of_two_retained_messages_decides() -> None:
    ear = Ear()

    assert ear.hears(OLD, retained=True, at=1)
    assert ear.hears(NEW, retained=True, at=2)
    assert not ear.hears(OLD, retained=True, at=1)
    other = Ear()
    assert other.hears(NEW, retained=True, at=2)
    assert not other.hears(OLD, retained=True, at=1)


def test_robot_that_moved_to_another_topic_is_accepted() -> None:
    ear = Ear()
    ear.hears(OLD, retained=False)

    assert ear.hears(NEW, retained=False)
    assert not ear.hears(OLD, retained=True, at=99)


def test_live_message_outranks_a_newer_retained_one() -> None:
    ear = Ear()
    ear.hears(OLD, retained=True, at=5)
    ear.hears(OLD, retained=False, at=1)

    assert not ear.hears(NEW, retained=True, at=9)


def test_expected_source_counts_as_current() -> None:
    ear = Ear()
    ear.sources.expect(ROBOT, NEW)

    assert not ear.hears(OLD, retained=True, at=99)
    assert ear.hears(OLD, retained=False)


def test_robots_are_checked_independently() -> None:
    ear = Ear()
    ear.hears(NEW, retained=False)

    assert ear.hears(OLD, retained=True, robot=RobotKey("ACME", "r2"))


@pytest.mark.parametrize("farewell", [ConnectionState.OFFLINE, ConnectionState.CONNECTION_BROKEN])
def test_end_of_an_old_connection_does_not_affect_the_new_one(farewell: ConnectionState) -> None:
    ear = Ear()
    ear.hears(OLD, retained=False)
    assert ear.hears(OLD, retained=False, says=farewell), "while it speaks there, it is its own"
    ear.hears(NEW, retained=False)

    assert not ear.hears(OLD, retained=False, at=99, says=farewell)
    assert ear.hears(NEW, retained=False, says=farewell)


def test_end_of_a_connection_may_be_the_first_message_of_a_robot() -> None:
    ear = Ear()

    assert ear.hears(OLD, retained=False, at=1, says=ConnectionState.CONNECTION_BROKEN)
    assert ear.hears(NEW, retained=False)
    assert not ear.hears(OLD, retained=True, at=99)
