"""Each route of openTCS's documentation is served, and answers as the table says."""

from __future__ import annotations

import asyncio
from urllib.parse import quote

import httpx
import pytest

from golden.outside import opentcs, order_service
from nena_order_service.api.rest import role_needed
from nena_order_service.extensions.opentcs.events import CLIENTS, ChangeLog, _vehicle_json
from nena_order_service.extensions.opentcs.plant import plant_json, plant_xml
from nena_order_service.service import OrderService
from nena_plant_formats.files import read
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.base import Role
from nena_shared.plant import PlantModel, Vehicle
from support.opentcs_routes import FOR_ROBOT, LEVELS, ROUTES, Route, changes_of
from support.waiting import PATIENCE, until

PREFIX = "/opentcs"
API = f"{PREFIX}/v1"


def test_all_routes_are_those_of_the_documentation() -> None:
    paths = opentcs(order_service()).openapi()["paths"]
    served = {f"{method.upper()} {path}" for path, methods in paths.items() for method in methods}
    assert served == {f"{each.method} {each.path}" for each in ROUTES}


READING = tuple(route for route in ROUTES if route.method == "GET")
CHANGING = tuple((route,) for route in ROUTES if route.method != "GET")


# What only reads shares a service; a change would show in the next answers.
@pytest.mark.parametrize("routes", [READING, *CHANGING], ids=lambda routes: routes[-1].path)
async def test_it_answers_as_the_table_says(client: httpx.AsyncClient, routes: tuple[Route, ...]) -> None:
    attempts = [(route.method, attempt) for route in routes for attempt in route.tries]
    for method, attempt in attempts:
        await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
        await client.post(f"{API}/orderSequences/S-1", json={})
        content = {} if attempt.body is None else {"json": attempt.body}
        url = PREFIX + quote(attempt.path)
        answer = await client.request(method, url, params=attempt.query, **content)
        assert answer.status_code == attempt.status, (attempt, answer.text)
        if answer.status_code >= 400:
            assert all(isinstance(sentence, str) for sentence in answer.json())


async def test_an_order_is_reassigned_to_another_vehicle(client: httpx.AsyncClient) -> None:
    url = f"{API}/transportOrders/T-1"
    await client.post(url, json=FOR_ROBOT)
    assert (await client.put(f"{url}/intendedVehicle", params={"vehicle": "Robot-02"})).status_code == 200
    assert (await client.get(url)).json()["intendedVehicle"] == "Robot-02"
    other = await client.get(f"{API}/transportOrders", params={"intendedVehicle": "Robot-02"})
    assert [each["name"] for each in other.json()] == ["T-1"]
    assert (await client.put(f"{url}/intendedVehicle")).status_code == 200
    assert (await client.get(url)).json()["intendedVehicle"] is None
    await client.post(f"{url}/withdrawal")
    assert (await client.put(f"{url}/intendedVehicle", params={"vehicle": "Robot-01"})).status_code == 409


async def test_the_reason_of_an_unassigned_order_is_reported(client: httpx.AsyncClient) -> None:
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    answer = await client.post(f"{API}/transportOrders/T-1/immediateAssignment")
    assert "DISPATCHABLE" in answer.json()[0]
    assert "robot 'Robot-01'" in answer.json()[0]


async def test_routes_have_paths_and_costs(client: httpx.AsyncClient) -> None:
    body = {"sourcePoint": "South 1", "destinationPoints": ["South 3", "South 1"]}
    url = f"{API}/vehicles/Robot-01/routeComputationQuery"
    there, here = (await client.post(url, json=body)).json()["routes"]
    assert (there["destinationPoint"], there["costs"]) == ("South 3", 12_000)
    assert there["steps"][0] == {
        "path": "South 1 --- South 2",
        "sourcePoint": "South 1",
        "destinationPoint": "South 2",
        "vehicleOrientation": "FORWARD",
    }
    assert (here["costs"], here["steps"]) == (0, [])
    closed = {**body, "destinationPoints": ["South 3"], "resourcesToAvoid": ["South 3"]}
    (none,) = (await client.post(url, json=closed)).json()["routes"]
    assert none == {"destinationPoint": "South 3", "costs": -1, "steps": None}


async def test_times_of_vehicles_and_sequences(client: httpx.AsyncClient, service: OrderService) -> None:
    before = (await client.get(f"{API}/vehicles/Robot-01")).json()
    assert before["stateTimestamp"] == before["procStateTimestamp"]
    await client.put(f"{API}/vehicles/Robot-01/integrationLevel", params={"newValue": "TO_BE_RESPECTED"})
    after = (await client.get(f"{API}/vehicles/Robot-01")).json()
    assert after["integrationLevel"] == "TO_BE_RESPECTED"
    assert after["stateTimestamp"] == before["stateTimestamp"]
    made = (await client.post(f"{API}/orderSequences/S", json={})).json()
    assert made["creationTime"] < made["finishedTime"] == "9999-12-31T23:59:59.000Z"
    assert service.engine.plant.vehicles_by_name["Robot-01"].envelope_key == after["envelopeKey"]


async def test_changes_are_polled(client: httpx.AsyncClient) -> None:
    url = f"{API}/events"
    assert (await client.get(url, params={"timeout": "0"})).json()["statusMessages"] == []
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    found = (await client.get(url)).json()["statusMessages"]
    orders = [each for each in found if each["type"] == "TransportOrder"]
    assert (orders[-1]["orderName"], orders[-1]["orderState"]) == ("T-1", "DISPATCHABLE")
    assert orders[-1]["destinations"][0]["locationName"] == "South 2"
    numbers = [each["sequenceNumber"] for each in found]
    assert numbers == sorted(set(numbers))
    again = await client.get(url, params={"minSequenceNo": str(numbers[-1] + 1), "timeout": "0"})
    assert again.json()["statusMessages"] == []
    await client.put(f"{API}/vehicles/Robot-01/integrationLevel", params={"newValue": "TO_BE_RESPECTED"})
    more = (await client.get(url, params={"minSequenceNo": str(numbers[-1] + 1)})).json()["statusMessages"]
    vehicle = next(each for each in more if each["type"] == "Vehicle")
    assert (vehicle["vehicleName"], vehicle["state"], vehicle["procState"]) == ("Robot-01", "UNKNOWN", "IDLE")


async def test_a_poll_waits_on_past_changes_that_do_not_match(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    log = changes_of(service)
    waiting = asyncio.create_task(log.poll(log.count, log.count + 1000, PATIENCE))
    await until(lambda: log.clients == 1)
    await client.post(f"{API}/orderSequences/S-1", json={})
    assert (log.count > 0, waiting.done()) == (True, False), "sequences have no messages"
    await client.post(f"{API}/transportOrders/T-1", json=FOR_ROBOT)
    assert (await waiting)[0]["orderName"] == "T-1"


async def test_change_numbers_continue_after_a_plant_change(service: OrderService) -> None:
    log = ChangeLog(service.engine.plant, SystemClock())
    log.count = 40
    assert await log.poll(0, 100, 0.0) == []
    log.note(service.engine.reporter.vehicle_status(service.engine.registry.named("Robot-01")))  # type: ignore[arg-type]
    assert [each["sequenceNumber"] for each in await log.poll(0, 100, 0.0)] == [40]


async def test_clients_beyond_the_limit_are_refused_before_the_stream_starts(
    client: httpx.AsyncClient, service: OrderService
) -> None:
    changes_of(service).clients = CLIENTS
    assert (await client.get(f"{API}/sse")).status_code == 503


@pytest.mark.parametrize(("color", "red"), [("#FF0000", 255), ("red", 0), ("#F00", 0), (None, 0)])
def test_a_color_that_cannot_be_read_is_black(service: OrderService, color: str | None, red: int) -> None:
    engine = service.engine
    known = engine.registry.named("Robot-01")
    assert known
    log = ChangeLog(service.engine.plant, SystemClock())
    model = Vehicle(name="Robot-01", color=color)
    shown = _vehicle_json(engine.reporter.vehicle_status(known), model, log.times_of("Robot-01"))
    assert shown["layout"]["routeColor"] == {"red": red, "green": 0, "blue": 0}


async def test_a_plant_model_may_be_larger_than_other_bodies(client: httpx.AsyncClient) -> None:
    large = {"name": "x" * 300_000}
    assert (await client.put(f"{API}/plantModel", json=large)).status_code != 413
    assert (await client.post(f"{API}/transportOrders/T-1", json=large)).status_code == 413


@pytest.mark.parametrize(
    "path",
    [
        "locations/Goods in/locked",
        "vehicles/R/envelopeKey",
        "vehicles/R/energyLevelThresholdSet",
        "plantModel",
    ],
)
def test_changes_of_the_plant_need_the_role_admin(path: str) -> None:
    assert role_needed("PUT", f"{API}/{path}") is Role.ADMIN
    assert role_needed("PUT", f"{API}/{path}\n") is Role.ADMIN


async def test_an_order_that_has_ended_is_not_assigned(client: httpx.AsyncClient) -> None:
    url = f"{API}/transportOrders/T-1"
    await client.post(url, json=FOR_ROBOT)
    await client.post(f"{url}/withdrawal")
    answer = await client.post(f"{url}/immediateAssignment")
    assert (answer.status_code, answer.json()) == (
        400,
        ["Transport order 'T-1' cannot be assigned to its intended vehicle: it is FAILED."],
    )


async def test_plant_model_round_trip_is_unchanged(client: httpx.AsyncClient, service: OrderService) -> None:
    shown = (await client.get(f"{API}/plantModel")).json()
    assert [each["name"] for each in shown["vehicles"]] == ["Robot-01", "Robot-02"]
    back: PlantModel = read(plant_xml(shown)).model
    assert plant_json(back) == shown
    assert back.points == service.engine.plant.points
    assert back.paths == service.engine.plant.paths
    assert LEVELS["energyLevelGood"] == shown["vehicles"][0]["energyLevelGood"]
