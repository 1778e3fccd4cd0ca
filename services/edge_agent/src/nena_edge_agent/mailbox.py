"""The queue in front of a robot's core: bounded, with a rule for each kind of event."""

from __future__ import annotations

import asyncio
from collections import deque

from nena_edge_agent.driver.port import BatteryReport, DriveProgress, GoalTable, PlanReport, PoseReport
from nena_edge_agent.protocol.events import (
    Event,
    InstantActionsReceived,
    MessageRefused,
    OrderReceived,
    ResponsesReceived,
    ZoneSetReceived,
)

MESSAGE_LIMIT = 100
"""Messages of fleet control that may wait."""

_MESSAGES = (OrderReceived, InstantActionsReceived, ZoneSetReceived, ResponsesReceived, MessageRefused)
_SUPERSEDED = (PoseReport, BatteryReport, GoalTable, PlanReport, DriveProgress)


class Mailbox:
    """Collects events for one task.

    Of poses, battery reports, plans, progress and tables of goals only the newest waits. Messages beyond the
    limit are dropped and counted: fleet control sends them again until a state echoes them. All else is an
    answer to something that the core has asked for, a handful per goal and action, and is never dropped.
    """

    def __init__(self) -> None:
        self._events: deque[Event] = deque()
        self._newest: dict[type, Event] = {}
        self._messages = 0
        self._filled = asyncio.Event()
        self.dropped = 0

    def put(self, event: Event) -> None:
        """Add an event; to be called in the event loop's thread."""
        if isinstance(event, _SUPERSEDED):
            self._newest[type(event)] = event
        elif not isinstance(event, _MESSAGES):
            self._keep_order(event)
        elif self._messages < MESSAGE_LIMIT:
            self._messages += 1
            self._keep_order(event)
        else:
            self.dropped += 1
        self._filled.set()

    def take(self) -> list[Event]:
        """Give and forget all that waits, in its order."""
        self._flush_newest()
        events = list(self._events)
        self._events.clear()
        self._messages = 0
        self._filled.clear()
        return events

    @property
    def empty(self) -> bool:
        """Whether nothing waits."""
        return not self._filled.is_set()

    def wake(self) -> None:
        """End a wait, also without an event."""
        self._filled.set()

    async def wait(self, seconds: float) -> None:
        """Wait until something is there, at most ``seconds``."""
        if self._filled.is_set() or seconds <= 0:
            await asyncio.sleep(0)
            return
        try:
            async with asyncio.timeout(seconds):
                await self._filled.wait()
        except TimeoutError:
            return

    def _keep_order(self, event: Event) -> None:
        """Put ``event`` behind the pose that came before it: an arrival is judged by its own pose."""
        self._flush_newest()
        self._events.append(event)

    def _flush_newest(self) -> None:
        self._events.extend(self._newest.values())
        self._newest.clear()
