"""States of actions, the queue of actions, and the load (sections 6.2.2, 6.2.3 and 6.6.9)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

from nena_edge_agent.protocol.declaration import ActionDeclaration, LoadChange
from nena_shared.vda5050.action import Action, ActionState, ActionStatus, BlockingType
from nena_shared.vda5050.factsheet import ActionScope
from nena_shared.vda5050.state import Load

ACTIVE = frozenset(
    {ActionStatus.INITIALIZING, ActionStatus.RUNNING, ActionStatus.PAUSED, ActionStatus.RETRIABLE}
)
"""Statuses of an action that has started and not ended."""

_PREDECESSORS: dict[ActionStatus, frozenset[ActionStatus]] = {
    ActionStatus.WAITING: frozenset(),
    ActionStatus.INITIALIZING: frozenset({ActionStatus.WAITING, ActionStatus.PAUSED, ActionStatus.RETRIABLE}),
    ActionStatus.RUNNING: ACTIVE | {ActionStatus.WAITING},
    ActionStatus.PAUSED: frozenset({ActionStatus.INITIALIZING, ActionStatus.RUNNING}),
    ActionStatus.RETRIABLE: frozenset({ActionStatus.RUNNING}),
    ActionStatus.FINISHED: ACTIVE | {ActionStatus.WAITING},
    ActionStatus.FAILED: ACTIVE | {ActionStatus.WAITING},
}
"""Statuses that may precede each status (section 6.6.9, figure 21); FINISHED and FAILED are final."""
DESCRIPTOR_LIMIT = 200
"""Maximum length of an actionDescriptor in the state, characters; the rest is cut off."""


@dataclass(slots=True)
class ActionRecord:
    """An action and its status; ``sequence_id`` is that of its node or edge, -1 for an instant action.

    The journal has these fields: one with a default would be left out of it.
    """

    action: Action
    scope: ActionScope
    sequence_id: int
    status: ActionStatus
    result: str | None

    @property
    def active(self) -> bool:
        """Return whether the action has started and not ended."""
        return self.status in ACTIVE


class ActionStates:
    """Actions and their states, in the order of arrival (section 6.6.9)."""

    def __init__(self) -> None:
        self._records: dict[str, ActionRecord] = {}
        self._states: tuple[ActionState, ...] | None = ()
        self._shown: dict[str, ActionState] = {}
        self.revision = 0

    def __iter__(self) -> Iterator[ActionRecord]:
        return iter(self._records.values())

    def __contains__(self, action_id: str) -> bool:
        return action_id in self._records

    def get(self, action_id: str) -> ActionRecord | None:
        """Return the record of an action, None if it is unknown."""
        return self._records.get(action_id)

    def add(self, records: Iterable[ActionRecord]) -> None:
        """Append actions."""
        for record in records:
            self._records[record.action.action_id] = record
            self._shown.pop(record.action.action_id, None)
        self._note_change()

    def remove(self, unwanted: Callable[[ActionRecord], bool]) -> None:
        """Remove every action for which ``unwanted`` returns True."""
        kept = {key: record for key, record in self._records.items() if not unwanted(record)}
        if len(kept) != len(self._records):
            self._records = kept
            self._shown = {key: shown for key, shown in self._shown.items() if key in kept}
            self._note_change()

    def change(self, action_id: str, status: ActionStatus, result: str | None = None) -> bool:
        """Set a status if figure 21 allows it; return whether anything has changed (section 6.6.9)."""
        record = self._records.get(action_id)
        if record is None or record.status not in _PREDECESSORS[status]:
            return False
        if record.status is status and result in (None, record.result):
            return False
        record.status = status
        record.result = result if result is not None else record.result
        self._forget_shown(action_id)
        return True

    def restart(self, action_id: str) -> None:
        """Reset an action to INITIALIZING: after a restart of the agent, its plug-in starts it again."""
        self._records[action_id].status = ActionStatus.INITIALIZING
        self._forget_shown(action_id)

    @property
    def all_ended(self) -> bool:
        """Return whether all actions have ended."""
        return all(record.status.ended for record in self._records.values())

    @property
    def states(self) -> tuple[ActionState, ...]:
        """Return the action states for the state message (section 6.6.9)."""
        if self._states is None:
            # Only changed states are copied: an order may have a thousand actions.
            for action_id, record in self._records.items():
                if action_id not in self._shown:
                    descriptor = record.action.action_descriptor
                    self._shown[action_id] = ActionState(
                        action_id=action_id,
                        action_type=record.action.action_type,
                        action_descriptor=descriptor and descriptor[:DESCRIPTOR_LIMIT],
                        action_status=record.status,
                        action_result=record.result,
                    )
            self._states = tuple(self._shown[action_id] for action_id in self._records)
        return self._states

    def _forget_shown(self, action_id: str) -> None:
        self._shown.pop(action_id, None)
        self._note_change()

    def _note_change(self) -> None:
        self.revision += 1
        self._states = None


RUNS_ALONE = (BlockingType.SINGLE, BlockingType.HARD)
STOPS_DRIVING = (BlockingType.SOFT, BlockingType.HARD)


def allow_driving(actions: Iterable[Action]) -> bool:
    """Return whether the robot may drive during ``actions``: none is SOFT or HARD (section 6.2.2)."""
    return all(action.blocking_type not in STOPS_DRIVING for action in actions)


class ActionQueue:
    """Actions of reached nodes and entered edges that have not ended, in order (section 6.2.2)."""

    def __init__(self) -> None:
        self._actions: dict[str, BlockingType] = {}

    def __iter__(self) -> Iterator[str]:
        return iter(self._actions)

    def append(self, actions: Iterable[Action]) -> None:
        """Append the actions of a node or edge."""
        self._actions.update((action.action_id, action.blocking_type) for action in actions)

    def remove(self, action_id: str) -> None:
        """Remove an action that has ended; an unknown one is ignored."""
        self._actions.pop(action_id, None)

    def clear(self) -> None:
        """Remove all actions."""
        self._actions.clear()

    @property
    def driving_allowed(self) -> bool:
        """Return whether no SOFT or HARD action is left (section 6.2.2)."""
        return all(blocking not in STOPS_DRIVING for blocking in self._actions.values())

    def runnable(self) -> list[str]:
        """Return the actions that may run now, including those that already run (section 6.2.2).

        NONE and SOFT actions at the front run in parallel. A SINGLE or HARD action waits for all actions
        before it, runs alone, and blocks all actions after it.
        """
        parallel: list[str] = []
        for action_id, blocking in self._actions.items():
            # SINGLE and HARD run alone; NONE and SOFT before them must end first (6.2.2).
            if blocking in RUNS_ALONE:
                return parallel or [action_id]
            parallel.append(action_id)
        return parallel


UNKNOWN_LOAD = Load()
"""A load whose ID and type are unknown."""


def loads_after(
    action: Action, declaration: ActionDeclaration | None, loads: tuple[Load, ...]
) -> tuple[Load, ...]:
    """Return the robot's loads after ``action``, given ``loads`` before it."""
    match declaration.load if declaration else None:
        case LoadChange.TAKE:
            return (
                Load(
                    load_id=_text_parameter(action, "loadId"), load_type=_text_parameter(action, "loadType")
                ),
            )
        case LoadChange.GIVE:
            return ()
        case _:
            return loads


def loaded_after(
    actions: Iterable[Action], declarations: Mapping[str, ActionDeclaration], *, loaded: bool
) -> bool:
    """Return whether the robot is loaded after executing ``actions`` in order."""
    for action in actions:
        declaration = declarations.get(action.action_type)
        if declaration and declaration.load:
            loaded = declaration.load is LoadChange.TAKE
    return loaded


def first_load_problem(
    actions: Iterable[Action], declarations: Mapping[str, ActionDeclaration], *, loaded: bool
) -> tuple[Action, str] | None:
    """Return the first action that the load at that point makes impossible, and the reason."""
    for action in actions:
        declaration = declarations.get(action.action_type)
        problem = declaration.load_problem(loaded=loaded) if declaration else None
        if problem:
            return action, problem
        loaded = loaded_after((action,), declarations, loaded=loaded)
    return None


def loads_by_sensor(loads: tuple[Load, ...], *, loaded: bool) -> tuple[Load, ...]:
    """Return the loads after a report of the load sensor; a known load keeps its ID."""
    if not loaded:
        return ()
    return loads or (UNKNOWN_LOAD,)


def _text_parameter(action: Action, key: str) -> str | None:
    value = action.parameter(key)
    return None if value is None else str(value)
