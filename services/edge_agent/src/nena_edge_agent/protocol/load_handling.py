"""What the robot carries: now, and by when an action of its order has its turn (sections 6.2.3 and 7.8)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.state import Load

UNKNOWN_LOAD = Load()
"""What a robot carries of which only that is known."""


def loads_after(
    action: Action, declaration: ActionDeclaration | None, loads: tuple[Load, ...]
) -> tuple[Load, ...]:
    """Give what a robot with ``loads`` carries when ``action`` has finished; the action may name its load."""
    match declaration.load if declaration else None:
        case LoadChange.TAKE:
            return (Load(load_id=_text(action, "loadId"), load_type=_text(action, "loadType")),)
        case LoadChange.GIVE:
            return ()
        case _:
            return loads


def loaded_after(
    actions: Iterable[Action], declarations: Mapping[str, ActionDeclaration], *, loaded: bool
) -> bool:
    """Tell whether the robot carries something when all of ``actions`` have finished, one after the other."""
    for action in actions:
        declaration = declarations.get(action.action_type)
        if declaration and declaration.load:
            loaded = declaration.load is LoadChange.TAKE
    return loaded


def first_load_problem(
    actions: Iterable[Action], declarations: Mapping[str, ActionDeclaration], *, loaded: bool
) -> tuple[Action, str] | None:
    """Find the first action that will not fit what the robot carries by then, and say why."""
    for action in actions:
        declaration = declarations.get(action.action_type)
        problem = declaration.load_problem(loaded=loaded) if declaration else None
        if problem:
            return action, problem
        loaded = loaded_after((action,), declarations, loaded=loaded)
    return None


def sensed(loads: tuple[Load, ...], *, loaded: bool) -> tuple[Load, ...]:
    """Give what the robot carries by its sensor, which knows no names; one that is known stays known."""
    if not loaded:
        return ()
    return loads or (UNKNOWN_LOAD,)


def _text(action: Action, key: str) -> str | None:
    value = action.parameter(key)
    return None if value is None else str(value)
