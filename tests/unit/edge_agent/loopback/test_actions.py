from __future__ import annotations

from nena_edge_agent.actions.builtin import TimedOperation
from nena_edge_agent.actions.settings import OperationSettings
from nena_edge_agent.loopback.actions import ChargingWatch, simulated_actions
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import ActionScope
from support.robot_core import action
from support.waiting import until


class Stage:
    def __init__(self) -> None:
        self.reports: list[ActionReport] = []
        self.plugins = {each.declaration.action_type: each for each in simulated_actions()}

    async def play(self, action_type: str, **parameters: int) -> ActionStatus:
        """Run an action to its end, and return its status."""
        self.reports.clear()
        act = action("a", "HARD", action_type, retriable=None, **parameters)
        self.plugins[action_type].start(act, (), self.reports.append)
        assert self.reports[0].status is ActionStatus.RUNNING
        return (await until(lambda: next((each for each in self.reports if each.status.ended), None))).status


async def test_fail_always_fails() -> None:
    stage = Stage()

    assert [await stage.play("failAlways") for _ in range(3)] == [ActionStatus.FAILED] * 3
    assert stage.reports[-1].result


async def test_fail_once_fails_every_other_time() -> None:
    stage = Stage()

    ends = [await stage.play("failOnce") for _ in range(4)]
    assert ends == [ActionStatus.FAILED, ActionStatus.FINISHED] * 2


async def test_the_other_simulated_actions_succeed_after_their_duration() -> None:
    stage = Stage()

    assert await stage.play("waitUninterrupted", duration=0) is ActionStatus.FINISHED
    assert await stage.play("needParameter", count=1) is ActionStatus.FINISHED


def test_each_declares_its_parameters_and_what_it_allows() -> None:
    declared = {each.declaration.action_type: each.declaration for each in simulated_actions()}

    assert not declared["waitUninterrupted"].pause_allowed
    assert not declared["waitUninterrupted"].cancel_allowed
    assert declared["failAlways"].cancel_allowed
    needy = declared["needParameter"]
    assert needy.problem(action("a", "HARD", "needParameter"), ActionScope.NODE)
    assert needy.problem(action("a", "HARD", "needParameter", count="3"), ActionScope.NODE)
    assert needy.problem(action("a", "HARD", "needParameter", count=3), ActionScope.NODE) is None


async def test_a_charging_action_switches_the_simulated_battery() -> None:
    switched: list[bool] = []
    reports: list[ActionReport] = []
    settings = OperationSettings(action_type="startCharging", seconds=0, charging=True)
    plugin = ChargingWatch(TimedOperation(settings), switched.append)
    assert plugin.declaration.action_type == "startCharging"

    plugin.start(action("a", "HARD", "startCharging"), (), reports.append)
    await until(lambda: len(reports) == 2)

    assert switched == [True]
    assert reports == [
        ActionReport("a", ActionStatus.RUNNING),
        ActionReport("a", ActionStatus.FINISHED, charging=None),
    ]
