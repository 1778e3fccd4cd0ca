"""Queues and schedules of the agent's task: events, effects that wait for the disk, and message intervals."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable
from math import inf

from nena_edge_agent.driver.port import BatteryReport, DriveProgress, GoalTable, PlanReport, PoseReport
from nena_edge_agent.protocol import events
from nena_shared.tasks import set_within

MESSAGE_LIMIT = 100
"""Maximum number of waiting messages from fleet control."""

ROUND_PAUSE = 0.001
"""Pause before the next round if events wait already, seconds; the link, the driver and actions run in it."""

_MESSAGES = (
    events.OrderReceived,
    events.InstantActionsReceived,
    events.ZoneSetReceived,
    events.ResponsesReceived,
    events.MessageRefused,
)
# Each is complete: a goal table, too, lists all goals that Nav2 remembers, not the changes.
_SUPERSEDED = (PoseReport, BatteryReport, GoalTable, PlanReport, DriveProgress)


class Mailbox:
    """Queues events for one task.

    Only the newest pose, battery report, plan, progress and goal table is queued. Messages of fleet control
    beyond the limit are dropped and counted: fleet control resends them until a state confirms them. All
    other events are answers to the core, a handful per goal and action, and are never dropped.
    """

    def __init__(self) -> None:
        self._events: list[events.Event] = []
        self._newest: dict[type, events.Event] = {}
        self._messages = 0
        self._filled = asyncio.Event()
        self.dropped = 0

    def put(self, event: events.Event) -> None:
        """Add an event; call this in the event loop's thread."""
        if isinstance(event, _SUPERSEDED):
            self._newest[type(event)] = event
        else:
            if isinstance(event, _MESSAGES):
                if self._messages >= MESSAGE_LIMIT:
                    self.dropped += 1
                    return
                self._messages += 1
            # After the pose that arrived before it: it may confirm the arrival that this event reports.
            self._events.extend(self._newest.values())
            self._newest.clear()
            self._events.append(event)
        self._filled.set()

    def take_all(self) -> list[events.Event]:
        """Remove and return all waiting events, in their order."""
        waiting = [*self._events, *self._newest.values()]
        self._events.clear()
        self._newest.clear()
        self._messages = 0
        self._filled.clear()
        return waiting

    @property
    def is_empty(self) -> bool:
        """Return whether no event waits."""
        return not self._filled.is_set()

    def wake(self) -> None:
        """End :meth:`wait` even without an event."""
        self._filled.set()

    async def wait(self, seconds: float) -> None:
        """Wait for an event, at most ``seconds``."""
        if self._filled.is_set() or seconds <= 0:
            # A busy robot must not starve the link and the driver, which run in the same loop.
            await asyncio.sleep(ROUND_PAUSE)
            return
        await set_within(self._filled, seconds)


STARTS = (events.Drive, events.SetPosition, events.StartAction)
"""Effects that wait for the disk; all others stop or report something."""


class Postponed:
    """Delays the start of drives and actions until the last record is on disk."""

    def __init__(self) -> None:
        self._waiting: list[events.Effect] = []

    def select_ready(self, effects: Iterable[events.Effect], *, recorded: bool) -> list[events.Effect]:
        """Return the effects that may be performed now, in order; ``recorded``: the last record is on disk.

        A waiting start is dropped if a later effect stops it.
        """
        if recorded:
            waiting, self._waiting = self._waiting, []
            return [*waiting, *effects]
        ready: list[events.Effect] = []
        for effect in effects:
            # 0018: while the disk fails, nothing new starts, and what stops or ends something works at once.
            if isinstance(effect, STARTS):
                self._waiting.append(effect)
            else:
                self._waiting = [start for start in self._waiting if not _ends_start(effect, start)]
                ready.append(effect)
        return ready


def _ends_start(effect: events.Effect, waiting: events.Effect) -> bool:
    """Return whether ``effect`` stops what ``waiting`` would start."""
    match effect, waiting:
        case events.Halt(), events.Drive():
            return True
        case events.CancelAction(action_id), events.StartAction(action):
            return action.action_id == action_id
        case _:
            return False


class StateSchedule:
    """Due times of states, monotonic, s; several requests within the minimum interval cause one state."""

    def __init__(self, *, minimum: float, maximum: float) -> None:
        self._minimum = minimum
        self._maximum = maximum
        self._last = -inf
        self._requested = inf

    def request(self, now: float) -> None:
        """Request a state as soon as the minimum interval allows."""
        self._requested = min(self._requested, now)

    @property
    def due(self) -> float:
        """Return when the next state is due."""
        return min(max(self._requested, self._last + self._minimum), self._last + self._maximum)

    def record_sent(self, now: float) -> None:
        """Record that a state was sent."""
        self._last, self._requested = now, inf


class VisualizationSchedule:
    """Due times of visualization messages, monotonic, s; an interval of 0 disables them."""

    def __init__(self, *, interval: float, now: float) -> None:
        self._interval = interval
        self.due = now if interval else inf
        """When the next message is due."""

    def record_sent(self, now: float) -> None:
        """Record that a message was sent; missed messages are skipped."""
        self.due = max(self.due + self._interval, now)
