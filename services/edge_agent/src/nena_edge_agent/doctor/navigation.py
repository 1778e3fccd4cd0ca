"""Check the links on the robot from observations, without I/O."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Collection
from dataclasses import dataclass

from nena_edge_agent.doctor.finding import Link, LinkFinding, LinkVerdict, missing, ok, unknown
from nena_edge_agent.nav2.poses import PoseReading, localized
from nena_edge_agent.nav2.presence import POSE_FIRST, Lifecycle
from nena_edge_agent.nav2.settings import RosSettings


@dataclass(frozen=True, slots=True)
class Grid:
    """An occupancy grid: its frame, its lower left corner (m), and its size (m)."""

    frame: str
    x: float
    y: float
    width: float
    height: float

    def holds(self, x: float, y: float) -> bool:
        """Return whether a point (m) is on the grid, which is assumed not to be rotated."""
        return 0 <= x - self.x <= self.width and 0 <= y - self.y <= self.height


@dataclass(frozen=True, slots=True)
class RosView:
    """What a node in the configured domain and namespace observes within a few seconds."""

    nodes: tuple[str, ...] = ()
    """Names of the other nodes, except hidden ones."""
    busy_domains: tuple[int, ...] = ()
    """Other domains that have nodes, among those searched."""
    servers: int = 0
    """Number of publishers of the action's status in the namespace."""
    elsewhere: tuple[str, ...] = ()
    """Other namespaces in which the action's status is published."""
    goal_listeners: int = 0
    lifecycle: Lifecycle = Lifecycle.ABSENT
    pose: PoseReading | None = None
    grid: Grid | None = None
    tolerance: float | None = None
    """Distance from a goal within which Nav2 considers it reached, m (``xy_goal_tolerance``)."""
    theta_tolerance: float | None = None
    """Deviation from a goal's heading at which it still counts as reached, rad (``yaw_goal_tolerance``)."""
    server_timeout: float | None = None
    """Time for which bt_navigator waits for its servers, ms (``default_server_timeout``)."""
    path_types: bool = True
    """Whether nav2_msgs/action/FollowPath is installed here."""
    path_servers: int = 0
    """Number of publishers of the status of the controller's FollowPath action."""
    collision_monitor: bool = False
    """Whether a collision monitor publishes its state."""
    unused_mask: str = ""
    """Why no node plans around the BLOCKED zones that the agent publishes, or could publish."""
    clock_offset: float | None = None
    """Seconds by which the newest odometry stamp is ahead of this program's clock; None: no odometry."""


MOST_OFF = 2.0
"""Maximum difference between this program's clock and ROS time stamps, seconds."""

UNSYNCHRONISED = 5
"""Return value of adjtimex(2) while the clock is not synchronised (TIME_ERROR)."""

_TIMEX_SIZE = 512
"""Buffer size, bytes; larger than struct timex on any Linux. A zeroed buffer only queries."""


def kernel_keeps_time() -> bool | None:
    """Return whether the kernel reports a synchronised clock (NTP, PTP); None if unknown."""
    try:
        answer: int = ctypes.CDLL(None).adjtimex(ctypes.create_string_buffer(_TIMEX_SIZE))
    except (OSError, AttributeError):
        return None
    return None if answer < 0 else answer != UNSYNCHRONISED


def judge_clock(*, kept: bool | None, ros_offset: float | None) -> LinkFinding:
    """Check the clock by the kernel's status and the offset of ROS time stamps, s."""
    # Simulated time starts at 0: such stamps are decades off, and transforms would never match.
    if ros_offset is not None and abs(ros_offset) > MOST_OFF:
        return missing(
            Link.CLOCK,
            f"the robot's ROS messages differ by {ros_offset:+.1f} s from this computer's clock",
            "synchronise both by NTP or PTP; on a real robot, use_sim_time must be false in every node",
        )
    if kept is False:
        return LinkFinding(
            Link.CLOCK,
            LinkVerdict.DOUBTFUL,
            "this computer's clock is not synchronised, according to the kernel",
            "synchronise it with chrony or systemd-timesyncd, from the same source as fleet control",
        )
    seen = "as ROS time stamps" if ros_offset is not None else "no ROS time stamp to compare"
    return ok(Link.CLOCK, f"{'synchronised' if kept else 'runs'}; {seen}")


# Measured (1.3.13): with its default of 20 ms, Nav2 itself aborts good drives on a loaded computer.
LOADED = 200.0
"""Value of ``default_server_timeout``, ms, below which Nav2 aborts drives on a loaded computer."""
ROS_LINKS = (Link.DOMAIN, Link.NAMESPACE, Link.LOCALISATION, Link.NAVIGATION)
NODES_SHOWN = 3


def judge_robot(view: RosView, settings: RosSettings) -> list[LinkFinding]:
    """Check domain, namespace, localisation and Nav2, up to the first missing link.

    Localisation is checked before Nav2, whose planner does not become active without a pose.
    """
    findings = [_domain_finding(view, settings)]
    if findings[-1].verdict is LinkVerdict.OK:
        findings.append(_namespace_finding(view, settings))
    if findings[-1].link is Link.NAMESPACE and findings[-1].verdict is LinkVerdict.OK:
        findings.append(_localisation_finding(view, settings))
        findings.append(_navigation_finding(view, settings))
    return [*findings, *unknown(ROS_LINKS[len(findings) :], f"needs the {findings[-1].link}")]


def judge_map(
    view: RosView | None, settings: RosSettings, map_id: str, plant_maps: Collection[str]
) -> LinkFinding:
    """Check the map ID that fleet control must use, and Nav2's map; ``view`` None: a loopback robot."""
    if plant_maps and map_id not in plant_maps:
        names = ", ".join(f"'{map_id}'" for map_id in sorted(plant_maps))
        remedy = "set map_id to this map's name in the plant model, or vda5050:mapId there to the robot's"
        return missing(Link.MAP, f"map_id is '{map_id}', and the plant model has {names}", remedy)
    agreed = f"map_id is '{map_id}', {'as in the plant model' if plant_maps else 'orders must use this name'}"
    if view is None:
        return ok(Link.MAP, agreed)
    if not view.servers:
        return LinkFinding(Link.MAP, LinkVerdict.UNKNOWN, f"{agreed}; more needs the {Link.NAMESPACE}")
    return _nav2_map_finding(view, settings, agreed)


def _nav2_map_finding(view: RosView, settings: RosSettings, agreed: str) -> LinkFinding:
    grid, pose = view.grid, view.pose
    if grid is None:
        text = f"{agreed}; no node publishes a map to compare the position with"
        return LinkFinding(
            Link.MAP, LinkVerdict.DOUBTFUL, text, "start Nav2's map server, if this robot has one"
        )
    if grid.frame.removeprefix("/") != settings.frame:
        text = f"Nav2's map is in frame '{grid.frame}', goals are in '{settings.frame}'"
        return missing(Link.MAP, text, "set ros.frame to Nav2's global frame")
    if pose and not grid.holds(pose.x, pose.y):
        text = f"the robot reports {pose.x:.2f} m, {pose.y:.2f} m, which is not on Nav2's map"
        return missing(Link.MAP, text, "load the map of this area, or set the initial position again")
    return ok(Link.MAP, f"{agreed}; Nav2's map is {grid.width:.0f} m by {grid.height:.0f} m")


def _domain_finding(view: RosView, settings: RosSettings) -> LinkFinding:
    if view.nodes:
        shown = ", ".join(view.nodes[:NODES_SHOWN]) + (", ..." if len(view.nodes) > NODES_SHOWN else "")
        return ok(Link.DOMAIN, f"{len(view.nodes)} nodes in domain {settings.domain_id}: {shown}")
    text = f"no other nodes in domain {settings.domain_id}"
    if view.busy_domains:
        domains = ", ".join(map(str, view.busy_domains))
        return missing(
            Link.DOMAIN, f"{text}, but nodes are visible in {domains}", "set ros.domain_id to the robot's"
        )
    remedy = (
        "set ros.domain_id to the robot's ROS_DOMAIN_ID; check that the robot's nodes run, that both have "
        "the same RMW_IMPLEMENTATION and ROS_AUTOMATIC_DISCOVERY_RANGE, and that UDP multicast is allowed"
    )
    return missing(Link.DOMAIN, text, remedy)


def _namespace_finding(view: RosView, settings: RosSettings) -> LinkFinding:
    if view.servers:
        return ok(Link.NAMESPACE, f"{settings.namespace} has {settings.names.status}")
    text = f"no node publishes {settings.names.status} in namespace {settings.namespace}"
    if view.elsewhere:
        namespaces = ", ".join(view.elsewhere)
        return missing(
            Link.NAMESPACE, f"{text}, but one does in {namespaces}", "set ros.namespace to the robot's"
        )
    return missing(Link.NAMESPACE, text, "start Nav2 on the robot; ros.names.action names its action")


def _navigation_finding(view: RosView, settings: RosSettings) -> LinkFinding:
    names = settings.names
    if view.lifecycle in (Lifecycle.INACTIVE, Lifecycle.SILENT) and view.pose is None:
        state = (
            "is not active" if view.lifecycle is Lifecycle.INACTIVE else "does not answer; it may be starting"
        )
        return missing(Link.NAVIGATION, f"Nav2 {state}, and the robot has no pose", POSE_FIRST)
    if view.lifecycle is Lifecycle.INACTIVE:
        remedy = (
            # Measured (1.3.13): the manager hangs at the dead node, and the new one stays unconfigured.
            "activate it: ros2 service call .../manage_nodes, or autostart: true in Nav2's parameters; if "
            "one of its servers was started again, restart the lifecycle manager as well"
        )
        return missing(Link.NAVIGATION, f"{names.lifecycle} reports that Nav2 is not active", remedy)
    if view.lifecycle is Lifecycle.SILENT:
        return missing(Link.NAVIGATION, f"{names.lifecycle} does not answer", "Nav2 hangs: restart it")
    # bt_navigator subscribes from "configure" on: a subscription alone does not show that it is active.
    if not view.goal_listeners:
        remedy = "check that bt_navigator is configured and active; ros.names.goal_pose names the topic"
        return missing(Link.NAVIGATION, f"no node subscribes to {names.goal_pose}", remedy)
    state = "active" if view.lifecycle is Lifecycle.ACTIVE else "available; it has no lifecycle manager"
    text = f"{state}, and accepts goals on {names.goal_pose}{_describe_drives(view)}"
    return _settings_finding(view, settings, text)


def _settings_finding(view: RosView, settings: RosSettings, text: str) -> LinkFinding:
    """Check whether a working Nav2, described by ``text``, supports the settings."""
    tolerance, path_action = settings.goals.goal_tolerance, settings.names.follow_path
    if tolerance is not None and view.tolerance is not None and tolerance < view.tolerance:
        problem = f"ros.goals.goal_tolerance is {tolerance:g} m"
        remedy = "leave ros.goals.goal_tolerance unset, so that it is read from Nav2"
    elif settings.nav2.follow_path and not view.path_types:
        problem = "ros.nav2.follow_path has no effect: nav2_msgs cannot be loaded"
        remedy = "source the robot's ROS installation with Nav2 before the start"
    elif settings.nav2.follow_path and not view.path_servers:
        problem = f"ros.nav2.follow_path is set, and no node has the action {path_action}"
        remedy = "check that controller_server is active; ros.names.follow_path names its action"
    elif view.unused_mask:
        problem = f"it drives through BLOCKED zones: {view.unused_mask}"
        remedy = "add a keep-out filter to Nav2's global costmap, see docs/nav2.md; restart Nav2"
    else:
        return ok(Link.NAVIGATION, text)
    return LinkFinding(Link.NAVIGATION, LinkVerdict.DOUBTFUL, f"{text}, and {problem}", remedy)


def _describe_drives(view: RosView) -> str:
    """Return Nav2's parameters and its collision monitor as text."""
    notes = []
    if view.tolerance is not None:
        notes.append(f"goal tolerance {view.tolerance:g} m (no node may allow less)")
    if view.theta_tolerance is not None:
        notes.append(f"heading tolerance {view.theta_tolerance:g} rad (likewise)")
    if view.server_timeout is not None:
        better = " (200 to 500 ms suit a loaded computer)" if view.server_timeout < LOADED else ""
        notes.append(f"waits {view.server_timeout:g} ms for its servers{better}")
    if view.collision_monitor:
        # Measured (1.3.13): its state is sent on changes only and not latched: a late reader knows nothing.
        notes.append("has a collision monitor, which reports a stop only when it begins or ends")
    return "".join(f"; {note}" for note in notes)


def _localisation_finding(view: RosView, settings: RosSettings) -> LinkFinding:
    pose, names = view.pose, settings.names
    if pose is None:
        remedy = (
            # Measured (1.3.13): planner_server waits 60 s for the transform, then gives up for good.
            "set the initial position (RViz, or the action initPosition); check that the localisation runs. "
            "Nav2 needs it within 60 s of its start"
        )
        return missing(Link.LOCALISATION, f"no poses on {names.pose}", remedy)
    if pose.frame.removeprefix("/") != settings.frame:
        text = f"poses are in frame '{pose.frame}', and ros.frame is '{settings.frame}': they are ignored"
        return missing(Link.LOCALISATION, text, "set ros.frame to the frame of the localisation")
    place = f"{pose.x:.2f} m, {pose.y:.2f} m, {math.degrees(pose.yaw):.0f} degrees"
    if not localized(pose, settings.localisation):
        text = f"the robot's position is uncertain: {place}: {_describe_spread(pose)}"
        return missing(Link.LOCALISATION, text, "set the initial position, or drive the robot around by hand")
    return ok(Link.LOCALISATION, f"the robot is at {place}, {_describe_spread(pose)}")


def _describe_spread(pose: PoseReading) -> str:
    variances = (pose.x_variance, pose.y_variance, pose.yaw_variance)
    if not all(variance >= 0 for variance in variances):
        return "with invalid variances"
    xy = math.sqrt(max(pose.x_variance, pose.y_variance))
    return f"± {xy:.2f} m and {math.degrees(math.sqrt(pose.yaw_variance)):.0f} degrees"
