"""What a robot is up to, in one word and in a sentence that says why."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from enum import StrEnum

from nena_shared.clock import iso
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.brief.state import ActionBrief, ErrorBrief, StateBrief
from nena_shared.vda5050.connection import ConnectionState
from nena_shared.vda5050.error import ErrorLevel, ErrorType
from nena_shared.vda5050.own_actions import ROS_SESSION
from nena_shared.vda5050.state import EmergencyStop, OperatingMode


class Condition(StrEnum):
    """The conditions, in the order in which they are judged: the first that holds is the robot's."""

    OFFLINE = "OFFLINE"
    """It has logged off, or sleeps, on purpose, or was never switched on."""
    BROKEN = "BROKEN"
    """The broker has lost it, and no state has come since."""
    SILENT = "SILENT"
    """It should send states, but has not for too long."""
    MANUAL = "MANUAL"
    """Fleet control is not in control: MANUAL, SERVICE, TEACH_IN, STARTUP, INTERVENED."""
    ERROR = "ERROR"
    """It reports an error that stops its order or needs a person."""
    BLOCKED = "BLOCKED"
    """It is held: emergency stop, protective field, lost localisation, pause."""
    BUSY = "BUSY"
    """It has an order or drives."""
    CHARGING = "CHARGING"
    """It charges and has nothing else to do."""
    IDLE = "IDLE"
    """It could take an order."""


TEXTS = {
    "offline": "Logged off at {since}.",
    "hibernating": "Sleeps since {since}; it answers nothing but a call to wake up.",
    "broken": "The broker lost its connection at {since}: no power, no radio, or its program has ended.",
    "unheard": "Nothing has been heard of it yet; the order service knows it from the plant model.",
    "stateless": "No state has come yet. Is its program running, and does it speak this version of VDA 5050?",
    "unreadable": "No state that could be read: {problem}",
    "silent": "No state since {since}; one was due within {limit} s.",
    "blind": "No state since {since}, because this service has no link to the broker.",
    "mode": "Operating mode {mode}: fleet control is not in control.",
    "error": "{type}: {description}",
    "emergency_stop": "Emergency stop is active; it is reset {how}.",
    "field": "Something is in its protective field.",
    "not_localized": "It does not know where it is; set its position.",
    "paused": "Paused.",
    "action": "Does {action} at {place}.",
    "waiting_for_release": "Waits at {place} until the way to {next} is released.",
    "driving": "Drives to {next}.",
    "standing": "Stands at {place} on the way to {next}.",
    "driving_free": "Drives without an order.",
    "action_waiting": "Waits at {place} to begin {action}.",
    "charging": "Charges, {charge} %.",
    "idle": "Free.",
    "idle_why": "{why}",
}
"""The sentences, by the code under which a translation finds them."""


@dataclass(frozen=True, slots=True)
class Reason:
    """Why a robot is in its condition: a code, and what its sentence is filled with."""

    code: str
    values: dict[str, str | float] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The sentence, in English."""
        return TEXTS[self.code].format(**self.values)


@dataclass(frozen=True, slots=True)
class Evidence:
    """What the judgement rests on; the times are for the sentence only."""

    connection: ConnectionState | None
    connection_since: datetime
    state: StateBrief | None
    state_time: datetime
    state_after_connection: bool
    """Whether the last state came after the last connection message."""
    overdue: bool
    """Whether the last state, or the first sign of the robot, is older than the limit."""
    silence_limit: float
    link_up: bool
    problem: str = ""
    """What was wrong with its last state, if that could not be read."""
    fleet_remark: str | None = None
    """What the order service says about the vehicle; None: it does not know it."""


Judgement = tuple[Condition, Reason]


def judge(evidence: Evidence) -> Judgement:
    """Tell the condition of a robot, and why."""
    if away := _away(evidence):
        return away
    state = evidence.state
    if state is None:
        return _without_state(evidence)
    if evidence.overdue:
        return Condition.SILENT, _silence_reason(evidence)
    return _held(state) or _working(state) or _free(state, evidence.fleet_remark)


def _away(evidence: Evidence) -> Judgement | None:
    match evidence.connection:
        case ConnectionState.OFFLINE:
            judgement = Condition.OFFLINE, "offline"
        case ConnectionState.HIBERNATING:
            judgement = Condition.OFFLINE, "hibernating"
        case ConnectionState.CONNECTION_BROKEN if not evidence.state_after_connection:
            judgement = Condition.BROKEN, "broken"
        case _:
            return None
    condition, code = judgement
    return condition, Reason(code, {"since": clock_text(evidence.connection_since)})


def _without_state(evidence: Evidence) -> Judgement:
    if evidence.problem:
        return Condition.SILENT, Reason("unreadable", {"problem": evidence.problem})
    if evidence.connection is None and evidence.fleet_remark is not None:
        return Condition.OFFLINE, Reason("unheard")
    return Condition.SILENT, Reason("stateless")


def _silence_reason(evidence: Evidence) -> Reason:
    since = clock_text(evidence.state_time)
    if not evidence.link_up:
        return Reason("blind", {"since": since})
    return Reason("silent", {"since": since, "limit": round(evidence.silence_limit)})


def clock_text(moment: datetime) -> str:
    """Write a time for a sentence: UTC, to the second."""
    return f"{iso(moment)[11:19]} UTC"


def _held(state: StateBrief) -> Judgement | None:
    if state.operating_mode not in (OperatingMode.AUTOMATIC, OperatingMode.SEMIAUTOMATIC):
        return Condition.MANUAL, Reason("mode", {"mode": state.operating_mode.value})
    error = worst_error(state)
    if error and error.error_level in (ErrorLevel.FATAL, ErrorLevel.CRITICAL):
        return Condition.ERROR, _error_reason(error)
    return _blocked(state)


def _blocked(state: StateBrief) -> Judgement | None:
    if state.safety_state.active_emergency_stop is not EmergencyStop.NONE:
        by_hand = state.safety_state.active_emergency_stop is EmergencyStop.MANUAL
        return Condition.BLOCKED, Reason("emergency_stop", {"how": "at the robot" if by_hand else "remotely"})
    if state.safety_state.field_violation:
        return Condition.BLOCKED, Reason("field")
    if state.mobile_robot_position and not state.mobile_robot_position.localized:
        return Condition.BLOCKED, Reason("not_localized")
    if state.paused:
        return Condition.BLOCKED, Reason("paused")
    return None


def _working(state: StateBrief) -> Judgement | None:
    action = _open_action(state.action_states) or _open_action(state.instant_action_states)
    if state.node_states or state.edge_states:
        return Condition.BUSY, _way_reason(state, action)
    if action:
        return Condition.BUSY, _action_reason(state, action)
    if state.driving:
        return Condition.BUSY, Reason("driving_free")
    return None


def _free(state: StateBrief, remark: str | None) -> Judgement:
    if state.power_supply.charging:
        return Condition.CHARGING, Reason("charging", {"charge": round(state.power_supply.state_of_charge)})
    return Condition.IDLE, Reason("idle_why", {"why": remark}) if remark else Reason("idle")


def worst_error(state: StateBrief) -> ErrorBrief | None:
    """Give the first of the errors of the highest level."""
    if not state.errors:
        return None
    levels = list(ErrorLevel)
    return max(state.errors, key=lambda each: levels.index(each.error_level))


def _error_reason(error: ErrorBrief) -> Reason:
    sentences = [text for text in (error.error_description, error.error_hint) if text]
    described = " ".join(sentences) or f"the robot gives no description (level {error.error_level})."
    return Reason("error", {"type": error.error_type, "description": described})


def _way_reason(state: StateBrief, action: ActionBrief | None) -> Reason:
    upcoming = state.node_states[0] if state.node_states else None
    target: dict[str, str | float] = {
        "place": state.last_node_id or "?",
        "next": upcoming.node_id if upcoming else "?",
    }
    if state.driving:
        return Reason("driving", target)
    if action and action.action_status is not ActionStatus.WAITING:
        return _action_reason(state, action)
    if upcoming and not upcoming.released:
        return Reason("waiting_for_release", target)
    return Reason("standing", target)


def _action_reason(state: StateBrief, action: ActionBrief) -> Reason:
    waiting = action.action_status is ActionStatus.WAITING
    name = action.action_type or action.action_id
    return Reason(
        "action_waiting" if waiting else "action", {"action": name, "place": state.last_node_id or "?"}
    )


def _open_action(actions: tuple[ActionBrief, ...]) -> ActionBrief | None:
    """Give the action that is being done, else the first that waits."""
    still_open = [each for each in actions if not each.action_status.ended]
    begun = (each for each in still_open if each.action_status is not ActionStatus.WAITING)
    return next(begun, still_open[0] if still_open else None)


class SessionState(StrEnum):
    """Whether the program of a robot runs and reaches what drives it."""

    NOT_ACTIVE = "NOT_ACTIVE"
    """It has logged off, sleeps, or was never heard of."""
    INITIATING = "INITIATING"
    """It is there, and no state has come yet."""
    ACTIVE = "ACTIVE"
    """It sends states, and nothing says that it cannot drive."""
    TERMINATING = "TERMINATING"
    """It says that it leaves ROS."""
    FAILED = "FAILED"
    """It went without a word, or says that its navigation is not there."""


def session_of(condition: Condition, state: StateBrief | None) -> SessionState:
    """Tell the state of a robot's node from its condition and its last state."""
    if condition is Condition.OFFLINE:
        return SessionState.NOT_ACTIVE
    if condition is Condition.BROKEN:
        return SessionState.FAILED
    if state is None:
        return SessionState.INITIATING
    if condition is Condition.SILENT:
        return SessionState.FAILED
    told = ros_session(state)
    if told:
        return told.state
    blind = any(each.error_type == ErrorType.NAVIGATION_NOT_AVAILABLE for each in state.errors)
    return SessionState.FAILED if blind else SessionState.ACTIVE


@dataclass(frozen=True, slots=True)
class RosSession:
    """What a robot's edge agent tells of its ROS session."""

    state: SessionState
    namespace: str
    domain_id: str


def ros_session(state: StateBrief) -> RosSession | None:
    """Give what the information of a state tells; it is for people, and nothing else goes by it."""
    for entry in state.information or ():
        if entry.info_type == ROS_SESSION:
            facts = {each.reference_key: each.reference_value for each in entry.info_references}
            told = facts.get("state", "")
            if told in SessionState.__members__:
                return RosSession(SessionState(told), facts.get("namespace", ""), facts.get("domainId", ""))
    return None
