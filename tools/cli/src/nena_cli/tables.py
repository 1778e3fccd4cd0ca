"""Tables of orders, sequences, vehicles and zone sets. Markup in names and reasons is not interpreted."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from datetime import datetime
from typing import TYPE_CHECKING, Final

from rich.text import Text

from nena_cli.styled import Table
from nena_shared.fleet_api.transport_order import OrderOutcome, TransportOrderState
from nena_shared.fleet_api.vehicle import VehicleState
from nena_shared.fleet_api.wait_chains import WaitChain, chain_from, wait_chains

if TYPE_CHECKING:  # a command needs few of them
    from nena_shared.fleet_api.audit import AuditEntry
    from nena_shared.fleet_api.peripherals import PeripheralJobStatus, PeripheralStatus
    from nena_shared.fleet_api.places import LocationStatus, PointStatus
    from nena_shared.fleet_api.plant import PathLockPreview, PathStatus, ZoneSetStatus
    from nena_shared.fleet_api.requests import InstantActionAnswer
    from nena_shared.fleet_api.schedules import ScheduleStatus
    from nena_shared.fleet_api.stops import StopStatus
    from nena_shared.fleet_api.traffic import TrafficPlan, VehiclePlan
    from nena_shared.fleet_api.transport_order import (
        DeliveryStatus,
        Destination,
        OrderSequenceStatus,
        TransportOrderStatus,
    )
    from nena_shared.fleet_api.vehicle import ReroutingAnswer, VehicleStatus

STATE_STYLES: Final[dict[TransportOrderState | OrderOutcome, str]] = {
    OrderOutcome.FINISHED: "green",
    OrderOutcome.FAILED: "red",
    OrderOutcome.UNROUTABLE: "red",
    OrderOutcome.GAVE_WAY: "dim",
    TransportOrderState.WITHDRAWN: "yellow",
    TransportOrderState.BEING_PROCESSED: "cyan",
}

BLOCKED = "BLOCKED"
"""A robot that reports, but stands until a person helps, as in the panel."""

VEHICLE_STYLES = {
    VehicleState.ERROR: "red",
    VehicleState.UNAVAILABLE: "yellow",
    VehicleState.UNKNOWN: "dim",
    VehicleState.EXECUTING: "cyan",
    VehicleState.CHARGING: "green",
    BLOCKED: "red",
    "WAITING": "yellow",
}


STUCK = (VehicleState.ERROR, VehicleState.UNAVAILABLE, VehicleState.UNKNOWN)
"""States in which a vehicle does not continue without help from a person."""


def vehicle_state(vehicle: VehicleStatus) -> str:
    """Return the state of a vehicle: ERROR, BLOCKED or WAITING where the robot's own state says less."""
    stopped = vehicle.active_emergency_stop not in (None, "NONE")
    paused = vehicle.paused and vehicle.stop is None
    if vehicle.state in STUCK:
        return vehicle.state
    if vehicle.taken_out or any(error.startswith("CRITICAL ") for error in vehicle.errors):
        return VehicleState.ERROR
    if stopped or paused or vehicle.field_violation or vehicle.localized is False:
        return BLOCKED
    return "WAITING" if vehicle.wait else vehicle.state


def is_stuck(vehicle: VehicleStatus) -> bool:
    """Return whether a vehicle does not continue without help from a person."""
    return vehicle_state(vehicle) in (*STUCK, BLOCKED)


def orders_table(orders: Iterable[TransportOrderStatus]) -> Table:
    """Return a table with a row for each order."""
    table = Table("order", "state", "vehicle", "destinations", "priority", "created", "reason")
    for order in orders:
        table.add_row(
            order.name,
            _state_text(order),
            _vehicle_of(order),
            destinations(order),
            str(order.priority or ""),
            _local_time(order.created),
            order.reason,
        )
    return table


def destinations(order: TransportOrderStatus) -> Text:
    """Return the destinations of an order: finished ones dim, the current one bold."""
    text = Text()
    for index, each in enumerate(order.drive_orders):
        done = each.state.value == "FINISHED"
        style = "dim" if done else "bold" if index == order.current_drive_order_index else ""
        text.append(" > " if index else "").append(_place_of(each.destination), style=style)
    return text


def order_details(order: TransportOrderStatus, delivery: DeliveryStatus) -> Table:
    """Return the details of an order."""
    return _details_table(
        ("order", order.name),
        ("state", _state_text(order)),
        ("reason", order.reason),
        ("vehicle", order.processing_vehicle or ""),
        ("intended vehicle", order.intended_vehicle or ""),
        ("type, priority", f"{order.type}, {order.priority}"),
        ("deadline", _deadline_text(order)),
        ("sequence", order.wrapping_sequence or ""),
        ("depends on", ", ".join(order.dependencies)),
        ("dispensable", "yes" if order.dispensable else ""),
        ("automatic", "yes" if order.automatic else ""),
        ("created by", order.created_by or ""),
        ("destinations", destinations(order)),
        ("delivery", " ".join(filter(None, (delivery.phase, delivery.order_id, delivery.note)))),
        ("properties", ", ".join(f"{each.key}={each.value}" for each in order.properties)),
    )


def _details_table(*rows: tuple[str, Text | str]) -> Table:
    """Return a table of names and values, without those that are empty."""
    table = Table(frame=False)
    for name, value in rows:
        if value:
            table.add_row(Text(name, style="dim"), value)
    return table


def history_table(status: TransportOrderStatus | OrderSequenceStatus) -> Table:
    """Return the history of an order or a sequence."""
    table = Table("time", "event", "details", title="History")
    for entry in status.history:
        what = entry.event_code.removeprefix("nena:")
        table.add_row(_local_time(entry.timestamp), what, ", ".join(entry.supplements))
    return table


def vehicles_table(vehicles: Iterable[VehicleStatus], fleet: Iterable[VehicleStatus] = ()) -> Table:
    """Return a table with a row for each vehicle; maps and waiting only if there are any.

    The queue in front of a vehicle is followed to its head through ``fleet``, by default the shown vehicles.
    """
    shown = tuple(vehicles)
    known = {vehicle.name: vehicle for vehicle in (*shown, *fleet)}
    chains = vehicle_chains(known)
    columns = ["vehicle", "state", "connection", "position", "energy", "order", "reason"]
    if chains:
        columns.append("waits for")
    if any(vehicle.maps for vehicle in shown):
        columns.append("maps")
    table = Table(*columns)
    for vehicle in shown:
        energy = "" if vehicle.energy_level is None else f"{vehicle.energy_level:.0f} %"
        table.add_row(
            vehicle.name,
            _vehicle_state(vehicle),
            Text(vehicle.connection, style="" if vehicle.connection == "ONLINE" else "yellow"),
            _position_of(vehicle),
            energy,
            vehicle.transport_order or "",
            "; ".join((vehicle.reason, *vehicle.errors, *_deviations_of(vehicle))),
            *([_waiting_chain(vehicle.name, chains, known)] if chains else []),
            *([_maps_of(vehicle)] if vehicle.maps else []),
        )
    return table


def vehicle_chains(fleet: Mapping[str, VehicleStatus]) -> dict[str, WaitChain]:
    """Return the chain of each waiting vehicle of the fleet, by name."""
    stuck = {name for name, vehicle in fleet.items() if is_stuck(vehicle)}
    return wait_chains({name: each.wait.vehicles for name, each in fleet.items() if each.wait}, stuck)


def _vehicle_state(vehicle: VehicleStatus) -> Text:
    state = vehicle_state(vehicle)
    return Text(state, style=VEHICLE_STYLES.get(state, ""))


def _waiting_chain(name: str, chains: Mapping[str, WaitChain], fleet: Mapping[str, VehicleStatus]) -> Text:
    """Return the vehicles from the next one to the head with its state, or around the circle."""
    chain = chains.get(name)
    if chain is None:
        return Text()
    way = " > ".join(chain_from(name, chains)[1:])
    if chain.head is None:
        return Text(f"{way} (circle: {', '.join(chain.circle)})", style="red")
    head = fleet.get(chain.head)
    return Text(f"{way} ({head.state if head else 'unknown'})")


def _deviations_of(vehicle: VehicleStatus) -> tuple[str, ...]:
    listed = ", ".join(vehicle.deviations)
    return (f"this robot deviates from VDA 5050: {listed}",) if listed else ()


def traffic_table(plan: TrafficPlan) -> Table:
    """Return a table with a row for each vehicle: its next points with seconds, bold where it may drive."""
    table = Table("vehicle", "at", "next", "goal", "order", "waits")
    for vehicle in plan.vehicles:
        table.add_row(
            vehicle.vehicle,
            vehicle.at,
            _next_points(vehicle),
            vehicle.goal or "",
            vehicle.transport_order or "",
            vehicle.wait.reason if vehicle.wait else "",
        )
    return table


def _next_points(plan: VehiclePlan) -> Text:
    text = Text()
    for index, each in enumerate(plan.ahead):
        when = "" if each.seconds is None else f" {each.seconds:.0f} s"
        text.append(" > " if index else "").append(
            f"{each.point}{when}", style="bold" if each.held else "dim"
        )
    return text


def _maps_of(vehicle: VehicleStatus) -> Text:
    """Return the maps of a robot with versions; disabled ones dim."""
    text = Text()
    for each in vehicle.maps or ():
        text.append(", " if text else "")
        text.append(f"{each.map_id} {each.map_version}".strip(), style="" if each.enabled else "dim")
    return text


def order_types_table(vehicle: VehicleStatus) -> Table:
    """Return the order types that a vehicle accepts, in order of preference."""
    table = Table("type", "priority", title=vehicle.name)
    for each in sorted(vehicle.acceptable_order_types, key=lambda each: each.priority):
        table.add_row(each.name, str(each.priority))
    return table


def _deadline_text(order: TransportOrderStatus) -> Text:
    text = Text(_local_time(order.deadline))
    return text.append(", late", style="red") if order.late else text


def zone_sets_table(zone_sets: Iterable[ZoneSetStatus]) -> Table:
    """Return a table with a row for each zone set and robot."""
    table = Table("zone set", "map", "target", "vehicle", "status", "note")
    for each in zone_sets:
        target = "deleted" if each.deleted else "enabled" if each.enabled else "disabled"
        for at in each.vehicles:
            table.add_row(each.zone_set_id, each.map_id, target, at.vehicle, at.phase, at.note)
        if not each.vehicles:
            table.add_row(each.zone_set_id, each.map_id, target)
    return table


def peripherals_table(peripherals: Iterable[PeripheralStatus]) -> Table:
    """Return a table with a row for each peripheral device."""
    table = Table("location", "state", "operations", "job", "waiting")
    for peripheral in peripherals:
        job = peripheral.job.operation if peripheral.job else ""
        waiting = str(len(peripheral.waiting) or "")
        table.add_row(peripheral.location, peripheral.state, ", ".join(peripheral.operations), job, waiting)
    return table


def peripheral_jobs_table(jobs: Iterable[PeripheralJobStatus]) -> Table:
    """Return a table with a row for each peripheral job."""
    table = Table("job", "location", "operation", "state", "vehicle", "order", "reason")
    for job in jobs:
        for_whom = (job.related_vehicle or "", job.related_transport_order or "")
        table.add_row(job.name, job.location, job.operation, job.state, *for_whom, job.reason)
    return table


def points_table(points: Iterable[PointStatus]) -> Table:
    """Return a table with a row for each point."""
    table = Table("point", "type", "x, y", "map", "locations", "occupied by", "reserved by")
    for point in points:
        place = f"{point.x:.2f}, {point.y:.2f}"
        names = (point.locations, point.occupied_by, point.reserved_by)
        table.add_row(point.name, point.type, place, point.map_id or "", *(", ".join(them) for them in names))
    return table


def paths_table(paths: Iterable[PathStatus]) -> Table:
    """Return a table with a row for each path."""
    table = Table("path", "from", "to", "locked")
    for path in paths:
        locked = f"by stop {path.stop}" if path.stop else "yes" if path.locked else "no"
        table.add_row(path.name, path.source_point, path.destination_point, locked)
    return table


def lock_previews_table(previews: Iterable[PathLockPreview]) -> Table:
    """Return a table of what would have no other route."""
    table = Table("vehicles without another route", "orders without another route")
    for preview in previews:
        table.add_row(*(", ".join(names) or "none" for names in (preview.vehicles, preview.orders)))
    return table


def locations_table(locations: Iterable[LocationStatus]) -> Table:
    """Return a table with a row for each location; the operations of a point only if they are fewer."""
    table = Table("location", "type", "x, y", "locked", "operations", "device", "points")
    for location in locations:
        links = (
            link.point
            if link.operations == location.operations
            else f"{link.point}: {', '.join(link.operations)}"
            for link in location.links
        )
        offered = (
            ", ".join(location.operations),
            ", ".join(location.peripheral_operations),
            "; ".join(links),
        )
        place = f"{location.x:.2f}, {location.y:.2f}"
        table.add_row(location.name, location.type, place, "locked" if location.locked else "", *offered)
    return table


def schedules_table(schedules: Iterable[ScheduleStatus]) -> Table:
    """Return a table with a row for each schedule."""
    table = Table("schedule", "cron", "time zone", "stops", "next run", "last run", "orders", "skipped")
    for schedule in schedules:
        next_run = (
            _local_time(schedule.next_runs[0])
            if schedule.next_runs
            else "none"
            if schedule.enabled
            else "disabled"
        )
        last_run = (
            schedule.last_runs[0].transport_order or schedule.last_runs[0].reason
            if schedule.last_runs
            else ""
        )
        counts = (str(schedule.created_orders or ""), str(schedule.skipped_runs or ""))
        table.add_row(
            schedule.name,
            schedule.cron or "template",
            schedule.time_zone,
            _stops_of(schedule),
            next_run,
            last_run,
            *counts,
        )
    return table


def schedule_details(status: ScheduleStatus) -> Table:
    """Return the definition of a schedule and its next runs."""
    return _details_table(
        ("schedule", status.name),
        ("cron, time zone", f"{status.cron or 'template'}, {status.time_zone}"),
        ("enabled", "yes" if status.enabled else "no"),
        ("valid from", _local_time(status.valid_from)),
        ("valid until", _local_time(status.valid_until)),
        ("catch up", str(status.catch_up)),
        ("max. open orders", str(status.max_open_orders)),
        ("stops", _stops_of(status)),
        ("created orders", str(status.created_orders)),
        ("skipped runs", str(status.skipped_runs)),
        ("next runs", ", ".join(map(_local_time, status.next_runs))),
    )


def schedule_runs_table(status: ScheduleStatus) -> Table:
    """Return the last runs of a schedule."""
    table = Table("planned", "order", "reason", title="Last runs")
    for run in status.last_runs:
        table.add_row(_local_time(run.planned), run.transport_order or "", run.reason)
    return table


def _stops_of(status: ScheduleStatus) -> str:
    """Return where a schedule's orders lead."""
    return " > ".join(map(_place_of, status.transport_order.destinations))


def stops_table(stops: Iterable[StopStatus]) -> Table:
    """Return a table with a row for each stop."""
    table = Table("stop", "area", "by", "since", "reason", "paused", "not paused")
    for stop in stops:
        area = stop.area
        where = f"{area.x_min:g},{area.y_min:g},{area.x_max:g},{area.y_max:g}" if area else "all robots"
        paused = "ended" if stop.ended else f"{stop.paused} of {stop.vehicles}"
        others = "; ".join(f"{other.vehicle} {other.reason}" for other in stop.not_paused)
        since = f"{stop.since:%Y-%m-%d %H:%M:%S} UTC"
        table.add_row(stop.name, where, stop.by, since, stop.reason, paused, others)
    return table


def audit_table(entries: Iterable[AuditEntry]) -> Table:
    """Return a table with a row for each request of the audit trail."""
    table = Table("row", "time", "user", "by", "operation", "object", "request", "change", "result")
    for entry in entries:
        change = " > ".join(filter(None, (entry.before, entry.after)))
        result = f"{entry.result}: {entry.reason}" if entry.reason else str(entry.result)
        time = f"{entry.timestamp:%Y-%m-%d %H:%M:%S} UTC"
        by = f"{entry.interface} ({entry.client})" if entry.client else str(entry.interface)
        row = (
            str(entry.sequence),
            time,
            entry.user,
            by,
            entry.operation,
            entry.object,
            entry.request,
            change,
            result,
        )
        table.add_row(*map(printable, row))
    return table


def printable(text: str) -> str:
    """Return text of an unknown sender with its control characters escaped: a terminal would obey them."""
    return "".join(each if each.isprintable() else each.encode("unicode_escape").decode() for each in text)


def rerouting_table(done: ReroutingAnswer) -> Table:
    """Return the result of rerouting."""
    table = Table("vehicle", "order", "outcome", "route", "reason")
    route = " > ".join(done.route)
    table.add_row(done.vehicle, done.transport_order, done.outcome, route, done.reason)
    return table


def instant_action_table(vehicle: str, done: InstantActionAnswer) -> Table:
    """Return what became of an instant action."""
    table = Table("vehicle", "action", "status", "reason")
    table.add_row(vehicle, done.action_type, done.status, done.result or done.reason)
    return table


def _state_text(order: TransportOrderStatus) -> Text:
    state = order.ended_as or order.state
    style = STATE_STYLES.get(state, "")
    return Text(f"{state} (held)", style="yellow") if order.held else Text(state, style=style)


def _vehicle_of(status: TransportOrderStatus | OrderSequenceStatus) -> str:
    """Return the vehicle of an order or a sequence; in parentheses if it is only intended."""
    return status.processing_vehicle or (f"({status.intended_vehicle})" if status.intended_vehicle else "")


def _position_of(vehicle: VehicleStatus) -> str:
    if vehicle.current_position:
        return vehicle.current_position
    position = vehicle.precise_position
    return f"{position.x:.2f}, {position.y:.2f}" if position else ""


def _place_of(destination: Destination) -> str:
    place = destination.location_name
    if destination.coordinate:
        place = f"{destination.coordinate.x:g}, {destination.coordinate.y:g}"
    return f"{place}: {destination.operation}"


def _local_time(moment: datetime | None) -> str:
    return f"{moment.astimezone():%Y-%m-%d %H:%M:%S}" if moment else ""


def sequences_table(sequences: Iterable[OrderSequenceStatus]) -> Table:
    """Return a table with a row for each sequence."""
    table = Table("sequence", "state", "vehicle", "orders", "created", "reason")
    for sequence in sequences:
        table.add_row(
            sequence.name,
            _sequence_state(sequence),
            _vehicle_of(sequence),
            _orders_of(sequence),
            _local_time(sequence.created),
            sequence.reason,
        )
    return table


def sequence_details(sequence: OrderSequenceStatus) -> Table:
    """Return the details of a sequence."""
    return _details_table(
        ("sequence", sequence.name),
        ("state", _sequence_state(sequence)),
        ("reason", sequence.reason),
        ("vehicle", sequence.processing_vehicle or ""),
        ("intended vehicle", sequence.intended_vehicle or ""),
        ("order types", ", ".join(sequence.order_types)),
        ("failure", "ends the sequence" if sequence.failure_fatal else "ignored"),
        ("orders", _orders_of(sequence)),
        ("properties", ", ".join(f"{each.key}={each.value}" for each in sequence.properties)),
    )


def _orders_of(sequence: OrderSequenceStatus) -> Text:
    """Return the orders of a sequence: finished ones dim, the next one bold."""
    text = Text()
    turn = sequence.finished_index + 1
    for index, name in enumerate(sequence.orders):
        style = "dim" if index < turn else "bold" if index == turn else ""
        text.append(" > " if index else "").append(name, style=style)
    return text


def _sequence_state(sequence: OrderSequenceStatus) -> str:
    if sequence.finished:
        return "finished"
    return "complete" if sequence.complete else "open"
