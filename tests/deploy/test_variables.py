"""Variables in container files and units name real settings: programs pass over unknown ones."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from pydantic import BaseModel

from nena_edge_agent.extension import settings_model
from nena_order_service import extension as order_service
from nena_order_service.settings import OrderServiceSettings
from nena_robot_simulator.settings import SimulatorSettings
from nena_shared.program import HEARTBEAT_FILE
from nena_shared.settings import settings_with
from nena_status_aggregator import extension as aggregator
from nena_status_aggregator.settings import AggregatorSettings

ROOT = Path(__file__).parents[2]
MODELS: dict[str, type[BaseModel]] = {
    "edge_agent": settings_model(),
    "order_service": settings_with(OrderServiceSettings, order_service.installed()),
    "robot_simulator": SimulatorSettings,
    "status_aggregator": settings_with(AggregatorSettings, aggregator.installed()),
}
NO_SETTING = {HEARTBEAT_FILE, "NENA_VERSION"}


def knows(model: Any, path: list[str]) -> bool:
    for name in path:
        field = getattr(model, "model_fields", {}).get(name)
        if field is None:
            return False
        model = field.annotation
    return True


def files_of(service: str) -> list[Path]:
    unit = ROOT / "deploy" / "systemd" / f"nena-{service.replace('_', '-')}.service"
    images = [*ROOT.glob(f"services/{service}/Dockerfile*"), *ROOT.glob(f"tools/{service}/Dockerfile*")]
    return [*sorted(images), *([unit] if unit.exists() else [])]


def cases() -> list[Any]:
    return [pytest.param(name, path, id=f"{name}-{path.name}") for name in MODELS for path in files_of(name)]


def variables(text: str) -> set[str]:
    return set(re.findall(r"\bNENA_[A-Z_]+", text)) - NO_SETTING


@pytest.mark.parametrize(("service", "path"), cases())
def test_environment_file_of_one_service_names_its_settings(service: str, path: Path) -> None:
    found = variables(path.read_text())

    assert found
    assert [each for each in found if not knows(MODELS[service], each[5:].lower().split("__"))] == []


OF_GRAFANA = {"NENA_PROMETHEUS_URL"}
"""Read by the data source in deploy/grafana, not by a program of NeNa's."""


def test_docker_compose_names_settings() -> None:
    texts = [(ROOT / name).read_text() for name in ("docker-compose.yml", "docker-compose.site.yml")]
    found = variables("\n".join(texts))

    assert {"NENA_MQTT__HOST", "NENA_HTTP__HOST", "NENA_PLANT", "NENA_MQTT__TLS__CA"} <= found
    unknown = [
        each
        for each in found - OF_GRAFANA
        if not any(knows(model, each[5:].lower().split("__")) for model in MODELS.values())
    ]
    assert unknown == []
