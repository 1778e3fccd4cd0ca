"""Whether Nav2 is there and can take goals, and if not, what is missing in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum, auto

from nena_edge_agent.driver.port import NavigationReport
from nena_edge_agent.nav2.settings import Navigation, RosSettings, status_of

MISSES = 2
"""Calls without an answer after which a service counts as silent."""


class Lifecycle(Enum):
    """What Nav2's lifecycle manager says of itself."""

    ABSENT = auto()
    """There is no such service: nothing is known, and Nav2 counts as active."""
    STARTING = auto()
    """The service is there and has not answered yet, as during Nav2's bring-up."""
    ACTIVE = auto()
    INACTIVE = auto()
    SILENT = auto()


LIFECYCLE_PROBLEMS = {
    Lifecycle.INACTIVE: "says that Nav2 is not active: activate it on the robot",
    Lifecycle.STARTING: "does not answer yet: Nav2 is starting",
    Lifecycle.SILENT: "does not answer: does Nav2 hang?",
}


@dataclass(frozen=True, slots=True)
class Presence:
    """What the ROS graph shows of Nav2.

    ``servers`` are the endpoint ids of the status array's publishers; ``action``: the action's server is
    there, and this machine can speak to it.
    """

    servers: frozenset[str]
    goal_listeners: int
    lifecycle: Lifecycle
    action: bool = False


class LifecycleWatch:
    """Makes up its mind by the answers of the lifecycle manager: one that stays out can be chance."""

    def __init__(self) -> None:
        self._misses = 0
        self._known = Lifecycle.ABSENT

    def judge(self, *, there: bool, active: bool | None) -> Lifecycle:
        """Note whether the service is there, and what it answered (None: nothing)."""
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


def judge(presence: Presence, settings: RosSettings, *, pose_known: bool) -> NavigationReport:
    """Return whether goals can be given now."""
    missing = _missing(presence, settings, pose_known=pose_known)
    return NavigationReport(available=missing is None, reason=missing or "")


def _takes_goals(presence: Presence, settings: RosSettings) -> bool:
    """Return whether somebody takes goals in a way that the settings allow."""
    by_topic = presence.goal_listeners > 0 and not settings.by_action_only
    return by_topic or (presence.action and settings.navigation is not Navigation.TOPICS)


def _missing(presence: Presence, settings: RosSettings, *, pose_known: bool) -> str | None:
    names = settings.names
    where = f"in namespace {settings.namespace}, domain {settings.domain_id}"
    if not presence.servers:
        return f"no node publishes {status_of(settings.action)} {where}: is Nav2 running there?"
    if not _takes_goals(presence, settings):
        doing = f"listens to {names.goal_pose}"
        if settings.by_action_only:
            doing = f"serves the action {settings.action}"
        return f"no node {doing} {where}: is bt_navigator configured?"
    if problem := LIFECYCLE_PROBLEMS.get(presence.lifecycle):
        return f"{names.lifecycle} {where} {problem}"
    if not pose_known:
        return (
            f"no pose has come on {names.pose} {where}: set the initial position, or see whether "
            "the localisation runs"
        )
    return None
