"""The form for instant actions: generated from the factsheet; values are sent with their types."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import Browser, Route, expect

from nena_shared.fleet_api.reasons import Reason, ReasonCode
from nena_shared.vda5050.factsheet import Factsheet
from nena_shared.vda5050.topics import Topic
from support.broker import free_port
from support.fleet_examples import ROBOT, factsheet, state, vehicle_status
from support.panel import Hall, answered, opened, seconds_now

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

NO_ORDER_SERVICE = ("502",)
BEEP = {
    "actionType": "beep",
    "actionDescription": "makes itself heard",
    "actionScopes": ("INSTANT",),
    "actionParameters": (
        {"key": "times", "valueDataType": "INTEGER"},
        {"key": "loud", "valueDataType": "BOOL", "isOptional": True},
        {"key": "tune", "valueDataType": "OBJECT", "isOptional": True},
        {"key": "name", "valueDataType": "STRING", "isOptional": True},
    ),
    "pauseAllowed": False,
    "cancelAllowed": False,
}
SHUTDOWN = {**BEEP, "actionType": "shutdown", "actionParameters": ()}
AT_NODES_ONLY = {**BEEP, "actionType": "pick", "actionScopes": ("NODE",)}


def sheet() -> Factsheet:
    content = factsheet(at=seconds_now()).model_dump(by_alias=True)
    features = {"optionalParameters": (), "mobileRobotActions": (BEEP, SHUTDOWN, AT_NODES_ONLY)}
    return Factsheet.model_validate({**content, "protocolFeatures": features}, strict=False)


async def test_form_is_generated_from_the_factsheet(hall: Hall, browser: Browser) -> None:
    sent: list[Any] = []

    async def order_service(route: Route, body: Any) -> None:
        sent.append(body)
        done = {"actionId": "1", "actionType": "beep", "status": "FAILED", "reason": "no horn"}
        await route.fulfill(json=done)

    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.send(Topic.FACTSHEET, sheet(), retain=True)
        hall.send(Topic.STATE, state(at=seconds_now()))
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status(ROBOT.serial_number), vehicle, retain=True)
        async with opened(browser, f"{hall.url}#/robots/ACME%2Fr1", expected=NO_ORDER_SERVICE) as page:
            await answered(page, "**/vehicles/Vehicle-1/instantActions", order_service)
            await expect(page.locator(".facts")).to_contain_text("Carrier 100")
            await page.get_by_role("button", name="Instant action …").click()
            form = page.get_by_role("form", name="Instant action")
            await expect(form.get_by_label("Action")).to_have_value("")
            await form.get_by_label("Action").select_option("beep")
            await expect(form.get_by_text("makes itself heard")).to_be_visible()
            assert "pick" not in await form.locator("option").all_inner_texts()
            send = form.get_by_role("button", name="Start action")
            await send.click()  # the one that has to be filled in is empty
            assert sent == []
            await form.get_by_label("times").fill("3")
            await form.get_by_label("loud").select_option("true")
            await form.get_by_label("tune").fill("{broken")
            await form.get_by_label("name").fill("3")
            await send.click()
            assert sent == []
            await form.get_by_label("tune").fill('{"notes": [1, 2]}')
            await send.click()
            await expect(form).to_contain_text("beep failed on Vehicle-1: no horn")
            await expect(form.locator(".result")).to_have_attribute("data-level", "bad")
            await form.get_by_label("Action").select_option("shutdown")
            await send.click()  # not confirmed
            assert len(sent) == 1
            await form.get_by_label("Vehicle-1 must be switched on by hand").check()
            await send.click()
            await expect(form).to_contain_text("shutdown failed on Vehicle-1")
    parameters = {each["key"]: each["value"] for each in sent[0]["parameters"]}
    assert sent[0]["actionType"] == "beep"
    assert parameters == {"times": 3, "loud": True, "tune": {"notes": [1, 2]}, "name": "3"}


async def test_the_reason_of_a_result_is_in_the_language_of_the_panel(hall: Hall, browser: Browser) -> None:
    reason = Reason(ReasonCode.ACTION_UNSEEN, count=6)
    action = {"actionId": "1", "actionType": "stateRequest"}
    answer = {**action, "status": "UNKNOWN", "result": "horn", **sent(reason)}

    async with hall.connected("--order_service.url", f"http://127.0.0.1:{free_port()}"):
        hall.send(Topic.STATE, state(at=seconds_now()))
        vehicle = vehicle_status().model_dump_json(by_alias=True)
        hall.peer.publish(hall.fleet.vehicle_status(ROBOT.serial_number), vehicle, retain=True)
        place = f"{hall.url}#/robots/ACME%2Fr1"
        async with opened(browser, place, language="de-DE", expected=NO_ORDER_SERVICE) as page:
            await page.route("**/vehicles/Vehicle-1/instantActions", lambda route: route.fulfill(json=answer))
            await page.get_by_role("button", name="Sofortaktion …").click()
            form = page.get_by_role("form", name="Sofortaktion")
            await form.get_by_label("Aktion").select_option("stateRequest")
            await form.get_by_role("button", name="Aktion starten").click()
            result = form.get_by_role("status")
            await expect(result).to_contain_text("6-mal gesendet, vom Roboter aber nie gemeldet")
            await expect(result.locator("[lang=en]")).to_have_text("horn")


def sent(reason: Reason) -> dict[str, Any]:
    """Return the fields of a reason as the order service sends them."""
    return {"reason": str(reason), "codedReason": reason.coded.model_dump(mode="json", by_alias=True)}
