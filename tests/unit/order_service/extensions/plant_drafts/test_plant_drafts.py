"""Drafts of plant models by REST, over a real SQLite store, with the versions that they become."""

from __future__ import annotations

import json
from collections.abc import AsyncIterator
from dataclasses import dataclass, replace
from typing import Any

import httpx
import pytest

from nena_demo.plants import sample_plant_path
from nena_order_service.extensions.plant_drafts import PlantDrafts, drafts, versions
from nena_order_service.plant_file import PlantFile, load_plant
from nena_order_service.runner import ServiceRunner
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.plant import PlantModel, Point
from nena_shared.tasks import Supervisor
from support.clocks import ManualClock
from support.order_service import request

FILE = load_plant(sample_plant_path())
LINE: dict[str, Any] = {
    "name": "line",
    "points": [{"name": "A", "xMm": 0, "yMm": 0}, {"name": "B", "xMm": 3000, "yMm": 4000}],
    "paths": [
        {
            "name": "A --- B",
            "source": "A",
            "destination": "B",
            "lengthMm": 5000,
            "maxReverseVelocityMmS": 1000,
        }
    ],
}


@dataclass
class Site:
    """An order service that may change its plant, and a client of it."""

    runner: ServiceRunner
    store: Store

    async def call(self, method: str, path: str, status: int = 200, **body: Any) -> Any:
        """Return the answer of the present service, which another plant replaces."""
        transport = httpx.ASGITransport(self.runner.service.app, raise_app_exceptions=False)
        async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
            answer = await client.request(method, path, json=body or None)
        assert answer.status_code == status, answer.text
        return answer.json()

    async def save(self, name: str = "aisle", status: int | None = None, **fields: Any) -> Any:
        wanted = status or (200 if fields.get("version") else 201)
        return await self.call("PUT", f"/v1/plantDrafts/{name}", wanted, **{"version": None, **fields})


@pytest.fixture
async def site(settings: OrderServiceSettings) -> AsyncIterator[Site]:
    large = settings.model_copy(update={"max_body": 1_000_000})
    store = Store(open_database(settings.store.location()))
    async with Supervisor() as supervisor:
        runner = ServiceRunner(
            FILE,
            store,
            supervisor,
            make=lambda model: OrderService(large, model, store, change_plant=runner.change_plant),
            show=lambda _: None,
        )
        await runner.begin()
        yield Site(runner, store)
    store.close()


def codes(answer: dict[str, Any]) -> list[tuple[str, str, bool]]:
    return [(each["code"], each["name"], each["isError"]) for each in answer["findings"]]


async def test_a_draft_is_saved_read_listed_and_deleted(site: Site) -> None:
    made = await site.save(model=LINE)
    assert (made["version"], made["points"], made["paths"], made["by"]) == (1, 2, 1, "somebody")
    shown = await site.call("GET", "/v1/plantDrafts/aisle")
    assert shown["model"] == LINE, "values that are the default are left out"
    assert shown["findings"] == made["findings"]
    longer = {**LINE, "points": [*LINE["points"], {"name": "C", "xMm": 9000, "yMm": 0}]}
    saved = await site.save(model=longer, version=1)
    assert (saved["version"], saved["points"]) == (2, 3)
    assert ("NOT_STRONGLY_CONNECTED", "line", False) in codes(saved)
    listed = (await site.call("GET", "/v1/plantDrafts"))["drafts"]
    assert [(each["name"], each["version"]) for each in listed] == [("aisle", 2)]
    assert (await site.call("DELETE", "/v1/plantDrafts/aisle"))["version"] == 2
    assert (await site.call("GET", "/v1/plantDrafts/aisle", 404))["type"].endswith("unknown-plant-draft")
    assert (await site.save(status=404, model=LINE, version=2))["detail"].startswith("Unknown draft or")


async def test_the_second_of_two_editors_is_told_who_saved_when(site: Site) -> None:
    await site.save(model=LINE)
    await site.save(model=LINE, version=1)
    other = {**LINE, "name": "other"}
    refused = await site.save(status=409, model=other, version=1)
    assert refused["type"].endswith("plant-draft-changed")
    assert refused["detail"].startswith("somebody saved version 2 of the draft 'aisle' at 20")
    assert (await site.save(model=LINE, version=1))["version"] == 2, (
        "the answer was lost, and it is sent again"
    )
    await site.save(status=409, model=LINE)  # a new draft of a name that is taken
    assert (await site.call("GET", "/v1/plantDrafts/aisle"))["version"] == 2


async def test_a_session_hears_of_others_and_only_of_newer_versions(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    clock = ManualClock()
    extension = site.runner.service.extensions["plant_drafts"]
    assert isinstance(extension, PlantDrafts)
    monkeypatch.setattr(extension.drafts, "_core", replace(extension.core, clock=clock))
    await site.save(model=LINE)
    first = await site.call("GET", "/v1/plantDrafts/aisle?session=one")
    assert first["editors"] == []
    second = await site.call("GET", "/v1/plantDrafts/aisle?session=two&known=1")
    assert (second["editors"], second["model"]) == (["somebody"], None)
    clock.advance(drafts.OPEN_FOR + 1)
    assert (await site.call("GET", "/v1/plantDrafts/aisle?session=two"))["editors"] == []


async def test_findings_name_their_objects_and_a_draft_with_errors_is_kept(site: Site) -> None:
    broken = {**LINE, "paths": [{**LINE["paths"][0], "destination": "Z"}]}
    saved = await site.save(model=broken)
    assert codes(saved) == [("UNKNOWN_REFERENCE", "A --- B", True)]
    refused = await site.call("POST", "/v1/plantDrafts/aisle/activation", 422, version=1)
    assert "unknown point 'Z'" in refused["errors"][0]
    assert "unknown point 'Z'" in (await site.call("GET", "/v1/plantDrafts/aisle/file", 422))["errors"][0]
    empty = await site.save("empty")
    assert (empty["points"], codes(empty)[0]) == (0, ("NO_POINTS", "empty", True))
    shapeless = await site.save("bad", 422, model={"name": "x", "points": [{"name": "A"}]})
    assert shapeless["errors"][0].startswith("points.0.xMm")
    two = await site.save("bad", 422, model=LINE, fromVersion=0)
    assert "only one of" in two["errors"][0]


async def test_the_paths_that_a_vehicle_must_not_use_are_told_with_the_reason(site: Site) -> None:
    forklifts = {**LINE["paths"][0], "vehicleTypes": [{"vehicleTypeId": "forklift"}]}
    back = {**LINE["paths"][0], "name": "back", "source": "B", "destination": "A", "locked": True}
    vehicles = [{"name": "R1", "properties": {"nena:vehicleType": "tug"}}, {"name": "R2"}]
    await site.save(model={**LINE, "paths": [forklifts, back], "vehicles": vehicles})
    shown = await site.call("GET", "/v1/plantDrafts/aisle?known=1&vehicle=R1")
    assert shown["model"] is None
    told = {(each["name"], each["code"], each["codedReason"]["code"]) for each in shown["closed"]}
    assert told == {("A --- B", "WAY_OTHER_TYPES", "way_other_types"), ("back", "WAY_LOCKED", "way_locked")}
    assert "not open to robots of type tug" in shown["closed"][0]["text"]
    other = await site.call("GET", "/v1/plantDrafts/aisle?known=1&vehicle=R2")
    assert {each["name"] for each in other["closed"]} == {"back"}
    assert (await site.call("GET", "/v1/plantDrafts/aisle?vehicle=R3"))["closed"] == []
    broken = {**LINE, "paths": [{**forklifts, "destination": "Z"}], "vehicles": vehicles}
    await site.save(model=broken, version=1)
    assert (await site.call("GET", "/v1/plantDrafts/aisle?vehicle=R1"))["closed"] == []


async def test_a_draft_begins_with_a_file_of_any_format_or_the_active_plant(site: Site) -> None:
    active = await site.save("copy", fromVersion=0)
    assert active["points"] == len(FILE.model.points)
    shown = await site.call("GET", "/v1/plantDrafts/copy")
    assert PlantModel.model_validate(shown["model"]) == FILE.model
    for form in ("nena", "opentcs", "lif", "lif2"):
        written = await site.call("GET", f"/v1/plantDrafts/copy/file?format={form}")
        read = await site.save(f"from-{form}", file=written["content"])
        assert (read["points"], read["paths"] > 0) == (active["points"], True), form
        assert bool(written["losses"]) is form.startswith("lif")
    graph = await site.call("GET", "/v1/plantDrafts/copy/file?format=nav2-route")
    assert (graph["fileName"], json.loads(graph["content"])["type"]) == ("copy.geojson", "FeatureCollection")
    refused = await site.save("no", 422, file="not a plant")
    assert refused["errors"]


async def test_activation_obeys_the_rules_of_a_plant_change_and_keeps_a_version(site: Site) -> None:
    await site.save("copy", fromVersion=0)
    model = (await site.call("GET", "/v1/plantDrafts/copy"))["model"]
    gone = {
        **model,
        "points": [each for each in model["points"] if each["name"] != "South 2"],
        "paths": [each for each in model["paths"] if "South 2" not in (each["source"], each["destination"])],
        "locations": [each for each in model["locations"] if "South 2" not in str(each.get("links"))],
        "blocks": [],
    }
    await site.save("copy", model=gone, version=1)
    site.runner.service.engine.create(request("South 2"), "T-1")
    refused = await site.call("POST", "/v1/plantDrafts/copy/activation", 409, version=2)
    assert "'T-1'" in refused["errors"][0]
    stale = await site.call("POST", "/v1/plantDrafts/copy/activation", 409, version=1)
    assert stale["type"].endswith("plant-draft-changed")

    await site.call("POST", "/v1/transportOrders/T-1/withdrawal")
    moved = {
        **model,
        "points": [*model["points"][:-1], {**model["points"][-1], "xMm": model["points"][-1]["xMm"] + 1500}],
    }
    moved["points"].append({"name": "New", "xMm": 1, "yMm": 2})
    await site.save("copy", model=moved, version=2)
    changes = (await site.call("GET", "/v1/plantDrafts/copy/differences"))["differences"]
    assert [(each["change"], each["name"], each["distance"]) for each in changes] == [
        ("MOVED", model["points"][-1]["name"], 1.5),
        ("ADDED", "New", None),
    ]
    checked = await site.call("POST", "/v1/plantDrafts/copy/activation", version=3, checkOnly=True)
    assert (checked["changed"], site.runner.service.engine.plant) == (False, FILE.model)
    done = await site.call("POST", "/v1/plantDrafts/copy/activation", version=3)
    assert (done["changed"], done["points"]) == (True, len(FILE.model.points) + 1)
    assert "New" in site.runner.service.engine.plant.points_by_name

    kept = (await site.call("GET", "/v1/plantVersions"))["versions"]
    assert [(each["number"], each["draft"], each["by"]) for each in kept] == [
        (2, "copy", "anonymous"),
        (1, "", ""),
    ]
    assert (await site.call("GET", "/v1/plantVersions/2/differences"))["differences"] == changes
    back = await site.save("back", fromVersion=1)
    await site.call("POST", "/v1/plantDrafts/back/activation", version=back["version"])
    assert site.runner.service.engine.plant == FILE.model
    assert (await site.call("GET", "/v1/plantVersions"))["versions"][0]["number"] == 3
    await site.save("never", 404, fromVersion=9)
    assert (await site.call("GET", "/v1/plantDrafts/copy"))["version"] == 3, "kept over rebuilt services"


async def test_versions_are_limited_and_a_new_file_is_one(
    site: Site, settings: OrderServiceSettings, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(versions, "VERSIONS_KEPT", 2)
    for version, name in enumerate(("B1", "B2"), start=1):
        renamed = {**LINE, "points": [*LINE["points"], {"name": name, "xMm": 1, "yMm": 1}]}
        await site.save(model=renamed, version=version - 1 or None)
        await site.call("POST", "/v1/plantDrafts/aisle/activation", version=version)
    numbers = [each["number"] for each in (await site.call("GET", "/v1/plantVersions"))["versions"]]
    assert numbers == [3, 2]
    assert await site.store.document(versions.VERSION_MODEL, "1") is None
    other = PlantFile(
        FILE.model.model_copy(update={"points": (*FILE.model.points, Point(name="X", x_mm=0, y_mm=0))}), "2"
    )
    async with Supervisor() as supervisor:
        again = Store(open_database(settings.store.location()))
        runner = ServiceRunner(
            other,
            again,
            supervisor,
            make=lambda model: OrderService(settings, model, again),
            show=lambda _: None,
        )
        await runner.begin()
        extension = runner.service.extensions["plant_drafts"]
        assert isinstance(extension, PlantDrafts)
        newest = extension.versions.all().versions[0]
        assert (newest.number, newest.by, newest.points) == (4, "", len(other.model.points))
    again.close()


async def test_drafts_are_limited_and_audited_without_their_models(
    site: Site, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(drafts, "DRAFTS_LIMIT", 1)
    await site.save(model=LINE)
    assert "Delete one" in (await site.save("second", 409, model=LINE))["detail"]
    await site.call("POST", "/v1/plantDrafts/aisle/activation", version=1)
    rows = (await site.call("GET", "/v1/audit"))["entries"]
    activated, refused, saved = rows[:3]
    assert (activated["operation"], activated["object"], activated["result"]) == (
        "activatePlantDraft",
        "aisle",
        "DONE",
    )
    assert (refused["operation"], refused["result"]) == ("savePlantDraft", "REFUSED")
    assert (saved["object"], json.loads(saved["request"])) == ("aisle", {"version": None})
    assert json.loads(saved["after"])["points"] == 2
