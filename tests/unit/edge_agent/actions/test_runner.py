from __future__ import annotations

import pytest

from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.runner import ActionRunner
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport, CancelAction, PauseAction, ResumeAction, StartAction
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.state import Load
from support.robot_core import action
from support.waiting import until


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


async def test_an_action_is_begun_held_resumed_and_given_up() -> None:
    run, reports = runner(Wait())

    run.start(StartAction(action("a", "HARD", "wait", duration=3600), ()))
    run.pause(PauseAction("a"))
    run.resume(ResumeAction("a"))
    run.cancel(CancelAction("a"))

    assert [report.status.value for report in reports] == ["RUNNING", "PAUSED", "RUNNING", "FAILED"]


async def test_a_wait_ends_by_itself() -> None:
    run, reports = runner(Wait())

    run.start(StartAction(action("a", "HARD", "wait", duration=0), ()))

    await until(lambda: [each for each in reports if each.status is ActionStatus.FINISHED])


@pytest.mark.parametrize("at", ["start", "pause", "resume", "cancel"])
async def test_what_a_plug_in_does_wrong_fails_its_action_and_nothing_else(at: str) -> None:
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


def test_an_action_that_nobody_does_fails() -> None:
    run, reports = runner()

    run.start(StartAction(action("a", "HARD", "gone"), ()))

    assert (reports[0].status, reports[0].action_id) == (ActionStatus.FAILED, "a")


def test_a_cancel_of_what_does_not_run_is_answered() -> None:
    run, reports = runner()

    run.cancel(CancelAction("a"))

    assert reports == [ActionReport("a", ActionStatus.FAILED, "the action was not running")]


async def test_when_the_agent_ends_nothing_is_reported() -> None:
    run, reports = runner(Wait())
    run.start(StartAction(action("a", "HARD", "wait", duration=3600), ()))

    run.close()

    assert [report.status.value for report in reports] == ["RUNNING"]


async def test_a_late_report_of_a_first_try_does_not_end_the_second() -> None:
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


def test_two_plug_ins_for_one_action_are_a_mistake_in_the_settings() -> None:
    with pytest.raises(ConfigurationError, match="twice"):
        ActionRegistry([Wait(), Wait()])


def test_the_actions_of_the_core_are_its_own() -> None:
    plugin = Broken("nowhere")
    plugin.declaration = ActionDeclaration("cancelOrder", (ActionScope.NODE,))

    with pytest.raises(ConfigurationError, match="cancelOrder"):
        ActionRegistry([plugin])
