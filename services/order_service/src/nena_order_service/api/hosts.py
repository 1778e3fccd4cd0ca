"""What serves hosts: the operations of each noun, and those on the fleet as a whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from nena_order_service.api.audit import Trail
from nena_order_service.api.operations import Handler
from nena_order_service.api.orders import OrderOperations
from nena_order_service.api.peripherals import PeripheralOperations
from nena_order_service.api.plant import PlantOperations
from nena_order_service.api.sequences import SequenceOperations
from nena_order_service.api.stops import StopOperations
from nena_order_service.api.vehicles import VehicleOperations
from nena_order_service.api.zone_sets import zone_set_handlers
from nena_order_service.engine.engine import Engine
from nena_order_service.engine.path_locks import PathLocks
from nena_order_service.engine.zone_sets import ZoneSets
from nena_shared.fleet_api.operations import fleet as table
from nena_shared.fleet_api.requests import FleetSummary


class HostServices:
    """The operations of each noun, and the services behind them."""

    def __init__(self, engine: Engine, zones: ZoneSets) -> None:
        self._engine = engine
        self.zones = zones
        self.trail = Trail()
        self.locks = PathLocks(engine)
        self.orders = OrderOperations(engine)
        self.sequences = SequenceOperations(engine)
        self.vehicles = VehicleOperations(engine, self.orders)
        self.plant = PlantOperations(engine, self.locks)
        self.stops = StopOperations(engine)
        self.peripherals = PeripheralOperations(engine)

    async def load(self) -> None:
        """Restore what hosts have uploaded to the store."""
        await self._engine.load_stops()
        await self.locks.load()
        await self.zones.load()

    def handlers(self) -> Iterator[Handler]:
        """Yield what executes each operation."""
        yield from self.orders.handlers()
        yield from self.sequences.handlers()
        yield from self.vehicles.handlers()
        yield from self.plant.handlers()
        yield from zone_set_handlers(self.zones)
        yield from self.stops.handlers()
        yield from self.peripherals.handlers()
        yield Handler(table.SUMMARISE, self._summarise_fleet)
        yield Handler(table.SHOW_TRAFFIC_PLAN, self._engine.traffic_plans.current_plan)

    def _summarise_fleet(self) -> FleetSummary:
        """Return the numbers of unfinished orders and of vehicles in each state."""
        orders = list(self._engine.state.orders.unfinished())
        oldest = min(orders, key=lambda order: order.number, default=None)
        return FleetSummary(
            transport_orders=Counter(order.state for order in orders),
            vehicles=Counter(vehicle.state for vehicle in self.vehicles.iterate_statuses()),
            oldest_order=oldest.name if oldest else None,
        )
