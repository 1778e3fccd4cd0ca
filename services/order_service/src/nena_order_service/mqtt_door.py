"""The MQTT door: hosts ask for transport orders by publishing, and hear of every change."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from dataclasses import dataclass
from http import HTTPStatus

from pydantic import BaseModel

from nena_order_service.api.problems import FORESEEN, problem_of
from nena_order_service.ended_orders import EndedOrders
from nena_order_service.engine import Engine
from nena_order_service.host_requests import HostRequests
from nena_order_service.mqtt_limits import MqttLimits
from nena_order_service.mqtt_requests import read_request, text_in
from nena_shared.fleet_api.epoch import with_epoch
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import (
    CreationAnswer,
    OrderSequenceStatus,
    Problem,
    TransportOrderRequest,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.log import get_logger
from nena_shared.mqtt import Inbound, MqttLink, Outbound
from nena_shared.tasks import end

log = get_logger(__name__)


@dataclass(slots=True)
class DoorCounters:
    """What came through the door."""

    requests: int = 0
    malformed: int = 0
    refused: int = 0


class MqttDoor:
    """Takes creation requests, and tells orders, vehicles and the plant model, retained.

    A retained request is refused: the broker would deliver it again at each connect.
    """

    def __init__(
        self,
        mqtt: MqttLink,
        topics: FleetTopics,
        engine: Engine,
        requests: HostRequests,
        *,
        plant_json: bytes,
        limits: MqttLimits,
        max_body: int,
        end_kept: float,
        epoch: int = 0,
    ) -> None:
        self._mqtt = mqtt
        self._topics = topics
        self._engine = engine
        self._requests = requests
        self._plant_json = plant_json
        self._epoch = epoch
        self._limits = limits
        self._max_body = max_body
        self._ended = EndedOrders(end_kept, self._clear)
        self._tasks: set[asyncio.Task[None]] = set()
        self.counters = DoorCounters()
        mqtt.subscribe(topics.creation_requests, self._request_came)

    def greeting(self) -> Iterator[Outbound]:
        """Give what a broker that may have lost everything is told at each connect."""
        yield Outbound(self._topics.plant_model, self._plant_json, retain=True)
        for vehicle in self._engine.registry:
            yield self._of_vehicle(self._engine.status(vehicle))
        for sequence in self._engine.state.sequences.unfinished():
            yield self._of_sequence(sequence.status)
        for order in self._engine.state.orders.unfinished():
            yield self._of_order(order.status)
        for status in self._ended.statuses():
            yield self._of_order(status)

    def order_changed(self, status: TransportOrderStatus) -> None:
        """Tell an order's new version; the topic is cleared some time after the last one."""
        self._mqtt.publish(self._of_order(status))
        if status.state.final:
            self._ended.add(status)

    def sequence_changed(self, status: OrderSequenceStatus) -> None:
        """Tell an order sequence's new version; the last one is followed by what clears the topic."""
        self._mqtt.publish(self._of_sequence(status))
        if status.finished:
            self._mqtt.publish(Outbound(self._topics.sequence_status(status.name), b"", retain=True))

    def vehicle_changed(self, status: VehicleStatus) -> None:
        """Tell how a vehicle stands."""
        self._mqtt.publish(self._of_vehicle(status))

    async def close(self) -> None:
        """End the work on requests. Ends that are retained stay so: the next start clears them."""
        self._ended.close()
        await end(*self._tasks)

    def _clear(self, name: str) -> None:
        self._mqtt.publish(Outbound(self._topics.order_status(name), b"", retain=True))

    def _of_order(self, status: TransportOrderStatus) -> Outbound:
        return self._status(self._topics.order_status(status.name), status)

    def _of_sequence(self, status: OrderSequenceStatus) -> Outbound:
        return self._status(self._topics.sequence_status(status.name), status)

    def _of_vehicle(self, status: VehicleStatus) -> Outbound:
        return self._status(self._topics.vehicle_status(status.serial_number), status)

    def _status(self, topic: str, status: BaseModel) -> Outbound:
        body = status.model_dump_json(by_alias=True).encode()
        return Outbound(topic, with_epoch(body, self._epoch), retain=True)

    def _request_came(self, message: Inbound) -> None:
        if not message.payload:
            return  # somebody clears a retained request
        host = self._topics.host_of(message.topic)
        self.counters.requests += 1
        if problem := self._limits.refusal(host, len(self._tasks)):
            self._refuse(host, message, problem)
            return
        request = read_request(message, TransportOrderRequest, max_body=self._max_body)
        if isinstance(request, Problem):
            self.counters.malformed += 1
            log.warning("creation request refused", host=host, reason=request.detail, errors=request.errors)
            self._refuse(host, message, request)
        else:
            task = asyncio.create_task(self._create(host, message, request), name=f"creation for {host}")
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _create(self, host: str, message: Inbound, request: TransportOrderRequest) -> None:
        try:
            order, new = await self._requests.create(request)
        except Exception as error:
            if not isinstance(error, FORESEEN):
                log.exception("creation request failed", host=host)
            self.counters.refused += 1
            self._refuse(host, message, problem_of(error))
        else:
            status = HTTPStatus.CREATED if new else HTTPStatus.OK
            answer = CreationAnswer(
                status=status,
                name=order.name,
                idempotency_key=request.idempotency_key,
                transport_order=order,
            )
            self._answer(host, answer)

    def _refuse(self, host: str, message: Inbound, problem: Problem) -> None:
        answer = CreationAnswer(
            status=problem.status,
            name=text_in(message, "name", max_body=self._max_body),
            idempotency_key=text_in(message, "idempotencyKey", max_body=self._max_body),
            problem=problem,
        )
        self._answer(host, answer)

    def _answer(self, host: str, answer: CreationAnswer) -> None:
        body = answer.model_dump_json(by_alias=True, exclude_none=True).encode()
        self._mqtt.publish(Outbound(self._topics.creation_answer(host), body))
