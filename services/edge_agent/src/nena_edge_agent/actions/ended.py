"""What is given in place of an action that runs, where it has ended as it began."""

from __future__ import annotations


class Ended:
    """Nothing can be done to it any more."""

    def pause(self) -> None:
        """Do nothing."""

    def resume(self) -> None:
        """Do nothing."""

    def cancel(self) -> None:
        """Do nothing."""


ENDED = Ended()
