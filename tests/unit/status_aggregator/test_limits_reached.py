"""What the limits leave out is counted and logged."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from structlog.testing import capture_logs

from nena_conversations.kit.honest_robot import HonestRobot
from nena_shared.mqtt import Inbound
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import codec_for
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.metrics.exposition import Exposition
from nena_status_aggregator.mqtt import LIMITS_LOGGED_EVERY
from nena_status_aggregator.settings import AggregatorSettings
from support.clocks import ManualClock
from support.fleet_examples import order_status


def deliver(aggregator: Aggregator, topic: str, payload: bytes) -> None:
    for handler in aggregator.link.mqtt._handlers(topic):
        handler(Inbound(topic, payload, retained=False))


def limits_logged(aggregator: Aggregator) -> list[Mapping[str, Any]]:
    with capture_logs() as logs:
        aggregator.link.report_limits()
    return [each for each in logs if each["log_level"] == "error"]


async def test_open_orders_beyond_the_limit_are_counted_and_logged() -> None:
    clock = ManualClock()
    aggregator = Aggregator(
        AggregatorSettings.model_validate(
            {"orders_limit": 1, "open_orders_limit": 2, "history": {"url": "none"}}
        ),
        clock,
    )
    for number in range(5):
        aggregator.model.on_order_status(order_status(f"TO-{number}"), aggregator.now())
    assert [each["orders_removed"] for each in limits_logged(aggregator)] == [3]
    text = Exposition(aggregator).text().decode()
    assert "nena_transport_orders_open_forgotten_total 3" in text

    aggregator.model.on_order_status(order_status("TO-9"), aggregator.now())
    assert limits_logged(aggregator) == [], "once a minute"
    clock.advance(LIMITS_LOGGED_EVERY)
    assert [each["orders_removed"] for each in limits_logged(aggregator)] == [1]
    clock.advance(LIMITS_LOGGED_EVERY)
    assert limits_logged(aggregator) == [], "only when there are more"


async def test_robots_beyond_the_limit_are_logged() -> None:
    settings = AggregatorSettings.model_validate({"robots_limit": 1, "history": {"url": "none"}})
    aggregator = Aggregator(settings, ManualClock())
    codec = codec_for("2.1.0")
    for name in "abc":
        robot = HonestRobot(key=RobotKey("ACME", name))
        deliver(aggregator, f"uagv/v2/ACME/{name}/state", codec.encode(robot.state()))
    assert [(each["limit"], each["messages_ignored"]) for each in limits_logged(aggregator)] == [(1, 2)]
