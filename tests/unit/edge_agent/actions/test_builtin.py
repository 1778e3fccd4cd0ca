from __future__ import annotations

from typing import Literal

import pytest

from nena_edge_agent.actions.builtin import (
    MapTransforms,
    SimulatedOperation,
    TimedOperation,
    Unavailable,
    Wait,
)
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.factsheet import make_capabilities, make_factsheet
from nena_edge_agent.loopback.control import SimulationControl
from nena_edge_agent.program import make_registry
from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange
from nena_edge_agent.protocol.events import ActionReport
from nena_edge_agent.robot_link import RobotLink
from nena_edge_agent.settings import EdgeAgentSettings
from nena_shared.vda5050.action import Action, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.own_actions import SHOW_MAP_TRANSFORMS, transforms_itself
from support.edge_agent import make_robot
from support.ready_made import end_of
from support.robot_core import HEADER, action
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
        return await end_of(self.reports)


async def test_an_operation_finishes_after_its_duration() -> None:
    trial = Trial()
    assert trial.statuses == [ActionStatus.RUNNING]

    end = await trial.ends()

    assert (end.status, end.loads, end.charging) == (ActionStatus.FINISHED, None, None)


@pytest.mark.clause("6.2.3/pick")
@pytest.mark.parametrize(
    ("load", "change"), [("take", LoadChange.TAKE), ("give", LoadChange.GIVE), ("", None)]
)
def test_it_declares_its_effect_on_the_load(load: Literal["take", "give", ""], change: LoadChange) -> None:
    assert TimedOperation(OperationSettings(action_type="op", load=load)).declaration.load is change


@pytest.mark.clause("6.2.3/startCharging")
@pytest.mark.parametrize("charging", [True, False])
async def test_it_may_report_whether_the_robot_charges(charging: bool) -> None:  # noqa: FBT001
    assert (await Trial(charging=charging).ends()).charging is charging


async def test_a_pause_stops_the_duration() -> None:
    trial = Trial(seconds=3600)
    trial.running.pause()
    assert trial.statuses == [ActionStatus.RUNNING, ActionStatus.PAUSED]
    assert 3599 < trial.running._left <= 3600  # type: ignore[attr-defined]  # there is no other sight of it

    trial.running.resume()
    trial.running.resume()
    assert trial.statuses[2:] == [ActionStatus.RUNNING]
    trial.running.cancel()
    assert trial.statuses[3:] == [ActionStatus.FAILED]


async def test_a_cancelled_operation_does_not_change_the_load() -> None:
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


def test_the_transforms_of_each_map_are_reported() -> None:
    told: list[ActionReport] = []
    action = Action(action_type=SHOW_MAP_TRANSFORMS, action_id="1", blocking_type=BlockingType.NONE)
    running = MapTransforms({"roof": "x=1", "hall": "scale=2"}).start(action, (), told.append)
    assert told == [ActionReport("1", ActionStatus.FINISHED, "hall: scale=2; roof: x=1")]
    for step in (running.pause, running.resume, running.cancel):
        step()
    assert len(told) == 1


def declares(**fields: object) -> bool:
    settings = EdgeAgentSettings.model_validate(fields)
    capabilities = make_capabilities(
        settings, make_registry(settings, SimulationControl(RobotLink().cut), make_robot())
    )
    return transforms_itself(make_factsheet(HEADER, settings, capabilities))


def test_the_factsheet_shows_whether_the_robot_transforms_coordinates() -> None:
    transforms = {"hall": "rotation=90"}
    for version in ("2.0.0", "2.1.0", "3.0.0"):
        assert declares(map_transforms=transforms, version=version)
    assert not declares()
    assert not declares(map_transforms=transforms, driver="loopback")


LIFT = ActionDeclaration("lift", (ActionScope.NODE,), timeout=1.0)
LAMP = ActionDeclaration("lamp", (ActionScope.EDGE,), open_ended=True)


def test_an_unavailable_action_that_was_already_started_fails_with_the_reason() -> None:
    reports: list[ActionReport] = []
    plugin = Unavailable(LIFT)
    running = plugin.start(action("a", "HARD", "lift"), (), reports.append)
    running.cancel()

    assert [(each.status.value, each.result) for each in reports] == [
        ("FAILED", plugin.declaration.unavailable)
    ]


async def test_a_simulated_action_takes_its_time_and_reports_charging() -> None:
    reports: list[ActionReport] = []
    plugin = SimulatedOperation(LIFT, 0.01, charging=True)
    plugin.start(action("a", "HARD", "lift"), (), reports.append)
    await until(lambda: reports[-1].status.ended)

    assert (reports[-1].result, reports[-1].charging) == ("simulated", True)
    assert plugin.declaration.pause_allowed
    assert plugin.declaration.timeout is None


async def test_an_open_ended_action_is_simulated_until_it_is_cancelled() -> None:
    reports: list[ActionReport] = []
    running = SimulatedOperation(LAMP, 0.0, charging=None).start(
        action("a", "NONE", "lamp"), (), reports.append
    )
    running.pause()
    running.resume()
    assert [each.status.value for each in reports] == ["RUNNING", "PAUSED", "RUNNING"]
    running.cancel()

    assert reports[-1].result == "cancelled"


@pytest.mark.parametrize(("seconds", "refused"), [(0, False), (86400, False), (-1, True), (86401, True)])
def test_wait_out_of_range_is_refused(seconds: float, *, refused: bool) -> None:
    waiting = action("a", "HARD", "wait", duration=seconds)
    problem = Wait.declaration.problem(waiting, ActionScope.NODE)
    assert problem == (
        "action 'wait': parameter 'duration' must be at least 0 and at most 86400" if refused else None
    )
