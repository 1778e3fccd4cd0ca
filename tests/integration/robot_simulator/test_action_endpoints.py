"""Nav2's actions as rclpy's own client sees them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from math import dist

import pytest
from action_msgs.msg import GoalStatusArray
from action_msgs.srv import CancelGoal
from nav_msgs.msg import Odometry
from std_msgs.msg import String
from unique_identifier_msgs.msg import UUID

from nena_robot_simulator.goals import Action
from nena_shared.ros import interface
from support.action_client import ABORTED, CANCELED, SUCCEEDED, Client, Outcome, answer_of, outcome_of
from support.action_types import needs_action_types
from support.ros import BEST_EFFORT, LATCHED, RosPeer
from support.simulator import heard, publisher_to, simulated_robot, trace
from support.waiting import wait_until

pytestmark = [pytest.mark.ros, needs_action_types]

CRUISE = 5.0
"""m/s of a robot that lives five times as fast."""
Fault = Callable[[str], None]


@pytest.fixture
def fault(domain_id: int, peer: RosPeer) -> Iterator[Fault]:
    """Yield a separate robot, and a function that starts its faults."""
    with simulated_robot(domain_id):
        publisher = publisher_to(peer, String, "simulator/fault")

        def publish(text: str) -> None:
            publisher.publish(String(data=text))
            heard(peer)

        yield publish


@pytest.fixture
def client(fault: Fault, peer: RosPeer) -> Client:  # noqa: ARG001 - the robot has to be there first
    return Client(peer)


@pytest.fixture
def through(fault: Fault, peer: RosPeer) -> Client:  # noqa: ARG001 - the robot has to be there first
    return Client(peer, Action.THROUGH_POSES)


def test_goal_is_accepted_reported_and_reached(client: Client, peer: RosPeer) -> None:
    arrays = peer.subscribe(GoalStatusArray, "navigate_to_pose/_action/status", LATCHED)
    handle = client.send((4.0, 2.0))
    assert handle.accepted
    assert outcome_of(handle) == (SUCCEEDED, 0)
    wait_until(lambda: trace(arrays.messages)[-1:] == ["A:4"], what="its end in the array")
    left = [told.distance_remaining for told in client.feedback.messages]
    assert left[0] == 0.0, "no path is known yet"
    assert next(each for each in left if each) == pytest.approx(4.5, abs=0.5)
    last = client.feedback.messages[-1].current_pose
    assert last.header.frame_id == "map"
    place = (last.pose.position.x, last.pose.position.y)
    assert left[-1] == pytest.approx(dist(place, (4.0, 2.0)), abs=0.5)
    assert place[0] > 1.0


def test_new_goal_aborts_the_previous_one(client: Client) -> None:
    first = client.send((35.0, 0.0))
    client.feedback.wait_for(lambda told: told.current_pose.pose.position.x > 1.0)
    second = client.send((5.0, 0.0))
    assert outcome_of(first) == (ABORTED, 0)
    assert outcome_of(second) == (SUCCEEDED, 0)


def test_a_cancelled_goal_ends_canceled(client: Client) -> None:
    handle = client.send((35.0, 0.0))
    assert answer_of(handle.cancel_goal_async()).return_code == 0
    assert outcome_of(handle) == (CANCELED, 0)


@pytest.mark.parametrize(
    ("text", "place", "outcome"),
    [
        ('{"kind": "unreachable"}', (4.0, 0.0), (ABORTED, 208)),
        ('{"kind": "abort_halfway"}', (4.0, 0.0), (ABORTED, 105)),
        ('{"kind": "abort_halfway", "error_code": 106}', (4.0, 0.0), (ABORTED, 106)),
        ('{"kind": "stuck", "active": false}', (400.0, 0.0), (ABORTED, 204)),
    ],
)
def test_failed_drive_contains_the_reason(
    text: str, place: tuple[float, float], outcome: Outcome, fault: Fault, client: Client
) -> None:
    fault(text)
    assert outcome_of(client.send(place)) == outcome


def test_a_goal_in_an_unknown_frame_never_starts(client: Client) -> None:
    assert outcome_of(client.send((4.0, 0.0), frame="moon")) == (ABORTED, 0)


@pytest.mark.parametrize("kind", ["reject_goals", "inactive"])
def test_goals_are_refused(kind: str, fault: Fault, client: Client) -> None:
    fault(f'{{"kind": "{kind}"}}')
    wait_until(lambda: not client.send((4.0, 0.0)).accepted, what="a refusal")


def test_goal_id_is_accepted_once(client: Client) -> None:
    goal_id = UUID(uuid=list(range(16)))
    assert client.send((4.0, 0.0), goal_id=goal_id).accepted
    assert not client.send((5.0, 0.0), goal_id=goal_id).accepted


def test_recoveries_are_counted(fault: Fault, client: Client) -> None:
    fault('{"kind": "stuck", "recovery_after": 0.2}')
    client.send((4.0, 0.0))
    client.feedback.wait_for(lambda told: told.number_of_recoveries >= 2)


def test_poses_on_the_way_are_passed_at_speed(through: Client, peer: RosPeer) -> None:
    odometry = peer.subscribe(Odometry, "odom", BEST_EFFORT)
    handle = through.send((8.0, 0.0), (16.0, 1.0), (24.0, 0.0), (34.0, 0.0))
    assert outcome_of(handle) == (SUCCEEDED, 0)
    told = [(each.pose.pose.position.x, each.twist.twist.linear.x) for each in odometry.messages]
    speeds = [speed for x, speed in told if 6.0 < x < 26.0]
    counts = [told.number_of_poses_remaining for told in through.feedback.messages]
    assert sorted(set(counts), reverse=True) == [4, 3, 2, 1]
    assert min(speeds) > CRUISE / 2


@pytest.mark.parametrize(
    ("text", "places", "code"),
    [
        (
            '{"kind": "unreachable", "circles": [{"x": 4, "y": 0, "radius": 1}]}',
            ((4.0, 0.0), (8.0, 0.0)),
            308,
        ),
        ('{"kind": "stuck", "active": false}', (), 309),
    ],
)
def test_missing_route_contains_the_reason(
    text: str, places: tuple[tuple[float, float], ...], code: int, fault: Fault, through: Client
) -> None:
    fault(text)
    assert outcome_of(through.send(*places)) == (ABORTED, code)


def test_one_action_alone_drives(client: Client, through: Client) -> None:
    driven = client.send((35.0, 0.0))
    client.feedback.wait_for(lambda told: told.current_pose.pose.position.x > 0.5)
    assert outcome_of(through.send((3.0, 0.0))) == (ABORTED, 0)
    answer_of(driven.cancel_goal_async())
    assert outcome_of(driven) == (CANCELED, 0)
    assert outcome_of(through.send((3.0, 0.0))) == (SUCCEEDED, 0)


def test_cancelling_goals_of_one_action_leaves_the_other(through: Client, peer: RosPeer) -> None:
    handle = through.send((8.0, 0.0))
    canceller = peer.client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
    assert not peer.call(canceller, CancelGoal.Request()).goals_canceling
    assert outcome_of(handle) == (SUCCEEDED, 0)


@pytest.mark.usefixtures("fault")
@pytest.mark.parametrize("action", ["NavigateToPose", "FollowWaypoints", "ComputePathToPose"])
def test_unknown_goal_has_an_unknown_result(action: str, peer: RosPeer) -> None:
    found = interface(f"nav2_msgs/action/{action}")
    if found is None:
        pytest.skip(f"nav2_msgs without {action}")
    kind, name = found.Impl.GetResultService, re.sub(r"(?<!^)(?=[A-Z])", "_", action).lower()
    asker = peer.client(kind, f"{name}/_action/get_result")
    assert peer.call(asker, kind.Request()).status == 0


def test_action_servers_disappear_and_return(fault: Fault, client: Client) -> None:
    fault('{"kind": "unconfigured"}')
    wait_until(lambda: not client.ros.server_is_ready(), what="the server's leave")
    fault('{"kind": "unconfigured", "active": false}')
    wait_until(client.ros.server_is_ready, what="the server")
    wait_until(lambda: client.send((1.0, 0.0)).accepted, what="an accepted goal")


def test_robot_works_without_actions(domain_id: int, peer: RosPeer) -> None:
    with simulated_robot(domain_id, actions=False):
        peer.client(CancelGoal, "navigate_to_pose/_action/cancel_goal")
        names = [name for name, _ in peer.node.get_service_names_and_types()]
    assert "/navigate_to_pose/_action/send_goal" not in names
    assert "/navigate_through_poses/_action/cancel_goal" not in names
