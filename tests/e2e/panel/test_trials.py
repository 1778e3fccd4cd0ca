"""Programs on a draft in a real browser: an uploaded map, a proposal, clearance, alignment, a simulation."""

from __future__ import annotations

import json
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
from playwright.async_api import Browser, expect

from e2e.panel.test_plant import CANVAS, MODEL, SAVED, at, drag, drawing, drawn, site, tool
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.vda5050.topics import RobotKey
from support.broker import Broker
from support.drawn_maps import block, hall, write_map
from support.panel import becomes, findings, picture
from support.panel_texts import Texts
from support.robot_maps import robot_map

pytestmark = [pytest.mark.e2e, pytest.mark.broker]

PROGRAM = 300_000
"""Time for a program, ms: a few seconds on a free machine."""
GRIDS = "() => document.querySelector('nena-draft-canvas').grids.map(({ grid }) => grid.name)"
BEGUN = "async (draft) => (await (await fetch(`api/v1/control/plantDrafts/${draft}/run`)).json()).program"
WAITING = "() => document.querySelector('nena-draft-canvas').waiting?.size ?? 0"


async def test_a_plant_is_proposed_from_an_uploaded_map_checked_aligned_and_simulated(  # noqa: PLR0915 - one way through
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    image = hall(10, 7)
    block(image, 5, 4, 2, 1)
    yaml = write_map(tmp_path, image, name="shed")
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "shed", "empty") as page,
    ):
        region = page.get_by_role("region", name="Map", exact=True)
        await region.get_by_label("The YAML file").set_input_files([yaml])
        await region.get_by_role("button", name="Use this map").click()
        await expect(region).to_contain_text("Refused")
        await region.get_by_label("The YAML file").set_input_files([yaml, tmp_path / "shed.pgm"])
        await region.get_by_role("button", name="Use this map").click()
        await expect(region).to_contain_text("The map shed lies under the plan.", timeout=PROGRAM)
        await becomes(page, GRIDS, None, ["shed"].__eq__)
        await region.get_by_label("Distance between points in m").fill("2")
        await region.get_by_role("button", name="Propose a plant").click()
        await expect(region).to_contain_text("The proposal has replaced the drawing", timeout=PROGRAM)
        proposed = await drawn(page)
        assert (proposed["name"], len(proposed["points"]) > 5) == ("shed", True)
        assert {each["properties"]["vda5050:mapId"] for each in proposed["points"]} == {"shed"}
        # the clearance of each path, again after each change
        await region.get_by_role("button", name="Check clearance").click()
        await expect(region).to_contain_text("are among the findings", timeout=PROGRAM)
        await expect(page.locator(SAVED)).to_be_visible()
        await tool(page, "Point")
        await page.mouse.click(*await at(page, 6, 4.5))
        [pillar] = {each["name"] for each in (await drawn(page))["points"]} - {
            each["name"] for each in proposed["points"]
        }
        await tool(page, "Two-way path")
        start = min(proposed["points"], key=lambda each: abs(each["xMm"] - 6000) + abs(each["yMm"] - 3000))
        await drag(page, (start["xMm"] / 1000, start["yMm"] / 1000), (6, 4.5))
        too_close = page.locator("li[data-code=PATH_TOO_CLOSE]")
        close = too_close.filter(has_text=pillar)
        await expect(close.first).to_contain_text("touches an obstacle", timeout=PROGRAM)
        assert await findings(page) == []
        await picture(page, "plant-clearance")
        for _ in range(2):
            await page.get_by_role("button", name="Undo").click()
        # two pairs of places that lie 1 m beside each other
        await region.get_by_role("button", name="Align plan and map").click()
        for place in ((2.1, 1.6), (3.1, 1.6), (8.2, 5.3), (9.2, 5.3)):
            await page.mouse.click(*await at(page, *place))
        await expect(region).to_contain_text("differ by 0.00 m")
        before, after = (
            {each["name"]: each for each in model["points"]} for model in (proposed, await drawn(page))
        )
        moved = {abs(after[name]["xMm"] - before[name]["xMm"] - 1000) for name in before}
        assert max(moved) <= 30, "to a pixel"
        await page.get_by_role("button", name="Undo").click()
        await becomes(page, MODEL, None, lambda model: model["points"] == proposed["points"])
        await page.locator(CANVAS).press("Escape")
        # an edit while it is simulated: its clearance is checked afterwards
        trial = page.get_by_role("form", name="Simulate")
        await trial.get_by_label("Numbers of robots").fill("1, 4")
        await trial.get_by_label("Simulated hours").fill("0.1")
        ends = ",".join(each["name"] for each in proposed["points"][:2])
        orders = tmp_path / "orders.csv"
        orders.write_text(f"from,to,per_hour\n{ends},900\n")
        await trial.get_by_label("Orders").set_input_files([orders])
        await trial.get_by_role("button", name="Simulate").click()
        await becomes(page, BEGUN, "shed", "SIMULATE".__eq__)
        await page.get_by_role("button", name="Redo").click()
        await expect(trial).to_contain_text("Done.", timeout=PROGRAM)
        shown = page.get_by_role("region", name="Simulate")
        older = "Of an older state of the draft."
        await expect(shown).to_contain_text(older)
        await expect(too_close.first).to_be_visible(timeout=PROGRAM)
        await expect(region).not_to_contain_text(older)
        # the same draft after a reload: with its map and the last result of each program
        await page.reload()
        await expect(shown.get_by_role("row")).to_have_count(3)
        await expect(shown).to_contain_text(older)
        await expect(too_close.first).to_be_visible()
        await expect(region).to_contain_text("new.json written")
        await expect(region).not_to_contain_text(older)
        await becomes(page, GRIDS, None, ["shed"].__eq__)
        await shown.get_by_role("button", name="Show where 4 robots wait").click()
        await becomes(page, WAITING, None, bool)
        await shown.scroll_into_view_if_needed()
        assert await findings(page) == []
        await picture(page, "plant-simulated")


REASONS = files("nena_shared.fleet_api") / "texts"


async def test_a_plant_is_proposed_from_the_live_map_of_a_robot_which_a_copy_keeps(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser
) -> None:
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "live", "empty") as page,
    ):
        region = page.get_by_role("region", name="Map", exact=True)
        source = region.get_by_label("Source of the map")
        assert await source.locator("option").all_inner_texts() == ["files"]
        seen = robot_map(
            map_id="yard", x=-4.0, y=2.0, theta=0.5, resolution=0.05, width=240, height=140, unknown=60
        )
        topic = FleetTopics(made.fleet.prefix).robot_map(RobotKey("NeNa", "robot-01"))
        made.fleet.peer().publish(topic, seen.model_dump_json(by_alias=True), retain=True)
        await source.select_option(label="robot Robot-01")
        await expect(region.get_by_label("The YAML file")).to_be_hidden()
        await region.get_by_role("button", name="Use this map").click()
        await expect(region).to_contain_text("The map yard lies under the plan.", timeout=PROGRAM)
        await region.get_by_role("button", name="Propose a plant").click()
        await expect(region).to_contain_text("The proposal has replaced the drawing", timeout=PROGRAM)
        points = (await drawn(page))["points"]
        assert {each["properties"]["vda5050:mapId"] for each in points} == {"yard"}
        right, up = np.array([(each["xMm"] / 1000 + 4, each["yMm"] / 1000 - 2) for each in points]).T
        along, away = np.cos(0.5) * right + np.sin(0.5) * up, np.cos(0.5) * up - np.sin(0.5) * right
        assert 0 < along.min() < along.max() < 9, "where the robot has not been is not free"
        assert (0 < away.min() < 2, 5 < away.max() < 7) == (True, True)
        await expect(page.locator(SAVED)).to_be_visible()
        # a reload is the same session, of which nobody needs to hear
        async with page.expect_response(lambda answer: "session=" in answer.url) as looked:
            await page.reload()
        assert (await (await looked.value).json())["editors"] == []
        await expect(page.locator(CANVAS)).to_be_visible()
        # what is kept as another draft has the map, too
        await page.route("**/api/v1/control/plantDrafts/live?*", lambda route: route.abort())
        stored = await made.draft("live")
        body = {"version": stored["version"], "model": {**stored["model"], "name": "theirs"}}
        assert (await made.orders.put("/v1/plantDrafts/live", json=body)).status_code == 200
        await page.locator(CANVAS).focus()
        await page.keyboard.press("p")
        await page.get_by_role("button", name="Save mine as another draft").click()
        await expect(page.get_by_role("heading", name="live, mine")).to_be_visible()
        await becomes(page, GRIDS, None, lambda names: names == ["yard"])
        assert await findings(page) == []
        await picture(page, "plant-live-map")


@pytest.mark.parametrize("language", ["de-DE", "nl-NL"])
async def test_a_plant_is_proposed_checked_and_simulated_in_other_languages(
    broker: Broker, interface_name: str, tmp_path: Path, browser: Browser, language: str
) -> None:
    image = hall(8, 5)
    block(image, 4.5, 3, 0.5, 0.5)
    text, reasons = (
        Texts(language),
        json.loads((REASONS / f"{language[:2]}.json").read_text(encoding="utf-8")),
    )
    async with (
        site(broker, interface_name, tmp_path) as made,
        drawing(browser, made, "hal", "empty", language=language) as page,
    ):
        region = page.get_by_role("region", name=text("plant.map"), exact=True)
        uploaded = [write_map(tmp_path, image, name="hal"), tmp_path / "hal.pgm"]
        await region.get_by_label(text("plant.mapFiles")).set_input_files(uploaded)
        await region.get_by_role("button", name=text("plant.takeMap")).click()
        await expect(region).to_contain_text(text("plant.mapKept", name="hal"), timeout=PROGRAM)
        await region.get_by_role("button", name=text("plant.propose")).click()
        await expect(region).to_contain_text(text("plant.proposed"), timeout=PROGRAM)
        # wider than the one that the plant was proposed for
        await region.get_by_label(text("plant.new.robotWidth")).fill("1.2")
        await region.get_by_role("button", name=text("plant.check")).click()
        await expect(region).to_contain_text(text("plant.checked"), timeout=PROGRAM)
        close = page.locator("li[data-code=PATH_TOO_CLOSE]").first
        await expect(close).to_contain_text(text("plant.warning"))
        # what a robot may not use, and why
        await page.get_by_role("button", name=text("plant.newVehicle")).click()
        path = (await drawn(page))["paths"][0]["name"]
        await page.evaluate("(name) => document.querySelector('nena-draft-canvas').select([name])", path)
        await page.get_by_label(text("plant.locked")).check()
        closed = page.locator("li[data-code=WAY_LOCKED]")
        await expect(closed).to_contain_text(reasons["way_locked"].format(path=path))
        await page.get_by_label(text("plant.locked")).uncheck()
        await expect(closed).to_have_count(0)
        trial = page.get_by_role("form", name=text("plant.simulate"))
        await trial.get_by_label(text("plant.fleetSizes")).fill("2")
        await trial.get_by_label(text("plant.hours")).fill("0.05")
        await trial.get_by_role("button", name=text("plant.simulate")).click()
        await expect(trial).to_contain_text(text("plant.ended"), timeout=PROGRAM)
        shown = page.get_by_role("region", name=text("plant.simulate"))
        await expect(shown.get_by_role("row")).to_have_count(2)
        await expect(shown).to_contain_text("the orders only drive (MOVE)")
        await shown.get_by_role("button", name=text("plant.showHeatOf", robots=2)).click()
        assert await findings(page) == []
        await picture(page, f"plant-trials-{language[:2]}")
