"""The metrics of the order service, each defined once with its source.

To add one: count it where it happens, read it here, and run ``make reference``.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from http import HTTPStatus
from importlib.metadata import version
from time import time
from typing import Any, ClassVar, Final, Protocol

from nena_order_service.api.events import EventStream
from nena_order_service.api.mqtt import MqttApi
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.link import FleetLink
from nena_order_service.fleet.robot import LinkStatus
from nena_order_service.peripherals.devices import Verdict
from nena_order_service.settings import DISTRIBUTION
from nena_order_service.store.store import Store
from nena_shared.certificates import Certificates
from nena_shared.fleet_api.peripherals import PeripheralJobState, PeripheralState
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.fleet_api.vehicle import IntegrationLevel, VehicleState
from nena_shared.loop_lag import LoopLag
from nena_shared.metrics import (
    Exposition,
    LabelValues,
    Section,
    certificate_metrics,
    counter,
    gauge,
    histogram,
    link_metrics,
)
from nena_shared.mqtt import MqttLink


class Running(Protocol):
    """An order service in any role."""

    @property
    def leads(self) -> bool:
        """Return whether this is the active instance, which accepts orders and commands robots."""
        ...

    @property
    def store_ready(self) -> bool:
        """Whether the store can be written."""
        ...


class HasSection(Protocol):
    """A part of the order service with metrics of its own."""

    section: ClassVar[Section[Any] | None]


@dataclass(frozen=True, slots=True)
class Waiting:
    """An order service that is starting or on standby."""

    store_ready: bool
    leads: bool = False


class Monitored(Running, Protocol):
    """The leading order service, as far as metrics are read from it."""

    engine: Engine
    fleet: FleetLink
    store: Store
    mqtt: MqttLink
    mqtt_api: MqttApi
    stream: EventStream
    loop_lag: LoopLag
    answers: Mapping[int, int]
    """Number of HTTP answers by status."""
    certificates: Certificates


LIMITED: Final = str(HTTPStatus.TOO_MANY_REQUESTS.value)


def _count_answers(service: Monitored) -> Mapping[LabelValues, float]:
    doors = (("rest", service.answers), ("mqtt", service.mqtt_api.answers))
    # present from the start: for Prometheus, the first value of a series is not an increase
    limited: dict[LabelValues, float] = {(door, LIMITED): 0 for door, _ in doors}
    return limited | {
        (door, str(status)): count for door, counts in doors for status, count in counts.items()
    }


def _count_waits(service: Monitored) -> Mapping[LabelValues, float]:
    traffic = service.engine.traffic
    return {
        **{cause.value: count for cause, count in service.engine.state.orders.statistics.waits.items()},
        "robot": service.fleet.statistics.undelivered,
        "traffic": sum(bool(traffic.refusal_of(each)) for each in traffic.waiting_vehicles),
    }


def _oldest_age(service: Monitored) -> float:
    orders = service.engine.state.orders
    oldest = orders.waiting.oldest
    return max(0.0, time() - orders.get(oldest).status.created.timestamp()) if oldest is not None else 0.0


def _by_value(values: Iterable[str], known: Iterable[str]) -> Mapping[LabelValues, float]:
    counts = Counter(values)
    return {each: counts[each] for each in known}


def _list_values(values: Iterable[str]) -> str:
    return ", ".join(f"`{each}`" for each in values) + "."


PROGRAM: Final[Section[Running]] = Section(
    "Program",
    (
        gauge("nena_build_info", "Always 1.", lambda _: {version(DISTRIBUTION): 1}, "version"),
        gauge(
            "nena_order_service_leader",
            "1 in the active order service; 0 in a standby, during the start, and while the lease is "
            "uncertain.",
            lambda s: s.leads,
        ),
        gauge("nena_order_service_store_ready", "1 while the store can be written.", lambda s: s.store_ready),
    ),
    "These exist in every role. A standby, and an order service that waits for its store, have no others.",
)

ORDERS: Final[Section[Monitored]] = Section(
    "Transport orders",
    (
        gauge(
            "nena_order_service_orders",
            "Orders that have not ended.",
            lambda s: s.engine.state.orders.statistics.present,
            "state",
        ),
        counter(
            "nena_order_service_orders_created_total",
            "Orders created by hosts or by the order service itself.",
            lambda s: s.engine.state.orders.statistics.created,
        ),
        counter(
            "nena_order_service_orders_ended_total",
            "Orders that ended, by their outcome.",
            lambda s: s.engine.state.orders.statistics.ended,
            "state",
        ),
        counter(
            "nena_order_service_orders_late_total",
            "Orders whose deadline passed before their end.",
            lambda s: s.engine.state.orders.statistics.late,
        ),
        counter(
            "nena_order_service_order_events_total",
            "Entries of the orders' histories, by their event codes: what was retried, rerouted, held.",
            lambda s: s.engine.state.orders.statistics.events,
            "event",
        ),
        gauge(
            "nena_order_service_sequences",
            "Order sequences that are not finished.",
            lambda s: sum(1 for _ in s.engine.state.sequences.unfinished()),
        ),
        gauge(
            "nena_order_service_queue_length",
            "Orders that wait for a vehicle, held ones included.",
            lambda s: len(s.engine.state.orders.waiting),
        ),
        gauge(
            "nena_order_service_queue_oldest_seconds",
            "Age of the oldest order that waits for a vehicle, held ones included: time since its creation; "
            "0: none waits.",
            _oldest_age,
        ),
        gauge(
            "nena_order_service_waiting",
            "Waiting orders and robots, by cause: orders for a `dependency`, a `vehicle`, a `retry` or the "
            "end of a `hold`; VDA 5050 orders until the `robot` accepts them; robots for `traffic`.",
            _count_waits,
            "cause",
        ),
        histogram(
            "nena_order_service_order_assignment_seconds",
            "Time from an order's creation to its first assignment.",
            lambda s: s.engine.state.orders.statistics.assignment,
        ),
        histogram(
            "nena_order_service_order_duration_seconds",
            "Time from an order's creation to its end, by its outcome.",
            lambda s: s.engine.state.orders.statistics.durations,
            "state",
        ),
    ),
    "`state` is the openTCS state: "
    + _list_values(TransportOrderState)
    + " Ended orders have their outcome instead: "
    + _list_values(OrderOutcome)
    + " The codes of `event` are those of [order-service.md](order-service.md).",
)

ROBOTS: Final[Section[Monitored]] = Section(
    "Vehicles and their VDA 5050 orders",
    (
        gauge(
            "nena_order_service_vehicles",
            "Vehicles by state: " + _list_values(VehicleState),
            lambda s: _by_value((each.state for each in s.engine.unit_of_work.published), VehicleState),
            "state",
        ),
        gauge(
            "nena_order_service_vehicle_connections",
            "Vehicles by connection: " + _list_values(LinkStatus),
            lambda s: _by_value((each.connection for each in s.engine.unit_of_work.published), LinkStatus),
            "connection",
        ),
        gauge(
            "nena_order_service_vehicle_levels",
            "Vehicles by integration level: "
            + ", ".join(f"`{level.value}`" for level in IntegrationLevel)
            + ".",
            lambda s: _by_value(
                (each.integration_level for each in s.engine.unit_of_work.published), IntegrationLevel
            ),
            "level",
        ),
        counter(
            "nena_order_service_nodes_passed_total",
            "Nodes that robots have passed.",
            lambda s: s.fleet.statistics.nodes_passed,
        ),
        counter(
            "nena_order_service_vda_orders_ended_total",
            "VDA 5050 orders by outcome: `finished`, `cancelled`, `failed`.",
            lambda s: s.fleet.statistics.ended,
            "outcome",
        ),
        counter(
            "nena_order_service_vda_order_failures_total",
            "VDA 5050 orders that failed, by kind (`FailureKind` in the code).",
            lambda s: s.fleet.statistics.failures,
            "kind",
        ),
        histogram(
            "nena_order_service_vda_order_sending_seconds",
            "Time from the decision to send a VDA 5050 order to its first sending; long if the robot was "
            "not reachable.",
            lambda s: s.fleet.statistics.sending,
        ),
        histogram(
            "nena_order_service_vda_order_acknowledgement_seconds",
            "Time from the first sending to the first state of the robot that echoes the order.",
            lambda s: s.fleet.statistics.acknowledgement,
        ),
        histogram(
            "nena_order_service_vda_order_execution_seconds",
            "Time from the robot's acknowledgement of a VDA 5050 order to its end; finished orders only.",
            lambda s: s.fleet.statistics.execution,
        ),
    ),
)

MESSAGES: Final[Section[Monitored]] = Section(
    "Messages and requests",
    (
        counter(
            "nena_order_service_messages_received_total",
            "Messages received from robots.",
            lambda s: s.fleet.statistics.received,
            "topic",
        ),
        counter(
            "nena_order_service_messages_malformed_total",
            "Messages from robots that could not be read.",
            lambda s: s.fleet.statistics.malformed,
            "topic",
        ),
        counter(
            "nena_order_service_messages_repaired_total",
            "Values that violated VDA 5050 and were repaired.",
            lambda s: s.fleet.deviations.totals,
            "field",
            "kind",
        ),
        counter(
            "nena_order_service_messages_ignored_total",
            "Messages of robots beyond `fleet.robots_limit` (`robot_limit`) or `fleet.messages_per_second` "
            "(`rate`), or whose name is too long (`name_too_long`), and states that are repetitions or older "
            "than the last one (`old_state`).",
            lambda s: {
                "rate": s.fleet.statistics.too_many,
                "robot_limit": s.fleet.statistics.robot_limit,
                "name_too_long": s.fleet.statistics.name_too_long,
                "old_state": s.fleet.statistics.states_ignored,
            },
            "reason",
        ),
        counter(
            "nena_order_service_messages_sent_total",
            "Messages sent to robots.",
            lambda s: s.fleet.statistics.sent,
            "topic",
        ),
        counter(
            "nena_order_service_messages_resent_total",
            "Messages sent again because no state of the robot echoed them.",
            lambda s: s.fleet.statistics.resent,
            "topic",
        ),
        counter(
            "nena_order_service_foreign_commands_total",
            "Commands to robots of this fleet sent by another program.",
            lambda s: s.fleet.statistics.foreign,
        ),
        counter(
            "nena_order_service_requests_total",
            "Requests of hosts by interface (`door`: `rest` or `mqtt`) and answer status; 429: rate limit.",
            _count_answers,
            "door",
            "status",
        ),
        *link_metrics("nena_mqtt_", lambda s: s.mqtt.state),
        *certificate_metrics(lambda s: s.certificates),
        gauge("nena_event_clients", "Clients of the event stream.", lambda s: s.stream.clients),
        counter(
            "nena_order_service_event_overflows_total",
            "Clients of the event stream that were further behind than its backlog.",
            lambda s: s.stream.overflows,
        ),
    ),
)

PERIPHERALS: Final[Section[Monitored]] = Section(
    "Peripheral devices",
    (
        gauge(
            "nena_order_service_peripheral_jobs",
            "Peripheral jobs that have not ended.",
            lambda s: _by_value(
                (each.status.state for each in s.engine.state.peripheral_jobs.unfinished()),
                (state for state in PeripheralJobState if not state.final),
            ),
            "state",
        ),
        counter(
            "nena_order_service_peripheral_jobs_ended_total",
            "Peripheral jobs that ended; withdrawn ones count as FAILED.",
            lambda s: {
                state.value: s.engine.state.peripheral_jobs.ended[state.value]
                for state in PeripheralJobState
                if state.final
            },
            "state",
        ),
        gauge(
            "nena_order_service_peripheral_waits",
            "Vehicles that wait for a peripheral device.",
            lambda s: len(s.engine.peripherals.waiting),
        ),
        gauge(
            "nena_order_service_peripherals",
            "Peripheral devices by state: " + _list_values(PeripheralState),
            lambda s: _by_value(
                (
                    s.engine.peripherals.device_status(location).state
                    for location in s.engine.peripherals.operations
                ),
                PeripheralState,
            ),
            "state",
        ),
        counter(
            "nena_order_service_peripheral_answers_total",
            "Answers of devices: `accepted`, `finished`, `failed`; `ignored` if repeated, late or about an "
            "unknown job; `malformed` if unreadable.",
            lambda s: {
                each: s.engine.peripherals.answers[each]
                for each in (*(verdict.name.lower() for verdict in Verdict), "malformed")
            },
            "verdict",
        ),
    ),
)

WORK: Final[Section[Monitored]] = Section(
    "Store and computing time",
    (
        counter(
            "nena_order_service_commits_total",
            "Commits; each holds all changes that waited.",
            lambda s: s.store.commits,
        ),
        counter(
            "nena_order_service_commit_failures_total",
            "Commits that failed and were retried.",
            lambda s: s.store.failures,
        ),
        gauge(
            "nena_order_service_commits_waiting",
            "Units of work that wait to be committed.",
            lambda s: s.store.waiting,
        ),
        histogram("nena_order_service_commit_seconds", "Time of a commit.", lambda s: s.store.commit_seconds),
        histogram(
            "nena_order_service_dispatch_seconds",
            "Time to decide which vehicles get which of the orders that are due.",
            lambda s: s.engine.timings.dispatch,
        ),
        histogram(
            "nena_order_service_planning_seconds",
            "Time to find a route through the destinations of an order.",
            lambda s: s.engine.context.finder.planning,
        ),
        histogram(
            "nena_order_service_traffic_seconds",
            "Time to decide which vehicles may drive on.",
            lambda s: s.engine.timings.traffic,
        ),
        gauge(
            "nena_event_loop_lag_seconds",
            "Longest delay of the event loop in the last minute.",
            lambda s: s.loop_lag.longest,
        ),
    ),
)

SECTIONS: Final = (PROGRAM, ORDERS, ROBOTS, PERIPHERALS, MESSAGES, WORK)


def standing_by(role: Waiting) -> bytes:
    """Return the metrics of an order service that is not active."""
    return Exposition(role, (PROGRAM,)).text()


def exposition(service: Monitored, extensions: Iterable[HasSection]) -> Callable[[], bytes]:
    """Return a function that writes all metrics: of the order service, of its extensions, of the process."""
    parts = [Exposition(service, SECTIONS)]
    parts += [
        Exposition(extension, (extension.section,), process=False)
        for extension in extensions
        if extension.section
    ]
    return lambda: b"".join(part.text() for part in parts)
