"""``nena recordings``: what it asks the status aggregator and the order service for."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from typer.testing import CliRunner, Result

from nena_cli import recordings
from nena_client import Client
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.recordings import RecordingAnswer
from nena_shared.fleet_api.requests import InstantActionAnswer
from nena_shared.vda5050.action import ActionStatus

NAME = "20260102T030405.678Z-drive-failed.mcap"
ROWS = [{"robot": "ACME/r 1", "name": NAME, "size": 2049, "received": "2026-01-02T03:04:05.678Z"}]

Answer = Callable[[httpx.Request], httpx.Response]


@pytest.fixture
def aggregator(monkeypatch: pytest.MonkeyPatch) -> list[httpx.Request]:
    """Answer requests to the aggregator; return them."""
    asked: list[httpx.Request] = []
    make = httpx.Client

    def answer(request: httpx.Request) -> httpx.Response:
        asked.append(request)
        if request.url.path == "/api/v1/recordings":
            return httpx.Response(200, json=ROWS)
        if request.url.path.endswith(NAME):
            return httpx.Response(200, content=b"content")
        return httpx.Response(404, json={"detail": "No such recording."})

    monkeypatch.setattr(httpx, "Client", lambda **more: make(transport=httpx.MockTransport(answer), **more))
    return asked


def run(*arguments: str) -> Result:
    return CliRunner().invoke(recordings.app, [*arguments], env={"COLUMNS": "200", "NENA_TOKEN": "secret"})


def test_recordings_are_listed_with_the_users_token(aggregator: list[httpx.Request]) -> None:
    result = run("list", "--robot", "ACME/r 1", "--aggregator", "http://fleet:8080")

    assert result.exit_code == 0, result.output
    assert result.output.split("\t")[:3] == ["ACME/r 1", NAME, "3"]
    (asked,) = aggregator
    assert str(asked.url) == "http://fleet:8080/api/v1/recordings?robot=ACME%2Fr+1"
    assert asked.headers["authorization"] == "Bearer secret"


def test_a_recording_is_downloaded(aggregator: list[httpx.Request], tmp_path: Path) -> None:
    target = tmp_path / "failed.mcap"
    result = run("get", "ACME/r 1", NAME, "--to", str(target))

    assert result.exit_code == 0, result.output
    assert target.read_bytes() == b"content"
    assert aggregator[0].url.raw_path == f"/api/v1/recordings/ACME/r%201/{NAME}".encode()


@pytest.mark.usefixtures("aggregator")
def test_an_unknown_recording_is_refused_and_writes_nothing(tmp_path: Path) -> None:
    target = tmp_path / "failed.mcap"
    result = run("get", "ACME/r1", "other.mcap", "--to", str(target))

    assert (result.exit_code, target.exists()) == (1, False)
    assert "No such recording." in result.output


def test_without_an_aggregator_it_says_what_to_set() -> None:
    result = run("list", "--aggregator", "http://127.0.0.1:9")

    assert result.exit_code == 2
    assert "NENA_AGGREGATOR_URL" in result.output


def test_a_recording_is_requested_by_an_instant_action(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[tuple[str, str, Any]] = []

    def call(
        _: Client, operation: Operation[Any], name: str = "", *, body: Any = None
    ) -> InstantActionAnswer:
        asked.append((operation.name, name, body))
        return InstantActionAnswer(
            action_id="a", action_type="x", status=ActionStatus.FINISHED, reason="", result=NAME
        )

    monkeypatch.setattr(Client, "call", call)
    result = run("request", "Robot-01")

    assert result.exit_code == 0, result.output
    assert NAME in result.output
    assert asked == [("instantAction", "Robot-01", {"actionType": "nena:fetchRecording", "parameters": []})]


def test_without_a_vehicle_the_order_service_records(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def call(_: Client, operation: Operation[Any], _name: str) -> RecordingAnswer:
        asked.append(operation.name)
        return RecordingAnswer(robot="nena/order-service", name=NAME, sent=True)

    monkeypatch.setattr(Client, "call", call)
    result = run("request")

    assert result.exit_code == 0, result.output
    assert result.output.split("\t") == ["nena/order-service", NAME, "yes\n"]
    assert asked == ["fetchRecording"]
