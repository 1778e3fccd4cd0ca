"""What is known of one robot from its own messages alone."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from nena_order_service.fleet.abilities import Abilities
from nena_order_service.fleet.message_order import MessageOrder
from nena_order_service.fleet.reported import State
from nena_order_service.fleet.settings import FleetSettings
from nena_order_service.fleet.view import LinkStatus
from nena_shared.vda5050.connection import Connection, ConnectionState
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.rules import RULES, Rules
from nena_shared.vda5050.topics import RobotKey
from nena_shared.vda5050.versions import nearest_codec

INSTANT_ACTIONS_LIMIT: Final = 50
"""Instant actions that may be under way at one robot; more are refused."""

AWAY: Final = {
    ConnectionState.OFFLINE: LinkStatus.OFFLINE,
    ConnectionState.HIBERNATING: LinkStatus.HIBERNATING,
    ConnectionState.CONNECTION_BROKEN: LinkStatus.CONNECTION_BROKEN,
}
"""Links over which nothing reaches a robot."""


@dataclass(slots=True)
class Robot:
    """The last messages of a robot, and when they came (monotonic seconds)."""

    key: RobotKey
    settings: FleetSettings
    connection: ConnectionState | None = None
    state: State | None = None
    state_at: float | None = None
    abilities: Abilities | None = None
    """What its factsheet says; None before the first one."""
    malformed: int = 0
    """How many of its messages could not be read."""
    _heard_at: float | None = None
    _silent_after: float = 0.0
    _order: MessageOrder = field(default_factory=MessageOrder)

    def __post_init__(self) -> None:
        self._silent_after = self.settings.silent_after

    def take_connection(self, message: Connection, now: float) -> None:
        """Note what is known of the link; a will has an old header, so headers do not count here."""
        self.connection = message.connection_state
        self._heard_at = now
        self._order.restart()

    def take_state(self, message: State, now: float) -> bool:
        """Note a state and tell whether it is a new one.

        A state that comes after OFFLINE or a last will shows that the robot is there again: the broker may
        tell the will of an old connection only after the new connection stands.
        """
        if not self._order.is_new(message.header_id, message.timestamp, now):
            return False
        self.state = message
        self.state_at = self._heard_at = now
        if self.connection is not ConnectionState.ONLINE:
            self.connection = ConnectionState.ONLINE
        return True

    def take_factsheet(self, message: Factsheet) -> None:
        """Note what the robot can do, and how often it reports."""
        self.abilities = Abilities(message)
        interval = message.protocol_limits.timing.default_state_interval or 0.0
        self._silent_after = max(self.settings.silent_after, self.settings.silent_intervals * interval)

    def link(self, now: float) -> LinkStatus:
        """Tell what is known of the way to the robot."""
        if self.connection is None or self._heard_at is None:
            return LinkStatus.UNKNOWN
        if self.connection in AWAY:
            return AWAY[self.connection]
        return LinkStatus.SILENT if now > self._heard_at + self._silent_after else LinkStatus.ONLINE

    @property
    def silent_from(self) -> float | None:
        """After which moment it counts as silent if nothing more is heard of it; None: it is not there."""
        return self._heard_at + self._silent_after if self.reachable and self._heard_at is not None else None

    @property
    def rules(self) -> Rules | None:
        """What the version that the robot's states are of can say; None before the first one."""
        codec = nearest_codec(self.state.version) if self.state else None
        return RULES[codec.version] if codec else None

    @property
    def reachable(self) -> bool:
        """Whether it is worth sending anything: nothing says that the robot is away."""
        return self.connection is not None and self.connection not in AWAY

    @property
    def factsheet(self) -> Factsheet | None:
        """Its last factsheet."""
        return self.abilities.factsheet if self.abilities else None

    @property
    def most_instant_actions(self) -> int:
        """How many instant actions one message may hold, by the factsheet."""
        limit = self.factsheet.protocol_limits.maximum_array_lengths.instant_actions if self.factsheet else 0
        return limit or INSTANT_ACTIONS_LIMIT

    @property
    def clears_instant_actions_from(self) -> int:
        """From how many ended instant actions on it is told to clear them: long before it is full."""
        limits = self.factsheet.protocol_limits.maximum_array_lengths if self.factsheet else None
        room = limits.state_instant_action_states if limits else None
        usual = self.settings.clear_instant_actions_from
        return min(usual, max(room // 2, 1)) if room else usual

    @property
    def least_order_interval(self) -> float:
        """Seconds that must lie between two orders, by the factsheet."""
        return self.factsheet.protocol_limits.timing.minimum_order_interval if self.factsheet else 0.0
