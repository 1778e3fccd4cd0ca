"""Numbers of changes, by which those who follow the orders find out what they have missed."""

from __future__ import annotations

from collections import deque

from nena_order_service.store.changes import Changes


class ChangeNumbers:
    """Counts the changes of all orders of a store, over restarts and takeovers too.

    They are given in the order in which changes are committed and told; a step that changes an order several
    times has one number for all of its versions.
    """

    def __init__(self) -> None:
        self.last = 0
        """The last number given."""
        self.told = 0
        """The last number of a change that was told."""
        self._untold: dict[str, deque[tuple[int, int]]] = {}
        """Versions and their numbers, by the orders' names."""

    def give(self, changes: Changes) -> None:
        """Number the changes of a step."""
        self.last = changes.numbered(self.last)
        for change in changes.orders.values():
            order = change.order
            versions = self._untold.setdefault(order.name, deque())
            versions.append((order.status.version, change.change_number))

    def begin(self, last: int) -> None:
        """Go on behind the last number of the store."""
        self.last = self.told = last

    def of(self, name: str, version: int) -> tuple[int, bool]:
        """Give the number of a version that is told now, and whether it is the last version of its change.

        Versions are told in their order. The number is 0 for one that is told without having been changed.
        """
        versions = self._untold.get(name)
        while versions and versions[0][0] < version:
            versions.popleft()
        if not versions:
            self._untold.pop(name, None)
            return 0, False
        last_version, number = versions[0]
        if last_version > version:
            return number, False
        self.told = number
        versions.popleft()
        if not versions:
            del self._untold[name]
        return number, True
