"""Conditions of a fleet, each with what the attention list must contain, for the tests of all its readers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import datetime
from types import MappingProxyType
from typing import Any, Protocol

from nena_shared.fleet_api.attention import Matter
from nena_shared.fleet_api.reasons import CodedReason
from nena_shared.fleet_api.service_status import ServiceStatus
from nena_shared.fleet_api.stops import StopStatus
from nena_shared.fleet_api.traffic import TrafficWait, WaitCause
from nena_shared.fleet_api.transport_order import Hold, OrderOutcome, TransportOrderState
from nena_shared.vda5050.topics import RobotKey
from nena_status_aggregator.fleet.messages import MessageKind
from nena_status_aggregator.fleet.model import FleetModel
from nena_status_aggregator.fleet.robot import Timestamp
from support import fleet_records
from support.clocks import ManualClock
from support.fleet_examples import START, connection, order_status, power, vehicle_status, way


class Site(Protocol):
    """Where robots and the order service publish."""

    @property
    def now(self) -> datetime:
        """The present time of its clock."""

    def robot(self, name: str, vehicle: Mapping[str, Any] = MappingProxyType({}), **state: Any) -> None:
        """Let a robot connect and send a state, and the order service the status of its vehicle."""

    def connection(self, name: str, state: str) -> None:
        """Publish the connection state of a robot."""

    def garble(self, name: str) -> None:
        """Let a robot send a state that nobody can read."""

    def order(self, name: str, state: TransportOrderState, **fields: Any) -> None:
        """Publish the status of an order."""

    def service(self, **fields: Any) -> None:
        """Publish the heartbeat of the order service."""

    def direct_stop(self, stop: StopStatus) -> None:
        """Let the aggregator stop all robots without the order service."""


@dataclass(frozen=True)
class Condition:
    """A condition, and the matters that the list must then contain, as IDs: those of this condition only."""

    name: str
    arrange: Callable[[Site], None]
    matters: tuple[str, ...]
    robots: int = 0
    """Number of robots that the first matter holds up."""
    orders: int = 0
    """Number of orders."""


def key_of(name: str) -> RobotKey:
    """Return the robot of a vehicle."""
    return RobotKey("ACME", name.lower())


def wait_for(*names: str) -> dict[str, Any]:
    """Return the fields of a vehicle that waits for others, with an order."""
    wait = TrafficWait(vehicles=names, at="B", cause=WaitCause.PASSES, reason="it waits")
    return {"wait": wait}


def coded(code: str, *causes: CodedReason, **values: Any) -> CodedReason:
    return CodedReason(code=code, values=values, causes=causes)


def emergency(how: str) -> dict[str, Any]:
    return {"safety_state": {"active_emergency_stop": how, "field_violation": False}}


FATAL: dict[str, Any] = {
    "errors": ({"error_type": "motorFailure", "error_level": "FATAL", "error_description": "It smokes."},)
}
WARNED: dict[str, Any] = {"errors": ({"error_type": "dirtyLens", "error_level": "WARNING"},)}
LOST: dict[str, Any] = {
    "mobile_robot_position": {"x": 1.0, "y": 1.0, "theta": 0.0, "map_id": "hall", "localized": False}
}
NEEDED = coded("idle", coded("must_recharge", level=30))
ON_THE_WAY: dict[str, Any] = {"processing_vehicle": "Charges", "type": "Charge"}
S = TransportOrderState


def queue(site: Site, head: str, *names: str) -> None:
    """Let vehicles wait with orders, each for the one before it; the head has an emergency stop."""
    site.robot(head, **emergency("MANUAL"))
    for ahead, name in zip((head, *names), names, strict=False):
        site.order(f"T-{name}", S.BEING_PROCESSED, processing_vehicle=name)
        site.robot(name, {"transport_order": f"T-{name}", **wait_for(ahead)})


def circle(site: Site, one: str, other: str) -> None:
    site.robot(one, wait_for(other))
    site.robot(other, wait_for(one))


def with_order(site: Site, name: str, **state: Any) -> None:
    """Let a vehicle with an order send a state."""
    site.order(f"T-{name}", S.BEING_PROCESSED, processing_vehicle=name)
    site.robot(name, {"transport_order": f"T-{name}"}, **state)


def away(site: Site, name: str, connection: str, *, order: bool = False) -> None:
    with_order(site, name) if order else site.robot(name)
    site.connection(name, connection)


def charging(site: Site) -> None:
    site.order("Recharge-1", S.BEING_PROCESSED, **ON_THE_WAY)
    site.robot("Charges", {"transport_order": "Recharge-1"}, **power(12.0))


def garbled(site: Site) -> None:
    site.robot("Garbled")
    site.garble("Garbled")


def failed(name: str, **fields: Any) -> Callable[[Site], None]:
    def arrange(site: Site) -> None:
        site.order(name, S.FAILED, finished=site.now, **fields)

    return arrange


def held(site: Site) -> None:
    hold = Hold(by="Anna", reason="goods missing", since=site.now)
    site.order("Held", S.DISPATCHABLE, processing_vehicle=None, held=hold)


def stop_of(site: Site) -> StopStatus:
    return StopStatus(name="Stop-1", by="Anna", reason="visitors", since=site.now)


OWN: tuple[Condition, ...] = (
    Condition("idle", lambda s: s.robot("Idle"), ()),
    Condition("warned", lambda s: s.robot("Warned", **WARNED), ()),
    Condition("manual stop", lambda s: s.robot("Hit", **emergency("MANUAL")), ("emergency_stop:Hit",)),
    Condition("remote stop", lambda s: s.robot("Cut", **emergency("REMOTE")), ("emergency_stop:Cut",)),
    Condition("fatal error", lambda s: with_order(s, "Smoking", **FATAL), ("robot_error:Smoking",), orders=1),
    Condition("position lost", lambda s: s.robot("Lost", **LOST), ("not_localized:Lost",)),
    Condition("unreadable", garbled, ("robot_unreadable:Garbled",)),
    Condition("connection broken", lambda s: away(s, "Broken", "CONNECTION_BROKEN"), ("robot_lost:Broken",)),
    Condition("switched off", lambda s: away(s, "Off", "OFFLINE"), ()),
    Condition(
        "switched off at work",
        lambda s: away(s, "Gone", "OFFLINE", order=True),
        ("robot_offline:Gone",),
        orders=1,
    ),
    Condition(
        "taken out",
        lambda s: s.robot("Out", {"taken_out": True, "reason": "Three orders in a row failed."}),
        ("taken_out:Out",),
    ),
    Condition("by hand", lambda s: s.robot("Serviced", operating_mode="MANUAL"), ()),
    Condition(
        "by hand at work",
        lambda s: with_order(s, "Pushed", operating_mode="MANUAL"),
        ("not_automatic:Pushed",),
        orders=1,
    ),
    Condition(
        "paused at work", lambda s: with_order(s, "Paused", paused=True), ("robot_paused:Paused",), orders=1
    ),
    Condition("low battery", lambda s: s.robot("Weak", **power(12.0)), ("battery_low:Weak",)),
    Condition("charging", lambda s: s.robot("Plugged", **power(12.0, charging=True)), ()),
    Condition("on the way to a charger", charging, ()),
    Condition(
        "no charger",
        lambda s: s.robot("Stranded", {"coded_reason": NEEDED}, **power(28.0)),
        ("battery_low:Stranded",),
    ),
    Condition(
        "jam",
        lambda s: queue(s, "Head", "One", "Two", "Three"),
        ("jam:Head", "emergency_stop:Head"),
        robots=3,
        orders=3,
    ),
    Condition("circle", lambda s: circle(s, "Left", "Right"), ("circle:Left, Right",), robots=2),
    Condition("order failed", failed("Failed"), ("order_failed:Failed",)),
    Condition("order out of time", failed("Timeout", outcome=OrderOutcome.FAILED), ("order_failed:Timeout",)),
    Condition("order withdrawn", failed("Withdrawn", outcome=OrderOutcome.WITHDRAWN), ()),
    Condition("order gave way", failed("Parking", outcome=OrderOutcome.GAVE_WAY), ()),
    Condition("automatic order failed", failed("Park-1", automatic=True), ()),
    Condition(
        "order nowhere", lambda s: s.order("Nowhere", S.UNROUTABLE, finished=s.now), ("order_failed:Nowhere",)
    ),
    Condition("order held", held, ("order_held:Held",), orders=1),
    Condition(
        "order late",
        lambda s: s.order("Late", S.DISPATCHABLE, processing_vehicle=None, late=True),
        ("order_late:Late",),
        orders=1,
    ),
)
"""Conditions of robots and orders: they can all be true at once."""


def locked(site: Site) -> None:
    """Lock a path for which a robot waits with its order."""
    site.service(locked_paths=("A --- B",))
    reason = coded("all", coded("path_locked"))
    site.order("T-Closed", S.BEING_PROCESSED, processing_vehicle="Closed")
    site.robot("Closed", {"transport_order": "T-Closed", "coded_reason": reason}, **way("B", released=0))


def stopped_directly(site: Site) -> None:
    """Stop all robots without the order service, one of them with an order."""
    with_order(site, "Driven", paused=True)
    site.direct_stop(stop_of(site))


SERVICES: tuple[Condition, ...] = (
    Condition("all well", lambda s: s.service(), ()),
    Condition("path locked", locked, ("path_locked:A --- B",), robots=1, orders=1),
    Condition("all stopped", lambda s: s.service(stops=(stop_of(s),)), ("stop:Stop-1",)),
    Condition("all stopped directly", stopped_directly, ("stop:Stop-1",), robots=1, orders=1),
    Condition("database full", lambda s: s.service(store_ready=False), ("store_unavailable",)),
    Condition("order service down", lambda s: s.service(online=False), ("order_service_down",)),
    Condition("weak broker", lambda s: s.service(broker_lacks=("retained",)), ("broker_lacks",)),
)
"""Conditions of the services, of which one excludes the other."""

CONDITIONS = (*OWN, *SERVICES)


def heartbeat(now: datetime, **fields: Any) -> ServiceStatus:
    """Return a heartbeat of the order service."""
    return ServiceStatus.model_validate({"online": True, "timestamp": now, "store_ready": True, **fields})


class ModelSite:
    """A fleet model that gets the messages of a site."""

    def __init__(self, model: FleetModel, clock: ManualClock) -> None:
        self.model = model
        self.clock = clock
        self._number = 0
        self._beat: dict[str, Any] | None = None
        self.model.on_link(connected=True, at=self._at)

    @property
    def now(self) -> datetime:
        return self.clock.now()

    @property
    def _at(self) -> Timestamp:
        return Timestamp.of(self.clock)

    def robot(self, name: str, vehicle: Mapping[str, Any] = MappingProxyType({}), **fields: Any) -> None:
        key = key_of(name)
        self.connection(name, "ONLINE")
        self._number += 1
        message = fleet_records.state(
            self._number, robot=key, at=(self.now - START).total_seconds(), **fields
        )
        self.model.on_state(key, message, self._at)
        self.model.on_vehicle_status(vehicle_status(name, robot=key, **vehicle), self._at)

    def connection(self, name: str, state: str) -> None:
        self.model.on_connection(key_of(name), connection(state, robot=key_of(name)), self._at)

    def garble(self, name: str) -> None:
        self.model.on_malformed(MessageKind.STATE, "topic", "not JSON", self._at, key=key_of(name))

    def order(self, name: str, state: TransportOrderState, **fields: Any) -> None:
        self._number += 1
        self.model.on_order_status(order_status(name, self._number, state, **fields), self._at)

    def service(self, **fields: Any) -> None:
        self._beat = fields
        self.model.on_service_status(heartbeat(self.now, **fields), self._at, retained=False)

    def direct_stop(self, stop: StopStatus) -> None:
        self.model.direct_stops = (stop,)

    def wait(self, seconds: int, *, beating: bool = True) -> None:
        """Let time pass, with a look, and a heartbeat of the order service, each second."""
        for _ in range(seconds):
            self.clock.advance(1)
            if self._beat is not None and beating:
                self.service(**self._beat)
            self.model.flush(self._at)

    def list(self) -> tuple[Matter, ...]:
        self.model.flush(self._at)
        return self.model.attention.matters

    def ids(self) -> set[str]:
        return {each.id for each in self.list()}
