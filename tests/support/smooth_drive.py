"""An order in two parts whose nodes are passed, and the robot's lowest speed at them."""

from __future__ import annotations

from math import dist
from typing import Any

from nena_edge_agent.nav2.settings import Navigation
from support.edge_agent import FleetControl, ended
from support.robot_core import order, position
from support.ros import Inbox
from support.waiting import PATIENCE

SPACING = 2.0
"""Distance between two nodes, metres."""
NODES = ("n0", "n1", "n2", "n3", "n4")
NEAR = 0.9
"""Distance from a node within which the robot counts as passing it, metres; it brakes over half a metre."""
SPEED = 0.5
"""Cruise speed, m/s."""
LIKE_NAV2 = ("--replan_period", "1.0", "--recovery_time", "18")
"""Options for replanning and recoveries as in Nav2's default behaviour trees."""
REGULATED = {"speed": SPEED, "acceleration": 2.5, "approach": 0.6}
"""Limits of a robot with Regulated Pure Pursuit."""
WAYS = {
    Navigation.TOPICS: 1.35,
    Navigation.ACTION: 1.1,
    Navigation.THROUGH_POSES: 0.5,
}
"""Ways to drive, with the deviation in m that nodes allow, as docs/nav2.md recommends.

The next goal is given 0.6 m (where the controller slows down) and the way of a second (in which Nav2 plans
again) before a node; by topics 0.25 m earlier, since the robot's place is known that seldom.
"""


def settings(navigation: Navigation) -> dict[str, Any]:
    """Return the agent's settings for a robot that passes nodes; those of its ROS side are under ``ros``."""
    return {
        "drive": {"strategy": "pass_through"},
        "ros": {"navigation": navigation},
    }


async def drive(fleet: FleetControl, odometry: Inbox[Any], radius: float) -> float:
    """Drive over the nodes, and release the last two on the way; return the lowest relative speed at them.

    The result is the minimum speed at a passed node as a share of the robot's cruise speed.
    """
    places = {name: position(SPACING * index, radius=radius) for index, name in enumerate(NODES)}
    fleet.send(order(*NODES, released=3, positions=places))
    await fleet.state(lambda state: state["lastNodeId"] == "n1", within=PATIENCE)
    fleet.send(order(*NODES[2:], update=1, first=4, positions=places))
    await fleet.state(ended("o1"), within=PATIENCE)
    told = [(each.pose.pose.position, float(each.twist.twist.linear.x)) for each in odometry.messages]
    passed = [SPACING * index for index in range(1, len(NODES) - 1)]
    slow = [speed for place, speed in told if any(dist((place.x, place.y), (x, 0.0)) <= NEAR for x in passed)]
    return min(slow) / max(speed for _, speed in told)
