from __future__ import annotations

import pytest

from nena_order_service.api.rest import role_needed
from nena_shared.fleet_api.base import Role


@pytest.mark.parametrize(
    ("request_line", "role"),
    [
        ("GET /healthz", None),
        ("GET /readyz", None),
        ("GET /readyz/more", Role.VIEWER),
        ("GET /openapi.json", Role.VIEWER),
        ("GET /v1/transportOrders", Role.VIEWER),
        ("HEAD /v1/vehicles", Role.VIEWER),
        ("POST /v1/transportOrders", Role.OPERATOR),
        ("POST /v1/transportOrders/TO-1/withdrawal", Role.OPERATOR),
        ("PUT /v1/vehicles/Robot-01/pause", Role.OPERATOR),
        ("GET /v1/plantModel", Role.VIEWER),
        ("PUT /v1/plantModel", Role.ADMIN),
        ("GET /opentcs/v1/plantModel", Role.VIEWER),
        ("PUT /opentcs/v1/plantModel", Role.ADMIN),
        ("PUT /opentcs/v1/vehicles/Robot-01/paused", Role.OPERATOR),
        ("GET /v1/zoneSets", Role.VIEWER),
        ("POST /v1/zoneSets/night/enable", Role.ADMIN),
        ("DELETE /v1/zoneSets/night", Role.ADMIN),
        ("POST /v1/vehicles/Robot-01/rerouting", Role.OPERATOR),
        ("DELETE /anything", Role.OPERATOR),
    ],
)
def test_role_needed_for_a_request(request_line: str, role: Role | None) -> None:
    assert role_needed(*request_line.split()) == role
