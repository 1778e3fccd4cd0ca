"""Settings of the ready-made actions, and of plug-ins."""

from __future__ import annotations

import math
from collections.abc import Mapping
from enum import StrEnum
from typing import Annotated, Any, Literal, Self, Union

from pydantic import Discriminator, Field, JsonValue, Tag, model_validator

from nena_edge_agent.actions.plugin import ActionTimeouts, TopicQos
from nena_edge_agent.nav2.settings import RosName
from nena_edge_agent.protocol.declaration import ALL_BLOCKING_TYPES, LoadChange, Parameter
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.action import BlockingType
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType

Seconds = Annotated[float, Field(gt=0, le=86_400, allow_inf_nan=False)]
TypeName = Annotated[str, Field(min_length=1, max_length=200)]
FieldValues = dict[str, JsonValue]
"""Fields of a message by name; ``{parameter}`` in a string stands for a value."""


class ParameterSettings(SettingsGroup):
    """A parameter of an action in orders, used in the factsheet, in checks and in messages.

    VDA 5050 3.0 section 7.10.
    """

    key: str = Field(
        pattern=r"^[A-Za-z_][A-Za-z0-9_]*$", max_length=100, description="Name of the parameter in orders."
    )
    type: ValueDataType = Field(ValueDataType.STRING, description="BOOL, NUMBER, INTEGER, STRING, ...")
    required: bool = Field(default=True, description="Refuse orders without it.")
    description: str = Field("", description="Description.")
    minimum: float | None = Field(None, description="Minimum.")
    maximum: float | None = Field(None, description="Maximum.")
    choices: tuple[JsonValue, ...] = Field((), description="Allowed values. Unset: any.")
    values: dict[str, JsonValue] = Field(
        default_factory=dict,
        description="Value in messages for each choice: { left = 1, right = 2 }.",
    )

    @property
    def declared(self) -> Parameter:
        """Return the parameter as declared to the core."""
        return Parameter(
            self.key,
            self.type,
            required=self.required,
            description=self.description,
            minimum=self.minimum,
            maximum=self.maximum,
            choices=self.choices or tuple(self.values),
        )


class OperationBase(SettingsGroup):
    """Settings of all ready-made actions."""

    kind: str = "time"
    action_type: str = Field(min_length=1, max_length=100, description="Action type in orders.")
    description: str = Field("", max_length=500, description="Description for the factsheet.")
    load: Literal["take", "give", ""] = Field(
        "", description="take: loads the robot, which must be empty; give: unloads it, which must be loaded."
    )
    charging: bool | None = Field(None, description="Charging state afterwards. Unset: unchanged.")
    scopes: tuple[ActionScope, ...] = Field(
        (ActionScope.NODE,), min_length=1, description="Scopes: NODE, EDGE, INSTANT."
    )
    blocking_types: tuple[BlockingType, ...] = Field(
        ALL_BLOCKING_TYPES, min_length=1, description="Allowed blocking types."
    )
    parameters: tuple[ParameterSettings, ...] = Field((), description="Parameters in orders.")

    @property
    def load_change(self) -> LoadChange | None:
        """Return the effect of the action on the load."""
        return LoadChange(self.load) if self.load else None


class OperationSettings(OperationBase):
    """An action that takes a fixed time: for demonstrations, and for stations that do the work themselves."""

    kind: Literal["time"] = "time"
    seconds: float = Field(5.0, ge=0, le=86_400, allow_inf_nan=False, description="Duration, seconds.")
    interruptible: bool = Field(default=True, description="Can be paused and cancelled.")


class CommandSettings(SettingsGroup):
    """A message to publish."""

    topic: RosName = Field(description="Topic, relative to the robot's namespace unless it begins with '/'.")
    type: TypeName = Field(description="Message type, such as std_msgs/msg/String.")
    fields: FieldValues = Field(default_factory=dict, description="Fields of the message.")
    on_pause: FieldValues | None = Field(None, description="Message that pauses it; needs on_resume too.")
    on_resume: FieldValues | None = Field(None, description="Message that resumes it.")
    on_cancel: FieldValues | None = Field(None, description="Message that cancels it.")
    listener_timeout: float = Field(
        5.0, ge=0, le=600, description="Time to wait for a subscriber, seconds; 0: publish without one."
    )

    @model_validator(mode="after")
    def _both_pause_and_resume(self) -> Self:
        if (self.on_pause is None) is not (self.on_resume is None):
            raise ValueError("set on_pause and on_resume together")
        return self


class CallSettings(SettingsGroup):
    """A service to call."""

    service: RosName = Field(
        description="Service, relative to the robot's namespace unless it begins with '/'."
    )
    type: TypeName = Field(description="Service type, such as std_srvs/srv/Trigger.")
    fields: FieldValues = Field(default_factory=dict, description="Fields of the request.")
    expect: FieldValues | None = Field(
        None, description="Fields of a successful response. Unset: success = true, if the type has it."
    )
    result: str | None = Field(
        None, description="Response field for the action's result. Unset: message, if the type has it."
    )
    response_timeout: Seconds = Field(30.0, description="Timeout of the service call, seconds.")


class AnswerSettings(SettingsGroup):
    """A message to wait for."""

    topic: RosName = Field(description="Topic, relative to the robot's namespace unless it begins with '/'.")
    type: TypeName = Field(description="Message type, such as std_msgs/msg/String.")
    match: FieldValues = Field(
        default_factory=dict, description="Fields to match; an array lists alternatives."
    )
    failed: FieldValues | None = Field(None, description="Fields of a message that reports failure.")
    progress: FieldValues | None = Field(None, description="Fields of a message that reports progress.")
    result: str = Field("", description="Field with the action's result, such as status.text.")
    qos: TopicQos = Field(TopicQos.RELIABLE, description="reliable, best_effort (sensors) or latched.")


class RosOperationSettings(OperationBase):
    """Settings that all actions using ROS share."""

    timeout: Seconds | None = Field(60.0, description="Timeout, seconds; pauses do not count.")
    restartable: bool = Field(
        default=False, description="May be restarted after an interruption of the agent."
    )


class TopicOperationSettings(RosOperationSettings):
    """Publishes a message and, if configured, waits for an answer on another topic."""

    kind: Literal["topic"]
    command: CommandSettings = Field(description="Message to publish.")
    answer: AnswerSettings | None = Field(
        None, description="Message that ends it. Unset: it ends when it is sent."
    )


class ServiceOperationSettings(RosOperationSettings):
    """Calls a service and, if configured, waits for a message afterwards."""

    kind: Literal["service"]
    call: CallSettings = Field(description="Service to call.")
    answer: AnswerSettings | None = Field(None, description="Message that ends it. Unset: the response.")


class Behaviour(StrEnum):
    """Actions of Nav2's servers besides driving to a goal."""

    DOCK = "dock"
    UNDOCK = "undock"
    SPIN = "spin"
    BACK_UP = "back_up"
    DRIVE_ON_HEADING = "drive_on_heading"


TIMEOUTS = {
    Behaviour.DOCK: 300.0,
    Behaviour.UNDOCK: 60.0,
    Behaviour.SPIN: 60.0,
    Behaviour.BACK_UP: 120.0,
    Behaviour.DRIVE_ON_HEADING: 120.0,
}
"""Default timeout of each, seconds.

Docking may begin with a drive through the hall, for which Nav2 itself allows 1000 s; it allows 30 s for
undocking. The others cover the default ``maximum`` at the default ``speed``.
"""


class Nav2OperationSettings(OperationBase):
    """An action of one of Nav2's own servers; needs nav2_msgs."""

    kind: Literal["nav2"]
    behavior: Behaviour = Field(description="dock, undock, spin, back_up or drive_on_heading.")
    server: RosName | None = Field(None, description="Name of the ROS action. Unset: Nav2's own.")
    blocking_types: tuple[BlockingType, ...] = Field(
        (BlockingType.SOFT, BlockingType.HARD),
        min_length=1,
        description="SOFT or HARD: the order must not drive meanwhile.",
    )
    dock_id: str = Field(
        "", max_length=200, description="Default dock; orders may name another one (dockId)."
    )
    dock_type: str = Field("", max_length=200, description="Type of the dock, if several types exist.")
    drives_to_dock: bool = Field(
        default=True, description="Whether the docking server first drives to the dock's staging pose."
    )
    speed: float = Field(0.1, gt=0, le=5, description="Speed of back_up and drive_on_heading, m/s.")
    maximum: float = Field(
        math.tau, gt=0, le=100, description="Maximum angle (rad) or distance (m) in orders."
    )
    timeout: Seconds | None = Field(
        None,
        description="Timeout, seconds. Unset: 300 (dock), 60 (undock, spin) or 120 (back_up, "
        "drive_on_heading).",
    )

    @property
    def time_limit(self) -> float:
        """Return the timeout, seconds."""
        return self.timeout or TIMEOUTS[self.behavior]

    @model_validator(mode="after")
    def _check_scope(self) -> Self:
        # Only SOFT and HARD forbid the order's own driving meanwhile (VDA 5050, 6.2.2; 2.1: 6.12).
        if self.scopes != (ActionScope.NODE,) or BlockingType.NONE in self.blocking_types:
            raise ValueError("an action that drives needs the scope NODE and the blocking type SOFT or HARD")
        return self


def _kind_of(table: Any) -> str:  # noqa: ANN401 - any value in the file
    return str(table.get("kind", "time") if isinstance(table, dict) else getattr(table, "kind", "time"))


def operation_type(kinds: Mapping[str, type[OperationBase]]) -> Any:  # noqa: ANN401 - a type for pydantic
    """Return the type of ``[[operations]]`` tables; one without ``kind`` is a timed action."""
    known = {
        "time": OperationSettings,
        "topic": TopicOperationSettings,
        "service": ServiceOperationSettings,
        "nav2": Nav2OperationSettings,
        **kinds,
    }
    tagged = tuple(Annotated[settings, Tag(kind)] for kind, settings in known.items())
    return Annotated[Union[tagged], Discriminator(_kind_of)]  # noqa: UP007 - they are known at run time only


class LoadSensorSettings(SettingsGroup):
    """A topic that reports whether the robot carries something."""

    topic: RosName = Field(description="Topic, relative to the robot's namespace unless it begins with '/'.")
    type: TypeName = Field("std_msgs/msg/Bool", description="Message type.")
    loaded: FieldValues = Field({"data": True}, description="Fields of a message that reports a load.")
    qos: TopicQos = Field(TopicQos.BEST_EFFORT, description="reliable, best_effort or latched.")


class ActionSettings(SettingsGroup):
    """Plug-ins for actions, and the agent's timeouts for them."""

    plugins: tuple[str, ...] | None = Field(
        None,
        description="Plug-ins (entry points nena.actions) to load. Unset: all installed ones.",
    )
    options: dict[str, dict[str, JsonValue]] = Field(
        default_factory=dict,
        description="Options of each plug-in: [actions.options.NAME] tables.",
    )
    without_ros: Literal["refuse", "rehearse"] = Field(
        "refuse",
        description="ROS operations on a loopback robot: refuse (not available) or rehearse (each takes a "
        "set time).",
    )
    rehearsal_seconds: float = Field(
        2.0, ge=0, le=3600, description="Duration of a rehearsed operation, seconds."
    )
    begin_timeout: Seconds = Field(10.0, description="Timeout for a plug-in to report its start, seconds.")
    obey_timeout: Seconds = Field(10.0, description="Timeout for a plug-in to pause or cancel, seconds.")
    load_sensor: LoadSensorSettings | None = Field(None, description="Load sensor.")

    @property
    def timeouts(self) -> ActionTimeouts:
        """Return the timeouts of plug-ins."""
        return ActionTimeouts(begin=self.begin_timeout, obey=self.obey_timeout)


def default_operations() -> tuple[OperationBase, ...]:
    """Return the actions of a robot that has none configured."""
    on_request = (ActionScope.NODE, ActionScope.INSTANT)
    return (
        OperationSettings(action_type="pick", seconds=5.0, load="take"),
        OperationSettings(action_type="drop", seconds=5.0, load="give"),
        # The standard has these two as instant actions as well (6.2.3; 2.1: 6.8).
        OperationSettings(action_type="startCharging", seconds=1.0, charging=True, scopes=on_request),
        OperationSettings(action_type="stopCharging", seconds=1.0, charging=False, scopes=on_request),
    )
