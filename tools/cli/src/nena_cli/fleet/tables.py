"""Orders and vehicles as tables; names and reasons come from others, so no markup is read in them."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from rich.table import Table
from rich.text import Text

from nena_shared.fleet_api.delivery import DeliveryStatus
from nena_shared.fleet_api.rerouting import ReroutingAnswer
from nena_shared.fleet_api.transport_order import DriveOrderStatus, TransportOrderState, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.fleet_api.zone_set import ZoneSetStatus

STATE_STYLES = {
    TransportOrderState.FINISHED: "green",
    TransportOrderState.FAILED: "red",
    TransportOrderState.UNROUTABLE: "red",
    TransportOrderState.WITHDRAWN: "yellow",
    TransportOrderState.BEING_PROCESSED: "cyan",
}

VEHICLE_STYLES = {
    VehicleState.ERROR: "red",
    VehicleState.UNAVAILABLE: "yellow",
    VehicleState.UNKNOWN: "dim",
    VehicleState.EXECUTING: "cyan",
    VehicleState.CHARGING: "green",
}


def orders_table(orders: Iterable[TransportOrderStatus]) -> Table:
    """Give a line for each order."""
    table = Table("order", "state", "vehicle", "destinations", "priority", "created", "reason")
    for order in orders:
        table.add_row(
            Text(order.name),
            _state(order),
            Text(order.processing_vehicle or _meant_for(order)),
            destinations(order),
            Text(str(order.priority or "")),
            Text(_local(order.created)),
            Text(order.reason),
        )
    return table


def destinations(order: TransportOrderStatus) -> Text:
    """Give the stops of an order; what is done is dim, where it is now stands out."""
    text = Text()
    for index, each in enumerate(order.drive_orders):
        done = each.state.value == "FINISHED"
        style = "dim" if done else "bold" if index == order.current_drive_order_index else ""
        text.append(" > " if index else "").append(_place(each), style=style)
    return text


def order_details(order: TransportOrderStatus, delivery: DeliveryStatus) -> Table:
    """Give all that is known of an order."""
    table = Table.grid(padding=(0, 2))
    rows = [
        ("order", Text(order.name)),
        ("state", _state(order)),
        ("reason", Text(order.reason)),
        ("vehicle", Text(order.processing_vehicle or "")),
        ("intended vehicle", Text(order.intended_vehicle or "")),
        ("type, priority", Text(f"{order.type}, {order.priority}")),
        ("deadline", _deadline(order)),
        ("sequence", Text(order.wrapping_sequence or "")),
        ("depends on", Text(", ".join(order.dependencies))),
        ("dispensable", Text("yes" if order.dispensable else "")),
        ("automatic", Text("yes" if order.automatic else "")),
        ("destinations", destinations(order)),
        ("delivery", Text(" ".join(filter(None, (delivery.phase, delivery.order_id, delivery.note))))),
        ("properties", Text(", ".join(f"{each.key}={each.value}" for each in order.properties))),
    ]
    for name, value in rows:
        if value.plain:
            table.add_row(Text(name, style="dim"), value)
    return table


def history_table(order: TransportOrderStatus) -> Table:
    """Give what has happened to an order."""
    table = Table("when", "what", "why", title="History", title_justify="left")
    for entry in order.history:
        what = entry.event_code.removeprefix("nena:")
        table.add_row(Text(_local(entry.timestamp)), Text(what), Text(", ".join(entry.supplements)))
    return table


def vehicles_table(vehicles: Iterable[VehicleStatus]) -> Table:
    """Give a line for each vehicle; maps only where robots tell of any."""
    shown = tuple(vehicles)
    table = Table("vehicle", "state", "connection", "at", "energy", "order", "reason")
    if any(vehicle.maps for vehicle in shown):
        table.add_column("maps")
    for vehicle in shown:
        energy = "" if vehicle.energy_level is None else f"{vehicle.energy_level:.0f} %"
        table.add_row(
            Text(vehicle.name),
            Text(vehicle.state, style=VEHICLE_STYLES.get(vehicle.state, "")),
            Text(vehicle.connection, style="" if vehicle.connection == "ONLINE" else "yellow"),
            Text(_position(vehicle)),
            Text(energy),
            Text(vehicle.transport_order or ""),
            Text("; ".join((vehicle.reason, *vehicle.errors))),
            *([_maps(vehicle)] if vehicle.maps else []),
        )
    return table


def _maps(vehicle: VehicleStatus) -> Text:
    """Give the maps of a robot with their versions; those that are not enabled are dim."""
    text = Text()
    for each in vehicle.maps or ():
        text.append(", " if text else "")
        text.append(f"{each.map_id} {each.map_version}".strip(), style="" if each.enabled else "dim")
    return text


def order_types_table(vehicle: VehicleStatus) -> Table:
    """Give the types of orders that a vehicle accepts, liked best first."""
    table = Table("type", "priority", title=vehicle.name, title_justify="left")
    for each in sorted(vehicle.acceptable_order_types, key=lambda each: each.priority):
        table.add_row(Text(each.name), Text(str(each.priority)))
    return table


def _deadline(order: TransportOrderStatus) -> Text:
    text = Text(_local(order.deadline))
    return text.append(", late", style="red") if order.late else text


def zone_sets_table(zone_sets: Iterable[ZoneSetStatus]) -> Table:
    """Give a line for each zone set and robot."""
    table = Table("zone set", "map", "wanted", "vehicle", "there", "note")
    for each in zone_sets:
        wanted = "deleted" if each.deleted else "enabled" if each.enabled else "there"
        for at in each.vehicles:
            table.add_row(*map(Text, (each.zone_set_id, each.map_id, wanted, at.vehicle, at.phase, at.note)))
        if not each.vehicles:
            table.add_row(*map(Text, (each.zone_set_id, each.map_id, wanted)))
    return table


def rerouting_table(done: ReroutingAnswer) -> Table:
    """Give what has become of a request for rerouting."""
    table = Table("vehicle", "order", "outcome", "way", "reason")
    way = " > ".join(done.route)
    table.add_row(*map(Text, (done.vehicle, done.transport_order, done.outcome, way, done.reason)))
    return table


def _state(order: TransportOrderStatus) -> Text:
    style = STATE_STYLES.get(order.state, "")
    return Text(f"{order.state} (held)", style="yellow") if order.held else Text(order.state, style=style)


def _meant_for(order: TransportOrderStatus) -> str:
    return f"({order.intended_vehicle})" if order.intended_vehicle else ""


def _position(vehicle: VehicleStatus) -> str:
    if vehicle.current_position:
        return vehicle.current_position
    position = vehicle.precise_position
    return f"{position.x:.2f}, {position.y:.2f}" if position else ""


def _place(drive_order: DriveOrderStatus) -> str:
    destination = drive_order.destination
    place = destination.location_name
    if destination.coordinate:
        place = f"{destination.coordinate.x:g}, {destination.coordinate.y:g}"
    return f"{place}: {destination.operation}"


def _local(moment: datetime | None) -> str:
    return f"{moment.astimezone():%Y-%m-%d %H:%M:%S}" if moment else ""
