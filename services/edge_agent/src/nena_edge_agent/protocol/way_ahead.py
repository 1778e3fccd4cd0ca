"""The places behind the next node that the robot is to drive over without a stop, as far as is known now."""

from __future__ import annotations

from collections.abc import Callable
from itertools import islice
from math import atan2, hypot, pi, sin

from nena_edge_agent.driver.port import Pose
from nena_edge_agent.protocol.action_states import lets_drive
from nena_edge_agent.protocol.capabilities import Capabilities
from nena_edge_agent.protocol.geometry import radius, turn
from nena_edge_agent.protocol.order_progress import OrderProgress
from nena_shared.vda5050.order import Edge, Node, NodePosition

MOST = 20
"""Places ahead that are given at most; the others follow while the robot drives."""
CUT_WITHIN = 0.7
"""Metres before a place at which Nav2's default tree lets it go and heads for the next one."""


def way_ahead(
    progress: OrderProgress,
    start: Pose | NodePosition,
    capabilities: Capabilities,
    barred: Callable[[NodePosition, NodePosition], bool],
) -> tuple[Pose, ...]:
    """Give the places behind the next node, up to the next stop or the end of the base.

    ``start`` is where the way to the next node begins; ``barred`` tells whether a zone keeps the robot from
    going from one place to another. A stop is a node with a heading of its own or with actions that need one,
    and a bend that navigation would cut by more than the node allows.
    """
    places: list[Pose] = []
    before: Pose | NodePosition = start
    edges = islice(progress.edges, 1, MOST + 1)
    for node, edge, following in zip(progress.nodes, edges, islice(progress.nodes, 1, None), strict=False):
        here, there = node.node_position, following.node_position
        if here is None or there is None or not _goes_on(node, edge):
            break
        if _cut(before, here, there) > radius(here, capabilities.default_deviation_xy) or barred(here, there):
            break
        theta = there.theta if there.theta is not None else atan2(there.y - here.y, there.x - here.x)
        places.append(Pose(there.x, there.y, theta, there.map_id))
        before = here
    return tuple(places)


def _goes_on(node: Node, edge: Edge) -> bool:
    """Tell whether nothing at the node or on the edge behind it asks for a stop."""
    heading = node.node_position is not None and node.node_position.theta is not None
    return edge.released and not heading and lets_drive(node.actions) and lets_drive(edge.actions)


def _cut(before: Pose | NodePosition, here: NodePosition, there: NodePosition) -> float:
    """Give how far from a place navigation passes it, in m, where the way bends there."""
    if (before.x, before.y) == (here.x, here.y) or hypot(there.x - here.x, there.y - here.y) == 0:
        return 0.0
    inward = atan2(here.y - before.y, here.x - before.x)
    bend = abs(turn(inward, atan2(there.y - here.y, there.x - here.x)))
    return CUT_WITHIN * sin(min(bend, pi / 2))
