"""Queues and schedules of the agent's task: events, effects that wait for the disk, and message intervals."""

from __future__ import annotations

import asyncio
from collections import deque
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
_SUPERSEDED = (PoseReport, BatteryReport, GoalTable, PlanReport, DriveProgress)


class Mailbox:
    """Queues events for one task.

    Only the newest pose, battery report, plan, progress and goal table is queued. Messages of fleet control
    beyond the limit are dropped and counted: fleet control resends them until a state confirms them. All
    other events are answers to the core, a handful per goal and action, and are never dropped.
    """

    def __init__(self) -> None:
        self._events: deque[events.Event] = deque()
        self._newest: dict[type, events.Event] = {}
        self._messages = 0
        self._filled = asyncio.Event()
        self.dropped = 0

    def put(self, event: events.Event) -> None:
        """Add an event; call this in the event loop's thread."""
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

    def take(self) -> list[events.Event]:
        """Remove and return all waiting events, in their order."""
        # A pose must not be overtaken by an answer that it explains.
        self._flush_newest()
        taken = list(self._events)
        self._events.clear()
        self._messages = 0
        self._filled.clear()
        return taken

    @property
    def empty(self) -> bool:
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

    def _keep_order(self, event: events.Event) -> None:
        """Queue ``event`` after the pose that arrived before it, which may confirm an arrival."""
        self._flush_newest()
        self._events.append(event)

    def _flush_newest(self) -> None:
        self._events.extend(self._newest.values())
        self._newest.clear()


STARTS = (events.Drive, events.SetPosition, events.StartAction)
"""Effects that wait for the disk; all others stop or report something."""


class Postponed:
    """Delays the start of drives and actions until the last record is on disk."""

    def __init__(self) -> None:
        self._waiting: list[events.Effect] = []

    def sift(self, effects: Iterable[events.Effect], *, recorded: bool) -> list[events.Effect]:
        """Return the effects that may be performed now, in order; ``recorded``: the last record is on disk.

        A waiting start is dropped if a later effect stops it.
        """
        if recorded:
            waiting, self._waiting = self._waiting, []
            return [*waiting, *effects]
        now: list[events.Effect] = []
        for effect in effects:
            if isinstance(effect, STARTS):
                self._waiting.append(effect)
            else:
                self._waiting = [start for start in self._waiting if not _ends_start(effect, start)]
                now.append(effect)
        return now


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

    def sent(self, now: float) -> None:
        """Record that a state was sent."""
        self._last, self._requested = now, inf


class VisualizationSchedule:
    """Due times of visualization messages, monotonic, s; an interval of 0 disables them."""

    def __init__(self, *, interval: float, now: float) -> None:
        self._interval = interval
        self._next = now if interval else inf

    @property
    def due(self) -> float:
        """Return when the next visualization message is due."""
        return self._next

    def sent(self, now: float) -> None:
        """Record that a message was sent; missed messages are skipped."""
        self._next = max(self._next + self._interval, now)
