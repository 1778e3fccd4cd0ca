"""The checks a to l, which any Nav2 must pass with the edge agent; each returns its result as text."""

from __future__ import annotations

import time
from collections.abc import Awaitable, Callable
from math import dist
from statistics import median
from typing import Any

from action_msgs.msg import GoalStatusArray
from nav_msgs.msg import OccupancyGrid

from nav2_acceptance.site import LeftOutError, Nav2Site, Place
from nena_edge_agent.doctor.finding import LinkVerdict
from nena_edge_agent.doctor.navigation import judge_robot
from nena_edge_agent.doctor.ros_probe import observe_robot
from nena_edge_agent.driver.port import STANDING
from nena_edge_agent.nav2.settings import RosSettings
from support.action_types import HERE
from support.edge_agent import error_types, status_of
from support.nav2_agent import failure_of, ready, stamp_of
from support.ros import LATCHED
from support.simulator import goal
from support.waiting import until

Check = Callable[[Nav2Site], Awaitable[str]]
MODES = ("topics", *(("action", "through_poses") if HERE else ()))
SERVERS = (
    *("bt_navigator", "controller_server", "planner_server", "behavior_server"),
    *("amcl", "lifecycle_manager_navigation"),
)
ORDERS_TIMED = 5
DEVIATION = 1.1
"""Allowed deviation of nodes that are passed at 0.5 m/s, metres (docs/nav2.md)."""
SOON = 3.0
"""Maximum time from an order to the goal in Nav2's status array, seconds; also for a busy computer."""


def error_codes(state: dict[str, Any]) -> str:
    """Return a state's description of a failed drive."""
    return " ".join(each.get("errorDescription", "") for each in state["errors"])


async def doctor(site: Nav2Site) -> str:
    if site.pose is not None:
        async with site.agent():
            pass  # sets the position of a robot that is not localised
    settings = RosSettings(domain_id=site.bench.domain_id, namespace=site.namespace, call_timeout=1.0)
    findings = judge_robot(await observe_robot(settings), settings)
    missing = [f"{each.link}: {each.text}" for each in findings if each.verdict is LinkVerdict.MISSING]
    assert not missing, "; ".join(missing)
    return "; ".join(f"{each.link}: {each.text}" for each in findings)


async def orders(site: Nav2Site) -> str:
    took = []
    for mode in MODES:
        async with site.agent(mode, drive={"strategy": "pass_through"}):
            began = time.monotonic()
            done = await site.done(site.send(*site.over()))
            assert error_types(done) == [], f"{mode}: {error_codes(done)}"
            took.append(f"{mode} {time.monotonic() - began:.1f} s")
    return ", ".join(took)


async def cancel(site: Nav2Site) -> str:
    async with site.agent():
        order_id = site.send(site.far)
        await site.moves()
        began = time.monotonic()
        state = await site.instant("cancelOrder")
        took = time.monotonic() - began
        assert await site.bench.speed_at(state) < 0.01
        assert not state["driving"]
        await site.done(order_id)
    return f"FINISHED, robot stands after {took:.2f} s"


async def unreachable(site: Nav2Site) -> str:
    course, told = site.course, []
    places = {"outside": course.outside, "obstacle": course.obstacle, "edge": course.edge}
    known = {name: place for name, place in places.items() if place is not None}
    if not known:
        text = "no unreachable position is known (--outside, --obstacle, --edge)"
        raise LeftOutError(text)
    await site.close_in()
    try:
        for name, place in known.items():
            async with site.agent():
                began, since = time.monotonic(), len(site.bench.fleet.states)
                site.send(place, radius=0.25)
                failed = await site.when(lambda state: failure_of(state) is not None, since=since)
                told.append(f"{name}: {failure_of(failed)} after {time.monotonic() - began:.1f} s")
                await site.instant("cancelOrder")
    finally:
        await site.open_up()
    async with site.agent():
        since = len(site.bench.fleet.states)
        site.send(site.far, radius=0.05)
        await site.when(lambda state: "DEVIATION_TOO_SMALL" in error_types(state), since=since)
        await site.instant("cancelOrder")
        told.append("deviation below the tolerance: reported before driving")
    return "; ".join(told)


async def foreign_goals(site: Nav2Site) -> str:
    rviz = site.bench.ros.publisher(type(goal(0.0, 0.0)), f"{site.namespace.rstrip('/')}/goal_pose")
    for mode in MODES:
        async with site.agent(mode, drive={"strategy": "pass_through"}):
            since = len(site.bench.fleet.states)
            order_id = site.send(*site.over())
            await site.moves()
            rviz.publish(goal(*site.course.beside))
            await site.when(lambda state: "EXTERNAL_GOAL" in error_types(state), since=since)
            done = await site.done(order_id)
            assert error_types(done) == [], f"{mode}: {error_codes(done)}"
    return f"the order waits, then continues ({', '.join(MODES)})"


async def extensions(site: Nav2Site) -> str:
    told = [
        f"{mode}, {name}: lowest speed {await _extended(site, mode, share):.2f} of cruise"
        for mode in MODES[1:]
        for name, share in (("early", 0.2), ("on request", None), ("late", 0.6))
    ]
    if not told:
        text = "nav2_msgs is not installed here"
        raise LeftOutError(text)
    return "; ".join(told)


async def _extended(site: Nav2Site, mode: str, share: float | None) -> float:
    """Extend an order after a share of its path; return the lowest speed between start and end.

    ``share`` None: when the robot requests it.
    """
    description = {} if site.speed is None else {"maximum_speed": site.speed}
    async with site.agent(mode, drive={"strategy": "pass_through"}, description=description):
        first, way, since = len(site.bench.odometry), site.over(), len(site.bench.fleet.states)
        if share is None:
            order_id = site.send(*way, radius=DEVIATION, horizon=1)
            await site.when(
                lambda state: state["orderId"] == order_id and state["newBaseRequest"], since=since
            )
        else:
            length, begin = share * dist(site.here, way[1]), _place(site)
            order_id = site.send(*way[:2], radius=DEVIATION)
            await until(lambda: dist(begin, _place(site)) >= length, what="part of the path")
        site.extend(order_id, way, radius=DEVIATION)
        done = await site.when(
            lambda state: (state["orderId"], state["lastNodeId"]) == (order_id, f"n{len(way)}"), since=0
        )
        assert error_types(done) == [], f"{mode}: {error_codes(done)}"
        speeds = [abs(each.twist.twist.linear.x) for each in site.bench.odometry[first:]]
    fast = [index for index, speed in enumerate(speeds) if speed > 0.8 * max(speeds)]
    return float(min(speeds[fast[0] : fast[-1] + 1]) / max(speeds))


def _place(site: Nav2Site) -> Place:
    """Return where the robot is by its odometry."""
    found = site.bench.odometry[-1].pose.pose.position
    return float(found.x), float(found.y)


async def deaths(site: Nav2Site) -> str:
    told = []
    for server in SERVERS:
        async with site.agent():
            order_id = site.send(site.far)
            await site.moves()
            since, seen = len(site.bench.fleet.states), len(site.bench.odometry)
            await site.die(server)
            state = await _stopped_or_done(site, order_id, since)
            await site.stands()
            told.append(f"{server}: {state} after {_moved_for(site, seen):.1f} s")
            await site.live(server)
            if server == "amcl":
                await site.put_back()
            await site.instant("cancelOrder")
    return "; ".join(told)


def _moved_for(site: Nav2Site, seen: int) -> float:
    """Return the time from the odometry message ``seen`` to standstill by the robot's clock, seconds."""
    messages = site.bench.odometry[seen - 1 :]
    moving = [each for each in messages if abs(each.twist.twist.linear.x) >= STANDING]
    return stamp_of(moving[-1]) - stamp_of(messages[0]) if moving else 0.0


async def _stopped_or_done(site: Nav2Site, order_id: str, since: int) -> str:
    """Wait until the robot stops with an error, or the order is finished; return which."""

    def over(state: dict[str, Any]) -> bool:
        failed = bool(state["errors"]) and not state["driving"]
        return failed or (state["orderId"] == order_id and not state["nodeStates"])

    state = await site.when(over, since=since, within=120.0)
    if state["errors"]:
        assert await site.bench.speed_at(state) < 0.05, "reported as standing, but drives"
        return f"stands, {', '.join(sorted(set(error_types(state))))}"
    return "drives on to the end"


async def agent_killed(site: Nav2Site) -> str:
    options = ("--ros.namespace", site.namespace)
    begun = len(site.bench.fleet.states)
    with site.bench.agent_process(*options) as agent:
        await site.when(ready, since=begun)
        order_id = site.send(site.far)
        await site.moves()
        agent.kill()
        agent.restart()
        done = await site.done(order_id)
        assert error_types(done) == [], error_codes(done)
    return "the order continues"


async def pause(site: Nav2Site) -> str:
    async with site.agent():
        order_id = site.send(site.far)
        await site.moves()
        state = await site.instant("startPause")
        assert await site.bench.speed_at(state) < 0.01
        await site.instant("stopPause")
        done = await site.done(order_id)
        assert error_types(done) == [], error_codes(done)
    return "stops and continues"


async def place_lost(site: Nav2Site) -> str:
    async with site.agent():
        state = await site.put_back()
        assert status_of(state, state["actionStates"][-1]["actionId"]) == "FINISHED"
        since = len(site.bench.fleet.states)
        await site.die("amcl")
        lost = await site.when(lambda state: not state["agvPosition"]["positionInitialized"], since=since)
        since = len(site.bench.fleet.states)
        await site.live("amcl")
        await site.put_back()
        await site.when(ready, since=since)
        done = await site.done(site.send(site.far))
        assert error_types(done) == [], error_codes(done)
    return f"reported as lost ({error_codes(lost)[:80]}...); continues with the new pose"


async def maps(site: Nav2Site) -> str:
    found = site.bench.ros.subscribe(OccupancyGrid, f"{site.namespace.rstrip('/')}/map", LATCHED)
    grid = found.wait_for(what="Nav2's map").info
    return f"{grid.width * grid.resolution:.0f} m by {grid.height * grid.resolution:.0f} m"


async def latency(site: Nav2Site) -> str:
    topic = f"{site.namespace.rstrip('/')}/navigate_to_pose/_action/status"
    arrivals: list[float] = []
    site.bench.ros.node.create_subscription(
        GoalStatusArray, topic, lambda _: arrivals.append(time.monotonic()), LATCHED
    )
    took = []
    async with site.agent():
        for _ in range(ORDERS_TIMED):
            sent = time.monotonic()
            site.send(site.far)
            await until(lambda: arrivals[-1:] > [sent], what="the goal in the array")  # noqa: B023 - at once
            took.append(next(each for each in arrivals if each > sent) - sent)
            await site.instant("cancelOrder")
            await site.stands()
    assert median(took) < SOON
    return f"order to goal: median {1000 * median(took):.0f} ms, longest {1000 * max(took):.0f} ms"


CHECKS: dict[str, tuple[str, Check]] = {
    "a": ("doctor", doctor),
    "b": ("orders in each mode", orders),
    "c": ("cancel", cancel),
    "d": ("unreachable positions", unreachable),
    "e": ("goals of other clients", foreign_goals),
    "f": ("early and late extension", extensions),
    "g": ("each process killed", deaths),
    "h": ("agent killed", agent_killed),
    "i": ("pause", pause),
    "j": ("pose lost, set, localisation restarted", place_lost),
    "k": ("maps", maps),
    "l": ("latency", latency),
}
