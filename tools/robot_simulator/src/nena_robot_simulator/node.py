"""The robot as a ROS node: the topics and services of Nav2, AMCL, the map server and the robot's base.

All names are relative, so the namespace applies. Everything here runs in the session's thread.
"""

from __future__ import annotations

import random
import threading
import uuid
from collections import deque
from collections.abc import Iterable
from typing import Any

from action_msgs.msg import GoalInfo
from action_msgs.srv import CancelGoal
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from nav_msgs.srv import GetMap
from rclpy.publisher import Publisher
from rclpy.qos import QoSProfile, ReliabilityPolicy, qos_profile_system_default
from sensor_msgs.msg import BatteryState
from std_msgs.msg import String
from std_srvs.srv import Empty

from nena_robot_simulator import faults, messages
from nena_robot_simulator.action_server import LATCHED, NavigatorEndpoints, action_types
from nena_robot_simulator.behaviours import BEHAVIOURS, DOCKING, RECOVERIES, Behaviours
from nena_robot_simulator.controller_server import ControllerServer
from nena_robot_simulator.faults import disturbed
from nena_robot_simulator.goals import Action, GoalEntry, Snapshot
from nena_robot_simulator.motion import GridMap, Pose
from nena_robot_simulator.navigator import Goal
from nena_robot_simulator.offers import Offers, costmap_parameters, costmap_services, map_services
from nena_robot_simulator.planner_server import PlannerServer
from nena_robot_simulator.robot import Robot
from nena_robot_simulator.server_endpoints import ServerEndpoints
from nena_robot_simulator.servers import Command, Server, parameters
from nena_robot_simulator.session import RosSession
from nena_robot_simulator.settings import RobotSettings, SimulatorSettings
from nena_robot_simulator.waypoint_follower import WaypointFollower
from nena_shared.clock import Clock
from nena_shared.log import get_logger

log = get_logger(__name__)

RELIABLE = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE)
# Many drivers of bases and batteries publish so; reliable subscribers receive nothing from them.
BEST_EFFORT = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
FAULTS = QoSProfile(depth=10, reliability=ReliabilityPolicy.RELIABLE)

GOAL_DELAY = 0.003
"""Latency of a goal from the topic through bt_navigator's own action client to its server, seconds."""
LOOP_PERIOD = 0.01
"""Period of the behaviour tree (``bt_loop_duration``), seconds."""
BASE_PERIOD = 0.05
"""Period of odometry and laser scans, seconds."""
# Nav2's default tree replans at 1 Hz, and the planner publishes each plan.
PLAN_PERIOD = 1.0
BATTERY_PERIOD = 1.0
GOAL_QUEUE_LIMIT = 10
"""Maximum number of goals waiting for the delay; beyond, the oldest is dropped."""


class RobotNode:
    """A simulated robot in its domain and namespace. Call ``start`` and ``close``."""

    def __init__(
        self, settings: RobotSettings, *, simulator: SimulatorSettings, hall: GridMap, clock: Clock
    ) -> None:
        self._settings = settings
        self._hall = self._first_hall = hall
        self._offers = simulator.actions
        self._server_timeout = simulator.server_timeout
        self._clock = clock
        self._log = log.bind(robot=settings.name)
        self._robot = Robot(
            settings,
            simulator,
            hall=hall,
            now=clock.monotonic(),
            noise=random.Random(settings.name),  # noqa: S311 - noise of a simulation that can be repeated
        )
        self._goal_queue: deque[tuple[Pose, str]] = deque(maxlen=GOAL_QUEUE_LIMIT)
        self._held_back: dict[Action, Snapshot] = {}
        self._planned_for: object = None
        self._session = RosSession(
            settings.name,
            node_name="robot_simulator",
            namespace=settings.namespace,
            domain_id=settings.domain_id,
        )
        types = action_types() if simulator.actions else {}
        self._controller = ControllerServer(
            self._session, self._robot, types.get(Action.FOLLOW_PATH), clock, take=self._accept_goal
        )
        self._navigator = NavigatorEndpoints(self._session, self, types, on_goal_pose=self._on_goal_pose)
        self._planner = PlannerServer(self._session, self._robot, clock)
        self._amcl_pose: Publisher | None = None
        self._map: Publisher | None = None
        self._plan: Publisher | None = None
        self._servers = self._make_servers()
        self._last_array: dict[Action, Snapshot] = {}
        self._battery = self._session.publisher(BatteryState, "battery_state", BEST_EFFORT)
        self._odom = self._session.publisher(Odometry, "odom", BEST_EFFORT)
        self._session.subscribe(String, "simulator/fault", self._on_fault, FAULTS)
        self._make_timers()
        self._behaviours = Behaviours(self._session, self._robot, settings.docks, self._loop.reset)
        self._endpoints: Offers | None = None
        if self._offers:
            self._endpoints = Offers(self._session, self._robot, settings.filter_info_topic)
            self._open_offers()
        for fault in (*simulator.faults, *settings.faults):
            self._apply_fault(fault)
        self._show_servers()

    @property
    def alive(self) -> bool:
        """Whether the robot's thread still runs."""
        return self._session.alive

    def start(self) -> None:
        """Start serving."""
        self._session.start()
        self._log.info("robot ready", namespace=self._session.namespace, domain_id=self._settings.domain_id)

    def close(self) -> None:
        """Leave the ROS graph within two seconds."""
        self._session.close()

    def _open_offers(self) -> None:
        """Serve what belongs to no process of :class:`Servers`: docking, costmaps and waypoints."""
        self._behaviours.open(DOCKING)
        costmap_parameters(self._session, self._settings.footprint)
        costmap_services(
            self._session,
            lambda name: self._log.info("costmap cleared", costmap=name),
            lambda kind: messages.costmap_message(
                kind, self._hall, self._settings.map_frame, self._time_stamp()
            ),
        )
        WaypointFollower(self._session, take=self._accept_goal, find=self.find, cancel=self._cancel_goal)

    def _make_servers(self) -> ServerEndpoints:
        tolerance, drive = self._settings.tolerance, self._settings.drive
        values = parameters(
            xy_tolerance=tolerance.xy,
            yaw_tolerance=tolerance.yaw,
            planner_tolerance=tolerance.planner,
            speed=drive.speed,
            approach=drive.approach,
            server_timeout=self._server_timeout,
        )
        work = {
            Server.BEHAVIOURS: self._open_behaviours,
            Server.PLANNER: self._open_planner,
            Server.LOCALISATION: self._open_localisation,
            Server.MAPS: self._open_maps,
        }
        return ServerEndpoints(self._session, self._robot, work=work, values=values, changes=self)

    def change(self, server: Server, transition: int) -> bool:
        """Execute a transition; return False if the server's state does not allow it."""
        done = self._robot.servers.change(server, transition)
        self._robot.set_navigators()
        self._show_servers()
        return done

    def manage(self, manager: Server, command: int) -> bool:
        """Execute a command to a lifecycle manager; return whether all servers have done it."""
        done = self._robot.manage(
            manager, command, self._clock.monotonic(), on_goals_ended=self._publish_statuses
        )
        self._log.info("lifecycle manager", manager=manager.value, command=command, done=done)
        self._publish_statuses()
        self._show_servers()
        return done

    def _cancelled_by(self, server: Server, actions: Iterable[str]) -> list[Any]:
        def on_cancel(_request: CancelGoal.Request, response: CancelGoal.Response) -> None:
            """Cancel the server's goal, whichever is named: it has at most one."""
            had_one = self._cancel_behaviour()
            response.goals_canceling = [GoalInfo()] if had_one else []
            self._log.info("goal cancelled", server=server.value, had_one=had_one)

        return [
            self._servers.serve(server, CancelGoal, f"{action}/_action/cancel_goal", on_cancel)
            for action in actions
        ]

    def _open_behaviours(self) -> list[Any]:
        found = self._cancelled_by(Server.BEHAVIOURS, RECOVERIES)
        return [*found, *(self._behaviours.open(BEHAVIOURS) if self._offers else [])]

    def _cancel_behaviour(self) -> bool:
        return self._robot.cancel_recovery() or self._behaviours.cancel(*RECOVERIES)

    def _open_planner(self) -> list[Any]:
        self._plan = self._session.publisher(Path, "plan", RELIABLE)
        return [self._plan, *(self._planner.open() if self._offers else [])]

    def _open_localisation(self) -> list[Any]:
        topic = self._settings.localisation.pose_topic
        if topic:
            self._amcl_pose = self._session.publisher(PoseWithCovarianceStamped, "amcl_pose", LATCHED)
        return [
            *([self._amcl_pose] if topic else []),
            self._session.subscribe(
                PoseWithCovarianceStamped, "initialpose", self._on_initial_pose, qos_profile_system_default
            ),
            self._servers.serve(
                Server.LOCALISATION, Empty, "request_nomotion_update", self._on_nomotion_update
            ),
        ]

    def _open_maps(self) -> list[Any]:
        self._map = self._session.publisher(OccupancyGrid, "map", LATCHED)
        self._hall = self._first_hall  # a starting map_server has the map of its settings
        self._robot.use_map(self._hall)
        self._publish_map()
        served = self._servers.serve(Server.MAPS, GetMap, "map_server/map", self._on_get_map)
        return [self._map, served, *(map_services(self._servers, self._use_map) if self._offers else ())]

    def _use_map(self, found: GridMap) -> OccupancyGrid:
        """Use another map, like map_server after loading one; the robot's pose on it is unknown."""
        self._hall = found
        self._robot.use_map(found)
        self._publish_map()
        self._log.info("map loaded", width=found.width, height=found.height)
        return messages.map_message(found, self._settings.map_frame, self._time_stamp())

    def _make_timers(self) -> None:
        self._delivery = self._session.every(GOAL_DELAY, self._deliver_goals)
        self._delivery.cancel()
        self._loop = self._session.every(LOOP_PERIOD, self._on_loop)
        self._session.every(BASE_PERIOD, self._on_base)
        self._replanning = self._session.every(PLAN_PERIOD, self._publish_plan)
        self._session.every(BATTERY_PERIOD, self._publish_battery)

    def _time_stamp(self) -> int:
        """Return the current time, UTC nanoseconds."""
        return int(self._clock.now().timestamp() * 1_000_000) * 1000

    def _on_goal_pose(self, message: PoseStamped) -> None:
        if not self._goal_queue:
            self._delivery.reset()
        self._goal_queue.append((messages.goal_pose_of(message.pose), message.header.frame_id))

    def _deliver_goals(self) -> None:
        self._delivery.cancel()
        while self._goal_queue:
            pose, frame_id = self._goal_queue.popleft()
            # Nothing answers a goal by topic, so this one is lost without a trace.
            if self.hangs:
                continue
            self._accept_goal(Goal(uuid.uuid4(), pose, frame_id), Action.TO_POSE)

    def on_goal(self, action: Action, goal: Goal) -> int | None:
        """Accept a goal of an action; return the time of acceptance (UTC, ns), or None if it is rejected."""
        if self.find(action, goal.goal_id) is not None:
            return None
        return self._accept_goal(goal, action)

    def find(self, action: Action, goal_id: uuid.UUID) -> GoalEntry | None:
        """Return a known goal."""
        return self._robot.goals(action).find(goal_id, self._clock.monotonic())

    def _accept_goal(self, goal: Goal, action: Action) -> int | None:
        stamp = self._time_stamp()
        taken = self._robot.take_goal(goal, stamp, self._clock.monotonic(), action)
        x, y, via = goal.pose.x, goal.pose.y, len(goal.via)
        goal_id, frame = str(goal.goal_id), goal.frame_id
        self._log.info(
            "goal", tree=goal.tree, action=action, goal=goal_id, x=x, y=y, via=via, frame=frame, taken=taken
        )
        self._publish_statuses()
        self._loop.reset()
        return stamp if taken else None

    def _on_initial_pose(self, message: PoseWithCovarianceStamped) -> None:
        # Also while inactive: AMCL keeps such a pose for its activation (measured).
        if not self._robot.servers.runs(Server.LOCALISATION):
            return
        pose = messages.pose_of(message.pose.pose)
        # AMCL wants exactly its own frame, and drops other poses with a line in its log.
        if pose is None or message.header.frame_id != self._settings.map_frame:
            self._log.warning("initial pose ignored: invalid numbers or frame", frame=message.header.frame_id)
            return
        self._robot.take_initial_pose(pose)
        self._log.info("initial pose", x=pose.x, y=pose.y, yaw=pose.yaw)

    @property
    def hangs(self) -> bool:
        """Whether bt_navigator answers nothing."""
        return not self._robot.servers.runs(Server.NAVIGATOR)

    def on_cancel(self, action: Action, request: Any, response: Any) -> None:  # noqa: ANN401
        """Answer an action_msgs/srv/CancelGoal request."""
        goal_id = messages.goal_id_of(request.goal_info)
        stamp = messages.nanoseconds_of(request.goal_info.stamp)
        answer = self._robot.cancel(goal_id, stamp, self._clock.monotonic(), action)
        self._publish_statuses()
        # The array with CANCELING comes before the answer, as in rcl.
        response.return_code = int(answer.code)
        response.goals_canceling = [messages.goal_info(goal) for goal in answer.goals]
        self._log.info("cancel", goal=str(goal_id), code=answer.code.name, goals=len(answer.goals))

    def _cancel_goal(self, goal_id: uuid.UUID) -> None:
        self._robot.cancel(goal_id, 0, self._clock.monotonic())
        self._publish_statuses()

    def _on_nomotion_update(self, _request: Empty.Request, _response: Empty.Response) -> None:
        self._robot.force_estimate()

    def _on_get_map(self, _request: GetMap.Request, response: GetMap.Response) -> None:
        response.map = messages.map_message(self._hall, self._settings.map_frame, self._time_stamp())

    def _on_fault(self, message: String) -> None:
        try:
            fault = faults.parse(message.data)
        except faults.FaultRefusedError as error:
            self._log.warning("fault rejected", problems=error.problems)
            return
        self._apply_fault(fault)
        self._show_servers()
        self._publish_statuses()
        self._loop.reset()

    def _apply_fault(self, fault: faults.AnyFault) -> None:
        if isinstance(fault, faults.Freeze):
            self._log.info("fault", **fault.model_dump())
            threading.Event().wait(fault.seconds)  # blocks the robot's thread, so everything hangs
            return
        was_silent = self._is_silent
        now = self._clock.monotonic()
        if isinstance(fault, faults.Nav2Stopped) and fault.active:
            self.manage(Server.MANAGER, Command.SHUTDOWN)  # ends the goals, and tells their clients
        self._robot.apply(fault, goal_id=uuid.uuid4(), accepted_ns=self._time_stamp(), now=now)
        self._log.info("fault", **fault.model_dump())
        # The map is latched and published on change only, so one lost in the silence would never come.
        if was_silent and not self._is_silent:
            self._publish_map()

    def _show_servers(self) -> None:
        self._servers.show()
        if not self._robot.servers.listed(Server.NAVIGATOR):
            self._navigator.show(there=self._robot.servers.configured(Server.NAVIGATOR))
        self._controller.show()

    @property
    def _is_silent(self) -> bool:
        return self._robot.faults.on(faults.Silence)

    def _on_loop(self) -> None:
        """Advance the robot. While it rests, only the slower cycle of the base runs."""
        now = self._clock.monotonic()
        self._advance_robot(now)
        if not self._is_silent:
            if self._endpoints is not None:
                self._endpoints.show_collision()
            frame = self._settings.map_frame
            self._navigator.publish_progress(
                lambda action: self._robot.feedback(action, now), frame, self._time_stamp
            )
            self._controller.publish_progress(frame, self._time_stamp())
        if self._robot.drive is not None and self._robot.drive is not self._planned_for:
            self._publish_plan()
            self._replanning.reset()
        if self._robot.resting:
            # 50 resting robots in one process would wake it 5,000 times per second.
            self._loop.cancel()

    def _advance_robot(self, now: float) -> None:
        changed = self._robot.advance(now)
        self._publish_statuses()
        if changed:
            self._show_servers()

    def _on_base(self) -> None:
        if self._robot.resting:
            self._advance_robot(self._clock.monotonic())
        stamp = self._time_stamp()
        self._publish_message(
            self._odom,
            messages.odometry_message(
                self._robot.odometry,
                self._robot.velocity,
                frame_id=self._settings.odom_frame,
                child_frame_id=self._settings.base_frame,
                nanoseconds=stamp,
            ),
        )
        if self._endpoints is not None and not self._is_silent:
            self._endpoints.publish_transforms(self._settings, stamp)
        estimate = self._robot.scan() if self._amcl_pose is not None else None
        if estimate is not None:
            message = messages.estimate_message(estimate, self._settings.map_frame, stamp)
            self._publish_message(self._amcl_pose, message)

    def _publish_plan(self) -> None:
        drive = self._planned_for = self._robot.drive
        if drive is None or not self._robot.servers.works(Server.PLANNER):
            return
        poses = drive.plan(self._robot.pose)
        if poses:
            self._publish_message(
                self._plan, messages.path_message(poses, self._settings.map_frame, self._time_stamp())
            )

    def _publish_battery(self) -> None:
        scale = self._settings.battery.scale
        if self._robot.faults.on(faults.BatteryScale):
            scale = "fraction" if scale == "percent" else "percent"
        message = messages.battery_message(
            self._robot.battery, scale, self._time_stamp(), charging=self._robot.docked
        )
        self._publish_message(self._battery, message)

    def _publish_map(self) -> None:
        if not self._robot.servers.configured(Server.MAPS):
            return
        self._publish_message(
            self._map, messages.map_message(self._hall, self._settings.map_frame, self._time_stamp())
        )

    def _publish_statuses(self) -> None:
        for action in Action:
            self._publish_statuses_of(action)

    def _publish_statuses_of(self, action: Action) -> None:
        """Publish each new array; after a silence, only the last one of those held back."""
        snapshots = self._robot.take_unpublished(action)
        if snapshots:
            self._navigator.answer(action)
            if action is Action.FOLLOW_PATH:
                self._controller.answer()
        if self._is_silent:
            if snapshots:
                self._held_back[action] = snapshots[-1]
            return
        # A writer keeps only its last array, so this is what arrives after a break of the network.
        held_back = self._held_back.pop(action, None)
        if held_back is not None and not snapshots:
            snapshots = [held_back]
        for snapshot in snapshots:
            for shown in disturbed(snapshot, self._last_array.get(action, ()), self._robot.faults):
                self._navigator.publish(action, shown)
                if action is Action.FOLLOW_PATH:
                    self._controller.publish(shown)
            self._last_array[action] = snapshot

    def _publish_message(self, publisher: Publisher | None, message: object) -> None:
        """Publish a message, unless its server is gone or everything is silent."""
        if not self._is_silent and publisher is not None:
            publisher.publish(message)
