from __future__ import annotations

import pytest

from nena_edge_agent.actions.installed import Installed
from nena_edge_agent.actions.registry import ActionRegistry
from nena_edge_agent.actions.wait import Wait
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ActionScope
from support.bad_plugins import NODE, Good, made
from support.robot_core import action


def test_what_is_installed_comes_behind_what_the_agent_has() -> None:
    registry = ActionRegistry(
        [Wait()],
        Installed(
            (Good(), Wait(), made(declaration=ActionDeclaration("cancelOrder", NODE))), ("one is broken",)
        ),
    )

    assert registry.plugin("good") is not None
    assert registry.problems == (
        "one is broken",
        "a plug-in does 'wait', which the agent or its operations do",
        "a plug-in does 'cancelOrder', which the agent or its operations do",
    )


def test_a_check_that_fails_is_a_reason_against_the_action() -> None:
    def check(_: Action) -> str | None:
        message = "no scale"
        raise OSError(message)

    registry = ActionRegistry([made(declaration=ActionDeclaration("weigh", NODE, check=check))])

    problem = registry.declarations["weigh"].problem(action("a", "HARD", "weigh"), ActionScope.NODE)
    assert problem == "action 'weigh': its plug-in cannot judge it: OSError: no scale"


@pytest.mark.parametrize(("given", "expected"), [(None, None), ("too heavy", "action 'weigh': too heavy")])
def test_a_check_says_what_is_wrong(given: str | None, expected: str | None) -> None:
    registry = ActionRegistry([made(declaration=ActionDeclaration("weigh", NODE, check=lambda _: given))])

    assert registry.declarations["weigh"].problem(action("a", "HARD", "weigh"), ActionScope.NODE) == expected
