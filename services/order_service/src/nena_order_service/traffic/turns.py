"""Who is served first, and how much one decision may do before other tasks get the event loop."""

from __future__ import annotations

from math import inf

from nena_order_service.routing.router import Routes


class Turns:
    """The order in which vehicles are served: a number and a goal for each, until it has reached the goal."""

    def __init__(self) -> None:
        self._turns: dict[str, tuple[int, str]] = {}
        self._last = 0

    def take(self, vehicle: str, goal: str, *, first: bool, waits: bool) -> None:
        """Put a vehicle in line for ``goal``: behind the others, unless it keeps its turn or is ``first``.

        It keeps its turn while it ``waits`` with a request, with an unchanged goal, and if it is ``first``.
        """
        number, before = self._turns.get(vehicle, (None, ""))
        if first and number is None:
            number = min((each for each, _ in self._turns.values()), default=0) - 1
        elif number is None or not (first or waits or goal == before):
            self._last += 1
            number = self._last
        self._turns[vehicle] = number, goal

    def number(self, vehicle: str) -> int:
        """Return the number of a vehicle's turn: a lower one goes first."""
        return self._turns.get(vehicle, (0, ""))[0]

    def goal(self, vehicle: str) -> str:
        """Return the goal of a vehicle's turn; empty if it has none."""
        return self._turns.get(vehicle, (0, ""))[1]

    def end(self, vehicle: str) -> None:
        """End a vehicle's turn, if it has one."""
        self._turns.pop(vehicle, None)


CLAIMS_PER_SEARCH = 5
"""So many attempts to claim a section take about as long as one search."""


class SearchLimit:
    """How many routes one decision may search, and sections it may claim; the next one goes on with the rest.

    It begins with the oldest turn again, but finds the routes of the last one in the caches, and does not
    repeat what is *done*. So it gets further each time, however many vehicles need a search.
    """

    def __init__(self, routes: Routes) -> None:
        self.reached = False
        """Whether a search was left to the next decision."""
        self._routes = routes
        self._most = inf
        self.claims = 0
        """Number of attempts to claim a section for vehicles under way."""
        self._done: set[tuple[str, str]] = set()
        """Tasks for vehicles that are completed since the last decision that left nothing."""

    def begin(self, searches: float) -> None:
        """Begin a decision with so many searches."""
        if not self.reached:
            self._done.clear()
        self.reached = False
        self._most = self._spent + searches

    @property
    def _spent(self) -> float:
        return self._routes.searches + self.claims / CLAIMS_PER_SEARCH

    def permits(self) -> bool:
        """Return whether there may be another search; if not, it is left to the next decision."""
        self.reached = self.reached or self._spent >= self._most
        return not self.reached

    def is_done(self, task: str, vehicle: str) -> bool:
        """Return whether a task for a vehicle is completed."""
        return (task, vehicle) in self._done

    def done(self, task: str, vehicle: str) -> None:
        """Note that a task is completed, unless the limit ended it."""
        if not self.reached:
            self._done.add((task, vehicle))
