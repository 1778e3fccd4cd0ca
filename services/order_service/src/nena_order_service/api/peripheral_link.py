"""Peripheral devices over MQTT: jobs go out, answers and states come in."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TypeVar

from pydantic import BaseModel, ValidationError

from nena_order_service.engine.engine import Engine
from nena_shared.fleet_api.peripherals import (
    DeviceAnswer,
    DeviceCancellation,
    DeviceReport,
    DeviceRequest,
    PeripheralState,
)
from nena_shared.fleet_api.topics import FleetTopics, PeripheralTopic
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.vda5050.malformed import problems_of

log = get_logger(__name__)

M = TypeVar("M", bound=BaseModel)

LONGEST = 16_384
"""Maximum length of a device's message, bytes."""


class PeripheralLink:
    """Connects peripheral devices with the engine; call all methods in the event loop's thread."""

    def __init__(self, mqtt: MqttLink, topics: FleetTopics, engine: Engine) -> None:
        self._mqtt = mqtt
        self._topics = topics
        self._engine = engine
        engine.peripherals.ports.append(self)
        mqtt.subscribe(topics.all_peripherals(PeripheralTopic.JOB_STATE), self._handle_answer)
        mqtt.subscribe(topics.all_peripherals(PeripheralTopic.STATE), self._handle_report)
        mqtt.subscribe(topics.all_peripherals(PeripheralTopic.STATUS), self._clear_retained)
        for location in engine.peripherals.operations:
            mqtt.subscribe_by_name(topics.peripheral(location, PeripheralTopic.STATE))

    def request(self, location: str, request: DeviceRequest) -> None:
        """Ask a device to execute a job."""
        self._mqtt.publish(self._make_message(location, PeripheralTopic.JOB, request))

    def cancel(self, location: str, cancellation: DeviceCancellation) -> None:
        """Tell a device that a job is no longer needed."""
        self._mqtt.publish(self._make_message(location, PeripheralTopic.CANCEL, cancellation))

    def greeting(self) -> Iterator[Outbound]:
        """Yield the messages for a new connection: the jobs under way, once more."""
        # 0052: a device repeats its answer to a jobId that it knows, and executes nothing twice.
        for location, request in self._engine.peripherals.requests_under_way():
            yield self._make_message(location, PeripheralTopic.JOB, request)

    def _handle_answer(self, message: Inbound) -> None:
        if message.payload and (answer := self._read_message(message, DeviceAnswer)):
            self._engine.on_device_answer(self._topics.name_in(message.topic), answer)

    def _handle_report(self, message: Inbound) -> None:
        location = self._topics.name_in(message.topic)
        if not message.payload:  # the device has cleared its state
            self._engine.on_device_state(location, PeripheralState.UNKNOWN)
        elif report := self._read_message(message, DeviceReport):
            self._engine.on_device_state(location, report.state)

    def _clear_retained(self, message: Inbound) -> None:
        """Clear the retained status of a device that the plant no longer has."""
        location = self._topics.name_in(message.topic)
        if message.payload and location not in self._engine.peripherals.operations:
            self._mqtt.publish(Outbound(message.topic, b"", retain=True))

    def _read_message(self, message: Inbound, model: type[M]) -> M | None:
        if len(message.payload) > LONGEST:
            self._count_malformed()
            log.warning("message of a peripheral device is too long", topic=message.topic)
            return None
        try:
            return model.model_validate_json(message.payload)
        except ValidationError as error:
            self._count_malformed()
            log.warning(
                "message of a peripheral device is unreadable",
                topic=message.topic,
                problems=problems_of(error),
            )
            return None

    def _count_malformed(self) -> None:
        self._engine.peripherals.answers["malformed"] += 1

    def _make_message(self, location: str, topic: PeripheralTopic, body: BaseModel) -> Outbound:
        payload = body.model_dump_json(by_alias=True, exclude_none=True).encode()
        return Outbound(self._topics.peripheral(location, topic), payload)
