"""The page *Plant* in a real browser, over a real order service with loopback robots."""

from __future__ import annotations

import asyncio
import itertools
import json
import re
import subprocess
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, Page, Route, expect

from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.plant import PlantModel
from nena_shared.plant.curve import is_cubic_bezier, length
from nena_shared.vda5050.topics import RobotKey
from support.aggregator_process import AggregatorProcess
from support.broker import Broker, free_port
from support.drawn_maps import warehouse, write_map
from support.order_service_fleet import Fleet, vehicle_idle
from support.panel import Hall, becomes, findings, fits, opened, picture
from support.panel_texts import Texts
from support.programs import OrderServiceProgram
from support.robot_maps import robot_map
from support.waiting import PATIENCE, awaited

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

CANVAS = "nena-draft-canvas canvas"
DRAFT = "document.querySelector('nena-draft-canvas')"
PLACE = f"""([x, y]) => {{
  const [px, py] = {DRAFT}.view.toScreen(x, y);
  const {{ left, top }} = {DRAFT}.canvas.getBoundingClientRect();
  return [left + px, top + py];
}}"""
MODEL = "() => document.querySelector('nena-plant-page').history.present"
SAVED = "nena-plant-page .head [data-state='saved']"
DURING_RESTART = ("502", "503", "409")


@dataclass
class Site:
    """Panel, order service at a fixed port, and a robot on `South 1`."""

    fleet: Fleet
    url: str
    port: int
    service: OrderServiceProgram
    orders: httpx.AsyncClient

    def start(self) -> OrderServiceProgram:
        return self.fleet.order_service("--http.port", self.port)

    async def restart(self) -> None:
        self.service.kill()
        self.service = self.start()
        async with await self.service.client() as orders:
            await vehicle_idle(orders)

    async def draft(self, name: str) -> Any:
        return (await self.orders.get(f"/v1/plantDrafts/{name}")).json()


@asynccontextmanager
async def site(
    broker: Broker,
    interface_name: str,
    folder: Path,
    *plant: object,
    robots: tuple[tuple[float, float], ...] = (),
) -> AsyncIterator[Site]:
    """Run a robot on `South 1` of the sample plant; or `robots` on the map `site`, and a `plant` of it."""
    fleet, port, panel = Fleet(broker, interface_name, folder), free_port(), free_port()
    with fleet.stack:
        if not robots:
            fleet.agent()
        for number, (x, y) in enumerate(robots, start=1):
            serial = f"amr-{number}"
            file = fleet.agent_file(serial, x=x, y=y, speed=40.0)
            fleet.agent_of(file.replace("sample-hall", "site"), serial)
        service = fleet.order_service("--http.port", port, *plant)
        async with await service.client() as orders:
            for name in [f"amr-{number}" for number in range(1, len(robots) + 1)] or ["Robot-01"]:
                await vehicle_idle(orders, name)
            options = ("--interface_name", interface_name, "--topic_prefix", fleet.prefix)
            addresses = ("--http.port", str(panel), "--mqtt.port", str(broker.port))
            reached = ("--order_service.url", f"http://127.0.0.1:{port}")
            with AggregatorProcess(*addresses, *options, *reached) as aggregator:
                await aggregator.logged("broker connected")
                yield Site(fleet, f"http://127.0.0.1:{panel}/", port, service, orders)


@asynccontextmanager
async def drawing(
    browser: Browser, site: Site, name: str, source: str = "", **options: Any
) -> AsyncIterator[Page]:
    """Open the panel and a draft, which is made from this source first."""
    async with opened(browser, site.url, width=1600, height=1000, expected=DURING_RESTART, **options) as page:
        text = Texts(options.get("language", "en-GB"))
        await page.get_by_role("link", name=text("plant.title"), exact=True).click()
        if source:
            form = page.get_by_role("form", name=text("plant.new"))
            await form.get_by_label(text("plant.draftName")).fill(name)
            await form.get_by_label(text("plant.source")).select_option(source)
            await form.get_by_role("button").click()
        else:
            await page.locator("nena-plant-page").get_by_role("link", name=name, exact=True).click()
        await expect(page.locator(CANVAS)).to_be_visible()
        await becomes(page, f"() => {DRAFT}.view.width", None, lambda width: width > 1)  # fitted to its size
        yield page


async def at(page: Page, x: float, y: float) -> tuple[float, float]:
    """Return the place of a position (m) on the screen."""
    px, py = await page.evaluate(PLACE, [x, y])
    return px, py


async def drag(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    await page.mouse.move(*await at(page, *start))
    await page.mouse.down()
    await page.mouse.move(*await at(page, (start[0] + end[0]) / 2, (start[1] + end[1]) / 2))
    await page.mouse.move(*await at(page, *end))
    await page.mouse.up()


async def tool(page: Page, name: str) -> None:
    await page.get_by_role("toolbar").get_by_role("button", name=name, exact=True).click()


async def drawn(page: Page) -> dict[str, Any]:
    model: dict[str, Any] = await page.evaluate(MODEL)
    return model


async def test_a_plant_of_four_points_is_drawn_kept_activated_and_driven(  # noqa: PLR0915 - one way through
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with site(broker, interface_name, tmp_path) as made:
        async with drawing(browser, made, "yard", "empty") as page:
            # a point where the robot stands, with the name that it has in the active plant
            await expect(page.get_by_role("button", name="Here")).to_be_enabled()
            await page.get_by_role("button", name="Here").click()
            await page.get_by_label("Name", exact=True).fill("South 1")
            await page.get_by_label("Name", exact=True).press("Enter")
            await page.get_by_label("Heading").fill("")
            await page.get_by_label("Heading").press("Enter")
            await (
                page.get_by_role("button", name="Add ACME/robot-01")
                .or_(page.get_by_role("button", name="robot-01"))
                .first.click()
            )
            assert [each["name"] for each in (await drawn(page))["points"]] == ["South 1"]
            # the second by mouse, with a path in both directions into the open
            await tool(page, "Two-way path")
            await drag(page, (3, 2), (7, 2))
            assert [each["name"] for each in (await drawn(page))["paths"]] == [
                "South 1 --- P1",
                "P1 --- South 1",
            ]
            # two more by keys, beside each other, moved and connected
            canvas = page.locator(CANVAS)
            await canvas.focus()
            await page.keyboard.press("p")
            for _ in range(6):
                await page.keyboard.press("ArrowUp")
            await page.keyboard.press("p")
            await page.keyboard.press("Shift+ArrowLeft")
            await page.keyboard.press("Escape")
            for key in ("Tab", "Space", "Tab", "Space", "Tab", "Space", "Tab", "Shift+C"):
                await page.keyboard.press(key)
            points = {each["name"]: (each["xMm"], each["yMm"]) for each in (await drawn(page))["points"]}
            assert points == {
                "South 1": (3000, 2000),
                "P1": (7000, 2000),
                "P2": (8000, 5000),
                "P3": (4000, 5000),
            }
            assert len((await drawn(page))["paths"]) == 6
            for key in ("Escape", "Escape", "Tab"):
                await page.keyboard.press(key)
            await expect(canvas).not_to_be_focused()
            await canvas.focus()
            await page.keyboard.press("Control+z")
            assert len((await drawn(page))["paths"]) == 2
            await page.keyboard.press("Control+y")
            # a station at the last point, linked by a drag
            await tool(page, "Location")
            await page.mouse.click(*await at(page, 4, 7))
            await tool(page, "One-way path")
            await drag(page, (4, 7), (4, 5))
            [station] = (await drawn(page))["locations"]
            assert (station["type"], station["links"]) == ("Stations", [{"point": "P3"}])
            await tool(page, "Select")
            await page.mouse.click(*await at(page, 8, 5))
            await page.get_by_label("Parking position").check()
            await page.get_by_label("x in m").fill("8.25")
            await page.get_by_label("x in m").press("Enter")
            assert (await drawn(page))["points"][2]["xMm"] == 8250
            await expect(page.locator(SAVED)).to_be_visible()
            assert await findings(page) == []
            await picture(page, "plant-drawn")
            before = PlantModel.model_validate(await drawn(page))
        await made.restart()
        async with drawing(browser, made, "yard") as page:
            kept = PlantModel.model_validate(await drawn(page))
            assert kept == before, "over a closed browser and a killed order service"
            await page.get_by_role("button", name="Activate …").click()
            await expect(page.locator(".differences li[data-change=ADDED]").first).to_be_visible()
            await page.get_by_role("button", name="Activate now").click()
            await expect(page.get_by_text("is active, with 4 points")).to_be_visible()
        order = {"destinations": [{"locationName": station["name"], "operation": "Load cargo"}]}
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{made.port}", timeout=PATIENCE) as orders:

            async def state() -> str:
                answer = await orders.get("/v1/transportOrders/first")
                return str(answer.json()["state"]) if answer.status_code == 200 else answer.text

            assert (
                await orders.post("/v1/transportOrders", json={**order, "name": "first"})
            ).status_code == 201
            await awaited(state, lambda now: now == "FINISHED", what="the order on the drawn plant")
            versions = (await orders.get("/v1/plantVersions")).json()["versions"]
            assert [(each["number"], each["draft"]) for each in versions] == [(2, "yard"), (1, "")]


async def test_two_editors_lose_no_work(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "aisle", "active") as one,
    ):
        async with drawing(browser, made, "aisle") as two:
            await expect(one.get_by_text("Also open at: somebody")).to_be_visible()
            await expect(two.get_by_text("Also open at: somebody")).to_be_visible()
            # what one saves, the other takes over while it has changed nothing
            await one.locator(CANVAS).focus()
            await one.keyboard.press("p")
            await expect(one.locator(SAVED)).to_be_visible()
            await becomes(two, MODEL, None, lambda model: len(model["points"]) == 21)
            # both at once: the second is told, and keeps its work as another draft
            stored = await made.draft("aisle")
            await two.route("**/api/v1/control/plantDrafts/aisle?*", lambda route: route.abort())
            body = {"version": stored["version"], "model": {**stored["model"], "name": "theirs"}}
            assert (await made.orders.put("/v1/plantDrafts/aisle", json=body)).status_code == 200
            await two.locator(CANVAS).focus()
            await two.keyboard.press("Escape")
            await two.keyboard.press("p")
            alert = two.get_by_role("alert")
            await expect(alert).to_contain_text("somebody saved version")
            assert await findings(two) == []
            await picture(two, "plant-conflict")
            await alert.get_by_role("button", name="Save mine as another draft").click()
            await expect(two.get_by_role("heading", name="aisle, mine")).to_be_visible()
            assert len((await drawn(two))["points"]) == 22
        await becomes(one, MODEL, None, lambda model: model["name"] == "theirs")


async def test_a_server_that_does_not_answer_is_waited_for(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "aisle", "active") as page,
    ):
        held: asyncio.Queue[Route] = asyncio.Queue()
        urls = re.compile("/api/v1/control/plantDrafts(/aisle|/aisle/map)?$")
        await page.route(urls, held.put)
        waiting = page.locator("nena-plant-page").get_by_text("Loading …")
        await page.reload()
        for _ in range(2):
            draft = await held.get()
            await expect(waiting).to_be_visible()
            await draft.fulfill(status=502, json={"title": "No answer"})
        await (await held.get()).continue_()
        robot_map = await held.get()
        await expect(page.locator(CANVAS)).to_be_visible()
        await robot_map.abort()
        await (await held.get()).continue_()
        await page.get_by_role("link", name="Drafts").click()
        drafts = await held.get()
        await expect(waiting).to_be_visible()
        await drafts.abort()
        await page.unroute(urls)
        await expect(page.get_by_role("link", name="aisle", exact=True)).to_be_visible()


async def test_findings_are_at_their_places_and_conflicts_are_named(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "less", "active") as page,
    ):
        await page.mouse.click(*await at(page, 3, 2))
        await expect(page.get_by_label("Name", exact=True)).to_have_value("South 1")
        await page.locator(CANVAS).press("Delete")
        model = await drawn(page)
        assert "South 1" not in json.dumps(model)
        await expect(page.locator(SAVED)).to_be_visible()
        await page.get_by_role("button", name="Activate …").click()
        await expect(page.get_by_text("It cannot be activated:")).to_be_visible()
        await expect(page.locator("nena-plant-page")).to_contain_text(
            "uses 'South 1', which would be removed"
        )
        assert await findings(page) == []
        # the map of a robot lies under the plan
        seen = robot_map(x=-1.0, y=-1.0, resolution=0.1, width=260, height=142)
        topic = FleetTopics(made.fleet.prefix).robot_map(RobotKey("NeNa", "robot-01"))
        made.fleet.peer().publish(topic, seen.model_dump_json(by_alias=True), retain=True)
        under = "() => document.querySelector('nena-draft-canvas').grids.length"
        await becomes(page, under, None, lambda count: count == 1)
        await picture(page, "plant-activation")
        name = model["locations"][0]["name"]
        shown = page.get_by_role("region", name="Findings")
        location = model["locations"][0]
        await page.mouse.click(*await at(page, location.get("xMm", 0) / 1000, location.get("yMm", 0) / 1000))
        await expect(page.get_by_label("Name", exact=True)).to_have_value(name)
        links = page.get_by_role("button", name="Unlink ")
        while await links.count():
            await links.first.click()
        entry = shown.locator("li[data-code=LOCATION_WITHOUT_LINK]").filter(has_text=name)
        await expect(entry).to_be_visible()
        marked = await page.evaluate("() => [...document.querySelector('nena-draft-canvas').findings.keys()]")
        assert name in marked
        await entry.get_by_role("button").click()
        await page.get_by_label("File format").select_option("opentcs")
        await page.get_by_role("button", name="Download").click()
        await expect(page.get_by_role("region", name="Download")).to_contain_text("less.xml saved.")


async def test_points_are_selected_aligned_split_and_versions_compared(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "tidy", "active") as page,
    ):
        model = await drawn(page)
        row = [each for each in model["points"] if each["yMm"] == 2000]
        assert len(row) > 3
        await drag_area(
            page,
            (min(each["xMm"] for each in row) / 1000 - 0.5, 1.5),
            (max(each["xMm"] for each in row) / 1000 + 0.5, 2.5),
        )
        selected = page.get_by_role("region", name="Selected")
        await expect(selected).to_contain_text(f"{len(row)} objects")
        await page.locator(CANVAS).press("ArrowUp")
        moved = {each["name"]: each["yMm"] for each in (await drawn(page))["points"]}
        assert {moved[each["name"]] for each in row} == {2500}
        await page.mouse.click(*await at(page, row[1]["xMm"] / 1000, 2.5))
        await page.get_by_label("y in m").fill("3.1")
        await page.get_by_label("y in m").press("Enter")
        await expect(page.get_by_role("button", name="Align y")).to_be_disabled()
        await page.keyboard.down("Shift")
        await page.mouse.click(*await at(page, row[0]["xMm"] / 1000, 2.5))
        await page.keyboard.up("Shift")
        await page.get_by_role("button", name="Align y").click()
        moved = {each["name"]: each["yMm"] for each in (await drawn(page))["points"]}
        assert (moved[row[0]["name"]], moved[row[1]["name"]]) == (3100, 3100)
        ends = {row[0]["name"], row[1]["name"]}
        cut = {each["name"] for each in model["paths"] if {each["source"], each["destination"]} == ends}
        middle = (row[0]["xMm"] + row[1]["xMm"]) / 2000
        await tool(page, "Point")
        await page.mouse.click(*await at(page, middle, 3.1))
        after = await drawn(page)
        assert cut.isdisjoint(each["name"] for each in after["paths"])
        assert len(after["paths"]) == len(model["paths"]) + len(cut)
        await page.get_by_role("button", name="Differences", exact=True).click()
        await expect(page.locator(".differences li[data-change=MOVED]")).not_to_have_count(0)
        await page.get_by_role("link", name="Drafts").click()
        version = page.locator("li[data-version='1']")
        await expect(version).to_contain_text("Active")
        await version.get_by_role("button", name="Differences").click()
        await expect(version.locator(".hint").last).to_have_text("No differences.")
        assert await findings(page) == []
        await picture(page, "plant-drafts")
        await version.get_by_role("button", name="Make a draft").click()
        await expect(page.get_by_role("heading", name="version 1")).to_be_visible()
        assert len((await drawn(page))["points"]) == len(model["points"])


async def drag_area(page: Page, start: tuple[float, float], end: tuple[float, float]) -> None:
    await page.keyboard.down("Shift")
    await drag(page, start, end)
    await page.keyboard.up("Shift")


@pytest.mark.parametrize("language", ["de-DE", "nl-NL"])
async def test_the_page_speaks_each_language(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser, language: str
) -> None:
    text = Texts(language)
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "taal", "active", language=language, dark=True) as page,
    ):
        await page.mouse.click(*await at(page, 3, 2))
        await expect(page.get_by_label(text("plant.parking"))).to_be_visible()
        assert await findings(page) == []
        await picture(page, f"plant-{language[:2]}")
        await page.set_viewport_size({"width": 390, "height": 844})
        await fits(page, 390)
        assert await findings(page) == []
        await picture(page, f"plant-phone-{language[:2]}")


DRAG = """async ([x, y]) => {
  const canvas = document.querySelector("nena-draft-canvas");
  const at = (dx) => ({ pointerId: 1, clientX: x + dx, clientY: y });
  const send = (name, dx) => canvas.canvas.dispatchEvent(new PointerEvent(name, at(dx)));
  canvas.canvas.setPointerCapture = () => {};
  send("pointerdown", 0);
  const times = [];
  for (let step = 1; step <= 40; step += 1) {
    send("pointermove", 3 * step);
    times.push(await new Promise(requestAnimationFrame));
  }
  send("pointerup", 120);
  return times.slice(1).map((each, at) => each - times[at]).sort((a, b) => a - b);
}"""
"""Drags from a place of the window, and returns the times between frames, ms, shortest first."""

SLOWEST_FRAME = 100.0
"""Median of the frames of a drag, ms, also while other tests run; measured alone: docs/panel.md."""


async def test_2500_points_are_dragged_smoothly(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    side = 50
    points = [
        {"name": f"{x}/{y}", "xMm": 2000 * x, "yMm": 2000 * y} for x in range(side) for y in range(side)
    ]
    ways = [
        (f"{x}/{y}", f"{x + dx}/{y + dy}")
        for x in range(side)
        for y in range(side)
        for dx, dy in ((1, 0), (0, 1))
        if x + dx < side and y + dy < side
    ]
    paths = [
        {"name": f"{a} --- {b}", "source": a, "destination": b, "lengthMm": 2000}
        for pair in ways
        for a, b in (pair, pair[::-1])
    ]
    body = {"version": None, "model": {"name": "large", "points": points, "paths": paths}}
    async with site(broker, interface_name, tmp_path) as made:
        assert (await made.orders.put("/v1/plantDrafts/large", json=body)).status_code == 201
        async with drawing(browser, made, "large") as page:
            for what, place in (("point", (50.0, 50.0)), ("view", (51.0, 51.0))):
                times = await page.evaluate(DRAG, await at(page, *place))
                median = times[len(times) // 2]
                sys.stdout.write(f"drag of a {what}: median {median:.1f} ms, longest {times[-1]:.1f} ms\n")
                assert median < SLOWEST_FRAME
            moved = next(each for each in (await drawn(page))["points"] if each["name"] == "25/25")
            assert moved["xMm"] > 50_000
            await expect(page.locator(SAVED)).to_be_visible()
            stored = (await made.draft("large"))["model"]["points"]
            assert next(each for each in stored if each["name"] == "25/25")["xMm"] == moved["xMm"]


CHANGED = """async (model) => {
  const m = await import("/plant/model.js");
  const history = new m.History(model);
  const steps = [
    (now) => m.connect(now, "A", "C", true),
    (now) => m.move(now, new Set(["C"]), 0, 1000),
    (now) => m.split(now, ["A --- B"], { name: "M", xMm: 1000, yMm: 0 }),
    (now) => m.rename(now, "points", "A", "Z"),
    (now) => m.rename(now, "locationTypes", "T", "Table"),
    (now) => m.distribute(now, new Set(["Z", "M", "C", "L"]), "xMm"),
    (now) => m.remove(now, ["C"]),
  ];
  const made = steps.map((step) => (history.push(step(history.present)), history.present));
  while (history.undo());
  const first = history.present;
  while (history.redo());
  return { made, first, last: history.present, same: history.push(history.present) };
}"""


async def test_changes_keep_what_refers_to_an_object_and_are_undone(hall: Hall, browser: Browser) -> None:
    use = {"vehicleTypeId": "small", "trajectory": {"knotVector": [], "controlPoints": []}}
    door = {"location": "L", "name": "open", "executionTrigger": "AFTER_MOVEMENT"}
    path = {"name": "A --- B", "source": "A", "destination": "B", "lengthMm": 4000, "locked": True}
    model = {
        "name": "small",
        "points": [
            {"name": "A", "xMm": 0, "yMm": 0},
            {"name": "B", "xMm": 2000, "yMm": 0},
            {"name": "C", "xMm": 0, "yMm": 2000},
        ],
        "paths": [{**path, "vehicleTypes": [use], "peripheralOperations": [door]}],
        "locationTypes": [{"name": "T"}],
        "locations": [{"name": "L", "type": "T", "xMm": 5000, "links": [{"point": "C"}]}],
        "blocks": [{"name": "K", "members": ["A", "A --- B"]}, {"name": "empty", "members": []}],
    }
    async with hall.connected(), opened(browser, hall.url) as page:
        done = await page.evaluate(CHANGED, model)
    assert (done["first"], done["last"], done["same"]) == (model, done["made"][-1], False)
    connected, moved, split, renamed, typed, spread, removed = done["made"]
    assert [each["name"] for each in connected["paths"]] == ["A --- B", "A --- C", "C --- A"]
    assert [each["lengthMm"] for each in moved["paths"]] == [4000, 3000, 3000]
    parts = split["paths"][:2]
    assert [(each["name"], each["lengthMm"], each["locked"]) for each in parts] == [
        ("A --- M", 2000, True),
        ("M --- B", 2000, True),
    ], "a length that was set by hand keeps its ratio"
    assert [each["vehicleTypes"] for each in parts] == [[{"vehicleTypeId": "small"}]] * 2
    assert [each["peripheralOperations"] for each in parts] == [[], [door]]
    assert split["blocks"][0]["members"] == ["A", "A --- M", "M", "M --- B"]
    assert renamed["blocks"][0]["members"] == ["Z", "Z --- M", "M", "M --- B"]
    assert {(each["source"], each["destination"]) for each in renamed["paths"]} == {
        ("Z", "M"),
        ("M", "B"),
        ("Z", "C"),
        ("C", "Z"),
    }
    assert (typed["locationTypes"][0]["name"], typed["locations"][0]["type"]) == ("Table", "Table")
    places = {each["name"]: each["xMm"] for each in (*spread["points"], *spread["locations"])}
    assert places == {"Z": 0, "B": 2000, "C": 1667, "M": 3333, "L": 5000}
    assert removed["locations"][0]["links"] == []
    assert [each["name"] for each in removed["paths"]] == ["Z --- M", "M --- B"]
    assert [each["name"] for each in removed["blocks"]] == ["K", "empty"]


async def test_from_a_map_to_ten_orders_without_a_file_edited_by_hand(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    """Follow docs/from-a-map.md."""
    drawn_map, plant = write_map(tmp_path, warehouse()), tmp_path / "hall.json"
    robots = [part for number in (1, 2, 3) for part in ("--robot", f"NeNa/amr-{number}")]
    size = ("--robot-width", "0.6", "--robot-length", "0.8")
    command = [sys.executable, "-m", "nena_cli", "plant", "new", "--map", str(drawn_map), "-o", str(plant)]
    done = await asyncio.to_thread(
        subprocess.run, [*command, *size, *robots], capture_output=True, text=True, check=True
    )
    found = re.findall(r"^Parking \d+: x (\S+) m, y (\S+) m", done.stdout + done.stderr, re.MULTILINE)
    starts = [(float(x), float(y)) for x, y in found]
    async with site(broker, interface_name, tmp_path, "--plant", plant, robots=tuple(starts[:3])) as made:
        async with drawing(browser, made, "stations", "active") as page:
            model = await drawn(page)
            taken = {each["name"] for each in model["points"] if each.get("type") == "PARK_POSITION"}
            free = [each for each in model["points"] if each["name"] not in taken]
            for stand in (free[0], free[-1]):
                x, y = stand["xMm"] / 1000, stand["yMm"] / 1000
                await tool(page, "Location")
                await page.mouse.click(*await at(page, x, y + 1.0))
                await tool(page, "One-way path")
                [location] = (await drawn(page))["locations"][-1:]
                place = (location["xMm"] / 1000, location["yMm"] / 1000)
                await drag(page, place, (x, y))
            stations = (await drawn(page))["locations"]
            assert [each["links"] for each in stations] == [
                [{"point": free[0]["name"]}],
                [{"point": free[-1]["name"]}],
            ]
            await page.get_by_role("button", name="Activate …").click()
            await page.get_by_role("button", name="Activate now").click()
            await expect(page.get_by_text("is active, with")).to_be_visible()
            await picture(page, "plant-from-a-map")
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{made.port}", timeout=PATIENCE) as orders:
            for number in range(10):
                ends = ((0, "Load cargo"), (1, "Unload cargo"))
                stops = [{"locationName": stations[at_]["name"], "operation": what} for at_, what in ends]
                order = {"name": f"order-{number}", "destinations": stops}
                assert (await orders.post("/v1/transportOrders", json=order)).status_code == 201

            async def ended() -> list[str]:
                answer = (await orders.get("/v1/transportOrders?state=FINISHED")).json()
                return [
                    each["name"] for each in answer["transportOrders"] if each["name"].startswith("order-")
                ]

            await awaited(ended, lambda names: len(names) == 10, what="ten finished orders")


PIXEL = """([x, y]) => {
  const { canvas, view } = document.querySelector("nena-draft-canvas");
  const [px, py] = view.toScreen(x, y).map((each) => Math.round(each * devicePixelRatio));
  return [...canvas.getContext("2d").getImageData(px, py, 1, 1).data].join();
}"""


async def test_blocks_and_robots_are_made_changed_and_removed(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "blocks", "active") as page,
    ):
        model = await drawn(page)
        blocks = page.get_by_role("region", name="Blocks")
        make = blocks.get_by_role("button", name="Make a block of what is selected")
        await expect(make).to_be_disabled()
        row = sorted((each for each in model["points"] if each["yMm"] == 2000), key=lambda each: each["xMm"])
        left, right = row[0]["xMm"] / 1000, row[1]["xMm"] / 1000
        beside = [left * 0.7 + right * 0.3, 2.12]
        before = await page.evaluate(PIXEL, beside)
        await drag_area(page, (left - 0.5, 1.5), (right + 0.5, 2.5))
        await page.locator(CANVAS).press("b")
        block = (await drawn(page))["blocks"][-1]
        ends = {row[0]["name"], row[1]["name"]}
        between = {each["name"] for each in model["paths"] if {each["source"], each["destination"]} == ends}
        assert between
        assert set(block["members"]) == ends | between, "with the paths between the selected points"
        await becomes(page, PIXEL, beside, lambda colour: colour != before)
        form = blocks.locator(f"li[data-name='{block['name']}']")
        await form.get_by_label("Rule").select_option(label="several robots, in one direction at a time")
        await form.get_by_label("Name", exact=True).fill("Gate")
        await form.get_by_label("Name", exact=True).press("Enter")
        await expect(page.locator(SAVED)).to_be_visible()
        await page.mouse.click(*await at(page, row[2]["xMm"] / 1000, 2.0))
        form = blocks.locator("li[data-name='Gate']")
        await form.get_by_role("button", name="Replace them by what is selected").click()
        gate = (await drawn(page))["blocks"][-1]
        assert (gate["name"], gate["type"]) == ("Gate", "SAME_DIRECTION_ONLY")
        assert gate["members"] == [row[2]["name"]]
        await page.locator(CANVAS).press("Escape")
        for _ in range(2):  # closes its form, and opens it again
            await form.get_by_role("button", name="Gate", exact=True).click()
        await expect(page.get_by_role("region", name="Selected")).to_contain_text(row[2]["name"])
        assert await findings(page) == []
        await picture(page, "plant-block")
        await form.get_by_role("button", name="Remove Gate").click()
        assert (await drawn(page))["blocks"] == model.get("blocks", [])
        robots = page.get_by_role("region", name="Robots of the plant")
        await robots.get_by_role("button", name="Robot-01", exact=True).click()
        await robots.get_by_label("Length in m").fill("1.25")
        await robots.get_by_label("Length in m").press("Enter")
        vehicle = next(each for each in (await drawn(page))["vehicles"] if each["name"] == "Robot-01")
        assert vehicle["boundingBox"]["lengthMm"] == 1250
        await robots.get_by_role("button", name="Add another robot").click()
        for label, value in (("Manufacturer", "ACME"), ("Serial number", "amr-7")):
            await robots.get_by_label(label).fill(value)
            await robots.get_by_label(label).press("Enter")
        properties = (await drawn(page))["vehicles"][-1]["properties"]
        assert properties == {"vda5050:manufacturer": "ACME", "vda5050:serialNumber": "amr-7"}
        await expect(page.locator(SAVED)).to_be_visible()


BUILT = """async (model) => {
  const b = await import("/plant/building.js");
  const { find } = await import("/plant/model.js");
  const kind = { type: "T", prefix: "S" };
  const row = b.stationRow(model, b.placesAlong([1000, 1500], [3000, 1500], 1000), kind, 2000);
  const far = b.stationRow(model, [[0, 9000]], kind, 2000);
  const beside = b.placesBeside(model, find(model, "A --- B").thing, 3, 1000, 500);
  const split = row.points.at(-2).name;
  const whole = b.join(row, [split]);
  const merged = b.join(row, ["A", split]);
  const oneWay = b.turn(model, ["A --- B", "B --- A"]);
  const other = b.turn(oneWay, ["B --- A"]);
  return { row, far, beside, split, whole, merged, kept: b.join(model, ["A"]) === model, oneWay, other };
}"""


async def test_rows_of_stations_joins_and_directions_change_the_model(hall: Hall, browser: Browser) -> None:
    way = {"lengthMm": 8000, "maxVelocityMmS": 700}
    model = {
        "name": "small",
        "points": [{"name": "A", "xMm": 0, "yMm": 0}, {"name": "B", "xMm": 4000, "yMm": 0}],
        "paths": [
            {"name": "A --- B", "source": "A", "destination": "B", **way},
            {"name": "B --- A", "source": "B", "destination": "A", **way, "locked": True},
        ],
        "locationTypes": [{"name": "T"}],
        "blocks": [{"name": "K", "members": ["A --- B"]}],
    }
    async with hall.connected(), opened(browser, hall.url) as page:
        done = await page.evaluate(BUILT, model)
    row = done["row"]
    assert [(each["name"], each["xMm"], each["yMm"]) for each in row["locations"]] == [
        ("S1", 1000, 1500),
        ("S2", 2000, 1500),
        ("S3", 3000, 1500),
    ]
    served = {each["name"]: each["links"][0]["point"] for each in row["locations"]}
    places = {each["name"]: (each["xMm"], each["yMm"]) for each in row["points"]}
    assert [places[served[name]] for name in ("S1", "S2", "S3")] == [(1000, 0), (2000, 0), (3000, 0)]
    assert [each["lengthMm"] for each in row["paths"]] == [2000] * 8, (
        "both ways, in the ratio of their lengths"
    )
    assert "links" not in done["far"]["locations"][0]
    assert done["beside"] == [[1000, 500], [2000, 500], [3000, 500]]
    assert (len(done["whole"]["points"]), len(done["whole"]["paths"])) == (4, 6)
    made = [each for each in done["whole"]["paths"] if each["lengthMm"] == 4000]
    assert [(each["maxVelocityMmS"], each["locked"]) for each in made] == [(700, False), (700, True)]
    assert made[0]["name"] in done["whole"]["blocks"][0]["members"]
    members = {each["name"] for each in (*done["whole"]["points"], *done["whole"]["paths"])}
    assert set(done["whole"]["blocks"][0]["members"]) <= members
    assert done["split"] not in {each["name"] for each in done["merged"]["points"]}
    assert len(done["merged"]["paths"]) == 6
    assert not [each for each in done["merged"]["paths"] if each["source"] == each["destination"]]
    names = {each["name"] for each in (*done["merged"]["points"], *done["merged"]["paths"])}
    assert set(done["merged"]["blocks"][0]["members"]) <= names
    assert done["kept"], "a dead end has nothing to join"
    assert [each["name"] for each in done["oneWay"]["paths"]] == ["B --- A"]
    [back] = [each for each in done["other"]["paths"] if each["name"] == "A --- B"]
    assert (back["lengthMm"], back["maxVelocityMmS"], back["locked"]) == (8000, 700, True)


async def test_a_drag_makes_a_row_of_stations_and_keys_join_and_turn(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "row", "active") as page,
    ):
        model = await drawn(page)
        row = sorted((each for each in model["points"] if each["yMm"] == 2000), key=lambda each: each["xMm"])
        left = next(a["xMm"] / 1000 for a, b in itertools.pairwise(row) if b["xMm"] - a["xMm"] >= 4000)
        await tool(page, "Row of stations")
        await page.get_by_label("Distance between them in m").fill("1")
        await page.get_by_label("Distance between them in m").press("Enter")
        await drag(page, (left + 1, 3.5), (left + 3, 3.5))
        after = await drawn(page)
        stations = after["locations"][len(model.get("locations", [])) :]
        assert [each["xMm"] / 1000 for each in stations] == [left + 1, left + 2, left + 3]
        assert {each["yMm"] for each in stations} == {3500}
        points = {each["name"]: each for each in after["points"]}
        served = [points[each["links"][0]["point"]] for each in stations]
        assert [(each["xMm"] / 1000, each["yMm"]) for each in served] == [
            (left + at, 2000) for at in (1, 2, 3)
        ]
        await picture(page, "plant-row")
        # the point of the second station is joined away, and the path there turned twice
        await tool(page, "Select")
        await page.mouse.click(*await at(page, left + 2, 2))
        await expect(page.get_by_role("button", name="Join", exact=True)).to_be_enabled()
        await page.locator(CANVAS).press("j")
        ends = {served[0]["name"], served[2]["name"]}

        async def ways() -> list[str]:
            paths = (await drawn(page))["paths"]
            return [each["source"] for each in paths if {each["source"], each["destination"]} == ends]

        before = await ways()
        assert len(before) >= 1
        await page.mouse.click(*await at(page, left + 2, 2))
        await page.locator(CANVAS).press("w")
        assert len(await ways()) == 3 - len(before)
        await page.locator(CANVAS).press("w")
        assert len(await ways()) == len(before)
        assert await ways() != before
        # by keys: a point in the middle of the path, and a location beside it
        count = len((await drawn(page))["locations"])
        await page.locator(CANVAS).press("p")
        await page.locator(CANVAS).press("l")
        [added] = (await drawn(page))["locations"][count:]
        assert (added["xMm"] / 1000, added["yMm"]) == (left + 2, 3000)
        assert added["links"] == [{"point": (await drawn(page))["points"][-1]["name"]}]
        await page.locator(CANVAS).press("Control+z")
        await page.locator(CANVAS).press("Control+z")
        await page.mouse.click(*await at(page, left + 1.5, 2))
        # beside the selected path by its form
        await page.get_by_label("How many").fill("2")
        await page.get_by_label("m to the left").fill("-1")
        await page.get_by_role("button", name="Add the row").click()
        assert len((await drawn(page))["locations"]) == len(after["locations"]) + 2
        await expect(page.locator(SAVED)).to_be_visible()
        assert await findings(page) == []


CURVED = """async (model) => {
  const c = await import("/plant/curves.js");
  const m = await import("/plant/model.js");
  const { withWayBack } = await import("/plant/building.js");
  const points = new Map(model.points.map((each) => [each.name, each]));
  const curve = (path) => c.reshaped(path, points, c.straightCurve(path, points));
  const curved = m.change(model, "paths", ["A --- B"], curve);
  const both = withWayBack(curved, ["A --- B"]);
  const ways = ["A --- B", "B --- A"];
  const bent = c.bend(c.bend(both, ways, 0, [0, 3000]), ways, 1, [6000, 3000]);
  const moved = m.move(bent, new Set(["B"]), 1000, 500);
  const split = m.split(bent, ["A --- B"], { name: "M", xMm: 3000, yMm: 2250 });
  const straight = m.change(bent, "paths", ["A --- B"], (path) => c.reshaped(path, points, []));
  return JSON.stringify({ curved, both, bent, moved, split, straight });
}"""


async def test_curves_keep_their_shape_length_and_trajectories(hall: Hall, browser: Browser) -> None:
    uses = [{"vehicleTypeId": "small", "trajectory": {"knotVector": [], "controlPoints": []}}]
    path = {"name": "A --- B", "source": "A", "destination": "B", "lengthMm": 6000, "vehicleTypes": uses}
    points = [{"name": "A", "xMm": 0, "yMm": 0}, {"name": "B", "xMm": 6000, "yMm": 0}]
    door = {"location": "L", "name": "open"}
    model = {
        "name": "small",
        "points": points,
        "paths": [{**path, "peripheralOperations": [door]}],
        "locationTypes": [{"name": "T"}],
        "locations": [{"name": "L", "type": "T"}],
        "blocks": [{"name": "K", "members": ["A --- B"]}],
    }
    async with hall.connected(), opened(browser, hall.url) as page:
        done = json.loads(await page.evaluate(CURVED, model))
    models = {name: PlantModel.model_validate(made) for name, made in done.items()}
    there, back = models["both"].paths
    assert [(each.x_mm, each.y_mm) for each in there.layout.control_points] == [(2000, 0), (4000, 0)]
    assert (there.length_mm, back.length_mm) == (6000, 6000)
    assert back.peripheral_operations == there.peripheral_operations != ()
    assert models["both"].blocks[0].members == ("A --- B", "B --- A")
    there, back = models["bent"].paths
    assert [(each.x_mm, each.y_mm) for each in there.layout.control_points] == [(0, 3000), (6000, 3000)]
    assert [(each.x_mm, each.y_mm) for each in back.layout.control_points] == [(6000, 3000), (0, 3000)]
    trajectory = there.vehicle_types[0].trajectory
    assert trajectory
    assert is_cubic_bezier(trajectory)
    assert there.length_m == pytest.approx(length(trajectory), rel=0.01)
    assert back.length_mm == there.length_mm
    moved = models["moved"].paths[0]
    assert [(each.x_mm, each.y_mm) for each in moved.layout.control_points] == [(0, 3000), (7000, 3500)]
    ends = moved.vehicle_types[0].trajectory
    assert ends
    assert (ends.control_points[-1].x, ends.control_points[-1].y) == (7.0, 0.5)
    first, second = models["split"].paths[:2]
    assert (first.layout.connection_type, second.layout.connection_type) == ("BEZIER", "BEZIER")
    assert first.length_mm + second.length_mm == pytest.approx(there.length_mm, rel=0.01)
    assert [each.vehicle_types[0].trajectory is None for each in (first, second)] == [False, False]
    straight = models["straight"].paths[0]
    assert (straight.length_mm, straight.layout.control_points) == (6000, ())
    assert straight.vehicle_types[0].trajectory is None


async def test_a_path_is_bent_by_its_handles(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "bent", "active") as page,
    ):
        await tool(page, "Two-way path")
        model = await drawn(page)
        row = sorted((each for each in model["points"] if each["yMm"] == 2000), key=lambda each: each["xMm"])
        left, right = row[1]["xMm"] / 1000, row[2]["xMm"] / 1000
        ends = {row[1]["name"], row[2]["name"]}
        await drag(page, (left, 2), (right, 2))
        await tool(page, "Select")
        await page.mouse.click(*await at(page, (left + right) / 2, 2))
        await page.get_by_label("Curve").check()

        async def paths() -> list[Any]:
            return [
                each for each in (await drawn(page))["paths"] if {each["source"], each["destination"]} == ends
            ]

        one, two = await paths()
        before = one["lengthMm"]
        first = one["layout"]["controlPoints"][0]
        await drag(page, (first["xMm"] / 1000, first["yMm"] / 1000), (left, 5))
        await page.get_by_label("2: x in m").fill(str(right))
        await page.get_by_label("2: x in m").press("Enter")
        await page.get_by_label("2: y in m").fill("5")
        await page.get_by_label("2: y in m").press("Enter")
        one, two = await paths()
        assert one["layout"]["controlPoints"] == [
            {"xMm": left * 1000, "yMm": 5000},
            {"xMm": right * 1000, "yMm": 5000},
        ]
        assert two["layout"]["controlPoints"] == one["layout"]["controlPoints"][::-1]
        assert one["lengthMm"] > before * 1.2
        await picture(page, "plant-curve")
        # it is still one line, at its place: 3/4 of the way from the ends to the control points
        await page.locator(CANVAS).press("Escape")
        await page.mouse.click(*await at(page, (left + right) / 2, 4.25))
        await expect(page.get_by_role("region", name="Selected")).to_contain_text("2 objects")
        # a drag that is given up leaves it as it was
        await page.mouse.move(*await at(page, left, 5))
        await page.mouse.down()
        await page.mouse.move(*await at(page, left - 1, 6))
        await page.keyboard.press("Escape")
        await page.mouse.up()
        assert (await paths())[0] == one
        await expect(page.locator(SAVED)).to_be_visible()
        assert await findings(page) == []


async def test_a_door_is_drawn_on_a_path(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "door", "active") as page,
    ):
        model = await drawn(page)
        row = sorted((each for each in model["points"] if each["yMm"] == 2000), key=lambda each: each["xMm"])
        (left, right), middle = (each["xMm"] / 1000 for each in row[1:3]), row[1]["xMm"] / 1000 + 2
        await page.get_by_label("Kind of new locations").select_option(label="Door")
        await tool(page, "Location")
        await page.mouse.click(*await at(page, middle, 3))
        await expect(page.get_by_label("Operations of all")).to_have_value("open, close")
        [door] = (await drawn(page))["locations"][-1:]
        await tool(page, "One-way path")
        await drag(page, (middle, 3), (left + 2.5, 2))
        ends = {row[1]["name"], row[2]["name"]}

        async def operations() -> list[Any]:
            return [
                each.get("peripheralOperations", [])
                for each in (await drawn(page))["paths"]
                if {each["source"], each["destination"]} == ends
            ]

        first = {"name": "open", "executionTrigger": "AFTER_ALLOCATION", "completionRequired": True}
        last = {"name": "close", "executionTrigger": "AFTER_MOVEMENT", "completionRequired": False}
        expected = [{**each, "location": door["name"]} for each in (first, last)]
        found = await operations()
        assert found
        assert all(each == expected for each in found)
        await tool(page, "Select")
        await page.mouse.click(*await at(page, right - 0.5, 2))
        field = page.get_by_label("Door on the way")
        await expect(field).to_have_value(door["name"])
        await picture(page, "plant-door")
        await field.select_option(label="none")
        assert not any(await operations())
        await field.select_option(door["name"])
        assert all(each == expected for each in await operations())
        await expect(page.locator(SAVED)).to_be_visible()
        await expect(page.locator("li[data-code=LOCATION_WITHOUT_LINK]")).to_have_count(0)
        # the same door over a second, parallel track
        await tool(page, "Point")
        for x in (left, right):
            await page.mouse.click(*await at(page, x, 3.5))
        one, two = (await drawn(page))["points"][-2:]
        await tool(page, "One-way path")
        await drag(page, (left, 3.5), (right, 3.5))
        await drag(page, (middle, 3), (left + 2.5, 3.5))
        ends = {one["name"], two["name"]}
        assert await operations() == [expected]
        ends = {row[1]["name"], row[2]["name"]}
        assert all(each == expected for each in await operations()), "the first track keeps it"
        assert await findings(page) == []
