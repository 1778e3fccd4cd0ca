"""The table of error types (section 6.6.5.4): level, what each refers to, and what ends it."""

from __future__ import annotations

from collections.abc import Callable
from datetime import UTC, datetime
from typing import Any

import pytest

from nena_edge_agent.driver.port import DriveFailed, DriveFailure
from nena_edge_agent.protocol.events import (
    OperatingModeSwitched,
    ResponsesReceived,
    ZoneSetReceived,
)
from nena_shared.vda5050.state import OperatingMode
from nena_shared.vda5050.versions import RULES
from nena_shared.vda5050.zone_set import ZoneReleaseLossBehavior
from support.robot_core import Bench, action, at, order, position
from support.zones import responses, transfer, zone

pytestmark = pytest.mark.clause("6.6.5.4", "6.6.5.2")
NOON = datetime(2026, 1, 1, 12, tzinfo=UTC)
Step = Callable[[Bench], object]


def begin(bench: Bench) -> None:
    """Make the robot wait at n0, its decision point."""
    bench.send(order("n0", "n1", released=1, update=0))


def take_update(bench: Bench) -> None:
    bench.send(order("n0", "n2", update=7))


def take_order(bench: Bench) -> None:
    bench.send(order("n0", "n1", order_id="next"))


def order_beside(bench: Bench) -> None:
    begin(bench)
    take_order(bench)


def order_in_manual(bench: Bench) -> None:
    bench.do(OperatingModeSwitched(OperatingMode.MANUAL))
    take_order(bench)


def enable(bench: Bench, kind: str, left: float, right: float, **fields: Any) -> None:
    set_id = f"{kind} {left}"
    bench.do(ZoneSetReceived(transfer(zone("z", kind, left, right, **fields), zone_set_id=set_id)))
    bench.instant(action(set_id, "NONE", "enableZoneSet", zoneSetId=set_id))


def lose_a_release(bench: Bench, behavior: ZoneReleaseLossBehavior | None = None) -> None:
    enable(bench, "RELEASE", 13, 17, release_loss_behavior=behavior)
    bench.send(order("n0", "n1", "n2"))
    bench.arrive()
    bench.do(ResponsesReceived(responses("zone-1", "GRANTED"), NOON), at(15.0))
    bench.do(ResponsesReceived(responses("zone-1", "REVOKED"), NOON))


def update_after_cancel(bench: Bench) -> None:
    begin(bench)
    bench.instant(action("c", "NONE", "cancelOrder"))
    take_update(bench)


def other_content(bench: Bench) -> None:
    begin(bench)
    bench.send(order("n0", "n2", released=1))


def older_update(bench: Bench) -> None:
    begin(bench)
    bench.send(order("n0", "n2", update=3, released=1))
    bench.send(order("n0", "n1", update=2))


def fail_to_drive(bench: Bench) -> None:
    bench.send(order("n0", "n1", "n2", released=2))
    bench.do(DriveFailed(bench.goal.generation, DriveFailure.ABORTED, "blocked"))


def elsewhere(bench: Bench) -> None:
    upstairs = position(10.0).model_copy(update={"map_id": "attic"})
    bench.send(order("n0", "n1", positions={"n1": upstairs}))


@pytest.mark.parametrize(
    ("kind", "level", "named", "cause", "end"),
    [
        (
            "UNSUPPORTED_PARAMETER",
            "CRITICAL",
            {"parameter"},
            lambda bench: bench.send(order("n0", "n1", edge_fields={"direction": "left"})),
            take_order,
        ),
        (
            "NO_ORDER_TO_CANCEL",
            "WARNING",
            {"actionId"},
            lambda bench: bench.instant(action("c", "NONE", "cancelOrder")),
            take_order,
        ),
        (
            "VALIDATION_FAILURE",
            "WARNING",
            {"orderId", "orderUpdateId"},
            lambda bench: bench.send(order("n0", update=3)),
            take_order,
        ),
        (
            "INVALID_ORDER_ACTION",
            "WARNING",
            {"orderId", "orderUpdateId", "actionId"},
            lambda bench: bench.send(order("n0", node_actions={"n0": [action("x", "NONE", "dance")]})),
            take_order,
        ),
        (
            "INVALID_INSTANT_ACTION",
            "WARNING",
            {"actionId"},
            lambda bench: bench.instant(action("x", "NONE", "dance")),
            lambda bench: bench.instant(action("y", "NONE", "stateRequest")),
        ),
        ("OUTDATED_ORDER_UPDATE", "WARNING", {"orderId", "orderUpdateId"}, older_update, take_update),
        ("SAME_ORDER_UPDATE_ID", "WARNING", {"orderId", "orderUpdateId"}, other_content, take_update),
        (
            "ORDER_UPDATE_FOLLOWING_CANCEL",
            "WARNING",
            {"orderId", "orderUpdateId"},
            update_after_cancel,
            take_order,
        ),
        (
            "OTHER_ORDER_ACTIVE",
            "WARNING",
            {"orderId"},
            order_beside,
            take_update,
        ),
        (
            "START_NODE_OUT_OF_RANGE",
            "WARNING",
            {"orderId"},
            lambda bench: bench.send(order("n5")),
            take_order,
        ),
        (
            "NO_ROUTE_TO_TARGET",
            "WARNING",
            {"orderId"},
            lambda bench: bench.send(order("n0", "n1", positions={"n1": None})),
            take_order,
        ),
        (
            "MOBILE_ROBOT_NOT_AVAILABLE",
            "WARNING",
            {"orderId"},
            order_in_manual,
            lambda bench: bench.do(OperatingModeSwitched(OperatingMode.AUTOMATIC)),
        ),
        ("UNKNOWN_MAP_ID", "WARNING", {"orderId"}, elsewhere, take_order),
        (
            "INSUFFICIENT_MEMORY",
            "URGENT",
            {"orderId", "orderUpdateId"},
            lambda bench: bench.send(order("n0", "n1", "n2", "n3", "n4")),
            take_order,
        ),
        (
            "DUPLICATE_ZONE_SET",
            "WARNING",
            {"zoneSetId"},
            lambda bench: [bench.do(ZoneSetReceived(transfer(zone("z", "BLOCKED", 8, 9)))) for _ in range(2)],
            lambda bench: bench.do(ZoneSetReceived(transfer(zone_set_id="s2"))),
        ),
        (
            "BLOCKED_ZONE_VIOLATION",
            "CRITICAL",
            {"zoneId"},
            lambda bench: enable(bench, "BLOCKED", -1, 1),
            lambda bench: bench.do(at(5.0)),
        ),
        (
            "RELEASE_LOSS_HANDLING",
            "WARNING",
            {"zoneId"},
            lambda bench: lose_a_release(bench, behavior=ZoneReleaseLossBehavior.CONTINUE),
            lambda bench: bench.do(ResponsesReceived(responses("zone-1", "GRANTED"), NOON)),
        ),
        (
            "RELEASE_LOST",
            "CRITICAL",
            {"zoneId"},
            lose_a_release,
            lambda bench: bench.do(ResponsesReceived(responses("zone-1", "GRANTED"), NOON)),
        ),
        (
            "NODE_UNREACHABLE",
            "CRITICAL",
            {"nodeId"},
            fail_to_drive,
            lambda bench: bench.send(order("n1", "n2", update=1, first=2)),
        ),
        (
            "LOCALIZATION_ERROR",
            "FATAL",
            set(),
            lambda bench: bench.do(at(0.0, localized=False)),
            lambda bench: bench.do(at(0.0)),
        ),
    ],
)
def test_an_error_has_its_level_and_references_and_ends_with_its_cause(
    kind: str, level: str, named: set[str], cause: Step, end: Step
) -> None:
    bench = Bench(rules=RULES["3.0.0"], maximum_nodes=4)

    cause(bench)

    (entry,) = bench.state.errors
    assert (entry.error_type, entry.error_level.value) == (kind, level)
    assert named <= {each.reference_key for each in entry.error_references}
    assert entry.error_description
    assert entry.error_hint
    end(bench)
    assert not bench.errors
