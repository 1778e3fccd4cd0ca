from __future__ import annotations

import httpx
import pytest

from nena_shared.fleet_api.peripherals import PeripheralJobState, PeripheralState
from nena_shared.plant.model import PlantModel
from nena_shared.vda5050 import v2_0, v2_1, v3_0
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import Factsheet
from nena_status_aggregator.aggregator import Aggregator
from support.clocks import ManualClock
from support.fleet_examples import ROBOT, factsheet, peripheral_job, peripheral_status, sample_plant


@pytest.mark.usefixtures("populated")
async def test_the_fleet_with_the_age_of_states(client: httpx.AsyncClient, clock: ManualClock) -> None:
    clock.advance(7.5)
    fleet = (await client.get("/api/v1/fleet")).json()
    assert fleet["time"] == "2026-01-01T00:00:07.500Z"
    assert [(each["id"], each["stateAge"]) for each in fleet["robots"]] == [("ACME/r1", 7.5)]
    assert [each["id"] for each in fleet["orders"]] == ["TO-1"]
    assert fleet["link"]["connected"] is True


@pytest.mark.usefixtures("populated")
async def test_orders(client: httpx.AsyncClient) -> None:
    orders = (await client.get("/api/v1/orders")).json()
    assert [(each["id"], each["state"]) for each in orders] == [("TO-1", "BEING_PROCESSED")]
    assert orders[0]["destinations"][0] == {
        "place": "Goods in",
        "operation": "Load",
        "state": "TRAVELLING",
    }


async def test_peripheral_devices(client: httpx.AsyncClient, populated: Aggregator) -> None:
    assert (await client.get("/api/v1/peripherals")).json() == []
    jobs = (
        peripheral_job(related_vehicle="V1", related_transport_order="T-1", path="A --- B", reason="waits"),
        peripheral_job("close", PeripheralJobState.FAILED, reason="blocked"),
    )
    populated.model.on_peripheral_status(peripheral_status("Door 1", PeripheralState.EXECUTING, *jobs))
    opens = {
        "name": "PeripheralJob-open",
        "state": "BEING_PROCESSED",
        "operation": "open",
        "reason": "waits",
        "codedReason": None,
        "vehicle": "V1",
        "transportOrder": "T-1",
        "path": "A --- B",
        "created": "2026-01-01T00:00:00.000Z",
        "finished": None,
    }
    (device,) = (await client.get("/api/v1/peripherals")).json()
    assert device["jobs"][1] == {
        **opens,
        "name": "PeripheralJob-close",
        "state": "FAILED",
        "operation": "close",
        "reason": "blocked",
        **dict.fromkeys(("vehicle", "transportOrder", "path")),
        "finished": "2026-01-01T00:00:00.000Z",
    }
    assert {name: value for name, value in device.items() if name != "jobs"} == {
        "id": "Door 1",
        "state": "EXECUTING",
        "confirmed": True,
        "operations": ["open", "close"],
        "waiting": 0,
        "usedBy": [],
        "job": opens,
    }
    assert device["jobs"][0] == opens
    assert (await client.get("/api/v1/fleet")).json()["peripherals"] == [device]


async def test_plant_model_is_returned_as_published(
    client: httpx.AsyncClient, aggregator: Aggregator
) -> None:
    plant = sample_plant()
    aggregator.model.on_plant_model(plant)
    answer = await client.get("/api/v1/plant")
    assert PlantModel.from_json(answer.content) == plant


@pytest.mark.usefixtures("populated")
async def test_one_robot(client: httpx.AsyncClient) -> None:
    robot = (await client.get("/api/v1/robots/ACME/r1")).json()
    assert (robot["serialNumber"], robot["condition"], robot["stateAge"]) == ("r1", "IDLE", 0)


@pytest.mark.parametrize("codec", [v2_0.CODEC, v2_1.CODEC, v3_0.CODEC], ids=["2.0", "2.1", "3.0"])
async def test_the_actions_of_a_robot_in_the_same_names_for_each_version(
    client: httpx.AsyncClient, populated: Aggregator, codec: Codec
) -> None:
    missing = await client.get("/api/v1/robots/ACME/r1/actions")
    assert (missing.status_code, "request it with" in missing.json()["detail"]) == (404, True)
    beep = {
        "actionType": "beep",
        "actionDescription": "makes itself heard",
        "actionScopes": ("INSTANT", "NODE"),
        "actionParameters": ({"key": "times", "valueDataType": "INTEGER"},),
        "pauseAllowed": False,
        "cancelAllowed": False,
    }
    features = {"optionalParameters": (), "mobileRobotActions": (beep,)}
    content = {**factsheet().model_dump(by_alias=True), "protocolFeatures": features}
    sheet = Factsheet.model_validate(content, strict=False)
    received = codec.decode(Factsheet, codec.encode(sheet))
    populated.model.on_factsheet(ROBOT, received, populated.now())
    assert (await client.get("/api/v1/robots/ACME/r1/actions")).json() == [
        {
            "actionType": "beep",
            "description": "makes itself heard",
            "actionScopes": ["INSTANT", "NODE"],
            "actionParameters": [
                {"key": "times", "valueDataType": "INTEGER", "description": None, "isOptional": False}
            ],
        }
    ]
