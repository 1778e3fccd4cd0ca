"""Why an order is not done by each of the vehicles, one by one."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from math import inf

from nena_order_service.dispatch.dispatcher import NOBODY, Knowledge
from nena_order_service.dispatch.vehicle import DispatchedVehicle
from nena_order_service.orders.transport_order import TransportOrder

COULD = "could do it now"


@dataclass(frozen=True, slots=True)
class VehicleFit:
    """What is between one order and one vehicle."""

    vehicle: str
    fits: bool
    """Whether the vehicle could do it now."""
    reason: str
    """Why not, as a predicate; or that it could."""
    cost: float | None = None
    """Of its way, in the router's unit, where it could."""


def explain(
    order: TransportOrder,
    vehicles: Iterable[DispatchedVehicle],
    knowledge: Knowledge,
    *,
    kept: Mapping[int, str] = NOBODY,
) -> list[VehicleFit]:
    """Say of each vehicle why it does not get this order, or that it could; the best ones first."""
    found = [_fit(order, each, knowledge, kept.get(order.number)) for each in vehicles]
    return sorted(found, key=lambda each: (not each.fits, each.cost or 0.0, each.vehicle))


def _fit(
    order: TransportOrder, vehicle: DispatchedVehicle, knowledge: Knowledge, kept: str | None
) -> VehicleFit:
    if order.vehicle == vehicle.name and not order.state.final:
        return VehicleFit(vehicle.name, fits=True, reason="does it")
    intended = order.status.intended_vehicle
    for wanted, why in (
        (kept, f"is not {kept!r}, which is kept for it"),
        (intended, f"is not {intended!r}, which it is for"),
    ):
        if wanted not in (None, vehicle.name):
            return VehicleFit(vehicle.name, fits=False, reason=why)
    recharges, pick = knowledge.recharges(order), knowledge.pick(order)
    reason = knowledge.misfit(order, vehicle.name) or vehicle.why_not(order, recharges=recharges, pick=pick)
    if reason:
        return VehicleFit(vehicle.name, fits=False, reason=reason)
    cost = knowledge.cost(order, vehicle.name).complete
    if cost == inf:
        return VehicleFit(
            vehicle.name, fits=False, reason=f"has no way: {knowledge.why_no_way(order, vehicle.name)}"
        )
    return VehicleFit(vehicle.name, fits=True, reason=COULD, cost=cost)
