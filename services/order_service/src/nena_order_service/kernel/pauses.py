"""Orders that vehicles have, and for which these are sent nothing for now."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from nena_order_service.fleet import LinkStatus, NotLocatedError, RobotView
from nena_order_service.kernel.missions import MissionPlanner
from nena_order_service.kernel.order_book import OrderBook
from nena_order_service.kernel.vehicles import FleetVehicle
from nena_order_service.orders.transport_order import TransportOrder
from nena_shared.clock import Clock


class Pauses:
    """Knows which vehicles stand with an order, until they can go on.

    A person holds it, it is tried again later, nobody knows where the vehicle is, or locks of paths close its
    way. The vehicle keeps its place meanwhile: nobody sends it away.
    """

    def __init__(
        self,
        book: OrderBook,
        planner: MissionPlanner,
        view: Callable[[FleetVehicle], RobotView],
        clock: Clock,
    ) -> None:
        self._book = book
        self._planner = planner
        self._view = view
        self._clock = clock
        self._orders: dict[str, int] = {}

    def __contains__(self, vehicle: str) -> bool:
        """Tell whether the vehicle of this name stands with an order."""
        return vehicle in self._orders

    def __iter__(self) -> Iterator[tuple[str, TransportOrder]]:
        """Yield the vehicles' names and their orders."""
        return iter([(vehicle, self._book.get(number)) for vehicle, number in self._orders.items()])

    def begin(self, vehicle: FleetVehicle, order: TransportOrder) -> None:
        """Let a vehicle stand with its order, until :meth:`end`."""
        self._orders[vehicle.name] = order.number

    def end(self, vehicle: str) -> None:
        """Let the vehicle of this name go on, or be without an order."""
        self._orders.pop(vehicle, None)

    def is_over(self, vehicle: FleetVehicle) -> bool:
        """Tell whether a vehicle can go on with its order."""
        return not self._book.get(self._orders[vehicle.name]).held and not self.why(vehicle)

    def why(self, vehicle: FleetVehicle) -> str:
        """Say why a vehicle cannot go on; empty for nothing, or where the order itself says who holds it."""
        order = self._book.get(self._orders[vehicle.name])
        status = order.status
        if status.held:
            return ""
        if status.next_try and self._clock.now() < status.next_try:
            return f"it is tried again at {status.next_try:%H:%M:%S} UTC"
        view = self._view(vehicle)
        try:
            standing = self._planner.standing(vehicle, view)
        except NotLocatedError as error:
            away = view.state is None or view.link is not LinkStatus.ONLINE
            return f"the robot {view.availability.reason}" if away else str(error)
        return self._planner.locked_out(order, vehicle, standing)
