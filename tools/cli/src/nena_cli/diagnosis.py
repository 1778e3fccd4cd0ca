"""``nena status`` and ``nena explain``: what runs, what is wrong, why something waits, and what to do."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import UTC, datetime, timedelta
from typing import Annotated, Final, TypeVar

import typer
from rich.text import Text

from nena_cli.output import REFUSED
from nena_cli.service import Service, of_service
from nena_cli.styled import Table
from nena_cli.tables import STATE_STYLES, VEHICLE_STYLES, is_stuck, vehicle_chains, vehicle_state
from nena_client import Client, RefusedError, ServiceState
from nena_client.exchange import Query
from nena_shared.fleet_api.base import Resource
from nena_shared.fleet_api.operations.fleet import LIST_STOPS
from nena_shared.fleet_api.operations.orders import LIST_ORDERS, SHOW_ORDER
from nena_shared.fleet_api.operations.vehicles import LIST_VEHICLES
from nena_shared.fleet_api.reasons import ReasonCode
from nena_shared.fleet_api.stops import StopStatus
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.fleet_api.wait_chains import chain_from

RECENT: Final = timedelta(hours=1)
"""Age up to which a failed order is reported."""
SHOWN: Final = 5
"""Vehicles and orders that need a person and are listed; the others are counted."""
DEEPEST: Final = 20
"""Dependencies followed from one order to the next."""
OPEN: Final = tuple(state for state in TransportOrderState if not state.final)
"""States of unfinished orders."""
UNDONE: Final = (TransportOrderState.FAILED, TransportOrderState.UNROUTABLE)
NEWEST: Final = 1000
"""Orders that ended undone and are read: those created last, as many as fit on a page."""
GONE: Final = ("OFFLINE", "CONNECTION_BROKEN", "SILENT")
CONTROLLED: Final = (None, "AUTOMATIC", "SEMIAUTOMATIC")
"""Operating modes in which fleet control commands a robot (VDA 5050 6.10.6; None: not reported)."""
STYLES: Final[dict[str, str]] = {
    **{each.value: style for each, style in STATE_STYLES.items()},
    **{str(each): style for each, style in VEHICLE_STYLES.items()},
    "NOT READY": "red",
    "STOPPED": "red",
    "HELD": "yellow",
    "LATE": "red",
}

S = TypeVar("S", TransportOrderState, VehicleState)


class Attention(Resource):
    """A vehicle, an order or a service that needs a person."""

    name: str
    state: str
    reason: str
    waiting_behind: int = 0
    """Vehicles that wait for this one, directly or indirectly."""
    advice: str


class StatusReport(Resource):
    """What ``nena status`` reports."""

    services: dict[str, str]
    """State of the order service at each URL."""
    vehicles: dict[VehicleState, int]
    waiting_vehicles: int
    """Vehicles that wait for others."""
    orders: dict[TransportOrderState, int]
    """Unfinished orders."""
    attention: tuple[Attention, ...]
    """What needs a person, the most urgent first."""


class Step(Resource):
    """One link of an explanation: an order or a vehicle, its state and why."""

    name: str
    state: str
    reason: str


class Explanation(Resource):
    """Why an order or a vehicle is waiting: from itself to the root of the matter."""

    name: str
    steps: tuple[Step, ...]
    advice: str


@of_service
def status(service: Service) -> None:
    """Show what runs, what is wrong and what to do; status 1 if something needs a person."""
    with service.connected() as connection:
        services = connection.readiness()
        vehicles = connection.call(LIST_VEHICLES).vehicles
        stops = connection.call(LIST_STOPS).stops
        orders = [
            order
            for page in connection.pages(LIST_ORDERS, {"state": [each.value for each in OPEN]})
            for order in page.transport_orders
        ]
        ended: Query = {"state": [each.value for each in UNDONE], "limit": NEWEST}
        failed = connection.call(LIST_ORDERS, query=ended).transport_orders
    report = report_of(services, vehicles, (*orders, *failed), datetime.now(UTC), stops)
    service.print_one(report, *_status_tables(report))
    if report.attention:
        raise typer.Exit(REFUSED)


@of_service
def explain(
    service: Service, name: Annotated[str, typer.Argument(help="Name of the order or the vehicle.")]
) -> None:
    """Show why an order or a vehicle is waiting, link by link to the root, and what to do."""
    with service.connected() as connection:
        fleet = {vehicle.name: vehicle for vehicle in connection.call(LIST_VEHICLES).vehicles}
        found = explain_vehicle(name, fleet) if name in fleet else _explain_order(connection, name, fleet)
        found = with_services(found, connection.readiness())
    service.print_one(found, *_explanation_tables(found))


def report_of(
    services: Mapping[str, ServiceState],
    vehicles: Sequence[VehicleStatus],
    orders: Sequence[TransportOrderStatus],
    now: datetime,
    stops: Sequence[StopStatus] = (),
) -> StatusReport:
    """Return what runs and what needs a person."""
    known = {vehicle.name: vehicle for vehicle in vehicles}
    chains = vehicle_chains(known)
    behind = Counter(chain.head for chain in chains.values())
    stuck = sorted(
        (vehicle for vehicle in vehicles if _needs_a_person(vehicle)),
        key=lambda each: (-behind[each.name], vehicle_state(each) != VehicleState.ERROR, each.name),
    )
    circles = sorted({chain.circle for chain in chains.values() if chain.circle})
    return StatusReport(
        services={url: each.text for url, each in services.items()},
        vehicles=Counter(vehicle.state for vehicle in vehicles),
        waiting_vehicles=len(chains),
        orders=Counter(order.state for order in orders if not order.state.final),
        attention=(
            *(_of_service(url, each) for url, each in services.items() if not each.healthy),
            *map(_of_stop, stops),
            *(_of_vehicle(each, behind[each.name]) for each in stuck),
            *(
                Attention(
                    name=circle[0],
                    state="WAITING",
                    reason=_describe_circle(circle),
                    advice=_leave_circle(circle),
                )
                for circle in circles
            ),
            *(found for order in orders if (found := _of_order(order, now))),
        ),
    )


def explain_vehicle(name: str, fleet: Mapping[str, VehicleStatus]) -> Explanation:
    """Return why a vehicle waits, from the vehicle to the head of its queue; ``fleet`` contains it."""
    chains = vehicle_chains(fleet)
    names = chain_from(name, chains)
    chain = chains.get(name)
    steps = tuple(_vehicle_step(fleet[each]) for each in names if each in fleet)
    if chain and chain.circle:
        return Explanation(name=name, steps=steps, advice=_leave_circle(chain.circle))
    head = fleet.get(names[-1])
    return Explanation(name=name, steps=steps, advice=_advice_for(head) if head else "")


def explain_order(orders: Sequence[TransportOrderStatus], fleet: Mapping[str, VehicleStatus]) -> Explanation:
    """Return why the first order waits; each further one is what the order before it depends on."""
    last = orders[-1]
    steps = [Step(name=order.name, state=order.state, reason=order.reason) for order in orders]
    vehicle = last.processing_vehicle
    if last.held:
        advice = f"nena orders resume {last.name}"
    elif vehicle is not None and vehicle in fleet:
        found = explain_vehicle(vehicle, fleet)
        steps += found.steps
        advice = found.advice
    else:
        advice = ""
    return Explanation(name=orders[0].name, steps=tuple(steps), advice=advice)


def with_services(found: Explanation, services: Mapping[str, ServiceState]) -> Explanation:
    """Add order services that are not ready, such as without their broker: then everything waits for them."""
    troubled = [_of_service(url, each) for url, each in services.items() if not each.healthy]
    if not troubled:
        return found
    steps = (Step(name=each.name, state=each.state, reason=each.reason) for each in troubled)
    return Explanation(name=found.name, steps=(*found.steps, *steps), advice=troubled[0].advice)


def _explain_order(connection: Client, name: str, fleet: Mapping[str, VehicleStatus]) -> Explanation:
    """Read the order and the unfinished ones that it depends on; raises RefusedError."""
    orders = [connection.call(SHOW_ORDER, name)]
    while len(orders) < DEEPEST and not orders[-1].state.final:
        awaited = _first_unfinished(connection, orders[-1].dependencies)
        if awaited is None:
            break
        orders.append(awaited)
    return explain_order(orders, fleet)


def _first_unfinished(connection: Client, names: Sequence[str]) -> TransportOrderStatus | None:
    for name in names:
        try:
            order = connection.call(SHOW_ORDER, name)
        except RefusedError:
            continue  # deleted since
        if not order.state.final:
            return order
    return None


def _vehicle_step(vehicle: VehicleStatus) -> Step:
    state = vehicle_state(vehicle)
    reason = vehicle.wait.reason if vehicle.wait and state == "WAITING" else vehicle.reason
    told = (reason, *_of_safety(vehicle), *vehicle.errors)
    return Step(name=vehicle.name, state=state, reason="; ".join(filter(None, told)))


def _of_safety(vehicle: VehicleStatus) -> Iterator[str]:
    """Yield what keeps a robot where it stands, which its reason may not contain."""
    if vehicle.active_emergency_stop not in (None, "NONE"):
        yield f"emergency stop {vehicle.active_emergency_stop}"
    if vehicle.field_violation:
        yield "protective field violated"
    if vehicle.paused:
        yield "paused"
    if vehicle.localized is False:
        yield "not localised"


def _needs_a_person(vehicle: VehicleStatus) -> bool:
    if vehicle.connection == "HIBERNATING":
        return False
    return is_stuck(vehicle) or ReasonCode.PATH_LOCKED in _reason_codes(vehicle) or _is_empty(vehicle)


def _is_empty(vehicle: VehicleStatus) -> bool:
    """Return whether the battery of an idle vehicle is too low for orders."""
    return vehicle.state is VehicleState.IDLE and ReasonCode.MUST_RECHARGE in _reason_codes(vehicle)


def _reason_codes(vehicle: VehicleStatus) -> set[str]:
    """Return the codes of the reason of a vehicle, and of those that it contains."""
    found, left = set[str](), [*filter(None, (vehicle.coded_reason,))]
    while left:
        reason = left.pop()
        found.add(reason.code)
        left += reason.causes
    return found


def _of_stop(stop: StopStatus) -> Attention:
    where = "robots in an area are" if stop.area else "all robots are"
    reason = f"{where} paused by {stop.by}: {stop.reason}"
    return Attention(name=stop.name, state="STOPPED", reason=reason, advice=f"nena stops end {stop.name}")


def _of_service(url: str, found: ServiceState) -> Attention:
    advice = "Check the order service, its URL and its log."
    return Attention(name=url, state="NOT READY", reason=found.text, advice=advice)


def _of_vehicle(vehicle: VehicleStatus, behind: int) -> Attention:
    step = _vehicle_step(vehicle)
    return Attention(
        name=step.name,
        state=step.state,
        reason=step.reason,
        waiting_behind=behind,
        advice=_advice_for(vehicle),
    )


def _of_order(order: TransportOrderStatus, now: datetime) -> Attention | None:
    recent = order.finished is not None and now - order.finished <= RECENT
    if order.held:
        state, advice = "HELD", f"nena orders resume {order.name}"
    elif order.ended_as and order.ended_as.failure and recent:
        state, advice = order.ended_as.value, f"nena orders show {order.name}"
    elif order.late and not order.state.final:
        state, advice = "LATE", f"nena explain {order.name}"
    else:
        return None
    return Attention(name=order.name, state=state, reason=order.reason, advice=advice)


def _advice_for(vehicle: VehicleStatus) -> str:
    """Return what to do about a vehicle that stands; empty if it does not need a person."""
    advice = next((advice for applies, advice in ADVICE if applies(vehicle)), "")
    return advice.format(name=vehicle.name)


ADVICE: Final[tuple[tuple[Callable[[VehicleStatus], bool], str], ...]] = (
    (lambda each: each.connection in GONE, "Check the robot's power, its network and its edge agent."),
    (
        lambda each: each.connection == "UNKNOWN",
        "Start its edge agent; check broker, manufacturer, serial number and VDA 5050 version.",
    ),
    (lambda each: each.connection == "UNREADABLE", "Compare its messages with VDA 5050, as its reason says."),
    (lambda each: each.operating_mode not in CONTROLLED, "Switch the robot to AUTOMATIC."),
    (
        lambda each: each.active_emergency_stop not in (None, "NONE"),
        "Find out why it was triggered; reset it when everyone is safe.",
    ),
    (lambda each: each.taken_out, "Check the robot, then: nena vehicles level {name} TO_BE_UTILIZED"),
    (lambda each: each.localized is False, "Set its position in the control panel."),
    (is_stuck, "Go to the robot. Details: nena vehicles show {name}"),
    (
        lambda each: ReasonCode.PATH_LOCKED in _reason_codes(each),
        "Unlock the path in the control panel.",
    ),
    (_is_empty, "Take it to a charging station."),
)
"""What to do about a vehicle; the first that applies."""


def _describe_circle(names: Sequence[str]) -> str:
    return f"in a circle of waiting vehicles: {', '.join(names)}"


def _leave_circle(names: Sequence[str]) -> str:
    return f"nena vehicles reroute {names[0]} --forced"


def _status_tables(report: StatusReport) -> tuple[Table, ...]:
    rows = [
        *(("order service", f"{url}: {state}") for url, state in report.services.items()),
        ("vehicles", _count_by_state(report.vehicles, f"{report.waiting_vehicles} waiting for others")),
        ("open orders", _count_by_state(report.orders)),
    ]
    summary = Table(frame=False)
    for name, text in rows:
        summary.add_row(Text(name, style="dim"), Text(text))
    if not report.attention:
        summary.add_row(Text("needs attention", style="dim"), Text("nothing", style="green"))
        return (summary,)
    table = Table("needs attention", "state", "reason", "what to do", frame=False)
    for each in report.attention[:SHOWN]:
        behind = f" ({each.waiting_behind} wait behind it)" if each.waiting_behind else ""
        table.add_row(
            Text(each.name), _styled_state(each.state), Text(each.reason + behind), Text(each.advice)
        )
    if len(report.attention) > SHOWN:
        more = f"and {len(report.attention) - SHOWN} more"
        table.add_row(*map(Text, (more, "", "", "nena status -o json")))
    return summary, table


def _explanation_tables(found: Explanation) -> tuple[Table, ...]:
    steps = Table(frame=False)
    for depth, each in enumerate(found.steps):
        steps.add_row(Text("  " * depth + each.name), _styled_state(each.state), Text(each.reason))
    if found.advice:
        steps.add_row(Text("what to do", style="dim"), Text(""), Text(found.advice))
    return (steps,)


def _styled_state(state: str) -> Text:
    return Text(state, style=STYLES.get(state, ""))


def _count_by_state(by_state: Mapping[S, int], *more: str) -> str:
    """Return ``12: 8 EXECUTING, 4 IDLE``."""
    parts = (*(f"{by_state[state]} {state}" for state in sorted(by_state)), *more)
    total = sum(by_state.values())
    return f"{total}: {', '.join(parts)}" if total else "none"
