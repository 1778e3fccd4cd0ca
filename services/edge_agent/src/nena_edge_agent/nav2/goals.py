"""The goals in Nav2's status array, and which of them are this agent's.

A goal sent to the action has an ID with the agent's prefix. A goal sent by topic gets a random ID from
bt_navigator (``onGoalPoseReceived``), so its owner is inferred: each one sent may claim one new ID. A restart
of the server invalidates all IDs.
"""

from __future__ import annotations

import hashlib
import secrets
from collections.abc import Sequence
from dataclasses import dataclass

from nena_edge_agent.driver.port import GoalReport, GoalTable
from nena_shared.ros import GoalStatus


@dataclass(frozen=True, slots=True)
class GoalEntry:
    """One goal of the status array: its ID in hexadecimal digits, and its status."""

    goal_id: str
    status: GoalStatus


@dataclass(frozen=True, slots=True)
class GoalResult:
    """How a goal ended, and why: ``error_code`` and ``error_msg``; None if the distribution has no codes."""

    goal_id: str
    status: GoalStatus
    reason: tuple[int, str] | None


@dataclass(frozen=True, slots=True)
class FeedbackReading:
    """One message: the position in m and rad of ``frame``, the remaining distance in m and in poses."""

    goal_id: str
    x: float
    y: float
    yaw: float
    frame: str
    left: float
    recoveries: int
    places_left: int = 1


YIELD_TIME = 10.0
"""Seconds in which another client can resend a goal that Nav2 rejected because this agent drove."""
LENGTH = 8
"""Number of the 16 bytes of an ID that are the same for all goals of an agent; the others are random."""


class GoalIdPrefix:
    """The prefix of the agent whose ROS node has the name ``node_name``; IDs are hexadecimal digits."""

    def __init__(self, node_name: str) -> None:
        self._prefix = hashlib.sha256(f"nena {node_name}".encode()).digest()[:LENGTH].hex()

    def new(self) -> str:
        """Return a new random ID."""
        return self._prefix + secrets.token_hex(16 - LENGTH)

    def matches(self, goal_id: str) -> bool:
        """Return whether a goal is from this agent, in this run or an earlier one."""
        return goal_id.startswith(self._prefix)


ENDED_SHOWN = 5
"""Maximum number of ended goals in the table; Nav2 itself lists them for 15 minutes."""


@dataclass(frozen=True, slots=True)
class StatusChanges:
    """The changes in a status array: IDs that are newly recognised as ours, and lost IDs of ours."""

    claimed: tuple[str, ...]
    lost: frozenset[str]


@dataclass(slots=True)
class Goal:
    """A listed goal; ``past``: it had ended before the first array, and its owner is unknown."""

    ours: bool
    status: GoalStatus
    past: bool = False


class GoalRegistry:
    """Keeps the goals of the last status array of one action; times are monotonic seconds.

    A goal sent by topic is awaited for ``confirmation_time``, and can claim an ID for twice as long. A server
    that has been present for ``settle_time`` without an array has no earlier goals.
    """

    def __init__(self, prefix: GoalIdPrefix, *, confirmation_time: float, settle_time: float) -> None:
        self._prefix = prefix
        self._confirmation_time = confirmation_time
        self._settle_time = settle_time
        self._goals: dict[str, Goal] = {}
        self._orphans: frozenset[str] = frozenset()
        self._given_behind: str | None = None
        self._servers: frozenset[str] = frozenset()
        self._replaced: frozenset[str] = frozenset()
        self._servers_since: float | None = None
        self._array_seen = False
        self._claims = 0
        self._awaited = False
        self._given_at = -float("inf")
        self._others: tuple[GoalReport, ...] = ()
        self._others_known: dict[str, GoalStatus] | None = None
        self._yield_until: float | None = None
        self.given_before: str | None = None
        """The last goal of an earlier run that it did not see listed, once it is listed."""

    @property
    def live(self) -> tuple[str, ...]:
        """Return the IDs of our goals that have not ended."""
        return tuple(
            goal_id for goal_id, goal in self._goals.items() if goal.ours and not goal.status.terminal
        )

    @property
    def running(self) -> bool:
        """Return whether any goal has not ended, from any client."""
        return any(not goal.status.terminal for goal in self._goals.values())

    @property
    def others_run(self) -> bool:
        """Return whether a goal of another client is active."""
        return any(not goal.ours and not goal.status.terminal for goal in self._goals.values())

    @property
    def table(self) -> GoalTable:
        """Return the goals that run at the other action, then those of the last array, ended ones limited."""
        rows = [
            GoalReport(goal_id, not goal.ours, goal.status.name, goal.status.terminal)
            for goal_id, goal in self._goals.items()
            if not goal.past
        ]
        shown = [row for row in rows if row.ended][-ENDED_SHOWN:]
        return GoalTable((*self._others, *(row for row in rows if not row.ended or row in shown)))

    @property
    def yields(self) -> bool:
        """Return whether another client may resend a goal that Nav2 rejected."""
        return self._yield_until is not None

    @property
    def canceling(self) -> bool:
        """Return whether any goal is being cancelled; a goal sent now would end with it."""
        return any(goal.status is GoalStatus.CANCELING for goal in self._goals.values())

    @property
    def orphaned(self) -> bool:
        """Return whether the server disappeared while driving for us, and has not reported since."""
        return bool(self._orphans)

    def may_still_drive(self, now: float) -> bool:
        """Return whether a server is back, but has not shown yet whether it still drives for us."""
        return self.orphaned and bool(self._servers) and not self.is_settled(now)

    def status(self, goal_id: str) -> GoalStatus | None:
        """Return the last status of a goal, None if it is not listed."""
        goal = self._goals.get(goal_id)
        return None if goal is None else goal.status

    def taken_over(self, goal_id: str) -> str | None:
        """Return the ID of a running external goal that was accepted after ``goal_id``."""
        ids = list(self._goals)
        later = ids[ids.index(goal_id) + 1 :] if goal_id in self._goals else []
        running = (later_id for later_id in later if not self._goals[later_id].status.terminal)
        return next((later_id for later_id in running if not self._goals[later_id].ours), None)

    def is_settled(self, now: float) -> bool:
        """Return whether the earlier goals are known, so that a new ID can be distinguished from them."""
        since = self._servers_since
        return self._array_seen or (since is not None and now - since >= self._settle_time)

    def set_servers(self, servers: frozenset[str], now: float) -> bool:
        """Set the IDs of the array's publishers.

        Return whether an earlier one has gone, which invalidates all goal IDs.

        A server that appears next to another one is a restart of it: DDS lists a crashed publisher for
        another 20 s.
        """
        # DDS notices a killed publisher by its lease, 20 s later; a restarted one appears beside it.
        if servers - self._servers - self._replaced:
            self._replaced |= self._servers
        # One that outlives its successors had not crashed.
        self._replaced &= servers
        servers = servers - self._replaced or servers
        gone = self._servers - servers
        if gone or not self._servers:
            self._servers_since = now if servers else None
        self._servers = servers
        if gone:
            # The same server may return after a network failure, and list its current goals.
            self._orphans = self._orphans | frozenset(self.live)
            self._goals.clear()
            self._array_seen = self._awaited = False
            self._claims = 0
            self._given_behind = None
        return bool(gone)

    def reclaim(self, goal_ids: Sequence[str], given_behind: str | None = None) -> None:
        """Treat these as ours once they are listed: an earlier run of the program sent them.

        This also applies to the goal that the first array lists after ``given_behind`` ("": the last one);
        None: no other.
        """
        self._orphans = frozenset(goal_ids)
        self._given_behind = given_behind

    def record_published(self, now: float) -> None:
        """Record that a goal is sent at ``now``."""
        self._expire_claims(now)
        self._claims += 1
        self._awaited = True
        self._given_at = now

    def is_awaiting(self, now: float) -> bool:
        """Return whether the last sent goal is still awaited."""
        return self._awaited and now - self._given_at < self._confirmation_time

    def may_list_late(self, now: float) -> bool:
        """Return whether a goal sent by topic may still be listed: the first of two may have been lost."""
        return self._claims > 0 and now - self._given_at < 2 * self._confirmation_time

    def set_others(self, entries: Sequence[GoalEntry], now: float) -> str | None:
        """Handle the goals of the action that only others use; return a new one that interferes with ours.

        Nav2 drives for one action at a time, and aborts a goal of the other one within milliseconds. Such a
        goal counts as active for :data:`YIELD_TIME`, in which it can be resent.
        """
        foreign = {
            entry.goal_id: entry.status for entry in entries if not self._prefix.matches(entry.goal_id)
        }
        listed, self._others_known = self._others_known, foreign
        running = [goal_id for goal_id, status in foreign.items() if not status.terminal]
        since = self._servers_since
        latched = listed is None and (since is None or now - since < self._settle_time)
        previous = foreign if latched else listed or {}
        # Both navigators share one mutex (behavior_tree_navigator.hpp): Nav2 aborts the other one's goal at
        # once.
        refused = [
            goal_id
            for goal_id, status in foreign.items()
            if status is GoalStatus.ABORTED and not (goal_id in previous and previous[goal_id].terminal)
        ]
        if running:
            self._yield_until, shown = None, running
        elif refused and self.live:
            self._yield_until, shown = now + YIELD_TIME, refused[-1:]
        elif self._yield_until is None:
            shown = []
        else:
            return None
        self._others = tuple(
            GoalReport(goal_id, external=True, status=foreign[goal_id].name) for goal_id in shown
        )
        fresh = [goal_id for goal_id in shown if goal_id not in previous]
        return fresh[-1] if fresh and self.live else None

    def end_yielding(self, now: float) -> bool:
        """Stop yielding once the time for another client's retry is over; return whether it stopped."""
        if self._yield_until is None or now < self._yield_until:
            return False
        self._yield_until, self._others = None, ()
        return True

    def record_sent(self, now: float) -> None:
        """Record that a goal with an ID of ours is sent; its answer is awaited."""
        self._expire_claims(now)
        self._awaited, self._given_at = True, now

    def record_accepted(self, goal_id: str) -> None:
        """Record that the server has accepted a goal of ours; its array may arrive later."""
        self._awaited = False
        self._goals.setdefault(goal_id, Goal(ours=True, status=GoalStatus.ACCEPTED))

    def record_end(self, goal_id: str, status: GoalStatus) -> None:
        """Record the end of a goal by its result, which may arrive before the array."""
        goal = self._goals.get(goal_id)
        if goal is not None and not goal.status.terminal and status.terminal:
            goal.status = status

    def record_unknown(self, goal_id: str) -> None:
        """Remove a goal that the server does not know."""
        if goal_id in self._goals:
            self._goals[goal_id].status = GoalStatus.ABORTED

    def update(self, entries: Sequence[GoalEntry], now: float) -> StatusChanges:
        """Handle an array; ignore a late one."""
        self._expire_claims(now)
        # Arrays list goals in the order of acceptance (rcl_action_get_goal_status_array): one that lacks the
        # newest known goal is older than the last one.
        newest = next(reversed(self._goals), None)
        listed = {entry.goal_id for entry in entries}
        if newest is not None and newest not in listed and listed <= self._goals.keys():
            return StatusChanges((), frozenset())
        # The first array is latched: it may list goals of hours before.
        first, self._array_seen = not self._array_seen, True
        previous, self._goals = self._goals, {}
        self._find_given_before([entry.goal_id for entry in entries])
        strange = [
            entry.goal_id
            for entry in entries
            if not (
                entry.goal_id in previous
                or entry.goal_id in self._orphans
                or self._prefix.matches(entry.goal_id)
            )
        ]
        # Of the first array at most the last new ID is ours.
        claimed = tuple((strange[-1:] if first else strange)[: self._claims])
        self._claims -= len(claimed)
        if claimed:
            self._awaited = False
        for entry in entries:
            ours = (
                self._prefix.matches(entry.goal_id)
                or entry.goal_id in claimed
                or entry.goal_id in self._orphans
            )
            goal = self._goals[entry.goal_id] = _merge_status(previous.get(entry.goal_id), entry, ours=ours)
            goal.past = goal.past or (first and goal.status.terminal and not ours)
        self._orphans = frozenset()
        # Ended goals leave the list after 15 minutes (action_server_result_timeout); running ones never do.
        lost = frozenset(
            goal_id
            for goal_id, goal in previous.items()
            if goal.ours and not goal.status.terminal and goal_id not in self._goals
        )
        return StatusChanges(claimed, lost)

    def _find_given_before(self, listed: list[str]) -> None:
        """Find the goal that an earlier run sent last: by its prefix, or by its place behind a known goal."""
        behind, self._given_behind = self._given_behind, None
        # Goals of the action have the prefix; of goals by topic only their order is known.
        newest = next((goal_id for goal_id in reversed(listed) if self._prefix.matches(goal_id)), None)
        if behind is None or (newest is None and behind and behind not in listed):
            return
        if newest is not None:
            self.given_before = None if newest in self._orphans or newest == behind else newest
            return
        later = listed[listed.index(behind) + 1 :] if behind else listed[-1:]
        self.given_before = next((goal_id for goal_id in later if goal_id not in self._orphans), None)
        if self.given_before:
            self._orphans |= {self.given_before}

    def _expire_claims(self, now: float) -> None:
        if not self.may_list_late(now):
            self._claims = 0


def _merge_status(old: Goal | None, entry: GoalEntry, *, ours: bool) -> Goal:
    """Return the goal updated by ``entry``; an end is final, and an unknown status is ignored."""
    if old is None:
        return Goal(ours, entry.status)
    # Ends are final in rcl, and a result may arrive before an older array.
    if old.status.terminal or entry.status is GoalStatus.UNKNOWN:
        return old
    return Goal(old.ours, entry.status, old.past)
