"""The actions that a robot offers, and the installed plug-ins that provide them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from nena_edge_agent.actions.plugin import (
    ActionPlugin,
    PluginContext,
    PluginFactory,
    PluginUnavailableError,
)
from nena_edge_agent.actions.settings import ActionSettings
from nena_edge_agent.protocol.declaration import PREDEFINED, ActionDeclaration
from nena_shared.log import get_logger
from nena_shared.settings import ConfigurationError
from nena_shared.vda5050.action import Action

log = get_logger(__name__)

GROUP = "nena.actions"


class PluginBrokenError(Exception):
    """A plug-in is installed but provides no actions, for the reason in the message."""


@dataclass(frozen=True, slots=True)
class Installed:
    """The working plug-ins, and one sentence for each problem of the others."""

    plugins: tuple[ActionPlugin, ...] = ()
    problems: tuple[str, ...] = ()

    @property
    def action_types(self) -> frozenset[str]:
        """Return the action types of the plug-ins."""
        return frozenset(plugin.declaration.action_type for plugin in self.plugins)


NOTHING = Installed()


def installed_plugins(context: PluginContext, settings: ActionSettings) -> Installed:
    """Create the actions of all enabled plug-ins; only the actions of a broken plug-in are missing.

    Raises:
        ConfigurationError: a plug-in named in the settings is not installed.
    """
    names = _wanted_plugins(settings)
    plugins: list[ActionPlugin] = []
    problems: list[str] = []
    for name in names:
        try:
            plugins += make_plugins(name, replace(context, options=settings.options.get(name, {})))
        except PluginBrokenError as error:
            # 0020: the robot works without the plug-in's actions, and its state warns.
            log.warning("an action plug-in cannot be used", plugin=name, reason=str(error))
            problems.append(str(error))
    return Installed(tuple(plugins), tuple(problems))


def make_plugins(name: str, context: PluginContext) -> tuple[ActionPlugin, ...]:
    """Create the actions of one plug-in.

    Raises:
        PluginBrokenError: the plug-in cannot be loaded, fails, does not work here, or provides no actions.
    """
    factory = _load_factory(name)
    try:
        created = factory(context)
        plugins = tuple(created) if isinstance(created, Iterable) else (created,)
    except PluginUnavailableError as error:
        raise PluginBrokenError(f"plug-in '{name}' does not work on this robot: {error}") from error
    except Exception as error:
        log.exception("an action plug-in failed to start", plugin=name)
        raise PluginBrokenError(f"plug-in '{name}' failed to start: {_describe_error(error)}") from error
    for plugin in plugins:
        declared = isinstance(getattr(plugin, "declaration", None), ActionDeclaration)
        if not declared or not callable(getattr(plugin, "start", None)):
            raise PluginBrokenError(f"plug-in '{name}' returned {plugin!r}, which lacks declaration or start")
    return plugins


def _wanted_plugins(settings: ActionSettings) -> Iterator[str]:
    if settings.plugins == () and not settings.options:
        return  # without enabled plug-ins, the installed packages need not be searched
    available = _entry_points()
    wanted = tuple(available) if settings.plugins is None else settings.plugins
    missing = [name for name in (*wanted, *settings.options) if name not in available]
    if missing:
        known = ", ".join(available) or "none"
        text = f"unknown plug-in '{missing[0]}' of the entry points {GROUP}; installed: {known}"
        raise ConfigurationError([f"actions.{'plugins' if missing[0] in wanted else 'options'}: {text}"])
    yield from wanted


def _load_factory(name: str) -> PluginFactory:
    try:
        factory: Any = _entry_points()[name].load()
    except Exception as error:
        log.exception("an action plug-in cannot be loaded", plugin=name)
        raise PluginBrokenError(f"plug-in '{name}' cannot be loaded: {_describe_error(error)}") from error
    if not callable(factory):
        raise PluginBrokenError(f"plug-in '{name}' names {factory!r}, which does not create plug-ins")
    return cast("PluginFactory", factory)


@lru_cache(maxsize=1)
def _entry_points() -> dict[str, EntryPoint]:
    """Return the installed entry points; cached, because every robot of a fleet needs them."""
    return {point.name: point for point in sorted(entry_points(group=GROUP), key=lambda each: each.name)}


def _describe_error(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


class ActionRegistry:
    """The actions of one robot, by action type; ``problems`` describes plug-ins that do not work.

    Raises:
        ConfigurationError: two of ``plugins``, or one and the core, provide the same type. Such a plug-in
            that is only ``installed`` alongside the agent is omitted.
    """

    def __init__(self, plugins: Iterable[ActionPlugin], installed: Installed = NOTHING) -> None:
        self._plugins: dict[str, ActionPlugin] = {}
        self.problems = installed.problems
        for plugin in plugins:
            self._add_plugin(plugin)
        for plugin in installed.plugins:
            try:
                self._add_plugin(plugin)
            except ConfigurationError:
                # A package that is only installed must not keep the robot from starting.
                name = plugin.declaration.action_type
                text = f"ignoring the plug-in action '{name}': the agent or its operations define it"
                log.warning("ignoring an action of a plug-in", reason=text)
                self.problems = (*self.problems, text)

    @property
    def declarations(self) -> Mapping[str, ActionDeclaration]:
        """Return the declarations of all actions of the robot, including those of the core."""
        own = {
            action_type: _with_safe_check(plugin.declaration) for action_type, plugin in self._plugins.items()
        }
        return {**PREDEFINED, **own}

    def plugin(self, action_type: str) -> ActionPlugin | None:
        """Return the plug-in that executes ``action_type``, None if there is none."""
        return self._plugins.get(action_type)

    def _add_plugin(self, plugin: ActionPlugin) -> None:
        action_type = plugin.declaration.action_type
        if action_type in PREDEFINED:
            raise ConfigurationError([f"operations: '{action_type}' is built in; remove it"])
        if action_type in self._plugins:
            raise ConfigurationError([f"operations: '{action_type}' is defined twice"])
        self._plugins[action_type] = plugin


def _with_safe_check(declaration: ActionDeclaration) -> ActionDeclaration:
    """Return the declaration with a check that refuses the action instead of raising an exception."""
    check = declaration.check
    if check is None:
        return declaration

    def safe_check(action: Action) -> str | None:
        try:
            problem = check(action)
        except Exception as error:
            log.exception("an action plug-in failed to check an action", action_type=action.action_type)
            return f"its plug-in failed to check it: {type(error).__name__}: {error}"
        return None if problem is None else str(problem)

    return replace(declaration, check=safe_check)
