"""`nena orders`, `vehicles` and `dispatch` against a running order service with a robot."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner, Result

from nena_cli.__main__ import app
from nena_client import Client
from nena_demo.plants import sample_plant_path
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.order_service_fleet import Fleet, order_in, vehicle_idle
from support.programs import Program
from support.waiting import PATIENCE, awaited, until

pytestmark = [pytest.mark.broker, pytest.mark.e2e]


@pytest.fixture
def fleet(broker: Broker, interface_name: str, tmp_path: Path) -> Iterator[Fleet]:
    made = Fleet(broker, interface_name, tmp_path)
    with made.stack:
        yield made


class Nena:
    """The command line, beside the test's own loop."""

    def __init__(self, *urls: str) -> None:
        self._urls = [part for url in urls for part in ("--url", url)]

    async def __call__(self, *arguments: str, stdin: str | None = None) -> Result:
        command = [*arguments, *self._urls]
        return await asyncio.to_thread(lambda: CliRunner().invoke(app, command, input=stdin))

    async def json(self, *arguments: str, status: int = 0, stdin: str | None = None) -> list[Any]:
        done = await self(*arguments, "--json", stdin=stdin)
        assert done.exit_code == status, done.output
        return [json.loads(line) for line in done.stdout.splitlines()]


async def test_orders_are_created_listed_shown_and_withdrawn(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    (made,) = await nena.json(
        "orders", "create", "Goods in:Load cargo", "South 2",
        "--name", "T-1", "--vehicle", "Robot-02", "--priority", "7", "--property", "pallet=4711",
        "--deadline", "2035-01-01T12:00:00", "--key", "k",
        "--on-failure", "RETRY:2:5", "--on-failure", "HOLD", "--timeout", "9999",
    )  # fmt: skip
    assert (made["name"], made["state"], made["priority"]) == ("T-1", "DISPATCHABLE", 7)
    assert made["onFailure"] == [
        {"do": "RETRY", "times": 2, "after": 5.0},
        {"do": "HOLD", "times": 1, "after": 0.0},
    ]
    asked = ("name", "driveOrders", "intendedVehicle", "priority", "properties", "deadline", "created")
    there = (await client.get("/v1/transportOrders/T-1")).json()
    assert {each: there[each] for each in asked} == {each: made[each] for each in asked}
    (changed,) = await nena.json(
        "orders", "change", "T-1", "--priority", "9", "--timeout", "none", "--deadline", "2036-01-01T12:00"
    )
    assert (changed["priority"], changed["timeout"], changed["deadline"][:4]) == (9, None, "2036")
    assert changed["intendedVehicle"] == "Robot-02"
    there = (await client.get("/v1/transportOrders/T-1")).json()
    body = json.dumps({"name": "T-2", "destinations": [{"locationName": "South 2"}]})
    await nena.json("orders", "create", "--file", "-", stdin=body)

    assert [each["name"] for each in await nena.json("orders", "list")] == ["T-2", "T-1"]
    assert [each["name"] for each in await nena.json("orders", "list", "--limit", "1")] == ["T-2"]
    assert await nena.json("orders", "list", "--state", "FINISHED") == []
    assert [each["name"] for each in await nena.json("orders", "list", "--vehicle", "Robot-02")] == ["T-1"]
    listed = await nena("orders", "list")
    assert "Goods in: Load cargo > South 2: MOVE" in listed.stdout
    shown = await nena("orders", "show", "T-1")
    assert "pallet=4711" in shown.stdout
    assert "orderCreated" in shown.stdout

    (held,) = await nena.json("orders", "hold", "T-1", "--by", "Ann", "--reason", "tea", "--no-immediate")
    assert (held["held"]["by"], held["held"]["reason"]) == ("Ann", "tea")
    assert "(held)" in (await nena("orders", "list")).stdout
    (resumed,) = await nena.json("orders", "resume", "T-1", "--version", str(held["version"]))
    assert resumed["held"] is None

    stale = await nena("orders", "withdraw", "T-1", "--version", "99")
    assert stale.exit_code == 1
    assert "'T-1' has changed" in stale.stderr
    (ended,) = await nena.json("orders", "withdraw", "T-1", "--reason", "not needed")
    assert (ended["state"], ended["reason"]) == ("FAILED", "not needed")
    watched = await nena("orders", "watch", "T-1")
    assert watched.exit_code == 1
    assert "T-1 is FAILED: not needed" in watched.stderr


async def test_paths_are_locked_and_several_orders_withdrawn(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    name = "Middle 3 --- Middle 4"
    assert (await nena("paths", "lock", name, "--check")).stdout == "none\tnone\n"
    assert await nena.json("paths", "list", "--locked") == []
    (locked,) = await nena.json("paths", "lock", name)
    assert (locked["name"], locked["locked"]) == (name, True)
    (listed,) = await nena.json("paths", "list", "--locked")
    assert listed == locked
    (unlocked,) = await nena.json("paths", "unlock", name)
    assert unlocked["locked"] is False

    for order in ("T-1", "T-2"):
        await nena("orders", "create", "South 2", "--name", order, "--vehicle", "Robot-02")
    with (
        Client(str(client.base_url)) as own,
        pytest.raises(TimeoutError, match=r"'T-1' has not ended after 0\.1 s"),
    ):
        await asyncio.to_thread(own.wait_for, "T-1", 0.1)
    assert (await nena("orders", "withdraw", "T-1", "T-2")).exit_code == 0
    assert {each["state"] for each in await nena.json("orders", "list")} == {"FAILED"}


async def test_orders_are_imported_from_a_file(fleet: Fleet, tmp_path: Path) -> None:
    client = await fleet.order_service().client()
    nena, file = Nena(str(client.base_url)), tmp_path / "shift.csv"
    file.write_text("name,stops\nT-1,Goods in:Load cargo > South 2\nT-2,Nowhere\nT-3,South 2\n")
    checked = await nena("orders", "import", str(file), "--check")
    assert (checked.exit_code, "2 possible, 1 refused" in checked.stderr) == (1, True), checked.output
    assert await nena.json("orders", "list") == []
    made = await nena.json("orders", "import", str(file), status=1)
    assert [each["name"] for each in made] == ["T-1", "T-3"]
    again = await nena("orders", "import", str(file))
    assert "line 3 (T-2)" in again.stderr
    assert "Nowhere" in again.stderr
    assert [each["name"] for each in await nena.json("orders", "list")] == ["T-3", "T-1"]


async def test_sequences_are_created_filled_shown_and_completed(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    (made,) = await nena.json(
        "sequences",
        "create",
        "S",
        "--type",
        "Transport",
        "--vehicle",
        "Robot-02",
        "--failure-fatal",
        "--key",
        "k",
    )
    assert (made["orderTypes"], made["intendedVehicle"], made["failureFatal"]) == (
        ["Transport"],
        "Robot-02",
        True,
    )
    await nena.json("orders", "create", "South 2", "--name", "T-1", "--type", "Transport", "--sequence", "S")
    (waiting,) = await nena.json(
        "orders", "create", "South 2", "--after", "T-1", "--on-dependency-failure", "IGNORE"
    )
    assert (waiting["state"], waiting["onDependencyFailure"]) == ("ACTIVE", "IGNORE")
    refused = await nena("orders", "create", "South 2", "--sequence", "S")
    assert refused.exit_code == 1
    assert "only 'Transport'" in refused.stderr
    assert "T-1" in (await nena("sequences", "show", "S")).stdout
    (done,) = await nena.json("sequences", "complete", "S")
    assert (done["complete"], done["orders"]) == (True, ["T-1"])
    assert await nena.json("sequences", "list", "--unfinished", "--vehicle", "Robot-02") == [done]
    assert await nena.json("sequences", "list", "--finished", "--limit", "1") == []
    assert "open" not in (await nena("sequences", "list")).stdout

    (vehicle,) = await nena.json("vehicles", "order-types", "Robot-01", "Park", "*")
    wanted = [{"name": "Park", "priority": 0}, {"name": "*", "priority": 1}]
    assert vehicle["acceptableOrderTypes"] == wanted
    assert "Park" in (await nena("vehicles", "order-types", "Robot-01")).stdout
    (vehicle,) = await nena.json("vehicles", "order-types", "Robot-01", "--none")
    assert vehicle["acceptableOrderTypes"] == []
    assert (await nena("vehicles", "order-types", "Robot-01", "Park", "--none")).exit_code == 2


async def test_an_order_is_watched_to_its_end_and_vehicles_are_shown(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    fleet.agent(speed=20.0)
    await vehicle_idle(client)
    states = [each["state"] for each in await nena.json("orders", "create", "South 2", "--wait")]
    assert states[-1] == "FINISHED"
    assert (await nena("dispatch", "Robot-01", "@5.5,2.0", "--wait")).exit_code == 0
    (sent,) = await nena.json("dispatch", "Robot-01", "Goods in", "--operation", "Load cargo")
    await order_in(client, sent["name"], "FINISHED")
    (again,) = await nena.json("orders", "watch", sent["name"])
    assert again["state"] == "FINISHED"

    vehicles = await nena.json("vehicles", "list")
    assert [each["name"] for each in vehicles] == ["Robot-01", "Robot-02"]
    assert await nena.json("vehicles", "list", "--state", "CHARGING") == []
    (one,) = await nena.json("vehicles", "show", "Robot-01")
    assert one["connection"] == "ONLINE"
    assert "Robot-02" in (await nena("vehicles", "list")).stdout
    (plan,) = await nena.json("traffic")
    assert [(each["vehicle"], each["at"]) for each in plan["vehicles"]] == [("Robot-01", "Goods in stand")]
    assert "Goods in stand" in (await nena("traffic")).stdout


async def test_zone_sets_are_put_enabled_and_deleted(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    corners = [{"x": x, "y": y} for x, y in ((0, 0), (1, 0), (1, 1))]
    zone = {"zoneId": "z", "zoneType": "BLOCKED", "vertices": corners}
    file = fleet.folder / "zones.json"
    file.write_text(json.dumps({"mapId": "m", "zoneSetId": "night", "zones": [zone]}))
    assert (await nena("zones", "put", str(file))).exit_code == 0
    assert "enabled" in (await nena("zones", "enable", "night")).stdout
    (deleted,) = await nena.json("zones", "delete", "night")
    assert deleted["deleted"] is True
    assert await nena.json("zones", "list") == [deleted]
    assert (await nena("zones", "enable", "day")).exit_code == 1
    assert (await nena("zones", "put", "nowhere.json")).exit_code == 2


@pytest.mark.clause("6.2.3/hibernationAsked")
async def test_a_vehicle_is_hibernated_woken_and_shut_down(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    content = fleet.agent_file(version="3.0.1")
    robot = fleet.agent_of(content.replace("[loopback]", "[loopback]\npower = true"))
    await vehicle_idle(client)
    past = await nena("vehicles", "hibernate", "Robot-01", "--until", "2020-01-01T00:00:00")
    assert past.exit_code == 1
    assert "startHibernation of Robot-01 is FAILED: the wake-up time 20" in past.stderr

    (slept,) = await nena.json("vehicles", "hibernate", "Robot-01", "--until", "2090-01-01T00:00:00")
    assert (slept["actionType"], slept["status"]) == ("startHibernation", "FINISHED")
    await awaited(
        lambda: nena("vehicles", "show", "Robot-01"),
        lambda shown: "HIBERNATING" in shown.stdout,
        what="it sleeps",
    )
    refused = await nena("vehicles", "shutdown", "Robot-01")
    assert (refused.exit_code, "HIBERNATING until stopHibernation" in refused.stderr) == (1, True)
    woken = await nena("vehicles", "wake", "Robot-01")
    assert (woken.exit_code, "FINISHED" in woken.stdout) == (0, True)
    await vehicle_idle(client)
    (slept,) = await nena.json("vehicles", "hibernate", "Robot-01")
    assert slept["status"] == "FINISHED"
    assert (await nena("vehicles", "wake", "Robot-01")).exit_code == 0
    await vehicle_idle(client)
    (gone,) = await nena.json("vehicles", "shutdown", "Robot-01")
    assert gone["status"] == "FINISHED"
    assert robot.process.wait(PATIENCE) == 0


async def test_plant_model_is_activated(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    file = str(sample_plant_path())
    checked = (await nena("plant", "put", file, "--check")).stderr
    assert checked.startswith("Sample hall: ")
    assert "can be activated" in checked
    done = await nena("plant", "put", file, "--json")
    assert (done.exit_code, json.loads(done.stdout)["changed"]) == (0, True)
    wrong = fleet.folder / "wrong.json"
    wrong.write_text("{}")
    assert (await nena("plant", "put", str(wrong))).exit_code == 1


async def test_all_orders_are_watched_as_they_change(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    command = [
        *("orders", "watch", "--json", "--url", str(client.base_url)),
    ]
    log = fleet.folder / "watch.log"
    watching = fleet.stack.enter_context(Program("nena", *command, log=log))
    await client.post(
        "/v1/transportOrders", json={"name": "T-1", "destinations": [{"locationName": "South 2"}]}
    )
    await until(lambda: '"name":"T-1"' in watching.log)
    await client.post("/v1/transportOrders/T-1/withdrawal")
    await until(lambda: '"state":"FAILED"' in watching.log)
    await until(lambda: watching.log.endswith("\n"), what="the whole line")
    told = [json.loads(line) for line in watching.log.splitlines()]
    assert {each["name"] for each in told} == {"T-1"}
    assert [each["state"] for each in told].index("FAILED") == len(told) - 1 > 0


async def test_errors_are_one_clear_text(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    for arguments, said in (
        (("orders", "show", "T-9"), "Unknown transport order 'T-9'"),
        (("orders", "create", "Nowhere"), "Nowhere"),
        (("orders", "list", "--vehicle", "R2D2"), "R2D2"),
        (("explain", "T-9"), "Unknown transport order 'T-9'"),
        (("vehicles", "show", "R2D2"), "R2D2"),
        (("vehicles", "reroute", "Robot-01", "--forced"), "has no transport order"),
        (("vehicles", "watch", "R2D2"), "R2D2"),
        (("dispatch", "R2D2", "South 2"), "R2D2"),
    ):
        done = await nena(*arguments)
        assert (done.exit_code, said in done.stderr) == (1, True), done.output
    for wrong in (
        ("orders", "create"),
        ("orders", "create", "A:"),
        ("orders", "create", "A", "--priority", "9999"),
    ):
        assert (await nena(*wrong)).exit_code == 2
    away = await Nena(f"http://127.0.0.1:{free_port()}")("orders", "list")
    assert (away.exit_code, "Cannot connect to the order service" in away.stderr) == (2, True)


async def test_active_order_service_is_used(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(f"http://127.0.0.1:{free_port()}", str(client.base_url))
    assert len(await nena.json("vehicles", "list")) == 2
    (made,) = await nena.json("orders", "create", "South 2")
    assert isinstance(client, httpx.AsyncClient)
    await client.post(f"/v1/transportOrders/{made['name']}/withdrawal")
    assert (await nena("orders", "watch", made["name"])).exit_code == 1


async def aggregator_of(fleet: Fleet) -> tuple[str, str]:
    """Start a status aggregator of the fleet; return the option with its URL."""
    topics = ("--topic_prefix", fleet.prefix, "--interface_name", fleet.interface)
    options = (*map(str, fleet.broker.options), *topics, "--http.port", "0", "--history.url", "none")
    aggregator = fleet.stack.enter_context(AggregatorProcess(*options))
    await aggregator.logged("broker connected")
    return "--aggregator", await aggregator.url()


async def test_status_and_explain_name_what_needs_a_person(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena, there = Nena(str(client.base_url)), await aggregator_of(fleet)
    (made,) = await nena.json("orders", "create", "Storage", "--vehicle", "Robot-01", "--name", "T-1")
    assert made["driveOrders"][0]["destination"]["operation"] == "NOP"

    shown = await awaited(
        lambda: nena("status", *there), lambda shown: "Robot-01" in shown.stdout, what="it needs a person"
    )
    assert shown.exit_code == 1
    assert "active, ready" in shown.stdout
    assert "robot offline\tRobot-01" in shown.stdout
    (report,) = await nena.json("status", *there, status=1)
    assert report["orders"] == {"DISPATCHABLE": 1}
    (matter,) = report["attention"]
    async with httpx.AsyncClient(base_url=there[1], timeout=PATIENCE) as aggregator:
        await aggregator.post(f"/api/v1/attention/{matter['id']}/acknowledgement", json={"by": "Ann"})
    acknowledged = await nena("status", *there)
    assert (acknowledged.exit_code, "acknowledged by Ann" in acknowledged.stdout) == (0, True)

    await nena.json("orders", "hold", "T-1")
    (explained,) = await nena.json("explain", "T-1")
    assert "nena orders resume T-1" in explained["advice"]
    assert "Start its edge agent" in (await nena("explain", "Robot-01")).stdout


async def test_status_names_a_paused_robot_with_an_order_and_its_level_is_set(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena, there = Nena(str(client.base_url)), await aggregator_of(fleet)
    fleet.agent(speed=0.5)
    await vehicle_idle(client)
    await nena.json("orders", "create", "Storage", "--vehicle", "Robot-01")
    paused = await client.post("/v1/vehicles/Robot-01/instantActions", json={"actionType": "pause"})
    assert paused.json()["status"] == "FINISHED"

    shown = await awaited(
        lambda: nena("status", *there), lambda shown: "Robot-01" in shown.stdout, what="it needs a person"
    )
    assert (shown.exit_code, "robot paused\tRobot-01" in shown.stdout) == (1, True)
    (one,) = await nena.json("vehicles", "level", "Robot-01", "TO_BE_RESPECTED")
    assert (one["integrationLevel"], one["takenOut"]) == ("TO_BE_RESPECTED", False)


async def test_output_formats_into_a_pipe(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    nena = Nena(str(client.base_url))
    await nena.json("orders", "create", "Storage", "--name", "T-1")

    assert (await nena("-o", "name", "vehicles", "list")).stdout == "Robot-01\nRobot-02\n"
    assert (await nena("orders", "list")).stdout.startswith("T-1\tDISPATCHABLE\t\tStorage: NOP\t")
    assert "destinations" in (await nena("orders", "list", "-o", "wide")).stdout
    assert "name: T-1" in (await nena("orders", "show", "T-1", "-o", "yaml")).stdout


async def test_a_closed_pipe_ends_a_command_quietly(fleet: Fleet) -> None:
    client = await fleet.order_service().client()
    command = [
        str(Path(sys.executable).with_name("nena")),
        "vehicles",
        "watch",
        "--json",
        "--url",
        str(client.base_url),
    ]
    read, write = os.pipe()
    process = await asyncio.create_subprocess_exec(*command, stdout=write, stderr=asyncio.subprocess.PIPE)
    os.close(write)
    await asyncio.to_thread(os.read, read, 1)
    os.close(read)
    changed = await client.put(
        "/v1/vehicles/Robot-01/integrationLevel", json={"integrationLevel": "TO_BE_NOTICED"}
    )
    assert changed.status_code == 200
    _, errors = await asyncio.wait_for(process.communicate(), PATIENCE)
    assert (process.returncode, errors) == (1, b"")


async def test_a_server_that_is_no_order_service_is_named() -> None:
    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await reader.readuntil(b"\r\n\r\n")
        writer.write(b"HTTP/1.1 200 OK\r\ncontent-length: 5\r\nconnection: close\r\n\r\nhello")
        writer.close()

    port = free_port()
    async with await asyncio.start_server(answer, "127.0.0.1", port):
        done = await Nena(f"http://127.0.0.1:{port}")("vehicles", "list")
    assert done.exit_code == 2
    assert "is not an order service; check the URL" in done.stderr
