from __future__ import annotations

import pytest

from nena_shared.web.settings import HttpSettings
from nena_shared.web.users import Role
from nena_status_aggregator.rest.roles import make_rule

RULE = make_rule(HttpSettings(port=0))


@pytest.mark.parametrize(
    ("request_line", "role"),
    [
        ("GET /", None),
        ("GET /login.html", None),
        ("GET /texts/en.js", None),
        ("GET /healthz", None),
        ("GET /readyz", None),
        ("GET /metrics", Role.VIEWER),
        ("GET /api/v1/fleet", Role.VIEWER),
        ("HEAD /api/v1/fleet", Role.VIEWER),
        ("GET /api/v1/events", Role.VIEWER),
        ("GET /api/v1/control/vehicles", Role.VIEWER),
        ("POST /api/v1/control/transportOrders", Role.OPERATOR),
        ("DELETE /api/v1/control/transportOrders", Role.OPERATOR),
        ("GET /api/v1/session", Role.VIEWER),
        ("POST /api/v1/session", Role.VIEWER),
        ("DELETE /api/v1/session", None),
        ("POST /api/v1/session/", Role.OPERATOR),
        ("GET /api/v1/session/oidc", None),
        ("GET /api/v1/session/oidc/callback", None),
        ("GET /api/v1/session/oidcs", Role.VIEWER),
    ],
)
def test_what_a_request_takes(request_line: str, role: Role | None) -> None:
    assert RULE(*request_line.split()) == role


def test_metrics_are_open_where_the_settings_say_so() -> None:
    assert make_rule(HttpSettings(port=0, open_metrics=True))("GET", "/metrics") is None
