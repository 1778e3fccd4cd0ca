"""Describe the MQTT API as an AsyncAPI 3.0 document, generated from its topics and bodies."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

from pydantic import BaseModel
from pydantic.json_schema import JsonSchemaMode, models_json_schema

from nena_order_service.api.mqtt import COMMANDS, CommandAnswer
from nena_shared.fleet_api import operations as table
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceReport,
    DeviceRequest,
    PeripheralStatus,
)
from nena_shared.fleet_api.refusals import Refusal, by_status
from nena_shared.fleet_api.service_status import HEARTBEAT, ServiceStatus
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.fleet_api.transport_order import (
    CreationAnswer,
    OrderSequenceStatus,
    TransportOrderRequest,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus

ENCODED = (
    "in which `% / + # . * >`, spaces, invisible characters and a leading `$` are percent-encoded (UTF-8)"
)
PARAMETERS = {
    "host": f"Name chosen by the host, {ENCODED}. It is answered below the level that it has used.",
    "transportOrder": f"Name of a transport order, {ENCODED}.",
    "orderSequence": f"Name of an order sequence, {ENCODED}.",
    "location": f"Location of a peripheral device, {ENCODED}.",
    "serialNumber": f"Serial number of a vehicle's robot, {ENCODED}.",
}

EPOCH = {
    "type": "integer",
    "minimum": 0,
    "description": "Rises with each start and takeover; readers ignore statuses of an older epoch.",
}


@dataclass(frozen=True, slots=True)
class Channel:
    """One kind of topic in the document."""

    name: str
    address: str
    action: Literal["send", "receive"]
    """Whether the order service sends or receives there."""
    body: type[BaseModel] | None
    """Model of the message; None: the plant model, which has its own schema."""
    summary: str
    retained: bool = False
    refusals: tuple[Refusal, ...] = ()
    answered: bool = True
    """Whether the order service answers what it receives."""

    @property
    def parameters(self) -> tuple[str, ...]:
        """Parameters in the address."""
        return tuple(name for name in PARAMETERS if f"{{{name}}}" in self.address)


def channels(topics: FleetTopics) -> tuple[Channel, ...]:
    """Return all channels."""
    host = "{host}"
    return (
        _command_channel("create", topics.creation_request(host), TransportOrderRequest, table.CREATE_ORDER),
        Channel("createAnswer", topics.creation_answer(host), "send", CreationAnswer, "Answers create."),
        *_command_channels(topics),
        *_status_channels(topics),
        *_device_channels(topics),
    )


def _device_channels(topics: FleetTopics) -> tuple[Channel, ...]:
    """Return the channels of peripheral devices."""
    location = "{location}"
    return (
        Channel(
            "deviceJob",
            topics.peripheral(location, PeripheralTopic.JOB),
            "send",
            DeviceRequest,
            "Asks a device to execute a job. Repeated with the same jobId if there is no answer.",
        ),
        Channel(
            "deviceCancel",
            topics.peripheral(location, PeripheralTopic.CANCEL),
            "send",
            DeviceCancellation,
            "Tells a device that a job is no longer needed.",
        ),
        Channel(
            "deviceJobState",
            topics.peripheral(location, PeripheralTopic.JOB_STATE),
            "receive",
            DeviceAnswer,
            "A device's answer about a job.",
            answered=False,
        ),
        Channel(
            "deviceState",
            topics.peripheral(location, PeripheralTopic.STATE),
            "receive",
            DeviceReport,
            "A device's own state, retained; its last will reports UNAVAILABLE.",
            answered=False,
        ),
        Channel(
            "peripheralStatus",
            topics.peripheral(location, PeripheralTopic.STATUS),
            "send",
            PeripheralStatus,
            "Each change of a device and its job.",
            retained=True,
        ),
    )


def _status_channels(topics: FleetTopics) -> tuple[Channel, ...]:
    """Return the channels on which the order service publishes retained statuses."""
    return (
        Channel(
            "transportOrderStatus",
            topics.order_status("{transportOrder}"),
            "send",
            TransportOrderStatus,
            "Each change of an order, retained; an empty message clears it end_kept s after the last.",
            retained=True,
        ),
        Channel(
            "orderSequenceStatus",
            topics.sequence_status("{orderSequence}"),
            "send",
            OrderSequenceStatus,
            "Each change of an order sequence, retained until it is finished; an empty message clears it.",
            retained=True,
        ),
        Channel(
            "vehicleStatus",
            topics.vehicle_status("{serialNumber}"),
            "send",
            VehicleStatus,
            "Each change of a vehicle.",
            retained=True,
        ),
        Channel(
            "serviceStatus",
            topics.service_status,
            "send",
            ServiceStatus,
            f"Heartbeat of the order service, every {HEARTBEAT:g} s, and its last will.",
            retained=True,
        ),
        Channel(
            "plantModel",
            topics.plant_model,
            "send",
            None,
            "The plant model as NeNa writes it; lengths in mm, angles in degrees.",
            retained=True,
        ),
    )


def _command_channels(topics: FleetTopics) -> Iterator[Channel]:
    for name, body in COMMANDS.items():
        yield _command_channel(name, topics.command("{host}", name), body, table.COMMANDS[name])
        answer = topics.command_answer("{host}", name)
        yield Channel(f"{name}Answer", answer, "send", CommandAnswer, f"Answers {name}.")


def _command_channel(
    name: str, topic: str, body: type[BaseModel], operation: table.Operation[Any]
) -> Channel:
    return Channel(name, topic, "receive", body, operation.summary, refusals=operation.refusals)


def document(topics: FleetTopics) -> dict[str, Any]:
    """Return the AsyncAPI document."""
    described = channels(topics)
    return {
        "asyncapi": "3.0.0",
        "info": {
            "title": "NeNa order service",
            "version": "1",
            "description": "Transport orders and vehicles over MQTT 3.1.1, quality of service 1.",
        },
        "defaultContentType": "application/json",
        "channels": {each.name: _channel_object(each) for each in described},
        "operations": {each.name: _operation_object(each) for each in described},
        "components": {
            "messages": {each.name: _message_object(each) for each in described},
            "schemas": _schema_objects(described),
        },
    }


def _channel_object(channel: Channel) -> dict[str, Any]:
    return {
        "address": channel.address,
        "description": channel.summary,
        "parameters": {name: {"description": PARAMETERS[name]} for name in channel.parameters},
        "messages": {channel.name: {"$ref": f"#/components/messages/{channel.name}"}},
    }


def _operation_object(channel: Channel) -> dict[str, Any]:
    described: dict[str, Any] = {
        "action": channel.action,
        "channel": {"$ref": f"#/channels/{channel.name}"},
        "summary": channel.summary,
        "messages": [{"$ref": f"#/channels/{channel.name}/messages/{channel.name}"}],
        "bindings": {"mqtt": {"qos": 1, "retain": channel.retained}},
    }
    if channel.refusals:
        texts = by_status(channel.refusals)
        described["description"] = "\n".join(f"- {status.value}: {text}" for status, text in texts.items())
    if channel.action == "receive" and channel.answered:
        described["reply"] = {"channel": {"$ref": f"#/channels/{channel.name}Answer"}}
    return described


def _message_object(channel: Channel) -> dict[str, Any]:
    schema: dict[str, Any] = {"type": "object"}
    if channel.body:
        schema = {"$ref": f"#/components/schemas/{channel.body.__name__}"}
        if channel.retained:
            # The epoch is added to the JSON when it is published, so no model has the field.
            schema = {"allOf": [schema, {"type": "object", "properties": {"epoch": EPOCH}}]}
    return {"name": channel.name, "contentType": "application/json", "payload": schema}


def _schema_objects(described: tuple[Channel, ...]) -> dict[str, Any]:
    modes: dict[type[BaseModel], JsonSchemaMode] = {
        each.body: "validation" if each.action == "receive" else "serialization"
        for each in described
        if each.body
    }
    return _schema_definitions(tuple(modes.items()))


@cache
def _schema_definitions(modes: tuple[tuple[type[BaseModel], JsonSchemaMode], ...]) -> dict[str, Any]:
    """Return the schemas of these models; cached, because each change of the plant model needs them."""
    _, definitions = models_json_schema(modes, ref_template="#/components/schemas/{model}")
    schemas: dict[str, Any] = definitions["$defs"]
    return schemas
