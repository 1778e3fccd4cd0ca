"""The errors that a robot shows, and until when (section 6.6.5)."""

from __future__ import annotations

from enum import Enum, auto

from nena_shared.vda5050.error import ErrorEntry, ErrorReference, ErrorType

LIMIT = 50
"""Errors shown at the same time; beyond it the oldest goes."""

_Key = tuple[str, tuple[ErrorReference, ...]]


class Until(Enum):
    """What ends the report of an error."""

    ORDER_ACCEPTED = auto()
    """A new order or an update is accepted."""
    ORDER_OVER = auto()
    """As ORDER_ACCEPTED, or the order is cancelled."""
    INSTANT_ACTION_ACCEPTED = auto()
    """The next instant action is accepted."""
    CONDITION_OVER = auto()
    """Its cause is gone."""


class ActiveErrors:
    """All active errors, at most one per type and references."""

    def __init__(self) -> None:
        self._active: dict[_Key, tuple[ErrorEntry, Until]] = {}
        self.revision = 0
        self.entries: tuple[ErrorEntry, ...] = ()

    def show(self, error: ErrorEntry, until: Until) -> None:
        """Add ``error``, in place of an older one of the same type and references."""
        key = (error.error_type, error.error_references)
        if self._active.get(key) == (error, until):
            return
        self._active.pop(key, None)
        while len(self._active) >= LIMIT:
            del self._active[next(iter(self._active))]
        self._active[key] = (error, until)
        self._changed()

    def end(self, *causes: Until) -> None:
        """Take away every error that one of ``causes`` ends."""
        ended = [key for key, (_, until) in self._active.items() if until in causes]
        for key in ended:
            del self._active[key]
        if ended:
            self._changed()

    def condition(self, kind: ErrorType | str, error: ErrorEntry | None) -> None:
        """Show ``error`` as the only one of its ``kind`` for as long as its cause lasts, None: it is gone."""
        if error is None or self._other_than(error):
            old = [key for key in self._active if key[0] == kind]
            for key in old:
                del self._active[key]
            if old:
                self._changed()
        if error is not None:
            self.show(error, Until.CONDITION_OVER)

    def _other_than(self, error: ErrorEntry) -> bool:
        return any(
            kind == error.error_type and references != error.error_references
            for kind, references in self._active
        )

    def _changed(self) -> None:
        self.revision += 1
        self.entries = tuple(entry for entry, _ in self._active.values())
