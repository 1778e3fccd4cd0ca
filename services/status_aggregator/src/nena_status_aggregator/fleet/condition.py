"""The condition of a robot, the reason for it, and the state of its driver."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum

from nena_shared.clock import iso
from nena_shared.fleet_api.reasons import CodedReason, ReasonCode
from nena_shared.fleet_api.stops import VehicleStop
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.vda5050.action import ActionState, ActionStatus
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.own_actions import ROS_SESSION
from nena_shared.vda5050.state import EmergencyStop, OperatingMode, State


class Condition(StrEnum):
    """Conditions in order of precedence: the first that applies is the robot's condition."""

    OFFLINE = "OFFLINE"
    """Disconnected or hibernating on purpose, or never connected."""
    BROKEN = "BROKEN"
    """CONNECTION_BROKEN (last will), and no state received since."""
    SILENT = "SILENT"
    """No state for longer than the limit."""
    MANUAL = "MANUAL"
    """Not under fleet control: MANUAL, SERVICE, TEACH_IN, STARTUP, INTERVENED."""
    ERROR = "ERROR"
    """An error of level FATAL or CRITICAL is active, the states are unreadable, or orders in a row failed."""
    BLOCKED = "BLOCKED"
    """Emergency stop, protective field, not localised or paused."""
    WAITING = "WAITING"
    """Stationary with an order, waiting for other robots, a locked path or a release."""
    BUSY = "BUSY"
    """Has an active order, is assigned to one, or is driving."""
    CHARGING = "CHARGING"
    """Charging, without an order."""
    IDLE = "IDLE"
    """Available for an order."""


TEXTS = {
    "offline": "Disconnected at {since}.",
    "hibernating": "Hibernating since {since}; responds only to a wake-up command.",
    "broken": "Connection lost at {since}.",
    "unheard": "Never connected; known only from the plant model.",
    "unheard_why": "{why}",
    "expected": "No state received yet; waiting for the first one for up to {limit} s.",
    "stateless": "No state received yet.",
    "unreadable": "Unreadable state: {problem}",
    "silent": "No state since {since} (limit: {limit} s).",
    "blind": "No state since {since}: the status aggregator is not connected to the broker.",
    "mode": "Not under fleet control (operating mode: {mode}).",
    "error": "{type}: {description}",
    "emergency_stop": "Emergency stop active; reset it {how}.",
    "field": "Protective field violated.",
    "not_localized": "Not localised; set its position.",
    "paused": "Paused.",
    "stopped": "Paused with all robots by {by}: {why}",
    "stopped_area": "Paused with this area by {by}: {why}",
    "action": "Running {action} at {place}.",
    "waits_passing": "Waits for {vehicles} to pass {at}.",
    "waits_standing": "Blocked at {at} by {vehicles}.",
    "waits_turn": "Lets {vehicles} go first at {at}.",
    "waits_locked": "Waits until path {at} is unlocked.",
    "waits_peripheral": "Waits for the device {at}.",
    "waits_other": "Order {order}: {why}.",
    "waiting_for_release": "Waiting at {place} until {next} is released.",
    "assigned": "Has order {order}.",
    "driving": "Driving to {next}.",
    "standing": "Stopped at {place} on the way to {next}.",
    "driving_free": "Driving without an order.",
    "action_waiting": "Waiting at {place} to start {action}.",
    "charging": "Battery at {charge} %.",
    "taken_out": "{why}",
    "idle": "No order.",
    "idle_why": "{why}",
}
"""English sentences by reason code; the panel translates them by code."""

WAITS = {
    WaitCause.PASSES: "waits_passing",
    WaitCause.STANDS: "waits_standing",
    WaitCause.GOES_FIRST: "waits_turn",
    WaitCause.LOCKED: "waits_locked",
}

URGENT = ("emergency_stop", "not_localized", "error", "unreadable", "taken_out")
"""Reasons that need a person at the robot now."""

COORDINATE_NODES = ("goal:", "start:")
"""Prefixes of the node IDs that NeNa's order service assigns to coordinates."""


@dataclass(frozen=True, slots=True)
class ConditionReason:
    """Why a robot is in its condition: a code, and the values of its sentence."""

    code: str
    values: dict[str, str | float] = field(default_factory=dict)
    shown: dict[str, str] = field(default_factory=dict)
    """Values that are formatted differently in the sentence."""
    coded: CodedReason | None = None
    """The order service's reason, if the sentence contains it."""

    @property
    def text(self) -> str:
        """The sentence, in English."""
        return TEXTS[self.code].format(**{**self.values, **self.shown})

    @property
    def urgent(self) -> bool:
        """Whether the robot needs a person now."""
        return self.code in URGENT


@dataclass(frozen=True, slots=True)
class ConditionInputs:
    """Everything the condition is derived from; times are only used in the sentence."""

    connection: ConnectionState | None
    connection_since: datetime
    state: State | None
    state_time: datetime
    state_after_connection: bool
    """The last state was received after the last connection message."""
    overdue: bool
    """The last state, or the first message of the robot, is older than the limit."""
    silence_limit: float
    link_up: bool
    problem: str = ""
    """The problem of the last unreadable message."""
    unreadable: str = ""
    """The problem of the last state, if it is unreadable."""
    ignored: str = ""
    """Why the states are ignored, while old ones arrive."""
    fleet_remark: str | None = None
    """The order service's reason for the vehicle's state; None if the vehicle is unknown to it."""
    coded_remark: CodedReason | None = None
    """The same as a code."""
    transport_order: str | None = None
    """Transport order to which the vehicle is assigned."""
    wait: TrafficWait | None = None
    """Vehicles that it waits for, according to the order service."""
    stop: VehicleStop | None = None
    """The stop that pauses it, according to the order service."""
    taken_out: bool = False
    """Whether the order service has taken it out of dispatching."""


Assessment = tuple[Condition, ConditionReason]


def assess_condition(inputs: ConditionInputs) -> Assessment:
    """Return the condition of a robot and the reason for it."""
    if absence := _assess_connection(inputs):
        return absence
    state = inputs.state
    if state is None:
        return _assess_stateless(inputs)
    # One late state among many is normal; only if nothing else arrives are ignored states an error.
    problem = inputs.unreadable or (inputs.ignored if inputs.overdue else "")
    if problem and inputs.link_up:
        return Condition.ERROR, ConditionReason("unreadable", {"problem": problem})
    if inputs.overdue:
        values: dict[str, str | float] = {"since": clock_text(inputs.state_time)}
        if inputs.link_up:
            values["limit"] = round(inputs.silence_limit)
        return Condition.SILENT, ConditionReason("silent" if inputs.link_up else "blind", values)
    return (
        _assess_hindrance(state, inputs.stop)
        or _assess_work(state, inputs)
        or _assess_assignment(inputs)
        or _assess_free(state, inputs)
    )


def _assess_connection(inputs: ConditionInputs) -> Assessment | None:
    match inputs.connection:
        case ConnectionState.OFFLINE:
            condition, code = Condition.OFFLINE, "offline"
        case ConnectionState.HIBERNATING:
            condition, code = Condition.OFFLINE, "hibernating"
        # A robot that sends states is connected, whatever an old last will at the broker says.
        case ConnectionState.CONNECTION_BROKEN if not inputs.state_after_connection:
            condition, code = Condition.BROKEN, "broken"
        case _:
            return None
    return condition, ConditionReason(code, {"since": clock_text(inputs.connection_since)})


def _assess_stateless(inputs: ConditionInputs) -> Assessment:
    if inputs.problem:
        return Condition.ERROR, ConditionReason("unreadable", {"problem": inputs.problem})
    coded = inputs.coded_remark
    if inputs.fleet_remark and coded and coded.code == ReasonCode.OTHER_TOPIC:
        return Condition.OFFLINE, ConditionReason("unheard_why", {"why": inputs.fleet_remark}, coded=coded)
    if inputs.connection is None and inputs.fleet_remark is not None:
        return Condition.OFFLINE, ConditionReason("unheard")
    if not inputs.overdue:
        return Condition.SILENT, ConditionReason("expected", {"limit": round(inputs.silence_limit)})
    return Condition.SILENT, ConditionReason("stateless")


def clock_text(moment: datetime) -> str:
    """Format a time for a sentence: UTC, to the second."""
    return f"{iso(moment)[11:19]} UTC"


def _assess_hindrance(state: State, stop: VehicleStop | None) -> Assessment | None:
    """Return the condition of a robot that needs a person or the end of a pause to go on."""
    if state.operating_mode not in (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC):
        return Condition.MANUAL, ConditionReason("mode", {"mode": state.operating_mode.value})
    levels = list(ErrorLevel)
    error = max(state.errors, key=lambda entry: levels.index(entry.error_level), default=None)
    # VDA 5050 3.0, 6.6.5: WARNING and URGENT do not stop the robot.
    if error and error.error_level in (ErrorLevel.FATAL, ErrorLevel.CRITICAL):
        sentences = [text for text in (error.error_description, error.error_hint) if text]
        text = " ".join(sentences) or f"no description (level {error.error_level})."
        return Condition.ERROR, ConditionReason("error", {"type": error.error_type, "description": text})
    return _assess_blocked(state, stop)


def _assess_blocked(state: State, stop: VehicleStop | None) -> Assessment | None:
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        by_hand = state.safety_state.active_emergency_stop is EmergencyStop.MANUAL
        return Condition.BLOCKED, ConditionReason(
            "emergency_stop", {"how": "at the robot" if by_hand else "remotely"}
        )
    if state.safety_state.field_violation:
        return Condition.BLOCKED, ConditionReason("field")
    if state.mobile_robot_position and not state.mobile_robot_position.localized:
        return Condition.BLOCKED, ConditionReason("not_localized")
    if state.paused and stop:
        code = "stopped_area" if stop.area else "stopped"
        return Condition.BLOCKED, ConditionReason(code, {"by": stop.by, "why": stop.reason})
    if state.paused:
        return Condition.BLOCKED, ConditionReason("paused")
    return None


def _assess_work(state: State, inputs: ConditionInputs) -> Assessment | None:
    action = _open_action(state.action_states) or _open_action(state.instant_action_states)
    if state.node_states or state.edge_states:
        reason = _route_reason(state, action)
        if reason.code != "waiting_for_release":
            return Condition.BUSY, reason
        return Condition.WAITING, _wait_reason(inputs) or reason
    if action:
        return Condition.BUSY, _action_reason(state, action)
    if state.driving:
        return Condition.BUSY, ConditionReason("driving_free")
    return None


def _assess_assignment(inputs: ConditionInputs) -> Assessment | None:
    """Return the condition of a stationary robot that is assigned to an order."""
    if waits := _wait_reason(inputs):
        return Condition.WAITING, waits
    # While it charges, an assigned order, such as one to recharge, does not make it BUSY.
    charging = inputs.state is not None and inputs.state.power_supply.charging
    if inputs.transport_order is None or charging:
        return None
    return Condition.BUSY, ConditionReason("assigned", {"order": inputs.transport_order})


def _wait_reason(inputs: ConditionInputs) -> ConditionReason | None:
    wait = inputs.wait
    if wait is None:
        return None
    if wait.cause and wait.at:
        return ConditionReason(WAITS[wait.cause], {"vehicles": ", ".join(wait.vehicles), "at": wait.at})
    if wait.at and not wait.vehicles:
        return ConditionReason("waits_peripheral", {"at": wait.at})
    if inputs.transport_order is None:
        return None
    values: dict[str, str | float] = {"order": inputs.transport_order, "why": wait.reason}
    return ConditionReason("waits_other", values, coded=wait.coded_reason)


def _assess_free(state: State, inputs: ConditionInputs) -> Assessment:
    remark, coded = inputs.fleet_remark, inputs.coded_remark
    if inputs.taken_out and remark:
        return Condition.ERROR, ConditionReason("taken_out", {"why": remark}, coded=coded)
    if state.power_supply.charging:
        charge = round(state.power_supply.state_of_charge)
        return Condition.CHARGING, ConditionReason("charging", {"charge": charge})
    if remark:
        return Condition.IDLE, ConditionReason("idle_why", {"why": remark}, coded=coded)
    return Condition.IDLE, ConditionReason("idle")


def _route_reason(state: State, action: ActionState | None) -> ConditionReason:
    upcoming = state.node_states[0] if state.node_states else None
    target: dict[str, str | float] = {
        "place": state.last_node_id or "?",
        "next": upcoming.node_id if upcoming else "?",
    }
    shown: dict[str, str] = {}
    if upcoming:
        at = upcoming.node_position
        # The IDs of coordinate nodes hold an order's name and mean nothing to a reader.
        is_coordinate = at and upcoming.node_id.startswith(COORDINATE_NODES)
        shown["next"] = f"x {at.x:.2f}, y {at.y:.2f}" if at and is_coordinate else upcoming.node_id
    if state.driving:
        return ConditionReason("driving", target, shown)
    if action and action.action_status is not ActionStatus.WAITING:
        return _action_reason(state, action)
    if upcoming and not upcoming.released:
        return ConditionReason("waiting_for_release", target, shown)
    return ConditionReason("standing", target, shown)


def _action_reason(state: State, action: ActionState) -> ConditionReason:
    waiting = action.action_status is ActionStatus.WAITING
    name = action.action_type or action.action_id
    return ConditionReason(
        "action_waiting" if waiting else "action", {"action": name, "place": state.last_node_id or "?"}
    )


def _open_action(actions: tuple[ActionState, ...]) -> ActionState | None:
    """Return the action in progress, else the first waiting one."""
    still_open = [action for action in actions if not action.action_status.ended]
    started = (action for action in still_open if action.action_status is not ActionStatus.WAITING)
    return next(started, still_open[0] if still_open else None)


class SessionState(StrEnum):
    """State of a robot's agent and its driver."""

    NOT_ACTIVE = "NOT_ACTIVE"
    """Disconnected, hibernating or never connected."""
    INITIATING = "INITIATING"
    """Connected; no state received yet."""
    ACTIVE = "ACTIVE"
    """Sends states, and navigation is available."""
    TERMINATING = "TERMINATING"
    """Disconnecting from ROS."""
    FAILED = "FAILED"
    """Connection broken or silent, or navigation is not available."""


def session_of(condition: Condition, state: State | None) -> SessionState:
    """Return the state of a robot's driver from its condition and last state."""
    if condition is Condition.OFFLINE:
        return SessionState.NOT_ACTIVE
    if condition is Condition.BROKEN:
        return SessionState.FAILED
    if state is None:
        return SessionState.INITIATING
    if condition is Condition.SILENT:
        return SessionState.FAILED
    session = ros_session(state)
    if session:
        return session.state
    blind = any(error.error_type == ErrorType.NAVIGATION_NOT_AVAILABLE for error in state.errors)
    return SessionState.FAILED if blind else SessionState.ACTIVE


@dataclass(frozen=True, slots=True)
class RosSession:
    """The ROS session that an edge agent reports."""

    state: SessionState
    namespace: str
    domain_id: str


def ros_session(state: State) -> RosSession | None:
    """Return the ROS session in a state's information, for display only."""
    for entry in state.information or ():
        if entry.info_type == ROS_SESSION:
            facts = {
                reference.reference_key: reference.reference_value for reference in entry.info_references
            }
            name = facts.get("state", "")
            if name in SessionState.__members__:
                return RosSession(SessionState(name), facts.get("namespace", ""), facts.get("domainId", ""))
    return None
