"""Track goals sent to one of Nav2's servers, by its action or by topic.

Inputs are events and the time (monotonic seconds), outputs are commands. A goal waits for Nav2 or for the end
of a cancelled goal, is resent until the server accepts it or the status array lists it, is tracked by its ID,
and counts as reached when a pose confirms it. If the server ignores a halt, the controller itself is stopped.

By the action, a goal has an ID of ours, its result has the reason for a failure, its feedback the progress.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import dist, inf

from nena_edge_agent.driver.port import (
    Arrived,
    DriveFailed,
    DriveFailure,
    DriveGoal,
    DriverEvent,
    GoalTable,
    Halted,
    HaltFailed,
    NavigationReport,
    OwnGoals,
    Pose,
)
from nena_edge_agent.nav2.commands import (
    CancelGoal,
    Command,
    PublishGoal,
    Report,
    RequestPose,
    RequestResult,
    SendGoal,
    Server,
    StopMotion,
)
from nena_edge_agent.nav2.error_codes import TRANSIENT, Meaning, meaning_of
from nena_edge_agent.nav2.feedback import GIVEN_UP_AFTER, OBEYED_AFTER, PassedPoses
from nena_edge_agent.nav2.goals import GoalEntry, GoalIdPrefix, GoalRegistry, GoalResult
from nena_edge_agent.nav2.poses import SAME, has_reached, near
from nena_edge_agent.nav2.robot_base import Standstill
from nena_edge_agent.nav2.settings import GoalSettings
from nena_shared.log import get_logger
from nena_shared.ros import GoalStatus

LATE_AT_MOST = 8.0
"""Time after an arrival in which poses of a moving robot count as late, seconds."""
STANDS = 0.1
"""Difference between poses of a robot at standstill, m and rad."""


@dataclass(slots=True)
class GoalDrive:
    """The goal requested by the protocol core; times are monotonic seconds."""

    goal: DriveGoal
    times_sent: int = 0
    counted_from: int = 0
    """``times_sent`` when Nav2 was last unavailable; attempts before that do not count."""
    preempts: bool = False
    """Whether another goal was active or not listed yet when it was sent, whose result it may get."""
    interrupted: bool = False
    """Whether the controller was stopped on the way: the navigator may mistake that for success."""
    give_up_at: float | None = None
    goal_id: str | None = None
    reached_at: float | None = None
    pose_asked_at: float | None = None
    late_at: float = -inf
    """When a pose last showed the robot driving after its arrival."""
    _shown_driving: bool = False
    """Whether the last pose shows the robot driving."""

    @property
    def tries(self) -> int:
        """Return the number of attempts since Nav2 became available."""
        return self.times_sent - self.counted_from

    @property
    def may_be_undriven(self) -> bool:
        """Return whether it may succeed without the robot arriving."""
        return self.preempts or self.interrupted

    def on_pose(self, pose: Pose, before: Pose, now: float) -> None:
        """Record a pose and its predecessor; on busy computers, poses are received long after the arrival."""
        self._shown_driving = not near(pose, before, xy=STANDS, theta=STANDS)
        if self.reached_at is not None and self._shown_driving:
            self.late_at = min(now, self.reached_at + LATE_AT_MOST)

    def poses_are_late(self, now: float) -> bool:
        """Return whether no pose has followed the arrival, though the last one shows the robot moving."""
        if self.reached_at is None or self.late_at != -inf:
            return False
        return self._shown_driving and now - self.reached_at < LATE_AT_MOST

    def pose_may_come(self, now: float, wait: float) -> bool:
        """Return whether a pose may still confirm the arrival: within ``wait`` s of it, or of a late pose."""
        return self.reached_at is not None and now - max(self.reached_at, self.late_at) < wait


log = get_logger(__name__)

WITHOUT_REASON = (
    "no reason reported. Probably its lifecycle manager deactivated or paused it, or one of its servers "
    "did not answer in time: the default of 20 ms for bt_navigator's default_server_timeout is too short for "
    "a loaded computer; set 200 to 500 ms"
)
"""Explanation of a goal that is aborted with error code 0."""
REASON_WAIT = 2.0
"""Timeout for the reason of an aborted goal after the array with its end, seconds.

It is the error code of its result, or that Nav2 is no longer available, which the agent checks once a second.
Without nav2_msgs, and in Humble, there is no code.
"""
FROM_END = 1.0
"""Distance from the end of a route, m, beyond which it is not completed, whatever navigation reports."""
UNKNOWN_GOAL_ID = 2
"""Answer of action_msgs/srv/CancelGoal for an unknown goal."""
STALE_XY = 0.25
"""Metres that a robot may drive before AMCL sends a pose (``update_min_d``)."""
STALE_THETA = 0.2
"""Radians that a robot may turn before AMCL sends a pose (``update_min_a``)."""

PLAN_TOLERANCE = 0.75
"""Metres from the goal at which Nav2 may end its plan."""
EARLIER = "earlier"
"""Represents a path of an earlier run: its goal ID is not journalled, but has the agent's prefix."""
RECLAIM_TIME = 10.0
"""Seconds after a restart in which the order may still request Nav2's current goal."""
OBEYED_WITHIN = 0.5
"""Timeout for the robot to slow down after a halt, seconds; then its controller is stopped."""
RECLAIM_SERVER_WAIT = 5.0
"""Timeout for the navigator of an earlier run's goal to appear, seconds: DDS may need a while to find it.

Then the robot is stopped, and a halt fails if it is not confirmed within its own timeout."""


@dataclass(slots=True)
class _Halt:
    """A stop that is not confirmed yet: requested at ``asked_at``, enforced since ``since``.

    ``may_move``: the robot had a goal of ours since the last confirmed stop, or moves. ``quiet_at``: when the
    last of our goals had ended. ``failed``: ``HaltFailed`` has been reported.
    """

    asked_at: float
    since: float
    may_move: bool
    quiet_at: float | None = None
    failed: bool = False


class GoalTracker:
    """Tracks the goals of one server; its methods return the commands to execute now."""

    def __init__(
        self,
        settings: GoalSettings,
        prefix: GoalIdPrefix,
        server: Server = Server.NAVIGATOR,
        *,
        halts_after: GoalTracker | None = None,
    ) -> None:
        """Prepare; ``halts_after``: another tracker of the robot, after which this one answers a halt."""
        self._settings = settings
        self._server = server
        self._prefix = prefix
        self._registry = GoalRegistry(
            prefix, confirmation_time=settings.confirmation_time, settle_time=settings.settle_time
        )
        self.by_action = False
        """Whether goals are sent to the action; set by the driver while its server is available."""
        self._passed = PassedPoses()
        self._sent_for: GoalDrive | None = None
        self._sent: list[str] = []
        self._refused = False
        self._result_requested = ""
        self._reason: tuple[str, int, Meaning | None] = ("", 0, None)
        self._aborted: tuple[str, float] | None = None
        self._standstill = Standstill()
        self._navigation = NavigationReport(available=False, reason="Nav2 has not been searched for yet")
        self._drive: GoalDrive | None = None
        self._halt: _Halt | None = None
        self._drove = False
        """Whether a goal was requested since the last confirmed stop, so that the robot may still roll."""
        self._halts_after = halts_after
        self._cancels: dict[str, float] = {}
        self._runaway = False
        """Whether the robot may drive although its navigator is gone or does not respond."""
        self._silent = False
        """Whether the only evidence for that is the navigator's silence."""
        self._stop_again_at = -float("inf")
        self._stop_answered = False
        self._no_server_since: float | None = None
        self._server_found = False
        self._pose: Pose | None = None
        self._pose_at = self._localised_at = -float("inf")
        self._table = GoalTable()
        self._reclaimed: OwnGoals | None = None
        self._reclaimed_until: float | None = None
        self._arrived_at: float | None = None
        """When the last goal was reached; set while a pose at rest still has to be requested."""
        self._out: list[Command] = []

    @property
    def busy(self) -> bool:
        """Return whether something is awaited, so that :meth:`tick` is needed."""
        drive = self._drive
        waiting = drive is not None and (drive.goal_id is None or drive.reached_at is not None)
        stopping = self._halt is not None or bool(self._cancels) or self._runaway
        judging = self._aborted is not None or self._arrived_at is not None or self._registry.yields
        return waiting or stopping or judging or self._reclaimed is not None

    @property
    def goal_id(self) -> str | None:
        """Return the goal that Nav2 drives to for us, once it has accepted it."""
        return self._drive.goal_id if self._drive is not None else None

    @property
    def driving(self) -> bool:
        """Return whether Nav2 drives to the current goal."""
        drive = self._drive
        return drive is not None and drive.goal_id is not None and drive.reached_at is None

    @property
    def active(self) -> bool:
        """Return whether a goal of ours has not ended: the current one, or an earlier one."""
        return self.driving or bool(self._registry.live)

    @property
    def live(self) -> tuple[str, ...]:
        """Return the IDs of our goals that have not ended."""
        return self._registry.live

    @property
    def wanted(self) -> DriveGoal | None:
        """Return the active or waiting goal."""
        return self._drive.goal if self._drive is not None else None

    @property
    def may_drive(self) -> bool:
        """Return whether Nav2 drives for us, or may still start a goal that was sent."""
        drive = self._drive
        sent = drive is not None and drive.reached_at is None and drive.tries > 0
        return sent or bool(self._registry.live)

    @property
    def others_run(self) -> bool:
        """Return whether Nav2 drives for another client."""
        return self._registry.others_run

    @property
    def halting(self) -> bool:
        """Return whether a halt has not been answered by ``Halted``."""
        return self._halt is not None

    def awaits_goal(self, now: float) -> bool:
        """Return whether a sent goal may still be accepted."""
        return self._registry.is_awaiting(now)

    def is_own_plan(self, place: tuple[float, float]) -> bool:
        """Return whether a plan that ends at ``place`` (m) is for the current goal."""
        drive = self._drive
        if drive is None:
            return False
        return dist(place, (drive.goal.pose.x, drive.goal.pose.y)) <= PLAN_TOLERANCE

    def reclaim(self, goals: OwnGoals) -> None:
        """Treat the goals of an earlier run as ours; call it before anything else."""
        self._registry.reclaim(goals.goal_ids, goals.behind if goals.given else None)
        self._reclaimed = goals

    def expect_earlier(self) -> None:
        """Assume a goal of an earlier run until the server's status array shows whether there is one."""
        self._registry.reclaim((EARLIER,))

    def may_drive_earlier(self, now: float) -> bool:
        """Return whether the server may drive for us, also to a goal of an earlier run."""
        registry = self._registry
        return bool(registry.live) or (registry.orphaned and not registry.is_settled(now))

    def go_to(self, goal: DriveGoal, now: float) -> list[Command]:
        """Drive to ``goal`` without a stop; nothing is sent if a route through several poses leads there."""
        drive = self._drive
        same = drive is not None and drive is self._sent_for and drive.goal_id in self._sent
        if drive is not None and same and self._aborted is None and self._passed.covers(goal):
            drive.goal = goal
            self._passed.advance_goal()
            return self._advance_all(now)
        self._drove = True
        self._drive = GoalDrive(goal, preempts=self._registry.may_list_late(now))
        return self._advance_all(now)

    def drop(self, now: float) -> list[Command]:
        """Cancel the current goal without an answer: the goal that was to replace it cannot be sent."""
        self._drive = self._reclaimed = None
        return self._advance_all(now)

    def halt(self, now: float) -> list[Command]:
        """Drop the goal and stop; answered by ``Halted`` or ``HaltFailed``."""
        self._drive = self._reclaimed = None
        if self._halt is None:
            self._halt, self._stop_answered = _Halt(now, now, may_move=self._drove), False
        elif self._halt.failed:
            self._halt.since, self._halt.failed = now, False
        return self._advance_all(now)

    def on_statuses(self, entries: Sequence[GoalEntry], now: float) -> list[Command]:
        """Handle a status array: all goals that the server remembers."""
        changes = self._registry.update(entries, now)
        self._runaway = False  # the navigator responds, and its goals can be cancelled
        self._report_table()
        drive = self._drive
        if drive is not None and drive.times_sent:
            # SimpleActionServer (nav2_util) has one pending slot: a newer goal ends the older one as aborted.
            if changes.claimed:
                drive.goal_id, drive.reached_at = changes.claimed[-1], None
            elif drive.goal_id is None and drive is self._sent_for:
                # The server lists a goal sent by the action even if its answer was lost.
                listed = [goal_id for goal_id in self._sent if self._registry.status(goal_id) is not None]
                drive.goal_id = listed[-1] if listed else None
        if drive is not None and drive.goal_id is not None and drive.reached_at is None:
            self._follow_status(drive, drive.goal_id, now, lost=drive.goal_id in changes.lost)
        return self._advance_all(now)

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
            self._fail_drive(drive, DriveFailure.TAKEN_OVER, text)
        return self._advance_all(now)

    def on_goal_answer(self, goal_id: str, now: float, *, accepted: bool | None) -> list[Command]:
        """Handle the response to a sent goal; None: there was none, and the status array shows the result."""
        drive = self._drive
        if accepted:
            # The array with it may come later, or be lost: the status topic keeps its last sample only.
            self._registry.record_accepted(goal_id)
            if drive is not None and drive is self._sent_for and goal_id in self._sent:
                drive.goal_id, drive.reached_at = goal_id, None
            self._report_table()
        elif accepted is False:
            self._refused = True
        return self._advance_all(now)

    def on_result(self, result: GoalResult, now: float) -> list[Command]:
        """Handle the result of a goal: its last status, and its ``error_code`` and ``error_msg``, if any."""
        goal_id, status, reason = result.goal_id, result.status, result.reason
        self._registry.record_end(goal_id, status)
        # A cancelled goal may carry the code of a plan that failed before (208, seen in Jazzy 1.3.13).
        if status.terminal and reason is not None:
            self._reason = (goal_id, reason[0], meaning_of(*reason))
        if status.terminal:
            self._report_table()
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id and drive.reached_at is None:
            self._follow_status(drive, goal_id, now, lost=False)
        return self._advance_all(now)

    def on_cancel_answer(self, goal_id: str, code: int | None, now: float) -> list[Command]:
        """Handle the code of a cancel call, None for no answer; the goal's status shows its effect."""
        # Code 3 (already terminal or canceling) needs nothing: the array shows which (rcl_action,
        # action_server.c).
        if code == UNKNOWN_GOAL_ID:
            self._registry.record_unknown(goal_id)
        elif code is None:
            log.warning("no answer to a cancel request", goal=goal_id)
        return self._advance_all(now)

    def on_stop_answer(self, now: float, *, answered: bool) -> list[Command]:
        """Record whether the controller has answered that its goals are cancelled."""
        self._stop_answered = self._stop_answered or answered
        return self._advance_all(now)

    def on_silence(self, seconds: float, now: float) -> list[Command]:
        """Stop the controller: the server that drives for us has sent no feedback for ``seconds``.

        The goal is kept at first: a server that was only busy mistakes the stop for success, and the goal is
        resent.
        """
        self._run_away(now, silent=self._silent or not self._runaway)
        drive, standstill = self._drive, self._standstill
        if drive is None:
            return self._advance_all(now)
        drive.interrupted = True
        obeys = standstill.stands(now) or now - standstill.slowed_at < OBEYED_WITHIN
        if seconds >= GIVEN_UP_AFTER or (seconds >= OBEYED_AFTER and not obeys):
            text = f"{self._server} has sent no feedback for {seconds:.1f} s; stopping its controller"
            self._fail_drive(drive, DriveFailure.NAVIGATION_GONE, text)
        return self._advance_all(now)

    def on_feedback(self) -> None:
        """Record feedback for a goal of ours: a navigator that was only silent for a while may drive on."""
        if self._silent:
            self._runaway = self._silent = False

    def on_pose(self, pose: Pose, now: float) -> list[Command]:
        """Handle a pose of the localisation."""
        drive = self._drive
        if drive and drive.reached_at is None and self._passed.is_missed(drive.goal, pose):
            self._send_alone(drive)
        if self._drive and self._pose:
            self._drive.on_pose(pose, self._pose, now)
        if self._pose is None:
            self._localised_at = now
        self._pose, self._pose_at = pose, now
        return self._advance_all(now)

    def on_places(self, goal_id: str, left: int) -> None:
        """Record the number of poses that navigation has left to reach."""
        drive = self._drive
        if drive is not None and drive.goal_id == goal_id:
            self._passed.on_places_left(drive.goal, left)

    def forget_pose(self) -> None:
        """Discard the robot's pose: the localisation has lost it."""
        self._pose = None

    def on_velocity(self, speed: float, omega: float, now: float) -> None:
        """Handle a velocity of the odometry, m/s and rad/s."""
        self._standstill.on_velocity(speed, omega, now)

    def on_servers(self, servers: frozenset[str], now: float) -> list[Command]:
        """Handle the endpoint IDs of the status array's publishers."""
        drove = bool(self._registry.live)
        gone = self._registry.set_servers(servers, now)
        self._report_table()
        if servers:
            self._no_server_since, self._server_found = None, True
        elif self._no_server_since is None:
            self._no_server_since = now
        elif self._reclaimed is not None and now - self._no_server_since >= RECLAIM_SERVER_WAIT:
            self._reclaimed = None
            self._run_away(now)
        # When bt_navigator is killed, controller_server drives its path to the end (seen in Jazzy, 1.3.13).
        if gone and drove:
            self._run_away(now)
        drive = self._drive
        if gone and drive is not None and drive.reached_at is None:
            if drive.goal_id is not None:
                text = "Nav2 stopped or restarted during the drive"
                self._fail_drive(drive, DriveFailure.NAVIGATION_GONE, text)
            else:
                drive.counted_from, drive.give_up_at = drive.times_sent, None
        return self._advance_all(now)

    def on_planner_gone(self, now: float) -> list[Command]:
        """Stop the robot: the planner has died, and Nav2 would drive on until it needs the planner."""
        drive = self._drive
        if drive is not None and drive.goal_id is not None and drive.reached_at is None:
            self._run_away(now)
            self._fail_drive(drive, DriveFailure.NAVIGATION_GONE, "Nav2's planner stopped during the drive")
        return self._advance_all(now)

    def on_navigation(self, report: NavigationReport, now: float) -> list[Command]:
        """Record whether goals can be sent."""
        # A lifecycle PAUSE and a SIGTERM of Nav2 end the goal as aborted with code 0 (Jazzy, 1.3.13).
        lost = self._navigation.available and not report.available
        # A deactivated Nav2 aborts, but a hanging one may drive on.
        if lost and self._registry.live:
            self._run_away(now)
        if lost and self._drive is not None:
            self._drive.interrupted = True
        self._navigation = report
        return self._advance_all(now)

    def tick(self, now: float) -> list[Command]:
        """Advance the time."""
        return self._advance_all(now)

    def _advance_all(self, now: float) -> list[Command]:
        # In this order: ends first, then halts and arrivals, then goals to send, then goals to cancel.
        # An aborted goal ends once its reason is known, or does not come.
        drive = self._drive
        if self._aborted is not None and drive is not None and drive.goal_id == self._aborted[0]:
            self._follow_status(drive, drive.goal_id, now, lost=False)
        else:
            self._aborted = None
        if self._registry.end_yielding(now):
            self._report_table()
        # Once per goal, also for one of an earlier run or sent by topic: only the result has the error code.
        goal_id = self.goal_id
        if goal_id is not None and goal_id != self._result_requested:
            self._result_requested = goal_id
            self._out.append(RequestResult(goal_id, self._server))
        self._answer_halt(now)
        self._judge_arrival(now)
        self._send_or_give_up(now)
        self._stop_motion(now)
        # The order may request the goal of an earlier run for a while; then it is cancelled.
        if self._reclaimed is not None and self._registry.is_settled(now):
            if self._reclaimed_until is None:
                self._reclaimed_until = now + RECLAIM_TIME
            if now >= self._reclaimed_until:
                self._reclaimed = None
        self._cancel_leftovers(now)
        self._refresh_pose(now)
        commands, self._out = self._out, []
        return commands

    def _follow_status(self, drive: GoalDrive, goal_id: str, now: float, *, lost: bool) -> None:
        """Apply the status of the goal; 0 to 3 mean that it is still active.

        The end of an aborted goal is delayed until its reason is known: Nav2 aborts goals without a reason
        when it is deactivated or stopped, and only then says so.
        """
        status = self._registry.status(goal_id)
        explained = self._reason[0] == goal_id or self._registry.taken_over(goal_id) is not None
        # A goal that is being cancelled may still end in SUCCEEDED or ABORTED (rcl, goal_state_machine.c).
        if status is GoalStatus.ABORTED and not lost and not explained and self._navigation.available:
            self._aborted = self._aborted or (goal_id, now)
            if now - self._aborted[1] < REASON_WAIT:
                return
        self._aborted = None
        if lost:
            text = f"Nav2 no longer lists the goal {goal_id}: it was restarted"
            self._fail_drive(drive, DriveFailure.NAVIGATION_GONE, text)
        elif status is GoalStatus.SUCCEEDED:
            drive.reached_at = now
        elif status is GoalStatus.CANCELED:
            text = f"the goal {goal_id} was cancelled by another program"
            self._fail_drive(drive, DriveFailure.CANCELED_FROM_OUTSIDE, text)
        elif status is GoalStatus.ABORTED:
            self._fail_aborted(drive, goal_id)

    def _fail_aborted(self, drive: GoalDrive, goal_id: str) -> None:
        successor, (failed_id, code, meaning) = self._registry.taken_over(goal_id), self._reason
        explained, text = failed_id == goal_id, f"Nav2 has aborted the goal {goal_id}"
        if explained and meaning is not None:
            text, transient = f"{text}: {meaning.reason}", code in TRANSIENT
            self._fail_drive(
                drive, DriveFailure.ABORTED, text, hint=meaning.hint, code=code, transient=transient
            )
        elif successor is not None:
            text = f"the goal {goal_id} was replaced by another program's goal ({successor})"
            self._fail_drive(drive, DriveFailure.TAKEN_OVER, text)
        # Code 0: Nav2 was deactivated, or one of its servers did not answer within default_server_timeout.
        elif explained or not self._navigation.available:
            self._fail_drive(drive, DriveFailure.ABORTED, f"{text}: {WITHOUT_REASON}", transient=True)
        else:
            text = (
                f"{text}: the goal cannot be reached, the route is blocked, "
                "or the robot is not localised; Nav2's log on the robot shows which"
            )
            self._fail_drive(drive, DriveFailure.ABORTED, text)

    def _answer_halt(self, now: float) -> None:
        """Confirm a halt once the robot is at standstill; fail it if it keeps moving or is not confirmed."""
        halt, registry = self._halt, self._registry
        if halt is None:
            return
        halt.may_move = halt.may_move or registry.orphaned or self._runaway or self._standstill.moving
        # A goal on its way may still start the robot: a halt cannot be confirmed before it is listed or
        # given up.
        # After a start, DDS may need a while to find the navigator of an earlier run's goals.
        since = halt.asked_at if self._no_server_since is None else self._no_server_since
        searches = registry.orphaned and not self._server_found and now - since < RECLAIM_SERVER_WAIT
        if registry.is_awaiting(now) or registry.may_still_drive(now) or searches:
            halt.since = now
            unsettled = True
        else:
            unsettled = bool(registry.live)
        if unsettled:
            halt.may_move, halt.quiet_at = True, None
        elif halt.quiet_at is None:
            halt.quiet_at = now
        if self._stands_without_goals(halt, now):
            if self._halts_after is not None and self._halts_after.halting:
                return
            self._halt, self._drove = None, False
            self._report_event(Halted())
            return
        began = max(halt.since, halt.quiet_at or halt.since, self._standstill.slowed_at)
        overdue = now - began >= self._settings.standstill_timeout
        if overdue and not halt.failed and not self._standstill.stands(now):
            halt.failed = True
            self._report_event(HaltFailed(self._why_not_halted(now)))

    def _stands_without_goals(self, halt: _Halt, now: float) -> bool:
        """Return whether the robot is at standstill and no goal of ours will move it.

        Without odometry: a robot that was not driving, or after a while one whose servers have confirmed the
        stop.
        """
        settled = halt.quiet_at is not None
        if settled and self._registry.others_run:
            return True  # another client drives, and is not stopped
        if self._standstill.known(now):
            return self._standstill.stands(now) and (settled or self._stop_answered)
        if halt.quiet_at is None or (self._left_alone and not self._stop_answered):
            return False
        return not halt.may_move or now - halt.quiet_at >= self._settings.standstill_timeout

    @property
    def _left_alone(self) -> bool:
        """Return whether the navigator that drove for us has gone without ending the drive."""
        return self._registry.orphaned or self._runaway

    def _why_not_halted(self, now: float) -> str:
        asked = "Nav2 was asked to cancel its goals"
        if self._standstill.known(now):
            speed, omega = self._standstill.speed, self._standstill.omega
            return f"{asked}, and the odometry still shows {speed:.2f} m/s, {omega:.2f} rad/s"
        answer = "has" if self._stop_answered else "has not"
        return f"{asked}; its controller {answer} answered, and there is no odometry"

    def _run_away(self, now: float, *, silent: bool = False) -> None:
        """Assume that the controller may keep driving without its navigator."""
        self._runaway, self._stop_answered, self._stop_again_at = True, False, now
        self._silent = silent

    def _stop_motion(self, now: float) -> None:
        """Stop the controller directly if the navigator is gone or does not stop the robot."""
        stands = self._standstill.stands(now)
        if self._runaway and self._stop_again_at > now:  # a stop was requested at least once
            self._runaway = not stands and (self._standstill.known(now) or not self._stop_answered)
        halt = self._halt
        disobeyed = (
            halt is not None
            and halt.may_move
            and now - halt.asked_at >= OBEYED_WITHIN
            and (bool(self._registry.live) or self._left_alone or self._standstill.known(now))
            and now - self._standstill.slowed_at >= OBEYED_WITHIN
            and not (stands and self._stop_answered)
        )
        if (self._runaway or disobeyed) and now >= self._stop_again_at and not self._registry.others_run:
            self._stop_again_at = now + self._settings.cancel_time
            self._out.append(StopMotion())

    def _judge_arrival(self, now: float) -> None:
        """Accept success only if the pose confirms it; request a new pose if the last one may be old."""
        drive = self._drive
        if drive is None or drive.reached_at is None:
            return
        if drive.goal.ahead and self._pose is not None:
            self._judge_route(drive, self._pose, now)
            return
        # SUCCEEDED is the end of the path, up to 0.5 m (planner) + 0.25 m (goal checker) from the goal.
        if self._pose is not None and has_reached(self._pose, drive.goal):
            self._report_arrival(drive, now)
        elif drive.may_be_undriven and not self._may_agree(drive.goal):
            self._resend_undriven(drive)
        elif drive.pose_may_come(now, self._settings.pose_wait):
            if drive.pose_asked_at is None or self._pose_at > drive.pose_asked_at:
                drive.pose_asked_at = now
                self._out.append(RequestPose())
        elif drive.may_be_undriven:
            self._resend_undriven(drive)
        elif self._pose_at < drive.reached_at and self._may_agree(drive.goal):
            self._report_arrival(drive, now)
        elif not drive.poses_are_late(now):
            self._fail_drive(drive, DriveFailure.OUTSIDE_TOLERANCE, self._describe_disagreement(drive.goal))

    def _judge_route(self, drive: GoalDrive, pose: Pose, now: float) -> None:
        """Wait at the end of a route until its nodes are reported as passed; drive to one that was not."""
        if has_reached(pose, drive.goal):
            self._report_arrival(drive, now)
        elif drive.may_be_undriven and not near(pose, drive.goal.ahead[-1], xy=FROM_END, theta=None):
            self._resend_undriven(drive)
        elif drive.reached_at is not None and now - drive.reached_at >= self._settings.pose_wait:
            self._send_alone(drive)

    def _send_alone(self, drive: GoalDrive) -> None:
        """Resend a goal without the poses after it."""
        log.info("a skipped node is driven to separately", generation=drive.goal.generation)
        self._drive = GoalDrive(replace(drive.goal, ahead=()))

    def _resend_undriven(self, drive: GoalDrive) -> None:
        """Resend a goal that succeeded although the robot is elsewhere.

        Nav2 replans once a second (through poses: every 3 s), and not sooner for a new goal: until then, the
        controller follows the old path, and if that ends first, the new goal succeeds without being driven.
        The resent goal has nothing to preempt, so this happens once per goal.
        """
        log.info("goal succeeded elsewhere; sending it again", generation=drive.goal.generation)
        self._drive = GoalDrive(drive.goal)

    def _may_agree(self, goal: DriveGoal) -> bool:
        """Return whether a pose from before the stop is compatible with a robot at the goal."""
        pose = self._pose
        return pose is not None and has_reached(pose, goal, xy_slack=STALE_XY, theta_slack=STALE_THETA)

    def _describe_disagreement(self, goal: DriveGoal) -> str:
        if self._pose is None:
            return "Nav2 reports the goal as reached, but the robot's pose is not known"
        return (
            f"Nav2 reports the goal as reached, but the robot is at x {self._pose.x:.2f} m, "
            f"y {self._pose.y:.2f} m, heading {self._pose.theta:.2f} rad, and the goal at "
            f"x {goal.pose.x:.2f} m, y {goal.pose.y:.2f} m, heading {goal.pose.theta:.2f} rad"
        )

    def _send_or_give_up(self, now: float) -> None:
        """Publish the goal, resend it, or give up."""
        drive = self._drive
        if drive is None or drive.goal_id is not None or self._halt is not None:
            return
        if not self._navigation.available:  # wait for Nav2 without a timeout
            drive.counted_from, drive.give_up_at = drive.times_sent, None
            return
        timeout = self._settings.confirmation_time * (self._settings.resends + 1)
        # Nav2 aborts with 102 while map -> odom, which AMCL dates 1 s ahead, is in the future.
        localised = self._localised_at + self._settings.localisation_wait
        drive.give_up_at = max(now, localised) + timeout if drive.give_up_at is None else drive.give_up_at
        if self._registry.is_awaiting(now):
            return
        if now >= drive.give_up_at or drive.tries > self._settings.resends:
            self._fail_drive(drive, DriveFailure.NOT_TAKEN_UP, self._describe_refusal(drive))
        elif self._may_send(now) and not self._continue_earlier(drive, now) and now >= localised:
            drive.times_sent += 1
            drive.preempts = drive.preempts or self._registry.running
            self._send_goal(drive, now)

    def _send_goal(self, drive: GoalDrive, now: float) -> None:
        if not self.by_action:
            self._registry.record_published(now)
            self._out.append(PublishGoal(drive.goal))
            return
        if drive is not self._sent_for:
            self._sent_for, self._sent, self._refused = drive, [], False
        goal_id = self._prefix.new()
        self._passed.begin_route(drive.goal)
        self._sent.append(goal_id)
        self._registry.record_sent(now)
        self._out.append(SendGoal(drive.goal, goal_id, self._server))

    def _continue_earlier(self, drive: GoalDrive, now: float) -> bool:
        """Continue the goal of an earlier run, if it has the same pose and is active or succeeded."""
        goals, self._reclaimed = self._reclaimed, None
        if goals is None:
            return False
        # The goal that the earlier run sent last may not be journalled as accepted: it is newer than those.
        goal_id, place = self._registry.given_before, goals.given
        if not goal_id:
            goal_id, place = next(reversed(goals.goal_ids), None), goals.pose
        if goal_id is None or place is None or place.map_id != drive.goal.pose.map_id:
            return False
        theta = None if drive.goal.deviation_theta is None else SAME
        if not near(place, drive.goal.pose, xy=SAME, theta=theta):
            return False
        status = self._registry.status(goal_id)
        reached = status is GoalStatus.SUCCEEDED and self._may_agree(drive.goal)
        if not reached and status not in (GoalStatus.ACCEPTED, GoalStatus.EXECUTING):
            return False
        log.info(
            "continuing with a goal from before the restart", goal=goal_id, generation=drive.goal.generation
        )
        drive.goal_id, drive.times_sent = goal_id, 1
        drive.interrupted = True  # the earlier run may have stopped its controller, or preempted another goal
        drive.reached_at = now if reached else None
        return True

    def _may_send(self, now: float) -> bool:
        """Return whether a goal can be sent: while another is cancelled, a new one would end with it."""
        # A goal sent while another is cancelled ends with it (SimpleActionServer: terminate_all).
        clear = not self._registry.canceling and not any(
            goal_id in self._cancels for goal_id in self._registry.live
        )
        return clear and self._registry.is_settled(now)

    def _describe_refusal(self, drive: GoalDrive) -> str:
        if self._server is Server.CONTROLLER:
            return (
                f"Nav2's controller has not accepted the path, sent {drive.times_sent} times: "
                "is controller_server active?"
            )
        if drive is self._sent_for and self._refused:
            return f"Nav2 rejected the goal, sent {drive.times_sent} times: is bt_navigator active?"
        if drive.times_sent:
            return (
                f"Nav2 has not accepted the goal, sent {drive.times_sent} times: "
                "is bt_navigator active, and does it subscribe to this topic?"
            )
        return "no goal can be sent: Nav2 does not finish cancelling the previous goal"

    def _cancel_leftovers(self, now: float) -> None:
        """Cancel our obsolete goals, repeatedly until they end.

        Before a new goal, earlier goals are left to be preempted: a cancel could hit the new one.
        """
        live = self._registry.live
        self._cancels = {goal_id: again for goal_id, again in self._cancels.items() if goal_id in live}
        # While a goal is pending, the tree looks at its cancel flag only (is_cancel_requested).
        wanted = self._drive is not None or self._reclaimed is not None
        unwanted = tuple(self._cancels) if wanted and self._halt is None else live
        for goal_id in unwanted:
            if now >= self._cancels.get(goal_id, now):
                self._cancels[goal_id] = now + self._settings.cancel_time
                self._out.append(CancelGoal(goal_id, self._server))

    def _refresh_pose(self, now: float) -> None:
        """Request a pose once the robot has stopped at its goal: the last one is from before the stop."""
        arrived_at, stands = self._arrived_at, self._standstill
        if arrived_at is None:
            return
        if self._drive is not None:
            self._arrived_at = None
        # AMCL publishes nothing at rest: its last pose may be 0.25 m or 0.2 rad old (update_min_d,
        # update_min_a).
        elif stands.stands(now) or now - arrived_at >= self._settings.standstill_timeout:
            self._arrived_at = None
            self._out.append(RequestPose())

    def _report_arrival(self, drive: GoalDrive, now: float) -> None:
        self._drive, self._arrived_at = None, now
        self._report_event(Arrived(drive.goal.generation))

    def _fail_drive(
        self,
        drive: GoalDrive,
        failure: DriveFailure,
        description: str,
        *,
        hint: str = "",
        code: int = 0,
        transient: bool = False,
    ) -> None:
        """End the drive; a navigation that is gone may be restarted, by a person or its lifecycle manager."""
        self._drive = None
        transient = transient or failure is DriveFailure.NAVIGATION_GONE
        log.info("drive failed", generation=drive.goal.generation, reason=description, transient=transient)
        self._report_event(DriveFailed(drive.goal.generation, failure, description, hint, code, transient))

    def _report_table(self) -> None:
        """Report the listed goals before their effects on a drive."""
        table = self._registry.table
        if table != self._table:
            self._table = table
            self._report_event(table)

    def _report_event(self, event: DriverEvent) -> None:
        self._out.append(Report(event))
