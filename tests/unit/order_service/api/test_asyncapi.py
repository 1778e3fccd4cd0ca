"""The document alone; a test with a real broker shows that it describes the wire."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

import httpx
from jsonschema_rs import meta

from nena_order_service.api.asyncapi import channels, document
from nena_order_service.api.mqtt import COMMANDS
from nena_shared.fleet_api.topics import FleetTopics

DOCUMENT = document(FleetTopics("site/fleet"))


def references(part: Any) -> Iterator[str]:
    if isinstance(part, dict):
        yield from (value for key, value in part.items() if key == "$ref")
        for value in part.values():
            yield from references(value)
    elif isinstance(part, list):
        for value in part:
            yield from references(value)


def resolved(reference: str) -> Any:
    found: Any = DOCUMENT
    for step in reference.removeprefix("#/").split("/"):
        found = found[step]
    return found


def test_every_reference_leads_somewhere() -> None:
    found = set(references(DOCUMENT))
    assert found
    for reference in found:
        assert resolved(reference) is not None


def test_every_schema_is_one() -> None:
    for schema in DOCUMENT["components"]["schemas"].values():
        meta.validate(schema)


def test_every_command_has_its_channel_and_its_answer() -> None:
    for name in COMMANDS:
        assert DOCUMENT["operations"][name]["action"] == "receive"
        answer = DOCUMENT["operations"][name]["reply"]["channel"]["$ref"]
        assert resolved(answer)["address"] == f"site/fleet/hosts/{{host}}/commands/{name}/answer"


def test_parameters_are_those_of_the_address() -> None:
    for channel in channels(FleetTopics()):
        in_address = {part[1:-1] for part in channel.address.split("/") if part.startswith("{")}
        assert in_address == set(channel.parameters)


async def test_document_is_served(client: httpx.AsyncClient) -> None:
    answer = await client.get("/asyncapi.json")
    assert answer.json() == json.loads(json.dumps(document(FleetTopics())))
