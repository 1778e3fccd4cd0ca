"""Plug-ins that do not keep the contract, each in its own way: the suite must find every one of them."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any, cast

from nena_edge_agent.actions.plugin import Report, RunningAction
from nena_edge_agent.protocol.declaration import ActionDeclaration, Parameter
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import Action, ActionStatus
from nena_shared.vda5050.factsheet import ActionScope, ValueDataType
from nena_shared.vda5050.state import Load
from support.pausing import pass_time

NODE = (ActionScope.NODE,)
GOOD = ActionDeclaration("good", NODE, pause_allowed=True, cancel_allowed=True)


class Good:
    """Keeps the contract; the bad ones differ from it in one point. Runs until it is cancelled, or 0.5 s."""

    declaration = GOOD

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        return Running(action.action_id, report)


class Running:
    def __init__(self, action_id: str, report: Report, *, seconds: float = 0.5) -> None:
        self.action_id = action_id
        self.report = report
        self.left = seconds
        self.ended = False
        self.tell(ActionStatus.RUNNING)
        self.go_on()

    def tell(self, status: ActionStatus, result: str | None = None) -> None:
        self.report(ActionReport(self.action_id, status, result))

    def go_on(self) -> None:
        self.timer = asyncio.get_running_loop().call_later(self.left, self.finish)

    def finish(self) -> None:
        self.end(ActionStatus.FINISHED, "done")

    def end(self, status: ActionStatus, result: str | None) -> None:
        if not self.ended:
            self.ended = True
            self.timer.cancel()
            self.tell(status, result)

    def pause(self) -> None:
        if not self.ended:
            self.timer.cancel()
            self.tell(ActionStatus.PAUSED)

    def resume(self) -> None:
        if not self.ended:
            self.tell(ActionStatus.RUNNING)
            self.go_on()

    def cancel(self) -> None:
        self.end(ActionStatus.FAILED, "cancelled")


def made(kind: Callable[[str, Report], Any] = Running, declaration: ActionDeclaration = GOOD) -> Good:
    """Make a plug-in whose actions are of ``kind``."""

    class Made(Good):
        def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
            return cast("RunningAction", kind(action.action_id, report))

    plugin = Made()
    plugin.declaration = declaration
    return plugin


class Blocks(Running):
    """Does its work in the agent's own thread."""

    def __init__(self, action_id: str, report: Report) -> None:
        pass_time(0.7)
        super().__init__(action_id, report)


class BlocksLater(Running):
    def finish(self) -> None:
        end = time.monotonic() + 0.7
        while time.monotonic() < end:
            sum(range(1000))
        super().finish()


class Raises(Running):
    def __init__(self, action_id: str, report: Report) -> None:  # noqa: ARG002
        message = "no hydraulic pressure"
        raise RuntimeError(message)


class Silent(Running):
    def tell(self, status: ActionStatus, result: str | None = None) -> None:
        """Do nothing."""


class TellsOfAnother(Running):
    def tell(self, status: ActionStatus, result: str | None = None) -> None:
        self.report(ActionReport("another", status, result))


class TellsNoReports(Running):
    def tell(self, status: ActionStatus, result: str | None = None) -> None:  # noqa: ARG002
        self.report(cast("ActionReport", status.value))


class EndsTwice(Running):
    def finish(self) -> None:
        super().finish()
        self.tell(ActionStatus.FAILED, "after all")


class NeverEnds(Running):
    def go_on(self) -> None:
        self.timer = asyncio.get_running_loop().call_later(3600, self.finish)


class CannotGiveUp(Running):
    def cancel(self) -> None:
        """Continue."""


class RaisesAtCancel(Running):
    def cancel(self) -> None:
        message = "not now"
        raise RuntimeError(message)


class GivesNoReason(Running):
    def cancel(self) -> None:
        self.end(ActionStatus.FAILED, None)


class DoesNotHold(Running):
    def pause(self) -> None:
        """Continue."""


class WorksInThePause(Running):
    def pause(self) -> None:
        if not self.ended:
            self.tell(ActionStatus.PAUSED)
            self.timer.cancel()
            self.timer = asyncio.get_running_loop().call_later(0.05, self.tell, ActionStatus.RUNNING, "on")


class TalksBehindTheEnd(Running):
    def resume(self) -> None:
        self.tell(ActionStatus.RUNNING)


class LeavesATask(Running):
    def __init__(self, action_id: str, report: Report) -> None:
        super().__init__(action_id, report)
        self.task = asyncio.create_task(asyncio.Event().wait(), name="forgotten")


class LeavesAThread(Running):
    def __init__(self, action_id: str, report: Report) -> None:
        super().__init__(action_id, report)
        threading.Thread(target=threading.Event().wait, args=(20,), name="forgotten", daemon=True).start()


class OneAtATime(Good):
    """Keeps its action in itself, so that a second one replaces the first."""

    def start(self, action: Action, loads: tuple[Load, ...], report: Report) -> RunningAction:  # noqa: ARG002
        self.action_id = action.action_id

        def tell(told: ActionReport) -> None:
            report(ActionReport(self.action_id, told.status, told.result))

        return Running(action.action_id, tell)


def _check(_: Action) -> str | None:
    message = "no check today"
    raise KeyError(message)


KEY = Parameter("key", ValueDataType.STRING)

BAD: dict[str, tuple[Good, str]] = {
    "blocks": (made(Blocks, ActionDeclaration("good", NODE)), "blocks the whole agent at .* in pass_time"),
    "blocks later": (
        made(BlocksLater, ActionDeclaration("good", NODE)),
        "blocks the whole agent at .*bad_plugins.* in finish",
    ),
    "raises": (made(Raises), "start raised RuntimeError: no hydraulic pressure"),
    "gives nothing": (made(lambda *_: None), "returned None, which has no pause, resume, cancel"),
    "gives no running action": (made(lambda *_: object()), "which has no pause, resume, cancel"),
    "silent": (made(Silent), "no report within 0.3 s of the start"),
    "tells of another": (made(TellsOfAnother), "it reported on another action: 'another'"),
    "tells no reports": (made(TellsNoReports), "it reported 'RUNNING', which is not an ActionReport"),
    "ends twice": (made(EndsTwice), "it reported RUNNING, FINISHED, FAILED"),
    "never ends": (
        made(NeverEnds, ActionDeclaration("good", NODE)),
        "cannot be cancelled and has no timeout",
    ),
    "cannot give up": (made(CannotGiveUp), "did not end within 0.3 s of cancel"),
    "raises at cancel": (made(RaisesAtCancel), "cancel raised RuntimeError: not now"),
    "gives no reason": (made(GivesNoReason), "cancelled without a reason"),
    "does not hold": (made(DoesNotHold), "PAUSED was not reported within 0.3 s of pause"),
    "works in the pause": (made(WorksInThePause), "it reported RUNNING while paused"),
    "talks behind the end": (made(TalksBehindTheEnd), "FINISHED, RUNNING"),
    "leaves a task": (made(LeavesATask), "left running by actions that have ended: forgotten"),
    "leaves a thread": (made(LeavesAThread), "left running by actions that have ended: forgotten"),
    "one at a time": (OneAtATime(), "it reported on another action"),
    "is the agent's": (made(declaration=ActionDeclaration("cancelOrder", NODE)), "reserved by the agent"),
    "has no scope": (made(declaration=ActionDeclaration("good", ())), "no scopes"),
    "has a key twice": (made(declaration=ActionDeclaration("good", NODE, (KEY, KEY))), "the same key"),
    "cannot be told": (
        made(declaration=ActionDeclaration("good", NODE, description=cast("str", 7))),
        "does not fit the factsheet",
    ),
    "cannot judge": (
        made(declaration=ActionDeclaration("good", NODE, check=_check)),
        "check raised KeyError",
    ),
    "judges by no sentence": (
        made(declaration=ActionDeclaration("good", NODE, check=lambda _: cast("str", 7))),
        "check returned 7",
    ),
    "refuses its parameters": (
        made(declaration=ActionDeclaration("good", NODE, check=lambda _: "too high")),
        "too high: pass valid parameters",
    ),
}
"""By what is wrong: the plug-in, and what the helper says about it."""
