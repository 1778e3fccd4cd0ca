"""The surface of Nav2 that nav2_simple_commander uses, and the processes behind it."""

from __future__ import annotations

import pytest
from lifecycle_msgs.msg import TransitionEvent
from rcl_interfaces.srv import GetParameters
from std_msgs.msg import String
from std_srvs.srv import Trigger

from nena_robot_simulator.servers import Transition
from support.action_types import needs_action_types
from support.ros import RosPeer
from support.simple_commander import SimpleCommander
from support.simulator import heard, publisher_to, simulated_robot
from support.waiting import wait_until

pytestmark = pytest.mark.ros


@needs_action_types
def test_a_simple_commander_finds_its_way_about(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, localisation={"known_at_start": False}):
        commander = SimpleCommander(peer, start=(1.0, 1.0))
        commander.wait_until_nav2_active()
        assert commander.go_to_pose(4.0, 1.0)
        wait_until(commander.is_task_complete, what="the goal's end")
        assert commander.result() == "SUCCEEDED"
        assert commander.feedback.messages[0].distance_remaining == 0.0
        assert commander.go_through_poses((6.0, 1.0), (8.0, 1.0))
        wait_until(commander.is_task_complete, what="the goal's end")
        assert commander.result() == "SUCCEEDED"
        assert commander.go_to_pose(35.0, 1.0)
        assert not commander.is_task_complete()
        commander.cancel_task()
        assert commander.result() == "CANCELED"


@needs_action_types
def test_a_deactivated_navigator_refuses_until_it_is_activated(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        events = peer.subscribe(TransitionEvent, "bt_navigator/transition_event")
        commander = SimpleCommander(peer)
        commander.wait_until_nav2_active()
        assert commander.change_state("bt_navigator", Transition.DEACTIVATE)
        assert not commander.change_state("bt_navigator", Transition.DEACTIVATE)
        assert not commander.go_to_pose(3.0, 0.0)
        assert commander.change_state("bt_navigator", Transition.ACTIVATE)
        assert commander.go_to_pose(3.0, 0.0)
        assert [each.goal_state.label for each in events.messages] == ["inactive", "active"]


def test_parameters_are_told_all_or_none(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, tolerance={"xy": 0.4}):
        client = peer.client(GetParameters, "controller_server/get_parameters")
        names = ["goal_checker_plugins", "general_goal_checker.xy_goal_tolerance"]
        checkers, tolerance = peer.call(client, GetParameters.Request(names=names)).values
        assert list(checkers.string_array_value) == ["general_goal_checker"]
        assert tolerance.double_value == 0.4
        assert not peer.call(client, GetParameters.Request(names=[*names, "no_such_thing"])).values


@pytest.mark.parametrize(
    ("server", "service"),
    [
        ("amcl", "request_nomotion_update"),
        ("map_server", "map_server/map"),
        ("controller_server", "follow_path/_action/cancel_goal"),
        ("behavior_server", "spin/_action/cancel_goal"),
        ("lifecycle_manager_localization", "lifecycle_manager_localization/is_active"),
    ],
)
def test_a_process_that_dies_takes_its_endpoints_along(
    domain_id: int, peer: RosPeer, server: str, service: str
) -> None:
    def offered() -> bool:
        return f"/{service}" in dict(peer.node.get_service_names_and_types())

    with simulated_robot(domain_id):
        wait_until(offered, what=service)
        fault = publisher_to(peer, String, "simulator/fault")
        fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}"}}'))
        wait_until(lambda: not offered(), what=f"{service} gone")
        fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}", "active": false}}'))
        wait_until(offered, what=f"{service} back")


def test_a_lifecycle_manager_tells_of_a_server_that_is_missing(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        active = peer.client(Trigger, "lifecycle_manager_localization/is_active")
        assert peer.call(active, Trigger.Request()).success
        fault = publisher_to(peer, String, "simulator/fault")
        fault.publish(String(data='{"kind": "server_hung", "server": "amcl"}'))
        heard(peer)
        assert not peer.call(active, Trigger.Request()).success
