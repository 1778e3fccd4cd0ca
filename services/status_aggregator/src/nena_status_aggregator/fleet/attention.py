"""What needs a person: the one definition behind panel, REST, ``nena status``, web hook and metrics."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from itertools import chain
from typing import Final

from nena_shared.fleet_api.attention import Acknowledgement, Matter, MatterChange, MatterKind, advice_on
from nena_shared.fleet_api.reasons import CodedReason, ReasonCode
from nena_shared.fleet_api.stops import SetBy, StopStatus
from nena_shared.fleet_api.transport_order import TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleStatus
from nena_shared.fleet_api.wait_chains import WaitChain
from nena_shared.mqtt.broker_check import LACKS
from nena_shared.plant import RECHARGE_OPERATION
from nena_status_aggregator.fleet.order_service import OrderServiceWatch
from nena_status_aggregator.fleet.orders import OrderRegistry
from nena_status_aggregator.fleet.queues import Jam
from nena_status_aggregator.fleet.robot import Robot, Timestamp

BY_REASON: Final[Mapping[str, MatterKind]] = {
    "emergency_stop": MatterKind.EMERGENCY_STOP,
    "error": MatterKind.ROBOT_ERROR,
    "not_localized": MatterKind.NOT_LOCALIZED,
    "unreadable": MatterKind.ROBOT_UNREADABLE,
    "broken": MatterKind.ROBOT_LOST,
    "silent": MatterKind.ROBOT_SILENT,
    "stateless": MatterKind.ROBOT_SILENT,
    "taken_out": MatterKind.TAKEN_OUT,
    "field": MatterKind.PROTECTIVE_FIELD,
}
"""Kinds by the reason for a robot's condition."""

IF_IN_THE_WAY: Final[Mapping[str, MatterKind]] = {
    "offline": MatterKind.ROBOT_OFFLINE,
    "hibernating": MatterKind.ROBOT_OFFLINE,
    "unheard": MatterKind.ROBOT_OFFLINE,
    "unheard_why": MatterKind.ROBOT_OFFLINE,
    "mode": MatterKind.NOT_AUTOMATIC,
    "paused": MatterKind.ROBOT_PAUSED,
}
"""The same for robots that somebody has switched off on purpose: only if an order or other robots wait."""

PATIENCE: Final[Mapping[MatterKind, timedelta]] = {
    MatterKind.BROKER_LOST: timedelta(seconds=2),  # each start begins without
    MatterKind.PROTECTIVE_FIELD: timedelta(seconds=10),  # people and trucks pass
    MatterKind.CIRCLE: timedelta(seconds=4),  # the order service dissolves most
}
"""Time for which a matter must last before it is in the list, by kind; none for the others."""

LOW_BATTERY: Final = 20.0
"""Charge below which a robot that is not on its way to a charger needs a person, percent."""

FAILED_FOR: Final = timedelta(hours=8)
"""Time for which a failed order stays in the list: a shift."""

IN_ONE_GO: Final = timedelta(seconds=10)
"""Time between two locks of paths that a person sets together."""

SHOWN: Final = 20
"""Maximum number of names of robots and orders that a matter holds up."""


@dataclass(slots=True)
class Fleet:
    """The fleet at a time, and who waits for whom."""

    robots: Sequence[Robot]
    orders: OrderRegistry
    chains: Mapping[str, WaitChain]
    jams: Sequence[Jam]
    order_service: OrderServiceWatch
    at: Timestamp
    lost_since: datetime | None
    """Time since which the broker is not connected; None: it is."""
    direct_stops: Sequence[StopStatus] = ()
    """Active stops of all robots that the order service does not know yet."""
    behind: dict[tuple[str, ...], list[str]] = field(init=False)
    """Vehicles that wait behind a head, or in and behind a circle."""
    orders_of: dict[str, list[str]] = field(init=False)
    """Open transport orders of each vehicle, and those that wait for it."""

    def __post_init__(self) -> None:
        """Group the vehicles by the end of their queues, and the orders by their vehicles."""
        self.behind = defaultdict(list)
        for name, each in self.chains.items():
            self.behind[each.end].append(name)
        self.orders_of = defaultdict(list)
        for order in self.orders:
            status = order.status
            vehicle = status.processing_vehicle or status.intended_vehicle
            if vehicle and not status.state.final:
                self.orders_of[vehicle].append(status.name)

    def matter(
        self,
        kind: MatterKind,
        subject: str,
        reason: str,
        *,
        robot: str | None = None,
        since: datetime | None = None,
        robots: Iterable[str] = (),
        orders: Iterable[str] = (),
        paths: tuple[str, ...] = (),
    ) -> Matter:
        """Make a matter that holds up these robots, these orders and those of the robots."""
        held = sorted(set(robots))
        affected = sorted({*orders, *chain.from_iterable(self.orders_of.get(name, ()) for name in held)})
        return Matter(
            id=f"{kind}:{subject}" if subject else kind.value,
            kind=kind,
            urgent=kind.urgent,
            subject=subject,
            robot=robot,
            since=since or self.at.utc,
            reason=reason,
            paths=paths,
            robots=tuple(held[:SHOWN]),
            robot_count=len(held),
            orders=tuple(affected[:SHOWN]),
            order_count=len(affected),
            advice=advice_on(kind, subject),
        )


def find_matters(fleet: Fleet) -> Iterator[Matter]:
    """Yield everything that needs a person; ``since`` is ``now`` where the time is not known."""
    if fleet.lost_since:
        text = "The status aggregator is not connected to the MQTT broker."
        yield _of_all(fleet, MatterKind.BROKER_LOST, text, fleet.lost_since)
        return  # nothing else is known
    yield from _of_services(fleet)
    yield from _of_jams(fleet)
    for robot in fleet.robots:
        yield from _of_robot(robot, fleet)
    for order in fleet.orders:
        if found := _of_order(order.status, fleet):
            yield found


def _of_services(fleet: Fleet) -> Iterator[Matter]:
    services = fleet.order_service
    if services.is_up(fleet.at) is False:
        text = "The order service is down: no orders are accepted or assigned."
        yield _of_all(fleet, MatterKind.ORDER_SERVICE_DOWN, text, services.last_sign)
    elif services.store_ready is False:
        text = "The order service cannot write its database: no orders are accepted."
        yield _of_all(fleet, MatterKind.STORE_UNAVAILABLE, text)
    if services.broker_lacks:
        text = " ".join(LACKS[lack] for lack in services.broker_lacks)
        yield fleet.matter(MatterKind.BROKER_LACKS, "", text)
    for stop in services.stops:
        stopped = (v.name for v in _vehicles(fleet) if v.stop and v.stop.name == stop.name)
        yield _of_stop(fleet, stop, stopped)
    known = {stop.name for stop in services.stops}
    for stop in (each for each in fleet.direct_stops if each.name not in known):
        yield _of_stop(fleet, stop, (each.vehicle_name for each in fleet.robots if _is_paused(each)))
    if services.locked_paths:
        # The order service knows that locks close a route, but not which of several.
        waiting = [v.name for v in _vehicles(fleet) if ReasonCode.PATH_LOCKED in _codes_of(v)]
        for paths, setter in _locked_together(services):
            by = f" by {setter.by}" if setter else ""
            text = f"{'These paths are' if paths[1:] else 'This path is'} locked{by}: {', '.join(paths)}"
            since = min(setter.since, fleet.at.utc) if setter else None
            yield fleet.matter(
                MatterKind.PATH_LOCKED, paths[0], text, since=since, robots=waiting, paths=paths
            )


def _locked_together(services: OrderServiceWatch) -> Iterator[tuple[tuple[str, ...], SetBy | None]]:
    """Yield the locked paths, grouped where one person has locked several in one go."""
    together: list[str] = []
    last: SetBy | None = None
    known = services.locked_by
    for path in sorted(services.locked_paths, key=lambda each: _order_of(known.get(each))):
        setter = known.get(path)
        if not (last and setter and setter.by == last.by and setter.since - last.since <= IN_ONE_GO):
            if together:
                yield tuple(together), known.get(together[0])
            together = []
        together.append(path)
        last = setter
    yield tuple(together), known.get(together[0])


def _order_of(setter: SetBy | None) -> tuple[str, float]:
    return (setter.by, setter.since.timestamp()) if setter else ("", 0.0)


def _of_stop(fleet: Fleet, stop: StopStatus, stopped: Iterable[str]) -> Matter:
    where = "Robots in an area are" if stop.area else "All robots are"
    text = f"{where} paused by {stop.by}: {stop.reason}"
    return fleet.matter(MatterKind.STOP, stop.name, text, since=stop.since, robots=stopped)


def _is_paused(robot: Robot) -> bool:
    return robot.reason.code == "paused"


def _of_all(fleet: Fleet, kind: MatterKind, text: str, since: datetime | None = None) -> Matter:
    """Make a matter that holds up the whole fleet."""
    robots = (vehicle.name for vehicle in _vehicles(fleet))
    orders = (order.status.name for order in fleet.orders if not order.status.state.final)
    return fleet.matter(kind, "", text, since=since, robots=robots, orders=orders)


def _vehicles(fleet: Fleet) -> Iterator[VehicleStatus]:
    return (robot.vehicle for robot in fleet.robots if robot.vehicle)


def _of_jams(fleet: Fleet) -> Iterator[Matter]:
    circles = {each.circle for each in fleet.chains.values() if each.circle}
    for circle in sorted(circles):
        names = ", ".join(circle)
        text = f"These vehicles wait for each other: {names}."
        yield fleet.matter(MatterKind.CIRCLE, names, text, robots=fleet.behind[circle])
    for jam in fleet.jams:
        if not jam.circle:
            (head,) = jam.end
            text = f"{jam.robots} robots wait behind {head}."
            behind = fleet.behind[jam.end]
            yield fleet.matter(MatterKind.JAM, head, text, since=jam.since, robots=behind)


def _of_robot(robot: Robot, fleet: Fleet) -> Iterator[Matter]:
    vehicle = robot.vehicle
    name = vehicle.name if vehicle else robot.id
    behind, orders = fleet.behind.get((name,), ()), fleet.orders_of.get(name, ())
    kind = BY_REASON.get(robot.reason.code)
    if kind is None and (behind or orders) and not (fleet.direct_stops and _is_paused(robot)):
        kind = IF_IN_THE_WAY.get(robot.reason.code)
    if kind is None and vehicle and vehicle.taken_out:
        kind = MatterKind.TAKEN_OUT
    if kind:
        text = vehicle.reason if vehicle and kind is MatterKind.TAKEN_OUT else robot.reason.text
        yield fleet.matter(kind, name, text, robot=robot.id, robots=behind, orders=orders)
    if text := _low_charge(robot, fleet):
        yield fleet.matter(MatterKind.BATTERY_LOW, name, text, robot=robot.id, robots=behind, orders=orders)


def _low_charge(robot: Robot, fleet: Fleet) -> str:
    """Return what is wrong with the charge of a robot; empty if it charges or is on its way to a charger."""
    if robot.state is None or robot.state.power_supply.charging or robot.reason.code in IF_IN_THE_WAY:
        return ""
    charge, vehicle = robot.state.power_supply.state_of_charge, robot.vehicle
    codes = _codes_of(vehicle) if vehicle and not vehicle.transport_order else set[str]()
    stranded = ReasonCode.MUST_RECHARGE in codes or ReasonCode.CANNOT_RECHARGE in codes
    if not stranded and charge >= LOW_BATTERY:
        return ""
    order = fleet.orders.get(vehicle.transport_order or "") if vehicle else None
    if order and _recharges(order.status):
        return ""
    return f"Battery at {charge:.0f} %." + (f" {vehicle.reason}" if vehicle and stranded else "")


def _recharges(order: TransportOrderStatus) -> bool:
    return order.type == RECHARGE_OPERATION or any(
        each.destination.operation == RECHARGE_OPERATION for each in order.drive_orders
    )


def _codes_of(vehicle: VehicleStatus) -> set[str]:
    """Return the codes of the reasons of a vehicle, and of those that they contain."""
    wait = vehicle.wait.coded_reason if vehicle.wait else None
    return set(chain.from_iterable(map(_codes_in, filter(None, (vehicle.coded_reason, wait)))))


def _codes_in(reason: CodedReason) -> Iterator[str]:
    yield reason.code
    for cause in reason.causes:
        yield from _codes_in(cause)


def _of_order(order: TransportOrderStatus, fleet: Fleet) -> Matter | None:
    if outcome := order.ended_as:
        old = order.finished is not None and fleet.at.utc - order.finished > FAILED_FOR
        if old or order.automatic or not outcome.failure:
            return None
        return fleet.matter(MatterKind.ORDER_FAILED, order.name, order.reason, since=order.finished)
    robots = [order.processing_vehicle] if order.processing_vehicle else []
    if order.held:
        text = f"Held by {order.held.by}: {order.held.reason}"
        since = order.held.since
        return fleet.matter(
            MatterKind.ORDER_HELD, order.name, text, since=since, robots=robots, orders=[order.name]
        )
    if order.late:
        kind = MatterKind.ORDER_LATE
        return fleet.matter(kind, order.name, order.reason, since=order.deadline, orders=[order.name])
    return None


class AttentionRegistry:
    """The matters of the fleet with the time since which they are known, and who has acknowledged them."""

    def __init__(self, on_change: Callable[[MatterChange, Matter], None] = lambda *_: None) -> None:
        """Start without matters; ``on_change`` receives each change and must not block."""
        self.matters: tuple[Matter, ...] = ()
        """Urgent ones first; among them, and among the others, those that somebody has acknowledged last."""
        self.acknowledged: dict[str, Acknowledgement] = {}
        """By the ID of the matter; also restored ones whose matter has not been found yet."""
        self._on_change = on_change
        self._seen: dict[str, datetime] = {}
        """Time since which each matter is known, by ID; also of those that do not last long enough yet."""
        self._sought_until: datetime | None = None
        """Time at which restored acknowledgements without a matter are dropped."""

    def restore(self, acknowledged: Mapping[str, Acknowledgement], until: datetime) -> None:
        """Take over what was acknowledged before a restart, for matters that are found by a time."""
        self.acknowledged = {**acknowledged, **self.acknowledged}
        self._sought_until = until

    def update(self, found: Iterable[Matter], now: datetime, *, keep: bool = False) -> None:
        """Replace the matters; those that were known keep their time and their acknowledgement.

        ``keep``: what is not found may still be there, because not everything is known.
        """
        before = {matter.id: matter for matter in self.matters}
        every = ({**before} if keep else {}) | {matter.id: matter for matter in found}
        seen: dict[str, datetime] = {}
        shown: dict[str, Matter] = {}
        for name, matter in every.items():
            since = seen[name] = min(matter.since, self._seen.get(name, matter.since))
            if now - since >= PATIENCE.get(matter.kind, timedelta()):
                known = {"since": since, "acknowledged": self.acknowledged.get(name)}
                shown[name] = matter.model_copy(update=known)
        self._seen = seen
        self._sort(shown.values())
        for name in before.keys() - shown.keys():
            self.acknowledged.pop(name, None)
            self._on_change(MatterChange.ENDED, before[name])
        if self._sought_until and now >= self._sought_until:
            self.acknowledged = {name: by for name, by in self.acknowledged.items() if name in shown}
            self._sought_until = None
        for matter in self.matters:
            # What was acknowledged before a restart is not new.
            if matter.id not in before and not matter.acknowledged:
                self._on_change(MatterChange.BEGAN, matter)

    def acknowledge(self, name: str, by: str, at: datetime) -> Matter | None:
        """Acknowledge a matter by its ID and return it; None if there is none. The first name stays."""
        matter = next((each for each in self.matters if each.id == name), None)
        if matter is None or matter.acknowledged:
            return matter
        self.acknowledged[name] = Acknowledgement(by=by, at=at)
        changed = matter.model_copy(update={"acknowledged": self.acknowledged[name]})
        self._sort(changed if each.id == name else each for each in self.matters)
        self._on_change(MatterChange.ACKNOWLEDGED, changed)
        return changed

    def _sort(self, matters: Iterable[Matter]) -> None:
        self.matters = tuple(
            sorted(
                matters,
                key=lambda each: (
                    not each.urgent,
                    each.acknowledged is not None,
                    each.kind.rank,
                    -each.robot_count,
                    each.since,
                    each.subject,
                ),
            )
        )
