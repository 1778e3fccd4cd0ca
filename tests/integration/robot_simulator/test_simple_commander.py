"""The surface of Nav2 that nav2_simple_commander uses, and the processes behind it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from lifecycle_msgs.msg import TransitionEvent
from nav_msgs.msg import Odometry
from rcl_interfaces.srv import GetParameters
from sensor_msgs.msg import BatteryState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from nena_robot_simulator.action_server import action_types
from nena_robot_simulator.goals import Action
from nena_robot_simulator.robot import TRANSFORM_AHEAD
from nena_robot_simulator.servers import Server, Transition
from support.action_types import needs_action_types, needs_commander_types, needs_nav2_types
from support.pausing import pass_time
from support.ros import BEST_EFFORT, RosPeer
from support.simple_commander import SimpleCommander
from support.simulator import heard, publisher_to, simulated_robot
from support.waiting import wait_until

pytestmark = pytest.mark.ros


@needs_action_types
def test_simple_commander_navigates(domain_id: int, peer: RosPeer) -> None:
    kind = action_types()[Action.TO_POSE].Impl.FeedbackMessage
    with simulated_robot(domain_id, localisation={"known_at_start": False}):
        feedback = peer.subscribe(kind, "navigate_to_pose/_action/feedback")
        commander = SimpleCommander(peer, start=(1.0, 1.0))
        commander.wait_until_nav2_active()
        pass_time(TRANSFORM_AHEAD)  # on a slow computer Nav2 has had no transform for long
        assert commander.go_to_pose(4.0, 1.0)
        wait_until(commander.is_task_complete, what="the goal's end")
        assert commander.result() == "SUCCEEDED"
        assert feedback.messages[0].feedback.distance_remaining == 0.0
        assert commander.feedback.messages, "on a busy computer not the first one: it is for an unknown goal"
        assert commander.go_through_poses((6.0, 1.0), (8.0, 1.0))
        wait_until(commander.is_task_complete, what="the goal's end")
        assert commander.result() == "SUCCEEDED"
        assert commander.go_to_pose(35.0, 1.0)
        assert not commander.is_task_complete()
        commander.cancel_task()
        assert commander.result() == "CANCELED"


@needs_nav2_types
def test_simple_commander_uses_behaviors_controller_and_maps(
    domain_id: int, peer: RosPeer, tmp_path: Path
) -> None:
    odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
    with simulated_robot(domain_id):
        commander = SimpleCommander(peer)
        commander.wait_until_nav2_active()
        begins: tuple[Callable[[], bool], ...] = (
            lambda: commander.follow_path((0.0, 0.0), (1.0, 0.0), (2.0, 0.0)),
            lambda: commander.backup(0.5, 0.25),
            lambda: commander.spin(1.57),
        )
        for begin in begins:
            assert begin()
            wait_until(commander.is_task_complete, what="its end")
            assert commander.result() == "SUCCEEDED"
        odometry.clear()
        assert odometry.wait_for().pose.pose.position.x < 1.9
        commander.clear_all_costmaps()
        write_map(tmp_path)
        assert commander.change_map(f"{tmp_path}/map.yaml")
        assert not commander.change_map(f"{tmp_path}/missing.yaml")


@needs_commander_types
def test_a_simple_commander_asks_for_paths_and_costmaps(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, start={"x": 1.0, "y": 1.0}):
        commander = SimpleCommander(peer)
        path = commander.get_path(None, (4.0, 1.0))
        assert path is not None
        assert [round(each.pose.position.x, 2) for each in (path.poses[0], path.poses[-1])] == [1.0, 4.0]
        assert path.header.frame_id == "map"
        path = commander.get_path((2.0, 2.0), (2.0, 5.0))
        assert path is not None
        assert path.poses[0].pose.position.y == 2.0
        path = commander.get_path_through_poses((4.0, 1.0), (4.0, 4.0))
        assert path is not None
        assert any(each.pose.position.x == 4.0 and each.pose.position.y == 1.0 for each in path.poses)
        assert commander.get_path(None, (-60.0, 0.0)) is None, "it is outside of the map"
        assert commander.follow_path((1.0, 1.0), (2.0, 1.0)), "the controller takes a path of a client"
        for name in ("global_costmap", "local_costmap"):
            costmap = commander.get_costmap(name)
            assert len(costmap.data) == costmap.metadata.size_x * costmap.metadata.size_y
            assert set(costmap.data) == {0, 254}


@needs_commander_types
def test_a_simple_commander_follows_waypoints_docks_and_undocks(domain_id: int, peer: RosPeer) -> None:
    battery = peer.subscribe(BatteryState, "battery_state", BEST_EFFORT)
    with simulated_robot(domain_id):
        commander = SimpleCommander(peer)
        assert commander.follow_waypoints((1.0, 0.0), (-60.0, 0.0), (2.0, 0.0))
        wait_until(commander.is_task_complete, what="the last waypoint")
        assert (commander.result(), commander.missed_waypoints) == ("SUCCEEDED", [1])
        told = [each.current_waypoint for each in commander.feedback.messages]
        assert (told[0], told[-1]) == (0, 2)
        assert commander.follow_waypoints((35.0, 0.0))
        commander.cancel_task()
        assert commander.result() == "CANCELED"
        assert battery.wait_for().current < 0
        assert commander.dock("dock")
        wait_until(commander.is_task_complete, what="docking")
        assert commander.result() == "SUCCEEDED"
        battery.wait_for(lambda told: told.current > 0)
        begins: tuple[Callable[[], bool], ...] = (
            commander.undock,
            lambda: commander.drive_on_heading(0.3, 0.2),
        )
        for begin in begins:
            assert begin()
            wait_until(commander.is_task_complete, what="its end")
            assert commander.result() == "SUCCEEDED"


@needs_commander_types
def test_simple_commander_shuts_down_and_starts_nav2(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        commander = SimpleCommander(peer, start=(1.0, 1.0))
        assert commander.go_to_pose(35.0, 1.0)
        commander.wait_for_progress()
        assert commander.lifecycle_shutdown() == [True, True]
        assert commander.result() == "FAILED"
        wait_until(lambda: not peer.node.count_publishers("amcl_pose"), what="all servers down")
        assert commander.lifecycle_startup() == [False, False], "its processes have to be started again"
        fault = publisher_to(peer, String, "simulator/fault")
        for server in Server:
            fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}"}}'))
        services = peer.node.get_service_names_and_types
        wait_until(lambda: not any("get_state" in name for name, _ in services()), what="no processes")
        for server in Server:
            fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}", "active": false}}'))
        wait_until(lambda: peer.node.count_publishers("amcl_pose") == 1, what="its bring-up")
        commander.wait_until_nav2_active()
        assert commander.go_to_pose(4.0, 1.0)


def write_map(folder: Path) -> None:
    """Write a small map for map_server."""
    (folder / "map.pgm").write_bytes(b"P5 20 20 255 " + bytes([254] * 400))
    text = "image: map.pgm\nresolution: 0.5\norigin: [-5.0, -5.0, 0.0]\nnegate: 0\n"
    (folder / "map.yaml").write_text(f"{text}occupied_thresh: 0.65\nfree_thresh: 0.25\n")


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


def test_parameters_are_returned_all_or_none(domain_id: int, peer: RosPeer) -> None:
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
def test_killed_process_loses_its_endpoints(domain_id: int, peer: RosPeer, server: str, service: str) -> None:
    def offered() -> bool:
        return f"/{service}" in dict(peer.node.get_service_names_and_types())

    with simulated_robot(domain_id):
        wait_until(offered, what=service)
        fault = publisher_to(peer, String, "simulator/fault")
        fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}"}}'))
        wait_until(lambda: not offered(), what=f"{service} gone")
        fault.publish(String(data=f'{{"kind": "server_died", "server": "{server}", "active": false}}'))
        wait_until(offered, what=f"{service} back")


def test_restarted_process_is_unconfigured_until_bring_up(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        events = peer.subscribe(TransitionEvent, "planner_server/transition_event")
        fault = publisher_to(peer, String, "simulator/fault")
        fault.publish(String(data='{"kind": "server_died", "server": "planner_server"}'))
        fault.publish(String(data='{"kind": "server_died", "server": "planner_server", "active": false}'))
        events.wait_for(lambda event: event.goal_state.label == "active", what="the bring-up")
        steps = [(each.start_state.label, each.goal_state.label) for each in events.messages]
        assert steps == [("unconfigured", "inactive"), ("inactive", "active")]


def test_lifecycle_manager_reports_a_missing_server(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id):
        active = peer.client(Trigger, "lifecycle_manager_localization/is_active")
        assert peer.call(active, Trigger.Request()).success
        fault = publisher_to(peer, String, "simulator/fault")
        fault.publish(String(data='{"kind": "server_hung", "server": "amcl"}'))
        heard(peer)
        assert peer.call(active, Trigger.Request()).success, "its bond has not broken yet"
        wait_until(lambda: not peer.call(active, Trigger.Request()).success, what="the broken bond")
