"""Settings of the edge agent."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import GenericAlias
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self

from pydantic import AfterValidator, Field, create_model, model_validator

from nena_edge_agent.actions.settings import (
    ActionSettings,
    OperationBase,
    default_operations,
    operation_type,
)
from nena_edge_agent.download import DownloadSettings
from nena_edge_agent.loopback.settings import LoopbackSettings
from nena_edge_agent.nav2.settings import Navigation, RosSettings
from nena_edge_agent.power import PowerSettings
from nena_edge_agent.protocol.capabilities import TOLERABLE, DriveStrategy, ExternalGoals, LinkLossPolicy
from nena_shared.plant.geometry import parse_transform
from nena_shared.settings import ServiceSettings, SettingsGroup, TopicPrefix
from nena_shared.vda5050.versions import CODECS, UnknownVersionError, codec_for


def _topic_level(level: str) -> str:
    # VDA 5050 (4.2; 2.1: 6.3): no '/' in a level, and none of the signs that MQTT gives a meaning.
    if any(sign in level for sign in "/+#$") or not level.isprintable():
        raise ValueError("a topic level must not contain '/', '+', '#', '$' or unprintable characters")
    return level


def _optional_field(name: str) -> str:
    if name not in TOLERABLE:
        raise ValueError(f"{name!r} is not one of {', '.join(sorted(TOLERABLE))}")
    return name


def _supported_version(version: str) -> str:
    try:
        return codec_for(version).version
    except UnknownVersionError as error:
        raise ValueError(str(error)) from None


def _check_transform(text: str) -> str:
    parse_transform(text)
    return text


TransformText = Annotated[str, AfterValidator(_check_transform)]
SupportedVersion = Annotated[str, AfterValidator(_supported_version)]
OptionalField = Annotated[str, AfterValidator(_optional_field)]
TopicLevel = Annotated[str, Field(min_length=1, max_length=100), AfterValidator(_topic_level)]
Metres = Annotated[float, Field(gt=0, le=1000, allow_inf_nan=False)]
Seconds = Annotated[float, Field(gt=0, le=3600, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]


class DriveSettings(SettingsGroup):
    """How the robot drives along an order."""

    strategy: DriveStrategy = Field(
        DriveStrategy.STOP_AT_NODES,
        description="stop_at_nodes: stops at each node; pass_through: passes nodes that need no stop.",
    )
    pass_radius: Metres = Field(
        0.5, description="Maximum distance from a passed node at which the next goal is sent, metres."
    )
    # The standard takes a missing deviation as 0, as precisely as the robot can (7.3). Measured: Nav2
    # succeeds 0.12 to 0.28 m off (1.3.13, default tolerance).
    deviation_xy: Metres = Field(
        0.3, description="Allowed deviation from a node without allowedDeviationXY, metres."
    )
    deviation_theta: float = Field(
        0.3,
        gt=0,
        le=3.15,
        description="Allowed deviation from a theta without allowedDeviationTheta, radians.",
    )
    base_request_distance: NotNegative = Field(
        2.0, description="Distance to the end of the base at which a new base is requested, metres."
    )
    external_goals: ExternalGoals = Field(
        ExternalGoals.PAUSE,
        description="What happens to an order while navigation is driving to another program's goal (RViz, a "
        "docking server): pause: it waits and continues when that goal has ended; fail: its drive fails.",
    )
    # The default is the standard's rule: drive to the last released node (4.1; 2.1: 6.2).
    link_loss: LinkLossPolicy = Field(
        LinkLossPolicy.ASSERTIVE,
        description="What the robot does without its broker: assertive: drives its base to the end; "
        "preventive_at_once: stops where it is; preventive_next_node: stops at the next node.",
    )
    link_loss_patience: Seconds = Field(
        10.0, description="Time without the broker after which a preventive robot stops, seconds."
    )
    retries: int = Field(
        0,
        ge=0,
        le=100,
        description="Retries of a failed drive before it is reported; at least 3 if Nav2 has ended it for a "
        "reason that passes, such as its restart.",
    )
    retry_wait: Seconds = Field(5.0, description="Delay before each retry, seconds.")


class IntervalSettings(SettingsGroup):
    """Message intervals, in seconds."""

    state_minimum: Seconds = Field(0.1, description="Minimum state interval, seconds.")
    # The standard's limit: a state at least every 30 s (6.6.1; 2.1: 6.10.1).
    state_maximum: float = Field(30.0, gt=0, le=30, description="Maximum state interval, seconds.")
    visualization: float = Field(
        1.0, ge=0, le=3600, description="Interval of visualization messages, seconds; 0: none."
    )

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.state_minimum > self.state_maximum:
            raise ValueError("state_minimum is longer than state_maximum")
        return self


class JournalSettings(SettingsGroup):
    """The journal, by which orders and actions survive a restart."""

    enabled: bool = Field(default=True, description="Keep a journal; without it no order survives a restart.")
    folder: Path = Field(
        Path("~/.local/state/nena/edge_agent"), description="Folder with one file per robot."
    )


class MetricsSettings(SettingsGroup):
    """Metrics for Prometheus, on a port of the robot."""

    host: str = Field(
        "127.0.0.1",
        description="Address of the metrics server. It has no login: beyond loopback, restrict access to "
        "Prometheus by a firewall.",
    )
    port: int = Field(0, ge=0, le=65535, description="TCP port of the metrics; 0: none are served.")


class DescriptionSettings(SettingsGroup):
    """The robot in its factsheet: m, m/s, rad/s, m/s², kg."""

    series_name: str = Field("NeNa", description="Series name.")
    robot_class: str = Field("CARRIER", description="FORKLIFT, CONVEYOR, TUGGER, CARRIER, ...")
    kinematics: str = Field("DIFFERENTIAL", description="DIFFERENTIAL, OMNIDIRECTIONAL or THREE_WHEEL.")
    localization_types: tuple[str, ...] = Field(("NATURAL",), description="Localisation types.")
    maximum_load_mass: NotNegative = Field(50.0, description="kg")
    maximum_speed: NotNegative = Field(1.0, description="m/s")
    maximum_angular_speed: NotNegative = Field(1.5, description="rad/s")
    maximum_acceleration: NotNegative = Field(1.0, description="m/s²")
    maximum_deceleration: NotNegative = Field(1.0, description="m/s²")
    length: NotNegative = Field(0.8, description="m")
    width: NotNegative = Field(0.6, description="m")
    height: NotNegative = Field(0.5, description="m")


OPERATIONS = (
    "Ready-made actions: [[operations]] tables, each of a kind: time, topic, service, nav2, or one of an "
    "extension: signal, charge, turn_signal, dock."
)
if TYPE_CHECKING:
    Operations = tuple[OperationBase, ...]
else:
    Operations = tuple[operation_type({}), ...]


class EdgeAgentSettings(ServiceSettings):
    """The edge agent."""

    manufacturer: TopicLevel = Field("NeNa", description="Manufacturer; a level of the robot's topics.")
    serial_number: TopicLevel = Field("robot1", description="Serial number; a level of the robot's topics.")
    version: SupportedVersion = Field(
        "2.1.0", description=f"VDA 5050 version of the robot: {', '.join(CODECS)}."
    )
    interface_name: TopicPrefix | None = Field(
        None,
        description="First levels of all topics. Unset: uagv or vda5050, by the version.",
    )
    # 0026: not below the robot's own topics, because some fleet controls fail at unknown messages there.
    topic_prefix: TopicPrefix = Field(
        "nena/v1",
        description="Prefix of NeNa's own topics, as in the services; also of the robot's map.",
    )
    # With the standard's 0 (4.1; 2.1: 6.2), the next state after a lost one may take 30 s.
    # no Literal: the command line and the environment give texts
    qos: int = Field(
        1,
        ge=0,
        le=1,
        description="MQTT QoS of state, factsheet and subscriptions; the standard uses "
        "0. connection always uses 1.",
    )
    map_id: str = Field("map", min_length=1, max_length=200, description="Map that the robot drives on.")
    map_version: str = Field("1", description="Version of that map, for the state.")
    # 0019: one side transforms for each robot; this one, if its factsheet lists nena:showMapTransforms.
    map_transforms: dict[str, TransformText] = Field(
        default_factory=dict,
        description="Transforms from the plant to the robot's maps, by map ID: "
        "'scale=1 rotation=90 x=5 y=-1' (degrees counter-clockwise, metres of the map). The robot then uses "
        "the plant's frame, and fleet control must not transform; NeNa's does not.",
    )
    driver: Literal["nav2", "loopback"] = Field(
        "nav2", description="nav2: a robot with ROS 2 and Nav2; loopback: a simulated robot without ROS."
    )
    # Empty by default: a robot must not ignore what the standard defines (7.1.1; 2.1: 6.1.1).
    tolerated_parameters: tuple[OptionalField, ...] = Field(
        (),
        description="Optional order fields to ignore instead of refusing the order: edges.trajectory, ...",
    )
    strict: bool = Field(
        default=False,
        description="Refuse messages that violate the standard even if "
        "their meaning is clear, such as a number written as text.",
    )
    drive: DriveSettings = Field(default_factory=DriveSettings, description="Driving.")
    interval: IntervalSettings = Field(default_factory=IntervalSettings, description="Message intervals.")
    journal: JournalSettings = Field(default_factory=JournalSettings, description="Journal on disk.")
    description: DescriptionSettings = Field(
        default_factory=DescriptionSettings, description="The robot, for the factsheet."
    )
    download: DownloadSettings = Field(
        default_factory=DownloadSettings, description="Download of maps and zone sets."
    )
    metrics: MetricsSettings = Field(
        default_factory=MetricsSettings, description="Metrics for Prometheus; needs the extra `metrics`."
    )
    power: PowerSettings = Field(
        default_factory=PowerSettings, description="Hibernation and shutdown, with VDA 5050 3.0."
    )
    operations: Operations = Field(default_factory=default_operations, description=OPERATIONS)
    actions: ActionSettings = Field(
        default_factory=ActionSettings, description="Action plug-ins, and settings of all actions."
    )
    loopback: LoopbackSettings = Field(default_factory=LoopbackSettings, description="Loopback robots.")
    ros: RosSettings = Field(default_factory=RosSettings, description="The robot's ROS 2 side.")

    @property
    def drives_ahead(self) -> bool:
        """Return whether the driver passes several nodes with one goal."""
        return self.driver == "nav2" and self.ros.navigation is Navigation.THROUGH_POSES

    @property
    def power_actions(self) -> frozenset[str]:
        """Return the actions of hibernation and shutdown that the robot offers, if its version has them."""
        return self.power.offered(simulated=self.driver == "loopback" and self.loopback.power)

    @property
    def serial_numbers(self) -> tuple[str, ...]:
        """Return the robots of this program: one, or the numbered ones of a loopback fleet."""
        count = self.loopback.count if self.driver == "loopback" else 1
        if count == 1:
            return (self.serial_number,)
        return tuple(f"{self.serial_number}-{number}" for number in range(1, count + 1))


def with_kinds(
    model: type[EdgeAgentSettings], kinds: Mapping[str, type[OperationBase]]
) -> type[EdgeAgentSettings]:
    """Return the settings with further kinds of ``operations``."""
    operations: Any = (
        GenericAlias(tuple, (operation_type(kinds), ...)),
        Field(default_factory=default_operations, description=OPERATIONS),
    )
    return create_model(model.__name__, __base__=model, __doc__=model.__doc__, operations=operations)
