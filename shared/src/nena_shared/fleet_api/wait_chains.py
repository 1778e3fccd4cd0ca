"""Follow chains of waiting vehicles to the head of the queue, or to a circle."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class WaitChain:
    """The chain of vehicles that a vehicle waits for, directly or indirectly."""

    next: str
    """The next vehicle in the chain."""
    head: str | None
    """The vehicle at the head, which waits for no other; None: the chain ends in a circle."""
    circle: tuple[str, ...] = ()
    """Vehicles that wait for each other, each for the next one, starting with the first by name."""

    @property
    def end(self) -> tuple[str, ...]:
        """The head, or the vehicles of the circle; equal for all vehicles in a queue."""
        return (self.head,) if self.head is not None else self.circle


def wait_chains(
    waits: Mapping[str, Collection[str]], stuck: Collection[str] = frozenset()
) -> dict[str, WaitChain]:
    """Return the chain of each vehicle; ``waits`` maps vehicles to those they wait for.

    If a vehicle waits for several, its chain follows the one that leads to a ``stuck`` vehicle (emergency
    stop, error, offline), else to a circle, else to any other vehicle; the nearest first. A stuck vehicle is
    the head of its queue even if it waits itself; so is an unknown vehicle.
    """
    asked = {
        name: tuple(vehicle for vehicle in vehicles if vehicle != name)
        for name, vehicles in waits.items()
        # 0044: somebody has to help a stuck vehicle first, whatever it waits for
        if name not in stuck
    }
    asked = {name: vehicles for name, vehicles in asked.items() if vehicles}
    behind: dict[str, list[str]] = defaultdict(list)
    for name, vehicles in asked.items():
        for vehicle in vehicles:
            behind[vehicle].append(name)
    chains: dict[str, WaitChain] = {}
    heads = [name for name in behind if name not in asked]
    # a vehicle gets the first chain that reaches it, so what nobody ends by waiting comes first
    _line_up(chains, behind, deque((head, WaitChain(head, head)) for head in heads if head in stuck))
    open_ways = _endless(asked, behind, chains.keys())
    # the first that never ends: those it waits for come nearest first
    following = {name: next(vehicle for vehicle in asked[name] if vehicle in open_ways) for name in open_ways}
    row = deque[tuple[str, WaitChain]]()
    for circle in _circles(following):
        for name in circle:
            chains[name] = WaitChain(following[name], None, circle)
            row.append((name, chains[name]))
    _line_up(chains, behind, row)
    _line_up(chains, behind, deque((head, WaitChain(head, head)) for head in heads if head not in stuck))
    return chains


def chain_from(name: str, chains: Mapping[str, WaitChain]) -> tuple[str, ...]:
    """Return the vehicles from ``name`` to the head, or once around the circle."""
    row = [name]
    while (chain := chains.get(row[-1])) and chain.next not in row:
        row.append(chain.next)
    return tuple(row)


def _line_up(
    chains: dict[str, WaitChain], behind: Mapping[str, Iterable[str]], row: deque[tuple[str, WaitChain]]
) -> None:
    """Add chains for the vehicles behind those in ``row`` that have none, nearest first."""
    while row:
        name, chain = row.popleft()
        for vehicle in behind.get(name, ()):
            if vehicle not in chains:
                chains[vehicle] = WaitChain(name, chain.head, chain.circle)
                row.append((vehicle, chain))


def _endless(
    waits: Mapping[str, Iterable[str]], behind: Mapping[str, Iterable[str]], known: Collection[str]
) -> dict[str, None]:
    """Return the vehicles whose chain never ends; skip ``known`` ones."""
    left = {name: None for name in waits if name not in known}
    count = {name: sum(vehicle in left for vehicle in waits[name]) for name in left}
    # peel off, from the ends, whoever waits for nobody that is left; circles and those behind them remain
    ends = deque(name for name, number in count.items() if not number)
    while ends:
        name = ends.popleft()
        del left[name]
        for vehicle in behind.get(name, ()):
            if vehicle in left:
                count[vehicle] -= 1
                if not count[vehicle]:
                    ends.append(vehicle)
    return left


def _circles(following: Mapping[str, str]) -> Iterator[tuple[str, ...]]:
    """Yield the circles in ``following``."""
    seen: set[str] = set()
    for start in following:
        way: dict[str, int] = {}
        name = start
        while name not in seen:
            seen.add(name)
            way[name] = len(way)
            name = following[name]
        if name in way:
            circle = list(way)[way[name] :]
            # from the first by name, so that all vehicles of a circle report the same one
            first = circle.index(min(circle))
            yield (*circle[first:], *circle[:first])
