"""Room for robots and map in a real browser: rows in sight, the divider, resizing, any zoom."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import Browser, expect

from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import DriveOrderState, TransportOrderState
from nena_shared.vda5050.topics import RobotKey, Topic
from support.broker import free_port
from support.fleet_examples import connection, drive_order, position, sample_plant, state, vehicle_status
from support.panel import (
    COLOUR_NEAR,
    SIZES,
    Hall,
    becomes,
    findings,
    fits,
    opened,
    picture,
    plan_shown,
    seconds_now,
)

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

ROBOTS = 50
STOPPED: dict[str, Any] = {"safety_state": {"active_emergency_stop": "MANUAL", "field_violation": False}}
IN_SIGHT = """() => {
  const frame = document.querySelector("#lists").getBoundingClientRect();
  const [top, bottom] = [Math.max(0, frame.top), Math.min(innerHeight, frame.bottom)];
  const boxes = [...document.querySelectorAll("tr[data-robot]")].map((row) => row.getBoundingClientRect());
  return boxes.filter((box) => box.top >= top && box.bottom <= bottom).length;
}"""
"""Counts the rows of robots that are wholly in sight."""
CUT_OFF = "document.querySelector('#lists').scrollWidth - document.querySelector('#lists').clientWidth"
"""How much of the table lies beyond the edge of its frame, px."""
OFF_CENTRE = """([x, y]) => {
  const { view } = document.querySelector("nena-fleet-map");
  const [px, py] = view.toScreen(x, y);
  return [px - view.width / 2, py - view.height / 2, view.scale];
}"""
"""How far a position is from the centre of the map, px, and the scale, px/m."""
CORNERS = """() => {
  const { view, canvas } = document.querySelector("nena-fleet-map");
  const places = [[1, 2], [23, 12]].map(([x, y]) => view.toScreen(x, y));
  const [width, height] = [canvas.clientWidth, canvas.clientHeight];
  return view.width === width && places.every(([x, y]) => x > 0 && y > 0 && x < width && y < height);
}"""
"""Whether both corners of the plant are visible on a map of its element's size."""

SIZED = """() => {
  const { view, canvas } = document.querySelector("nena-fleet-map");
  return innerWidth === 1200 && view.width === canvas.clientWidth;
}"""
"""Whether the map has the size of its element in a window 1200 px wide."""


PRESENT = """(button) => {
  button.click();
  return document.querySelector("#map").getAnimations().map((each) => each.id);
}"""
"""Presses a button; returns the animations that it has begun, before they end."""


def publish_robots(hall: Hall) -> None:
    """Publish a robot with an emergency stop, eleven that wait behind it, and idle ones."""
    for number in range(1, ROBOTS + 1):
        key, name = RobotKey("ACME", f"r{number:02}"), f"AMR-{number:02}"
        here = position(3 + number % 8, 3 + number // 8)
        sent = state(
            robot=key, at=seconds_now(), mobile_robot_position=here, **STOPPED if number == 1 else {}
        )
        hall.send(Topic.CONNECTION, connection(robot=key), robot=key, retain=True)
        hall.send(Topic.STATE, sent, robot=key)
        wait = TrafficWait(
            vehicles=("AMR-01",), at="Middle 2", cause=WaitCause.PASSES, reason="it goes first"
        )
        behind = 1 < number <= 12
        status = vehicle_status(
            name, robot=key, transport_order=f"T-{number}" if behind else None, wait=wait if behind else None
        )
        body = status.model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), body, retain=True)


HEADS = {
    "en-GB": "AMR-01 (Emergency stop) is at the head",
    "de-DE": "AMR-01 (Not-Halt) steht ganz vorn",
    "nl-NL": "AMR-01 (Noodstop) staat vooraan",
}
"""What the row of a robot that waits says about the first one of its queue."""

NAME_IN_SIGHT = """(head) => {
  const [range, { firstChild: text }] = [new Range(), head.querySelector("a")];
  range.setStart(text, 0);
  range.setEnd(text, text.data.indexOf(" ("));
  return range.getBoundingClientRect().right + 12 <= head.getBoundingClientRect().right;
}"""
"""Whether the name of the first one is not cut off."""


@pytest.mark.parametrize(
    ("size", "least", "language"),
    [("wide", 20, "de-DE"), ("laptop", 12, "en-GB"), ("laptop", 12, "nl-NL"), ("phone", 6, "en-GB")],
    ids=str,
)
async def test_many_robots_are_in_sight(
    hall: Hall, browser: Browser, size: str, least: int, language: str
) -> None:
    width, height = SIZES[size]
    async with hall.connected("--jam.robots", "3", "--jam.seconds", "0.1"):
        hall.publish_plant()
        publish_robots(hall)
        async with opened(browser, hall.url, width=width, height=height, language=language) as page:
            row = page.locator("tr[data-robot='ACME/r02']")
            await expect(row).to_contain_text(HEADS[language])
            head = await row.locator("span:has(> a[title])").element_handle()
            await becomes(page, NAME_IN_SIGHT, head, bool)
            await expect(row.locator(".reason")).to_contain_text("AMR-01")
            await expect(row.locator(".line").first).to_contain_text(" s")  # how long it has waited
            await becomes(page, IN_SIGHT, None, lambda count: count >= least)
            await picture(page, f"room-{width}")
            await fits(page, width)
            assert await page.evaluate(CUT_OFF) == 0
            assert await findings(page) == []


ORDER_ROWS = """() => [...document.querySelectorAll("tr[data-order]")].map((row) => {
  const chip = row.querySelector(".chip").getBoundingClientRect();
  const cells = [...row.cells].filter((cell) => !cell.hidden);
  const frame = document.querySelector("#lists").getBoundingClientRect();
  const whole = chip.right <= row.cells[1].getBoundingClientRect().right;
  const inside = cells.at(-1).getBoundingClientRect().right <= frame.right + 1;
  const titles = row.closest("table").querySelectorAll("th:not([hidden])");
  const named = [...row.querySelectorAll(".name, .destinations"), ...titles];
  const uncut = named.every((each) => each.scrollWidth <= each.clientWidth);
  const first = [...row.querySelectorAll(".destinations li")].find((each) => each.offsetWidth);
  const begins = getComputedStyle(first, "::before").content === "none";
  return [whole && inside && uncut && begins, row.offsetHeight < 36, cells.length];
}).filter((row) => row[0] !== true || row[1] !== true || row[2] !== 5)"""
"""Orders with something that is cut off or begins with an arrow, that are too high, or that lack columns."""


ORDERS = [*TransportOrderState] * 5
"""The states of more orders than fit in sight: empty rows stand for those above and below."""

HEADER = """() => {
  const chips = [...document.querySelectorAll("nena-fleet-summary button")];
  for (const chip of chips.slice(-7)) chip.hidden = false;
  return chips.length ? document.querySelector(".bar").offsetHeight : 1000;
}"""
"""The height of the header with chips of seven conditions, px: less than 100 are two lines."""


@pytest.mark.parametrize("language", ["en-GB", "de-DE", "nl-NL"])
async def test_the_order_list_has_one_line_per_order_and_all_columns(
    hall: Hall, browser: Browser, language: str
) -> None:
    done, open_ = DriveOrderState.FINISHED, DriveOrderState.TRAVELLING
    stops = (drive_order("Goods in", "Load", done), drive_order("Packing 12", "Unload cargo", open_))
    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.publish_plant()
        for number, order_state in enumerate(ORDERS):
            vehicle = f"Forklift-Nord-{number:02}" if number % 2 else None
            reason = "waits for robot 'Forklift-Nord-07', which works on another order"
            more = {
                "processing_vehicle": vehicle,
                "reason": reason,
                "drive_orders": stops,
                "current_drive_order_index": 1,
            }
            hall.publish_order(1, order_state, f"WMS-2026-11-29-{number:04}", **more)
        async with opened(
            browser, hall.url, width=1280, height=800, language=language, expected=("502",)
        ) as page:
            await becomes(page, HEADER, None, lambda height: height < 100)
            await page.get_by_role("tab").nth(1).click()
            for width in (1280, 1600, 1920, 700):
                await page.set_viewport_size({"width": width, "height": 800})
                await expect(page.get_by_role("tab").nth(1)).to_contain_text(str(len(ORDERS)))
                await expect(page.locator("tr[data-order]").first).to_be_visible()
                await becomes(page, ORDER_ROWS, None, [].__eq__)
                await picture(page, f"orders-{width}-{language[:2]}")
                assert await page.evaluate(CUT_OFF) == 0
            await page.set_viewport_size({"width": 390, "height": 844})
            await fits(page, 390)
            await picture(page, f"orders-390-{language[:2]}")


async def test_the_divider_gives_room_to_the_map_or_the_lists(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        async with opened(browser, hall.url) as page:
            await plan_shown(page)
            await becomes(page, CORNERS, None, bool)
            divider = page.get_by_role("separator", name="Width of the map")
            width = "document.querySelector('#map').offsetWidth"
            before = await page.evaluate(width)
            box = await divider.bounding_box()
            assert box is not None
            await page.mouse.move(box["x"] + 6, box["y"] + 100)
            await page.mouse.down()
            await page.mouse.move(box["x"] + 206, box["y"] + 100)
            await page.mouse.up()
            await becomes(page, width, None, lambda now: abs(now - before - 200) < 12)
            await becomes(page, CORNERS, None, bool)
            await divider.focus()
            for _ in range(20):
                await page.keyboard.press("ArrowLeft")
            await expect(divider).to_have_attribute("aria-valuenow", "20")
            await becomes(page, CORNERS, None, bool)
            await page.reload()
            await expect(divider).to_have_attribute("aria-valuenow", "20")
            await divider.dispatch_event("dblclick")  # on a busy machine, Firefox takes two clicks as two
            await becomes(page, width, None, lambda now: abs(now - before) < 3)


async def test_the_plant_fits_a_window_and_a_full_screen_until_it_is_moved(
    hall: Hall, browser: Browser
) -> None:
    async with hall.connected():
        hall.publish_plant()
        async with opened(browser, hall.url, width=1600, height=1000) as page:
            await plan_shown(page)
            await becomes(page, CORNERS, None, bool)
            await page.set_viewport_size({"width": 950, "height": 600})
            await becomes(page, CORNERS, None, bool)
            small = await page.evaluate("document.querySelector('nena-fleet-map').view.scale")
            await page.set_viewport_size({"width": 1600, "height": 1000})
            await becomes(page, CORNERS, None, bool)
            scale = "document.querySelector('nena-fleet-map').view.scale"
            await becomes(page, scale, None, lambda now: now > small)
            screen = page.get_by_role("button", name="Full screen")
            await screen.click()
            await becomes(page, "document.fullscreenElement?.id ?? ''", None, "map".__eq__)
            await becomes(page, CORNERS, None, bool)
            await page.get_by_role("button", name="Zoom in").click()
            chosen = await page.evaluate(scale)
            await screen.click()  # WebDriver BiDi resizes no window that has the full screen
            await becomes(page, "document.fullscreenElement?.id ?? ''", None, "".__eq__)
            await page.set_viewport_size({"width": 1200, "height": 900})
            await becomes(page, SIZED, None, bool)
            assert await page.evaluate(scale) == chosen


async def test_a_robot_is_shown_near_enough_to_be_found(hall: Hall, browser: Browser) -> None:
    async with hall.connected():
        hall.publish_plant()
        publish_robots(hall)
        async with opened(browser, hall.url) as page:
            await plan_shown(page)
            await page.locator("nena-fleet-map canvas").focus()
            for _ in range(10):
                await page.keyboard.press("-")
            await page.locator("tr[data-robot='ACME/r09']").get_by_role("link", name="AMR-09").click()
            assert await page.get_by_role("button", name="Show on map").evaluate(PRESENT) == ["present"]
            x, y, scale = await page.evaluate(OFF_CENTRE, [4.0, 4.0])
            assert (abs(x) < 1, abs(y) < 1, scale >= 30) == (True, True, True)


async def test_a_locked_path_is_visible_at_any_zoom(hall: Hall, browser: Browser) -> None:
    plant = sample_plant()
    locked, *others = plant.paths
    model = plant.model_copy(update={"paths": (locked.model_copy(update={"locked": True}), *others)})
    ends = [plant.point(name) for name in (locked.source, locked.destination)]
    middle = [sum(end.x_m for end in ends) / 2, sum(end.y_m for end in ends) / 2]
    async with hall.connected():
        hall.peer.publish(hall.fleet.plant_model, model.to_json(), retain=True)
        async with opened(browser, hall.url) as page:
            await expect(page.locator("nena-fleet-map canvas")).to_be_visible()
            await becomes(page, COLOUR_NEAR, [*middle, "bad"], lambda found: found > 30)
            await page.locator("nena-fleet-map canvas").focus()
            for _ in range(20):
                await page.keyboard.press("-")
            await becomes(
                page, "document.querySelector('nena-fleet-map').view.scale", None, lambda scale: scale < 1
            )
            await becomes(page, COLOUR_NEAR, [*middle, "bad"], lambda found: found > 30)
