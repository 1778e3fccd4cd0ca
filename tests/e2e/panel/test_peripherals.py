"""Peripheral devices in a real browser: the list, the page of one, and the robots that wait for it."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import pytest
from playwright.async_api import Browser, expect

from nena_shared.fleet_api.peripherals import PeripheralJobState, PeripheralJobStatus, PeripheralState
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.topics import PeripheralTopic
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.plant import Location, LocationType
from nena_shared.vda5050.topics import RobotKey, Topic
from support.fleet_examples import (
    START,
    connection,
    peripheral_job,
    peripheral_status,
    position,
    sample_plant,
    state,
    vehicle_status,
)
from support.panel import Hall, findings, opened, picture, seconds_now, visit

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

DOORS = {"Door 1": (12_000, 6000), "Door 2/east": (18_000, 8000), "Lift": (6000, 11_000)}
"""Devices, each with its place, mm."""
DOOR, OTHER, LIFT = DOORS


def robot(hall: Hall, number: int, x: float, wait: TrafficWait) -> None:
    """Publish a robot that waits, and its vehicle and order."""
    key, name = RobotKey("ACME", f"r{number}"), f"AMR-0{number}"
    hall.send(Topic.CONNECTION, connection(robot=key), robot=key, retain=True)
    here = position(x, 7)
    shown = state(robot=key, at=seconds_now(), mobile_robot_position=here, last_node_id="Middle 2")
    hall.send(Topic.STATE, shown, robot=key)
    status = vehicle_status(name, robot=key, transport_order=f"T-{number}", wait=wait)
    body = status.model_dump_json(by_alias=True)
    hall.peer.publish(hall.fleet.vehicle_status(key.serial_number), body, retain=True)
    hall.publish_order(
        1, TransportOrderState.BEING_PROCESSED, f"T-{number}", processing_vehicle=name, reason=wait.reason
    )


def job(number: int, *described: Any, **fields: Any) -> PeripheralJobStatus:
    """Return a job for AMR-0``number`` that was requested some seconds ago."""
    requested = datetime.now(UTC) - timedelta(seconds=20)
    whose = {"related_vehicle": f"AMR-0{number}", "related_transport_order": f"T-{number}"}
    return peripheral_job(*described, **{"created": requested, **whose, **fields})


def devices(hall: Hall) -> None:
    """Publish a plant with devices, and their statuses; all of it is retained."""
    plant = sample_plant()
    places = [Location(name=name, x_mm=x, y_mm=y, type="Doors") for name, (x, y) in DOORS.items()]
    kinds = (*plant.location_types, LocationType(name="Doors"))
    plant = plant.model_copy(update={"locations": (*plant.locations, *places), "location_types": kinds})
    hall.peer.publish(hall.fleet.plant_model, plant.to_json(), retain=True)
    opens = job(1, reason="waits for the device to finish 'open'")
    ended = datetime.now(UTC) - timedelta(seconds=5)
    failed = job(3, "open", PeripheralJobState.FAILED, reason="light curtain interrupted", finished=ended)
    waits = job(
        4,
        "raise",
        PeripheralJobState.TO_BE_PROCESSED,
        reason="waits for the device to execute 'raise'; it reports unavailable",
    )
    shown = (
        peripheral_status(DOOR, PeripheralState.EXECUTING, opens, used_by=("AMR-01",)),
        peripheral_status(OTHER, PeripheralState.IDLE, failed),
        peripheral_status(LIFT, PeripheralState.UNAVAILABLE, waits, operations=("raise", "lower")),
    )
    for each in shown:
        hall.publish_peripheral(each)


def robots(hall: Hall) -> None:
    """Publish two robots that wait for the first door."""
    reason = "it waits for peripheral 'Door 1' to finish 'open'"
    robot(hall, 1, 9, TrafficWait(at="Door 1", reason=reason))
    behind = TrafficWait(
        at="Door 1", vehicles=("AMR-01",), cause=WaitCause.PASSES, reason="it waits for AMR-01"
    )
    robot(hall, 2, 6, behind)


async def test_devices_are_listed_with_their_jobs(hall: Hall, browser: Browser) -> None:
    devices(hall)
    address = f"{hall.url}#/?tab=peripherals"
    async with hall.connected(), opened(browser, address, width=1600, height=1000) as page:
        robots(hall)
        tab = page.get_by_role("tab", name="Devices")
        await expect(tab).to_have_text("Devices (3)")
        await expect(tab).to_have_attribute("aria-selected", "true")
        rows = page.locator("tr[data-peripheral]")
        names = rows.locator("a.name")
        await expect(names).to_have_text(["Lift", "Door 1", "Door 2/east"])  # what needs attention is first
        opening = ("Executing", "open", "In progress, requested", "AMR-01", "T-1", "Also waiting: AMR-02")
        failed = ("Idle", "open failed: light curtain interrupted")
        away = ("Unavailable", "raise", "Waiting, requested", "it reports unavailable", "AMR-04", "T-4")
        for row, words in ((1, opening), (2, failed), (0, away)):
            for text in words:
                await expect(rows.nth(row)).to_contain_text(text)
        assert await findings(page) == []
        await picture(page, "devices")

        await page.get_by_role("columnheader", name="Device").get_by_role("button").click()
        await expect(names).to_have_text(["Door 1", "Door 2/east", "Lift"])
        search = page.locator("nena-search input")
        await search.fill("AMR-02")
        await page.reload()
        await expect(names).to_have_text(["Door 1"])
        await search.fill("Lift")
        await page.get_by_role("tab", name="Robots").click()
        await search.fill("curtain")
        await expect(page.locator("nena-robot-table")).to_contain_text("No match")
        await search.fill("Lift")
        await expect(names).to_have_text(["Lift"])  # only the devices have a match
        await page.goto(hall.url)
        await expect(tab).to_have_text("Devices (3)")  # not before there are devices
        await page.get_by_role("tab", name="Robots").press("ArrowRight")
        await page.keyboard.press("ArrowRight")
        await expect(tab).to_be_focused()
        await expect(page.locator("#peripherals")).to_be_visible()


async def test_a_robot_links_to_the_device_that_it_waits_for(hall: Hall, browser: Browser) -> None:
    devices(hall)
    async with hall.connected(), opened(browser, hall.url) as page:
        robots(hall)
        waiting = page.locator("tr[data-robot='ACME/r1']")
        await expect(waiting).to_contain_text("Waits for the device Door 1.")
        await waiting.get_by_role("link", name="Door 1: Executing").click()
        device = page.locator("nena-peripheral-details")
        await expect(device).to_contain_text("In use by AMR-01")
        await expect(page.get_by_role("heading", name="Connected to")).to_be_hidden()  # no robot stops at it
        jobs = device.locator("li")
        await expect(jobs).to_contain_text("open \u2013 In progress")
        assert await findings(page) == []
        done = job(1, "open", PeripheralJobState.FINISHED)
        hall.publish_peripheral(peripheral_status(DOOR, PeripheralState.IDLE, done))
        await expect(jobs).to_contain_text("open \u2013 Finished")
        await jobs.get_by_role("link", name="AMR-01").click()
        causes = page.locator("nena-robot-page .causes")
        await expect(causes.get_by_role("link", name="Door 1: Idle")).to_be_visible()


async def test_devices_of_a_stopped_order_service_are_greyed_and_hidden_once_cleared(
    hall: Hall, browser: Browser
) -> None:
    devices(hall)
    async with hall.connected(), opened(browser, f"{hall.url}#/?tab=peripherals") as page:
        row = page.locator("tr[data-peripheral='Lift']")
        await expect(row.locator(".chip")).to_have_css("font-style", "normal")
        dead = ServiceStatus(online=False, timestamp=START, store_ready=False)
        hall.peer.publish(hall.fleet.service_status, dead.model_dump_json(by_alias=True), retain=True)
        for part in (".chip", ".reason:visible", ".owners"):
            await expect(row.locator(part)).to_have_css("font-style", "italic")
        assert await findings(page) == []
        tab = page.get_by_role("tab", name="Devices")
        await page.get_by_role("tab", name="Robots").click()
        await expect(tab).to_be_visible()
        for name in DOORS:
            topic = hall.fleet.peripheral(name, PeripheralTopic.STATUS)
            hall.peer.publish(topic, b"", retain=True)
        await expect(tab).to_be_hidden()
        await visit(page, f"{hall.url}#/?tab=peripherals")
        await expect(page.locator("nena-peripheral-table")).to_contain_text(
            "switch them on in the order service"
        )
