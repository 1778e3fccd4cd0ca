"""The order service's decisions arrive at the aggregator as files: after a failed order, and on request."""

from __future__ import annotations

import io
import json
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader

from nena_shared import log
from nena_shared.settings import LogSettings
from support.broker import Broker
from support.order_service_fleet import AT_SOUTH_1, Fleet, order_in, running, vehicle_idle
from support.served_aggregator import Served, serving
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.broker, pytest.mark.e2e]

SOURCE = "nena/order-service"
TO_SOUTH_3 = {"name": "TO-1", "destinations": [{"locationName": "South 3"}], "intendedVehicle": "Robot-01"}


def by_topic(file: bytes) -> dict[str, list[dict[str, Any]]]:
    found: dict[str, list[dict[str, Any]]] = {}
    messages: Any = make_reader(io.BytesIO(file), validate_crcs=True).iter_messages()
    for _, channel, message in messages:
        found.setdefault(channel.topic, []).append(json.loads(message.data))
    return found


async def arrived(served: Served, ending: str) -> dict[str, list[dict[str, Any]]]:
    """Wait for a recording whose name has this end; return its content."""
    listed = await served.until(
        f"/api/v1/recordings?robot={SOURCE}",
        lambda files: any(each["name"].endswith(ending) for each in files),
    )
    name = next(each["name"] for each in listed if each["name"].endswith(ending))
    return by_topic((await served.http.get(f"/api/v1/recordings/{SOURCE}/{name}")).content)


def settings_with_box(fleet: Fleet, folder: Path) -> Any:
    return fleet.settings(
        topic_prefix=f"{fleet.interface}/nena",
        black_box={"enabled": True, "delay": 0.2},
        upload={"enabled": True, "folder": folder / "outgoing"},
    )


async def make_unreachable(fleet: Fleet, x: float, y: float) -> None:
    """Make a place unreachable; the command is repeated until the robot's control is there."""
    peer, place = fleet.peer(), f"{fleet.interface}/loopback/NeNa/robot-01"
    command = json.dumps({"command": "unreachable", "x": x, "y": y})

    async def ask() -> list[bytes]:
        peer.publish(f"{place}/control", command)
        return peer.payloads(f"{place}/answer")

    await awaited(ask, bool, seconds=PATIENCE, what="an answer", every=0.2)


async def test_a_failed_order_is_explained_by_a_file_at_the_aggregator(
    broker: Broker, fleet: Fleet, tmp_path: Path
) -> None:
    log.configure(LogSettings())
    kept = {"recordings": {"folder": tmp_path / "received"}}
    robot = fleet.agent_file("robot-01", **AT_SOUTH_1).replace("[loopback]", "[loopback]\ncontrol = true")
    fleet.agent_of(robot)
    async with (
        serving(broker, fleet.interface, **kept) as served,
        running(settings_with_box(fleet, tmp_path)) as client,
    ):
        await vehicle_idle(client)
        await make_unreachable(fleet, 15.0, 2.0)
        await client.post("/v1/transportOrders", json=TO_SOUTH_3)
        await order_in(client, "TO-1", "FAILED")
        found = await arrived(served, "-order-failed.mcap")

    (assigned,) = (
        each for each in found["/nena/dispatch"] if each.get("order") == "TO-1" and "event" in each
    )
    assert (assigned["event"], assigned["explanation"][0]) == ("nena:assignedToVehicle", "Robot-01")
    assert found["/nena/routing"][0]["route"] == ["South 1", "South 2", "South 3"]
    told = [each["event"] for each in found["/nena/delivery"] if each.get("orderId")]
    assert (told[:2], told[-1]) == (["orderSent", "orderAccepted"], "orderFailed")
    assert "unreachable" in found["/nena/orders"][-1]["reason"]
    assert any("order assigned" in each["message"] for each in found["/nena/log"])


async def test_recordings_are_requested_over_rest_and_mqtt(
    broker: Broker, fleet: Fleet, tmp_path: Path
) -> None:
    kept = {"recordings": {"folder": tmp_path / "received"}}
    async with (
        serving(broker, fleet.interface, **kept) as served,
        running(settings_with_box(fleet, tmp_path)) as client,
    ):
        await client.post("/v1/transportOrders", json=TO_SOUTH_3)
        answer = (await client.post("/v1/recordings")).json()
        assert (answer["robot"], answer["sent"]) == (SOURCE, True)
        assert "/nena/orders" in await arrived(served, answer["name"])

        command = f"{fleet.interface}/nena/hosts/wms/commands/fetchRecording"
        peer = fleet.peer(f"{command}/answer")
        peer.publish(command, json.dumps({"requestId": "r-1"}))
        told = json.loads((await peer.wait_for(f"{command}/answer")).payload)
        assert told["status"] == 200, told
        assert "/nena/orders" in await arrived(served, told["recording"]["name"])


async def test_without_a_black_box_a_request_says_how_to_get_one(fleet: Fleet) -> None:
    async with running(fleet.settings()) as client:
        answer = await client.post("/v1/recordings")

    assert answer.status_code == 409
    assert "black_box.enabled" in answer.json()["detail"]
