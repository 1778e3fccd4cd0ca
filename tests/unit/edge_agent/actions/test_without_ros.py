from __future__ import annotations

from nena_edge_agent.actions.without_ros import Rehearsed, Unavailable
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.factsheet import ActionScope
from support.robot_core import action
from support.waiting import until

LIFT = ActionDeclaration("lift", (ActionScope.NODE,), timeout=1.0)
LAMP = ActionDeclaration("lamp", (ActionScope.EDGE,), open_ended=True)


def test_one_that_was_begun_before_the_settings_changed_fails_with_the_reason() -> None:
    reports: list[ActionReport] = []
    plugin = Unavailable(LIFT)
    running = plugin.start(action("a", "HARD", "lift"), (), reports.append)
    running.cancel()

    assert [(each.status.value, each.result) for each in reports] == [
        ("FAILED", plugin.declaration.unavailable)
    ]


async def test_a_rehearsal_takes_its_time_and_tells_of_charging() -> None:
    reports: list[ActionReport] = []
    plugin = Rehearsed(LIFT, 0.01, charging=True)
    plugin.start(action("a", "HARD", "lift"), (), reports.append)
    await until(lambda: reports[-1].status.ended)

    assert (reports[-1].result, reports[-1].charging) == ("rehearsed", True)
    assert plugin.declaration.pause_allowed
    assert plugin.declaration.timeout is None


async def test_what_lasts_is_rehearsed_until_it_is_given_up() -> None:
    reports: list[ActionReport] = []
    running = Rehearsed(LAMP, 0.0, charging=None).start(action("a", "NONE", "lamp"), (), reports.append)
    running.pause()
    running.resume()
    assert [each.status.value for each in reports] == ["RUNNING", "PAUSED", "RUNNING"]
    running.cancel()

    assert reports[-1].result == "cancelled"
