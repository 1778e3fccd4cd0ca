"""Detects whether Nav2 is present and accepts goals, and if not, what is missing."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum, auto
from typing import Any

from nena_edge_agent.driver.port import NavigationReport
from nena_edge_agent.nav2.settings import Navigation, RosSettings, status_of

MISSES = 2
"""Unanswered calls after which a service counts as silent."""


DISCOVERY = 5.0
"""Maximum time of discovery in the ROS graph, seconds."""
POSE_FIRST = (
    "set the initial position first. Nav2's planner gives up after waiting 60 s for it: if Nav2 "
    "has run longer without one, restart it"
)
"""What to do if Nav2 is not active and the robot has no pose."""


class Lifecycle(Enum):
    """The state that Nav2's lifecycle manager reports."""

    ABSENT = auto()
    """The service does not exist: nothing is known, and Nav2 counts as active."""
    STARTING = auto()
    """The service exists but has not answered yet, as during Nav2's bring-up."""
    ACTIVE = auto()
    INACTIVE = auto()
    SILENT = auto()


LIFECYCLE_PROBLEMS = {
    Lifecycle.INACTIVE: "reports that Nav2 is not active: activate it on the robot, and if one of its "
    "servers was started again, restart the lifecycle manager as well",
    Lifecycle.STARTING: "does not answer yet: Nav2 is starting",
    Lifecycle.SILENT: "does not answer: does Nav2 hang?",
}


INCONCLUSIVE = frozenset({Lifecycle.ABSENT, Lifecycle.ACTIVE})
"""States that do not explain why Nav2 is unavailable."""


@dataclass(frozen=True, slots=True)
class Presence:
    """What the ROS graph shows of Nav2.

    ``servers`` are the endpoint IDs of the status array's publishers, ``localisers`` those of the pose's;
    ``localiser`` is the localisation's own lifecycle state. ``action``: the action's server is present, and
    this machine has its types. ``planner_gone``: the planner was present before.
    """

    servers: frozenset[str]
    goal_listeners: int
    lifecycle: Lifecycle
    action: bool = False
    localisers: frozenset[str] = frozenset()
    localiser: Lifecycle = Lifecycle.ABSENT
    planner_gone: bool = False


def endpoints(publishers: Iterable[Any], *, node_name: str | None = None) -> frozenset[str]:
    """Return the endpoint IDs of publishers in the ROS graph, of the nodes called ``node_name`` if given."""
    return frozenset(
        bytes(publisher.endpoint_gid).hex()
        for publisher in publishers
        if node_name is None or publisher.node_name == node_name
    )


class PlannerWatch:
    """Detects that the planner has died, which Nav2 itself notices only when it replans.

    A planner that was never present is not reported: some robots plan elsewhere.
    """

    def __init__(self) -> None:
        self._there = False
        self.gone = False

    def has_just_gone(self, publishers: frozenset[str]) -> bool:
        """Handle the endpoint IDs of the plan's publishers; return whether the planner has just gone."""
        # Nav2's bond takes 4 s, and stops nothing: the next replanning would fail.
        just_gone = self._there and not publishers
        self._there = bool(publishers)
        self.gone = not publishers and (self.gone or just_gone)
        return just_gone


class LifecycleWatch:
    """Determines the state from the lifecycle manager's responses; a single missing response is ignored."""

    def __init__(self) -> None:
        self._misses = 0
        self._known = Lifecycle.ABSENT

    def update(self, *, there: bool, active: bool | None) -> Lifecycle:
        """Record whether the service is present, and its answer (None: no answer)."""
        # Robots without Nav2's lifecycle manager have no such service.
        if not there:
            self._misses, self._known = 0, Lifecycle.ABSENT
        elif active is None and self._known in (Lifecycle.ABSENT, Lifecycle.STARTING):
            self._known = Lifecycle.STARTING
        elif active is None:
            self._misses += 1
            self._known = Lifecycle.SILENT if self._misses >= MISSES else self._known
        else:
            self._misses, self._known = 0, Lifecycle.ACTIVE if active else Lifecycle.INACTIVE
        return self._known


def judge_navigation(
    presence: Presence, settings: RosSettings, *, pose_known: bool, seconds: float = math.inf
) -> NavigationReport:
    """Return whether goals can be sent now; ``seconds`` is how long Nav2 has been searched for."""
    names, where = settings.names, _describe_place(settings)
    missing: str | None
    if not presence.servers:
        missing = f"no node publishes {status_of(settings.action)} {where}: is Nav2 running there?"
    elif not _takes_goals(presence, settings):
        doing = f"listens to {names.goal_pose}"
        if settings.by_action_only:
            doing = f"serves the action {settings.action}"
        missing = f"no node {doing} {where}: is bt_navigator configured?"
    else:
        missing = _inactive_part(presence, settings, pose_known=pose_known)
    # Right after the start, DDS may not have found everything yet.
    there = presence.servers and _takes_goals(presence, settings) and pose_known
    if missing and not there and seconds < DISCOVERY and presence.lifecycle in INCONCLUSIVE:
        missing = f"the agent has just started and is searching for Nav2 {where}"
        return NavigationReport(available=False, reason=missing, starting=True)
    return NavigationReport(available=missing is None, reason=missing or "")


def _takes_goals(presence: Presence, settings: RosSettings) -> bool:
    """Return whether any server accepts goals in a way that the settings allow."""
    by_topic = presence.goal_listeners > 0 and not settings.by_action_only
    return by_topic or (presence.action and settings.navigation is not Navigation.TOPICS)


def _inactive_part(presence: Presence, settings: RosSettings, *, pose_known: bool) -> str | None:
    """Return what a Nav2 that is present still lacks."""
    names, where = settings.names, _describe_place(settings)
    # The planner's activation waits 60 s for a pose and gives up for good (Jazzy, 1.3): the pose comes first.
    problem = LIFECYCLE_PROBLEMS.get(presence.lifecycle)
    if problem and not pose_known:
        return f"no pose received on {names.pose} {where}, and Nav2 is not active: {POSE_FIRST}"
    if problem:
        return f"{names.lifecycle} {where} {problem}"
    if presence.planner_gone:
        return f"no node publishes {names.plan} {where} any more: is {names.planner} running?"
    # An inactive AMCL keeps an initial pose for its activation; an unconfigured one loses it.
    if presence.localiser is Lifecycle.INACTIVE:
        return f"{names.localiser} {where} reports an inactive localisation: activate it on the robot"
    if not pose_known:
        return (
            f"no pose received on {names.pose} {where}: set the initial position, or check that "
            "the localisation runs"
        )
    return None


def _describe_place(settings: RosSettings) -> str:
    return f"in namespace {settings.namespace}, domain {settings.domain_id}"
