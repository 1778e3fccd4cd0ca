"""The library vda5050-sdk as fleet control of NeNa's agent, and as a robot of NeNa's order service."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from faults.history import History, Kind
from faults.outside_robots import MANUFACTURER as ROBOTS
from faults.outside_robots import Standing, library_robot
from support.broker import Broker
from support.edge_agent import MANUFACTURER, SERIAL, agent_settings, running_agent
from support.order_service_fleet import Fleet, order_in, running, vehicle_idle
from support.robot_core import MAP
from support.waiting import PATIENCE

sdk: Any = pytest.importorskip("vda5050", reason="vda5050-sdk is not installed")

pytestmark = pytest.mark.broker

INTERFACE = "uagv"
"""The library has no other."""


def order(*nodes: str, order_id: str, released: int, start: float = 0.0, picks: bool = False) -> Any:
    """Build an order with the library, 10 m from node to node; ``released`` nodes are base."""
    builder = sdk.OrderBuilder(order_id=order_id, manufacturer=MANUFACTURER, serial_number=SERIAL)
    for number, node in enumerate(nodes):
        pick = sdk.Action(action_type="pick", action_id=f"{order_id}-pick", blocking_type="HARD")
        if number:
            builder.add_edge(nodes[number - 1], node, released=number < released)
        builder.add_node(
            node,
            x=start + 10.0 * number,
            y=0.0,
            map_id=MAP,
            released=number < released,
            actions=[pick] if picks and number == 1 else [],
        )
    return builder.build()


@pytest.mark.clause("6.1.1", "6.2.1", "7.3")
async def test_its_fleet_control_completes_and_cancels_orders(own_broker: Broker, tmp_path: Path) -> None:
    key = sdk.VehicleKey(manufacturer=MANUFACTURER, serial_number=SERIAL)
    config = sdk.MasterConfig(
        broker_url=f"mqtt://{own_broker.host}:{own_broker.port}", validate_messages=True, visualization=True
    )
    refused: list[Any] = []
    async with (
        running_agent(agent_settings(own_broker, INTERFACE, tmp_path)),
        sdk.MasterClient(config) as master,
    ):
        master.on_error(refused.append)

        async def until(done: Any) -> Any:
            assert await master.wait_for(key, lambda s: s.state and done(s.state), timeout=PATIENCE)
            return (await master.session(key)).state

        await until(lambda state: state.order_id == "")
        assert (
            await master.dispatch(order("n0", "n1", "n2", order_id="o1", released=3, picks=True), key)
        ).accepted
        state = await until(lambda state: state.order_id == "o1" and not state.node_states)
        assert (state.last_node_id, state.errors) == ("n2", [])
        state = await until(lambda state: state.action_states[0].action_status == "FINISHED")
        assert (state.loads or [])[0] is not None

        held = order("n2", "n3", "n4", order_id="o2", released=1, start=20.0)
        assert (await master.dispatch(held, key)).accepted
        await until(lambda state: state.order_id == "o2" and len(state.node_states) == 2)
        await master.cancel_order(key, action_id="c")
        state = await until(lambda state: state.order_id == "o2" and not state.node_states)
        assert "FINISHED" in [each.action_status for each in state.action_states if each.action_id == "c"]
    assert refused == []


@pytest.mark.clause("6.1.2/confirm", "6.6.8")
async def test_its_robot_executes_an_order(own_broker: Broker, tmp_path: Path) -> None:
    fleet, history = Fleet(own_broker, INTERFACE, tmp_path), History()
    with fleet.stack:
        async with (
            running(fleet.settings()) as client,
            library_robot(own_broker, Standing("robot-01", "sample-hall", 3.0, 2.0), history),
        ):
            await vehicle_idle(client)
            body = {
                "name": "T-1",
                "intendedVehicle": "Robot-01",
                "destinations": [
                    {"locationName": "Goods in", "operation": "Load cargo"},
                    {"locationName": "South 2", "operation": "MOVE"},
                ],
            }
            assert (await client.post("/v1/transportOrders", json=body)).status_code == 201
            done = await order_in(client, "T-1", "FINISHED", "FAILED")
            assert done["state"] == "FINISHED", done["reason"]
            vehicle = (await client.get("/v1/vehicles/Robot-01")).json()
    assert ROBOTS == "NeNa"
    assert [each.what for each in history.events if each.kind is Kind.ENTERED][-1] == "South 2"
    assert vehicle["deviations"] == []
