"""The commands for vehicles, and what they ask the order service for."""

from __future__ import annotations

import pytest
from typer.testing import CliRunner

from nena_cli import vehicles
from nena_client import Client
from nena_shared.fleet_api.operations import Operation
from nena_shared.fleet_api.requests import VehicleList
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.vehicle import ProcessingState, VehicleState, VehicleStatus


def vehicle(name: str, state: VehicleState, *behind: str) -> VehicleStatus:
    wait = TrafficWait(vehicles=behind, at="B", cause=WaitCause.PASSES, reason="it waits") if behind else None
    return VehicleStatus(
        name=name,
        manufacturer="NeNa",
        serial_number=name,
        state=state,
        processing_state=ProcessingState.IDLE,
        connection="ONLINE",
        reason="",
        wait=wait,
    )


FLEET = (
    vehicle("V-3", VehicleState.EXECUTING, "V-2"),
    vehicle("V-2", VehicleState.IDLE, "V-1"),
    vehicle("V-1", VehicleState.ERROR),
)


def test_filtered_list_follows_queues_through_all_vehicles(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def call(
        _: Client, operation: Operation[VehicleList], *, query: dict[str, list[str]] | None = None
    ) -> VehicleList:
        assert operation.method == "GET"
        wanted = (query or {}).get("state")
        return VehicleList(vehicles=tuple(each for each in FLEET if not wanted or each.state in wanted))

    monkeypatch.setattr(Client, "call", call)
    monkeypatch.setenv("COLUMNS", "200")
    done = CliRunner().invoke(vehicles.app, ["list", "--state", "EXECUTING"])
    assert done.exit_code == 0, done.output
    assert "V-2 > V-1 (ERROR)" in done.output
