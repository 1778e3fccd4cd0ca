"""Settings for ROS: the robot's address and names in the ROS graph, and the driver's timeouts."""

from __future__ import annotations

import math
import re
from enum import StrEnum
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, ConfigDict, Field, ValidationError
from pydantic.dataclasses import dataclass as checked

from nena_shared.settings import SettingsGroup

BatteryScale = Literal["fraction", "percent"]
"""How ``percentage`` is sent: 0 to 1 as the message defines it, or 0 to 100 as many drivers do."""


_TOKEN = "[A-Za-z_][A-Za-z0-9_]*"  # noqa: S105 - a pattern, no secret
_NAMESPACE = re.compile(rf"/?|/?{_TOKEN}(/{_TOKEN})*")
_NAME = re.compile(rf"/?{_TOKEN}(/{_TOKEN})*")
_NODE_NAME = re.compile(_TOKEN)


def _ros_namespace(namespace: str) -> str:
    if not _NAMESPACE.fullmatch(namespace):
        raise ValueError(
            "a ROS namespace consists of letters, digits and underscores, with '/' between its parts, "
            "and no part starts with a digit: r1 or hall_2/r1"
        )
    return "/" + namespace.removeprefix("/")


def _ros_name(name: str) -> str:
    if not _NAME.fullmatch(name):
        raise ValueError(
            "a ROS name consists of letters, digits and underscores, with '/' between its parts: amcl_pose, "
            "or /sensors/battery for one outside of the robot's namespace"
        )
    return name


def _ros_node_name(name: str) -> str:
    if not _NODE_NAME.fullmatch(name):
        raise ValueError(
            "the name of a ROS node consists of letters, digits and underscores: nena_edge_agent"
        )
    return name


Namespace = Annotated[str, Field(max_length=200), AfterValidator(_ros_namespace)]
"""A ROS namespace; read back with a leading slash."""
RosName = Annotated[str, Field(min_length=1, max_length=200), AfterValidator(_ros_name)]
NodeName = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_ros_node_name)]
DomainId = Annotated[int, Field(ge=0, le=232)]
"""Above 232, Fast DDS ends the program without a message."""
Seconds = Annotated[float, Field(gt=0, le=600, allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Radians = Annotated[float, Field(gt=0, le=math.pi)]


GOAL_TOLERANCE = 0.25
"""Nav2's default goal tolerance, used if the actual one is unknown, metres."""


class Navigation(StrEnum):
    """How goals are sent to Nav2."""

    AUTO = "auto"
    """By its action if this machine has the types and the robot the server, else by topics."""
    TOPICS = "topics"
    ACTION = "action"
    THROUGH_POSES = "through_poses"
    """By the action for several poses: nodes ahead are sent with the next one."""


class PoseSource(StrEnum):
    """The source of the robot's pose."""

    AUTO = "auto"
    """The topic, and the transforms while nothing publishes on it."""
    TOPIC = "topic"
    TF = "tf"


def status_of(action: str) -> str:
    """Return the topic of an action's goal statuses."""
    return f"{action}/_action/status"


class RosNames(SettingsGroup):
    """Names of topics and services; without a leading slash they are in the robot's namespace."""

    goal_pose: RosName = Field("goal_pose", description="Topic of Nav2 goals.")
    action: RosName = Field(
        "navigate_to_pose", description="Nav2's action; driving by topics uses its status and cancelling."
    )
    pose: RosName = Field("amcl_pose", description="Topic of the localised pose.")
    initial_pose: RosName = Field("initialpose", description="Topic for the initial pose.")
    fresh_pose: RosName = Field(
        "request_nomotion_update", description="Service that requests a pose at standstill."
    )
    battery: RosName = Field("battery_state", description="Topic of the battery state.")
    plan: RosName = Field("plan", description="Topic of Nav2's plan, for the remaining distance.")
    map: RosName = Field("map", description="Topic of the robot's map, shown in the panel.")
    odometry: RosName = Field("odom", description="Topic of the odometry.")
    lifecycle: RosName = Field(
        "lifecycle_manager_navigation/is_active",
        description="Service that reports whether Nav2 is active; optional.",
    )
    controller: RosName = Field("controller_server", description="Node whose parameters are read.")
    costmap: RosName = Field(
        "local_costmap/local_costmap", description="Node whose parameters hold the robot's footprint."
    )
    planner: RosName = Field(
        "planner_server", description="Node of Nav2's planner; if it dies, the robot is stopped."
    )
    navigator: RosName = Field("bt_navigator", description="Node whose parameters are read.")
    localiser: RosName = Field(
        "amcl/get_state", description="Service with the localisation's lifecycle state; optional."
    )
    through_poses: RosName = Field("navigate_through_poses", description="Nav2's action for several poses.")
    follow_path: RosName = Field("follow_path", description="Action of Nav2's controller, for paths.")
    speed_limit: RosName = Field("speed_limit", description="Topic of the controller's speed limit.")
    collision_monitor: RosName = Field(
        "collision_monitor_state", description="Topic of the collision monitor's state."
    )
    tf: RosName = Field("tf", description="Topic of the transforms.")
    tf_static: RosName = Field("tf_static", description="Topic of the static transforms.")
    zone_filter_info: RosName = Field(
        "zone_filter_info", description="Topic that names the mask of BLOCKED zones (CostmapFilterInfo)."
    )
    zone_mask: RosName = Field("zone_filter_mask", description="Topic of the mask of BLOCKED zones.")
    map_server: RosName = Field("map_server", description="Nav2's map server, for maps.store = nav2.")
    clear_costmaps: tuple[RosName, ...] = Field(
        (
            "global_costmap/clear_entirely_global_costmap",
            "local_costmap/clear_entirely_local_costmap",
        ),
        description="Services that clear the costmaps after a change of the map.",
    )

    motions: tuple[RosName, ...] = Field(
        (
            "follow_path",
            "spin",
            "backup",
            "drive_on_heading",
            "assisted_teleop",
            "dock_robot",
            "undock_robot",
        ),
        min_length=1,
        description="Actions that move the robot, the controller's first; their goals are cancelled if the "
        "navigator does not stop the robot.",
    )

    @property
    def status(self) -> str:
        """Return the topic with the goal statuses of the action for one pose."""
        return status_of(self.action)


class GoalSettings(SettingsGroup):
    """How goals are sent and followed."""

    confirmation_time: Seconds = Field(
        3.5,
        description="Time until a goal that Nav2 does not list is sent again, seconds; below 3 s, a goal "
        "whose status was lost can be sent twice.",
    )
    resends: int = Field(3, ge=0, le=20, description="Resends of a goal before it fails.")
    settle_time: Seconds = Field(
        2.0,
        description="Time after Nav2 was found until earlier goals are ruled out, seconds.",
    )
    cancel_time: Seconds = Field(2.0, description="Time until a cancel without effect is repeated, seconds.")
    pose_wait: Seconds = Field(2.0, description="Timeout for the pose that confirms an arrival, seconds.")
    localisation_wait: Seconds = Field(
        1.5,
        description="Time from the first pose of the localisation, also after a loss, until a goal is sent, "
        "seconds. AMCL dates its transform 1 s ahead (transform_tolerance); Nav2 aborts earlier goals (102).",
    )
    standstill_timeout: Seconds = Field(
        3.0,
        description="Time after a stop request until a robot without confirmed standstill is reported as not "
        "stopped, seconds. Without odometry: time after the cancel until it counts as standing.",
    )
    standstill_noise: float = Field(
        0.01,
        gt=0,
        le=0.1,
        description="Maximum odometry velocity at standstill, m/s and rad/s. Raise it if the "
        "odometry drifts at rest; lower velocities are reported as 0.",
    )
    goal_tolerance: Positive | None = Field(
        None,
        description="Nav2's goal tolerance (xy_goal_tolerance), metres. Unset: read from Nav2; 0.25 if it "
        "does not answer.",
    )
    replan_period: float = Field(
        1.0,
        ge=0,
        le=60,
        description="Replanning period of Nav2's behaviour tree, seconds. At a passed node, the next goal "
        "is sent early: by the goal tolerance or the controller's slow-down distance, plus the distance "
        "driven in this time, but within the node's deviation.",
    )
    blocked_after: Seconds = Field(
        20.0,
        description="Time without movement during a goal until the robot counts as blocked, seconds.",
    )


class LocalisationSettings(SettingsGroup):
    """The initial position, and when the robot counts as localised."""

    initial_xy_variance: Positive = Field(0.25, description="Variance of an initial position, m².")
    initial_theta_variance: Positive = Field(0.068, description="Variance of an initial heading, rad².")
    initial_attempts: int = Field(4, ge=1, le=20, description="Attempts to set an initial position.")
    initial_wait: Seconds = Field(2.5, description="Timeout of each attempt, seconds.")
    initial_xy_tolerance: Positive = Field(
        0.5, description="Position tolerance of the confirming pose, metres."
    )
    initial_theta_tolerance: Radians = Field(
        0.5, description="Heading tolerance of the confirming pose, radians."
    )
    pose_timeout: Seconds = Field(
        5.0,
        description="Time without a pose during a goal after which one is requested, seconds; if none is "
        "received, the robot counts as lost.",
    )
    xy_spread_limit: Positive = Field(
        0.75, description="Maximum standard deviation of a localised position, m."
    )
    theta_spread_limit: Radians = Field(
        0.5, description="Maximum standard deviation of a localised heading, rad."
    )


class OfferSettings(SettingsGroup):
    """Optional features of Nav2, used if this machine has nav2_msgs."""

    speed_limit: bool = Field(
        default=True,
        description="Obey maximumSpeed of edges and SPEED_LIMIT zones by Nav2's topic speed_limit. "
        "description.maximum_speed must be the controller's own speed.",
    )
    keep_out: bool = Field(
        default=True,
        description="Publish BLOCKED zones as a mask for the keep-out filter of Nav2's costmaps.",
    )
    follow_path: bool = Field(
        default=False,
        description="Drive edges with a trajectory or corridor along it, by the controller's action: "
        "without Nav2's planner, which avoids obstacles, and without recoveries.",
    )
    mask_resolution: float = Field(
        0.05, ge=0.01, le=1.0, description="Cell size of the keep-out mask, metres."
    )


class RosSettings(SettingsGroup):
    """The robot's ROS side."""

    namespace: Namespace = Field("/", description="ROS namespace of the robot. Unset: '/'.")
    domain_id: DomainId = Field(0, description="ROS domain ID of the robot.")
    start_session: bool = Field(
        default=True,
        description=("Join the ROS graph at start. false: wait for the instant action nena:startRosSession."),
    )
    session_retry: Seconds = Field(
        1.0, description="Delay before a failed session is started again, seconds; doubles each time."
    )
    node_name: NodeName = Field("nena_edge_agent", description="Name of the agent's ROS node.")
    frame: str = Field(
        "map", min_length=1, max_length=200, description="Nav2's global frame, for goals and poses."
    )
    base_frame: str = Field(
        "base_link",
        min_length=1,
        max_length=200,
        description="Frame of the robot, for the pose by transforms.",
    )
    pose_source: PoseSource = Field(
        PoseSource.AUTO,
        description="Source of the robot's pose: topic (names.pose); tf (transforms from frame to "
        "base_frame, needs tf2_msgs); auto: the topic, and transforms while nothing publishes on it.",
    )
    transform_timeout: Seconds = Field(
        2.0, description="Time without a transform after which the pose is unknown, seconds."
    )
    names: RosNames = Field(default_factory=RosNames, description="Topics and services.")
    navigation: Navigation = Field(
        Navigation.AUTO,
        description="How goals are sent: topics; action (needs nav2_msgs); through_poses (Nav2's action for "
        "several poses); auto: the action if nav2_msgs and its server are available, else topics.",
    )
    battery_scale: BatteryScale = Field(
        "fraction", description="Scale of the battery percentage: 0 to 1, or 0 to 100."
    )
    goals: GoalSettings = Field(default_factory=GoalSettings, description="Goals.")
    localisation: LocalisationSettings = Field(
        default_factory=LocalisationSettings, description="Initial position and limits of a localised pose."
    )
    behavior_trees: dict[str, str] = Field(
        default_factory=dict,
        description="Behaviour trees that orders may name, with their files on the robot: "
        "{ careful = '/opt/trees/careful.xml' }. Needs nav2_msgs.",
    )
    nav2: OfferSettings = Field(
        default_factory=OfferSettings,
        description="Optional features of Nav2, used if nav2_msgs is available.",
    )
    watch_period: Seconds = Field(1.0, description="Interval between checks for Nav2, seconds.")
    call_timeout: Seconds = Field(1.0, description="Timeout of ROS services, seconds.")
    stop_timeout: Seconds = Field(
        5.0, description="Time to stop the robot before the program exits, seconds."
    )

    @property
    def action(self) -> str:
        """Return the action for goals; its statuses also show goals sent by topic."""
        through = self.navigation is Navigation.THROUGH_POSES
        return self.names.through_poses if through else self.names.action

    @property
    def other_action(self) -> str:
        """Return the action that only other clients use."""
        through = self.navigation is Navigation.THROUGH_POSES
        return self.names.action if through else self.names.through_poses

    @property
    def by_action_only(self) -> bool:
        """Return whether goals are never sent by topic."""
        return self.navigation in (Navigation.ACTION, Navigation.THROUGH_POSES)


class BadAddressError(Exception):
    """The address is not valid in a ROS graph; the text says why."""


@checked(frozen=True, config=ConfigDict(strict=True))
class RosAddress:
    """A namespace with its leading slash, and a domain ID."""

    namespace: Namespace
    domain_id: DomainId

    @classmethod
    def of(cls, settings: RosSettings) -> Self:
        """Return the address that settings name."""
        return cls(settings.namespace, settings.domain_id)

    def changed(self, *, namespace: str | None = None, domain_id: int | None = None) -> RosAddress:
        """Return the address with the given parts replaced.

        Raises:
            BadAddressError: ROS does not allow such a namespace or domain.
        """
        try:
            return RosAddress(
                namespace=self.namespace if namespace is None else namespace,
                domain_id=self.domain_id if domain_id is None else domain_id,
            )
        except ValidationError as error:
            problems = (f"{problem['loc'][-1]}: {problem['msg']}" for problem in error.errors())
            raise BadAddressError("; ".join(problems)) from None

    def applied(self, settings: RosSettings) -> RosSettings:
        """Return ``settings`` with this address."""
        return settings.model_copy(update={"namespace": self.namespace, "domain_id": self.domain_id})

    def __str__(self) -> str:
        """Return the address as text."""
        return f"namespace {self.namespace}, domain {self.domain_id}"
