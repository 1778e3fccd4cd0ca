"""What a file gets of what is watched."""

from __future__ import annotations

import pytest
from rich.table import Table

from nena_cli.fleet import watch
from nena_cli.fleet.connection import Connection
from nena_cli.fleet.events import Event
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus


def test_what_is_watched_ends_with_the_end_of_a_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    status = VehicleStatus(
        name="Robot-01",
        manufacturer="ACME",
        serial_number="1",
        state=VehicleState.IDLE,
        processing_state=ProcessingState.IDLE,
        reason="no order waits",
        connection="ONLINE",
    )
    event = Event("vehicle", None, status.model_dump(mode="json", by_alias=True))
    monkeypatch.setattr(watch, "follow", lambda *_, **__: iter([event]))
    board = watch.Board(VehicleStatus, lambda shown: Table(*(each.name for each in shown)))

    told = list(watch.watch(Connection([], None), board, {"kind": "vehicle"}, as_json=False))

    out = capsys.readouterr().out
    assert told == [status]
    assert "Robot-01" in out
    assert out.endswith("\n")
