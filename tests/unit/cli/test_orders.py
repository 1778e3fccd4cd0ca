"""Files for commands; an invalid one is reported in a line, and nothing is sent."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NoReturn

import pytest
from typer.testing import CliRunner

from nena_cli import orders, watching, zones
from nena_cli.options import Format
from nena_cli.tables import vehicles_table
from nena_client import Client, Event, RefusedError
from nena_shared.fleet_api.operations import SHOW_VEHICLE, Operation
from nena_shared.fleet_api.transport_order import Problem
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus


@pytest.mark.parametrize(
    "content", [b"\xff", b"{", b'{"destinations": [{"locationName": "\xff"}]}', b"[" * 100_000]
)
def test_invalid_order(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_bytes(content)
    done = CliRunner().invoke(orders.app, ["create", "--file", str(file)])

    assert (done.exit_code, type(done.exception)) == (2, SystemExit)
    assert "message: Invalid JSON" in done.stderr


@pytest.mark.parametrize("content", [b"\xff", b"{", b'{"mapId": NaN}', b"[" * 100_000])
def test_invalid_zone_set(content: bytes, tmp_path: Path) -> None:
    file = tmp_path / "zones.json"
    file.write_bytes(content)
    done = CliRunner().invoke(zones.app, ["put", str(file)])

    assert (done.exit_code, type(done.exception)) == (2, SystemExit)
    assert done.stderr.startswith(f"nena: {file}: ")


def test_watch_output_ends_with_a_newline(
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
    monkeypatch.setattr(Client, "events", lambda *_, **__: iter([event]))
    board = watching.Board(VehicleStatus, vehicles_table)

    told = list(watching.watch(Client([]), board, {"kind": "vehicle"}, Format.TABLE))

    out = capsys.readouterr().out
    assert told == [status]
    assert "Robot-01" in out
    assert out.endswith("\n")


def test_options_of_the_order_are_refused_beside_a_file(tmp_path: Path) -> None:
    file = tmp_path / "order.json"
    file.write_text('{"destinations": [{"locationName": "Storage"}]}')
    command = ["create", "--file", str(file), "--key", "k", "--after", "T-1", "--type", "Transport"]
    done = CliRunner().invoke(orders.app, command, env={"COLUMNS": "250"})
    assert done.exit_code == 2
    assert "set --type, --after, --key there instead" in done.output

    default = [*command[:3], "--priority", "0", "--wait"]
    assert "set --priority there instead" in CliRunner().invoke(orders.app, default).output


def test_watching_orders_of_an_unknown_vehicle_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    unknown = Problem(title="Not Found", status=404, detail="Unknown vehicle 'V9'.")

    def call(_: Client, operation: Operation[Any], name: str = "", **_more: Any) -> NoReturn:
        assert (operation, name) == (SHOW_VEHICLE, "V9")
        raise RefusedError(unknown)

    monkeypatch.setattr(Client, "call", call)
    done = CliRunner().invoke(orders.app, ["watch", "--vehicle", "V9"])
    assert done.exit_code == 1
    assert "Unknown vehicle 'V9'" in done.stderr
