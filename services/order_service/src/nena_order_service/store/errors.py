"""Why a store cannot be used."""

from __future__ import annotations

from nena_shared.program import StartError


class StoreError(StartError):
    """The store cannot be used; the text says why, and what to do."""


class FencedError(StoreError):
    """Another order service has taken the store over; this one must not write any more."""

    def __init__(self) -> None:
        super().__init__(
            "another order service is the active one on this store now, so this one has ended. "
            "Start it again: it stands by then"
        )


class StoreLostError(StoreError):
    """The database file is not the one that was opened; what is committed there is gone after a restart."""

    def __init__(self, reason: str) -> None:
        super().__init__(
            f"{reason}, so orders could not be kept. Put the file back, or restore a backup, and start again"
        )
