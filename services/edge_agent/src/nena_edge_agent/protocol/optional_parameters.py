"""Optional fields of the order: which ones this robot acts on (section 7.1.1).

A robot must not ignore an optional field that the standard defines: it acts on it or refuses the order.
"""

from __future__ import annotations

from collections.abc import Iterator

from nena_shared.vda5050.factsheet import OptionalParameter, Support
from nena_shared.vda5050.order import Edge, Order, OrientationType

SUPPORTED: tuple[OptionalParameter, ...] = (
    OptionalParameter(
        parameter="order.nodes.nodePosition",
        support=Support.REQUIRED,
        description="The robot drives to coordinates and knows no nodes by name.",
    ),
    OptionalParameter(parameter="order.nodes.nodePosition.theta", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.nodes.nodePosition.allowedDeviationXY", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.nodes.nodePosition.allowedDeviationTheta", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.edges.maximumSpeed", support=Support.SUPPORTED),
    OptionalParameter(parameter="order.edges.length", support=Support.SUPPORTED),
)


def unsupported(order: Order, tolerated: frozenset[str]) -> tuple[str, Edge] | None:
    """Find the first optional field that the robot cannot act on, and its edge; None if there is none."""
    found = ((name, edge) for edge in order.edges for name in _unsupported_of(edge))
    return next(((name, edge) for name, edge in found if name not in tolerated), None)


def _unsupported_of(edge: Edge) -> Iterator[str]:
    """Name what ``edge`` asks for; what the robot does anyway (drive forwards, turn freely) is no demand."""
    demands = {
        "edges.maximumMobileRobotHeight": edge.maximum_mobile_robot_height is not None,
        "edges.minimumLoadHandlingDeviceHeight": edge.minimum_load_handling_device_height is not None,
        "edges.orientation": _special_orientation(edge),
        "edges.direction": bool(edge.direction),
        "edges.reachOrientationBeforeEntering": bool(edge.reach_orientation_before_entering),
        "edges.maximumRotationSpeed": edge.maximum_rotation_speed is not None,
        "edges.trajectory": edge.trajectory is not None,
        "edges.corridor": edge.corridor is not None,
    }
    return (name for name, demanded in demands.items() if demanded)


def _special_orientation(edge: Edge) -> bool:
    return edge.orientation is not None and (
        edge.orientation != 0 or edge.orientation_type is OrientationType.GLOBAL
    )
