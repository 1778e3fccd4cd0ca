"""The active errors of a robot, and what ends them (section 6.6.5)."""

from __future__ import annotations

from enum import Enum, auto

from nena_shared.vda5050.error import ErrorEntry, ErrorLevel, ErrorType

LIMIT = 50
"""Maximum number of active errors; beyond it, the error of the oldest refusal is dropped."""

ErrorKey = tuple[str, frozenset[tuple[str, str]]]


class Until(Enum):
    """What ends the report of an error (section 6.6.5)."""

    ORDER_ACCEPTED = auto()
    """A new order or an update is accepted."""
    ORDER_OVER = auto()
    """As ORDER_ACCEPTED, or the order is cancelled."""
    INSTANT_ACTION_ACCEPTED = auto()
    """The next instant action is accepted."""
    ZONE_SET_ACCEPTED = auto()
    """The next zone set is accepted."""
    CONDITION_OVER = auto()
    """Its cause is over."""
    WITHDRAWN = auto()
    """Its reporter withdraws it."""
    AVAILABLE = auto()
    """The robot accepts orders again."""


REFUSED = (Until.ORDER_ACCEPTED, Until.INSTANT_ACTION_ACCEPTED, Until.ZONE_SET_ACCEPTED, Until.AVAILABLE)
"""What ends errors of refused messages."""


class ActiveErrors:
    """All active errors, at most one per type and references (section 6.6.5).

    The headerId is ignored: a resent message repeats the same mistake with another headerId.
    """

    def __init__(self) -> None:
        self._active: dict[ErrorKey, tuple[ErrorEntry, Until]] = {}
        self.revision = 0
        self.entries: tuple[ErrorEntry, ...] = ()
        self.worst_reported: ErrorLevel | None = None
        """The highest level of the errors that people or devices have reported and not withdrawn."""

    def report(self, error: ErrorEntry, until: Until) -> None:
        """Add ``error``, in place of an older one of the same type and references (section 6.6.5)."""
        key = error_key(error)
        if self._active.get(key) == (error, until):
            return
        # It moves to the end: the state lists errors in the order in which they were last reported.
        self._active.pop(key, None)
        while len(self._active) >= LIMIT:
            # The oldest refusal goes first: errors that explain why the robot stops are kept longest.
            refusals = (key for key, (_, until) in self._active.items() if until in REFUSED)
            del self._active[next(refusals, next(iter(self._active)))]
        self._active[key] = (error, until)
        self._note_change()

    def end(self, *causes: Until) -> None:
        """Remove every error that one of ``causes`` ends (section 6.6.5)."""
        ended = [key for key, (_, until) in self._active.items() if until in causes]
        for key in ended:
            del self._active[key]
        if ended:
            self._note_change()

    def withdraw(self, error: ErrorEntry) -> None:
        """Remove ``error``; one that is not active is ignored."""
        if self._active.pop(error_key(error), None):
            self._note_change()

    def set_condition(self, kind: ErrorType | str, error: ErrorEntry | None) -> None:
        """Report ``error`` as the only one of its ``kind``; None withdraws it (section 6.6.5)."""
        if error is None and not self._active:
            return
        outdated = [
            key
            for key, (_, until) in self._active.items()
            if until is Until.CONDITION_OVER and key[0] == kind
        ]
        # As long as it has the same references, the error keeps its place in the state.
        if error is None or outdated != [error_key(error)]:
            for key in outdated:
                del self._active[key]
            if outdated:
                self._note_change()
        if error is not None:
            self.report(error, Until.CONDITION_OVER)

    def _note_change(self) -> None:
        self.revision += 1
        self.entries = tuple(entry for entry, _ in self._active.values())
        reported = {entry.error_level for entry, until in self._active.values() if until is Until.WITHDRAWN}
        self.worst_reported = next((level for level in reversed(ErrorLevel) if level in reported), None)


def error_key(error: ErrorEntry) -> ErrorKey:
    """Return the key of an error: its type, and its references without the headerId."""
    references = (
        (reference.reference_key, reference.reference_value) for reference in error.error_references
    )
    return error.error_type, frozenset(reference for reference in references if reference[0] != "headerId")
