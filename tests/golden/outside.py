"""What other programs rely on, as JSON: REST, MQTT, settings, metrics, roles.

Texts for people are left out: they may be reworded. ``PYTHONPATH=tests python -m golden.outside`` writes the
files again; a change there is a change for every host, and belongs into the changelog.
"""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import httpx
from fastapi import FastAPI

from nena_demo.plants import sample_plant_path
from nena_order_service.api.rest import role_needed
from nena_order_service.plant_file import load_plant
from nena_order_service.service import OrderService
from nena_order_service.settings import OrderServiceSettings, StoreSettings
from nena_order_service.store.schema import open_database
from nena_order_service.store.store import Store
from nena_shared.clock import SystemClock
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.settings import settings_with
from nena_shared.vda5050.topics import RobotKey, Topic, TopicScheme
from nena_status_aggregator.aggregator import Aggregator
from nena_status_aggregator.api.app import make_app
from nena_status_aggregator.api.session import make_rule
from nena_status_aggregator.extension import installed
from nena_status_aggregator.settings import AggregatorHttpSettings, AggregatorSettings
from reference.configuration import PROGRAMS as SETTINGS
from reference.configuration import settings_of
from reference.metrics import PROGRAMS as METRICS

FOLDER: Final = Path(__file__).parent
TEXTS: Final = frozenset({"title", "description", "summary", "operationId"})
EXAMPLE: Final = "example"
"""No field of a body has this name."""
OPENTCS: Final = "/opentcs"


def without_texts(part: Any) -> Any:
    """Leave out what only people read, and the ids that FastAPI makes of functions' names."""
    if isinstance(part, dict):
        kept = {name: value for name, value in part.items() if not _is_text(name, value)}
        return {name: without_texts(value) for name, value in kept.items()}
    return [without_texts(each) for each in part] if isinstance(part, list) else part


def _is_text(name: str, value: Any) -> bool:
    return name == EXAMPLE or (name in TEXTS and isinstance(value, str))


def order_service() -> OrderService:
    """Make an order service with all of its APIs; it runs nothing."""
    with tempfile.TemporaryDirectory() as folder:
        store = Store(open_database(f"sqlite:///{folder}/orders.db"))
        settings = OrderServiceSettings(
            plant=sample_plant_path(),
            store=StoreSettings.model_validate({"url": f"sqlite:///{folder}/orders.db"}),
        )
        made = OrderService(settings, load_plant(settings.plant).model, store, change_plant=_change_nothing)
        store.close()
    return made


async def _change_nothing(*_: object, **__: object) -> None:
    pass


def opentcs(service: OrderService) -> FastAPI:
    """Return the application that serves openTCS's paths."""
    mounts = (getattr(route, "app", None) for route in service.app.routes)
    return next(each for each in mounts if isinstance(each, FastAPI))


def aggregator() -> Aggregator:
    """Make an aggregator that has heard of nothing yet."""
    return Aggregator(settings_with(AggregatorSettings, installed())(), SystemClock(), installed())


def asyncapi(service: OrderService) -> Any:
    """Return the description of the MQTT API as it is served."""

    async def get() -> Any:
        transport = httpx.ASGITransport(service.app)
        async with httpx.AsyncClient(transport=transport, base_url="http://order-service") as client:
            return (await client.get("/asyncapi.json")).raise_for_status().json()

    return asyncio.run(get())


def roles(described: dict[str, Any], needed: Callable[[str, str], Any]) -> dict[str, str | None]:
    """Return the role that each request needs."""
    found = {}
    for path, methods in described["paths"].items():
        for method in methods:
            role = needed(method.upper(), path)
            found[f"{method.upper()} {path}"] = None if role is None else role.name
    return found


def settings() -> dict[str, list[str]]:
    """Return the names of each program's settings."""
    return {program: sorted(each.name for each in settings_of(model)) for program, model in SETTINGS.items()}


def metrics() -> dict[str, dict[str, str]]:
    """Return the type of each program's metrics."""
    return {
        program: {metric.name: metric.kind.value for section in sections for metric in section.metrics}
        for program, sections in METRICS.items()
    }


def topics() -> dict[str, Any]:
    """Return the MQTT topics of hosts and robots."""
    fleet, robot = FleetTopics(), RobotKey("MANUFACTURER", "SERIAL")
    return {
        "hosts": {
            "creation_requests": fleet.creation_requests,
            "creation_request": fleet.creation_request("HOST"),
            "creation_answer": fleet.creation_answer("HOST"),
            "commands": fleet.commands,
            "command": fleet.command("HOST", "COMMAND"),
            "command_answer": fleet.command_answer("HOST", "COMMAND"),
            "order_status": fleet.order_status("ORDER"),
            "sequence_status": fleet.sequence_status("SEQUENCE"),
            "vehicle_status": fleet.vehicle_status("SERIAL"),
            "plant_model": fleet.plant_model,
        },
        "robots": {
            version: [TopicScheme("uagv", version).of(robot, topic) for topic in Topic]
            for version in ("v2", "v3")
        },
        "maps": fleet.all_robot_maps,
        "recordings": [fleet.recording_chunks(robot), fleet.recording_answers(robot)],
    }


def documents() -> dict[str, Any]:
    """Return all of them, by the names of their files."""
    service = order_service()
    panel = make_app(aggregator(), AggregatorHttpSettings())
    rule = make_rule(AggregatorHttpSettings())
    return {
        "order_service_openapi": without_texts(service.app.openapi()),
        "order_service_roles": roles(service.app.openapi(), role_needed),
        "opentcs_openapi": without_texts(opentcs(service).openapi()),
        "opentcs_roles": roles(opentcs(service).openapi(), lambda m, path: role_needed(m, OPENTCS + path)),
        "asyncapi": without_texts(asyncapi(service)),
        "status_aggregator_openapi": without_texts(panel.openapi()),
        "status_aggregator_roles": roles(panel.openapi(), rule),
        "settings": settings(),
        "metrics": metrics(),
        "topics": topics(),
    }


def file_of(name: str) -> Path:
    """Return where the document of this name is kept."""
    return FOLDER / f"{name}.json"


def text_of(document: Any) -> str:
    """Write a document as its file has it."""
    return json.dumps(document, indent=1, sort_keys=True, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    for written, content in documents().items():
        file_of(written).write_text(text_of(content), encoding="utf-8")
