"""One robot as its messages describe it: last messages, connection, message order, abilities and view."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection
from dataclasses import dataclass, field
from datetime import UTC, datetime
from enum import StrEnum
from functools import cached_property
from math import inf
from typing import Final

from nena_order_service.fleet.settings import FleetSettings
from nena_shared.clock import iso
from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import ActionParameterDescription, Factsheet, MobileRobotAction, Support
from nena_shared.vda5050.malformed import QUOTE
from nena_shared.vda5050.own_actions import transforms_itself
from nena_shared.vda5050.repair import Repair
from nena_shared.vda5050.rules import Rules
from nena_shared.vda5050.state import State
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import nearest_codec

R = ReasonCode

NO_TIME: Final = datetime.min.replace(tzinfo=UTC)
"""Instead of a timestamp that cannot be read."""

BELIEVED_COUNT: Final = 3
BELIEVED_AFTER: Final = 10.0
"""A sender counts as restarted with a wrong clock after this many consecutive messages, over this many
seconds, that look old but whose headerIds increase or, if those never change, timestamps."""

CONNECTIONS_KEPT: Final = 20
"""Number of connection messages per robot that are recognised when repeated."""


LONGEST_STATE_INTERVAL: Final = 30.0
"""Seconds; a robot sends a state at least this often (section 6.6)."""

POSITION_WITHIN: Final = 30.0
"""Seconds of states without a position after connecting that mark a robot as never reporting it."""


class MessageOrder:
    """Checks the headers of one robot's messages on one topic (section 7.2).

    A message is old if neither its headerId nor its timestamp is higher than the last one's. A sender that
    restarts counts from 0 with a later timestamp, so its message is new. One whose clock was also set back is
    accepted after BELIEVED_COUNT messages, or at once after :meth:`restart`.

    Messages with the same header have no order: they are new if their content differs.
    """

    def __init__(self) -> None:
        self._last: tuple[int, datetime] | None = None
        self._content: object = None
        """The last message, or whatever else tells messages with the same header apart."""
        self._counts = False
        """Whether the header has ever changed."""
        self._last_old: tuple[int, datetime] | None = None
        self._old_since = 0.0
        self._old_in_a_row = 0

    def restart(self) -> None:
        """Accept any message as new: the sender has reconnected."""
        self._last = None

    @property
    def last_header(self) -> str:
        """The header of the last new message, for people."""
        return "" if self._last is None else header_text(*self._last)

    def is_new(self, header_id: int, timestamp: datetime, now: float, content: object = None) -> bool:
        """Return whether a message is new (section 7.2), and if so, compare later ones with it.

        ``now`` is its arrival, in monotonic seconds.
        """
        last, header = self._last, (header_id, timestamp)
        if last == header:
            # Without either a counting headerId or a time, an idle robot's states cannot be told apart.
            is_ordered = self._counts or timestamp != NO_TIME
            if is_ordered and content == self._content:
                return False
        elif last is not None:
            old = header_id <= last[0] and timestamp <= last[1]
            if old and not self._is_believed(header, now):
                return False
            self._counts = True
        self._last, self._content = header, content
        self._last_old = None
        return True

    def _is_believed(self, header: tuple[int, datetime], now: float) -> bool:
        # Another order among the old messages shows a repetition by the broker, not a sender that counts on.
        if self._last_old is None or header <= self._last_old:
            self._old_in_a_row, self._old_since = 0, now
        self._old_in_a_row += 1
        self._last_old = header
        return self._old_in_a_row >= BELIEVED_COUNT and now - self._old_since >= BELIEVED_AFTER


def header_text(header_id: int, timestamp: datetime) -> str:
    """Return the header of a message for people; without a time that could not be read."""
    return f"headerId {header_id}" if timestamp == NO_TIME else f"headerId {header_id} of {iso(timestamp)}"


class LinkStatus(StrEnum):
    """The state of the link to a robot."""

    UNKNOWN = "UNKNOWN"
    """It has never connected."""
    ONLINE = "ONLINE"
    OFFLINE = "OFFLINE"
    HIBERNATING = "HIBERNATING"
    CONNECTION_BROKEN = "CONNECTION_BROKEN"
    SILENT = "SILENT"
    """It should be online, but its last state is too old."""
    UNREADABLE = "UNREADABLE"
    """It is online, but its messages cannot be read, or look old and are ignored."""


REPORTS_NOTHING: Final = frozenset({LinkStatus.SILENT, LinkStatus.UNREADABLE})
"""Link states in which a robot reports nothing readable but may still receive messages."""


class VdaOrderPhase(StrEnum):
    """The phase of a VDA order."""

    WAITING = "WAITING"
    """Not sent yet, because the robot cannot be sent an order now."""
    SENT = "SENT"
    """Sent, but no state echoes it yet."""
    RUNNING = "RUNNING"
    """The robot has it."""
    CANCELLING = "CANCELLING"
    """It is to be cancelled, which the robot has not confirmed yet."""


@dataclass(frozen=True, slots=True)
class Availability:
    """Whether a robot can take a VDA order now; ``reason`` explains it, as a predicate."""

    can_take_order: bool
    reason: Reason


@dataclass(frozen=True, slots=True)
class RobotView:
    """What is known about a robot at one moment."""

    key: RobotKey
    link: LinkStatus
    vehicle_state: VehicleState
    availability: Availability
    state: State | None
    """Its last state message; while its states are unreadable, what the last one says about the robot."""
    state_at: float | None
    """When it arrived, monotonic seconds."""
    factsheet: Factsheet | None
    malformed: int
    """Number of its messages that could not be read."""
    order_id: str | None
    order_phase: VdaOrderPhase | None
    wait_reason: Reason | None
    """What the VDA order waits for; None if the robot simply executes it."""
    stale: bool = False
    """Whether the state is from before the robot last connected."""
    deviations: tuple[Repair, ...] = ()
    """Deviations of its messages from the standard that were repaired."""
    substituted: tuple[Repair, ...] = ()
    """Those of the last state after which the safest value is used."""


ORDER_PREFIX: Final = "order."
RETRY: Final = "retry"
LISTS: Final = frozenset({"nodes", "edges"})
"""First parts of paths of an order's fields that leave out the prefix ``order.``."""


DEVIATION_XY_FIELD: Final = "nodes.nodePosition.allowedDeviationXY"
THETA_FIELD: Final = "nodes.nodePosition.theta"
DEVIATION_THETA_FIELD: Final = "nodes.nodePosition.allowedDeviationTheta"
POSITION_FIELDS: Final = (DEVIATION_XY_FIELD, THETA_FIELD, DEVIATION_THETA_FIELD)
"""The optional fields of a node's position."""


class Abilities:
    """What a robot supports according to its factsheet (section 7.10).

    An empty list counts as not reported: everything may be supported.
    """

    def __init__(self, factsheet: Factsheet) -> None:
        self.factsheet = factsheet
        self._taken: dict[str, bool] = {}
        """Cache of supported optional fields, which are checked for each node of each order."""

    @cached_property
    def required_fields(self) -> tuple[str, ...]:
        """The paths, within an order, of the optional fields that the robot requires (section 7.10)."""
        features = self.factsheet.protocol_features
        paths = (
            field.parameter for field in features.optional_parameters if field.support is Support.REQUIRED
        )
        return tuple(
            path.removeprefix(ORDER_PREFIX)
            for path in paths
            if path.startswith(ORDER_PREFIX) or path.split(".", 1)[0] in LISTS
        )

    def takes_field(self, path: str) -> bool:
        """Return whether an optional field, such as ``nodes.actions``, may be sent (section 7.1.1)."""
        taken = self._taken.get(path)
        if taken is None:
            listed = self.factsheet.protocol_features.optional_parameters
            name = path.removeprefix("nodes.")
            taken = not listed or any(f".{name}." in f".{field.parameter}." for field in listed)
            self._taken[path] = taken
        return taken

    def lists_field(self, path: str) -> bool:
        """Return whether the factsheet lists an optional field."""
        return bool(self.factsheet.protocol_features.optional_parameters) and self.takes_field(path)

    @cached_property
    def takes_positions(self) -> bool:
        """Whether positions of nodes are sent as they are: with all fields, and without filling any."""
        # Of most robots: then an order of hundreds of nodes needs no copy of each.
        demanded = set(self.required_fields).intersection(POSITION_FIELDS)
        return not demanded and all(map(self.takes_field, POSITION_FIELDS))

    @cached_property
    def takes_retries(self) -> bool:
        """Whether the robot supports RETRIABLE actions and ``retry`` (section 6.6.9)."""
        rules = self.codec.rules if self.codec else None
        has_status = rules is not None and ActionStatus.RETRIABLE in rules.action_statuses
        listed = not self.lists_actions or bool(self.declared_actions(RETRY))
        return has_status and listed and self.takes_field("nodes.actions.retriable")

    @cached_property
    def codec(self) -> Codec | None:
        """Codec for messages to this robot; None for an unsupported version."""
        return nearest_codec(self.factsheet.version)

    @cached_property
    def transforms_itself(self) -> bool:
        """Whether the robot reports positions in the plant's frame instead of its map's."""
        return transforms_itself(self.factsheet)

    @property
    def lists_actions(self) -> bool:
        """Whether the factsheet lists the supported actions."""
        return bool(self.factsheet.protocol_features.mobile_robot_actions)

    def declared_actions(self, action_type: str) -> tuple[MobileRobotAction, ...]:
        """Return the declarations of an action type; some robots list one for each scope."""
        actions = self.factsheet.protocol_features.mobile_robot_actions
        return tuple(action for action in actions if action.action_type == action_type)

    def declared_parameters(self, action: Action) -> dict[str, ActionParameterDescription]:
        """Return the parameters that the factsheet lists for an action, by key."""
        return {
            parameter.key: parameter
            for declaration in self.declared_actions(action.action_type)
            for parameter in declaration.action_parameters or ()
        }


INSTANT_ACTIONS_LIMIT: Final = 50
"""Maximum number of active instant actions per robot; more are refused."""

AWAY: Final = {
    ConnectionState.OFFLINE: LinkStatus.OFFLINE,
    ConnectionState.HIBERNATING: LinkStatus.HIBERNATING,
    ConnectionState.CONNECTION_BROKEN: LinkStatus.CONNECTION_BROKEN,
}
"""Connection states in which nothing reaches a robot."""
NOT_REACHED: Final = frozenset(AWAY.values())
"""The same as states of the link."""


def _before_quote(problem: Reason) -> str:
    """Return a problem of a message without the quoted value, which may change with every message."""
    return str(problem).partition(QUOTE)[0]


@dataclass(slots=True)
class Robot:
    """The last messages of a robot, and when they arrived (monotonic seconds)."""

    key: RobotKey
    settings: FleetSettings
    connection: ConnectionState | None = None
    state: State | None = None
    """Its last readable state."""
    sighting: State | None = None
    """What its last state says about the robot itself, if that state is unreadable; its order is unknown."""
    state_at: float | None = None
    """When the state or sighting arrived."""
    abilities: Abilities | None = None
    """What its factsheet declares; None before the first one."""
    malformed: int = 0
    """Number of its messages that could not be read."""
    placed: bool = False
    """Whether it reports its position in general; some robots never do."""
    stale: bool = False
    """Whether its last state is from before it last connected: it may have been restarted since."""
    unreadable: Reason | None = None
    """The problem of its last state or connection message; None if that could be read."""
    other_topic: Reason | None = None
    """That a message came on a topic like this robot's."""
    substituted: tuple[Repair, ...] = ()
    """What its last state does not say in the standard's words, and was read as the safest value."""
    states_unreadable: bool = False
    """Whether its last state could not be read."""
    _unreadable_at: float = -inf
    _heard_at: float | None = None
    _silent_after: float = 0.0
    _order: MessageOrder = field(default_factory=MessageOrder)
    _placed_until: float | None = None
    """When it will count as never reporting its position, unless it reports one before."""
    _online_id: int | None = None
    """The headerId of the last connection message, if that was ONLINE."""
    _connections: deque[tuple[int, datetime]] = field(default_factory=lambda: deque(maxlen=CONNECTIONS_KEPT))

    def __post_init__(self) -> None:
        self._silent_after = self.settings.silent_after

    def take_connection(self, message: Connection, now: float) -> bool:
        """Update the connection state (section 6.5); return whether that has changed."""
        # Some robots publish ONLINE periodically. That is no new connection: one that restarts counts from 0.
        online = message.connection_state is ConnectionState.ONLINE
        online_id = self._online_id if self.connection is ConnectionState.ONLINE else None
        periodic = online and online_id is not None and message.header_id > online_id
        self._online_id = message.header_id if online else None
        self.connection = message.connection_state
        self._heard_at = now
        # The age does not matter, as a last will was made when the robot connected. A message that is
        # repeated or retained is no new connection either: an old state after it stays old.
        header = message.header_id, message.timestamp
        if header in self._connections:
            return False
        self._connections.append(header)
        if periodic:
            return False
        self._order.restart()
        if online and self.placed:
            self._placed_until = inf
        if online and self.state is not None:
            self.stale = self.state.timestamp < message.timestamp
        return True

    def take_state(self, message: State, now: float) -> bool:
        """Store a state; return whether it is new."""
        if not self._order.is_new(message.header_id, message.timestamp, now, message):
            return False
        self.unreadable, self.states_unreadable, self.sighting = None, False, None
        self.stale = False
        if message.mobile_robot_position is not None:
            self.placed, self._placed_until = True, None
        elif self._placed_until is not None:
            self._placed_until = min(self._placed_until, now + POSITION_WITHIN)
            self.placed = now < self._placed_until
        self.state = message
        self.state_at = self._heard_at = now
        # Brokers may deliver the will of an old connection after the new one is up. A state shows who is
        # right.
        self.connection = ConnectionState.ONLINE
        return True

    def take_unreadable_state(self, problem: Reason, sighting: State | None, now: float) -> None:
        """Count an unreadable state, and store what it says about the robot itself, if anything."""
        self.take_malformed(problem, now)
        self.states_unreadable = True
        if sighting and self._order.is_new(sighting.header_id, sighting.timestamp, now, sighting):
            self.sighting, self.state_at = sighting, now

    def take_old_state(self, header: str, last: str, now: float) -> None:
        """Note that a state is ignored, because its header does not come after the last one's."""
        self._note_problem(Reason(R.OLD_STATES, received=header, last=last), now)

    def take_malformed(self, problem: Reason | None, now: float) -> None:
        """Count an unreadable message; ``problem`` describes it if orders depend on such messages."""
        self.malformed += 1
        if problem is not None:
            self._note_problem(problem, now)

    def _note_problem(self, problem: Reason, now: float) -> None:
        self._unreadable_at = now
        if self.unreadable is None or _before_quote(problem) != _before_quote(self.unreadable):
            self.unreadable = problem

    def take_factsheet(self, message: Factsheet) -> None:
        """Store what the robot supports and how often it reports (section 7.10)."""
        self.abilities = Abilities(message)
        interval = message.protocol_limits.timing.default_state_interval or 0.0
        # 30 s at most by the standard (6.6): some factsheets have milliseconds
        intervals = self.settings.silent_intervals * min(interval, LONGEST_STATE_INTERVAL)
        self._silent_after = max(self.settings.silent_after, intervals)

    def link_status(self, now: float) -> LinkStatus:
        """Return the state of the link; a robot with unreadable or ignored messages is not silent."""
        if self.connection is None or self._heard_at is None:
            return LinkStatus.UNREADABLE if self.unreadable else LinkStatus.UNKNOWN
        heard = now <= self._heard_at + self._silent_after
        if heard and self.connection is ConnectionState.ONLINE:
            return LinkStatus.UNREADABLE if self.states_unreadable else LinkStatus.ONLINE
        speaks = bool(self.unreadable) and now <= self._unreadable_at + self._silent_after
        if self.connection in AWAY:
            is_back = speaks and self._unreadable_at > self._heard_at
            return LinkStatus.UNREADABLE if is_back else AWAY[self.connection]
        return LinkStatus.UNREADABLE if speaks else LinkStatus.SILENT

    @property
    def last_header(self) -> str:
        """The header of its last new state, for people."""
        return self._order.last_header

    @property
    def rules(self) -> Rules | None:
        """The rules of the robot's version of VDA 5050; None before its first state."""
        codec = nearest_codec(self.state.version) if self.state else None
        return codec.rules if codec else None

    @property
    def is_reachable(self) -> bool:
        """Whether messages may reach the robot: it has connected and is not known to be offline."""
        return self.connection is not None and self.connection not in AWAY

    @property
    def factsheet(self) -> Factsheet | None:
        """Its last factsheet."""
        return self.abilities.factsheet if self.abilities else None

    @property
    def most_instant_actions(self) -> int:
        """The maximum number of instant actions per message, by the factsheet (section 7.10)."""
        limit = self.factsheet.protocol_limits.maximum_array_lengths.instant_actions if self.factsheet else 0
        return limit or INSTANT_ACTIONS_LIMIT

    @property
    def clears_instant_actions_from(self) -> int:
        """The number of ended instant actions at which clearInstantActions is sent (section 6.2.3)."""
        limits = self.factsheet.protocol_limits.maximum_array_lengths if self.factsheet else None
        room = limits.state_instant_action_states if limits else None
        usual = self.settings.clear_instant_actions_from
        # At half of what its state can hold: until it has cleared them, more may end.
        return min(usual, max(room // 2, 1)) if room else usual

    @property
    def least_order_interval(self) -> float:
        """The minimum interval between two orders, seconds, by the factsheet (section 7.10)."""
        return self.factsheet.protocol_limits.timing.minimum_order_interval if self.factsheet else 0.0


INSTANT_ONLY: Final = frozenset(
    {
        "cancelOrder",
        "clearInstantActions",
        "clearZoneActions",
        "deleteMap",
        "deleteZoneSet",
        "downloadMap",
        "downloadZoneSet",
        "factsheetRequest",
        "logReport",
        "retry",
        "shutdown",
        "skipRetry",
        "startHibernation",
        "startPause",
        "stateRequest",
        "stopHibernation",
        "stopPause",
        "trigger",
        "updateCertificate",
    }
)
"""Action types that never belong to an order; 2.x reports them among the order's actionStates."""


def is_idle(state: State, instant_ids: Collection[str]) -> bool:
    """Return whether the robot has nothing left to do for an order (section 6.6.8).

    Instant actions do not count. ``instant_ids`` identifies those that 2.x mixes with the order's actions and
    that cannot be distinguished by type.
    """
    if state.node_states or state.edge_states:
        return False
    return all(
        action.action_status.ended or action.action_type in INSTANT_ONLY or action.action_id in instant_ids
        for action in state.action_states
    )
