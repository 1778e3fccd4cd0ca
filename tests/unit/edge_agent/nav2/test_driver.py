from __future__ import annotations

import asyncio
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import replace
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriveLimits,
    DriveProgress,
    DriverEvent,
    NavigationReport,
    OwnGoals,
    Pose,
    PoseReport,
    SessionReport,
    SessionState,
    VelocityReport,
)
from nena_edge_agent.nav2 import action_client, goal_tracker, presence
from nena_edge_agent.nav2 import driver as driver_module
from nena_edge_agent.nav2.commands import Server
from nena_edge_agent.nav2.driver import Nav2Driver
from nena_edge_agent.nav2.goals import FeedbackReading, GoalEntry
from nena_edge_agent.nav2.map_server import MapServer, MapUser
from nena_edge_agent.nav2.parameters import Nav2Parameters
from nena_edge_agent.nav2.poses import PoseReading
from nena_edge_agent.nav2.presence import Lifecycle, Presence
from nena_edge_agent.nav2.settings import Navigation, RosAddress, RosSettings
from nena_edge_agent.nav2.speed_limit import SpeedLimiter
from nena_shared.clock import SystemClock
from nena_shared.ros import GoalStatus
from nena_shared.tasks import StartError
from support.clocks import ManualClock
from support.pausing import pass_time, turn_passes
from support.waiting import until

READING = PoseReading(1.0, 2.0, 0.5, "map", 1, 0.01, 0.01, 0.01)


async def test_a_machine_without_ros_gets_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", None)
    told: list[DriverEvent] = []
    driver = Nav2Driver(RosSettings(), "hall", told.append, ManualClock())
    with pytest.raises(StartError, match="source the robot's ROS installation"):
        await driver.start()
    await driver.stop()
    assert told == []


@pytest.mark.ros
async def test_without_the_types_of_the_action_it_is_not_available(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(action_client, "action_type", lambda _navigation: None)
    driver = Nav2Driver(RosSettings(navigation=Navigation.ACTION), "hall", lambda _: None, ManualClock())
    with pytest.raises(StartError, match=r"ros\.navigation = topics"):
        await driver.start()


@asynccontextmanager
async def started(
    monkeypatch: pytest.MonkeyPatch, told: list[DriverEvent], **parts: Any
) -> AsyncIterator[Nav2Driver]:
    """Run a driver outside of the ROS graph."""
    monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", ModuleType("node"))
    driver = Nav2Driver(RosSettings(start_session=False), "hall", told.append, ManualClock(), **parts)
    await driver.start()
    try:
        yield driver
    finally:
        await driver.stop()


def goal(generation: int) -> DriveGoal:
    return DriveGoal(generation, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None, maximum_speed=0.4)


@pytest.mark.parametrize("generation", [-1, 1])
async def test_a_goal_with_a_limit_fails_without_a_controller_for_it(
    monkeypatch: pytest.MonkeyPatch, generation: int
) -> None:
    told: list[DriverEvent] = []
    async with started(monkeypatch, told, limiter=SpeedLimiter("speed_limit", 1.0)) as driver:
        driver.go_to(goal(generation))
        await turn_passes()
    failed = [each for each in told if isinstance(each, DriveFailed)]
    reasons = [each.reason for each in told if isinstance(each, NavigationReport)]
    if generation < 0:
        assert [each.failure for each in failed] == [DriveFailure.NOT_TAKEN_UP]
    else:
        assert not failed
        assert any("no node subscribes to speed_limit" in each for each in reasons)


async def test_a_pose_on_the_previous_map_is_not_used_after_a_restart(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    mark = tmp_path / "unplaced"
    mark.touch()
    told: list[DriverEvent] = []

    def server(user: MapUser) -> MapServer:
        return MapServer(RosSettings(), "attic", mark=mark, user=user)

    async with started(monkeypatch, told, make_map_server=server) as driver:
        driver._on_pose(READING)
        await turn_passes()
    poses = [each for each in told if isinstance(each, PoseReport)]
    assert [each.localized for each in poses] == [False]
    assert "the position on it is not set" in poses[0].problem
    assert mark.exists()


class Station:
    """A map_server that answers on request, and a robot that notes its goals."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, *enabled: str) -> None:
        self.let_answer = asyncio.Event()
        self.asked: list[str] = []
        self.goals: list[Pose] = []
        self.stopped = 0
        self.clients = {Server.NAVIGATOR: self}
        self.is_ready = False
        monkeypatch.setattr(MapServer, "_load_in_turn", self._load)
        self._enabled = enabled or ("hall",)
        self.server = MapServer(RosSettings(), *self._enabled)

    def map_server(self, user: MapUser) -> MapServer:
        self.server = MapServer(RosSettings(), *self._enabled, user=user)
        return self.server

    async def presence(self) -> None:
        """Answer never: the tests say what a check finds."""
        await asyncio.Event().wait()

    async def cancel_goal(self, _: str) -> int:
        return 0

    def request_result(self, goal_id: str) -> None:
        """Send no results."""

    async def request_pose(self) -> bool:
        return True

    async def stop_motion(self) -> bool:
        self.stopped += 1
        return True

    def prepare_stop(self) -> None:
        """Find no servers: there are none."""

    def planners(self) -> frozenset[str]:
        """Find no planner, as on a robot that plans elsewhere."""
        return frozenset()

    async def _load(self, file: str) -> None:
        self.asked.append(file)
        await self.let_answer.wait()

    def publish_goal(self, pose: Pose) -> None:
        self.goals.append(pose)


def available(driver: Nav2Driver) -> None:
    """Let a check find Nav2."""
    driver._on_navigation(
        frozenset({"navigator"}), driver._with_map(NavigationReport(available=True, reason=""))
    )


async def test_an_order_that_starts_while_a_map_is_enabled_does_not_drive_on_the_previous_map(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station, told = Station(monkeypatch), list[DriverEvent]()
    async with started(monkeypatch, told, make_map_server=station.map_server) as driver:
        monkeypatch.setattr(driver, "_node", station)
        driver._on_statuses(Server.NAVIGATOR, [])
        available(driver)
        enabling = asyncio.create_task(station.server.use("attic", "attic.yaml"))
        await turn_passes()
        driver.go_to(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        available(driver)
        station.let_answer.set()
        await enabling
        available(driver)
        await turn_passes()
        assert station.goals == []
        monkeypatch.setattr(driver, "_node", None)
    reports = [each for each in told if isinstance(each, NavigationReport)]
    assert [each.available for each in reports] == [False, True, False, True], "the core gives its goal again"
    assert reports[2].reason == "map_server loads the map 'attic'"


async def test_a_check_running_while_a_map_is_enabled_does_not_make_navigation_available(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Enable a map between the check of Nav2 and its evaluation, while Nav2's parameters are read."""
    station, told = Station(monkeypatch), list[DriverEvent]()
    async with started(monkeypatch, told, make_map_server=station.map_server) as driver:
        enabling: list[asyncio.Task[None]] = []

        async def seen() -> Presence:
            return Presence(frozenset({"navigator"}), 1, Lifecycle.ABSENT)

        async def enable(_: NavigationReport) -> None:
            if not enabling:
                enabling.append(asyncio.create_task(station.server.use("attic", "attic.yaml")))
                await turn_passes()

        monkeypatch.setattr(driver, "_read_limits", enable)
        monkeypatch.setattr(
            presence, "judge_navigation", lambda *_, **__: NavigationReport(available=True, reason="")
        )
        monkeypatch.setattr(station, "presence", seen, raising=False)
        monkeypatch.setattr(driver, "_node", station)
        monkeypatch.setattr(driver, "_settings", RosSettings(watch_period=0.05))
        driver._on_statuses(Server.NAVIGATOR, [])
        driver.go_to(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        await driver._watch_nav2()
        assert (station.goals, station.asked) == ([], ["attic.yaml"])
        monkeypatch.setattr(driver, "_node", None)
        station.let_answer.set()
        await enabling[0]
    assert [each.available for each in told if isinstance(each, NavigationReport)][-1:] == [False]


async def test_a_restarted_map_server_gets_the_map_that_was_enabled_meanwhile(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station = Station(monkeypatch, "attic", "attic.yaml")
    enabling = asyncio.create_task(station.server.use("cellar", "cellar.yaml"))
    await turn_passes()
    again = asyncio.create_task(station.server.load_again())
    await turn_passes()
    station.let_answer.set()
    await enabling
    await again
    assert station.asked == ["cellar.yaml"]
    assert (station.server.map_id, station.server.problem) == ("cellar", "")


async def test_a_plugins_drive_that_waits_while_another_map_is_enabled_is_answered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station, told = Station(monkeypatch), list[DriverEvent]()
    station.let_answer.set()
    async with started(monkeypatch, told, make_map_server=station.map_server) as driver:
        driver.go_to(DriveGoal(-1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        await station.server.use("attic", "attic.yaml")
        await turn_passes()
    (failed,) = (each for each in told if isinstance(each, DriveFailed))
    assert (failed.generation, failed.failure) == (-1, DriveFailure.NOT_TAKEN_UP)


async def test_a_restarted_map_server_gets_its_map_without_delaying_the_check(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station = Station(monkeypatch, "attic", "attic.yaml")
    async with started(monkeypatch, [], make_map_server=station.map_server) as driver:
        server = station.server
        monkeypatch.setattr(server, "_session", object())
        monkeypatch.setattr(server, "_node", SimpleNamespace(get_publishers_info_by_topic=lambda _: []))
        monkeypatch.setattr(server, "_load", SimpleNamespace(service_is_ready=lambda: True), raising=False)
        reasons = []
        for _ in range(3):
            reasons.append(driver._with_map(NavigationReport(available=True, reason="")).reason)
            await turn_passes()
        assert all("attic" in each for each in reasons), "it has not answered yet"
        assert station.asked == ["attic.yaml"]
        station.let_answer.set()
        await until(lambda: not server.problem, what="the map")
        assert driver._with_map(NavigationReport(available=True, reason="")).available


async def test_a_silent_navigator_is_detected_between_two_checks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(driver_module, "FEEDBACK_TIMEOUT", 0.05)
    monkeypatch.setattr(goal_tracker, "GIVEN_UP_AFTER", 0.05)
    station, told = Station(monkeypatch), list[DriverEvent]()
    async with started(monkeypatch, told) as driver:
        monkeypatch.setattr(driver, "_node", station)
        monkeypatch.setattr(driver, "_clock", SystemClock())
        driver._on_statuses(Server.NAVIGATOR, [])
        available(driver)
        driver.go_to(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        driver._on_statuses(Server.NAVIGATOR, [GoalEntry("a" * 32, GoalStatus.EXECUTING)])
        driver._on_feedback(FeedbackReading("a" * 32, 0.0, 0.0, 0.0, "map", 1.0, 0))
        await until(lambda: any(isinstance(each, DriveFailed) for each in told), what="the silence")
        monkeypatch.setattr(driver, "_node", None)
    (failed,) = (each for each in told if isinstance(each, DriveFailed))
    assert failed.failure is DriveFailure.NAVIGATION_GONE


async def test_a_hanging_navigator_is_stopped_by_odometry_before_the_drive_fails(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told: list[DriverEvent] = []
    async with on_the_way(monkeypatch, told) as (driver, station, clock):
        stopped_at = 0.0
        for tick in range(1, 16):
            clock.advance(0.05)
            driver._on_velocity((0.5, 0.0))
            await turn_passes()
            if station.stopped and not stopped_at:
                stopped_at = 0.05 * tick
        assert stopped_at == pytest.approx(0.5, abs=0.06)
        assert not any(isinstance(each, DriveFailed) for each in told), "it may only be busy"
        for _ in range(10):
            clock.advance(0.05)
            driver._on_velocity((0.5, 0.0))
        await turn_passes()
    (failed,) = (each for each in told if isinstance(each, DriveFailed))
    assert failed.failure is DriveFailure.NAVIGATION_GONE


async def odometry_comes(driver: Nav2Driver, clock: ManualClock, messages: int) -> None:
    """Report the robot's motion so many times, every 0.05 s, without feedback."""
    for _ in range(messages):
        clock.advance(0.05)
        driver._on_velocity((0.5, 0.0))
        await turn_passes()


@asynccontextmanager
async def on_the_way(
    monkeypatch: pytest.MonkeyPatch, told: list[DriverEvent]
) -> AsyncIterator[tuple[Nav2Driver, Station, ManualClock]]:
    """Yield a driver whose robot drives to goal a, of which feedback has arrived."""
    station, clock = Station(monkeypatch), ManualClock()
    async with started(monkeypatch, told) as driver:
        monkeypatch.setattr(driver, "_node", station)
        monkeypatch.setattr(driver, "_clock", clock)
        driver._on_statuses(Server.NAVIGATOR, [])
        available(driver)
        driver.go_to(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        driver._on_statuses(Server.NAVIGATOR, [GoalEntry("a" * 32, GoalStatus.EXECUTING)])
        driver._on_feedback(FEEDBACK)
        yield driver, station, clock
        monkeypatch.setattr(driver, "_node", None)


FEEDBACK = FeedbackReading("a" * 32, 0.0, 0.0, 0.0, "map", 1.0, 0)


async def test_a_goal_without_feedback_after_one_with_it_is_not_stopped(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()
    async with on_the_way(monkeypatch, told) as (driver, station, clock):
        driver._on_velocity((0.5, 0.0))
        ended = GoalEntry("a" * 32, GoalStatus.SUCCEEDED)
        driver._on_statuses(Server.NAVIGATOR, [ended])
        driver.go_to(DriveGoal(2, Pose(2.0, 0.0, 0.0, "hall"), 0.3, None))
        driver._on_statuses(Server.NAVIGATOR, [ended, GoalEntry("b" * 32, GoalStatus.EXECUTING)])
        await odometry_comes(driver, clock, 60)
        assert station.stopped == 0
    assert not any(isinstance(each, DriveFailed) for each in told)


async def test_feedback_of_the_previous_goal_is_a_sign_of_life_until_the_next_is_accepted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()
    async with on_the_way(monkeypatch, told) as (driver, station, clock):
        driver.go_to(DriveGoal(2, Pose(2.0, 0.0, 0.0, "hall"), 0.3, None))
        await turn_passes()
        told.clear()
        for _ in range(20):
            clock.advance(0.05)
            driver._on_velocity((0.5, 0.0))
            driver._on_feedback(replace(FEEDBACK, left=0.5))
            await turn_passes()
        assert station.stopped == 0
        assert not any(isinstance(each, DriveProgress) for each in told), "it is not of the current goal"
        await odometry_comes(driver, clock, 12)
        assert station.stopped == 1, "the navigator that drives is silent"


async def test_a_pause_of_the_network_fails_no_drive_of_a_robot_with_odometry(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(driver_module, "FEEDBACK_TIMEOUT", 0.05)
    told = list[DriverEvent]()
    async with on_the_way(monkeypatch, told) as (driver, station, clock):
        driver._on_velocity((0.5, 0.0))
        clock.advance(2.1)
        await until(lambda: driver._listening is None, what="the end of the wait for feedback")
        assert station.stopped == 0
        driver._on_velocity((0.5, 0.0))
        driver._on_feedback(FEEDBACK)
        await turn_passes()
        assert station.stopped == 0
    assert not any(isinstance(each, DriveFailed) for each in told)


async def test_parameters_are_read_again_until_all_servers_have_answered(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    contour = ((0.5, 0.3), (-0.5, 0.3), (0.0, -0.3))
    found = [Nav2Parameters(speed=0.5, complete=False), Nav2Parameters(speed=0.5, contour=contour)]
    told, read = list[DriverEvent](), iter(found)

    async def answer() -> Nav2Parameters:
        return next(read)

    async with started(monkeypatch, told) as driver:
        monkeypatch.setattr(driver, "_parameters", SimpleNamespace(read=answer))
        for _ in range(4):
            await driver._read_limits(NavigationReport(available=True, reason=""))
            available(driver)
        await turn_passes()
    assert [each.contour for each in told if isinstance(each, DriveLimits)] == [(), contour]


async def test_a_navigator_that_leaves_the_graph_is_detected_between_two_checks(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    station, told = Station(monkeypatch), list[DriverEvent]()
    monkeypatch.setattr(driver_module, "GLANCE", 0.01)
    async with started(monkeypatch, told) as driver:
        monkeypatch.setattr(driver, "_settings", RosSettings(watch_period=60.0))
        monkeypatch.setattr(station, "server_ids", frozenset, raising=False)
        driver._on_statuses(Server.NAVIGATOR, [])
        available(driver)
        driver.go_to(DriveGoal(1, Pose(1.0, 0.0, 0.0, "hall"), 0.3, None))
        driver._on_statuses(Server.NAVIGATOR, [GoalEntry("a" * 32, GoalStatus.EXECUTING)])
        monkeypatch.setattr(driver, "_node", station)
        await until(lambda: any(isinstance(each, DriveFailed) for each in told), what="its absence")
        await until(lambda: station.stopped, what="the stop")
        monkeypatch.setattr(driver, "_node", None)


async def test_a_planner_that_dies_during_a_drive_stops_the_robot(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()
    monkeypatch.setattr(driver_module, "GLANCE", 0.01)
    async with on_the_way(monkeypatch, told) as (_, station, _):
        present = iter([frozenset({"planner"})])
        monkeypatch.setattr(station, "server_ids", lambda: frozenset({"navigator"}), raising=False)
        monkeypatch.setattr(station, "planners", lambda: next(present, frozenset()))
        await until(lambda: any(isinstance(each, DriveFailed) for each in told), what="its absence")
        await until(lambda: station.stopped, what="the stop")
    (failed,) = (each for each in told if isinstance(each, DriveFailed))
    assert failed.failure is DriveFailure.NAVIGATION_GONE
    assert "planner" in failed.description


async def test_a_goal_of_an_earlier_run_can_be_stopped_without_a_search_for_the_servers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    prepared: list[str] = []

    async def done(*_: object) -> None:
        """Join or leave no graph."""

    def node(*_: object, **__: object) -> SimpleNamespace:
        return SimpleNamespace(start=done, stop=done, prepare_stop=lambda: prepared.append("stop"))

    async with started(monkeypatch, []) as driver:
        module = SimpleNamespace(Nav2Node=node)
        monkeypatch.setitem(sys.modules, "nena_edge_agent.nav2.node", module)
        await driver._open_node(RosAddress.of(RosSettings()))
        assert prepared == []
        driver.reclaim(OwnGoals(("a" * 32,), Pose(1.0, 0.0, 0.0, "hall")))
        await driver._open_node(RosAddress.of(RosSettings()))
        assert prepared == ["stop"]
        monkeypatch.setattr(driver, "_node", None)


async def test_a_robot_whose_localisation_dies_during_a_drive_is_reported_as_moving(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()
    async with started(monkeypatch, told) as driver:
        driver._on_pose(READING)
        driver._on_velocity((0.5, 0.0))
        for publishers in (frozenset({"amcl"}), frozenset[str](), frozenset[str]()):
            driver._watch_localiser(Presence(frozenset(), 1, Lifecycle.ABSENT, localisers=publishers))
        await turn_passes()
    lost = [each for each in told if isinstance(each, PoseReport)][-1]
    assert (lost.localized, lost.vx) == (False, 0.5)


@pytest.mark.parametrize("localised", [True, False])
async def test_without_a_session_it_is_unknown_whether_the_robot_moves(
    monkeypatch: pytest.MonkeyPatch, *, localised: bool
) -> None:
    told = list[DriverEvent]()
    async with started(monkeypatch, told) as driver:
        if localised:
            driver._on_pose(READING)
        driver._on_velocity((0.5, 0.0))
        driver._on_session(SessionReport(SessionState.FAILED, "", 0, "the node has failed"))
        await turn_passes()
    *_, last = (each for each in told if isinstance(each, PoseReport | VelocityReport))
    assert (last.vx, last.omega) == (None, None)


async def test_a_standing_robot_whose_localisation_restarts_is_localised_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()
    async with started(monkeypatch, told) as driver:
        driver._on_velocity((0.0, 0.0))
        driver._on_pose(READING)
        for publishers in (frozenset({"amcl"}), frozenset[str](), frozenset[str]()):
            driver._watch_localiser(Presence(frozenset(), 1, Lifecycle.ABSENT, localisers=publishers))
        driver._on_pose(READING)  # within a second, where it stood
        await turn_passes()
    assert [each.localized for each in told if isinstance(each, PoseReport)] == [True, False, True]


async def test_an_arrival_is_judged_after_the_poses_that_a_delay_held_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    told = list[DriverEvent]()

    async def answered() -> bool:
        return True

    async with on_the_way(monkeypatch, told) as (driver, station, clock):
        monkeypatch.setattr(station, "request_pose", answered, raising=False)
        driver._on_pose(READING)
        driver._on_statuses(Server.NAVIGATOR, [GoalEntry("a" * 32, GoalStatus.SUCCEEDED)])
        clock.advance(3.0)
        pass_time(driver_module.HELD_UP + 0.1)
        at_goal = replace(READING, y=0.0, stamp=2)
        asyncio.get_running_loop().call_later(0.1, driver._on_pose, at_goal)
        await until(lambda: any(isinstance(each, Arrived | DriveFailed) for each in told), what="the end")
    assert [each for each in told if isinstance(each, Arrived | DriveFailed)] == [Arrived(1)]
