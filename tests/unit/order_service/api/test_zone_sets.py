from __future__ import annotations

import httpx

from support.zones import zone, zone_set

URL = "/v1/zoneSets"
DAY = zone_set(zone("z", "BLOCKED", 0, 1), zone_set_id="day").model_dump(
    mode="json", by_alias=True, exclude_none=True
)


async def test_zone_sets_are_put_shown_enabled_and_deleted(client: httpx.AsyncClient) -> None:
    put = await client.post(URL, json=DAY)
    assert (put.status_code, put.json()["zoneSetId"], put.json()["zones"]) == (200, "day", 1)
    assert {each["phase"] for each in put.json()["vehicles"]} == {"UNKNOWN"}
    assert put.json()["outlines"] == [
        {
            "zoneId": "z",
            "zoneType": "BLOCKED",
            "vertices": [[0.0, -5.0], [1.0, -5.0], [1.0, 5.0], [0.0, 5.0]],
        }
    ]
    assert (await client.get(f"{URL}/day")).json() == put.json()
    assert (await client.post(f"{URL}/day/enable")).json()["enabled"] is True
    assert (await client.delete(f"{URL}/day")).json()["deleted"] is True
    assert len((await client.get(URL)).json()["zoneSets"]) == 1


async def test_an_invalid_zone_set_is_refused(client: httpx.AsyncClient) -> None:
    for wrong in ({}, {**DAY, "zones": [{"zoneId": "z"}]}, {**DAY, "mapId": 7}):
        answer = await client.post(URL, json=wrong)
        assert (answer.status_code, bool(answer.json()["errors"])) == (422, True)
    assert (await client.post(f"{URL}/night/enable")).status_code == 404
    assert (await client.post(URL, content=b"x" * 5000)).status_code == 413
