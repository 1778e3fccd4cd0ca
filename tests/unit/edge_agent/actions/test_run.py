"""What a plug-in does wrong fails its action, with a reason, and hurts nothing else."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from typing import Any, cast

import pytest

from nena_edge_agent.actions.builtin import Wait
from nena_edge_agent.actions.plugin import ENDED, ActionTimeouts, Report, RunningAction
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.run import (
    MAXIMUM_RESULT,
    PROGRESS_INTERVAL,
    ActionRunner,
    Run,
    report_problem,
)
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport, CancelAction, PauseAction, ResumeAction, StartAction
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.state import Load
from support.robot_core import action
from support.waiting import until

A = action("a", "HARD", "trial")
RUNNING = ActionReport("a", ActionStatus.RUNNING)
FINISHED = ActionReport("a", ActionStatus.FINISHED)
QUICK = ActionTimeouts(begin=0.05, obey=0.05)
LONG = ActionTimeouts(begin=30.0, obey=30.0)


class Puppet:
    """A plug-in that does nothing itself: the test reports for it."""

    def __init__(
        self, at_start: Callable[[], object] = lambda: ENDED, *, timeout: float | None = None
    ) -> None:
        self.declaration = ActionDeclaration("trial", (ActionScope.NODE,), timeout=timeout)
        self.at_start = at_start
        self.asked: list[str] = []
        self.report: Report = lambda _: None

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        self.report = report
        given = self.at_start()
        return self if given is ENDED else cast("RunningAction", given)

    def pause(self) -> None:
        self.asked.append("pause")

    def resume(self) -> None:
        self.asked.append("resume")

    def cancel(self) -> None:
        self.asked.append("cancel")


class Trial:
    """One run, and what the core hears of it."""

    def __init__(self, plugin: Puppet, timeouts: ActionTimeouts = LONG) -> None:
        self.plugin = plugin
        self.told: list[ActionReport] = []
        self.run = Run(A, plugin, self.told.append, timeouts)
        self.run.start(())

    @property
    def statuses(self) -> list[str]:
        return [each.status.value for each in self.told]

    async def fails(self) -> str:
        await until(lambda: self.statuses[-1:] == ["FAILED"], what="the failure")
        return str(self.told[-1].result)


async def test_valid_reports_are_passed_on() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(RUNNING)
    trial.run.pause()
    trial.plugin.report(ActionReport("a", ActionStatus.PAUSED))
    trial.run.resume()
    trial.plugin.report(RUNNING)
    trial.plugin.report(FINISHED)

    assert trial.statuses == ["RUNNING", "PAUSED", "RUNNING", "FINISHED"]
    assert trial.plugin.asked == ["pause", "resume"]


async def test_reports_after_the_end_are_ignored() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(FINISHED)
    trial.plugin.report(ActionReport("a", ActionStatus.FAILED, "late"))
    trial.plugin.report(RUNNING)

    assert trial.statuses == ["FINISHED"]


@pytest.mark.parametrize(
    ("report", "reason"),
    [
        ("FINISHED", "not an ActionReport"),
        (None, "not an ActionReport"),
        (ActionReport("b", ActionStatus.RUNNING), "another action"),
        (ActionReport("a", ActionStatus.RETRIABLE), "plug-ins must not report"),
        (ActionReport("a", cast("ActionStatus", "FINISHED!")), "plug-ins must not report"),
        (ActionReport("a", ActionStatus.FINISHED, cast("str", 7)), "not a text"),
        (ActionReport("a", ActionStatus.FINISHED, loads=cast("Any", "box")), "not a tuple of Load"),
        (ActionReport("a", ActionStatus.FINISHED, loads=cast("Any", ("box",))), "not a tuple of Load"),
        (ActionReport("a", ActionStatus.FINISHED, charging=cast("Any", 1)), "not True or False"),
        (ActionReport("a", ActionStatus.FAILED, error=cast("Any", "broken")), "not an ErrorEntry"),
    ],
)
async def test_an_invalid_report_fails_the_action(report: Any, reason: str) -> None:
    trial = Trial(Puppet())
    trial.plugin.report(report)

    assert reason in await trial.fails()
    assert trial.plugin.asked == ["cancel"]


async def test_a_failure_without_a_reason_gets_one() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(ActionReport("a", ActionStatus.FAILED))

    assert await trial.fails() == "the plug-in reported no reason"


@pytest.mark.parametrize("given", [None, object()])
async def test_a_start_that_returns_no_running_action_fails(given: object) -> None:
    assert "without pause, resume, cancel" in await Trial(Puppet(lambda: given)).fails()


async def test_an_action_that_never_starts_fails_in_time() -> None:
    trial = Trial(Puppet(), QUICK)

    assert "did not report its start within 0.05 s" in await trial.fails()
    assert trial.plugin.asked == ["cancel"]


async def test_an_action_that_takes_too_long_fails_with_its_last_progress() -> None:
    trial = Trial(Puppet(timeout=0.05))
    trial.plugin.report(RUNNING)
    trial.plugin.report(ActionReport("a", ActionStatus.RUNNING, "at 40 %"))

    assert await trial.fails() == "the action took longer than 0.05 s; last progress: at 40 %"
    assert trial.plugin.asked == ["cancel"]


async def test_pauses_do_not_count() -> None:
    trial = Trial(Puppet(timeout=0.05))
    trial.plugin.report(RUNNING)
    trial.plugin.report(ActionReport("a", ActionStatus.PAUSED))
    yardstick = asyncio.Event()
    asyncio.get_running_loop().call_later(0.2, yardstick.set)
    await yardstick.wait()
    assert not trial.run.ended

    trial.plugin.report(RUNNING)
    assert "took longer" in await trial.fails()


async def test_an_action_that_ignores_a_cancel_fails_in_time() -> None:
    trial = Trial(Puppet(), QUICK)
    trial.plugin.report(RUNNING)
    trial.run.cancel()

    assert "did not cancel within 0.05 s" in await trial.fails()


async def test_an_action_that_cannot_pause_reports_it_and_continues() -> None:
    trial = Trial(Puppet(), QUICK)
    trial.plugin.report(RUNNING)
    trial.run.pause()
    await until(lambda: len(trial.told) == 2)

    assert trial.told[-1].status is ActionStatus.RUNNING
    assert "did not pause" in str(trial.told[-1].result)
    trial.plugin.report(FINISHED)
    assert trial.run.ended


async def test_reports_from_other_threads_are_handled_in_the_loop() -> None:
    trial = Trial(Puppet())
    heard: list[int] = []
    trial.run._on_report = lambda _: heard.append(threading.get_ident())

    await asyncio.to_thread(trial.plugin.report, RUNNING)
    await until(lambda: heard)

    assert heard == [threading.get_ident()]


async def test_progress_is_reported_periodically() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(RUNNING)
    for number in range(50):
        trial.plugin.report(ActionReport("a", ActionStatus.RUNNING, f"{number} %"))

    assert [each.result for each in trial.told] == [None, "0 %"]
    await until(lambda: len(trial.told) == 3)
    assert trial.told[2].result == "49 %"


async def test_waiting_progress_is_dropped_at_the_end() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(RUNNING)
    for number in range(3):
        trial.plugin.report(ActionReport("a", ActionStatus.RUNNING, f"{number} %"))
    trial.plugin.report(FINISHED)
    yardstick = asyncio.Event()
    asyncio.get_running_loop().call_later(PROGRESS_INTERVAL * 1.5, yardstick.set)
    await yardstick.wait()

    assert [each.result for each in trial.told] == [None, "0 %", None]


async def test_a_long_result_is_truncated() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(ActionReport("a", ActionStatus.FINISHED, "x" * 5000))

    assert trial.told[0].result == "x" * MAXIMUM_RESULT


async def test_an_abandoned_action_reports_nothing_more() -> None:
    trial = Trial(Puppet())
    trial.plugin.report(RUNNING)
    trial.run.abandon()
    trial.plugin.report(FINISHED)

    assert trial.statuses == ["RUNNING"]
    assert trial.plugin.asked == ["cancel"]


class Broken:
    """A plug-in that raises wherever it is told to."""

    declaration = ActionDeclaration("broken", (ActionScope.NODE,))

    def __init__(self, at: str) -> None:
        self._at = at

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        self._step("start")
        report(ActionReport(action.action_id, ActionStatus.RUNNING))
        return self

    def pause(self) -> None:
        self._step("pause")

    def resume(self) -> None:
        self._step("resume")

    def cancel(self) -> None:
        self._step("cancel")

    def _step(self, name: str) -> None:
        if name == self._at:
            message = f"no {name} today"
            raise RuntimeError(message)


def runner(*plugins: Broken | Wait) -> tuple[ActionRunner, list[ActionReport]]:
    reports: list[ActionReport] = []
    return ActionRunner(ActionRegistry(plugins), reports.append), reports


async def test_an_action_is_started_paused_resumed_and_cancelled() -> None:
    run, reports = runner(Wait())

    run.start(StartAction(action("a", "HARD", "wait", duration=3600), ()))
    run.pause(PauseAction("a"))
    run.resume(ResumeAction("a"))
    run.cancel(CancelAction("a"))

    assert [report.status.value for report in reports] == ["RUNNING", "PAUSED", "RUNNING", "FAILED"]


async def test_wait_finishes_after_its_duration() -> None:
    run, reports = runner(Wait())

    run.start(StartAction(action("a", "HARD", "wait", duration=0), ()))

    await until(lambda: [each for each in reports if each.status is ActionStatus.FINISHED])


@pytest.mark.parametrize("at", ["start", "pause", "resume", "cancel"])
async def test_a_faulty_plug_in_fails_only_its_own_action(at: str) -> None:
    run, reports = runner(Broken(at))
    run.start(StartAction(action("a", "HARD", "broken"), ()))
    for effect in (PauseAction("a"), ResumeAction("a"), CancelAction("a")):
        match effect:
            case PauseAction():
                run.pause(effect)
            case ResumeAction():
                run.resume(effect)
            case CancelAction():
                run.cancel(effect)

    failed = [report for report in reports if report.status is ActionStatus.FAILED]
    assert f"no {at} today" in str(failed[0].result)


def test_an_action_without_a_plug_in_fails() -> None:
    run, reports = runner()

    run.start(StartAction(action("a", "HARD", "gone"), ()))

    assert (reports[0].status, reports[0].action_id) == (ActionStatus.FAILED, "a")


def test_cancelling_an_action_that_is_not_running_is_answered() -> None:
    run, reports = runner()

    run.cancel(CancelAction("a"))

    assert reports == [ActionReport("a", ActionStatus.FAILED, "the action was not running")]


async def test_nothing_is_reported_when_the_agent_exits() -> None:
    run, reports = runner(Wait())
    run.start(StartAction(action("a", "HARD", "wait", duration=3600), ()))

    run.close()

    assert [report.status.value for report in reports] == ["RUNNING"]


async def test_a_late_report_does_not_end_a_restarted_action() -> None:
    late: list[Report] = []

    class Slow(Broken):
        def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:
            late.append(report)
            return super().start(action, loads, report)

    run, reports = runner(Slow("nowhere"))
    again = StartAction(action("a", "HARD", "broken"), ())
    run.start(again)
    late[0](ActionReport("a", ActionStatus.FAILED, "no power"))
    run.start(again)
    late[0](ActionReport("a", ActionStatus.FINISHED))

    assert [report.status.value for report in reports] == ["RUNNING", "FAILED", "RUNNING"]
    late[1](ActionReport("a", ActionStatus.FINISHED))
    assert reports[-1].status is ActionStatus.FINISHED


def test_two_plug_ins_for_one_action_are_a_settings_error() -> None:
    with pytest.raises(ConfigurationError, match="twice"):
        ActionRegistry([Wait(), Wait()])


def test_plug_ins_cannot_replace_core_actions() -> None:
    plugin = Broken("nowhere")
    plugin.declaration = ActionDeclaration("cancelOrder", (ActionScope.NODE,))

    with pytest.raises(ConfigurationError, match="cancelOrder"):
        ActionRegistry([plugin])


@pytest.mark.parametrize(
    "report",
    [
        ActionReport("a", ActionStatus.INITIALIZING),
        ActionReport("a", ActionStatus.RUNNING, "at 40 %"),
        ActionReport("a", ActionStatus.FINISHED, "done", loads=(), charging=False),
        ActionReport("a", ActionStatus.FINISHED, loads=(Load(load_id="box"),)),
    ],
)
def test_a_valid_report_has_no_problem(report: ActionReport) -> None:
    assert report_problem(report, "a") is None


def test_a_problem_of_a_report_is_described_briefly() -> None:
    assert len(report_problem("x" * 10_000, "a") or "") < 200
