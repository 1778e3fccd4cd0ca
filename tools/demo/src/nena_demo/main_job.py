"""The main job: two transport orders, one over REST and one over MQTT, carried out by two robots."""

from __future__ import annotations

import uuid

from nena_demo.host import Host
from nena_shared.fleet_api.transport_order import (
    Destination,
    TransportOrderRequest,
    TransportOrderState,
    TransportOrderStatus,
)

ROBOTS_SECONDS = 60.0
ORDERS_SECONDS = 300.0


class JobFailedError(Exception):
    """Something stood still or ended badly; the text says what, and what was last known of it."""


def transport(load_at: str, unload_at: str) -> TransportOrderRequest:
    """Make the request to carry something from one location to another."""
    return TransportOrderRequest(
        name="Transport-" + uuid.uuid4().hex[:8],
        idempotency_key=uuid.uuid4().hex,
        type="Transport",
        destinations=(
            Destination(location_name=load_at, operation="Load cargo"),
            Destination(location_name=unload_at, operation="Unload cargo"),
        ),
    )


async def wait_for_robots(host: Host, count: int) -> None:
    """Wait until ``count`` vehicles are idle and know where they are.

    Raises:
        JobFailedError: they are not, in time; with what each of them waits for.

    """
    try:
        await host.wait_for(
            lambda: sum(_can_work(host, name) for name in host.vehicles) >= count, ROBOTS_SECONDS
        )
    except TimeoutError as error:
        known = [
            f"{each.name}: {each.connection} {each.state}, {each.reason}" for each in host.vehicles.values()
        ]
        message = f"not all of {count} robots became ready within {ROBOTS_SECONDS:.0f} s. " + (
            "; ".join(known) or "The order service told of no vehicle."
        )
        raise JobFailedError(message) from error


async def run(host: Host) -> tuple[TransportOrderStatus, ...]:
    """Give the two orders and wait for their ends.

    Raises:
        JobFailedError: one of them did not end in FINISHED in time.

    """
    first = await host.create_by_rest(transport("Goods in", "Storage"))
    second = await host.create_by_mqtt(transport("Storage", "Goods out"))
    names = (first.name, second.name)
    try:
        await host.wait_for(lambda: all(_ended(host, name) for name in names), ORDERS_SECONDS)
    except TimeoutError as error:
        raise JobFailedError(_standstill(host, names)) from error
    orders = tuple(host.orders[name] for name in names)
    for order in orders:
        if order.state is not TransportOrderState.FINISHED:
            message = f"{order.name} ended as {order.state}: {order.reason}"
            raise JobFailedError(message)
    return orders


def _can_work(host: Host, name: str) -> bool:
    vehicle = host.vehicles[name]
    return vehicle.connection == "ONLINE" and vehicle.state == "IDLE" and vehicle.current_position is not None


def _ended(host: Host, name: str) -> bool:
    return name in host.orders and host.orders[name].state.final


def _standstill(host: Host, names: tuple[str, ...]) -> str:
    lines = [f"not done within {ORDERS_SECONDS:.0f} s:"]
    for name in names:
        order = host.orders.get(name)
        lines.append(
            f"  {name}: {order.state}, {order.reason}" if order else f"  {name}: nothing was told of it"
        )
    lines += [f"  {each.name}: {each.state}, {each.reason}" for each in host.vehicles.values()]
    return "\n".join(lines)
