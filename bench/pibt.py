"""The yardstick of the traffic benchmark: priority inheritance with backtracking (PIBT) in lock-step.

Okumura, Machida, Défago, Tamura: Priority Inheritance with Backtracking for Iterative Multi-agent Path
Finding, Artificial Intelligence 310 (2022). All robots move at once from point to point. A step takes the
average time of a path on the routes between stations. Longer times, the work at stations and, if requested,
turning, are a debt: a robot that owes a step stands still for one.

Beyond the paper, robots in a dead end go first: otherwise one that wants to enter it and one that wants to
leave it wait for each other for ever.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from heapq import heappop, heappush
from itertools import islice
from math import atan2, inf, pi
from random import Random
from statistics import fmean

from bench.halls import SPEED_MM_S, Hall, orders_by_lot

WORK_SECONDS = 2.0
TURN_RATE = 2.0
"""rad/s, as loopback robots turn."""
ORDERS_OF_BOUND = 2000

WORK = ""
"""The goal of a robot that does at a station what it came for; no point has this name."""


@dataclass(frozen=True)
class Road:
    """One way from a point to a neighbour."""

    to: str
    seconds: float
    heading: float


class Roads:
    """The plant for lock-step and bound: points, and the time from one to the next."""

    def __init__(self, hall: Hall) -> None:
        self.of: dict[str, list[Road]] = {each.name: [] for each in hall.plant.points}
        self._into: dict[str, list[tuple[str, float]]] = {name: [] for name in self.of}
        for edge in hall.plant.edges():
            one, other = hall.plant.point(edge.source), hall.plant.point(edge.destination)
            heading = atan2(other.y_mm - one.y_mm, other.x_mm - one.x_mm)
            seconds = edge.path.length_mm / min(SPEED_MM_S, edge.max_velocity_mm_s)
            self.of[one.name].append(Road(other.name, seconds, heading))
            self._into[other.name].append((one.name, seconds))
        self.to = cache(self._to)

    def _to(self, goal: str) -> dict[str, float]:
        """Return the seconds from each point to ``goal``."""
        found, queue = {goal: 0.0}, [(0.0, goal)]
        while queue:
            seconds, point = heappop(queue)
            if seconds > found[point]:
                continue
            for before, more in self._into[point]:
                if seconds + more < found.get(before, inf):
                    found[before] = seconds + more
                    heappush(queue, (seconds + more, before))
        return found

    def way(self, start: str, goal: str) -> Iterator[Road]:
        """Yield the roads of a shortest way."""
        left = self.to(goal)
        while start != goal:
            road = min(self.of[start], key=lambda each: each.seconds + left.get(each.to, inf))
            yield road
            start = road.to


def bound(hall: Hall, robots: int, *, turns: bool = False) -> float:
    """Return the orders per minute of robots that never meet."""
    roads, at, heading, spent = Roads(hall), "", 0.0, 0.0
    points = hall.station_points
    for order in islice(orders_by_lot(hall), ORDERS_OF_BOUND):
        for goal in map(points.__getitem__, order):
            for road in roads.way(at or goal, goal):
                spent += road.seconds + (_turning(heading, road.heading) if turns else 0.0)
                heading = road.heading
            at, spent = goal, spent + WORK_SECONDS
    return robots * ORDERS_OF_BOUND * 60 / spent


def _turning(before: float, after: float) -> float:
    return abs((after - before + pi) % (2 * pi) - pi) / TURN_RATE


@dataclass
class Agent:
    """One robot: where it is, and what is left of its order."""

    at: str
    lot: float
    goals: list[str] = field(default_factory=list)
    heading: float = 0.0
    since: int = 0
    """The step in which it got its goal: who has gone longest without reaching it goes first."""
    debt: float = 0.0
    next: str | None = None


class LockStep:
    """Robots of PIBT with a backlog that never empties."""

    def __init__(self, hall: Hall, robots: int, *, turns: bool = False, seed: int = 1) -> None:
        self.roads = Roads(hall)
        self.finished = 0
        self.steps = 0
        self._turns = turns
        self._random = Random(seed)
        self._points = hall.station_points
        self._orders = iter(orders_by_lot(hall))
        self.agents = [Agent(each.name, self._random.random()) for each in hall.starts(robots)]
        stations = list(self._points.values())
        ways = (self.roads.way(a, b) for a in stations for b in stations if a != b)
        self.seconds = fmean(road.seconds for way in ways for road in way)

    def run(self, minutes: float) -> int:
        """Run for so many minutes; return how many orders were finished."""
        before = self.finished
        for _ in range(round(minutes * 60 / self.seconds)):
            self.step()
        return self.finished - before

    def step(self) -> None:
        """Move all robots by one step."""
        self.steps += 1
        self._here = {each.at: each for each in self.agents}
        self._taken: set[str] = set()
        for each in self.agents:
            self._attend(each)
            each.next = None
            if each.debt >= self.seconds:
                each.debt -= self.seconds
                self._take(each, each.at)
        for each in sorted(self.agents, key=lambda one: (len(self.roads.of[one.at]) > 1, one.since, one.lot)):
            if each.next is None:
                self._plan(each, None)
        for each in self.agents:
            self._move(each)

    def _attend(self, agent: Agent) -> None:
        """Begin the work at a goal, or go on to the next one once it is done."""
        if agent.goals[:1] == [WORK] and agent.debt < self.seconds:
            agent.goals.pop(0)
            agent.since = self.steps
            self.finished += not agent.goals
        if not agent.goals:
            agent.goals = [each for name in next(self._orders) for each in (self._points[name], WORK)]
        if agent.goals[0] == agent.at:
            agent.goals.pop(0)
            agent.debt += WORK_SECONDS

    def _plan(self, agent: Agent, pusher: Agent | None) -> bool:
        """Choose the next point of a robot, and those of the robots that it pushes; False: there is none."""
        left = self.roads.to(agent.goals[0] or agent.at)
        choice = [agent.at, *(road.to for road in self.roads.of[agent.at])]
        choice.sort(key=lambda point: (left.get(point, inf), point in self._here, self._random.random()))
        for point in choice:
            other = self._here.get(point)
            swaps = other is not None and other is not agent and other.next == agent.at
            if point in self._taken or swaps or (pusher and point == pusher.at):
                continue
            self._take(agent, point)
            if not other or other.next is not None or self._plan(other, agent):
                return True
        self._take(agent, agent.at)
        return False

    def _take(self, agent: Agent, point: str) -> None:
        agent.next = point
        self._taken.add(point)

    def _move(self, agent: Agent) -> None:
        if agent.next is None or agent.next == agent.at:
            return
        road = next(each for each in self.roads.of[agent.at] if each.to == agent.next)
        if self._turns:
            agent.debt += _turning(agent.heading, road.heading)
        agent.at, agent.heading = road.to, road.heading


def orders_per_minute(hall: Hall, robots: int, *, turns: bool = False, minutes: float = 30.0) -> float:
    """Return what PIBT gets done, after two minutes in which it gets under way."""
    fleet = LockStep(hall, robots, turns=turns)
    fleet.run(2.0)
    return fleet.run(minutes) / minutes
