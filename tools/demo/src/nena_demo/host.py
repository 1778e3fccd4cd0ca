"""A small host system, and the main job: two transport orders, one over REST and one over MQTT."""

from __future__ import annotations

import asyncio
import uuid
from collections.abc import Callable, Sequence

import httpx
from pydantic import BaseModel, ValidationError

from nena_shared.fleet_api.epoch import EpochFilter
from nena_shared.fleet_api.topics import FleetTopics
from nena_shared.fleet_api.transport_order import (
    CreationAnswer,
    Destination,
    TransportOrderBatch,
    TransportOrderBatchAnswer,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.mqtt import Inbound, LinkHooks, MqttLink, Outbound
from nena_shared.settings import MqttSettings

HOST_ID = "demo-host"
ANSWER_SECONDS = 10.0
CANNOT_DRIVE = "navigationNotAvailable"
"""The error of a robot whose agent has not found Nav2 yet."""


class RefusedError(Exception):
    """The order service rejected a request; the message is its text."""


class Host:
    """Follow all orders and vehicles by MQTT, and call ``on_change`` for each change."""

    def __init__(
        self, broker: MqttSettings, rest_url: str, on_change: Callable[[str, str, str, str], None]
    ) -> None:
        """``on_change(kind, name, state, reason)`` is called on changes; kind is ``order`` or ``vehicle``."""
        self._topics = FleetTopics()
        self._epochs = EpochFilter()
        self._on_change = on_change
        self._changed = asyncio.Event()
        self._answers: dict[str, CreationAnswer] = {}
        self.rest = httpx.AsyncClient(base_url=rest_url, timeout=ANSWER_SECONDS)
        self.orders: dict[str, TransportOrderStatus] = {}
        self.vehicles: dict[str, VehicleStatus] = {}
        self.link = MqttLink(broker, client_id="nena-demo-host", hooks=LinkHooks(on_lost=self._epochs.reset))
        self.link.subscribe(self._topics.creation_answer(HOST_ID), self._on_answer)
        self.link.subscribe(self._topics.all_order_statuses, self._on_order)
        self.link.subscribe(self._topics.all_vehicle_statuses, self._on_vehicle)

    async def create_by_rest(self, request: TransportOrderRequest) -> TransportOrderStatus:
        """Create an order over REST.

        Raises:
            RefusedError: with the order service's text.
        """
        answer = await self.rest.post("/v1/transportOrders", content=_body_of(request), headers=_JSON)
        if answer.is_error:
            raise RefusedError(answer.text)
        return TransportOrderStatus.model_validate_json(answer.content)

    async def create_many(self, requests: Sequence[TransportOrderRequest]) -> set[str]:
        """Create orders over REST; return the names of those that were accepted.

        Raises:
            httpx.HTTPError: the order service does not answer, or refuses all of them.
        """
        batch = TransportOrderBatch(transport_orders=tuple(requests))
        answer = await self.rest.post("/v1/transportOrders/batch", content=_body_of(batch), headers=_JSON)
        answer.raise_for_status()
        results = TransportOrderBatchAnswer.model_validate_json(answer.content).results
        return {result.transport_order.name for result in results if result.transport_order}

    async def create_by_mqtt(self, request: TransportOrderRequest) -> TransportOrderStatus:
        """Create an order over MQTT and wait for the answer; ``request`` needs an idempotency key.

        Raises:
            RefusedError: with the order service's text, or because there was no answer.
        """
        key = request.idempotency_key or ""
        self.link.publish(Outbound(self._topics.creation_request(HOST_ID), _body_of(request)))
        try:
            await self.wait_for(lambda: key in self._answers, ANSWER_SECONDS)
        except TimeoutError as error:
            raise RefusedError(
                f"no answer over MQTT within {ANSWER_SECONDS:.0f} s to the request for {request.name}"
            ) from error
        answer = self._answers.pop(key)
        if answer.transport_order is None:
            raise RefusedError(answer.problem.detail if answer.problem else "refused without a reason")
        return answer.transport_order

    async def wait_for(self, condition: Callable[[], bool], seconds: float) -> None:
        """Wait until ``condition`` holds; it is evaluated after each message.

        Raises:
            TimeoutError: it does not hold in time.
        """
        async with asyncio.timeout(seconds):
            while not condition():
                # No message is missed: handlers run in this loop, and nothing is awaited since the check.
                self._changed.clear()
                await self._changed.wait()

    def _on_answer(self, message: Inbound) -> None:
        answer = CreationAnswer.model_validate_json(message.payload)
        self._answers[answer.idempotency_key or ""] = answer
        self._changed.set()

    def _on_order(self, message: Inbound) -> None:
        if not message.payload or not self._epochs.is_current(message.payload):
            return  # the retained status of an ended order is cleared
        order = TransportOrderStatus.model_validate_json(message.payload)
        before = self.orders.get(order.name)
        self.orders[order.name] = order
        self._changed.set()
        if before is None or before.state != order.state:
            self._on_change("order", order.name, order.state, order.reason)

    def _on_vehicle(self, message: Inbound) -> None:
        if not self._epochs.is_current(message.payload):
            return
        try:
            vehicle = VehicleStatus.model_validate_json(message.payload)
        except ValidationError:
            return  # an empty message clears a removed vehicle
        before = self.vehicles.get(vehicle.name)
        self.vehicles[vehicle.name] = vehicle
        self._changed.set()
        if before is None or (before.state, before.connection) != (vehicle.state, vehicle.connection):
            self._on_change("vehicle", vehicle.name, f"{vehicle.connection} {vehicle.state}", vehicle.reason)


_JSON = {"Content-Type": "application/json"}


def _body_of(request: BaseModel) -> bytes:
    return request.model_dump_json(by_alias=True, exclude_none=True).encode()


ROBOTS_SECONDS = 300.0
ORDERS_SECONDS = 300.0


class JobFailedError(Exception):
    """An order stalled or failed; the message names it and its last known state."""


def transport(load_at: str, unload_at: str, name: str | None = None) -> TransportOrderRequest:
    """Return a request to carry a load from one location to another."""
    return TransportOrderRequest(
        name=name or "Transport-" + uuid.uuid4().hex[:8],
        idempotency_key=uuid.uuid4().hex,
        type="Transport",
        destinations=(
            Destination(location_name=load_at, operation="Load cargo"),
            Destination(location_name=unload_at, operation="Unload cargo"),
        ),
    )


async def wait_for_robots(host: Host, count: int) -> None:
    """Wait until ``count`` vehicles are idle, localised, and can drive.

    Raises:
        JobFailedError: they are not in time; the message says what each of them waits for.
    """
    try:
        await host.wait_for(lambda: sum(map(can_work, host.vehicles.values())) >= count, ROBOTS_SECONDS)
    except TimeoutError as error:
        known = [
            f"{vehicle.name}: {vehicle.connection} {vehicle.state}, {vehicle.reason}"
            for vehicle in host.vehicles.values()
        ]
        raise JobFailedError(
            f"not all of {count} robots became ready within {ROBOTS_SECONDS:.0f} s. "
            + ("; ".join(known) or "The order service reported no vehicle.")
        ) from error


async def run(host: Host) -> tuple[TransportOrderStatus, ...]:
    """Create the two orders and wait until they end.

    Raises:
        JobFailedError: one of them did not end in FINISHED in time.
    """
    first = await host.create_by_rest(transport("Goods in", "Storage"))
    second = await host.create_by_mqtt(transport("Storage", "Goods out"))
    names = (first.name, second.name)
    try:
        await host.wait_for(lambda: all(_has_ended(host, name) for name in names), ORDERS_SECONDS)
    except TimeoutError as error:
        raise JobFailedError(_describe_standstill(host, names)) from error
    orders = tuple(host.orders[name] for name in names)
    for order in orders:
        if order.state is not TransportOrderState.FINISHED:
            raise JobFailedError(f"{order.name} ended as {order.state}: {order.reason}")
    return orders


def can_work(vehicle: VehicleStatus) -> bool:
    """Return whether a vehicle is idle, localised, and can drive."""
    drives = not any(CANNOT_DRIVE in error for error in vehicle.errors)
    there = vehicle.connection == "ONLINE" and vehicle.current_position is not None
    return there and drives and vehicle.state == "IDLE"


def _has_ended(host: Host, name: str) -> bool:
    return name in host.orders and host.orders[name].state.final


def _describe_standstill(host: Host, names: tuple[str, ...]) -> str:
    lines = [f"not finished within {ORDERS_SECONDS:.0f} s:"]
    for name in names:
        order = host.orders.get(name)
        lines.append(f"  {name}: {order.state}, {order.reason}" if order else f"  {name}: no status received")
    lines += [f"  {vehicle.name}: {vehicle.state}, {vehicle.reason}" for vehicle in host.vehicles.values()]
    return "\n".join(lines)
