"""``nena status`` and ``nena explain``: what runs, what is wrong, why something waits, and what to do."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Annotated, Final, TypeVar

import typer
from rich.text import Text

from nena_cli.aggregator import DEFAULT_AGGREGATOR, Aggregator, check_answer, connect_aggregator
from nena_cli.output import REFUSED, WRONG
from nena_cli.service import Service, of_service
from nena_cli.styled import Table
from nena_cli.tables import STATE_STYLES, VEHICLE_STYLES, is_stuck, vehicle_chains, vehicle_state
from nena_client import Client, RefusedError, ServiceState, UnreachableError
from nena_shared.fleet_api.attention import AttentionList, Matter, MatterKind, advice_on
from nena_shared.fleet_api.base import Resource
from nena_shared.fleet_api.operations.fleet import SUMMARISE
from nena_shared.fleet_api.operations.orders import SHOW_ORDER
from nena_shared.fleet_api.operations.vehicles import LIST_VEHICLES
from nena_shared.fleet_api.reasons import ReasonCode
from nena_shared.fleet_api.requests import FleetSummary
from nena_shared.fleet_api.transport_order import TransportOrderState, TransportOrderStatus
from nena_shared.fleet_api.vehicle import VehicleState, VehicleStatus
from nena_shared.fleet_api.wait_chains import chain_from

SHOWN: Final = 20
"""Matters that are listed; the others are counted."""
DEEPEST: Final = 20
"""Dependencies followed from one order to the next."""
GONE: Final = ("OFFLINE", "CONNECTION_BROKEN", "SILENT")
CONTROLLED: Final = (None, "AUTOMATIC", "SEMIAUTOMATIC")
"""Operating modes in which fleet control commands a robot (VDA 5050 6.10.6; None: not reported)."""
STYLES: Final[dict[str, str]] = {
    **{each.value: style for each, style in STATE_STYLES.items()},
    **{str(each): style for each, style in VEHICLE_STYLES.items()},
    "NOT READY": "red",
}

S = TypeVar("S", TransportOrderState, VehicleState)


class StatusReport(Resource):
    """What ``nena status`` reports."""

    services: dict[str, str]
    """State of the order service at each URL."""
    vehicles: dict[VehicleState, int] | None
    """Number by state; None: no order service is ready."""
    orders: dict[TransportOrderState, int] | None
    """Number of unfinished orders by state."""
    attention: tuple[Matter, ...]
    """What needs a person, in the order of the panel."""


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
def status(service: Service, *, aggregator: Aggregator = DEFAULT_AGGREGATOR) -> None:
    """Show what runs, what needs a person and what to do.

    The exit status is 1 if something needs a person and nobody has acknowledged it, 2 if the aggregator or an
    order service does not answer or is not ready.
    """
    with connect_aggregator(service, aggregator) as client:
        answer = client.get("/api/v1/attention")
        check_answer(answer, WRONG)
        found = AttentionList.model_validate_json(answer.content)
    counts: FleetSummary | None = None
    with service.opened() as connection:
        services = connection.readiness()
        if any(each.healthy for each in services.values()):  # a hung one is waited for once
            with suppress(RefusedError, UnreachableError):
                counts = connection.call(SUMMARISE)
    report = StatusReport(
        services={url: each.text for url, each in services.items()},
        vehicles=counts.vehicles if counts else None,
        orders=counts.transport_orders if counts else None,
        attention=found.attention,
    )
    service.print_one(report, *_status_tables(report))
    if found.unacknowledged:
        raise typer.Exit(REFUSED)
    if not all(each.healthy for each in services.values()):
        raise typer.Exit(WRONG)


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


def explain_vehicle(name: str, fleet: Mapping[str, VehicleStatus]) -> Explanation:
    """Return why a vehicle waits, from the vehicle to the head of its queue; ``fleet`` contains it."""
    chains = vehicle_chains(fleet)
    names = chain_from(name, chains)
    chain = chains.get(name)
    steps = tuple(_vehicle_step(fleet[each]) for each in names if each in fleet)
    if chain and chain.circle:
        advice = advice_on(MatterKind.CIRCLE, chain.circle[0])
        return Explanation(name=name, steps=steps, advice=advice)
    head = fleet.get(names[-1])
    return Explanation(name=name, steps=steps, advice=_advice_for(head) if head else "")


def explain_order(orders: Sequence[TransportOrderStatus], fleet: Mapping[str, VehicleStatus]) -> Explanation:
    """Return why the first order waits; each further one is what the order before it depends on."""
    last = orders[-1]
    steps = [Step(name=order.name, state=order.state, reason=order.reason) for order in orders]
    vehicle = last.processing_vehicle
    if last.held:
        advice = advice_on(MatterKind.ORDER_HELD, last.name)
    elif vehicle is not None and vehicle in fleet:
        found = explain_vehicle(vehicle, fleet)
        steps += found.steps
        advice = found.advice
    else:
        advice = ""
    return Explanation(name=orders[0].name, steps=tuple(steps), advice=advice)


def with_services(found: Explanation, services: Mapping[str, ServiceState]) -> Explanation:
    """Add order services that are not ready, such as without their broker: then everything waits for them."""
    troubled = {url: each.text for url, each in services.items() if not each.healthy}
    if not troubled:
        return found
    steps = (Step(name=url, state="NOT READY", reason=text) for url, text in troubled.items())
    advice = advice_on(MatterKind.ORDER_SERVICE_DOWN, "")
    return Explanation(name=found.name, steps=(*found.steps, *steps), advice=advice)


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


def _advice_for(vehicle: VehicleStatus) -> str:
    """Return what to do about a vehicle that stands; empty if it does not need a person."""
    if vehicle.connection == "UNKNOWN":
        return "Start its edge agent; check broker, manufacturer, serial number and VDA 5050 version."
    kind = next((kind for applies, kind in HINDRANCES if applies(vehicle)), None)
    if kind:
        return advice_on(kind, vehicle.name)
    return f"Go to the robot. Details: nena vehicles show {vehicle.name}" if is_stuck(vehicle) else ""


HINDRANCES: Final[tuple[tuple[Callable[[VehicleStatus], bool], MatterKind], ...]] = (
    (lambda each: each.connection in GONE, MatterKind.ROBOT_LOST),
    (lambda each: each.connection == "UNREADABLE", MatterKind.ROBOT_UNREADABLE),
    (lambda each: each.operating_mode not in CONTROLLED, MatterKind.NOT_AUTOMATIC),
    (lambda each: each.active_emergency_stop not in (None, "NONE"), MatterKind.EMERGENCY_STOP),
    (lambda each: each.taken_out, MatterKind.TAKEN_OUT),
    (lambda each: each.localized is False, MatterKind.NOT_LOCALIZED),
    (
        lambda each: not is_stuck(each) and ReasonCode.PATH_LOCKED in _reason_codes(each),
        MatterKind.PATH_LOCKED,
    ),
    (lambda each: not is_stuck(each) and _is_empty(each), MatterKind.BATTERY_LOW),
)
"""Why a vehicle stands; the first that applies."""


def _status_tables(report: StatusReport) -> tuple[Table, ...]:
    summary = Table(frame=False)
    for url, state in report.services.items():
        summary.add_row(Text("order service", style="dim"), f"{url}: {state}")
    if report.vehicles is not None and report.orders is not None:
        summary.add_row(Text("vehicles", style="dim"), _count_by_state(report.vehicles))
        summary.add_row(Text("open orders", style="dim"), _count_by_state(report.orders))
    if not report.attention:
        summary.add_row(Text("needs attention", style="dim"), Text("nothing", style="green"))
        return (summary,)
    table = Table("needs attention", "name", "since", "reason", "what to do", frame=False)
    for each in report.attention[:SHOWN]:
        style = "dim" if each.acknowledged else "red" if each.urgent else "yellow"
        since = f"{each.since.astimezone():%d %b %H:%M}"
        kind = Text(each.kind.replace("_", " "), style=style)
        table.add_row(kind, each.subject, since, _reason_of(each), each.advice)
    if len(report.attention) > SHOWN:
        more = f"and {len(report.attention) - SHOWN} more"
        table.add_row(more, "", "", "", "nena status -o json")
    return summary, table


def _reason_of(matter: Matter) -> str:
    """Return what it is, what it holds up, and who has acknowledged it."""
    held = ((matter.robot_count, "robots"), (matter.order_count, "orders"))
    holds = ", ".join(f"{count} {what if count > 1 else what[:-1]}" for count, what in held if count)
    seen = f"acknowledged by {matter.acknowledged.by}" if matter.acknowledged else ""
    more = "; ".join(filter(None, (holds and f"holds up {holds}", seen)))
    return f"{matter.reason} ({more})" if more else matter.reason


def _explanation_tables(found: Explanation) -> tuple[Table, ...]:
    steps = Table(frame=False)
    for depth, each in enumerate(found.steps):
        steps.add_row("  " * depth + each.name, _styled_state(each.state), each.reason)
    if found.advice:
        steps.add_row(Text("what to do", style="dim"), "", found.advice)
    return (steps,)


def _styled_state(state: str) -> Text:
    return Text(state, style=STYLES.get(state, ""))


def _count_by_state(by_state: Mapping[S, int]) -> str:
    """Return ``12: 8 EXECUTING, 4 IDLE``."""
    parts = ", ".join(f"{by_state[state]} {state}" for state in sorted(by_state))
    return f"{sum(by_state.values())}: {parts}" if parts else "none"
