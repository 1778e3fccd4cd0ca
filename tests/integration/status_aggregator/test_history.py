"""What robots did is found again, over the API, after a restart, and in files."""

from __future__ import annotations

import csv
import json
from io import StringIO
from pathlib import Path
from typing import Any

import pytest

from nena_shared.vda5050.topics import Topic
from nena_status_aggregator.settings import HistorySettings
from support.broker import Broker, MqttPeer
from support.fleet_examples import order_status, position, state, way
from support.served_aggregator import Served, serving

pytestmark = pytest.mark.broker


def kept_in(folder: Path) -> HistorySettings:
    return HistorySettings.model_validate(
        {"url": f"sqlite:///{folder / 'history.db'}", "interval": 0.02, "track_distance": 0.5}
    )


def codes(page: dict[str, Any]) -> list[str]:
    return [entry["code"] for entry in page["entries"]]


async def drive(served: Served, peer: MqttPeer) -> None:
    """Drive an order from A to B, and wait until all of it is in the history.

    Events of its condition follow its states a moment later: once the robot is shown at the end of its order
    all have been published, and later ones, here of TO-0, are written after them.
    """
    for number, fields in enumerate(
        (
            {"last_node_id": "A", "mobile_robot_position": position(0, 0)},
            {"order_id": "o1", "last_node_id": "A", "driving": True, **way("B")},
            {
                "order_id": "o1",
                "last_node_id": "B",
                "last_node_sequence_id": 2,
                "mobile_robot_position": position(3, 0),
            },
        )
    ):
        served.send(peer, Topic.STATE, state(number + 1, at=number, **fields))
    robot = "/api/v1/robots/ACME/r1"
    await served.until(robot, lambda shown: (shown.get("order") or {}).get("progress") == 100)
    last = order_status("TO-0").model_dump_json(by_alias=True)
    peer.publish(served.fleet.order_status("TO-0"), last)
    await served.until("/api/v1/history?order=TO-0", lambda page: bool(page["entries"]))


async def test_history_of_a_robot_survives_a_restart(
    broker: Broker, interface_name: str, tmp_path: Path
) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        with MqttPeer(broker) as peer:
            await drive(served, peer)
            order = order_status().model_dump_json(by_alias=True)
            peer.publish(served.fleet.order_status("TO-1"), order)
            await served.until("/api/v1/history?order=TO-1", lambda page: codes(page) == ["transportOrder"])
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        page = await served.get("/api/v1/history?robot=ACME/r1&order=o1")
        assert {"orderTaken", "nodeReached", "orderEnded"} <= set(codes(page))
        assert page["next"] is None
        first = await served.get("/api/v1/history?limit=1")
        rest = await served.get(f"/api/v1/history?before={first['next']}")
        assert first["entries"][0]["id"] > rest["entries"][0]["id"]
        track = await served.get("/api/v1/history?code=position&robot=ACME/r1")
        assert [entry["values"]["x"] for entry in track["entries"]] == [3, 0]
        assert codes(await served.get("/api/v1/history?until=2000-01-01T00:00:00Z")) == []
        wrong = await served.http.get("/api/v1/history?code=nonsense")
        assert (wrong.status_code, wrong.headers["content-type"]) == (422, "application/problem+json")


async def test_history_is_exported_as_files(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        with MqttPeer(broker) as peer:
            await drive(served, peer)
        table = await served.http.get("/api/v1/history.csv?robot=ACME/r1")
        rows = list(csv.DictReader(StringIO(table.text, newline="")))
        lines = await served.http.get("/api/v1/history.jsonl?robot=ACME/r1")
        entries = [json.loads(line) for line in lines.text.splitlines()]
        assert table.headers["content-type"] == "text/csv; charset=utf-8"
        assert [int(row["id"]) for row in rows] == [entry["id"] for entry in entries]
        assert entries == sorted(entries, key=lambda entry: entry["id"])
        taken = next(entry for entry in entries if entry["code"] == "orderTaken")
        assert taken["values"] == {"orderId": "o1", "orderUpdateId": 0}
        nobody = await served.http.get("/api/v1/history.csv?robot=nobody")
        assert nobody.text == "id,time,code,robot,order,text,values\r\n"


async def test_replay_of_a_drive(broker: Broker, interface_name: str, tmp_path: Path) -> None:
    async with serving(broker, interface_name, history=kept_in(tmp_path)) as served:
        with MqttPeer(broker) as peer:
            await drive(served, peer)
        answer = await served.http.get("/api/v1/replay")
        assert answer.headers["content-encoding"] == "gzip"
        (robot,) = answer.json()["robots"]
        assert (robot["robot"], sum(robot["x"]), sum(robot["y"])) == ("ACME/r1", 300, 0)
        assert robot["looks"][-1][1] == "IDLE"
        long = await served.http.get("/api/v1/replay?since=2020-01-01T00:00:00Z")
        assert (long.status_code, "request a shorter one" in long.json()["detail"]) == (422, True)
