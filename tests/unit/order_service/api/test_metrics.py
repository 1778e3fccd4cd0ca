from __future__ import annotations

import gzip
from collections import Counter
from dataclasses import replace
from datetime import timedelta
from http import HTTPStatus
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from nena_order_service.api import metrics
from nena_order_service.api.metrics import SECTIONS, _count_answers
from nena_order_service.api.rest import role_needed, rule_of
from nena_order_service.api.server import RestServer, make_standby_app, make_starting_app
from nena_order_service.extension import installed
from nena_order_service.orders.transport_order import TransportOrder
from nena_order_service.service import OrderService
from nena_shared.fleet_api.base import Role
from nena_shared.fleet_api.transport_order import TransportOrderRequest
from nena_shared.metrics import Section
from nena_shared.tasks import Supervisor
from nena_shared.web.settings import HttpSettings
from support.order_service import NOW, assigned_order, dispatchable_order
from support.waiting import PATIENCE

MOVE = {"destinations": [{"locationName": "Goods in", "operation": "Load cargo"}]}
ORDER = TransportOrderRequest.model_validate(MOVE)


async def shown(client: httpx.AsyncClient) -> dict[str, float]:
    """Return all samples, by name and labels as the text has them."""
    text = (await client.get("/metrics")).raise_for_status().text
    return {
        each.name + "".join(f" {key}={value}" for key, value in each.labels.items()): each.value
        for family in text_string_to_metric_families(text)
        for each in family.samples
    }


async def test_every_metric_of_the_tables_is_shown(client: httpx.AsyncClient) -> None:
    text = (await client.get("/metrics")).text
    types = {
        line.split()[2]: line.split()[3] for line in text.splitlines() if line.startswith("# TYPE nena_")
    }
    sections: list[Section[Any]] = [*SECTIONS]
    sections += [extension.section for extension in installed().values() if extension.section]
    assert types == {metric.name: metric.kind.value for section in sections for metric in section.metrics}


async def test_orders_are_counted_by_state_and_by_what_they_wait_for(client: httpx.AsyncClient) -> None:
    before = await shown(client)
    for name in ("waits", "held", "gone"):
        (await client.post("/v1/transportOrders", json={**MOVE, "name": name})).raise_for_status()
    for path in ("held/hold", "gone/withdrawal"):
        (await client.post(f"/v1/transportOrders/{path}", json={"reason": "a test"})).raise_for_status()

    after = await shown(client)

    assert before["nena_order_service_orders state=DISPATCHABLE"] == 0
    assert after["nena_order_service_orders state=DISPATCHABLE"] == 2
    assert after["nena_order_service_queue_length"] == 2
    assert after["nena_order_service_waiting cause=vehicle"] == 1
    assert after["nena_order_service_waiting cause=hold"] == 1
    assert after["nena_order_service_orders_created_total"] == 3
    assert after["nena_order_service_orders_ended_total state=WITHDRAWN"] == 1
    assert after["nena_order_service_order_duration_seconds_count state=WITHDRAWN"] == 1
    assert after["nena_order_service_order_events_total event=nena:held"] == 1
    assert after["nena_order_service_queue_oldest_seconds"] > 0
    assert after["nena_order_service_commits_total"] > before["nena_order_service_commits_total"]
    assert after["nena_order_service_commit_seconds_count"] == after["nena_order_service_commits_total"]
    assert after["nena_order_service_dispatch_seconds_count"] > 0


async def test_the_queue_age_is_that_of_its_oldest_order(
    service: OrderService, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    def created_after(seconds: int, order: TransportOrder) -> TransportOrder:
        created = NOW + timedelta(seconds=seconds)
        return replace(order, status=order.status.model_copy(update={"created": created}))

    async def age() -> float:
        return (await shown(client))["nena_order_service_queue_oldest_seconds"]

    monkeypatch.setattr(metrics, "time", (NOW + timedelta(seconds=100)).timestamp)
    orders = service.engine.state.orders
    assert await age() == 0
    orders.load(assigned_order(number=1))
    assert await age() == 0
    orders.load(created_after(60, dispatchable_order(number=2)))
    assert await age() == 40
    orders.load(dispatchable_order(number=1))
    assert await age() == 100


async def test_order_sequences_are_counted_until_they_are_finished(client: httpx.AsyncClient) -> None:
    (await client.post("/v1/orderSequences", json={"name": "S"})).raise_for_status()
    assert (await shown(client))["nena_order_service_sequences"] == 1
    (await client.post("/v1/orderSequences/S/completion", json={})).raise_for_status()
    assert (await shown(client))["nena_order_service_sequences"] == 0


async def test_orders_from_before_a_restart_keep_their_states_and_are_not_counted_as_new(
    service: OrderService, client: httpx.AsyncClient
) -> None:
    (await client.post("/v1/transportOrders", json=MOVE)).raise_for_status()
    orders = service.engine.state.orders
    again = type(orders)(service.engine.state.pending)
    for each in orders.unfinished():
        again.load(each)

    assert again.statistics.present == orders.statistics.present
    assert again.statistics.waits == orders.statistics.waits
    assert again.statistics.created == 0


async def test_the_answer_is_compressed_if_gzip_is_accepted(client: httpx.AsyncClient) -> None:
    async with client.stream("GET", "/metrics", headers={"accept-encoding": "gzip"}) as answer:
        raw = b"".join([part async for part in answer.aiter_raw()])
    plain = await client.get("/metrics", headers={"accept-encoding": "identity"})

    assert answer.headers["content-encoding"] == "gzip"
    assert b"# TYPE nena_order_service_orders gauge" in gzip.decompress(raw)
    assert "content-encoding" not in plain.headers
    assert len(raw) < len(plain.content) / 3


@pytest.mark.parametrize(
    "app", [make_standby_app(lambda: "", lambda: "gone"), make_starting_app(lambda: "gone")]
)
async def test_a_service_that_does_not_lead_reports_it(app: object) -> None:
    transport = httpx.ASGITransport(app)  # type: ignore[arg-type]
    async with httpx.AsyncClient(transport=transport, base_url="http://standby") as client:
        samples = await shown(client)

    assert samples["nena_order_service_leader"] == 0
    assert samples["nena_order_service_store_ready"] == 0


async def test_the_leader_reports_it_while_certain(service: OrderService, client: httpx.AsyncClient) -> None:
    assert (await shown(client))["nena_order_service_leader"] == 1
    service.store.lead_problem = "the connection to the database was lost"
    assert (await shown(client))["nena_order_service_leader"] == 0


async def test_one_metric_that_fails_does_not_hide_the_others(
    service: OrderService, client: httpx.AsyncClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delattr(type(service.store), "waiting")

    samples = await shown(client)

    assert "nena_order_service_commits_waiting" not in samples
    assert "nena_order_service_commits_total" in samples


def test_metrics_need_a_viewer_unless_they_are_public() -> None:
    assert role_needed("GET", "/metrics") is Role.VIEWER
    assert rule_of(HttpSettings(port=0))("GET", "/metrics") is Role.VIEWER
    assert rule_of(HttpSettings(port=0, open_metrics=True))("GET", "/metrics") is None
    assert rule_of(HttpSettings(port=0, open_metrics=True))("GET", "/v1/vehicles") is Role.VIEWER


async def test_answers_are_counted_by_status_refused_ones_too() -> None:
    server = RestServer(make_standby_app(lambda: "", lambda: ""), HttpSettings(port=0))
    async with Supervisor() as supervisor, httpx.AsyncClient(base_url=server.url, timeout=PATIENCE) as client:
        server.open(supervisor)
        await client.get("/healthz")
        await client.get("/v1/vehicles")
        await server.close()

    assert server.answers == {HTTPStatus.OK: 1, HTTPStatus.SERVICE_UNAVAILABLE: 1}


def test_rate_limited_requests_are_counted_from_zero() -> None:
    """The first of a series that is born with it would be no increase for Prometheus."""
    limited, door = Counter({429: 2, 200: 5}), SimpleNamespace(answers=Counter[int]())
    service: Any = SimpleNamespace(answers=limited, mqtt_api=door)
    assert _count_answers(service) == {("rest", "429"): 2, ("rest", "200"): 5, ("mqtt", "429"): 0}
