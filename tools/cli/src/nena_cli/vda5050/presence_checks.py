"""Whether a robot is there: its connection, and a state at least every 30 s (sections 6.5 and 6.6)."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import datetime, timedelta
from typing import Final

from nena_cli.vda5050.finding import Problem, Rule, Severity
from nena_cli.vda5050.said import Said
from nena_shared.vda5050.connection import Connection, ConnectionState

LONGEST_SILENCE: Final = timedelta(seconds=30)
GRACE: Final = timedelta(seconds=5)
"""On the way over the broker, and for clocks that are not exact."""

SILENT: Final = {
    ConnectionState.OFFLINE: Severity.ERROR,
    ConnectionState.HIBERNATING: Severity.ERROR,
    # a broker may tell the will of an old connection after the new one stands
    ConnectionState.CONNECTION_BROKEN: Severity.WARNING,
}


class PresenceChecks:
    """Follows one robot's connection and the times of its states."""

    def __init__(self) -> None:
        self._connection: ConnectionState | None = None
        self._last: Said | None = None
        """The last state, while the next one is to come in time."""
        self._told = False

    def on_connection(self, message: Connection) -> None:
        """Take in what is known of the link; a new link begins a new time."""
        self._connection = message.connection_state
        self._last = None
        self._told = False

    def on_state(self, said: Said) -> Iterator[Problem]:
        """Say what is wrong with a state's coming now."""
        if said.retained:
            return
        if self._connection in SILENT and not self._told:
            self._told = True
            text = f"a state comes from a robot whose connection is {self._connection}"
            yield Rule.CONNECTION, SILENT[self._connection], text
        if self._last and said.time - self._last.time > LONGEST_SILENCE + GRACE:
            silence = (said.time - self._last.time).total_seconds()
            yield Rule.STATE_INTERVAL, Severity.ERROR, f"no state for {silence:.0f} s"
        self._last = said

    def silence(self, now: datetime) -> tuple[Said, Problem] | None:
        """Tell once that the state after the last one is overdue at ``now``."""
        last = self._last
        if last is None or now - last.time <= LONGEST_SILENCE + GRACE:
            return None
        self._last = None
        text = f"no state has come after this one, for {(now - last.time).total_seconds():.0f} s"
        return last, (Rule.STATE_INTERVAL, Severity.ERROR, text)
