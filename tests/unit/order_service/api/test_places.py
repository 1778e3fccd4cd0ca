"""Points and locations by REST: lists, filters, pages, and who uses a point."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import httpx
import pytest

from nena_order_service.api.plant import PlantOperations
from nena_order_service.service import OrderService
from nena_shared.fleet_api.places import LocationsQuery, LocationStatus, PointStatus
from nena_shared.plant import Link, Location, LocationType, PlantModel, Point
from support.fleet_examples import state


async def found(client: httpx.AsyncClient, what: str, **query: Any) -> list[dict[str, Any]]:
    answer = await client.get(f"/v1/{what}", params=query)
    assert answer.status_code == 200, answer.text
    objects: list[dict[str, Any]] = answer.json()[what]
    return objects


async def test_points_are_those_of_the_plant_model(client: httpx.AsyncClient, service: OrderService) -> None:
    points = [PointStatus.model_validate(each) for each in await found(client, "points")]
    assert [each.name for each in points] == [each.name for each in service.engine.plant.points]
    for status, point in zip(points, service.engine.plant.points, strict=True):
        assert (status.x, status.y, status.theta) == (point.x_m, point.y_m, point.heading_rad)
    one = await client.get(f"/v1/points/{points[0].name}")
    assert PointStatus.model_validate(one.json()) == points[0]


async def test_points_and_locations_name_each_other(client: httpx.AsyncClient) -> None:
    linked = {
        (location["name"], link["point"])
        for location in await found(client, "locations")
        for link in location["links"]
    }
    assert linked == {
        (name, point["name"]) for point in await found(client, "points") for name in point["locations"]
    }


async def test_a_point_names_who_stands_there_and_who_reserves_it(
    client: httpx.AsyncClient, service: OrderService, monkeypatch: pytest.MonkeyPatch
) -> None:
    engine, (before, here, *_) = service.engine, service.engine.plant.points
    resources = engine.traffic.resources
    engine.traffic.restore_position(
        "Robot-01", (resources.at_point(before.name), resources.at_point(here.name)), 1000
    )
    standing = state(last_node_id=here.name)
    view = engine.view
    monkeypatch.setattr(
        engine,
        "view",
        lambda vehicle: replace(view(vehicle), state=standing if vehicle.name == "Robot-01" else None),
    )
    listed = {each["name"]: each for each in await found(client, "points")}
    used = {name: (each["occupiedBy"], each["reservedBy"]) for name, each in listed.items()}
    assert used.pop(before.name) == ([], ["Robot-01"])
    assert used.pop(here.name) == (["Robot-01"], ["Robot-01"])
    assert set(map(str, used.values())) == {"([], [])"}
    assert (await client.get(f"/v1/points/{here.name}")).json() == listed[here.name]
    own = await found(client, "points", vehicle="Robot-01")
    assert own == [listed[before.name], listed[here.name]]
    assert await found(client, "points", vehicle="Robot-02") == []
    assert (await client.get("/v1/points", params={"vehicle": "R2D2"})).status_code == 404


@pytest.mark.parametrize("what", ["points", "locations"])
async def test_lists_are_paged(client: httpx.AsyncClient, what: str) -> None:
    names = [each["name"] for each in await found(client, what)]
    collected: list[str] = []
    after: dict[str, str] = {}
    while True:
        page = (await client.get(f"/v1/{what}", params={"limit": 1, **after})).json()
        collected.extend(each["name"] for each in page[what])
        if page["next"] is None:
            break
        after = {"after": page["next"]}
    assert collected == names
    assert (await client.get(f"/v1/{what}", params={"after": "Nowhere"})).status_code == 404
    assert (await client.get(f"/v1/{what}/Nowhere")).status_code == 404
    assert (await client.get(f"/v1/{what}", params={"typ": "x"})).status_code == 400


async def test_points_are_filtered_by_type_and_map(client: httpx.AsyncClient) -> None:
    parking = await found(client, "points", type="PARK_POSITION")
    assert parking
    assert {each["type"] for each in parking} == {"PARK_POSITION"}
    assert await found(client, "points", mapId="cellar") == []
    assert (await client.get("/v1/points", params={"type": "BENCH"})).status_code == 422


async def test_locations_are_filtered_by_type_point_and_operation(client: httpx.AsyncClient) -> None:
    everything = [LocationStatus.model_validate(each) for each in await found(client, "locations")]
    one = next(each for each in everything if each.operations)
    operation, point = one.operations[0], one.links[0].point
    offering = await found(client, "locations", operation=operation)
    assert one.name in {each["name"] for each in offering}
    assert all(operation in each["operations"] for each in offering)
    assert await found(client, "locations", operation="Juggle") == []
    assert len(await found(client, "locations", operation="NOP")) == len(everything)
    assert one.name in {each["name"] for each in await found(client, "locations", point=point)}
    assert {each["type"] for each in await found(client, "locations", type=one.type)} == {one.type}
    assert (await client.get("/v1/locations", params={"point": "Nowhere"})).status_code == 404


SHELF = PlantModel(
    name="shelf",
    points=(Point(name="A", x_mm=0, y_mm=0), Point(name="B", x_mm=0, y_mm=1000)),
    location_types=(LocationType(name="Shelf", allowed_operations=("Load", "Unload")),),
    locations=(
        Location(
            name="S",
            type="Shelf",
            x_mm=0,
            y_mm=0,
            links=(Link(point="A", allowed_operations=("Load", "Juggle")), Link(point="B")),
        ),
    ),
)


@pytest.fixture
def shelf(service: OrderService, monkeypatch: pytest.MonkeyPatch) -> PlantOperations:
    monkeypatch.setattr(service.engine, "plant", SHELF)
    return PlantOperations(service.engine, service.hosts.locks)


def test_a_link_offers_no_more_than_the_type_of_its_location(shelf: PlantOperations) -> None:
    """As orders are checked: they are refused what the location type lacks."""
    assert [(each.point, each.operations) for each in shelf.find_location_status("S").links] == [
        ("A", ("Load",)),
        ("B", ("Load", "Unload")),
    ]
    found = {
        (operation, point): bool(
            shelf.list_locations(LocationsQuery(operation=operation, point=point)).locations
        )
        for operation in ("Load", "Unload", "Juggle", "NOP")
        for point in (None, "A", "B")
    }
    assert {each for each, offered in found.items() if not offered} == {
        ("Unload", "A"),
        ("Juggle", None),
        ("Juggle", "A"),
        ("Juggle", "B"),
    }
