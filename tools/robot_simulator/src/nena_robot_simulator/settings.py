"""Settings of the simulator: the hall and its robots."""

from __future__ import annotations

import re
from collections import Counter
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from nena_robot_simulator.faults import Fault
from nena_robot_simulator.sensors import Scale
from nena_shared.settings import ProgramSettings, SettingsGroup

LAST_DOMAIN = 232
"""Highest ROS domain ID; above it Fast DDS ends the process."""
_NAMESPACE = re.compile(r"(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?")


def _ros_namespace(namespace: str) -> str:
    if not _NAMESPACE.fullmatch(namespace):
        raise ValueError(
            "a ROS namespace consists of letters, digits and underscores, with '/' between parts "
            "that do not start with a digit, e.g. r1 or hall_2/r1"
        )
    return namespace.removeprefix("/")


Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Namespace = Annotated[str, Field(max_length=200), AfterValidator(_ros_namespace)]


class StartPose(SettingsGroup):
    """Start pose of a robot, in the map frame."""

    x: Finite = Field(0.0, description="x, m.")
    y: Finite = Field(0.0, description="x, m.")
    yaw: Finite = Field(0.0, description="Heading, rad, counter-clockwise from the x axis.")


class DriveSettings(SettingsGroup):
    """Limits of a robot's drive."""

    speed: Positive = Field(1.0, description="Maximum speed, m/s.")
    acceleration: Positive = Field(1.0, description="Maximum acceleration and deceleration, m/s².")
    yaw_rate: Positive = Field(1.5, description="Maximum yaw rate, rad/s.")
    yaw_acceleration: Positive = Field(3.0, description="Maximum yaw acceleration, rad/s².")
    approach: float = Field(
        0.0,
        ge=0,
        le=10,
        description="Distance to the goal at which the robot starts to slow down, metres; "
        "0.6 with Nav2's Regulated Pure Pursuit. 0: brakes as late as possible.",
    )
    deceleration: Positive | None = Field(
        None,
        description="Deceleration that the base reaches, m/s². Unset: that of 'acceleration', on which the "
        "controller counts; below it, the robot rolls past its goals.",
    )
    # Measured: the base stood 0.7 s after all servers had been killed.
    command_timeout: float = Field(
        0.7,
        ge=0,
        description="Time for which the base obeys the last command of a controller that has died or hangs, "
        "seconds. 0: for ever.",
    )


class ToleranceSettings(SettingsGroup):
    """Tolerances of Nav2's goal checker and planner."""

    xy: Positive = Field(0.25, description="Distance from the end of the path at which it is reached, m.")
    yaw: Positive = Field(0.25, description="Deviation from the goal's heading at which it is reached, rad.")
    planner: Positive = Field(0.5, description="Distance from an occupied goal at which a path may end, m.")


class BatterySettings(SettingsGroup):
    """A robot's battery."""

    charge: Share = Field(1.0, description="Initial state of charge, 0 to 1.")
    drain_per_km: float = Field(0.05, ge=0, description="Charge used per kilometre, 0 to 1.")
    drain_per_hour: float = Field(0.02, ge=0, description="Charge used per hour, 0 to 1.")
    scale: Scale = Field("fraction", description="Scale of the published percentage: 0 to 1, or 0 to 100.")


class LocalisationSettings(SettingsGroup):
    """Localisation of a robot."""

    known_at_start: bool = Field(
        default=True,
        description="Localised at start. False: no estimates until an initial pose.",
    )
    pose_topic: bool = Field(
        default=True,
        description="Publish amcl_pose. False: only transforms, as SLAM and other localisers do.",
    )
    xy_deviation: float = Field(0.02, ge=0, description="Standard deviation of the estimated position, m.")
    yaw_deviation: float = Field(0.01, ge=0, description="Standard deviation of the estimated heading, rad.")


class RobotSettings(SettingsGroup):
    """One robot."""

    name: str = Field("robot1", min_length=1, max_length=100, description="Name in the log.")
    namespace: Namespace = Field("", description="ROS namespace. Empty: none.")
    domain_id: int = Field(0, ge=0, le=232, description="ROS domain ID.")
    start: StartPose = Field(default_factory=StartPose, description="Start pose.")
    drive: DriveSettings = Field(default_factory=DriveSettings, description="Limits of the drive.")
    tolerance: ToleranceSettings = Field(
        default_factory=ToleranceSettings, description="Tolerances of Nav2, also served as its parameters."
    )
    battery: BatterySettings = Field(default_factory=BatterySettings, description="Battery.")
    localisation: LocalisationSettings = Field(
        default_factory=LocalisationSettings, description="Localisation."
    )
    footprint: str = Field(
        "[[0.4, 0.3], [-0.4, 0.3], [-0.4, -0.3], [0.4, -0.3]]",
        description="Parameter footprint of the local costmap: corners, m. Empty: none.",
    )
    filter_info_topic: str | None = Field(
        None,
        description="Topic of the costmaps' keep-out filter. Without a leading '/' it is in the namespace of "
        "the costmap, as in Nav2: global_costmap/NAME. Unset: zone_filter_info in the robot's namespace.",
    )
    docks: tuple[str, ...] = Field(("dock",), description="Docks that the docking server knows, by name.")
    map_frame: str = Field("map", min_length=1, description="Frame of map, goals and pose estimates.")
    odom_frame: str = Field("odom", min_length=1, description="Frame of the odometry.")
    base_frame: str = Field("base_link", min_length=1, description="Frame of the robot.")
    faults: tuple[Fault, ...] = Field((), description="Faults of this robot at start.")


class MapSettings(SettingsGroup):
    """The hall."""

    min_x: Finite = Field(-20.0, description="Left inner wall, m.")
    min_y: Finite = Field(-20.0, description="Lower inner wall, m.")
    max_x: Finite = Field(60.0, description="Right inner wall, m.")
    max_y: Finite = Field(40.0, description="Upper inner wall, m.")
    resolution: Annotated[float, Field(ge=0.02, le=1.0)] = Field(0.1, description="Cell size, m.")

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        width, height = self.max_x - self.min_x, self.max_y - self.min_y
        if not (0 < width <= 1000 and 0 < height <= 1000):  # noqa: PLR2004 - named in the message
            raise ValueError("width and height of the hall must be above 0 m and at most 1000 m")
        return self


def _start_beside(start: StartPose, index: int) -> StartPose:
    return start.model_copy(update={"y": start.y + index})


def one_robot() -> tuple[RobotSettings, ...]:
    """Return the default: one robot."""
    return (RobotSettings(),)


class SimulatorSettings(ProgramSettings):
    """The simulator."""

    robots: tuple[RobotSettings, ...] = Field(
        default_factory=one_robot, description="Robots, as [[robots]] tables of the configuration file."
    )
    copies: int = Field(
        1,
        ge=1,
        le=200,
        description="Number of copies of the only robot in 'robots', each in its own namespace.",
    )
    separate_domains: bool = Field(
        default=False,
        description="Use a separate ROS domain per copy instead of a namespace; cheaper for many robots.",
    )
    map: MapSettings = Field(default_factory=MapSettings, description="The hall.")
    time_factor: float = Field(
        1.0,
        gt=0,
        le=100,
        description="Factor by which robots move faster than real time; Nav2's delays are unchanged.",
    )
    # Nav2's action_server_result_timeout; rcl's own default is 10 s.
    result_timeout: float = Field(
        900.0, gt=0, description="Time that an ended goal stays in the status array, seconds."
    )
    replan_period: float = Field(
        0.0,
        ge=0,
        le=60,
        description="Period of replanning, seconds; 1.0 in Nav2's default behaviour tree (3 times as long "
        "through poses). A new goal follows the old path until then. 0: replan at once.",
    )
    recovery_time: float = Field(
        0.0,
        ge=0,
        le=600,
        description="Time in which a robot without a path spins, waits and backs up before its goal is "
        "aborted, seconds; 17 to 21 with Nav2's default behaviour tree. 0: at once.",
    )
    # Nav2's default, with which a loaded computer aborts good drives (measured).
    server_timeout: float = Field(
        0.02,
        gt=0,
        le=60,
        description="Time for which bt_navigator waits for an answer of its servers, seconds "
        "(default_server_timeout).",
    )
    actions: bool = Field(
        default=True,
        description="Also serve Nav2's actions, if their types are installed.",
    )
    faults: tuple[Fault, ...] = Field((), description="Faults of every robot at start.")

    @model_validator(mode="after")
    def _copies_fit(self) -> Self:
        if self.copies > 1 and len(self.robots) != 1:
            raise ValueError(
                "copies need exactly one robot; without copies, define each robot in a [[robots]] table"
            )
        if self.separate_domains and self.robots and self.robots[0].domain_id + self.copies - 1 > LAST_DOMAIN:
            raise ValueError(
                f"{self.copies} copies from domain ID {self.robots[0].domain_id} exceed {LAST_DOMAIN}"
            )
        return self

    @property
    def all_robots(self) -> tuple[RobotSettings, ...]:
        """All robots, including copies."""
        if self.copies == 1:
            return self.robots
        return tuple(self._copy_robot(self.robots[0], index) for index in range(self.copies))

    def _copy_robot(self, robot: RobotSettings, index: int) -> RobotSettings:
        """Return a copy, one metre beside the previous one."""
        place = {"name": f"{robot.name}-{index + 1}", "start": _start_beside(robot.start, index)}
        if self.separate_domains:
            return robot.model_copy(update={**place, "domain_id": robot.domain_id + index})
        # Not the number alone: a part of a namespace must not begin with a digit.
        return robot.model_copy(update={**place, "namespace": f"{robot.namespace or 'r'}{index + 1}"})

    @model_validator(mode="after")
    def _robots_differ(self) -> Self:
        if not self.robots:
            raise ValueError("robots is empty; omit it to simulate one robot with default settings")
        names = Counter(robot.name for robot in self.robots)
        places = Counter((robot.domain_id, robot.namespace) for robot in self.robots)
        for name in (name for name, count in names.items() if count > 1):
            raise ValueError(f"duplicate robot name '{name}'; use unique names")
        for domain_id, namespace in (place for place, count in places.items() if count > 1):
            raise ValueError(
                f"two robots share domain {domain_id} and namespace '{namespace}'; "
                "use a different namespace or domain_id for each"
            )
        return self
