"""Build the engine and fleet control from the settings, for the order service and for simulations."""

from __future__ import annotations

from collections.abc import Callable

from nena_order_service.engine.context import Context
from nena_order_service.engine.engine import Engine
from nena_order_service.fleet.link import FleetLink, HeaderIds, RobotAddresses
from nena_order_service.fleet.vda_order import OperationMap
from nena_order_service.orders.vda_orders import OrderPlanner
from nena_order_service.routing.graph import cost_evaluators
from nena_order_service.routing.router import RouteFinder, Router
from nena_order_service.settings import OrderServiceSettings
from nena_order_service.store.store import Store
from nena_order_service.vehicles.registry import VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.mqtt import BrokerLink
from nena_shared.plant import PlantModel
from nena_shared.vda5050.message_reader import MessageReader
from nena_shared.vda5050.topics import TopicScheme


def make_engine(settings: OrderServiceSettings, plant: PlantModel, store: Store, clock: Clock) -> Engine:
    """Build the engine over ``store``."""
    router = Router(plant, cost_evaluators(settings.routing.costs, plant))
    without_host_locks = Router(plant, cost_evaluators(settings.routing.costs, plant))
    operations = OperationMap(settings.engine.action_types)
    finder = RouteFinder(
        plant, router, without_host_locks=without_host_locks, action_type=operations.action_type
    )
    planner = OrderPlanner(
        plant,
        finder,
        operations,
        speed_limits=settings.engine.speed_limits,
        peripherals=settings.engine.peripherals.enabled,
    )
    registry = VehicleRegistry(
        plant,
        default_map_id=settings.engine.default_map_id,
        adopt_unknown=settings.engine.adopt_unknown,
        max_distance=settings.engine.max_distance_to_point,
    )
    context = Context(planner, registry, settings.engine, clock, on_failure=settings.orders.on_failure)
    return Engine(context, store)


def make_fleet(
    settings: OrderServiceSettings,
    mqtt: BrokerLink,
    engine: Engine,
    clock: Clock,
    *,
    epoch: int = 0,
    header_ids: HeaderIds | None = None,
    make_reader: Callable[..., MessageReader] = MessageReader,
) -> FleetLink:
    """Build fleet control over the link ``mqtt``.

    Raises:
        ConfigurationError: the plant model names an unsupported version.
    """
    addresses = RobotAddresses(
        [TopicScheme(settings.interface_name, "v2"), TopicScheme(settings.interface_name_v3, "v3")]
    )
    addresses.expect_vehicles((vehicle.key, vehicle.model) for vehicle in engine.registry if vehicle.model)
    return FleetLink(
        mqtt,
        addresses=addresses,
        settings=settings.fleet,
        clock=clock,
        on_events=engine.on_events,
        epoch=epoch,
        header_ids=header_ids,
        only_map=engine.plant.only_map(settings.engine.default_map_id),
        nodes=engine.plant.points_by_name,
        make_reader=make_reader,
    )
