"""The APIs accept the bodies in the guide."""

from __future__ import annotations

import re
from pathlib import Path

import httpx
import pytest
from pydantic import BaseModel

from nena_shared.fleet_api.plant import PathLockRequest
from nena_shared.fleet_api.plant_drafts import PlantActivation, PlantDraftRequest, PlantRunRequest
from nena_shared.fleet_api.requests import (
    DispatchRequest,
    HoldRequest,
    InstantActionRequest,
    IntegrationLevelRequest,
    OrderChange,
    OrderTypesRequest,
    ReroutingRequest,
    ResumeRequest,
    WithdrawalRequest,
)
from nena_shared.fleet_api.schedules import ScheduleRequest, ScheduleSwitch
from nena_shared.fleet_api.stops import StopEndRequest, StopRequest
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import (
    OrderSequenceRequest,
    TransportOrderBatch,
    TransportOrderRequest,
)

GUIDE = (Path(__file__).parents[3] / "docs" / "order-service.md").read_text(encoding="utf-8")

BODIES: dict[str, type[BaseModel]] = {
    "/v1/transportOrders": TransportOrderRequest,
    "/v1/transportOrders/batch": TransportOrderBatch,
    "/v1/orderSequences": OrderSequenceRequest,
    "/v1/transportOrders/Pallet-4711": OrderChange,
    "/withdrawal": WithdrawalRequest,
    "/hold": HoldRequest,
    "/resume": ResumeRequest,
    "/dispatch": DispatchRequest,
    "/instantActions": InstantActionRequest,
    "/lock": PathLockRequest,
    "/integrationLevel": IntegrationLevelRequest,
    "/acceptableOrderTypes": OrderTypesRequest,
    "/rerouting": ReroutingRequest,
    "/v1/schedules/milk-run": ScheduleRequest,
    "/enabled": ScheduleSwitch,
    "/v1/plantDrafts/aisle": PlantDraftRequest,
    "/activation": PlantActivation,
    "/run": PlantRunRequest,
    "/v1/stops": StopRequest,
    "/end": StopEndRequest,
}
EXAMPLES = re.findall(r"\$nena(\S+) -H 'Content-Type: application/json' -d '(\{.*?\})'\n", GUIDE, re.DOTALL)


@pytest.mark.parametrize(("path", "body"), EXAMPLES)
def test_bodies_of_curl_examples_are_taken(path: str, body: str) -> None:
    kind = next(model for ending, model in BODIES.items() if httpx.URL(path).path.endswith(ending))
    kind.model_validate_json(body, by_alias=True, by_name=False)


def test_every_kind_of_body_has_an_example() -> None:
    assert {ending for path, _ in EXAMPLES for ending in BODIES if path.endswith(ending)} == set(BODIES)


def test_mqtt_example_is_taken() -> None:
    found = re.search(r"-t (\S+/create) -m '(\{.*?\})'", GUIDE)
    assert found is not None
    topic, body = found.groups()
    assert topic == FleetTopics().creation_request("wms")
    TransportOrderRequest.model_validate_json(body, by_alias=True, by_name=False)
