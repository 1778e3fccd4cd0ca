from __future__ import annotations

import httpx
import pytest

from nena_shared.vda5050 import v2_0, v2_1, v3_0
from nena_shared.vda5050.codec import Codec
from nena_shared.vda5050.factsheet import Factsheet
from nena_status_aggregator.aggregator import Aggregator
from support.fleet_examples import ROBOT, factsheet


@pytest.mark.usefixtures("populated")
async def test_one_robot(client: httpx.AsyncClient) -> None:
    robot = (await client.get("/api/v1/robots/ACME/r1")).json()
    assert (robot["serialNumber"], robot["condition"], robot["stateAge"]) == ("r1", "IDLE", 0)


@pytest.mark.parametrize("codec", [v2_0.CODEC, v2_1.CODEC, v3_0.CODEC], ids=["2.0", "2.1", "3.0"])
async def test_the_actions_of_a_robot_in_the_same_names_for_each_version(
    client: httpx.AsyncClient, populated: Aggregator, codec: Codec
) -> None:
    missing = await client.get("/api/v1/robots/ACME/r1/actions")
    assert (missing.status_code, "asked for it" in missing.json()["detail"]) == (404, True)
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
