"""The factsheet's optional fields agree with the check of orders (section 7.1.1)."""

from __future__ import annotations

from typing import Any

import pytest

from nena_edge_agent.protocol.capabilities import DEMANDS, supported
from nena_shared.vda5050.factsheet import Support
from nena_shared.vda5050.order import ControlPoint, Corridor, Trajectory
from nena_shared.vda5050.versions import RULES
from support.robot_core import Bench, order

VALUES: dict[str, tuple[str, Any]] = {
    "edges.maximumSpeed": ("maximum_speed", 0.5),
    "edges.maximumMobileRobotHeight": ("maximum_mobile_robot_height", 1.0),
    "edges.minimumLoadHandlingDeviceHeight": ("minimum_load_handling_device_height", 0.2),
    "edges.orientation": ("orientation", 1.0),
    "edges.direction": ("direction", "left"),
    "edges.reachOrientationBeforeEntering": ("reach_orientation_before_entering", True),
    "edges.maximumRotationSpeed": ("maximum_rotation_speed", 0.5),
    "edges.trajectory": (
        "trajectory",
        Trajectory(degree=1, control_points=(ControlPoint(x=0, y=0), ControlPoint(x=1, y=0))),
    ),
    "edges.corridor": ("corridor", Corridor(left_width=1.0, right_width=1.0)),
}


@pytest.mark.clause("6.10/parameters", "6.1.4.2", "7.3/edge")
@pytest.mark.parametrize("limits_speed", [True, False])
@pytest.mark.parametrize("name", DEMANDS)
def test_an_edge_field_is_listed_if_orders_may_contain_it(name: str, *, limits_speed: bool) -> None:
    bench = Bench(limits_speed=limits_speed)
    field, value = VALUES[name]

    bench.send(order("n0", "n1", edge_fields={field: value}))

    listed = {each.parameter for each in supported(bench.capabilities)}
    assert (bench.state.order_id == "o1") is (f"order.{name}" in listed)


@pytest.mark.clause("6.10/parameters")
def test_node_positions_are_required() -> None:
    demanded = [
        each.parameter for each in supported(Bench().capabilities) if each.support is Support.REQUIRED
    ]

    assert demanded == ["order.nodes.nodePosition"]


@pytest.mark.clause("6.10/parameters", "6.2.3/retry")
@pytest.mark.parametrize(("version", "listed"), [("2.0.0", False), ("2.1.0", False), ("3.0.0", True)])
def test_retriable_actions_are_listed_if_the_version_has_them(version: str, *, listed: bool) -> None:
    names = {each.parameter for each in supported(Bench(rules=RULES[version]).capabilities)}

    assert ({"order.nodes.actions.retriable", "order.edges.actions.retriable"} <= names) is listed


@pytest.mark.clause("7.3/zoneSetId", "6.1.4.2")
def test_an_order_for_a_zone_set_is_refused_unless_that_is_tolerated() -> None:
    strict, lenient = Bench(), Bench(tolerated_parameters=frozenset({"zoneSetId"}))
    wanted = order("n0", "n1").model_copy(update={"zone_set_id": "s1"})

    strict.send(wanted)
    lenient.send(wanted)

    (entry,) = strict.state.errors
    assert entry.error_type == "UNSUPPORTED_PARAMETER"
    assert ("parameter", "zoneSetId") in {
        (e.reference_key, e.reference_value) for e in entry.error_references
    }
    assert (strict.state.order_id, lenient.state.order_id) == ("", "o1")
