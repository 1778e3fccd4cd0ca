"""Locks of paths by REST, and what the router makes of them."""

from __future__ import annotations

import httpx
import pytest

from nena_order_service.routing.graph import NoRouteError
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.traffic.resources import Found
from nena_shared.fleet_api.transport_order import Destination
from nena_shared.plant import BoundingBox


def _to(point: str) -> Destination:
    return Destination(location_name=point)


async def lock(client: httpx.AsyncClient, name: str, *, locked: bool) -> httpx.Response:
    return await client.put(f"/v1/paths/{name}/lock", json={"locked": locked})


async def test_paths_are_listed_and_locked(client: httpx.AsyncClient, service: OrderService) -> None:
    paths = (await client.get("/v1/paths")).json()["paths"]
    assert {path["name"] for path in paths} == {path.name for path in service.engine.plant.paths}
    name = paths[0]["name"]
    answer = await lock(client, name, locked=True)
    assert (answer.status_code, answer.json()["locked"]) == (200, True)
    assert answer.json()["lockedInPlantModel"] is False
    assert (await client.get(f"/v1/paths/{name}")).json() == answer.json()
    assert await service.store.read_path_locks() == {name: True}
    assert (await lock(client, name, locked=False)).json()["locked"] is False


async def test_the_lock_of_a_path_has_the_name_of_the_person_also_after_a_restart(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    name = service.engine.plant.paths[0].name
    for person in ("Anna", "Ben"):  # the first one has closed it
        answer = await client.put(f"/v1/paths/{name}/lock", json={"locked": True, "by": person})
        assert answer.json()["lockedBy"]["by"] == "Anna"
    service.engine.context.locked_paths.locked_by = {}
    await service.hosts.locks.load()
    assert service.hosts.locks.get(name).model_dump(mode="json", by_alias=True) == answer.json()
    assert (await lock(client, name, locked=False)).json()["lockedBy"] is None
    assert (await lock(client, name, locked=True)).json()["lockedBy"]["by"] == "somebody"


async def test_paths_come_in_pages_and_by_lock(client: httpx.AsyncClient, service: OrderService) -> None:
    names = [path.name for path in service.engine.plant.paths]
    first = (await client.get("/v1/paths", params={"limit": 2})).json()
    assert [path["name"] for path in first["paths"]] == names[:2]
    rest = (await client.get("/v1/paths", params={"after": first["next"]})).json()
    assert [path["name"] for path in rest["paths"]] == names[2:]
    assert rest["next"] is None

    await lock(client, names[3], locked=True)
    locked = (await client.get("/v1/paths", params={"locked": "true"})).json()["paths"]
    assert [path["name"] for path in locked] == [names[3]]
    unknown = await client.get("/v1/paths", params={"after": "Nowhere"})
    assert (unknown.status_code, unknown.json()["type"]) == (404, "/problems/unknown-path")


async def test_unknown_path_and_bad_request_are_problems(client: httpx.AsyncClient) -> None:
    assert (await lock(client, "Nowhere --- Else", locked=True)).status_code == 404
    assert (await client.get("/v1/paths/Nowhere")).status_code == 404
    name = (await client.get("/v1/paths")).json()["paths"][0]["name"]
    assert (await client.put(f"/v1/paths/{name}/lock", json={"locked": "perhaps"})).status_code == 422


async def test_routes_avoid_locked_paths_and_orders_wait_for_them(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    finder = service.engine.context.finder
    plant = service.engine.plant
    start, goal = plant.points[0].name, plant.points[-1].name
    before = finder.find(start, [_to(goal)])
    for path in plant.paths:
        if goal in (path.destination, path.source):
            await lock(client, path.name, locked=True)
    with pytest.raises(NoRouteError):
        finder.find(start, [_to(goal)])
    made = await client.post("/v1/transportOrders", json={"destinations": [{"locationName": goal}]})
    assert made.json()["state"] == "DISPATCHABLE"
    for path in plant.paths:
        await lock(client, path.name, locked=False)
    assert finder.find(start, [_to(goal)]) == before


async def test_locks_survive_a_restart(
    client: httpx.AsyncClient, service: OrderService, settings: OrderServiceSettings
) -> None:
    name = (await client.get("/v1/paths")).json()["paths"][0]["name"]
    await lock(client, name, locked=True)
    again = OrderService(settings, service.engine.plant, service.store)
    await again.hosts.locks.load()
    assert again.hosts.locks.get(name).locked


async def test_read_only_store_acknowledges_nothing(client: httpx.AsyncClient, service: OrderService) -> None:
    name = (await client.get("/v1/paths")).json()["paths"][0]["name"]
    service.store.problem = "disk full"
    assert (await lock(client, name, locked=True)).status_code == 503
    service.store.problem = ""
    assert not service.hosts.locks.get(name).locked


async def preview(client: httpx.AsyncClient, name: str, *also: str) -> dict[str, list[str]]:
    answer = await client.get(f"/v1/paths/{name}/lockPreview", params={"also": list(also)})
    assert answer.status_code == 200, answer.text
    return dict(answer.json())


async def test_a_preview_names_the_orders_without_another_route(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    plant = service.engine.plant
    goal, start = plant.points[-1].name, plant.points[0]
    service.engine.traffic.update_position(
        plant.vehicles[0].name, Found(start.name, on_point=True), BoundingBox()
    )
    await client.post("/v1/transportOrders", json={"name": "TO-1", "destinations": [{"locationName": goal}]})
    first, *others = (path.name for path in plant.paths if goal in (path.destination, path.source))

    assert (await preview(client, first, *others))["orders"] == ["TO-1"]
    elsewhere = next(path.name for path in plant.paths if goal not in (path.destination, path.source))
    assert await preview(client, elsewhere) == {"vehicles": [], "orders": []}
    assert not any(path["locked"] for path in (await client.get("/v1/paths")).json()["paths"])
    assert (await client.get("/v1/paths/Nowhere/lockPreview")).status_code == 404
