"""Robots that send too many messages: dropped before they are read, counted, and others are not affected."""

from __future__ import annotations

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.clock import SystemClock
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.model import FleetModel, ModelLimits
from nena_status_aggregator.mqtt import FleetSubscriber
from nena_status_aggregator.settings import AggregatorSettings
from support.clocks import ManualClock
from support.fleet_examples import ROBOT

OTHER = RobotKey("ACME", "other")


def deliver(link: FleetSubscriber, topic: str, payload: bytes) -> None:
    for handler in link.mqtt._handlers(topic):
        handler(Inbound(topic, payload, retained=False))


async def test_a_flood_of_one_robot_is_dropped_and_counted() -> None:
    model, codec = FleetModel(ModelLimits()), codec_for("2.1.0")
    settings = AggregatorSettings(messages_per_second=0.001, messages_burst=20)
    link = FleetSubscriber(settings, model, SystemClock())
    flood, other = HonestRobot(key=ROBOT), HonestRobot(key=OTHER)
    states = [flood.state() for _ in range(50)]

    for state in states:
        deliver(link, f"uagv/v2/{ROBOT}/state", codec.encode(state))
    deliver(link, f"uagv/v2/{OTHER}/state", codec.encode(other.state()))
    for _ in range(30):
        deliver(link, f"nena/v1/robots/{ROBOT}/map", b"")

    read, other_robot = model.robots.get(ROBOT), model.robots.get(OTHER)
    assert read
    assert read.state
    assert read.state.header_id == states[19].header_id
    assert other_robot
    assert other_robot.state
    assert model.statistics.too_many[MessageKind.STATE] == 30
    assert model.statistics.too_many[MessageKind.ROBOT_MAP] == 10


async def test_the_last_will_of_a_robot_that_flooded_its_connection_topic_is_read() -> None:
    model, codec, clock = FleetModel(ModelLimits()), codec_for("2.1.0"), ManualClock()
    link = FleetSubscriber(AggregatorSettings(messages_per_second=10, messages_burst=20), model, clock)
    robot = HonestRobot(key=ROBOT)
    for each in [ConnectionState.ONLINE] * 30 + [ConnectionState.CONNECTION_BROKEN]:
        deliver(link, f"uagv/v2/{ROBOT}/connection", codec.encode(robot.connection(each)))

    def state() -> ConnectionState | None:
        known = model.robots.get(ROBOT)
        return known.connection.connection_state if known and known.connection else None

    assert state() is ConnectionState.ONLINE
    link.read_postponed()
    assert state() is ConnectionState.ONLINE, "not before the limit allows"
    clock.advance(1.0)
    link.read_postponed()
    assert state() is ConnectionState.CONNECTION_BROKEN
