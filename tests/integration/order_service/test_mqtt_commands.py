"""Every topic of the MQTT API in use, with a real broker and a robot; each message as documented."""

from __future__ import annotations

import json
import re
from collections.abc import Awaitable, Callable
from itertools import count
from typing import Any

import httpx
import pytest
from jsonschema_rs import Draft202012Validator

from support.broker import MqttPeer
from support.order_service_fleet import Fleet, listening, order_in, vehicle_idle
from support.waiting import PATIENCE, awaited

pytestmark = pytest.mark.broker

Start = Callable[..., Awaitable[httpx.AsyncClient]]

NUMBERS = count()


class Host:
    """A host called wms."""

    def __init__(self, fleet: Fleet) -> None:
        self._topics = f"{fleet.prefix}/hosts/wms"
        self._peer: MqttPeer = fleet.peer(f"{fleet.prefix}/#")

    async def ask(self, command: str, *, retain: bool = False, **body: object) -> dict[str, Any]:
        request_id = f"r-{next(NUMBERS)}"
        payload = json.dumps({"requestId": request_id, **body})
        return await self.send(command, payload, request_id, retain=retain)

    async def send(
        self, command: str, payload: str, request_id: str | None = None, *, retain: bool = False
    ) -> dict[str, Any]:
        topic = f"{self._topics}/commands/{command}"
        before = len(self._peer.received(f"{topic}/answer"))
        self._peer.publish(topic, payload, retain=retain)

        def answers() -> list[dict[str, Any]]:
            return [json.loads(each.payload) for each in self._peer.received(f"{topic}/answer")[before:]]

        await self._peer.wait_for(
            f"{topic}/answer", lambda _: any(a.get("requestId") == request_id for a in answers())
        )
        return next(answer for answer in answers() if answer.get("requestId") == request_id)

    async def create(self, name: str, *stops: dict[str, str]) -> None:
        body = {"name": name, "destinations": list(stops)}
        self._peer.publish(f"{self._topics}/transportOrders/create", json.dumps(body))
        await self._peer.wait_for(f"{self._topics}/transportOrders/answer")

    def heard(self) -> list[tuple[str, bytes]]:
        """Return the messages to hosts; leader/ and brokerCheck/ are internal to order services."""
        internal = ("/leader/", "/brokerCheck/")
        return [
            (each.topic, each.payload)
            for each in self._peer.history
            if not any(folder in each.topic for folder in internal)
        ]


@pytest.fixture
def host(fleet: Fleet) -> Host:
    return Host(fleet)


def misfits(document: dict[str, Any], messages: list[tuple[str, bytes]]) -> tuple[list[str], set[str]]:
    """Return the errors of messages, and their channels."""
    addresses = {
        re.compile(re.sub(r"\\\{\w+\\\}", "[^/]+", re.escape(channel["address"]))): name
        for name, channel in document["channels"].items()
    }
    wrong, used = [], set()
    for topic, payload in messages:
        name = next((name for address, name in addresses.items() if address.fullmatch(topic)), None)
        if name is None:
            wrong.append(f"{topic} is not in the document")
            continue
        used.add(name)
        if payload:
            schema = {
                **document["components"]["messages"][name]["payload"],
                "components": document["components"],
            }
            errors = Draft202012Validator(schema).iter_errors(json.loads(payload))
            wrong.extend(f"{topic}: {error.message}" for error in errors)
    return wrong, used


async def ways_and_zones_are_changed(host: Host) -> None:
    rerouted = await host.ask("reroute", vehicle="Robot-01")
    assert (rerouted["status"], rerouted["rerouting"]["transportOrder"]) == (200, "T-1")
    corners = [{"x": x, "y": y} for x, y in ((30, 30), (31, 30), (31, 31))]
    zone = {"zoneId": "z", "zoneType": "BLOCKED", "vertices": corners}
    zones = {"mapId": "sample-hall", "zoneSetId": "night", "zones": [zone]}
    assert (await host.ask("putZoneSet", zoneSet=zones))["zoneSet"]["enabled"] is False
    assert (await host.ask("enableZoneSet", zoneSetId="night"))["zoneSet"]["enabled"] is True
    assert (await host.ask("deleteZoneSet", zoneSetId="night"))["zoneSet"]["deleted"] is True


async def paths_are_locked_and_vehicles_told(client: httpx.AsyncClient, host: Host) -> None:
    path = (await client.get("/v1/paths")).json()["paths"][0]["name"]
    preview = (await host.ask("previewPathLock", path=path))["preview"]
    assert preview == {"vehicles": [], "orders": []}
    assert (await host.ask("lockPath", path=path, locked=True))["path"]["locked"] is True
    assert (await host.ask("lockPath", path=path, locked=False))["path"]["locked"] is False
    level = await host.ask("integrationLevel", vehicle="Robot-02", integrationLevel="TO_BE_IGNORED")
    assert (level["status"], level["vehicle"]["integrationLevel"]) == (200, "TO_BE_IGNORED")
    types = await host.ask(
        "acceptableOrderTypes", vehicle="Robot-02", acceptableOrderTypes=[{"name": "Park"}]
    )
    assert types["vehicle"]["acceptableOrderTypes"] == [{"name": "Park", "priority": 0}]
    assert (await host.ask("summary"))["summary"] == (await client.get("/v1/summary")).json()
    planned = (await host.ask("trafficPlan"))["trafficPlan"]["vehicles"]
    assert [each["vehicle"] for each in planned] == ["Robot-01"]


async def sequences_are_made_and_completed(host: Host) -> None:
    made = await host.ask("createOrderSequence", name="S", failureFatal=True)
    assert (made["status"], made["orderSequence"]["failureFatal"]) == (201, True)
    assert (await host.ask("createOrderSequence", name="S"))["status"] == 409
    assert (await host.ask("orderSequence", orderSequence="S"))["orderSequence"] == made["orderSequence"]
    listed = await host.ask("orderSequences", finished=False)
    assert listed["orderSequences"]["orderSequences"] == [made["orderSequence"]]
    stale = await host.ask("completeOrderSequence", orderSequence="S", version=99)
    assert stale["status"] == 412
    complete = await host.ask("completeOrderSequence", orderSequence="S")
    assert (complete["status"], complete["orderSequence"]["finished"]) == (200, True)


async def orders_are_held_and_withdrawn(host: Host) -> None:
    sent = await host.ask("dispatch", vehicle="Robot-01", point="South 2")
    assert (sent["status"], sent["transportOrder"]["intendedVehicle"]) == (201, "Robot-01")
    name = sent["transportOrder"]["name"]
    assert sent["transportOrder"]["createdBy"] == "wms"
    changed = await host.ask("changeOrder", transportOrder=name, priority=5, intendedVehicle=None)
    assert (changed["status"], changed["transportOrder"].get("intendedVehicle")) == (200, None)
    held = await host.ask("hold", transportOrder=name, by="Ann", reason="tea")
    assert (held["status"], held["transportOrder"]["held"]["by"]) == (200, "Ann")
    resumed = await host.ask("resume", transportOrder=name, version=held["transportOrder"]["version"])
    assert (resumed["status"], resumed["transportOrder"].get("held")) == (200, None)
    stale = await host.ask("withdraw", transportOrder=name, version=99)
    assert (stale["status"], "has changed" in stale["problem"]["detail"]) == (412, True)
    withdrawn = await host.ask("withdraw", transportOrder=name, reason="not needed")
    assert (withdrawn["status"], withdrawn["transportOrder"]["state"]) == (200, "FAILED")


async def an_area_is_stopped_and_released(host: Host) -> None:
    area = {"xMin": 100, "yMin": 100, "xMax": 101, "yMax": 101}
    begun = await host.ask("stop", by="Ann", reason="spilled oil", area=area)
    assert (begun["status"], begun["stop"]["by"]) == (200, "Ann")
    name = begun["stop"]["name"]
    assert [each["name"] for each in (await host.ask("stops"))["stops"]["stops"]] == [name]
    assert (await host.ask("endStop", stop=name, by="Ann"))["status"] == 200
    assert (await host.ask("endStop", stop=name, by="Ann"))["status"] == 404
    assert (await host.ask("stops"))["stops"]["stops"] == []


async def devices_are_asked_for(host: Host) -> None:
    """The plant has none; devices and their topics are tested in test_peripherals.py."""
    assert (await host.ask("peripherals"))["peripherals"]["peripherals"] == []
    assert (await host.ask("peripheralJobs"))["peripheralJobs"]["peripheralJobs"] == []
    assert (await host.ask("peripheral", location="Door"))["status"] == 404
    assert (await host.ask("peripheralJob", peripheralJob="J"))["status"] == 404
    assert (await host.ask("fetchRecording"))["status"] == 409, "the black box is off by default"
    assert (await host.ask("withdrawPeripheralJob", peripheralJob="J"))["status"] == 404
    made = await host.ask("createPeripheralJob", location="Door", operation="open", reservationToken="wms")
    assert made["status"] == 404


async def places_are_listed(host: Host) -> None:
    points = (await host.ask("points", vehicle="Robot-01"))["points"]["points"]
    assert (await host.ask("point", point=points[0]["name"]))["point"] == points[0]
    locations = (await host.ask("locations", limit=1))["locations"]["locations"]
    assert (await host.ask("location", location=locations[0]["name"]))["location"] == locations[0]
    assert (await host.ask("location", location="Nowhere"))["status"] == 404


async def schedules_are_made_and_deleted(host: Host) -> None:
    order = {"destinations": [{"locationName": "South 2"}]}
    made = await host.ask(
        "putSchedule", schedule="yearly", transportOrder=order, cron="0 3 1 1 *", timeZone="Europe/Berlin"
    )
    assert (made["status"], made["schedule"]["enabled"]) == (201, True)
    disabled = await host.ask("enableSchedule", schedule="yearly", enabled=False)
    assert (await host.ask("schedule", schedule="yearly"))["schedule"] == disabled["schedule"]
    assert [each["name"] for each in (await host.ask("schedules"))["schedules"]["schedules"]] == ["yearly"]
    assert (await host.ask("deleteSchedule", schedule="yearly"))["status"] == 200
    assert (await host.ask("schedule", schedule="yearly"))["status"] == 404


OF_DEVICES = {"deviceJob", "deviceCancel", "deviceJobState", "deviceState", "peripheralStatus"}


async def everything_is_as_documented(client: httpx.AsyncClient, host: Host) -> None:
    """Wait for a message on each described channel, and check all of them."""
    document = (await client.get("/asyncapi.json")).json()
    channels = set(document["channels"]) - OF_DEVICES

    async def unheard() -> set[str]:
        return channels - misfits(document, host.heard())[1]

    await awaited(unheard, lambda left: not left, seconds=PATIENCE, what="a message on each channel")
    wrong, used = misfits(document, host.heard())
    assert wrong == []
    assert used == channels


async def test_every_command_works_as_documented(fleet: Fleet, service: Start, host: Host) -> None:
    client = await service()
    fleet.agent(speed=2.5)
    await vehicle_idle(client)
    await host.create("T-1", {"locationName": "Packing stand"})
    await order_in(client, "T-1", "BEING_PROCESSED")

    delivery = await awaited(
        lambda: host.ask("delivery", transportOrder="T-1"),
        lambda answer: answer["delivery"]["phase"] in ("SENT", "DELIVERED"),
        seconds=PATIENCE,
        what="T-1 is sent",
    )
    assert (delivery["status"], delivery["delivery"]["transportOrder"]) == (200, "T-1")
    assignment = await host.ask("assignment", transportOrder="T-1")
    fits = {each["vehicle"]: each["fits"] for each in assignment["assignment"]["vehicles"]}
    assert fits == {"Robot-01": True, "Robot-02": False}
    paused = await host.ask("instantAction", vehicle="Robot-01", actionType="pause")
    assert (paused["status"], paused["instantAction"]["status"]) == (200, "FINISHED")
    await ways_and_zones_are_changed(host)
    await paths_are_locked_and_vehicles_told(client, host)
    await sequences_are_made_and_completed(host)
    await orders_are_held_and_withdrawn(host)
    await devices_are_asked_for(host)
    await places_are_listed(host)
    await schedules_are_made_and_deleted(host)
    await an_area_is_stopped_and_released(host)
    assert (await host.ask("instantAction", vehicle="Robot-01", actionType="resume"))["status"] == 200
    await order_in(client, "T-1", "FINISHED")

    await everything_is_as_documented(client, host)


@pytest.mark.parametrize(
    ("command", "body", "status"),
    [
        ("withdraw", {"transportOrder": "T-9"}, 404),
        ("hold", {"transportOrder": "T-9"}, 404),
        ("resume", {}, 422),
        ("delivery", {"transportOrder": "T-9"}, 404),
        ("assignment", {"transportOrder": "T-9"}, 404),
        ("dispatch", {"vehicle": "R2D2", "point": "South 2"}, 404),
        ("dispatch", {"vehicle": "Robot-01"}, 422),
        ("instantAction", {"vehicle": "Robot-01", "actionType": "pause"}, 409),
        ("createOrderSequence", {"intendedVehicle": "R2D2"}, 404),
        ("orderSequence", {"orderSequence": "S-9"}, 404),
        ("orderSequences", {"limit": 0}, 422),
        ("completeOrderSequence", {"orderSequence": "S-9"}, 404),
        ("acceptableOrderTypes", {"vehicle": "R2D2", "acceptableOrderTypes": []}, 404),
        ("reroute", {"vehicle": "Robot-01"}, 409),
        ("putZoneSet", {"zoneSet": {"zoneSetId": "x"}}, 422),
        ("enableZoneSet", {"zoneSetId": "x"}, 404),
        ("deleteZoneSet", {"zoneSetId": "x"}, 404),
        ("lockPath", {"path": "Nowhere", "locked": True}, 404),
        ("lockPath", {"path": "Nowhere"}, 422),
        ("integrationLevel", {"vehicle": "R2D2", "integrationLevel": "TO_BE_IGNORED"}, 404),
        ("integrationLevel", {"vehicle": "Robot-01", "integrationLevel": "LATER"}, 422),
        ("point", {"point": "Nowhere"}, 404),
        ("points", {"limit": 0}, 422),
        ("putSchedule", {"schedule": "S", "cron": "0 3 1 1 *"}, 422),
        ("enableSchedule", {"schedule": "S-9", "enabled": True}, 404),
        ("deleteSchedule", {"schedule": "S-9"}, 404),
        ("dance", {}, 404),
    ],
)
async def test_impossible_requests_are_problems(
    service: Start, host: Host, command: str, body: dict[str, object], status: int
) -> None:
    await listening(await service())
    answer = await host.send(command, json.dumps({"requestId": "r", **body}), "r")
    assert (answer["status"], answer["problem"]["status"]) == (status, status)


async def test_bad_commands_are_refused_and_the_next_one_is_handled(service: Start, host: Host) -> None:
    await listening(await service(max_body=1024))
    assert (await host.send("withdraw", "{"))["status"] == 400
    assert (await host.send("withdraw", "x" * 2000))["status"] == 413
    assert (await host.ask("delivery", transportOrder="T-9"))["status"] == 404
