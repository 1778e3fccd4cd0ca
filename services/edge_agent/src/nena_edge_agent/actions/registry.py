"""Which action types a robot has, and what does each."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from nena_edge_agent.actions.installed import NOTHING, Installed
from nena_edge_agent.actions.plugin import ActionPlugin
from nena_edge_agent.protocol.declaration import PREDEFINED, ActionDeclaration
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action

log = get_logger(__name__)


class ActionRegistry:
    """The actions of one robot, by action type; ``problems`` says what is missing of its plug-ins.

    Raises:
        ConfigurationError: two of ``plugins``, or one and the core, do the same type. Of those that are
            ``installed`` beside the agent such a one is left out.

    """

    def __init__(self, plugins: Iterable[ActionPlugin], installed: Installed = NOTHING) -> None:
        self._plugins: dict[str, ActionPlugin] = {}
        self.problems = installed.problems
        for plugin in plugins:
            self._add(plugin)
        for plugin in installed.plugins:
            self._add_if_free(plugin)

    @property
    def declarations(self) -> Mapping[str, ActionDeclaration]:
        """All actions that the robot knows, those of the core among them."""
        own = {action_type: _guarded(plugin.declaration) for action_type, plugin in self._plugins.items()}
        return {**PREDEFINED, **own}

    def plugin(self, action_type: str) -> ActionPlugin | None:
        """Give what does ``action_type``."""
        return self._plugins.get(action_type)

    def _add_if_free(self, plugin: ActionPlugin) -> None:
        try:
            self._add(plugin)
        except ConfigurationError:
            text = f"a plug-in does '{plugin.declaration.action_type}', which the agent or its operations do"
            log.warning("an action of a plug-in is left out", reason=text)
            self.problems = (*self.problems, text)

    def _add(self, plugin: ActionPlugin) -> None:
        action_type = plugin.declaration.action_type
        if action_type in PREDEFINED:
            raise ConfigurationError([f"operations: the agent itself does '{action_type}'; leave it out"])
        if action_type in self._plugins:
            raise ConfigurationError([f"operations: '{action_type}' stands there twice"])
        self._plugins[action_type] = plugin


def _guarded(declaration: ActionDeclaration) -> ActionDeclaration:
    """Have a check that fails be a reason against the action, and no failure of the core."""
    check = declaration.check
    if check is None:
        return declaration

    def guarded(action: Action) -> str | None:
        try:
            problem = check(action)
        except Exception as error:
            log.exception("an action plug-in failed at a check", action_type=action.action_type)
            return f"its plug-in cannot judge it: {type(error).__name__}: {error}"
        return None if problem is None else str(problem)

    return replace(declaration, check=guarded)
