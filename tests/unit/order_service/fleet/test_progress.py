from __future__ import annotations

import pytest

from nena_order_service.fleet.mission_run import read
from support.fleet import make_mission
from support.fleet_examples import state

MISSION = make_mission("m", "A", "B")


@pytest.mark.clause("6.6.2/first")
def test_a_robot_that_lists_its_first_node_has_passed_nothing_yet() -> None:
    listed = [{"node_id": "A", "sequence_id": 0, "released": True}, *_to_b()]

    progress = read(state(order_id="m", last_node_id="A", node_states=listed), MISSION)

    assert (progress.passed, progress.done) == (-1, False)


@pytest.mark.clause("6.6.2/first", "6.6.2/fleet")
def test_a_robot_that_does_not_list_it_stands_there() -> None:
    assert read(state(order_id="m", last_node_id="A", node_states=_to_b()), MISSION).passed == 0


@pytest.mark.clause("6.6.2/fleet")
def test_a_number_that_is_left_from_the_order_before_does_not_count() -> None:
    late = state(order_id="m", last_node_id="A", last_node_sequence_id=8, node_states=_to_b())

    assert read(late, MISSION).passed < MISSION.last_sequence_id


def _to_b() -> list[dict[str, object]]:
    return [{"node_id": "B", "sequence_id": 2, "released": True}]
