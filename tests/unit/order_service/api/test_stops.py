"""Stops by REST, and what they do to routes and to commands for single robots."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import httpx
import pytest

from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.routing.graph import NoRouteError
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_shared.fleet_api.transport_order import Destination


async def begin(client: httpx.AsyncClient, **body: Any) -> dict[str, Any]:
    answer = await client.post("/v1/stops", json={"reason": "spill", **body})
    assert answer.status_code == 200, answer.text
    stop: dict[str, Any] = answer.json()
    return stop


async def test_stop_is_listed_until_it_is_ended(client: httpx.AsyncClient) -> None:
    stop = await begin(client, by="Anna")
    assert (stop["by"], stop["reason"], stop["area"], stop["ended"]) == ("Anna", "spill", None, None)
    assert (await client.get("/v1/stops")).json() == {"stops": [stop]}
    vehicle = (await client.get("/v1/vehicles")).json()["vehicles"][0]
    assert vehicle["stop"] == {"name": stop["name"], "by": "Anna", "reason": "spill", "area": False}

    ended = await client.post(f"/v1/stops/{stop['name']}/end", json={"by": "Ben", "reason": "cleaned"})
    assert ended.status_code == 200
    assert ended.json()["ended"]
    assert (await client.get("/v1/stops")).json() == {"stops": []}
    again = await client.post(f"/v1/stops/{stop['name']}/end")
    assert again.status_code == 404
    assert "may have been ended" in again.json()["detail"]


@pytest.mark.parametrize(
    "body",
    [
        {},
        {"reason": ""},
        {"reason": "x", "area": {"xMin": 1, "yMin": 0, "xMax": 1, "yMax": 2}},
        {"reason": "x", "robots": []},
    ],
)
async def test_malformed_stop_is_refused(client: httpx.AsyncClient, body: dict[str, Any]) -> None:
    assert (await client.post("/v1/stops", json=body)).status_code == 422
    assert (await client.get("/v1/stops")).json() == {"stops": []}


async def test_paths_of_an_area_are_locked_until_the_stop_ends(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    plant, finder = service.engine.plant, service.engine.context.finder
    start, goal = plant.points[0], plant.points[-1]
    locked_by_host = next(each.name for each in plant.paths if goal.name in (each.source, each.destination))
    await client.put(f"/v1/paths/{locked_by_host}/lock", json={"locked": True})
    area = {"xMin": goal.x_m - 0.1, "yMin": goal.y_m - 0.1, "xMax": goal.x_m + 0.1, "yMax": goal.y_m + 0.1}
    stop = await begin(client, area=area)

    paths = {each["name"]: each for each in (await client.get("/v1/paths")).json()["paths"]}
    touching = {each.name for each in plant.paths if goal.name in (each.source, each.destination)}
    assert {name for name, each in paths.items() if each["stop"] == stop["name"]} >= touching
    assert all(paths[name]["locked"] for name in touching)
    with pytest.raises(NoRouteError):
        finder.find(start.name, [Destination(location_name=goal.name)])
    order = (
        await client.post("/v1/transportOrders", json={"destinations": [{"locationName": goal.name}]})
    ).json()
    assert order["state"] == "DISPATCHABLE", "it waits for the end of the stop"

    await client.post(f"/v1/stops/{stop['name']}/end")
    paths = {each["name"]: each for each in (await client.get("/v1/paths")).json()["paths"]}
    assert {name for name, each in paths.items() if each["locked"]} == {locked_by_host}
    assert not any(each["stop"] for each in paths.values())


async def test_stops_and_their_locks_survive_a_restart(
    client: httpx.AsyncClient, service: OrderService, settings: OrderServiceSettings
) -> None:
    point = service.engine.plant.points[0]
    area = {"xMin": point.x_m - 1, "yMin": point.y_m - 1, "xMax": point.x_m + 1, "yMax": point.y_m + 1}
    stop = await begin(client, area=area, by="Anna")
    locked = service.engine.context.locked_paths.by_stops
    assert locked

    again = OrderService(settings, service.engine.plant, service.store)
    await again.hosts.load()
    assert again.engine.context.locked_paths.by_stops == locked
    assert all(again.hosts.locks.get(each).locked for each in locked)
    assert again.engine.stops.get(stop["name"]).by == "Anna"


async def test_robot_of_a_stop_is_not_resumed_alone(
    client: httpx.AsyncClient, service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    stop = await begin(client, by="Anna")
    vehicle = next(iter(service.engine.registry))
    online = replace(service.engine.view(vehicle), link=LinkStatus.ONLINE)
    monkeypatch.setattr(service.engine, "view", lambda _: online)
    answer = await client.post(f"/v1/vehicles/{vehicle.name}/instantActions", json={"actionType": "resume"})
    assert answer.status_code == 409
    assert f"End the stop '{stop['name']}' first" in answer.json()["detail"]


async def test_stop_that_cannot_be_stored_is_refused(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    service.store.problem = "disk full"
    assert (await client.post("/v1/stops", json={"reason": "spill"})).status_code == 503
    service.store.problem = ""
    assert (await client.get("/v1/stops")).json() == {"stops": []}
