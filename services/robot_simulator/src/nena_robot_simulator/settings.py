"""Settings of the simulator: the place, and the robots in it."""

from __future__ import annotations

import re
from collections import Counter
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from nena_robot_simulator.faults import Fault
from nena_robot_simulator.sensors import Scale
from nena_shared.settings import ProgramSettings, SettingsGroup

LAST_DOMAIN = 232
"""Above it Fast DDS ends the process."""
_NAMESPACE = re.compile(r"(/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*)?")


def _ros_namespace(namespace: str) -> str:
    if not _NAMESPACE.fullmatch(namespace):
        message = (
            "a ROS namespace is made of letters, digits and underscores, with '/' between its parts, "
            "and no part starts with a digit: r1 or hall_2/r1"
        )
        raise ValueError(message)
    return namespace.removeprefix("/")


Finite = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
Share = Annotated[float, Field(ge=0, le=1)]
Namespace = Annotated[str, Field(max_length=200), AfterValidator(_ros_namespace)]


class StartPose(SettingsGroup):
    """Where a robot stands at first, in the map frame."""

    x: Finite = Field(0.0, description="Metres.")
    y: Finite = Field(0.0, description="Metres.")
    yaw: Finite = Field(0.0, description="Radians, counter-clockwise from the x axis.")


class DriveSettings(SettingsGroup):
    """What a robot's drive can do."""

    speed: Positive = Field(1.0, description="Highest speed, m/s.")
    acceleration: Positive = Field(1.0, description="Acceleration and braking, m/s².")
    yaw_rate: Positive = Field(1.5, description="Highest turning rate, rad/s.")
    yaw_acceleration: Positive = Field(3.0, description="Acceleration of turning, rad/s².")


class BatterySettings(SettingsGroup):
    """A robot's battery."""

    charge: Share = Field(1.0, description="State of charge at the start, 0 to 1.")
    drain_per_km: float = Field(0.05, ge=0, description="Charge that a kilometre of driving takes, 0 to 1.")
    drain_per_hour: float = Field(0.02, ge=0, description="Charge that an hour takes anyway, 0 to 1.")
    scale: Scale = Field("fraction", description="Send the percentage as 0 to 1, or as 0 to 100.")


class LocalisationSettings(SettingsGroup):
    """How well a robot knows where it is."""

    known_at_start: bool = Field(default=True, description="False: silent until an initial pose comes.")
    xy_deviation: float = Field(0.02, ge=0, description="Standard deviation of the estimated place, m.")
    yaw_deviation: float = Field(0.01, ge=0, description="Standard deviation of the heading, rad.")


class RobotSettings(SettingsGroup):
    """One robot."""

    name: str = Field("robot1", min_length=1, max_length=100, description="Name in the log.")
    namespace: Namespace = Field("", description="ROS namespace; empty: none.")
    domain_id: int = Field(0, ge=0, le=232, description="ROS domain id.")
    start: StartPose = Field(default_factory=StartPose, description="Where it stands at first.")
    drive: DriveSettings = Field(default_factory=DriveSettings, description="What the drive can do.")
    battery: BatterySettings = Field(default_factory=BatterySettings, description="The battery.")
    localisation: LocalisationSettings = Field(
        default_factory=LocalisationSettings, description="How well it knows where it is."
    )
    map_frame: str = Field("map", min_length=1, description="Frame of map, goals and estimates.")
    odom_frame: str = Field("odom", min_length=1, description="Frame of the odometry.")
    base_frame: str = Field("base_link", min_length=1, description="Frame of the robot itself.")
    faults: tuple[Fault, ...] = Field((), description="Faults of this robot from the start.")


class MapSettings(SettingsGroup):
    """The hall that the robots drive in."""

    min_x: Finite = Field(-20.0, description="Left inner wall, m.")
    min_y: Finite = Field(-20.0, description="Lower inner wall, m.")
    max_x: Finite = Field(60.0, description="Right inner wall, m.")
    max_y: Finite = Field(40.0, description="Upper inner wall, m.")
    resolution: Annotated[float, Field(ge=0.02, le=1.0)] = Field(0.1, description="Size of a cell, m.")

    @model_validator(mode="after")
    def _has_room(self) -> Self:
        width, height = self.max_x - self.min_x, self.max_y - self.min_y
        if not (0 < width <= 1000 and 0 < height <= 1000):  # noqa: PLR2004 - said in the message
            message = "the hall must be wider and higher than 0 m, and at most 1000 m"
            raise ValueError(message)
        return self


def _beside(start: StartPose, index: int) -> StartPose:
    return start.model_copy(update={"y": start.y + index})


def one_robot() -> tuple[RobotSettings, ...]:
    """Give the robots of a simulator that was told of none."""
    return (RobotSettings(),)


class SimulatorSettings(ProgramSettings):
    """The simulator."""

    robots: tuple[RobotSettings, ...] = Field(
        default_factory=one_robot, description="The robots: [[robots]] tables of the file."
    )
    copies: int = Field(
        1,
        ge=1,
        le=200,
        description="How many robots to make of the only one of 'robots', each in a namespace of its own.",
    )
    separate_domains: bool = Field(
        default=False, description="Give each copy the next domain id instead; it costs less for many robots."
    )
    map: MapSettings = Field(default_factory=MapSettings, description="The hall that the robots drive in.")
    time_factor: float = Field(
        1.0,
        gt=0,
        le=100,
        description="How much faster than life robots move; Nav2's delays stay as they are.",
    )
    result_timeout: float = Field(
        900.0, gt=0, description="Seconds that an ended goal stays in the status array."
    )
    replan_period: float = Field(
        0.0,
        ge=0,
        le=60,
        description="Seconds between two plans of the behaviour tree, 1.0 in Nav2's default tree (3 times as "
        "long through poses): until the next one a new goal leads along the old path. 0: planned at once.",
    )
    actions: bool = Field(
        default=True,
        description="Serve Nav2's actions too, where this machine has their types.",
    )
    faults: tuple[Fault, ...] = Field((), description="Faults of every robot from the start.")

    @model_validator(mode="after")
    def _copies_fit(self) -> Self:
        if self.copies > 1 and len(self.robots) != 1:
            message = "copies are made of one robot; name each robot in a [[robots]] table instead"
            raise ValueError(message)
        if self.separate_domains and self.robots and self.robots[0].domain_id + self.copies - 1 > LAST_DOMAIN:
            message = f"there are no {self.copies} domain ids from {self.robots[0].domain_id} on"
            raise ValueError(message)
        return self

    @property
    def all_robots(self) -> tuple[RobotSettings, ...]:
        """The robots, copies and all."""
        if self.copies == 1:
            return self.robots
        return tuple(self._copy(self.robots[0], index) for index in range(self.copies))

    def _copy(self, robot: RobotSettings, index: int) -> RobotSettings:
        """Make a robot of the row, a metre beside the one before it."""
        place = {"name": f"{robot.name}-{index + 1}", "start": _beside(robot.start, index)}
        if self.separate_domains:
            return robot.model_copy(update={**place, "domain_id": robot.domain_id + index})
        return robot.model_copy(update={**place, "namespace": f"{robot.namespace or 'r'}{index + 1}"})

    @model_validator(mode="after")
    def _robots_differ(self) -> Self:
        if not self.robots:
            message = "there is no robot to simulate; leave the setting out for one with default settings"
            raise ValueError(message)
        names = Counter(robot.name for robot in self.robots)
        places = Counter((robot.domain_id, robot.namespace) for robot in self.robots)
        for name in (name for name, count in names.items() if count > 1):
            message = f"two robots are called '{name}'; give each robot a name of its own"
            raise ValueError(message)
        for domain_id, namespace in (place for place, count in places.items() if count > 1):
            message = (
                f"two robots share domain {domain_id} and namespace '{namespace}'; "
                "give each one a namespace or a domain_id of its own"
            )
            raise ValueError(message)
        return self
