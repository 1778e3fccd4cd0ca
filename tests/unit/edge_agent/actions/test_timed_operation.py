from __future__ import annotations

from typing import Literal

import pytest

from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.actions.timed_operation import TimedOperation
from nena_edge_agent.protocol.declaration import LoadChange
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from support.robot_core import action
from support.waiting import until


class Trial:
    """One operation, and what it reports."""

    def __init__(self, **settings: object) -> None:
        operation = TimedOperation(
            OperationSettings.model_validate({"action_type": "op", "seconds": 0.02, **settings})
        )
        self.reports: list[ActionReport] = []
        self.running = operation.start(action("a", "HARD", "op"), (), self.reports.append)

    @property
    def statuses(self) -> list[ActionStatus]:
        return [report.status for report in self.reports]

    async def ends(self) -> ActionReport:
        return await until(lambda: next((each for each in self.reports if each.status.ended), None))


async def test_it_runs_and_is_finished_after_its_time() -> None:
    trial = Trial()
    assert trial.statuses == [ActionStatus.RUNNING]

    end = await trial.ends()

    assert (end.status, end.loads, end.charging) == (ActionStatus.FINISHED, None, None)


@pytest.mark.clause("6.2.3/pick")
@pytest.mark.parametrize(
    ("load", "change"), [("take", LoadChange.TAKE), ("give", LoadChange.GIVE), ("", None)]
)
def test_it_declares_what_it_does_to_the_load(load: Literal["take", "give", ""], change: LoadChange) -> None:
    assert TimedOperation(OperationSettings(action_type="op", load=load)).declaration.load is change


@pytest.mark.clause("6.2.3/startCharging")
@pytest.mark.parametrize("charging", [True, False])
async def test_it_may_say_whether_the_robot_charges(charging: bool) -> None:  # noqa: FBT001
    assert (await Trial(charging=charging).ends()).charging is charging


async def test_its_time_does_not_run_while_it_is_held() -> None:
    trial = Trial(seconds=3600)
    trial.running.pause()
    assert trial.statuses == [ActionStatus.RUNNING, ActionStatus.PAUSED]
    assert 3599 < trial.running._left <= 3600  # type: ignore[attr-defined]  # there is no other sight of it

    trial.running.resume()
    trial.running.resume()
    assert trial.statuses[2:] == [ActionStatus.RUNNING]
    trial.running.cancel()
    assert trial.statuses[3:] == [ActionStatus.FAILED]


async def test_a_cancelled_operation_changes_no_load() -> None:
    trial = Trial(load="take")
    trial.running.cancel()

    other = Trial(seconds=0.05)
    await other.ends()

    assert trial.statuses == [ActionStatus.RUNNING, ActionStatus.FAILED]
    assert trial.reports[-1].loads is None


def test_its_declaration_follows_the_settings() -> None:
    declaration = TimedOperation(OperationSettings(action_type="op", interruptible=False)).declaration

    assert (declaration.pause_allowed, declaration.cancel_allowed) == (False, False)
    assert declaration.restartable
