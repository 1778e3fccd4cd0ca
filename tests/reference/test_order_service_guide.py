"""The tables of docs/order-service.md list exactly what the code has."""

from __future__ import annotations

import re
from collections.abc import Iterable
from enum import StrEnum
from itertools import chain
from pathlib import Path

import pytest
from pydantic import BaseModel

from nena_order_service.api.asyncapi import channels
from nena_order_service.api.events import EventKind
from nena_order_service.api.mqtt import COMMANDS, Command, CommandAnswer
from nena_order_service.dispatching.settings import CandidateKey, OrderKey, VehicleKey
from nena_order_service.orders.transport_order import EventCode
from nena_shared.fleet_api.operations import OPERATIONS
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import (
    CreationAnswer,
    DependencyFailure,
    FailureMeasure,
    OrderSequenceRequest,
    TransportOrderRequest,
    TransportOrderState,
)
from nena_shared.fleet_api.vehicle import IntegrationLevel, ReroutingType

GUIDE = (Path(__file__).parents[2] / "docs" / "order-service.md").read_text(encoding="utf-8")
PARAMETERS = {"{host}": "HOST", "{serialNumber}": "SERIAL"}
"""How the guide writes the variable parts of topics; all others are ``NAME``."""


def table(section: str, head: str) -> dict[str, str]:
    """Return the rows of a table of the guide: the first cell, and the rest of the row."""
    _, _, text = GUIDE.partition(f"\n## {section}\n")
    _, found, below = text.partition(f"\n| {head} |")
    assert found, f"the section '{section}' has no table of '{head}'"
    rows = below.partition("\n\n")[0].splitlines()[2:]
    return {first: rest for first, _, rest in (row.removeprefix("| ").partition(" | ") for row in rows)}


def names(cells: Iterable[str]) -> set[str]:
    """Return what stands in backticks."""
    return set(chain.from_iterable(re.findall(r"`([^`]+)`", cell) for cell in cells))


def fields(model: type[BaseModel]) -> set[str]:
    """Return the names of a model's fields on the wire."""
    return {field.alias or name for name, field in model.model_fields.items()}


@pytest.mark.parametrize(
    ("section", "request_"),
    [("Create an order", TransportOrderRequest), ("Order sequences", OrderSequenceRequest)],
)
def test_fields_of_requests(section: str, request_: type[BaseModel]) -> None:
    assert names(table(section, "field")) == fields(request_)


@pytest.mark.parametrize(
    ("section", "head", "values"),
    [
        ("Follow an order", "event code", EventCode),
        ("Order dependencies", "`onDependencyFailure`", DependencyFailure),
        ("When a vehicle fails", "`do`", FailureMeasure),
        ("Reroute a vehicle", "`type`", ReroutingType),
        ("Traffic: who may drive where", "`integrationLevel`", IntegrationLevel),
    ],
)
def test_values(section: str, head: str, values: type[StrEnum]) -> None:
    assert names(table(section, head)) == set(values)


def test_states_that_hosts_see() -> None:
    seen = set(TransportOrderState) - {TransportOrderState.RAW}
    assert names(table("Follow an order", "state")) == seen


def test_events_of_the_stream() -> None:
    assert names(table("Event stream", "event")) == {*EventKind, "synced", "gap", "heartbeat"}


def test_keys_of_the_dispatcher() -> None:
    rows = table("Dispatching", "setting (`kernel.dispatch.`)").values()
    assert [names([row]) for row in rows] == [
        {*OrderKey, "deadline_at_risk"},
        set(CandidateKey),
        set(VehicleKey),
    ]


def test_statuses_of_refusals() -> None:
    described = {int(each) for each in re.findall(r"\d{3}", " ".join(table("Problems", "status")))}
    assert {refusal.status for each in OPERATIONS for refusal in each.refusals} <= described


def test_topics() -> None:
    addresses = {
        re.sub(r"/commands/\w+", "/commands/COMMAND", each.address) for each in channels(FleetTopics())
    }
    written = {re.sub(r"{\w+}", lambda part: PARAMETERS.get(part[0], "NAME"), each) for each in addresses}
    assert names(table("Use MQTT instead of REST", "topic")) == written


@pytest.mark.parametrize(
    ("topic", "answer"),
    [("transportOrders/answer", CreationAnswer), ("commands/COMMAND/answer", CommandAnswer)],
)
def test_answers_over_mqtt(topic: str, answer: type[BaseModel]) -> None:
    described = table("Use MQTT instead of REST", "topic")[f"`nena/v1/hosts/HOST/{topic}`"]
    assert names([described]) == fields(answer)


def test_commands_and_their_fields() -> None:
    rows = table("Use MQTT instead of REST", "command")
    assert names(rows) == set(COMMANDS)
    for row, body in rows.items():
        commands = names([row])
        if "the fields of" not in body:  # those are described with the operation
            expected = set().union(*(fields(COMMANDS[each]) for each in commands)) - fields(Command)
            assert names([body]) - commands == expected - commands, row
