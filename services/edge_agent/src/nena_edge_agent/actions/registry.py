"""Which action types a robot has, and what does each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.protocol.declaration import ActionDeclaration
from nena_edge_agent.protocol.predefined import PREDEFINED
from nena_shared.settings import ConfigurationError


class ActionRegistry:
    """The plug-ins of one robot, by action type.

    Raises:
        ConfigurationError: two plug-ins, or a plug-in and the core, do the same type.

    """

    def __init__(self, plugins: Iterable[ActionPlugin]) -> None:
        self._plugins: dict[str, ActionPlugin] = {}
        for plugin in plugins:
            self._add(plugin)

    @property
    def declarations(self) -> Mapping[str, ActionDeclaration]:
        """All actions that the robot knows, those of the core among them."""
        own = {action_type: plugin.declaration for action_type, plugin in self._plugins.items()}
        return {**PREDEFINED, **own}

    def plugin(self, action_type: str) -> ActionPlugin | None:
        """Give what does ``action_type``."""
        return self._plugins.get(action_type)

    def _add(self, plugin: ActionPlugin) -> None:
        action_type = plugin.declaration.action_type
        if action_type in PREDEFINED:
            raise ConfigurationError([f"operations: the agent itself does '{action_type}'; leave it out"])
        if action_type in self._plugins:
            raise ConfigurationError([f"operations: '{action_type}' stands there twice"])
        self._plugins[action_type] = plugin
