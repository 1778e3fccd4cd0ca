from __future__ import annotations

from itertools import pairwise

import pytest

from nena_order_service.engine.zone_sets import (
    FIRST_PAUSE,
    LONGEST_PAUSE,
    WantedZoneSet,
    ZoneDistribution,
    ZoneStep,
)
from nena_shared.vda5050.state import RobotZoneSetStatus, ZoneSetState
from support.scripted_fleet import key
from support.zones import zone, zone_set

pytestmark = pytest.mark.clause("6.4")

SET = zone_set(zone("z", "BLOCKED", 0, 1))
ROBOT = key("V1")


def at_robot(status: str) -> list[ZoneSetState]:
    return [ZoneSetState(zone_set_id="s1", map_id=SET.map_id, zone_set_status=RobotZoneSetStatus(status))]


@pytest.mark.parametrize(
    ("status", "wanted", "steps"),
    [
        ("", WantedZoneSet(zone_set=SET), [ZoneStep.SEND]),
        ("DISABLED", WantedZoneSet(zone_set=SET), []),
        ("DISABLED", WantedZoneSet(zone_set=SET, enabled=True), [ZoneStep.ENABLE]),
        ("ENABLED", WantedZoneSet(zone_set=SET, enabled=True), []),
        ("ENABLED", WantedZoneSet(zone_set=SET), []),
        ("DISABLED", WantedZoneSet(zone_set=SET, deleted=True), [ZoneStep.DELETE]),
        ("", WantedZoneSet(zone_set=SET, deleted=True), []),
    ],
)
def test_steps_to_the_target_status_are_due(
    status: str, wanted: WantedZoneSet, steps: list[ZoneStep]
) -> None:
    states = at_robot(status) if status else []
    due = ZoneDistribution().due_steps(ROBOT, states, {"s1": wanted}, 0.0)
    assert [each.step for each in due] == steps


def test_steps_are_retried_with_growing_delays_until_confirmed() -> None:
    distribution, wanted = ZoneDistribution(), {"s1": WantedZoneSet(zone_set=SET)}
    times = [now for now in range(5000) if list(distribution.due_steps(ROBOT, [], wanted, float(now)))]
    pauses = [later - earlier for earlier, later in pairwise(times)]
    assert pauses[:3] == [FIRST_PAUSE, 2 * FIRST_PAUSE, 4 * FIRST_PAUSE]
    assert max(pauses) == LONGEST_PAUSE
    distribution.record_result(ROBOT, "s1", "too many zones")
    assert distribution.last_result(ROBOT, "s1") == "too many zones"
    assert list(distribution.due_steps(ROBOT, at_robot("DISABLED"), wanted, 5000.0)) == []
    assert distribution.last_result(ROBOT, "s1") == ""
    assert [each.step for each in distribution.due_steps(ROBOT, [], wanted, 5001.0)] == [ZoneStep.SEND]
