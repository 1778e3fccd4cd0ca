"""Track goals sent to Nav2's action, by its responses, results and feedback besides the status array.

A goal has an ID of ours and is accepted or rejected; its result has the reason for a failure, its feedback
the progress. If the action's server is missing, goals are sent by topic if the settings allow it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from nena_edge_agent.driver.port import DriveFailure, DriveGoal, DriveProgress, Pose
from nena_edge_agent.nav2.commands import Command, RequestResult, SendGoal
from nena_edge_agent.nav2.error_codes import TRANSIENT, Meaning, meaning_of
from nena_edge_agent.nav2.goal_tracker import (
    GIVEN_UP_AFTER,
    OBEYED_AFTER,
    STOPPED_AFTER,
    GoalDrive,
    GoalTracker,
)
from nena_edge_agent.nav2.goals import (
    FeedbackReading,
    GoalEntry,
    GoalIdPrefix,
    GoalResult,
    PrefixedGoalRegistry,
)
from nena_edge_agent.nav2.poses import agrees, near
from nena_edge_agent.nav2.settings import GoalSettings, Navigation, RosSettings
from nena_shared.clock import Clock
from nena_shared.log import get_logger
from nena_shared.program import StartError
from nena_shared.ros import GoalStatus

if TYPE_CHECKING:
    from nena_edge_agent.nav2.action_client import ActionClient


WITHOUT_REASON = (
    "no reason reported. Probably its lifecycle manager deactivated or paused it, or one of its servers "
    "did not answer in time: the default of 20 ms for bt_navigator's default_server_timeout is too short for "
    "a loaded computer; set 200 to 500 ms"
)
"""Explanation of a goal that is aborted with error code 0."""
SAME = 0.001
"""Maximum distance between two poses of the same node, metres."""
TURNED_AWAY = 0.3
"""Increase of the distance to a pose, m, at which the robot counts as turning away from it."""


FROM_END = 1.0
"""Distance from the end of a route, m, beyond which it is not completed, whatever navigation reports."""


class PassedPoses:
    """Tracks a goal through several poses; those after the next one are its ``ahead``."""

    def __init__(self) -> None:
        self._places: tuple[Pose, ...] = ()
        self._dropped = False
        self._closest = math.inf

    def begin(self, goal: DriveGoal) -> None:
        """Record the poses sent to navigation."""
        self._places = (goal.pose, *goal.ahead)
        self.advance()

    def advance(self) -> None:
        """Record that the next pose is now the goal."""
        self._dropped, self._closest = False, math.inf

    def covers(self, goal: DriveGoal) -> bool:
        """Return whether navigation already drives to ``goal`` and through the poses ahead of it."""
        wanted = (goal.pose, *goal.ahead)
        if len(self._places) <= 1 or len(wanted) > len(self._places):
            return False
        rest = self._places[-len(wanted) :]
        same = (near(one, other, xy=SAME, theta=None) for one, other in zip(wanted, rest, strict=True))
        return all(same)

    def left(self, goal: DriveGoal, places: int) -> None:
        """Record how many poses navigation has left to reach."""
        self._dropped = self._dropped or places <= len(goal.ahead)

    def missed(self, goal: DriveGoal, pose: Pose) -> bool:
        """Return whether the robot turns away from ``goal`` without having reached it."""
        if not goal.ahead or not self._dropped:
            return False
        away = math.dist((pose.x, pose.y), (goal.pose.x, goal.pose.y))
        self._closest = min(self._closest, away)
        return self._closest > goal.deviation_xy and away > self._closest + TURNED_AWAY


POSE_STEP = 0.05
"""Distance between two reported positions, m."""
YAW_STEP = 0.1
"""Radians."""
PROGRESS_PERIOD = 1.0
"""Seconds between two reports of the remaining distance."""
FRESH = 0.5
"""Seconds for which a pose from the feedback takes precedence over the localisation's, which are rarer."""


SILENCES = (STOPPED_AFTER, OBEYED_AFTER, GIVEN_UP_AFTER)
COUNTED = 0.2
"""Maximum time between two velocities that counts as silence, seconds; a longer gap delayed everything."""


class SilenceWatch:
    """Detects that the driving server no longer sends feedback; times are monotonic seconds.

    Once odometry has arrived, only time in which it arrives is counted: network, computer and this program
    work then, so only the server is silent. A goal without feedback so far is not watched: goals sent by
    topic may never have any.
    """

    def __init__(self) -> None:
        self._heard_at: float | None = None
        self._goal_id = ""
        self._odometry_at = -math.inf
        self._silent_for = 0.0
        self._reported = 0

    @property
    def by_odometry(self) -> bool:
        """Return whether odometry has arrived, so that :meth:`on_velocity` alone decides."""
        return self._odometry_at != -math.inf

    def heard(self, goal_id: str, now: float) -> None:
        """Record feedback for one of our goals that has not ended."""
        self._heard_at, self._goal_id, self._silent_for, self._reported = now, goal_id, 0.0, 0

    def on_velocity(self, now: float, live: Sequence[str]) -> float:
        """Record that odometry has arrived; return the seconds of a silence to handle now, or 0.

        ``live`` are our goals that have not ended.
        """
        before, self._odometry_at = self._odometry_at, now
        if self._heard_at is None or self._goal_id not in live:
            self._heard_at = None
            return 0.0
        self._silent_for += min(now - max(before, self._heard_at), COUNTED)
        passed = sum(self._silent_for >= each for each in SILENCES)
        if passed <= self._reported:
            return 0.0
        self._reported = passed
        return self._silent_for

    def silent_for(self, now: float, live: Sequence[str]) -> float:
        """Return the seconds since the last feedback; 0 before the first of a goal."""
        return 0.0 if self._heard_at is None or self._goal_id not in live else now - self._heard_at


class FeedbackFilter:
    """Selects the feedback to report; times are monotonic seconds."""

    def __init__(self) -> None:
        self._received_at = -math.inf
        self._place = (math.inf, math.inf)
        self._yaw = 0.0
        self._progress_at = -math.inf
        self._progress: tuple[str, int] = ("", 0)

    def fresh(self, now: float) -> bool:
        """Return whether feedback with positions is arriving now."""
        return now - self._received_at < FRESH

    def moved(self, reading: FeedbackReading, now: float) -> bool:
        """Return whether to report the position."""
        self._received_at = now
        here = (reading.x, reading.y)
        turned = abs(math.remainder(reading.yaw - self._yaw, math.tau))
        if math.dist(here, self._place) < POSE_STEP and turned < YAW_STEP:
            return False
        self._place, self._yaw = here, reading.yaw
        return True

    def progress(self, reading: FeedbackReading, map_id: str, now: float) -> DriveProgress | None:
        """Return the remaining distance to report, None if there is nothing new.

        A recovery is reported at once.
        """
        drive = (reading.goal_id, reading.recoveries)
        if drive == self._progress and now - self._progress_at < PROGRESS_PERIOD:
            return None
        self._progress, self._progress_at = drive, now
        left = reading.left if reading.left > 0.0 else None  # Nav2 reports 0 while it has no path
        return DriveProgress(left, reading.recoveries, map_id)


log = get_logger(__name__)

REASON_WAIT = 2.0
"""Timeout for the reason of an aborted goal after the array with its end, seconds.

It is the error code of its result, or that Nav2 is no longer available, which the agent checks once a second.
Without nav2_msgs, and in Humble, there is no code.
"""


class ActionTracker(GoalTracker):
    """The tracker for Nav2's action; the driver sets ``by_action`` while the action's server is available."""

    def __init__(
        self, settings: GoalSettings, prefix: GoalIdPrefix, *, halts_after: GoalTracker | None = None
    ) -> None:
        super().__init__(settings, halts_after=halts_after)
        self._prefix = prefix
        self._registry: PrefixedGoalRegistry = PrefixedGoalRegistry(
            prefix, confirmation_time=settings.confirmation_time, settle_time=settings.settle_time
        )
        self.by_action = False
        self._passed = PassedPoses()
        self._sent_for: GoalDrive | None = None
        self._sent: list[str] = []
        self._refused = False
        self._result_requested = ""
        self._reason: tuple[str, int, Meaning | None] = ("", 0, None)
        self._aborted: tuple[str, float] | None = None

    @property
    def goal_id(self) -> str | None:
        """Return the goal that Nav2 drives to for us, once it has accepted it."""
        return self._drive.goal_id if self._drive is not None else None

    @property
    def busy(self) -> bool:
        """Return whether something is awaited, so that :meth:`tick` is needed."""
        return self._aborted is not None or self._registry.yields or super().busy

    def go_to(self, goal: DriveGoal, now: float) -> list[Command]:
        """Drive to ``goal``; if the current goal already leads there, nothing is sent."""
        drive = self._drive
        same = drive is not None and drive is self._sent_for and drive.goal_id in self._sent
        if drive is not None and same and self._aborted is None and self._passed.covers(goal):
            drive.goal = goal
            self._passed.advance()
            return self._advance(now)
        return super().go_to(goal, now)

    def on_pose(self, pose: Pose, now: float) -> list[Command]:
        """Handle a pose; resend a pose that a goal through several poses has skipped."""
        drive = self._drive
        if drive is not None and drive.reached_at is None and self._passed.missed(drive.goal, pose):
            self._send_alone(drive)
        return super().on_pose(pose, now)

    def on_places(self, goal_id: str, left: int) -> None:
        """Handle the number of poses that navigation has left to reach."""
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id:
            self._passed.left(drive.goal, left)

    def on_other_statuses(self, entries: Sequence[GoalEntry], now: float) -> list[Command]:
        """Handle the status array of the action that this agent does not use."""
        foreign = self._registry.set_others(entries, now)
        self._report_table()
        drive = self._drive
        if foreign and drive is not None and drive.goal_id is not None and drive.reached_at is None:
            text = (
                f"another program sent Nav2 a goal ({foreign}), which Nav2 rejects while it drives through "
                "several poses: this robot pauses, so that the goal can be resent"
            )
            self._fail(drive, DriveFailure.TAKEN_OVER, text)
        return self._advance(now)

    def on_goal_answer(self, goal_id: str, now: float, *, accepted: bool | None) -> list[Command]:
        """Handle the response to a sent goal; None: there was none, and the status array shows the result."""
        drive = self._drive
        if accepted:
            self._registry.accept(goal_id)
            if drive is not None and drive is self._sent_for and goal_id in self._sent:
                drive.goal_id, drive.reached_at = goal_id, None
            self._report_table()
        elif accepted is False:
            self._refused = True
        return self._advance(now)

    def on_result(
        self, goal_id: str, status: GoalStatus, reason: tuple[int, str] | None, now: float
    ) -> list[Command]:
        """Handle the result of a goal: its last status, and its ``error_code`` and ``error_msg``, if any."""
        self._registry.settle(goal_id, status)
        if status.terminal and reason is not None:
            self._reason = (goal_id, reason[0], meaning_of(*reason))
        if status.terminal:
            self._report_table()
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id and drive.reached_at is None:
            self._follow(drive, goal_id, now, lost=False)
        return self._advance(now)

    def _publish(self, drive: GoalDrive, now: float) -> None:
        if not self.by_action:
            super()._publish(drive, now)
            return
        if drive is not self._sent_for:
            self._sent_for, self._sent, self._refused = drive, [], False
        goal_id = self._prefix.new()
        self._passed.begin(drive.goal)
        self._sent.append(goal_id)
        self._registry.sent(now)
        self._out.append(SendGoal(drive.goal, goal_id))

    def _bind(self, drive: GoalDrive, claimed: tuple[str, ...]) -> None:
        """Find the goal in the array in case its response was lost."""
        super()._bind(drive, claimed)
        if drive.goal_id is None and drive is self._sent_for:
            listed = [each for each in self._sent if self._registry.status(each) is not None]
            drive.goal_id = listed[-1] if listed else None

    def _judge_arrival(self, now: float) -> None:
        """Wait at the end of a route until its nodes are reported as passed; drive to one that was not."""
        drive, pose = self._drive, self._pose
        if drive is None or drive.reached_at is None or not drive.goal.ahead or pose is None:
            super()._judge_arrival(now)
        elif agrees(pose, drive.goal):
            self._arrive(drive, now)
        elif drive.may_be_undriven and not near(pose, drive.goal.ahead[-1], xy=FROM_END, theta=None):
            self._resend(drive)
        elif now - drive.reached_at >= self._settings.pose_wait:
            self._send_alone(drive)

    def _send_alone(self, drive: GoalDrive) -> None:
        """Resend a goal without the poses after it."""
        log.info("a skipped node is driven to separately", generation=drive.goal.generation)
        self._drive = GoalDrive(replace(drive.goal, ahead=()))

    def _advance(self, now: float) -> list[Command]:
        drive = self._drive
        if self._aborted is not None:
            goal_id = self._aborted[0]
            if drive is not None and drive.goal_id == goal_id:
                self._follow(drive, goal_id, now, lost=False)
            else:
                self._aborted = None
        if self._registry.end_yielding(now):
            self._report_table()
        self._request_result()
        return super()._advance(now)

    def _request_result(self) -> None:
        """Request the result of the current goal once, also of one of an earlier run or sent by topic."""
        goal_id = self.goal_id
        if goal_id is not None and goal_id != self._result_requested:
            self._result_requested = goal_id
            self._out.append(RequestResult(goal_id))

    def _follow(self, drive: GoalDrive, goal_id: str, now: float, *, lost: bool) -> None:
        """Delay the end of an aborted goal until its reason is known.

        Nav2 aborts goals without a reason when it is deactivated or stopped, and only then says so.
        """
        aborted = self._registry.status(goal_id) is GoalStatus.ABORTED and not lost
        known = self._reason[0] == goal_id or self._registry.taken_over(goal_id) is not None
        if aborted and not known and self._navigation.available:
            self._aborted = self._aborted or (goal_id, now)
            if now - self._aborted[1] < REASON_WAIT:
                return
        self._aborted = None
        super()._follow(drive, goal_id, now, lost=lost)

    def _fail_aborted(self, drive: GoalDrive, goal_id: str) -> None:
        failed_id, code, meaning = self._reason
        known, text = failed_id == goal_id, f"Nav2 has aborted the goal {goal_id}"
        if known and meaning is not None:
            text, transient = f"{text}: {meaning.reason}", code in TRANSIENT
            self._fail(drive, DriveFailure.ABORTED, text, hint=meaning.hint, code=code, transient=transient)
        elif (known or not self._navigation.available) and self._registry.taken_over(goal_id) is None:
            self._fail(drive, DriveFailure.ABORTED, f"{text}: {WITHOUT_REASON}", transient=True)
        else:
            super()._fail_aborted(drive, goal_id)

    def _refusal(self, drive: GoalDrive) -> str:
        if drive is self._sent_for and self._refused:
            return f"Nav2 rejected the goal, sent {drive.times_sent} times: is bt_navigator active?"
        return super()._refusal(drive)


class ActionSide:
    """Executes the tracker's commands on the action, and passes the responses to the tracker.

    ``apply`` executes the tracker's other commands. rclpy is imported with the first client.
    """

    def __init__(
        self,
        tracker: ActionTracker,
        *,
        apply: Callable[[Iterable[Command]], None],
        on_feedback: Callable[[FeedbackReading], None],
        clock: Clock,
    ) -> None:
        self._tracker = tracker
        self._apply = apply
        self._on_feedback = on_feedback
        self._clock = clock
        self._client: ActionClient | None = None
        self._sends = False

    @staticmethod
    def check(settings: RosSettings) -> None:
        """Check that the installation has what the settings require.

        Raises:
            StartError: the action is required, and its types cannot be loaded.
        """
        from nena_edge_agent.nav2.action_client import action_type  # noqa: PLC0415 - loads rclpy

        if settings.by_action_only and action_type(settings.navigation) is None:
            message = (
                "nav2_msgs cannot be loaded: source the robot's ROS installation with Nav2 before the start, "
                "or set ros.navigation = topics"
            )
            raise StartError(message)

    def new_client(self, settings: RosSettings) -> list[ActionClient]:
        """Return the extensions for a new node: none without nav2_msgs.

        Goals sent by topic have results and feedback as well.
        """
        from nena_edge_agent.nav2.action_client import ActionClient, action_type  # noqa: PLC0415

        self._sends, types = settings.navigation is not Navigation.TOPICS, action_type(settings.navigation)
        self._client = None
        if types is None:
            return []
        self._client = ActionClient(
            settings, types, on_result=self._on_result, on_feedback=self._take_feedback
        )
        return [self._client]

    def look(self) -> bool:
        """Check whether a server accepts goals; if so, the next goal is sent to it."""
        self._tracker.by_action = self._sends and self._client is not None and self._client.ready
        return self._tracker.by_action

    def on_other_statuses(self, entries: list[GoalEntry]) -> None:
        """Handle the statuses of the action that only other clients use."""
        self._apply(self._tracker.on_other_statuses(entries, self._clock.monotonic()))

    async def send(self, goal: DriveGoal, goal_id: str) -> None:
        """Send a goal and handle the server's response."""
        log.info("goal sent", generation=goal.generation, goal=goal_id, x=goal.pose.x, y=goal.pose.y)
        accepted = (
            await self._client.send(goal_id, (goal.pose, *goal.ahead), goal.behavior_tree)
            if self._client is not None
            else None
        )
        self._apply(self._tracker.on_goal_answer(goal_id, self._clock.monotonic(), accepted=accepted))

    def request_result(self, goal_id: str) -> None:
        """Request the result of a goal; the server sends it when the goal ends."""
        if self._client is not None:
            self._client.request_result(goal_id)

    def _on_result(self, result: GoalResult) -> None:
        now = self._clock.monotonic()
        self._apply(self._tracker.on_result(result.goal_id, result.status, result.reason, now))

    def _take_feedback(self, reading: FeedbackReading) -> None:
        self._tracker.on_places(reading.goal_id, reading.places_left)
        self._on_feedback(reading)
