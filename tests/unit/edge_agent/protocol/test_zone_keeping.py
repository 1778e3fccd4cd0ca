"""Zone sets that fleet control brings, enables and deletes, as the state tells of them."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.protocol.capabilities import RULES
from nena_edge_agent.protocol.events import ActionReport, ZoneSetReceived
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.zone_set import BidirectedLimitation, DirectedLimitation
from support.robot_core import Bench, action, order
from support.zones import transfer, zone, zone_set

WALL = zone("wall", "BLOCKED", 13, 17)


def held(bench: Bench) -> dict[str, str]:
    return {each.zone_set_id: each.zone_set_status.value for each in bench.state.zone_sets or ()}


@pytest.fixture
def bench() -> Bench:
    return Bench(rules=RULES["3.0.0"])


@pytest.mark.clause("6.4.1", "6.6.5")
def test_the_same_id_is_refused_until_another_set_is_taken(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)))
    bench.do(ZoneSetReceived(transfer(zone("other", "BLOCKED", 0, 1))))

    (entry,) = bench.state.errors
    assert (entry.error_type, entry.error_level.value) == ("DUPLICATE_ZONE_SET", "WARNING")
    assert ("zoneSetId", "s1") in {(e.reference_key, e.reference_value) for e in entry.error_references}
    bench.do(ZoneSetReceived(transfer(WALL, zone_set_id="s2")))
    assert bench.errors == []
    assert held(bench) == {"s1": "DISABLED", "s2": "DISABLED"}


@pytest.mark.clause("6.2.3/enableZoneSet", "6.2.3/deleteZoneSet")
def test_instant_actions_enable_and_delete(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)), ZoneSetReceived(transfer(WALL, zone_set_id="s2")))

    bench.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))
    bench.instant(action("d1", "NONE", "deleteZoneSet", zoneSetId="s1"))
    bench.instant(action("d2", "NONE", "deleteZoneSet", zoneSetId="s2"))
    bench.instant(action("d3", "NONE", "deleteZoneSet", zoneSetId="s2"))

    assert [bench.status(each) for each in ("e", "d1", "d2", "d3")] == [
        "FINISHED",
        "FAILED",
        "FINISHED",
        "FAILED",
    ]
    assert held(bench) == {"s1": "ENABLED"}


@pytest.mark.clause("6.2.3/enableZoneSet")
def test_an_order_enables_a_set_on_a_node(bench: Bench) -> None:
    bench.do(ZoneSetReceived(transfer(WALL)))
    enabling = action("e", "HARD", "enableZoneSet", zoneSetId="s1")

    bench.send(order("n0", "n1", node_actions={"n0": [enabling]}))

    assert bench.status("e") == "FINISHED"
    assert held(bench) == {"s1": "ENABLED"}
    assert bench.goal.pose.x == 10.0


@pytest.mark.clause("6.2.3/downloadZoneSet")
def test_a_set_that_an_action_brought_is_taken_or_fails_it(bench: Bench) -> None:
    for action_id in ("w1", "w2"):
        bench.instant(action(action_id, "NONE", "work"))
        bench.do(ActionReport(action_id, ActionStatus.FINISHED, zone_set=zone_set(WALL)))

    assert (bench.status("w1"), bench.status("w2")) == ("FINISHED", "FAILED")
    assert "DUPLICATE_ZONE_SET" in bench.errors


@pytest.mark.clause("6.4", "6.10/zones", "6.2.3")
@pytest.mark.parametrize("version", ["2.0.0", "2.1.0"])
def test_older_versions_have_no_zones(version: str) -> None:
    bench = Bench(rules=RULES[version])

    bench.instant(action("e", "NONE", "enableZoneSet", zoneSetId="s1"))

    assert bench.capabilities.zones == frozenset()
    assert bench.status("e") == "FAILED"


@pytest.mark.clause("6.4/others")
@pytest.mark.parametrize(
    ("kind", "fields"),
    [
        ("COORDINATED_REPLANNING", {}),
        ("ACTION", {"entry_actions": (), "during_actions": (), "exit_actions": ()}),
        ("PRIORITY", {"priority_factor": 0.5}),
        ("PENALTY", {"penalty_factor": 0.5}),
        ("DIRECTED", {"direction": 0.0, "directed_limitation": DirectedLimitation.SOFT}),
        ("BIDIRECTED", {"direction": 0.0, "bidirected_limitation": BidirectedLimitation.SOFT}),
    ],
)
def test_a_set_with_a_zone_that_the_robot_does_not_support_is_refused(
    bench: Bench, kind: str, fields: dict[str, Any]
) -> None:
    bench.do(ZoneSetReceived(transfer(WALL, zone("other", kind, 20, 30, **fields))))

    assert bench.errors == ["VALIDATION_FAILURE"]
    assert held(bench) == {}
