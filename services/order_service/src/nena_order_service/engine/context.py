"""The context of the engine's flows: plant, state, traffic, fleet control, settings and clock."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

from pydantic import Field

from nena_order_service.dispatching.settings import DispatchSettings
from nena_order_service.engine.state import FleetState
from nena_order_service.fleet.robot import RobotView
from nena_order_service.fleet.vda_order import VdaOrder
from nena_order_service.orders.vda_orders import OrderPlanner
from nena_order_service.peripherals.settings import PeripheralSettings
from nena_order_service.routing.router import RouteFinder, VehicleRoutes
from nena_order_service.traffic.manager import TrafficManager
from nena_order_service.traffic.resources import Resources
from nena_order_service.vehicles.registry import FleetVehicle, VehicleRegistry
from nena_shared.clock import Clock
from nena_shared.fleet_api.stops import SetBy
from nena_shared.fleet_api.transport_order import FailurePolicy
from nena_shared.plant import PlantModel
from nena_shared.settings import SettingsGroup
from nena_shared.vda5050.action import Action
from nena_shared.vda5050.topics import RobotKey


class EngineSettings(SettingsGroup):
    """Handling of orders and vehicles."""

    adopt_unknown: bool = Field(
        default=False,
        description="Dispatch robots that are connected but not in the plant model.",
    )
    default_map_id: str = Field(
        "",
        description="Map of vehicles without one in the plant model. Empty: the map that the robot reports.",
    )
    max_distance_to_point: float | None = Field(
        None,
        gt=0,
        description="Distance from the nearest point beyond which a vehicle's position counts as wrong, m: "
        "it gets no orders and no more base, unless an order has sent it to a coordinate. Unset: twice the "
        "longest path of the plant, at least 5 m.",
    )
    release_ahead: int = Field(
        0,
        ge=0,
        le=1000,
        description="Nodes released ahead of a robot (preventive: without a connection it stops after "
        "them); the rest is horizon. 0: as far as `release_seconds` allows.",
    )
    release_seconds: float = Field(
        1.0,
        ge=0,
        description="With `release_ahead` 0, a robot's base extends beyond its next node by the distance "
        "that it drives in this time at full speed; the rest is horizon. Raise it for robots that take "
        "longer to brake: they slow down before their next node. 0: everything that can be allocated "
        "(assertive).",
    )
    restart_patience: float = Field(
        30.0,
        ge=0,
        description="Time after the start to wait for the first state of each vehicle that is not offline, "
        "and whose place is not known from before, seconds; then the others drive, and missing robots keep "
        "their resources. VDA 5050 requires a state every 30 s.",
    )
    traffic: bool = Field(
        default=True,
        description="Allocate points, paths and blocks to one robot at a time. false: no traffic control; "
        "robots must avoid each other.",
    )
    speed_limits: bool = Field(
        default=True,
        description="Send robots the speed limits of the plant model (edges.maximumSpeed) if their "
        "factsheets list this field. false: robots drive at their own speed.",
    )
    dispatch: DispatchSettings = Field(
        default_factory=DispatchSettings, description="Dispatching: which vehicle gets which order."
    )
    peripherals: PeripheralSettings = Field(
        default_factory=PeripheralSettings, description="Peripheral devices, such as doors and lifts."
    )
    action_types: dict[str, str] = Field(
        default_factory=dict,
        description="VDA 5050 action types by plant operation; extends the built-in table.",
    )
    commit_timeout: float = Field(10.0, gt=0, description="Timeout for committing a request, seconds.")
    instant_action_timeout: float = Field(
        10.0, gt=0, description="Timeout for the end of an instant action, seconds."
    )


class FleetControl(Protocol):
    """Fleet control as the engine uses it; it reports events to the engine's ``on_events``."""

    def start_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """Send a VDA order (section 6.1.1); raises RobotBusyError."""
        ...

    def adopt_vda_order(
        self, robot: RobotKey, vda_order: VdaOrder, *, accepted: bool, update_id: int = 0
    ) -> None:
        """Restore a VDA order after a restart; raises RobotBusyError."""
        ...

    def extend_vda_order(self, robot: RobotKey, vda_order: VdaOrder) -> None:
        """Send an order update (section 6.1.2); raises BaseChangedError."""
        ...

    def release_base(self, robot: RobotKey, order_id: str, sequence_id: int | None) -> None:
        """Send an order update that only extends the base, to this node; None: to the end (section 6.1.2)."""
        ...

    def cancel_vda_order(self, robot: RobotKey) -> None:
        """Cancel the robot's VDA order (section 6.1.3)."""
        ...

    def instant_action(self, robot: RobotKey, action: Action) -> None:
        """Send an instant action (section 6.2.1)."""
        ...

    def all_known(self) -> bool:
        """Return whether every robot that is connected, according to the broker, has reported its state."""
        ...

    def connected_for(self) -> float:
        """Return how long the link to the broker has been up, seconds; 0 while it is down."""
        ...

    def view(self, robot: RobotKey) -> RobotView:
        """Return the known state of a robot."""
        ...


class LockedPaths:
    """Paths that hosts have locked or unlocked, and those in areas of stops, which are locked anyway."""

    def __init__(self, finder: RouteFinder, resources: Resources, plant: PlantModel) -> None:
        """Start with the locks of the plant model."""
        self.by_hosts: Mapping[str, bool] = {}
        self.by_stops: Mapping[str, str] = {}
        """The names of the stops, by path."""
        self.locked_by: dict[str, SetBy] = {}
        """The hosts that have locked paths, by path."""
        self._finder = finder
        self._resources = resources
        self._plant = plant

    def locked_by_hosts(self) -> dict[str, SetBy | None]:
        """Return the paths that hosts have locked, with who did it, not those that the plant model locks."""
        in_plant = self._plant.paths_by_name
        names = (name for name, locked in self.by_hosts.items() if locked and not in_plant[name].locked)
        return {name: self.locked_by.get(name) for name in names}

    def lock(
        self, *, by_hosts: Mapping[str, bool] | None = None, by_stops: Mapping[str, str] | None = None
    ) -> None:
        """Replace the locks of hosts or stops, before any vehicle is granted more of its route."""
        self.by_hosts = self.by_hosts if by_hosts is None else by_hosts
        self.by_stops = self.by_stops if by_stops is None else by_stops
        # A stop in an area outlasts what hosts unlock: people may be in it.
        self._finder.set_locks(self.by_hosts, self.by_stops)
        self._resources.set_locks({**self.by_hosts, **dict.fromkeys(self.by_stops, True)})


class Context:
    """The state, and everything that the flows need to change it."""

    def __init__(
        self,
        planner: OrderPlanner,
        registry: VehicleRegistry,
        settings: EngineSettings,
        clock: Clock,
        *,
        on_failure: FailurePolicy = (),
    ) -> None:
        """``on_failure`` is the failure policy of orders that have none of their own."""
        self.planner = planner
        self.finder = planner.finder
        self.plant = planner.plant
        self.registry = registry
        self.settings = settings
        self.on_failure = on_failure
        self.clock = clock
        self.state = FleetState(registry)
        self.routes = VehicleRoutes(planner.finder.router, registry.model)
        self.traffic = TrafficManager(
            planner.plant,
            self.routes,
            exclusive=settings.traffic,
            peripherals=settings.peripherals.enabled,
        )
        self.locked_paths = LockedPaths(self.finder, self.traffic.resources, planner.plant)
        self._fleet: FleetControl | None = None

    def connect(self, fleet: FleetControl) -> None:
        """Connect fleet control."""
        self._fleet = fleet

    @property
    def fleet(self) -> FleetControl:
        """Fleet control; raises RuntimeError before :meth:`connect`."""
        if self._fleet is None:
            raise RuntimeError("fleet control is not connected yet")
        return self._fleet

    def view(self, vehicle: FleetVehicle) -> RobotView:
        """Return the known state of a vehicle's robot."""
        return self.fleet.view(vehicle.key)
