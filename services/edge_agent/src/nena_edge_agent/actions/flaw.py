"""What is wrong with a report of a plug-in, before the core gets hold of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Final

from nena_edge_agent.protocol.events import ActionReport
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.error import ErrorEntry
from nena_shared.vda5050.state import Load, Map
from nena_shared.vda5050.zone_set import ZoneSet

REPORTED: Final = frozenset(
    {
        ActionStatus.INITIALIZING,
        ActionStatus.RUNNING,
        ActionStatus.PAUSED,
        ActionStatus.FINISHED,
        ActionStatus.FAILED,
    }
)
"""What a plug-in may say; the rest is the core's."""


def _all_of(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, tuple) and all(isinstance(each, kind) for each in value)


def _one(kind: type) -> Callable[[Any], bool]:
    return lambda value: isinstance(value, kind)


_SOUND: Final[Mapping[str, tuple[Callable[[Any], bool], str]]] = {
    "result": (_one(str), "a text"),
    "loads": (_all_of(Load), "a tuple of Load"),
    "charging": (_one(bool), "True or False"),
    "maps": (_all_of(Map), "a tuple of Map"),
    "zone_set": (_one(ZoneSet), "a ZoneSet"),
    "error": (_one(ErrorEntry), "an ErrorEntry"),
}
"""How to know a sound value of each field that may be given, and what it is called."""


def flaw_of(report: object, action_id: str) -> str | None:
    """Say what is wrong with a report of the action ``action_id``, in the words that follow "reported"."""
    if not isinstance(report, ActionReport):
        return f"{_named(report)}, which is no ActionReport"
    if report.action_id != action_id:
        return f"something of the action {report.action_id!r}, which is another one"
    if report.status not in REPORTED:
        return f"the status {report.status!r}, which is not a plug-in's to report"
    for name, (sound, what) in _SOUND.items():
        value = getattr(report, name)
        if value is not None and not sound(value):
            return f"{name} {_named(value)}, which is not {what}"
    return None


def _named(value: object) -> str:
    return repr(value)[:100]
