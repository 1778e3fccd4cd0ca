"""Who uses which resource, and who is in whose way because of it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

from nena_order_service.traffic.resources import Uses


class UseIndex:
    """Counts the uses of each resource by vehicle and direction: a loop uses some of them twice."""

    def __init__(self) -> None:
        self._users: defaultdict[str, dict[tuple[str, str | None], int]] = defaultdict(dict)

    def add(self, vehicle: str, uses: Uses) -> None:
        """Note that ``vehicle`` uses these resources once more."""
        for resource, direction in uses.items():
            users, user = self._users[resource], (vehicle, direction)
            users[user] = users.get(user, 0) + 1

    def remove(self, vehicle: str, uses: Uses) -> None:
        """Take back one :meth:`add` of the same uses."""
        for resource, direction in uses.items():
            users, user = self._users[resource], (vehicle, direction)
            users[user] -= 1
            if not users[user]:
                del users[user]
            if not users:
                del self._users[resource]

    def others(self, vehicle: str, uses: Uses) -> Iterator[tuple[str, str]]:
        """Give who else uses what ``vehicle`` cannot share with them: pairs of vehicle and resource."""
        for resource, direction in uses.items():
            if users := self._users.get(resource):
                for other, their_direction in users:
                    if other != vehicle and (direction is None or direction != their_direction):
                        yield other, resource

    def users(self, resource: str) -> frozenset[str]:
        """Give who uses ``resource``."""
        return frozenset(vehicle for vehicle, _ in self._users.get(resource, ()))
