from __future__ import annotations

import pytest

from nena_order_service.api.mqtt import COMMANDS, REQUESTS_LIMIT, Command, MqttLimits, read_request, text_in
from nena_order_service.settings import HostSettings
from nena_shared.findings import FINDINGS_SHOWN
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.mqtt import Inbound
from support.clocks import ManualClock


def statuses(limits: MqttLimits, *hosts: str, in_work: int = 0) -> list[int | None]:
    told = [limits.refusal(host, in_work) for host in hosts]
    return [problem.status if problem else None for problem in told]


def test_each_host_has_its_own_rate_limit_that_recovers() -> None:
    clock = ManualClock()
    limits = MqttLimits(HostSettings(requests_per_second=2.0, burst=2), clock)

    assert statuses(limits, "wms", "wms", "wms", "mes") == [None, None, 429, None]
    refused = limits.refusal("wms", 0)
    assert refused
    assert refused.detail == "Too many requests. Retry in 0.5 s."

    clock.seconds += 0.5
    assert statuses(limits, "wms", "wms") == [None, 429]


def test_pending_requests_are_limited() -> None:
    limits = MqttLimits(HostSettings(), ManualClock())

    assert statuses(limits, "wms", in_work=REQUESTS_LIMIT - 1) == [None]
    assert statuses(limits, "wms", in_work=REQUESTS_LIMIT) == [503]


def read(payload: bytes, *, retained: bool = False) -> Command | Problem:
    return read_request(Inbound("t", payload, retained), COMMANDS["delivery"], max_body=100)


def test_valid_request_is_read() -> None:
    assert read(b'{"transportOrder": "T-1"}') == COMMANDS["delivery"].model_validate(
        {"transportOrder": "T-1"}
    )


@pytest.mark.parametrize(
    ("payload", "status"),
    [
        (b"{", 400),
        (b"\xff", 400),
        (b"[]", 422),
        (b"{}", 422),
        (b'{"transport_order": "T-1"}', 422),
        (b'{"transportOrder": "T-1", "colour": "red"}', 422),
        (b" " * 101, 413),
    ],
)
def test_any_other_value_is_a_problem(payload: bytes, status: int) -> None:
    problem = read(payload)
    assert isinstance(problem, Problem)
    assert problem.status == status


def test_retained_request_is_refused() -> None:
    problem = read(b'{"transportOrder": "T-1"}', retained=True)
    assert isinstance(problem, Problem)
    assert problem.status == 400
    assert "retain" in problem.detail


@pytest.mark.parametrize(
    ("payload", "text"),
    [
        (b'{"colour": "red", "requestId": "17"}', "17"),
        (b'{"requestId": 17}', None),
        (b'{"requestId": ""}', None),
        (b'{"requestId": "\\ud800"}', None),
        (b"{}", None),
        (b"[]", None),
        (b"{", None),
        (b"\xff", None),
        (b'{"requestId": "%s"}' % (b"x" * 201), None),
        (b'{"requestId": "17"}' + b" " * 300, None),
    ],
)
def test_a_refusal_identifies_its_request(payload: bytes, text: str | None) -> None:
    assert text_in(Inbound("t", payload, retained=False), "requestId", max_body=300) == text


@pytest.mark.parametrize("count", [11, 999, 100_000])
def test_thousands_of_conflicts_give_a_readable_answer(count: int) -> None:
    payload = b'{"zoneSet": {"mapId": "m", "zoneSetId": "s", "zones": [%b]}}' % b",".join([b"1"] * count)
    problem = read_request(Inbound("t", payload, retained=False), COMMANDS["putZoneSet"], max_body=10**6)

    assert isinstance(problem, Problem)
    assert problem.status == 422
    assert len(problem.errors) <= FINDINGS_SHOWN + 1
    assert problem.errors[-1] in {
        f"message: {count - FINDINGS_SHOWN} more invalid values",
        f"message: {count} invalid values",
    }
