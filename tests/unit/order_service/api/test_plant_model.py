from __future__ import annotations

import httpx
from fastapi import FastAPI

from nena_demo.plants import sample_plant_path
from nena_order_service.api import problems
from nena_order_service.api.plant import plant_model_router
from nena_order_service.service import OrderService
from nena_shared.plant import PlantModel


async def test_model_of_any_format_is_accepted_or_refused(service: OrderService) -> None:
    asked: list[tuple[str, bool]] = []

    async def change(model: PlantModel, *, check_only: bool = False) -> None:
        asked.append((model.name, check_only))

    app = FastAPI()
    problems.install(app)
    app.include_router(plant_model_router(b"{}", change, service.hosts.trail))
    transport = httpx.ASGITransport(app)
    async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
        data = sample_plant_path().read_bytes()
        done = await client.put("/v1/plantModel", content=data)
        assert (done.json()["changed"], done.json()["points"]) == (True, 20)
        looked = await client.put("/v1/plantModel", content=data, params={"check": True})
        assert looked.json()["changed"] is False
        wrong = await client.put("/v1/plantModel", content=b"<model/>")
        assert (wrong.status_code, bool(wrong.json()["errors"])) == (422, True)
    assert asked == [("Sample hall", False), ("Sample hall", True)]


async def test_plant_model_is_published_unchanged(client: httpx.AsyncClient, service: OrderService) -> None:
    answer = await client.get("/v1/plantModel")
    assert PlantModel.from_json(answer.content) == service.engine.plant
