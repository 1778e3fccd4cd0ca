"""Processes of Nav2 that die, hang and are deactivated one by one."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any
from uuid import UUID

import pytest

from nena_robot_simulator import faults
from nena_robot_simulator.goals import Action
from nena_robot_simulator.motion import Pose
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.robot import Feedback
from nena_robot_simulator.servers import (
    BOND_TIMEOUT,
    CLEANING,
    MANAGED,
    RESPAWN_CHECK,
    RESPAWN_WAIT,
    Command,
    LifecycleState,
    Server,
    Servers,
    Transition,
)
from support.timed_robot import A, B, Bench

BRING_UP = BOND_TIMEOUT + RESPAWN_CHECK + 0.5
"""Seconds after which a server that has died and come back works again."""
AWAY = 0.5
"""Seconds for which a server is away that comes back at once."""
WALLED_IN = faults.Unreachable(error_code=208)


def driving(goal_id: UUID = A, **settings: Any) -> Bench:
    bench = Bench(**settings)
    bench.take(goal_id, 15.0, 0.0)
    bench.run(3.0)
    return bench


def die_and_come_back(bench: Bench, server: Server) -> None:
    bench.apply(faults.ServerDied(server=server))
    bench.run(AWAY)
    bench.apply(faults.ServerDied(server=server, active=False))


def ended(bench: Bench, goal_id: UUID = A) -> tuple[int, int]:
    """Return status and error code of a goal."""
    entry = bench.robot.goals(Action.TO_POSE).find(goal_id, bench.now)
    assert entry is not None
    return int(entry.status), entry.error_code


def stands(bench: Bench) -> Callable[[], bool]:
    return lambda: bench.robot.velocity == (0.0, 0.0)


def at_least(bench: Bench, x: float) -> bool:
    return bench.robot.pose.x >= x


def feedback(bench: Bench) -> Feedback:
    found = bench.robot.feedback(Action.TO_POSE, bench.now)
    assert found is not None
    return found


@pytest.mark.parametrize("fault", [faults.ServerDied, faults.ServerHung])
def test_without_a_controller_the_base_stops_after_its_own_timeout(
    fault: type[faults.ServerDied | faults.ServerHung],
) -> None:
    bench = driving()
    bench.apply(fault(server=Server.CONTROLLER))
    bench.run(0.6)
    assert bench.robot.velocity[0] == pytest.approx(1.0), "its last command still counts"
    assert bench.run(5.0, stands(bench)) < 1.3
    assert bench.until_ended(seconds=BOND_TIMEOUT) == 6, "the lifecycle manager has deactivated Nav2"


@pytest.mark.parametrize("server", [Server.CONTROLLER, Server.PLANNER])
@pytest.mark.parametrize("fault", [faults.ServerDied, faults.ServerHung])
def test_a_server_without_an_answer_at_the_replanning_ends_the_drive_without_a_code(
    server: Server, fault: type[faults.ServerDied | faults.ServerHung]
) -> None:
    bench = driving(replan_period=1.0, recovery_time=18.0, server_timeout=0.2)
    bench.apply(fault(server=server))
    assert 0.2 <= bench.run(5.0, lambda: ended(bench)[0] == 6) <= 1.25, "no recoveries"
    assert ended(bench) == (6, 0)


@pytest.mark.parametrize("fault", [faults.ServerDied, faults.ServerHung])
def test_a_base_without_a_command_timeout_drives_on_after_its_goal_has_failed(
    fault: type[faults.ServerDied | faults.ServerHung],
) -> None:
    bench = driving(drive={"command_timeout": 0.0})
    bench.apply(fault(server=Server.CONTROLLER))
    assert bench.until_ended() == 6
    x = bench.robot.pose.x
    bench.run(10.0)
    assert bench.robot.pose.x == pytest.approx(x + 10.0, abs=0.1)


def test_a_restarted_controller_does_not_stop_a_base_that_drives_on_before_its_next_goal() -> None:
    bench = driving(drive={"command_timeout": 0.0})
    die_and_come_back(bench, Server.CONTROLLER)
    bench.run(BRING_UP)
    assert bench.robot.servers.works(Server.CONTROLLER)
    assert bench.robot.velocity[0] == pytest.approx(1.0)
    bench.take(B, bench.robot.pose.x + 2.0, 0.0)
    assert bench.until_ended(B) == 4
    assert bench.run(5.0, stands(bench)) < 1.5


@pytest.mark.parametrize("command", [Command.PAUSE, Command.RESET, Command.SHUTDOWN])
def test_a_controller_that_is_deactivated_stops_a_base_without_a_command_timeout(command: Command) -> None:
    bench = driving(drive={"command_timeout": 0.0})
    bench.robot.manage(Server.MANAGER, command, bench.now)
    assert bench.run(5.0, stands(bench)) < 1.3


def test_a_goal_is_reached_at_full_speed_and_a_heavy_robot_rolls_past_it() -> None:
    bench = Bench(drive={"acceleration": 2.5, "deceleration": 0.4})
    bench.take(A, 5.0, 0.0)
    assert bench.until_ended() == 4
    assert bench.robot.velocity[0] == pytest.approx(1.0)
    assert bench.robot.pose.x < 5.0
    assert 2.0 < bench.run(5.0, stands(bench)) < 3.0
    assert bench.robot.pose.x > 5.5


def test_without_a_planner_the_drive_ends_at_the_next_replanning() -> None:
    bench = driving(replan_period=1.0)
    bench.apply(faults.ServerDied(server=Server.PLANNER))
    assert bench.until_ended(seconds=1.1) == 6
    assert ended(bench) == (6, 0)


def test_without_a_localisation_the_controller_gives_up_after_a_second() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.LOCALISATION))
    assert 0.9 < bench.run(5.0, lambda: ended(bench)[0] == 6) < 1.1
    assert ended(bench) == (6, 102)


def test_a_localisation_that_comes_back_knows_no_pose() -> None:
    bench = Bench()
    assert bench.robot.scan() is not None
    die_and_come_back(bench, Server.LOCALISATION)
    bench.run(BRING_UP)
    bench.robot.force_estimate()
    assert bench.robot.scan() is None
    bench.take(A, 3.0, 0.0)
    bench.run(0.1)
    assert ended(bench)[0] == 6
    bench.robot.take_initial_pose(Pose(0, 0, 0))
    assert bench.robot.scan() is not None


@pytest.mark.parametrize("server", [Server.NAVIGATOR, Server.CONTROLLER, Server.PLANNER, Server.BEHAVIOURS])
def test_a_server_that_comes_back_is_unconfigured_until_its_manager_brings_it_up(server: Server) -> None:
    bench = Bench()
    servers = bench.robot.servers
    die_and_come_back(bench, server)
    assert servers.state(server) is LifecycleState.UNCONFIGURED
    assert not servers.works(server)
    bench.run(BOND_TIMEOUT - AWAY - 0.1)
    assert servers.state(server) is LifecycleState.UNCONFIGURED
    assert servers.group_active(Server.MANAGER), "its bond has not broken yet"
    bench.run(0.2)
    group = MANAGED[Server.MANAGER]
    assert not servers.group_active(Server.MANAGER)
    assert not any(map(servers.works, group)), "it deactivates all"
    bench.run(CLEANING)
    assert {servers.state(each) for each in group} == {LifecycleState.UNCONFIGURED}, "and cleans them up"
    bench.run(RESPAWN_CHECK)
    assert all(map(servers.works, group))
    assert servers.group_active(Server.MANAGER)
    assert bench.take(B, 3.0, 0.0)
    assert bench.until_ended(B) == 4


def test_a_controller_that_comes_back_does_not_drive_on() -> None:
    bench = driving()
    die_and_come_back(bench, Server.CONTROLLER)
    assert bench.run(3.0, stands(bench)) < 2.0
    x = bench.robot.pose.x
    assert bench.until_ended(seconds=BOND_TIMEOUT) == 6, "the lifecycle manager resets Nav2"
    bench.run(BRING_UP)
    assert bench.robot.pose.x == x


def test_a_path_without_its_navigator_ends_when_the_controller_is_deactivated() -> None:
    bench = Bench()
    bench.take(A, 25.0, 0.0)
    bench.run(3.0)
    die_and_come_back(bench, Server.NAVIGATOR)
    bench.run(BOND_TIMEOUT - AWAY - 0.1)
    assert bench.robot.velocity[0] == pytest.approx(1.0), "the controller still has its path"
    bench.run(2.0, stands(bench))
    assert bench.robot.pose.x < 10.0


def kill(bench: Bench, server: Server) -> None:
    bench.apply(faults.ServerDied(server=server, lease=20.0))


def revive(bench: Bench, server: Server) -> None:
    bench.apply(faults.ServerDied(server=server, active=False))


def test_a_killed_server_stays_listed_for_its_lease() -> None:
    bench = driving()
    kill(bench, Server.NAVIGATOR)
    servers = bench.robot.servers
    bench.run(19.0)
    assert servers.listed(Server.NAVIGATOR)
    assert not servers.runs(Server.NAVIGATOR)
    bench.run(1.1)
    assert not servers.listed(Server.NAVIGATOR)


def test_a_killed_server_that_is_back_within_the_bond_time_is_brought_up() -> None:
    bench = Bench()
    kill(bench, Server.NAVIGATOR)
    bench.run(BOND_TIMEOUT - 0.5)
    revive(bench, Server.NAVIGATOR)
    bench.run(BRING_UP)
    assert bench.robot.servers.group_active(Server.MANAGER)


@pytest.mark.parametrize("server", [Server.NAVIGATOR, Server.CONTROLLER, Server.PLANNER, Server.BEHAVIOURS])
def test_a_killed_server_that_is_back_later_needs_its_lifecycle_manager_restarted(server: Server) -> None:
    bench = Bench()
    servers = bench.robot.servers
    kill(bench, server)
    bench.run(BOND_TIMEOUT + 0.5)
    revive(bench, server)
    bench.run(30.0)
    assert servers.state(server) is LifecycleState.UNCONFIGURED
    assert not servers.runs(Server.MANAGER), "it waits for the old process"
    kill(bench, Server.MANAGER)
    revive(bench, Server.MANAGER)
    bench.run(BRING_UP)
    assert servers.group_active(Server.MANAGER)


def test_servers_that_hang_for_ten_seconds_are_brought_up_again_without_the_goal() -> None:
    bench = driving()
    for server in MANAGED[Server.MANAGER]:
        bench.apply(faults.ServerHung(server=server))
    bench.run(10.0)
    for server in MANAGED[Server.MANAGER]:
        bench.apply(faults.ServerHung(server=server, active=False))
    bench.run(16.0)
    assert bench.robot.servers.group_active(Server.MANAGER)
    assert bench.robot.goals(Action.TO_POSE).find(A, bench.now) is None
    assert bench.run(5.0, stands(bench)) < 0.1


def test_nav2_that_is_stopped_and_started_needs_a_pose_and_a_goal() -> None:
    bench = driving()
    bench.robot.manage(Server.MANAGER, Command.SHUTDOWN, bench.now)
    bench.apply(faults.Nav2Stopped())
    assert bench.run(5.0, stands(bench)) < 1.3
    bench.apply(faults.Nav2Stopped(active=False))
    bench.run(BRING_UP)
    assert bench.robot.servers.group_active(Server.MANAGER)
    assert bench.robot.servers.group_active(Server.LOCALISATION_MANAGER)
    assert bench.robot.scan() is None
    bench.robot.take_initial_pose(Pose(0, 0, 0))
    bench.take(B, 3.0, 0.0)
    assert bench.until_ended(B) == 4


def pose_after(bench: Bench, outage: float) -> None:
    """Give a localisation that was away a pose."""
    bench.apply(faults.ServerDied(server=Server.LOCALISATION))
    bench.run(0.1)
    revive(bench, Server.LOCALISATION)
    bench.run(outage)
    bench.robot.take_initial_pose(Pose(0, 0, 0))
    bench.run(0.05)


@pytest.mark.parametrize(
    ("outage", "wait", "end"), [(11, 0.5, (6, 102)), (11, 1.1, (4, 0)), (8, 0.0, (4, 0))]
)
def test_the_first_second_after_a_pose_is_too_early_if_nav2_has_no_older_transform(
    outage: float, wait: float, end: tuple[int, int]
) -> None:
    bench = Bench()
    pose_after(bench, outage)
    bench.run(wait)
    bench.take(A, 3.0, 0.0)
    bench.until_ended()
    assert ended(bench) == end


def test_the_first_pose_of_all_is_too_early_as_well_if_nav2_has_waited_for_it() -> None:
    bench = Bench(localisation={"known_at_start": False})
    bench.run(11.0)
    bench.robot.take_initial_pose(Pose(0, 0, 0))
    bench.take(A, 3.0, 0.0)
    bench.until_ended()
    assert ended(bench) == (6, 102)


def test_a_pose_for_an_inactive_localisation_counts_from_its_activation() -> None:
    bench = Bench(localisation={"known_at_start": False})
    bench.robot.servers.change(Server.LOCALISATION, Transition.DEACTIVATE)
    bench.robot.set_navigators()
    bench.robot.take_initial_pose(Pose(2, 1, 0))
    bench.run(1.0)
    assert bench.robot.scan() is None
    bench.robot.servers.change(Server.LOCALISATION, Transition.ACTIVATE)
    bench.run(0.1)
    assert bench.robot.scan() is not None


def test_a_goal_that_is_cancelled_in_a_recovery_has_the_code_of_the_failed_plan() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    bench.run(3.0)
    bench.robot.cancel(A, 0, bench.now)
    assert bench.until_ended() == 5
    assert ended(bench) == (5, 208)


@pytest.mark.parametrize("fault", [None, faults.AbortHalfway(fraction=0.9)])
def test_a_goal_that_is_cancelled_on_its_way_has_no_code(fault: faults.AbortHalfway | None) -> None:
    bench = Bench()
    if fault is not None:
        bench.apply(fault)
    bench.take(A, 15.0, 0.0)
    bench.run(3.0)
    bench.robot.cancel(A, 0, bench.now)
    bench.until_ended()
    assert ended(bench) == (5, 0)


def test_a_restarted_controller_has_no_speed_limit() -> None:
    bench = Bench()
    bench.robot.limit_speed(0.3, percentage=False)
    die_and_come_back(bench, Server.CONTROLLER)
    bench.run(BRING_UP)
    bench.take(A, 10.0, 0.0)
    bench.run(3.0)
    assert bench.robot.velocity[0] == pytest.approx(1.0)


def test_a_server_that_is_back_after_the_reset_is_brought_up_too() -> None:
    bench = Bench()
    servers = bench.robot.servers
    bench.apply(faults.ServerDied(server=Server.PLANNER))
    bench.run(BOND_TIMEOUT + 3.0)
    states = [servers.state(each) for each in MANAGED[Server.MANAGER]]
    assert states == [
        LifecycleState.ACTIVE,  # in reverse order the reset stops at the planner, which does not answer
        LifecycleState.UNCONFIGURED,
        LifecycleState.INACTIVE,
        LifecycleState.INACTIVE,
    ]
    bench.apply(faults.ServerDied(server=Server.PLANNER, active=False))
    bench.run(2 * RESPAWN_CHECK + CLEANING + 0.1)
    assert servers.group_active(Server.MANAGER)


def test_a_lifecycle_manager_waits_ten_seconds_for_a_server() -> None:
    bench = Bench()
    bench.apply(faults.ServerDied(server=Server.PLANNER))
    bench.run(BOND_TIMEOUT + RESPAWN_WAIT + RESPAWN_CHECK)
    bench.apply(faults.ServerDied(server=Server.PLANNER, active=False))
    bench.run(5.0)
    assert not bench.robot.servers.group_active(Server.MANAGER)
    assert not bench.take(A, 3.0, 0.0)


def test_a_lifecycle_manager_that_comes_back_misses_what_has_died_meanwhile() -> None:
    bench = Bench()
    bench.apply(faults.ServerDied(server=Server.MANAGER))
    die_and_come_back(bench, Server.BEHAVIOURS)
    bench.run(2 * BRING_UP)
    assert not bench.robot.servers.works(Server.BEHAVIOURS)
    bench.apply(faults.ServerDied(server=Server.MANAGER, active=False))
    bench.run(BRING_UP)
    assert bench.robot.servers.works(Server.BEHAVIOURS)


def test_behaviours_that_die_end_the_drive_by_the_bond_alone() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.BEHAVIOURS))
    bench.run(BOND_TIMEOUT - 0.2)
    assert ended(bench)[0] == 2
    assert bench.until_ended(seconds=0.5) == 6


def test_a_lifecycle_manager_that_dies_ends_nothing() -> None:
    bench = driving()
    bench.apply(faults.ServerDied(server=Server.MANAGER))
    bench.apply(faults.ServerDied(server=Server.BEHAVIOURS))
    assert bench.until_ended() == 4


def test_a_robot_without_a_way_spins_waits_and_backs_up_before_208() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    turned = bench.run(5.0, lambda: bench.robot.velocity[1] > 0.5)
    backed = bench.run(20.0, lambda: bench.robot.velocity[0] < -0.1)
    assert turned + backed < 10.0
    assert feedback(bench).left == 0.0
    assert feedback(bench).recoveries >= 4
    assert bench.until_ended() == 6
    assert ended(bench) == (6, 208)
    assert 17.0 <= bench.now - 100.0 <= 21.0


def test_recoveries_count_to_a_dozen() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    bench.run(17.9)
    assert 12 <= feedback(bench).recoveries <= 15


def test_a_recovery_can_be_cancelled_at_the_behaviours() -> None:
    bench = Bench(recovery_time=18.0)
    bench.apply(WALLED_IN)
    bench.take(A, 5.0, 0.0)
    bench.run(1.0)
    assert not bench.robot.cancel_controller()
    assert bench.robot.cancel_recovery()
    assert bench.run(3.0, stands(bench)) < 1.0


def test_a_goal_is_approached_as_regulated_pure_pursuit_does() -> None:
    bench = Bench(drive={"speed": 0.5, "approach": 0.6})
    bench.take(A, 6.0, 0.0)
    speeds = []
    for place in (5.0, 5.5, 5.7):
        bench.run(60.0, partial(at_least, bench, place))
        speeds.append(bench.robot.velocity[0])
    assert speeds == pytest.approx([0.5, 0.41, 0.25], abs=0.03)


def test_a_new_goal_is_known_to_the_feedback_at_the_next_replanning() -> None:
    bench = Bench(replan_period=1.0)
    bench.take(A, 15.0, 0.0)
    bench.run(0.01)
    assert feedback(bench).left == 0.0, "no path yet"
    bench.run(3.0)
    bench.take(B, 25.0, 0.0)
    bench.run(5.0, lambda: feedback(bench).goal_id == B)
    assert 10.0 < feedback(bench).left < 13.0, "still the old path, from its first feedback on"
    bench.run(1.0)
    assert feedback(bench).left > 20.0


def test_lifecycle_transitions_follow_their_states() -> None:
    servers = Servers()
    assert not servers.change(Server.PLANNER, Transition.ACTIVATE)
    assert servers.change(Server.PLANNER, Transition.DEACTIVATE)
    assert not servers.group_active(Server.MANAGER)
    assert servers.change(Server.PLANNER, Transition.CLEANUP)
    assert servers.state(Server.PLANNER) is LifecycleState.UNCONFIGURED
    assert not servers.change(Server.PLANNER, 99)


def test_a_client_can_stop_and_start_all_servers() -> None:
    bench = driving()
    robot, manager = bench.robot, Server.MANAGER
    assert not robot.manage(manager, Command.STARTUP, bench.now), "they are active, and refuse"
    assert not robot.servers.group_active(manager)
    assert robot.manage(manager, Command.PAUSE, bench.now)
    assert ended(bench) == (6, 0)
    assert not bench.take(B, 20.0, 0.0)
    bench.run(BRING_UP)
    assert robot.velocity == (0.0, 0.0)
    assert robot.manage(manager, Command.RESUME, bench.now)
    assert robot.servers.group_active(manager)
    assert robot.manage(manager, Command.RESET, bench.now)
    assert not robot.servers.configured(Server.NAVIGATOR)
    assert robot.manage(manager, Command.STARTUP, bench.now)
    assert bench.take(B, 20.0, 0.0)
    assert bench.until_ended(B) == 4
    assert robot.manage(manager, Command.SHUTDOWN, bench.now)
    assert {robot.servers.state(each) for each in MANAGED[manager]} == {LifecycleState.FINALIZED}
    assert not robot.manage(manager, Command.STARTUP, bench.now), "its processes have to be started again"
    assert not robot.manage(manager, 99, bench.now)


def test_the_feedback_of_a_new_goal_through_poses_counts_them_at_once() -> None:
    """As recorded: 41c2b2ab took over with two poses left, of a goal that had one."""
    bench = Bench(replan_period=1.0)

    def left() -> int:
        found = bench.robot.feedback(Action.THROUGH_POSES, bench.now)
        assert found is not None
        return found.places_left

    def through(goal_id: UUID, *places: float) -> None:
        way = [Pose(x, 0.0, 0.0) for x in places]
        goal = Goal(goal_id, way[-1], "map", tuple(way[:-1]))
        assert bench.robot.take_goal(goal, 1, bench.now, Action.THROUGH_POSES)

    through(A, 5.0)
    bench.run(1.0)
    assert left() == 1
    through(B, 5.0, 10.0)
    bench.run(0.03)
    assert left() == 2
    bench.run(5.0, lambda: bench.robot.pose.x > 4.4)
    assert left() == 2, "a pose that was passed counts until the next replanning"
    bench.run(3.1)
    assert left() == 1
