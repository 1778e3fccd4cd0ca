"""Reports of what robots and the order service published, over the API."""

from __future__ import annotations

import csv
from datetime import UTC, datetime, timedelta
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from nena_shared.fleet_api.transport_order import TransportOrderState
from nena_shared.vda5050.topics import Topic
from nena_status_aggregator.api import history as history_api
from nena_status_aggregator.extensions.reports import queries as report_queries
from nena_status_aggregator.settings import HistorySettings
from support.broker import Broker, MqttPeer
from support.fleet_examples import order_status, position, state, way
from support.served_aggregator import Served, serving

pytestmark = pytest.mark.broker


def kept_in(folder: Path) -> HistorySettings:
    return HistorySettings.model_validate({"url": f"sqlite:///{folder / 'history.db'}", "interval": 0.02})


async def work(served: Served, peer: MqttPeer) -> None:
    """Execute an order that drives 3 m without a load, and wait until it is in the history."""
    at_a: dict[str, Any] = {"last_node_id": "A", "mobile_robot_position": position(0, 0), "loads": ()}
    at_b: dict[str, Any] = {"last_node_id": "B", "mobile_robot_position": position(3, 0), "loads": ()}
    served.send(peer, Topic.STATE, state(1, at=1, **at_a))
    served.send(peer, Topic.STATE, state(2, at=2, order_id="o1", driving=True, **at_a, **way("B")))
    served.send(peer, Topic.STATE, state(3, at=3, order_id="o1", last_node_sequence_id=2, **at_b))
    end = datetime.now(UTC)
    done = order_status(
        "TO-1",
        2,
        TransportOrderState.FINISHED,
        created=end - timedelta(seconds=90),
        finished=end,
        deadline=end + timedelta(seconds=1),
    )
    peer.publish(served.fleet.order_status("TO-1"), done.model_dump_json(by_alias=True))
    path = "/api/v1/history?code=transportOrder&code=orderEnded"
    await served.until(path, lambda page: len(page["entries"]) == 2)


async def test_report_of_an_order_as_json_and_csv(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        with MqttPeer(broker) as peer:
            await work(served, peer)
        report = await served.get("/api/v1/report")
        orders = report["orders"]
        assert (orders["finished"], orders["deadlines"], orders["onTime"]) == (1, 1, 1)
        assert (orders["leadTimeP50"], orders["leadTimeP95"]) == (90.0, 90.0)
        (robot,) = report["robots"]
        assert (robot["robot"], robot["distance"], robot["emptyDistance"]) == ("ACME/r1", 3.0, 3.0)
        table = await served.http.get("/api/v1/report.csv")
        assert table.headers["content-type"] == "text/csv; charset=utf-8"
        rows = list(csv.reader(StringIO(table.text, newline="")))
        assert ["orders", "finished", "", "", "1"] in rows
        assert ["robots", "emptyDistance", "ACME/r1", "", "3.0"] in rows


@pytest.mark.parametrize(
    ("query", "problem"),
    [
        ("since=2026-01-02T00:00:00Z&until=2026-01-01T00:00:00Z", "must be before until"),
        ("since=2026-01-01T00:00:00Z&until=2026-01-01T00:00:00Z", "must be before until"),
        ("since=9998-01-01T00:00:00Z", "must be before the current time"),
        ("since=9998-01-01T00:00:00Z&until=9999-01-01T00:00:00Z", "must be before the current time"),
        ("since=2026-01-01T00:00:00Z&until=2026-03-01T00:00:00Z", "longer than 31 days"),
        ("until=0001-01-01T00:00:00Z", "too early"),
        ("since=yesterday", "Invalid request"),
        ("since=0001-01-01T00:00:00%2B14:00", "Invalid request"),
    ],
)
async def test_invalid_ranges_are_refused(
    broker: Broker, interface_name: str, tmp_path: Path, query: str, problem: str
) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        for form in ("report", "report.csv"):
            answer = await served.http.get(f"/api/v1/{form}?{query}")
            assert answer.status_code == 422
            assert problem in answer.json()["detail"]
        empty = await served.get("/api/v1/report?until=2020-01-01T00:00:00Z")
        assert (empty["recordedSince"], empty["robots"]) == (None, [])


async def test_limits_of_reports_are_refused_with_advice(
    broker: Broker, interface_name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        with MqttPeer(broker) as peer:
            await work(served, peer)
        monkeypatch.setattr(report_queries, "ENTRIES_LIMIT", 1)
        long = await served.http.get("/api/v1/report")
        assert (long.status_code, "shorter range" in long.json()["detail"]) == (422, True)
        monkeypatch.setattr(history_api, "WAITING_LIMIT", 0)
        busy = await served.http.get("/api/v1/report")
        assert (busy.status_code, "try again" in busy.json()["detail"]) == (503, True)
