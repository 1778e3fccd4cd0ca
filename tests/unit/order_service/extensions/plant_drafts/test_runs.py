"""Programs on drafts, in processes of their own: maps, proposals, clearance, simulations."""

from __future__ import annotations

import asyncio
import json
import os
from base64 import b64decode, b64encode
from io import BytesIO
from pathlib import Path
from typing import Any
from unittest.mock import Mock

import pytest
from PIL import Image

from nena_order_service.extensions.plant_drafts import PlantDrafts, runs
from nena_shared.fleet_api.plant_drafts import PlantProgram
from nena_shared.plant import PlantModel
from support.drawn_maps import block, hall, write_map
from unit.order_service.extensions.plant_drafts.test_plant_drafts import LINE, Site, site

__all__ = ["site"]

URL = "/v1/plantDrafts/aisle/run"


def files(folder: Path, **values: Any) -> dict[str, str]:
    """Return a hall of 8 m by 5 m with a pillar, from 0 to 10 m and 0 to 7 m, as uploaded."""
    image = hall(8, 5)
    block(image, 4.5, 3, 0.5, 0.5)
    path = write_map(folder, image, **values)
    encoded = b64encode((folder / "site.pgm").read_bytes()).decode()
    return {"name": "site", "yaml": path.read_text(), "image": encoded}


async def ended(site: Site) -> Any:
    """Return the run once it has ended."""
    extension = site.runner.service.extensions["plant_drafts"]
    assert isinstance(extension, PlantDrafts)
    assert extension.runs._task
    await asyncio.wait((extension.runs._task,))
    return await site.call("GET", URL)


async def done(site: Site, program: str, **fields: Any) -> Any:
    await site.call("POST", URL, program=program, **fields)
    found = await ended(site)
    assert found["state"] == "DONE", found
    return found


async def last(site: Site, program: str) -> Any:
    """Return the last result of a program on the draft."""
    return await site.call("GET", f"{URL}?program={program}")


async def test_a_map_is_kept_with_the_draft_and_becomes_a_plant(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    await site.save(model=LINE)
    assert (await site.call("GET", "/v1/plantDrafts/aisle/map"))["map"] is None
    assert "no map" in (await failed(site, "PROPOSE"))
    # as under deploy/systemd, whose filter of system calls refuses it
    monkeypatch.setattr(os, "setpriority", Mock(side_effect=PermissionError))
    await done(site, "MAP", map=files(tmp_path, origin="[1.0, 2.0, 0.5]"))
    [row] = (await site.call("GET", "/v1/audit?operation=startPlantRun"))["entries"][:1]
    assert json.loads(row["request"])["program"] == "MAP"
    assert "image" not in row["request"], "the audit trail keeps no files"
    kept = (await site.call("GET", "/v1/plantDrafts/aisle/map"))["map"]
    assert [kept[key] for key in ("name", "width", "height", "x", "theta")] == ["site", 200, 140, 1, 0.5]
    picture = Image.open(BytesIO(b64decode(kept["picture"])))
    middle, wall = picture.getpixel((60, 70)), picture.getpixel((95, 65))
    assert (picture.size, middle, wall) == ((200, 140), (0, 1), (0, 255)), "opaque where it is occupied"
    proposed = await done(site, "PROPOSE", robotWidth=0.5, robotLength=0.7)
    model = PlantModel.model_validate(proposed["model"])
    assert {point.map_id for point in model.points} == {"site"}
    assert "new.json written" in proposed["texts"][0]
    await site.save(model=proposed["model"], version=1)
    assert [each["code"] for each in (await done(site, "CHECK", robotWidth=0.5))["findings"]] == []
    await site.save("mine", model=LINE, mapOf="aisle")
    await site.save("mine", model=proposed["model"], version=1, mapOf="other")
    kept_runs = [await last(site, program) for program in ("PROPOSE", "CHECK", "SIMULATE")]
    assert [run["version"] for run in kept_runs] == [1, 2, 0]
    assert kept_runs[0]["model"] == proposed["model"]
    await site.call("DELETE", "/v1/plantDrafts/aisle")
    await site.save(model=LINE, mapOf="gone")
    assert (await last(site, "PROPOSE"))["state"] == "NONE", "gone with its draft"
    assert (await site.call("GET", "/v1/plantDrafts/aisle/map"))["map"] is None, "gone with its draft"
    assert (await site.call("GET", "/v1/plantDrafts/mine/map"))["map"] == kept


async def failed(site: Site, program: str, **fields: Any) -> str:
    await site.call("POST", URL, program=program, **fields)
    found = await ended(site)
    assert found["state"] == "FAILED", found
    return str(found["texts"][0])


async def test_paths_near_obstacles_are_findings(site: Site, tmp_path: Path) -> None:
    across = {"points": [{"name": "A", "xMm": 2000, "yMm": 3750}, {"name": "B", "xMm": 8000, "yMm": 3750}]}
    await site.save(model={**LINE, **across})
    await done(site, "MAP", map=files(tmp_path))
    found = (await done(site, "CHECK", robotWidth=0.6))["findings"]
    [close] = [each for each in found if each["code"] == "PATH_TOO_CLOSE"]
    assert (close["kind"], close["name"], close["isError"]) == ("path", "A --- B", False)
    assert "0.6 m wide touches an obstacle" in close["text"]
    await site.save(model={**LINE, "paths": [{**LINE["paths"][0], "destination": "Z"}]}, version=1)
    assert [each["isError"] for each in (await done(site, "CHECK"))["findings"]] == [True]


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({"image": "/etc/hostname"}, ""),
        ({"resolution": 0}, "resolution 0"),
        ({"mode": "grey"}, "mode 'grey' is unknown"),
    ],
)
async def test_a_map_that_cannot_be_read_is_named(
    site: Site, tmp_path: Path, values: dict[str, Any], reason: str
) -> None:
    await site.save(model=LINE)
    uploaded = files(tmp_path, **values)
    if reason:
        assert reason in await failed(site, "MAP", map=uploaded)
        assert (await site.call("GET", "/v1/plantDrafts/aisle/map"))["map"] is None
    else:
        await done(site, "MAP", map=uploaded)  # the uploaded image, whatever the YAML file names
    text = b64encode(b"no image").decode()
    assert "is no PGM, PNG or BMP" in await failed(
        site, "MAP", map={**uploaded, "image": text, "yaml": "resolution: 1\norigin: [0, 0, 0]"}
    )
    outside = {**uploaded, "name": "../site"}
    await site.call("POST", URL, 422, program="MAP", map=outside)
    await site.call("POST", URL, 422, program="CHECK", map=uploaded)


async def test_a_draft_is_simulated_beside_the_active_plant(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(runs, "NICENESS", 0)
    orders = "from,to,per_hour\nA,B,30\n"
    await site.save("aisle", fromVersion=0)
    both = await done(site, "SIMULATE", robots=[2], hours=0.1)
    assert [each["robots"] for each in both["figures"]] == [2]
    assert both["figures"] == both["activeFigures"], "the same plant, and the same seed"
    assert both["figures"][0]["ordersPerHour"] > 0
    await site.save(model=LINE, version=1)
    alone = await done(site, "SIMULATE", robots=[1], hours=0.05, orders=orders)
    assert (len(alone["figures"]), alone["activeFigures"]) == (1, [])
    assert "the plant has no location 'A', 'B'" in alone["texts"][-1], "why there is nothing beside it"
    assert "the plant has no location 'Z'" in await failed(
        site, "SIMULATE", orders="from,to,per_hour\nA,Z,30\n"
    )
    await site.save("other", model=LINE)
    assert (await site.call("GET", URL.replace("aisle", "other") + "?program=SIMULATE"))["state"] == "NONE"
    await site.call("POST", "/v1/plantDrafts/aisle/activation", version=2)
    assert (await site.call("GET", URL))["state"] == "NONE", "of the service with the new plant"
    assert await last(site, "SIMULATE") == alone, "kept, and not replaced by one that failed"


async def test_one_program_runs_at_a_time_and_ends_when_it_is_cancelled(site: Site) -> None:
    await site.save("aisle", fromVersion=0)
    started = await site.call("POST", URL, program="SIMULATE", hours=8, robots=[3])
    assert (started["state"], started["by"]) == ("RUNNING", "somebody")
    refused = await site.call("POST", URL, 409, program="CHECK")
    assert refused["type"].endswith("plant-run-goes-on")
    assert "SIMULATE runs on the draft 'aisle'" in refused["detail"]
    assert (await site.call("DELETE", URL))["state"] == "CANCELLED"
    assert (await site.call("DELETE", URL))["state"] == "CANCELLED", "nothing runs any more"
    await site.call("DELETE", "/v1/plantDrafts/aisle")
    await site.call("GET", URL, 404)


async def test_time_and_memory_are_limited(
    site: Site, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    await site.save("aisle", fromVersion=0)
    monkeypatch.setitem(runs.SECONDS, PlantProgram.SIMULATE, 0.2)
    assert "ended after 0 s" in await failed(site, "SIMULATE", hours=8)
    monkeypatch.setattr(runs, "MEMORY", 64 * 1024**2)
    assert await failed(site, "MAP", map=files(tmp_path))
    monkeypatch.setitem(runs.NEEDED, PlantProgram.PROPOSE, ("no_such_library",))
    assert "pip install 'nena-order-service[plant-editor]'" in await failed(site, "PROPOSE")
