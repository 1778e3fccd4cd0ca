"""What is remembered of a conversation that may have no end: the newest so many, the oldest is forgotten."""

from __future__ import annotations

from typing import Final, TypeVar

K = TypeVar("K")
V = TypeVar("V")

REMEMBERED: Final = 10_000
"""Ids of one kind; what is older than so many orders or actions is not looked for any more."""


class Remembered(dict[K, V]):
    """A dictionary that forgets its oldest entry when it is full."""

    def __init__(self, limit: int = REMEMBERED) -> None:
        super().__init__()
        self._limit = limit

    def __setitem__(self, key: K, value: V) -> None:
        super().__setitem__(key, value)
        if len(self) > self._limit:
            del self[next(iter(self))]
