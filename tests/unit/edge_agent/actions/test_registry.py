"""Plug-ins by entry points; real distributions are in the integration tests."""

from __future__ import annotations

from collections.abc import Callable
from importlib.metadata import EntryPoint
from typing import Any

import pytest

from nena_edge_agent.actions import registry as module
from nena_edge_agent.actions.builtin import Wait
from nena_edge_agent.actions.plugin import PluginContext, PluginUnavailableError
from nena_edge_agent.actions.registry import (
    GROUP,
    ActionRegistry,
    Installed,
    PluginBrokenError,
    installed_plugins,
    make_plugins,
)
from nena_edge_agent.actions.settings import ActionSettings
from nena_edge_agent.plugin_check import DryDrive
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.topics import RobotKey
from support.bad_plugins import NODE, Good, made
from support.robot_core import action


def test_installed_plug_ins_are_listed_after_built_in_ones() -> None:
    registry = ActionRegistry(
        [Wait()],
        Installed(
            (Good(), Wait(), made(declaration=ActionDeclaration("cancelOrder", NODE))), ("one is broken",)
        ),
    )

    assert registry.plugin("good") is not None
    assert registry.problems == (
        "one is broken",
        "ignoring the plug-in action 'wait': the agent or its operations define it",
        "ignoring the plug-in action 'cancelOrder': the agent or its operations define it",
    )


def test_a_check_that_raises_refuses_the_action() -> None:
    def check(_: Action) -> str | None:
        message = "no scale"
        raise OSError(message)

    registry = ActionRegistry([made(declaration=ActionDeclaration("weigh", NODE, check=check))])

    problem = registry.declarations["weigh"].problem(action("a", "HARD", "weigh"), ActionScope.NODE)
    assert problem == "action 'weigh': its plug-in failed to check it: OSError: no scale"


@pytest.mark.parametrize(("given", "expected"), [(None, None), ("too heavy", "action 'weigh': too heavy")])
def test_a_check_reports_the_problem(given: str | None, expected: str | None) -> None:
    registry = ActionRegistry([made(declaration=ActionDeclaration("weigh", NODE, check=lambda _: given))])

    assert registry.declarations["weigh"].problem(action("a", "HARD", "weigh"), ActionScope.NODE) == expected


CONTEXT = PluginContext(RobotKey("ACME", "0001"), DryDrive())
MADE_WITH: list[PluginContext] = []


def one(context: PluginContext) -> Good:
    MADE_WITH.append(context)
    return Good()


def two(_: PluginContext) -> list[Any]:
    return [Good(), Wait()]


def none(_: PluginContext) -> object:
    return object()


def fails(_: PluginContext) -> Good:
    message = "no hydraulics"
    raise OSError(message)


def unavailable(_: PluginContext) -> Good:
    message = "it needs ROS"
    raise PluginUnavailableError(message)


NOT_A_FACTORY = 7
HERE = __name__


@pytest.fixture
def there(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Make entry points of this module count as installed."""

    class Found(EntryPoint):
        def load(self) -> Any:
            if self.value == "missing":
                message = "No module named 'acme'"
                raise ImportError(message)
            return globals()[self.value]

    def install(*names: str) -> None:
        points = {each: Found(name=each, value=each, group=GROUP) for each in names}
        monkeypatch.setattr(module, "_entry_points", lambda: points)

    return install


def test_all_installed_plug_ins_are_used(there: Callable[..., None]) -> None:
    there("one", "two")

    found = installed_plugins(CONTEXT, ActionSettings())

    assert [each.declaration.action_type for each in found.plugins] == ["good", "good", "wait"]
    assert found.problems == ()


def test_settings_select_plug_ins_and_pass_their_options(there: Callable[..., None]) -> None:
    there("one", "two")
    settings = ActionSettings(plugins=("one",), options={"one": {"speed": 2}})

    assert len(installed_plugins(CONTEXT, settings).plugins) == 1
    assert MADE_WITH[-1].options == {"speed": 2}


@pytest.mark.parametrize("settings", [{"plugins": ("thre",)}, {"options": {"thre": {}}}])
def test_a_plug_in_that_is_not_installed_is_a_settings_error(
    there: Callable[..., None], settings: dict[str, Any]
) -> None:
    there("one")

    with pytest.raises(ConfigurationError, match=r"unknown plug-in 'thre'.*installed: one"):
        installed_plugins(CONTEXT, ActionSettings(**settings))


@pytest.mark.parametrize(
    ("name", "problem"),
    [
        ("missing", "plug-in 'missing' cannot be loaded: ImportError: No module named 'acme'"),
        ("fails", "plug-in 'fails' failed to start: OSError: no hydraulics"),
        ("unavailable", "plug-in 'unavailable' does not work on this robot: it needs ROS"),
        ("none", "plug-in 'none' returned <object object"),
        ("NOT_A_FACTORY", "plug-in 'NOT_A_FACTORY' names 7, which does not create plug-ins"),
    ],
)
def test_a_broken_plug_in_disables_only_its_own_actions(
    there: Callable[..., None], name: str, problem: str
) -> None:
    there(name, "one")

    found = installed_plugins(CONTEXT, ActionSettings())

    assert found.action_types == {"good"}
    assert found.problems[0].startswith(problem)
    with pytest.raises(PluginBrokenError):
        make_plugins(name, CONTEXT)


def test_without_wanted_plug_ins_no_entry_points_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "_entry_points", lambda: pytest.fail("it looked"))

    assert installed_plugins(CONTEXT, ActionSettings(plugins=())) == Installed()


def test_without_plug_ins_only_core_actions_exist() -> None:
    assert Installed().action_types == frozenset()
