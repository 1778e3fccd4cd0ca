"""Optional fields of the order: which ones this robot acts on (section 7.1.1).

A robot must not ignore an optional field that the standard defines: it acts on it or refuses the order.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

from nena_edge_agent.protocol.capabilities import Capabilities
from nena_shared.vda5050.action import ActionStatus
from nena_shared.vda5050.factsheet import OptionalParameter, Support
from nena_shared.vda5050.order import Edge, Order, OrientationType

SPEED = "edges.maximumSpeed"
"""Optional field that only a driver which can limit the speed acts on."""
ZONE_SET = "zoneSetId"
"""Optional field of a 2.x order, which no robot here acts on: 2.x has no way to bring it a zone set."""

_ALWAYS: tuple[OptionalParameter, ...] = (
    OptionalParameter(
        parameter="order.nodes.nodePosition",
        support=Support.REQUIRED,
        description="The robot drives to coordinates and knows no nodes by name.",
    ),
    OptionalParameter(parameter="order.nodes.nodePosition.theta", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.nodes.nodePosition.allowedDeviationXY", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.nodes.nodePosition.allowedDeviationTheta", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.edges.length", support=Support.SUPPORTED),
)


def _speed(edge: Edge, capabilities: Capabilities) -> bool:
    """Tell whether the robot would be too fast; nobody drives along an edge at 0 m/s."""
    limit = edge.maximum_speed
    if limit is None or limit >= capabilities.maximum_speed:
        return False
    return limit == 0 or not capabilities.limits_speed


def _orientation(edge: Edge, _: Capabilities) -> bool:
    return edge.orientation is not None and (
        edge.orientation != 0 or edge.orientation_type is OrientationType.GLOBAL
    )


DEMANDS: dict[str, Callable[[Edge, Capabilities], bool]] = {
    SPEED: _speed,
    "edges.maximumMobileRobotHeight": lambda edge, _: edge.maximum_mobile_robot_height is not None,
    "edges.minimumLoadHandlingDeviceHeight": lambda edge, _: (
        edge.minimum_load_handling_device_height is not None
    ),
    "edges.orientation": _orientation,
    "edges.direction": lambda edge, _: bool(edge.direction),
    "edges.reachOrientationBeforeEntering": lambda edge, _: bool(edge.reach_orientation_before_entering),
    "edges.maximumRotationSpeed": lambda edge, _: edge.maximum_rotation_speed is not None,
    "edges.trajectory": lambda edge, _: edge.trajectory is not None,
    "edges.corridor": lambda edge, _: edge.corridor is not None,
}
"""Whether an edge asks for what the robot cannot do, for each field that may ask for it.

What the robot does anyway (drive forwards, turn freely, keep to its own speed) is no demand.
"""
TOLERABLE: frozenset[str] = frozenset({ZONE_SET, *DEMANDS})
"""Fields that a setting may have passed over."""


def supported(capabilities: Capabilities) -> tuple[OptionalParameter, ...]:
    """Give the optional fields that the factsheet names; what it does not name counts as unsupported."""
    more: list[str] = []
    if capabilities.limits_speed:
        more.append(SPEED)
    if ActionStatus.RETRIABLE in capabilities.rules.standard.action_statuses:
        more += ["nodes.actions.retriable", "edges.actions.retriable"]
    listed = (OptionalParameter(parameter=f"order.{each}", support=Support.SUPPORTED) for each in more)
    return (*_ALWAYS, *listed)


def unsupported(order: Order, capabilities: Capabilities) -> tuple[str, Edge | None] | None:
    """Find the first optional field that the robot cannot act on, and the edge that it stands at, if any."""
    if order.zone_set_id and ZONE_SET not in capabilities.tolerated_parameters:
        return ZONE_SET, None
    return next(_unsupported(order, capabilities), None)


def _unsupported(order: Order, capabilities: Capabilities) -> Iterator[tuple[str, Edge]]:
    for edge in order.edges:
        for name, demanded in DEMANDS.items():
            if name not in capabilities.tolerated_parameters and demanded(edge, capabilities):
                yield name, edge
